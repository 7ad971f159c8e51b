"""The benchmark of the live phase: the phase of a whole clip, ticks, and the peers it is beside."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist


@pytest.fixture(scope="module")
def live(benchmark):
    return benchmark("live")


def curve(phase):
    return np.column_stack([np.cos(0.06 * phase), np.sin(0.05 * phase), 0.01 * phase])


@pytest.fixture
def known(live):
    """A movement of a hundred frames, of which trials usually have 199."""
    mean = curve(np.arange(100.0))
    return live.Known(mean, 199.0)


def test_inverse_of_a_warp_takes_the_middle_of_a_pause(live):
    times = np.array([0, 0, 1, 3, 3, 3, 4, 6, 7, 7.0])
    found = live.phase_of(times, np.array([0, 0.5, 2, 3, 5, 7]))
    np.testing.assert_allclose(found, [0.5, 1.5, 2.5, 4, 6.5, 8.5])
    linear = np.arange(100.0)
    np.testing.assert_allclose(live.truth_of(linear, 199), np.arange(199) / 2)


def test_ticks_are_pattern_frames_at_the_mean_pace(known):
    np.testing.assert_allclose(known.ticks(curve(np.arange(199) / 2)), known.mean, atol=1e-12)
    # Between two ticks the phase goes on; and it stays within the clock.
    np.testing.assert_allclose(known.at_frames([0, 3, 99], 7), [0, 0.5, 3, 3.5, 99, 99, 99])


def test_every_method_tracks_the_mean_clip(live, known):
    clip = curve(np.arange(199) / 2)
    for name, follow in live.PEERS.items():
        phases = follow(known, clip)
        assert phases.shape == (199,), name
        late = np.abs(phases - np.arange(199) / 2)[40:]
        assert np.median(late) < 1, name


def path_costs(costs):
    """Cheapest paths of time warping to every cell, a diagonal step costing double."""
    total = np.full(costs.shape, np.inf)
    total[0, 0] = costs[0, 0]
    for i, j in np.ndindex(costs.shape):
        for back, weight in (((1, 0), 1), ((0, 1), 1), ((1, 1), 2)):
            k, m = i - back[0], j - back[1]
            if k >= 0 and m >= 0:
                total[i, j] = min(total[i, j], total[k, m] + weight * costs[i, j])
    return total


def test_dixon_with_full_window_equals_dtw(live, known):
    clip = curve(np.linspace(0, 99, 199))
    costs = cdist(known.ticks(clip), known.mean)
    warping = live.Dixon(costs, window=len(costs), max_run=3)
    columns = [warping.next() for _ in costs]
    # Rows and columns came in turn, so that the whole square was seen.
    np.testing.assert_allclose(warping.total, path_costs(costs))
    assert columns == list(range(100))
