"""Runs of frames beyond a limit, against a loop."""

import numpy as np
import pytest
from sklearn_motionsync.model.departures import runs


def slow_runs(scores, limit):
    found = []
    n, n_frames, n_features = scores.shape
    for i in range(n):
        for k in range(n_features):
            first = None
            for p in range(n_frames + 1):
                beyond = p < n_frames and abs(scores[i, p, k]) > limit
                if beyond and first is None:
                    first = p
                if not beyond and first is not None:
                    peak = max(range(first, p), key=lambda q: abs(scores[i, q, k]))
                    found.append((i, k, first, p - 1, peak, scores[i, peak, k]))
                    first = None
    return found


@pytest.mark.parametrize("limit", [0.5, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("shape", [(4, 30, 3), (1, 1, 1), (3, 1, 2), (1, 50, 1), (2, 7, 40)])
def test_runs_equal_those_of_a_loop(shape, limit):
    scores = np.random.default_rng(0).standard_normal(shape) * 1.5
    # Integers: equal peaks, scores equal to the limit.
    for z in (scores, np.round(scores), np.sort(scores, axis=1)):
        found = runs(z, limit)
        assert list(zip(*found, strict=True)) == slow_runs(z, limit)


def test_runs_may_change_sign():
    z = np.array([0, 4, -5, 0, 0, np.inf, -3.5, 3])[np.newaxis, :, np.newaxis]
    found = runs(z, 3)
    assert found.first.tolist() == [1, 5]
    assert found.last.tolist() == [2, 6]
    assert found.peak.tolist() == [2, 5]
    assert found.score.tolist() == [-5, np.inf]


def test_no_run_and_one_long_run():
    z = np.ones((2, 6, 3))
    assert [len(column) for column in runs(z, 1)] == [0] * 6
    assert all(column.dtype == int for column in runs(z, 1)[:5])
    everything = runs(z, 0.5)
    assert everything.performance.tolist() == [0] * 3 + [1] * 3
    assert everything.feature.tolist() == [0, 1, 2] * 2
    assert set(everything.first) == {0}
    assert set(everything.last) == {5}
    assert set(everything.peak) == {0}
