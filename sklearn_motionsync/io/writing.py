"""write_motion: recordings and synchronised bodies back into motion files."""

from __future__ import annotations

from pathlib import Path as FilePath

import numpy as np
import pandas as pd

from ..body.axes import UP_AXES
from ..body.skeleton import Skeleton
from ..inputs.collections import check_members
from ..inputs.facts import units_of_columns
from ..inputs.numbers import as_numbers, check_finite
from ..inputs.recorded import frame_rate_of_rows, start_of_rows
from ..inputs.types import Path, PerformanceLike, Table
from ..inputs.wording import counted
from .motion import read_motion
from .rig import Rig, add_middles, make_rig, solve_rig
from .timestamps import check_frame_rate

__all__ = ["write_motion"]

_ENDINGS = (".bvh", ".trc", ".mot", ".sto")
# Digits behind the point, of positions and degrees.
_DIGITS = 6


def write_motion(
    path: Path,
    X: PerformanceLike,
    skeleton: Skeleton | None = None,
    *,
    like: Path | Table | None = None,
    frame_rate: float | None = None,
    in_place: bool = False,
) -> None:
    """Write one performance into a motion file: BVH, TRC, or OpenSim's MOT and STO.

    BVH has rotations: a body that was recorded, synchronised, blended or sampled is put on a rig,
    whose bones keep their length. TRC has positions. MOT and STO have any columns.

    Parameters
    ----------
    path : str or path-like
        The file, whose name ends with ``.bvh``, ``.trc``, ``.mot`` or ``.sto``. It is replaced.
    X : array (n_frames, n_features) or DataFrame
        Joint positions, joint by joint x, y, z; for MOT and STO a table of any columns.
    skeleton : Skeleton, default=None
        Which columns are which joints, for arrays. By default a table tells.
    like : str, path-like or DataFrame, default=None
        BVH only: a file, or a table read from one, whose rig is taken: its joints, offsets at rest,
        channels and their order. X must have its joints, but for end sites. By default that of
        ``X.attrs``, as `read_motion` leaves it; without one, the first frame is at rest.
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
    path = FilePath(path)
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
    start = start_of_rows(X)
    if ending in (".mot", ".sto"):
        text = _write_storage(X, rate, start, path)
    else:
        joints, parents, points, up = _read_positions(X, skeleton, path)
        if in_place:
            points = _in_place(points, parents, up)
        if ending == ".trc":
            text = _write_trc(joints, points, rate, start, getattr(X, "attrs", {}), path)
        else:
            text = _write_bvh(joints, parents, points, up, rate, _rig_like(like, X, path), path)
    path.write_text(text, encoding="utf-8", newline="\n")


def _read_positions(X, skeleton, path):
    """Joints, parents, positions (n_frames, n_joints, 3), and the vertical axis."""
    # A single frame is no performance, but a pose that a file may hold: it is checked as two.
    is_pose = isinstance(X, (np.ndarray, pd.DataFrame)) and len(X) == 1
    (x,) = check_members([np.repeat(X, 2, axis=0) if is_pose else X], finite="allow-nan")
    x = x[:1] if is_pose else x
    if skeleton is None:
        if not isinstance(X, pd.DataFrame):
            raise ValueError(f"{path}: an array does not name its joints: give a skeleton.")
        names = [str(name)[:-2] for name in X.columns[::3]]
        expected = [f"{name}_{axis}" for name in names for axis in "xyz"]
        if [str(name) for name in X.columns] != expected:
            raise ValueError(
                f"{path}: columns must be <joint>_x, <joint>_y, <joint>_z, joint by joint; got "
                f"{[str(name) for name in X.columns][:6]}."
            )
        joints, parents, up = (
            X.attrs.get("joints"),
            X.attrs.get("parents"),
            X.attrs.get("up") or "y",
        )
        same = joints is not None and list(joints) == names
        parents = list(parents) if same else Skeleton.from_frame(X).parents
    else:
        names, parents, up = list(skeleton.joints), skeleton.parents, skeleton.up
    if x.shape[1] != 3 * len(names):
        raise ValueError(
            f"{path}: X has {counted(x.shape[1], 'column')}, and "
            f"{counted(len(names), 'joint')} need {3 * len(names)}."
        )
    points = x.astype(np.float64).reshape(len(x), -1, 3)
    return names, list(parents), points, up


def _in_place(points, parents, up):
    """Positions without the horizontal way of the first root."""
    way = points[:, [parents.index(-1)]] - points[:1, [parents.index(-1)]]
    way[..., "xyz".index(up[-1])] = 0
    return points - way


# -- BVH ---------------------------------------------------------------------------------


def _rig_like(like, X, path):
    """The rig of a file, of a table, or of X; None without any."""
    if like is None:
        attrs = getattr(X, "attrs", {})
        joints = attrs.get("joints")
        names = [str(name)[:-2] for name in getattr(X, "columns", ())[::3]]
        return Rig.from_attrs(attrs) if joints == names else None
    table = like if isinstance(like, pd.DataFrame) else read_motion(like)
    rig = Rig.from_attrs(table.attrs)
    if rig is None:
        raise ValueError(f"{path}: like= has no rig: give a BVH file, or a table read from one.")
    return rig


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


def _write_trc(joints, points, rate, start, attrs, path):
    units = attrs.get("units") if isinstance(attrs.get("units"), str) else "m"
    n_frames, first = len(points), attrs.get("first_frame") or 1
    keys = "DataRate CameraRate NumFrames NumMarkers Units OrigDataRate OrigDataStartFrame"
    values = [f"{rate:g}"] * 2 + [n_frames, len(joints), units, f"{rate:g}", first, n_frames]
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "\t".join([*keys.split(), "OrigNumFrames"]),
        "\t".join(map(str, values)),
        "Frame#\tTime\t" + "\t\t\t".join(joints) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{j + 1}" for j in range(len(joints)) for axis in "XYZ"),
        "",
    ]
    for k, row in enumerate(points.reshape(n_frames, -1)):
        numbers = ["" if np.isnan(v) else f"{v:.{_DIGITS}f}" for v in row]
        lines.append("\t".join([str(first + k), f"{start + k / rate:.6f}", *numbers]))
    return "\n".join(lines) + "\n"


def _write_storage(X, rate, start, path):
    if not isinstance(X, pd.DataFrame):
        raise ValueError(f"{path}: give a DataFrame, whose columns have names.")
    values = as_numbers(X, f"{path}: X", dtype=np.float64)
    check_finite(values, f"{path}: frame", [str(name) for name in X.columns], allow_nan=True)
    units = units_of_columns(X)
    angles = {unit: name for name, unit in units.items() if unit in ("deg", "rad")}
    if len(angles) > 1:
        raise ValueError(
            f"{path}: {angles['deg']!r} is in degrees and {angles['rad']!r} in radians; a file has "
            "one of them. Convert, and set X.attrs['units']."
        )
    in_degrees = "no" if "rad" in angles else "yes"
    lines = [path.stem, "version=1", f"nRows={len(X)}", f"nColumns={1 + X.shape[1]}"]
    lines += [f"inDegrees={in_degrees}", "endheader", "\t".join(["time", *map(str, X.columns)])]
    times = start + np.arange(len(X)) / rate
    for time, row in zip(times, values, strict=True):
        lines.append("\t".join([f"{time:.6f}", *(f"{v:.8g}" for v in row)]))
    return "\n".join(lines) + "\n"
