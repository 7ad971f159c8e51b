"""Skeleton: which columns are which joints, and which joints are the landmarks of the body."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol, Self

import numpy as np
import pandas as pd

from ..inputs.numbers import as_numbers, is_integer
from ..inputs.types import UpAxis
from ..inputs.wording import counted
from .axes import UP_AXES, estimate_up
from .columns import joint_columns
from .formats import AXES, FORMATS, LANDMARKS, SIDES
from .landmarks import (
    add_midpoints,
    as_tuple,
    guess_landmarks,
    missing_counterparts,
)
from .limbs import (
    LIMBS,
    complete_legs,
    cosine_names,
    landmark_positions,
    limbs_between,
    parts_of_names,
)

# A root that moves less than this share of the largest coordinate stands still, and the length of a
# bone that changes less does not.
_STILL = 1e-4
# Limbs are crossed in this share of frames if sides are exchanged; people cross them for less.
_CROSSED = 0.95


class _Constructor(Protocol):
    """A class method that makes a known skeleton."""

    def __call__(self, *, n_dims: Literal[3, 2] = 3, up: UpAxis | None = None) -> Skeleton: ...


@dataclass(frozen=True)
class Skeleton:
    """The joints of a recording, their parents, and the landmarks of the body.

    Parameters
    ----------
    joints : sequence of str
        Names of the joints, in the order of the columns: joint j has the columns
        ``3 j``, ``3 j + 1``, ``3 j + 2`` (x, y, z), or with two axes ``2 j``, ``2 j + 1`` (x, y).
    parents : sequence of int
        Index of each joint's parent, -1 for a root. Bones join a joint to its parent.
    landmarks : mapping of str to str or tuple of str, default=None
        The joint at each of the fifteen landmarks of the paper's body model:
        ``pelvis``, ``neck``, ``head`` and ``left_``/``right_`` ``shoulder``, ``elbow``,
        ``wrist``, ``hip``, ``knee``, ``ankle``. Several joints stand for their mean, such as two
        markers for the middle of a knee. Landmarks may be missing, or None; both ends of at least
        one limb must be given. By default they are guessed from the names, and a missing pelvis or
        neck is the mean of the hips or the shoulders.
    up : {"y", "x", "z", "-y", "-x", "-z"}, default="y"
        The vertical axis of the positions; "-y" where y points downwards, as in pictures.
    n_dims : {3, 2}, default=3
        Axes of a position: 2 for key-points in a picture.

    Attributes
    ----------
    limbs : list of str
        Names of the limbs both of whose ends are landmarks; twelve for the whole body.
    has_height : bool
        Whether the height of the pelvis is a feature: there is a pelvis and a complete leg.
    bones : list of tuple of int
        Pairs (parent, joint) of indices of joints.
    column_names : list of str
        Names of the position columns, ``<joint>_x``, ``<joint>_y``, ``<joint>_z``, ...

    Raises
    ------
    ValueError
        If lengths disagree, a name is not text or is repeated, a parent is not the index of another
        joint, parents form a cycle, a landmark is unknown or names no joint, the landmarks form no
        limb, or a guess finds a landmark on one side only.

    Notes
    -----
    The skeleton of a file is ``Skeleton.from_frame(io.read_motion(path))``. A skeleton cannot
    be changed, and can be a key of a dict: equal skeletons have equal hashes.

    Examples
    --------
    >>> from sklearn_motionsync import Skeleton
    >>> skeleton = Skeleton.acclaim()
    >>> len(skeleton.joints), skeleton.landmarks["left_knee"]
    (31, 'lfemur')
    >>> Skeleton.coco(n_dims=2).landmarks["pelvis"]
    ('left_hip', 'right_hip')

    Markers of one leg:

    >>> leg = {"left_hip": "LGTR", "left_knee": ("LKNE", "LKNM"), "left_ankle": "LANK"}
    >>> Skeleton(["LGTR", "LKNE", "LKNM", "LANK"], [-1] * 4, leg, up="z").limbs
    ['left_thigh', 'left_leg']
    """

    joints: tuple[str, ...]
    parents: tuple[int, ...]
    # None, and lists of names, can be given.
    landmarks: Mapping[str, Any] | Any = None
    up: UpAxis = "y"
    n_dims: Literal[3, 2] = 3

    # Made below, of `FORMATS`.
    acclaim: ClassVar[_Constructor]
    coco: ClassVar[_Constructor]
    kinect: ClassVar[_Constructor]
    kinect_v2: ClassVar[_Constructor]
    mediapipe: ClassVar[_Constructor]
    openpose: ClassVar[_Constructor]
    paper: ClassVar[_Constructor]
    plug_in_gait: ClassVar[_Constructor]

    if TYPE_CHECKING:

        def __init__(
            self,
            joints: Sequence[str],
            parents: Sequence[int],
            landmarks: Mapping[str, str | Sequence[str] | None] | None = None,
            up: UpAxis = "y",
            n_dims: Literal[3, 2] = 3,
        ) -> None: ...

    def __post_init__(self):
        joints, parents = _as_joints(self.joints), _as_parents(self.parents)
        if len(joints) != len(parents) or len(set(joints)) != len(joints):
            raise ValueError(
                f"A skeleton needs different joint names and one parent each, got {len(joints)} "
                f"names ({len(set(joints))} different) and {len(parents)} parents."
            )
        if any(not -1 <= p < len(joints) for p in parents):
            raise ValueError(f"parents must be other joints' indices, or -1; got {parents}.")
        if cycle := find_cycle(parents):
            raise ValueError(
                f"parents form a cycle: {' > '.join(joints[j] for j in cycle)}. The chain of "
                "every joint must end at a root, whose parent is -1."
            )
        if not is_integer(self.n_dims) or self.n_dims not in UP_AXES:
            raise ValueError(
                f"n_dims must be 3, or 2 for positions in the plane, got {self.n_dims!r}."
            )
        ups = list(UP_AXES[self.n_dims])
        if not isinstance(self.up, str) or self.up not in ups:
            raise ValueError(f"up must be among {ups}, got {self.up!r}.")
        named = {} if self.landmarks is None else _as_landmarks(self.landmarks)
        landmarks = named
        if self.landmarks is None:
            landmarks = add_midpoints(guess_landmarks(joints))
        object.__setattr__(self, "joints", joints)
        object.__setattr__(self, "parents", parents)
        object.__setattr__(self, "n_dims", int(self.n_dims))
        object.__setattr__(self, "landmarks", _check_landmarks(landmarks, named, joints))

    def __hash__(self):
        landmarks = frozenset(self.landmarks.items())
        return hash((self.joints, self.parents, landmarks, self.up, self.n_dims))

    # In files the landmarks are a plain dict.

    def __getstate__(self):
        return self.__dict__ | {"landmarks": dict(self.landmarks)}

    def __setstate__(self, state):
        self.__dict__.update(state, landmarks=MappingProxyType(state["landmarks"]))

    def __repr__(self):
        for name in FORMATS:
            if self == getattr(type(self), name)(n_dims=self.n_dims):
                return f"Skeleton.{name}({'n_dims=2' if self.n_dims == 2 else ''})"
        count = len(self.landmarks)
        partial = "" if count == len(LANDMARKS) else f", {count} of {len(LANDMARKS)} landmarks"
        plane = ", n_dims=2" if self.n_dims == 2 else ""
        return f"Skeleton(<{len(self.joints)} joints{partial}>, up={self.up!r}{plane})"

    @classmethod
    def from_frame(
        cls,
        df: pd.DataFrame,
        *,
        landmarks: Mapping[str, str | Sequence[str] | None] | None = None,
        up: UpAxis | None = None,
    ) -> Self:
        """The skeleton of a DataFrame of positions, such as `io.read_motion` returns.

        Parameters
        ----------
        df : DataFrame (n_frames, 3 * n_joints), or (n_frames, 2 * n_joints)
            Columns ``<joint>_x``, ``<joint>_y``, ``<joint>_z``, or ``<joint>_x``, ``<joint>_y`` of
            key-points in a picture, also in the spellings of other programs, such as ``<joint> X``,
            ``<joint>:X``, or a `MultiIndex`. Columns of their quality are left out. If ``df.attrs``
            has ``joints`` and ``parents``, the parent of a joint is its nearest ancestor that has
            columns; otherwise every joint is a root. So is a joint whose parent is no landmark and
            stands still while the joint moves away from it, as the roots of some retargeted takes
            do.
        landmarks : mapping of str to str or tuple of str, default=None
            The joints of some or all landmarks, several for their mean; the others are guessed from
            the names. None as a joint leaves a landmark out.
        up : {"y", "x", "z", "-y", "-x", "-z"}, default=None
            The vertical axis; by default ``df.attrs["up"]``, or the axis along which the head is
            above the feet on average; without feet, the head above the pelvis and the shoulders
            above the hands. "y" if the positions leave doubt. Give it for people that lie or stand
            on their hands, and for bent trunks without arms and legs.

        Returns
        -------
        Skeleton
            With the joints of the columns.

        Raises
        ------
        ValueError
            If the columns are no such positions, the names give no limb, or a
            landmark on one side only. For an array without columns use
            ``Skeleton(joints, parents)``.

        Examples
        --------
        >>> import pandas as pd
        >>> from sklearn_motionsync import Skeleton
        >>> df = pd.DataFrame(0.0, index=range(2), columns=Skeleton.paper().column_names)
        >>> Skeleton.from_frame(df).landmarks["left_knee"]
        'left_knee'
        >>> legs = df[[c for c in df if c.startswith(("left_", "right_"))]]
        >>> Skeleton.from_frame(legs, landmarks={"pelvis": ("left_hip", "right_hip")}, up="z")
        Skeleton(<12 joints, 14 of 15 landmarks>, up='z')
        """
        columns = joint_columns(df)
        joints = columns.joints
        n_dims: Literal[3, 2] = 2 if len(columns.axes) == 2 else 3
        if twice := sorted({joint for joint in joints if joints.count(joint) > 1}):
            raise ValueError(
                f"The columns of the joints {twice} are repeated; use "
                "df.loc[:, ~df.columns.duplicated()]."
            )
        named = {} if landmarks is None else _as_landmarks(landmarks)
        attrs = getattr(df, "attrs", {})
        names = _as_joints(attrs.get("joints", ()))
        # Renamed columns are not joints of the file.
        names_of_file = names if set(joints) <= set(names) else ()
        guess = guess_landmarks(joints, names_of_file, clusters=not named)
        try:
            positions = as_numbers(df.iloc[:, columns.places.ravel()], "df", dtype=np.float64)
            positions = positions.reshape(len(positions), *columns.places.shape)
        except (TypeError, ValueError):
            positions = None
        if positions is not None:
            # Of the markers of a static trial, those that were taken off stand for nothing.
            never = np.isnan(positions).any(axis=2).all(axis=0)
            seen = [joint for joint, is_never in zip(joints, never, strict=True) if not is_never]
            if 0 < len(seen) < len(joints):
                guess |= guess_landmarks(seen, names_of_file, clusters=False)
        all_landmarks = _check_landmarks(add_midpoints(guess | named), named, joints)
        parents = _nearest_parents(joints, names, _as_parents(attrs.get("parents", ())))
        held = {joint for at in all_landmarks.values() for joint in as_tuple(at)}
        parents = _without_still_roots(positions, joints, parents, held)
        up = attrs.get("up") if up is None else up
        skeleton = cls(joints, parents, all_landmarks, "y" if up is None else up, n_dims)
        if positions is not None:
            if not named and all(guess != known.landmarks for known in FORMATS.values()):
                _warn_of_sides(positions, skeleton)
            flat = positions.reshape(len(positions), -1)
            estimate = estimate_up(flat, skeleton) if up is None else None
            if estimate is not None:
                skeleton = cls(joints, parents, all_landmarks, estimate, n_dims)
        return skeleton

    def index_of(self, landmark: str) -> int:
        """Index of the joint at a landmark.

        Parameters
        ----------
        landmark : str
            Name of one of the fifteen landmarks.

        Returns
        -------
        int
            Index among ``joints``.

        Raises
        ------
        ValueError
            If there is no such landmark, or if it is the mean of several joints.
        """
        indices = self.indices_of(landmark)
        if len(indices) > 1:
            raise ValueError(
                f"The landmark {landmark!r} is the mean of the joints {self.landmarks[landmark]}; "
                "indices_of gives all of them."
            )
        return indices[0]

    def indices_of(self, landmark: str) -> tuple[int, ...]:
        """Indices of the joints whose mean is a landmark.

        Parameters
        ----------
        landmark : str
            Name of one of the fifteen landmarks.

        Returns
        -------
        tuple of int
            Indices among ``joints``, most often a single one.

        Raises
        ------
        ValueError
            If there is no such landmark.
        """
        if landmark not in LANDMARKS:
            raise ValueError(f"landmark must be among {LANDMARKS}, got {landmark!r}.")
        if landmark not in self.landmarks:
            raise ValueError(
                f"The skeleton lacks the landmark {landmark!r}; it has {list(self.landmarks)}."
            )
        return tuple(self.joints.index(joint) for joint in as_tuple(self.landmarks[landmark]))

    def body(self) -> Self:
        """The skeleton of the landmarks that the limbs join, with "y" up.

        Returns
        -------
        Skeleton
            That of the positions which `DirectionCosines.inverse_transform` returns; of a whole
            body, ``Skeleton.paper()``.
        """
        held = {joint for name in self.limbs for joint in LIMBS[name][:2]}
        # The pelvis is between the hips, the neck between the shoulders.
        held |= {"pelvis"} if "hip" in self.limbs or self.has_height else set()
        held |= {"neck"} if "shoulder" in self.limbs else set()
        joints = [name for name in LANDMARKS if name in held and name in self.landmarks]
        paper = type(self).paper()
        parents = _nearest_parents(joints, paper.joints, paper.parents)
        return type(self)(joints, parents, {name: name for name in joints}, "y", self.n_dims)

    def parts(self) -> dict[str, list[int]]:
        """The features of `DirectionCosines` of each arm, each leg and the trunk.

        For `PartSynchronizer`. The trunk is hip line, torso, shoulder line and neck. The height of
        the pelvis is in no part, and a part without limbs is left out.

        Returns
        -------
        dict of str to list of int
            Indices of the features of ``"left arm"``, ``"right arm"``, ``"left leg"``,
            ``"right leg"`` and ``"trunk"``.

        Examples
        --------
        >>> from sklearn_motionsync import Skeleton
        >>> Skeleton.paper().parts()["left leg"]
        [13, 14, 15, 19, 20, 21]
        """
        return parts_of_names(cosine_names(self.limbs, self.n_dims, self.has_height))

    @property
    def limbs(self) -> list[str]:
        """Names of the limbs both of whose ends are landmarks; twelve for the whole body."""
        return limbs_between(self.landmarks)

    @property
    def has_height(self) -> bool:
        """Whether the height of the pelvis is a feature: a pelvis and a complete leg are there."""
        return "pelvis" in self.landmarks and bool(complete_legs(self.limbs))

    @property
    def bones(self) -> list[tuple[int, int]]:
        """Pairs (parent, joint) of indices of joints."""
        return [(p, j) for j, p in enumerate(self.parents) if p >= 0]

    @property
    def column_names(self) -> list[str]:
        """Names of the position columns, ``<joint>_x``, ``<joint>_y``, ``<joint>_z``, ..."""
        return [f"{joint}_{axis}" for joint in self.joints for axis in AXES[self.n_dims]]


# -- the constructors of known skeletons --------------------------------------------------


def _constructor(name):
    """The class method of `Skeleton` that makes the skeleton of one of `FORMATS`."""
    known = FORMATS[name]

    def constructor(
        cls: type[Skeleton], *, n_dims: Literal[3, 2] = 3, up: UpAxis | None = None
    ) -> Skeleton:
        """{known.summary}

        Parameters
        ----------
        n_dims : {{3, 2}}, default=3
            Axes of a position: 2 for key-points in a picture.
        up : {{"y", "x", "z", "-y", "-x", "-z"}}, default=None
            The vertical axis; by default {known.up!r} in space and {known.up_2d!r} in a picture.

        Returns
        -------
        Skeleton
            With the joints of this format, in its order.
        """
        joints = list(known.parents)
        parents = [joints.index(p) if p else -1 for p in known.parents.values()]
        default = known.up_2d if n_dims == 2 else known.up
        return cls(joints, parents, known.landmarks, default if up is None else up, n_dims)

    constructor.__name__, constructor.__qualname__ = name, f"Skeleton.{name}"
    constructor.__doc__ = (constructor.__doc__ or "").format(known=known)
    return classmethod(constructor)


for _name in FORMATS:
    setattr(Skeleton, _name, _constructor(_name))


# -- positions ----------------------------------------------------------------------------


def loose_joints(skeleton):
    """Indices of the joints that are no landmarks and in no bone, while others are in bones."""
    held = {joint for name in skeleton.landmarks for joint in skeleton.indices_of(name)}
    held |= {joint for bone in skeleton.bones for joint in bone}
    return [j for j in range(len(skeleton.joints)) if j not in held] if skeleton.bones else []


def _without_still_roots(x, joints, parents, held):
    """Parents, -1 for the joints that move away from a root that stands still and is not held."""
    roots = {p for p in parents if p >= 0 and parents[p] < 0 and joints[p] not in held}
    if x is None or not roots or not len(x):
        return parents
    largest = np.fmax.reduce(np.abs(x), axis=None, initial=0)

    def changes(values):
        return (np.fmax.reduce(values) - np.fmin.reduce(values) > _STILL * largest).any()

    still = {root for root in roots if not changes(x[:, root])}
    return [
        -1 if p in still and changes(np.linalg.norm(x[:, j] - x[:, p], axis=1)) else p
        for j, p in enumerate(parents)
    ]


def _warn_of_sides(positions, skeleton):
    """Warn if lines from one side to the other are shorter than limbs in nearly all frames."""
    points = landmark_positions(positions.reshape(len(positions), -1), skeleton)
    for limb in ("arm", "thigh", "leg"):
        if not {f"left_{limb}", f"right_{limb}"} <= set(skeleton.limbs):
            continue
        pairs = [LIMBS[f"{side}_{limb}"][:2] for side in SIDES]
        start, end = (points[:, [LANDMARKS.index(pair[k]) for pair in pairs]] for k in (0, 1))
        same, crossed = (
            np.linalg.norm(start - ends, axis=2).sum(axis=1) for ends in (end, end[:, ::-1])
        )
        # A comparison with NaN is False.
        if (crossed < same).sum() > _CROSSED * (crossed + same > 0).sum():
            joints = {name: skeleton.landmarks[name] for pair in pairs for name in pair}
            warnings.warn(
                f"Left and right may be exchanged: of {joints}, each is nearer to the next joint "
                "of the other side. Look at them, and name them right in landmarks={...}.",
                UserWarning,
                stacklevel=3,
            )


# -- checks of names, parents and landmarks -----------------------------------------------


def _as_joints(joints):
    """Names as a tuple of str."""
    names = _as_sequence(joints)
    if names is None or not all(isinstance(name, str) and name for name in names):
        raise ValueError(
            "joints must be the names of the joints, a list of text in the order of the columns; "
            f"got {joints!r}."
        )
    return tuple(map(str, names))


def _as_parents(parents):
    """Indices as a tuple of int."""
    listed = _as_sequence(parents)
    if listed is None or not all(map(is_integer, listed)):
        raise ValueError(
            "parents must be a list of whole numbers, the index of each joint's parent or -1; got "
            f"{parents!r:.200}."
        )
    return tuple(map(int, listed))


def _as_sequence(values):
    """An ordered collection as a tuple; None for text, sets and scalars."""
    if isinstance(values, (str, bytes, Set)) or not isinstance(values, Iterable):
        return None
    return None if getattr(values, "ndim", 1) == 0 else tuple(values)


def _as_landmarks(landmarks):
    """Landmarks as a dict: the name of a joint, a tuple of several, or None."""
    if not isinstance(landmarks, Mapping):
        raise ValueError(
            "landmarks must be a mapping, the joint at each landmark such as "
            f"{{'pelvis': 'root'}}; got {landmarks!r}."
        )
    if unknown := sorted(str(name) for name in landmarks if name not in LANDMARKS):
        raise ValueError(f"landmarks must be among {LANDMARKS}, got {unknown}.")
    joints_of = {}
    for name, at in landmarks.items():
        joints = (at,) if isinstance(at, str) else _as_sequence(at)
        are_names = joints and all(isinstance(joint, str) for joint in joints)
        if at is not None and (not are_names or len(set(joints)) < len(joints)):
            raise ValueError(
                f"The landmark {name!r} must be a joint's name, a tuple of different names for "
                f"their mean, or None where it is missing; got {at!r}."
            )
        joints = joints and tuple(map(str, joints))
        joints_of[name] = joints[0] if joints and len(joints) == 1 else joints
    return joints_of


def _check_landmarks(landmarks, named, joints):
    """The landmarks that are not None, in their order; a refusal if they form no limb.

    Guessed landmarks must come in pairs of left and right, given ones need not.
    """
    there = {name: landmarks[name] for name in LANDMARKS if landmarks.get(name) is not None}
    absent = [name for name, at in there.items() if not set(as_tuple(at)) <= set(joints)]
    missing = absent or missing_counterparts(there, named)
    if not missing and not limbs_between(there):
        missing = [name for name in LANDMARKS if name not in there]
    if missing:
        got = f" (got { ({name: there[name] for name in absent}) })" if absent else ""
        raise ValueError(
            f"No joint stands for the landmarks {missing}{got}; give landmarks={{...}} with one of "
            f"the joints {list(joints)} for each, or several of them for their mean, such as "
            "{'pelvis': ('LASI', 'RASI')}. A landmark that the body lacks is None; both ends "
            "of one limb must be there."
        )
    return MappingProxyType(there)


def find_cycle(parents):
    """Joints whose parents lead back to the first of them; empty if all lead to a root."""
    for start in range(len(parents)):
        chain = [start]
        while (joint := parents[chain[-1]]) >= 0:
            if joint in chain:
                return [*chain[chain.index(joint) :], joint]
            chain.append(joint)
    return []


def _nearest_parents(joints, names, parents):
    """For each joint the index of its nearest ancestor among the joints, or -1."""
    if len(names) != len(parents) or any(not -1 <= p < len(names) for p in parents):
        raise ValueError(
            "df.attrs must have one parent, an index or -1, for each of its joints; got "
            f"{counted(len(names), 'joint')} and the parents {parents}."
        )
    above = {name: names[p] for name, p in zip(names, parents, strict=True) if p >= 0}
    index = {joint: j for j, joint in enumerate(joints)}
    result = []
    for joint in joints:
        ancestor = above.get(joint)
        for _ in names:  # no more steps than joints, in case the parents form a cycle
            if ancestor is None or ancestor in index:
                break
            ancestor = above.get(ancestor)
        result.append(index.get(ancestor, -1))
    return result
