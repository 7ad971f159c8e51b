"""Every measure with valid arguments, a slow oracle, and arguments that it refuses."""

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

NAN, INF = np.nan, np.inf


class Case(NamedTuple):
    """One measure: `oracle` computes the same from `arguments` by plain loops."""

    arguments: tuple
    oracle: Callable
    refused: list


def make_warps():
    rng = np.random.default_rng(1)
    steps = rng.uniform(0, 2, (5, 19)) * (rng.uniform(size=(5, 19)) > 0.2)
    tau = np.concatenate([np.zeros((5, 1)), np.cumsum(steps, axis=1)], axis=1)
    return 19 * tau / tau[:, -1:]


def make_curves(n=4, n_frames=20, n_features=3):
    rng = np.random.default_rng(5)
    base = np.cumsum(rng.standard_normal((n_frames, n_features)), axis=0)
    return base + 0.3 * rng.standard_normal((n, n_frames, n_features))


WARPS = make_warps()
MOMENTS = [np.linspace(0, 1, 12 + i) ** (1 + i / 4) for i in range(5)]
KEYFRAMES = np.sort(np.random.default_rng(2).uniform(1, 18, (5, 2)), axis=1)
CURVES = make_curves(), np.random.default_rng(0).standard_normal((4, 20, 3))

# -- oracles ------------------------------------------------------------------------------


def interpolate(track, at):
    i = min(int(at), len(track) - 2)
    return track[i] * (i + 1 - at) + track[i + 1] * (at - i)


def integral(f):
    """Trapezoidal rule over [0, 1]."""
    return sum((a + b) / 2 for a, b in pairwise(f)) / (len(f) - 1)


def group_difference(times, moments):
    P, differences = times.shape[1], []
    for p in range(P):
        shown = [
            interpolate(phi, tau[p] * (len(phi) - 1) / (P - 1))
            for tau, phi in zip(times, moments, strict=True)
        ]
        differences += [abs(phi - sum(shown) / len(shown)) for phi in shown]
    return (P - 1) * np.mean(differences)


def keyframe_difference(times, keyframes, pattern, lengths):
    differences = []
    for tau, own, length in zip(times, keyframes, lengths, strict=True):
        frames = (length - 1) / (times.shape[1] - 1)
        for p, k in zip(pattern, own, strict=True):
            differences.append(abs(interpolate(tau, p) - k / frames))
    return np.mean(differences)


def squared_distance(x, y):
    return sum(integral((x[:, k] - y[:, k]) ** 2) for k in range(x.shape[1]))


def spread_ratio(before, after):
    n, ratios = len(before), []
    for i in range(n):
        others = [j for j in range(n) if j != i]
        new, old = (squared_distance(z[i], z[others].mean(axis=0)) for z in (after, before))
        ratios.append(new / old)
    return np.mean(ratios)


# -- refused arguments --------------------------------------------------------------------

FIVE = [[0, 1, 2, 3, 4.0]]
WRONG_WARPS = [
    ([[0, NAN, 2, 3, 4]], r"Trial 0: \w+ must be from 0 to P - 1 = 4.*nan at frame 1"),
    ([[0, 1, 2, 3, INF]], "got inf at frame 4"),
    ([[0, 1, 2, 3, 4.1]], "got 4.1 at frame 4"),
    ([[-0.1, 1, 2, 3, 4]], "got -0.1 at frame 0"),
    ([0, 1, 2, 3, 4], r"shape \(n_sequences, P\).*got \(5,\)"),
    ([[0]], r"P at least 2, got \(1, 1\)"),
    (np.zeros((0, 5)), "Got 0 warps and 1 set"),
    (np.zeros((1, 5, 1)), r"got \(1, 5, 1\)"),
    ([[0, 1j, 2, 3, 4]], "complex"),
]
WRONG_MOMENTS = [
    ([[0, 1.5]], r"Trial 0: moments must be shares.*got \[0.0, 1.5\].*For seconds give"),
    ([[-0.5, 1]], r"from 0 to 1, .*got \[-0.5, 1.0\]"),
    ([[0, NAN, 1]], r"got \[0.0, nan, 1.0\]"),
    ([[0, 0.5, 0.4, 1]], r"must not decrease; got \[0.0, 0.5, 0.4, 1.0\]"),
    ([[0]], r"at least 2, .*got \[0.0\]"),
    ([[[0, 1]]], r"got \[\[0.0, 1.0\]\]"),
    ([0, 1], "1 warp and 2 sets"),
    ([], "1 warp and 0 sets"),
    ([["0", "1"]], "Trial 0: moments is not a numeric"),
    ({"a": [0, 1]}, "got dict"),
    (None, "got NoneType"),
]
WRONG_KEYFRAMES = [
    (([[NAN]], [2], [9]), r"Trial 0: key-frames .* from 0 to 8, in its own .*nan"),
    (([[8.5]], [2], [9]), r"from 0 to 8.*\[8.5\]"),
    (([[-1]], [2], [9]), "Trial 0: key-frames"),
    (([[5, 4]], [1, 2], [9]), "Trial 0: key-frames must increase"),
    (([[4, 5]], [2, 1], [9]), "The pattern: key-frames must increase"),
    (([[5]], [4.5], [9]), "The pattern: .* from 0 to 4, in frames of the clock"),
    (([[0.62, 1.4, 2.5]], [1, 2, 3], [300]), "Trial 0: .* look like seconds"),
    (([[5]], 2, [9]), r"pattern_keyframes must have shape \(n_keyframes,\)"),
    (([[]], [], [9]), "at least one"),
    (([[5], [5]], [2], [9]), r"each of the 1 warp; got .* \(1,\) and \[\(1,\), \(1,\)\]"),
    (([5], [2], [9]), r"got the shapes \(1,\) and \[\(\)\]"),
    (([[5, 6]], [2], [9]), r"got the shapes \(1,\) and \[\(2,\)\]"),
    ((5, [2], [9]), "list of arrays, one a trial, got int"),
    (("lift", [2], [9]), "got str"),
    (([["lift"]], [2], [9]), "Trial 0: keyframes is not a numeric"),
    *((([[5]], [2], [n]), rf"got \[{n}.*, wrong for the trials \[0\]") for n in (1, 9.5, NAN, INF)),
    (([[5]], [2], [9, 9]), "n_frames must be the lengths of the 1 trial"),
    (([[5]], [2], 9), "n_frames must be the lengths"),
]


def with_gap(value):
    x = make_curves()
    x[2, 7, 1] = value
    return x


WRONG_CURVES = [
    (np.full((4, 20, 3), NAN), "all is NaN|is NaN"),
    (with_gap(INF), "is infinity"),
    (np.ma.masked_invalid(with_gap(NAN)), "masked"),
    (CURVES[0] + 1j, "complex"),
    (CURVES[0].astype(str), "not a numeric array"),
    (CURVES[0][:, :1], "of at least 2 sequences, 2 frames"),
    (CURVES[0][:1], "at least 2 sequences"),
    (CURVES[0][:, :, :0], "1 feature"),
    (CURVES[0][:, :, 0], r"x\[:, :, np.newaxis\]"),
    (np.empty((0, 20, 3)), "at least 2 sequences"),
    ([], "at least 2 sequences"),
    ([x[:k] for x, k in zip(CURVES[0], (20, 19, 18, 17), strict=True)], "on one clock"),
    ([x[:k].tolist() for x, k in zip(CURVES[0], (9, 8, 7, 6), strict=True)], "not a numeric"),
    (None, "must have one shape"),
]
CURVE_REFUSALS = [((wrong, wrong), {}, message) for wrong, message in WRONG_CURVES]
CURVE_REFUSALS += [((CURVES[0], with_gap(INF)), {}, "after")]
ONE_MOMENT, ONE_KEYFRAME = [[0, 0.5, 1]], ([[5]], [2], [9])


def refusals(wrong, arguments):
    """Triples of arguments, keywords and message; `arguments` places a wrong value."""
    return [(arguments(value), {}, message) for value, message in wrong]


CASES = {
    "group_timing_error": Case(
        (WARPS, MOMENTS),
        group_difference,
        refusals(WRONG_WARPS, lambda t: (t, ONE_MOMENT))
        + refusals(WRONG_MOMENTS, lambda phi: (FIVE, phi)),
    ),
    "keyframe_error": Case(
        (WARPS, KEYFRAMES, np.array([4.0, 9.5]), [30, 40, 20, 25, 55]),
        keyframe_difference,
        refusals(WRONG_WARPS[:1], lambda t: (t, *ONE_KEYFRAME))
        + refusals(WRONG_KEYFRAMES, lambda k: (FIVE, *k)),
    ),
    "least_squares": Case(CURVES, spread_ratio, CURVE_REFUSALS),
}
