"""Archives of joint positions (``*_positions.npz``)."""

import math
import sys
import warnings
import zipfile
from pathlib import Path

import numpy as np
from numpy.lib import format as npy
from sklearn.utils import Bunch

from ..body.skeleton import Skeleton
from ..io.text import check_result_size

_NEEDED = ("positions", "offsets", "label", "actor", "take", "fps", "joints", "parents")
_TEXTS = ("label", "actor", "take", "joints")


def load_performances(path):
    """Read an archive of performances.

    Parameters
    ----------
    path : str or path-like
        A NumPy archive (``.npz``) with ``positions`` (sum of frames, joints, 3);
        ``offsets`` (N + 1,), performance i being ``positions[offsets[i]:offsets[i + 1]]``;
        ``label``, ``actor``, ``take`` and ``fps`` (N,); ``joints`` and ``parents`` (joints,).
        Every performance has at least two frames, and every position is finite. Parents are
        indices of joints, -1 for a root. Labels, actors and takes are text or whole numbers.

    Returns
    -------
    Bunch
        data : list of ndarray (n_frames_i, 3 * n_joints)
            Joint positions, joint by joint x, y, z, in the unit and dtype of the archive.
        target, actor, take : ndarray of str (N,)
            The action, who performed it, and which of their performances it is.
        joints : list of str
            Names of the joints.
        skeleton : Skeleton or None
            None if the names of the joints do not tell which of them are the body's.
        frame_rate : ndarray (N,)
            Frames a second; NaN where it is not known.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file is no such archive; the message says what is wrong with it. Arrays of more
        than 64 MB and 32 times the size of their file are refused before they are unpacked.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import Skeleton
    >>> from sklearn_motionsync.datasets import load_performances
    >>> folder = getfixture("tmp_path")
    >>> kinect = Skeleton.kinect()
    >>> np.savez(
    ...     folder / "one.npz", positions=np.zeros((7, 20, 3)), offsets=[0, 7], label=["bow"],
    ...     actor=["A"], take=["1"], fps=[30.0], joints=kinect.joints, parents=kinect.parents,
    ... )
    >>> bunch = load_performances(folder / "one.npz")
    >>> bunch.data[0].shape, bunch.target[0]
    ((7, 60), np.str_('bow'))
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"There is no archive at {path}; give the path of a .npz file.")
    fields = read_arrays(path, _NEEDED)
    positions, offsets = _check_positions(path, fields)
    texts = {name: _check_texts(path, name, fields[name]) for name in _TEXTS}
    joints = texts["joints"].tolist()
    parents = _check_parents(path, fields["parents"], joints)
    frame_rate = _check_frame_rates(path, fields["fps"])
    _check_finite(path, positions, offsets, joints)
    try:
        skeleton = Skeleton.from_names(joints, parents)
    except ValueError:
        skeleton = None
    frames = positions.reshape(len(positions), -1)
    return Bunch(
        data=np.split(frames, offsets[1:-1]),
        target=texts["label"],
        actor=texts["actor"],
        take=texts["take"],
        joints=joints,
        skeleton=skeleton,
        frame_rate=frame_rate,
    )


def _check_positions(path, fields):
    """Positions and offsets; all other fields have the shapes that go with them."""
    if missing := [name for name in _NEEDED if name not in fields]:
        raise ValueError(f"{path} lacks {missing}; an archive of performances holds {_NEEDED}.")
    positions, offsets = fields["positions"], fields["offsets"]
    if (
        positions.ndim != 3
        or positions.shape[2] != 3
        or not positions.shape[1]
        or positions.dtype.kind != "f"
    ):
        raise ValueError(
            f"{path}: positions must be floats of shape (frames, joints, 3), got "
            f"{positions.dtype} {positions.shape}."
        )
    if offsets.ndim != 1 or len(offsets) < 2 or offsets.dtype.kind not in "iu":
        raise ValueError(
            f"{path}: offsets must be N + 1 whole numbers, got {offsets.dtype} {offsets.shape}."
        )
    outside = (offsets < 0) | (offsets > len(positions))
    # Differences of unsigned numbers are never negative.
    lengths = np.diff(np.where(outside, 0, offsets).astype(np.int64))
    if offsets[0] != 0 or offsets[-1] != len(positions) or outside.any() or (lengths < 1).any():
        raise ValueError(
            f"{path}: offsets must increase from 0 to the {len(positions)} frames of positions."
        )
    if (lengths < 2).any():
        raise ValueError(
            f"{path}: performance {np.argmin(lengths)} has one frame; a performance needs at least "
            "2. Leave it out of positions, offsets, label, actor, take and fps."
        )
    n = len(lengths)
    for name, size in (
        *((name, n) for name in ("label", "actor", "take", "fps")),
        *((name, positions.shape[1]) for name in ("joints", "parents")),
    ):
        if fields[name].shape != (size,):
            raise ValueError(f"{path}: {name} must have shape ({size},), got {fields[name].shape}.")
    return positions, offsets.astype(np.int64)


def _check_texts(path, name, values):
    """Text, or the whole numbers that a label, an actor or a take may be."""
    kinds = "US" if name == "joints" else "USiu"
    if values.dtype.kind not in kinds:
        raise ValueError(f"{path}: {name} must be text, got {values.dtype}.")
    try:
        if values.dtype.kind == "S":
            values = np.char.decode(values, "utf-8")
        values = values.astype(str)
        # Neither NumPy nor Python asks whether the numbers are characters.
        if values.view(np.uint32).max() > sys.maxunicode:
            raise ValueError
        "".join(values.tolist()).encode()
    except ValueError as error:
        raise ValueError(f"{path}: {name} must be text, got bytes that are none.") from error
    if name == "joints" and len(set(values.tolist())) < len(values):
        names, counts = np.unique(values, return_counts=True)
        raise ValueError(
            f"{path}: joints must have different names, got {str(names[counts > 1][0])[:40]!r} "
            "more than once."
        )
    return values


def _check_parents(path, parents, joints):
    n = len(joints)
    whole = parents.dtype.kind in "iuf" and (parents == np.trunc(parents)).all()
    if not whole or (parents < -1).any() or (parents >= n).any():
        raise ValueError(
            f"{path}: parents must be indices of joints, whole numbers from 0 to {n - 1}, or -1 "
            f"for a root, got {_shown(parents)}."
        )
    parents = parents.astype(np.int64)
    # Every step leads to an ancestor; after as many as there are joints all are past the root.
    ancestors = parents.copy()
    for _ in range(n.bit_length()):
        above = ancestors >= 0
        ancestors[above] = ancestors[ancestors[above]]
    if (ancestors >= 0).any():
        joint = joints[np.flatnonzero(ancestors >= 0)[0]][:40]
        raise ValueError(
            f"{path}: parents must lead to a root (-1), but from joint {joint!r} they run in a "
            f"circle, got {_shown(parents)}."
        )
    return parents.tolist()


def _check_frame_rates(path, fps):
    if fps.dtype.kind not in "iuf" or ((fps <= 0) | np.isinf(fps)).any():
        raise ValueError(
            f"{path}: fps must be frames a second, above 0, or NaN where they are not known, got "
            f"{_shown(fps)}."
        )
    return fps.astype(np.float64)


def _check_finite(path, positions, offsets, joints):
    finite = np.isfinite(positions)
    if not finite.all():
        frame, joint, _ = np.argwhere(~finite)[0]
        i = np.searchsorted(offsets, frame, side="right") - 1
        raise ValueError(
            f"{path}: performance {i}, frame {frame - offsets[i]}, joint {joints[joint][:40]!r} is "
            "NaN or infinite. Interpolate the gap before the archive is written (fill_gaps), or "
            "leave the performance out."
        )


def _shown(values):
    shown = str(values.tolist()[:8])[:80].rstrip("]")
    return shown + (", ...]" if len(values) > 8 else "]")


# -- the arrays of a NumPy archive, each held against its stated size before it is made --

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
            check_result_size(path, path.stat().st_size, n_bytes, "the arrays")
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
