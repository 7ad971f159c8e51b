"""Key-points in a picture against bodies that move in a plane."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import DirectionCosines, JointPositions, Skeleton
from sklearn_motionsync.datasets import make_bending

from made_bodies import columns_of, standing, turned

PAPER = Skeleton.paper()
PLANE = Skeleton.paper(n_dims=2)
REFERENCES = ["heading", "parent", "world"]


def picture_of(x, across=0):
    """Positions along two axes: one across the picture, and y."""
    return x.reshape(len(x), -1, 3)[..., [across, 1]].reshape(len(x), -1)


@pytest.fixture(scope="module")
def people():
    """Seen from before them, at half a right angle, so that left is across all the time."""
    people = []
    for x in make_bending(4, random_state=1).data:
        left, right = (x[0, 3 * PAPER.index_of(f"{side}_hip") :][:3] for side in ("left", "right"))
        faces = np.rad2deg(np.arctan2(*(left - right)[[2, 0]]))
        # Moved into the plane that faces the camera.
        people.append(turned(x, faces + 45) * np.tile([1, 1, 0], 15))
    return people


@pytest.mark.parametrize(
    ("kind", "reference"),
    [
        *((DirectionCosines, reference) for reference in REFERENCES),
        *((JointPositions, reference) for reference in ("heading", "world")),
    ],
)
def test_features_equal_those_of_a_body_that_moves_in_a_plane(people, kind, reference):
    seen = [picture_of(x) for x in people]
    space, plane = kind(PAPER, reference).fit(people), kind(PLANE, reference).fit(seen)
    names = space.get_feature_names_out()
    columns = [not name.endswith("_z") for name in names]
    assert list(plane.get_feature_names_out()) == list(names[columns])
    poses, found = space.transform(people), plane.transform(seen)
    for a, b in zip(found, poses, strict=True):
        np.testing.assert_allclose(a, b[:, columns], atol=1e-9)
    if kind is DirectionCosines:
        np.testing.assert_allclose(plane.limb_lengths_, space.limb_lengths_, rtol=1e-12)
        back, expected = plane.inverse_transform(found), space.inverse_transform(poses)
        for a, b in zip(back, expected, strict=True):
            np.testing.assert_allclose(a, picture_of(b), atol=1e-9)


@pytest.mark.parametrize("reference", REFERENCES)
def test_cosines_of_hips_and_shoulders_seen_end_on_are_0(reference):
    """They point at the camera."""
    bent = standing(neck=(0, 1.4, 0.3), head=(0, 1.5, 0.5), left_knee=(0.1, 0.5, 0.2))
    bent = np.vstack([bent, standing()])
    bent.reshape(-1, 15, 3)[:, PAPER.joints.index("right_shoulder")] += [0, 0, 1e-30]
    side = picture_of(bent, across=2)
    cosines = DirectionCosines(PLANE, reference).fit(side)
    at = dict(zip(cosines.get_feature_names_out(), cosines.transform(side)[0], strict=True))
    assert (at["hip_x"], at["hip_y"], at["shoulder_x"], at["shoulder_y"]) == (0, 0, 0, 0)
    np.testing.assert_allclose(at["torso_x"], 0.6, atol=1e-12)
    back = cosines.inverse_transform(cosines.transform(side))
    np.testing.assert_allclose(cosines.transform(back), cosines.transform(side), atol=1e-12)
    for kind in (DirectionCosines, JointPositions):
        leg = PAPER.joints.index("left_knee")
        faulty = side.copy()
        faulty[:, 2 * leg : 2 * leg + 2] = side[:, 2 * (leg - 1) : 2 * leg]
        with pytest.raises(ValueError, match="the limb 'left_thigh' has no length"):
            kind(PLANE).fit(faulty)
    # A moment of coincidence is rather a key-point that was not found.
    lost = picture_of(make_bending(1, random_state=1).data[0])
    for side in ("left", "right"):
        lost[5, 2 * PAPER.index_of(f"{side}_hip") :][:2] = 0
    with pytest.raises(ValueError, match=r"frame 5: the limb 'hip' has no length"):
        DirectionCosines(PLANE).fit(lost)


@pytest.mark.parametrize(
    ("up", "pixels"),
    [
        ("-y", lambda x, y: (x, -y)),
        # A picture that lies on its side, y downwards: the head to its right, or to its left.
        ("x", lambda x, y: (y, x)),
        ("-x", lambda x, y: (-y, -x)),
    ],
)
def test_features_do_not_depend_on_the_vertical_axis_of_the_picture(people, up, pixels):
    seen = [picture_of(x) for x in people]
    skeleton = Skeleton(PLANE.joints, PLANE.parents, up=up, n_dims=2)
    given = [np.stack(pixels(x[:, ::2], x[:, 1::2]), axis=2).reshape(x.shape) for x in seen]
    for kind in (DirectionCosines, JointPositions):
        found = kind(skeleton).fit_transform([x + 500 for x in given])
        for a, b in zip(found, kind(PLANE).fit_transform(seen), strict=True):
            np.testing.assert_allclose(a, b, atol=1e-9)
    guessed = Skeleton.from_frame(columns_of(given[0], skeleton))
    assert (guessed.up, guessed.n_dims, guessed.landmarks) == (up, 2, PAPER.landmarks)
    other = {"-y": "y", "x": "-x", "-x": "x"}[up]
    with pytest.raises(ValueError, match=f"seems to be.*up='{up}'"):
        DirectionCosines(Skeleton(PLANE.joints, PLANE.parents, up=other, n_dims=2)).fit(given)


def test_two_axes_are_read_from_the_columns():
    df = pd.DataFrame(0.0, index=[0], columns=PLANE.column_names)
    assert Skeleton.from_frame(df).n_dims == 2
    for wrong in (df[df.columns[1:]], df.add_suffix("_x"), df.assign(weight=1.0)):
        with pytest.raises(ValueError, match=r"<joint>_z or, in the plane, <joint>_x, <joint>_y"):
            Skeleton.from_frame(wrong)
    (x,) = make_bending(1, random_state=1).data
    table = columns_of(picture_of(x), PLANE)
    with pytest.raises(ValueError, match="column 0 is 'pelvis_y', where the skeleton has"):
        DirectionCosines(PLANE).fit(table[[*table.columns[1::-1], *table.columns[2:]]])
