"""Key-points that programs track in videos, and other tables of joints: text, HDF5, JSON, NPY."""

import contextlib
import io
import json
import math
import re
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from ..body.formats import FORMATS as BODIES
from ..inputs.columns import find_clock, parse_columns
from ..inputs.numbers import listed
from ..inputs.wording import counted
from .text import EXACT, MotionText, check_result_size, decode, make_unique, quote, warn

# The first bytes of a file, and those of HDF5.
_HEAD = 2**16
_HDF5 = b"\x89HDF\r\n\x1a\n"
_MEDIAPIPE = list(BODIES["mediapipe"].parents)
# Landmarks that are numbered: the number alone, or behind the word.
_NUMBERED = r"(?:lm|(?:pose)?[\s_]*landmarks?|keypoints?)?[\s_]*(\d+)"
# The joints of OpenPose by their number: BODY_25, and COCO without the feet and the mid hip.
_BODY_25 = list(BODIES["openpose"].parents)
_OPENPOSE = {25: _BODY_25, 18: _BODY_25[:8] + _BODY_25[9:19]}
# From so many points on FreeMoCap has the body with hands and face.
_WITH_FACE = 553
_SUBJECT = re.compile(r"track|individual|animal|person|subject", re.IGNORECASE)
# Tracking states of Kinect in words.
_STATES = {"nottracked": "0", "inferred": "0.5", "tracked": "1", "true": "1", "false": "0"}
# Without a unit, times with steps of at most 1 are seconds, with steps of at most 1000
# milliseconds, then microseconds, ticks of 100 ns, and nanoseconds.
_UNITS = {1: 1, 1e3: 1e3, 1e5: 1e6, 1e6: 1e7, math.inf: 1e9}
_LARGEST_FRAME = 1e12
_SPLIT = "If it holds several trials, split it: to_trials(pd.read_csv(path), by=..., time=...)."


# -- formats ----------------------------------------------------------------------------


def read_table(path):
    """A table of text of joints by axes, or of other columns, as readers of `motion` return it."""
    return _assemble(read_cells(path))


def read_mediapipe(path):
    """A table of MediaPipe's landmarks, which are named as in `Skeleton.mediapipe`."""
    motion = _assemble(read_cells(path), up="-y")
    return motion | {"joints": name_landmarks(motion["joints"]) or motion["joints"]}


def read_deeplabcut(path):
    """What DeepLabCut writes, as text or HDF5."""
    head = path.read_bytes()[:_HEAD]
    if not head.startswith(_HDF5):
        n_header = 3 + (b"\nindividuals" in head)
        return _assemble(read_cells(path, n_header), frame=0, units="px")
    with naming(path, "needs the package tables (pip install tables) and a table of DeepLabCut"):
        df = pd.read_hdf(path)
        table = df.set_axis(range(df.shape[1]), axis=1).reset_index(drop=True)
        table[df.shape[1]] = df.index.to_numpy()
        return _assemble(Cells(path, [*df.columns, ("frame",)], table), units="px")


def read_sleap(path):
    """What SLEAP writes for analysis, as text or HDF5."""
    if not path.read_bytes().startswith(_HDF5):
        return _assemble(read_cells(path), units="px")
    with (
        naming(path, "needs h5py (pip install h5py) and an analysis of SLEAP"),
        import_module("h5py").File(path) as file,
    ):
        nodes, names = ([decode(x) for x in file[f"{x}_names"][:]] for x in ("node", "track"))
        shape = file["tracks"].shape
        check_result_size(path, path.stat().st_size, 8 * math.prod(shape), f"tracks {shape}")
        tracks = file["tracks"][:].astype(np.float64)
        scores = file["point_scores"][:].astype(np.float64) if "point_scores" in file else None
        # The order is (frames, tracks, nodes, axes), or for MATLAB (tracks, axes, nodes, frames).
        if shape[1:] not in [(len(names) or 1, len(nodes), n_axes) for n_axes in (2, 3)]:
            tracks = tracks.transpose(3, 0, 2, 1)
            scores = None if scores is None else scores.transpose(2, 0, 1)
        names = names if len(names) == tracks.shape[1] else map(str, range(tracks.shape[1]))
        return _motion(nodes, tracks, scores, list(names), units="px")


def read_openpose(path):
    """A folder of OpenPose, which holds a file for each frame with the people in it."""
    file_of, people, size = {}, [], 0
    for file in list_frames(path):
        digits = re.findall(r"\d{1,12}", file.stem)
        frame = int(digits[-1]) if digits else None
        if frame is None or frame in file_of:
            raise ValueError(
                f"{file}: its name needs a number that no other file has, that of its frame. "
                "Keep the files of each video in a folder of its own, and others elsewhere."
            )
        file_of[frame] = file
        size += file.stat().st_size
        with naming(file, "needs 'people' with 'pose_keypoints_2d' by x, y and confidence"):
            for k, person in enumerate(json.loads(file.read_bytes())["people"]):
                points = person.get("pose_keypoints_2d", person.get("pose_keypoints"))
                number = int(np.ravel(person.get("person_id", -1))[0])
                values = np.array(points, dtype=np.float64).reshape(-1, 3)
                people.append((frame, str(number if number >= 0 else k), values))
    shapes = {values.shape for *_, values in people}
    if len(shapes) != 1:
        raise ValueError(f"{path}: all people need as many key-points, got {sorted(shapes)}.")
    frames, subjects, values = zip(*people, strict=True)
    rows = np.array(frames), subjects, np.stack(values)
    values, _, names = _on_frames(path, size, *rows, present=[*file_of])
    if len(names) > 1:
        warn(
            f"{path.name} has up to {len(names)} people in a frame. OpenPose counts them in each "
            "frame anew, so that a number may stand for different people."
        )
    joints = _OPENPOSE.get(values.shape[2]) or [f"point_{k}" for k in range(values.shape[2])]
    # It may be told to write shares of the picture.
    units = "px" if np.nanmax(np.abs(values[..., :2]), initial=0) > 1 else None
    facts = {"units": units, "first_frame": min(file_of)}
    names = names if len(names) > 1 else [""]
    return _motion(joints, values[..., :2], values[..., 2], names, **facts)


def list_frames(path):
    """The files of a folder of OpenPose; none of another folder, or of a file."""
    files = sorted(path.iterdir()) if path.is_dir() else []
    files = [x for x in files if x.suffix.lower() == ".json"]
    if named := [x for x in files if x.stem.lower().endswith("_keypoints")]:
        return named
    return files if files and b'"people"' in files[0].read_bytes() else []


def read_array(path):
    """An array of NumPy (n_frames, n_joints, 2 or 3), such as one of FreeMoCap."""
    with naming(path, "needs an array of numbers (n_frames, n_joints, 2 or 3)"):
        array = np.load(path, mmap_mode="r", allow_pickle=False)
        if array.dtype.kind not in "fiu" or array.shape[2:] not in ((2,), (3,)) or not array.size:
            raise ValueError(f"It holds {array.dtype} of the shape {array.shape}.")
        values = np.where(np.isfinite(array), array, np.nan).astype(np.float64)[:, None]
    joints = [f"point_{k}" for k in range(values.shape[2])]
    if len(joints) == len(_MEDIAPIPE) or len(joints) >= _WITH_FACE:
        joints[: len(_MEDIAPIPE)] = _MEDIAPIPE
    return _motion(joints, values, None, [""])


def name_landmarks(joints):
    """The joints as `Skeleton.mediapipe` names them; None if they are not its landmarks.

    They are known by names in any spelling, or as 33 numbered landmarks in order.
    """
    numbered = [re.fullmatch(_NUMBERED, joint, re.IGNORECASE) for joint in joints]
    if len(joints) == len(_MEDIAPIPE) and all(numbered):
        steps = np.diff([float(each[1]) for each in numbered])
        return list(_MEDIAPIPE) if (steps == 1).all() else None
    name_of = {name.replace("_", ""): name for name in _MEDIAPIPE}
    names = [name_of.get(re.sub(r"[^a-z0-9]", "", x.lower()), x) for x in joints]
    return names if set(_MEDIAPIPE) <= set(names) else None


def joints_of_header(path, head):
    """The joints that the first line of a table of text names."""
    if path.suffix.lower() not in (".csv", ".tsv", ".txt"):
        return []
    return parse_columns(split_cells((head.splitlines() or [b""])[0])[0]).joints


def is_sleap(path, head):
    """Whether a file is one of SLEAP by its columns, or the names in a file of HDF5."""
    is_hdf5 = head.startswith(_HDF5)
    return b"node_names" in path.read_bytes() if is_hdf5 else head.startswith(b"track,frame_idx,")


# -- tables with a column for each number, and names of the columns ------------------------------


@contextlib.contextmanager
def naming(path, what):
    """Whatever libraries raise becomes a ValueError that names the file."""
    try:
        yield
    except Exception as error:
        message = str(error)[:400]
        message = message if message.startswith(str(path)) else f"{path} {what}. {message[:200]}"
        raise ValueError(message) from error


class Cells(NamedTuple):
    """The cells of a table: labels of its columns, and the number of the line of each row."""

    path: Path
    labels: list
    table: pd.DataFrame
    lines: list | None = None

    def numbers(self, place, words=None):
        """A column as floats, NaN where a cell is blank or infinite; words may stand for some."""
        cells = self.table[place]
        if cells.dtype.kind not in "fiu":
            if words:
                cells = cells.map(lambda x: words.get(str(x).lower(), x))
            numbers = pd.to_numeric(cells, errors="coerce")
            wrong = (numbers.isna() & cells.notna()).to_numpy()
            if wrong.any():
                row = int(wrong.argmax())
                raise ValueError(
                    f"{self.path}, {f'line {self.lines[row]}' if self.lines else f'row {row}'}: "
                    f"column {str(self.labels[place])[:60]!r} needs numbers, or nothing where one "
                    f"is missing, got {str(cells.iloc[row])[:60]!r}."
                )
            cells = numbers
        values = cells.to_numpy(dtype=np.float64, na_value=np.nan)
        return np.where(np.isfinite(values), values, np.nan)

    def is_text(self, place):
        return self.table[place].dtype.kind not in "fiub" and self.table[place].notna().any()


def split_cells(line):
    """The cells of a line, and the character between them."""
    separator = max((b",", b"\t", b";"), key=line.count)
    return [decode(cell).strip(' "\t') for cell in line.split(separator)], separator


def read_cells(path, n_header=1):
    """The rows of a table of text below the lines of its header."""
    text = MotionText(path)
    levels, (*_, separator) = zip(*(split_cells(text.row()) for _ in range(n_header)), strict=True)
    n = len(levels[-1])
    if len({len(level) for level in levels}) > 1 or not re.search("[A-Za-z]", "".join(levels[0])):
        raise text.error("a header needs a name above each column, such as 'hip_x'.")
    rows, lines = [], []
    while row := text.row():
        n_cells = row.count(separator) + 1
        if b'"' not in row and not row.rstrip(separator).count(separator) < n <= n_cells:
            raise text.error(
                f"a row needs {counted(n, 'column')}, as the header has, got {n_cells} "
                f"({quote([row])}). The file is not complete, or does not begin with names."
            )
        rows.append(row)
        lines.append(text.line_number)
    if not rows:
        raise text.error("the file ends where frames should follow; it is not complete.")
    options = {"sep": separator.decode(), "skipinitialspace": True, "skip_blank_lines": False}
    options |= {"encoding_errors": "replace", "low_memory": False, "index_col": False} | EXACT
    if separator != b"," and re.search(rb"\d,\d", rows[0]):
        options["decimal"] = ","
    with naming(path, "holds rows that are no table"):
        data = io.BytesIO(b"\n".join(rows))
        table = pd.read_csv(data, header=None, names=range(n), usecols=range(n), **options)
        if len(table) != len(rows):
            raise ValueError("A quotation mark has no end.")
    labels = list(zip(*levels, strict=True)) if n_header > 1 else levels[0]
    return Cells(path, labels, table, lines)


# -- what all share: frames, subjects, times, joints and their confidence ------------------


def _assemble(cells, frame=None, **facts):
    """A table as a reader of `motion.FORMATS` returns it."""
    labels, columns = cells.labels, parse_columns(cells.labels)
    at, time, seconds = find_clock(labels)
    frame = at if frame is None else frame
    frame, time = (None if x is None or cells.is_text(x) else x for x in (frame, time))
    subject = None
    if columns.joints:
        subject = next((x for x in columns.rest if _SUBJECT.fullmatch(str(labels[x]))), None)
        taken = [*columns.places.flat, *columns.confidence]
    else:
        taken = [x for x in columns.rest if x not in (frame, time) and not cells.is_text(x)]
    texts = [labels[x] for x in columns.rest if cells.is_text(x)]
    if not taken or (not columns.joints and len(texts) > len(taken)):
        raise ValueError(
            f"{cells.path} is no recording, most of its columns are text: {listed(texts)}."
        )
    seen, qualities = {*taken, frame, time, subject}, set(columns.confidence)
    left = [str(label) for x, label in enumerate(labels) if x not in seen]
    facts |= {"left_out": f"the columns {listed(left)}"} if left else {}
    blank = np.full(len(cells.table), np.nan)
    values = [
        blank if x < 0 else cells.numbers(x, _STATES if x in qualities else None) for x in taken
    ]
    values = np.stack(values, axis=1)
    times = None if time is None else cells.numbers(time)
    numbers = np.arange(len(values)) if frame is None else cells.numbers(frame)
    if frame is None and None not in (time, subject):
        numbers = np.unique(times, return_inverse=True)[1]
    subjects = pd.Series([""] * len(values)) if subject is None else cells.table[subject]
    order = subjects.groupby(numbers).cumcount()
    subjects = subjects.astype(object).where(subjects.notna(), order).map(str).tolist()
    size = cells.path.stat().st_size
    values, frames, names = _on_frames(cells.path, size, numbers, subjects, values)
    if frame is not None:
        facts["first_frame"] = int(numbers.min())
    if time is not None:
        facts["times"] = _read_times(cells, time, times, seconds, frames)
    if not columns.joints:
        facts["channels"] = make_unique([str(labels[x]) for x in taken])
        return {"kind": "values", "values": values[:, 0]} | facts
    if columns.units:
        facts["units"] = "px" if columns.units.startswith("p") else columns.units
    # Of four levels, as of DeepLabCut, the second is the individual.
    has_individuals = isinstance(labels[1], tuple) and len(labels[1]) == 4
    of_joints = [labels[x][1] for x in columns.places[:, 0]] if has_individuals else None
    positions, confidence = np.split(values, [columns.places.size], axis=2)
    positions = positions.reshape(*positions.shape[:2], *columns.places.shape)
    confidence = confidence if max(columns.confidence) >= 0 else None
    return _motion(columns.joints, positions, confidence, names, of_joints, **facts)


def _on_frames(path, size, numbers, subjects, values, present=None):
    """Rows (n_rows, ...) as (n_frames, n_subjects, ...), their frames, and the subjects.

    Frames without a row are NaN. A warning tells of those that are not in ``present`` either.
    """
    if not (np.abs(numbers) < _LARGEST_FRAME).all() or (numbers != np.round(numbers)).any():
        raise ValueError(f"{path}: frames need whole numbers, got {numbers[:5].tolist()}.")
    present = np.unique(numbers if present is None else present).astype(np.int64)
    step = int(np.gcd.reduce(np.diff(present))) or 1
    frames = (numbers.astype(np.int64) - present[0]) // step
    n_frames = int(present[-1] - present[0]) // step + 1
    names = sorted(set(subjects), key=lambda name: (len(name), name))
    people = pd.Index(names).get_indexer(subjects)
    shape = (n_frames, len(names), *values.shape[1:])
    check_result_size(path, size, 8 * math.prod(shape), counted(n_frames, "frame"))
    twice = pd.DataFrame({0: frames, 1: people}).duplicated()
    if twice.any():
        raise ValueError(f"{path}: frame {numbers[twice.argmax()]:g} comes twice. {_SPLIT}")
    if n_frames > len(present):
        warn(
            f"{path.name} skips {counted(n_frames - len(present), 'frame')} after frame "
            f"{present[:-1][np.diff(present) > step][0]}, whose positions are missing (NaN)."
        )
    placed = np.full(shape, np.nan)
    placed[frames, people] = values
    return placed, frames, names


def _read_times(cells, place, times, seconds, frames):
    """Times of all frames in seconds, between others where there is no row."""
    label = str(cells.labels[place])[:60]
    first = pd.Series(times).groupby(frames).first()
    times = np.interp(np.arange(frames.max() + 1), first.index, first)
    steps = np.diff(times)
    if not np.isfinite(times).all() or (steps < 0).any():
        raise ValueError(f"{cells.path}: times of {label!r} must not decrease or miss. {_SPLIT}")
    units = 1 if seconds is None else round(1 / seconds)
    if seconds is None and len(steps) and np.median(steps) > 1:
        units = next(unit for longest, unit in _UNITS.items() if np.median(steps) <= longest)
        warn(
            f"{cells.path.name}: the times of {label!r} name no unit, and by their steps of "
            f"{np.median(steps):g} they count {units:g} a second. If not, give frame_rate=."
        )
    return times / units


def _motion(joints, values, confidence, names, of_joints=None, **facts):
    """What a reader of `motion.FORMATS` returns, of (n_frames, n_subjects, n_joints, n_axes)."""
    n_frames, _, n_joints, n_axes = values.shape
    values = values.reshape(n_frames, -1, n_axes).copy()
    facts = {"kind": "keypoints"} | facts
    if confidence is not None:
        facts["confidence"] = confidence.reshape(n_frames, -1)
        # Zeros without any confidence are joints that were not seen.
        values[(values == 0).all(axis=2) & (facts["confidence"] == 0)] = np.nan
    if n_axes == 2 and (confidence is not None or facts.get("units") == "px"):
        facts["up"] = "-y"
    subjects = [name or of for name in names for of in of_joints or [""] * n_joints]
    joints = list(joints) * len(names) if any(subjects) else make_unique(joints)
    return {"joints": joints, "subjects": subjects, "positions": values} | facts


# Name, endings, what tells it by path and first bytes, and reader, as `motion.MotionFormat`.
KEYPOINT_FORMATS = [
    ("sleap", (), is_sleap, read_sleap),
    ("deeplabcut", (".h5", ".hdf5"), lambda _, x: x.startswith(b"scorer"), read_deeplabcut),
    ("openpose", (), lambda path, _: bool(list_frames(path)), read_openpose),
    ("mediapipe", (), lambda *x: name_landmarks(joints_of_header(*x)) is not None, read_mediapipe),
    ("array", (".npy",), lambda _, x: x.startswith(b"\x93NUMPY"), read_array),
    ("table", (".csv", ".tsv"), lambda *x: bool(joints_of_header(*x)), read_table),
]
