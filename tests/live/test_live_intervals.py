"""Intervals of the live phase: what they hold, when they widen, and how they are calibrated."""

import numpy as np
import pytest
from scipy.special import softmax
from sklearn_motionsync import DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.live import OnlineSynchronizer
from sklearn_motionsync.live.stream import gains_of, phase_bounds

P = 100
BUNCH = make_bending(48, n_actors=8, n_frames=P, random_state=4)
COSINES = DirectionCosines(BUNCH.skeleton).fit(BUNCH.data)
KNOWN = np.flatnonzero(np.isin(BUNCH.actor, np.unique(BUNCH.actor)[:5]))
NEW = np.setdiff1d(np.arange(48), KNOWN)


@pytest.fixture(scope="module")
def fitted():
    """Learnt of five of eight made actors."""
    X = COSINES.transform([BUNCH.data[i] for i in KNOWN])
    return OnlineSynchronizer(DenseSynchronizer(P)).fit(X)


@pytest.fixture(scope="module")
def clips():
    """Those of the other three actors."""
    return COSINES.transform([BUNCH.data[i] for i in NEW])


@pytest.fixture(scope="module")
def truths(fitted):
    """The phases of the frames of these clips, by the times they were made with."""
    pattern = BUNCH.times[KNOWN[fitted.synchronizer_.pattern_index_]]
    clock = np.linspace(0, P - 1, len(pattern))
    return [np.interp(BUNCH.times[i], pattern, clock) for i in NEW]


@pytest.fixture(scope="module")
def as_made(fitted, clips):
    """Of every second clip."""
    return fitted.track(clips[1::2])


def width(live):
    return live.upper - live.lower


def mean_width(lives):
    return np.mean([width(live).mean() for live in lives])


def held(lives, truths):
    """The share of the truths inside."""
    pairs = zip(lives, truths, strict=True)
    return np.mean([np.mean((x.lower <= t) & (t <= x.upper)) for x, t in pairs])


def check_bounds(live, last=P - 1):
    assert (live.lower >= 0).all()
    assert (live.lower <= live.phase).all()
    assert (live.phase <= live.upper).all()
    assert (live.upper <= last).all()


# -- what they hold -----------------------------------------------------------------------


def in_gap(x):
    share = np.linspace(0, 1, len(x))[:, np.newaxis]
    return (share > 0.4) & (share < 0.6)


def test_intervals_hold_the_made_truth_of_new_people(fitted, clips, truths, as_made):
    """Also where nothing is seen for a fifth of the movement."""
    gappy = fitted.track([np.where(in_gap(x), np.nan, x) for x in clips[1::2]])
    for found in (as_made, gappy):
        for one in found:
            check_bounds(one)
        assert 0.85 <= held(found, truths[1::2]) <= 0.99


@pytest.mark.nightly
def test_phases_and_intervals_of_real_people_held_out(hdm05):
    """The truth is the warp of the whole clip. Under another action nothing is sure."""
    action, other = "grabHighR", "depositFloorR"
    shares, right, wrong, errors, confidence = [], [], [], [], []
    for actor in np.unique(hdm05.actor)[::2]:

        def load(action, held_out, actor=actor):
            """Clips at 30 frames a second, by one actor or by the others."""
            chosen = (hdm05.target == action) & ((hdm05.actor == actor) == held_out)
            return [hdm05.data[i][::4] for i in np.flatnonzero(chosen)]

        features = DirectionCosines(hdm05.skeleton)
        training = features.fit_transform(load(action, held_out=False))
        X = features.transform(load(action, held_out=True))
        live = OnlineSynchronizer(DenseSynchronizer(P)).fit(training)
        tracks, truths = live.track(X), []
        for x, times in zip(X, live.synchronizer_.match(X).times, strict=True):
            rising = times + 1e-9 * np.arange(P)
            truths.append(np.interp(np.linspace(0, P - 1, len(x)), rising, np.arange(P)))
        shares.append(held(tracks, truths))
        others = live.track(features.transform(load(other, held_out=True)))
        right.append(mean_width(tracks))
        wrong.append(mean_width(others))
        pairs = zip(tracks, truths, strict=True)
        errors += [np.abs(x.phase - truth)[len(truth) // 5 :] for x, truth in pairs]
        for some in (tracks, others):
            late = [x.confidence[len(x.phase) // 2 :].mean() for x in some]
            confidence.append(np.median(late))
    assert 0.82 <= np.mean(shares) <= 0.97
    assert np.mean(right) < 15
    assert np.mean(wrong) > 1.3 * np.mean(right)
    assert np.median(np.concatenate(errors)) < 3.5
    assert (np.array(confidence[1::2]) < np.array(confidence[::2]) / 2).all()


# -- when they widen ----------------------------------------------------------------------


def test_intervals_widen_while_nothing_is_seen(fitted, clips):
    x = clips[0]
    hidden = np.flatnonzero(in_gap(x)[:, 0])
    seen, found = fitted.track([x, np.where(in_gap(x), np.nan, x)])
    before, last, after = width(found)[[hidden[0] - 1, hidden[-1], -1]]
    assert last >= 3 * before
    assert (np.diff(width(found)[hidden]) > -2).all()
    assert after == pytest.approx(width(seen)[-1], abs=2)
    # If nothing is seen from the start on, it widens as well.
    (blind,) = fitted.track([np.full_like(x, np.nan)])
    check_bounds(blind)
    assert width(blind)[len(x) // 2] > 1.3 * width(blind)[len(x) // 8] > 4


def test_intervals_begin_narrow_at_the_first_frame(fitted, clips, as_made):
    for found in as_made:
        assert found.lower[0] == 0
        assert found.upper[0] <= 2
    # A trial that waits in the first pose stays there.
    (waits,) = fitted.track([np.repeat(clips[0][:1], 100, axis=0)])
    assert waits.lower.max() < 2
    assert waits.lower[-20:].max() == 0


# -- how they are computed ----------------------------------------------------------------


def test_bounds_are_quantiles_about_the_phase():
    rng = np.random.default_rng(0)
    costs = np.abs(np.arange(130) - rng.uniform(0, 100, (20, 1))) + rng.random((20, 130))
    costs[:, 125:] = np.inf
    phase, temperature = rng.uniform(0, 99, 20), rng.uniform(0.1, 20, 20)
    lower, upper = phase_bounds(gains_of(costs), temperature, phase, 99)
    for i, at in enumerate(phase):
        mass = softmax(-costs[i] / temperature[i]).cumsum()
        first, last = (int(np.flatnonzero(mass >= q)[0]) for q in (0.05, 0.95))
        assert lower[i] == max(min(first, at - 1), 0)
        assert upper[i] == min(max(last, at + 1), 99)
    # Costs of any size, and copies without costs.
    huge = phase_bounds(gains_of(1e60 * costs), np.full(20, 1e-9), phase, 99)
    assert np.isfinite(huge).all()


def test_a_single_training_trial_has_wider_intervals(fitted, clips, truths, as_made):
    x = COSINES.transform([BUNCH.data[KNOWN[fitted.synchronizer_.pattern_index_]]])
    alone = OnlineSynchronizer(DenseSynchronizer(P)).fit(x).track(clips[1::2])
    assert mean_width(alone) > 1.5 * mean_width(as_made)
    assert held(alone, truths[1::2]) > 0.85
