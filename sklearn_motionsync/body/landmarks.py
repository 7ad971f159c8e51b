"""Skeletons known by heart, and landmarks told from the names of joints."""

import os
import re

__all__ = [
    "ACCLAIM",
    "ACCLAIM_LANDMARKS",
    "KINECT",
    "KINECT_LANDMARKS",
    "LANDMARKS",
    "PAPER",
    "guess_landmarks",
]

# The fifteen joints of the body model and the parent of each.
PAPER = {
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
LANDMARKS = list(PAPER)

ACCLAIM = {
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
ACCLAIM_LANDMARKS = {
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

KINECT = {
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
KINECT_LANDMARKS = {
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


def guess_landmarks(joints):
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
