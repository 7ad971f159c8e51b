"""Bodies of which joints are hidden in some frames, NaN: what the others tell of them."""

import numpy as np

from .axes import heading
from .formats import LANDMARKS
from .limbs import exponent_of

__all__ = ["hide_whole", "in_proportion", "seen_heading", "seen_landmarks", "typical_lengths"]


def hide_whole(points):
    """Make those of (n_frames, n, n_dims) points NaN, in place, of which a coordinate is NaN."""
    points[np.isnan(points).any(axis=2)] = np.nan


def seen_landmarks(points, landmarks):
    """Those of the landmarks that some frame of (n_frames, 15, n_dims) points shows."""
    if not np.isnan(points.sum()):
        return landmarks
    hidden = np.isnan(points[:, :, 0]).all(axis=0)
    return [name for name in landmarks if not hidden[LANDMARKS.index(name)]]


def typical_lengths(lengths):
    """Medians (12,) of (n_frames, 12) over the frames that see a limb; NaN of those never seen."""
    typical = np.median(lengths, axis=0)
    if not np.isnan(typical.sum()):
        return typical
    for k in np.flatnonzero(np.isnan(typical)):
        seen = lengths[~np.isnan(lengths[:, k]), k]
        if seen.size:
            typical[k] = np.median(seen)
    return typical


def in_proportion(lengths, learnt):
    """Lengths (12,) in which those never seen, NaN, are to the others as of the learnt body.

    So they follow the unit and the size of the body that is seen. NaN if no limb tells them.
    """
    seen = ~np.isnan(lengths)
    learnt = np.ldexp(learnt, -exponent_of(learnt.max(), learnt.dtype))
    whole = learnt[seen].sum()
    ratio = lengths[seen].sum() / whole if whole > 0 else np.nan
    return np.where(seen, lengths, ratio * learnt).astype(lengths.dtype)


def seen_heading(hips, shoulders=None):
    """Axes (n_frames, 3, 3) that turn with a body, as those of ``heading``.

    Nothing is taken from later frames. Where the hips are hidden, the axes face along the
    shoulders, turned by as much as they were against the hips when both were last seen; if
    they never were, along the shoulders. Where those are hidden, too, the body faces
    where it faced before.

    Parameters
    ----------
    hips : ndarray, shape (n_frames, 3)
        Directions to the left; NaN where they are hidden.
    shoulders : ndarray, shape (n_frames, 3), default=None

    Returns
    -------
    ndarray
        NaN as long as nothing has told where the body faces.
    """
    across = _level(hips)
    if shoulders is not None:
        others = _level(shoulders)
        twist = _latest(across * others.conj())
        twist[np.isnan(twist)] = 1
        across = np.where(np.isnan(across), others * twist, across)
    hidden, ways = np.isnan(hips[:, 0]), hips.copy()
    told = _latest(across)[hidden]
    ways[hidden] = np.column_stack([told.real, np.zeros_like(told.real), told.imag])
    axes = heading(ways)
    axes[np.isnan(ways[:, 0])] = np.nan
    return axes


def _level(ways):
    """Level directions as complex numbers x + iz of size 1; NaN of what is hidden or upright."""
    size = np.hypot(ways[:, 0], ways[:, 2])
    shown = size > np.sqrt(np.finfo(ways.dtype).eps)
    level = np.full(len(ways), np.nan, dtype=np.result_type(ways.dtype, np.complex64))
    level[shown] = (ways[shown, 0] + 1j * ways[shown, 2]) / size[shown]
    return level


def _latest(values):
    """Each value, or the latest before it that is not NaN; NaN as long as there is none."""
    places = np.where(np.isnan(values), 0, np.arange(len(values)))
    return values[np.maximum.accumulate(places)]
