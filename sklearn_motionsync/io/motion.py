"""Files of motion capture: `read_motion`, and the registry of the readers of all formats."""

from __future__ import annotations

import inspect
import os
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path as FilePath
from typing import Any, Literal

import numpy as np
import pandas as pd

from ..inputs.numbers import LARGEST, listed
from ..inputs.recorded import SAME_RATE, is_thinned
from ..inputs.resampling import is_even, is_rate
from ..inputs.tables import FRAME
from ..inputs.types import Path
from ..inputs.wording import counted
from .acclaim import read_acclaim
from .bvh import read_bvh
from .c3d import MissingGroup, read_c3d
from .gaps import check_filling, fill_gaps, warn_of_gaps
from .text import FARTHEST, read_storage
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
        A file that ends with ``.bvh``, ``.amc``, ``.c3d``, ``.trc``, ``.mot`` or ``.sto``, in any
        case; or several, such as ``sorted(folder.glob("*.c3d"))``.
    asf : str or path-like, default=None
        The skeleton of an AMC file. By default the ``.asf`` file of its folder with the longest
        name that the AMC file's begins with (``02.asf`` for ``02_01.amc``), or the only one.
    frame_rate : float, default=None
        Frames per second. By default what the file says; AMC files mostly do not.
    max_gap : int, default=0
        The longest gap of joints and markers to interpolate, in frames; see `fill_gaps`.
    ends : {"keep", "trim"}, default="keep"
        "trim" leaves out the frames before the first and after the last one in which all joints or
        markers are seen; see `fill_gaps`. Other groups of the file are longer then.
    group : str, default=None
        The group of a C3D file to read: by default its "markers"; "angles", "forces", "moments",
        "powers", "scalars" or "reactions", if the file has such points; "analog" for the analog
        channels. Of several files those that have no such group are left out.
    columns : {None, "common"}, default=None
        Of several files: "common" leaves out the columns that some of them lack, such as other
        markers, and brings the others into the order of the first. By default all stay.

    Returns
    -------
    DataFrame (n_frames, 3 * n_joints), or list of DataFrame
        Of several files a list. Float64 columns ``<joint>_x``, ``<joint>_y``, ``<joint>_z``, joint
        by joint, and an index named "frame", from 0. A marker that was not seen is NaN. The group
        "analog" has a column for each channel, and a row for each sample; a MOT or STO file a
        column for each of its own but the time. Its ``attrs`` hold ``format``, ``frame_rate``,
        ``units``, ``up``, ``kind``, ``joints`` and ``parents`` or ``channels``, ``trial`` and
        ``levels``; the manual's page of motion files explains them, and what else each format adds.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the ending is not known, or the file is damaged or not complete; the message names the
        line, byte or frame. If the result would take more than 64 MB and 32 times the size of the
        file.

    Warns
    -----
    UserWarning
        If positions or values are missing, or beyond those of any recording, so that they become
        NaN; if times are uneven, or contradict the frame rate that
        the file states, unless `frame_rate` is given; if a file or columns of several are left
        out; if a C3D file states two scales.

    See Also
    --------
    find_gaps : Lists the gaps of a recording.
    sklearn_motionsync.to_trials : Makes uneven times even.
    sklearn_motionsync.Skeleton.from_frame : The skeleton of a recording.

    Examples
    --------
    >>> from sklearn_motionsync.datasets import make_walk
    >>> from sklearn_motionsync.io import read_motion, write_motion
    >>> walk, path = make_walk(1, random_state=0), getfixture("tmp_path") / "walk.trc"
    >>> write_motion(path, walk.data[0], walk.skeleton, frame_rate=100)
    >>> df = read_motion(path)
    >>> list(df.columns[:3]), df.attrs["frame_rate"], df.attrs["units"]
    (['pelvis_x', 'pelvis_y', 'pelvis_z'], 100.0, 'm')
    """
    check_filling(max_gap, ends)
    check_frame_rate(frame_rate)
    if columns not in (None, "common") or (columns and isinstance(path, (str, os.PathLike))):
        raise ValueError(
            "columns must be None, or 'common' with a list of several files, got "
            f"columns={columns!r} for {path!r}."
        )
    options: dict[str, Any] = {"asf": asf, "group": group}
    if not isinstance(path, (str, os.PathLike)):
        options |= {"frame_rate": frame_rate, "max_gap": max_gap, "ends": ends}
        return _read_several(path, columns, options)
    path = FilePath(path)
    motion = _read_file(path, options)
    _hide_damage(motion, path)
    if "times" in motion:
        motion |= describe_times(
            path.name,
            motion.pop("times"),
            stated=motion["frame_rate"],
            decimals=motion.pop("decimals"),
            frame_rate=frame_rate,
        )
    elif frame_rate is not None:
        motion["frame_rate"] = float(frame_rate)
    df = _to_frame(motion, path)
    if max_gap or ends != "keep":
        df = fill_gaps(df, max_gap, ends=ends)
    warn_of_gaps(df, path.name)
    return df


def _read_file(path, options):
    """What the reader of a file returns, which is given the options that were chosen."""
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
    return reader(path, **options)


def _hide_damage(motion, path):
    """What is larger than any recording, as of a flipped bit, becomes NaN, or is refused."""
    kind, joints = motion["kind"], motion.get("joints")
    values = motion["values"] if joints is None else motion["positions"]
    limit = FARTHEST if kind in ("joints", "markers", "angles") else LARGEST
    damaged = np.abs(values) > limit
    if not damaged.any():
        return
    frame, column, *axis = np.argwhere(damaged)[0].tolist()
    name = motion["channels"][column] if joints is None else f"{joints[column]}_{'xyz'[axis[0]]}"
    found = f"frame {frame} of {name[:60]!r} is {values[frame, column, *axis]:.3g}"
    beyond = f"No recording has numbers beyond {limit:g}: the file is damaged, or in another unit."
    # Joints of a skeleton are always seen.
    if kind == "joints" or 2 * damaged.sum() > damaged.size:
        raise ValueError(f"{path}: {found}. {beyond}")
    values[damaged if joints is None else damaged.any(axis=2)] = np.nan
    warnings.warn(
        f"{path.name}: {found}, the first of {counted(damaged.sum(), 'number')} that become "
        f"missing (NaN). {beyond}",
        UserWarning,
        stacklevel=3,
    )


def _read_several(paths, columns, options):
    """The recordings of those files that have the group, with all columns or the common ones."""
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
    return _keep_common(recordings) if columns else recordings


def _keep_common(recordings):
    """Recordings with the columns that all of them have, in the order of the first."""
    shared = set.intersection(*(set(x.columns) for x in recordings))
    common = [name for name in recordings[0].columns if name in shared]
    losses = []
    for x in recordings:
        lost = [name for name in x.columns if name not in shared]
        if lost:
            label = x.attrs["trial"][:40]
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
            stacklevel=4,
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
    df.attrs |= {"trial": path.stem, "levels": ["recording", FRAME]}
    return df


# -- times of frames: even ones give a frame rate, uneven ones are kept and warned of --------------

# A share of a step by which even times may miss their places, beside rounding.
_JITTER = 0.1
# A larger share is never explained by rounding: half a step is what one lost frame leaves.
_MAX_JITTER = 0.45
# A step this many times longer than it should be is a gap.
_GAP = 1.9
# Digits of less than this share of a step show each lost frame.
_FINE = 0.1
# Seconds; no recording has shorter steps.
_SHORTEST_STEP = 1e-9


def check_frame_rate(frame_rate):
    if frame_rate is not None and not is_rate(frame_rate):
        raise ValueError(f"frame_rate must be frames a second, above 0, got {frame_rate!r}.")


def describe_times(
    name, times, *, stated=None, decimals=17, frame_rate=None, unit="s", may_be_thinned=False
):
    """The ``attrs`` of a recording that describe its times, which do not decrease.

    ``frame_rate`` (None if it is not known), ``first_time`` where times are in seconds, ``times``
    where they are uneven. A rate that the file states counts where the times agree with it, as far
    as the ``decimals`` that they were written with allow. A ``frame_rate`` of the caller replaces
    all others. Times in frames give no frame rate. With ``may_be_thinned`` every k-th frame of the
    stated rate is no contradiction.

    Warns, in the caller's caller, if times are uneven or contradict the stated rate, and no
    ``frame_rate`` is given.
    """
    rate, even = _estimate_frame_rate(times, decimals, stated)
    facts = {"frame_rate": rate if unit == "s" else None}
    if unit == "s":
        facts["first_time"] = float(times[0])
    if not even:
        facts["times"] = times.tolist()
    if frame_rate is not None:
        facts["frame_rate"] = float(frame_rate)
    elif not even:
        steps = np.diff(times)
        warnings.warn(
            f"{name}: its times are uneven, in steps of {steps.min():.4g} to {steps.max():.4g} "
            f"{unit}, but frames count as evenly spaced. df.attrs['times'] holds them; "
            "to_trials(df.assign(time=df.attrs['times']), time='time') makes them even. If they "
            "are even in truth, give frame_rate=.",
            UserWarning,
            stacklevel=3,
        )
    elif stated and facts["frame_rate"] not in (None, stated):
        if may_be_thinned and is_thinned(rate, stated):
            return facts
        warnings.warn(
            f"{name}: it says {stated:g} frames a second, but by its times there are {rate:g}, "
            "which is used. If the times are wrong, give frame_rate=.",
            UserWarning,
            stacklevel=3,
        )
    return facts


def _estimate_frame_rate(times, decimals, stated):
    """Frames a second of the times, None where it cannot be estimated, and whether they are even.

    The stated rate is returned where the times agree with it.
    """
    step = (times[-1] - times[0]) / max(len(times) - 1, 1)
    if len(times) < 2 or step < _SHORTEST_STEP:
        return stated, len(times) < 2 or stated is not None
    # Times have few digits: 0.033, 0.067, 0.1.
    rate = float(f"{1 / step:.6g}")
    rounding = 10.0**-decimals
    # A lost frame makes the mean step longer, and not the median.
    steps = np.diff(times)
    has_gap = steps.max() >= _GAP * max(np.median(steps), rounding)
    off = times - step * np.arange(len(times))
    jitters = np.ptp(off) / 2 <= min(_JITTER * step + rounding / 2, _MAX_JITTER * step)
    even = is_even(times) or (jitters and not has_gap)
    if stated is not None:
        # With few frames the digits leave the rate uncertain. Coarse ones hide a lost frame, which
        # the duration shows.
        blur = min(rounding / (len(times) - 1), step / 4)
        agree = abs(step - 1 / stated) < max(SAME_RATE / stated, blur)
        lost = abs((times[-1] - times[0]) * stated - len(steps)) > max(0.5, rounding * stated)
        is_fine = rounding * stated < _FINE
        if agree and (even or not (has_gap or (lost and not is_fine))):
            return stated, True
    return (rate, True) if even else (None, False)
