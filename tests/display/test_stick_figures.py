"""SkeletonDisplay: the places of bones, and bodies in step after synchronisation."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from artists import bones_drawn, ends_of_bones
from IPython.core.formatters import HTMLFormatter
from matplotlib.animation import FuncAnimation
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    Skeleton,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import SkeletonDisplay

from made_bodies import with_still_root

PAPER = Skeleton.paper()


@pytest.fixture(scope="module")
def bunch():
    return make_bending(6, n_frames=40, style=0, noise=0, random_state=1)


@pytest.fixture(scope="module")
def pipe(bunch):
    steps = DirectionCosines(bunch.skeleton), ASpace(6), DenseSynchronizer(40), ActionModel()
    return make_pipeline(*steps).fit(bunch.data)


def standing(faces=(0, 0, 1)):
    """The joints of a body that stands with its arms out, in some heading."""
    at = {
        "pelvis": (0, 1, 0), "neck": (0, 1.5, 0), "head": (0, 1.8, 0.1),
        "hip": (0.1, 1, 0), "knee": (0.1, 0.5, 0.05), "ankle": (0.1, 0, 0),
        "shoulder": (0.2, 1.5, 0), "elbow": (0.5, 1.5, 0), "wrist": (0.8, 1.5, 0),
    }  # fmt: skip
    forward = np.array(faces, dtype=float)
    left = np.cross([0, 1, 0], forward)
    axes = np.stack([left, [0, 1, 0], forward])
    points = []
    for name in PAPER.joints:
        side, _, part = name.rpartition("_")
        x, y, z = at[part]
        points.append((-x if side == "right" else x, y, z))
    return np.array(points) @ axes


def test_bones_seen_from_the_front_and_from_the_right():
    body = standing()
    X = np.tile(body.ravel(), (3, 1))
    joints = dict(zip(PAPER.joints, body, strict=True))
    for azimuth, column in ((0, 0), (-90, 2)):
        display = SkeletonDisplay.from_positions(X, PAPER, frames=[1]).plot(azimuth=azimuth)
        left = [bone for bone in PAPER.bones if PAPER.joints[bone[1]].startswith("left")]
        expected = np.array([body[list(bone)][:, [column, 1]] for bone in left])
        drawn = bones_drawn(display, 0, "left")
        assert sorted(map(np.ndarray.tolist, drawn.round(9))) == sorted(
            map(np.ndarray.tolist, expected.round(9))
        )
        display.animate(seconds=0.2, fps=10)
        np.testing.assert_array_equal(bones_drawn(display, 0, "left"), drawn)
        head = np.ravel(display.heads_[0].get_data())
        np.testing.assert_allclose(head, joints["head"][[column, 1]], atol=1e-9)
        assert len(bones_drawn(display, 0)) == len(PAPER.bones)
        assert len(bones_drawn(display, 0, "middle")) == 2
        low, high = display.axes_[0].get_ylim()
        assert low < 0 < 1.8 < high
        assert len({tuple(lines.get_colors()[0]) for lines in display.bones_[0].values()}) == 3


def of_scenes(scenes, titles=("one",), skeleton=PAPER, **drawn):
    """A display of bodies, with other attributes."""
    display = SkeletonDisplay()
    display.scenes, display.titles, display.skeleton = scenes, titles, skeleton
    for name, value in drawn.items():
        setattr(display, name, value)
    return display


def test_marked_bones_are_violet_thick_and_in_front():
    body = standing()[np.newaxis]
    thigh = next(b for b in PAPER.bones if PAPER.joints[b[1]] == "left_knee")
    plain = of_scenes([[body]] * 2, ["one", "two"]).plot()
    display = of_scenes([[body]] * 2, ["one", "two"], marked=[[], [thigh]]).plot()
    counts = [{side: len(bones_drawn(display, k, side)) for side in display.bones_[k]}
              for k in (0, 1)]  # fmt: skip
    assert counts[0] == {"left": 6, "middle": 2, "right": 6, "departing": 0}
    assert counts[1] == {"left": 5, "middle": 2, "right": 6, "departing": 1}
    x, y = (body[0, list(thigh)] @ axis for axis in ([0.5, 0, 3**0.5 / 2], [0, 1, 0]))
    np.testing.assert_allclose(bones_drawn(display, 1, "departing")[0], np.transpose([x, y]))
    # All bones are drawn; the marked one is thicker and in front, the others are grey.
    assert sorted(bones_drawn(plain, 1).tolist()) == sorted(bones_drawn(display, 1).tolist())
    departing = display.bones_[1].pop("departing")
    assert len({tuple(lines.get_colors()[0]) for lines in display.bones_[1].values()}) == 1
    for lines in display.bones_[1].values():
        assert departing.get_zorder() > lines.get_zorder()
        assert departing.get_linewidths()[0] > 1.5 * lines.get_linewidths()[0]
    assert "departing" not in plain.bones_[0]


def test_shadows_are_behind_and_move_along():
    moving = standing() + np.arange(3)[:, np.newaxis, np.newaxis] * [0, 0.2, 0]
    display = of_scenes([[moving[::2]]], behind=[[moving]], heading="all of it").plot(at=1)
    assert display.heading_.get_text() == "all of it"
    # Side by side; a figure of the user has no heading.
    beside = of_scenes([[moving, moving]], behind=[[moving, moving]], labels=["a", "b"])
    beside.plot(plt.subplots()[1], at=0.5)
    assert beside.heading_ is None
    for each in (display, beside):
        (shadow,) = each.behind_
        assert shadow.get_zorder() < min(x.get_zorder() for x in each.bones_[0].values())
        assert sorted(ends_of_bones(shadow).tolist()) == sorted(bones_drawn(each, 0).tolist())


def test_place_heading_and_vertical_axis_have_no_effect():
    pictures = []
    for faces, shift in (((0, 0, 1), 0), ((0.6, 0, -0.8), 5)):
        X = np.tile((standing(faces) + [shift, 0.3, -shift]).ravel(), (2, 1))
        display = SkeletonDisplay.from_positions(X, PAPER, frames=1)
        pictures.append(bones_drawn(display, 0))
    upright = standing().reshape(-1, 3)
    z_up = np.stack([upright[:, 0], -upright[:, 2], upright[:, 1]], axis=1)
    turned = Skeleton(PAPER.joints, PAPER.parents, PAPER.landmarks, up="z")
    display = SkeletonDisplay.from_positions(np.tile(z_up.ravel(), (2, 1)), turned, frames=1)
    pictures.append(bones_drawn(display, 0))
    for picture in pictures[1:]:
        np.testing.assert_allclose(picture, pictures[0], atol=1e-9)


def test_from_model_draws_mean_and_accepted_poses(pipe):
    display = SkeletonDisplay.from_model(pipe, frames=(0.1, 20), random_state=0)
    display.plot(azimuth=0)
    titles = [axis.get_title() for axis in display.axes_]
    assert [title.split("\n")[0] for title in titles] == ["frame 4"] * 2 + ["frame 20"] * 2
    assert [len(bones_drawn(display, panel)) for panel in range(4)] == [14, 12 * 14, 14, 12 * 14]
    mean = pipe[:2].inverse_transform(pipe[-1].mean_).reshape(40, 15, 3)
    mean[..., 1] -= mean[..., 1].min()
    for panel, frame in ((0, 4), (2, 20)):
        x, y = display.heads_[panel].get_data()
        np.testing.assert_allclose([x[0], y[0]], mean[frame, 2, :2])


def test_bodies_move_together_after_synchronisation(bunch, pipe):
    display = SkeletonDisplay.from_estimator(pipe, bunch.data)
    assert display.labels[0] == f"{pipe[2].pattern_index_} (pattern)"
    # Heights of heads relative to the first frame, as bodies differ in size.
    heights, standing = {"raw": [], "synchronised": []}, display.heads_[0].get_ydata()
    for at in np.linspace(0.1, 0.7, 7):
        display.plot(at=at)
        for panel, name in enumerate(heights):
            heights[name].append(display.heads_[panel].get_ydata() / standing)
        assert len(bones_drawn(display, 0)) == 6 * 14
        times = [axis.get_title().split(", ")[1] for axis in display.axes_]
        assert times == [f"at {100 * at:.0f} % of the time"] * 2
    apart = {name: np.ptp(np.array(h), axis=1).mean() for name, h in heights.items()}
    assert apart["synchronised"] < 0.02 < 0.2 < apart["raw"]


def test_the_view_follows_a_body_that_walks_far(bunch):
    staying = bunch.data[0]
    drift = np.outer(np.linspace(0, 6, len(staying)), np.tile([0.6, 0, 0.8], 15))
    strips, moving = [], []
    for X in (staying, staying + drift):
        display = SkeletonDisplay.from_positions(X, bunch.skeleton, frames=[0, 30])
        strips.append([bones_drawn(display, panel) for panel in (0, 1)])
        display = SkeletonDisplay.from_trials([X], bunch.skeleton).plot(at=0.7)
        moving.append(bones_drawn(display, 0))
    np.testing.assert_allclose(strips[0], strips[1], atol=1e-9)
    middle = np.abs(moving[1][:, :, 0]).max()
    assert middle < 1.5, "six metres away without following"
    # A body that stays is not followed: the feet stand still while the pelvis moves.
    feet = [j for j, name in enumerate(bunch.skeleton.joints) if name.endswith("ankle")]
    raw = SkeletonDisplay.from_trials([staying], bunch.skeleton).scenes[0][0]
    assert np.ptp(raw[:, feet], axis=0).max() < 0.05 < np.ptp(raw[:, 0, [0, 2]], axis=0).max()


def test_hidden_joints_are_gaps(bunch):
    X = bunch.data[0].copy()
    joints = list(bunch.skeleton.joints)
    for joint, frames in (("left_wrist", slice(None)), ("pelvis", slice(0, 4)), ("neck", [20])):
        j = joints.index(joint)
        X[frames, 3 * j : 3 * j + 3] = np.nan
    display = SkeletonDisplay.from_positions(X, bunch.skeleton, frames=[10, 20])
    whole = SkeletonDisplay.from_positions(bunch.data[0], bunch.skeleton, frames=[10, 20])
    for panel, hidden in ((0, 1), (1, 5)):
        drawn, expected = bones_drawn(display, panel), bones_drawn(whole, panel)
        seen = np.isfinite(drawn).all(axis=(1, 2))
        # A bone is missing if one of its ends is; the others do not change.
        assert (~seen).sum() == hidden
        np.testing.assert_allclose(drawn[seen], expected[seen], atol=0.02)
    X[25] = np.nan  # the whole body
    assert len(SkeletonDisplay.from_positions(X, bunch.skeleton).axes_) == 6
    X[:, :3] = np.nan
    with pytest.raises(ValueError, match="No frame shows the pelvis"):
        SkeletonDisplay.from_positions(X, bunch.skeleton)


def test_animation_plays_from_the_first_to_the_last_frame(bunch, pipe, monkeypatch):
    display = SkeletonDisplay.from_estimator(pipe, bunch.data, trials=[0, 1])
    shows = []

    def recorded(animation, figure, show, **kwargs):
        shows.append(show)
        made(animation, figure, show, **kwargs)

    made = FuncAnimation.__init__
    monkeypatch.setattr(FuncAnimation, "__init__", recorded)
    animation = display.animate(seconds=1, fps=4)
    number, heads = display.figure_.number, []
    (show,) = shows
    for k in range(4):
        show(k)
        heads.append(np.array(display.heads_[0].get_data()).T)
    for k, at in enumerate(np.linspace(0, 1, 4)):
        display.plot(at=at)
        np.testing.assert_array_equal(np.array(display.heads_[0].get_data()).T, heads[k])
    html = HTMLFormatter()(animation)
    assert html.count("data:image/png;base64") == 4
    assert "Animation" in html
    # The notebook shows the animation without the figure.
    assert not plt.fignum_exists(number)
    axes = plt.figure().subplots(2, 1)
    display.plot(axes).animate(seconds=0.2, fps=5)
    assert display.axes_ == list(axes)
    assert all(len(axis.collections) == 4 for axis in axes), "earlier bodies are still there"


def test_from_trials_keeps_the_pace(bunch):
    X = [bunch.data[0], bunch.data[1][::2], bunch.data[2]]
    display = SkeletonDisplay.from_trials(X, bunch.skeleton, names=["a", "b", "c"])
    (scene,) = display.scenes
    assert [len(x) for x in scene] == [len(x) for x in X]
    assert [tick.get_text() for tick in display.axes_[0].get_xticklabels()] == ["a", "b", "c"]
    # The short one has ended while the others are half way.
    middle = SkeletonDisplay.from_trials(X, bunch.skeleton).plot(at=0.6)
    ended = SkeletonDisplay.from_trials([X[1]], bunch.skeleton).plot(at=1.0)
    alone = np.sort(np.ptp(bones_drawn(ended, 0)[..., 1], axis=1))
    heights = np.ptp(bones_drawn(middle, 0)[..., 1], axis=1)
    assert np.isclose(heights[:, np.newaxis], alone).any(axis=0).all()


@pytest.mark.parametrize("keys", [["ann", "bob"], [("ann", 1), ("ann", 2)]])
def test_trials_have_the_labels_of_a_table(bunch, keys):
    tables = [pd.DataFrame(x, columns=bunch.skeleton.column_names) for x in bunch.data[:2]]
    labels = SkeletonDisplay.from_trials(pd.concat(tables, keys=keys), bunch.skeleton).labels
    assert labels == [key if isinstance(key, str) else f"{key[0]}, {key[1]}" for key in keys]
    assert SkeletonDisplay.from_trials(tables, bunch.skeleton).labels == ["0", "1"]


def test_a_root_that_stands_still_is_not_drawn():
    """The same picture as without it, though it is far away."""
    bunch = make_bending(2, n_frames=30, random_state=0)
    x = bunch.data[0] + np.tile(np.arange(30)[:, np.newaxis] / 50 * [1, 0, 0], (1, 15))
    df = with_still_root(x, bunch.skeleton, (90, -80, 70))
    before = df.copy()
    still, moving = (
        SkeletonDisplay.from_positions(y, skeleton, frames=[0, 29])
        for y, skeleton in ((df, Skeleton.from_frame(df)), (x, bunch.skeleton))
    )
    pd.testing.assert_frame_equal(df, before)
    for panel in (0, 1):
        np.testing.assert_array_equal(bones_drawn(still, panel), bones_drawn(moving, panel))
        assert still.axes_[panel].axis() == moving.axes_[panel].axis()
