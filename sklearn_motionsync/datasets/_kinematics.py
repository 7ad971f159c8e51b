"""What the readers of motion files share: words and numbers of a text, and forward kinematics."""

import array
import io
import math

import numpy as np

from ._guard import check_growth

# Joints times frames whose rotations are held at once.
_BLOCK = 2**17


class MotionText:
    """The words of a text file, one by one or line by line, and where they stand.

    Words are bytes: old files hold any encoding in their comments.
    """

    def __init__(self, path):
        data = path.read_bytes().removeprefix(b"\xef\xbb\xbf")
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        self.path = path
        self.size = len(data)
        self.line_number = 0
        self.is_whole = True  # the line read last has an end
        self._lines = io.BytesIO(data)
        self._words = []  # those left of this line, the last first

    @property
    def n_left(self):
        """Bytes after the line read last."""
        return self.size - self._lines.tell()

    def row(self):
        """The next line that has words, as it is; empty at the end."""
        while line := self._lines.readline():
            self.line_number += 1
            if line.strip():
                self.is_whole = line.endswith(b"\n")
                return line.removesuffix(b"\n")
        return b""

    def line(self):
        """The words of the next line that has any, or what is left of this one; [] at the end."""
        words, self._words = self._words[::-1], []
        return words or self.row().split()

    def lines(self):
        """All lines that are left."""
        while words := self.line():
            yield words

    def word(self, expected):
        """The next word; a brace is always a word of its own."""
        if not self._words:
            line = b" ".join(self.line())
            self._words = line.replace(b"{", b" { ").replace(b"}", b" } ").split()[::-1]
        if not self._words:
            raise self.error(f"the file ends where {expected} should follow; it is not complete.")
        return self._words.pop()

    def numbers(self, words, n, what):
        """`n` finite numbers."""
        if len(words) != n:
            raise self.error(f"{what} needs {n} numbers, got {len(words)} ({show(words)}).")
        try:
            numbers = array.array("d", map(float, words))
        except ValueError:
            numbers = array.array("d", [math.nan])
        # Python reads 1_0 as a number, files do not mean it.
        if not all(map(math.isfinite, numbers)) or b"_" in b"".join(words):
            bad = next(word for word in words if not _is_number(word))
            raise self.error(f"{what} needs finite numbers, got {show([bad])}.")
        return numbers

    def error(self, message):
        return ValueError(f"{self.path}, line {self.line_number}: {message}")


def _is_number(word):
    try:
        return math.isfinite(float(word)) and b"_" not in word
    except ValueError:
        return False


def show(words):
    """Words as an error message quotes them, never more than a line."""
    text = decode(b" ".join(words[:8])[:61])
    return repr(text if len(text) <= 60 else text[:60] + "...")


def decode(name):
    """The text of a name: UTF-8, or ISO-8859-1 if it is not."""
    try:
        return name.decode("utf-8")
    except UnicodeDecodeError:
        return name.decode("latin-1")


def unique(names):
    """The names, with ``_2``, ``_3``, ... behind those that came before."""
    taken, last = set(names), {}
    result = []
    for name in names:
        new = name
        if name in last:
            # Counting on from the last number keeps this linear.
            while new in taken:
                last[name] += 1
                new = f"{name}_{last[name]}"
            taken.add(new)
        else:
            last[name] = 1
        result.append(new)
    return result


def check_positions(path, size, n_frames, n_joints):
    """Refuse positions out of all proportion to the file, before they are made."""
    check_growth(path, size, n_frames * n_joints * 24, f"{n_frames} frames of {n_joints} joints")


def rotations(values, groups, n_joints, degrees):
    """Rotation matrices (n_joints, n_frames, 3, 3), of angles (n_frames, n_values).

    `groups` maps an order of axes, as SciPy writes it, to a list of (joint, columns).
    Joints in no group do not turn.
    """
    from scipy.spatial.transform import Rotation

    matrices = np.zeros((n_joints, len(values), 3, 3))
    matrices[..., range(3), range(3)] = 1
    for order, members in groups.items():
        joints, columns = map(np.array, zip(*members, strict=True))
        angles = values[:, columns].swapaxes(0, 1).reshape(-1, len(order))
        turned = Rotation.from_euler(order, angles, degrees=degrees).as_matrix()
        matrices[joints] = turned.reshape(len(joints), len(values), 3, 3)
    return matrices


def joint_positions(path, parents, values, transforms):
    """Positions (n_frames, n_joints, 3) of a tree of joints.

    ``transforms(values)`` gives the translations (n_joints, n_frames, 3) and rotations
    (n_joints, n_frames, 3, 3) of joints in their parents, for some frames' values.
    """
    parents = np.asarray(parents)
    positions = np.empty((len(values), len(parents), 3))
    step = max(1, _BLOCK // len(parents))
    with np.errstate(over="ignore", invalid="ignore"):
        for first in range(0, len(values), step):
            placed = _place(parents, *transforms(values[first : first + step]))
            positions[first : first + step] = placed.swapaxes(0, 1)
    if not np.isfinite(positions).all():
        frame, joint = np.argwhere(~np.isfinite(positions))[0, :2]
        raise ValueError(
            f"{path}: joint {joint} is infinitely far away in frame {frame}; offsets, lengths or "
            "translations in the file are too large to be true."
        )
    return positions


def _place(parents, translations, rotations):
    """Translations in the world; both arrays are overwritten.

    Each joint is known relative to an ancestor, its parent at first. Every pass replaces
    the ancestor by the ancestor's own, so the number of passes is the logarithm of the
    depth: a chain of many thousand joints costs no more than a bush.
    """
    ancestor = parents.copy()
    while (joints := np.flatnonzero(ancestor >= 0)).size:
        above = ancestor[joints]
        turn = rotations[above]
        moved = (turn @ translations[joints][..., None])[..., 0] + translations[above]
        rotations[joints] = turn @ rotations[joints]
        translations[joints] = moved
        ancestor[joints] = ancestor[above]
    return translations
