"""The benchmark of live cycles: chains of cycles with a known phase, and trials begun anew."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def cycles(benchmark):
    return benchmark("live_cycles")


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
