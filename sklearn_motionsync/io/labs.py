"""Exports of laboratories: TRC, Vicon Nexus, Qualisys QTM, OptiTrack Motive and Xsens MVN."""

import itertools
import math
import operator
import re
from collections import Counter
from xml.etree import ElementTree

import numpy as np

from ..body.skeleton import find_cycle
from ..inputs.wording import counted
from .text import (
    MotionText,
    as_joints,
    choose_group,
    decode,
    hide_unseen,
    make_unique,
    numbers_or_nan,
    quote,
    read_rate,
    read_timed_rows,
    split_fields,
    split_rows,
)


def _cells(row, separator=b","):
    return [cell.strip().strip(b'"').strip() for cell in row.split(separator)]


def _read_columns(text, rows, columns, n, time_column, separator=b",", what="time"):
    """The numbers in columns of `n`, NaN where a cell is blank, and the decimals of the times."""
    picked = map(operator.itemgetter(*columns), split_rows(text, rows, n, separator))
    return read_timed_rows(text, picked, time_column, what)


# -- TRC: markers in columns of text, as OpenSim, Pose2Sim, Cortex and Vicon write them ------------

_TRC_AXIS = re.compile(rb"[XYZxyz]\d*")


def read_trc(path):
    """A TRC file as a reader of `motion.FORMATS` returns it; markers that were not seen are NaN."""
    text = MotionText(path)
    first = split_fields(text.row())
    if not first or not first[0].lower().startswith(b"pathfiletype"):
        raise text.error(
            f"expected 'PathFileType', with which TRC files begin, got {quote(first)}."
        )
    header = _read_trc_header(text)
    names, row = _read_trc_names(text, header)
    n = 2 + 3 * len(names)
    rows = itertools.chain([row] * bool(row), iter(text.row, b""))
    values, decimals = read_timed_rows(text, split_rows(text, rows, n), time_column=1)
    text.check_count(len(values), header["numframes"], "NumFrames")
    text.check_count(len(names), header["nummarkers"], "NumMarkers", "marker")
    motion = as_joints(names, values[:, 2:])
    hide_unseen(motion["positions"])
    return motion | {
        "times": values[:, 1].copy(),
        "decimals": decimals,
        "frame_rate": header["datarate"],
        "units": header["units"],
        "kind": "markers",
        "first_frame": int(values[0, 0]) if math.isfinite(values[0, 0]) else None,
    }


def _read_trc_header(text):
    """The values that stand below their names, by the names in small letters."""
    keys = [key.lower() for key in text.line()]
    if b"numframes" not in keys and b"datarate" not in keys:
        raise text.error(
            f"expected 'DataRate CameraRate NumFrames NumMarkers Units ...', got {quote(keys)}."
        )
    row = text.row()
    words = row.split()
    # A unit may be left out between its tabs.
    values = dict(zip(keys, words if len(words) == len(keys) else split_fields(row), strict=False))
    counts = {
        name.lower(): text.count(values[key], name) if key in values else None
        for name, key in (("NumFrames", b"numframes"), ("NumMarkers", b"nummarkers"))
    }
    return counts | {
        "datarate": read_rate(values.get(b"datarate", b"")),
        "units": decode(values.get(b"units", b"")) or None,
    }


def _read_trc_names(text, header):
    """Names of the markers, and the first row of numbers."""
    labels = split_fields(text.row())
    if len(labels) < 2 or b"frame" not in labels[0].lower() or b"time" not in labels[1].lower():
        raise text.error(
            f"expected 'Frame# Time' and the names of the markers, got {quote(labels)}."
        )
    labels = labels[2:]
    names = [label for label in labels if label]
    line_number, row = text.line_number, text.row()
    axes = [field for field in split_fields(row) if field]
    n = len(names) if header["nummarkers"] is None else header["nummarkers"]
    if axes and _TRC_AXIS.fullmatch(axes[0]):
        # X1 Y1 Z1 X2 Y2 Z2 ..., with any numbers.
        n, letters = len(axes) // 3, b"".join(axis[:1] for axis in axes).lower()
        if letters != b"xyz" * n:
            raise text.error(f"expected X1 Y1 Z1 X2 Y2 Z2 ..., got {quote(axes)}.")
        row = text.row()
    if len(names) != n and len(split_fields(row, 2 + 3 * len(names))) == 2 + 3 * len(names):
        # The columns of the first frame agree with the names.
        n = len(names)
    if len(names) != n or not n:
        # Some markers may have no name: then those of the others are in every third column.
        places = labels[: 3 * n : 3]
        if not n or len(places) != n or sum(map(bool, places)) != len(names):
            raise text.error(
                f"line {line_number} names {counted(len(names), 'marker')}, but there are columns "
                f"for {n}; each has its name in the first of its three columns, with tabs between "
                "them."
            )
        names = [name or b"marker_%d" % (j + 1) for j, name in enumerate(places)]
    return [decode(name) for name in names], row


# -- Vicon Nexus: sections below each other, each with its rate, names, axes, units and rows -------

VICON = re.compile(
    rb'(?im)^\s*"?(?:frame"? *[,;\t] *"?sub ?frame|(?:model outputs|trajectories|devices|joints|'
    rb'segments|events|gait cycle parameters)"?[,;\t ]*\r?\n"?(?:\d|subject))'
)
_AXES_ROW = re.compile(rb'(?i)\s*"?(?:frame|field ?#)"? *([,;\t])')
# Model outputs by their unit; where it is blank, their names end so.
_OUTPUTS = {
    "angles": "deg|rad",
    "forces": "k?n(/kg)?",
    "moments": "k?n[.*]?m?m(/kg)?",
    "powers": "m?w(/kg)?",
    "positions": "mm|cm|m",
}
# No device is so much faster than the cameras.
_MOST_SUB_FRAMES = 10000


def read_vicon(path, *, group="markers"):
    """A CSV of Vicon Nexus as a reader of `motion.FORMATS` returns it; blank cells are NaN.

    `group` is "markers", "analog" (or "devices"), or what the model outputs are, such as "angles".
    """
    group = "analog" if group == "devices" else group
    text = MotionText(path)
    sections, separator = _read_sections(text)
    members, entries, others = {}, [], Counter()
    for title, lines in sections:
        at = next((i for i, (*_, line) in enumerate(lines) if _AXES_ROW.match(line)), None)
        if at is not None:
            head = [_cells(line, separator) for *_, line in lines[: at + 2]]
            names, axes, units = head[at - 1] if at else [], head[at], head[-1]
            units = [] if units[0] else units  # a row of numbers
            table = read_rate(head[0][0]) if at > 1 else None, axes, lines[at + 1 + bool(units) :]
            for kind, found in _sort_columns(title.lower(), names, axes, units, others).items():
                number = sum(key.partition("_")[0] == kind for key in members) + 1
                members[kind if number == 1 else f"{kind}_{number}"] = (table, found)
        elif title.lower() == "events":
            entries += _read_events(text, lines, separator)
        elif lines:
            others[f"section {title[:40]!r}"] += 1
    groups = {}
    for name, ((rate, *_), of) in members.items():
        units = [unit for *_, unit in of]
        if not name.startswith("analog"):
            units = units[0] if len(set(units)) == 1 else None
        groups[name] = {"n": len(of), "units": units, "frame_rate": rate}
    facts = choose_group(path, groups, group, others)
    (rate, axes, lines), of = members[group]
    n_first = 1 + axes[1].lower().startswith(b"sub")
    columns = [*range(n_first), *(j for _, at, _ in of for j in at)]
    rows = (line for text.line_number, text.is_whole, line in lines)
    values, _ = _read_columns(text, rows, columns, len(axes), 0, separator, "frame")
    times = _read_times(text, values[:, :n_first], rate)
    facts |= {"events": entries, "first_frame": int(values[0, 0])}
    if rate is not None:
        facts |= {"times": times, "decimals": 17}
    names, values = [name for name, *_ in of], values[:, n_first:]
    if any(len(at) != 3 for _, at, _ in of):
        names = [f"{x}_{decode(axes[j]).lower()}" if at[1:] else x for x, at, _ in of for j in at]
        return facts | {"channels": make_unique(names), "values": values}
    # An output of a model is of a subject by the names of the markers.
    known = [x for key, (_, of) in members.items() if not key.startswith("analog") for x, *_ in of]
    facts |= as_joints(names, values, known)
    if group.startswith("markers"):
        hide_unseen(facts["positions"])
    return facts


def _read_sections(text):
    """Titles, each with its lines (number, whether it is whole, text), and what separates cells."""
    sections, lines = [], []
    while line := text.row():
        lines.append((text.line_number, text.is_whole, line))
    separator = next((found[1] for *_, x in lines if (found := _AXES_ROW.match(x))), None)
    if separator is None:
        raise ValueError(f"{text.path} is of no known format; Vicon's has 'Frame,Sub Frame,X,Y,Z'.")
    for number, is_whole, line in lines:
        # With semicolons numbers have decimal commas.
        line = line.replace(b",", b".") if separator == b";" else line
        cells = [b"0"] if line[:1].isdigit() else _cells(line, separator)
        if cells[0] and not cells[0][:1].isdigit() and not any(cells[1:]):
            sections.append((decode(cells[0]), []))
        elif sections and any(cells):
            sections[-1][1].append((number, is_whole, line))
    return sections, separator


def _read_events(text, lines, separator):
    """(label, context, time) of each row below a header, which names the columns."""
    events, keys = [], None
    for text.line_number, _, line in lines:
        cells = _cells(line, separator)
        if b"context" in (cell.lower() for cell in cells):
            keys = [cell.lower().partition(b" ")[0] for cell in cells]
        elif keys is not None:
            event = dict.fromkeys((b"name", b"context", b"time"), b"")
            event |= dict(zip(keys, cells, strict=False))
            (time,) = numbers_or_nan(text, [event[b"time"]])
            events.append((decode(event[b"name"]), decode(event[b"context"]), time))
    return events


def _sort_columns(title, names, axes, units, others):
    """(name, columns, unit) of the members of each group; `others` counts what is in none."""
    while len(axes) > 2 and not axes[-1]:
        axes.pop()
    names, units = (list(map(decode, x + [b""] * len(axes))) for x in (names, units))
    found, groups = [], {}
    for j in range(1 + axes[1].lower().startswith(b"sub"), len(axes)):
        # A name reaches to the next.
        if names[j] or not found:
            found.append((names[j] or f"marker_{j}", {}))
        axis = decode(axes[j])
        if title == "devices":
            # Channels of several force plates have the same names.
            name = f"{found[-1][0]} {axis}" if axes.count(axes[j]) > 1 or not axis else axis
            groups.setdefault("analog", []).append((name.strip(), [j], units[j] or None))
        else:
            found[-1][1].setdefault(axis.lower(), j)
    for name, at in found if title != "devices" else ():
        turns = any(axis[:1] == "r" for axis in at)
        others["rotation"] += turns
        axes_of = next((x for x in (["x", "y", "z"], ["tx", "ty", "tz"]) if {*x} <= {*at}), None)
        unit = units[at[axes_of[0]] if axes_of else next(iter(at.values()))] or None
        if axes_of:
            kind = "segments" if "tx" in axes_of else _kind_of(title, name, unit)
            groups.setdefault(kind, []).append((name, [at[axis] for axis in axes_of], unit))
        elif not turns:
            groups.setdefault("scalars", []).append((name, list(at.values()), unit))
    return groups


def _kind_of(title, name, unit):
    if title == "trajectories":
        return "markers"
    for kind, units in _OUTPUTS.items():
        ends_so = unit is None and name.lower().removesuffix("s").endswith(kind[:-1])
        if ends_so or (unit and re.fullmatch(units, unit.lower())):
            return kind
    return "scalars"


def _read_times(text, numbers, rate):
    """Seconds of the trial, whose frame 1 is at 0, by the numbers of frames and sub-frames."""
    sub = numbers[:, 1] if numbers.shape[1] == 2 else np.zeros(len(numbers))
    per_frame = np.floor(sub.max()) + 1
    times = ((numbers[:, 0] - 1) * per_frame + sub) / (rate or 1)
    if not (sub.min() >= 0 and per_frame <= _MOST_SUB_FRAMES and (np.diff(times) >= 0).all()):
        raise text.error(f"Sub Frames are 0 to {_MOST_SUB_FRAMES}, in order; got {sub.max():g}.")
    return times


# -- Qualisys QTM: a header of names and values, and columns of markers or bodies ------------------

QTM = re.compile(rb"(?:NO_OF_[A-Z]+|FREQUENCY|TIME_STAMP|DATA_INCLUDED)\s")
_KEY = re.compile(rb"(NO_OF|DATA)_\w+|\w*FREQUENCY|DESCRIPTION|TIME_STAMP|\w+_(NAMES|TYPES)|EVENT")
# Keys, noun and numbers of columns of a marker; or of a body, which has a position, three angles, a
# residual and perhaps a matrix.
_CONTENTS = {
    b"3D": (b"MARKER_NAMES", b"NO_OF_MARKERS", "marker", (3,)),
    b"6D": (b"BODY_NAMES", b"NO_OF_BODIES", "body", (16, 7)),
}


def read_qtm(path):
    """A TSV of QTM as a reader of `motion.FORMATS` returns it; blank cells and 0 0 0 are NaN."""
    text = MotionText(path)
    header, marks, row = {}, [], text.row()
    while (fields := split_fields(row, 0)) and _KEY.fullmatch(fields[0]):
        header[fields[0]] = fields[1:]
        marks += [(fields + [b""] * 3)[1:4]] * (fields[0] == b"EVENT")
        row = text.row(b"\n")
    contents = b" ".join(header.get(b"DATA_INCLUDED", [b"3D"]))
    key, number, noun, widths = _CONTENTS.get(contents, (b"",) * 4)
    names = [decode(name) for name in header.get(key, [])]
    if not names:
        raise text.error(
            "expected DATA_INCLUDED 3D with MARKER_NAMES, or 6D with BODY_NAMES, got "
            f"{quote([contents])} and {quote(list(header))}."
        )
    leads, n = (2, 0), len(names)  # Frame and Time may be there, and the names of the columns
    if fields and not any(re.fullmatch(rb"[-+.\deE]+", field) for field in fields):
        leads = (sum(field.lower() in (b"frame", b"time") for field in fields[:2]),)
        row = text.row(b"\n")
    sizes = [(lead, lead + n * width) for lead in leads for width in widths]
    fitting = [(lead, size) for lead, size in sizes if len(split_fields(row, size)) == size]
    if not fitting or 1 in leads:
        raise text.error(
            f"{decode(key)} names {n}, each with {' or '.join(map(str, widths))} columns, behind "
            f"Frame and Time or without both; got {counted(len(split_fields(row)), 'column')}."
        )
    lead, size = fitting[0]
    rows = itertools.chain([row] * bool(row), iter(lambda: text.row(None if lead else b"\n"), b""))
    values, decimals = _read_columns(text, rows, range(size), size, 1 if lead else None, b"\t")
    for of, stated, what in ((len(values), b"NO_OF_FRAMES", "frame"), (n, number, noun)):
        if stated in header:
            word = b" ".join(header[stated])
            text.check_count(of, text.count(word, decode(stated)), decode(stated), what)
    rate = read_rate(b" ".join(header.get(b"FREQUENCY", [])))
    entries = [(decode(label), "", *numbers_or_nan(text, [at])) for label, _, at in marks]
    facts = as_joints(names, values[:, lead:])
    hide_unseen(facts["positions"])
    if lead:
        facts |= {"times": values[:, 1].copy(), "decimals": decimals}
    return facts | {
        "frame_rate": rate, "units": "mm",
        "kind": "markers" if noun == "marker" else "joints",
        "first_frame": int(values[0, 0]) if lead and math.isfinite(values[0, 0]) else 1,
        "events": entries,
        "left_out": "" if noun == "marker" else counted(n, "rotation"),
    }  # fmt: skip


# -- OptiTrack Motive: a line of facts, and columns with a type, a name, an axis and others --------

MOTIVE = re.compile(b'"*Format Version')
_LENGTHS = {b"meters": "m", b"centimeters": "cm", b"millimeters": "mm", b"inches": "in"}
_GROUPS = {"bone": "joints", "rigid body": "joints", "marker": "markers"}


def read_motive(path, *, group=None):
    """A CSV of Motive as a reader of `motion.FORMATS` returns it.

    `group` is "joints" (bones and rigid bodies), by default if there are any, or "markers".
    """
    text = MotionText(path)
    facts, table = dict(itertools.pairwise(_cells(text.row()))), {}
    while (row := text.row()) and not _AXES_ROW.match(row):
        cells = _cells(row)
        table[b"".join(cells[:2]).lower()] = cells
    axes = _cells(row.lower())
    if b"name" not in table or not b"".join(axes[1:2]).startswith(b"time"):
        raise text.error("expected rows of Type, Name, ID and 'Frame,Time (Seconds),X,Y,Z'.")
    rows = (table.get(x, []) + [b""] * len(axes) for x in (b"type", b"name", b"id", b"parent", b""))
    members, others = {"joints": [], "markers": []}, Counter()
    for j, cells in enumerate(zip(*rows, strict=False)):
        kind, name, mark, parent, what = map(decode, cells)
        others["rotation"] += (what.lower(), axes[j : j + 1]) == ("rotation", [b"x"])
        if what.lower() == "position" and axes[j : j + 3] == [b"x", b"y", b"z"]:
            kind = f"unlabelled {kind}" if name.lower().startswith("unlabel") else kind
            if of := _GROUPS.get(kind.lower()):
                members[of].append((name or f"{kind}_{j}", j, mark, parent))
            else:
                others[kind.lower()[:40]] += 1
    rate = read_rate(facts.get(b"Export Frame Rate", facts.get(b"Capture Frame Rate", b"")))
    units = facts.get(b"Length Units", b"")
    units = _LENGTHS.get(units.lower(), decode(units) or None)
    groups = {of: {"n": len(x), "units": units, "frame_rate": rate} for of, x in members.items()}
    group = group or ("joints" if members["joints"] else "markers")
    chosen = choose_group(path, groups, group, others)
    if group == "joints" and facts.get(b"Coordinate Space", b"").lower() == b"local":
        raise text.error("positions are those in the parent bone; export them as Global.")
    columns = [0, 1, *(j + k for _, j, *_ in members[group] for k in range(3))]
    values, decimals = _read_columns(text, iter(text.row, b""), columns, len(axes), 1)
    if stated := facts.get(key := b"Total Exported Frames"):
        text.check_count(len(values), text.count(stated, decode(key)), decode(key))
    known = [name for of in members.values() for name, *_ in of]
    motion = as_joints([name for name, *_ in members[group]], values[:, 2:], known)
    return chosen | motion | {
        "parents": _read_parents(text, members[group], motion["subjects"]),
        "times": values[:, 1].copy(), "decimals": decimals, "up": "y",
        "first_frame": int(values[0, 0]) if math.isfinite(values[0, 0]) else None,
    }  # fmt: skip


def _read_parents(text, members, subjects):
    """The index of each bone's parent, which its row names by ID or name."""
    at = {name: j for j, (name, *_) in enumerate(members)}
    at |= {(subjects[j], name.rpartition(":")[2]): j for j, (name, *_) in enumerate(members)}
    at |= {(subjects[j], mark): j for j, (_, _, mark, _) in enumerate(members) if mark}
    parents = [at.get((subjects[j], x), at.get(x, -1)) for j, (*_, x) in enumerate(members)]
    parents = [-1 if parent == j else parent for j, parent in enumerate(parents)]
    if find_cycle(parents):
        raise text.error("the row of parents has a bone that is below itself.")
    return parents


# -- Xsens MVN: XML with a subject, its segments and joints, and an element for each frame ---------

# The element of a frame that holds a group.
_ELEMENTS = {"segments": "position", "angles": "jointAngle"}
# Abbreviations of a file that may stand for very long text, also of two bytes a character.
_ENTITY = re.compile(rb"<\0?!\0?E\0?N\0?T\0?I\0?T\0?Y")


def read_mvnx(path, *, group="segments"):
    """An MVNX file of Xsens as a reader of `motion.FORMATS` returns it.

    `group` is "segments", their origins in metres, or "angles" of the joints in degrees.
    """
    if group not in _ELEMENTS:
        raise ValueError(f"{path}: there are no {group[:40]} in it; group= reads {[*_ELEMENTS]}.")
    file = _XsensFile(path)
    values, decimals = read_timed_rows(file, file.rows(group), time_column=0)
    others = "joint angles" if group == "segments" else "positions of segments"
    poses = "".join(f", the calibration pose {kind!r}" for kind in dict.fromkeys(file.poses))
    facts = {
        "frame_rate": file.frame_rate,
        "units": "m" if group == "segments" else "deg",
        "up": "z",
        "kind": group,
        "left_out": f"orientations, {others}{poses}",
    }
    if file.has_times:
        # They are in milliseconds.
        facts |= {"times": values[:, 0] / 1000, "decimals": decimals + 3}
    values = values[:, 1:].copy()
    if group == "angles":
        channels = [f"{joint}_{axis}" for joint in file.joints for axis in "xyz"]
        subjects = [file.subject] * len(channels)
        return facts | {"channels": channels, "values": values, "subjects": subjects}
    facts |= {"joints": file.segments, "subjects": [file.subject] * len(file.segments)}
    positions = values.reshape(len(values), -1, 3)
    return facts | {"parents": file.parents, "positions": positions}


class _XsensFile:
    """What stands above the frames, and the frames one by one, each of which is then freed."""

    def __init__(self, path):
        self.path, self.frame_rate, self.subject, self.has_times = path, None, None, True
        self.segments, self.joints, self.parents, self.poses, self._n = [], [], [], [], 0

    def error(self, message):
        return ValueError(f"{self.path}, frame {self._n}: {message}")

    def rows(self, group):
        """Yield the time of each frame, as text in milliseconds, and the numbers of a group."""
        frames = None
        for event, element in self._elements():
            name = _tag_of(element)
            if event == "start" and name == "subject":
                if self.subject is not None:
                    raise self.error("a second subject begins; export a file for each.")
                self.subject = element.get("label", "")
                self.frame_rate = read_rate(element.get("frameRate", ""))
            elif event == "start" and name == "frames":
                frames = element
            elif event == "end" and name == "segments":
                self.segments, self.parents = _labels_of(element), [-1] * len(element)
            elif event == "end" and name == "joints":
                self.joints, self.parents = _labels_of(element), _parents_of(self.segments, element)
            elif event == "end" and name == "frame" and frames is not None:
                if (kind := element.get("type", "normal")) == "normal":
                    yield self._row(element, group)
                    self._n += 1
                elif len(self.poses) < 9:
                    self.poses.append(kind[:40])
                frames.clear()

    def _elements(self):
        """Starts and ends of all elements."""
        with self.path.open("rb") as file:
            try:
                end = b""
                while portion := file.read(2**16):
                    if _ENTITY.search(end + portion):
                        raise ValueError("it declares entities, which no recording needs")
                    end = portion[-16:]
                file.seek(0)
                yield from ElementTree.iterparse(file, ("start", "end"))
            except (ElementTree.ParseError, LookupError, ValueError) as error:
                raise self.error(f"{error}; the file is damaged or not complete.") from error

    def _row(self, element, group):
        n = len(self.segments if group == "segments" else self.joints)
        texts = [child.text or "" for child in element if _tag_of(child) == _ELEMENTS[group]]
        fields = " ".join(texts).encode().split()
        if not n or len(fields) != 3 * n:
            raise self.error(
                f"<{_ELEMENTS[group]}> needs 3 numbers for each of {n} {group}, got {len(fields)}. "
                f"Export the file with its {group}."
            )
        self.has_times &= (time := element.get("time")) is not None
        return [(time or "0").encode(), *fields]


def _tag_of(element):
    """The tag of an element without its namespace."""
    return element.tag.rpartition("}")[2]


def _labels_of(element):
    named = enumerate(element, 1)
    return make_unique([x.get("label") or f"{_tag_of(x)}_{i}" for i, x in named])


def _parents_of(segments, joints):
    """The parent of each segment, which stands before it; -1 without one."""
    parents, places = [-1] * len(segments), {name: i for i, name in enumerate(segments)}
    for joint in joints:
        # Such as Pelvis/jLeftHip and LeftUpperLeg/jLeftHip.
        ends = [(end.text or "").partition("/")[0].strip() for end in joint]
        parent, child = (places.get(end, -1) for end in (*ends, "", "")[:2])
        if parent < child:
            parents[child] = parent
    return parents
