"""Archives of joint positions (``*_positions.npz``)."""

import zipfile
from pathlib import Path

import numpy as np
from sklearn.utils import Bunch

from ..body.skeleton import Skeleton

_NEEDED = ("positions", "offsets", "label", "actor", "take", "fps", "joints", "parents")


def load_performances(path):
    """Read an archive of performances.

    Parameters
    ----------
    path : str or path-like
        A NumPy archive (``.npz``) with ``positions`` (sum of frames, joints, 3);
        ``offsets`` (N + 1,), performance i being ``positions[offsets[i]:offsets[i + 1]]``;
        ``label``, ``actor``, ``take`` and ``fps`` (N,); ``joints`` and ``parents`` (joints,).

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
        If the file is no such archive; the message says what is wrong with it.

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
    fields = _read_fields(path)
    _check_fields(path, fields)
    positions, offsets = fields["positions"], fields["offsets"]
    joints, parents = fields["joints"].tolist(), fields["parents"].tolist()
    try:
        skeleton = Skeleton.from_names(joints, parents)
    except ValueError:
        skeleton = None
    frames = positions.reshape(len(positions), -1)
    return Bunch(
        data=np.split(frames, offsets[1:-1]),
        target=fields["label"].astype(str),
        actor=fields["actor"].astype(str),
        take=fields["take"].astype(str),
        joints=joints,
        skeleton=skeleton,
        frame_rate=np.asarray(fields["fps"], dtype=np.float64),
    )


def _read_fields(path):
    if not zipfile.is_zipfile(path):
        raise ValueError(f"{path} cannot be read as a NumPy .npz archive: it is no zip file.")
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            return {name: archive[name] for name in _NEEDED if name in archive.files}
    except (zipfile.BadZipFile, ValueError, EOFError, OSError) as error:
        raise ValueError(f"{path} cannot be read as a NumPy .npz archive: {error}.") from error


def _check_fields(path, fields):
    missing = [name for name in _NEEDED if name not in fields]
    if missing:
        raise ValueError(f"{path} lacks {missing}; an archive of performances holds {_NEEDED}.")
    positions, offsets = fields["positions"], fields["offsets"]
    if positions.ndim != 3 or positions.shape[2] != 3 or positions.dtype.kind != "f":
        raise ValueError(
            f"{path}: positions must be floats of shape (frames, joints, 3), got "
            f"{positions.dtype} {positions.shape}."
        )
    if offsets.ndim != 1 or len(offsets) < 2 or offsets.dtype.kind not in "iu":
        raise ValueError(f"{path}: offsets must be N + 1 whole numbers, got shape {offsets.shape}.")
    if offsets[0] != 0 or offsets[-1] != len(positions) or (np.diff(offsets) < 1).any():
        raise ValueError(
            f"{path}: offsets must increase from 0 to the {len(positions)} frames of positions."
        )
    n = len(offsets) - 1
    for name, size in (
        *((name, n) for name in ("label", "actor", "take", "fps")),
        *((name, positions.shape[1]) for name in ("joints", "parents")),
    ):
        if fields[name].shape != (size,):
            raise ValueError(f"{path}: {name} must have shape ({size},), got {fields[name].shape}.")
