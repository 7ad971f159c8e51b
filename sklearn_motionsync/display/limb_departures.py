"""Limbs that depart from an action: when, how far, and the bones that represent them."""

import re
from functools import partial
from numbers import Real
from textwrap import fill

import numpy as np

from ..body.base import PositionsTransformer
from ..body.direction_cosines import DirectionCosines
from ..body.limbs import LIMBS
from ..inputs.tables import name_trial
from ..model.departures import WHOLE, judge
from ..utils.pipelines import find_step, find_synchronizer, flat_steps, union_transformers
from .arguments import as_frames, as_index

# The pelvis is no limb; its height is marked on the hips.
_HEIGHT, _PELVIS = "pelvis_height", "hip"
# A frame given by index represents the frames around it, up to this share of the clock.
_FAR = 1 / 12
# Characters beside each other above a body.
_WIDTH_OF_TITLE = 18


def limb_departures(rows, n_frames, frames, skeleton):
    """The frames to show, and the limbs that depart around them.

    Parameters
    ----------
    rows : list of Departure
        Of one trial, the most important first.
    n_frames : int
        Of the clock.
    frames : int or list of int
        As for `SkeletonDisplay.from_departures`.
    skeleton : Skeleton
        Its joints are landmarks.

    Returns
    -------
    frames : list of int
        One a panel.
    titles : list of str
        The frame and the most important departure.
    marked : list of list of (int, int)
        The bones that depart around each frame.
    """
    rows = [row for row in rows if row.limb not in (None, WHOLE)]
    shown, stretches = _stretches(rows, frames, n_frames)
    titles, marked = [], []
    for frame, stretch in zip(shown, stretches, strict=True):
        departing = [
            row
            for row in rows
            if len(stretch) and row.first <= stretch[-1] and row.last >= stretch[0]
        ]
        text = "no limb departs"
        if departing:
            # A panel has no room for more.
            text = describe_departure(departing[0])
            text = re.sub(r"moves (\S+) times as far", r"x \1", text)
        titles.append(f"frame {frame}\n{fill(text, _WIDTH_OF_TITLE)}")
        limbs = dict.fromkeys(row.limb for row in departing)
        bones = [bone for limb in limbs for bone in _bones_of_limb(limb, skeleton)]
        # Each once.
        marked.append(list(dict.fromkeys(bones)))
    return shown, titles, marked


def describe_departure(row):
    """A departure in plain words, such as ``"left forearm 31\N{DEGREE SIGN} flexed"``."""
    limb = row.limb.replace("_", " ")
    if limb == WHOLE:
        return f"{limb} {row.kind}"
    if row.kind == "angle":
        return f"{limb} {row.size:.0f}\N{DEGREE SIGN} {row.direction or 'off'}"
    if row.kind in ("late", "early"):
        return f"{limb} {row.size:.0f} % {row.kind}"
    if row.unit == "ratio":
        return f"{limb} moves {row.size:.1f} times as far"
    return f"{limb} {abs(row.size):.2f} {'higher' if row.size > 0 else 'lower'}"


def _stretches(rows, frames, n_frames):
    """The frames to show, and the frames of the clock that each of them represents."""
    if isinstance(frames, Real):
        count = min(len(as_frames(frames, n_frames)), n_frames)
        edges = np.linspace(0, n_frames, count + 1).round().astype(int)
        stretches, shown = np.split(np.arange(n_frames), edges[1:-1]), []
        for stretch in stretches:
            # The peak of the most important departure, or the middle.
            peaks = [row.peak for row in rows if stretch[0] <= row.peak <= stretch[-1]]
            shown.append([*peaks, int(stretch[(len(stretch) - 1) // 2])][0])
        return shown, stretches
    shown = as_frames(frames, n_frames)
    distances = np.abs(np.arange(n_frames) - np.array(shown)[:, np.newaxis])
    near = (distances == distances.min(axis=0)) & (distances <= _FAR * n_frames)
    return shown, [np.flatnonzero(of_frame) for of_frame in near]


def _bones_of_limb(limb, skeleton):
    """The bones of a skeleton that represent a limb."""
    ends = LIMBS[_PELVIS if limb == _HEIGHT else limb][:2]
    ends = tuple(skeleton.joints.index(name) for name in ends if name in skeleton.joints)
    # The hips, and the shoulders, are two bones each, from their middle.
    return [ends] if ends in skeleton.bones else [b for b in skeleton.bones if b[1] in ends]


def departing_bodies(estimator, X, params, caller, *, trial, frames, reference):
    """What a `SkeletonDisplay` draws of the departures of a trial: a dict of its attributes.

    Parameters
    ----------
    estimator : Pipeline
    X, params, caller
        As for `view_of`.
    trial, frames, reference
        As for `SkeletonDisplay.from_departures`.
    """
    if X is None:
        raise ValueError(f"{caller} needs trials X, whose departures are drawn; got None.")
    index = partial(as_index, trial, what="trial")
    judged = judge(estimator, X, params, caller, reference=reference, only=index)
    before, _ = split_at_synchronizer(estimator)
    view, limbs = judged.view, judged.space.limbs
    if limbs is None:
        raise ValueError(
            "Limbs that depart need a pipeline of DirectionCosines, an ASpace if you like, "
            "synchronizers and an ActionModel, whose features lead back to limbs; those found "
            f"are {', '.join(view.names[:4])}, ..., by way of "
            f"{[type(step).__name__ for step in flat_steps(before)]}."
        )
    i = index(len(view.labels))
    rows, skeleton = judged.rows(i, None), limbs.cosines.skeleton.body()
    if judged.refused is None:
        is_accepted = view.model_of_points.predict(view.curves.points.take([i]))[0] == 1
    else:
        is_accepted = not judged.refused[i]
    # Hints would hide what is rare, and most right trials have some.
    rows = [row for row in rows if row.rare] or ([] if is_accepted else rows)
    shown, titles, marked = limb_departures(rows, len(judged.mean), frames, skeleton)
    bodies, shadows = (
        np.asarray(limbs.cosines.inverse_transform(limbs.invert(x)))
        for x in (judged.curves[i], judged.mean)
    )
    bodies, shadows = (x.reshape(len(x), -1, skeleton.n_dims) for x in (bodies, shadows))
    if not skeleton.has_height:
        # Without a height of the pelvis both have the same floor.
        floor = min(bodies[..., 1].min(), shadows[..., 1].min())
        bodies[..., 1] -= floor
        shadows[..., 1] -= floor
    verdict = "accepted" if is_accepted else "not accepted"
    whose = "a new person" if reference is None else "this person"
    rare = [describe_departure(row) for row in rows if row.rare and row.limb is not None]
    heading = (
        f"{name_trial(i, view.labels[i])} is {verdict}.\n"
        f"Rare: {', '.join(rare) if rare else 'nothing'}. Violet: limbs that depart at or around "
        f"that frame. Pale: what is expected of {whose}."
    )
    scenes, behind = ([[x[[frame]]] for frame in shown] for x in (bodies, shadows))
    drawn = {"scenes": scenes, "behind": behind, "skeleton": skeleton}
    return drawn | {"titles": titles, "marked": marked, "heading": heading}


def split_at_synchronizer(estimator):
    """The steps of a pipeline before its synchronizer, and those of them with a skeleton."""
    before, _ = find_synchronizer(estimator)
    if before is None:
        raise ValueError(
            "Stick figures need a pipeline that begins with DirectionCosines; for a synchronizer "
            "by itself use from_trials with the joint positions."
        )
    transformers = [each for step in flat_steps(before) for each in union_transformers(step)]
    views = [each for each in transformers if isinstance(each, PositionsTransformer)]
    if not views:
        # Raises an error that names the steps.
        find_step(before, DirectionCosines)
    return before, views
