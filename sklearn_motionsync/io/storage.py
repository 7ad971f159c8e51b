"""MOT and STO: OpenSim's tables of coordinates, forces and other values by time."""

import numpy as np

from ..inputs.wording import counted
from .text import (
    MotionText,
    decode,
    make_unique,
    quote,
    read_rate,
    read_timed_rows,
    split_fields,
)

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
_ANGLE_UNITS = {b"yes": "deg", b"true": "deg", b"1": "deg"}
_ANGLE_UNITS |= {b"no": "rad", b"false": "rad", b"0": "rad"}


def read_storage(path):
    """A MOT or STO file as a reader of `motion.READERS` returns it."""
    text = MotionText(path)
    header = _read_header(text)
    labels = _read_labels(text)
    components = _COMPONENTS.get(header.get(b"datatype"), "")
    rows = _split_rows(text, len(labels), len(components))
    frames, decimals = read_timed_rows(text, rows, time_column=0)
    for key, name in ((b"nrows", "nRows"), (b"datarows", "datarows")):
        if key in header:
            text.check_n_frames(len(frames), text.count(header[key], name), name)
    values = np.frombuffer(b"".join(frames)).reshape(len(frames), -1)
    forces = all(any(word in label.lower() for word in _FORCES) for label in labels)
    columns = [f"{a}_{b}" for a in labels for b in components] if components else labels
    return {
        "channels": make_unique(columns),
        "values": values[:, 1:].copy(),
        "times": values[:, 0].copy(),
        "decimals": decimals,
        "frame_rate": read_rate(header.get(b"datarate", b"")),
        "units": None if forces else _ANGLE_UNITS.get(header.get(b"indegrees")),
        "up": None,
        "kind": "forces" if forces else "coordinates",
    }


def _read_header(text):
    """The values above 'endheader' by their names, both in small letters."""
    header = {}
    while row := text.row().strip():
        row = row.lower()
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
