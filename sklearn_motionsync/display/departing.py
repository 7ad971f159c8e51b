"""Which limbs depart from an action, and when: what a strip of stick figures is to show."""

from numbers import Real
from typing import NamedTuple

import numpy as np

from ..body.limbs import LIMBS
from ..body.skeleton import Skeleton
from .given import as_frames

__all__ = ["Strip", "bones_of", "limb_of", "strip_of"]

# The pelvis is no limb; it is marked where the legs hang on it.
_HEIGHT, _PELVIS = "pelvis_height", "hip"
# How much of the clock a frame stands for that was asked for, to each side.
_FAR = 1 / 12


class Strip(NamedTuple):
    """What the panels of a strip show.

    Attributes
    ----------
    frames : list of int
        One a panel.
    titles : list of str
    marked : list of list of (int, int)
        The bones of the skeleton that depart around these frames.
    """

    frames: list
    titles: list
    marked: list


def strip_of(scores, names, frames, limit, skeleton=None):
    """The frames of a strip, and the limbs that depart around them.

    Parameters
    ----------
    scores : ndarray, shape (P, n_features)
        Of one performance, in standard deviations that are predicted for a new person.
    names : list of str
        Of the features: ``pelvis_height``, ``hip_x``, ...
    frames : int or list of int
        How many: the clock is cut into as many equal parts, each of which is shown at the frame
        of its worst departure, or in its middle if there is none. Or which ones: each
        stands for the frames that are nearer to it than to the others, at most a twelfth of the
        clock away.
    limit : float
        Beyond how many standard deviations a feature departs.
    skeleton : Skeleton, default=None
        Whose joints are landmarks; by default the paper's.

    Returns
    -------
    Strip
    """
    skeleton = Skeleton.paper() if skeleton is None else skeleton
    parts = list(dict.fromkeys(map(limb_of, names)))
    columns = [[k for k, name in enumerate(names) if limb_of(name) == part] for part in parts]
    # The score of a limb is that of the cosine that is farthest off.
    size = np.stack([np.abs(scores[:, c]).max(axis=1) for c in columns], axis=1)
    shown, stretches = _cut(frames, size.max(axis=1), limit)
    titles, marked = [], []
    for frame, stretch in zip(shown, stretches, strict=True):
        peaks = size[stretch].max(axis=0)
        departing = [part for part, peak in zip(parts, peaks, strict=True) if peak > limit]
        worst = parts[int(peaks.argmax())]
        said = f"{worst} {_rounded(peaks.max())} std" if departing else "no limb departs"
        titles.append(f"frame {frame}\n{said}")
        bones = [bone for part in departing for bone in bones_of(part, skeleton)]
        marked.append(list(dict.fromkeys(bones)))
    return Strip(shown, titles, marked)


def _cut(frames, worst, limit):
    """The frames to show, and the frames of the clock that each of them stands for."""
    n_frames = len(worst)
    if isinstance(frames, Real):
        count = min(len(as_frames(frames, n_frames)), n_frames)
        edges = np.linspace(0, n_frames, count + 1).round().astype(int)
        stretches = np.split(np.arange(n_frames), edges[1:-1])
        return [_typical(stretch, worst, limit) for stretch in stretches], stretches
    shown = as_frames(frames, n_frames)
    apart = np.abs(np.arange(n_frames) - np.array(shown)[:, np.newaxis])
    near = (apart == apart.min(axis=0)) & (apart <= _FAR * n_frames)
    return shown, [np.flatnonzero(of_frame) for of_frame in near]


def _typical(stretch, worst, limit):
    peak = int(stretch[worst[stretch].argmax()])
    return peak if worst[peak] > limit else int(stretch[(len(stretch) - 1) // 2])


def limb_of(name):
    """The limb of a feature, or the height of the pelvis."""
    return name if name == _HEIGHT else name.rpartition("_")[0]


def _rounded(score):
    return f"{score:.0f}" if score >= 10 else f"{score:.1f}"


def bones_of(part, skeleton):
    """The bones of a skeleton that a limb is drawn as."""
    limb = LIMBS[_PELVIS if part == _HEIGHT else part]
    ends = tuple(skeleton.joints.index(name) for name in limb[:2] if name in skeleton.joints)
    # The hips and the shoulders are each drawn as two bones, from their middle.
    return [ends] if ends in skeleton.bones else [b for b in skeleton.bones if b[1] in ends]
