"""Small archives of trials, and damage to what is in them."""

import io
import re
import struct
import zipfile
import zlib

import numpy as np
from sklearn_motionsync import Skeleton

from motion_files import npy


def fields():
    kinect = Skeleton.kinect()
    return {
        "positions": np.random.default_rng(0).standard_normal((12, 20, 3)).astype(np.float32),
        "offsets": [0, 5, 12],
        "label": ["bow", "w\u00e4ve"],
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
        "offsets": np.array([0, 5, 12], ">u8"),
        "label": np.array(["bow", "w\u00e4ve".encode()], "S"),
        "actor": [1, 2],
        "parents": np.array(fields()["parents"], float),
        "fps": [30, 25],
    }
    contents = []
    for content in (fields(), other):
        for save in (np.savez, np.savez_compressed):
            file = io.BytesIO()
            save(file, **content)
            contents.append(file.getvalue())
    return contents


def with_header(values, header):
    """An array as NumPy writes it, with another header."""
    header = header.encode("latin-1") + b"\n"
    content = np.ascontiguousarray(values).tobytes()
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + content


def archive(path, **members):
    """An archive of the fields, some of them replaced by the bytes of a member."""
    contents = {name: npy(values) for name, values in fields().items()} | members
    with zipfile.ZipFile(path, "w") as file:
        for name, content in contents.items():
            file.writestr(f"{name}.npy", content)
    return path


# -- damage: each takes a random.Random and the bytes of an archive ---------------------


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


ARCHIVE = (set_content, mend)
