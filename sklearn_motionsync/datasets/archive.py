"""Trials from archives of joint positions (``*_positions.npz``)."""

import zipfile
from pathlib import Path as FilePath

import numpy as np
from sklearn.utils import Bunch

from ..body.skeleton import Skeleton, find_cycle
from ..inputs.numbers import check_finite
from ..inputs.types import Path
from ..io.text import FARTHEST, check_result_size
from ..matching.sizes import RATES

# The kinds of the dtype of each array, in words, and its shape: N trials, F frames, and joints.
_FIELDS = {
    "positions": ("f", "floats", "F, joints, 3"),
    "offsets": ("iu", "whole numbers", "N + 1"),
    "label": ("USiu", "text", "N"),
    "actor": ("USiu", "text", "N"),
    "take": ("USiu", "text", "N"),
    "fps": ("iuf", "numbers", "N"),
    "joints": ("US", "text", "joints"),
    "parents": ("iuf", "numbers", "joints"),
}


def load_trials(path: Path) -> Bunch:
    """Read an archive of trials.

    Parameters
    ----------
    path : str or path-like
        A NumPy archive (``.npz``) with ``positions`` (sum of frames, joints, 3);
        ``offsets`` (N + 1,), trial i being ``positions[offsets[i]:offsets[i + 1]]``;
        ``label``, ``actor``, ``take`` and ``fps`` (N,); ``joints`` and ``parents`` (joints,).
        Every trial has at least two frames, and every position is finite and below 1e7. Parents are
        indices of joints, -1 for a root. Labels, actors and takes are text or whole numbers.

    Returns
    -------
    Bunch
        data : list of ndarray (n_frames_i, 3 * n_joints)
            Joint positions, joint by joint x, y, z, in the unit and dtype of the archive.
        target, actor, take : ndarray of str (N,)
            The action, the actor, and the number of the trial.
        joints : list of str
            Names of the joints.
        skeleton : Skeleton or None
            None if the landmarks of a body cannot be found by the names of the joints.
        frame_rate : ndarray (N,)
            Frames per second; NaN where it is not known.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file is no such archive; the message names the fault. If its arrays would take
        more than 64 MB and more than 32 times the size of the file: they are not unpacked.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import Skeleton
    >>> from sklearn_motionsync.datasets import load_trials
    >>> folder = getfixture("tmp_path")
    >>> kinect = Skeleton.kinect()
    >>> np.savez(
    ...     folder / "one.npz", positions=np.zeros((7, 20, 3)), offsets=[0, 7], label=["bow"],
    ...     actor=["A"], take=["1"], fps=[30.0], joints=kinect.joints, parents=kinect.parents,
    ... )
    >>> bunch = load_trials(folder / "one.npz")
    >>> bunch.data[0].shape, bunch.target[0]
    ((7, 60), np.str_('bow'))
    """
    path = FilePath(path)
    if not path.is_file():
        raise FileNotFoundError(f"There is no archive at {path}; give the path of a .npz file.")
    fields = _read_arrays(path)
    _check_fields(path, fields)
    texts = {
        name: _as_text(path, name, x) for name, x in fields.items() if _FIELDS[name][1] == "text"
    }
    joints, fps = texts["joints"].tolist(), fields["fps"]
    if len(set(joints)) < len(joints):
        raise ValueError(
            f"{path}: joints must have different names, got {_quote(texts['joints'])}."
        )
    parents = fields["parents"]
    valid = (parents == np.trunc(parents)) & (parents >= -1) & (parents < len(parents))
    if not valid.all() or find_cycle(parents.astype(int).tolist()):
        raise ValueError(
            f"{path}: parents must be indices of joints, whole numbers from 0 to "
            f"{len(parents) - 1}, or -1 for a root, to which they lead in no cycle, got "
            f"{_quote(parents)}."
        )
    if ((fps < RATES[0]) | (fps > RATES[1])).any():
        raise ValueError(
            f"{path}: fps must be frames per second, above 0, or NaN if it is not known, got "
            f"{_quote(fps)}."
        )
    try:
        skeleton = Skeleton(joints, parents.astype(int).tolist())
    except ValueError:
        skeleton = None
    positions = fields["positions"]
    data = np.split(positions.reshape(len(positions), -1), fields["offsets"].astype(np.int64)[1:-1])
    columns = [f"{joint}_{axis}" for joint in joints for axis in "xyz"]
    for i, x in enumerate(data):
        check_finite(x, f"{path}: trial {i}, frame", columns)
        if np.abs(x).max() > FARTHEST:
            raise ValueError(
                f"{path}: trial {i} has positions beyond {FARTHEST:g}, as no recording has: the "
                "archive is damaged, or in another unit."
            )
    return Bunch(
        data=data,
        target=texts["label"],
        actor=texts["actor"],
        take=texts["take"],
        joints=joints,
        skeleton=skeleton,
        frame_rate=fps.astype(np.float64),
    )


def _check_fields(path, fields):
    """Refuse arrays of another kind or shape, and offsets that do not divide the frames."""
    if missing := [name for name in _FIELDS if name not in fields]:
        raise ValueError(f"{path} lacks {missing}; an archive of trials holds {[*_FIELDS]}.")
    n_trials = fields["offsets"].size - 1
    n_frames, n_joints = (*fields["positions"].shape, 0, 0)[:2]
    sizes = {"F": n_frames, "joints": n_joints, "3": 3, "N": n_trials, "N + 1": n_trials + 1}
    for name, (kinds, words, shape) in _FIELDS.items():
        x, expected = fields[name], tuple(sizes[size] for size in shape.split(", "))
        if x.dtype.kind not in kinds or x.shape != expected or not x.size:
            raise ValueError(
                f"{path}: {name} must be {words} of the shape ({shape}), where N is {n_trials}, F "
                f"{n_frames} and joints {n_joints}, got {x.dtype} {x.shape}."
            )
    # Differences of unsigned numbers are never negative.
    offsets = fields["offsets"].astype(np.int64)
    lengths = np.diff(offsets)
    bad = (lengths < 2) | (lengths > n_frames)
    if offsets[0] != 0 or offsets[-1] != n_frames or bad.any():
        raise ValueError(
            f"{path}: offsets must increase from 0 to the {n_frames} frames of positions, by at "
            f"least 2 for each trial, got {_quote(offsets)}."
        )


def _as_text(path, name, values):
    try:
        texts = np.char.decode(values, "utf-8") if values.dtype.kind == "S" else values.astype(str)
        # NumPy accepts code points that are no characters, and beyond the last one.
        "".join(map(chr, texts.view(np.uint32))).encode()
    except (ValueError, OverflowError) as error:
        raise ValueError(f"{path}: {name} must be text, got other bytes.") from error
    return texts


def _quote(values):
    text = str(values.tolist()[:8])[:80].rstrip("]")
    return text + (", ...]" if len(values) > 8 else "]")


def _read_arrays(path):
    """The arrays of `_FIELDS` that the archive has, by name; their size is checked before."""
    try:
        with zipfile.ZipFile(path) as archive:
            n_bytes = sum(member.file_size for member in archive.infolist())
        check_result_size(path, path.stat().st_size, n_bytes, "the arrays")
        with np.load(path) as archive:
            # What is no array is read as bytes.
            arrays = {name: np.asarray(archive[name]) for name in _FIELDS if name in archive}
    except Exception as error:  # of zipfile, zlib, tokenize, ast, struct: any byte may be wrong
        if isinstance(error, ValueError) and str(error).startswith(f"{path}: "):
            raise
        reason = " ".join(str(error).split())[:200].rstrip(".") or type(error).__name__
        raise ValueError(f"{path} cannot be read as a NumPy .npz archive: {reason}.") from error
    # In the machine's own byte order.
    return {name: x.astype(x.dtype.newbyteorder("="), copy=False) for name, x in arrays.items()}
