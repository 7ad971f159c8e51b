"""How somebody walks: the course of angles and force, cycle after cycle, and its pace."""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

# When the moments come, in shares of a cycle from heel strike to heel strike.
TOE_OFF = 0.62
KEYFRAMES = {
    "first force peak": 0.14,
    "valley of the force": 0.30,
    "second force peak": 0.48,
    "toe-off": TOE_OFF,
    "peak knee flexion": 0.73,
}

# Degrees of flexion, of the ankle dorsiflexion, and body weights, by share of the cycle.
CURVES = {
    "hip_flexion": {
        0.00: 30, 0.08: 27, 0.18: 20, 0.30: 8, 0.42: -3, 0.52: -10, 0.60: -5, 0.68: 9, 0.77: 24,
        0.86: 33, 0.94: 32,
    },
    "knee_flexion": {
        0.00: 4, 0.06: 12, 0.14: 19, 0.26: 12, 0.39: 4, 0.49: 11, 0.56: 25, 0.62: 40, 0.67: 54,
        0.73: 61, 0.79: 55, 0.86: 33, 0.92: 11, 0.97: 2,
    },
    "ankle_dorsiflexion": {
        0.00: 0, 0.03: -4, 0.07: -6, 0.14: -1, 0.24: 5, 0.36: 9, 0.45: 11, 0.52: 6, 0.58: -10,
        0.64: -19, 0.70: -11, 0.78: -2, 0.86: 1, 0.94: 1,
    },
    "vertical_force": {
        0.00: 0, 0.03: 0.36, 0.07: 0.82, 0.14: 1.12, 0.22: 0.91, 0.30: 0.76, 0.39: 0.93, 0.48: 1.10,
        0.54: 0.76, 0.58: 0.30, TOE_OFF: 0, 0.75: 0, 0.90: 0,
    },
}  # fmt: skip
# How people differ: degrees by which an angle is larger throughout, and by which it is larger here
# and smaller there; the share of the latter between cycles of somebody; and shares by which the
# range of a curve is larger, and by which the force is larger here and there, for each degree.
_MOVED = {"hip_flexion": 4.0, "knee_flexion": 3.0, "ankle_dorsiflexion": 2.5}
_BENT, _BENT_AGAIN = 1.5, 0.3
_LARGER, _FORCE_A_DEGREE = 0.06, 0.02
# At how many moments a pace is drawn.
_N_PACE = 501


class Walk(NamedTuple):
    """Consecutive cycles of one person.

    ``curves`` give angles and force at a phase, in cycles. At so many even steps of the group's
    pace ``moments`` come; when they do, ``shares`` of each cycle are over, which takes as long as
    ``durations`` say, about 1. There is one cycle more at either end.
    """

    curves: list
    moments: np.ndarray
    shares: np.ndarray
    durations: np.ndarray

    def times_at(self, cycle, share):
        """Which moment of a cycle it is when a share of it is over."""
        even = np.linspace(0, 1, _N_PACE)
        return np.interp(np.interp(share, self.shares[cycle], even), even, self.moments)

    def shares_at(self, cycle, moments):
        """Which share of a cycle is over at moments."""
        even = np.linspace(0, 1, _N_PACE)
        return np.interp(np.interp(moments, self.moments, even), even, self.shares[cycle])


def draw_walk(random_state, n_cycles, amplitude, timing, style, warp):
    """So many cycles of somebody, with one more before and after them."""
    n = n_cycles + 2
    durations = random_state.uniform(0.85, 1.15) * random_state.uniform(0.96, 1.04, n)
    curves = []
    for name, anchors in CURVES.items():
        at = np.array(list(anchors))
        values = _vary(random_state, style, name, at, _anchors_of(name, amplitude), n)
        # Cycle after cycle, so that one ends where the next begins.
        phases = np.arange(n)[:, np.newaxis] + at
        curves.append(PchipInterpolator(phases.ravel(), values.ravel()))
    even = np.linspace(0, 1, _N_PACE)
    shares = _draw_shares(random_state, n, warp, even)
    # Where the group is at an even pace, people are at theirs.
    moments = np.interp(even, shifted(even, timing), even)
    return Walk(curves, moments, shares, durations)


def _anchors_of(name, amplitude):
    """Values of a curve where it is known, with the knee flexed further in swing."""
    at, values = np.array(list(CURVES[name].items()), dtype=np.float64).T
    if name == "knee_flexion":
        peak = KEYFRAMES["peak knee flexion"]
        values += amplitude * np.cos(np.pi * np.clip((at - peak) / 0.42, -0.5, 0.5)) ** 2
    return values


def _vary(random_state, style, name, at, values, n):
    """The same of n cycles of a person, each a little larger or smaller here and there."""
    waves = np.arange(1, 4)[:, np.newaxis]

    def draw(count, size):
        weights = size * random_state.standard_normal((count, 3)) / waves[:, 0]
        return weights @ np.sin(2 * np.pi * (waves * at + random_state.uniform(size=(3, 1))))

    wave = draw(1, _BENT) + draw(n, _BENT * _BENT_AGAIN)
    larger = np.exp(style * _LARGER * random_state.standard_normal())
    moved = random_state.standard_normal()
    if name == "vertical_force":
        # What is 0 stays 0.
        return values * larger * np.exp(style * _FORCE_A_DEGREE * wave)
    return values * larger + style * (_MOVED[name] * moved + wave)


def _draw_shares(random_state, n, strength, even):
    """Shares of n cycles over at even moments: integrals of smooth positive rates."""
    waves = np.arange(1, 4)[:, np.newaxis]
    shape = np.sin(np.pi * waves * even + random_state.uniform(0, 2 * np.pi, (3, 1)))
    weights = random_state.standard_normal((1, 3)) + 0.35 * random_state.standard_normal((n, 3))
    rates = 2 ** (0.5 * strength * np.tanh(0.15 * (weights / waves[:, 0]) @ shape))
    shares = np.cumsum((rates[:, 1:] + rates[:, :-1]) / 2, axis=1)
    return np.hstack([np.zeros((n, 1)), shares / shares[:, -1:]])


def shifted(moments, timing):
    """The share of the cycle that is over when moments come, toe-off being later by timing."""
    exponent = np.log(0.5) / np.log(TOE_OFF)
    return moments + timing / 100 * np.sin(np.pi * moments**exponent) ** 2


def typical(moments, amplitude):
    """Angles and force of somebody typical: (n_moments, 4)."""
    curves = []
    for name, anchors in CURVES.items():
        at = np.arange(-1, 2)[:, np.newaxis] + np.array(list(anchors))
        values = np.tile(_anchors_of(name, amplitude), 3)
        curves.append(PchipInterpolator(at.ravel(), values)(moments))
    return np.stack(curves, axis=1)
