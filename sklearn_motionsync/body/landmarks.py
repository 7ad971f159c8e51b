"""Landmarks told from the names of joints: those of a known format, or the likeliest ones."""

import os
import re

from .formats import FORMATS, LANDMARKS, SIDES

__all__ = ["LANDMARKS", "as_tuple", "completed", "likely_landmarks", "one_sided", "plain_names"]

# Names of the joint at each landmark in files whose joints are the near ends of the
# bones, the likeliest first. The last are what Plug-in Gait calls its bones, and its markers on
# the skin, which stand for the joints where no centres were computed.
_SYNONYMS = {
    "pelvis": ("pelvis", "hips", "hip", "hipcenter", "midhip", "spinebase", "root", "pelo"),
    "neck": ("neck", "neck1", "neck01", "necktwist01", "shouldercenter", "spineshoulder", "thorax",
             "trxo"),
    "head": ("head", "nose", "headtop", "headtopend", "hedo"),
    "shoulder": ("upperarm", "uparm", "uarm", "arm", "shoulder", "sjc", "clo", "sho"),
    "elbow": ("elbow", "forearm", "lowerarm", "lowarm", "farm", "larm", "ejc", "huo", "elb"),
    "wrist": ("wrist", "hand", "wjc", "rao"),
    "hip": ("thigh", "upleg", "upperleg", "hip", "hipjoint", "hjc", "fep", "asi"),
    "knee": ("knee", "calf", "leg", "lowerleg", "lowleg", "shin", "shank", "kjc", "feo", "kne"),
    "ankle": ("ankle", "foot", "ajc", "tio", "ank"),
}  # fmt: skip
# Joints or markers of which a landmark is the mean where none of those names is there: one of each
# side, or several of one.
_AROUND = {"head": ("ear", "fhd"), "wrist": ("wra", "wrb")}
# Formats that the guess could read otherwise; it finds what others lack in files that have more.
_KNOWN = [
    known.landmarks
    for known in FORMATS.values()
    if len(known.landmarks) == len(LANDMARKS)
    and all(isinstance(at, str) for at in known.landmarks.values())
]
# What stands in the middle of a pair, where no joint does.
_MIDDLES = {"pelvis": "hip", "neck": "shoulder"}


def likely_landmarks(joints, names=()):
    """The landmarks of a known format if the names are its, otherwise guessed ones.

    `names` may tell more joints than are there; their landmarks are left out.
    """
    there = {*joints, *names}
    plain = plain_names([*joints, *(name for name in names if name not in set(joints))])
    for landmarks in _KNOWN:
        if not set(landmarks.values()) <= there:
            landmarks = {name: plain.get(_plain(joint)) for name, joint in landmarks.items()}
        if None not in landmarks.values():
            return {name: joint for name, joint in landmarks.items() if joint in set(joints)}
    return _guessed(plain_names(joints))


def completed(landmarks):
    """Landmarks with a pelvis and a neck in the middle of the hips and the shoulders."""
    for name, part in _MIDDLES.items():
        pair = [landmarks.get(f"{side}_{part}") for side in SIDES]
        if name not in landmarks and None not in pair:
            landmarks = landmarks | {name: tuple(j for at in pair for j in as_tuple(at))}
    return landmarks


def one_sided(landmarks, given):
    """Landmarks that lack though their counterpart was told from the names; but those given."""
    lacking = []
    for name in LANDMARKS:
        side, _, part = name.rpartition("_")
        other = f"{SIDES[side == SIDES[0]]}_{part}"
        if side and name not in {*landmarks, *given} and other in landmarks and other not in given:
            lacking.append(name)
    return lacking


def as_tuple(at):
    """The joints of a landmark, of which there is one or several."""
    return (at,) if isinstance(at, str) else tuple(at)


def plain_names(joints):
    """Joints by their names in small letters and digits; of equal names the first."""
    # A prefix that a program gave to every joint but perhaps the root is no part of a name.
    prefix = re.match(r"(.*[^A-Za-z0-9])?", os.path.commonprefix(joints[1:])).group()  # noqa: RUF071
    # Of a body of which one side was recorded, every name has the side.
    prefix = re.sub(r"(?i)(?<![a-z0-9])(left|right|l|r)[^a-z0-9]+$", "", prefix)
    return {_plain(j.removeprefix(prefix)): j for j in reversed(joints)}


def _plain(name):
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _guessed(plain):
    """The joint of each landmark that can be told from the names."""
    found = {}
    for landmark in LANDMARKS:
        side, _, part = landmark.rpartition("_")
        joint = _find(plain, side, _SYNONYMS[part])
        if joint is not None:
            found[landmark] = joint
    for name in _AROUND["head"]:
        pair = [_find(plain, side, (name,)) for side in SIDES]
        if "head" not in found and None not in pair:
            found["head"] = tuple(pair)
    for side in SIDES:
        pair = [_find(plain, side, (name,)) for name in _AROUND["wrist"]]
        if f"{side}_wrist" not in found and None not in pair:
            found[f"{side}_wrist"] = tuple(pair)
    return found


def _find(plain, side, synonyms):
    """The joint that is called by one of these names, of this side."""
    forms = ("{side}{part}", "{part}{side}", "{side[0]}{part}", "{part}{side[0]}")
    names = [
        form.format(side=side, part=synonym)
        for synonym in synonyms
        for form in (forms if side else ("{part}",))
    ]
    return next((plain[name] for name in names if name in plain), None)
