"""MotionTracker: equal results on all ways in, lost phases, and what is refused."""

import pickle

import numpy as np
import pandas as pd
import pytest
from sklearn import clone
from sklearn.exceptions import NotFittedError
from sklearn_motionsync import DenseSynchronizer, DirectionCosines, LinearSynchronizer
from sklearn_motionsync.body import JointNoise
from sklearn_motionsync.live import MotionTracker, Track

LIMBS = np.arange(1, 37).reshape(12, 3)


def movement(size, n=60):
    t = np.linspace(0, 1, n)
    return np.column_stack([size * np.cos(6 * t), size * np.sin(6 * t), size * np.sin(3 * t)])


TRAINING = [movement(0.9, 55), movement(1.0, 60), movement(1.1, 62), movement(1.2, 65)]


@pytest.fixture(scope="module")
def tracker():
    return MotionTracker(LinearSynchronizer(), 100, noise=0.02).fit(TRAINING)


@pytest.fixture
def running(tracker):
    return pickle.loads(pickle.dumps(tracker))


@pytest.fixture
def take():
    x = movement(1.05) + 0.02 * np.random.default_rng(0).standard_normal((60, 3))
    x[20:40, 1] = np.nan
    x[30:35] = np.nan
    return x


def assert_same(a, b):
    for left, right in zip(a, b, strict=True):
        np.testing.assert_array_equal(left, right)


# -- equal results on all ways in ---------------------------------------------------------


def test_facts_of_takes_are_compared_where_they_matter():
    def tables(X, **attrs):
        out = [pd.DataFrame(x) for x in X]
        for df in out:
            df.attrs |= attrs
        return out

    facts = {"frame_rate": 50, "units": "m", "up": "y"}
    fitted = MotionTracker(LinearSynchronizer(), 30, noise=0.02).fit(tables(TRAINING, **facts))
    (fast,) = tables([movement(1.0, 120)], **facts | {"frame_rate": 100})
    (turned,) = tables([movement(1.0)], **facts | {"units": "mm", "up": "z"})
    # With times the frame rate does not matter.
    assert len(fitted.track(fast, times=np.arange(120) / 2).phases) == 120
    with pytest.warns(UserWarning, match="100 frames a second"):
        fitted.track(fast)
    with pytest.raises(ValueError, match="mm"):
        fitted.track(turned)


def test_step_equals_track(tracker, running, take):
    """To the last bit, also through a pickle, beside other takes, and after a reset."""
    track = tracker.track(take)
    for i, frame in enumerate(take):
        if i == 31:
            running = pickle.loads(pickle.dumps(running))
            running.track(take[:9])
            running.smooth(take[:9])
        assert_same(running.step(frame), (part[i] for part in track))
    running.reset()
    assert_same(running.step(take[0]), (part[0] for part in track))


def test_equal_random_states_give_equal_results(tracker, take):
    """Of a take by itself, beside others, as a table and as a list."""
    twin = clone(tracker).fit(TRAINING)
    for method in ("track", "smooth"):
        alone = getattr(tracker, method)(take)
        assert_same(getattr(twin, method)([take[:9], take])[1], alone)
        assert isinstance(alone, Track)
        assert repr(alone) == "Track(60 frames of 3 features, 0 of them lost)"
    for other in (pd.DataFrame(take), take.tolist()):
        assert_same(tracker.track(other), tracker.track(take))


def test_seconds_are_frames_over_the_frame_rate(tracker, take):
    seconds, times = clone(tracker).set_params(frame_rate=30).fit(TRAINING), np.arange(60.0)
    track = tracker.track(take)
    assert_same(tracker.track(take, times=times), track)
    assert tracker.duration_ == np.mean([54, 59, 61, 64])
    for a, b in zip(seconds.track(take, times=times / 30), track, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-6)


def test_rows_are_takes_after_a_fit_on_rows(tracker):
    rows = np.stack([movement(size)[:, 0] for size in (0.9, 1.0, 1.1, 1.2)])
    fitted = clone(tracker).fit(rows)
    tracks = fitted.track(rows[:2])
    assert [t.poses.shape for t in tracks] == [(60, 1)] * 2
    assert_same(fitted.step(rows[0, 0]), (part[0] for part in tracks[0]))


# -- what is learnt -----------------------------------------------------------------------


def test_rate_spread_is_that_of_paces():
    """A pace is the mean time of a frame of the clock over the own one, by the synchronizer."""
    t = np.linspace(0, 1, 240)
    X = [
        movement(1, 240)[np.round(239 * np.interp(np.linspace(0, 1, n), t, t**bend)).astype(int)]
        for n, bend in ((50, 0.7), (60, 1.0), (70, 1.2), (90, 1.4))
    ]
    tracker = MotionTracker(DenseSynchronizer(60, metric=None, refine=False), 20).fit(X)
    times = tracker.synchronizer_.match(X).times
    own = np.gradient(times, axis=1) * np.array([[49], [59], [69], [89]]) / 59
    paces = np.clip(tracker.duration_ / 59 / np.maximum(own, 1e-6), 0.25, 4)
    assert tracker.rate_spread_ == pytest.approx(np.sqrt(np.mean(np.log(paces) ** 2)), rel=1e-6)


def test_constant_features_have_the_least_variance():
    """A billionth of the largest; the others are tracked as without them."""
    X = [np.column_stack([x, np.full(len(x), 5.0)]) for x in TRAINING]
    fitted = MotionTracker(LinearSynchronizer(), 100, noise=0.02).fit(X)
    variances = np.diag(fitted.covariance_)
    assert variances[3] == pytest.approx(1e-9 * variances.max(), rel=1e-12)
    assert fitted.covariance_[3, :3].tolist() == [0, 0, 0]
    take, without = movement(1.05), MotionTracker(LinearSynchronizer(), 100, noise=0.02)
    expected = without.fit(TRAINING).track(take)
    for value in (5.0, np.nan):
        track = fitted.track(np.column_stack([take, np.full(60, value)]))
        np.testing.assert_allclose(track.poses[:, 3], 5, atol=1e-3)
        assert np.abs(track.phases - expected.phases)[5:].max() < 3
        assert not track.lost.any()


def test_two_trials_are_enough():
    """Of two the deviations are their differences; single precision stays."""
    X = [movement(size).astype(np.float32) for size in (1.0, 1.2)]
    fitted = MotionTracker(LinearSynchronizer(), 50).fit(X)
    squares = np.square(X[1] - X[0]).mean(axis=0)
    np.testing.assert_allclose(np.diag(fitted.covariance_), squares, rtol=1e-5)
    track = fitted.track(movement(1.05).astype(np.float32))
    assert track.poses.dtype == track.covariances.dtype == fitted.mean_.dtype == np.float32
    assert np.isfinite(track.poses).all()


def test_groups_of_similar_trials_widen_deviations(tracker):
    training = [movement(size) for size in (0.8, 0.81, 1.2, 1.21)]
    alone = clone(tracker).fit(training)
    people = clone(tracker).fit(training, groups=["ann", "ann", "bob", "bob"])
    assert (np.diag(people.covariance_) > np.diag(alone.covariance_)).all()


# -- missing and improbable observations --------------------------------------------------


def test_smoothed_phases_of_hidden_frames_are_those_that_lead_to_the_later_ones():
    """Nothing is seen in the beginning of a fast take: the filter is late, the smoother is not."""
    lengths = {0.9: 40, 1.0: 52, 1.1: 65, 1.2: 83}
    X = [movement(size, n) for size, n in lengths.items()]
    tracker = MotionTracker(LinearSynchronizer(60), 400, noise=0.02).fit(X)
    take, phases = movement(1.05, 40), np.arange(40) * 59 / 39
    take[1:15] = np.nan
    track, smooth = tracker.track(take), tracker.smooth(take)
    assert (phases - track.phases)[14] > 5
    assert np.abs(smooth.phases - phases)[:30].max() < 3
    assert (np.diff(smooth.phases)[:30] > 0).all()
    assert np.median(track.rates[20:35]) == pytest.approx(59 / 39, rel=0.2)


@pytest.mark.parametrize("size", [50.0, 1e9])
def test_observations_outside_the_gate_are_ignored_then_lost(tracker, size):
    clean = movement(1.05)
    odd, without = clean.copy(), clean.copy()
    odd[20], without[20] = [size, -size, size], np.nan
    np.testing.assert_array_equal(tracker.track(odd).poses, tracker.track(without).poses)
    odd[20:] = size
    for track in (tracker.track(odd), tracker.smooth(odd)):
        assert track.lost[40:].all()
        assert not track.lost[:20].any()
        assert np.isfinite(track.poses).all()
        assert np.isfinite(track.covariances).all()


@pytest.mark.parametrize("deviation", [0.0, 2.5])
def test_other_movements_are_lost_and_the_action_is_found_again(tracker, deviation):
    """Also where it is two and a half standard deviations off."""
    noise = np.sqrt(np.diag(tracker.covariance_) + tracker.noise**2)
    other = np.cumsum(np.random.default_rng(0).standard_normal((60, 3)) / 4, axis=0)
    action = movement(1.05) + deviation * noise * [1, -1, 1]
    track = tracker.track(np.concatenate([other, action]))
    assert track.lost[10:60].mean() > 0.5
    assert not track.lost[-20:].any()
    assert np.abs(track.phases[-20:] - np.arange(40, 60)).max() < 5


@pytest.mark.parametrize(("deviation", "lost"), [(1.5, False), (4.0, True)])
def test_poses_far_from_the_mean_are_lost(tracker, deviation, lost):
    noise = np.sqrt(np.diag(tracker.covariance_) + tracker.noise**2)
    track = tracker.track(movement(1.05) + deviation * noise * [1, -1, 1])
    assert track.lost[20:].any() == lost


@pytest.mark.parametrize("pause", [0, 30])
def test_second_trial_restarts_after_a_pause(tracker, pause):
    one = movement(1.05)
    track = tracker.track(np.concatenate([one, np.repeat(one[-1:], pause, axis=0), one]))
    phases = track.phases
    assert np.abs(phases[10:60] - np.arange(10, 60)).max() < 5
    assert (phases[65 : 60 + pause] > 57).all()
    assert np.abs(phases[80 + pause : 120 + pause] - np.arange(20, 60)).max() < 5
    assert (track.rates[65 : 60 + pause] == 0).all()


# -- refusals -----------------------------------------------------------------------------

INFINITE = np.where(np.arange(180).reshape(60, 3) == 11, np.inf, movement(1))


@pytest.mark.parametrize(
    ("X", "more", "message"),
    [
        (movement(1)[:, :2], {}, "Trial 0 has 2 features a frame"),
        ([movement(1), movement(1)[:, :2]], {}, "Trial 1 has 2 features"),
        (INFINITE, {}, "Trial 0, frame 3, feature 2 is infinity"),
        (1e10 * movement(1), {}, "Trial 0 .*1e\\+09"),
        (movement(1)[:1], {}, "with at least 2 frames"),
        (movement(1)[0], {}, r"wrap one sequence as \[X\]"),
        ([], {}, "0 trials"),
        (movement(1), {"times": np.r_[0:30, 20:50]}, "Trial 0: time stamps must increase"),
        ([movement(1)], {"times": [None, None]}, "for each trial, got 2 for 1"),
        ([movement(1)], {"times": 3.0}, "for each trial, got none for 1"),
        (movement(1), {"times": 1e-12 * np.arange(60)}, r"by 1e-09 to 1e\+09 frames"),
        (movement(1)[:2], {"times": [0, 1e200]}, r"but 1e\+200 follows 0"),
    ],
)
def test_track_refuses(tracker, X, more, message):
    with pytest.raises(ValueError, match=message):
        tracker.track(X, **more)


@pytest.mark.parametrize(
    ("frame", "time", "message"),
    [
        ([1.0, 2.0], None, r"The observation has shape \(2,\), expected \(3,\)"),
        ([1.0, np.inf, 2.0], None, "feature 1 is infinity"),
        ([1.0, 0.0, 0.0], 1.0, "must increase, but 1 follows 1"),
        ([1.0, 0.0, 0.0], np.nan, "finite"),
    ],
)
def test_refused_observation_changes_nothing(running, take, frame, time, message):
    for i in range(2):
        running.step(take[i])
    before = pickle.dumps(vars(running))
    with pytest.raises(ValueError, match=message):
        running.step(frame, time=time)
    assert pickle.dumps(vars(running)) == before


def test_refused_estimators(tracker):
    unfitted = MotionTracker()
    for call in (unfitted.reset, lambda: unfitted.step([0.0]), lambda: unfitted.track([[0.0]])):
        with pytest.raises(NotFittedError):
            call()
    with pytest.raises(ValueError, match=r"'noise' parameter .* \(0.0, 1000000000.0\]"):
        clone(tracker).set_params(noise=1e200).fit(TRAINING)


def test_feature_names_are_checked():
    frames = [pd.DataFrame(movement(s), columns=list("xyz")) for s in (0.9, 1.0, 1.1)]
    named = MotionTracker(LinearSynchronizer(), 20).fit(frames)
    with pytest.warns(UserWarning, match="does not have valid feature names"):
        assert_same(named.track(frames[0]), named.track(frames[0].to_numpy()))
    assert_same(named.track(frames[0]), named.track(frames[0][list("zyx")]))
    with pytest.raises(ValueError, match="hip"):
        named.track(frames[0].rename(columns={"x": "hip"}))
    with pytest.raises(ValueError, match="should match"):
        named.step(frames[0][list("zyx")].iloc[0])


# -- people -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def people(bends):
    """Bends at 30 Hz of three actors, the groups of these, and bends of the fourth."""
    held = bends.actor == bends.actor[-1]
    known, new = ([bends.data[i][::4] for i in np.flatnonzero(h)] for h in (~held, held))
    return known, bends.actor[~held], new, DirectionCosines(bends.skeleton).fit(known)


@pytest.fixture(scope="module")
def of_bends(people):
    """A tracker of the three actors, and the poses of the fourth."""
    known, groups, new, cosines = people
    tracker = MotionTracker(DenseSynchronizer(metric=None, refine=False), 100)
    return tracker.fit(cosines.transform(known), groups=groups), cosines.transform(new)


def test_errors_of_a_new_person_are_smaller_than_of_the_mean(of_bends):
    """Of the phase, and of half of the limbs, hidden for a second."""
    tracker, new = of_bends
    rng = np.random.default_rng(0)
    squares, phases = [], []
    for x in new[:2]:
        seen = x + 0.05 * rng.standard_normal(x.shape)
        hidden = np.ix_(np.arange(30, 60), LIMBS[rng.permutation(12)[:6]].ravel())
        seen[hidden] = np.nan
        track, smooth = tracker.track(seen), tracker.smooth(seen)
        matched = tracker.synchronizer_.match([x]).frames([len(x)])[0]
        truth = np.interp(np.arange(len(x)), matched, np.arange(len(matched)))
        # The mean trial at the phase of the whole take.
        frames = np.arange(tracker.n_frames_)
        mean = np.column_stack([np.interp(truth, frames, m) for m in tracker.mean_.T])
        estimates = track.poses, smooth.poses, mean
        squares.append([np.square(each - x)[hidden].sum() for each in estimates])
        phases.append(100 / tracker.n_frames_ * np.abs(track.phases - truth)[len(truth) // 5 :])
        assert track.lost.mean() < 0.05
    filtered, smoothed, mean = np.sqrt(np.mean(squares, axis=0))
    assert np.median(np.concatenate(phases)) < 4
    assert filtered < 0.8 * mean
    assert smoothed < 0.9 * filtered


def test_moved_joints_of_a_new_person(people):
    """By 1 and 5 cm: not lost, and nearer to the truth than with equal noise in every cosine."""
    known, groups, new, cosines = people
    poses, new, rng, errors = cosines.transform(known), new[:2], np.random.default_rng(0), []
    for sd, equal in ((0.01, False), (0.05, False), (0.05, True)):
        if not equal:
            seen = cosines.transform([x + sd * rng.standard_normal(x.shape) for x in new])
        sync, noise = DenseSynchronizer(metric=None, refine=False), JointNoise(sd, cosines)
        tracker = MotionTracker(sync, 100, noise=0.05 if equal else noise)
        tracks = tracker.fit(poses, groups=groups).track(seen)
        off = [t.poses - x for t, x in zip(tracks, cosines.transform(new), strict=True)]
        errors.append(np.sqrt(np.mean(np.square(np.concatenate(off)))))
        assert equal or np.mean([t.lost.mean() for t in tracks]) <= 0.02
    assert errors[1] < 0.75 * errors[2]


@pytest.fixture(scope="module")
def jogs(hdm05, people):
    """Poses of two jogs."""
    chosen = np.flatnonzero(hdm05.target == "jogLeftCircle4StepsRstart")[:2]
    return people[3].transform([hdm05.data[i][::4] for i in chosen])


def test_bands_of_another_action_are_wider_and_hold_as_often(jogs, of_bends):
    """Of hidden arms, as evidence makes them wider; people held out, and jogs under bends."""
    tracker, own = of_bends
    inside, widths, hidden = [], [], LIMBS[8:10].ravel()
    for takes in (own[:3], jogs):
        seen = [x + 0.05 * np.random.default_rng(0).standard_normal(x.shape) for x in takes]
        for x in seen:
            x[:, hidden] = np.nan
        tracks, truth = tracker.track(seen), np.concatenate(takes)[:, hidden]
        poses = np.concatenate([t.poses for t in tracks])[:, hidden]
        variances = np.concatenate([t.covariances for t in tracks])[:, hidden, hidden]
        inside.append(np.mean(np.abs(poses - truth) <= 1.645 * np.sqrt(variances)))
        widths.append(np.sqrt(variances).mean())
    assert widths[1] > 1.3 * widths[0]
    assert inside[1] > inside[0] - 0.05
