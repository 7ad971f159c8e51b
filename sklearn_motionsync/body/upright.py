"""Which way up a body is: its vertical axis made the second, told from positions, and checked."""

import numpy as np

from .formats import LANDMARKS, SIDES
from .hidden import seen_landmarks, typical_lengths
from .limbs import LIMB_NAMES, landmarks_of, size_of, unit

__all__ = ["UPS", "as_recorded", "check_upright", "seems_up", "y_up"]

# A body is upside down if it is in so many of its frames, by more than so many leg lengths. Of 363
# real performances that bend, hop, crouch and sit down, the one that comes closest has its pelvis
# 0.26 legs above the ankles and its head, on average, 0.15 above the pelvis.
_NEARLY_ALWAYS, _CLEARLY = 0.9, 0.1
# Whose left and right limbs differ by more is no body, so it has no upside; of those people the
# limbs differ by 1.38 at most.
_ALIKE = 1.5
# A body tells its vertical axis if its mean direction from the feet to the head is so long, of at
# most 1, along one axis.
_TELLING = 0.5
# ... and so many times as long as along any other, where two parts of it tell. Whoever bends shows
# it by the legs, or by the arms that hang down: of 343 real performances none is mistaken. A trunk
# alone is, in half of the deep bends.
_CLEARER = 1.5

# For each vertical axis in space, which axis of the recording becomes x, y and z, and its sign:
# rotations, so that left stays left.
_IN_SPACE = {
    "y": ((0, 1), (1, 1), (2, 1)),
    "z": ((0, 1), (2, 1), (1, -1)),
    "x": ((1, -1), (0, 1), (2, 1)),
    "-y": ((0, 1), (1, -1), (2, -1)),
    "-z": ((0, 1), (2, -1), (1, 1)),
    "-x": ((1, 1), (0, -1), (2, 1)),
}
# The same in the plane. Pictures have y downwards, and are seen as the camera saw them: what is
# along x in one that lies on its side is seen across after turning it, not mirrored.
_IN_PLANE = {
    "y": ((0, 1), (1, 1)),
    "-y": ((0, 1), (1, -1)),
    "x": ((1, 1), (0, 1)),
    "-x": ((1, -1), (0, -1)),
}
UPS = {2: _IN_PLANE, 3: _IN_SPACE}


def y_up(points, skeleton):
    """Points (..., n_dims) of a skeleton in axes of which the second is vertical."""
    if skeleton.up == "y":
        return points
    axes = UPS[skeleton.n_dims][skeleton.up]
    return np.stack([s * points[..., a] if s < 0 else points[..., a] for a, s in axes], axis=-1)


def as_recorded(points, skeleton):
    """The way back: points whose second axis is vertical in the axes of the recording."""
    back = np.empty_like(points)
    for axis, (source, sign) in enumerate(UPS[skeleton.n_dims][skeleton.up]):
        back[..., source] = sign * points[..., axis]
    return back


def seems_up(positions, skeleton):
    """The vertical axis that the positions seem to have: the body's way from the feet to the head.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_dims * n_joints)
        With gaps or without.
    skeleton : Skeleton
        Of any vertical axis.

    Returns
    -------
    str or None
        None if they do not tell.
    """
    positions = positions[np.isfinite(positions).all(axis=1)]
    if not positions.size:
        return None
    points, _ = landmarks_of(positions, skeleton)
    lower, middle, upper = _levels(points, skeleton.landmarks)
    ways = [b - a for a, b in ((lower, middle), (middle, upper)) if a is not None and b is not None]
    if not ways:
        return None
    hands, shoulders = (
        _first(points, skeleton.landmarks, [f"{side}_{part}" for side in SIDES])
        for part in ("wrist", "shoulder")
    )
    if lower is None and hands is not None and shoulders is not None:
        ways.append(shoulders - hands)
    rise = np.mean([unit(way).mean(axis=0) for way in ways], axis=0)
    # Who does not stand tells nothing for sure: then what is usual is as likely.
    *others, largest = np.sort(np.abs(rise))
    clearer = _CLEARER if len(ways) > 1 else 1
    if largest < max(_TELLING, clearer * max(others)):
        return None
    return _named(rise)


def _named(rise):
    axis = int(np.abs(rise).argmax())
    return f"{'-' if rise[axis] < 0 else ''}{'xyz'[axis]}"


def _levels(points, landmarks):
    """Tracks (n_frames, n_dims) of the feet, the pelvis and the head; None for what lacks."""
    return (
        _first(points, landmarks, [f"{side}_ankle" for side in SIDES]),
        _first(points, landmarks, ["pelvis"], [f"{side}_hip" for side in SIDES]),
        _first(points, landmarks, ["head"], ["neck"], [f"{side}_shoulder" for side in SIDES]),
    )


def _first(points, landmarks, *choices):
    """The mean of those landmarks of a choice that are there, of the first choice that has any."""
    for choice in choices:
        there = [LANDMARKS.index(name) for name in choice if name in landmarks]
        if there:
            return sum(points[:, place] / len(there) for place in there)
    return None


def _is_even(lengths, limbs):
    """Whether limbs of the left and the right are about as long as each other."""
    parts = {name.partition("_")[2] for name in limbs if name.startswith(SIDES)}
    pairs = [[f"{side}_{part}" for side in SIDES] for part in parts]
    pairs = [pair for pair in pairs if set(pair) <= set(limbs)]
    left, right = (np.array([lengths[LIMB_NAMES.index(pair[k])] for pair in pairs]) for k in (0, 1))
    return bool(np.all((left < _ALIKE * right) & (right < _ALIKE * left)))


def check_upright(points, lengths, skeleton, what):
    """Refuse a body that stands on its head from the first to the last frame.

    Parameters
    ----------
    points : ndarray, shape (n_frames, 15, n_dims)
        Landmarks, the second axis vertical; NaN where they are hidden, which tells nothing.
    lengths : ndarray, shape (n_frames, 12)
        Of the limbs.
    skeleton : Skeleton
    what : str
        What to call it in messages, with a capital letter.
    """
    there = seen_landmarks(points, skeleton.landmarks)
    lower, middle, upper = _levels(points, there)
    if middle is None or (lower is None and upper is None):
        return
    # The legs tell for sure; without them the trunk does.
    bottom, top = (middle, upper) if lower is None else (lower, middle)
    rises = top[:, 1] - bottom[:, 1]
    below = np.count_nonzero(rises < 0)
    if not below or below < _NEARLY_ALWAYS * (np.count_nonzero(np.isfinite(rises)) - 1):
        return
    rises = rises[np.isfinite(rises)]
    typical = typical_lengths(lengths)
    limbs = [name for name in skeleton.limbs if not np.isnan(typical[LIMB_NAMES.index(name)])]
    size = size_of(typical, limbs)
    if np.quantile(rises, _NEARLY_ALWAYS) >= -_CLEARLY * size or not _is_even(typical, limbs):
        return
    trunk = [] if upper is None else _rises(middle, upper)
    if len(trunk) and trunk[:, 1].mean() > -_CLEARLY * size:
        return
    # From the feet to the head, or as far as is seen.
    ways = [_rises(bottom, top)] + [trunk] * (lower is not None and len(trunk) > 0)
    rise = sum(way.mean(axis=0) for way in ways)
    parts = [
        "the pelvis is below the ankles" if lower is not None else "",
        "the head is below the pelvis" if len(trunk) else "",
    ]
    seems = _named(as_recorded(rise, skeleton))
    raise ValueError(
        f"{what} is upside down: {' and '.join(filter(None, parts))}. The skeleton says that "
        f"{_signed(skeleton.up)} is up, but {_signed(seems)} seems to be. Turn the skeleton, not "
        f"the positions: Skeleton(..., up={seems!r}), or Skeleton.from_frame(df, up={seems!r})."
    )


def _rises(lower, upper):
    """The ways up (n_seen, n_dims) in the frames that see both ends."""
    rises = upper - lower
    return rises[~np.isnan(rises[:, 1])]


def _signed(up):
    return up if up.startswith("-") else f"+{up}"
