"""CycleSegmenter: phases of takes that are known, errors, and the scikit-learn contract."""

import numpy as np
import pandas as pd
import pytest
from scipy.ndimage import gaussian_filter1d
from sklearn.preprocessing import StandardScaler
from sklearn.utils import estimator_checks
from sklearn_motionsync import (
    FrameWise,
    Skeleton,
    to_frame,
    to_trials,
)
from sklearn_motionsync.datasets import make_bending, make_gait
from sklearn_motionsync.display import CycleDisplay
from sklearn_motionsync.takes import CycleSegmenter

from made_bodies import standing, turned

HIP = 0


@pytest.fixture(scope="module")
def gait():
    return make_gait(6, 4, takes=True, warp=2, random_state=0)


@pytest.fixture(scope="module")
def fitted(gait):
    return CycleSegmenter(start=HIP).fit(gait.data[:3])


def errors_of_cuts(locations, times):
    """Deviations of the true phases of cuts from their mean, in cycles."""
    at = [times[i][k] for i, k in zip(locations["take"], locations["start"], strict=True)]
    turns = np.exp(2j * np.pi * np.array(at))
    return np.angle(turns * np.conj(turns.mean())) / (2 * np.pi)


def slowing_take(n_cycles=8, n_frames=800):
    """A take that slows down, and its phases."""
    t = np.linspace(0, 1, n_frames)
    phases = n_cycles * (t + 0.05 * np.sin(np.pi * t))
    angle = 2 * np.pi * phases[:, np.newaxis]
    return np.sin(angle + np.arange(3)) + 0.5 * np.cos(2 * angle), phases


# -- results --------------------------------------------------------------------------------


def test_takes_of_new_subjects_are_cut_at_the_same_phase(gait):
    """The truth is the phase that the takes were made with."""
    takes = FrameWise(StandardScaler()).fit_transform(gait.data)
    new, times = takes[3:], gait.times[3:]
    fitted = CycleSegmenter(start=HIP).fit(takes[:3])
    cycles, locations = fitted.segment(new)
    assert np.abs(errors_of_cuts(locations, times)).mean() < 0.006
    assert set(locations["take"]) == {0, 1, 2}
    assert locations["complete"].all()
    assert (locations["score"] > 0.95).all()
    assert np.ptp(errors_of_cuts(locations, times)) < 0.05
    for cycle, (_, row) in zip(cycles, locations.iterrows(), strict=True):
        np.testing.assert_array_equal(cycle, new[row["take"]][row["start"] : row["stop"]])
    # Neighbouring cycles share a frame.
    inner = locations["take"].to_numpy()[1:] == locations["take"].to_numpy()[:-1]
    np.testing.assert_array_equal(
        locations["start"].to_numpy()[1:][inner], locations["stop"].to_numpy()[:-1][inner] - 1
    )


@pytest.mark.parametrize(("n_cycles", "n_frames"), [(8, 800), (45, 2000)])
def test_phases_follow_takes_that_slow_down(n_cycles, n_frames):
    take, phases = slowing_take(n_cycles, n_frames)
    segmenter = CycleSegmenter(start=0).fit(take)
    _, locations = segmenter.segment(take)
    assert len(locations) in (n_cycles - 1, n_cycles)
    np.testing.assert_allclose(np.diff(phases[locations["start"]]), 1, atol=0.05)
    lengths = (locations["stop"] - locations["start"] - 1).to_numpy()
    assert lengths.max() > 1.25 * lengths[0]


@pytest.mark.parametrize(("start", "k"), [(1, 1), ("x2", 2)])
def test_cycles_begin_at_the_maximum_of_the_start_feature(start, k, gait):
    segmenter = CycleSegmenter(start=start).fit(gait.data[:2])
    assert segmenter.start_ == f"x{k}"
    cycles, _ = segmenter.segment(gait.data[:2])
    ends = np.mean([c[0, k] for c in cycles])
    assert ends > np.quantile(np.concatenate(cycles)[:, k], 0.9)


def test_cycles_begin_by_default_with_the_feature_that_repeats_best():
    """Not with the largest, which drift."""
    t = 2 * np.pi * np.arange(500) / 50
    drift = np.sin(t / 7.3)
    take = np.column_stack([3 * np.sin(t) + drift, 2 * np.cos(t), 4 * np.sin(t) - 2 * drift])
    assert CycleSegmenter().fit(take).start_ == "x1"
    # At its maximum, wherever in the cycle a take begins.
    for first in (0, 17, 40):
        segmenter = CycleSegmenter().fit(take[first:])
        starts = segmenter.segment(take[first:])[1]["start"] + first
        assert ((starts + 25) % 50 - 25).abs().max() <= 1


def test_takes_of_other_frame_rates_are_cut_at_the_same_phase(gait, fitted):
    tables = [
        pd.DataFrame(x).iloc[::step] for x, step in zip(gait.data[3:], (1, 2, 3), strict=True)
    ]
    for table in tables:
        table.attrs["frame_rate"] = 100
    _, locations = fitted.segment(tables)
    _, expected = fitted.segment(gait.data[3:])
    assert locations["take"].tolist() == expected["take"].tolist()
    starts = locations["start"] * (locations["take"] + 1)
    assert (starts - expected["start"]).abs().max() <= 4
    with pytest.warns(UserWarning, match="50 frames a second"):
        CycleSegmenter(start=HIP, period=(20, 200)).fit(tables)


def test_cycles_begin_with_the_foot_that_is_farther_ahead():
    """Legs that swing, the left one farther, of a body that walks in a curve."""
    skeleton, t = Skeleton.paper(), np.linspace(0, 1, 400)
    joints = np.tile(standing().reshape(15, 3), (400, 1, 1))
    for k, joint in enumerate(skeleton.joints):
        side = 1 if joint.startswith("left") else -1
        swing = {"knee": 0.15, "ankle": 0.4}.get(joint.split("_")[-1], 0)
        swing *= 1.2 if side > 0 else 1
        joints[:, k, 2] = side * swing * np.cos(2 * np.pi * (5 * t - 0.3))
    joints[..., 0] += 2
    take = np.stack([turned(x, a) for x, a in zip(joints, np.rad2deg(3 * t), strict=True)])
    take = take.reshape(400, -1)
    for start, name, phase in ((None, "left", 0.3), ("right", "right", 0.8)):
        segmenter = CycleSegmenter(skeleton, start=start).fit(take)
        assert segmenter.start_ == name
        cycles, locations = segmenter.segment(take)
        assert cycles[0].shape[1] == 45
        true = (np.arange(6) + phase) / 5 * 399
        np.testing.assert_allclose(locations["start"], true[: len(locations)], atol=3)


@pytest.mark.parametrize(("swing", "is_foot"), [(0.031, False), (0.042, True)])
def test_cycles_begin_with_a_foot_in_gait_only(swing, is_foot):
    """A body that nods; its ankles move against each other by four swings, of a leg of a metre."""
    joints = np.tile(standing().reshape(15, 3), (400, 1, 1))
    nod = np.sin(2 * np.pi * 5 * np.linspace(0, 1, 400))
    joints[:, 2] += nod[:, np.newaxis] * [0, -0.1, 0.3]
    joints[:, [8, 14], 2] += swing * nod[:, np.newaxis] * [1, -1]
    start = CycleSegmenter(Skeleton.paper()).fit(joints.reshape(400, -1)).start_
    assert (start in ("left", "right")) == is_foot


def steps(weaker=1.0):
    """Steps of 40 frames, of which every second one may be weaker."""
    angle = 2 * np.pi * np.arange(640)[:, np.newaxis] / 40
    strengths = np.repeat(np.tile([1, weaker], 8), 40)
    return (np.sin(angle + np.arange(3)) + 0.5 * np.cos(2 * angle)) * strengths[:, np.newaxis]


def test_warns_where_several_cycles_fit_and_period_selects_one():
    """Every second step is stronger: a cycle may be a step, or two."""
    segmenter, X = CycleSegmenter(), [steps(), steps(0.4)]
    message = r"Trial 1: several cycles fit, of 38\.\d, 80\.0 frames; 80\.0 is taken"
    report = segmenter.report(X)
    assert [len(periods) for periods in report["periods"]] == [1, 2]
    assert report["period"][1] == report["periods"][1][1]
    with pytest.warns(UserWarning, match=message + r".* for 1 of 2 takes\. Give period="):
        segmenter.fit(X)
    chosen = CycleSegmenter(period=(20, 60)).fit(X)
    np.testing.assert_allclose(chosen.periods_, report["periods"][1][0], rtol=0.1)
    assert len(chosen.segment(X[1:])[0]) >= 14
    with pytest.raises(ValueError, match=r"not cyclic within period=\(8, 12\)"):
        CycleSegmenter(period=(8, 12)).fit(X)


def test_of_several_cycles_that_fit_the_learnt_one_is_taken():
    """The fit has seen steps that are alike; later every second one is stronger."""
    steady, beat = steps(), steps(0.4)
    assert CycleSegmenter().report([beat])["period"][0] == pytest.approx(80, rel=0.05)
    segmenter = CycleSegmenter(start=0).fit([steady])
    assert segmenter.report([beat])["period"][0] == pytest.approx(40, rel=0.05)
    _, locations = segmenter.segment([beat])  # a warning is an error
    np.testing.assert_allclose(np.diff(locations["start"]), 40, atol=4)
    assert len(locations) >= 14
    display = CycleDisplay.from_estimator(segmenter, [beat])
    assert display.repeats.period == pytest.approx(40, rel=0.1)
    with pytest.warns(UserWarning, match="several cycles fit"):
        CycleSegmenter(start=0).fit([steady, beat])
    slow = CycleSegmenter(start=0).fit([np.repeat(steady, 8, axis=0)])
    # Alone, much weaker steps would not make a take cyclic.
    for other, take in ((slow, beat), (segmenter, steps(0.15))):
        with pytest.warns(
            UserWarning, match=r"several cycles fit, of .* 80\.\d is taken"
        ) as caught:
            other.segment([take])
        assert caught[0].filename == __file__


def squats(sizes):
    """Squats of 80 frames each, standing between them."""
    depth = (1 - np.cos(2 * np.pi * np.arange(80) / 80)) / 2
    one = np.column_stack([depth, depth**2, depth * (1 - depth)])
    return np.concatenate([size * one for size in sizes])


def test_repetitions_are_cut_from_rest_to_rest():
    """Five squats are five, also between standing, and of a person who squats less deep."""
    stand = np.zeros((150, 3))
    segmenter = CycleSegmenter().fit([squats([1] * 4), squats([0.9] * 3)])
    assert segmenter.start_ == "rest"
    X = [squats([1] * 5), np.concatenate([stand, squats([0.8] * 5), stand])]
    X.append(np.concatenate([X[1][:310], stand, X[1][310:]]))
    _, table = segmenter.segment(X)
    assert table["complete"].all()
    assert table["take"].value_counts(sort=False).tolist() == [5, 5, 5]
    offsets = (table["start"] - np.repeat([0, 70, 60], [5, 7, 3]) + 40) % 80 - 40
    assert offsets.abs().max() <= 2
    assert segmenter.report(X)["n_cycles"].round().tolist() == [5, 5, 5]


def test_repetitions_that_are_far_smaller_are_left_out():
    """Two shallow squats are nearer to standing than to a squat."""
    segmenter = CycleSegmenter(start=0, incomplete=True).fit([squats([1] * 10)])
    _, table = segmenter.segment(squats([1] * 6 + [0.2] * 2 + [1] * 2))
    whole = table[table["complete"]]
    assert whole["start"].tolist() == [*range(40, 400, 80), 680]
    assert table["stretch"].tolist() == [0] * 7 + [1] * 3


def test_segment_warns_of_cycles_that_hold_a_rest():
    well = squats([1] * 10)
    rests = np.concatenate([well[:440], np.repeat(well[440:441], 100, axis=0), well[440:]])
    segmenter = CycleSegmenter(start=0).fit([well])
    segmenter.segment([well])  # a warning is an error
    X = to_trials(to_frame([well, rests], trials=["first", "second"]))
    message = (
        r"Trial 1 \('second'\): the cycle from start 4\d\d to stop 621 has 1\d\d frames, but the "
        r"period of the take is 80\.\d\. It may hold several repetitions, .* 1 of 18 whole cycles"
        r"\. Look at the cuts with CycleDisplay"
    )
    with pytest.warns(UserWarning, match=message) as caught:
        segmenter.segment(X)
    assert len(caught) == 1
    assert caught[0].filename == __file__
    # The pieces at both ends may be of any length.
    pieces = segmenter.set_params(incomplete=True).segment([well])[1].iloc[[0, -1]]
    assert not pieces["complete"].any()
    assert (pieces["stop"] - pieces["start"] < 45).all()


def test_segment_warns_of_cycles_that_are_short():
    well = squats([1] * 20)
    hasty = np.concatenate([well[:400], well[400:560:2], well[560:]])
    segmenter = CycleSegmenter(start=0).fit(well)
    with pytest.warns(UserWarning, match="has 4. frames, .* only a part of a repetition.* 1 of 19"):
        segmenter.segment(hasty)


# -- errors ---------------------------------------------------------------------------------


def test_fit_refuses_takes_that_are_not_cyclic(gait):
    bunch = make_bending(2, random_state=0)
    with pytest.raises(ValueError, match=r"Trial 0: not cyclic.* 0.00 at 0.00 cycles; threshold"):
        CycleSegmenter(bunch.skeleton).fit(bunch.data)
    noise = np.random.default_rng(0).normal(size=(200, 4))
    with pytest.raises(ValueError, match=r"not cyclic. Its .* 0\.\d\d at .*; threshold=0.4"):
        CycleSegmenter().fit(noise)
    short = gait.data[1][: round(1.52 * CycleSegmenter().report(gait.data)["period"][1])]
    named = to_trials(to_frame([gait.data[0], short], trials=["ann", "bob"]))
    report = CycleSegmenter().report(named)
    assert report["cyclic"].to_dict() == {"ann": True, "bob": False}
    with pytest.raises(ValueError, match=r"Trial 0 \('bob'\): holds 1\.\d\d cycles"):
        CycleSegmenter().fit(named[1:])


def test_takes_of_as_many_movements_have_no_common_cycle():
    """Each moves other features, so that none follows the mean of all."""
    t = 2 * np.pi * np.arange(200) / 40
    circle = np.column_stack([np.sin(t), np.cos(t)])
    takes = [np.pad(circle, ((0, 0), (2 * k, 8 - 2 * k))) for k in range(5)]
    with pytest.raises(ValueError, match="Trial 0: does not follow the pattern"):
        CycleSegmenter().fit(takes)
    with pytest.raises(ValueError, match="None of the 5 takes is cyclic"):
        CycleSegmenter(not_cyclic="skip").fit(takes)


def test_a_take_of_few_cycles_teaches_with_the_others(gait):
    """It does not repeat often enough by itself, and follows the cycle of the others."""
    whole, other = gait.data[:2]
    short = other[: round(1.52 * CycleSegmenter().report(gait.data)["period"][1])]
    segmenter = CycleSegmenter(start=HIP).fit([whole, short])
    assert np.isfinite(segmenter.periods_).all()
    report = segmenter.report([short, whole[:50]])
    assert report["cyclic"].tolist() == [True, False]
    assert report["n_cycles"][0] == pytest.approx(1.52, abs=0.1)
    assert report["reason"].tolist() == ["", "does not follow the pattern"]
    with pytest.raises(ValueError, match=r"Trial 1: does not .* 0\.5 is required.* set not_cyclic"):
        segmenter.segment([short, whole[:50]])


@pytest.mark.parametrize("n_features", [1, 2])
def test_in_few_features_only_what_repeats_by_itself_follows(n_features):
    """All that goes up and down is like the cycle of a single feature."""
    rng, skip = np.random.default_rng(0), CycleSegmenter(start=0, not_cyclic="skip")
    t = 2 * np.pi * np.arange(400)[:, np.newaxis] / 50
    skip.fit([np.sin(t + k + np.arange(n_features)) + 0.4 * np.cos(2 * t) for k in range(3)])
    noise = list(gaussian_filter1d(rng.normal(size=(20, 600, n_features)), 8, axis=1))
    follows, repeats = skip.report(noise)["cyclic"], CycleSegmenter().report(noise)["cyclic"]
    assert not (follows & ~repeats).any()
    assert follows.sum() <= 8


def test_threshold_is_higher_below_two_cycles():
    """Of 1.7 cycles 0.7 overlap another: the threshold is divided by the square root of that."""
    t = 2 * np.pi * np.arange(300)[:, np.newaxis] / 100
    waves = np.sin(t + np.arange(3))
    for threshold, cyclic in ((0.9, [True, False]), (0.7, [True, True])):
        report = CycleSegmenter(threshold=threshold).report([waves, waves[:170]])
        assert (report["strength"] > 0.95).all()
        assert report["cyclic"].tolist() == cyclic


def test_takes_that_are_not_cyclic_can_be_skipped(gait):
    still, skip = np.zeros((200, 4)), CycleSegmenter(start=HIP, not_cyclic="skip")
    mixed = [still, *gait.data[:2], gait.data[0][:60]]
    cycles, locations = fit_and_segment(skip, mixed)
    expected, alone = fit_and_segment(CycleSegmenter(start=HIP), gait.data[:2])
    assert_same((cycles, locations.assign(take=locations["take"] - 1)), (expected, alone))
    assert np.isnan(skip.periods_).tolist() == [True, False, False, True]
    nothing, locations = skip.segment([still])
    assert nothing == []
    assert list(locations) == ["take", "stretch", "start", "stop", "complete", "score"]
    with pytest.raises(ValueError, match="None of the 2 takes is cyclic"):
        skip.fit([still, still])
    # The earlier fit is as it was.
    assert all(map(np.array_equal, skip.segment(mixed)[0], expected))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda X: [X[0], np.where(np.eye(len(X[1]), 4) > 0, np.nan, X[1])], "Trial 1, frame 0, "),
        (lambda X: [X[0], X[1][:, :3]], "Trial 1 has 3 features a frame, trial 0 has 4"),
        (lambda X: [X[0], X[1][:, 0]], "Trial 1 has shape"),
        (lambda X: [], "0 trials"),
        (lambda X: X[0][:, 0], r"one take \(n_frames, n_features\), or a list"),
        (lambda X: 3.0, r"A set of trials is .*got float"),
    ],
)
def test_errors_name_the_bad_take(change, message, gait, fitted):
    for method in (CycleSegmenter().fit, CycleSegmenter().report, fitted.segment):
        with pytest.raises(ValueError, match=message):
            method(change(gait.data))


def test_takes_of_other_features_are_refused(fitted):
    with pytest.raises(ValueError, match="3 features a frame, but CycleSegmenter is expecting"):
        fitted.segment([np.zeros((99, 3))])


LEGS = ["pelvis", "neck", "left_knee", "left_ankle", "right_knee", "right_ankle"]


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"start": "knee"}, "no feature 'knee'; there are 18: x0, x1, x2"),
        ({"start": "ahead"}, "start='ahead' needs a skeleton in space"),
        (
            {"start": "ahead", "skeleton": Skeleton(LEGS, [-1, 0, 0, 2, 0, 4])},
            r"start='ahead' needs a skeleton .* hips or shoulders",
        ),
        *(
            ({"period": period}, "period must be two numbers of frames, the least")
            for period in ((40,), (60, 40), (1.9, 60), (2, np.nan), ("20", "60"))
        ),
    ],
)  # fmt: skip
def test_refuses_wrong_parameters(params, message, gait):
    with pytest.raises(ValueError, match=message):
        CycleSegmenter(**params).fit(np.tile(gait.data[0], 5)[:, :18] + np.arange(18))
    CycleSegmenter(period=(2, 60)).report(gait.data)


# -- the contract -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    [
        "check_complex_data",
        "check_do_not_raise_errors_in_init_or_set_params",
        "check_estimator_cloneable",
        "check_estimator_repr",
        "check_estimator_sparse_array",
        "check_estimators_unfitted",
        "check_fit1d",
        "check_get_params_invariance",
        "check_no_attributes_set_in_init",
        "check_param_validation",
        "check_parameters_default_constructible",
        "check_set_params",
        "check_valid_tag_types",
    ],
)
def test_scikit_learn_checks(name):
    """The others fit noise, in which nothing repeats."""
    getattr(estimator_checks, name)("CycleSegmenter", CycleSegmenter())


def fit_and_segment(segmenter, X):
    return segmenter.fit(X).segment(X)


def assert_same(answer, expected):
    (cycles, locations), (others, other) = answer, expected
    assert all(np.array_equal(a, b) for a, b in zip(cycles, others, strict=True))
    pd.testing.assert_frame_equal(locations, other)


def test_segment_gives_equal_results_for_every_kind_of_collection(gait):
    X = [x[:380] for x in gait.data[:2]]
    expected = fit_and_segment(CycleSegmenter(start=HIP), X)
    for given in (np.stack(X), to_frame(X, columns=list("hkaf"))):
        assert_same(fit_and_segment(CycleSegmenter(start=HIP), given), expected)
    takes = to_frame(X, trials=["ann", "bob"], columns=list("hkaf"))
    cycles, locations = fit_and_segment(CycleSegmenter(start="h"), takes)
    assert set(locations["take"]) == {"ann", "bob"}
    assert to_frame(cycles).index.names == ["trial", "part", "frame"]


def test_a_single_take_is_a_list_of_one(gait, fitted):
    take = gait.data[0]
    expected = fit_and_segment(CycleSegmenter(start=HIP), [take])
    assert_same(fit_and_segment(CycleSegmenter(start=HIP), take), expected)
    table = pd.DataFrame(take, columns=list("hkaf"))
    cycles, locations = fit_and_segment(CycleSegmenter(start="h"), table)
    assert_same((cycles, locations), expected)
    assert cycles[1].attrs["trial"] == (0, 1)
    assert list(to_frame(cycles).index.names) == ["take", "part", "frame"]
    # A take among others is cut as alone.
    _, whole = fitted.segment(gait.data)
    for i in (5, 0):
        alone = fitted.segment([gait.data[i]])[1]
        among = whole[whole["take"] == i].assign(take=0).reset_index(drop=True)
        pd.testing.assert_frame_equal(alone, among)


def test_a_feature_that_counts_the_time_is_warned_of():
    takes = make_gait(2, n_cycles=4, takes=True, random_state=0).data
    timed = [np.column_stack([x, np.arange(len(x)) / 100]) for x in takes]
    with pytest.warns(UserWarning, match="Feature 4: increases evenly"):
        CycleSegmenter(start=0).fit(timed)
