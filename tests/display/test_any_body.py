"""Stick figures of parts of bodies, mean landmarks, pictures, and points without bones."""

import numpy as np
import pandas as pd
import pytest
from artists import bones_drawn, ends_of_bones
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    JointPositions,
    Match,
    Skeleton,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import SkeletonDisplay

PAPER = Skeleton.paper()
BUNCH = make_bending(6, n_frames=40, random_state=1)
LEGS = ["pelvis", *(f"{s}_{j}" for s in ("left", "right") for j in ("hip", "knee", "ankle"))]
ARMS = ["neck", *(f"{s}_{j}" for s in ("left", "right") for j in ("shoulder", "elbow", "wrist"))]
HALF = ["pelvis", "neck", *(j for j in PAPER.joints if j.startswith("left"))]


def columns(joints, axes="xyz"):
    return [f"{joint}_{axis}" for joint in joints for axis in axes]


def part_of(joints, axes="xyz", of=BUNCH.data):
    """Tables of some of the joints, and a skeleton of them with the paper's bones."""
    tables = [pd.DataFrame(x, columns=PAPER.column_names)[columns(joints, axes)] for x in of]
    whole = Skeleton(PAPER.joints, PAPER.parents, {j: j for j in joints}, n_dims=len(axes)).body()
    order = list(whole.joints)
    assert sorted(order) == sorted(joints)
    return [df[columns(order, axes)] for df in tables], whole


def in_order(drawn):
    return np.array(sorted(drawn.round(9).tolist()))


def pipeline(skeleton):
    steps = DirectionCosines(skeleton), ASpace(4), DenseSynchronizer(30), ActionModel()
    return make_pipeline(*steps)


@pytest.mark.parametrize(
    ("joints", "axes"), [(LEGS, "xyz"), (ARMS, "xy"), ([*ARMS, "head"], "xyz")]
)
def test_any_part_is_drawn(joints, axes):
    X, skeleton = part_of(joints, axes)
    n_bones = len(skeleton.bones)
    display = SkeletonDisplay.from_positions(X[0], skeleton, frames=3)
    assert [len(bones_drawn(display, panel)) for panel in range(3)] == [n_bones] * 3
    display = SkeletonDisplay.from_positions(np.stack([x[:30] for x in X]), skeleton, frames=[9])
    assert len(bones_drawn(display, 0)) == 6 * n_bones
    for first in (DirectionCosines, JointPositions):
        pipe = make_pipeline(first(skeleton), DenseSynchronizer(30)).fit(X)
        display = SkeletonDisplay.from_estimator(pipe, X, trials=[0, 1, 2])
        assert display.scenes[1][0].shape == (30, len(skeleton.joints), len(axes))
        display.plot(at=0.7)
        assert len(bones_drawn(display, 1)) == 3 * n_bones


@pytest.mark.parametrize(("joints", "axes"), [(LEGS, "xyz"), (HALF, "xy")])
def test_model_and_departures_of_any_part(joints, axes):
    X, skeleton = part_of(joints, axes)
    pipe = pipeline(skeleton).fit(X)
    display = SkeletonDisplay.from_model(pipe, frames=[5])
    assert display.skeleton == skeleton
    mean = bones_drawn(display, 0)
    assert len(mean) == len(skeleton.bones)
    assert np.isfinite(mean).all()
    still = np.repeat(X[0].to_numpy()[:1], 40, axis=0)
    still = pd.DataFrame(still, columns=X[0].columns)
    display = SkeletonDisplay.from_departures(pipe, [X[1], still], trial=1, frames=3)
    assert display.skeleton == skeleton
    marked = {skeleton.joints[joint] for of_panel in display.marked for _, joint in of_panel}
    assert marked & {"left_knee", "left_ankle", "left_hip", "neck", "left_elbow"}
    assert sum(len(bones_drawn(display, k)) for k in range(3)) == 3 * len(skeleton.bones)


def test_departures_of_an_upper_body_are_above_the_floor():
    X, skeleton = part_of([j for j in PAPER.joints if j not in LEGS or j == "pelvis"])
    display = SkeletonDisplay.from_departures(pipeline(skeleton).fit(X), X, frames=3)
    assert min(x[..., 1].min() for scene in display.scenes + display.behind for x in scene) >= 0


def test_positions_in_a_plane_are_not_turned():
    """The azimuth has no effect; the lowest joint is on the floor, the pelvis above the origin."""
    skeleton = Skeleton.paper(n_dims=2, up="-y")
    seen = BUNCH.data[0].reshape(-1, 15, 3)[..., :2] * [100, -100] + [640, 300]
    X = seen.reshape(len(seen), -1)
    pictures = [
        SkeletonDisplay.from_positions(X, skeleton, frames=[4]).plot(azimuth=a)
        for a in (-60, 0, 45)
    ]
    body, floor = seen[4] * [1, -1], -seen[..., 1].max()
    body = body - [body[0, 0], floor]
    expected = [[body[a], body[b]] for a, b in skeleton.bones]
    for display in pictures:
        np.testing.assert_allclose(in_order(bones_drawn(display, 0)), in_order(np.array(expected)))
        head = np.ravel(display.heads_[0].get_data())
        np.testing.assert_allclose(head, body[PAPER.joints.index("head")])


@pytest.mark.parametrize("name", ["openpose", "coco", "mediapipe", "plug_in_gait"])
@pytest.mark.parametrize("n_dims", [3, 2])
def test_every_format_is_drawn(name, n_dims):
    skeleton = getattr(Skeleton, name)(n_dims=n_dims)
    rng = np.random.default_rng(0)
    X = rng.normal(size=(5, n_dims * len(skeleton.joints)))
    display = SkeletonDisplay.from_positions(X, skeleton, frames=[2])
    counts = {side: len(bones_drawn(display, 0, side)) for side in ("left", "middle", "right")}
    assert counts["left"] == counts["right"] > 0
    if name not in ("coco", "mediapipe"):
        assert sum(counts.values()) == len(skeleton.bones)
        assert counts["middle"] >= 1 + ("head" in skeleton.landmarks)
    else:
        # The trunk joins mean landmarks, the face the nose; MediaPipe has hands and feet.
        assert counts["left"] == 6 + 5 * (name == "mediapipe")
        assert counts["middle"] == 2 + {"coco": 4, "mediapipe": 9}[name]
    assert len(display.heads_[0].get_xdata()) == ("head" in skeleton.landmarks)


def test_a_mean_landmark_is_drawn_between_its_joints():
    landmarks = {**PAPER.landmarks, "head": ("left_wrist", "right_wrist")}
    skeleton = Skeleton(PAPER.joints, PAPER.parents, landmarks)
    display = SkeletonDisplay.from_positions(BUNCH.data[0], skeleton, frames=[3])
    ends = [wrist(display, side) for side in ("left", "right")]
    head = np.ravel(display.heads_[0].get_data())
    np.testing.assert_allclose(head, np.mean(ends, axis=0), atol=1e-9)


def wrist(display, side):
    """The place of a wrist: the end of its bone; bones have the order of the skeleton."""
    bones = [b for b in PAPER.bones if PAPER.joints[b[1]].startswith(side)]
    place = [PAPER.joints[b] for _, b in bones].index(f"{side}_wrist")
    return bones_drawn(display, 0, side)[place, 1]


def test_without_bones_joints_are_points_and_limbs_join_landmarks():
    table = pd.DataFrame(BUNCH.data[0], columns=PAPER.column_names)
    for axis in "xyz":
        table[f"marker_{axis}"] = table[f"head_{axis}"] + 0.1
    bare = Skeleton.from_frame(table)
    assert bare.bones == []
    display = SkeletonDisplay.from_positions(table, bare, frames=[0, 9])
    whole = SkeletonDisplay.from_positions(BUNCH.data[0], PAPER, frames=[0, 9])
    for panel in (0, 1):
        for side in ("left", "middle", "right"):
            np.testing.assert_allclose(
                in_order(bones_drawn(display, panel, side)),
                in_order(bones_drawn(whole, panel, side)),
            )
        assert len(display.heads_[panel].get_xdata()) == 16
    display.behind = display.scenes
    assert len(ends_of_bones(display.plot().behind_[0])) == 14


# -- without a skeleton ---------------------------------------------------------------------


def points_drawn(x, azimuth=None, **given):
    """The places of joints without a skeleton, (n_joints, 2)."""
    display = SkeletonDisplay.from_positions(x, None, **given).plot(azimuth=azimuth)
    assert all(len(lines.get_paths()) == 0 for lines in display.bones_[0].values())
    return np.transpose(display.heads_[0].get_data())


def test_joints_without_a_skeleton_are_points():
    """They are moved to the floor and not turned."""
    x = BUNCH.data[0] + np.tile([5.0, 3.0, -2.0], 15)
    points = x.reshape(-1, 15, 3)
    expected = points[4, :, :2] - [points[4, :, 0].mean(), points[..., 1].min()]
    np.testing.assert_allclose(points_drawn(x, frames=[4], azimuth=0), expected)
    for joint in (0, 7):
        markers = np.delete(points, joint, axis=1).reshape(len(x), -1)
        assert len(points_drawn(markers, frames=1)) == 14


@pytest.mark.parametrize("path", [[[0.0, 1, 0]] * 5, [[0.0, t, 0] for t in range(5)]])
def test_a_single_marker_is_drawn(path):
    hidden = np.array(path)
    assert len(points_drawn(hidden, frames=2)) == 1
    hidden[1] = np.nan
    SkeletonDisplay.from_positions(hidden, None, frames=[0, 1]).figure_.canvas.draw()


def test_points_have_two_or_three_axes():
    """In space, or in the plane if names or the number of columns say so."""
    x = np.random.default_rng(0).normal(size=(6, 12))
    assert len(points_drawn(x, frames=[1])) == 4
    named = pd.DataFrame(x, columns=columns("abcdef", "xy"))
    steps = np.diff(points_drawn(named, frames=[1]), axis=0)
    np.testing.assert_allclose(steps, np.diff(x[1].reshape(6, 2), axis=0))
    assert len(points_drawn(x[:, :8], frames=[1])) == 4
    match = Match(np.linspace(0, 5, 6)[np.newaxis])
    display = SkeletonDisplay.from_trials([x[:, :8]], None, match=match)
    assert display.scenes[1][0].shape == (6, 4, 2)
