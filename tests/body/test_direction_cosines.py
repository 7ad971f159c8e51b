"""Poses: cosines of known bodies, and positions reconstructed from them."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import ASpace, DirectionCosines, Skeleton, to_frame
from sklearn_motionsync.datasets import make_bending

from made_bodies import standing

REFERENCES = ["heading", "parent", "world"]


@pytest.fixture(scope="module")
def recording():
    return make_bending(1, random_state=1).data[0]


def named(cosines, positions):
    """The height, and the cosines of each limb."""
    height, *values = cosines.fit_transform(np.vstack([positions, positions]))[0].round(9)
    limbs = [str(name)[:-2] for name in cosines.get_feature_names_out()[1::3]]
    rows = np.reshape(values, (-1, 3)).tolist()
    return {"u": height} | dict(zip(limbs, map(tuple, rows), strict=True))


def test_cosines_of_a_known_body():
    body = named(DirectionCosines(Skeleton.paper()), standing(left_wrist=(0.2, 1.2, 0.3)))
    assert body["u"] == 1
    assert body["hip"] == (1, 0, 0)
    assert body["torso"] == (0, 1, 0)
    assert body["right_forearm"] == (0, -1, 0)
    assert body["left_forearm"] == (0, 0, 1)


def test_parent_cosines_of_a_stretched_leg_do_not_change_with_the_thigh():
    swung = standing(left_knee=(0.1, 0.7, 0.4), left_ankle=(0.1, 0.4, 0.8))
    for body in (standing(), swung):
        limbs = named(DirectionCosines(Skeleton.paper(), "parent"), body)
        assert limbs["left_leg"] == (0, -1, 0)
        assert limbs["right_forearm"][0] == -1
    assert limbs["left_thigh"] == (0, -0.6, 0.8)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("n_dims", [2, 3])
def test_parent_cosines_of_limbs_opposite_to_rest_are_unit_and_invertible(n_dims, dtype):
    """Hips of people seen from behind, level to any digit or exactly, and an arm across."""
    x = standing().reshape(-1, 3)[:, :n_dims].reshape(1, -1)
    skeleton = Skeleton.paper(n_dims=n_dims)
    x = np.repeat(x, 5, axis=0).astype(dtype)
    tilts = np.array([0, 1e-9, 1e-7, 1e-4, 1e-2])
    world = DirectionCosines(skeleton, "world").fit(x)
    for limb in ("hip", "left_arm"):
        poses = world.transform(x)
        place = list(world.get_feature_names_out()).index(f"{limb}_x")
        poses[:, place], poses[:, place + 1] = -np.cos(tilts), np.sin(tilts)
        positions = world.inverse_transform(poses)
        parent = DirectionCosines(skeleton, "parent").fit(positions)
        cosines = parent.transform(positions)
        lengths = np.linalg.norm(cosines[:, 1:].reshape(5, 12, n_dims), axis=2)
        eps = 10 * np.finfo(dtype).eps
        np.testing.assert_allclose(lengths, 1, atol=eps)
        again = parent.transform(parent.inverse_transform(cosines))
        np.testing.assert_allclose(again, cosines, atol=10 * eps)
        if n_dims == 2:
            np.testing.assert_allclose(cosines, cosines[[0] * 5], atol=0.011)


@pytest.mark.parametrize("reference", REFERENCES)
def test_inverse_transform_reconstructs_positions_except_place_and_heading(reference):
    """Exactly, but for place and heading: the embedded body is built like the inverse's."""
    bunch = make_bending(1, noise=0, random_state=1)
    cosines = DirectionCosines(bunch.skeleton, reference)
    poses = cosines.fit_transform(bunch.data)
    back = cosines.inverse_transform(poses)
    assert back[0].shape == bunch.data[0].shape
    original = bunch.data[0].reshape(-1, 15, 3)
    rebuilt = back[0].reshape(-1, 15, 3)
    if reference == "world":
        original = original - original[:, :1] * [1, 0, 1]
        np.testing.assert_allclose(rebuilt, original, atol=1e-9)
    gaps = [np.linalg.norm(x[:, :, None] - x[:, None], axis=-1) for x in (original, rebuilt)]
    np.testing.assert_allclose(gaps[1], gaps[0], atol=1e-9)
    np.testing.assert_allclose(rebuilt[..., 1], original[..., 1], atol=1e-9)
    again = DirectionCosines(Skeleton.paper(), reference).fit_transform(back)
    np.testing.assert_allclose(again[0], poses[0], atol=1e-9)


# -- inverse_transform --------------------------------------------------------------------


def heights(poses):
    return np.concatenate([x[:, 0] for x in poses])


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_inverse_transform_keeps_the_height_of_the_pelvis(bends, dtype):
    """Of real people, whose hips are below the pelvis, and of approximations of them."""
    cosines = DirectionCosines(bends.skeleton)
    poses = cosines.fit_transform([x.astype(dtype) for x in bends.data])
    aspace = ASpace(3).fit(poses)
    for given in (poses, aspace.inverse_transform(aspace.transform(poses))):
        back = cosines.inverse_transform(given)
        again = DirectionCosines(Skeleton.paper()).fit_transform(back)
        np.testing.assert_allclose(heights(again), heights(given), atol=1e-5)
        for x in back:
            ankles = x.reshape(len(x), 15, 3)[:, [8, 14], 1]
            np.testing.assert_allclose(ankles.min(), 0, atol=1e-5)


def test_inverse_transform_shifts_hips_by_a_quarter_of_a_leg_at_most(recording):
    cosines = DirectionCosines(Skeleton.paper())
    (poses,) = cosines.fit_transform([recording])
    heights = []
    for jump in (-0.4, -0.2, 0.0, 0.2, 0.4):
        back = cosines.inverse_transform(poses[:1] + jump * np.eye(37)[0])
        heights.append(DirectionCosines(Skeleton.paper()).fit_transform(back)[0, 0])
    np.testing.assert_allclose(np.subtract(heights, poses[0, 0])[1:4], [-0.2, 0, 0.2], atol=1e-9)
    assert heights[0] > poses[0, 0] - 0.4 + 0.1
    assert heights[4] < poses[0, 0] + 0.4 - 0.1


@pytest.mark.parametrize("reference", REFERENCES)
def test_inverse_transform_refuses_cosines_of_length_0_and_scales_others(recording, reference):
    cosines = DirectionCosines(Skeleton.paper(), reference)
    (poses,) = cosines.fit_transform([recording])
    faulty, tiny = poses.copy(), poses.copy()
    faulty[9, 4:7] = 0
    message = r"Trial 1, frame 9: the limb 'torso' has no direction, its cosines are 0"
    with pytest.raises(ValueError, match=message):
        cosines.inverse_transform([poses, faulty])
    tiny[:, 1:] *= 1e-6
    np.testing.assert_allclose(
        cosines.inverse_transform(tiny), cosines.inverse_transform(poses), atol=1e-9
    )


# -- names of columns ---------------------------------------------------------------------


def test_inverse_transform_refuses_wrong_order_of_columns(recording):
    cosines = DirectionCosines(Skeleton.paper()).set_output(transform="pandas")
    names = Skeleton.paper().column_names
    table = cosines.fit_transform(pd.DataFrame(recording, columns=names))
    expected = cosines.inverse_transform(np.asarray(table))
    # Its own output: without a warning, which would be an error here.
    np.testing.assert_array_equal(cosines.inverse_transform(table), expected)
    np.testing.assert_array_equal(cosines.inverse_transform([table])[names], expected)
    for wrong in (table[table.columns[::-1]], table.add_prefix("my_")):
        for given in (wrong, [wrong], to_frame([wrong])):
            with pytest.raises(ValueError, match="names should match"):
                cosines.inverse_transform(given)
