"""Costs: what each of them compares, and what a step of a path costs under it (Eqs. 12 and 16)."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .filters import SMOOTHING, smooth

__all__ = ["COSTS", "RATE_WEIGHT", "Cost", "StepTable", "cost_features", "step_table"]

# w of the velocity cost, from the measurement in docs/method.md.
RATE_WEIGHT = 0.2


class Cost(NamedTuple):
    """One way to compare performances.

    Attributes
    ----------
    features : callable
        ``features(postures, derive)``: what is compared at every position. ``derive(postures)``
        are their velocities, by the frame; they are a new array.
    weights : callable
        ``weights(rates)``: ``b``, ``g`` and ``phi`` of `StepTable` at local rates.
    degree : int
        With which power of the unit of the data squares of the features grow.
    """

    features: Callable
    weights: Callable
    degree: int


class StepTable(NamedTuple):
    """What every admissible step costs: the difference between one cost and another.

    Attributes
    ----------
    steps : ndarray of int, shape (n_steps,)
        Admissible steps ``s``, in sub-positions, the preferred ones first: among
        paths of equal cost the back-tracking takes the earlier entry.
    moving : ndarray, shape (n_steps,)
        ``b_s``, the weight of ``|x_m(q)|^2``.
    inner : ndarray, shape (n_steps,)
        ``g_s = 2 sqrt(b_s)``, the weight of the inner product: the local cost is a square,
        ``|x_n(p) - sqrt(b_s) x_m(q)|^2``, and ``b_s = 1`` at rate 1.
    penalty : ndarray, shape (n_steps,)
        ``phi(rho)``, multiplied by ``mu``.
    subframes : int
        Sub-positions a frame.
    """

    steps: np.ndarray
    moving: np.ndarray
    inner: np.ndarray
    penalty: np.ndarray
    subframes: int


def cost_features(on_clock, cost, subframes=1, smoothing=SMOOTHING):
    """Features of normalised sequences that a cost compares.

    Parameters
    ----------
    on_clock : ndarray, shape (n_sequences, Q, n_features)
        Linearly normalised sequences, ``subframes`` positions a frame.
    cost : {"posture", "velocity", "elastic"}
        ``"posture"``: the points themselves. ``"velocity"``: their derivative by the frame,
        smoothed. ``"elastic"``: the velocity divided by the square root of its length, whose
        squared distance is the Fisher-Rao distance.
    subframes : int, default=1
    smoothing : float, default=0.03
        Width of the smoothing, as a share of the clip.

    Returns
    -------
    ndarray, shape (n_sequences, Q, n_features)
    """

    def derive(postures):
        velocity = smooth(postures, smoothing * (postures.shape[1] - 1), order=1)
        velocity *= subframes
        return velocity

    return COSTS[cost].features(on_clock, derive)


def step_table(cost="posture", max_rate=2, subframes=1):
    """Build the step table of a cost.

    ==========  ========  ===========  =============
    cost        b_s       g_s          phi
    ==========  ========  ===========  =============
    posture     1         2            abs(rho - 1)
    velocity    omega^2   2 omega      (rho - 1)^2
    elastic     rho       2 sqrt(rho)  (rho - 1)^2
    ==========  ========  ===========  =============

    The two penalties agree on the rates 0, 1 and 2 of Eq. 16. A velocity counts with the
    weight ``omega = 1 - w + w rho``, ``w = 0.2``: run at the rate rho a sequence moves rho times
    as fast, but taking that whole (w = 1) makes wrong moments agree by changing the pace, and
    not at all (w = 0) stands still and jumps.

    Parameters
    ----------
    cost : {"posture", "velocity", "elastic"}, default="posture"
        ``"posture"`` with the other defaults is exactly Eqs. 12 and 16.
    max_rate : float, default=2
        Largest local rate; 2 is the limit that follows from Eq. 13.
    subframes : int, default=1
        Sub-positions a frame.

    Returns
    -------
    StepTable
    """
    if cost not in COSTS:
        raise ValueError(f"cost={cost!r} is unknown; use one of {', '.join(map(repr, COSTS))}.")
    steps = np.arange(int(np.floor(max_rate * subframes)) + 1)
    steps = steps[np.argsort(np.abs(steps - subframes), kind="stable")]
    return StepTable(steps, *COSTS[cost].weights(steps / subframes), subframes)


# -- the costs ------------------------------------------------------------------------------


def _postures(postures, derive):
    return postures


def _posture_weights(rates):
    ones = np.ones(len(rates))
    return ones, 2 * ones, np.abs(rates - 1)


def _velocities(postures, derive):
    return derive(postures)


def _velocity_weights(rates):
    omega = 1 + RATE_WEIGHT * (rates - 1)
    return omega**2, 2 * omega, np.square(rates - 1)


def _square_roots(postures, derive):
    velocity = derive(postures)
    speed = np.linalg.norm(velocity, axis=-1, keepdims=True)
    return velocity / np.sqrt(np.maximum(speed, np.finfo(speed.dtype).tiny))


def _elastic_weights(rates):
    return rates, 2 * np.sqrt(rates), np.square(rates - 1)


COSTS = {
    "velocity": Cost(_velocities, _velocity_weights, 2),
    "elastic": Cost(_square_roots, _elastic_weights, 1),
    "posture": Cost(_postures, _posture_weights, 2),
}
