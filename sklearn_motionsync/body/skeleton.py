"""Skeleton: which columns are which joints, and which joints are the body's."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..inputs.numbers import as_numbers
from .columns import (
    AXES,
    as_joints,
    as_landmarks,
    as_parents,
    check_columns,
    circle_of,
    is_whole,
    joints_with_axes,
    kept_parents,
)
from .formats import FORMATS, LANDMARKS
from .landmarks import as_tuple, completed, likely_landmarks, one_sided
from .limbs import LIMBS, limbs_between, stretched_legs
from .parts import parts_of_limbs
from .upright import UPS, seems_up

__all__ = ["LANDMARKS", "Skeleton", "check_columns"]

# -- ready skeletons: those whose joints are known by heart ------------------------------


class ReadySkeletons:
    """Ways to make a `Skeleton` without naming a joint.

    ``n_dims`` is 3, or 2 for positions in a picture. ``up`` is the vertical axis; by default the
    one that is usual with the format, which in pictures is "-y".
    """

    @classmethod
    def paper(cls, *, n_dims=3, up=None):
        """The paper's fifteen joints; "y" is up."""
        return cls._ready("paper", n_dims, up)

    @classmethod
    def acclaim(cls, *, n_dims=3, up=None):
        """The 31 joints of HDM05 and of CMU's ASF/AMC files; "y" is up."""
        return cls._ready("acclaim", n_dims, up)

    @classmethod
    def kinect(cls, *, n_dims=3, up=None):
        """The 20 joints of the first Kinect; "y" is up."""
        return cls._ready("kinect", n_dims, up)

    @classmethod
    def kinect_v2(cls, *, n_dims=3, up=None):
        """The 25 joints of the second Kinect, and of NTU RGB+D in the same order; "y" is up."""
        return cls._ready("kinect_v2", n_dims, up)

    @classmethod
    def openpose(cls, *, n_dims=3, up=None):
        """OpenPose's 25 key-points, BODY_25; "y" is up in space. The head is the nose."""
        return cls._ready("openpose", n_dims, up)

    @classmethod
    def coco(cls, *, n_dims=3, up=None):
        """The 17 key-points of COCO; "y" is up in space.

        The pelvis is the mean of the hips, the neck that of the shoulders, the head the nose.
        """
        return cls._ready("coco", n_dims, up)

    @classmethod
    def mediapipe(cls, *, n_dims=3, up=None):
        """The 33 landmarks of MediaPipe's pose; "-y" is up, in space as in pictures.

        The pelvis is the mean of the hips, the neck that of the shoulders, the head the nose.
        """
        return cls._ready("mediapipe", n_dims, up)

    @classmethod
    def opencap(cls, *, n_dims=3, up=None):
        """The 20 video key-points of OpenCap, which have no head; "y" is up."""
        return cls._ready("opencap", n_dims, up)

    @classmethod
    def plug_in_gait(cls, *, n_dims=3, up=None):
        """Joint centres of Vicon's Plug-in Gait, and origins of its bones; "z" is up.

        The pelvis is ``PELO``, the neck the thorax' ``TRXO``, the head ``HEDO``. A file without
        them has fewer limbs: use ``Skeleton.from_frame``.
        """
        return cls._ready("plug_in_gait", n_dims, up)

    @classmethod
    def optitrack(cls, *, n_dims=3, up=None):
        """The 21 bones of a skeleton of OptiTrack's Motive; "y" is up."""
        return cls._ready("optitrack", n_dims, up)

    @classmethod
    def unreal(cls, *, n_dims=3, up=None):
        """The body of Unreal Engine's mannequin, 22 bones; "z" is up."""
        return cls._ready("unreal", n_dims, up)

    @classmethod
    def _ready(cls, name, n_dims, up):
        known = FORMATS[name]
        joints = list(known.parents)
        parents = [joints.index(p) if p else -1 for p in known.parents.values()]
        if up is None:
            up = known.up_in_pictures if n_dims == 2 else known.up
        return cls(joints, parents, known.landmarks, up, n_dims)


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
class Skeleton(ReadySkeletons):
    """Which joints the positions hold, how they hang together, and which are the body's.

    Parameters
    ----------
    joints : sequence of str
        Names of the joints, in the order of the columns: joint j has the columns
        ``3 j``, ``3 j + 1``, ``3 j + 2`` (x, y, z), or with two axes ``2 j``, ``2 j + 1`` (x, y).
    parents : sequence of int
        Index of each joint's parent, -1 for a root. Used to draw bones.
    landmarks : mapping of str to str or tuple of str, default=None
        The joint at each of the fifteen landmarks of the paper's body model:
        ``pelvis``, ``neck``, ``head`` and ``left_``/``right_`` ``shoulder``, ``elbow``,
        ``wrist``, ``hip``, ``knee``, ``ankle``. Several joints stand for their mean, such as two
        markers for the middle of a knee. Landmarks may lack, or be None; two of them that belong to
        one limb must be there. By default it is guessed from the names: a pelvis or a neck without
        a joint is the mean of the hips or the shoulders.
    up : {"y", "x", "z", "-y", "-x", "-z"}, default="y"
        The vertical axis of the positions; "-y" where y points downwards, as in pictures.
    n_dims : {3, 2}, default=3
        Axes of a position: 2 for key-points in a picture.

    Raises
    ------
    ValueError
        If lengths disagree, a name is no text or comes twice, a parent is no index of another
        joint, parents run in a circle, a landmark is unknown or names no joint, the landmarks leave
        no limb, or a guess finds a landmark on one side only.

    Notes
    -----
    The skeleton of a file is ``Skeleton.from_frame(io.read_motion(path))``. A skeleton cannot
    be changed, and serves as a key: equal ones have equal hashes.

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

    joints: tuple
    parents: tuple
    landmarks: Mapping | None = None
    up: str = "y"
    n_dims: int = 3

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
        if not is_whole(self.n_dims) or self.n_dims not in UPS:
            raise ValueError(
                f"n_dims must be 3, or 2 for positions in the plane, got {self.n_dims!r}."
            )
        ups = UPS[self.n_dims]
        if not (isinstance(self.up, str) and self.up in ups):
            raise ValueError(
                f"up must be {', '.join(map(repr, list(ups)[:-1]))} or {list(ups)[-1]!r}, got "
                f"{self.up!r}."
            )
        object.__setattr__(self, "joints", joints)
        object.__setattr__(self, "parents", parents)
        object.__setattr__(self, "n_dims", int(self.n_dims))
        object.__setattr__(self, "landmarks", self._checked_landmarks())

    def _checked_landmarks(self):
        if self.landmarks is None:
            return _sound(completed(likely_landmarks(self.joints)), (), self.joints)
        landmarks = as_landmarks(self.landmarks)
        return _sound(landmarks, landmarks, self.joints)

    # Files hold the landmarks as a plain dict, which every kind of file can fill again.

    def __getstate__(self):
        return vars(self) | {"landmarks": dict(self.landmarks)}

    def __setstate__(self, state):
        landmarks = {
            name: at if isinstance(at, str) else tuple(at)
            for name, at in state["landmarks"].items()
        }
        vars(self).update(state, landmarks=_ReadOnly(landmarks))

    def __repr__(self):
        for name in FORMATS:
            if self == getattr(type(self), name)(n_dims=self.n_dims):
                return f"Skeleton.{name}({'n_dims=2' if self.n_dims == 2 else ''})"
        some = len(self.landmarks)
        of = "" if some == len(LANDMARKS) else f", {some} of {len(LANDMARKS)} landmarks"
        plane = ", n_dims=2" if self.n_dims == 2 else ""
        return f"Skeleton(<{len(self.joints)} joints{of}>, up={self.up!r}{plane})"

    @classmethod
    def from_names(cls, joints, parents, up="y", n_dims=3):
        """A ready skeleton if the names are one's, otherwise landmarks guessed from names."""
        return cls(joints, parents, None, up, n_dims)

    @classmethod
    def from_frame(cls, df, *, landmarks=None, up=None):
        """The skeleton of a DataFrame of positions, such as `io.read_motion` gives.

        Parameters
        ----------
        df : DataFrame (n_frames, 3 * n_joints), or (n_frames, 2 * n_joints)
            Columns ``<joint>_x``, ``<joint>_y``, ``<joint>_z``, joint by joint, or ``<joint>_x``,
            ``<joint>_y`` of key-points in a picture. Where its
            ``attrs`` name ``joints`` and ``parents``, the parent of a joint is its nearest
            ancestor that has columns; otherwise nothing is joined.
        landmarks : mapping of str to str or tuple of str, default=None
            The joints of some or all landmarks, several for their mean; the others are told from
            the names. None as a joint leaves a landmark out.
        up : {"y", "x", "z", "-y", "-x", "-z"}, default=None
            The vertical axis; by default ``df.attrs["up"]``, or the one along which the head is
            above the feet on average; without feet, the head above the pelvis and the shoulders
            above the hands. Where the positions do not tell clearly, it is "y". Give it for those
            who lie or stand on their hands, and for trunks that bend and have no arms or legs:
            their positions tell another one.

        Returns
        -------
        Skeleton

        Raises
        ------
        ValueError
            If the columns are not such triples or pairs, no limb is told from the names, or a
            landmark on one side only. Without columns, as an array: make the skeleton by
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
        joints, n_dims = joints_with_axes(df)
        if twice := sorted({joint for joint in joints if joints.count(joint) > 1}):
            raise ValueError(
                f"The columns of the joints {twice} come more than once; use "
                "df.loc[:, ~df.columns.duplicated()]."
            )
        given = {} if landmarks is None else as_landmarks(landmarks)
        attrs = getattr(df, "attrs", {})
        names = as_joints(attrs.get("joints", ()))
        # Columns that were renamed are none of the joints that the file had.
        likely = likely_landmarks(joints, names if set(joints) <= set(names) else ())
        landmarks = _sound(completed(likely | given), given, joints)
        parents = kept_parents(joints, names, as_parents(attrs.get("parents", ())))
        up = attrs.get("up") if up is None else up
        skeleton = cls(joints, parents, landmarks, "y" if up is None else up, n_dims)
        seems = _seems_up(df, skeleton) if up is None else None
        return skeleton if seems is None else cls(joints, parents, landmarks, seems, n_dims)

    def index_of(self, landmark):
        """Index of the joint that stands for a landmark."""
        indices = self.indices_of(landmark)
        if len(indices) > 1:
            raise ValueError(
                f"The landmark {landmark!r} is the mean of the joints {self.landmarks[landmark]}; "
                "indices_of gives all of them."
            )
        return indices[0]

    def indices_of(self, landmark):
        """Indices of the joints whose mean a landmark is: a tuple, mostly of one."""
        if landmark not in LANDMARKS:
            raise ValueError(f"landmark must be among {LANDMARKS}, got {landmark!r}.")
        if landmark not in self.landmarks:
            raise ValueError(
                f"The skeleton lacks the landmark {landmark!r}; it has {list(self.landmarks)}."
            )
        return tuple(self.joints.index(joint) for joint in as_tuple(self.landmarks[landmark]))

    def body(self):
        """The skeleton of the landmarks that limbs hold together, with "y" up.

        It is that of the positions which `DirectionCosines.inverse_transform` gives; of a whole
        body, ``Skeleton.paper()``.

        Returns
        -------
        Skeleton
        """
        held = {joint for name in self.limbs for joint in LIMBS[name][:2]}
        # The pelvis is between the hips, the neck between the shoulders.
        held |= {"pelvis"} if "hip" in self.limbs or self.has_height else set()
        held |= {"neck"} if "shoulder" in self.limbs else set()
        joints = [name for name in LANDMARKS if name in held and name in self.landmarks]
        paper = type(self).paper()
        parents = kept_parents(joints, paper.joints, paper.parents)
        return type(self)(joints, parents, {name: name for name in joints}, "y", self.n_dims)

    def parts(self):
        """Which features of `DirectionCosines` are the arms', the legs' and the trunk's.

        For `PartSynchronizer`. The trunk is hip line, torso, shoulder line and neck; the height of
        the pelvis is no part's, and a part without limbs is left out.

        Returns
        -------
        dict of str to list of int
            ``"left arm"``, ``"right arm"``, ``"left leg"``, ``"right leg"``, ``"trunk"``.

        Examples
        --------
        >>> from sklearn_motionsync import Skeleton
        >>> Skeleton.paper().parts()["left leg"]
        [13, 14, 15, 19, 20, 21]
        """
        return parts_of_limbs(self.limbs, self.n_dims, int(self.has_height))

    @property
    def limbs(self):
        """Names of the limbs, both of whose joints are landmarks: of the whole body twelve."""
        return limbs_between(self.landmarks)

    @property
    def has_height(self):
        """Whether the height of the pelvis is told: there is one, and a leg down to the ankle."""
        return "pelvis" in self.landmarks and bool(stretched_legs(self.limbs))

    @property
    def bones(self):
        """Pairs (parent, joint) of joint indices."""
        return [(p, j) for j, p in enumerate(self.parents) if p >= 0]

    @property
    def column_names(self):
        """Names of the position columns, ``<joint>_x``, ``<joint>_y``, ``<joint>_z``, ..."""
        return [f"{joint}_{axis}" for joint in self.joints for axis in AXES[self.n_dims]]


def _sound(landmarks, given, joints):
    """The landmarks that are there, in their order; a refusal if they make no body.

    Those that are given are meant as they are, those that are guessed come in pairs.
    """
    there = {name: landmarks[name] for name in LANDMARKS if landmarks.get(name) is not None}
    absent = [name for name, at in there.items() if not set(as_tuple(at)) <= set(joints)]
    missing = absent or one_sided(there, given)
    if not missing and not limbs_between(there):
        missing = [name for name in LANDMARKS if name not in there]
    if missing:
        got = f" (got { ({name: there[name] for name in absent}) })" if absent else ""
        raise ValueError(
            f"No joint stands for the landmarks {missing}{got}; give landmarks={{...}} with one of "
            f"the joints {list(joints)} for each, or several of them for their mean, such as "
            "{'pelvis': ('LASI', 'RASI')}. A landmark that the body lacks is None; both ends of "
            "one limb must be there."
        )
    return _ReadOnly(there)


def _seems_up(df, skeleton):
    """The vertical axis that a table of positions seems to have, or None."""
    try:
        positions = as_numbers(df, "df", dtype=np.float64)
    except (TypeError, ValueError):
        return None
    return seems_up(positions, skeleton)
