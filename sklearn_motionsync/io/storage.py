"""MOT and STO: OpenSim's tables of coordinates, forces and whatever else has a time."""

import array
import math

import numpy as np

from .guard import check_growth
from .text import (
    MotionText,
    check_n_rows,
    check_time,
    count_decimals,
    decode,
    fields_of,
    read_numbers,
    show,
    unique,
)

# The parts of one column, by the DataType of the file.
_PARTS = {
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


def read_storage(path):
    """Names, values and facts of a MOT or STO file."""
    text = MotionText(path)
    header, lines = _read_header(text)
    n_rows = next((key for key in (b"nrows", b"datarows") if key in header), None)
    n_stated = None if n_rows is None else _count(text, header[n_rows], lines[n_rows])
    labels = _read_labels(text)
    parts = _PARTS.get(header.get(b"datatype", b"").lower(), "")
    values, times, decimals = _read_rows(text, len(labels), len(parts))
    check_n_rows(text, "the number of rows", lines.get(n_rows), n_stated, len(times))
    check_growth(path, text.size, 8 * len(values), f"{len(times)} rows of {len(labels)} columns")
    forces = all(any(word in label.lower() for word in _FORCES) for label in labels)
    return {
        "channels": unique([f"{a}_{b}" for a in labels for b in parts] if parts else labels),
        "values": np.frombuffer(values).reshape(len(times), -1),
        "times": np.frombuffer(times),
        "decimals": decimals,
        "frame_rate": _rate(header),
        "units": None if forces else _units(header),
        "up": None,
        "kind": "forces" if forces else "coordinates",
    }


def _read_header(text):
    """What the lines above 'endheader' say, by its name in small letters, and where."""
    header, lines = {}, {}
    while row := text.row().strip():
        if row.lower() == b"endheader":
            return header, lines
        key, equals, value = row.partition(b"=")
        if not equals:
            key, _, value = row.partition(b" ")
        key = key.strip().lower()
        header[key], lines[key] = value.strip(), text.line_number
    raise text.error("the file ends where 'endheader' should follow; it is not complete.")


def _count(text, value, line_number):
    if not value.isdigit() or len(value) > 18:
        raise text.error(f"line {line_number} needs a whole number of rows, got {show([value])}.")
    return int(value)


def _rate(header):
    try:
        rate = float(header.get(b"datarate", b""))
    except ValueError:
        return None
    return rate if 0 < rate < math.inf else None


def _units(header):
    """Of the angles; None if the file does not say."""
    said = header.get(b"indegrees", b"").lower()
    return {
        b"yes": "deg",
        b"true": "deg",
        b"1": "deg",
        b"no": "rad",
        b"false": "rad",
        b"0": "rad",
    }.get(said)


def _read_labels(text):
    """Names of the columns behind the time."""
    labels = fields_of(text.row())
    while labels and not labels[-1]:
        labels.pop()
    if len(labels) < 2 or labels[0].lower() != b"time" or b"" in labels:
        raise text.error(f"expected 'time' and the names of the other columns, got {show(labels)}.")
    return [decode(label) for label in labels[1:]]


def _read_rows(text, n_labels, n_parts):
    """Values and times one after the other, and how many decimals the times have."""
    values, times, decimals, time = array.array("d"), array.array("d"), 0, -math.inf
    n = n_labels * max(n_parts, 1)
    while row := text.row():
        fields = row.split()
        if len(fields) != 1 + n_labels:
            fields = _without_the_end(fields_of(row), 1 + n_labels)
        first, rest = fields[:1], fields[1:]
        if n_parts:
            rest = [part for field in rest for part in field.strip(b"~[]()").split(b",")]
        if len(fields) != 1 + n_labels or len(rest) != n:
            raise text.error(
                f"a row needs its time and {n_labels} columns"
                f"{f' of {n_parts} numbers, with commas between them' if n_parts else ''}, "
                f"got {show([row])}."
            )
        numbers = read_numbers(text, first + rest, "a row")
        time = check_time(text, numbers[0], time)
        decimals = max(decimals, count_decimals(first[0]))
        times.append(time)
        values.extend(numbers[1:])
    return values, times, decimals


def _without_the_end(fields, n):
    """The fields without blank ones behind the last of n."""
    while len(fields) > n and not fields[-1]:
        fields = fields[:-1]
    return fields
