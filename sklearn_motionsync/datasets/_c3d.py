"""C3D: marker positions of optical motion capture."""

import math

import numpy as np

from ._c3d_file import BLOCK, C3DFile, Parameters
from ._kinematics import unique


def read_c3d(path):
    """Names, positions and facts of a C3D file; invalid points are NaN."""
    file = C3DFile(path)
    parameters = Parameters(file)
    n_points, n_analog = _check_counts(file, parameters)
    scale = _find_scale(file, parameters)
    word = 4 if scale < 0 else 2
    frame_bytes = word * (4 * n_points + n_analog)
    start = (file.integer(16) - 1) * BLOCK
    stated = (parameters.number("POINT", "DATA_START", 0) or file.integer(16)) - 1
    if not file.first_parameter < start < len(file.data) or start != stated * BLOCK:
        raise file.error(
            f"the header says that data begin at byte {start}, POINT:DATA_START says "
            f"{stated * BLOCK:g}; both must be the same, behind the parameters at byte "
            f"{file.first_parameter} and before the end at byte {len(file.data)}"
        )
    n_frames = _count_frames(file, parameters, frame_bytes, len(file.data) - start)
    raw = np.frombuffer(file.data, np.uint8, n_frames * frame_bytes, start)
    raw = np.ascontiguousarray(raw.reshape(n_frames, frame_bytes)[:, : 4 * n_points * word])
    numbers = file.floats(raw) if scale < 0 else raw.view(file.order + "i2").astype(np.float64)
    numbers = numbers.reshape(n_frames, n_points, 4)
    positions = numbers[..., :3] * (1.0 if scale < 0 else scale)
    # The fourth number is negative where the point was not seen. NaN is no number at all.
    seen = (numbers[..., 3] >= 0) & np.isfinite(positions).all(axis=2)
    positions[~seen] = np.nan
    rate = parameters.number("POINT", "RATE", file.float(20))
    return {
        "joints": _find_labels(parameters, n_points),
        "parents": [-1] * n_points,
        "positions": positions,
        "frame_rate": float(rate) if math.isfinite(rate) and rate > 0 else None,
        "units": parameters.text("POINT", "UNITS"),
        "up": {"+Y": "y", "+Z": "z"}.get(parameters.text("POINT", "Y_SCREEN")),
        "kind": "markers",
    }


def _check_counts(file, parameters):
    """Numbers of points and of analog values in a frame, as header and parameters agree."""
    n_points, n_analog, per_frame = (file.integer(at) for at in (2, 4, 18))
    used = parameters.number("POINT", "USED", n_points)
    if used != n_points or not n_points:
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
    return n_points, n_analog


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


def _find_labels(parameters, n_points):
    """A name for every marker, though labels may lack or come in several parameters."""
    labels = parameters.texts("POINT", "LABELS")
    number = 2
    while len(labels) < n_points and (more := parameters.texts("POINT", f"LABELS{number}")):
        labels += more
        number += 1
    labels = (labels + [""] * n_points)[:n_points]
    return unique([label or f"marker_{i + 1}" for i, label in enumerate(labels)])
