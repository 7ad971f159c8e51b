"""Limbs that depart from an action, in numbers and on stick figures."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from artists import ends_of_bones
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
    Match,
    Skeleton,
)
from sklearn_motionsync.body.limbs import LIMBS, part_of_limb
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import SkeletonDisplay
from sklearn_motionsync.display.limb_departures import describe_departure, limb_departures
from sklearn_motionsync.model import find_departures
from sklearn_motionsync.model.departures import Departure

PAPER = Skeleton.paper()
ENDS = {
    "left_thigh": [("left_hip", "left_knee")],
    "torso": [("pelvis", "neck")],
    "hip": [("pelvis", "left_hip"), ("pelvis", "right_hip")],
    "shoulder": [("neck", "left_shoulder"), ("neck", "right_shoulder")],
    "pelvis_height": [("pelvis", "left_hip"), ("pelvis", "right_hip")],
}


def bones(*pairs):
    return sorted((PAPER.joints.index(a), PAPER.joints.index(b)) for a, b in pairs)


def row(limb, first, last, peak=None, kind="angle", size=30.0, unit="degrees"):
    peak = first if peak is None else peak
    region = part_of_limb(limb)
    places = first, last, peak, first, last, np.nan, np.nan
    return Departure(0, kind, limb, region, None, 0, *places, size, unit, 5.0, True)


def departures(rows, frames):
    return limb_departures(rows, 60, frames, PAPER)


@pytest.mark.parametrize("limb", [*LIMBS, "pelvis_height"])
def test_a_limb_is_marked_on_its_bones(limb):
    _, titles, (marked,) = departures([row(limb, 20, 20)], [20])
    assert sorted(marked) == bones(*(ENDS[limb] if limb in ENDS else [LIMBS[limb][:2]]))
    # A line of a title is as wide as its panel.
    assert " ".join(titles[0].split()) == f"frame 20 {limb.replace('_', ' ')} 30° off"
    assert max(map(len, titles[0].split("\n"))) <= 18


@pytest.mark.parametrize(
    ("kind", "size", "unit", "text"),
    [
        ("angle", 30.4, "degrees", "left arm 30° off"),
        ("late", 12.3, "percent", "left arm 12 % late"),
        ("early", 7.6, "percent", "left arm 8 % early"),
        ("too small", 0.52, "ratio", "left arm moves 0.5 times as far"),
        ("too large", 1.6, "ratio", "left arm moves 1.6 times as far"),
        ("value", -0.123, "leg lengths", "left arm 0.12 lower"),
        ("value", 0.3, "leg lengths", "left arm 0.30 higher"),
    ],
)
def test_departures_in_plain_words(kind, size, unit, text):
    assert describe_departure(row("left_arm", 0, 59, 3, kind, size, unit)) == text


def test_directions_and_the_whole_body_in_plain_words():
    flexed = row("left_forearm", 0, 5)._replace(direction="flexed")
    assert describe_departure(flexed) == "left forearm 30° flexed"
    late = row("whole body", 0, 9, kind="starts late", unit="percent")
    assert describe_departure(late) == "whole body starts late"
    # It is told in the heading, and marks no limb.
    assert departures([late], 1)[1] == ["frame 29\nno limb departs"]


def test_each_part_of_the_clock_is_shown_at_its_most_important_departure():
    rows = [row("left_thigh", 12, 16, 14), row("torso", 3, 13, 12), row("hip", 57, 59, 59)]
    frames, titles, marked = departures(rows, 6)
    # A part without a peak is shown in its middle: 20 to 29, ...
    assert frames == [4, 14, 24, 34, 44, 59]
    assert [title.split("\n")[1] for title in titles] == [
        "torso 30° off",
        "left thigh 30° off",
        *["no limb departs"] * 3,
        "hip 30° off",
    ]
    thigh, torso = bones(*ENDS["left_thigh"]), bones(*ENDS["torso"])
    assert [sorted(m) for m in marked] == [
        torso, sorted(thigh + torso), [], [], [], bones(*ENDS["hip"])
    ]  # fmt: skip
    assert departures(rows, 1)[0] == [14]
    assert departures(rows, 100)[0] == list(range(60))


def test_a_chosen_frame_represents_the_frames_around_it():
    rows = [row("torso", 24, 24), row("neck", 27, 27), row("hip", 36, 36)]
    # Frame 26 is as far from 22 as from 30; 5 frames are a twelfth of the clock.
    titles = departures(rows, [22, 30])[1]
    assert titles == ["frame 22\ntorso 30° off", "frame 30\nneck 30° off"]
    assert departures(rows, [30, 22, 30])[1] == [titles[1], titles[0], titles[1]]
    assert departures(rows, [41])[1] == ["frame 41\nhip 30° off"]
    assert departures(rows, [42])[1] == ["frame 42\nno limb departs"]


# -- stick figures ----------------------------------------------------------------------


@pytest.fixture(scope="module")
def bunch():
    return make_bending(8, n_frames=40, random_state=1)


@pytest.fixture(scope="module")
def pipe(bunch):
    steps = DirectionCosines(bunch.skeleton), ASpace(0.99), DenseSynchronizer(40), ActionModel()
    return make_pipeline(*steps).fit(bunch.data)


def marked_joints(display, panel):
    return {PAPER.joints[b] for _, b in display.marked[panel]}


def test_standing_still_departs_from_bending(bunch, pipe):
    still = np.repeat(bunch.data[0][:1], 40, axis=0)
    people = [bunch.data[3], still]
    good, bad = (SkeletonDisplay.from_departures(pipe, people, trial=i, frames=3) for i in (0, 1))
    assert good.heading_.get_text().startswith("Trial 0 is accepted.")
    assert bad.heading_.get_text().startswith("Trial 1 is not accepted.")
    assert sum(map(len, good.marked)) < 3 < sum(map(len, bad.marked))
    assert "neck" in marked_joints(bad, 1), "the torso"
    # The whole pose is drawn, with what the aSpace leaves out, and the mean at the frame.
    poses = Match.from_estimator(pipe, people).warp(pipe[0].transform(people))[1]
    mean = pipe[1].inverse_transform([pipe[-1].mean_])[0]
    for x, scenes in ((poses, bad.scenes), (mean, bad.behind)):
        bodies = pipe[0].inverse_transform([x])[0].reshape(40, 15, 3)
        for title, scene in zip(bad.titles, scenes, strict=True):
            frame = int(title.split("\n")[0].removeprefix("frame "))
            np.testing.assert_allclose(scene[0], bodies[[frame]], atol=1e-9)


def test_titles_agree_with_find_departures(bunch, pipe):
    people = [bunch.data[0][::-1], bunch.data[1]]
    table = find_departures(pipe, people)
    worst = table[table.trial == 0].iloc[0]
    assert worst.rare
    display = SkeletonDisplay.from_departures(pipe, people)
    at = [title for title in display.titles if title.startswith(f"frame {worst.peak}\n")]
    assert len(at) == 1
    assert at[0].split("\n")[1].startswith(f"{worst.limb.replace('_', ' ')} ")
    assert f"{worst['size']:.0f}" in at[0]
    display = SkeletonDisplay.from_departures(pipe, people, trial=1, frames=[5, 30])
    assert display.titles == ["frame 5\nno limb departs", "frame 30\nno limb departs"]
    assert "Rare: nothing." in display.heading


def test_a_reference_is_what_is_expected(bunch, pipe):
    """A person who always bends with an arm lifted departs from others, not from the own trials."""
    shift = np.zeros((15, 3))
    shift[PAPER.joints.index("left_wrist"), 1] = 0.3
    own = [bunch.data[2] + k * shift.ravel() for k in (0.99, 1.0, 1.01, 0.995, 1.005)]
    frames = range(0, 40, 8)
    alone = SkeletonDisplay.from_departures(pipe, own[3:], frames=frames)
    display = SkeletonDisplay.from_departures(pipe, own[3:], reference=own[:3], frames=frames)
    assert "expected of a new person" in alone.heading
    assert "expected of this person" in display.heading
    wrist = PAPER.joints.index("left_wrist")
    body, others, of_person = (
        np.array([scene[0][0, wrist] for scene in scenes])
        for scenes in (display.scenes, alone.behind, display.behind)
    )
    first = find_departures(pipe, own[3:4]).iloc[0]
    assert (first.limb, first.rare) == ("left_forearm", True)
    assert np.linalg.norm(body - of_person, axis=1).max() < 0.3
    assert np.linalg.norm(body - others, axis=1).max() > 0.2
    table = find_departures(pipe, own[3:4], reference=own[:3], limit=1e-3)
    size = table.query("limb == 'left_forearm' and kind == 'angle'")["size"].max()
    assert first["size"] > 4 * size


def test_a_pipeline_without_aspace_on_axes_of_the_user(bunch):
    """An arm is stretched out for a while."""
    arm = [j for name in ("left_elbow", "left_wrist") for j in [PAPER.joints.index(name)]]
    wrong = bunch.data[2].copy().reshape(-1, 15, 3)
    shoulder = wrong[10:20, PAPER.joints.index("left_shoulder")]
    for k, joint in enumerate(arm):
        wrong[10:20, joint] = shoulder + [0.25 * (k + 1), 0, 0]
    steps = DirectionCosines(bunch.skeleton), LinearSynchronizer(40), ActionModel()
    pipe = make_pipeline(*steps).fit(bunch.data)
    _, axes = plt.subplots(1, 2)
    people = [wrong.reshape(-1, 45), *bunch.data]
    display = SkeletonDisplay.from_departures(pipe, people, frames=[2, 15], ax=axes)
    assert display.axes_ == list(axes)
    assert display.heading_ is None
    assert display.marked[0] == []
    assert marked_joints(display, 1) == {"left_elbow", "left_wrist"}
    assert len(ends_of_bones(display.bones_[1]["departing"])) == 2
    assert display.axes_[1].get_title().startswith("frame 15\nleft arm ")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        *(({"trial": bad}, "trial must be from 0 to 7, got")
          for bad in (8, -1, 1.5, True)),
        *(({"trial": bad}, "trial must be one number from 0 to 7")
          for bad in ("0", None, [0])),
        ({"frames": 0}, "frames must be how many"),
        ({"frames": [40]}, "frames must be from 0 to 39"),
    ],
)  # fmt: skip
def test_from_departures_refuses(bunch, pipe, arguments, message):
    with pytest.raises(ValueError, match=message):
        SkeletonDisplay.from_departures(pipe, bunch.data, **arguments)


def test_from_departures_refuses_pipelines_without_limbs(bunch, pipe):
    points = pipe[:2].transform(bunch.data)
    alone = make_pipeline(pipe[2], pipe[3])
    with pytest.raises(ValueError, match="begins with DirectionCosines"):
        SkeletonDisplay.from_departures(alone, points)
    with pytest.raises(ValueError, match="no ActionModel in Pipeline"):
        SkeletonDisplay.from_departures(pipe[:3], bunch.data)
    with pytest.raises(ValueError, match="from_departures needs trials X"):
        SkeletonDisplay.from_departures(pipe, None)
    double = FunctionTransformer(lambda X: [2 * x for x in X])
    steps = *pipe[:2], double, LinearSynchronizer(20), ActionModel()
    odd = make_pipeline(*steps).fit(bunch.data)
    with pytest.raises(ValueError, match="whose features lead back to limbs; those found are"):
        SkeletonDisplay.from_departures(odd, bunch.data)
    with pytest.raises(TypeError, match="from_departures got 'keyframes'"):
        SkeletonDisplay.from_departures(pipe, bunch.data, keyframes=bunch.keyframes)
