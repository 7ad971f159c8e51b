"""The benchmarks of live phases, cycles and trackers: what they follow, and their peers."""

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.spatial.distance import cdist


@pytest.fixture(scope="module")
def live(benchmark):
    return benchmark("live")


@pytest.fixture(scope="module")
def cycles(benchmark):
    return benchmark("live_cycles")


@pytest.fixture(scope="module")
def tracking(benchmark):
    return benchmark("tracking")


# -- the phase of a whole clip ------------------------------------------------------------


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


# -- chains of cycles --------------------------------------------------------------------


def test_cycles_lie_between_strikes_and_have_the_phase_of_the_other_foot(cycles):
    points = np.arange(100.0)[:, np.newaxis, np.newaxis] * [1.0, 2.0, 3.0]
    strikes, others = np.array([10.5, 50.0, 90.0]), np.array([5.0, 30.0, 60.0])
    # The other foot of the second cycle is early: it is no cycle.
    ((found, shares),) = cycles.whole_cycles(points, strikes, others, 0.4)
    np.testing.assert_allclose(found[[0, -1], 0, 0], [10.5, 50])
    np.testing.assert_allclose(np.interp(30, found[:, 0, 0], shares), 0.4, atol=0.01)
    assert (shares[0], shares[-1]) == (0, 1)


def test_chain_has_no_jumps_and_counts_its_cycles(cycles):
    t = np.linspace(0, 1, 51)
    pairs = [(np.stack([np.sin(7 * t + k), t + k, t], axis=1)[:, np.newaxis], t) for k in range(3)]
    values, truth = cycles.chain(pairs, 400, np.random.default_rng(0))
    assert len(values) == len(truth) == 400
    np.testing.assert_allclose(np.diff(truth), 1 / 50)
    assert np.abs(np.diff(values, axis=0)).max() < 0.5
    paced, phases = cycles.paced(values, truth, 10)
    assert phases[0] == pytest.approx(0.4, abs=0.05)
    # Phases stay those of their frames.
    np.testing.assert_allclose(paced[:, 0, 1], np.interp(phases, truth, values[:, 0, 1]), atol=1e-6)


def test_bodies_are_turned_about_the_vertical(cycles):
    points = np.random.default_rng(1).standard_normal((400, 4, 3))
    turned = cycles.turned(points, np.linspace(0, 9, 400))
    np.testing.assert_allclose(turned[..., 1], points[..., 1])
    np.testing.assert_allclose(np.linalg.norm(turned, axis=2), np.linalg.norm(points, axis=2))
    np.testing.assert_allclose(
        cycles.turned(np.array([[[0.0, 0, 1]]]), np.array([np.pi / 2]))[0, 0], [1, 0, 0], atol=1e-12
    )


# -- the peer of trackers, against the joint Gaussian -------------------------------------


def joint(model, n, d):
    """Covariance of what can be seen in n frames, one long vector."""
    F, s = model.transition, len(model.transition)
    drives = block_diag(model.spread, *[model.drive] * (n - 1))
    # Each state is the sum of all that was added before, carried on.
    L = np.zeros((n * s, n * s))
    for t in range(n):
        for u in range(t + 1):
            L[t * s : (t + 1) * s, u * s : (u + 1) * s] = np.linalg.matrix_power(F, t - u)
    shown = np.kron(np.eye(n), np.eye(d, s))
    return shown @ L @ drives @ L.T @ shown.T


def conditioned(C, y, noise):
    """Mean of all, given what of y is no NaN."""
    seen = ~np.isnan(y)
    return C[:, seen] @ np.linalg.solve((C + noise)[np.ix_(seen, seen)], y[seen])


@pytest.mark.parametrize(("length", "share"), [(4, 0.25), (12, 0.5)])
def test_filter_and_smoother_equal_conditioning_of_the_joint_gaussian(tracking, length, share):
    rng = np.random.default_rng(3)
    takes = [np.cumsum(rng.standard_normal((20, 2)), axis=0) for _ in range(3)]
    mean, model = tracking.matern(takes, length, share)
    np.testing.assert_allclose(mean, np.concatenate(takes).mean(axis=0))
    noise, y = np.array([[0.09, 0.02], [0.02, 0.05]]), rng.standard_normal((6, 2))
    y[0, 1] = y[2] = y[4, 0] = np.nan
    live, smoothed = tracking.kalman(model, y, noise)
    C, noises = joint(model, 6, 2), np.kron(np.eye(6), noise)
    for t in range(6):
        past = np.where(np.arange(6)[:, np.newaxis] <= t, y, np.nan)
        expected = conditioned(C, past.ravel(), noises).reshape(6, 2)
        assert live[t] == pytest.approx(expected[t], abs=1e-8)
    expected = conditioned(C, y.ravel(), noises).reshape(6, 2)
    assert smoothed == pytest.approx(expected, abs=1e-6)
