"""The training set of a fit: what was read, its gaps filled, and the common clock (Eq. 7)."""

import warnings
from numbers import Integral
from typing import NamedTuple

import numpy as np
import pandas as pd
from sklearn.utils import check_random_state

from ..inputs.collections import (
    Trials,
    as_collection,
    as_source,
    count_of,
    select,
)
from ..inputs.numbers import as_numbers, check_finite, check_magnitude, check_names
from ..inputs.tables import as_pandas
from ..inputs.wording import counted
from ..matching.anchors import KeyframeColumns, add_ramps
from ..matching.counting import first_largest
from ..matching.gaps import Filler, add_weights, is_gappy
from ..matching.sizes import BATCH, EQUAL
from ..matching.units import Unit
from ..matching.warps import even_slices, normalise

# Most bytes of a training set on the clock; a fit holds several copies.
MOST_BYTES = 4 * 2**30
# Most trials in ``examples_``.
_MOST_EXAMPLES = 64


class TrainingSet(NamedTuple):
    """What a fit learns from.

    Attributes
    ----------
    trials : Trials
        Without gaps.
    filler : Filler or None
        What filled their gaps.
    population : int
        How many trials were given, of which these may be a sample.
    keyframes : ndarray, shape (n_trials, n_keyframes), or None
        Known key-frames as shares of the trials; NaN for those that are not known.
    """

    trials: Trials
    filler: Filler | None
    population: int
    keyframes: np.ndarray | None = None


def draw_sample(X, size, pattern, random_state):
    """A random sample of trials; the others are not read.

    Parameters
    ----------
    X : trials of any kind
    size : int or None
        Size of the sample; None for all.
    pattern : as of a synchronizer
        A pattern given by its index is always in the sample.
    random_state : as of a synchronizer

    Returns
    -------
    X : trials of any kind
        The sample.
    numbers : list of int or None
        Their indices, which increase; None if they are all.
    population : int or None
        How many trials were given; None if they are all.
    """
    if size is None:
        return X, None, None
    X = as_pandas(X)
    # Trials, or rows, by index; None for input that has to be refused.
    collection = as_source(X)
    if isinstance(X, pd.DataFrame):
        collection = X if X.index.nlevels == 1 else as_collection(X)
    elif collection is None:
        is_sequence = isinstance(X, (list, tuple)) or (isinstance(X, np.ndarray) and X.ndim > 0)
        collection = X if is_sequence else None
    population = 0 if collection is None else count_of(collection)
    is_index = isinstance(pattern, Integral) and not isinstance(pattern, bool)
    if size >= population or (is_index and pattern >= population):
        return X if collection is None else collection, None, None
    drawn = check_random_state(random_state).permutation(population)
    if is_index:
        drawn = np.concatenate([[pattern], drawn[drawn != pattern]])
    numbers = np.sort(drawn[:size])
    return select(collection, numbers), numbers.tolist(), population


# -- the clock, and the pattern on it ---------------------------------------------------------


class CommonClock(NamedTuple):
    """A training set on the common clock.

    Attributes
    ----------
    n_frames : int
    lengths : ndarray of int, shape (n_trials,)
        Frames of the trials as recorded.
    examples : ndarray, shape (min(n_trials, 64), P, n_features)
        Trials linearly normalised, evenly spaced.
    unit : Unit
        Their centre and scale.
    arrays : list of ndarray (n_frames_i, n_columns)
        Trials as recorded, with columns of weights and key-frames.
    positions : ndarray, shape (n_trials, P, n_columns)
        The same, linearly normalised (Eq. 7) and in the unit.
    anchors : KeyframeColumns or None
        The columns of key-frames.
    weighs : bool
        Whether there is a column of weights.
    """

    n_frames: int
    lengths: np.ndarray
    examples: np.ndarray
    unit: Unit
    arrays: list
    positions: np.ndarray
    anchors: KeyframeColumns | None
    weighs: bool

    @property
    def poses(self):
        """Positions without columns of weights and key-frames."""
        return self.positions[:, :, : len(self.unit.centre)]


def put_on_clock(training, n_frames, pattern, advice, keyframe_std=0.0):
    """Normalise a training set linearly (Eq. 7).

    Parameters
    ----------
    training : TrainingSet
    n_frames : int or None
        None: as many as the pattern has, or the median length of the trials.
    pattern : ndarray or None
        If it was given as an array.
    advice : str
        What to use if the training set does not fit into memory.
    keyframe_std : float, default=0.0
        Standard deviation of key-frames, in frames of the clock.

    Returns
    -------
    CommonClock
    """
    trials = training.trials
    lengths = np.array([len(x) for x in trials])
    if n_frames is None:
        n_frames = int(np.median(lengths)) if pattern is None else len(pattern)
    n_trials, n_features = len(trials), trials[0].shape[1]
    n_bytes = 8 * n_trials * n_frames * n_features
    if n_bytes > MOST_BYTES:
        raise ValueError(
            f"{counted(n_trials, 'trial')} at n_frames = {n_frames} take "
            f"{n_bytes / 2**30:.0f} GB several times over; {MOST_BYTES / 2**30:.0f} GB is the "
            f"limit. Use {advice}."
        )
    positions = normalise(trials, n_frames)
    unit = Unit.of(positions)
    evenly = np.unique(np.linspace(0, n_trials - 1, _MOST_EXAMPLES).round().astype(np.intp))
    examples = positions[evenly]
    arrays, anchors = list(trials), None
    if trials.weights is not None:
        arrays = add_weights(arrays, trials.weights)
    if training.keyframes is not None:
        arrays = add_ramps(arrays, training.keyframes)
        anchors = KeyframeColumns(training.keyframes.shape[1], keyframe_std / (n_frames - 1))
    if arrays[0].shape[1] > n_features:
        positions = normalise(arrays, n_frames)
    unit(positions, out=positions)
    weighs = trials.weights is not None
    return CommonClock(n_frames, lengths, examples, unit, arrays, positions, anchors, weighs)


class Pattern(NamedTuple):
    """The trial to whose clock all others are warped.

    Attributes
    ----------
    trial : int or None
        Its index in the training set; None if it was given as an array.
    array : ndarray, shape (n_frames, n_features)
        As recorded.
    distances : ndarray, shape (n_trials,)
        Global distances of the training set; NaN if there are none.
    """

    trial: int | None
    array: np.ndarray
    distances: np.ndarray


def pattern_of(training, pattern, median):
    """The pattern: the median, or as given.

    Parameters
    ----------
    training : TrainingSet
    pattern : "median", int or ndarray
        As of a synchronizer; an array is checked.
    median : Median or None
        Used if the pattern is "median".
    """
    trials = training.trials
    unknown = np.full(len(trials), np.nan)
    if isinstance(pattern, np.ndarray):
        return Pattern(None, pattern, unknown)
    if isinstance(pattern, str):
        return Pattern(median.trial, trials[median.trial], median.distances)
    index = list(trials.numbers).index(pattern)
    return Pattern(index, trials[index], unknown)


def check_pattern(pattern, trials, names):
    """The pattern as a synchronizer uses it: "median", an index, or a checked array.

    Parameters
    ----------
    pattern : as of a synchronizer
    trials : Trials
    names : sequence or None
        Of the features.
    """
    if isinstance(pattern, str):
        return pattern
    if isinstance(pattern, bool):
        raise ValueError(f"pattern must be 'median', an index or an array, got {pattern}.")
    if isinstance(pattern, Integral):
        if pattern not in trials.numbers:
            raise ValueError(
                f"pattern={pattern} is out of range: there are {len(trials)} "
                f"trials, the last has index {len(trials) - 1}."
            )
        return int(pattern)
    check_names(pattern, names, "The pattern")
    array = as_numbers(pattern, "The pattern", dtype=trials[0].dtype)
    array = array[:, np.newaxis] if array.ndim == 1 else array
    width = trials[0].shape[1]
    if array.ndim != 2 or len(array) < 2 or array.shape[1] != width:
        raise ValueError(
            f"A pattern given as an array must have shape (n_frames, {width}) with at least 2 "
            f"frames, like the trials; got {array.shape}."
        )
    check_finite(array, "The pattern, frame", names)
    check_magnitude(float(np.abs(array).max()), "The pattern", training=True)
    return array


# -- whether one of several features dominates what is compared, as with mixed units ----------

# Of 112 sets of features of people, one action each, the largest share of velocities is 0.93:
# positions, direction cosines, and their first components, two or more (HDM05, UTKinect).
_DOMINANT = 0.95


def warn_of_one_feature(shares, trials, names):
    """Warn if one of several features has nearly all of the energy, as with mixed units.

    Parameters
    ----------
    shares : ndarray, shape (n_features,)
        Of the features in the energy that is compared without a metric.
    trials : sequence of ndarray (n_frames_i, n_features)
    names : sequence or None
        Of the features.
    """
    if shares.max() <= _DOMINANT or (shares > EQUAL[shares.dtype] ** 2).sum() < 2:
        return
    if _are_principal_components(trials):
        return
    k = first_largest(shares)
    name = k if names is None else repr(names[k])
    warnings.warn(
        f"Feature {name} holds {100 * shares[k]:.4g} % of the energy that is compared: of "
        f"{len(shares)} features the others hardly count. If units differ, scale them: "
        "make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer()). If it alone shall tell "
        "the moments, leave the others out, and warp them by Match.warp.",
        UserWarning,
        stacklevel=2,
    )


def _are_principal_components(trials):
    """Whether features are uncorrelated, the largest first, as those of an aSpace are.

    They have one unit, and the first has most of the variance by construction.
    """
    # From a pose near the mean, so that no digits are lost.
    origin = trials[0].mean(axis=0, dtype=np.float64)
    arrays, total, products, count = list(trials), 0, 0, 0
    for rows in even_slices(len(arrays), BATCH):
        frames = np.concatenate(arrays[rows]).astype(np.float64) - origin
        total, products = total + frames.sum(axis=0), products + frames.T @ frames
        count += len(frames)
    covariance = products - np.outer(total, total) / count
    variance = np.diag(covariance)
    # Up to the rounding of single precision.
    bound = 4 * EQUAL[np.dtype(np.float32)] * np.sqrt(np.outer(variance, variance))
    off_diagonal = np.abs(covariance - np.diag(variance))
    return bool((off_diagonal <= bound).all() and (np.diff(variance) <= 0).all())


# -- gaps: filled before trials are matched (`matching.gaps`) ------------------------------

# What is less sure is as not seen.
_SURE = 0.5


def with_confidence(trials, confidence):
    """Trials of which what is less sure than not is hidden.

    Parameters
    ----------
    trials : Trials
    confidence : list of array-like (n_frames_i,) or (n_frames_i, n_features), or None
        From 0 to 1, one for each of all that were given.

    Raises
    ------
    ValueError
        If there is not one for each, of these shapes and in this range.
    """
    if confidence is None:
        return trials
    n = len(trials)
    # Some of all that were given have the confidence of their number.
    is_whole = list(trials.numbers) == list(range(n))
    count = len(confidence) if hasattr(confidence, "__len__") else -1
    if count <= max(trials.numbers) or (is_whole and count != n):
        raise ValueError(
            f"confidence must be a list of {n} arrays, (n_frames,) or (n_frames, n_features), one "
            f"a trial; got {confidence!r:.200}."
        )
    arrays, confidences = [], []
    for i, x in zip(trials.numbers, trials, strict=True):
        sure = as_numbers(confidence[i], f"Trial {i}: confidence", dtype=np.float64)
        if sure.shape not in (x.shape, x.shape[:1]):
            raise ValueError(
                f"Trial {i}: confidence has shape {sure.shape}, expected one number a frame, "
                f"{x.shape[:1]}, or one for each feature, {x.shape}."
            )
        sure = np.broadcast_to(sure.reshape(len(x), -1), x.shape)
        # Not a number fails the comparison, too.
        if not (sure.min() >= 0 and sure.max() <= 1):
            raise ValueError(
                f"Trial {i}: confidence must be from 0, not seen, to 1, got "
                f"{sure.min():g} to {sure.max():g}. Divide it by its largest value."
            )
        arrays.append(np.where(sure < _SURE, x.dtype.type(np.nan), x))
        confidences.append(sure)
    out = trials.replace(arrays)
    out.confidence = confidences
    return out


def learn_filler(trials, names=None):
    """The filler of a training set.

    Parameters
    ----------
    trials : sequence of ndarray (n_frames_i, n_features)
    names : sequence, default=None
        Of the features.

    Raises
    ------
    ValueError
        If a feature is NaN in all of them.
    """
    never = np.logical_and.reduce([np.isnan(x).all(axis=0) for x in trials])
    if never.any():
        k = int(never.argmax())
        name = k if names is None else f"{k} ({names[k]!r})"
        raise ValueError(
            f"Feature {name} is NaN in every frame of every trial; never seen: "
            f"{never.sum()} of {counted(len(never), 'feature')}. Leave such out, or add a "
            "trial that shows them."
        )
    return Filler.learn(trials)


def fill_trials(filler, trials):
    """Trials without gaps, and with the weights of their frames.

    Parameters
    ----------
    filler : Filler
    trials : Trials

    Raises
    ------
    ValueError
        If all of a trial is NaN, or the end of one in an array of equal lengths.
    """
    filled = []
    if trials.kind == "array":
        _refuse_padding(trials)
    for i, x in enumerate(trials):
        sure = 1.0 if trials.confidence is None else trials.confidence[i]
        if not is_gappy(x) and np.all(sure == 1):
            filled.append((x, np.ones(len(x))))
            continue
        if np.isnan(x).all():
            raise ValueError(
                f"{trials.called(i)} is NaN in every frame and feature: nothing of it was "
                "seen, so it has no timing. Leave it out."
            )
        filled.append(filler(x, sure))
    arrays, weights = zip(*filled, strict=True)
    out = trials.replace(arrays)
    out.weights = list(weights)
    return out


def _refuse_padding(trials):
    """Refuse frames of NaN that only bring trials to the length of the longest."""
    for i, x in enumerate(trials):
        if not np.isnan(x).all() and np.isnan(x[-1]).all():
            n = len(x) - int(np.argmin(np.isnan(x[::-1]).all(axis=1)))
            raise ValueError(
                f"{trials.called(i)} is NaN from frame {n} to its end, frame {len(x) - 1}: "
                "in an array of equal lengths such frames only fill up. Give a list without them, "
                f"such as [X[0], X[1][:{n}], ...]; if the end was not seen, give list(X)."
            )


def known_whole(trials, but):
    """Indices of filled trials that had no gaps, but for one."""
    weights = trials.weights or [np.ones(1)] * len(trials)
    return np.array([i for i, w in enumerate(weights) if i != but and w.min() == 1], np.intp)


def fill_warped(warped, examples):
    """Fill warped trials from the mean of others at every moment, in place.

    A trial deviates from the mean. Its deviations are filled as gaps are before a match.

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
