"""Forward kinematics: the positions of the joints of a tree, from how each moves in its parent."""

import itertools

import numpy as np

# Joints times frames of a level that are placed at once, in the mean: enough for the overhead of
# NumPy's calls not to count, and few enough for the processor's cache. And those of all levels,
# which bounds the memory.
_LEVEL = 2**14
_BLOCK = 2**20
# The two axes that turn about a third, the first to where the second was.
_OTHERS = {"X": (1, 2), "Y": (2, 0), "Z": (0, 1)}


def split_channels(channels):
    """Columns that move joints, and columns that turn them.

    Of each joint come its channels in the order of their columns: ("t" or "r", axis), with the axis
    "X", "Y" or "Z". ``moving`` (3, n) has axis, joint and column of each translation, ``turning``
    for each sequence of axes, such as "ZXY", the joints that turn about it, each with its columns.
    """
    moving, turning, column = [], {}, 0
    for j, joint_channels in enumerate(channels):
        axes, columns = "", []
        for kind, axis in joint_channels:
            if kind == "t":
                moving.append(("XYZ".index(axis), j, column))
            else:
                axes += axis
                columns.append(column)
            column += 1
        if axes:
            turning.setdefault(axes, []).append((j, columns))
    return np.array(moving, dtype=int).reshape(-1, 3).T, turning


def place_joints(parents, turning, values, translations, *, degrees=True, at_rest=None, bones=None):
    """Positions (n_frames, n_joints, 3) of the joints of a tree, each with axes that turn with it.

    Parameters
    ----------
    parents : list of int
        The parent of each joint, -1 for roots.
    turning : dict of str to list of (int, list of int)
        As `split_channels` returns it; each axis is turned by those before it. Other joints do
        not turn.
    values : ndarray (n_frames, n_values)
        The channels.
    translations : callable
        ``translations(values)`` returns, for some frames, the translation of each joint in its
        parent, along the axes of the parent, (3, n_joints, n_frames); it is overwritten.
    degrees : bool
        Whether angles are degrees.
    at_rest : ndarray (3, 3, n_joints), default=None
        Each joint's axes before it turns, as columns, in those of its parent; by default the same.
    bones : ndarray (3, n_joints), default=None
        From where a joint turns to its position, along its axes; by default nothing.
    """
    levels = _find_levels(parents, turning, leaves_turn=bones is not None)
    positions = np.empty((len(values), len(parents), 3))
    step = max(1, min(_LEVEL * len(levels), _BLOCK) // len(parents))
    for first in range(0, len(values), step):
        block = values[first : first + step]
        angles = np.ascontiguousarray(block.T)
        if degrees:
            angles = np.radians(angles)
        placed = _place(levels, angles, translations(block), at_rest, bones)
        positions[first : first + step] = placed.transpose(2, 1, 0)
    return positions


def _place(levels, angles, places, at_rest, bones):
    """Translations in parents become positions in space, level by level."""
    # The axes of the level above; above the roots they are those of space.
    axes = np.broadcast_to(np.eye(3)[:, :, None, None], (3, 3, 1, angles.shape[1]))
    for joints, parents, above, turns in levels:
        axes = axes[:, :, above]
        moved = rotate(axes, places[:, joints])
        places[:, joints] = moved if parents is None else moved + places[:, parents]
        if at_rest is not None:
            axes = rotate(axes[:, :, None], at_rest[:, :, joints, None])
        for names, members, columns in turns:
            turn(axes[:, :, members], names, angles[columns])
        if bones is not None:
            places[:, joints] += rotate(axes, bones[:, joints, None])
    return places


def _find_levels(parents, turning, leaves_turn):
    """Joints with equally many ancestors, which are placed at once.

    For each level its joints, their parents (None above the roots), these in the level above, and
    for each order of axes the joints that turn so, as a part of the level, and their columns.
    """
    children = {}
    for j, parent in enumerate(parents):
        children.setdefault(parent, []).append(j)
    # The rotation of a leaf moves nothing.
    turns_as = {
        j: (axes, columns)
        for axes, members in turning.items()
        for j, columns in members
        if leaves_turn or j in children
    }
    levels, at = [], {-1: 0}
    joints = children[-1]
    while joints:
        joints.sort(key=lambda j: turns_as.get(j, ("",))[0])
        above = [parents[j] for j in joints]
        turns, first = [], 0
        for axes, group in itertools.groupby(joints, lambda j: turns_as.get(j, ("",))[0]):
            group = list(group)
            if axes:
                columns = np.array([turns_as[j][1] for j in group]).T
                turns.append((axes, slice(first, first + len(group)), columns))
            first += len(group)
        levels.append((joints, above if levels else None, [at[j] for j in above], turns))
        at = {j: i for i, j in enumerate(joints)}
        joints = [child for j in joints for child in children.get(j, ())]
    return levels


def rotate(axes, vectors):
    """Vectors (3, ...) given along axes (3, 3, ...), in the coordinates of the axes."""
    result = axes[:, 0] * vectors[0]
    result += axes[:, 1] * vectors[1]
    result += axes[:, 2] * vectors[2]
    return result


def turn(axes, names, angles):
    """Turn axes (3, 3, ...) about some of themselves, as they are then, by angles (n, ...)."""
    for name, c, s in zip(names, np.cos(angles), np.sin(angles), strict=True):
        i, j = _OTHERS[name]
        first, second = axes[:, i], axes[:, j]
        across = s * first
        first *= c
        first += s * second
        second *= c
        second -= across
