"""Axes: the vertical of a recording, where bodies stand upright, the heading, those of a parent."""

import numpy as np

from .formats import LANDMARKS, SIDES
from .limbs import LIMB_NAMES, LIMBS, body_size, landmark_positions, median_lengths, unit_vectors

# Limbs beyond a joint that bends, and the share of a change that is a bend.
_JOINTED, _MOST = ("left_arm", "right_arm", "left_thigh", "right_thigh"), 0.5
# Of limbs, the words for a change along the axes of the parent: to the left (of limbs on the right
# the other way round), up and forward, and the opposite.
_ON_SIDE, _UPRIGHT = ("to the left", "to the right"), ("raised", "lowered")
_AHEAD, _TURNED = ("forward", "backward"), ("turned to the right", "turned to the left")
_OUTWARD, _BENT = ("abducted", "adducted"), ("flexed", "extended")
_WORDS = {
    "thigh": (_OUTWARD, _BENT, _BENT),
    "arm": (("outward", "inward"), _UPRIGHT, _AHEAD),
    "torso": (_ON_SIDE, _UPRIGHT, _AHEAD),
    "neck": (_ON_SIDE, _UPRIGHT, _AHEAD),
    "hip": (_TURNED, ("left side raised", "left side lowered"), _TURNED),
    "shoulder": (_TURNED, ("left side raised", "left side lowered"), _TURNED),
}

# -- the vertical axis --------------------------------------------------------------------

# For each vertical axis in space, the axis of the recording that becomes x, y and z, and its sign:
# rotations, so that left remains left.
_IN_SPACE = {
    "y": ((0, 1), (1, 1), (2, 1)),
    "z": ((0, 1), (2, 1), (1, -1)),
    "x": ((1, -1), (0, 1), (2, 1)),
    "-y": ((0, 1), (1, -1), (2, -1)),
    "-z": ((0, 1), (2, -1), (1, 1)),
    "-x": ((1, 1), (0, -1), (2, 1)),
}
# The same in a picture, where y points downwards: a reflection, which shows what the camera saw.
_IN_PLANE = {
    "y": ((0, 1), (1, 1)),
    "-y": ((0, 1), (1, -1)),
    "x": ((1, 1), (0, 1)),
    "-x": ((1, -1), (0, -1)),
}
UP_AXES: dict[int, dict] = {2: _IN_PLANE, 3: _IN_SPACE}


def to_y_up(points, skeleton):
    """Points (..., n_dims) of a recording in axes of which the second is vertical."""
    if skeleton.up == "y":
        return points
    axes = UP_AXES[skeleton.n_dims][skeleton.up]
    return np.stack([s * points[..., a] if s < 0 else points[..., a] for a, s in axes], axis=-1)


def from_y_up(points, skeleton):
    """The inverse of `to_y_up`."""
    back = np.empty_like(points)
    for axis, (source, sign) in enumerate(UP_AXES[skeleton.n_dims][skeleton.up]):
        back[..., source] = sign * points[..., axis]
    return back


# -- the heading --------------------------------------------------------------------------


def heading_axes(left):
    """Axes (n_frames, 3, 3) of bodies, one a row: x horizontal to the left, y up, z forward.

    ``left`` (n_frames, 3) are unit vectors along the hips, or along the shoulders, to the left.
    Where they are vertical, the axes are those of the recording.
    """
    x = left * np.array([1, 0, 1], dtype=left.dtype)
    length = np.linalg.norm(x, axis=1, keepdims=True)
    horizontal = length[:, 0] > np.sqrt(np.finfo(left.dtype).eps)
    x = np.where(horizontal[:, np.newaxis], x / np.where(length > 0, length, 1), (1, 0, 0))
    y = np.broadcast_to(np.asarray((0, 1, 0), dtype=x.dtype), x.shape)
    return np.stack([x, y, np.cross(x, y)], axis=1).astype(left.dtype)


def fill_heading(hips, shoulders=None):
    """Directions to the left for `heading_axes`, where those of the hips are NaN in some frames.

    Directions are (n_frames, 3). No frame uses a later one. Where the hips are hidden, the
    shoulders give the heading, corrected by the angle between both when they were last seen
    together; before that, by none. Where both are hidden, the last heading stays; before the first
    frame that shows a heading the result is NaN.
    """
    angles = _horizontal(hips)
    if shoulders is not None:
        others = _horizontal(shoulders)
        twist = _last_known(angles * others.conj())
        twist[np.isnan(twist)] = 1
        angles = np.where(np.isnan(angles), others * twist, angles)
    hidden, left = np.isnan(hips[:, 0]), hips.copy()
    known = _last_known(angles)[hidden]
    left[hidden] = np.column_stack([known.real, np.zeros_like(known.real), known.imag])
    return left


def _horizontal(directions):
    """Horizontal directions as unit complex numbers x + iz; NaN of hidden and vertical ones."""
    size = np.hypot(directions[:, 0], directions[:, 2])
    shown = size > np.sqrt(np.finfo(directions.dtype).eps)
    units = np.full(len(size), np.nan, dtype=np.result_type(directions.dtype, np.complex64))
    units[shown] = (directions[shown, 0] + 1j * directions[shown, 2]) / size[shown]
    return units


def _last_known(values):
    """Each value, or the last one before it that is not NaN; NaN if there is none."""
    indices = np.where(np.isnan(values), 0, np.arange(len(values)))
    return values[np.maximum.accumulate(indices)]


def project_on_axes(vectors, axes):
    """Coordinates of vectors (n_frames, n, 3) along axes (n_frames, 3, 3), one a row."""
    return vectors @ axes.transpose(0, 2, 1)


# -- the axes of a parent limb ------------------------------------------------------------


def convert_to_parent_axes(cosines, limbs, *, inverse=False):
    """Cosines along the axes of the body as cosines along those of the parent limbs, or back.

    Parameters
    ----------
    cosines : ndarray, shape (n_frames, 12, n_dims)
        In a picture, the rotations are about its normal.
    limbs : list of str
        The limbs of the skeleton. A limb without its parent takes the nearest limb above it, or
        the axes of the body.
    inverse : bool, default=False

    Returns
    -------
    ndarray, shape (n_frames, 12, n_dims)
        0 for other limbs.
    """
    n_dims = cosines.shape[2]
    if n_dims == 2:
        cosines = np.concatenate([cosines, np.zeros_like(cosines[..., :1])], axis=2)
    # A limb without an ancestor has the axes of the body.
    axes_of = {None: np.broadcast_to(np.eye(3, dtype=cosines.dtype), (len(cosines), 3, 3))}
    out = np.zeros_like(cosines)
    for i, (name, limb) in enumerate(LIMBS.items()):
        if name not in limbs:
            continue
        above = limb.parent
        while above is not None and above not in limbs:
            above = LIMBS[above].parent
        cosine, parent = cosines[:, i : i + 1], axes_of[above]
        local = cosine if inverse else project_on_axes(cosine, parent)
        whole = cosine @ parent if inverse else cosine
        out[:, i : i + 1] = whole if inverse else local
        axes_of[name] = _swing(limb.rest, local[:, 0]) @ parent
    return out[..., :n_dims]


def direction_of(name, change, expected):
    """The word for where a limb points instead of where it is expected to.

    Parameters
    ----------
    name : str
        Of the limb.
    change : ndarray, shape (n_dims,)
        Of its direction, along the axes of the parent limb.
    expected : ndarray, shape (n_dims,)
        Its direction, along these axes.

    Returns
    -------
    str or None
        None where a picture does not tell.
    """
    limb = LIMBS[name]
    rest = np.array(limb.rest[: len(change)], dtype=float)
    pair = unit_vectors(np.stack([expected, expected + change]))
    if limb.parent in _JOINTED:
        # Between the limb and its parent: a knee or an elbow.
        bend = np.diff(np.arccos(np.clip(pair @ rest, -1, 1)))[0]
        if abs(bend) >= _MOST * np.arccos(np.clip(pair[0] @ pair[1], -1, 1)):
            return "flexed" if bend > 0 else "extended"
        return "turned"
    axis = int(np.argmax(np.abs(change)))
    if len(change) == 2 and axis == 0:
        return None
    words = _WORDS[name.removeprefix("left_").removeprefix("right_")]
    is_mirrored = name.startswith("right_") and axis == 0
    return words[axis][int(change[axis] < 0) ^ is_mirrored]


def _swing(rest, direction):
    """Axes (n_frames, 3, 3) after the smallest rotation from ``rest`` to each direction.

    The rotation is composed of two half-turns, about ``rest`` and about the bisector of both, so
    that it stays orthogonal for a direction opposite to ``rest``.
    """
    rest = np.asarray(rest, dtype=direction.dtype)
    cosine = direction @ rest
    sideways = direction * (rest == 0)
    # 1 + cosine, without cancellation.
    along = np.where(cosine > 0, 1 + cosine, (sideways**2).sum(axis=1) / (1 + np.abs(cosine)))
    along[~direction.any(axis=1)] = 1
    middle = unit_vectors(along[:, np.newaxis] * rest + sideways)
    # At the opposite of rest any perpendicular will do in space, and only this one in the plane.
    across = (rest[0] == 0, rest[0] != 0, 0)
    middle = np.where(middle.any(axis=1, keepdims=True), middle, across).astype(direction.dtype)
    about_middle = 2 * middle[:, :, np.newaxis] * middle[:, np.newaxis] - np.eye(
        3, dtype=rest.dtype
    )
    return (2 * rest * rest - 1)[:, np.newaxis] * about_middle


# -- upright bodies: their vertical axis is estimated, and those upside down are refused ----------

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


def check_upright(points, lengths, skeleton, what):
    """Refuse a body that is upside down from the first to the last frame.

    Parameters
    ----------
    points : ndarray, shape (n_frames, 15, n_dims)
        The landmarks, the second axis vertical; NaN where they are hidden.
    lengths : ndarray, shape (n_frames, 12)
        Of the limbs.
    skeleton : Skeleton
    what : str
        The subject of the message, with a capital letter.
    """
    heights = points[:, :, 1]
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
    lower, middle, upper = _levels(points, seen)
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
