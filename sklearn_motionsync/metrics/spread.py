"""How much performances differ: the share of the spread that synchronising leaves."""

import numpy as np

from .arguments import as_movements

__all__ = ["least_squares", "pairwise_correlation", "sobolev_least_squares"]


def least_squares(before, after):
    """Share of the spread that is left: 1 for no gain, 0 for identical performances.

    ``mean_i  int |y_i - mean_{j != i} y_j|^2 dt / int |x_i - mean_{j != i} x_j|^2 dt``, the norm
    taken over all features; a performance that was no different before does not count. If none
    was, there was nothing to gain: 1.

    Parameters
    ----------
    before, after : array-like, shape (n_sequences, P, n_features)
        On one clock, linearly normalised and synchronised.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If they are not of one shape and finite; or performances that were identical before are not
        after, of which there is no share.

    Notes
    -----
    The share does not depend on the unit. Differences that rounding explains are none.

    Small values are easily had by distorting time: judge on features that were not matched
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
    x, y = as_movements(before, after)
    old, new = (_integral(_from_others(z.values)) for z in (x, y))
    counts = old > _least(x)
    if not counts.any():
        return _no_share((new <= _least(y)).all(), "identical")
    return _in_one_unit(np.mean(new[counts] / old[counts]), x, y)


def sobolev_least_squares(before, after):
    """Share of the spread of velocities that is left.

    ``sum_i int |y_i' - mean_j y_j'|^2 dt / sum_i int |x_i' - mean_j x_j'|^2 dt``; 1 if velocities
    did not differ before, since there was nothing to gain.

    Parameters
    ----------
    before, after : array-like, shape (n_sequences, P, n_features)

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If they are not of one shape and finite; or velocities that were identical before are not
        after.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync.metrics import sobolev_least_squares
    >>> x = np.stack([np.zeros((3, 1)), np.arange(3.0)[:, None]])
    >>> sobolev_least_squares(x, x + 5)
    1.0
    """
    x, y = as_movements(before, after)
    slopes = [np.gradient(z.values, axis=1) for z in (x, y)]
    old, new = (_integral(_from_others(z)).sum() for z in slopes)
    if old <= len(x.values) * _least(x):
        return _no_share(new <= len(y.values) * _least(y), "of identical velocity")
    return _in_one_unit(new / old, x, y)


def pairwise_correlation(before, after):
    """Gain in the correlation of pairs: more than 1 if synchronising made them more alike.

    ``sum_{i != j} cc(y_i, y_j) / sum_{i != j} cc(x_i, x_j)``, where cc is the correlation over
    time, features centred one by one and pooled. A performance that stands still correlates with
    none: its cc are 0. If the sum is 0 before and after, there was nothing to gain: 1.

    Parameters
    ----------
    before, after : array-like, shape (n_sequences, P, n_features)

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If they are not of one shape and finite; or correlations whose sum is 0 before do not have
        that sum after.

    Notes
    -----
    Performances that correlate negatively before, in sum, give a negative ratio, which cannot be
    compared with others.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync.metrics import pairwise_correlation
    >>> x = np.array([[0, 1, 2.0], [0, 2, 1.0]])[:, :, None]
    >>> pairwise_correlation(x, x[[0, 0]])
    2.0
    """
    pair = as_movements(before, after)
    old, new = (_mean_correlation(z) for z in pair)
    least = np.finfo(np.float64).eps * pair[0].values[0].size
    if abs(old) <= least:
        return _no_share(abs(new) <= least, "uncorrelated")
    return float(new / old)


# -- helpers --------------------------------------------------------------------------------


def _integral(z):
    """int |z_i|^2 dt, by the trapezoidal rule over [0, 1], of every sequence."""
    return np.trapezoid(np.square(z).sum(axis=2), dx=1 / (z.shape[1] - 1), axis=1)


def _from_others(z):
    # From the first one, so that nothing at all is between identical ones.
    z = z - z[0]
    return (z - z.mean(axis=0)) * len(z) / (len(z) - 1)


def _least(movements):
    """The integral of one performance up to which it is rounding."""
    return movements.values.shape[2] * movements.rounding**2


def _in_one_unit(share, before, after):
    """A share of squares that were taken in units of two kinds."""
    with np.errstate(over="ignore", under="ignore"):
        share = float(np.ldexp(share, 2 * (after.exponent - before.exponent)))
    if not np.isfinite(share):
        raise ValueError(
            "after is so much larger than before that the share is beyond double precision: give "
            "both in one unit."
        )
    return share


def _no_share(none_after, what):
    """1, for no gain, of what had nothing to gain before, and has nothing to lose after."""
    if none_after:
        return 1.0
    raise ValueError(
        f"The performances are {what} before and are not after: that is no share of anything, nor "
        "a gain. Compare with performances that differ, such as normalize(X) of a synchronizer."
    )


def _mean_correlation(movements):
    z = movements.values
    # From the first frame, so that nothing at all moves where nothing moved.
    z = z - z[:, :1]
    centred = (z - z.mean(axis=1, keepdims=True)).reshape(len(z), -1)
    norms = np.linalg.norm(centred, axis=1)
    moves = norms > movements.rounding * np.sqrt(centred.shape[1])
    centred = centred[moves] / norms[moves, np.newaxis]
    correlation = centred @ centred.T
    pairs = len(z) * (len(z) - 1)
    return correlation[~np.eye(len(centred), dtype=bool)].sum() / pairs
