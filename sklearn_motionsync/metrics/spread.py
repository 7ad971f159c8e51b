"""Spread: how much trials differ from each other, before and after synchronising.

Ratios are of squares: where all differences are halved they are 0.25.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from ..inputs.collections import as_collection
from ..inputs.numbers import as_numbers, check_finite, nanmean
from ..inputs.types import TrialsLike


def least_squares(before: TrialsLike, after: TrialsLike) -> float:
    """Ratio of squared differences after and before: 1 for no gain, 0 for identical trials.

    ``mean_i  int |y_i - mean_{j != i} y_j|^2 dt / int |x_i - mean_{j != i} x_j|^2 dt``, the norm
    over all features. Trials that equal the mean of the others before are left out.

    Parameters
    ----------
    before, after : array-like, shape (n_sequences, P, n_features)
        On one clock, linearly normalised and synchronised, in one unit. NaN is what was hidden:
        it is left out.

    Returns
    -------
    float
        The ratio of squares: 0.25 where all differences are halved. It does not depend on the unit.
        1 if all trials were identical before and are after.

    Raises
    ------
    ValueError
        If they are not of one shape, infinite, or all NaN; or trials that were identical
        before are not after.

    Notes
    -----
    Differences within rounding are 0.

    Warps that distort time give small values: judge by features that were not matched
    (`FeatureHoldoutScorer`).

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync.metrics import least_squares
    >>> x = np.zeros((2, 3, 1))
    >>> x[1] = 2
    >>> least_squares(x, x / 2)
    0.25
    """
    (x, tolerance), (y, tolerance_after) = _check_pair(before, after)
    old, new = (_distances_from_others(z) for z in (x, y))
    counts = old > x.shape[2] * tolerance**2
    if not counts.any():
        if (new <= y.shape[2] * tolerance_after**2).all():
            return 1.0
        raise ValueError(
            "The trials are identical before and are not after: the ratio is not defined. "
            "Compare with trials that differ, such as normalize(X) of a synchronizer."
        )
    return float(np.mean(new[counts] / old[counts]))


class AmplitudePhase(NamedTuple):
    """The result of `amplitude_phase_variance`, in squares of the unit of the trials.

    Parameters
    ----------
    amplitude : float
        ``MSE_amp``: the variance at the same moment of the action.
    phase : float
        ``MSE_phase``: the variance that is due to the timing of the moments.
    total : float
        ``MSE_total``, the sum of both: the variance before synchronising.
    phase_share : float
        ``R^2 = MSE_phase / MSE_total``; NaN if trials did not differ.
    constant : float
        ``C_R``: the ratio of the energies of the trials before and after warping.
    """

    amplitude: float
    phase: float
    total: float
    phase_share: float
    constant: float


def amplitude_phase_variance(before: TrialsLike, after: TrialsLike) -> AmplitudePhase:
    """Split the variance of trials into that of their shapes and that of their timing.

    With ``x_i`` before and ``y_i`` after synchronising, means over the N trials written as
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
    (x, tolerance), (y, _) = _check_pair(before, after, allow_nan=False)
    total, energy = _variance(x), _energy(x)
    total_left, energy_left = _variance(y), _energy(y)
    if energy == 0 < energy_left or energy_left == 0 < energy:
        raise ValueError(
            "One of before and after is zero everywhere, and the other is not. Give the same "
            "trials, normalised and synchronised."
        )
    amplitude = energy * (total_left / energy_left) if energy_left > 0 else 0.0
    differ = total > x.shape[2] * tolerance**2
    share = (total - amplitude) / total if differ else np.nan
    constant = energy / energy_left if energy_left > 0 else 1.0
    return AmplitudePhase(amplitude, total - amplitude, total, float(share), float(constant))


# -- checks and sums ----------------------------------------------------------------------


def _check_pair(before, after, *, allow_nan=True):
    """The same trials before and after, each with the size of its rounding errors.

    With ``allow_nan`` NaN is what was hidden.

    Returns
    -------
    pair : list of (ndarray of float64, shape (n_sequences, P, n_features), float)
    """
    pair = [_on_clock(z, name) for z, name in ((before, "before"), (after, "after"))]
    shape = pair[0].shape
    is_valid = len(shape) == 3 and shape[0] >= 2 and shape[1] >= 2 and shape[2] >= 1
    if not is_valid or pair[1].shape != shape:
        raise ValueError(
            "before and after must have one shape (n_sequences, P, n_features), of at least 2 "
            f"sequences, 2 frames and 1 feature; got {shape} and {pair[1].shape}. Give univariate "
            "ones as x[:, :, np.newaxis]."
        )
    for z, name in zip(pair, ("before", "after"), strict=True):
        for i, x in enumerate(z):
            check_finite(x, f"{name}, trial {i}, frame", allow_nan=allow_nan)
            if np.isnan(x).all():
                raise ValueError(f"{name}, trial {i}: all is NaN. Leave it out.")
    eps = [np.finfo(z.dtype).eps + len(z) * np.finfo(np.float64).eps for z in pair]
    return [
        (z.astype(np.float64), 4 * e * np.nanmax(np.abs(z))) for z, e in zip(pair, eps, strict=True)
    ]


def _on_clock(values, what):
    """Trials on one clock as an array."""
    if isinstance(values, pd.DataFrame) and values.index.nlevels >= 2:
        values = as_collection(values)
    if isinstance(values, np.ndarray) and values.dtype == object and values.ndim == 1:
        values = list(values)
    if isinstance(values, (list, tuple)):
        shapes = [np.shape(x) for x in values if hasattr(x, "shape")]
        if len(set(shapes)) > 1:
            raise ValueError(
                f"{what} must be trials on one clock, all of one shape (P, n_features), got "
                f"{shapes[0]} and {next(s for s in shapes if s != shapes[0])}: give those that "
                "transform or normalize return."
            )
    return as_numbers(values, what)


def _distances_from_others(z):
    """``int |z_i - mean_{j != i} z_j|^2 dt`` over [0, 1] of every sequence, trapezoidal rule.

    What is hidden differs by 0, and the rest by as much more as gives the mean square of the seen.
    """
    hidden = np.isnan(z)
    if not hidden.any():
        # Relative to the first one, so that identical sequences differ by exactly 0.
        z = z - z[0]
        differences = (z - z.mean(axis=0)) * len(z) / (len(z) - 1)
    else:
        n_others = (~hidden).sum(axis=0) - 1
        differences = (
            np.where(hidden, 0, z - nanmean(z, axis=0)) * (n_others + 1) / np.maximum(n_others, 1)
        )
        compared = (~hidden & (n_others > 0)).mean(axis=(1, 2), keepdims=True)
        differences = differences / np.sqrt(np.where(compared > 0, compared, 1))
    return np.trapezoid(np.square(differences).sum(axis=2), dx=1 / (z.shape[1] - 1), axis=1)


def _variance(z):
    """The mean over trials of the integral of their squared distance from the mean."""
    # Relative to the first one, so that identical ones differ by exactly 0.
    z = z - z[0]
    return _energy(z - z.mean(axis=0))


def _energy(z):
    """The mean over trials of ``int |z_i|^2 dt`` over [0, 1], by the trapezoidal rule."""
    squares = np.square(z).sum(axis=2).mean(axis=0)
    return float(np.trapezoid(squares, dx=1 / (len(squares) - 1)))
