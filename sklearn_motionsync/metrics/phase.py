"""The variance of performances split into that of their shapes and that of their timing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..inputs.types import PerformancesLike
from .spread import check_pair

__all__ = ["amplitude_phase_variance"]


class AmplitudePhase(NamedTuple):
    """The result of `amplitude_phase_variance`, in squares of the unit of the performances.

    Parameters
    ----------
    amplitude : float
        ``MSE_amp``: the variance at the same moment of the action.
    phase : float
        ``MSE_phase``: the variance that is due to the timing of the moments.
    total : float
        ``MSE_total``, the sum of both: the variance before synchronising.
    phase_share : float
        ``R^2 = MSE_phase / MSE_total``; NaN if performances did not differ.
    constant : float
        ``C_R``: the ratio of the energies of the performances before and after warping.
    """

    amplitude: float
    phase: float
    total: float
    phase_share: float
    constant: float


def amplitude_phase_variance(before: PerformancesLike, after: PerformancesLike) -> AmplitudePhase:
    """Split the variance of performances into that of their shapes and that of their timing.

    With ``x_i`` before and ``y_i`` after synchronising, means over the N performances written as
    ``xm`` and ``ym``, and ``|.|`` taken over all features:

    - ``MSE_total = 1/N sum_i int |x_i - xm|^2 dt``
    - ``MSE_amp = C_R 1/N sum_i int |y_i - ym|^2 dt``
    - ``MSE_phase = C_R int |ym|^2 dt - int |xm|^2 dt``
    - ``C_R = sum_i int |x_i|^2 dt / sum_i int |y_i|^2 dt``
    - ``MSE_total = MSE_amp + MSE_phase``, and ``R^2 = MSE_phase / MSE_total``.

    Parameters
    ----------
    before, after : array-like, shape (n_sequences, P, n_features)
        On one clock: linearly normalised, ``synchronizer.normalize(X)``, and synchronised,
        ``synchronizer.transform(X)``.

    Returns
    -------
    AmplitudePhase
        A named tuple: ``amplitude``, ``phase``, ``total``, ``phase_share`` and ``constant``.

    Raises
    ------
    ValueError
        If they are not of one shape and finite; or one is zero everywhere and the other is not.

    Notes
    -----
    Kneip and Ramsay write ``C_R`` by the covariance of the rates of the warps with the squares of
    the synchronised curves. As ``int |x_i|^2 dt = int |y_i|^2 tau_i' dt``, it is the ratio of
    energies above, which needs no derivative, and is also valid if the mean of the warps is
    not the identity.

    The share of the phase is negative if synchronising increased the differences. It depends on
    the zero of the features, as energies do, and features of larger values count more. Give angles
    relative to the joint at rest, one by one or scaled. Warps that distort time reduce the
    amplitude, and the rest is called phase: `FeatureHoldoutScorer` detects that.

    References
    ----------
    A. Kneip, J. O. Ramsay, "Combining Registration and Fitting for Functional Models", Journal of
    the American Statistical Association 103, 2008.

    J. O. Ramsay, G. Hooker, S. Graves, "Functional Data Analysis with R and MATLAB", section 8.5,
    2009.

    Examples
    --------
    The same two bumps, one of them late: they differ in timing alone.

    >>> import numpy as np
    >>> from sklearn_motionsync.metrics import amplitude_phase_variance
    >>> t = np.linspace(0, 1, 201)
    >>> before = np.stack([np.sin(np.pi * t), np.sin(np.pi * t**1.5)])[:, :, np.newaxis]
    >>> after = before[[0, 0]]
    >>> amplitude_phase_variance(before, after).phase_share
    1.0
    >>> higher = after * np.array([1, 1.2])[:, np.newaxis, np.newaxis]
    >>> round(amplitude_phase_variance(higher, higher).phase_share, 3)
    0.0
    """
    (x, tolerance), (y, _) = check_pair(before, after, allow_nan=False)
    total, energy = _variance(x), _energy(x)
    total_left, energy_left = _variance(y), _energy(y)
    if energy == 0 < energy_left or energy_left == 0 < energy:
        raise ValueError(
            "One of before and after is zero everywhere, and the other is not. Give the same "
            "performances, normalised and synchronised."
        )
    amplitude = energy * (total_left / energy_left) if energy_left > 0 else 0.0
    differ = total > x.shape[2] * tolerance**2
    share = (total - amplitude) / total if differ else np.nan
    constant = energy / energy_left if energy_left > 0 else 1.0
    return AmplitudePhase(amplitude, total - amplitude, total, float(share), float(constant))


def _variance(z):
    """The mean over performances of the integral of their squared distance from the mean."""
    # Relative to the first one, so that identical ones differ by exactly 0.
    z = z - z[0]
    return _energy(z - z.mean(axis=0))


def _energy(z):
    """The mean over performances of ``int |z_i|^2 dt`` over [0, 1], by the trapezoidal rule."""
    squares = np.square(z).sum(axis=2).mean(axis=0)
    return float(np.trapezoid(squares, dx=1 / (len(squares) - 1)))
