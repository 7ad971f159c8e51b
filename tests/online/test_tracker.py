"""MotionTracker: what it knows of people, what it takes, and what it says of odd observations."""

import pickle

import numpy as np
import pandas as pd
import pytest
from sklearn import clone
from sklearn_motionsync import (
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
    MotionTracker,
    Track,
)
from sklearn_motionsync.datasets import load_performances

LIMBS = np.arange(1, 37).reshape(12, 3)


def movement(size, n=60):
    t = np.linspace(0, 1, n)
    return np.column_stack([size * np.cos(6 * t), size * np.sin(6 * t), size * np.sin(3 * t)])


TRAINING = [movement(0.9, 55), movement(1.0, 60), movement(1.1, 62), movement(1.2, 65)]


@pytest.fixture(scope="module")
def tracker():
    return MotionTracker(LinearSynchronizer(), 100, noise=0.02, random_state=0).fit(TRAINING)


@pytest.fixture
def take():
    x = movement(1.05) + 0.02 * np.random.default_rng(0).standard_normal((60, 3))
    x[20:40, 1] = np.nan
    x[30:35] = np.nan
    return x


def same(a, b):
    for left, right in zip(a, b, strict=True):
        np.testing.assert_array_equal(left, right)


# -- the same answers on every road -------------------------------------------------------


def test_a_take_is_its_frames(tracker, take):
    """To the last bit, through a pickle in mid-stream, and again after a reset."""
    whole, running = tracker.track(take), pickle.loads(pickle.dumps(tracker))
    for i, frame in enumerate(take):
        if i == 31:
            running = pickle.loads(pickle.dumps(running))
        same(running.step(frame), (part[i] for part in whole))
    running.reset()
    same(running.step(take[0]), (part[0] for part in whole))


def test_equal_seeds_give_equal_answers(tracker, take):
    twin = clone(tracker).fit(TRAINING)
    for method in ("track", "smooth"):
        alone = getattr(tracker, method)(take)
        same(getattr(twin, method)([take[:9], take])[1], alone)
        assert isinstance(alone, Track)
        assert repr(alone) == "Track(60 frames of 3 features, 0 of them lost)"


def test_tracking_leaves_a_running_take_alone(tracker, take):
    running = pickle.loads(pickle.dumps(tracker))
    running.step(take[0])
    running.track(take)
    running.smooth(take)
    same(running.step(take[1]), (part[1] for part in tracker.track(take)))


def test_seconds_are_frames_over_the_rate(tracker, take):
    seconds = clone(tracker).set_params(frame_rate=30).fit(TRAINING)
    times = np.arange(60.0)
    same(tracker.track(take, times=times), tracker.track(take))
    near = seconds.track(take, times=times / 30)
    for a, b in zip(near, tracker.track(take), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-6)


def test_half_the_frames_give_about_the_same_phases(tracker):
    clean, times = movement(1.05, 119), np.arange(119) / 2
    every = tracker.track(clean, times=times).phases[::2]
    second = tracker.track(clean[::2], times=times[::2]).phases
    assert np.abs(every - second)[5:].max() < 3


def test_who_goes_twice_as_fast_has_twice_the_rate(tracker):
    training = [movement(s, n) for s, n in zip((0.9, 1.0, 1.1, 1.2), (40, 60, 80, 60), strict=True)]
    wide = clone(tracker).fit(training)
    track = wide.track(movement(1.05, 30))
    assert 1.4 < np.median(track.rates[10:25]) < 2.4
    assert np.abs(track.phases - np.linspace(0, 59, 30))[5:].max() < 6


@pytest.mark.parametrize("kind", [list, np.stack, lambda X: [pd.DataFrame(x) for x in X]])
def test_kinds_of_input(tracker, take, kind):
    first, second = tracker.track(kind([take, take]))
    same(first, second)
    same(tracker.track(pd.DataFrame(take)), first)
    same(tracker.track(take.tolist()), first)


def test_rows_are_takes_after_a_fit_on_rows(tracker):
    rows = np.stack([movement(size)[:, 0] for size in (0.9, 1.0, 1.1, 1.2)])
    fitted = clone(tracker).fit(rows)
    tracks = fitted.track(rows[:2])
    assert [t.postures.shape for t in tracks] == [(60, 1)] * 2
    same(fitted.step(rows[0, 0]), (part[0] for part in tracks[0]))


def test_single_precision_stays(tracker, take):
    single = clone(tracker).fit([movement(s).astype(np.float32) for s in (0.9, 1.0, 1.1)])
    track = single.track(take.astype(np.float32))
    assert track.postures.dtype == track.covariances.dtype == single.mean_.dtype == np.float32


def test_groups_that_are_alike_make_strangers_differ_more(tracker):
    training = [movement(size) for size in (0.8, 0.81, 1.2, 1.21)]
    alone = clone(tracker).fit(training)
    people = clone(tracker).fit(training, groups=["ann", "ann", "bob", "bob"])
    assert (np.diag(people.covariance_) > np.diag(alone.covariance_)).all()


# -- odd observations ---------------------------------------------------------------------


def test_what_is_not_seen_goes_on(tracker):
    blind = tracker.track(np.full((60, 3), np.nan))
    assert np.isfinite(blind.postures).all()
    assert not blind.lost.any()
    assert (np.diff(blind.phases[:40]) > 0).all()
    widths = np.trace(blind.covariances, axis1=1, axis2=2)
    assert widths[20] > widths[0]
    smoothed = tracker.smooth(np.full((9, 3), np.nan))
    assert np.isfinite(smoothed.covariances).all()


@pytest.mark.parametrize("size", [50.0, 1e300])
def test_an_impossible_pose_is_not_believed_and_then_lost(tracker, take, size):
    clean = movement(1.05)
    odd = clean.copy()
    odd[20] = size, -size, size
    track, without = tracker.track(odd), clean.copy()
    without[20] = np.nan
    np.testing.assert_array_equal(track.postures, tracker.track(without).postures)
    odd[20:] = size
    for answer in (tracker.track(odd), tracker.smooth(odd)):
        assert answer.lost[40:].all()
        assert not answer.lost[:20].any()
        assert np.isfinite(answer.postures).all()
        assert np.isfinite(answer.covariances).all()


def test_other_movements_are_lost_and_found_again(tracker):
    rng = np.random.default_rng(0)
    other = np.cumsum(rng.standard_normal((60, 3)) / 4, axis=0)
    again = movement(1.05)
    track = tracker.track(np.concatenate([other, again]))
    assert track.lost[10:60].mean() > 0.5
    assert not track.lost[-20:].any()
    assert np.abs(track.phases[-20:] - np.arange(40, 60)).max() < 5


def test_who_moves_alike_but_looks_otherwise_is_lost(tracker):
    """Postures four standard deviations of people off; half of that are nobody's mistake."""
    noise = np.sqrt(np.diag(tracker.covariance_) + tracker.noise**2)
    for off, lost in ((1.5, False), (4.0, True)):
        track = tracker.track(movement(1.05) + off * noise * [1, -1, 1])
        assert track.lost[20:].any() == lost
    assert tracker.departure_limit_ == 9


def test_who_looks_odd_is_found_again(tracker):
    """Two and a half standard deviations off; 20 frames of something else before."""
    noise = np.sqrt(np.diag(tracker.covariance_) + tracker.noise**2)
    odd = np.cumsum(np.random.default_rng(0).standard_normal((20, 3)) / 4, axis=0)
    track = tracker.track(np.concatenate([odd, movement(1.05) + 2.5 * noise * [1, -1, 1]]))
    assert track.lost[:20].any()
    assert not track.lost[-30:].any()


def test_a_second_performance_begins_anew(tracker):
    """Right after the first, and after a pause at the end."""
    one = movement(1.05)
    for pause in (0, 30):
        still = np.repeat(one[-1:], pause, axis=0)
        track = tracker.track(np.concatenate([one, still, one]))
        phases, second = track.phases, slice(60 + pause + 20, 120 + pause)
        assert np.abs(phases[10:60] - np.arange(10, 60)).max() < 5
        assert (phases[65 : 60 + pause] > 57).all()
        assert np.abs(phases[second] - np.arange(20, 60)).max() < 5
        assert (track.rates[65 : 60 + pause] == 0).all()


def test_a_single_frame(tracker):
    one = movement(1.05)[:1]
    for track in (tracker.track(one), tracker.smooth(one)):
        assert track.postures.shape == (1, 3)
        assert np.linalg.norm(track.postures - one) < 0.05
        assert track.rates.shape == track.lost.shape == (1,)


def test_a_projection(tracker):
    """A plane seen through an offset, with gaps; and what equals no projection."""
    matrix, offset = np.array([[1.0, 0.5, 0.0], [0.0, 1.0, -1.0]]), np.array([3.0, -2.0])
    clean = movement(1.05)
    image = clean @ matrix.T + offset
    image[20:30, 0] = np.nan
    for method in (tracker.track, tracker.smooth):
        track = method(image, projection=(matrix, offset))
        assert np.abs(track.phases - np.arange(60))[5:].max() < 5
        assert np.abs(track.postures - clean)[5:].mean() < 0.1
    same(tracker.track(clean, projection=np.eye(3)), tracker.track(clean))
    running = pickle.loads(pickle.dumps(tracker))
    for frame in image[:5]:
        running.step(frame, projection=(matrix, offset))
    # The camera fails, and the body is seen itself.
    assert np.isfinite(running.step(clean[5]).postures).all()


# -- what is refused ----------------------------------------------------------------------


def put(x, value):
    x = x.copy()
    x[3, 2] = value
    return x


@pytest.mark.parametrize(
    ("X", "more", "message"),
    [
        (movement(1)[:, :2], {}, r"The take has 2 features a frame, expected are 3"),
        ([movement(1), movement(1)[:, :2]], {}, r"Performance 1 has 2 features"),
        (put(movement(1), np.inf), {}, r"The take, frame 3, feature 2 is infinity"),
        (movement(1)[:0], {}, r"at least 1 frame"),
        (movement(1)[0], {}, r"x\[:, np.newaxis\]"),
        ([], {}, "0 takes"),
        (movement(1), {"times": np.r_[0:30, 20:50]}, r"The take: time stamps must increase"),
        (movement(1), {"times": np.arange(59)}, r"one a frame, shape \(60,\)"),
        ([movement(1)], {"times": [None, None]}, r"1 takes, but 2 sequences of times"),
        ([movement(1)], {"times": 3.0}, r"1 takes, but no sequences of times"),
        (movement(1), {"projection": [np.eye(3), np.zeros(3)]}, r"or the tuple \(matrix, offset\)"),
        (movement(1), {"projection": np.eye(2)}, r"shape \(n_observed, 3\)"),
        (movement(1), {"projection": (np.eye(3), [1.0])}, r"offset .* shape \(3,\)"),
        (movement(1), {"projection": np.full((1, 3), np.nan)}, "is NaN"),
    ],
)
@pytest.mark.parametrize("method", ["track", "smooth"])
def test_what_is_no_take(tracker, method, X, more, message):
    with pytest.raises(ValueError, match=message):
        getattr(tracker, method)(X, **more)


@pytest.mark.parametrize(
    ("frame", "time", "message"),
    [
        ([1.0, 2.0], None, r"shape \(2,\), expected \(3,\)"),
        ([1.0, np.inf, 2.0], None, "infinity"),
        ([1.0, 0.0, 0.0], 1.0, "must increase, but 1 follows 1"),
        ([1.0, 0.0, 0.0], 0.5, "must increase"),
        ([1.0, 0.0, 0.0], np.nan, "finite"),
    ],
)
def test_a_frame_that_is_refused_changes_nothing(tracker, take, frame, time, message):
    running = pickle.loads(pickle.dumps(tracker))
    for i in range(2):
        running.step(take[i])
    before = pickle.dumps(vars(running))
    with pytest.raises(ValueError, match=message):
        running.step(frame, time=time)
    assert pickle.dumps(vars(running)) == before


def test_names_are_kept_to():
    frames = [pd.DataFrame(movement(s), columns=list("xyz")) for s in (0.9, 1.0, 1.1)]
    named = MotionTracker(LinearSynchronizer(), 20, random_state=0).fit(frames)
    same(named.track(frames[0]), named.track(frames[0].to_numpy()))
    with pytest.raises(ValueError, match="should match"):
        named.track(frames[0][list("zyx")])
    with pytest.raises(ValueError, match="should match"):
        named.step(frames[0][list("zyx")].iloc[0])


def test_one_performance_is_not_enough(tracker):
    with pytest.raises(ValueError, match="at least 2 performances, got n_samples = 1"):
        clone(tracker).fit([movement(1)])


# -- people -------------------------------------------------------------------------------


def test_people_not_seen(bends):
    """Bends at 30 Hz, an actor held out: the phase, and half of the limbs, hidden for a second."""
    X = [x[::4] for x in DirectionCosines(bends.skeleton).fit_transform(bends.data)]
    held = bends.actor == bends.actor[-1]
    known = [x for x, of in zip(X, held, strict=True) if not of]
    sync = DenseSynchronizer(metric=None, refine=False)
    tracker = MotionTracker(sync, 100, random_state=0).fit(known, groups=bends.actor[~held])
    rng = np.random.default_rng(0)
    squares, phases = [], []
    for i in np.flatnonzero(held)[:2]:
        seen = X[i] + 0.05 * rng.standard_normal(X[i].shape)
        hidden = np.ix_(np.arange(30, 60), LIMBS[rng.permutation(12)[:6]].ravel())
        seen[hidden] = np.nan
        track, smooth = tracker.track(seen), tracker.smooth(seen)
        matched = tracker.synchronizer_.match([X[i]]).frames([len(X[i])])[0]
        truth = np.interp(np.arange(len(X[i])), matched, np.arange(len(matched)))
        # The mean is told the phase.
        frames = np.arange(tracker.n_frames_)
        mean = np.column_stack([np.interp(truth, frames, m) for m in tracker.mean_.T])
        answers = track.postures, smooth.postures, mean
        squares.append([np.square(x - X[i])[hidden].sum() for x in answers])
        phases.append(100 / tracker.n_frames_ * np.abs(track.phases - truth)[len(truth) // 5 :])
        assert track.lost.mean() < 0.05
    filtered, smoothed, mean = np.sqrt(np.mean(squares, axis=0))
    assert np.median(np.concatenate(phases)) < 4
    assert filtered < 0.8 * mean
    assert smoothed < 0.9 * filtered


def test_other_actions_of_people_are_lost(real_data):
    """Jogging is no bend."""
    bunch = load_performances(real_data / "hdm05" / "hdm05_positions.npz")
    some = {
        name: np.flatnonzero(bunch.target == name)[:6]
        for name in ("depositFloorR", "jogLeftCircle4StepsRstart")
    }
    cosines = DirectionCosines(bunch.skeleton)
    bends, jogs = (
        [x[::4] for x in cosines.fit_transform([bunch.data[i] for i in k])] for k in some.values()
    )
    tracker = MotionTracker(LinearSynchronizer(), 100, random_state=0).fit(bends)
    assert tracker.track(jogs[0]).lost.mean() > 0.4
    assert not tracker.track(bends[0]).lost.any()
