"""Gaps of performances: filled before they are matched (`matching.gaps`)."""

import numpy as np

from ..inputs.numbers import as_numbers
from ..inputs.wording import counted
from ..matching.gaps import Filler, is_gappy

__all__ = [
    "check_fill",
    "fill_performances",
    "fill_warped",
    "hold_gaps",
    "known_whole",
    "learn_filler",
    "with_confidence",
]

# What is less sure is as not seen.
_SURE = 0.5


def hold_gaps(performances):
    """Whether anything of performances is NaN, or not sure; they hold no infinity."""
    sums = [x.sum() for x in performances]
    return performances.confidence is not None or bool(np.isnan(sums).any())


def with_confidence(performances, confidence):
    """Performances of which what is less sure than not is hidden.

    Parameters
    ----------
    performances : Performances
    confidence : list of array-like (n_frames_i,) or (n_frames_i, n_features), or None
        From 0 to 1, one for each of all that were given.

    Raises
    ------
    ValueError
        If there is not one for each, of these shapes and in this range.
    """
    if confidence is None:
        return performances
    n = len(performances)
    # Some of all that were given have the confidence of their number.
    is_whole = list(performances.numbers) == list(range(n))
    count = len(confidence) if hasattr(confidence, "__len__") else -1
    if count <= max(performances.numbers) or (is_whole and count != n):
        raise ValueError(
            f"confidence must be a list of {n} arrays, (n_frames,) or (n_frames, n_features), one "
            f"a performance; got {confidence!r:.200}."
        )
    arrays, confidences = [], []
    for i, x in zip(performances.numbers, performances, strict=True):
        sure = as_numbers(confidence[i], f"Performance {i}: confidence", dtype=np.float64)
        if sure.shape not in (x.shape, x.shape[:1]):
            raise ValueError(
                f"Performance {i}: confidence has shape {sure.shape}, expected one number a frame, "
                f"{x.shape[:1]}, or one for each feature, {x.shape}."
            )
        sure = np.broadcast_to(sure.reshape(len(x), -1), x.shape)
        # Not a number fails the comparison, too.
        if not (sure.min() >= 0 and sure.max() <= 1):
            raise ValueError(
                f"Performance {i}: confidence must be from 0, not seen, to 1, got "
                f"{sure.min():g} to {sure.max():g}. Divide it by its largest value."
            )
        arrays.append(np.where(sure < _SURE, x.dtype.type(np.nan), x))
        confidences.append(sure)
    out = performances.replace(arrays)
    out.confidence = confidences
    return out


def learn_filler(performances, names=None):
    """The filler of a training set.

    Parameters
    ----------
    performances : sequence of ndarray (n_frames_i, n_features)
    names : sequence, default=None
        Of the features.

    Raises
    ------
    ValueError
        If a feature is NaN in all of them.
    """
    never = np.logical_and.reduce([np.isnan(x).all(axis=0) for x in performances])
    if never.any():
        k = int(never.argmax())
        name = k if names is None else f"{k} ({names[k]!r})"
        raise ValueError(
            f"Feature {name} is NaN in every frame of every performance; never seen: "
            f"{never.sum()} of {counted(len(never), 'feature')}. Leave such out, or add a "
            "performance that shows them."
        )
    return Filler.learn(performances)


def fill_performances(filler, performances):
    """Performances without gaps, and with the weights of their frames.

    Parameters
    ----------
    filler : Filler
    performances : Performances

    Raises
    ------
    ValueError
        If all of a performance is NaN, or the end of one in an array of equal lengths.
    """
    filled = []
    if performances.kind == "array":
        _refuse_padding(performances)
    for i, x in enumerate(performances):
        sure = 1.0 if performances.confidence is None else performances.confidence[i]
        if not is_gappy(x) and np.all(sure == 1):
            filled.append((x, np.ones(len(x))))
            continue
        if np.isnan(x).all():
            raise ValueError(
                f"{performances.called(i)} is NaN in every frame and feature: nothing of it was "
                "seen, so it has no timing. Leave it out."
            )
        filled.append(filler(x, sure))
    arrays, weights = zip(*filled, strict=True)
    out = performances.replace(arrays)
    out.weights = list(weights)
    return out


def _refuse_padding(performances):
    """Refuse frames of NaN that only bring performances to the length of the longest."""
    for i, x in enumerate(performances):
        if not np.isnan(x).all() and np.isnan(x[-1]).all():
            n = len(x) - int(np.argmin(np.isnan(x[::-1]).all(axis=1)))
            raise ValueError(
                f"{performances.called(i)} is NaN from frame {n} to its end, frame {len(x) - 1}: "
                "in an array of equal lengths such frames only fill up. Give a list without them, "
                f"such as [X[0], X[1][:{n}], ...]; if the end was not seen, give list(X)."
            )


def known_whole(performances, but):
    """Indices of filled performances that had no gaps, but for one."""
    weights = performances.weights or [np.ones(1)] * len(performances)
    return np.array([i for i, w in enumerate(weights) if i != but and w.min() == 1], np.intp)


def check_fill(fill):
    """Refuse a ``fill`` that there is not."""
    if fill is not None and not (isinstance(fill, str) and fill == "model"):
        raise ValueError(
            f"fill={fill!r} is unknown: use None to keep what was hidden as NaN, or 'model' to "
            "fill it from the mean of the warped training set."
        )


def fill_warped(warped, examples):
    """Fill warped performances from the mean of others at every moment, in place.

    A performance deviates from the mean. Its deviations are filled as gaps are before a match.

    Parameters
    ----------
    warped : ndarray, shape (n_sequences, P, n_features)
    examples : ndarray, shape (n_examples, P, n_features)
        Warped, without gaps.
    """
    mean = examples.mean(axis=0)
    filler = Filler.learn(list(examples - mean))
    for x in warped:
        if is_gappy(x):
            np.copyto(x, filler(x - mean)[0] + mean, where=np.isnan(x))
