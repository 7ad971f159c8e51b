"""What the readers of text files share, and the tables of OpenSim, MOT and STO."""

import array
import inspect
import io
import math
import os
import warnings
from collections import Counter

import numpy as np
import pandas as pd

from ..body.landmarks import guess_feet, guess_landmarks
from ..inputs.resampling import is_rate
from ..inputs.wording import counted

# No number of a file is larger, in any unit; and no position or angle: 10 km in millimetres.
_LARGEST, FARTHEST = 1e12, 1e7
# Coordinates that Cortex writes for a marker it did not see.
UNSEEN = 9999999.0
# Bytes of a table that are parsed at once: memory beside the file and its numbers stays constant.
PORTION = 2**22
# The characters of plain decimal numbers and of the blanks between them.
_PLAIN = b"0123456789+-.eE \t\n"
# Before pandas 3.1 the last digit is right only with this option; since then it is deprecated.
_OLD = tuple(map(int, pd.__version__.split(".")[:2])) < (3, 1)
EXACT = {"float_precision": "round_trip"} if _OLD else {}
# What programs write for a missing number, without its sign.
_MISSING = {b"", b"nan", b"na", b"n/a", b"null", b"none", b"inf", b"infinity"}
_MISSING |= {b"1.#ind", b"1.#inf", b"1.#qnan", b"1.#snan", b"nan(ind)", b"nan(snan)"}
# A small file may describe a huge result (many joints that never move, many short frames, a
# compressed archive of zeros). The result of a real recording is about as large as its file.
_LARGE_RESULT = 64 * 2**20
_MAX_GROWTH = 32


class MotionText:
    """The words of a text file, one by one or line by line, and their line numbers.

    Words are bytes: old files hold any encoding in their comments.
    """

    def __init__(self, path):
        data = path.read_bytes().removeprefix(b"\xef\xbb\xbf")
        if b"\r" in data:
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

    def row(self, blanks=None):
        """The next line that has more than `blanks`, by default words; empty at the end."""
        while line := self._lines.readline():
            self.line_number += 1
            if line.strip(blanks):
                self.is_whole = line.endswith(b"\n")
                return line.removesuffix(b"\n")
        return b""

    def line(self):
        """The words of the next line that has any, or what is left of this one; [] at the end."""
        words, self._words = self._words[::-1], []
        return words or self.row().split()

    def lines(self):
        """The words of all lines that have any."""
        for line in self._lines:
            self.line_number += 1
            if words := line.split():
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
            raise self.error(
                f"{what} needs {counted(n, 'number')}, got {len(words)} ({quote(words)})."
            )
        try:
            numbers = array.array("d", map(float, words))
        except ValueError:
            numbers = array.array("d", [math.nan])
        # Python accepts 1_0 as a number; no file means it.
        if b"_" in b"".join(words) or not math.hypot(*numbers) < _LARGEST:
            for word in words:
                if not _is_number(word):
                    raise self.error(
                        f"{what} needs finite numbers below {_LARGEST:g}, got {quote([word])}."
                    )
        return numbers

    def positive(self, words, what):
        """A single number above 0, neither so small nor so large that its inverse overflows."""
        (number,) = self.numbers(words, 1, what)
        if not number > 1 / _LARGEST:
            raise self.error(f"{what} must be above 0, got {number!r}.")
        return number

    def count(self, word, what):
        """A whole number, 0 or more."""
        if not _is_number(word) or not 0 <= float(word) == int(float(word)):
            raise self.error(f"{what} needs a whole number, 0 or more, got {quote([word])}.")
        return int(float(word))

    def table(self, n, what):
        """The lines that are left, `n` finite numbers each, as an array (n_lines, n)."""
        rows = []
        while self.n_left:
            start = self._lines.tell()
            portion = self._lines.read(PORTION) + self._lines.readline()
            numbers = _plain_numbers(portion, n)
            if numbers is not None:
                rows.append(numbers)
                self.line_number += portion.count(b"\n") + (not portion.endswith(b"\n"))
                continue
            # Line by line: this finds the line of an error, if there is one.
            self._lines.seek(start)
            while self._lines.tell() < start + len(portion) and (words := self.line()):
                rows.append(np.array([self.numbers(words, n, what)]))
        return np.concatenate(rows or [np.empty((0, n))])

    def check_count(self, n, n_stated, name, noun="frame"):
        """Warn, in the caller of `read_motion`, if a file states another number than it has.

        It is refused if its last line has no end, with which frames may have been lost.
        """
        if n_stated in (None, n):
            return
        contradiction = f"{name} says {n_stated}, but {counted(n, noun)} follow{'s' * (n == 1)}"
        if not self._lines.getvalue().endswith(b"\n"):
            raise self.error(
                f"{contradiction}, and the last line has no end: the file is not complete. Export "
                "it again, or remove its last line, which may lack digits."
            )
        warn(
            f"{self.path.name}: {contradiction}; what is there is read. If the file is not "
            "complete, export it again."
        )

    def check_size(self, n_frames, n_joints):
        """Refuse positions out of all proportion to the file, before they are made."""
        n_bytes = 24 * n_frames * n_joints
        shape = f"{counted(n_frames, 'frame')} of {counted(n_joints, 'joint')}"
        check_result_size(self.path, self.size, n_bytes, shape)

    def error(self, message):
        return ValueError(f"{self.path}, line {self.line_number}: {message}")


def warn(message):
    """Warn in the first caller outside of the package."""
    package, level, frame = __name__.partition(".")[0], 1, inspect.currentframe()
    while frame is not None and frame.f_globals.get("__name__", "").startswith(f"{package}."):
        level, frame = level + 1, frame.f_back
    warnings.warn(message, UserWarning, stacklevel=level)


def choose_group(path, groups, group, others):
    """The facts of a group of a file, which must have members; `others` counts what is in none."""
    if group in groups and groups[group]["n"]:
        return {
            "kind": group,
            "units": groups[group]["units"],
            "frame_rate": groups[group]["frame_rate"],
            "groups": groups,
            "left_out": ", ".join(describe_groups(groups, group, others)),
        }
    there = [f"{name!r} ({facts['n']})" for name, facts in groups.items() if facts["n"]]
    unread = "".join(f", not its {counted(n, noun)}" for noun, n in others.items() if n)
    raise ValueError(
        f"{path}: there are no {group[:40]} in this file; read_motion(..., group=...) reads "
        f"{', '.join(there)[:300] or 'none'}{unread[:200]}."
    )


def check_result_size(path, file_size, n_bytes, what):
    """Refuse a result of `n_bytes` from a file of `file_size` bytes, before it is made."""
    if n_bytes > max(_LARGE_RESULT, _MAX_GROWTH * file_size):
        raise ValueError(
            f"{path}: {what} would take {n_bytes / 2**20:.0f} MB, from a file of "
            f"{file_size / 2**20:.2f} MB. No recording grows like that, so the file is probably "
            "damaged. Remove the joints or the frames that are not needed."
        )


def _plain_numbers(text, n):
    """Lines of `n` plain finite numbers each, as an array; None if they are anything else."""
    if text.translate(None, _PLAIN):
        return None
    if text.isspace():
        return np.empty((0, n))
    try:
        numbers = pd.read_csv(
            io.BytesIO(text),
            header=None,
            sep=r"\s+",
            dtype=np.float64,
            na_filter=False,
            engine="c",
            low_memory=False,
            **EXACT,
        ).to_numpy()
    except ValueError:
        return None
    limited = max(numbers.max(), -numbers.min()) < _LARGEST
    return numbers if numbers.shape[1] == n and limited else None


def _is_number(word, below=_LARGEST):
    try:
        return abs(float(word)) < below and b"_" not in word
    except ValueError:
        return False


# -- rows that begin with their time: TRC, MOT and STO ----------------------------------


def split_fields(row, n=None):
    """The fields between tabs, or between blanks in a row without tabs.

    Blank ones behind the first `n` are left out.
    """
    fields = [field.strip() for field in row.split(b"\t")] if b"\t" in row else row.split()
    while n is not None and len(fields) > n and not fields[-1]:
        fields.pop()
    return fields


def split_rows(text, rows, n, separator=None):
    """The `n` fields of each row, by default as `split_fields` finds them.

    Those of markers at its end may be absent from a whole line; they are blank.
    """
    for i, row in enumerate(rows):
        fields = row.split(separator) if separator else split_fields(row, n)
        missing = n - len(fields)
        has_gaps = missing % 3 == 0 and (separator or b"\t" in row) and text.is_whole
        if (missing > 0 and not has_gaps) or b"".join(fields[n:]).strip():
            raise text.error(
                f"a row needs {n} fields, got {len(fields)} ({quote([row])}). A marker that was "
                "not seen is left blank, between as many separators."
            )
        if missing > 0:
            # They take no bytes of the file.
            text.check_size(i, n // 3)
            fields = fields + [b""] * missing
        yield fields


def read_timed_rows(text, rows, time_column, what="time"):
    """Rows of numbers, NaN where one is missing, and how many decimals the times have.

    `rows` yields the fields of one row after the other, as they are read from `text`. The column
    may have the number of the frame in place of its time, or None has neither.
    """
    result, decimals, before = [], 0, -math.inf
    for fields in rows:
        numbers = numbers_or_nan(text, fields)
        time = 0.0 if time_column is None else numbers[time_column]
        if not -_LARGEST < time < _LARGEST or time < before:
            raise text.error(
                f"the {what} of a row must be a number, and not lie before that of the row above, "
                f"got {time:g} after {before:g}."
            )
        before = time
        word = fields[time_column or 0].strip().lower()
        decimals = max(decimals, 17 if b"e" in word else len(word.partition(b".")[2]))
        result.append(numbers)
    if not result:
        raise text.error("the file ends where frames should follow; it is not complete.")
    return np.frombuffer(bytearray().join(result)).reshape(len(result), -1), decimals


def read_rate(word):
    """Frames a second as the header states them; None if it states no such number."""
    try:
        rate = float(word)
    except (TypeError, ValueError):
        return None
    return rate if is_rate(rate) else None


def numbers_or_nan(text, fields):
    try:
        numbers = array.array("d", map(float, fields))
        # Python accepts 1_0 as a number; no file means it.
        if not any(map(math.isinf, numbers)) and b"_" not in b"".join(fields):
            return numbers
    except ValueError:
        pass
    numbers = array.array("d")
    for field in fields:
        is_missing = field.strip().lower().lstrip(b"+-") in _MISSING
        if not is_missing and not _is_number(field, math.inf):
            raise text.error(
                f"a frame needs numbers, or nothing where one is missing, got {quote([field])}."
            )
        numbers.append(math.nan if is_missing else float(field))
    return numbers


def hide_unseen(positions):
    """NaN where a marker has no position, or the one that writers give to markers not seen."""
    zero = (positions == 0).all(axis=2)
    unseen = np.isnan(positions).any(axis=2) | (positions == UNSEEN).all(axis=2)
    if not (zero | unseen).all():
        unseen |= zero
    positions[unseen] = np.nan
    return positions


# -- names and quotations ---------------------------------------------------------------


def quote(words):
    """Words as an error message quotes them, never more than a line."""
    text = decode(b" ".join(words[:8])[:61])
    return repr(text if len(text) <= 60 else text[:60] + "...")


def decode(name):
    """The text of a name: UTF-8, or ISO-8859-1 if it is not."""
    try:
        return name.decode("utf-8")
    except UnicodeDecodeError:
        return name.decode("latin-1")


def make_unique(names):
    """The names, with ``_2``, ``_3``, ... behind those that came before."""
    used, number, result = set(names), Counter(), []
    for name in names:
        number[name] += 1
        new = name if number[name] == 1 else f"{name}_{number[name]}"
        # Counting on from the last number keeps this linear.
        while number[name] > 1 and new in used:
            number[name] += 1
            new = f"{name}_{number[name]}"
        used.add(new)
        result.append(new)
    return result


def split_subjects(names, among=None):
    """Names of markers without the prefixes that name subjects, and the subject of each.

    A prefix is what is before the last colon, as in "Ann:LASI", where several names have it
    (`among` lists all of a file, by default `names`); or what is before an underscore in every
    name, as in "Ann_LASI", where landmarks are known by what is left. The subject of other names
    is "".
    """
    among = names if among is None else among
    shared = Counter(name.rpartition(":")[0] for name in among if not name.endswith(":"))
    pairs = [name.rpartition(":") for name in names]
    subjects = [a if shared[a] > 1 and b else "" for a, _, b in pairs]
    if not any(subjects) and (prefix := _common_prefix(among)):
        subjects = [prefix] * len(names)
    markers = [n[len(s) + 1 :] if s else n for n, s in zip(names, subjects, strict=True)]
    return markers if any(subjects) else make_unique(markers), subjects


def as_joints(names, values, among=None):
    """The positions of markers and their names, of which `split_subjects` takes the prefixes."""
    joints, subjects = split_subjects(names, among)
    positions = values.reshape(len(values), len(joints), -1)[:, :, :3].copy()
    return {"joints": joints, "subjects": subjects, "positions": positions}


def _common_prefix(names):
    """What is before an underscore in every name, without a side, if half of the rest is known."""
    prefix = os.path.commonprefix(names).rpartition("_")[0]  # noqa: RUF071
    while prefix.lower().rpartition("_")[2] in ("l", "r", "left", "right"):
        prefix = prefix.rpartition("_")[0]
    rest = [name[len(prefix) + 1 :] for name in names]
    if len(rest) < 2 or not prefix:
        return ""
    landmarks = guess_landmarks(rest)
    known = {*landmarks.values(), *guess_feet(rest, landmarks).values()}
    return prefix if 2 * len(known) >= len(rest) else ""


def describe_groups(groups, group, others):
    """The contents of a file beside a group; `others` counts those that are in no group."""
    contents = []
    for name, facts in groups.items():
        if name != group and facts["n"]:
            noun = "analog channel" if name == "analog" else name.removesuffix("s")
            rate = facts["frame_rate"] if name == "analog" else None
            contents.append(
                counted(facts["n"], noun) + ("" if rate is None else f" at {rate:g} Hz")
            )
    return contents + [counted(n, noun) for noun, n in others.items() if n]


# -- MOT and STO -----------------------------------------------------------------------------------

# The components of a column, by the DataType of the file.
_COMPONENTS = {
    b"vec2": "xy",
    b"vec3": "xyz",
    b"unitvec3": "xyz",
    b"quaternion": "wxyz",
    b"vec4": "1234",
    b"vec5": "12345",
    b"vec6": "123456",
    b"spatialvec": "123456",
}
_FORCES = ("force", "torque", "moment")
_ANGLE_UNITS = dict.fromkeys((b"yes", b"y", b"true", b"1"), "deg")
_ANGLE_UNITS |= dict.fromkeys((b"no", b"n", b"false", b"0"), "rad")


def read_storage(path):
    """A MOT or STO file as a reader of `motion.FORMATS` returns it."""
    text = MotionText(path)
    header = _read_header(text)
    labels = _read_labels(text)
    components = _COMPONENTS.get(header.get(b"datatype"), "")
    rows = _split_rows(text, len(labels), len(components))
    values, decimals = read_timed_rows(text, rows, time_column=0)
    for key, name in ((b"nrows", "nRows"), (b"datarows", "datarows")):
        if key in header:
            text.check_count(len(values), text.count(header[key], name), name)
    forces = all(any(word in label.lower() for word in _FORCES) for label in labels)
    columns = [f"{a}_{b}" for a in labels for b in components] if components else labels
    return {
        "channels": make_unique(columns),
        "values": values[:, 1:].copy(),
        "times": values[:, 0].copy(),
        "decimals": decimals,
        "frame_rate": read_rate(header.get(b"datarate", b"")),
        "units": None if forces else _ANGLE_UNITS.get(header.get(b"indegrees")),
        "kind": "forces" if forces else "coordinates",
    }


def _read_header(text):
    """The values above 'endheader' by their names, both in small letters."""
    header = {}
    while row := text.row().strip():
        row = b" ".join(row.lower().split())
        if row == b"endheader":
            return header
        key, _, value = row.partition(b"=" if b"=" in row else b" ")
        header[key.strip()] = value.strip()
    raise text.error("the file ends where 'endheader' should follow; it is not complete.")


def _read_labels(text):
    """Names of the columns behind the time."""
    labels = split_fields(text.row(), 0)
    if len(labels) < 2 or labels[0].lower() != b"time" or b"" in labels:
        raise text.error(
            f"expected 'time' and the names of the other columns, got {quote(labels)}."
        )
    return [decode(label) for label in labels[1:]]


def _split_rows(text, n_labels, n_components):
    """The time and the components of every row."""
    n = 1 + n_labels
    while row := text.row():
        fields = row.split()
        if len(fields) != n:
            fields = split_fields(row, n)
        values = fields
        if n_components:
            values = [value for x in fields[1:] for value in x.strip(b"~[]()").split(b",")]
            values = fields[:1] + values
        if len(fields) != n or len(values) != 1 + n_labels * max(n_components, 1):
            commas = f" of {n_components} numbers, with commas between them" * bool(n_components)
            raise text.error(
                f"a row needs its time and {counted(n_labels, 'column')}{commas}, got "
                f"{quote([row])}."
            )
        yield values
