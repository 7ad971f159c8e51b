"""Damage files of motion capture and archives in many ways, and check that reading stays safe.

A damaged file must be read, to numbers that a recording may hold (or NaN for a marker that was not
seen), or be refused with a ValueError that names the file. Anything else is a failure: another
error, or a warning of another kind. A case is the same for the same seed and number.
"""

import json
import random
import re
import struct
import traceback
import warnings
import zlib
from pathlib import Path

import numpy as np
from sklearn_motionsync.datasets import load_trials
from sklearn_motionsync.io import find_gaps, read_motion

from damaged_archives import ARCHIVE

NUMBERS = (
    *(b"0 -1 1 2 7 65535 65536 -32768 2147483648 99999999 9999999999999999999999".split()),
    *(b"1e30 -1e200 1e308 1e999 -1e999 nan inf -inf 0x10 1_0 1e-320 . - e +".split()),
    b"9" * 5000,
)
WORDS = (
    *(b"HIERARCHY ROOT JOINT End Site OFFSET CHANNELS MOTION { } Frames: Frame Time:".split()),
    *(b"Xposition Zrotation :units :root :bonedata :hierarchy begin end name root".split()),
    *(b"direction length axis dof rx tx order lfemur :DEGREES :RADIANS # ( )".split()),
    *(b"PathFileType DataRate NumFrames NumMarkers Units Frame# Time X1 Y2 Z time".split()),
    *(b"Frame,Sub Trajectories Devices Model EVENT MARKER_NAMES Type,Bone Name ,,, deg".split()),
    *(b"endheader nRows=7 nColumns=9 inDegrees=yes DataType=Vec3 1,2,3 , \t \t\t\t".split(b" ")),
)
# Formats that hold no missing values.
WITHOUT_GAPS = ("bvh", "amc")


# -- damage -----------------------------------------------------------------------------


def place(rng, data):
    """A place in the file, in every second case near its beginning, where headers are."""
    return rng.randrange(min(len(data), 6000) if rng.random() < 0.5 else len(data))


def chunk(rng, data):
    start = place(rng, data)
    return start, start + rng.choice((1, 2, 4, 16, 100, 512, 5000))


def flip_bits(rng, data):
    data = bytearray(data)
    for _ in range(rng.choice((1, 1, 3, 20))):
        data[place(rng, data)] ^= 1 << rng.randrange(8)
    return bytes(data)


def overwrite(rng, data):
    start, stop = chunk(rng, data)
    byte = rng.choice((b"\0", b"\xff", b" ", b"\n", b"\r", b"9", b"-", rng.randbytes(1)))
    n = min(stop, len(data)) - start
    return data[:start] + (byte * n if rng.random() < 0.7 else rng.randbytes(n)) + data[stop:]


def truncate(rng, data):
    return data[: place(rng, data)]


def repeat(rng, data):
    """Delete a part, or repeat it."""
    start, stop = chunk(rng, data)
    return data[:start] + data[start:stop] * rng.choice((0, 0, 0, 2, 2, 100)) + data[stop:]


def move(rng, data):
    start, stop = chunk(rng, data)
    rest = data[:start] + data[stop:]
    to = place(rng, rest) if rest else 0
    return rest[:to] + data[start:stop] + rest[to:]


def set_value(rng, data):
    """Another integer or float, also where the header has one."""
    at = rng.choice((rng.randrange(24), rng.randrange(512, 4000), place(rng, data)))
    if rng.random() < 0.5:
        value = rng.choice((0, 1, 2, 256, 0x7FFF, 0x8000, 0xFFFE, 0xFFFF, rng.randrange(65536)))
        packed = struct.pack(rng.choice("<>") + "H", value)
    else:
        value = rng.choice((0.0, -0.0, -1.0, 1e38, -1e38, 1e-40, float("nan"), float("inf")))
        packed = struct.pack(rng.choice("<>") + "f", value)
    return data[:at] + packed + data[at + len(packed) :]


def set_words(rng, data):
    """Other numbers in the place of numbers, or other words in the place of any."""
    start = place(rng, data)
    parts = re.split(rb"([\s,]+)", data[start : start + 3000])
    places, others = range(0, len(parts), 2), WORDS
    if rng.random() < 0.5:
        places = [i for i in places if re.fullmatch(rb"[-+.\de]+", parts[i])]
        others = NUMBERS
    for i in rng.sample(places, min(len(places), rng.choice((1, 1, 3)))):
        parts[i] = rng.choice(others)
    return data[:start] + b"".join(parts) + data[start + 3000 :]


BINARY = (*[flip_bits] * 3, overwrite, truncate, repeat, repeat, move, set_value, set_value)
TEXT = (flip_bits, flip_bits, overwrite, truncate, repeat, repeat, move, *[set_words] * 4)
# How files are damaged, by the ending of their names.
DAMAGES = {".c3d": BINARY, ".npz": BINARY[:8] + ARCHIVE, ".npy": BINARY}
TEXTS = (".bvh", ".amc", ".asf", ".trc", ".mot", ".sto", ".mvnx", ".csv", ".tsv", ".json")
DAMAGES |= dict.fromkeys(TEXTS, TEXT)


def damaged(originals, seed, number):
    """The files of one case, the same for the same numbers."""
    rng = random.Random(f"{seed} {number}")
    files = dict(rng.choice(originals))
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        name = rng.choice(list(files))
        if files[name]:
            files[name] = rng.choice(DAMAGES[Path(name).suffix])(rng, files[name])
    return files


# -- judgement --------------------------------------------------------------------------

EXPECTED_WARNINGS = (
    ": .*((positions|values) are missing|times are uneven|by its times|scale|become missing)",
    ": .*(says .* but .* follow|holds . subjects|its data hold|name no unit)",
    r" (holds|skips|has up to) \d+ ",
)


def run_case(files, folder):
    """ "read", "ValueError", or a description of the failure."""
    for name, content in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(content)
    path = folder / next(iter(files))
    path = path.parent if path.suffix == ".json" else path
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for message in EXPECTED_WARNINGS:
                warnings.filterwarnings("ignore", message=rf"a(\.\w+)?{message}")
            results = read_all(path, folder)
    except ValueError as error:
        message = str(error)
        if type(error) is ValueError and message.startswith(str(folder)) and len(message) < 700:
            return "ValueError"
        return "a bad message\n" + traceback.format_exc()
    except Exception:
        return "another error\n" + traceback.format_exc()
    try:
        return next(filter(None, map(problem_of, results)), "read")
    except Exception:
        return "a result that cannot be judged\n" + traceback.format_exc()


def read_all(path, folder):
    """DataFrames, or the arrays of an archive."""
    if path.suffix == ".npz":
        bunch = load_trials(path)
        parents = bunch.skeleton.parents if bunch.skeleton else ()
        assert len(bunch.data) == len(bunch.target) == len(bunch.frame_rate)
        assert all(-1 <= p < len(bunch.joints) for p in parents)
        return bunch.data
    if path.suffix != ".c3d":
        return [read_motion(path, asf=folder / "a.asf" if path.suffix == ".amc" else None)]
    # One group for each case: it may be damaged where the others are not.
    group = ("markers", "angles", "analog", "segments")[zlib.crc32(path.read_bytes()) % 4]
    return [read_motion(path, group=group, max_gap=0 if group == "analog" else 5)]


def problem_of(result):
    """What is wrong with a result, or None."""
    if isinstance(result, np.ndarray):
        good = result.ndim == 2 and len(result) >= 2 and result.shape[1] % 3 == 0
        return None if good and np.abs(result).max() <= 1e7 else f"a bad result {result.shape}"
    values, attrs = result.to_numpy(), result.attrs
    kinds = ("markers", "joints", "segments", "angles", "keypoints")
    most = 1e7 if attrs["kind"] in kinds else 1e9
    known = (np.abs(values) <= most) | (np.isnan(values) & (attrs["format"] not in WITHOUT_GAPS))
    if not known.all() or values.dtype != np.float64 or not result.columns.is_unique:
        return f"a bad result {result.shape} {values.dtype}"
    if result.empty:
        return "an empty result"
    json.dumps(attrs, allow_nan=False)
    if "joints" in attrs and find_gaps(result).empty != (not np.isnan(values).any()):
        return "gaps that do not fit"
    return None
