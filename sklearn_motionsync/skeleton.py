"""Skeleton: which columns are which joints, and which joints are the body's."""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass

__all__ = ["LANDMARKS", "Skeleton"]

# The fifteen joints of the body model and the parent of each.
_PAPER_PARENTS = {
    "pelvis": None,
    "neck": "pelvis",
    "head": "neck",
    **{
        f"{side}_{joint}": parent if parent in ("neck", "pelvis") else f"{side}_{parent}"
        for side in ("left", "right")
        for joint, parent in (
            ("shoulder", "neck"),
            ("elbow", "shoulder"),
            ("wrist", "elbow"),
            ("hip", "pelvis"),
            ("knee", "hip"),
            ("ankle", "knee"),
        )
    },
}
LANDMARKS = list(_PAPER_PARENTS)

_ACCLAIM = {
    "root": None,
    **{"lhipjoint": "root", "rhipjoint": "root", "lowerback": "root"},
    **{"lfemur": "lhipjoint", "ltibia": "lfemur", "lfoot": "ltibia", "ltoes": "lfoot"},
    **{"rfemur": "rhipjoint", "rtibia": "rfemur", "rfoot": "rtibia", "rtoes": "rfoot"},
    **{"upperback": "lowerback", "thorax": "upperback", "lowerneck": "thorax"},
    **{"lclavicle": "thorax", "rclavicle": "thorax"},
    **{"upperneck": "lowerneck", "head": "upperneck"},
    **{"lhumerus": "lclavicle", "lradius": "lhumerus", "lwrist": "lradius"},
    **{"lhand": "lwrist", "lthumb": "lwrist", "lfingers": "lhand"},
    **{"rhumerus": "rclavicle", "rradius": "rhumerus", "rwrist": "rradius"},
    **{"rhand": "rwrist", "rthumb": "rwrist", "rfingers": "rhand"},
}
# An Acclaim joint is the far end of the bone of that name.
_ACCLAIM_LANDMARKS = {
    "pelvis": "root",
    "neck": "thorax",
    "head": "head",
    **{
        f"{side}_{landmark}": side[0] + bone
        for side in ("left", "right")
        for landmark, bone in (
            ("shoulder", "clavicle"),
            ("elbow", "humerus"),
            ("wrist", "radius"),
            ("hip", "hipjoint"),
            ("knee", "femur"),
            ("ankle", "tibia"),
        )
    },
}

_KINECT = {
    "HipCenter": None,
    "Spine": "HipCenter",
    "ShoulderCenter": "Spine",
    "Head": "ShoulderCenter",
    **{"ShoulderLeft": "ShoulderCenter", "ElbowLeft": "ShoulderLeft"},
    **{"WristLeft": "ElbowLeft", "HandLeft": "WristLeft"},
    **{"ShoulderRight": "ShoulderCenter", "ElbowRight": "ShoulderRight"},
    **{"WristRight": "ElbowRight", "HandRight": "WristRight"},
    **{"HipLeft": "HipCenter", "KneeLeft": "HipLeft"},
    **{"AnkleLeft": "KneeLeft", "FootLeft": "AnkleLeft"},
    **{"HipRight": "HipCenter", "KneeRight": "HipRight"},
    **{"AnkleRight": "KneeRight", "FootRight": "AnkleRight"},
}
_KINECT_LANDMARKS = {
    "pelvis": "HipCenter",
    "neck": "ShoulderCenter",
    "head": "Head",
    **{
        f"{side}_{landmark}": landmark.capitalize() + side.capitalize()
        for side in ("left", "right")
        for landmark in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
    },
}

# Names of the joint at each landmark in files whose joints are the near ends of the
# bones, the likeliest first.
_SYNONYMS = {
    "pelvis": ("pelvis", "hips", "hip", "hipcenter", "midhip", "root"),
    "neck": ("neck", "neck1", "necktwist01", "shouldercenter", "spineshoulder", "thorax"),
    "head": ("head",),
    "shoulder": ("upperarm", "uparm", "arm", "shoulder"),
    "elbow": ("elbow", "forearm", "lowerarm", "lowarm"),
    "wrist": ("wrist", "hand"),
    "hip": ("thigh", "upleg", "upperleg", "hip", "hipjoint"),
    "knee": ("knee", "calf", "leg", "lowerleg", "lowleg", "shin"),
    "ankle": ("ankle", "foot"),
}


@dataclass(frozen=True)
class Skeleton:
    """Which joints the positions hold, how they hang together, and which are the body's.

    Parameters
    ----------
    joints : sequence of str
        Names of the joints, in the order of the columns: joint j has the columns
        ``3 j``, ``3 j + 1``, ``3 j + 2`` (x, y, z).
    parents : sequence of int
        Index of each joint's parent, -1 for the root. Used to draw bones.
    landmarks : mapping of str to str, default=None
        The joint at each of the fifteen landmarks of the paper's body model:
        ``pelvis``, ``neck``, ``head`` and ``left_``/``right_`` ``shoulder``, ``elbow``,
        ``wrist``, ``hip``, ``knee``, ``ankle``. By default it is guessed from the names.
    up : {"y", "z"}, default="y"
        The vertical axis of the positions.

    Raises
    ------
    ValueError
        If lengths disagree, a name comes twice, a parent does not exist, or a landmark
        is missing or names no joint.

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
        joints = tuple(str(j) for j in self.joints)
        parents = tuple(int(p) for p in self.parents)
        if len(joints) != len(parents) or len(set(joints)) != len(joints):
            raise ValueError(
                f"A skeleton needs different joint names and one parent each, got {len(joints)} "
                f"names ({len(set(joints))} different) and {len(parents)} parents."
            )
        if any(not -1 <= p < len(joints) or p == i for i, p in enumerate(parents)):
            raise ValueError(f"parents must be other joints' indices, or -1; got {parents}.")
        if self.up not in ("y", "z"):
            raise ValueError(f"up must be 'y' or 'z', got {self.up!r}.")
        landmarks = _guess_landmarks(joints) if self.landmarks is None else dict(self.landmarks)
        missing = [name for name in LANDMARKS if landmarks.get(name) not in joints]
        if missing:
            raise ValueError(
                f"No joint stands for the landmarks {missing}; give landmarks={{...}} with one of "
                f"the joints {list(joints)} for each."
            )
        object.__setattr__(self, "joints", joints)
        object.__setattr__(self, "parents", parents)
        object.__setattr__(self, "landmarks", {name: landmarks[name] for name in LANDMARKS})

    @classmethod
    def paper(cls):
        """The paper's fifteen joints."""
        return cls._of(_PAPER_PARENTS, {name: name for name in LANDMARKS})

    @classmethod
    def acclaim(cls):
        """The 31 joints of HDM05 and of CMU's ASF/AMC files."""
        return cls._of(_ACCLAIM, _ACCLAIM_LANDMARKS)

    @classmethod
    def kinect(cls):
        """The 20 joints of the first Kinect."""
        return cls._of(_KINECT, _KINECT_LANDMARKS)

    @classmethod
    def from_names(cls, joints, parents, up="y"):
        """A ready skeleton if the names are one's, otherwise landmarks guessed from names."""
        for known in (cls.acclaim(), cls.kinect(), cls.paper()):
            if set(known.joints) <= set(joints):
                return cls(joints, parents, known.landmarks, up)
        return cls(joints, parents, None, up)

    @classmethod
    def _of(cls, parents, landmarks):
        joints = list(parents)
        return cls(joints, [joints.index(p) if p else -1 for p in parents.values()], landmarks)

    @property
    def bones(self):
        """Pairs (parent, joint) of joint indices."""
        return [(p, j) for j, p in enumerate(self.parents) if p >= 0]

    @property
    def column_names(self):
        """Names of the position columns, ``<joint>_x``, ``<joint>_y``, ``<joint>_z``, ..."""
        return [f"{joint}_{axis}" for joint in self.joints for axis in "xyz"]


def _guess_landmarks(joints):
    """The joint of each landmark that can be told from the names."""
    # A prefix that a program gave to every joint but perhaps the root is no part of a name.
    prefix = re.match(r"(.*[^A-Za-z0-9])?", os.path.commonprefix(joints[1:])).group()  # noqa: RUF071
    plain = {re.sub(r"[^a-z0-9]", "", j.removeprefix(prefix).lower()): j for j in reversed(joints)}
    found = {}
    for landmark in LANDMARKS:
        side, _, part = landmark.rpartition("_")
        forms = ("{side}{part}", "{part}{side}", "{side[0]}{part}", "{part}{side[0]}")
        names = [
            form.format(side=side, part=synonym)
            for synonym in _SYNONYMS[part]
            for form in (forms if side else ("{part}",))
        ]
        joint = next((plain[name] for name in names if name in plain), None)
        if joint is not None:
            found[landmark] = joint
    return found
