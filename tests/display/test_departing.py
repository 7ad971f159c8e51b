"""Strips of stick figures that show what is wrong with a performance."""

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
from sklearn_motionsync.display.departing import strip_of

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


# -- which frames, which limbs ----------------------------------------------------------


@pytest.mark.parametrize("limb", ENDS)
def test_a_limb_is_marked_on_the_bones_it_is(limb):
    feature = limb if limb == "pelvis_height" else f"{limb}_y"
    strip = strip_of(scores_of(**{feature: {20: -7}}), NAMES, [20], 3)
    assert sorted(strip.marked[0]) == bones(*ENDS[limb])
    assert strip.titles == [f"frame 20\n{limb} 7.0 std"]


def test_every_limb_has_bones():
    for limb in LIMBS:
        (marked,) = strip_of(scores_of(**{f"{limb}_x": {0: 5}}), NAMES, 1, 3).marked
        assert len(marked) == (2 if limb in ("hip", "shoulder") else 1)


def test_each_part_of_the_clock_is_shown_at_its_worst():
    scores = scores_of(torso_z={3: 4, 12: 12.4}, left_thigh_x={14: -30, 44: 2.9}, hip_x={59: 3.1})
    strip = strip_of(scores, NAMES, 6, 3)
    # Without departures in its middle: of 20 to 29, ...
    assert strip.frames == [3, 14, 24, 34, 44, 59]
    assert [title.split("\n")[1] for title in strip.titles] == [
        "torso 4.0 std",
        "left_thigh 30 std",
        *["no limb departs"] * 3,
        "hip 3.1 std",
    ]
    thigh, torso = bones(*ENDS["left_thigh"]), bones(*ENDS["torso"])
    assert [sorted(m) for m in strip.marked] == [
        torso, sorted(thigh + torso), [], [], [], bones(*ENDS["hip"])
    ]  # fmt: skip
    assert strip_of(scores, NAMES, 1, 3).frames == [14]
    assert strip_of(scores, NAMES, 100, 3).frames == list(range(60))


def test_frames_asked_for_stand_for_those_around_them():
    scores = scores_of(torso_z={24: 9, 27: 8, 36: 5})
    # 26 is as far from one as from the other; 5 frames are a twelfth of the clock.
    titles = strip_of(scores, NAMES, [22, 30], 3).titles
    assert titles == ["frame 22\ntorso 9.0 std", "frame 30\ntorso 8.0 std"]
    assert strip_of(scores, NAMES, [30, 22, 30], 3).titles == [titles[1], titles[0], titles[1]]
    assert strip_of(scores, NAMES, [41], 3).titles == ["frame 41\ntorso 5.0 std"]
    assert strip_of(scores, NAMES, [42], 3).titles == ["frame 42\nno limb departs"]


# -- of people ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bunch():
    return make_bending(8, n_frames=40, random_state=1)


@pytest.fixture(scope="module")
def pipe(bunch):
    steps = DirectionCosines(bunch.skeleton), ASpace(0.99), DenseSynchronizer(40), ActionModel()
    return make_pipeline(*steps).fit(bunch.data)


def marked_joints(display, panel):
    return {PAPER.joints[b] for _, b in display.marked[panel]}


def test_who_stands_still_does_not_bend(bunch, pipe):
    still = np.repeat(bunch.data[0][:1], 40, axis=0)
    people = [bunch.data[3], still]
    good, bad = (
        SkeletonDisplay.from_departures(pipe, people, performance=i, frames=3) for i in (0, 1)
    )
    assert good.heading_.get_text().startswith("Performance 0 is accepted.")
    assert bad.heading_.get_text().startswith("Performance 1 is not accepted.")
    assert sum(map(len, good.marked)) < 3 < sum(map(len, bad.marked))
    assert "neck" in marked_joints(bad, 1), "the torso"
    # What is drawn: the whole posture, also what the aSpace leaves out, and the mean at the frame.
    postures = Match.from_estimator(pipe, people).warp(pipe[0].transform(people))[1]
    mean = pipe[1].inverse_transform([pipe[-1].mean_])[0]
    for x, scenes in ((postures, bad.scenes), (mean, bad.behind)):
        bodies = pipe[0].inverse_transform([x])[0].reshape(40, 15, 3)
        for title, scene in zip(bad.titles, scenes, strict=True):
            frame = int(title.split("\n")[0].removeprefix("frame "))
            np.testing.assert_allclose(scene[0], bodies[[frame]], atol=1e-9)


def test_the_strip_and_the_table_say_the_same(bunch, pipe):
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


def test_tables_and_key_frames(bunch):
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
    assert other.heading.startswith("Performance 2 ('c') is accepted.")
    assert one.titles == other.titles
    np.testing.assert_allclose(np.array(one.scenes), np.array(other.scenes), atol=1e-9)
    with pytest.raises(ValueError, match=r"from_departures\(estimator, X, keyframes=\[...\]\)"):
        SkeletonDisplay.from_departures(pipe, frames)


def test_the_limit_is_in_predicted_standard_deviations(bunch, pipe):
    few, many = (
        SkeletonDisplay.from_departures(pipe, bunch.data, frames=4, limit=limit)
        for limit in (2, 0.5)
    )
    assert "more than 2 standard deviations" in few.heading
    assert sum(map(len, few.marked)) < sum(map(len, many.marked))
    display = SkeletonDisplay.from_departures(pipe, bunch.data, frames=[5, 30], limit=1e9)
    assert display.titles == ["frame 5\nno limb departs", "frame 30\nno limb departs"]


def test_without_an_aspace_and_on_given_axes(bunch):
    """An arm that is stretched out for a while, which only the postures themselves show."""
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
    ("given", "message"),
    [
        *(({"performance": bad}, "performance=.* is out of range: there are 8 performances")
          for bad in (8, -1, 1.5, "0", None, True, [0])),
        *(({"limit": bad}, "limit must be a number of standard deviations above 0, or None; got")
          for bad in (0, -1, np.nan, "3", [3])),
        ({"frames": 0}, "frames must be how many"),
        ({"frames": [40]}, "frames must be from 0 to 39"),
        ({"frames": "all"}, "frames must be from 0 to 39"),
        ({"at": 2}, "at must be a share of the time"),
        ({"azimuth": "left"}, "azimuth must be a number of degrees"),
    ],
)  # fmt: skip
def test_departures_that_cannot_be_drawn(bunch, pipe, given, message):
    with pytest.raises(ValueError, match=message):
        SkeletonDisplay.from_departures(pipe, bunch.data, **given)


def test_pipelines_without_limbs(bunch, pipe):
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


def test_real_people_who_do_something_else(real_bends_of_three):
    """A model of three actors' bends; the fourth one bends, and stands still."""
    pipe, new = real_bends_of_three
    still = np.repeat(new[:1], len(new), axis=0)
    good, bad = (SkeletonDisplay.from_departures(pipe, [new, still], performance=i) for i in (0, 1))
    assert "is accepted" in good.heading
    assert "is not accepted" in bad.heading
    assert sum(map(len, good.marked)) < sum(map(len, bad.marked))
    assert any("neck" in marked_joints(bad, panel) for panel in (2, 3)), "upright at its height"


def test_a_model_accepts_what_its_aspace_does_not_see(bunch):
    """Of two components none moves the neck sideways."""
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
    assert "Performance 1 is accepted.\n" in plain.heading


@pytest.fixture(scope="module")
def real_bends_of_three(bends):
    others = bends.actor != "bk"
    people = [x for x, other in zip(bends.data, others, strict=True) if other]
    steps = DirectionCosines(bends.skeleton), ASpace(0.95), DenseSynchronizer(100), ActionModel()
    pipe = make_pipeline(*steps).fit(people, actionmodel__groups=bends.actor[others])
    return pipe, bends.data[int(np.flatnonzero(~others)[0])]
