"""All transformers of joint positions: invariances of the features, and refusals."""

import numpy as np
import pandas as pd
import pytest
from sklearn import clone
from sklearn_motionsync import DirectionCosines, JointPositions, Skeleton, to_frame
from sklearn_motionsync.datasets import make_bending

from made_bodies import moved, standing, turned, turned_over

PAPER = Skeleton.paper()
NAMES = PAPER.column_names
KINDS = [
    *((DirectionCosines, reference) for reference in ("heading", "parent", "world")),
    *((JointPositions, reference) for reference in ("heading", "world")),
]


@pytest.fixture(params=KINDS, ids=lambda kind: f"{kind[0].__name__} {kind[1]}")
def made(request):
    """The transformer of a skeleton; by default the paper's."""
    kind, reference = request.param
    return lambda skeleton=PAPER: kind(skeleton, reference)


@pytest.fixture(scope="module")
def recording():
    return make_bending(1, random_state=1).data[0]


def test_features_are_invariant_to_place_and_size(made, recording):
    expected = made().fit_transform([recording])[0]
    for changed in (moved(recording, [3.0, -7.0, 2.0]), 1.3 * recording, 1e-8 * recording):
        np.testing.assert_allclose(made().fit_transform([changed])[0], expected, atol=1e-9)
    single = made().fit_transform([(1e8 * recording).astype("f4")])[0]
    assert single.dtype == "f4"
    np.testing.assert_allclose(single, expected, atol=1e-5)


@pytest.mark.parametrize("degrees", [30, 179, -135])
def test_features_are_invariant_to_heading_unless_world(made, degrees, recording):
    straight, other = made().fit_transform([recording, turned(recording, degrees)])
    assert np.allclose(straight, other, atol=1e-9) is (made().reference != "world")


@pytest.mark.parametrize("factor", [1, 1 + 2e-16])
def test_limb_without_length_is_refused(made, recording, factor):
    """Nor do joints that coincide except for the last digit give a direction."""
    message = r"Trial 1, frame 7: the limb 'left_leg' has no length"
    faulty = [recording, moved(recording, [7.0, 0.0, 0.0])]
    knee, ankle = (3 * PAPER.index_of(f"left_{joint}") for joint in ("knee", "ankle"))
    faulty[1][7, ankle : ankle + 3] = factor * faulty[1][7, knee : knee + 3]
    for ask in (made().fit, made().fit_transform, made().fit([recording]).transform):
        with pytest.raises(ValueError, match=message):
            ask(faulty)


def test_vertical_hips_give_finite_features(made):
    lying = standing(left_hip=(0, 1.1, 0), right_hip=(0, 0.9, 0))
    assert np.isfinite(made().fit_transform(lying)).all()


def test_wrong_width_is_refused(made):
    with pytest.raises(ValueError, match="31 joints need 93"):
        made(Skeleton.acclaim()).fit([np.zeros((4, 45))])


# -- which way is up ----------------------------------------------------------------------


def test_random_points_are_not_taken_for_a_body_upside_down(made):
    rng = np.random.default_rng(0)
    walks = list(np.cumsum(rng.standard_normal((200, 30, 45)), axis=1))
    made().fit(walks + [-x for x in walks])


def test_lying_and_handstands_are_accepted(made, recording):
    lying = recording.reshape(-1, 15, 3)[..., [0, 2, 1]].reshape(recording.shape)
    handstand = recording.copy()
    half = len(recording) // 2
    handstand[half:] = turned_over(recording[half:])
    assert len(made().fit_transform([lying, turned_over(lying), handstand])) == 3


# -- names of columns ---------------------------------------------------------------------


def test_wrong_order_of_columns_is_refused(made, recording):
    estimator, table = made(), pd.DataFrame(recording, columns=NAMES)
    swapped = table[[*NAMES[3:], *NAMES[:3]]]
    half = swapped.set_axis([*swapped.columns[:20], *map(str, range(25))], axis=1)
    message = r"column 0 is 'neck_x', where the skeleton has 'pelvis_x'.*df\[skeleton.column_names"
    for wrong in (swapped, half, [swapped] * 2, to_frame([swapped])):
        with pytest.raises(ValueError, match=message):
            clone(estimator).fit(wrong)
    # Also after a fit without names.
    estimator.fit([recording])
    with pytest.warns(UserWarning, match="fitted without feature names"):  # noqa: SIM117
        with pytest.raises(ValueError, match=message):
            estimator.transform([swapped])


def test_other_column_names_are_accepted(made, recording):
    expected = made().fit_transform(recording)
    for names in (NAMES, [f"marker {i}" for i in range(45)], range(45)):
        given = pd.DataFrame(recording, columns=names)
        np.testing.assert_array_equal(made().fit_transform(given), expected)
