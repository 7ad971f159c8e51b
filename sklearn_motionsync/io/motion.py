"""Files of motion capture: `read_motion`, and the registry of the readers of all formats."""

from __future__ import annotations

import inspect
import os
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path as FilePath
from typing import Any, Literal

import pandas as pd

from ..inputs.numbers import listed
from ..inputs.tables import FRAME
from ..inputs.types import Path
from ..inputs.wording import counted
from .acclaim import read_acclaim
from .bvh import read_bvh
from .c3d import MissingGroup, read_c3d
from .gaps import check_ends, check_max_gap, fill_gaps, warn_of_gaps, warn_of_missing
from .text import read_storage
from .timestamps import check_frame_rate, describe_times, warn_of_other_rate
from .trc import read_trc

# The readers, by the ending of the file's name in small letters. A format is one function and one
# entry for each of its endings.
#
# A reader gets the path of a file that exists (a `pathlib.Path`), and as keyword parameters those
# options of `read_motion` that only some formats have (``asf``, ``group``) and that were given.
# It returns a dict with
#
# - ``positions``, floats (n_frames, n_joints, 3), NaN where a joint was not seen, with ``joints``
#   (unique names) and ``parents`` (indices, -1 for a root); or ``values``, floats (n_frames,
#   n_channels), with ``channels`` (unique names);
# - ``frame_rate`` (frames per second or None), ``units`` (str, list of str or None), ``up`` ("x",
#   "y", "z", "-x", ... or None) and ``kind`` (what was measured, such as "markers");
# - for formats with a time in each row ``times`` (seconds, not decreasing) and ``decimals`` (how
#   many they were written with); ``frame_rate`` is then the rate that the header states;
# - whatever else goes into ``attrs``, as plain Python types.
#
# A file that is damaged or not complete is a ValueError that begins with its path.
READERS: dict[str, Callable[..., dict]] = {
    ".bvh": read_bvh,
    ".amc": read_acclaim,
    ".c3d": read_c3d,
    ".trc": read_trc,
    ".mot": read_storage,
    ".sto": read_storage,
}


def read_motion(
    path: Path | Iterable[Path],
    *,
    asf: Path | None = None,
    frame_rate: float | None = None,
    max_gap: int = 0,
    ends: Literal["keep", "trim"] = "keep",
    group: str | None = None,
    columns: Literal["common"] | None = None,
) -> Any:
    """Read recordings from files of motion capture (BVH, AMC, C3D, TRC, MOT or STO).

    Parameters
    ----------
    path : str, path-like, or iterable of them
        A file whose name ends with ``.bvh``, ``.amc``, ``.c3d``, ``.trc``, ``.mot`` or ``.sto``, in
        any case; or several, such as ``sorted(folder.glob("*.c3d"))``.
    asf : str or path-like, default=None
        The skeleton of an AMC file. By default the ``.asf`` file in the same folder with the
        longest name that the AMC file's begins with (``02.asf`` for ``02_01.amc``), or the only
        one there.
    frame_rate : float, default=None
        Frames per second. By default what the file says; AMC files mostly do not.
    max_gap : int, default=0
        The longest gap to interpolate, in frames, for joints and markers; see `fill_gaps`. By
        default none is.
    ends : {"keep", "trim"}, default="keep"
        "trim" leaves out the frames before the first and after the last one in which all joints or
        markers are seen; see `fill_gaps`. Other groups of the file are longer then.
    group : str, default=None
        The group of a C3D file to read: by default its "markers"; "angles", "forces", "moments",
        "powers", "scalars" or "reactions", if the file says that some of its points are these;
        "analog" for the analog channels recorded at the same time. ``attrs["groups"]`` lists
        the groups of a file. Of several files those that have no such group are left out.
    columns : {None, "common"}, default=None
        Of several files: "common" leaves out the columns that some of them lack, such as other
        markers, and brings the others into the order of the first. By default all stay. The joints
        and parents in ``attrs`` are those of the file in any case.

    Returns
    -------
    DataFrame (n_frames, 3 * n_joints), or list of DataFrame
        Of several files a list. Float64 columns ``<joint>_x``, ``<joint>_y``, ``<joint>_z``, joint
        by joint, and an index named "frame", from 0. Repeated names end with ``_2``, ``_3`` and so
        on. A joint of a BVH file is the centre of its rotation, and ``<parent>_end`` an End Site; a
        joint of an AMC file is the far end of the bone of that name. A marker that was not seen is
        NaN: in a C3D file it is marked so, or at exactly (0, 0, 0) and without a camera; in a TRC
        file it is blank, no number, or 0. The group "analog" has a column for each channel, in its
        unit, and a row for each sample; a MOT or STO file a column for each of its own but the time
        (vectors ``_x``, ``_y``, ``_z``, quaternions ``_w``, ``_x``, ``_y``, ``_z``).
        Its ``attrs`` hold

        format : {"bvh", "amc", "c3d", "trc", "mot", "sto"}
            The ending of the file.
        frame_rate : float or None
            Frames per second, None if it is not known, or if times are uneven.
        units : str or None
            "m" for AMC, the unit that the file states for C3D and TRC ("mm"), None for BVH, which
            has none. For the group "analog" a list, one for each channel. For MOT and STO "deg"
            or "rad", the unit of the angles; lengths are in metres there.
        up : {"y", "z"} or None
            The vertical axis, None if a C3D file does not state it, and for TRC, MOT and STO.
        kind : str
            "joints", "markers", or for C3D the group; for MOT and STO "forces" if the names of all
            columns contain force, torque or moment, else "coordinates".
        joints : list of str
            Names of the joints or markers; for the group "analog", MOT and STO ``channels``
            instead.
        parents : list of int
            Index of each joint's parent, -1 for a root and for markers.
        performance, levels : str, list of str
            The label of the recording in tables, which is the name of its file without the ending;
            and the names of the levels of their index, "recording" and "frame".

        for BVH files also

        rig : dict
            ``offsets`` of the joints at rest and their ``channels``, which `write_motion` takes.

        for C3D and TRC files also

        first_frame : int
            The number of frame 0 in its trial.

        for TRC, MOT and STO files also

        first_time : float
            The time of frame 0, in seconds.
        times : list of float
            The times of all frames in seconds, only if they are uneven.

        and for C3D files also

        events : list of dict
            The events marked in the recording, by time: ``label``, ``context`` (such as "Left",
            or None), ``time`` in seconds of the trial, and ``frame``, its position in the frames
            returned, from 0 and with fractions. It may lie outside of them, and is None if
            the file has no frame rate.
        groups : dict of str to dict
            The number of members of each group (``n``), their ``units`` and ``frame_rate``.
        left_out : str
            The other contents of the file, in one line, such as "12 angles, 16 analog channels at
            1000 Hz, the geometry of 2 force plates"; empty if there are none.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the ending is not known; the message lists those that are. If the file is damaged or
        not complete, or has numbers of 1e12 and more (BVH, AMC); the message names the line or
        byte. If the result would take more than 64 MB and more than 32 times the size of the file.

    Warns
    -----
    UserWarning
        If positions or values are missing; the message says how many, and of which markers or
        columns. If times are uneven, or contradict the frame rate that the file states, unless
        `frame_rate` is given. Of several files, if one is left out for it lacks the group, and
        if columns are left out. If a C3D file states two scales.

    See Also
    --------
    find_gaps : Lists the gaps of a recording.
    sklearn_motionsync.to_sequences : Makes uneven times even.
    sklearn_motionsync.Skeleton.from_frame : The skeleton of a recording.

    Examples
    --------
    >>> from sklearn_motionsync.io import read_motion
    >>> path = getfixture("tmp_path") / "arm.bvh"
    >>> _ = path.write_text('''HIERARCHY
    ... ROOT arm
    ... {
    ...   OFFSET 0 0 0
    ...   CHANNELS 1 Zrotation
    ...   End Site { OFFSET 2 0 0 }
    ... }
    ... MOTION
    ... Frames: 2
    ... Frame Time: 0.01
    ... 0
    ... 90
    ... ''')
    >>> df = read_motion(path)
    >>> df[["arm_end_x", "arm_end_y"]].round(6).to_numpy().tolist()
    [[2.0, 0.0], [0.0, 2.0]]
    >>> df.attrs["frame_rate"], df.attrs["joints"], df.attrs["parents"]
    (100.0, ['arm', 'arm_end'], [-1, 0])
    """
    check_max_gap(max_gap)
    check_ends(ends)
    check_frame_rate(frame_rate)
    if columns not in (None, "common") or (columns and isinstance(path, (str, os.PathLike))):
        raise ValueError(
            "columns must be None, or 'common' with a list of several files, got "
            f"columns={columns!r} for {path!r}."
        )
    options: dict[str, Any] = {"asf": asf, "group": group}
    if not isinstance(path, (str, os.PathLike)):
        options |= {"frame_rate": frame_rate, "max_gap": max_gap, "ends": ends}
        recordings = _read_several(path, options)
        return _keep_common(recordings) if columns else recordings
    path = FilePath(path)
    if not path.is_file():
        raise FileNotFoundError(f"There is no motion file at {path}.")
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise ValueError(
            f"{path} ends with {path.suffix!r}, which no reader is for; the known endings are "
            f"{_join(READERS)}."
        )
    options = {name: value for name, value in options.items() if value is not None}
    for name, value in options.items():
        endings = [end for end in READERS if name in inspect.signature(READERS[end]).parameters]
        if path.suffix.lower() not in endings:
            raise ValueError(
                f"{name}= goes with {_join(endings)} files only, got {name}={value!r} with {path}."
            )
    motion = reader(path, **options)
    stated = motion["frame_rate"]
    if "times" in motion:
        times, decimals = motion.pop("times"), motion.pop("decimals")
        motion |= describe_times(
            path.name, times, stated=stated, decimals=decimals, frame_rate=frame_rate
        )
        if frame_rate is None:
            warn_of_other_rate(path.name, stated, motion["frame_rate"])
    elif frame_rate is not None:
        motion["frame_rate"] = float(frame_rate)
    df = _to_frame(motion, path)
    if "joints" not in df.attrs:
        if max_gap or ends != "keep":
            raise ValueError(
                f"max_gap and ends go with positions, got max_gap={max_gap} frames for the "
                f"{df.attrs['kind']} of {path}, and ends={ends!r}."
            )
        warn_of_missing(df, path.name)
        return df
    if max_gap or ends != "keep":
        df = fill_gaps(df, max_gap, ends=ends)
    warn_of_gaps(df, path.name)
    return df


def _read_several(paths, options):
    """The recordings of those files that have the group."""
    recordings, refused = [], []
    for path in paths:
        try:
            recordings.append(read_motion(path, **options))
        except MissingGroup as error:
            refused.append(error)
    if not recordings:
        raise refused[0] if refused else ValueError("There are no files to read, got none.")
    for missing in refused:
        warnings.warn(f"{missing} The file is left out.", UserWarning, stacklevel=3)
    return recordings


def _keep_common(recordings):
    """Recordings with the columns that all of them have, in the order of the first."""
    shared = set.intersection(*(set(x.columns) for x in recordings))
    common = [name for name in recordings[0].columns if name in shared]
    losses = []
    for x in recordings:
        lost = [name for name in x.columns if name not in shared]
        if lost:
            label = x.attrs["performance"][:40]
            losses.append(f"{len(lost)} of {label!r} {listed(lost)}")
    listing = "; ".join(losses[:3]) + f"; and some of {len(losses) - 3} more" * (len(losses) > 3)
    if not common:
        raise ValueError(
            f"No column is common to the {len(recordings)} files, there are {listing}. Read those "
            "together that have the same joints, markers or channels."
        )
    if losses:
        warnings.warn(
            f"{len(recordings)} files have {counted(len(common), 'column')} in common. Left out "
            f"are {listing}.",
            UserWarning,
            stacklevel=3,
        )
    result = []
    for x in recordings:
        places = x.columns.get_indexer(common)
        selected = x[common]
        for key in ("channels", "units"):
            if isinstance(values := x.attrs.get(key), list):
                selected.attrs[key] = [values[k] for k in places]
        result.append(selected)
    return result


def _join(endings):
    *before, last = endings
    return f"{', '.join(before)} and {last}" if before else last


def _to_frame(motion, path):
    if "positions" in motion:
        values = motion.pop("positions")
        values = values.reshape(len(values), -1)
        columns = [f"{joint}_{axis}" for joint in motion["joints"] for axis in "xyz"]
    else:
        values, columns = motion.pop("values"), motion["channels"]
    index = pd.RangeIndex(len(values), name="frame")
    df = pd.DataFrame(values, columns=columns, index=index, copy=False)
    df.attrs = {"format": path.suffix.lower().removeprefix(".")} | motion
    df.attrs |= {"performance": path.stem, "levels": ["recording", FRAME]}
    return df
