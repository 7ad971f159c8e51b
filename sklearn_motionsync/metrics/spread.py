"""Spread: how much performances differ from each other after synchronising, as a share of before.

They are ratios of squares: where all differences are halved they are 0.25.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from ..inputs.collections import as_collection
from ..inputs.numbers import as_numbers, check_finite, nanmean
from ..inputs.types import PerformancesLike

__all__ = [
    "check_pair",
    "least_squares",
    "sobolev_least_squares",
]


def least_squares(before: PerformancesLike, after: PerformancesLike) -> float:
    """Ratio of squared differences after and before: 1 for no gain, 0 for identical performances.

    ``mean_i  int |y_i - mean_{j != i} y_j|^2 dt / int |x_i - mean_{j != i} x_j|^2 dt``, the norm
    over all features. Performances that equal the mean of the others before are left out.

    Parameters
    ----------
    before, after : array-like, shape (n_sequences, P, n_features)
        On one clock, linearly normalised and synchronised, in one unit. NaN is what was hidden:
        it is left out.

    Returns
    -------
    float
        The ratio of squares: 0.25 where all differences are halved. It does not depend on the unit.
        1 if all performances were identical before and are after.

    Raises
    ------
    ValueError
        If they are not of one shape, infinite, or all NaN; or performances that were identical
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
    (x, tolerance), (y, tolerance_after) = check_pair(before, after)
    old, new = (_squared_norms(_from_others(z)) for z in (x, y))
    counts = old > x.shape[2] * tolerance**2
    if not counts.any():
        is_same = (new <= y.shape[2] * tolerance_after**2).all()
        return _without_spread_before(is_same, "identical")
    return float(np.mean(new[counts] / old[counts]))


def sobolev_least_squares(before: PerformancesLike, after: PerformancesLike) -> float:
    """Ratio of squared differences of velocities after and before; 1 for no gain.

    ``sum_i int |y_i' - mean_j y_j'|^2 dt / sum_i int |x_i' - mean_j x_j'|^2 dt``

    Parameters
    ----------
    before, after : array-like, shape (n_sequences, P, n_features)
        On one clock, linearly normalised and synchronised, in one unit. NaN is what was hidden:
        it is left out.

    Returns
    -------
    float
        The ratio of squares: 0.25 where all differences are halved. 1 if all velocities were
        identical before and are after.

    Raises
    ------
    ValueError
        If they are not of one shape, infinite, or all NaN; or velocities that were identical
        before are not after.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync.metrics import sobolev_least_squares
    >>> x = np.stack([np.zeros((3, 1)), np.arange(3.0)[:, None]])
    >>> sobolev_least_squares(x, x + 5)
    1.0
    """
    (x, tolerance), (y, tolerance_after) = check_pair(before, after)
    old, new = (_squared_norms(_from_others(np.gradient(z, axis=1))).sum() for z in (x, y))
    if old <= len(x) * x.shape[2] * tolerance**2:
        is_same = new <= len(y) * y.shape[2] * tolerance_after**2
        return _without_spread_before(is_same, "of identical velocity")
    return float(new / old)


# -- checks and sums ----------------------------------------------------------------------


def check_pair(before, after, *, allow_nan=True):
    """The same performances before and after, each with the size of its rounding errors.

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
            check_finite(x, f"{name}, performance {i}, frame", allow_nan=allow_nan)
            if np.isnan(x).all():
                raise ValueError(f"{name}, performance {i}: all is NaN. Leave it out.")
    eps = [np.finfo(z.dtype).eps + len(z) * np.finfo(np.float64).eps for z in pair]
    return [
        (z.astype(np.float64), 4 * e * np.nanmax(np.abs(z))) for z, e in zip(pair, eps, strict=True)
    ]


def _on_clock(values, what):
    """Performances on one clock as an array."""
    if isinstance(values, pd.DataFrame) and values.index.nlevels >= 2:
        values = as_collection(values)
    if isinstance(values, np.ndarray) and values.dtype == object and values.ndim == 1:
        values = list(values)
    if isinstance(values, (list, tuple)):
        shapes = [np.shape(x) for x in values if hasattr(x, "shape")]
        if len(set(shapes)) > 1:
            raise ValueError(
                f"{what} must be performances on one clock, all of one shape (P, n_features), got "
                f"{shapes[0]} and {next(s for s in shapes if s != shapes[0])}: give those that "
                "transform or normalize return."
            )
    return as_numbers(values, what)


def _squared_norms(z):
    """``int |z_i|^2 dt`` over [0, 1] of every sequence, by the trapezoidal rule."""
    return np.trapezoid(np.square(z).sum(axis=2), dx=1 / (z.shape[1] - 1), axis=1)


def _from_others(z):
    """Differences of every sequence from the mean of the others.

    What is hidden differs by 0, and the rest by as much more as gives the mean square of the seen.
    """
    hidden = np.isnan(z)
    if not hidden.any():
        # Relative to the first one, so that identical sequences differ by exactly 0.
        z = z - z[0]
        return (z - z.mean(axis=0)) * len(z) / (len(z) - 1)
    n_others = (~hidden).sum(axis=0) - 1
    differences = (
        np.where(hidden, 0, z - nanmean(z, axis=0)) * (n_others + 1) / np.maximum(n_others, 1)
    )
    compared = (~hidden & (n_others > 0)).mean(axis=(1, 2), keepdims=True)
    return differences / np.sqrt(np.where(compared > 0, compared, 1))


def _without_spread_before(none_after, what):
    """1, for no gain, if there is no spread before and after."""
    if none_after:
        return 1.0
    raise ValueError(
        f"The performances are {what} before and are not after: the ratio is not defined. "
        "Compare with performances that differ, such as normalize(X) of a synchronizer."
    )
