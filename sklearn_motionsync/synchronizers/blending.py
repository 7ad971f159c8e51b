"""blend_trials: weighted means of trials, in their poses and their timing."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Integral
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator

from ..body.base import PositionsTransformer
from ..body.blends import blend_bodies, blend_numbers
from ..body.joint_positions import JointPositions
from ..body.skeleton import Skeleton
from ..inputs.collections import NOT_ONE, as_collection, check_members
from ..inputs.facts import compare_facts
from ..inputs.numbers import as_numbers, check_finite
from ..inputs.recorded import timeless
from ..inputs.tables import FRAME, labels_of
from ..inputs.types import NumbersLike, TrialsLike
from ..inputs.wording import counted
from ..matching.counting import ROUNDING, whole
from ..matching.sizes import EQUAL
from ..utils.pipelines import flat_steps, route_to_synchronizer, union_transformers
from .match import Match

# Smallest pace of an extrapolated blend, by that of the slowest trial.
_SLOWEST = 0.5
# Largest number of frames of a blend, by that of the longest trial.
_LONGEST = 100
# Attributes of tables that hold the label of a trial.
_LABELS = ("trial", "levels")


def blend_trials(
    estimator: BaseEstimator | Match,
    X: TrialsLike,
    weights: NumbersLike | Mapping[Any, float],
    *,
    timing: NumbersLike | Mapping[Any, float] | None = None,
    skeleton: Skeleton | None = None,
    **params: Any,
) -> np.ndarray | pd.DataFrame:
    """Blend trials: a weighted mean of their poses and of their timing.

    Frames that correspond on the clock of the pattern are averaged, and the blend has the averaged
    pace: from frame p of the pattern to the next one it takes
    ``sum_i w_i (tau_i(p+1) - tau_i(p))`` frames. At weights of 0.5 the durations are averaged.

    Joint positions are blended as bodies. Directions of limbs and bones, along axes that turn with
    each body, have the mean on the sphere with the smallest sum of squared angles, so that no limb
    becomes shorter. Lengths of limbs are averaged. Headings have a circular mean, and steps of the
    path are averaged along each body's heading. So are heights of the pelvis. Feet that stand in
    the trials stand in the blend: the body follows them, and hips and knees bend by the rest.

    Parameters
    ----------
    estimator : Pipeline with a synchronizer, synchronizer, or Match
        Fitted; or the match of X, ``Match.from_estimator(pipe, X)``, for several blends or for
        sequences recorded with the trials.
    X : list of arrays (n_frames_i, n_features), 3-D array, or (trial, frame) frame
        Trials as the estimator takes them, without gaps; with a `Match` any sequences
        recorded with them. All have one frame rate.
    weights : array-like of shape (n_sequences,) or (n_rows, n_sequences), or dict
        Weight of each trial; their sum is 1. Weights below 0 or above 1 extrapolate:
        1.5 and -0.5 exaggerate the differences of the first from the second. Several rows change
        evenly from the first to the last frame of the pattern: ``[[1, 0], [0, 1]]`` is a transition
        from the first trial to the second, which continues at the place and in the heading of
        the first. A dict has the weights of some trials by index or label.
    timing : array-like or dict, as weights, default=None
        Weights of the timing; by default ``weights``.
    skeleton : Skeleton, default=None
        That of joint positions. By default that of the step of the pipeline which takes joint
        positions; without any, features are averaged as numbers.
    **params : dict
        Metadata of the matching, such as ``keyframes``.

    Returns
    -------
    ndarray, shape (n_frames, n_features), or DataFrame
        Of the kind and dtype of the trials of X. Frames of a table are numbered from 0.

    Raises
    ------
    ValueError
        If the weights are not one a trial or not of sum 1; if X breaks the contract for
        trials, or that of the skeleton; if there is no such trial; if extrapolation
        leaves the blend no time, or makes it a hundred times as long as the longest of X.

    See Also
    --------
    sklearn_motionsync.display.SkeletonDisplay : Draws the blend, and lets it move.
    ActionModel.sample : Random mixtures of the training trials.

    Notes
    -----
    A weight of 1 gives that trial back. Negative weights extrapolate along great circles from
    the mean of the directions with positive weights. Opposite directions have no mean: the one of
    the largest weight, the first of equal ones, is used. Extrapolated lengths and paces are at
    least half the smallest one of the trials.

    A foot stands while its ankle, heel or toe is slow, against the fastest joint of the body, and
    as low as the other foot. It then moves along the floor, and is as high, as on average in the
    trials with positive weights. So negative weights exaggerate steps, but not how feet slip.
    Feet that slip in a recording, or go with a treadmill, do so in its blends. Bodies in a picture
    (``n_dims=2``), and legs without hip, knee and ankle, are left as they are.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines
    >>> from sklearn_motionsync.synchronizers import blend_trials
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(6, random_state=0)
    >>> pipe = make_pipeline(DirectionCosines(bunch.skeleton), ASpace(), DenseSynchronizer())
    >>> between = blend_trials(pipe.fit(bunch.data), bunch.data, {0: 0.5, 3: 0.5})
    >>> len(bunch.data[0]), len(between), len(bunch.data[3])
    (101, 105, 108)

    The movement of the first at the pace of the fourth:

    >>> moved = blend_trials(pipe, bunch.data, {0: 1}, timing={3: 1})
    >>> len(moved)
    108
    """
    skeleton = _skeleton_of(estimator, skeleton)
    sequences = as_collection(X)
    if sequences is None:
        raise ValueError(NOT_ONE)
    arrays = check_members(sequences)
    labels, _ = labels_of(sequences)
    rates = compare_facts(arrays.facts, arrays.called).get("frame_rate", ())
    if skeleton is not None:
        # Refuses sequences that are not positions of the skeleton.
        JointPositions(skeleton).fit(sequences)
    match = estimator
    if not isinstance(estimator, Match):
        match = route_to_synchronizer(estimator, X, params, "blend_trials").match()
    elif beside := {name for name, value in params.items() if value is not None} - {"frame_rate"}:
        raise TypeError(f"A Match takes no {sorted(beside)}.")
    warps = match.frames(list(map(len, arrays)))
    n_frames = warps.shape[1]
    weights = _weights(weights, labels, n_frames, "weights")
    timing = weights if timing is None else _weights(timing, labels, n_frames, "timing")
    frames, at = _blend_pace(warps, timing)
    weights = np.stack([np.interp(at, np.arange(n_frames), w) for w in weights.T])
    # Those of other weights than 0.
    used = np.flatnonzero(weights.any(axis=1))
    chosen = [arrays[i].astype(np.float64) for i in used]
    if skeleton is None:
        out = blend_numbers(chosen, frames[used], weights[used])
    else:
        out = blend_bodies(chosen, frames[used], weights[used], skeleton)
    return _like(sequences[0], out.astype(arrays[0].dtype, copy=False), rates)


def _skeleton_of(estimator, skeleton):
    """The skeleton of joint positions, or None for numbers."""
    if skeleton is not None:
        if isinstance(skeleton, Skeleton):
            return skeleton
        raise ValueError(
            "skeleton must be the Skeleton of joint positions, such as Skeleton.kinect(); got "
            f"{type(skeleton).__name__}."
        )
    if isinstance(estimator, Match):
        steps = [] if estimator.reached is None else estimator.reached.steps
    else:
        steps = flat_steps(estimator)
    steps = [each for step in steps for each in union_transformers(step)]
    skeletons = [step.skeleton for step in steps if isinstance(step, PositionsTransformer)]
    return skeletons[0] if skeletons else None


def _weights(given, labels, n_frames, what) -> np.ndarray:
    """Weights (n_frames, n_sequences) of sum 1 at each frame of the clock."""
    if isinstance(given, (pd.Series, Mapping)):
        row = np.zeros(len(labels))
        for label, weight in given.items():
            place, weight = _index(label, labels, what), as_numbers(weight, what)
            if weight.ndim:
                raise ValueError(
                    f"{what}: {label!r} has numbers of shape {weight.shape}; a dict has one number "
                    "for each. Weights that change are rows, [[1, 0], [0, 1]]."
                )
            row[place] += weight
        given = row
    rows = np.atleast_2d(as_numbers(given, what, dtype=np.float64))
    if rows.ndim != 2 or rows.shape[1] != len(labels):
        raise ValueError(
            f"{what} must be one for each of the {counted(len(labels), 'trial')}, or rows of "
            f"them; got shape {np.shape(given)}. For some, give a dict: {{0: 0.5, 1: 0.5}}."
        )
    check_finite(rows, f"{what}, row")
    total = rows.sum(axis=1)
    wrong = np.abs(total - 1) > EQUAL[np.dtype(np.float32)]
    if wrong.any():
        i = int(wrong.argmax())
        where = f", row {i}," if len(rows) > 1 else ""
        raise ValueError(
            f"{what}{where} must have the sum 1, got {total[i]:g}. To extrapolate, make others "
            "negative, as in [1.5, -0.5]."
        )
    # A single weight is then exactly 1.
    rows = rows / total[:, np.newaxis]
    if len(rows) == 1:
        return np.repeat(rows, n_frames, axis=0)
    at = np.linspace(0, len(rows) - 1, n_frames)
    return np.column_stack([np.interp(at, np.arange(len(rows)), column) for column in rows.T])


def _index(label, labels, what):
    """The index of a trial that is given by its label or index."""
    if label in labels:
        return labels.index(label)
    numbered = any(isinstance(name, Integral) for name in labels)
    if isinstance(label, Integral) and not numbered and 0 <= label < len(labels):
        return int(label)
    raise ValueError(f"{what}: there is no trial {label!r}; labels are {labels[:8]}.")


def _blend_pace(warps, timing):
    """The frames of each trial at the frames of a blend, and those of the clock.

    Parameters
    ----------
    warps : ndarray, shape (n_sequences, P)
        The frame of each trial at each frame of the clock.
    timing : ndarray, shape (P, n_sequences)

    Returns
    -------
    frames : ndarray, shape (n_sequences, n_frames)
    at : ndarray, shape (n_frames,)
    """
    between = (timing[1:] + timing[:-1]).T / 2
    used = between.any(axis=1)
    steps_of_trials = np.diff(warps[used], axis=1)
    steps = np.maximum(
        (between[used] * steps_of_trials).sum(axis=0), _SLOWEST * steps_of_trials.min(axis=0)
    )
    elapsed = np.concatenate([[0], np.cumsum(steps)])
    last = whole(elapsed[-1])
    if not 1 <= last <= _LONGEST * warps.max():
        raise ValueError(
            f"Weights beyond 0 and 1 give a blend of {last + 1} frames; the longest trial "
            f"has {warps.max() + 1:.0f}: give timing= weights between 0 and 1."
        )
    clock = np.arange(warps.shape[1])
    at = np.interp(np.linspace(0, elapsed[-1], last + 1), elapsed, clock)
    frames = np.stack([np.interp(at, clock, x) for x in warps])
    exact = np.rint(frames)
    return np.where(np.abs(frames - exact) < ROUNDING * warps.max(), exact, frames), at


def _like(x, array, rates):
    """An array as a trial of the kind of ``x``, one of those that have these frame rates."""
    if not isinstance(x, pd.DataFrame):
        return array
    df = pd.DataFrame(array, columns=x.columns, index=pd.RangeIndex(len(array), name=FRAME))
    df.attrs = {key: value for key, value in timeless(x).items() if key not in _LABELS}
    if "frame_rate" in df.attrs or rates:
        df.attrs["frame_rate"] = rates[0] if len(rates) == 1 else None
    return df
