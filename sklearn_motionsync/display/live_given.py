"""What `PhaseDisplay` is given, checked, and what it gets out of an estimator."""

from copy import copy

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from ..body.direction_cosines import DirectionCosines
from ..live.stream import LivePhase
from ..live.times import as_stamps
from ..pipelines import find_step
from ..sequences import as_collection
from ..tables import labels_of
from .given import as_drawn

__all__ = [
    "as_expected",
    "as_moving",
    "as_phases",
    "bodies_of_features",
    "each_of",
    "from_zero",
    "one_each",
    "path_of",
    "spread_of",
    "taken",
    "times_of",
]

_PARTS = "phase", "rate", "confidence"
# By how much rounding may take a phase or a confidence beyond its bounds.
_ROUNDING = 1e-9


def as_phases(phases, n_frames):
    """A list of LivePhase of checked arrays (n_frames_i,)."""
    listed = [phases] if isinstance(phases, LivePhase) else phases
    sound = isinstance(listed, (list, tuple)) and len(listed) > 0
    if not sound or not all(isinstance(of, LivePhase) for of in listed):
        raise ValueError(
            "phases must be a LivePhase of arrays, such as live.history, or a list of them, such "
            f"as live.follow(X) gives; got {phases!r:.80}."
        )
    if len(listed) == 1 and np.ndim(listed[0].phase) == 2:
        listed = [
            LivePhase(*streams) for streams in zip(*map(np.transpose, listed[0]), strict=True)
        ]
    checked = []
    for i, of in enumerate(listed):
        shape, arrays, bounds = ("n_frames",), [], (n_frames - 1, np.inf, 1)
        for what, values, most in zip(_PARTS, of, bounds, strict=True):
            array = as_drawn(values, f"Performance {i}: the {what}", shape)
            if not ((array >= -_ROUNDING) & (array <= most + _ROUNDING)).all():
                raise ValueError(f"Performance {i}: the {what} must be from 0 to {most}.")
            arrays.append(np.clip(array.astype(np.float64), 0, most))
            shape = array.shape
        checked.append(LivePhase(*arrays))
    return checked


def one_each(values, count, what, each="performances"):
    """A list with something for each of so many performances."""
    if not hasattr(values, "__len__") or isinstance(values, str) or len(values) != count:
        got = len(values) if hasattr(values, "__len__") else repr(values)
        raise ValueError(
            f"There are {count} {each}, but {what} of {got}: give a list with one for each."
        )
    return list(values)


def each_of(values, lengths, what, shape, gaps=False):
    """Something of each performance, of this shape after its frames; None where it is not known."""
    if values is None:
        return [None] * len(lengths)
    return [
        None
        if gaps and x is None
        else as_drawn(x, f"Performance {i}: {what}", (n, *shape)).astype(np.float64)
        for i, (x, n) in enumerate(zip(one_each(values, len(lengths), what), lengths, strict=True))
    ]


def as_expected(mean, spread, n_frames, n_shown):
    """Mean and spread (P, n_shown) of what is shown, checked, or None."""
    for what, given, needs, there in (
        ("mean", mean, "seen", n_shown > 0),
        ("spread", spread, "mean", mean is not None),
    ):
        if given is not None and not there:
            raise ValueError(f"{what} is of what is drawn; give {needs}, too.")
    mean, spread = (
        x if x is None else as_drawn(x, what, (n_frames, n_shown))
        for x, what in ((mean, "The mean"), (spread, "The spread"))
    )
    if spread is not None and (spread < 0).any():
        raise ValueError("The spread must be a standard deviation, of at least 0.")
    return mean, spread


def as_moving(bodies, mean_body, lengths, n_frames, skeleton):
    """The body of each performance, and the mean one, checked; None without bodies."""
    if bodies is None:
        return [None] * len(lengths), None
    if mean_body is None or skeleton is None:
        raise ValueError("Bodies are drawn before the mean one: give mean_body and skeleton, too.")
    shape = len(skeleton.joints), skeleton.n_dims
    bodies = each_of(bodies, lengths, "bodies", shape)
    return bodies, as_drawn(mean_body, "The mean body", (n_frames, *shape))


def from_zero(times, n, i):
    """Time since the first frame, which increases."""
    if times is None:
        return np.arange(float(n))
    if not (np.diff(times) > 0).all():
        raise ValueError(f"Performance {i}: times must increase from frame to frame, got {times}.")
    return times - times[0]


def taken(live, X, what="X"):
    """How to choose of X what ``follow`` takes, its arrays, their labels; if it is a single one."""
    check_is_fitted(live)
    collection = as_collection(X)
    if collection is not None and len(collection) == 0:
        raise ValueError("Found 0 performances (n_samples=0); there is nothing to draw.")
    if collection is None and np.ndim(X) != 2:
        raise ValueError(
            f"{what} must be performances, or one of them, 2-D; got an array of shape "
            f"{np.shape(X)}."
        )
    on_rows = live.mean_.shape[1] != live.n_features_in_
    if collection is None and on_rows:
        rows = np.asarray(X)
        arrays = list(rows[:, :, np.newaxis])
        names = X.index if isinstance(X, pd.DataFrame) else range(len(rows))
        return (lambda chosen: rows[chosen]), arrays, list(map(str, names)), False
    members = [X] if collection is None else collection
    names = [", ".join(map(str, n)) if isinstance(n, tuple) else n for n in labels_of(members)[0]]
    return (lambda chosen: [members[i] for i in chosen]), members, names, collection is None


def times_of(live, times, chosen, arrays, labels, each="performances"):
    """Of those that are chosen the times, which the estimator takes."""
    listed = one_each(times, len(arrays), "times", each)
    for i in chosen:
        as_stamps(listed[i], len(arrays[i]), live.frame_rate, f"Performance {labels[i]}")
    return [listed[i] for i in chosen]


def path_of(live, X, n):
    """The phases of the n frames of one performance that is over."""
    (tau,) = live.synchronizer_.match(X).times
    clock = np.arange(live.n_frames_)
    # Where tau stands still, any phase of that while is as right.
    return np.interp(np.linspace(0, clock[-1], n), tau + 1e-9 * clock, clock)


def spread_of(live, training):
    """The standard deviation of the training performances about their mean, (P, n_features)."""
    match = live.synchronizer_.match(training)
    warped = match.warp(taken(live, training)[1])
    return np.asarray(warped).reshape(len(warped), *live.mean_.shape).std(axis=0)


def bodies_of_features(body, seen, mean):
    """Joint positions of what is seen and of the mean, and whose they are."""
    if body is None:
        return None, None, None
    skeleton = find_step(body, DirectionCosines)[1].skeleton.body()
    *bodies, mean_body = (_positions(body, x, skeleton) for x in (*seen, mean))
    return bodies, mean_body, skeleton


def _positions(body, x, skeleton):
    """Joint positions (n_frames, n_joints, n_dims), NaN where nothing is known of them."""
    whole = ~np.isnan(x).any(axis=1)
    if isinstance(body, DirectionCosines):
        # Limbs are hidden one by one.
        body, whole = copy(body).set_params(hidden="nan"), np.ones(len(x), dtype=bool)
    found = np.full((len(x), len(skeleton.joints) * skeleton.n_dims), np.nan)
    if whole.any():
        found[whole] = np.asarray(body.inverse_transform(x[whole]))
    return found.reshape(len(x), -1, skeleton.n_dims)
