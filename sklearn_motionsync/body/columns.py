"""Names of columns of joint positions: which joints they tell, and in which order."""

from collections.abc import Iterable, Mapping, Set
from numbers import Integral, Real

from ..inputs.numbers import column_names
from .formats import LANDMARKS

__all__ = [
    "AXES",
    "as_joints",
    "as_landmarks",
    "as_parents",
    "check_columns",
    "circle_of",
    "is_whole",
    "joints_with_axes",
    "kept_parents",
]

# Of the positions in the plane, and in space.
AXES = {2: "xy", 3: "xyz"}


def joints_with_axes(df):
    """Names of the joints of a DataFrame of their positions, and how many axes each has.

    Its columns are ``<joint>_x``, ``_y``, ``_z``, ..., or ``<joint>_x``, ``_y``, ... in the plane.
    """
    columns = getattr(df, "columns", None)
    if columns is None or callable(columns):
        raise ValueError(
            "Joints are told from the columns of a DataFrame, got "
            f"{type(df).__name__}. Use pd.DataFrame(positions, columns=skeleton.column_names)."
        )
    columns = [str(column) for column in columns]
    for n_dims, axes in sorted(AXES.items(), reverse=True):
        joints = [column[:-2] for column in columns[::n_dims]]
        if joints and columns == [f"{joint}_{axis}" for joint in joints for axis in axes]:
            return joints, n_dims
    raise ValueError(
        "The columns must be <joint>_x, <joint>_y, <joint>_z or, in the plane, <joint>_x, "
        f"<joint>_y for one joint after the other, got {columns[:4]}"
        f"{' ...' if len(columns) > 4 else ''}; select them with df[skeleton.column_names], with "
        "df.filter(regex='_[xyz]$'), or drop the others."
    )


def check_columns(x, skeleton, what):
    """Refuse a table in which a column of the skeleton stands in another one's place.

    Names that the skeleton does not have are fine.

    Parameters
    ----------
    x : table, or anything without names
    skeleton : Skeleton
    what : str
        What to call it in messages, with a capital letter.
    """
    expected = skeleton.column_names
    place_of = {name: place for place, name in enumerate(expected)}
    for place, name in enumerate(column_names(x) or ()):
        if place_of.get(name, place) != place:
            raise ValueError(
                f"{what}: column {place} is {name!r}, where the skeleton has "
                f"{(*expected, 'none')[min(place, len(expected))]!r}. Bring the columns into the "
                "order of the skeleton's joints by df[skeleton.column_names]."
            )


# -- what a skeleton is made of, checked: names, parents, landmarks ----------------------


def as_joints(joints):
    """Names as a tuple of plain text."""
    names = _listed(joints)
    if names is None or not all(isinstance(name, str) and name for name in names):
        raise ValueError(
            "joints must be the names of the joints, a list of text in the order of the columns; "
            f"got {joints!r}."
        )
    return tuple(map(str, names))


def as_parents(parents):
    """Indices as a tuple of plain numbers."""
    listed = _listed(parents)
    if listed is None:
        raise ValueError(
            "parents must be a list, the index of each joint's parent or -1; got "
            f"{type(parents).__name__}."
        )
    for j, parent in enumerate(listed):
        if not is_whole(parent):
            raise ValueError(
                "parents must be whole numbers, the index of each joint's parent or -1; got "
                f"{parent!r} for joint {j}."
            )
    return tuple(map(int, listed))


def _listed(values):
    """What has an order as a tuple; None for text, sets and whatever holds nothing."""
    if isinstance(values, (str, bytes, Set)) or not isinstance(values, Iterable):
        return None
    return None if getattr(values, "ndim", 1) == 0 else tuple(values)


def is_whole(value):
    """Whether it is a whole number of any type, but no truth value."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return False
    return isinstance(value, Integral) or float(value).is_integer()


def as_landmarks(landmarks):
    """Landmarks that are known by name, as a dict: a joint's name, several as a tuple, or None."""
    if not isinstance(landmarks, Mapping):
        raise ValueError(
            "landmarks must be a mapping, the joint at each landmark such as "
            f"{{'pelvis': 'root'}}; got {landmarks!r}."
        )
    if unknown := sorted(str(name) for name in landmarks if name not in LANDMARKS):
        raise ValueError(f"landmarks must be among {LANDMARKS}, got {unknown}.")
    return {name: _as_place(name, at) for name, at in landmarks.items()}


def _as_place(landmark, at):
    """The joint of a landmark, or the tuple of those whose mean it is."""
    if at is None:
        return None
    joints = (at,) if isinstance(at, str) else _listed(at)
    sound = joints and all(isinstance(joint, str) for joint in joints)
    if not sound or len(set(joints)) < len(joints):
        raise ValueError(
            f"The landmark {landmark!r} must be a joint's name, a tuple of different names for "
            f"their mean, or None where it lacks; got {at!r}."
        )
    return str(joints[0]) if len(joints) == 1 else tuple(map(str, joints))


def circle_of(parents):
    """Joints whose parents lead back to the first of them; empty if all lead to a root."""
    sound = set()
    for joint in range(len(parents)):
        chain = []
        while joint >= 0 and joint not in sound:
            if joint in chain:
                return [*chain[chain.index(joint) :], joint]
            chain.append(joint)
            joint = parents[joint]
        sound.update(chain)
    return []


def kept_parents(joints, names, parents):
    """Index of the nearest ancestor that is among the joints, or -1, for each joint."""
    if len(names) != len(parents) or any(not -1 <= p < len(names) for p in parents):
        raise ValueError(
            "df.attrs must have one parent, an index or -1, for each of its joints; got "
            f"{len(names)} joints and the parents {parents}."
        )
    above = {name: names[p] for name, p in zip(names, parents, strict=True) if p >= 0}
    index = {joint: j for j, joint in enumerate(joints)}
    result = []
    for joint in joints:
        ancestor = above.get(joint)
        for _ in names:  # no more steps than joints, should parents run in a circle
            if ancestor is None or ancestor in index:
                break
            ancestor = above.get(ancestor)
        result.append(index.get(ancestor, -1))
    return result
