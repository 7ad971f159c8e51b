"""Anchors against all admissible paths, and warps through exact key-frames."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from sklearn_motionsync.matching import tile as module
from sklearn_motionsync.matching.anchors import (
    Anchors,
    KeyframeColumns,
    add_ramps,
    first_meeting,
    pin,
)
from sklearn_motionsync.matching.costs import COSTS, step_table
from sklearn_motionsync.matching.trellis import Trellis

from oracle import all_paths, path_cost, step_costs

NAN = np.nan


def ramps(n_positions, keyframes):
    """Ramps (n_sequences, n_positions, n_keyframes) of key-frames as shares."""
    shares = np.asarray(keyframes)[:, np.newaxis]
    return np.linspace(0, 1, n_positions)[:, np.newaxis] - shares


def miss_cost(p, q, own, other, n_frames, n_positions, most, std):
    """The cost of key-frames at one cell, in frames of the clock, as docs/method.md has it."""
    total = 0.0
    for k, m in zip(own, other, strict=True):
        if np.isnan(k) or np.isnan(m):
            continue
        share = max(0.0, 1 - abs(p - k * (n_frames - 1)))
        width = max(2**0.5 * std * (n_frames - 1), 0.5)
        miss = q / (n_positions - 1) * (n_frames - 1) - m * (n_frames - 1)
        total += share * most * (1 - np.exp(-(miss**2) / (2 * width**2)))
    return total


@pytest.mark.parametrize("cost", COSTS)
@pytest.mark.parametrize(("subframes", "std"), [(1, 0.0), (2, 0.1)])
@pytest.mark.parametrize(
    ("n_bases", "kept"), [(1, "rows"), (2, "rows"), (2, "choices"), (2, "small")]
)
def test_anchored_paths_equal_all_paths(cost, subframes, std, n_bases, kept, monkeypatch):
    small, rows = {"rows": (0, 10**9), "choices": (0, 0), "small": (10**6, 0)}[kept]
    monkeypatch.setattr(module, "SMALL_BYTES", [small] * 2)
    monkeypatch.setattr(module, "ROW_BYTES", rows)
    n_frames, reach, mu, most = 7 - subframes, 3, 0.3, 4.0
    n_positions = (n_frames - 1) * subframes + 1
    costs, rng = step_costs(cost, 2, subframes), np.random.default_rng(0)
    own = np.array([[0.31, 0.8], [NAN, 0.66]])[:n_bases]
    others = np.array([[0.5, 0.6], [0.2, NAN], [NAN, NAN]])
    bases = rng.standard_normal((n_bases, n_frames, 2))
    moving = rng.standard_normal((3, n_positions, 2))
    anchors = Anchors(KeyframeColumns(2, std), n_frames, most)
    trellis = Trellis(step_table(cost, 2, subframes), mu, reach, anchors=anchors)
    given = np.concatenate([bases, ramps(n_frames, own)], axis=2)
    met = np.concatenate([moving, ramps(n_positions, others)], axis=2)
    distances, disparities = trellis.distances(given, met), trellis.paths(given, met)
    np.testing.assert_array_equal(trellis.paths(given, met, max_bytes=0), disparities)
    for n, base in enumerate(bases):
        for m, sequence in enumerate(moving):
            known = own[n], others[m], n_frames, n_positions, most, std
            totals = {
                tuple(path): path_cost(base, sequence, path, costs, mu, subframes)
                + sum(miss_cost(p, q, *known) for p, q in enumerate(path))
                for path in all_paths(n_frames, sorted(costs), subframes, reach)
            }
            best = min(totals.values())
            np.testing.assert_allclose(distances[n, m], best, rtol=1e-12, atol=1e-12)
            path = tuple(subframes * np.arange(n_frames) + disparities[n, m])
            np.testing.assert_allclose(totals[path], best, rtol=1e-12, atol=1e-12)


def test_unknown_keyframes_change_no_bit():
    rng = np.random.default_rng(1)
    bases, moving = rng.standard_normal((2, 30, 3)), rng.standard_normal((4, 30, 3))
    plain = Trellis(step_table("velocity", 3), 0.2, 9)
    anchors = Anchors(KeyframeColumns(1, 0.0), 30, 1e3)
    anchored = Trellis(step_table("velocity", 3), 0.2, 9, anchors=anchors)
    columns = [
        np.concatenate([x, np.full((*x.shape[:2], 1), NAN)], axis=2) for x in (bases, moving)
    ]
    np.testing.assert_array_equal(anchored.paths(*columns), plain.paths(bases, moving))
    expected = plain.distances(bases, moving)
    np.testing.assert_allclose(anchored.distances(*columns), expected, rtol=1e-13)


@st.composite
def warps_and_keyframes(draw):
    n_frames = draw(st.integers(6, 40))
    steps = draw(st.lists(st.floats(0, 5), min_size=n_frames - 1, max_size=n_frames - 1))
    tau = np.concatenate([[0], np.cumsum(steps)])
    tau = tau / tau[-1] * (n_frames - 1) if tau[-1] > 0 else np.arange(n_frames) * 1.0
    count = draw(st.integers(1, 3))
    # At least two frames apart in the pattern: one piece of a warp meets one of them.
    room = (n_frames - 1) / (count + 1)
    at = [(a + 1) * room + draw(st.floats(-0.2, 0.2)) * max(room - 2, 0) for a in range(count)]
    moments = sorted(draw(st.lists(st.floats(0.01, 0.99), min_size=count, max_size=count)))
    return tau, np.array(at), np.array(moments) * (n_frames - 1)


JUMP = np.array([0.0] * 7 + [18.0] * 12), np.array([np.nextafter(9, 0)]), np.array([2.390625])


@settings(max_examples=60, deadline=None)
@example(JUMP)
@given(warps_and_keyframes())
def test_pinned_warps_meet_keyframes_and_stay_warps(case):
    tau, at, moments = case
    if len(at) > 1 and np.diff(at).min() < 2:
        return
    (out,) = pin(tau[np.newaxis], at, moments[np.newaxis])
    frames = np.arange(len(tau))
    np.testing.assert_allclose(np.interp(at, frames, out), moments, atol=1e-9)
    assert (np.diff(out) >= 0).all()
    assert out[0] == 0
    assert out[-1] == len(tau) - 1


def test_pins_leave_what_is_unknown_or_far_away():
    frames = np.arange(101) * 1.0
    (same,) = pin(frames[np.newaxis], np.array([50.0]), np.array([[NAN]]))
    np.testing.assert_array_equal(same, frames)
    (out,) = pin(frames[np.newaxis], np.array([30.5]), np.array([[33.0]]))
    np.testing.assert_allclose(np.interp(30.5, frames, out), 33)
    assert np.abs(out - frames)[75:].max() < 0.01


def test_ramps_find_their_keyframes():
    arrays = [np.zeros((11, 2)), np.zeros((31, 2), np.float32)]
    marked = add_ramps(arrays, np.array([[0.25, NAN], [0.5, 0.9]]))
    assert [x.shape for x in marked] == [(11, 4), (31, 4)]
    assert marked[1].dtype == np.float32
    np.testing.assert_allclose(np.interp(0, marked[0][:, 2], np.arange(11)), 2.5)
    assert np.isnan(marked[0][:, 3]).all()


def test_first_meeting_inverts_warps():
    frames = np.arange(41)
    tau = 40 * (frames / 40) ** 2
    met = first_meeting(np.stack([tau, tau]), np.array([[10.0, NAN], [40 * 0.36, 22.5]]))
    np.testing.assert_allclose(met[0, 0], 20, atol=0.02)
    assert np.isnan(met[0, 1])
    np.testing.assert_allclose(met[1], [24, 30], atol=0.02)
