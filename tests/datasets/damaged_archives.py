"""Small archives of performances, and their own kinds of damage: headers, directories, sizes."""

import io
import re
import struct
import zipfile
import zlib

import numpy as np
from sklearn_motionsync import Skeleton

DTYPES = "<f4 >f8 <f2 |O <U3 |S2 <M8[s] |b1 <c8 |V4 <i8 >u2 <U0 f999 [('a','<f4')] ('<f4',(2,))"
SHAPES = "() (0,) (-1,) (12,) (2,) (20,) (12,20,3) (3,20,12) (12,0,3) (10**9,) (4294967296,) (1e3,)"
NUMBERS = (0, 1, 2, 8, 12, 14, 99, 255, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFE, 0xFFFFFFFF)


def fields():
    kinect = Skeleton.kinect()
    return {
        "positions": np.random.default_rng(0).standard_normal((12, 20, 3)).astype(np.float32),
        "offsets": [0, 5, 12],
        "label": ["bow", "wave"],
        "actor": ["A", "B"],
        "take": ["1", "1"],
        "fps": [30.0, np.nan],
        "joints": kinect.joints,
        "parents": kinect.parents,
    }


def make_archives():
    """The bytes of archives, plain and compressed, of other types and byte orders."""
    other = fields() | {
        "positions": np.asfortranarray(fields()["positions"].astype(">f8")),
        "offsets": np.array([0, 5, 12], "u8"),
        "label": np.array(["bow", "wave"], "S"),
        "actor": [1, 2],
    }
    contents = []
    for content in (fields(), other):
        for save in (np.savez, np.savez_compressed):
            file = io.BytesIO()
            save(file, **content)
            contents.append(file.getvalue())
    return contents


def npy(values, header=None):
    """An array as NumPy writes it, or with another header."""
    file = io.BytesIO()
    np.save(file, values)
    if header is None:
        return file.getvalue()
    header = header.encode("latin-1") + b"\n"
    content = np.ascontiguousarray(values).tobytes()
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + content


def archive(path, compression=zipfile.ZIP_STORED, **members):
    """An archive of the fields, some of them replaced by the bytes of a member."""
    contents = {name: npy(np.asarray(values)) for name, values in fields().items()} | members
    with zipfile.ZipFile(path, "w", compression) as file:
        for name, content in contents.items():
            file.writestr(f"{name}.npy", content)
    return path


# -- damage: each takes a random.Random and the bytes of an archive ---------------------


def set_directory(rng, data):
    """A number of a local header, of the central directory, or of its end."""
    starts = [m.start() for m in re.finditer(rb"PK\x01\x02|PK\x03\x04|PK\x05\x06", data)]
    if not starts:
        return data
    start = rng.choice(starts)
    # Version, flags, method, checksum, sizes, lengths of names and extras, where members begin.
    at = start + rng.choice((4, 6, 8, 10, 14, 16, 18, 20, 22, 24, 26, 28, 30, 32, 42))
    kind = rng.choice("HI")
    packed = struct.pack("<" + kind, rng.choice(NUMBERS) & (0xFFFF if kind == "H" else 0xFFFFFFFF))
    return data[:at] + packed + data[at + len(packed) :]


def set_member(rng, data):
    """The archive with a member that is well formed and wrong."""
    members = read_members(data)
    if not members:
        return data
    name = rng.choice(sorted(members))
    content = members[name]
    values = np.frombuffer(content[128:], np.uint8)
    way = rng.randrange(4)
    if way == 0:
        dtype, shape = rng.choice(DTYPES.split()), rng.choice(SHAPES.split())
        quoted = dtype if dtype[0] in "[(" else repr(dtype)
        order = rng.choice(("False", "True"))
        header = f"{{'descr': {quoted}, 'fortran_order': {order}, 'shape': {shape}, }}"
        members[name] = npy(values, header)
    elif way == 1:
        members[name] = npy(odd_values(rng, fields().get(name.removesuffix(".npy"), [0])))
    elif way == 2:
        members[name] = content + bytes(rng.choice((1, 1000, 10**6, 70 * 10**6)))
    else:
        members[rng.choice(("positions.npy", "../x", "label.npy", "joints"))] = content
    return write_members(rng, members)


def odd_values(rng, values):
    values = np.array(values)
    odd = rng.choice((np.nan, np.inf, -1, 0, 0.5, 2**63, 2**64 - 1, -(2**63), 1e300))
    with np.errstate(all="ignore"):
        if rng.random() < 0.5 and values.dtype.kind in "fiu":
            values = values.astype(rng.choice(("f8", "f2", "i8", "u8", "i1", "u1", "f4")))
        try:
            values.flat[rng.randrange(values.size)] = odd
        except (OverflowError, ValueError):
            values = values[::-1]
    return values


def read_members(data):
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as file:
            return {name: file.read(name) for name in file.namelist()}
    except Exception:  # damaged before
        return {}


def write_members(rng, members):
    file = io.BytesIO()
    methods = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2)
    with zipfile.ZipFile(file, "w", rng.choice(methods)) as out:
        for name, content in members.items():
            out.writestr(name, content)
    return file.getvalue()


def mend(rng, data):
    """Checksums that fit what is there, so that damage is not found by them."""
    data = bytearray(data)
    for match in re.finditer(rb"PK\x01\x02", bytes(data)):
        at = match.start()
        if at + 46 > len(data):
            continue
        method, size, where = struct.unpack_from("<6xH8xI18xI", data, at + 4)
        if method or where + 30 > len(data):
            continue
        names = sum(struct.unpack_from("<HH", data, where + 26))
        content = bytes(data[where + 30 + names :][:size])
        struct.pack_into("<I", data, at + 16, zlib.crc32(content))
        struct.pack_into("<I", data, where + 14, zlib.crc32(content))
    return bytes(data)


def set_content(rng, data):
    """Bytes of a member that is not compressed, and checksums that fit."""
    data = bytearray(data)
    for _ in range(rng.choice((1, 4, 20))):
        data[rng.randrange(max(1, len(data) * 3 // 4))] = rng.choice((0, 1, 127, 128, 255))
    return mend(rng, data)


ARCHIVE = (set_directory, set_directory, set_member, set_member)
ARCHIVE += (set_content, mend)
