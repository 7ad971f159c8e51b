"""Forward kinematics: the positions of the joints of a tree, from how each moves in its parent."""

import numpy as np

# Frames, and frames times joints, that are placed at once: enough for the overhead of NumPy's calls
# not to count, and few enough for the processor's cache and the memory.
_FRAMES = 2**12
_BLOCK = 2**18
# The two axes that turn about a third, the first to where the second was.
_OTHERS = {"X": (1, 2), "Y": (2, 0), "Z": (0, 1)}


def split_channels(channels):
    """Columns that move joints, and columns that turn them.

    Of each joint come its channels in the order of their columns: ("t" or "r", axis), with the axis
    "X", "Y" or "Z". ``moving`` (3, n) has axis, joint and column of each translation, ``turns`` for
    each joint the axes about which it turns, such as "ZXY", and their columns.
    """
    moving, turns, column = [], [], 0
    for j, joint_channels in enumerate(channels):
        axes, columns = "", []
        for kind, axis in joint_channels:
            if kind == "t":
                moving.append(("XYZ".index(axis), j, column))
            else:
                axes += axis
                columns.append(column)
            column += 1
        turns.append((axes, columns))
    return np.array(moving, dtype=int).reshape(-1, 3).T, turns


def place_joints(parents, turns, values, translations, *, degrees=True, at_rest=None, bones=None):
    """Positions (n_frames, n_joints, 3) of the joints of a tree, each with axes that turn with it.

    Joints turn by ``values`` (n_frames, n_channels), in ``turns`` as `split_channels` returns them,
    each axis turned by those before it. ``translations(values)`` returns, for some frames, the
    translation of each joint along the axes of its parent, (3, n_joints, n_frames), which is
    overwritten. ``at_rest`` (3, 3, n_joints) are the axes of joints before they turn, as columns,
    in those of their parents, by default the same; ``bones`` (3, n_joints) lead from where a joint
    turns to its position, along its axes.
    """
    children = {-1: []}
    for j, parent in enumerate(parents):
        children.setdefault(parent, []).append(j)
    order = children[-1]
    for j in order:
        order += children.get(j, ())
    positions = np.empty((len(values), len(parents), 3))
    step = max(1, min(_FRAMES, _BLOCK // len(parents)))
    for first in range(0, len(values), step):
        block = values[first : first + step]
        angles = np.radians(block.T) if degrees else np.ascontiguousarray(block.T)
        places, axes_of = translations(block), {-1: np.eye(3)[:, :, None]}
        for j in order:
            above = axes_of[parents[j]]
            places[:, j] = rotate(above, places[:, j])
            if parents[j] >= 0:
                places[:, j] += places[:, parents[j]]
            # The rotation of a leaf moves nothing but its bone.
            if j in children or bones is not None:
                axes = np.repeat(above, len(block) // above.shape[2], axis=2)
                if at_rest is not None:
                    axes = rotate(axes[:, :, None], at_rest[:, :, j, None])
                names, columns = turns[j]
                axes_of[j] = turn(axes, names, angles[columns])
            if bones is not None:
                places[:, j] += rotate(axes_of[j], bones[:, j, None])
        positions[first : first + step] = places.transpose(2, 1, 0)
    return positions


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
    return axes
