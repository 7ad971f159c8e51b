"""How sure a match is: intervals of its times, doubtful trials, and calibration."""

import pickle
import warnings

import numpy as np
import pytest
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
    Match,
    PartSynchronizer,
)
from sklearn_motionsync.inputs import validation

P = 60


@pytest.fixture(scope="module")
def fitted(bending_aspace):
    return DenseSynchronizer(P).fit(bending_aspace[:12])


def coverage(match, truth, nominal=0.9):
    lower, upper = match.interval(nominal)
    inside = (lower - 1e-9 <= truth) & (truth <= upper + 1e-9)
    return inside[:, 3:-3].mean()


# -- what an interval is ------------------------------------------------------------------


@pytest.mark.parametrize(
    "params",
    [{}, {"consensus": 0}, {"refine": True}],
    ids=str,
)
def test_intervals_hold_the_times_and_grow_with_the_coverage(params, bending_aspace):
    sync = DenseSynchronizer(P, **params).fit(bending_aspace[:9])
    match, before = sync.match(bending_aspace[9:14]), None
    for wanted in (0.5, 0.8, 0.9, 0.99):
        lower, upper = match.interval(wanted)
        assert lower.shape == upper.shape == (5, P)
        assert (np.diff(lower, axis=1) >= 0).all()
        assert (np.diff(upper, axis=1) >= 0).all()
        assert (lower >= 0).all()
        assert (upper <= P - 1).all()
        assert (lower <= match.times).all()
        assert (match.times <= upper).all()
        np.testing.assert_allclose(upper[:, [0, -1]], lower[:, [0, -1]], atol=1e-9)
        if before is not None:
            assert (lower <= before[0]).all()
            assert (upper >= before[1]).all()
        before = lower, upper


def test_the_pattern_is_certain_of_itself(fitted, bending_aspace):
    lower, upper = fitted.match([bending_aspace[fitted.pattern_index_]]).interval()
    np.testing.assert_allclose(lower, np.arange(P)[np.newaxis], atol=1e-6)
    np.testing.assert_allclose(upper, lower, atol=1e-6)


def test_trials_in_parts_have_the_same_intervals(bending_aspace, monkeypatch, tmp_path):
    X = np.stack([x[np.linspace(0, len(x) - 1, 50).astype(int)] for x in bending_aspace[:14]])
    sync = DenseSynchronizer(P).fit(X)
    np.save(tmp_path / "X.npy", X)
    monkeypatch.setattr(validation, "MANY", 5)
    in_parts, whole = sync.match(np.load(tmp_path / "X.npy", mmap_mode="r")), sync.match(X)
    alone, wanted = sync.match(X[3:4]), whole.interval()
    # A match tells of the fit that it is from, also when it was stored.
    sync.fit(X[:3])
    for match in (in_parts, pickle.loads(pickle.dumps(whole))):
        np.testing.assert_array_equal(match.interval(), wanted)
        assert match.reasons == whole.reasons
    np.testing.assert_array_equal(alone.interval(), np.array(wanted)[:, 3:4])
    assert alone.reasons == whole.reasons[3:4]


def test_units(fitted, bending_aspace):
    X = bending_aspace[12:15]
    match = fitted.match(X)
    frames = match.interval(0.9)
    for got, wanted in zip(match.interval(0.9, "percent"), frames, strict=True):
        np.testing.assert_allclose(got, wanted * 100 / (P - 1))
    last = np.array([len(x) - 1 for x in X])[:, np.newaxis] / 50.0
    for got, wanted in zip(match.interval(0.9, "seconds", X, 50.0), frames, strict=True):
        np.testing.assert_allclose(got, wanted / (P - 1) * last)
    with pytest.raises(ValueError, match="The frame rate of trial 0 is not known"):
        match.interval(0.9, "seconds")


def test_table(fitted, bending_aspace):
    X = [*bending_aspace[12:14], np.concatenate([bending_aspace[14]] * 2)]
    match = fitted.match(X)
    table = match.to_frame("percent", labels=["ann", "bob", "twice"], coverage=0.8)
    assert list(table.columns) == ["time", "offset", "rate", "lower", "upper", "doubtful"]
    lower, upper = match.interval(0.8, "percent")
    np.testing.assert_array_equal(table["lower"].to_numpy().reshape(3, P), lower)
    np.testing.assert_array_equal(table["upper"].to_numpy().reshape(3, P), upper)
    assert table.groupby(level=0)["doubtful"].all().tolist() == [False, False, True]
    assert "lower" not in match.to_frame()


@pytest.mark.parametrize("wrong", [0, 1, True, "0.9", np.nan])
def test_refused_coverages(wrong, fitted, bending_aspace):
    with pytest.raises(ValueError, match="coverage must be a probability above 0 and below 1"):
        fitted.match(bending_aspace[:1]).interval(wrong)


def test_matches_that_do_not_tell(bending, bending_aspace):
    X, given = bending_aspace[:5], {"keyframes": [k[:1] for k in bending.keyframes[:5]]}
    linear, parts = LinearSynchronizer(P), PartSynchronizer({"first": [0], "second": [1]})
    for match in (
        Match(np.tile(np.arange(5.0), (2, 1))),
        linear.fit(X).match(X),
        linear.fit(X, **given).match(X, **given),
        parts.fit(X).match_parts(X)["first"],
    ):
        for tell in (
            match.interval,
            lambda m=match: m.doubtful,
            lambda m=match: m.to_frame(coverage=0.9),
        ):
            with pytest.raises(ValueError, match=r"only DenseSynchronizer\.match does"):
                tell()


def test_single_precision_and_several_jobs(bending_aspace):
    X = [x.astype(np.float32) for x in bending_aspace[:12]]
    sync = DenseSynchronizer(P).fit(X)
    wide = sync.match(X).interval()
    for one, other in zip(wide, sync.set_params(n_jobs=2).match(X).interval(), strict=True):
        np.testing.assert_array_equal(one, other)
    double = DenseSynchronizer(P).fit(bending_aspace[:12]).match(bending_aspace[:12]).interval()
    assert np.abs(np.array(wide) - double).mean() < 0.2


# -- coverage -----------------------------------------------------------------------------


@pytest.mark.parametrize(("noise", "n_features"), [(0.005, 16), (0.05, 4)])
def test_coverage_of_known_warps_of_one_source(noise, n_features, known_warps):
    shares, widths = [], []
    for seed in range(4):
        X, truth = known_warps(seed, noise, n_features)
        match = DenseSynchronizer(100, pattern=0).fit(X).match(X[1:])
        shares.append(coverage(match, truth[1:]))
        lower, upper = match.interval()
        widths.append((upper - lower).mean())
    assert 0.85 < np.mean(shares) < 0.96
    # They are sharp: half-widths of hundredths of a frame where the noise is small.
    assert np.median(widths) < 2 * {0.005: 0.06, 0.05: 0.4}[noise]


@pytest.mark.nightly
def test_coverage_of_people_held_out(real_data, benchmark):
    """Key moments of people that had no part in the fit; constants are those of the package."""
    harness = benchmark("harness")
    shown = harness.BEND, harness.ELBOW, harness.STAND
    chosen = [event for event in harness.EVENTS if event[:2] in shown]
    inside = []
    for one in harness.read_people(real_data, chosen, patterns=4):
        actors = np.asarray(one.actors)
        for actor in np.unique(actors):
            train, test = np.flatnonzero(actors != actor), np.flatnonzero(actors == actor)
            space = ASpace().fit([one.poses[i] for i in train])
            known = space.transform([one.poses[i] for i in train])
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                sync = DenseSynchronizer(100).fit(known)
            match = sync.match(space.transform([one.poses[i] for i in test]))
            lower, upper = match.interval(0.9)
            for at in one.moments.values():
                moment = at[train[sync.pattern_index_]]
                for i, low, high in zip(test, lower, upper, strict=True):
                    if np.isfinite(moment + at[i]):
                        low, high = (np.interp(moment, np.arange(100), x) for x in (low, high))
                        inside.append(low <= at[i] <= high)
    assert len(inside) > 60
    assert 0.87 < np.mean(inside) <= 1


# -- doubtful trials ----------------------------------------------------------------


def test_trials_that_are_repeated_cut_off_or_still_are_doubtful(fitted, bending_aspace):
    own = bending_aspace[12:22]
    assert not fitted.match(own).doubtful.any()
    wrong = {
        "repeated": [np.concatenate([x, x]) for x in own],
        "cut off": [x[: len(x) // 2] for x in own],
        "still": [x[:1] + 1e-3 * np.sin(np.arange(40.0))[:, np.newaxis] for x in own],
    }
    for some in wrong.values():
        match = fitted.match(some)
        assert match.doubtful.mean() > 0.8
        assert "it may be cut off, repeated or another movement" in match.reasons[0]


def test_the_way_back_of_a_movement_that_is_alike_both_ways_is_not_doubted(bends):
    """A bend backwards is a bend: docs/howto/timing.md names it."""
    X = make_pipeline(DirectionCosines(bends.skeleton), ASpace()).fit_transform(bends.data)
    sync = DenseSynchronizer(P).fit(X[:18])
    assert not sync.match(X[18:]).doubtful.any()
    assert sync.match([x[::-1] for x in X[18:]]).doubtful.mean() < 0.5
    assert sync.match([np.concatenate([x, x]) for x in X[18:]]).doubtful.mean() > 0.6


# -- key-frames and calibration -----------------------------------------------------------


def test_exact_keyframes_pin_the_interval(bending, bending_aspace):
    X, keyframes = bending_aspace[:10], bending.keyframes[:10]
    sync = DenseSynchronizer(P, refine=True).fit(X, keyframes=keyframes)
    match = sync.match(X[:4], keyframes=keyframes[:4])
    lower, upper = match.interval()
    for k in sync.keyframes_:
        around = [int(np.floor(k)), int(np.ceil(k))]
        np.testing.assert_allclose(lower[:, around], match.times[:, around])
        np.testing.assert_allclose(upper[:, around], match.times[:, around])
    free = sync.match(X[:4]).interval()
    assert (upper - lower).mean() < (free[1] - free[0]).mean()


def test_calibration_by_keyframes(bending, bending_aspace):
    """Intervals that are wrong by a factor hold 90 % of the key-frames of others afterwards."""
    sync = DenseSynchronizer(P).fit(bending_aspace[:10])
    sync.interval_factor_ = 5.0
    known = slice(10, 25)
    same = sync.calibrate(bending_aspace[known], bending.keyframes[known])
    assert same is sync
    assert 0 < sync.interval_factor_ < 5
    match, others = sync.match(bending_aspace[25:]), bending.keyframes[25:]
    lower, upper = match.interval()
    own = np.array(bending.keyframes[sync.pattern_index_], dtype=float)
    own *= (P - 1) / (len(bending_aspace[sync.pattern_index_]) - 1)
    inside = []
    for x, k, low, high in zip(bending_aspace[25:], others, lower, upper, strict=True):
        at = np.asarray(k) * (P - 1) / (len(x) - 1)
        low, high = (np.interp(own, np.arange(P), bounds) for bounds in (low, high))
        inside.extend((low <= at) & (at <= high))
    assert 0.75 < np.mean(inside) <= 1
    again = sync.interval_factor_
    sync.calibrate(bending_aspace[known], bending.keyframes[known])
    np.testing.assert_allclose(sync.interval_factor_, again)


def test_calibration_by_too_few_keyframes(bending, bending_aspace, fitted):
    with pytest.raises(ValueError, match=r"8 key-frames .* at least 9 are needed"):
        fitted.calibrate(bending_aspace[:8], [k[:1] for k in bending.keyframes[:8]])
    assert fitted.interval_factor_ == 1
