"""The data of the player of a report: stick figures of trials, as recorded, and their warps."""

import base64

import numpy as np
from sklearn.pipeline import make_pipeline

from ..body.base import PositionsTransformer
from ..display.arguments import as_performances
from ..display.bodies import (
    bones_by_side,
    landmark_track,
    place_on_floor,
    project,
    read_positions,
)
from ..display.drawing import COLORS
from ..inputs.wording import counted
from ..synchronizers.match import match_of_times
from ..utils.pipelines import find_synchronizer, flat_steps, transform_through, union_transformers

__all__ = ["bodies_of", "player_of"]

# Coordinates that a report holds, at most, of two bytes each: 4 MB of text. And frames a trial that
# a movement needs at least; where these are too many, there are fewer trials.
MOST_COORDINATES, _FEWEST_FRAMES = 1_500_000, 25
# The largest number, and what stands for a joint that was not seen.
_LARGEST, _MISSING = 32767, -32768
# Seconds of the median trial if no frame rate is known.
_UNKNOWN = 4.0


def bodies_of(estimator, X, params):
    """The joint positions that reach the first step with a skeleton, and that; else X and None.

    Parameters
    ----------
    estimator : synchronizer, or Pipeline with one
    X : performances, as the estimator takes them
    params : dict
        As for `transform_through`.
    """
    before, synchronizer = find_synchronizer(estimator)
    steps = [] if before is None else flat_steps(before)
    for k, step in enumerate(steps):
        for part in union_transformers(step):
            if isinstance(part, PositionsTransformer):
                earlier = make_pipeline(*steps[:k]) if k else None
                # Later ones take the other params.
                also = [*(later.transform for later in steps[k:]), synchronizer.match]
                X = transform_through(earlier, X, params, "write_report", also=also)
                return X, part.skeleton
    return X, None


def player_of(trials, X, skeleton):
    """What the script of the player reads, and sentences on colours and on what was left out.

    Parameters
    ----------
    trials : TrialSet
    X : performances
        Joint positions.
    skeleton : Skeleton
    """
    n, template = len(trials.names), trials.template
    X = as_performances(X)
    first = 0 if template is None else template
    points, bones, dots = _points(X[first], skeleton, first)
    width = points.shape[1] * points.shape[2]
    most = max(MOST_COORDINATES // (width * _FEWEST_FRAMES), 2)
    chosen = sorted(sorted(range(n), key=lambda i: i != first)[:most])
    longest = _longest([trials.frames[i] for i in chosen], MOST_COORDINATES // width)
    bodies = []
    for i in chosen:
        x = _points(X[i], skeleton, i)[0]
        if len(x) > longest:
            even = match_of_times([np.arange(float(longest))], 1)
            x = even.warp([x.reshape(len(x), -1)])[0].reshape(longest, *x.shape[1:])
        bodies.append(x)
    durations = (trials.frames - 1.0 if trials.seconds is None else trials.seconds)[chosen]
    times = trials.aligned.match.times[chosen]
    every = np.concatenate(bodies)
    scale = np.nanmax(np.abs(every)) / _LARGEST
    right = chosen.index(first)
    data = {
        "names": [trials.names[i] + " (template)" * (i == template) for i in chosen],
        "left": 1 if right == 0 and len(chosen) > 1 else 0,
        "right": right,
        "seconds": trials.seconds is not None,
        "durations": durations.tolist(),
        "median": float(np.median(durations)),
        "pace": 1.0 if trials.seconds is not None else _UNKNOWN / float(np.median(durations)),
        "counts": [len(x) for x in bodies],
        "points": every.shape[1],
        "dims": every.shape[2],
        "positions": _packed(np.where(np.isnan(every), _MISSING, every / scale), "<i2"),
        "scale": float(scale),
        "frames": times.shape[1],
        "warps": _packed(times / (times.shape[1] - 1) * 65535, "<u2"),
        "bones": bones,
        "dots": dots,
        "dotColor": COLORS["middle"],
    }
    note = ["Left limbs are blue, right ones orange."] if bones else []
    if len(chosen) < n:
        note.append(f"The player holds {counted(len(chosen), 'trial')} of {n}.")
    if max(trials.frames[chosen]) > longest:
        note.append(f"To keep this file small, it holds {longest} frames of longer trials.")
    return data, " ".join(note)


def _points(x, skeleton, i):
    """The points of a trial that are drawn, (n_frames, n_points, n_dims), its bones and its dots.

    Bones are pairs of a colour and indices of two points.
    """
    body = place_on_floor(read_positions(x, skeleton, i), skeleton)
    views = [project(body, skeleton, azimuth) for azimuth in (0, -90)[: skeleton.n_dims - 1]]
    # Seen from the front, and from the side.
    points = np.concatenate([views[0], *(view[..., :1] for view in views[1:])], axis=2)
    by_side = bones_by_side(skeleton)
    # As in `SkeletonDisplay`, the joints are dots if no bones join them; otherwise the head is one.
    dots = [] if skeleton.bones else list(range(len(skeleton.joints)))
    used = sorted({k for of_side in by_side.values() for bone in of_side for k in bone} | {*dots})
    number = {point: k for k, point in enumerate(used)}
    bones = [
        [COLORS[side], [[number[a], number[b]] for a, b in of_side]]
        for side, of_side in by_side.items()
        if of_side
    ]
    points, dots = points[:, used], [number[k] for k in dots]
    if not dots and "head" in skeleton.landmarks:
        dots = [len(used)]
        head = landmark_track(body, skeleton, "head")[:, np.newaxis]
        points = np.concatenate([points, head], axis=1)
    return points, bones, dots


def _longest(lengths, most):
    """The largest number of frames of a trial with which all have so many frames together."""
    low, high = 2, max(lengths)
    while low < high:
        middle = (low + high + 1) // 2
        fits = np.minimum(lengths, middle).sum() <= most
        low, high = (middle, high) if fits else (low, middle - 1)
    return low


def _packed(values, dtype):
    """Whole numbers as text."""
    return base64.b64encode(np.round(values).astype(dtype).tobytes()).decode("ascii")
