"""Skeleton: which columns are which joints, and which joints are the body's."""

from collections.abc import Mapping
from dataclasses import dataclass

from ..gate import names_of
from .checks import as_joints, as_landmarks, as_parents, circle_of
from .landmarks import (
    ACCLAIM,
    ACCLAIM_LANDMARKS,
    KINECT,
    KINECT_LANDMARKS,
    LANDMARKS,
    PAPER,
    guess_landmarks,
)

__all__ = ["LANDMARKS", "Skeleton", "check_columns", "joints_of"]


class _ReadOnly(dict):
    """A dict that stays as it is, so that what holds it can be hashed."""

    def _refuse(self, *args, **kwargs):
        raise TypeError("The landmarks of a skeleton stay as they are: make another skeleton.")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __hash__(self):
        return hash(frozenset(self.items()))

    def __reduce__(self):
        return type(self), (dict(self),)


@dataclass(frozen=True)
class Skeleton:
    """Which joints the positions hold, how they hang together, and which are the body's.

    Parameters
    ----------
    joints : sequence of str
        Names of the joints, in the order of the columns: joint j has the columns
        ``3 j``, ``3 j + 1``, ``3 j + 2`` (x, y, z).
    parents : sequence of int
        Index of each joint's parent, -1 for a root. Used to draw bones.
    landmarks : mapping of str to str, default=None
        The joint at each of the fifteen landmarks of the paper's body model:
        ``pelvis``, ``neck``, ``head`` and ``left_``/``right_`` ``shoulder``, ``elbow``,
        ``wrist``, ``hip``, ``knee``, ``ankle``. By default it is guessed from the names.
    up : {"y", "z"}, default="y"
        The vertical axis of the positions.

    Raises
    ------
    ValueError
        If lengths disagree, a name is no text or comes twice, a parent is no index of another
        joint, parents run in a circle, or a landmark is missing, unknown or names no joint.

    Notes
    -----
    The skeleton of a file is ``Skeleton.from_frame(datasets.read_motion(path))``. A skeleton cannot
    be changed, and serves as a key: equal ones have equal hashes.

    Examples
    --------
    >>> from sklearn_motionsync import Skeleton
    >>> skeleton = Skeleton.acclaim()
    >>> len(skeleton.joints), skeleton.landmarks["left_knee"]
    (31, 'lfemur')
    """

    joints: tuple
    parents: tuple
    landmarks: Mapping | None = None
    up: str = "y"

    def __post_init__(self):
        joints, parents = as_joints(self.joints), as_parents(self.parents)
        if len(joints) != len(parents) or len(set(joints)) != len(joints):
            raise ValueError(
                f"A skeleton needs different joint names and one parent each, got {len(joints)} "
                f"names ({len(set(joints))} different) and {len(parents)} parents."
            )
        if any(not -1 <= p < len(joints) or p == i for i, p in enumerate(parents)):
            raise ValueError(f"parents must be other joints' indices, or -1; got {parents}.")
        if circle := circle_of(parents):
            raise ValueError(
                f"parents run in a circle: {' > '.join(joints[j] for j in circle)}. The chain of "
                "every joint must end at a root, whose parent is -1."
            )
        if not (isinstance(self.up, str) and self.up in ("y", "z")):
            raise ValueError(f"up must be 'y' or 'z', got {self.up!r}.")
        object.__setattr__(self, "joints", joints)
        object.__setattr__(self, "parents", parents)
        object.__setattr__(self, "landmarks", self._checked_landmarks())

    def _checked_landmarks(self):
        guessed = self.landmarks is None
        landmarks = guess_landmarks(self.joints) if guessed else as_landmarks(self.landmarks)
        missing = [name for name in LANDMARKS if landmarks.get(name) not in self.joints]
        if missing:
            raise ValueError(
                f"No joint stands for the landmarks {missing}; give landmarks={{...}} with one of "
                f"the joints {list(self.joints)} for each."
            )
        return _ReadOnly({name: str(landmarks[name]) for name in LANDMARKS})

    # Files hold the landmarks as a plain dict, which every kind of file can fill again.

    def __getstate__(self):
        return vars(self) | {"landmarks": dict(self.landmarks)}

    def __setstate__(self, state):
        vars(self).update(state, landmarks=_ReadOnly(state["landmarks"]))

    def __repr__(self):
        for name in ("acclaim", "kinect", "paper"):
            if self == getattr(type(self), name)():
                return f"Skeleton.{name}()"
        return f"Skeleton(<{len(self.joints)} joints>, up={self.up!r})"

    @classmethod
    def paper(cls):
        """The paper's fifteen joints."""
        return cls._of(PAPER, {name: name for name in LANDMARKS})

    @classmethod
    def acclaim(cls):
        """The 31 joints of HDM05 and of CMU's ASF/AMC files."""
        return cls._of(ACCLAIM, ACCLAIM_LANDMARKS)

    @classmethod
    def kinect(cls):
        """The 20 joints of the first Kinect."""
        return cls._of(KINECT, KINECT_LANDMARKS)

    @classmethod
    def from_names(cls, joints, parents, up="y"):
        """A ready skeleton if the names are one's, otherwise landmarks guessed from names."""
        return cls(joints, parents, cls._likely_landmarks(joints), up)

    @classmethod
    def from_frame(cls, df, *, landmarks=None, up=None):
        """The skeleton of a DataFrame of positions, such as `datasets.read_motion` gives.

        Parameters
        ----------
        df : DataFrame (n_frames, 3 * n_joints)
            Columns ``<joint>_x``, ``<joint>_y``, ``<joint>_z``, joint by joint. Where its
            ``attrs`` name ``joints`` and ``parents``, the parent of a joint is its nearest
            ancestor that has columns; otherwise nothing is joined.
        landmarks : mapping of str to str, default=None
            The joints of some or all landmarks; the others are told from the names.
        up : {"y", "z"}, default=None
            The vertical axis; by default ``df.attrs["up"]``, or "y".

        Returns
        -------
        Skeleton

        Raises
        ------
        ValueError
            If the columns are not such triples, or a landmark has no joint. Without columns, as
            an array: make the skeleton by ``Skeleton(joints, parents)``.

        Examples
        --------
        >>> import pandas as pd
        >>> from sklearn_motionsync import Skeleton
        >>> df = pd.DataFrame(0.0, index=range(2), columns=Skeleton.paper().column_names)
        >>> Skeleton.from_frame(df).landmarks["left_knee"]
        'left_knee'
        """
        joints = joints_of(df)
        given = {} if landmarks is None else as_landmarks(landmarks)
        attrs = getattr(df, "attrs", {})
        up = attrs.get("up") or "y" if up is None else up
        names = as_joints(attrs.get("joints", ()))
        # Columns that were renamed are none of the joints that the file had.
        likely = cls._likely_landmarks(joints, names if set(joints) <= set(names) else ())
        parents = _kept_parents(joints, names, as_parents(attrs.get("parents", ())))
        return cls(joints, parents, likely | given, up)

    @classmethod
    def _likely_landmarks(cls, joints, names=()):
        """The landmarks of a ready skeleton if the names are one's, otherwise guessed ones.

        `names` may tell more joints than are there; their landmarks are left out.
        """
        for known in (cls.acclaim(), cls.kinect(), cls.paper()):
            if set(known.landmarks.values()) <= {*joints, *names}:
                return {name: j for name, j in known.landmarks.items() if j in joints}
        return guess_landmarks(as_joints(joints))

    @classmethod
    def _of(cls, parents, landmarks):
        joints = list(parents)
        return cls(joints, [joints.index(p) if p else -1 for p in parents.values()], landmarks)

    def index_of(self, landmark):
        """Index of the joint that stands for a landmark."""
        if landmark not in self.landmarks:
            raise ValueError(f"landmark must be among {LANDMARKS}, got {landmark!r}.")
        return self.joints.index(self.landmarks[landmark])

    @property
    def bones(self):
        """Pairs (parent, joint) of joint indices."""
        return [(p, j) for j, p in enumerate(self.parents) if p >= 0]

    @property
    def column_names(self):
        """Names of the position columns, ``<joint>_x``, ``<joint>_y``, ``<joint>_z``, ..."""
        return [f"{joint}_{axis}" for joint in self.joints for axis in "xyz"]


def joints_of(df):
    """Names of the joints of a DataFrame whose columns are ``<joint>_x``, ``_y``, ``_z``, ..."""
    columns = getattr(df, "columns", None)
    if columns is None or callable(columns):
        raise ValueError(
            "Joints are told from the columns of a DataFrame, got "
            f"{type(df).__name__}. Use pd.DataFrame(positions, columns=skeleton.column_names)."
        )
    columns = [str(column) for column in columns]
    joints = [column[:-2] for column in columns[::3]]
    if not joints or columns != [f"{joint}_{axis}" for joint in joints for axis in "xyz"]:
        raise ValueError(
            "The columns must be <joint>_x, <joint>_y, <joint>_z for one joint after the other, "
            f"got {columns[:4]}{' ...' if len(columns) > 4 else ''}; select them with "
            "df[skeleton.column_names] or drop the others."
        )
    if twice := sorted({joint for joint in joints if joints.count(joint) > 1}):
        raise ValueError(
            f"The columns of the joints {twice} come more than once; use "
            "df.loc[:, ~df.columns.duplicated()]."
        )
    return joints


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
    for place, name in enumerate(names_of(x) or ()):
        if place_of.get(name, place) != place:
            raise ValueError(
                f"{what}: column {place} is {name!r}, where the skeleton has "
                f"{(*expected, 'none')[min(place, len(expected))]!r}. Bring the columns into the "
                "order of the skeleton's joints by df[skeleton.column_names]."
            )


def _kept_parents(joints, names, parents):
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
