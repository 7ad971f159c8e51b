"""The arrays of a NumPy archive, each held against its stated size before it is made."""

import math
import warnings
import zipfile

import numpy as np
from numpy.lib import format as npy

from ._guard import check_growth

# What NumPy writes. Others unpack by more than is read of them at a time.
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_ENCRYPTED = 0x1
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


def read_arrays(path, names):
    """Those of the arrays that the archive has, by name."""
    try:
        with zipfile.ZipFile(path) as archive:
            members = _find_members(archive, names)
            n_bytes = sum(member.file_size for member in members.values())
            check_growth(path, path.stat().st_size, n_bytes, "the arrays")
            return {name: _read_array(archive, name, m) for name, m in members.items()}
    except Exception as error:  # of zipfile, zlib, tokenize, ast, struct: whatever a byte may cause
        if isinstance(error, ValueError) and str(error).startswith(f"{path}: "):
            raise
        reason = " ".join(str(error).split())[:200].rstrip(".") or type(error).__name__
        raise ValueError(f"{path} cannot be read as a NumPy .npz archive: {reason}.") from error


def _find_members(archive, names):
    found = [member.filename for member in archive.infolist()]
    members = {}
    for name in names:
        if found.count(f"{name}.npy") > 1:
            raise ValueError(f"it holds {name} twice")
        if f"{name}.npy" in found:
            members[name] = archive.getinfo(f"{name}.npy")
    for name, member in members.items():
        if member.flag_bits & _ENCRYPTED or member.compress_type not in _METHODS:
            raise ValueError(f"{name} is encrypted, or packed as NumPy does not; write it again")
    return members


def _read_array(archive, name, member):
    with archive.open(member) as stream:
        version = npy.read_magic(stream)
        if version not in _HEADERS:
            raise ValueError(f"{name} is in version {version} of the format; 1.0 and 2.0 are known")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # headers that Python 2 wrote are as good
            shape, by_column, dtype = _HEADERS[version](stream)
        if dtype.hasobject or dtype.names or dtype.subdtype or not dtype.itemsize:
            raise ValueError(f"{name} holds Python objects or records; numbers or text are needed")
        n_bytes = math.prod(shape) * dtype.itemsize
        n_left = member.file_size - stream.tell()
        if n_bytes != n_left or any(n < 0 for n in shape):
            raise ValueError(
                f"{name} says {dtype} {shape}, {n_bytes} bytes, but there are {n_left} of them"
            )
        content = stream.read(n_bytes)
    if len(content) != n_bytes:
        raise ValueError(f"{name} ends after {len(content)} of its {n_bytes} bytes")
    values = np.frombuffer(content, dtype).reshape(shape, order="F" if by_column else "C")
    # A copy: in the machine's own byte order, and writeable.
    return values.astype(dtype.newbyteorder("="))
