"""Positions of joints as labs have them: columns in any spelling, arrays with an axis of joints."""

import functools

import numpy as np

from ..inputs.columns import find_clock, parse_columns
from ..inputs.tables import as_pandas
from ..inputs.wording import counted
from .formats import AXES


def joint_columns(df):
    """The columns of the joints of a DataFrame of positions, as `parse_columns` gives them.

    Beside the positions there may be columns of their quality, and of frames and times.
    """
    columns = getattr(df, "columns", None)
    if columns is None or callable(columns):
        raise ValueError(
            "The names of joints are read from the columns of a DataFrame, got "
            f"{type(df).__name__}. Use pd.DataFrame(positions, columns=skeleton.column_names)."
        )
    # What a file calls joints may be their angles.
    parsed, others = _parse(tuple(columns), "joints" in getattr(df, "attrs", {}))
    if not parsed.joints or others:
        names = [str(column) for column in columns]
        raise ValueError(
            "The columns must be <joint>_x, <joint>_y, <joint>_z or, in the plane, <joint>_x, "
            "<joint>_y, or in another spelling such as <joint> X, <joint>:X, or two levels, got "
            f"{names[:4]}{' ...' if len(names) > 4 else ''}"
            + (f", of which {others[:4]} are no positions" if parsed.joints else "")
            + "; select them with df[skeleton.column_names], with df.filter(regex='_[xyz]$'), or "
            "drop the others."
        )
    if len(subjects := sorted(set(parsed.subjects))) > 1:
        raise ValueError(
            f"The columns are of several subjects, {subjects}; select one of them, as in "
            f"df.xs({subjects[0]!r}, axis=1, level=<level>)."
        )
    return parsed


def columns_of_skeleton(x, skeleton):
    """The columns of a table that are a skeleton's positions, in another spelling of its names.

    Returns
    -------
    JointColumns or None
        With the joints in the order of the skeleton; None if the names are those of the skeleton,
        or do not fit to them.
    """
    columns = getattr(x, "columns", None)
    if columns is None or callable(columns):
        return None
    return _fit(tuple(columns), skeleton)


def plain_positions(X, skeleton):
    """Trials as arrays (n_frames, n_dims * n_joints), or as tables with the skeleton's names.

    Tables of other spellings, and arrays (n_frames, n_joints, n_dims) or a stack of them, become
    such ones where they fit to the skeleton; all else stays as it is.
    """
    if type(X) in (list, tuple):  # but not what was checked before
        return [plain_positions(x, skeleton) if hasattr(x, "shape") else x for x in X]
    fitting = columns_of_skeleton(X, skeleton)
    if fitting is not None:
        table = as_pandas(X).iloc[:, fitting.places.ravel()]
        return table.set_axis(skeleton.column_names, axis=1)
    shape = getattr(X, "shape", ())
    if len(shape) > 2 and tuple(shape[-2:]) == (len(skeleton.joints), skeleton.n_dims):
        return np.asarray(X).reshape(*shape[:-2], -1)
    return X


def check_columns(names, skeleton, what, width=None):
    """Refuse columns of which one of the skeleton has the place of another one.

    Columns with other names are accepted.

    Parameters
    ----------
    names : sequence of str
    skeleton : Skeleton
    what : str
        The subject of the message, with a capital letter.
    width : int, default=None
        The number of columns, if it is to be checked, too.
    """
    expected = skeleton.column_names
    if width not in (None, len(expected)):
        raise ValueError(
            f"{what} has {counted(width, 'feature')} a frame, but the skeleton's "
            f"{len(skeleton.joints)} joints need {len(expected)}: "
            f"{', '.join(AXES[skeleton.n_dims])} of each."
        )
    place_of = {name: place for place, name in enumerate(expected)}
    for place, name in enumerate(names):
        if place_of.get(name, place) != place:
            raise ValueError(
                f"{what}: column {place} is {name!r}, where the skeleton has "
                f"{(*expected, 'none')[min(place, len(expected))]!r}. Bring the columns into the "
                "order of the skeleton's joints by df[skeleton.column_names]."
            )


@functools.lru_cache(maxsize=32)
def _parse(columns, any_vector=False):
    """The parsed columns, and the names of those that are no position, quality or clock."""
    parsed, clock = parse_columns(columns, any_vector), find_clock(columns)[:2]
    return parsed, [columns[place] for place in parsed.rest if place not in clock]


@functools.lru_cache(maxsize=32)
def _fit(columns, skeleton):
    if set(columns) == set(skeleton.column_names) or not columns:
        return None
    parsed, others = _parse(columns)
    places = {joint: k for k, joint in enumerate(_without_subject(parsed.joints))}
    joints = _without_subject(skeleton.joints)
    if others or len(parsed.axes) != skeleton.n_dims or len(parsed.joints) != len(joints):
        return None
    if places.keys() != set(joints):
        return None
    order = [places[joint] for joint in joints]
    confidence = [parsed.confidence[k] for k in order]
    return parsed._replace(places=parsed.places[order], confidence=confidence)


def _without_subject(joints):
    """Names of joints without the prefix of the one subject that all of them have."""
    subjects = {joint.rpartition(":")[0] for joint in joints}
    return [joint.rpartition(":")[2] for joint in joints] if len(subjects) == 1 else list(joints)
