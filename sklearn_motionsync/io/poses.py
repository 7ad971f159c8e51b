"""Poses of labelled arrays: what `movement` and others keep of tracked key-points."""

import math
from numbers import Real

import numpy as np
import pandas as pd

from ..inputs.tables import FRAME, label_of_part
from .clock import find_rate, tell_uneven
from .gaps import check_max_gap, fill_gaps
from .text import unique

# What the dimensions are called, the older names last.
_NAMES = {
    "time": ("time",),
    "individual": ("individual", "individuals"),
    "keypoint": ("keypoint", "keypoints"),
    "space": ("space",),
}


def from_poses(poses, *, min_confidence=None, frame_rate=None, max_gap=0, performance=None):
    """Turn an xarray Dataset of poses, as `movement` has them, into recordings.

    xarray is not needed for it, beyond what made the Dataset.

    Parameters
    ----------
    poses : xarray Dataset or DataArray
        A Dataset with the variable ``position`` and perhaps ``confidence``, or positions alone.
        Dimensions, in any order, are ``time``, ``space`` ("x", "y" and perhaps "z"), ``keypoint``
        (or ``keypoints``) and ``individual`` (or ``individuals``); the last two may lack where one
        was selected. Its ``attrs`` may hold ``fps`` and ``time_unit``, "seconds" or "frames".
    min_confidence : float, default=None
        Positions of less confidence become NaN. Those whose confidence is NaN are kept.
    frame_rate : float, default=None
        Frames a second. By default as the times say, or ``fps`` where they are numbers of frames.
    max_gap : int, default=0
        Gaps of up to that many frames are interpolated, see `fill_gaps`.
    performance : hashable, default=None
        What the recording is called, such as the name of its file; it stands before the name of
        the individual. A tuple has a level for each of its parts.

    Returns
    -------
    list of DataFrame (n_frames, n_dims * n_keypoints)
        One for each individual, float64, with the columns ``<keypoint>_x``, ``<keypoint>_y`` and
        perhaps ``<keypoint>_z``, key-point by key-point, and an index named "frame", from 0. Their
        ``attrs`` are as those of `read_motion`: ``format`` ("poses"), ``frame_rate`` (None where
        nobody says, or times are uneven), ``units`` (None), ``up`` ("-y" in the plane, as pictures
        count from above; None in space), ``kind`` ("keypoints"), ``joints``, ``parents`` (-1 for
        all), ``first_time`` where times are seconds, ``times`` where they are uneven;
        ``performance``, the name of the individual, or ``(performance, individual)``, and
        ``levels``.

    Raises
    ------
    ValueError
        If these are no such poses, or `min_confidence` is given and there is no confidence.

    Warns
    -----
    UserWarning
        If times are uneven, unless `frame_rate` is given.

    See Also
    --------
    find_gaps : Which positions are missing.
    sklearn_motionsync.Skeleton.from_frame : The skeleton of what is returned.

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
    >>> list(ann.columns), ann.attrs["frame_rate"], ann.attrs["performance"]
    (['hip_x', 'hip_y', 'knee_x', 'knee_y'], 30.0, 'ann')
    """
    check_max_gap(max_gap)
    _check_number(min_confidence, "min_confidence", "a number such as 0.6")
    _check_number(frame_rate, "frame_rate", "frames a second, above 0", above=0)
    position, confidence, attrs = _parts(poses)
    values = _in_order(position, "position")
    axes = _axes(position, values.shape[3])
    values = np.array(values[..., [axes.index(axis) for axis in sorted(axes)]], dtype=np.float64)
    _drop_uncertain(values, confidence, min_confidence)
    facts = _clock(position, attrs, frame_rate)
    joints = unique(_names(position, "keypoint", values.shape[2]))
    columns = [f"{joint}_{axis}" for joint in joints for axis in sorted(axes)]
    index = pd.RangeIndex(len(values), name="frame")
    recordings = []
    for i, individual in enumerate(_names(position, "individual", values.shape[1])):
        df = pd.DataFrame(values[:, i].reshape(len(values), -1), columns=columns, index=index)
        df.attrs = {"format": "poses", "units": None, "up": "-y" if len(axes) == 2 else None}
        df.attrs |= {"kind": "keypoints", "joints": joints, "parents": [-1] * len(joints)} | facts
        df.attrs |= {"performance": individual, "levels": ("individual", FRAME)}
        if performance is not None:
            df.attrs |= label_of_part(performance, individual, "individual")
        recordings.append(fill_gaps(df, max_gap) if max_gap else df)
    return recordings


def _check_number(value, name, what, above=-math.inf):
    if value is None:
        return
    if not isinstance(value, Real) or isinstance(value, bool) or not above < value < math.inf:
        raise ValueError(f"{name} must be {what}, got {value!r}.")


def _parts(poses):
    """Positions, their confidence or None, and what is known of all."""
    if hasattr(poses, "data_vars"):
        if "position" not in poses.data_vars:
            raise ValueError(
                "A Dataset of poses needs the variable 'position', got "
                f"{[str(name) for name in poses.data_vars]}; rename it, as in "
                "ds.rename({'points': 'position'})."
            )
        confidence = poses["confidence"] if "confidence" in poses.data_vars else None
        return poses["position"], confidence, {**poses["position"].attrs, **poses.attrs}
    if not all(hasattr(poses, name) for name in ("dims", "coords", "values", "attrs")):
        raise ValueError(
            "from_poses needs an xarray Dataset or DataArray with the dimensions time, space, "
            f"keypoint and individual, got {type(poses).__name__}. Positions of other kinds: "
            "pd.DataFrame(x, columns=['hip_x', 'hip_y', ...])."
        )
    return poses, None, dict(poses.attrs)


def _dimensions(array, what, known=_NAMES):
    """The place of each known dimension among those of an array, if it is there."""
    dims = [str(dim) for dim in array.dims]
    places = {}
    for name, called in known.items():
        places[name] = next((dims.index(other) for other in called if other in dims), None)
    others = [dim for i, dim in enumerate(dims) if i not in places.values()]
    if others:
        raise ValueError(
            f"The {what} of poses has the dimensions {list(known)}, got also {others}; select one "
            f"of each, as in ds.isel({others[0]}=0)."
        )
    return places


def _in_order(array, what, known=_NAMES):
    """Values with all known dimensions in their order; one that is not there has one place."""
    places = _dimensions(array, what, known)
    needed = [name for name in ("time", "space") if name in known and places[name] is None]
    if needed:
        raise ValueError(
            f"The {what} of poses needs the dimension {needed[0]!r}, got {list(array.dims)}."
        )
    there = [place for place in places.values() if place is not None]
    values = np.transpose(np.asarray(array.values), there)
    if values.dtype.kind not in "fiub":
        raise ValueError(f"The {what} of poses must be numbers, got {values.dtype}.")
    missing = [i for i, place in enumerate(places.values()) if place is None]
    values = np.expand_dims(values, missing)
    if 0 in values.shape:
        raise ValueError(
            f"The {what} of poses is empty: {dict(zip(known, values.shape, strict=True))}."
        )
    return values


def _coordinate(array, name):
    """The values of a coordinate, also of one that was selected; None if there is none."""
    found = next((other for other in _NAMES[name] if other in array.coords), None)
    return None if found is None else np.atleast_1d(array.coords[found].values)


def _names(array, name, n):
    names = _coordinate(array, name)
    if names is None or len(names) != n:
        return [f"{name}_{i}" for i in range(n)]
    return [str(value) for value in names.tolist()]


def _axes(position, n):
    names = _coordinate(position, "space")
    axes = list("xyz"[:n]) if names is None else [str(axis) for axis in names.tolist()]
    if sorted(axes) not in (["x", "y"], ["x", "y", "z"]):
        raise ValueError(
            f"The dimension 'space' must hold 'x', 'y' and perhaps 'z', got {axes}; other "
            "coordinates must be turned into these."
        )
    return axes


def _drop_uncertain(values, confidence, least):
    if least is None:
        return
    if confidence is None:
        raise ValueError(
            f"min_confidence={least!r} needs a Dataset with the variable 'confidence', and there "
            "is none."
        )
    known = {name: called for name, called in _NAMES.items() if name != "space"}
    doubtful = _in_order(confidence, "confidence", known) < least
    values[np.broadcast_to(doubtful, values.shape[:3])] = np.nan


def _clock(position, attrs, frame_rate):
    """What is known of the time."""
    fps = _as_number(attrs.get("fps"))
    good = isinstance(fps, Real) and not isinstance(fps, bool) and 0 < fps < math.inf
    fps = float(fps) if good else None
    times = _coordinate(position, "time")
    if times is None:
        return {"frame_rate": fps if frame_rate is None else float(frame_rate)}
    times, in_seconds = _as_seconds(times, attrs.get("time_unit"), fps)
    rate, even = find_rate(times, stated=fps if in_seconds else None)
    facts = {"frame_rate": rate if in_seconds else None}
    if in_seconds:
        facts["first_time"] = float(times[0])
    if not even:
        facts["times"] = times.tolist()
    if frame_rate is not None:
        facts["frame_rate"] = float(frame_rate)
    elif not even:
        tell_uneven("The poses", times, stacklevel=4, unit="s" if in_seconds else "frames")
    return facts


def _as_number(value):
    """Numbers that are written as text, as files keep them who know text only."""
    try:
        return float(value) if isinstance(value, str) else value
    except ValueError:
        return None


def _as_seconds(times, unit, fps):
    """The times, and whether they are seconds; otherwise they are frames."""
    if times.dtype.kind in "mM":
        times, unit = (times - times[0]) / np.timedelta64(1, "s"), "seconds"
    elif times.dtype.kind not in "fiu":
        raise ValueError(f"The times of poses must be numbers, got {times.dtype}.")
    times = times.astype(np.float64)
    if not np.isfinite(times).all() or (np.diff(times) < 0).any():
        raise ValueError("The times of poses must increase; sort them by ds.sortby('time').")
    if unit is None:
        unit = "frames" if (times == np.round(times)).all() else "seconds"
    word = str(unit).lower()
    in_frames = word.startswith("frame")
    if not in_frames and word not in ("s", "sec", "second", "seconds"):
        raise ValueError(
            f"The times of poses must be seconds or frames, but attrs['time_unit'] is {unit!r}. "
            "Change them, as in ds.assign_coords(time=ds.time / 1000).assign_attrs("
            "time_unit='seconds')."
        )
    if in_frames and fps is not None:
        return times / fps, True
    return times, not in_frames
