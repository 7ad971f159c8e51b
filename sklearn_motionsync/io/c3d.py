"""C3D: markers, quantities computed from them, and analog channels of optical motion capture."""

import math
import re

import numpy as np

from ..inputs.resampling import is_rate
from ..inputs.wording import counted
from .text import (
    UNSEEN,
    as_joints,
    choose_group,
    decode,
    describe_groups,
    make_unique,
    warn,
)

_BLOCK = 512
# How processors write numbers: Intel, DEC and MIPS.
_LITTLE, _DEC, _BIG = 84, 85, 86
# Groups of points that are computed from markers. There may be others, which have units.
_COMPUTED = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS")
# The header has room for so many events, and this number where their labels have 4 characters.
_MAX_HEADER_EVENTS = 18
_LONG_LABELS = 12345


def read_c3d(path, *, group=None):
    """A C3D file as a reader of `motion.FORMATS` returns it; invalid points are NaN.

    `group` is "markers", "analog", "segments", or a group of points that the file lists; by default
    the markers, or the segments of a file without any.
    """
    file = _File(path)
    parameters = _Parameters(file)
    rate = parameters.number("POINT", "RATE", file.float(20))
    rate = float(rate) if is_rate(rate) else None
    segments = _Segments(file, parameters, rate)
    n_points, n_stated, per_frame = _read_counts(file, parameters, segments)
    frames = None
    if n_points or any(n_stated):
        frames = _Frames(file, parameters, segments, n_points, n_stated, per_frame)
    labels = _read_labels(parameters, "POINT", n_points, "marker")
    members = _read_point_groups(parameters, labels)
    groups = {
        name: {"n": len(points), "units": units, "frame_rate": rate}
        for name, (points, units) in members.items()
    }
    group = group or ("segments" if segments.n and not groups["markers"]["n"] else "markers")
    if segments.n:
        segments_rate = None if rate is None else rate * segments.per_frame
        groups["segments"] = groups["markers"] | {"n": segments.n, "frame_rate": segments_rate}
    if frames and frames.n_analog:
        n_channels = frames.n_analog // per_frame
        units = (parameters.texts("ANALOG", "UNITS") + [""] * n_channels)[:n_channels]
        groups["analog"] = {
            "n": n_channels,
            "units": [unit or None for unit in units],
            "frame_rate": None if rate is None else rate * per_frame,
        }
    facts = choose_group(file.path, groups, group, {})
    # The first frame usually counts from 1; it may be two words of 16 bits, the lower first.
    words = parameters.numbers("TRIAL", "ACTUAL_START_FIELD")
    first_frame = file.integer(6)
    if words and all(math.isfinite(word) and word >= 0 for word in words):
        first_frame = int(words[0]) + (65536 * int(words[1]) if len(words) > 1 else 0)
    events = _read_event_parameters(parameters)
    if events is None:
        # Frame 1 of the trial is at 0 seconds. In files that count from 0 it is frame 0.
        events = _read_header_events(file, max(first_frame - 1, 0) / (rate or math.inf))
    facts |= {
        "up": {"+Y": "y", "+Z": "z"}.get(parameters.text("POINT", "Y_SCREEN")),
        "first_frame": first_frame,
        "events": events,
        "left_out": _describe_others(parameters, groups, group, events),
    }
    if group == "analog":
        channels = _read_labels(parameters, "ANALOG", n_channels, "channel")
        values = _read_analog(frames, parameters, n_channels)
        return facts | {"channels": make_unique(channels), "values": values}
    if group == "segments":
        return facts | as_joints(segments.labels, segments.read_origins())
    points = members[group][0]
    positions = _read_points(frames, points, computed=group != "markers")
    return facts | as_joints([labels[i] for i in points], positions, labels)


# -- the header, and how numbers are written --------------------------------------------


class _File:
    """The bytes of the file, and how its processor wrote numbers."""

    def __init__(self, path):
        self.path = path
        self.data = path.read_bytes()
        if len(self.data) < 2 * _BLOCK or self.data[1] != 0x50:
            raise self.error(
                f"byte 1 must be hexadecimal 50 and the file {2 * _BLOCK} bytes or more, got "
                f"{self.data[1:2].hex() or 'nothing'} and {len(self.data)} bytes; it is no C3D "
                "file, or not complete"
            )
        self.first_parameter = (self.data[0] - 1) * _BLOCK
        if not 0 < self.first_parameter <= len(self.data) - 4:
            raise self.error(
                f"byte 0 says that parameters begin in block {self.data[0]}, but the file has "
                f"{len(self.data) // _BLOCK} blocks"
            )
        self.processor = self.data[self.first_parameter + 3]
        if self.processor not in (_LITTLE, _DEC, _BIG):
            raise self.error(
                f"byte {self.first_parameter + 3} says processor {self.processor}; 84 (Intel), "
                "85 (DEC) and 86 (MIPS) are known"
            )
        orders = "><" if self.processor == _BIG else "<>"
        self.float_order = orders[0]
        # Some writers convert the floats only, or the integers only. The header says where the
        # data begin; in the wrong order that is outside of the file.
        for self.order in (*orders, orders[0]):
            self.data_start = (self.integer(16) - 1) * _BLOCK
            if self.first_parameter < self.data_start < len(self.data):
                break

    def error(self, message):
        return ValueError(f"{self.path}: {message}. Export the recording again.")

    def integer(self, at):
        return int(np.frombuffer(self.data, self.order + "u2", 1, at)[0])

    def float(self, at):
        return float(self.floats(np.frombuffer(self.data, np.uint8, 4, at))[0])

    def floats(self, raw):
        """Numbers of 4 bytes, given as an array of their bytes."""
        if self.processor != _DEC:
            with np.errstate(invalid="ignore"):  # signalling NaN
                return raw.view(self.float_order + "f4").astype(np.float64)
        # A DEC number has its two 16-bit words swapped and is four times too large for IEEE;
        # those with an exponent of 0 are 0.
        words = raw.view("<u2").astype(np.uint32)
        bits = words[..., 0::2] << 16 | words[..., 1::2]
        sign = np.where(bits >> 31, -1.0, 1.0)
        exponent = (bits >> 23 & 0xFF).astype(np.int64)
        mantissa = (bits & 0x7FFFFF | 0x800000).astype(np.float64)
        return np.where(exponent > 0, np.ldexp(sign * mantissa, exponent - 152), 0.0)


# -- the parameters ---------------------------------------------------------------------


class _Parameters:
    """The parameters of the file: (group, name) to type, dimensions and bytes."""

    def __init__(self, file):
        self._file = file
        self._values = {}
        groups, members = {}, []
        data, at = file.data, file.first_parameter
        n_blocks = data[at + 2]
        stated_end = min(len(data), at + n_blocks * _BLOCK) if n_blocks else len(data)
        # Writers count wrongly, and one byte is too little for many; the data bound them.
        end = file.data_start if at < file.data_start < len(data) else stated_end
        at += 4
        # Every entry is longer than 4 bytes, so this comes to an end.
        while at + 4 < end and data[at] and data[at + 1]:
            n_chars, group = np.frombuffer(data, "i1", 2, at).tolist()
            link = at + 2 + abs(n_chars)
            step = file.integer(link) if link + 2 <= end else 0
            if link + step > end:
                # Some programs write what they change in the order of their own processor.
                step = step >> 8 | (step & 0xFF) << 8
            content = data[link + 2 : min(end, link + step) if step else end]
            if link + 2 > end or link + step > end or step == 1:
                if at >= stated_end:
                    break  # no parameters follow here
                raise self._error(at, "leads out of the parameters")
            name = decode(data[at + 2 : link]).strip().upper()
            if group < 0:
                groups.setdefault(-group, name)
            else:
                members.append((group, name, at, content))
            if not step:
                break
            at = link + step
        for group, name, at, content in members:
            self._values.setdefault((groups.get(group), name), self._read(at, content))

    def _error(self, at, problem):
        return self._file.error(f"the parameter at byte {at} {problem}")

    def _read(self, at, content):
        # The format allows for seven dimensions.
        if len(content) < 2 or content[1] > 7 or len(content) < 2 + content[1]:
            raise self._error(at, "is not complete, or no parameter")
        size = np.frombuffer(content[:1], "i1")[0]
        dimensions = list(content[2 : 2 + content[1]])
        n_bytes = math.prod(dimensions) * abs(int(size))
        values = content[2 + len(dimensions) :][:n_bytes]
        if size not in (-1, 1, 2, 4) or len(values) < n_bytes:
            raise self._error(at, f"says {n_bytes} bytes of type {size}, which are not there")
        return int(size), dimensions, values

    def names(self, group):
        """Names of the parameters of a group, in the order of the file."""
        return [name for holder, name in self._values if holder == group]

    def numbers(self, group, name, kind="u"):
        """The numbers of a parameter and its continuations, integers of kind "u" or "i"."""

        def read(size, _, values):
            if size <= 0:
                return []
            if size == 4:
                return self._file.floats(np.frombuffer(values, np.uint8)).tolist()
            return np.frombuffer(values, f"{self._file.order}{kind}{size}").astype(float).tolist()

        return self._continued(read, group, name)

    def texts(self, group, name):
        """The texts of a parameter and its continuations."""

        def read(size, dimensions, values):
            width = dimensions[0] if dimensions else 1
            if size != -1 or not width:
                return []
            pieces = (values[i : i + width] for i in range(0, len(values), width))
            return [decode(piece).replace("\0", " ").strip() for piece in pieces]

        return self._continued(read, group, name)

    def _continued(self, read, group, name):
        """The values of a parameter and of NAME2, NAME3, ..."""
        result, number = read(*self._values.get((group, name), (0, [], b""))), 2
        while more := read(*self._values.get((group, f"{name}{number}"), (0, [], b""))):
            result += more
            number += 1
        return result

    def number(self, group, name, default=None):
        return next(iter(self.numbers(group, name)), default)

    def text(self, group, name):
        return next(iter(self.texts(group, name)), None) or None


# -- the data: frames of points and analog values ---------------------------------------


class _Segments:
    """The matrices (4, 4) from segments to the laboratory, the group ROTATION of markerless files.

    Columns stand one behind the other, and behind them a reliability, below 0 of one not seen. The
    last column is the origin.
    """

    def __init__(self, file, parameters, rate):
        self._file, self._parameters = file, parameters

        def whole(name, default):
            number = parameters.number("ROTATION", name, default)
            return int(number) if number in range(1, 2**16) else default

        self.n, self.start = whole("USED", 0), (whole("DATA_START", 1) - 1) * _BLOCK
        ratio = round(parameters.number("ROTATION", "RATE", rate or 1) / (rate or 1), 6)
        self.per_frame = whole("RATIO", int(ratio) if ratio in range(1, 2**16) else 1)
        labels = _read_labels(parameters, "ROTATION", self.n, "segment")
        self.labels = [re.sub("_4x4$", "", label, flags=re.IGNORECASE) for label in labels]

    def read_origins(self):
        """Positions (n_frames, n, 3), NaN where a segment was not seen."""
        file, size = self._file, 4 * 17 * self.n
        end = file.data_start if file.data_start > self.start else len(file.data)
        if not file.first_parameter < self.start < len(file.data):
            raise file.error(
                f"ROTATION:DATA_START says byte {self.start}, and the rotations must begin between "
                f"{file.first_parameter} and {len(file.data)}"
            )
        stated = {n * self.per_frame for n in _stated_frames(file, self._parameters)}
        stated = [*_whole([self._parameters.number("ROTATION", "FRAMES", 0)]), *sorted(stated)]
        n_frames = _count_frames(file, stated, size, self.start, end)
        numbers = file.floats(np.frombuffer(file.data, np.uint8, n_frames * size, self.start))
        numbers = numbers.reshape(n_frames, self.n, 17)
        unseen = (numbers[..., 16] < 0) | (numbers[..., :16] == 0).all(axis=2)
        positions = numbers[..., 12:15].copy()
        positions[unseen | ~np.isfinite(positions).all(axis=2)] = np.nan
        return positions


def _read_counts(file, parameters, segments):
    """Numbers of points in a frame, of analog values as header and section state it, and of values
    of a channel.
    """
    n_points, n_analog, per_frame = (file.integer(at) for at in (2, 4, 18))
    used = parameters.number("POINT", "USED", n_points)
    if used != n_points or not (n_points or n_analog or segments.n):
        raise file.error(
            f"the header says {n_points} markers, POINT:USED says {used:g}; both must be the same "
            "and above 0"
        )
    per_frame = max(per_frame, 1)
    channels = parameters.number("ANALOG", "USED", n_analog / per_frame)
    return n_points, (n_analog, channels * per_frame), per_frame


class _Frames:
    """The numbers of all frames, and how they are written."""

    def __init__(self, file, parameters, segments, n_points, n_stated, per_frame):
        self.file = file
        self.n_points = n_points
        scale = _read_scale(file, parameters)
        self.real = scale < 0
        self.scale = 1.0 if self.real else scale
        self.word = 4 if self.real else 2
        start = file.data_start
        stated = (parameters.number("POINT", "DATA_START", 0) or start // _BLOCK + 1) - 1
        if not file.first_parameter < start < len(file.data) or start != stated * _BLOCK:
            raise file.error(
                f"the header says that data begin at byte {start}, POINT:DATA_START says "
                f"{stated * _BLOCK:g}; both must be the same, behind the parameters at byte "
                f"{file.first_parameter} and before the end at byte {len(file.data)}"
            )
        has_end = segments.n and start < segments.start < len(file.data)
        end = segments.start if has_end else len(file.data)
        stated, n_bytes = _stated_frames(file, parameters), end - start
        fitting = {n for n in n_stated if n >= 0 and n % per_frame == 0}
        if len(set(n_stated)) > 1:
            # The size decides. Data are padded to whole blocks.
            spare = {n: [n_bytes - k * self.frame_bytes(n) for k in stated] for n in fitting}
            fitting = {n for n in fitting if any(0 <= size < _BLOCK for size in spare[n])}
        if len(fitting) != 1:
            raise file.error(
                f"the header says {n_stated[0]} analog values a frame, {per_frame} of each "
                f"channel, but ANALOG:USED says {n_stated[1] / per_frame:g} channels; they must be "
                "the same whole number, or one of them fit the size of the file"
            )
        self.n_analog = int(fitting.pop())
        frame_bytes = self.frame_bytes(self.n_analog)
        self.n_frames = _count_frames(file, stated, frame_bytes, start, end)
        raw = np.frombuffer(file.data, np.uint8, self.n_frames * frame_bytes, start)
        self._raw = raw.reshape(self.n_frames, frame_bytes)

    def frame_bytes(self, n_analog):
        return self.word * (4 * self.n_points + n_analog)

    def numbers(self, first, stop, kind="i"):
        """The numbers first to stop of every frame, integers of kind "i" or "u"."""
        raw = np.ascontiguousarray(self._raw[:, first * self.word : stop * self.word])
        if self.real:
            return self.file.floats(raw)
        return raw.view(f"{self.file.order}{kind}2").astype(np.float64)


def _read_scale(file, parameters):
    """The factor of integers; negative where numbers are floats."""
    header = file.float(12)
    scale = parameters.number("POINT", "SCALE", header)
    if scale < 0 and header < 0:
        # Floats are not scaled, and some writers put any negative number here.
        return scale
    if not math.isfinite(header + scale) or min(header, scale) <= 0:
        raise file.error(
            f"the header says scale {header:g}, POINT:SCALE says {scale:g}; both must be below 0, "
            "or both above"
        )
    if math.isclose(scale, header, rel_tol=1e-3):
        return scale
    warn(
        f"{file.path.name}: the header says scale {header:g}, which is used, POINT:SCALE says "
        f"{scale:g}. If positions are too large or too small, multiply them by "
        f"{scale / header:.6g}."
    )
    return header


def _stated_frames(file, parameters):
    """The numbers of frames that the file states, that of the header first.

    Long recordings do not fit the 16 bits of the header, and writers worked around that
    in different ways.
    """
    first, last = file.integer(6), file.integer(8)
    more = [parameters.number("POINT", name, 0) for name in ("FRAMES", "LONG_FRAMES")]
    limits = [parameters.numbers("TRIAL", f"ACTUAL_{end}_FIELD") for end in ("START", "END")]
    if all(len(limit) == 2 for limit in limits):
        low, high = (limit[0] + 65536 * limit[1] for limit in limits)
        more.append(high - low + 1)
    more = _whole(sorted(more, reverse=True))
    # A larger number may stand in the header as the largest.
    header = [] if more and last == 2**16 - 1 else _whole([(last - first + 1) % 2**16])
    return list(dict.fromkeys(header + more))


def _whole(numbers):
    return [int(n) for n in numbers if math.isfinite(n) and n > 0 and n == int(n)]


def _count_frames(file, stated, frame_bytes, first, end):
    """The number of frames between two bytes, of those that the file states, or that 16 bits hide.

    Zeros at the end may be what fills the last block. Where numbers differ, a warning tells them.
    """
    n_bytes, held = end - first, (end - first) // frame_bytes
    filled = min(held, -(-len(file.data[first:end].rstrip(b"\0")) // frame_bytes))
    numbers = " or ".join(map(str, sorted(set(stated)))) or "no"
    # The header has 16 bits for a number: larger ones are 65535, or lack their higher bits.
    possible = [n + over for over in range(0, held, 2**16) for n in stated if n + over <= held]
    exact = [n for n in possible if n_bytes - n * frame_bytes < _BLOCK]
    fitting = [n for n in [*exact, *possible] if n >= filled] or exact
    if not fitting and not 0 < max(stated, default=0) * frame_bytes <= n_bytes:
        raise file.error(
            f"it says {numbers} frames of {frame_bytes} bytes, but holds "
            f"{n_bytes / frame_bytes:.1f} frames; it is not complete, or its header is wrong"
        )
    n_frames = (fitting or [filled])[0]
    in_16_bits = {n_frames, n_frames % 2**16, min(n_frames, 2**16 - 1)}
    if n_frames not in stated or not in_16_bits.issuperset(stated):
        warn(
            f"{file.path.name}: it says {numbers} frames, and its data hold {n_frames}, which are "
            "read. Look at the last ones."
        )
    return n_frames


def _read_points(frames, points, computed):
    numbers = frames.numbers(0, 4 * frames.n_points).reshape(frames.n_frames, -1, 4)
    zero = (numbers[..., :3] == 0).all(axis=2)
    all_zero = zero.all()
    numbers, zero = numbers[:, points], zero[:, points]
    positions, cameras = numbers[..., :3] * frames.scale, numbers[..., 3]
    # The fourth number is negative where the point was not seen. NaN is no number at all.
    seen = (cameras >= 0) & np.isfinite(positions).all(axis=2)
    if not computed:
        # It holds the cameras and the residual in 16 bits, the sign for the highest. Many writers
        # leave a marker that no camera saw at the origin, with a 0 here.
        has_camera = (cameras > 0) & (cameras < 2**15)
        seen &= ~zero | has_camera | all_zero
        seen &= ~(positions == UNSEEN).all(axis=2)
    positions[~seen] = np.nan
    return positions


def _read_analog(frames, parameters, n):
    kind = "u" if (parameters.text("ANALOG", "FORMAT") or "").upper() == "UNSIGNED" else "i"
    general = parameters.number("ANALOG", "GEN_SCALE", 1.0)
    offsets = parameters.numbers("ANALOG", "OFFSET", kind) or [0.0] * n
    scales = parameters.numbers("ANALOG", "SCALE") or [1.0] * n
    for name, numbers in (("OFFSET", offsets), ("SCALE", scales)):
        if len(numbers) < n:
            raise frames.file.error(f"ANALOG:{name} has {len(numbers)} numbers for {n} channels")
    offsets, scales = offsets[:n], scales[:n]
    if not general or not np.isfinite([general, *offsets, *scales]).all():
        raise frames.file.error(
            f"ANALOG:GEN_SCALE must not be 0, and it, ANALOG:SCALE and ANALOG:OFFSET must be "
            f"finite, got GEN_SCALE {general:g}, SCALE from {min(scales):g} to {max(scales):g}, "
            f"OFFSET from {min(offsets):g} to {max(offsets):g}"
        )
    first = 4 * frames.n_points
    values = frames.numbers(first, first + frames.n_analog, kind).reshape(-1, n)
    values[~np.isfinite(values)] = np.nan
    return (values - offsets) * [general * scale for scale in scales]


# -- events -----------------------------------------------------------------------------


def _read_event_parameters(parameters):
    """(label, context, time) of each event of the group EVENT; None without any."""
    group = next((g for g in ("EVENT", "EVENTS") if "TIMES" in parameters.names(g)), "EVENT")
    # Pairs of minutes and seconds.
    times = np.array(parameters.numbers(group, "TIMES"))
    times = times[: len(times) // 2 * 2].reshape(-1, 2) @ [60.0, 1.0]
    n = parameters.number(group, "USED", len(times))
    n = int(n) if n in range(65536) else len(times)
    if not n:
        return None
    columns = [parameters.texts(group, name) for name in ("LABELS", "CONTEXTS")]
    labels, contexts = ((texts + [""] * n)[:n] for texts in columns)
    times = [*times.tolist(), *[math.nan] * n][:n]
    return list(zip(labels, contexts, times, strict=True))


def _read_header_events(file, start):
    """The same of the events in the header, whose times count from the first frame."""
    n = file.integer(300)
    if n > _MAX_HEADER_EVENTS:
        return []
    width = 4 if file.integer(298) == _LONG_LABELS else 2
    labels = (file.data[396 + width * i : 396 + width * (i + 1)] for i in range(n))
    return [
        (label.decode("latin-1").replace("\0", " ").strip(), "", start + file.float(304 + 4 * i))
        for i, label in enumerate(labels)
    ]


# -- groups of points and channels ------------------------------------------------------


def _read_labels(parameters, group, n, what):
    """A name for each of n points or channels, some of which may have no label."""
    labels = (parameters.texts(group, "LABELS") + [""] * n)[:n]
    return [label or f"{what}_{i + 1}" for i, label in enumerate(labels)]


def _read_point_groups(parameters, labels):
    """Indices and units of the points of each group, by name; markers are the rest.

    POINT:ANGLES lists the labels of the points that are angles, POINT:ANGLE_UNITS says what
    they are measured in; forces, moments and others likewise.
    """
    names, marker_unit = parameters.names("POINT"), parameters.text("POINT", "UNITS")
    # Points in the unit of markers, such as centres of joints, are used like markers.
    in_other_units = {
        f"{name.removesuffix('_UNITS')}S"
        for name in names
        if name.endswith("_UNITS") and parameters.text("POINT", name) != marker_unit
    } - {"LABELS", "DESCRIPTIONS", "MARKERS"}
    markers = dict.fromkeys(range(len(labels)))
    groups = {}
    for name in dict.fromkeys([*_COMPUTED, *sorted(in_other_units)]):
        listed = {label.upper() for label in parameters.texts("POINT", name)}
        points = [i for i in markers if labels[i].upper() in listed]
        if points:
            units = parameters.text("POINT", f"{name.removesuffix('S')}_UNITS")
            groups[name.lower()] = (points, units)
            for i in points:
                del markers[i]
    return {"markers": (list(markers), marker_unit)} | groups


def _describe_others(parameters, groups, group, events):
    """The contents of the file beside the group, in one line; empty if there are none."""
    contents = describe_groups({k: x for k, x in groups.items() if k != "segments"}, group, {})
    if "segments" in groups:
        of_them = "the rotations of " if group == "segments" else "the origins and rotations of "
        contents.append(of_them + counted(groups["segments"]["n"], "segment"))
    plates = parameters.number("FORCE_PLATFORM", "USED", 0)
    if math.isfinite(plates) and plates > 0:
        contents.append(f"the geometry of {counted(plates, 'force plate')}")
    if n_untimed := sum(not math.isfinite(time) for *_, time in events):
        contents.append(f"{counted(n_untimed, 'event')} without a time")
    return ", ".join(contents)
