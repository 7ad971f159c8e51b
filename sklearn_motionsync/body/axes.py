"""Axes of reference: the vertical axis of a recording, the heading, and those of a parent limb."""

import numpy as np

from .limbs import LIMBS, unit_vectors

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
