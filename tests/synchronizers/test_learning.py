"""The six steps of a fit by hand, and small sets."""

import numpy as np
import pytest
from sklearn_motionsync import DenseSynchronizer, LinearSynchronizer
from sklearn_motionsync.inputs.collections import Trials
from sklearn_motionsync.synchronizers.learning import (
    finish_warps,
    learn_metric,
    let_exemplars_vote,
    match_pairs,
    warp_in_portions,
)
from sklearn_motionsync.synchronizers.training import TrainingSet, pattern_of, put_on_clock
from sklearn_motionsync.utils.parallel import Progress


def styled(n, style=0.3, n_features=2):
    """One movement in several styles and at several paces."""
    rng = np.random.default_rng(0)
    X = []
    for n_frames in rng.integers(40, 60, n):
        t = np.linspace(0, 1, n_frames)[:, np.newaxis]
        phase = t + rng.uniform(-0.1, 0.1) * np.sin(np.pi * t)
        a, b = style * rng.standard_normal((2, n_features))
        X.append(np.sin((4 + np.arange(n_features)) * phase + a) * (1 + b))
    return X


# -- the steps ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "params",
    [
        {},
        {"style": 0.0},
        {"pattern": 2, "consensus": 3},
        {"metric": None, "consensus": 3},
        {"cost": "pose", "max_rate": 2, "consensus": 0},
    ],
    ids=str,
)
def test_six_steps_by_hand_arrive_at_the_same_times(params):
    """Copies of one source are refined, other trials sharpened, and those of the paper neither."""
    params = dict(params)
    X = styled(7, params.pop("style", 0.3))
    sync = DenseSynchronizer(**params).fit(X)
    settings = sync.get_params()
    trials = Trials(X, "list", list(range(len(X))))
    training = TrainingSet(trials, None, len(X))
    names = "cost", "metric", "consensus", "smoothness", "max_offset", "max_rate"
    with Progress(sync, 0) as progress:
        clock = put_on_clock(training, None, None, "fewer frames")
        clock.positions.flags.writeable = clock.examples.flags.writeable = False
        step = learn_metric(clock, **{name: settings[name] for name in names})
        jobs = {"random_state": 0, "n_jobs": None, "progress": progress}
        pairs = match_pairs(clock, step, True, trials=trials, names=None, **jobs)
        pattern = pattern_of(training, sync.pattern, pairs.median)
        vote = let_exemplars_vote(clock, training, pattern, pairs, sync.consensus)
        final = finish_warps(clock, training, pattern, vote, "auto")
        distances, times = warp_in_portions(
            final.warper, X, n_jobs=None, begin=lambda fits: progress, name="warping"
        )
    assert pattern.trial == sync.pattern_index_
    np.testing.assert_array_equal(pattern.distances, sync.global_distances_)
    np.testing.assert_array_equal(vote.exemplars, sync.exemplars_)
    np.testing.assert_array_equal(final.unexplained, sync.unexplained_variance_)
    assert final.refines == sync.refines_ == (params == {} and sync.unexplained_variance_ < 0.025)
    match = sync.match(X)
    np.testing.assert_array_equal(times, match.times)
    back = pairs.matcher.features.back(distances)
    np.testing.assert_array_equal(back, match.distances)


# -- small sets -----------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("n_features", [1, 2])
@pytest.mark.parametrize("n", [1, 2, 3])
def test_few_trials(n, n_features, dtype):
    X = [x.astype(dtype) for x in styled(n, 0.0, n_features)]
    sync = DenseSynchronizer().fit(X)
    assert (sync.metric_ is None) == (n < 3)
    assert sync.evidence_.weak is False
    assert sync.global_distances_.shape == (n,)
    assert sync.pattern_.dtype == dtype
    assert len(sync.exemplars_) == n - 1
    assert np.isnan(sync.unexplained_variance_) == (n == 1)
    times = sync.match(X).times
    np.testing.assert_array_equal(times[sync.pattern_index_], np.arange(sync.n_frames_))
    assert (np.diff(times, axis=1) >= 0).all()
    aligned = sync.transform(X)
    assert aligned.dtype == dtype
    before = LinearSynchronizer(pattern=sync.pattern_index_).fit_transform(X)
    off, linear = (np.abs(x - sync.pattern_).mean() for x in (aligned, before))
    assert off <= linear
