"""Limbs that depart from an action, in numbers and on stick figures."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from sklearn import clone, config_context
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    KeyframeSynchronizer,
    LinearSynchronizer,
    Match,
    Skeleton,
    find_departures,
)
from sklearn_motionsync.body.limbs import LIMBS
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import SkeletonDisplay
from sklearn_motionsync.display.limb_departures import limb_departures

PAPER = Skeleton.paper()
NAMES = list(DirectionCosines(PAPER).get_feature_names_out())
ENDS = {
    "left_thigh": [("left_hip", "left_knee")],
    "torso": [("pelvis", "neck")],
    "hip": [("pelvis", "left_hip"), ("pelvis", "right_hip")],
    "shoulder": [("neck", "left_shoulder"), ("neck", "right_shoulder")],
    "pelvis_height": [("pelvis", "left_hip"), ("pelvis", "right_hip")],
}


def bones(*pairs):
    return sorted((PAPER.joints.index(a), PAPER.joints.index(b)) for a, b in pairs)


def scores_of(n_frames=60, **peaks):
    """Scores of 0 but for those of some features at some frames."""
    scores = np.zeros((n_frames, len(NAMES)))
    for name, at in peaks.items():
        for frame, score in at.items():
            scores[frame, NAMES.index(name)] = score
    return scores


def departures(scores, frames):
    return limb_departures(scores, NAMES, frames, 3, PAPER)


@pytest.mark.parametrize("limb", ENDS)
def test_a_limb_is_marked_on_its_bones(limb):
    feature = limb if limb == "pelvis_height" else f"{limb}_y"
    _, titles, marked = departures(scores_of(**{feature: {20: -7}}), [20])
    assert sorted(marked[0]) == bones(*ENDS[limb])
    assert titles == [f"frame 20\n{limb} 7.0 std"]


def test_every_limb_has_bones():
    for limb in LIMBS:
        _, _, (marked,) = departures(scores_of(**{f"{limb}_x": {0: 5}}), 1)
        assert len(marked) == (2 if limb in ("hip", "shoulder") else 1)


def test_each_part_of_the_clock_is_shown_at_its_largest_departure():
    scores = scores_of(torso_z={3: 4, 12: 12.4}, left_thigh_x={14: -30, 44: 2.9}, hip_x={59: 3.1})
    frames, titles, marked = departures(scores, 6)
    # A part without departures is shown in its middle: 20 to 29, ...
    assert frames == [3, 14, 24, 34, 44, 59]
    assert [title.split("\n")[1] for title in titles] == [
        "torso 4.0 std",
        "left_thigh 30 std",
        *["no limb departs"] * 3,
        "hip 3.1 std",
    ]
    thigh, torso = bones(*ENDS["left_thigh"]), bones(*ENDS["torso"])
    assert [sorted(m) for m in marked] == [
        torso, sorted(thigh + torso), [], [], [], bones(*ENDS["hip"])
    ]  # fmt: skip
    assert departures(scores, 1)[0] == [14]
    assert departures(scores, 100)[0] == list(range(60))


def test_a_chosen_frame_represents_the_frames_around_it():
    scores = scores_of(torso_z={24: 9, 27: 8, 36: 5})
    # Frame 26 is as far from 22 as from 30; 5 frames are a twelfth of the clock.
    titles = departures(scores, [22, 30])[1]
    assert titles == ["frame 22\ntorso 9.0 std", "frame 30\ntorso 8.0 std"]
    assert departures(scores, [30, 22, 30])[1] == [titles[1], titles[0], titles[1]]
    assert departures(scores, [41])[1] == ["frame 41\ntorso 5.0 std"]
    assert departures(scores, [42])[1] == ["frame 42\nno limb departs"]


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
    good, bad = (
        SkeletonDisplay.from_departures(pipe, people, performance=i, frames=3) for i in (0, 1)
    )
    assert good.heading_.get_text().startswith("Trial 0 is accepted.")
    assert bad.heading_.get_text().startswith("Trial 1 is not accepted.")
    assert sum(map(len, good.marked)) < 3 < sum(map(len, bad.marked))
    assert "neck" in marked_joints(bad, 1), "the torso"
    # The whole posture is drawn, with what the aSpace leaves out, and the mean at the frame.
    postures = Match.from_estimator(pipe, people).warp(pipe[0].transform(people))[1]
    mean = pipe[1].inverse_transform([pipe[-1].mean_])[0]
    for x, scenes in ((postures, bad.scenes), (mean, bad.behind)):
        bodies = pipe[0].inverse_transform([x])[0].reshape(40, 15, 3)
        for title, scene in zip(bad.titles, scenes, strict=True):
            frame = int(title.split("\n")[0].removeprefix("frame "))
            np.testing.assert_allclose(scene[0], bodies[[frame]], atol=1e-9)


def test_titles_agree_with_find_departures(bunch, pipe):
    people = [bunch.data[0][::-1], bunch.data[1]]
    for i, limit in ((0, None), (1, 1.5)):
        table = find_departures(pipe, people, limit=limit)
        table = table[table.performance == i]
        display = SkeletonDisplay.from_departures(pipe, people, performance=i, limit=limit)
        worst = table.iloc[0]
        limb = worst.feature if worst.feature == "pelvis_height" else worst.feature[:-2]
        size = abs(worst.deviation)
        size = f"{size:.0f}" if size >= 10 else f"{size:.1f}"
        assert f"frame {worst.peak}\n{limb} {size} std" in display.titles
    assert "more than 1.5 standard deviations" in display.heading
    display = SkeletonDisplay.from_departures(pipe, people, frames=[5, 30], limit=1e9)
    assert display.titles == ["frame 5\nno limb departs", "frame 30\nno limb departs"]


def test_tables_and_key_frames_are_accepted(bunch):
    labels = list("abcdefgh")
    frames = pd.concat(dict(zip(labels, map(pd.DataFrame, bunch.data), strict=True)))
    steps = DirectionCosines(bunch.skeleton), ASpace(0.99), KeyframeSynchronizer(40), ActionModel()
    drawn = []
    for X, output in ((bunch.data, "default"), (frames, "pandas")):
        with config_context(enable_metadata_routing=True):
            steps[2].set_fit_request(keyframes=True).set_transform_request(keyframes=True)
            pipe = make_pipeline(*map(clone, steps)).set_output(transform=output)
            pipe.fit(X, keyframes=bunch.keyframes)
        given = {"performance": 2, "limit": 1, "keyframes": bunch.keyframes}
        drawn.append(SkeletonDisplay.from_departures(pipe, X, **given))
    one, other = drawn
    assert other.heading.startswith("Trial 2 ('c') is accepted.")
    assert one.titles == other.titles
    np.testing.assert_allclose(np.array(one.scenes), np.array(other.scenes), atol=1e-9)
    with pytest.raises(ValueError, match=r"from_departures\(estimator, X, keyframes=\[...\]\)"):
        SkeletonDisplay.from_departures(pipe, frames)


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
    assert len(display.bones_[1]["departing"].get_paths()) == 2
    assert display.axes_[1].get_title().startswith("frame 15\nleft_")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        *(({"performance": bad}, "performance must be from 0 to 7, got")
          for bad in (8, -1, 1.5, True)),
        *(({"performance": bad}, "performance must be one number from 0 to 7")
          for bad in ("0", None, [0])),
        *(({"limit": bad}, "limit must be a number of standard deviations above 0, or None; got")
          for bad in (0, -1, np.nan)),
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
    with pytest.raises(ValueError, match="from_departures needs performances X"):
        SkeletonDisplay.from_departures(pipe, None)
    double = FunctionTransformer(lambda X: [2 * x for x in X])
    steps = *pipe[:2], double, LinearSynchronizer(20), ActionModel()
    odd = make_pipeline(*steps).fit(bunch.data)
    with pytest.raises(ValueError, match="whose features lead back to limbs; those found are"):
        SkeletonDisplay.from_departures(odd, bunch.data)
    with pytest.raises(TypeError, match="from_departures got 'keyframes'"):
        SkeletonDisplay.from_departures(pipe, bunch.data, keyframes=bunch.keyframes)


def test_real_subject_is_accepted_unless_standing_still(real_bends_of_three):
    """A model of the bends of three actors sees the fourth bend and stand still."""
    pipe, new = real_bends_of_three
    still = np.repeat(new[:1], len(new), axis=0)
    good, bad = (SkeletonDisplay.from_departures(pipe, [new, still], performance=i) for i in (0, 1))
    assert "is accepted" in good.heading
    assert "is not accepted" in bad.heading
    assert sum(map(len, good.marked)) < sum(map(len, bad.marked))
    assert any("neck" in marked_joints(bad, panel) for panel in (2, 3)), "upright at its height"


def test_heading_tells_departures_outside_the_aspace(bunch):
    """Neither of the two components moves the neck sideways."""
    steps = DirectionCosines(bunch.skeleton), ASpace(2), LinearSynchronizer(40), ActionModel()
    pipe = make_pipeline(*steps).fit(bunch.data)
    tilted = bunch.data[3].reshape(-1, 15, 3).copy()
    tilted[:, PAPER.index_of("head"), 0] += 0.15
    display = SkeletonDisplay.from_departures(pipe, [tilted.reshape(-1, 45), bunch.data[3]])
    assert "neck" in display.titles[0]
    assert find_departures(pipe, [tilted.reshape(-1, 45)]).rare.any()
    assert "is accepted: the model sees what the aSpace keeps," in display.heading
    plain = SkeletonDisplay.from_departures(
        pipe, [tilted.reshape(-1, 45), bunch.data[3]], performance=1
    )
    assert "Trial 1 is accepted.\n" in plain.heading


@pytest.fixture(scope="module")
def real_bends_of_three(bends):
    others = bends.actor != "bk"
    people = [x for x, other in zip(bends.data, others, strict=True) if other]
    steps = DirectionCosines(bends.skeleton), ASpace(0.95), DenseSynchronizer(100), ActionModel()
    pipe = make_pipeline(*steps).fit(people, actionmodel__groups=bends.actor[others])
    return pipe, bends.data[int(np.flatnonzero(~others)[0])]
