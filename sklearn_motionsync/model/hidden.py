"""Performances on one clock with gaps: what is counted, and what stands in for the rest."""

import numpy as np

__all__ = ["fill_with_mean", "group_counts", "is_gappy", "mean_of_other_groups"]


def is_gappy(performances):
    """Whether anything in an array is NaN."""
    # A sum is NaN if a term is; no mask is made of what is whole.
    return bool(np.isnan(performances.sum()))


def fill_with_mean(performances, mean):
    """Performances whose gaps follow a mean performance.

    A deviation from the mean goes on in a straight line from one end of a gap to the other, and
    stays where the gap has one end only. It is 0 in features that a performance never shows.

    Parameters
    ----------
    performances : ndarray, shape (n, P, n_features)
        With NaN in gaps.
    mean : ndarray, shape (P, n_features)

    Returns
    -------
    ndarray, shape (n, P, n_features)
        The same array if there is no gap.
    """
    if not is_gappy(performances):
        return performances
    hidden, filled = np.isnan(performances), performances.copy()
    frames = np.arange(len(mean))
    for i, k in np.argwhere(hidden.any(axis=1)):
        gap, curve = hidden[i, :, k], mean[:, k]
        if gap.all():
            filled[i, :, k] = curve
            continue
        deviations = performances[i, ~gap, k] - curve[~gap]
        filled[i, gap, k] = curve[gap] + np.interp(frames[gap], frames[~gap], deviations)
    return filled


def group_counts(performances, codes):
    """How many performances of each group show each value: (n_groups, P, n_features)."""
    counts = np.zeros((codes.max() + 1, *performances.shape[1:]))
    np.add.at(counts, codes, ~np.isnan(performances))
    return counts


def mean_of_other_groups(performances, codes):
    """For each performance with gaps, the mean of what those of all other groups show, or NaN."""
    counts, sums = (
        group_counts(performances, codes),
        np.zeros((codes.max() + 1, *performances.shape[1:])),
    )
    np.add.at(sums, codes, np.nan_to_num(performances))
    counts = counts.sum(axis=0) - counts
    means = np.full(sums.shape, np.nan)
    np.divide(sums.sum(axis=0) - sums, counts, out=means, where=counts > 0)
    return means[codes]
