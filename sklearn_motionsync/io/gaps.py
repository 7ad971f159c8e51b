"""Gaps: frames in which a marker was not seen."""

from numbers import Integral
from typing import Literal

import numpy as np
import pandas as pd

from ..body.columns import joint_columns
from ..inputs.numbers import as_numbers, check_finite
from ..inputs.recorded import Recorded
from ..inputs.wording import counted
from ..matching.gaps import fill_by_take
from ..utils.parallel import one_blas_thread
from .events import name_recording
from .text import warn

# Kinds of what joints are the names of; angles and forces have no positions.
POSITIONS = ("joints", "markers", "segments", "keypoints")


def find_gaps(df: pd.DataFrame) -> pd.DataFrame:
    """List the gaps of a recording.

    Parameters
    ----------
    df : DataFrame (n_frames, 3 * n_joints) or (n_frames, 2 * n_joints)
        Joint positions: columns ``<joint>_x``, ``<joint>_y``, ``<joint>_z``, as `read_motion`
        returns them, or ``<joint>_x``, ``<joint>_y`` of key-points in the plane, or the other
        spellings of `Skeleton.from_frame`. A joint is missing in a frame where any of them is NaN.

    Returns
    -------
    DataFrame
        One row for each gap, sorted by joint and time, with the columns

        joint : str
            Name of the joint.
        first, last : int
            First and last missing frame: rows of `df`, counted from 0.
        n_frames : int
            Length of the gap, in frames.
        inside : bool
            False if the gap touches the start or the end of the recording, so that it cannot be
            filled.

    Raises
    ------
    ValueError
        If `df` is not a DataFrame of such columns, holds several trials, or has values that
        are infinite or not numeric.

    See Also
    --------
    fill_gaps : Fills gaps; its notes say what takes long ones.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from sklearn_motionsync.io import find_gaps
    >>> df = pd.DataFrame({f"knee_{axis}": [0.0, np.nan, np.nan, 3.0, 4.0] for axis in "xyz"})
    >>> find_gaps(df)
      joint  first  last  n_frames  inside
    0  knee      1     2         2    True
    """
    columns, values = _read(df)
    joint, first, last = _find(_missing(values, columns))
    return pd.DataFrame(
        {
            "joint": np.array(columns.joints)[joint],
            "first": first,
            "last": last,
            "n_frames": last - first + 1,
            "inside": (first > 0) & (last < len(df) - 1),
        }
    )


def fill_gaps(
    df: pd.DataFrame, max_gap: int, *, ends: Literal["keep", "trim"] = "keep"
) -> pd.DataFrame:
    """Fill gaps of a recording by what its own other frames tell, and trim it to what was seen.

    Parameters
    ----------
    df : DataFrame (n_frames, 3 * n_joints) or (n_frames, 2 * n_joints)
        Joint positions, as for `find_gaps`. It is not changed.
    max_gap : int
        The longest gap to fill, in frames, with those of rows that were dropped. Longer gaps stay
        NaN, as do those that touch an end of the recording: nothing is extrapolated.
    ends : {"keep", "trim"}, default="keep"
        "trim" leaves out the frames before the first and after the last one in which all joints
        are seen, after short gaps are filled. Joints that are never seen do not count.

    Returns
    -------
    DataFrame
        The positions with gaps filled, in the unit of `df`, with the same columns, index and
        ``attrs``. If it was trimmed, ``attrs["rows"]`` are its first and last row in `df`; events
        and times in ``attrs`` are those of the frames that are left, and frames that were numbered
        from 0 still are.

    Raises
    ------
    ValueError
        If `max_gap` is not a whole number of frames, 0 or more, or there is no such `ends`. If `df`
        is not as `find_gaps` needs it, or its index says that rows are not in order of time. If no
        two frames show all joints and it is to be trimmed.

    See Also
    --------
    find_gaps : Lists all gaps.

    Notes
    -----
    Hidden joints are regressed on the joints that are seen in the gap, in all other frames of the
    recording, with several penalties. What a regression leaves is joined across the gap by lines,
    by Akima's piecewise cubic polynomials and by cubic splines, and so are the positions without a
    regression. All these guesses are averaged; the weight of each is its error to the power of -12,
    in gaps as long, and half as long, elsewhere in the recording. So a joint that moves with the
    others follows them, and one that does not is interpolated. A recording too short for such gaps
    is interpolated by Akima's polynomials. A gap takes about a fortieth of a second in 1,000
    frames of 40 joints, and three times as long in 10,000 frames.

    A wrong frame beside a gap, or of another joint in it, is taken for movement: hide it before.
    The longer the gap and the less regular the movement, the larger the error; the page "Work with
    gaps and hidden limbs" of the manual has a table.

    Leave gaps NaN that are too long. `DirectionCosines` with ``hidden="nan"`` and then `ASpace`
    take them: what was hidden is expected from the limbs of all trials, and from the frames before
    and after. A `MotionTracker` fills in limbs of a movement that it knows.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from sklearn_motionsync.io import fill_gaps
    >>> df = pd.DataFrame({f"knee_{axis}": [0.0, np.nan, np.nan, 3.0, 4.0] for axis in "xyz"})
    >>> fill_gaps(df, 2)["knee_y"].round(6).tolist()
    [0.0, 1.0, 2.0, 3.0, 4.0]
    >>> fill_gaps(df, 1)["knee_y"].isna().sum()
    np.int64(2)

    A marker that was seen late:

    >>> late = pd.DataFrame({f"knee_{axis}": [np.nan, 1.0, 2.0, 3.0] for axis in "xyz"})
    >>> fill_gaps(late, 2, ends="trim")["knee_y"].tolist()
    [1.0, 2.0, 3.0]
    """
    check_filling(max_gap, ends)
    columns, values = _read(df)
    places = _places(df)
    order = np.argsort(places)
    points = values[order].reshape(len(df), *columns.places.shape)
    with one_blas_thread():
        filled = fill_by_take(points, max_gap, places[order])[np.argsort(order)]
    values = np.where(np.isnan(values), filled.reshape(values.shape), values)
    # Columns of quality stay as they are.
    at = {place: k for k, place in enumerate(columns.places.ravel())}
    parts = [values[:, at[k]] if k in at else df.iloc[:, k] for k in range(df.shape[1])]
    result = pd.DataFrame(dict(enumerate(parts)), index=df.index).set_axis(df.columns, axis=1)
    result.attrs = dict(df.attrs)
    return _trim(result, _missing(values, columns)) if ends == "trim" else result


def check_filling(max_gap, ends):
    if not isinstance(max_gap, Integral) or isinstance(max_gap, bool) or max_gap < 0:
        raise ValueError(f"max_gap must be a whole number of frames, 0 or more, got {max_gap!r}.")
    if ends not in ("keep", "trim"):
        raise ValueError(f"ends must be 'keep' or 'trim', got {ends!r}.")


def _trim(df, missing):
    """A recording from the first to the last frame in which all joints are seen."""
    never = missing.all(axis=0)
    seen = np.flatnonzero(~missing[:, ~never].any(axis=1))
    if len(seen) < 2 or never.all():
        raise ValueError(
            f"{name_recording(df)} cannot be trimmed: {0 if never.all() else len(seen)} of "
            f"{len(df)} frames show all joints. find_gaps(df) lists the gaps; give a larger "
            "max_gap, leave out joints, or leave out the recording."
        )
    first, last = int(seen[0]), int(seen[-1])
    rows, recording = np.arange(first, last + 1), Recorded(df)
    part = df.iloc[rows]
    if len(part) == len(df) or not df.index.equals(pd.RangeIndex(len(df))):
        # The index tells which frames of the recording the rows are.
        return part
    part = part.set_axis(pd.RangeIndex(len(rows), name=df.index.name))
    part.attrs = recording.attrs_of(rows) | {"rows": [first, last]}
    return part


def warn_of_gaps(df, name):
    """Warn of what is missing in a recording that a file was read into, if anything is."""
    if not np.isnan(df.to_numpy()).any():
        return
    kind = df.attrs.get("kind", "joints")
    what = "positions" if kind in POSITIONS else "values"
    if "channels" in df.attrs:
        missing, labels = df.isna().to_numpy(), list(df.columns)
        advice = ". Interpolate short gaps with df.interpolate(limit=<frames>, limit_area='inside')"
    else:
        columns = joint_columns(df)
        missing = _missing(df.to_numpy()[:, columns.places.ravel()], columns)
        labels, (_, first, last) = columns.joints, _find(missing)
        n_outside = int(((first == 0) | (last == len(df) - 1)).sum())
        ends = f"; {n_outside} touch an end, where ends='trim' leaves frames out" * bool(n_outside)
        advice = (
            f": {counted(len(first), 'gap')}, the longest of "
            f"{counted((last - first).max(initial=0) + 1, 'frame')}{ends}. Interpolate short gaps "
            "with read_motion(..., max_gap=<frames>), list them with find_gaps(df)"
        )
    n_missing = dict(sorted(zip(labels, missing.sum(axis=0).tolist(), strict=True)))
    worst = sorted(filter(n_missing.get, n_missing), key=n_missing.get, reverse=True)
    names = ", ".join(str(label)[:40] for label in worst[:4]) + ", ..." * (len(worst) > 4)
    share = 100 * missing.mean()
    digits = 2 if share < 99 else 3
    if worst:
        warn(
            f"{name}: {share:.{digits}g} % of the {what} are missing (NaN), of {len(worst)} of "
            f"{len(labels)} {kind} ({names}){advice}, or drop those columns."
        )


def _read(df):
    """The columns of the joints, and a copy of their positions, joint by joint."""
    name = name_recording(df)
    if "channels" in df.attrs:
        raise ValueError(
            f"{name} has no positions but {df.attrs.get('kind', 'channels')}: "
            "max_gap and ends go with positions."
        )
    columns = joint_columns(df)
    levels = df.index.droplevel(-1) if df.index.nlevels > 1 else df.index[:0]
    if levels.nunique() > 1:
        raise ValueError(
            f"A recording must be of one trial, got a table of {levels.nunique()}; use "
            "df.groupby(level=0, group_keys=False).apply(fill_gaps, max_gap=10)."
        )
    positions = df.iloc[:, columns.places.ravel()]
    values = np.array(as_numbers(positions, name, dtype=np.float64))
    check_finite(values, f"{name}, frame", list(positions.columns), allow_nan=True)
    return columns, values


def _missing(values, columns):
    return np.isnan(values).reshape(len(values), *columns.places.shape).any(axis=2)


def _find(missing):
    """Joint, first and last frame of each gap; those of a joint one behind the other."""
    change = np.diff(np.pad(missing, ((1, 1), (0, 0))).astype(np.int8), axis=0).T
    joint, first = np.nonzero(change == 1)
    return joint, first, np.nonzero(change == -1)[1] - 1


def _places(df):
    """Where rows lie in time, in frames: further apart where rows between them were dropped."""
    recording = Recorded(df)
    if recording.frames is None:
        return np.arange(len(df))
    steps = np.diff(recording.frames)
    if not ((steps > 0).all() or (steps < 0).all()):
        raise ValueError(
            "The rows of this recording are not in order of time, by its index; sort it by "
            "df.sort_index() before its gaps are filled."
        )
    return (recording.frames - recording.frames[:1]) / recording.step
