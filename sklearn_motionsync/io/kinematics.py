"""Forward kinematics: where the joints of a tree are, from how each moves in its parent."""

import itertools

import numpy as np

from .guard import check_growth

# Joints times frames of a level that are placed at once, in the mean: enough for NumPy's calls not
# to count, and few enough for the processor's cache. And those of all levels, for memory's sake.
_LEVEL = 2**12
_BLOCK = 2**20
# The two axes that turn about a third, the first to where the second was.
_OTHERS = {"X": (1, 2), "Y": (2, 0), "Z": (0, 1)}


def check_positions(path, size, n_frames, n_joints):
    """Refuse positions out of all proportion to the file, before they are made."""
    check_growth(path, size, n_frames * n_joints * 24, f"{n_frames} frames of {n_joints} joints")


class Tree:
    """A tree of joints, each with axes of its own that turn with it.

    Parameters
    ----------
    parents : list of int
        The parent of each joint, -1 for roots.
    turning : dict of str to list of (int, list of int)
        The axes about which joints turn, such as "ZXY", each turned by those before it; and the
        joints that do, each with the columns of its angles. Others do not turn.
    degrees : bool
        Whether angles are degrees.
    at_rest : array (3, 3, n_joints), default=None
        Each joint's axes before it turns, as columns, in those of its parent; by default the same.
    bones : array (3, n_joints), default=None
        From where a joint turns to where it is said to be, along its axes; by default nothing.
    """

    def __init__(self, parents, turning, degrees=True, at_rest=None, bones=None):
        self._n_joints = len(parents)
        self._degrees, self._at_rest, self._bones = degrees, at_rest, bones
        self._levels = _levels(parents, turning, leaves_turn=bones is not None)

    def positions(self, path, values, translations):
        """Positions (n_frames, n_joints, 3) for values (n_frames, n_values).

        ``translations(values)`` gives, for some frames, what lies between a joint and its parent
        along the axes of the parent, (3, n_joints, n_frames); it is overwritten.
        """
        positions = np.empty((len(values), self._n_joints, 3))
        step = max(1, min(_LEVEL * len(self._levels), _BLOCK) // self._n_joints)
        with np.errstate(over="ignore", invalid="ignore"):
            for first in range(0, len(values), step):
                some = values[first : first + step]
                placed = self._place(some, translations(some))
                positions[first : first + step] = placed.transpose(2, 1, 0)
        if not np.isfinite(positions).all():
            frame, joint = np.argwhere(~np.isfinite(positions))[0, :2]
            raise ValueError(
                f"{path}: joint {joint} is infinitely far away in frame {frame}; offsets, lengths "
                "or translations in the file are too large to be true."
            )
        return positions

    def _place(self, values, places):
        """Translations in parents become places in the world, level by level."""
        angles = np.ascontiguousarray(values.T)
        if self._degrees:
            angles = np.radians(angles)
        # Those of the level above are all that a level needs; above the roots is the world.
        axes = np.broadcast_to(np.eye(3)[:, :, None, None], (3, 3, 1, len(values)))
        for joints, parents, above, turns in self._levels:
            axes = axes[:, :, above]
            moved = along(axes, places[:, joints])
            places[:, joints] = moved if parents is None else moved + places[:, parents]
            if self._at_rest is not None:
                axes = along(axes[:, :, None], self._at_rest[:, :, joints, None])
            for names, part, columns in turns:
                turn(axes[:, :, part], names, angles[columns])
            if self._bones is not None:
                places[:, joints] += along(axes, self._bones[:, joints, None])
        return places


def _levels(parents, turning, leaves_turn):
    """Joints with equally many ancestors, which are placed at once.

    For each level its joints, their parents (None above the roots), these in the level above, and
    for each order of axes the joints that turn so, as a part of the level, and their columns.
    """
    children = {}
    for j, parent in enumerate(parents):
        children.setdefault(parent, []).append(j)
    # Nothing hangs on a leaf, so nobody sees it turn.
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


def along(axes, vectors):
    """Vectors (3, ...) that are told along axes (3, 3, ...), whose second index tells which."""
    return axes[:, 0] * vectors[0] + axes[:, 1] * vectors[1] + axes[:, 2] * vectors[2]


def turn(axes, names, angles):
    """Turn axes (3, 3, ...) about some of themselves, as they are then, by angles (n, ...)."""
    for name, c, s in zip(names, np.cos(angles), np.sin(angles), strict=True):
        i, j = _OTHERS[name]
        first, second = axes[:, i], axes[:, j]
        axes[:, i], axes[:, j] = c * first + s * second, c * second - s * first
