"""write_motion: recordings and synchronised bodies back into motion files."""

from __future__ import annotations

import re
import warnings
from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from ..body.axes import UP_AXES
from ..body.columns import joint_columns, plain_positions
from ..body.skeleton import Skeleton
from ..inputs.collections import check_members
from ..inputs.columns import parse_columns
from ..inputs.facts import units_of_columns
from ..inputs.numbers import as_numbers, check_finite
from ..inputs.recorded import Recorded, frame_rate_of_rows, times_of_rows
from ..inputs.types import Path, Table, TrialLike
from ..inputs.wording import counted
from ..matching.counting import whole
from ..utils.files import check_path, write_whole
from .motion import check_frame_rate, read_motion

_ENDINGS = (".bvh", ".trc", ".mot", ".sto")
# Digits behind the point, of positions, degrees and seconds.
_DIGITS = 6
# Degrees and radians, and their rates, among units.
_ANGLE = re.compile(r"(deg|rad)(ree|ian)?s?\b", re.IGNORECASE)


def write_motion(
    path: Path,
    X: TrialLike,
    skeleton: Skeleton | None = None,
    *,
    like: Path | Table | None = None,
    frame_rate: float | None = None,
    in_place: bool = False,
) -> None:
    """Write one trial into a motion file: BVH, TRC, or OpenSim's MOT and STO.

    BVH has rotations: a body that was recorded, synchronised, blended or sampled is put on a rig,
    whose bones keep their length. TRC has positions. MOT and STO have any columns.

    Parameters
    ----------
    path : str or path-like
        The file, whose name ends with ``.bvh``, ``.trc``, ``.mot`` or ``.sto``. It is
        replaced once the new one is complete.
    X : array (n_frames, n_features) or DataFrame
        Joint positions, joint by joint x, y, z; for MOT and STO a table of any columns. Its header
        says "inDegrees" if ``X.attrs["units"]`` are degrees or radians, or these a second.
    skeleton : Skeleton, default=None
        Which columns are which joints, for arrays. By default a table tells.
    like : str, path-like or DataFrame, default=None
        BVH only: a file, or a table read from one, whose rig is taken: its joints, offsets at rest,
        channels and their order. Joints that turn about one or two axes turn about all three. X
        must have its joints, but for end sites. By default that of ``X.attrs``, as `read_motion`
        leaves it; without one, the first frame is at rest.
    frame_rate : float, default=None
        Frames a second; by default what the table tells.
    in_place : bool, default=False
        Whether to take the horizontal way of the root out, so that the body stays where it begins.

    Raises
    ------
    ValueError
        If the ending is not known, the frame rate is not known, X has NaN (but for TRC), lacks a
        joint of the rig, or has several roots (for BVH).

    See Also
    --------
    read_motion : Reads such files.

    Notes
    -----
    In a BVH every joint turns as little as it must for its child to lie in its direction; with
    several children, by least squares. Lengths of bones are those of the rig; where the median of X
    differs by more than a thousandth, those of X. Hips that keep their distance, but not that from
    the pelvis, hang on their middle, ``pelvis_middle``. The vertical axis becomes y. A joint that
    has position channels beside the root keeps moving in its parent. The turn of a bone about
    itself shows in positions only as far as it has more than one child.

    Examples
    --------
    >>> from sklearn_motionsync.datasets import make_bending
    >>> from sklearn_motionsync.io import read_motion, write_motion
    >>> bending = make_bending(1, noise=0, random_state=0)
    >>> path = getfixture("tmp_path") / "bend.bvh"
    >>> write_motion(path, bending.data[0], bending.skeleton, frame_rate=30)
    >>> df = read_motion(path)[bending.skeleton.column_names]
    >>> bool(abs(df.to_numpy() - bending.data[0]).max() < 0.02)  # metres
    True
    """
    path = FilePath(check_path(path, "motion.bvh"))
    ending = path.suffix.lower()
    if ending not in _ENDINGS:
        raise ValueError(
            f"{path} ends with {path.suffix!r}, for which there is no writer; the known endings "
            f"are {', '.join(_ENDINGS)}."
        )
    if like is not None and ending != ".bvh":
        raise ValueError(f"like= goes with .bvh files only, got it with {path}.")
    check_frame_rate(frame_rate)
    rate = frame_rate_of_rows(X) if frame_rate is None else frame_rate
    if rate is None:
        raise ValueError(f"{path}: the frame rate is not known: give frame_rate=.")
    times = _written_times(X, rate)
    if ending in (".mot", ".sto"):
        text = _write_storage(X, times, path)
    else:
        joints, parents, points, up = _read_positions(X, skeleton, path)
        _printable(joints, path)
        if in_place:
            way = points[:, [parents.index(-1)]] - points[:1, [parents.index(-1)]]
            way[..., "xyz".index(up[-1])] = 0
            points = points - way
        if ending == ".trc":
            text = _write_trc(joints, points, rate, times, X, path)
        else:
            text = _write_bvh(joints, parents, points, up, rate, _rig_like(like, X, path), path)
    write_whole(path, text)


def _read_positions(X, skeleton, path):
    """Joints, parents, positions (n_frames, n_joints, 3), and the vertical axis."""
    if skeleton is not None:
        names, parents, up = list(skeleton.joints), skeleton.parents, skeleton.up
        X = plain_positions(X, skeleton)
    elif not isinstance(X, pd.DataFrame):
        raise ValueError(f"{path}: an array does not name its joints: give a skeleton.")
    else:
        columns = joint_columns(X)
        names = columns.joints
        is_known = list(X.attrs.get("joints") or ()) == names
        parents = X.attrs["parents"] if is_known else Skeleton.from_frame(X).parents
        up = X.attrs.get("up") or "y"
        X = X.iloc[:, columns.places.ravel()]
    # A single frame is no trial, but a pose that a file may hold: it is checked as two.
    is_pose = isinstance(X, (np.ndarray, pd.DataFrame)) and len(X) == 1
    (x,) = check_members([np.repeat(X, 2, axis=0) if is_pose else X], finite="allow-nan")
    x = x[:1] if is_pose else x
    if x.shape[1] != 3 * len(names):
        raise ValueError(
            f"{path}: X has {counted(x.shape[1], 'column')}, and "
            f"{counted(len(names), 'joint')} need {3 * len(names)}."
        )
    points = x.astype(np.float64).reshape(len(x), -1, 3)
    return names, list(parents), points, up


# -- BVH ---------------------------------------------------------------------------------


def _rig_like(like, X, path):
    """The rig of a file, of a table, or of X; None without any."""
    table = X if like is None else like
    table = table if isinstance(table, pd.DataFrame) or like is None else read_motion(like)
    attrs = getattr(table, "attrs", {})
    rig = attrs.get("rig")
    if like is not None and rig is None:
        raise ValueError(f"{path}: like= has no rig: give a BVH file, or a table read from one.")
    if rig is None or (like is None and attrs["joints"] != parse_columns(X.columns).joints):
        return None
    # A joint that turns turns about all axes: its children need not lie where a hinge leads.
    turns = [f"{axis}rotation" for axis in "ZXY"]
    channels = [
        [*names, *(turn for turn in turns if turn not in names)] if {*turns} & {*names} else names
        for names in rig["channels"]
    ]
    return Rig(attrs["joints"], attrs["parents"], rig["offsets"], channels)


def _write_bvh(joints, parents, points, up, rate, rig, path):
    points = np.stack([s * points[..., a] for a, s in UP_AXES[3][up]], axis=-1)
    if rig is None:
        joints, parents, points = add_middles(joints, parents, points)
        rig = make_rig(joints, parents, points)
    if rig.parents.count(-1) != 1:
        raise ValueError(
            f"{path}: a BVH file has one root, got {rig.parents.count(-1)}: give a skeleton with "
            "parents, or write a .trc file."
        )
    named = {*joints, *(f"{joint}_pivot" for joint in joints)}
    missing = [name for j, name in enumerate(rig.joints) if name not in named and not rig.is_end(j)]
    if missing:
        raise ValueError(
            f"{path}: X lacks the joints {missing[:6]} of the rig; it has {joints[:40]}."
        )
    places = [joints.index(name) if name in joints else None for name in rig.joints]
    ordered = np.stack(
        [np.full_like(points[:, 0], np.nan) if k is None else points[:, k] for k in places], axis=1
    )
    for name, k in zip(rig.joints, places, strict=True):
        if k is not None and np.isnan(points[:, k]).any():
            frame = int(np.isnan(points[:, k]).any(axis=1).argmax())
            raise ValueError(
                f"{path}: joint {name!r} is NaN in frame {frame}. Fill gaps first: io.fill_gaps."
            )
    values, offsets = solve_rig(rig, ordered)
    lines = ["HIERARCHY", *_hierarchy(rig, offsets, 0, 0)]
    lines += ["MOTION", f"Frames: {len(values)}", f"Frame Time: {1 / rate:.10g}"]
    lines += [" ".join(f"{v:.{_DIGITS}f}" for v in row) for row in values]
    return "\n".join(lines) + "\n"


def _hierarchy(rig, offsets, j, depth):
    """Lines of a joint and of what is below it."""
    pad, kind = "  " * depth, "ROOT" if rig.parents[j] < 0 else "JOINT"
    head = "End Site" if rig.is_end(j) else f"{kind} {rig.joints[j]}"
    lines = [f"{pad}{head}", f"{pad}{{"]
    # Where the root is, is in its channels.
    lines.append(f"{pad}  OFFSET " + " ".join(f"{v:.{_DIGITS}f}" for v in offsets[j]))
    if not rig.is_end(j):
        channels = rig.channels[j]
        lines.append(" ".join([f"{pad}  CHANNELS {len(channels)}", *channels]))
    for k, parent in enumerate(rig.parents):
        if parent == j:
            lines += _hierarchy(rig, offsets, k, depth + 1)
    return [*lines, f"{pad}}}"]


# -- TRC, MOT and STO --------------------------------------------------------------------


def _write_trc(joints, points, rate, times, X, path):
    attrs = Recorded(X).attrs_of(np.arange(len(X))) if isinstance(X, pd.DataFrame) else {}
    units = attrs.get("units") if isinstance(attrs.get("units"), str) else "m"
    n_frames, first = len(points), attrs.get("first_frame") or 1
    keys = "DataRate CameraRate NumFrames NumMarkers Units OrigDataRate OrigDataStartFrame"
    values = [f"{rate:.9g}"] * 2 + [n_frames, len(joints), units, f"{rate:.9g}", first, n_frames]
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "\t".join([*keys.split(), "OrigNumFrames"]),
        "\t".join(map(str, values)),
        "Frame#\tTime\t" + "\t\t\t".join(joints) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{j + 1}" for j in range(len(joints)) for axis in "XYZ"),
        "",
    ]
    for k, (time, row) in enumerate(zip(times, points.reshape(n_frames, -1), strict=True)):
        numbers = ["" if np.isnan(v) else f"{v:.{_DIGITS}f}" for v in row]
        lines.append("\t".join([str(first + k), time, *numbers]))
    return "\n".join(lines) + "\n"


def _write_storage(X, times, path):
    if not isinstance(X, pd.DataFrame):
        raise ValueError(f"{path}: give a DataFrame, whose columns have names.")
    values = as_numbers(X, f"{path}: X", dtype=np.float64)
    check_finite(values, f"{path}: frame", [str(name) for name in X.columns], allow_nan=True)
    angles = {
        kind[1].lower(): name
        for name, unit in units_of_columns(X).items()
        if (kind := _ANGLE.match(unit.replace("°", "deg")))
    }
    if len(angles) > 1:
        raise ValueError(
            f"{path}: {angles['deg']!r} is in degrees and {angles['rad']!r} in radians; a file has "
            "one of them. Convert, and set X.attrs['units']."
        )
    lines = [re.sub(r"[\s=]+", "_", path.stem), "version=1", f"nRows={len(X)}"]
    lines += [f"nColumns={1 + X.shape[1]}"]
    # Without angles nothing is said of them.
    lines += [f"inDegrees={'yes' if kind == 'deg' else 'no'}" for kind in angles]
    lines += ["endheader", "\t".join(["time", *_printable(X.columns, path)])]
    for time, row in zip(times, values, strict=True):
        lines.append("\t".join([time, *(f"{v:.8g}" for v in row)]))
    return "\n".join(lines) + "\n"


def _written_times(X, rate):
    """The times of rows as text, of which those of a high rate have more digits."""
    digits = _DIGITS + max(0, whole(np.log10(rate), "up"))
    return [f"{time:.{digits}f}" for time in times_of_rows(X, np.arange(len(X)), rate)]


def _printable(names, path):
    """Names as text; those with what ends a name, such as a tab, are refused."""
    names, ends = list(map(str, names)), r"[\t-\r]" + "|[{}]" * (path.suffix.lower() == ".bvh")
    for name in names:
        if not name.strip() or re.search(ends, name):
            raise ValueError(f"{path}: such a file cannot have the name {name!r}: rename it.")
    return names


# -- rigs ------------------------------------------------------------------------------------------

# Bones of a body whose median lengths differ from those of the rig by more than this share are as
# long as in the body.
_SAME_LENGTH = 1e-3
# Shorter than this share of the longest bone, an offset has no direction.
_NO_LENGTH = 1e-6


class Rig(NamedTuple):
    """A tree of joints at rest, y up, with offsets from parents, which come before their children.

    Channels are such as ``["Xposition", ..., "Zrotation", ...]``, of each joint; none of an end
    site.
    """

    joints: list
    parents: list
    offsets: list
    channels: list

    def free_axes(self, j):
        """Whether a joint moves along x, y and z in its parent."""
        return [f"{axis}position" in self.channels[j] for axis in "XYZ"]

    def turns(self, j):
        """The axes about which a joint turns, in the order of its channels."""
        return "".join(name[0] for name in self.channels[j] if name.endswith("rotation"))

    def is_end(self, j):
        """Whether a joint is an end site, which neither turns nor moves."""
        return not self.channels[j] and j not in self.parents


def add_middles(joints, parents, points):
    """A body with a joint in the middle of two that keep their distance, but not from the parent.

    So are hips that were moved from the pelvis by one height, whatever way it turns. The middle,
    ``<parent>_middle``, keeps its distance from the parent, and both joints that from the middle.
    Points are (n_frames, n_joints, 3); more joints stand at the end.
    """
    joints, parents = list(joints), list(parents)

    def varies(start, end):
        lengths = np.linalg.norm(end - start, axis=1)
        return np.ptp(lengths) > _SAME_LENGTH * lengths.max()

    for parent in range(len(joints)):
        children = [j for j, above in enumerate(parents) if above == parent]
        at = points[:, parent]
        loose = [j for j in children if varies(at, points[:, j])]
        if len(loose) == 2:
            pair = points[:, loose]
            middle = pair.mean(axis=1)
            if not varies(*pair.swapaxes(0, 1)) and not varies(at, middle):
                for j in loose:
                    parents[j] = len(joints)
                joints.append(f"{joints[parent]}_middle")
                parents.append(parent)
                points = np.concatenate([points, middle[:, np.newaxis]], axis=1)
    return joints, parents, points


def make_rig(joints, parents, points):
    """A rig of a body that has none: at rest it is as in its first frame.

    Points are (n_frames, n_joints, 3). Children of one joint turn by themselves: each hangs on a
    joint of its own in the same place, ``<child>_pivot``.
    """
    turns = ["Zrotation", "Xrotation", "Yrotation"]
    moves = ["Xposition", "Yposition", "Zposition"]
    rig = Rig([], [], [], [])

    def add(name, parent, offset, channels):
        for values, value in zip(rig, (name, parent, offset, channels), strict=True):
            values.append(value)
        return len(rig.joints) - 1

    def hang(j, above):
        offset = points[0, j] - (points[0, parents[j]] if above >= 0 else 0)
        if above >= 0 and parents.count(parents[j]) > 1:
            above = add(f"{joints[j]}_pivot", above, [0.0] * 3, turns)
        above = add(joints[j], above, offset.tolist(), turns if above >= 0 else moves + turns)
        for child in np.flatnonzero(np.equal(parents, j)).tolist():
            hang(child, above)

    for root in np.flatnonzero(np.less(parents, 0)).tolist():
        hang(root, -1)
    return rig


def solve_rig(rig, points):
    """The channels (n_frames, n_channels) of a rig at positions, in their unit and in degrees.

    Every joint turns as far as it must for its children to lie in their directions, by least
    squares where there are several. Bones keep their length: that of the rig, or the median of the
    positions if it differs. The offsets (n_joints, 3) with these lengths are returned, too. The
    positions (n_frames, n_joints, 3) are y up, and NaN of an end site that is not known.
    """
    n_frames, n_joints = points.shape[:2]
    offsets = _fit_lengths(rig, points)
    seen, axes = ~np.isnan(points).any(axis=(0, 2)), [None] * n_joints
    placed, columns = np.empty_like(points), []
    for j, parent in enumerate(rig.parents):
        above = axes[parent] if parent >= 0 else np.broadcast_to(np.eye(3), (n_frames, 3, 3))
        start = placed[:, parent] if parent >= 0 else 0
        moved, free = np.tile(offsets[j], (n_frames, 1)), rig.free_axes(j)
        if any(free):
            moved[:, free] = np.einsum("tba,tb->ta", above, points[:, j] - start)[:, free]
        placed[:, j] = start + np.einsum("tab,tb->ta", above, moved)
        order, angles = rig.turns(j), np.zeros((n_frames, len(rig.turns(j))))
        held = [(k, place) for k, place in _held_by(rig, offsets, j) if seen[k]]
        if held and order:
            at_rest = np.array([place for _, place in held])
            ways = points[:, [k for k, _ in held]] - placed[:, j, np.newaxis]
            ways = np.einsum("tba,tkb->tka", above, ways)
            with warnings.catch_warnings():
                # Where two axes coincide either angle will do.
                warnings.simplefilter("ignore", UserWarning)
                angles = Rotation.from_matrix(_rotation(at_rest, ways)).as_euler(order)
            # Without jumps.
            angles = np.degrees(np.unwrap(angles, axis=0))
        axes[j] = above @ _turn(order, angles)
        values = {f"{axis}rotation": angle for axis, angle in zip(order, angles.T, strict=True)}
        values |= dict(zip(("Xposition", "Yposition", "Zposition"), moved.T, strict=True))
        columns += [values[name] for name in rig.channels[j]]
    return np.stack(columns, axis=1), offsets


def _held_by(rig, offsets, j):
    """Joints that turn with a joint as one body, and where they are at rest from it."""
    held, stack = [], [(j, np.zeros(3))]
    sizes = np.linalg.norm(offsets, axis=1)
    while stack:
        above, at = stack.pop()
        for k, parent in enumerate(rig.parents):
            if parent == above and not any(rig.free_axes(k)):
                place = at + offsets[k]
                if np.linalg.norm(place) > _NO_LENGTH * sizes.max():
                    held.append((k, place))
                if not rig.turns(k):
                    stack.append((k, place))
    return held


def _fit_lengths(rig, points):
    """The offsets, with the median lengths of bones where those of the rig differ."""
    offsets = np.array(rig.offsets, dtype=np.float64)
    for j, parent in enumerate(rig.parents):
        length = np.linalg.norm(offsets[j])
        # A pivot is where its parent is.
        while parent >= 0 and np.isnan(points[:, parent]).any():
            parent = rig.parents[parent]
        if parent < 0 or length == 0 or any(rig.free_axes(j)) or np.isnan(points[:, j]).any():
            continue
        measured = float(np.median(np.linalg.norm(points[:, j] - points[:, parent], axis=1)))
        if abs(measured - length) > _SAME_LENGTH * length:
            offsets[j] *= measured / length
    return offsets


def _rotation(rest, ways):
    """Rotations (n_frames, 3, 3) of vectors (n, 3) towards others (n_frames, n, 3)."""
    along = ways / np.maximum(np.linalg.norm(ways, axis=2, keepdims=True), 1e-300)
    unit = rest / np.linalg.norm(rest, axis=1, keepdims=True)
    weights = np.linalg.norm(rest, axis=1)
    # Vectors on one line leave the turn about it open: then the smallest rotation is taken.
    if np.linalg.matrix_rank(unit, tol=1e-4) == 1:
        start, ends = unit[weights.argmax()], along[:, weights.argmax()]
        axis, real = np.cross(start, ends), 1 + ends @ start
        # Opposite vectors turn about any normal.
        axis[real < 1e-12] = np.cross(start, np.eye(3)[np.abs(start).argmin()])
        return Rotation.from_quat(np.column_stack([axis, real])).as_matrix()
    product = np.einsum("tka,kb->tab", along * weights[:, np.newaxis], unit)
    u, _, vt = np.linalg.svd(product)
    sign = np.sign(np.linalg.det(u @ vt))
    u = u * np.stack([np.ones_like(sign), np.ones_like(sign), sign], axis=1)[:, np.newaxis]
    return u @ vt


def _turn(order, angles):
    """Rotations (n, 3, 3) by degrees (n, n_axes), each axis turned by those before it."""
    if not order:
        return np.broadcast_to(np.eye(3), (len(angles), 3, 3))
    return Rotation.from_euler(order, angles, degrees=True).as_matrix().reshape(-1, 3, 3)
