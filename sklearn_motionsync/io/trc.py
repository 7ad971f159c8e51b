"""TRC: markers in columns of text, as OpenSim, Pose2Sim, Cortex and Vicon write them."""

import itertools
import math
import re

from ..inputs.wording import counted
from .text import (
    MotionText,
    as_joints,
    decode,
    hide_unseen,
    quote,
    read_rate,
    read_timed_rows,
    split_fields,
    split_rows,
)

_AXIS = re.compile(rb"[XYZxyz]\d*")


def read_trc(path):
    """A TRC file as a reader of `motion.FORMATS` returns it; markers that were not seen are NaN."""
    text = MotionText(path)
    first = split_fields(text.row())
    if not first or not first[0].lower().startswith(b"pathfiletype"):
        raise text.error(
            f"expected 'PathFileType', with which TRC files begin, got {quote(first)}."
        )
    header = _read_header(text)
    names, row = _read_names(text, header)
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


def _read_header(text):
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


def _read_names(text, header):
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
    if axes and _AXIS.fullmatch(axes[0]):
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
