"""The vertical axis: any of six, given or estimated from the positions, and checked."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import DirectionCosines, JointPositions, Skeleton
from sklearn_motionsync.datasets import load_trials, make_bending

from made_bodies import columns_of, standing, turned_over

PAPER = Skeleton.paper()
UPS = ["x", "y", "z", "-x", "-y", "-z"]
LEGS = ["pelvis", *(f"{s}_{j}" for s in ("left", "right") for j in ("hip", "knee", "ankle"))]
TRUNK = ["pelvis", "neck", "head", "left_shoulder", "right_shoulder"]
KINDS = [
    *((DirectionCosines, reference) for reference in ("heading", "parent", "world")),
    *((JointPositions, reference) for reference in ("heading", "world")),
]


def with_up(up, skeleton=PAPER, landmarks=None):
    landmarks = skeleton.landmarks if landmarks is None else {j: j for j in landmarks}
    return Skeleton(skeleton.joints, skeleton.parents, landmarks, up, skeleton.n_dims)


def raised(x, up, seed=0):
    """Positions rotated so that y becomes another axis; the angle about it is random."""
    rng = np.random.default_rng(seed)
    y = np.eye(3)["xyz".index(up[-1])] * (-1 if up[0] == "-" else 1)
    side = rng.normal(size=3)
    side -= (side @ y) * y
    side /= np.linalg.norm(side)
    turn = np.stack([side, y, np.cross(side, y)])
    assert np.linalg.det(turn) > 0
    return (x.reshape(-1, 3) @ turn).reshape(x.shape)


@pytest.fixture(scope="module")
def recording():
    return make_bending(1, random_state=1).data[0]


@pytest.mark.parametrize(
    ("up", "kind", "reference"),
    [
        *((up, DirectionCosines, "heading") for up in UPS),
        *((up, JointPositions, "world") for up in UPS),
        *(("-z", kind, reference) for kind, reference in KINDS),
    ],
)
def test_features_do_not_depend_on_the_vertical_axis(kind, reference, up, recording):
    made = kind(with_up(up), reference)
    expected = kind(PAPER, reference).fit_transform(recording)
    if reference != "world":
        found = made.fit_transform(raised(recording, up))
        np.testing.assert_allclose(found, expected, atol=1e-9)
    # Of the recording's axes one is turned into another: a body is not mirrored.
    at = made.fit_transform([raised(recording, up, seed) for seed in (0, 1)])[0]
    parts = {DirectionCosines: "hip torso left_thigh", JointPositions: "left_hip neck left_knee"}
    names = list(made.get_feature_names_out())
    triad = [names.index(f"{part}_{axis}") for part in parts[kind].split() for axis in "xyz"]
    chirality = [np.linalg.det(x[:, triad].reshape(-1, 3, 3)) for x in (at, expected)]
    np.testing.assert_allclose(chirality[0], chirality[1], atol=1e-9)


@pytest.mark.parametrize(
    ("up", "recorded"),
    [
        ("z", lambda x, y, z: (x, -z, y)),
        ("-y", lambda x, y, z: (x, -y, -z)),
        ("-z", lambda x, y, z: (x, z, -y)),
    ],
)
def test_axes_of_the_recording_are_rotated_about_x(up, recorded, recording):
    given = np.stack(recorded(*np.moveaxis(recording.reshape(-1, 15, 3), 2, 0)), axis=2)
    for kind in (DirectionCosines, JointPositions):
        found = kind(with_up(up), "world").fit_transform(given.reshape(recording.shape))
        np.testing.assert_array_equal(found, kind(PAPER, "world").fit_transform(recording))


# -- estimated from the positions ---------------------------------------------------------


@pytest.mark.parametrize(
    ("up", "joints"), [*((up, None) for up in UPS), ("-x", LEGS), ("z", TRUNK)]
)
def test_up_is_estimated_unless_given(up, joints, recording):
    df = columns_of(raised(recording, up))
    if joints:
        df = df[[f"{j}_{a}" for j in joints for a in "xyz"]]
    assert Skeleton.from_frame(df).up == up
    # What is given, or what the file says, goes first.
    assert Skeleton.from_frame(df, up="x").up == "x"
    df.attrs["up"] = "-z"
    assert Skeleton.from_frame(df).up == "-z"
    df.attrs["up"] = None
    df.iloc[3:9] = np.nan
    assert Skeleton.from_frame(df).up == up


@pytest.mark.parametrize("name", ["hdm05/hdm05", "utkinect/utkinect", "cmu07_walk/cmu07_walk"])
def test_up_of_people_is_estimated_and_that_of_upper_bodies_right_or_in_doubt(real_data, name):
    bunch = load_trials(real_data / f"{name}_positions.npz")
    arms = [f"{side}_{part}" for side in ("left", "right") for part in ("shoulder", "wrist")]
    given = dict.fromkeys(PAPER.joints)
    given |= {at: bunch.skeleton.landmarks[at] for at in ("pelvis", "neck", "head", *arms)}
    right = 0
    X = bunch.data[::6]
    for x in X:
        assert Skeleton.from_frame(columns_of(x, bunch.skeleton), landmarks=given).up == "y"
        df = columns_of(raised(x.astype(float), "-z"), bunch.skeleton)
        assert Skeleton.from_frame(df).up == "-z"
        right += Skeleton.from_frame(df, landmarks=given).up == "-z"
    assert right > 0.85 * len(X)


def test_up_is_y_in_doubt():
    for values in (0.0, np.nan, "a"):
        df = pd.DataFrame(values, index=range(3), columns=PAPER.column_names)
        assert Skeleton.from_frame(df).up == "y"
    aslant = columns_of(standing() @ np.kron(np.eye(15), np.full((3, 3), 3**-0.5)))
    assert Skeleton.from_frame(aslant.filter(regex="elbow|wrist")).up == "y"


# -- checked ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("up", "landmarks"), [*((up, None) for up in UPS), ("-x", LEGS), ("z", TRUNK)]
)
def test_body_upside_down_is_refused_for_any_axis(up, landmarks, recording):
    other = up[1:] if up.startswith("-") else f"-{up}"
    message = rf"says that '{up}' is up, but '{other}' seems to be\. .*up='{other}'"
    for kind in (DirectionCosines, JointPositions):
        with pytest.raises(ValueError, match=f"Trial 1 is upside down: .*{message}"):
            kind(with_up(up, landmarks=landmarks)).fit(
                [raised(recording, up), raised(recording, other)]
            )
        kind(with_up(other, landmarks=landmarks)).fit([raised(recording, other)])


@pytest.mark.parametrize("name", ["hdm05/hdm05", "utkinect/utkinect", "cmu07_walk/cmu07_walk"])
def test_parts_of_people_are_accepted_and_upside_down_refused(real_data, name):
    bunch = load_trials(real_data / f"{name}_positions.npz")
    for landmarks in (PAPER.joints, LEGS, [*TRUNK, "left_elbow"]):
        known = {j: bunch.skeleton.landmarks[j] for j in landmarks}
        some = Skeleton(bunch.joints, bunch.skeleton.parents, known)
        fitted = DirectionCosines(some).fit(bunch.data)
        # Not all trunks tell.
        for x in bunch.data[::6] if "left_hip" in landmarks else bunch.data[:1]:
            with pytest.raises(ValueError, match="upside down"):
                fitted.transform([turned_over(x)])
