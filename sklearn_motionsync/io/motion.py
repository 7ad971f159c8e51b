"""Files of motion capture: `read_motion`, and the registry of the readers of all formats."""

from __future__ import annotations

import inspect
import math
import os
from collections.abc import Callable, Iterable
from numbers import Real
from pathlib import Path as FilePath
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd

from ..inputs.numbers import LARGEST, listed
from ..inputs.recorded import SAME_RATE, first_time_of, is_thinned
from ..inputs.resampling import is_even, is_rate
from ..inputs.tables import FRAME
from ..inputs.types import Path
from ..inputs.wording import counted
from .bones import read_acclaim, read_bvh
from .c3d import read_c3d
from .gaps import POSITIONS, check_filling, fill_gaps, warn_of_gaps
from .keypoints import KEYPOINT_FORMATS
from .labs import MOTIVE, QTM, VICON, read_motive, read_mvnx, read_qtm, read_trc, read_vicon
from .text import FARTHEST, make_unique, read_storage, warn


class MotionFormat(NamedTuple):
    """A format of files: how they are known, and their reader.

    A reader gets the path of what exists (a `pathlib.Path`), and as keyword parameters those
    options of `read_motion` that only some formats have (``asf``, ``group``) and that were given.
    It returns a dict with

    - ``positions``, floats (n_frames, n_joints, 3) or (n_frames, n_joints, 2), NaN where a joint
      was not seen, with ``joints`` (unique names) and ``parents`` (indices, -1 for a root, as all
      are by default); or ``values``, floats (n_frames, n_channels), with ``channels`` (unique
      names); and ``kind``, what was measured, such as "markers";
    - optionally ``confidence``, floats (n_frames, n_joints), and ``subjects``, a list with the
      subject of each joint or channel, "" where it has none; its name is then no part of the
      names, which are unique within a subject;
    - what is known of ``frame_rate`` (frames per second), ``units`` (str or list of str) and ``up``
      ("x", "y", "z", "-x", ...);
    - for formats with a time in each row ``times`` (seconds, not decreasing) and, if it is known,
      ``decimals`` (how many they were written with, by default as many as the numbers have);
      ``frame_rate`` is then the rate that the header states;
    - optionally ``events``, triples of label, context ("" without one) and time in seconds;
    - whatever else goes into ``attrs``, as plain Python types: ``left_out`` is a line about what
      was not read.

    A file that is damaged or not complete is a ValueError that begins with its path.

    Attributes
    ----------
    name : str
        As it is called; ``attrs["format"]`` is the ending of the file where ``name`` is None.
    endings : tuple of str
        Of names of files, in small letters; a folder has none.
    fits : callable
        Tells by the path and the first bytes of a file, b"" of a folder, whether it is one.
    read : callable
    """

    name: str | None
    endings: tuple[str, ...]
    fits: Callable[[FilePath, bytes], bool]
    read: Callable[..., dict]


# The first bytes of a file, by which its format is known.
_HEAD = 2**16

# Where the beginning of a file fits none, its ending tells.
FORMATS = [
    MotionFormat(
        None, (".bvh",), lambda path, head: head.lstrip().startswith(b"HIERARCHY"), read_bvh
    ),
    MotionFormat(None, (".amc",), lambda path, head: False, read_acclaim),
    MotionFormat(None, (".c3d",), lambda path, head: head[1:2] == b"\x50", read_c3d),
    MotionFormat(None, (".trc",), lambda path, head: head.startswith(b"PathFileType"), read_trc),
    MotionFormat(None, (".mot", ".sto"), lambda path, head: False, read_storage),
    MotionFormat(None, (".mvnx",), lambda path, head: b"<mvnx" in head, read_mvnx),
    MotionFormat("vicon", (".csv",), lambda path, head: bool(VICON.search(head)), read_vicon),
    MotionFormat("qtm", (".tsv",), lambda path, head: bool(QTM.match(head)), read_qtm),
    MotionFormat("motive", (".csv",), lambda path, head: bool(MOTIVE.match(head)), read_motive),
    *(MotionFormat(*each) for each in KEYPOINT_FORMATS),
]
ENDINGS = tuple(ending for each in FORMATS for ending in each.endings)


def read_motion(
    path: Path | Iterable[Path],
    *,
    asf: Path | None = None,
    frame_rate: float | None = None,
    max_gap: int = 0,
    ends: Literal["keep", "trim"] = "keep",
    group: str | None = None,
    columns: Literal["common"] | None = None,
    subject: str | None = None,
    min_confidence: float | None = None,
    quality: Literal["drop", "keep"] = "drop",
    verbose: int = 0,
) -> Any:
    """Read recordings from files of motion capture, whatever program wrote them.

    Parameters
    ----------
    path : str, path-like, or iterable of them
        A file, which is known by what it holds (the manual's page of motion files lists the
        formats), or a folder of key-points with a file a frame; or several, such as
        ``sorted(folder.glob("*.c3d"))``. Any other folder is read file by file.
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
        The group of a C3D file or of a CSV of Vicon Nexus to read: by default its "markers", or
        the "segments" of a C3D file that has rotations only; "angles", "forces", "moments",
        "powers", "scalars" or "reactions", if the file has such points; "analog" for the analog
        channels. Of a CSV of Motive "joints" or "markers". Of several files those that have no
        such group are left out.
    columns : {None, "common"}, default=None
        Of several files: "common" leaves out the columns that some of them lack, such as other
        markers, and brings the others into the order of the first. By default all stay.
    subject : str, default=None
        The subject to read, of a file that names several. By default all are read, and
        the name of each joint begins with its subject's, as in "Ann:LASI". The only subject of a
        file is no part of the names.
    min_confidence : float, default=None
        Positions of less confidence become NaN, where the file tells one. By default all are
        kept.
    quality : {"drop", "keep"}, default="drop"
        "keep" adds the columns ``<joint>_confidence`` behind the positions.
    verbose : int, default=0
        Above 0, what was read of each file and what was left out is printed, which is
        ``attrs["report"]``.

    Returns
    -------
    DataFrame (n_frames, 3 * n_joints), or list of DataFrame
        Of several files a list. Those that cannot be read are left out of it with a warning, unless
        none can. Float64 columns ``<joint>_x``, ``<joint>_y``, ``<joint>_z``, joint
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
        out; if a C3D file states two scales, or numbers of frames that its data contradict.

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
    check_confidence(min_confidence, quality)
    files, known = _files_of(path, columns)
    of_reader: dict[str, Any] = {"asf": asf, "group": group}
    of_table: dict[str, Any] = {"max_gap": max_gap, "ends": ends}
    of_table |= {"min_confidence": min_confidence, "quality": quality}
    if known is None:
        options = {"frame_rate": frame_rate, "subject": subject, "verbose": verbose}
        return _read_several(files, columns, of_reader | of_table | options)
    (file,) = files
    motion = _read_file(file, known, of_reader)
    _hide_damage(motion, file)
    choose_subject(motion, subject, file)
    set_clock(motion, file.name, frame_rate)
    name = known.name or file.suffix.lower().removeprefix(".")
    df = as_recording(motion, name, file.stem, ["recording", FRAME], **of_table)
    df.attrs["report"] = _report(df)
    if verbose:
        print(f"{file.name}: {df.attrs['report']}")
    warn_of_gaps(df, file.name)
    return df


def _files_of(path, columns):
    """The files that are asked for, and the format of the only one; None of several."""
    several = not isinstance(path, (str, os.PathLike))
    files = path if several else [FilePath(path)]
    known = None if several else _format_of(files[0])
    if columns not in (None, "common") or (columns and known):
        raise ValueError(
            "columns must be None, or 'common' with a folder or a list of several files, got "
            f"columns={columns!r} for {path!r}."
        )
    if not several and known is None:
        files = sorted(x for x in files[0].iterdir() if x.suffix.lower() in ENDINGS)
        if not files:
            raise FileNotFoundError(f"There is no motion file at {path}, a folder without any.")
    return files, known


def set_clock(motion, name, frame_rate, **options):
    """The frame rate, the time of the first frame, uneven times, and events on this clock.

    Options are those of `describe_times`. At a new frame rate events are at other times too.
    """
    times, decimals = motion.pop("times", None), motion.pop("decimals", None)
    if "events" in motion:
        start = (first_time_of(motion) or 0.0) if times is None else times[0]
        rate, events = motion["frame_rate"], []
        for label, context, time in motion["events"]:
            if math.isfinite(time):
                # The numbers of a C3D file have 24 bits.
                time = round(time, 6)
                frame = None if rate is None else round(float((time - start) * rate), 5)
                events.append(dict(label=label, context=context or None, time=time, frame=frame))
        motion["events"] = sorted(events, key=lambda event: event["time"])
    if times is not None:
        stated = motion["frame_rate"]
        motion |= describe_times(
            name, times, stated=stated, decimals=decimals, frame_rate=frame_rate, **options
        )
    elif frame_rate is not None:
        motion["frame_rate"] = float(frame_rate)
    if (rate := motion["frame_rate"]) is None:
        return
    motion["first_time"] = first_time_of(motion) or 0.0
    for event in motion.get("events", ()):
        if frame_rate is not None and event["frame"] is not None:
            event["time"] = round(motion["first_time"] + event["frame"] / rate, 6)


def check_confidence(min_confidence, quality="drop"):
    if quality not in ("drop", "keep"):
        raise ValueError(f"quality must be 'drop' or 'keep', got {quality!r}.")
    if not isinstance(min_confidence, Real | None) or isinstance(min_confidence, bool):
        raise ValueError(f"min_confidence must be a number such as 0.6, got {min_confidence!r}.")


def _format_of(path):
    """The `MotionFormat` of a file or folder; None of a folder of several recordings."""
    if path.is_dir():
        return next((each for each in FORMATS if each.fits(path, b"")), None)
    if not path.is_file():
        raise FileNotFoundError(f"There is no motion file at {path}.")
    with path.open("rb") as file:
        head = file.read(_HEAD).removeprefix(b"\xef\xbb\xbf")
    ending = path.suffix.lower()
    known = next((each for each in FORMATS if each.fits(path, head)), None)
    # Of several formats of text the last, a table, takes what none knows by its content.
    known = known or next((x for x in reversed(FORMATS) if ending in x.endings), None)
    if known is None:
        raise ValueError(
            f"{path} ends with {path.suffix!r}, which no reader is for, and does not begin like a "
            f"format that is known by its content; the known endings are {', '.join(ENDINGS)}."
        )
    return known


def _read_file(path, known, options):
    """What the reader of a file returns, which is given the options that were chosen."""
    options = {name: value for name, value in options.items() if value is not None}
    for name, value in options.items():
        takers = [each for each in FORMATS if name in inspect.signature(each.read).parameters]
        if known not in takers:
            endings = dict.fromkeys(ending for each in takers for ending in each.endings)
            raise ValueError(
                f"{name}= goes with {', '.join(endings)} files only, got {name}={value!r} with "
                f"{path}."
            )
    return {"frame_rate": None, "units": None, "up": None} | known.read(path, **options)


def choose_subject(motion, subject, path):
    """Keep the joints of a subject, or name each by its own; of one subject names tell nothing."""
    subjects = motion.pop("subjects", None) or []
    names = [name for name in dict.fromkeys(subjects) if name]
    if subject is not None and subject not in names:
        there = f"its subjects are {names}" if names else "it names none"
        raise ValueError(f"{path}: there is no subject {subject!r}; {there}.")
    what = "joints" if "joints" in motion else "channels"
    if subject is not None or len(names) == 1:
        motion["subject"] = names[0] if subject is None else subject
        if len(names) > 1:
            motion |= _taken(motion, [i for i, each in enumerate(subjects) if each == subject])
        motion[what] = make_unique(motion[what])
    elif names:
        motion["subject"] = names
        of_each = zip(subjects, motion[what], strict=True)
        motion[what] = make_unique([f"{a}:{b}" if a else b for a, b in of_each])
        warn(
            f"{path.name} holds {counted(len(names), 'subject')} {listed(names)}, and the names of "
            f"joints begin with theirs, as {motion[what][0]!r}. subject={names[0]!r} reads one."
        )


def _taken(motion, places):
    """What a motion holds of joints or channels at these places."""
    taken = {}
    for key in ("joints", "channels", "units"):
        if isinstance(motion.get(key), list):
            taken[key] = [motion[key][i] for i in places]
    for key in ("positions", "values", "confidence"):
        if key in motion:
            taken[key] = motion[key][:, places]
    if "parents" in motion:
        parents = [motion["parents"][i] for i in places]
        taken["parents"] = [places.index(i) if i in places else -1 for i in parents]
    return taken


def _hide_damage(motion, path):
    """What is larger than any recording, as of a flipped bit, becomes NaN, or is refused."""
    kind, joints = motion["kind"], motion.get("joints")
    values = motion["values"] if joints is None else motion["positions"]
    limit = FARTHEST if kind in (*POSITIONS, "angles") else LARGEST
    highest, lowest = (f.reduce(values, axis=None, initial=0) for f in (np.fmax, np.fmin))
    if max(highest, -lowest) <= limit:
        return
    damaged = np.abs(values) > limit
    frame, column, *axis = np.argwhere(damaged)[0].tolist()
    name = motion["channels"][column] if joints is None else f"{joints[column]}_{'xyz'[axis[0]]}"
    found = f"frame {frame} of {name[:60]!r} is {values[frame, column, *axis]:.3g}"
    beyond = f"No recording has numbers beyond {limit:g}: the file is damaged, or in another unit."
    # Joints of a skeleton are always seen.
    if kind == "joints" or 2 * damaged.sum() > damaged.size:
        raise ValueError(f"{path}: {found}. {beyond}")
    values[damaged if joints is None else damaged.any(axis=2)] = np.nan
    warn(
        f"{path.name}: {found}, the first of {counted(damaged.sum(), 'number')} that become "
        f"missing (NaN). {beyond}"
    )


def _read_several(paths, columns, options):
    """The recordings of those files that can be read, with all columns or the common ones."""
    recordings, refused = [], []
    for path in paths:
        try:
            recordings.append(read_motion(path, **options))
        except (ValueError, OSError) as error:
            refused.append(error)
    if not recordings:
        raise refused[0] if refused else ValueError("There are no files to read, got none.")
    for reason in refused:
        warn(f"{reason} The file is left out.")
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
        warn(
            f"{len(recordings)} files have {counted(len(common), 'column')} in common. Left out "
            f"are {listing}."
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


def as_recording(
    motion, name, trial, levels, *, max_gap=0, ends="keep", min_confidence=None, quality="drop"
):
    """The table of what a reader of the format of this name returned.

    The options are those of `read_motion`.
    """
    if "positions" in motion:
        values, joints = motion.pop("positions"), motion["joints"]
        columns = [f"{joint}_{axis}" for joint in joints for axis in "xyz"[: values.shape[2]]]
        motion.setdefault("parents", [-1] * len(joints))
        confidence = motion.pop("confidence", None)
        if confidence is not None and min_confidence is not None:
            values[confidence < min_confidence] = np.nan
        values = values.reshape(len(values), -1)
        if quality == "keep" and confidence is not None:
            columns += [f"{joint}_confidence" for joint in joints]
            values = np.hstack([values, confidence])
    else:
        values, columns = motion.pop("values"), motion["channels"]
    index = pd.RangeIndex(len(values), name=FRAME)
    df = pd.DataFrame(values, columns=columns, index=index, copy=False)
    df.attrs = {"format": name} | motion | {"trial": trial, "levels": levels}
    return fill_gaps(df, max_gap, ends=ends) if max_gap or ends != "keep" else df


def _report(df):
    """What was read of a file, in sentences."""
    attrs = df.attrs
    of = "joint" if "joints" in attrs else "channel"
    rate, subject = attrs["frame_rate"], attrs.get("subject")
    units = attrs["units"] if isinstance(attrs["units"], str) else None
    text = (
        f"{counted(len(df), 'frame')} of {counted(len(attrs[f'{of}s']), of)} ({attrs['kind']})"
        f"{'' if rate is None else f' at {rate:g} Hz'}{'' if units is None else f' in {units}'}."
    )
    if subject is not None:
        text += f" Subject: {subject if isinstance(subject, str) else ', '.join(subject)}."
    return f"{text} Left out: {attrs['left_out']}." if attrs.get("left_out") else text


# -- times of frames: even ones give a frame rate, uneven ones are kept and warned of --------------

# A share of a step by which even times may miss their places, beside rounding.
_JITTER = 0.1
# A larger share is never explained by rounding: half a step is what one lost frame leaves.
_MAX_JITTER = 0.45
# A step this many times longer than it should be is a gap.
_GAP = 1.9
# Digits of less than this share of a step show each lost frame.
_FINE = 0.1
# Times that need as many digits behind the point, or more, are not rounded.
_DECIMALS = 9
# Seconds; no recording has shorter steps.
_SHORTEST_STEP = 1e-9


def check_frame_rate(frame_rate):
    if frame_rate is not None and not is_rate(frame_rate):
        raise ValueError(f"frame_rate must be frames a second, above 0, got {frame_rate!r}.")


def describe_times(name, times, *, stated=None, decimals=17, frame_rate=None, may_be_thinned=False):
    """The ``attrs`` of a recording that describe its times, which do not decrease.

    ``frame_rate`` (None if it is not known), ``first_time``, and ``times`` where they are uneven. A
    rate that the file states counts where the times agree with it, as far as the digits that they
    were written with allow. A ``frame_rate`` of the caller replaces all others. With
    ``may_be_thinned`` every k-th frame of the stated rate is no contradiction.

    Warns, in the caller's caller, if times are uneven or contradict the stated rate, and no
    ``frame_rate`` is given.
    """
    rate, even = _estimate_frame_rate(times, decimals, stated)
    facts = {"frame_rate": rate, "first_time": float(times[0])}
    if not even:
        facts["times"] = times.tolist()
    if frame_rate is not None:
        facts["frame_rate"] = float(frame_rate)
    elif not even:
        steps = np.diff(times)
        warn(
            f"{name}: its times are uneven, in steps of {steps.min():.4g} to {steps.max():.4g} "
            "s, but frames count as evenly spaced. df.attrs['times'] holds them; "
            "to_trials(df.assign(time=df.attrs['times']), time='time') makes them even. If they "
            "are even in truth, give frame_rate=."
        )
    elif stated and facts["frame_rate"] not in (None, stated):
        if may_be_thinned and is_thinned(rate, stated):
            return facts
        warn(
            f"{name}: it says {stated:g} frames a second, but by its times there are {rate:g}, "
            "which is used. If the times are wrong, give frame_rate=."
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
    if decimals is None:
        fitting = (n for n in range(_DECIMALS) if (np.round(times, n) == times).all())
        decimals = next(fitting, 17)
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
