"""Poses in labelled arrays: key-points that `movement` and other programs track in videos."""

from collections.abc import Hashable
from typing import Any

import numpy as np
import pandas as pd

from ..inputs.resampling import times_as_numbers
from ..inputs.tables import FRAME, label_of_part
from .gaps import check_filling
from .motion import as_recording, check_confidence, check_frame_rate, set_clock
from .text import make_unique, read_rate

_DIMENSIONS = ("time", "individual", "keypoint", "space")
# Older names of some of them.
_RENAMED = {"individuals": "individual", "keypoints": "keypoint"}


def from_poses(
    poses: Any,
    *,
    min_confidence: float | None = None,
    frame_rate: float | None = None,
    max_gap: int = 0,
    trial: Hashable = None,
) -> list[pd.DataFrame]:
    """Convert an xarray Dataset of poses, such as one of `movement`, into recordings.

    Parameters
    ----------
    poses : xarray Dataset or DataArray
        A Dataset with the variable ``position`` and optionally ``confidence``, or positions alone.
        Dimensions, in any order, are ``time``, ``space`` ("x", "y" and optionally "z"),
        ``keypoint`` (or ``keypoints``) and ``individual`` (or ``individuals``); the last two may
        be missing if one was selected. Its ``attrs`` may hold ``fps`` (frames per second) and
        ``time_unit``, "seconds" or "frames".
    min_confidence : float, default=None
        Positions of less confidence become NaN. Those whose confidence is NaN are kept. By
        default all are.
    frame_rate : float, default=None
        Frames per second. By default estimated from the times, or ``fps`` if times are in frames.
    max_gap : int, default=0
        The longest gap to interpolate, in frames; see `fill_gaps`. By default none is.
    trial : hashable, default=None
        Label of the recording, such as the name of its file; the name of the individual follows
        it. A tuple has a level for each of its items. By default the name of the individual
        alone is the label.

    Returns
    -------
    list of DataFrame (n_frames, n_dims * n_keypoints)
        One for each individual, float64, with the columns ``<keypoint>_x``, ``<keypoint>_y`` and,
        in space, ``<keypoint>_z``, in the unit of the Dataset, and an index named "frame", from 0.
        Their ``attrs`` have the keys of `read_motion`: ``format`` ("poses"), ``frame_rate``
        (frames per second; None if it is not known, or times are uneven), ``units`` (None), ``up``
        ("-y" in the plane, as y points down in pictures; None in space), ``kind`` ("keypoints"),
        ``joints``, ``parents`` (-1 for all), ``first_time`` (seconds) if that is known,
        ``times`` if they are uneven, ``trial`` (the name of the individual, or
        ``(trial, individual)``) and ``levels``.

    Raises
    ------
    ValueError
        If ``poses`` is not such a Dataset, or ``min_confidence`` is given without a confidence.

    Warns
    -----
    UserWarning
        If times are uneven, or contradict ``fps``, and no `frame_rate` is given. Every second or
        k-th frame of ``fps`` is no contradiction.

    See Also
    --------
    find_gaps : Lists the missing positions.
    sklearn_motionsync.Skeleton.from_frame : The skeleton of a recording.

    Examples
    --------
    >>> import numpy as np
    >>> import xarray as xr
    >>> from sklearn_motionsync.io import from_poses
    >>> position = xr.DataArray(
    ...     np.zeros((90, 2, 2, 1)),
    ...     dims=("time", "space", "keypoint", "individual"),
    ...     coords={"space": ["x", "y"], "keypoint": ["hip", "knee"], "individual": ["ann"]},
    ... )
    >>> (ann,) = from_poses(xr.Dataset({"position": position}, attrs={"fps": 30}))
    >>> list(ann.columns), ann.attrs["frame_rate"], ann.attrs["trial"]
    (['hip_x', 'hip_y', 'knee_x', 'knee_y'], 30.0, 'ann')
    """
    check_frame_rate(frame_rate)
    check_confidence(min_confidence)
    check_filling(max_gap, "keep")
    position, confidence, attrs = _split_poses(poses)
    position, values = _arrange(position, "position", _DIMENSIONS)
    axes = _read_axes(position)
    # A copy: the poses are not changed.
    values = np.array(values[..., np.argsort(axes)], dtype=np.float64)
    if min_confidence is not None:
        if confidence is None:
            raise ValueError(
                f"min_confidence={min_confidence!r} needs a Dataset with the variable "
                "'confidence', and there is none."
            )
        _, confidence = _arrange(confidence, "confidence", _DIMENSIONS[:3])
        confidence = np.broadcast_to(confidence, values.shape[:3])
    joints = make_unique(_read_names(position, "keypoint"))
    times, fps = _read_times(position, attrs, frame_rate)
    motion = {
        "frame_rate": fps,
        "units": None,
        "up": "-y" if len(axes) == 2 else None,
        "kind": "keypoints",
        "joints": joints,
        "times": times,
        "decimals": 17,
    }
    set_clock(motion, "The poses", frame_rate, may_be_thinned=True)
    recordings, options = [], {"max_gap": max_gap, "min_confidence": min_confidence}
    for i, individual in enumerate(_read_names(position, "individual")):
        motion["positions"] = values[:, i]
        if min_confidence is not None:
            motion["confidence"] = confidence[:, i]
        df = as_recording(motion, "poses", individual, ("individual", FRAME), **options)
        if trial is not None:
            df.attrs |= label_of_part(trial, individual, "individual")
        recordings.append(df)
    return recordings


def _split_poses(poses):
    """Positions, their confidence or None, and the ``attrs`` of both."""
    if hasattr(poses, "data_vars"):
        if "position" not in poses.data_vars:
            raise ValueError(
                "A Dataset of poses needs the variable 'position', got "
                f"{[str(name) for name in poses.data_vars]}; rename it, as in "
                "ds.rename({'points': 'position'})."
            )
        return poses["position"], poses.get("confidence"), poses["position"].attrs | poses.attrs
    if not hasattr(poses, "expand_dims"):
        raise ValueError(
            "from_poses needs an xarray Dataset or DataArray with the dimensions time, space, "
            f"keypoint and individual, got {type(poses).__name__}. Positions of other kinds: "
            "pd.DataFrame(x, columns=['hip_x', 'hip_y', ...])."
        )
    return poses, None, poses.attrs


def _arrange(array, what, dimensions):
    """A DataArray with these dimensions in their order, and its values."""
    names = {*array.dims, *array.coords}
    array = array.rename({old: new for old, new in _RENAMED.items() if old in names})
    extra = [dim for dim in array.dims if dim not in dimensions]
    if extra:
        raise ValueError(
            f"The {what} of poses has the dimensions {list(dimensions)}, got also {extra}; select "
            f"one of each, as in ds.isel({extra[0]}=0)."
        )
    missing = [dim for dim in dimensions if dim not in array.dims]
    for dim in {"time", "space"} & set(missing):
        raise ValueError(f"The {what} of poses needs the dimension {dim!r}, got {array.dims}.")
    array = array.expand_dims(missing).transpose(*dimensions)
    values = array.values
    if values.dtype.kind not in "fiub":
        raise ValueError(f"The {what} of poses must be numbers, got {values.dtype}.")
    if not values.size:
        raise ValueError(f"The {what} of poses is empty: {dict(array.sizes)}.")
    return array, values


def _read_names(position, dimension):
    if dimension not in position.coords:
        return [f"{dimension}_{i}" for i in range(position.sizes[dimension])]
    return [str(name) for name in position.coords[dimension].values.tolist()]


def _read_axes(position):
    has_names = "space" in position.coords
    axes = _read_names(position, "space") if has_names else list("xyz"[: position.sizes["space"]])
    if sorted(axes) not in (["x", "y"], ["x", "y", "z"]):
        raise ValueError(
            f"The dimension 'space' must hold 'x', 'y' and optionally 'z', got {axes}; convert "
            "other coordinates to these."
        )
    return axes


def _read_times(position, attrs, frame_rate):
    """The times in seconds, and the frame rate of ``attrs``; None of what is not known."""
    fps = read_rate(attrs.get("fps"))
    if "time" not in position.coords:
        return None, fps
    values = position.coords["time"].values
    unit = "seconds" if values.dtype.kind in "mM" else attrs.get("time_unit")
    times = times_as_numbers(values, "The coordinate 'time' of poses")
    if not np.isfinite(times).all() or (np.diff(times) < 0).any():
        raise ValueError("The times of poses must increase; sort them by ds.sortby('time').")
    if unit is None:
        unit = "frames" if (times == np.round(times)).all() else "seconds"
    word = str(unit).lower()
    if word.startswith("frame"):
        rate = frame_rate if fps is None else fps
        return None if rate is None else times / rate, fps
    if word not in ("s", "sec", "second", "seconds"):
        raise ValueError(
            f"The times of poses must be seconds or frames, but attrs['time_unit'] is {unit!r}. "
            "Change them, as in ds.assign_coords(time=ds.time / 1000).assign_attrs("
            "time_unit='seconds')."
        )
    return times, fps
