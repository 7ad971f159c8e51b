"""What displays are given, checked: names, indices, numbers, what is drawn."""

from collections.abc import Iterable, Mapping, Set
from numbers import Real

import numpy as np
import pandas as pd

from ..body.skeleton import Skeleton
from ..inputs.collections import as_collection
from ..inputs.numbers import as_numbers, is_integer

__all__ = [
    "as_behind",
    "as_drawn",
    "as_durations",
    "as_frames",
    "as_index",
    "as_indices",
    "as_labels",
    "as_limit",
    "as_marked",
    "as_moments",
    "as_names",
    "as_performance",
    "as_performances",
    "as_pictures",
    "as_scenes",
    "as_skeleton",
    "check_view",
    "is_number",
    "mean_of_seen",
]

# Panels of a strip; pictures of an animation, a quarter of an hour.
_MOST, _MOST_PICTURES = 1000, 25_000


def as_names(names, count, what, each):
    """One text for each of ``count`` things, as a list.

    Parameters
    ----------
    names : sequence
    count : int
    what, each : str
        What to call them, and what each of them names.
    """
    listed = _listed(names)
    if listed is None or len(listed) != count or any(np.ndim(name) > 0 for name in listed):
        got = repr(names) if listed is None else f"{len(listed)}: {listed[:6]}"
        raise ValueError(
            f"{what} must be a list of text, one for each of the {count} {each}, got {got}."
        )
    for i, name in enumerate(listed):
        if pd.isna(name):
            raise ValueError(
                f"{what} must be text for each of the {count} {each}, but {name!r} at {i} says "
                "that it is missing: name it, such as 'unknown', or leave it out of what is drawn."
            )
    return [str(name) for name in listed]


def as_indices(indices, count, what):
    """Indices from 0 to ``count - 1`` as a list, of one or several; at least one."""
    listed = [indices] if isinstance(indices, Real) else _listed(indices)
    if not listed or not all(is_integer(i) and 0 <= i < count for i in listed):
        raise ValueError(
            f"{what} must be from 0 to {count - 1}, got "
            f"{indices if listed is None else listed!r}: give whole numbers."
        )
    return [int(i) for i in listed]


def as_index(index, count, what):
    """One index from 0 to ``count - 1``."""
    if not isinstance(index, Real):
        raise ValueError(f"{what} must be one number from 0 to {count - 1}, got {index!r}.")
    return as_indices(index, count, what)[0]


def as_frames(frames, n_frames):
    """Frames by their numbers, or so many, evenly spaced from the first to the last."""
    if not isinstance(frames, Real):
        return as_indices(frames, n_frames, "frames")
    if not (is_integer(frames) and 1 <= frames <= _MOST):
        raise ValueError(
            f"frames must be how many, a whole number from 1 to {_MOST}, or a list of frames from "
            f"0 to {n_frames - 1}; got {frames!r}."
        )
    return np.linspace(0, n_frames - 1, int(frames)).round().astype(int).tolist()


def as_pictures(seconds, fps):
    """How many pictures an animation has, at least two."""
    if not (is_number(seconds) and is_number(fps) and seconds > 0 and fps > 0):
        raise ValueError(f"seconds and fps must be above 0, got {seconds!r} and {fps!r}.")
    if seconds * fps > _MOST_PICTURES:
        raise ValueError(
            f"seconds={seconds!r} at fps={fps!r} are {seconds * fps:.3g} pictures, more than "
            f"{_MOST_PICTURES}; choose fewer."
        )
    return max(2, round(seconds * fps))


def as_performance(performance, count):
    """The index of one of so many performances."""
    if not (is_integer(performance) and 0 <= performance < count):
        raise ValueError(
            f"performance={performance!r} is out of range: there are {count} performances, from 0 "
            f"to {count - 1}."
        )
    return int(performance)


def as_limit(limit):
    """A number of standard deviations, above 0."""
    if not is_number(limit, 0) or limit == 0:
        raise ValueError(
            f"limit must be a number of standard deviations above 0, or None; got {limit!r}."
        )
    return float(limit)


def as_performances(X):
    """Performances one by one, of a collection or a single one."""
    collection = as_collection(X)
    if collection is not None and len(collection) == 0:
        raise ValueError("Found 0 performances (n_samples=0); there is nothing to draw.")
    return [X] if collection is None else collection


def as_moments(frames, n_frames):
    """Frames of a model by their numbers, or as shares of the action below 1."""
    listed = [frames] if isinstance(frames, Real) else _listed(frames)
    if listed is not None:
        shares = [isinstance(f, Real) and 0 < f < 1 for f in listed]
        listed = [
            round(f * (n_frames - 1)) if share else f
            for f, share in zip(listed, shares, strict=True)
        ]
    what = "frames, those that are no shares between 0 and 1,"
    return as_indices(frames if listed is None else listed, n_frames, what)


def is_number(value, low=-np.inf, high=np.inf):
    """Whether it is a number from ``low`` to ``high``, not infinite."""
    is_real = isinstance(value, Real) and not isinstance(value, bool)
    return is_real and bool(np.isfinite(value)) and low <= value <= high


def as_drawn(values, what, shape):
    """Numbers of a shape, with NaN where there is a gap.

    Parameters
    ----------
    values : array-like
    what : str
        What to call it, with a capital letter.
    shape : tuple of int or str
        A name stands for any number above 0.
    """
    array = as_numbers(values, what)
    sound = array.ndim == len(shape) and all(
        size == wanted or (isinstance(wanted, str) and size > 0)
        for size, wanted in zip(array.shape, shape, strict=True)
    )
    if not sound:
        wanted = f"({', '.join(map(str, shape))}{',' * (len(shape) == 1)})"
        raise ValueError(f"{what} must have the shape {wanted}, got {array.shape}.")
    if np.isinf(array).any():
        where = tuple(np.argwhere(np.isinf(array))[0].tolist())
        raise ValueError(f"{what} is infinite at {where}; make it NaN to leave a gap.")
    return array


def as_skeleton(skeleton):
    """A skeleton, or None for points without bones."""
    if skeleton is not None and not isinstance(skeleton, Skeleton):
        raise ValueError(
            "skeleton must be a Skeleton, such as Skeleton.paper() or bunch.skeleton, or None for "
            f"points without bones; got {type(skeleton).__name__}."
        )
    return skeleton


def as_scenes(scenes, skeleton):
    """For each panel a list of performances (n_frames_i, n_joints, n_dims)."""
    checked = _as_performances_of_panels(scenes, skeleton, "scenes", "Panel")
    if not any(np.isfinite(x).any() for scene in checked for x in scene):
        raise ValueError("scenes must hold positions to draw; they are empty, or all NaN.")
    return checked


def as_behind(behind, n_panels, skeleton):
    """For each panel a list of performances that stand behind."""
    checked = _as_performances_of_panels(behind, skeleton, "behind", "Behind panel")
    if len(checked) != n_panels or skeleton is None:
        raise ValueError(
            f"behind must hold a list of performances for each of the {n_panels} panels, and there "
            f"must be a skeleton; got {len(checked)}, and skeleton={skeleton!r}."
        )
    return checked


def _as_performances_of_panels(scenes, skeleton, name, panel):
    listed = _listed(scenes)
    if listed is None or any(_listed(scene) is None for scene in listed):
        raise ValueError(
            f"{name} must be a list with, for each panel, a list of its performances (n_frames, "
            f"n_joints, 3); got {type(scenes).__name__}."
        )
    return [
        [
            as_drawn(x, f"{panel} {k}, performance {i}", _shape_of(x, skeleton))
            for i, x in enumerate(scene)
        ]
        for k, scene in enumerate(listed)
    ]


def _shape_of(x, skeleton):
    """What a performance must be like: of points without a skeleton, in the plane or in space."""
    if skeleton is not None:
        return "n_frames", len(skeleton.joints), skeleton.n_dims
    return "n_frames", "n_joints", 2 if np.shape(x)[2:] == (2,) else 3


def as_marked(marked, n_panels, skeleton):
    """For each panel the marked bones, pairs of joint indices."""
    bones = [] if skeleton is None else skeleton.bones
    listed = _listed(marked)
    panels = None if listed is None else [_listed(of_panel) for of_panel in listed]
    if panels is None or None in panels or len(panels) != n_panels:
        raise ValueError(
            f"marked must be a list with, for each of the {n_panels} panels, a list of bones, "
            f"pairs (parent, joint) of skeleton.bones; got {marked!r}."
        )
    checked = []
    for k, of_panel in enumerate(panels):
        pairs = [_listed(bone) for bone in of_panel]
        for bone, pair in zip(of_panel, pairs, strict=True):
            if pair is None or not all(map(is_integer, pair)) or tuple(pair) not in bones:
                raise ValueError(
                    f"marked, panel {k}: {bone!r} is no bone of the skeleton; its bones are "
                    f"{bones}."
                )
        checked.append([tuple(int(j) for j in pair) for pair in pairs])
    return checked


def as_durations(durations, scenes):
    """How long each performance of each panel takes."""
    listed = _listed(durations)
    if listed is None or [np.shape(d) for d in listed] != [(len(scene),) for scene in scenes]:
        raise ValueError(
            "durations must be a list with, for each panel, the duration of each performance; "
            f"got {durations!r}."
        )
    if not all(is_number(d, 0) for of_scene in listed for d in of_scene):
        raise ValueError(f"durations must be numbers of at least 0, got {durations!r}.")
    return listed


def as_labels(labels, scenes):
    """Names of the performances of every panel, which has as many."""
    for k, scene in enumerate(scenes):
        names = as_names(labels, len(scene), "labels", f"performances of panel {k}")
    return names


def check_view(at, azimuth):
    """Refuse a time that is no share, and a direction that is no angle."""
    if not is_number(at, 0, 1):
        raise ValueError(f"at must be a share of the time from 0 to 1, got {at!r}.")
    if not is_number(azimuth):
        raise ValueError(f"azimuth must be a number of degrees, got {azimuth!r}.")


def mean_of_seen(values, axis):
    """The mean of what is not NaN, NaN where nothing is."""
    seen = np.isfinite(values)
    count = seen.sum(axis=axis)
    total = np.where(seen, values, 0).sum(axis=axis)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _listed(values):
    """What has an order as a list; None for text, sets, tables of names, and single things."""
    if isinstance(values, (str, bytes, Set, Mapping)) or not isinstance(values, Iterable):
        return None
    return None if getattr(values, "ndim", 1) != 1 else list(values)
