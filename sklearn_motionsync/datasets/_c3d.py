"""C3D: markers, what was computed from them, and analog channels of optical motion capture."""

import math

import numpy as np

from ._c3d_events import find_events, find_first_frame
from ._c3d_file import BLOCK, C3DFile, Parameters
from ._c3d_groups import find_channels, find_labels, find_point_groups, find_scales
from ._text import unique

# Where Cortex did not see a marker.
_NOWHERE = 9999999.0


def read_c3d(path, group="markers"):
    """Names, values and facts of a group of a C3D file; invalid points are NaN."""
    file = C3DFile(path)
    parameters = Parameters(file)
    n_points, n_analog, per_frame = _check_counts(file, parameters)
    layout = _Layout(file, parameters, n_points, n_analog)
    rate = parameters.number("POINT", "RATE", file.float(20))
    rate = float(rate) if math.isfinite(rate) and rate > 0 else None
    labels = find_labels(parameters, "POINT", n_points, "marker")
    members = find_point_groups(parameters, labels)
    groups = {
        name: {"n": len(points), "units": units, "frame_rate": rate}
        for name, (points, units) in members.items()
    }
    if n_analog:
        analog_rate = None if rate is None else rate * per_frame
        channels, units = find_channels(parameters, n_analog // per_frame)
        groups["analog"] = {"n": len(units), "units": units, "frame_rate": analog_rate}
    _check_group(file, groups, group)
    first_frame = find_first_frame(file, parameters)
    events, n_lost = find_events(file, parameters, rate, first_frame)
    facts = {
        "frame_rate": groups[group]["frame_rate"],
        "units": groups[group]["units"],
        "up": {"+Y": "y", "+Z": "z"}.get(parameters.text("POINT", "Y_SCREEN")),
        "kind": group,
        "first_frame": first_frame,
        "events": events,
        "groups": groups,
        "left_out": _left_out(parameters, groups, group, n_lost),
    }
    if group == "analog":
        for event in events:
            event["frame"] = None if event["frame"] is None else event["frame"] * per_frame
        values = _read_analog(layout, parameters, len(channels))
        return facts | {"channels": unique(channels), "values": values}
    points = members[group][0]
    positions = _read_points(layout, points, computed=group != "markers")
    joints = unique([labels[i] for i in points])
    return facts | {"joints": joints, "parents": [-1] * len(points), "positions": positions}


def _check_group(file, groups, group):
    if group in groups and groups[group]["n"]:
        return
    there = [f"{name!r} ({facts['n']})" for name, facts in groups.items() if facts["n"]]
    if not there:
        raise file.error("the header says 0 markers and 0 analog values; there is nothing to read")
    raise ValueError(
        f"{file.path}: there are no {group} in this file; read_motion(..., group=...) reads "
        f"{', '.join(there)}."
    )


def _left_out(parameters, groups, group, n_lost):
    """What the file holds beside the group, in one line; empty if there is nothing."""
    parts = []
    for name, facts in groups.items():
        if name == group or not facts["n"]:
            continue
        if name == "analog":
            rate = facts["frame_rate"]
            at = "" if rate is None else f" at {rate:g} Hz"
            parts.append(f"{facts['n']} analog {_plural('channel', facts['n'])}{at}")
        else:
            parts.append(f"{facts['n']} {_plural(name.removesuffix('s'), facts['n'])}")
    plates = parameters.number("FORCE_PLATFORM", "USED", 0)
    if math.isfinite(plates) and plates > 0:
        parts.append(f"the geometry of {plates:g} force {_plural('plate', plates)}")
    if n_lost:
        parts.append(f"{n_lost} {_plural('event', n_lost)} without a time")
    return ", ".join(parts)


def _plural(noun, n):
    return noun if n == 1 else noun + "s"


class _Layout:
    """Where the numbers of a frame are, and how they are written."""

    def __init__(self, file, parameters, n_points, n_analog):
        self.file = file
        self.n_points, self.n_analog = n_points, n_analog
        scale = _find_scale(file, parameters)
        self.real = scale < 0
        self.scale = 1.0 if self.real else scale
        self.word = 4 if self.real else 2
        frame_bytes = self.word * (4 * n_points + n_analog)
        start = file.data_start
        stated = (parameters.number("POINT", "DATA_START", 0) or start // BLOCK + 1) - 1
        if not file.first_parameter < start < len(file.data) or start != stated * BLOCK:
            raise file.error(
                f"the header says that data begin at byte {start}, POINT:DATA_START says "
                f"{stated * BLOCK:g}; both must be the same, behind the parameters at byte "
                f"{file.first_parameter} and before the end at byte {len(file.data)}"
            )
        self.n_frames = _count_frames(file, parameters, frame_bytes, len(file.data) - start)
        raw = np.frombuffer(file.data, np.uint8, self.n_frames * frame_bytes, start)
        self._raw = raw.reshape(self.n_frames, frame_bytes)

    def numbers(self, first, stop, kind="i"):
        """The numbers first to stop of every frame, integers of kind "i" or "u"."""
        raw = np.ascontiguousarray(self._raw[:, first * self.word : stop * self.word])
        if self.real:
            return self.file.floats(raw)
        return raw.view(f"{self.file.order}{kind}2").astype(np.float64)


def _read_points(layout, points, computed):
    numbers = layout.numbers(0, 4 * layout.n_points).reshape(layout.n_frames, -1, 4)
    blank = (numbers[..., :3] == 0).all(axis=2)
    anything = not blank.all()
    numbers, blank = numbers[:, points], blank[:, points]
    positions, cameras = numbers[..., :3] * layout.scale, numbers[..., 3]
    # The fourth number is negative where the point was not seen. NaN is no number at all.
    seen = (cameras >= 0) & np.isfinite(positions).all(axis=2)
    if not computed:
        # It holds the cameras and the residual in 16 bits, the sign for the highest. Nothing
        # in it, at the very origin, is how many writers leave a marker that no camera saw.
        named = (cameras > 0) & (cameras < 2**15)
        seen &= ~(blank & ~named & anything)
        seen &= ~(positions == _NOWHERE).all(axis=2)
    positions[~seen] = np.nan
    return positions


def _read_analog(layout, parameters, n):
    kind, offsets, scales = find_scales(layout.file, parameters, n)
    first = 4 * layout.n_points
    values = layout.numbers(first, first + layout.n_analog, kind).reshape(-1, n)
    with np.errstate(over="ignore", invalid="ignore"):
        values = (values - offsets) * scales
    values[~np.isfinite(values)] = np.nan
    return values


def _check_counts(file, parameters):
    """Numbers of points and of analog values in a frame, as header and parameters agree."""
    n_points, n_analog, per_frame = (file.integer(at) for at in (2, 4, 18))
    used = parameters.number("POINT", "USED", n_points)
    if used != n_points or not (n_points or n_analog):
        raise file.error(
            f"the header says {n_points} markers, POINT:USED says {used:g}; both must be the same "
            "and above 0"
        )
    channels = parameters.number("ANALOG", "USED")
    if channels is not None and channels * per_frame != n_analog:
        raise file.error(
            f"the header says {n_analog} analog values a frame, but ANALOG:USED says {channels:g} "
            f"channels, {per_frame} values each"
        )
    if n_analog % max(per_frame, 1):
        raise file.error(
            f"the header says {n_analog} analog values a frame, {per_frame} of each channel, which "
            "is no whole number of channels"
        )
    return n_points, n_analog, max(per_frame, 1)


def _find_scale(file, parameters):
    """What an integer is multiplied with; negative where numbers are floats."""
    header = file.float(12)
    scale = parameters.number("POINT", "SCALE", header)
    if scale < 0 and header < 0:
        # Floats are not scaled, so writers did not care what stands there.
        return scale
    if not math.isfinite(scale) or not scale or not math.isclose(scale, header, rel_tol=1e-3):
        raise file.error(
            f"the header says scale {header:g}, POINT:SCALE says {scale:g}; both must be the same "
            "and not 0"
        )
    return scale


def _count_frames(file, parameters, frame_bytes, n_bytes):
    """The number of frames. Where the file states several, its size decides.

    Long recordings do not fit the 16 bits of the header, and writers worked around that
    in different ways.
    """
    header = file.integer(8) - file.integer(6) + 1
    stated = {header}
    stated |= {parameters.number("POINT", name, 0) for name in ("FRAMES", "LONG_FRAMES")}
    limits = [parameters.numbers("TRIAL", f"ACTUAL_{end}_FIELD") for end in ("START", "END")]
    if all(limit is not None and len(limit) == 2 for limit in limits):
        low, high = (limit[0] + 65536 * limit[1] for limit in limits)
        stated.add(high - low + 1)
    stated = sorted(int(n) for n in stated if math.isfinite(n) and n > 0 and n == int(n))
    possible = [n for n in stated if n * frame_bytes <= n_bytes]
    # Data are padded to whole blocks.
    exact = [n for n in possible if n_bytes - n * frame_bytes < BLOCK]
    if exact:
        return header if header in exact else exact[-1]
    if len(stated) == 1 and possible:
        return stated[0]
    raise file.error(
        f"it says {' or '.join(map(str, stated)) or 'no'} frames of {frame_bytes} bytes, but holds "
        f"{n_bytes / frame_bytes:.1f} frames; it is not complete, or its header is wrong"
    )
