"""Costs: the features that are compared, and the weights of the steps of a path (Eqs. 12, 16)."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .counting import whole

# w of the velocity cost, from the measurement in docs/design.md.
RATE_WEIGHT = 0.2


class Cost(NamedTuple):
    """One way to compare trials.

    Attributes
    ----------
    of_velocity : bool
        Whether velocities are compared: smoothed derivatives of the poses, by the frame.
    transform : callable or None
        Function of poses, or velocities, (n_sequences, Q, n_features) that gives the features;
        None for the same.
    weights : callable
        ``weights(rates)``: ``b``, ``g`` and ``phi`` of `StepTable` at local rates.
    """

    of_velocity: bool
    transform: Callable | None
    weights: Callable

    @property
    def degree(self):
        """Power of the unit of the data in squares of the features: 1 of square roots."""
        return 2 if self.transform is None else 1


class StepTable(NamedTuple):
    """The cost of every admissible step.

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


def step_table(cost="pose", max_rate=2, subframes=1):
    """Build the step table of a cost.

    ==========  ========  ===========  =============
    cost        b_s       g_s          phi
    ==========  ========  ===========  =============
    pose     1         2            abs(rho - 1)
    velocity    omega^2   2 omega      (rho - 1)^2
    elastic     rho       2 sqrt(rho)  (rho - 1)^2
    ==========  ========  ===========  =============

    The two penalties agree on the rates 0, 1 and 2 of Eq. 16. A velocity counts with the
    weight ``omega = 1 - w + w rho``, ``w = 0.2``: run at the rate rho a sequence moves rho times
    as fast, but taking that whole (w = 1) makes wrong moments agree by changing the pace, and
    not at all (w = 0) stands still and jumps.

    Parameters
    ----------
    cost : {"pose", "velocity", "elastic"}, default="pose"
        ``"pose"`` with the other defaults is exactly Eqs. 12 and 16.
    max_rate : float, default=2
        Largest local rate; 2 is the limit that follows from Eq. 13.
    subframes : int, default=1
        Sub-positions a frame.

    Returns
    -------
    StepTable
    """
    steps = np.arange(whole(max_rate * subframes, "down") + 1)
    steps = steps[np.argsort(np.abs(steps - subframes), kind="stable")]
    return StepTable(steps, *COSTS[cost].weights(steps / subframes), subframes)


class StepGroup(NamedTuple):
    """Steps of equal weights; their smallest penalty is taken out of the levels."""

    moving: float
    inner: float
    penalty: float
    levels: list


def group_steps(table, mu, slopes):
    """Groups of steps of equal weights, and the group of every step, given their slopes."""
    weights = list(zip(table.moving.tolist(), table.inner.tolist(), strict=True))
    unique = sorted(set(weights))
    group_of_step = np.array([unique.index(pair) for pair in weights])
    groups = []
    for i, (moving, inner) in enumerate(unique):
        members = group_of_step == i
        penalties = mu * table.penalty[members]
        least = penalties.min()
        levels = [
            (value - float(least), slopes[members][penalties == value].tolist())
            for value in sorted(set(penalties.tolist()), reverse=True)
        ]
        groups.append(StepGroup(moving, inner, float(least), levels))
    return groups, group_of_step


# -- the costs ------------------------------------------------------------------------------


def _pose_weights(rates):
    ones = np.ones(len(rates))
    return ones, 2 * ones, np.abs(rates - 1)


def _velocity_weights(rates):
    omega = 1 + RATE_WEIGHT * (rates - 1)
    return omega**2, 2 * omega, np.square(rates - 1)


def _square_root_velocity(velocity):
    speed = np.linalg.norm(velocity, axis=-1, keepdims=True)
    return velocity / np.sqrt(np.maximum(speed, np.finfo(speed.dtype).tiny))


def _elastic_weights(rates):
    return rates, 2 * np.sqrt(rates), np.square(rates - 1)


COSTS = {
    "velocity": Cost(True, None, _velocity_weights),
    "elastic": Cost(True, _square_root_velocity, _elastic_weights),
    "pose": Cost(False, None, _pose_weights),
}
