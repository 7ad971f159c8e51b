"""The upright body: its vertical axis estimated from positions, and bodies upside down refused."""

import numpy as np

from .axes import from_y_up
from .formats import LANDMARKS, SIDES
from .limbs import LIMB_NAMES, body_size, landmark_positions, median_lengths, unit_vectors

# A body is upside down if it is so in this share of its frames, by this share of its leg length. Of
# 363 real trials that bend, hop, crouch and sit down, the closest one has its pelvis
# 0.26 legs above the ankles and its head, on average, 0.15 above the pelvis.
_MOST_FRAMES, _MARGIN = 0.9, 0.1
# Points whose left and right limbs differ by a larger factor are not taken for a body; in those
# trials the largest factor is 1.38.
_LARGEST_ASYMMETRY = 1.5
# The mean direction from the feet to the head, of length 1 at most, must have this component along
# the vertical axis ...
_LEAST_COMPONENT = 0.5
# ... which exceeds the others by this factor if two segments give it. Bent bodies are recognised by
# the legs, or by the hanging arms: none of 343 real trials is mistaken. A trunk alone is
# mistaken in half of the deep bends.
_LEAST_RATIO = 1.5


def estimate_up(positions, skeleton):
    """The vertical axis of positions, by the mean direction from the feet to the head.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_dims * n_joints)
        Frames with NaN are left out.
    skeleton : Skeleton
        Its own vertical axis is not used.

    Returns
    -------
    str or None
        None in doubt.
    """
    positions = positions[np.isfinite(positions).all(axis=1)]
    if not positions.size:
        return None
    points, landmarks = landmark_positions(positions, skeleton), skeleton.landmarks
    lower, middle, upper = _levels(points, landmarks)
    segments = [(lower, middle), (middle, upper)]
    if lower is None and middle is not None and upper is not None:
        hands, shoulders = (
            _mean(points, landmarks, [f"{side}_{part}" for side in SIDES])
            for part in ("wrist", "shoulder")
        )
        segments.append((hands, shoulders))
    rises = [b - a for a, b in segments if a is not None and b is not None]
    if not rises:
        return None
    rise = np.mean([unit_vectors(x).mean(axis=0) for x in rises], axis=0)
    *others, largest = np.sort(np.abs(rise))
    ratio = _LEAST_RATIO if len(rises) > 1 else 1
    if largest < max(_LEAST_COMPONENT, ratio * max(others)):
        return None
    return _nearest_axis(rise)


def check_upright(heights, points, lengths, skeleton, what):
    """Refuse a body that is upside down from the first to the last frame.

    Parameters
    ----------
    heights : ndarray, shape (n_frames, 15)
        Of the landmarks; NaN where they are hidden.
    points : callable
        Gives the landmarks, (n_frames, 15, n_dims), the second axis vertical. Few bodies need them.
    lengths : ndarray, shape (n_frames, 12)
        Of the limbs.
    skeleton : Skeleton
    what : str
        The subject of the message, with a capital letter.
    """
    never_seen = np.isnan(heights).all(axis=0)
    seen = [name for name in skeleton.landmarks if not never_seen[LANDMARKS.index(name)]]
    lower, middle, upper = _levels(heights, seen)
    if middle is None or (lower is None and upper is None):
        return
    # Without legs the trunk decides.
    bottom, top = (middle, upper) if lower is None else (lower, middle)
    rises = top - bottom
    below = np.count_nonzero(rises < 0)
    if not below or below < _MOST_FRAMES * (np.count_nonzero(np.isfinite(rises)) - 1):
        return
    rises = rises[np.isfinite(rises)]
    medians = median_lengths(lengths)
    limbs = [name for name in skeleton.limbs if not np.isnan(medians[LIMB_NAMES.index(name)])]
    margin = _MARGIN * body_size(medians, limbs)
    length_of = dict(zip(LIMB_NAMES, medians, strict=True))
    pairs = [(name, name.replace("left", "right")) for name in limbs if name.startswith("left_")]
    pairs = [(length_of[left], length_of[right]) for left, right in pairs if right in limbs]
    is_symmetric = all(max(pair) < _LARGEST_ASYMMETRY * min(pair) for pair in pairs)
    if np.quantile(rises, _MOST_FRAMES) >= -margin or not is_symmetric:
        return
    lower, middle, upper = _levels(points(), seen)
    bottom, top = (middle, upper) if lower is None else (lower, middle)
    trunk = [] if upper is None else _seen_rises(middle, upper)
    if len(trunk) and trunk[:, 1].mean() > -margin:
        return
    rise = _seen_rises(bottom, top).mean(axis=0)
    if lower is not None and len(trunk):
        rise = rise + trunk.mean(axis=0)
    likely = _nearest_axis(from_y_up(rise, skeleton))
    raise ValueError(
        f"{what} is upside down: the skeleton says that {skeleton.up!r} is up, but {likely!r} "
        f"seems to be. Turn the skeleton, not the positions: Skeleton(..., up={likely!r}), or "
        f"Skeleton.from_frame(df, up={likely!r})."
    )


def _levels(points, landmarks):
    """Tracks (n_frames, ...) of the feet, the pelvis and the head; None where they are absent.

    The hips replace the pelvis, and the neck or the shoulders the head.
    """
    return (
        _mean(points, landmarks, [f"{side}_ankle" for side in SIDES]),
        _mean(points, landmarks, ["pelvis"], [f"{side}_hip" for side in SIDES]),
        _mean(points, landmarks, ["head"], ["neck"], [f"{side}_shoulder" for side in SIDES]),
    )


def _mean(points, landmarks, *choices):
    """The mean of the landmarks of the first choice of which there are any; None without."""
    for choice in choices:
        there = [LANDMARKS.index(name) for name in choice if name in landmarks]
        if there:
            return sum(points[:, place] / len(there) for place in there)
    return None


def _seen_rises(lower, upper):
    """Vectors (n_seen, n_dims) from lower to upper points in the frames that show both."""
    rises = upper - lower
    return rises[~np.isnan(rises[:, 1])]


def _nearest_axis(rise):
    axis = int(np.abs(rise).argmax())
    return f"{'-' if rise[axis] < 0 else ''}{'xyz'[axis]}"
