"""Files of motion capture: BVH, Acclaim's ASF/AMC, C3D, and OpenSim's TRC, MOT and STO."""

import math
from numbers import Real
from pathlib import Path

import pandas as pd

from ..inputs.tables import FRAME
from .acclaim import find_asf, read_acclaim
from .bvh import read_bvh
from .c3d import read_c3d
from .clock import set_clock
from .gaps import check_max_gap, fill_gaps, warn_of_gaps, warn_of_missing
from .storage import read_storage
from .trc import read_trc

_ENDINGS = ".bvh", ".amc", ".c3d", ".trc", ".mot", ".sto"


def read_motion(path, *, asf=None, frame_rate=None, max_gap=0, group=None):
    """Read a recording from a BVH, AMC, C3D, TRC, MOT or STO file.

    Parameters
    ----------
    path : str or path-like
        A file whose name ends with ``.bvh``, ``.amc``, ``.c3d``, ``.trc``, ``.mot`` or ``.sto``, in
        any case.
    asf : str or path-like, default=None
        The skeleton of an AMC file. By default the ``.asf`` file beside it with the longest name
        that the AMC file's begins with (``02.asf`` for ``02_01.amc``), or the only one there.
    frame_rate : float, default=None
        Frames a second. By default what the file says; AMC files mostly do not.
    max_gap : int, default=0
        Gaps of joints and markers up to that many frames are interpolated, see `fill_gaps`.
    group : str, default=None
        What to read of a C3D file: by default its "markers"; "angles", "forces", "moments",
        "powers", "scalars" or "reactions", where the file says that some of its points are
        such; "analog" for the channels that were recorded along with them. ``attrs["groups"]``
        tells which of them a file has.

    Returns
    -------
    DataFrame (n_frames, 3 * n_joints)
        Float64 columns ``<joint>_x``, ``<joint>_y``, ``<joint>_z``, joint by joint, and an index
        named "frame", from 0. Names that come twice end with ``_2``, ``_3`` and so on. A joint
        of a BVH file is where the joint turns, and ``<parent>_end`` where an End Site is; a joint
        of an AMC file is the far end of the bone of that name. A marker that was not seen is NaN:
        the file says so, or has it at exactly (0, 0, 0) and names no camera; a TRC file leaves
        it blank or has no number there. The group "analog" has a column for each channel, in
        its unit, and a row for each sample; a MOT or STO file a column for each that it has
        beside the time (vectors ``_x``, ``_y``, ``_z``, quaternions ``_w``, ``_x``, ``_y``,
        ``_z``).
        Its ``attrs`` hold

        format : {"bvh", "amc", "c3d", "trc", "mot", "sto"}
            What was read.
        frame_rate : float or None
            Frames a second, None where nobody says, or where times are uneven.
        units : str or None
            "m" for AMC, what the file says for C3D and TRC ("mm"), None for BVH, which has none.
            For the group "analog" a list, one for each channel. For MOT and STO "deg" or "rad",
            what the file says of its angles; lengths are metres there.
        up : {"y", "z"} or None
            The vertical axis, None where a C3D file does not say, and for TRC, MOT and STO.
        kind : str
            What the positions are of: "joints", "markers", or for C3D the group; for MOT and STO
            "forces" where all columns are called forces, torques or moments, else
            "coordinates".
        joints : list of str
            Their names; for the group "analog", MOT and STO ``channels`` instead.
        parents : list of int
            Index of each joint's parent, -1 for a root and for markers.
        performance, levels : str, list of str
            What the recording is called in tables, the name of its file without the ending; and
            the names of the levels of an index of such, "recording" and "frame".

        for C3D and TRC files also

        first_frame : int
            The number that frame 0 has in its trial.

        for TRC, MOT and STO files also

        first_time : float
            The time of frame 0, in seconds.
        times : list of float
            The times of all frames, only where they are uneven.

        and for C3D files also

        events : list of dict
            What was marked in the recording, by time: ``label``, ``context`` (such as "Left", or
            None), ``time`` in seconds of the trial, and ``frame``, the place in the frames
            returned here, from 0 and with fractions. It may lie outside of them, and is None if
            the file has no frame rate.
        groups : dict of str to dict
            How many there are in each group (``n``), their ``units`` and ``frame_rate``.
        left_out : str
            What else is in the file, in one line, such as "12 angles, 16 analog channels at
            1000 Hz, the geometry of 2 force plates"; empty if there is nothing.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is not of these formats, damaged or not complete; the message says what was found
        where. A result of more than 64 MB and 32 times the size of its file is refused.

    Warns
    -----
    UserWarning
        If positions are missing; the message says how many, of which markers, and what helps.
        If times are uneven, or contradict the frame rate that the file states, unless
        `frame_rate` is given.

    See Also
    --------
    find_gaps : The gaps of a recording.
    sklearn_motionsync.to_sequences : Makes uneven times even.
    sklearn_motionsync.Skeleton.from_frame : The skeleton of what is returned.

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
    _check_frame_rate(frame_rate)
    path = _existing(path, "motion file")
    kind = path.suffix.lower()
    if kind == ".asf":
        raise ValueError(f"{path} is a skeleton without motion; give the .amc file, and asf=.")
    if kind not in _ENDINGS:
        raise ValueError(
            f"{path} must end with {', '.join(_ENDINGS[:-1])} or {_ENDINGS[-1]}, got "
            f"{kind or 'nothing'!r}."
        )
    if asf is not None and kind != ".amc":
        raise ValueError(f"asf= goes with .amc files only, got asf={str(asf)!r} with {path}.")
    if group is not None and kind != ".c3d":
        raise ValueError(f"group= goes with .c3d files only, got group={group!r} with {path}.")
    if group is not None and not isinstance(group, str):
        raise ValueError(f"group must be the name of a group, such as 'markers', got {group!r}.")
    if group == "analog" and max_gap:
        raise ValueError(f"max_gap goes with points, got max_gap={max_gap} with group='analog'.")
    if kind in (".mot", ".sto") and max_gap:
        raise ValueError(f"max_gap goes with points, got max_gap={max_gap} with {path}.")
    motion = _read(path, kind, asf, group)
    if "times" in motion:
        set_clock(path.name, motion, frame_rate)
    df = _to_frame(motion, path, frame_rate)
    if group == "analog":
        return df
    if kind in (".mot", ".sto"):
        warn_of_missing(df, path.name)
        return df
    if max_gap:
        df = fill_gaps(df, max_gap)
    warn_of_gaps(df, path.name)
    return df


def _read(path, kind, asf, group):
    """What the reader of the format gives."""
    if kind == ".amc":
        asf = find_asf(path) if asf is None else _existing(asf, "skeleton (asf=)")
        return read_acclaim(path, asf)
    if kind == ".c3d":
        return read_c3d(path, group or "markers")
    return {".bvh": read_bvh, ".trc": read_trc}.get(kind, read_storage)(path)


def _check_frame_rate(frame_rate):
    if frame_rate is None:
        return
    number = isinstance(frame_rate, Real) and not isinstance(frame_rate, bool)
    if not number or not math.isfinite(frame_rate) or frame_rate <= 0:
        raise ValueError(f"frame_rate must be frames a second, above 0, got {frame_rate!r}.")


def _existing(path, what):
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"There is no {what} at {path}.")
    return path


def _to_frame(motion, path, frame_rate):
    if "values" in motion:
        values, columns = motion.pop("values"), list(motion["channels"])
    else:
        values = motion.pop("positions")
        values = values.reshape(len(values), -1)
        columns = [f"{joint}_{axis}" for joint in motion["joints"] for axis in "xyz"]
    index = pd.RangeIndex(len(values), name="frame")
    df = pd.DataFrame(values, columns=columns, index=index)
    if frame_rate is not None:
        motion["frame_rate"] = float(frame_rate)
    df.attrs = {"format": path.suffix.lower().removeprefix(".")} | motion
    df.attrs |= {"performance": path.stem, "levels": ["recording", FRAME]}
    return df
