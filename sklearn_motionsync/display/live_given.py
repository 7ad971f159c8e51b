"""What `PhaseDisplay` is given, checked, and what it gets out of an estimator."""

import numpy as np

from ..body.direction_cosines import DirectionCosines
from ..live.stream import LivePhase
from ..pipelines import find_step
from ..sequences import as_collection
from ..tables import labels_of
from .given import as_drawn

__all__ = [
    "as_phases",
    "bodies_of_features",
    "each_of",
    "from_zero",
    "path_of",
    "spread_of",
    "taken",
]

_PARTS = "phase", "rate", "confidence"
# By how much rounding may take a phase or a confidence beyond its bounds.
_ROUNDING = 1e-9


def as_phases(phases, n_frames):
    """A list of LivePhase of checked arrays (n_frames_i,)."""
    listed = [phases] if isinstance(phases, LivePhase) else list(phases)
    if not listed or not all(isinstance(of, LivePhase) for of in listed):
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


def each_of(values, lengths, what, shape, gaps=False):
    """Something of each performance, of this shape after its frames; None where it is not known."""
    if values is None:
        return [None] * len(lengths)
    if len(values) != len(lengths):
        raise ValueError(
            f"There are {len(lengths)} performances, but {what} of {len(values)}: give one of each."
        )
    return [
        None
        if gaps and x is None
        else as_drawn(x, f"Performance {i}: {what}", (n, *shape)).astype(np.float64)
        for i, (x, n) in enumerate(zip(values, lengths, strict=True))
    ]


def from_zero(times, n, i):
    """Time since the first frame, which increases."""
    if times is None:
        return np.arange(float(n))
    if not (np.diff(times) > 0).all():
        raise ValueError(f"Performance {i}: times must increase from frame to frame, got {times}.")
    return times - times[0]


def taken(live, X):
    """How to choose of X what ``follow`` takes, its arrays, their labels; if it is a single one."""
    collection = as_collection(X)
    on_rows = live.mean_.shape[1] != live.n_features_in_
    if collection is None and on_rows:
        rows = np.asarray(X)
        arrays = list(rows[:, :, np.newaxis])
        return (lambda chosen: rows[chosen]), arrays, [str(i) for i in range(len(rows))], False
    members = [X] if collection is None else collection
    names = [", ".join(map(str, n)) if isinstance(n, tuple) else n for n in labels_of(members)[0]]
    return (lambda chosen: [members[i] for i in chosen]), members, names, collection is None


def path_of(live, X, n):
    """The phases of the n frames of one performance that is over."""
    (tau,) = live.synchronizer_.match(X).times
    clock = np.arange(live.n_frames_)
    # Where tau stands still, any phase of that while is as right.
    return np.interp(np.linspace(0, clock[-1], n), tau + 1e-9 * clock, clock)


def spread_of(live, training):
    """The standard deviation of the training performances about their mean, (P, n_features)."""
    warped = live.synchronizer_.match(training).warp(training)
    return np.asarray(warped).reshape(len(warped), *live.mean_.shape).std(axis=0)


def bodies_of_features(body, seen, mean):
    """Joint positions of what is seen and of the mean, and whose they are."""
    if body is None:
        return None, None, None
    skeleton = find_step(body, DirectionCosines)[1].skeleton.body()
    shape = len(skeleton.joints), skeleton.n_dims
    *bodies, mean_body = (
        np.asarray(body.inverse_transform(x)).reshape(len(x), *shape) for x in (*seen, mean)
    )
    return bodies, mean_body, skeleton
