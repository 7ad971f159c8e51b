"""Gaps: frames where a marker was not seen."""

import warnings

import numpy as np
import pandas as pd

from ..body.skeleton import parse_joint_columns


def find_gaps(df):
    """List the gaps of a recording.

    Parameters
    ----------
    df : DataFrame (n_frames, 3 * n_joints) or (n_frames, 2 * n_joints)
        Columns ``<joint>_x``, ``<joint>_y``, ``<joint>_z``, as `read_motion` gives them, or
        ``<joint>_x``, ``<joint>_y`` of key-points in the plane. A joint is missing in a frame
        where any of them is NaN.

    Returns
    -------
    DataFrame
        One row a gap, by joint and time: ``joint``; ``first`` and ``last``, positions of the
        frames, counted from 0; ``n_frames``; ``inside``, False where the gap touches the
        beginning or the end of the recording, so that nothing can be interpolated.

    Raises
    ------
    ValueError
        If it is no DataFrame, the columns are not such triples or pairs, values are infinite or
        no numbers, or it holds several performances.

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
    joints, n_dims, values = _read(df)
    joint, first, last = _find(_missing(values, n_dims))
    return pd.DataFrame(
        {
            "joint": np.array(joints, dtype=object)[joint],
            "first": first,
            "last": last,
            "n_frames": last - first + 1,
            "inside": (first > 0) & (last < len(df) - 1),
        }
    )


def fill_gaps(df, max_gap):
    """Interpolate short gaps of a recording.

    Parameters
    ----------
    df : DataFrame (n_frames, 3 * n_joints) or (n_frames, 2 * n_joints)
        As for `find_gaps`. It is not changed.
    max_gap : int
        The longest gap to fill, in frames. Longer ones stay NaN, as do those that touch an end
        of the recording: nothing is extrapolated. Joints of the same name are filled each by
        itself.

    Returns
    -------
    DataFrame
        The same columns, index and ``attrs``.

    Raises
    ------
    ValueError
        If `max_gap` is no whole number from 0, or as for `find_gaps`.

    Notes
    -----
    Akima's piecewise cubic polynomials are used. Gaps cut out of real recordings came back with
    these errors (RMS over 600 gaps, in millimetres; hands and feet of HDM05 at 120 Hz, and
    the markers of a C3D file of walking at 50 Hz):

    ======  ======  =====  =====  ======  ======  =====  =====  ======
    gap of  HDM05                         markers
    ------  ----------------------------  ----------------------------
    frames  linear  PCHIP  Akima  spline  linear  PCHIP  Akima  spline
    ======  ======  =====  =====  ======  ======  =====  =====  ======
    5          3.4    1.6    1.0     0.9     4.0    2.6    2.4     3.0
    10        11.6    5.9    3.2     2.0     9.0    5.1    4.2     4.5
    20        36.4   22.6   10.8     9.2    26.5   16.1   13.1    15.1
    40        85.6   56.5   38.3    35.0    62.4   43.2   40.3    41.8
    ======  ======  =====  =====  ======  ======  =====  =====  ======

    The cubic spline wins on HDM05's joints, which were smoothed before; Akima wins on
    markers as they were recorded, where gaps are. With 20 frames and more the error
    of any is centimetres.

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
    """
    check_max_gap(max_gap)
    _, n_dims, values = _read(df)
    missing = _missing(values, n_dims)
    joint, first, last = _find(missing)
    short = (first > 0) & (last < len(df) - 1) & (last - first < max_gap)
    # By the joint's place: names may come twice.
    for j in np.unique(joint[short]):
        rows = short & (joint == j)
        here = np.zeros(len(df) + 1, dtype=int)
        np.add.at(here, first[rows], 1)
        np.add.at(here, last[rows] + 1, -1)
        frames = np.flatnonzero(np.cumsum(here[:-1]))
        part = values[:, n_dims * j : n_dims * (j + 1)]
        filled = _interpolate(np.flatnonzero(~missing[:, j]), part, frames)
        part[frames] = np.where(np.isnan(part[frames]), filled, part[frames])
    result = pd.DataFrame(values, index=df.index, columns=df.columns)
    result.attrs = dict(df.attrs)
    return result


def check_max_gap(max_gap):
    whole = isinstance(max_gap, int | np.integer) and not isinstance(max_gap, bool)
    if not whole or max_gap < 0:
        raise ValueError(f"max_gap must be a whole number of frames, 0 or more, got {max_gap!r}.")


def warn_of_gaps(df, name):
    """Say once and shortly what is missing, if anything is."""
    gaps = find_gaps(df)
    if gaps.empty:
        return
    joints, _ = parse_joint_columns(df)
    worst = gaps.groupby("joint")["n_frames"].sum().sort_values(ascending=False, kind="stable")
    n_missing = int(worst.sum())
    names = ", ".join(str(joint)[:20] for joint in worst.index[:4])
    names += ", ..." if len(worst) > 4 else ""
    n_outside = int((~gaps["inside"]).sum())
    ends = f"; {n_outside} touch an end and cannot be interpolated" if n_outside else ""
    warnings.warn(
        f"{name}: {100 * n_missing / (len(df) * len(joints)):.2g} % of the positions are missing "
        f"(NaN), of {len(worst)} of {len(joints)} {df.attrs.get('kind', 'joints')} ({names}): "
        f"{len(gaps)} gaps, the longest of {gaps['n_frames'].max()} frames{ends}. Interpolate "
        "short gaps with read_motion(..., max_gap=<frames>), list them with find_gaps(df), or drop "
        "those columns.",
        UserWarning,
        stacklevel=3,
    )


def warn_of_missing(df, name):
    """The same of a table that holds no positions."""
    missing = df.isna().sum()
    missing = missing[missing > 0].sort_values(ascending=False, kind="stable")
    if missing.empty:
        return
    names = ", ".join(str(column)[:40] for column in missing.index[:4])
    names += ", ..." if len(missing) > 4 else ""
    warnings.warn(
        f"{name}: {100 * missing.sum() / df.size:.2g} % of the values are missing (NaN), of "
        f"{len(missing)} of {df.shape[1]} {df.attrs.get('kind', 'columns')} ({names}). Interpolate "
        "short gaps with df.interpolate(limit=<frames>, limit_area='inside'), or drop those "
        "columns.",
        UserWarning,
        stacklevel=3,
    )


def _read(df):
    """Names of the joints, their dimensions, and a copy of the positions."""
    if not isinstance(df, pd.DataFrame):
        raise ValueError(
            f"A recording must be a DataFrame, as read_motion gives, got {type(df).__name__}; name "
            "the columns of an array with pd.DataFrame(x, columns=skeleton.column_names)."
        )
    joints, n_dims = parse_joint_columns(df)
    levels = df.index.droplevel(-1) if df.index.nlevels > 1 else df.index[:0]
    if levels.nunique() > 1:
        raise ValueError(
            f"A recording must be of one performance, got a table of {levels.nunique()}; take them "
            "one by one, as in df.groupby(level=0, group_keys=False).apply(fill_gaps, max_gap=10)."
        )
    for column, dtype in enumerate(df.dtypes):
        if getattr(dtype, "kind", "O") not in "fiubO":
            raise _no_numbers(df, column, dtype)
    try:
        values = df.to_numpy(dtype=np.float64, na_value=np.nan, copy=True)
    except (TypeError, ValueError) as error:
        column = next(i for i in range(df.shape[1]) if not _is_numeric(df.iloc[:, i]))
        raise _no_numbers(df, column, df.dtypes.iloc[column]) from error
    if np.isinf(values).any():
        frame, column = np.argwhere(np.isinf(values))[0]
        raise ValueError(
            f"Frame {frame}, column {df.columns[column]!r} is infinite; positions must be finite, "
            "or NaN where a marker was not seen. Replace it, as in "
            "df.replace([np.inf, -np.inf], np.nan)."
        )
    return joints, n_dims, values


def _is_numeric(column):
    try:
        column.to_numpy(dtype=np.float64, na_value=np.nan)
    except (TypeError, ValueError):
        return False
    return True


def _no_numbers(df, column, dtype):
    return ValueError(
        f"Column {df.columns[column]!r} must hold numbers, got {dtype}; convert it with "
        "pd.to_numeric, or drop that joint."
    )


def _missing(values, n_dims):
    return np.isnan(values).reshape(len(values), -1, n_dims).any(axis=2)


def _find(missing):
    """Joint, first and last frame of each gap; those of a joint one behind the other."""
    change = np.diff(np.pad(missing, ((1, 1), (0, 0))).astype(np.int8), axis=0).T
    joint, first = np.nonzero(change == 1)
    return joint, first, np.nonzero(change == -1)[1] - 1


def _interpolate(known, part, frames):
    from scipy.interpolate import Akima1DInterpolator

    if len(known) == 2:
        # A line. SciPy 1.13 reads memory it never set here.
        share = ((frames - known[0]) / (known[1] - known[0]))[:, None]
        return (1 - share) * part[known[0]] + share * part[known[1]]
    return Akima1DInterpolator(known, part[known])(frames)
