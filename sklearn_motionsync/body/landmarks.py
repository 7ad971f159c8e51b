"""Landmarks guessed from the names of joints: those of a known format, or by common synonyms."""

import os
import re

from .formats import FORMATS, LANDMARKS, SIDES

__all__ = [
    "add_midpoints",
    "as_tuple",
    "guess_feet",
    "guess_landmarks",
    "missing_counterparts",
    "other_side",
]

# Names of the joint at each landmark in files whose joints are the near ends of the
# bones, the likeliest first. The last are names of bones in Plug-in Gait, and of its markers on
# the skin, which stand for the joints where no joint centres were computed.
_SYNONYMS = {
    "pelvis": ("pelvis", "hips", "hip", "hipcenter", "midhip", "spinebase", "root", "pelo",
               "sacrum", "sacral", "vsacral"),
    "neck": ("neck", "neck1", "neck01", "necktwist01", "shouldercenter", "spineshoulder", "thorax",
             "trxo"),
    "head": ("head", "nose", "headtop", "headtopend", "hedo"),
    "shoulder": ("upperarm", "uparm", "uarm", "arm", "shoulder", "sjc", "clo", "sho"),
    "elbow": ("elbow", "forearm", "lowerarm", "lowarm", "farm", "larm", "ejc", "huo", "elb"),
    "wrist": ("wrist", "hand", "wjc", "rao"),
    "hip": ("thigh", "upleg", "upperleg", "hip", "hipjoint", "hjc", "fep", "asi",
            "asis"),
    "knee": ("knee", "calf", "leg", "lowerleg", "lowleg", "shin", "shank", "kjc", "feo", "kne"),
    "ankle": ("ankle", "foot", "ajc", "tio", "ank"),
}  # fmt: skip
# Pairs of joints or markers whose mean is a landmark if no synonym is found.
_PAIRS = {
    "head": [("left", "ear", "right", "ear"), ("left", "fhd", "right", "fhd")],
    **{f"{side}_wrist": [(side, "wra", side, "wrb")] for side in SIDES},
}
# Names of what is at both ends of a foot, the likeliest first; the joint of an ankle is neither.
_ENDS_OF_FEET = {
    "heel": ("heel", "hee", "calcaneus", "calcn", "calc", "cal"),
    "toe": ("bigtoe", "toetip", "toe", "toes", "footindex", "toebase", "ball", "mt2", "mt1", "mt5",
            "foot"),
}  # fmt: skip
# Formats with all landmarks at joints of their own. The names of the others are synonyms.
_KNOWN = [
    known.landmarks
    for known in FORMATS.values()
    if len(known.landmarks) == len(LANDMARKS)
    and all(isinstance(at, str) for at in known.landmarks.values())
]
_MIDPOINTS = {"pelvis": "hip", "neck": "shoulder"}


def guess_landmarks(joints, names=()):
    """The landmarks of a known format if the names are its, otherwise guessed by synonyms.

    `names` may list joints of the file that have no columns; their landmarks are left out.
    """
    there = {*joints, *names}
    plain = _plain_names([*joints, *(name for name in names if name not in set(joints))])
    for landmarks in _KNOWN:
        if not set(landmarks.values()) <= there:
            landmarks = {name: plain.get(_plain(joint)) for name, joint in landmarks.items()}
        if None not in landmarks.values():
            return {name: joint for name, joint in landmarks.items() if joint in set(joints)}
    return _guess_by_synonyms(_plain_names(joints))


def guess_feet(joints, landmarks):
    """The joints at heels and toes, ``left_heel`` and so on, as far as names tell."""
    plain, held = _plain_names(joints), {j for at in landmarks.values() for j in as_tuple(at)}
    plain = {name: joint for name, joint in plain.items() if joint not in held}
    joint_at = {
        f"{side}_{part}": _find(plain, side, synonyms)
        for side in SIDES
        for part, synonyms in _ENDS_OF_FEET.items()
    }
    return {name: joint for name, joint in joint_at.items() if joint is not None}


def add_midpoints(landmarks):
    """Landmarks with a missing pelvis and neck as the means of the hips and the shoulders."""
    for name, part in _MIDPOINTS.items():
        pair = [landmarks.get(f"{side}_{part}") for side in SIDES]
        if name not in landmarks and None not in pair:
            landmarks = landmarks | {name: tuple(j for at in pair for j in as_tuple(at))}
    return landmarks


def missing_counterparts(landmarks, named):
    """Landmarks that are missing while the other side was guessed, unless they were given."""
    return [
        name
        for name in LANDMARKS
        if name not in {*landmarks, *named}
        and (other := other_side(name)) in landmarks
        and other not in named
    ]


def other_side(landmark):
    """The landmark of the other side; None for pelvis, neck and head."""
    side, _, part = landmark.rpartition("_")
    return f"{SIDES[side == SIDES[0]]}_{part}" if side else None


def as_tuple(at):
    """The joints of a landmark, one or several, as a tuple."""
    return (at,) if isinstance(at, str) else tuple(at)


def _plain_names(joints):
    """Joints by their names in small letters and digits; of equal names the first."""
    # Programs put a prefix before every joint, except perhaps the root.
    prefix = re.match(r"(.*[^A-Za-z0-9])?", os.path.commonprefix(joints[1:])).group()  # noqa: RUF071
    # If one side was recorded, the side is in every name, and no prefix.
    prefix = re.sub(r"(?i)(?<![a-z0-9])(left|right|l|r)[^a-z0-9]+$", "", prefix)
    # Of markers with and without the name of the subject, those with it are the body's.
    subjects = {joint.rpartition(":")[0] for joint in joints if ":" in joint}
    if not prefix and len(subjects) == 1:
        prefix = f"{subjects.pop()}:"
    return {_plain(j.removeprefix(prefix)): j for j in reversed(joints)}


def _plain(name):
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _guess_by_synonyms(plain):
    """The joint of each landmark that a synonym or a pair of joints gives."""
    joint_at = {}
    for landmark in LANDMARKS:
        side, _, part = landmark.rpartition("_")
        joint = _find(plain, side, _SYNONYMS[part])
        if joint is not None:
            joint_at[landmark] = joint
    for landmark, pairs in _PAIRS.items():
        for side, name, other, other_name in pairs:
            pair = _find(plain, side, (name,)), _find(plain, other, (other_name,))
            if landmark not in joint_at and None not in pair:
                joint_at[landmark] = pair
    return joint_at


def _find(plain, side, synonyms):
    """The joint with one of these names on a side, or None."""
    forms = ("{side}{part}", "{part}{side}", "{side[0]}{part}", "{part}{side[0]}")
    names = [
        form.format(side=side, part=synonym)
        for synonym in synonyms
        for form in (forms if side else ("{part}",))
    ]
    return next((plain[name] for name in names if name in plain), None)
