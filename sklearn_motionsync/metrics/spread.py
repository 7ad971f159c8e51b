"""Spread: how much trials differ from each other, before and after synchronising.

Ratios are of squares: where all differences are halved they are 0.25.
"""

from __future__ import annotations

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


# -- checks and sums ----------------------------------------------------------------------


def _check_pair(before, after):
    """The same trials before and after, each with the size of its rounding errors.

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
            check_finite(x, f"{name}, trial {i}, frame", allow_nan=True)
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
