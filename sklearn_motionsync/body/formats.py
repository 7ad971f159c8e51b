"""Skeletons known by heart: their joints, the parent of each, and which are the landmarks."""

from typing import NamedTuple

__all__ = ["FORMATS", "LANDMARKS", "SIDES", "Format"]

SIDES = ("left", "right")


class Format(NamedTuple):
    """Joints as a program writes them.

    Attributes
    ----------
    parents : dict of str to str or None
        The parent of each joint, in the order of the columns.
    landmarks : dict of str to str or tuple of str
        The joint of each landmark, or those whose mean it is.
    up : str
        The vertical axis that is usual in space.
    up_in_pictures : str
        The same of two coordinates.
    """

    parents: dict
    landmarks: dict
    up: str = "y"
    up_in_pictures: str = "-y"


def _both(parts, name):
    """Landmarks of both sides: ``name(side, joint)`` of each part."""
    return {f"{side}_{part}": name(side, joint) for side in SIDES for part, joint in parts.items()}


def _chains(name, roots, *chains):
    """Parents of the joints of both sides; each chain hangs on one of the roots or on a chain."""
    parents = {}
    for side in SIDES:
        for above, *chain in chains:
            for joint in chain:
                parents[name(side, joint)] = above if above in roots else name(side, above)
                above = joint
    return parents


def _in_order(parents, joints):
    return {joint: parents[joint] for joint in joints}


_PARTS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
_ARM, _LEG = _PARTS[:3], _PARTS[3:]


def _snake(side, joint):
    return f"{side}_{joint}"


def _initial(side, joint):
    return side[0].upper() + joint


# The fifteen joints of the body model.
_PAPER = {"pelvis": None, "neck": "pelvis", "head": "neck"} | _chains(
    _snake, ("neck", "pelvis"), ("neck", *_ARM), ("pelvis", *_LEG)
)
LANDMARKS = list(_PAPER)


def _acclaim():
    parents = {
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
    bones = ("clavicle", "humerus", "radius", "hipjoint", "femur", "tibia")
    sides = _both(dict(zip(_PARTS, bones, strict=True)), lambda side, bone: side[0] + bone)
    landmarks = {"pelvis": "root", "neck": "thorax", "head": "head"} | sides
    return Format(parents, landmarks, up_in_pictures="y")


def _kinect(version):
    def name(side, joint):
        return joint + side.capitalize()

    arm, leg = ("Shoulder", "Elbow", "Wrist", "Hand"), ("Hip", "Knee", "Ankle", "Foot")
    names = {1: ("HipCenter", "Spine", "ShoulderCenter"), 2: ("SpineBase", "SpineMid", "Neck")}
    pelvis, middle, third = names[version]
    shoulders = third if version == 1 else "SpineShoulder"
    parents = {pelvis: None, middle: pelvis, shoulders: middle, third: shoulders, "Head": third}
    if version == 1:
        parents[third] = middle
    sides = _chains(name, (shoulders, pelvis), (shoulders, *arm), (pelvis, *leg))
    order = [pelvis, middle, third, "Head"]
    order += [name(side, joint) for chain in (arm, leg) for side in SIDES for joint in chain]
    parents |= sides
    if version == 2:
        parents |= _chains(name, (), ("Hand", "HandTip"), ("Hand", "Thumb"))
        tips = [name(side, joint) for side in SIDES for joint in ("HandTip", "Thumb")]
        order += [shoulders, *tips]
    landmarks = {"pelvis": pelvis, "neck": shoulders, "head": "Head"}
    landmarks |= _both({part: part.capitalize() for part in _PARTS}, name)
    return Format(_in_order(parents, order), landmarks)


def _openpose(*, face, pelvis):
    """BODY_25, or without the face OpenCap's key-points."""
    arm, leg = [[part.capitalize() for part in chain] for chain in (_ARM, _LEG)]
    parents = {pelvis: None, "Neck": pelvis, "Nose": "Neck"} | _chains(
        _initial, ("Neck", pelvis, "Nose"), ("Neck", *arm), (pelvis, *leg), ("Nose", "Eye", "Ear"),
        ("Ankle", "BigToe", "SmallToe"), ("Ankle", "Heel"),
    )  # fmt: skip
    order = ["Nose", "Neck", *(s + j for s in "RL" for j in arm), pelvis]
    order += [s + j for s in "RL" for j in leg] + ["REye", "LEye", "REar", "LEar"]
    order += [s + j for s in "LR" for j in ("BigToe", "SmallToe", "Heel")]
    landmarks = {"pelvis": pelvis, "neck": "Neck"} | ({"head": "Nose"} if face else {})
    landmarks |= _both({part: part.capitalize() for part in _PARTS}, _initial)
    if not face:
        order = [joint for joint in order if joint[1:] not in ("Eye", "Ear", "ose")]
    return Format(_in_order(parents, order), landmarks)


def _key_points(*, more):
    """COCO's seventeen, or MediaPipe's thirty-three."""
    # A tree has one way between two joints: the right side of the trunk is left open.
    trunk = {"nose": None, "left_hip": None, "right_hip": "left_hip"}
    trunk |= {"left_shoulder": "left_hip", "right_shoulder": "left_shoulder"}
    face = ("nose", "eye_inner", "eye", "eye_outer", "ear") if more else ("nose", "eye", "ear")
    parents = trunk | _chains(_snake, ("nose",), _ARM, _LEG, face)
    order = ["nose"]
    if more:
        parents |= {"mouth_left": None, "mouth_right": "mouth_left"}
        parents |= _chains(
            _snake, (), *(("wrist", tip) for tip in ("pinky", "index", "thumb")),
            ("ankle", "heel", "foot_index"),
        )  # fmt: skip
        order += [_snake(s, j) for s in SIDES for j in ("eye_inner", "eye", "eye_outer")]
        order += [*(_snake(s, "ear") for s in SIDES), "mouth_left", "mouth_right"]
        pairs = (*_ARM, "pinky", "index", "thumb", *_LEG, "heel", "foot_index")
    else:
        pairs = ("eye", "ear", *_PARTS)
    order += [_snake(side, joint) for joint in pairs for side in SIDES]
    hips, shoulders = (tuple(_snake(side, part) for side in SIDES) for part in ("hip", "shoulder"))
    landmarks = {"pelvis": hips, "neck": shoulders, "head": "nose"}
    landmarks |= _both({part: part for part in _PARTS}, _snake)
    return Format(_in_order(parents, order), landmarks, up="-y" if more else "y")


def _near_ends(name, middle, neck, limbs, *, clavicle, toes, up):
    """A rig whose joints are the near ends of its bones; `middle` leads up from the pelvis."""
    pelvis, chest = middle[0], middle[-1]
    parents = {joint: above for above, joint in zip((None, *middle), middle, strict=False)}
    parents |= {neck[0]: chest, **{joint: neck[0] for joint in neck[1:]}}
    arm, leg = limbs[:3], limbs[3:]
    parents |= _chains(name, (chest, pelvis), (chest, *clavicle, *arm), (pelvis, *leg, *toes))
    landmarks = {"pelvis": pelvis, "neck": neck[0], "head": neck[-1]}
    landmarks |= _both(dict(zip(_PARTS, limbs, strict=True)), name)
    return parents, landmarks, up


def _optitrack():
    limbs = ("UArm", "FArm", "Hand", "Thigh", "Shin", "Foot")
    parents, landmarks, up = _near_ends(
        _initial, ("Hip", "Ab", "Chest"), ("Neck", "Head"), limbs,
        clavicle=("Shoulder",), toes=("Toe",), up="y",
    )  # fmt: skip
    order = ["Hip", "Ab", "Chest", "Neck", "Head"]
    order += [s + j for s in "LR" for j in ("Shoulder", *limbs[:3])]
    order += [s + j for s in "LR" for j in (*limbs[3:], "Toe")]
    return Format(_in_order(parents, order), landmarks, up)


def _unreal():
    def name(side, joint):
        return f"{joint}_{side[0]}"

    limbs = ("upperarm", "lowerarm", "hand", "thigh", "calf", "foot")
    spine = ("pelvis", "spine_01", "spine_02", "spine_03")
    parents, landmarks, up = _near_ends(
        name, spine, ("neck_01", "head"), limbs, clavicle=("clavicle",), toes=("ball",), up="z"
    )
    order = [*spine, *(f"{j}_{s}" for s in "lr" for j in ("clavicle", *limbs[:3]))]
    order += ["neck_01", "head", *(f"{j}_{s}" for s in "lr" for j in (*limbs[3:], "ball"))]
    return Format(_in_order(parents, order), landmarks, up)


def _plug_in_gait():
    centres = {part: f"{part[0].upper()}JC" for part in _PARTS}
    parents = {"PELO": None, "TRXO": "PELO", "HEDO": "TRXO"} | _chains(
        _initial, ("PELO", "TRXO"), ("PELO", *(centres[part] for part in _LEG)),
        ("TRXO", *(centres[part] for part in _ARM)),
    )  # fmt: skip
    landmarks = {"pelvis": "PELO", "neck": "TRXO", "head": "HEDO"} | _both(centres, _initial)
    order = ["PELO", *(s + centres[part] for s in "LR" for part in _LEG), "TRXO", "HEDO"]
    order += [s + centres[part] for s in "LR" for part in _ARM]
    return Format(_in_order(parents, order), landmarks, up="z")


# In the order in which names are held against them: who has most landmarks first.
FORMATS = {
    "acclaim": _acclaim(),
    "kinect": _kinect(1),
    "paper": Format(_PAPER, {name: name for name in LANDMARKS}, up_in_pictures="y"),
    "kinect_v2": _kinect(2),
    "openpose": _openpose(face=True, pelvis="MidHip"),
    "mediapipe": _key_points(more=True),
    "coco": _key_points(more=False),
    "plug_in_gait": _plug_in_gait(),
    "optitrack": _optitrack(),
    "unreal": _unreal(),
    "opencap": _openpose(face=False, pelvis="midHip"),
}
