"""Blends: a performance between those of several people, in its postures and in its timing."""

from collections.abc import Mapping
from numbers import Integral

import numpy as np
import pandas as pd

from ..body.base import PositionsTransformer
from ..body.blends import blend_bodies, blend_numbers, blend_postures
from ..body.direction_cosines import DirectionCosines
from ..body.joint_positions import JointPositions
from ..body.limbs import exponent_of
from ..body.skeleton import Skeleton
from ..inputs.collections import NOT_ONE, as_collection, check_members
from ..inputs.numbers import as_numbers, check_names
from ..inputs.tables import FRAME, labels_of
from ..utils.pipelines import flat_steps, route_to_synchronizer, union_transformers
from .match import Match

__all__ = ["blend_performances"]

# Weights of sum 1 may miss it by rounding of single precision.
_ROUNDING = 1e-5
# A frame that is so near to a whole one, as a share of all, is that one.
_WHOLE = 1e-11
# Beyond the performances a blend goes at least so many times as fast as the slowest of them.
_SLOWEST = 0.5
# So many times as many frames as the longest performance has are a mistake in the weights.
_LONGEST = 100
# Steps of time that differ by less, as a share, are of one frame rate.
_ALIKE = 0.01
# What tables carry along that only one performance is called.
_OWN = ("performance", "levels")


def blend_performances(
    estimator, X, weights, *, timing=None, skeleton=None, lengths_of=None, **params
):
    """A performance between those of several people: a weighted mean of postures and of timing.

    What meets on the clock of the pattern is blended, and the blend goes on at the blended pace:
    from each frame p of the pattern to the next one it takes ``sum_i w_i (tau_i(p+1) - tau_i(p))``
    frames. Of two people at 0.5 it takes the mean of their times.

    Joint positions are blended as bodies. The directions of limbs and bones are averaged on the
    sphere, where the sum of squared angles is least, so that no limb gets shorter; along axes that
    turn with each body. Lengths of limbs are averaged, or one's own. The heading is averaged on the
    circle, and the path goes by steps that are averaged along each body's heading.
    The pelvis moves up and down by the averaged height; the whole body is moved as far up or down
    as puts the lower ankle, half of the time, where it is on average.

    Parameters
    ----------
    estimator : Pipeline with a synchronizer, synchronizer, or Match
        Fitted; or the match of X, ``Match.from_estimator(pipe, X)``, for several blends or for
        what was recorded along with the performances.
    X : list of arrays (n_frames_i, n_features), 3-D array, or (performance, frame) frame
        Performances as the estimator takes them; with a `Match` any sequences that go with them.
        All of one frame rate.
    weights : array-like of shape (n_sequences,) or (n_rows, n_sequences), or dict
        How much of each performance. Of sum 1; below 0 or above 1 they lead on beyond: 1.5 and
        -0.5 exaggerate what tells the first from the second. Rows are weights that
        change evenly from the first to the last frame of the pattern: ``[[1, 0], [0, 1]]``
        goes over from the first performance to the second, which then goes on where the first one
        was, and the way that one faced. A dict has the weights of some
        performances by their numbers or labels.
    timing : as weights, default=None
        Weights of the timing; by default the same.
    skeleton : Skeleton or DirectionCosines, default=None
        What X is: joint positions of a skeleton, or postures of `DirectionCosines`. By default that
        of the step of the pipeline which takes joint positions; without any, numbers.
    lengths_of : label or int, default=None
        The performer, by number or label in X, who lends the blend the lengths of the limbs. By
        default they are blended.
    **params : dict
        What matching takes besides, such as ``keyframes``.

    Returns
    -------
    ndarray, shape (n_frames, n_features), or DataFrame
        As performances of X are. Float32 stays. Frames of a table are numbered from 0, or go on
        from 0 by the step of time that those of X have.

    Raises
    ------
    ValueError
        If the weights are not one a performance or not of sum 1; if X breaks the contract for
        performances, or that of the skeleton; if there is no such performer; if weights beyond 0
        and 1 leave the blend no time, or make it a hundred times as long as the longest of X.

    See Also
    --------
    SkeletonDisplay : Draws the blend, and lets it move.
    ActionModel.sample : Random mixtures of the training performances.

    Notes
    -----
    The weights of one performance give that performance back. Weights below 0 lead away, on great
    circles, from the mean with those above 0. Exact opposites have no mean: the direction of the
    largest weight is taken, the first one's of equal weights. Beyond the performances, lengths and
    paces end at half the smallest one of them.

    Links that are no limbs nor bones, such as from the pelvis to the middle of the hips or to a
    marker, are numbers along the axes of the body. Joints between two landmarks, such as of the
    spine, are put where bones lead from the pelvis. Bones that close a ring with limbs, such as the
    last one to the head, collar bones, and those from the pelvis to the hips, give way.
    In a picture (``n_dims=2``) nothing is turned.

    Hips within 17 degrees of the vertical show no heading: it goes on evenly from before to after,
    and in a cartwheel the body is not turned about. Who lies on the side from the first to the last
    frame has none, and is blended along the axes of the recording.

    Feet are not held to the floor: people who stand or step differently slide in between.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines
    >>> from sklearn_motionsync import blend_performances
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(6, random_state=0)
    >>> pipe = make_pipeline(DirectionCosines(bunch.skeleton), ASpace(), DenseSynchronizer())
    >>> between = blend_performances(pipe.fit(bunch.data), bunch.data, {0: 0.5, 3: 0.5})
    >>> len(bunch.data[0]), len(between), len(bunch.data[3])
    (101, 104, 108)

    The movement of the first at the pace of the fourth:

    >>> moved = blend_performances(pipe, bunch.data, {0: 1}, timing={3: 1})
    >>> len(moved)
    108
    """
    skeleton = _skeleton_of(estimator, skeleton)
    # An estimator of numbers takes rows if it was fitted on them.
    takes_rows = skeleton is None and not isinstance(estimator, Match)
    sequences, arrays, is_rows = _read(X, takes_rows)
    labels, levels = labels_of(sequences)
    _check(sequences, arrays, skeleton)
    match = estimator
    if not isinstance(estimator, Match):
        match = route_to_synchronizer(estimator, X, params, "blend_performances").match()
    elif params:
        raise TypeError(f"A Match is matched already, and takes no {sorted(params)}.")
    met = match.frames(list(map(len, arrays)))
    weights = _weights(weights, labels, met.shape[1], "weights")
    timing = weights if timing is None else _weights(timing, labels, met.shape[1], "timing")
    owner = None if lengths_of is None else _owner(lengths_of, labels, skeleton)
    frames, at = _paced(met, timing)
    weights = np.stack([np.interp(at, np.arange(met.shape[1]), w) for w in weights.T])
    out = _blended(arrays, frames, weights, skeleton, owner).astype(arrays[0].dtype, copy=False)
    if is_rows:
        return out[:, 0]
    return _like(sequences, out, levels[-1])


def _read(X, takes_rows):
    """Performances as they were given, as arrays, and whether they are univariate rows."""
    sequences = as_collection(X)
    is_rows = sequences is None
    if is_rows:
        X = np.asarray(X)
        if X.ndim != 2 or not takes_rows:
            raise ValueError(NOT_ONE)
        sequences = [x[:, np.newaxis] for x in X]
    return sequences, check_members(sequences), is_rows


def _skeleton_of(estimator, skeleton):
    """What X is: the skeleton of positions, the cosines of postures, or None of numbers."""
    if skeleton is not None:
        if isinstance(skeleton, (Skeleton, DirectionCosines)):
            return skeleton
        raise ValueError(
            "skeleton must be the Skeleton of joint positions, or the DirectionCosines that made "
            f"the postures; got {type(skeleton).__name__}."
        )
    if isinstance(estimator, Match):
        return None
    for step in flat_steps(estimator):
        for part in union_transformers(step):
            if isinstance(part, PositionsTransformer):
                return part.skeleton
    return None


def _check(sequences, arrays, skeleton):
    """Refuse what are no positions or postures of the skeleton."""
    if isinstance(skeleton, Skeleton):
        JointPositions(skeleton).fit(sequences)
    elif skeleton is not None:
        names = skeleton.get_feature_names_out()
        if arrays[0].shape[1] != len(names):
            raise ValueError(
                f"Performance 0 has {arrays[0].shape[1]} features a frame, but postures of these "
                f"DirectionCosines have {len(names)}. For joint positions give the Skeleton."
            )
        for i, x in enumerate(sequences):
            check_names(x, names, f"Performance {i}")


def _weights(given, labels, n_frames, what):
    """Weights (n_frames, n_sequences) of sum 1 at each frame of the clock."""
    if isinstance(given, pd.Series):
        given = given.to_dict()
    if isinstance(given, Mapping):
        given = _row_of(given, labels, what)
    rows = np.atleast_2d(as_numbers(given, what, dtype=np.float64))
    if rows.ndim != 2 or rows.shape[1] != len(labels):
        raise ValueError(
            f"{what} must be one for each of the {len(labels)} performances, or rows of them; got "
            f"shape {np.shape(given)}. Of some, give a dict: {{0: 0.5, 1: 0.5}}."
        )
    _check_rows(rows, labels, what)
    # Rounding is not to be seen in a single weight.
    rows = rows / rows.sum(axis=1, keepdims=True)
    if len(rows) == 1:
        return np.repeat(rows, n_frames, axis=0)
    at = np.linspace(0, len(rows) - 1, n_frames)
    return np.column_stack([np.interp(at, np.arange(len(rows)), column) for column in rows.T])


def _row_of(given, labels, what):
    """Weights of some performances as those of all: (n_sequences,)."""
    row = np.zeros(len(labels))
    for label, weight in given.items():
        place, weight = _index(label, labels, what), as_numbers(weight, what)
        if weight.ndim:
            raise ValueError(
                f"{what}: {label!r} has numbers of shape {weight.shape}; a dict has one number for "
                "each. Weights that change are rows, [[1, 0], [0, 1]]."
            )
        row[place] += weight
    return row


def _check_rows(rows, labels, what):
    """Refuse weights (n_rows, n_sequences) that are no numbers, or not of sum 1."""
    where = [f", row {i}," if len(rows) > 1 else "" for i in range(len(rows))]
    wrong = ~np.isfinite(rows)
    if wrong.any():
        i, k = np.argwhere(wrong)[0]
        raise ValueError(
            f"{what}{where[i]} must be finite numbers, got {rows[i, k]} for performance "
            f"{labels[k]!r}."
        )
    total = rows.sum(axis=1)
    wrong = np.abs(total - 1) > _ROUNDING
    if wrong.any():
        i = int(wrong.argmax())
        by = ": divide by it" if total[i] > 0 else ""
        raise ValueError(
            f"{what}{where[i]} must have the sum 1, got {total[i]:g}{by}. What is to go beyond one "
            "performance leads away from another, as in [1.5, -0.5]."
        )


def _index(label, labels, what):
    """The place of a performance that is called by its label, or by its number."""
    if label in labels:
        return labels.index(label)
    numbered = any(isinstance(name, Integral) for name in labels)
    if isinstance(label, Integral) and not numbered and 0 <= label < len(labels):
        return int(label)
    raise ValueError(f"{what}: there is no performance {label!r}; they are called {labels[:8]}.")


def _owner(label, labels, skeleton):
    if not isinstance(skeleton, Skeleton):
        raise ValueError("lengths_of is for joint positions, which have limbs: give skeleton.")
    return _index(label, labels, "lengths_of")


def _paced(met, timing):
    """The frames of each performance that meet at each frame of a blend, and those of the clock.

    Parameters
    ----------
    met : ndarray, shape (n_sequences, P)
        The frame of each performance that meets each frame of the clock.
    timing : ndarray, shape (P, n_sequences)

    Returns
    -------
    frames : ndarray, shape (n_sequences, n_frames)
    at : ndarray, shape (n_frames,)
    """
    between = (timing[1:] + timing[:-1]).T / 2
    used = between.any(axis=1)
    taken = np.diff(met[used], axis=1)
    steps = np.maximum((between[used] * taken).sum(axis=0), _SLOWEST * taken.min(axis=0))
    passed = np.concatenate([[0], np.cumsum(steps)])
    last = int(np.rint(passed[-1]))
    if last < 1:
        raise ValueError(
            "Weights beyond 0 and 1 leave the blend no time: give timing= weights between."
        )
    if last > _LONGEST * met.max():
        raise ValueError(
            f"Weights beyond 0 and 1 make the blend {last + 1} frames long, the longest "
            f"performance has {met.max() + 1:.0f}: give timing= weights between."
        )
    clock = np.arange(met.shape[1])
    at = np.interp(np.linspace(0, passed[-1], last + 1), passed, clock)
    frames = np.stack([np.interp(at, clock, x) for x in met])
    whole = np.rint(frames)
    return np.where(np.abs(frames - whole) < _WHOLE * met.max(), whole, frames), at


def _blended(arrays, frames, weights, skeleton, owner):
    """The blend of those that have a say, (n_frames, n_features)."""
    used = weights.any(axis=1)
    if owner is not None:
        used[owner] = True
        owner = int(used[:owner].sum())
    chosen = [x.astype(np.float64) for x, u in zip(arrays, used, strict=True) if u]
    frames, weights = frames[used], weights[used]
    if skeleton is None:
        return blend_numbers(chosen, frames, weights)
    if isinstance(skeleton, DirectionCosines):
        body = skeleton.skeleton
        return blend_postures(chosen, frames, weights, int(body.has_height), body.n_dims)
    # In a unit in which squares are numbers.
    k = exponent_of(max(np.abs(x).max() for x in chosen), np.float64)
    chosen = [np.ldexp(x, -k) for x in chosen] if k else chosen
    out = blend_bodies(chosen, frames, weights, skeleton, owner)
    return np.ldexp(out, k) if k else out


def _like(sequences, array, name):
    """An array as the kind of the performances."""
    x = sequences[0]
    if not isinstance(x, pd.DataFrame):
        return array
    df = pd.DataFrame(array, columns=x.columns, index=_clock(sequences, len(array), name))
    df.attrs = {key: value for key, value in x.attrs.items() if key not in _OWN}
    return df


def _clock(sequences, n_frames, name):
    """Frames from 0; or times, if all performances have such, of one frame rate."""
    indices = [x.index for x in sequences if isinstance(x, pd.DataFrame)]
    if not all(index.dtype.kind in "fmM" for index in indices):
        return pd.RangeIndex(n_frames, name=name)
    steps = [(index[-1] - index[0]) / (len(index) - 1) for index in indices]
    if max(steps) - min(steps) > _ALIKE * min(steps):
        return pd.RangeIndex(n_frames, name=FRAME)
    return pd.Index(np.arange(n_frames) * steps[0], name=name)
