"""BVH: a tree of joints with offsets and channels, then the channels of every frame."""

from dataclasses import dataclass

import numpy as np

from ..inputs.wording import counted
from .kinematics import place_joints, split_channels
from .text import MotionText, decode, make_unique, quote

_KEYWORDS = (b"HIERARCHY", b"ROOT", b"JOINT", b"END", b"OFFSET", b"CHANNELS", b"MOTION", b"{", b"}")
_CHANNELS = [axis + kind for kind in (b"POSITION", b"ROTATION") for axis in (b"X", b"Y", b"Z")]


def read_bvh(path):
    """A BVH file as a reader of `motion.FORMATS` returns it.

    A position channel takes the place of the component of OFFSET that it names, at every
    joint; a component without a channel stays at OFFSET.
    """
    text = MotionText(path)
    joints = _read_hierarchy(text)
    n_channels = sum(len(joint.channels or ()) for joint in joints)
    if not n_channels:
        raise text.error("no joint has CHANNELS, so nothing moves.")
    values, n_stated, frame_rate = _read_motion(text, n_channels)
    text.check_count(len(values), n_stated, "Frames:")
    text.check_size(len(values), len(joints))
    parents = [joint.parent for joint in joints]
    offsets = np.array([joint.offset for joint in joints]).T[:, :, None]
    channels = [
        [f"{name[:1].decode()}{name[1:].decode().lower()}" for name in joint.channels or ()]
        for joint in joints
    ]
    (axes, moved, columns), turns = split_channels(
        [[("t" if name.endswith("position") else "r", name[0]) for name in of] for of in channels]
    )

    def translations(values):
        result = np.repeat(offsets, len(values), axis=2)
        result[axes, moved] = values[:, columns].T
        return result

    return {
        "joints": make_unique([joint.name for joint in joints]),
        "parents": parents,
        "positions": place_joints(parents, turns, values, translations),
        "frame_rate": frame_rate,
        "up": "y",
        "kind": "joints",
        "rig": {"offsets": offsets[:, :, 0].T.tolist(), "channels": channels},
    }


@dataclass
class _Joint:
    name: str
    parent: int
    is_end: bool = False
    offset: object = None
    channels: list | None = None


def _read_hierarchy(text):
    """The joints, parents first, up to and with the word MOTION."""
    joints, stack = [], []
    expected = "ROOT, JOINT, End Site, OFFSET, CHANNELS, a brace or MOTION"
    while (key := (word := text.word(expected)).upper()) != b"MOTION":
        current = joints[stack[-1]] if stack else None
        if key in (b"ROOT", b"JOINT", b"END"):
            joints.append(_read_declaration(text, key, joints, stack))
            stack.append(len(joints) - 1)
        elif key == b"}" and stack:
            if current.offset is None:
                raise text.error(f"joint {current.name[:60]!r} ends without an OFFSET.")
            stack.pop()
        elif key == b"OFFSET" and stack and current.offset is None:
            words = [text.word("a number of OFFSET") for _ in range(3)]
            current.offset = text.numbers(words, 3, "OFFSET")
        elif key == b"CHANNELS" and stack and current.channels is None:
            current.channels = _read_channels(text, current.is_end)
        elif key != b"HIERARCHY" or joints:
            raise text.error(f"expected {expected}, got {quote([word])}.")
    if stack or not joints:
        raise text.error(
            f"MOTION begins with {counted(len(stack), 'open joint')} of {len(joints)}; every "
            "{ needs a }, and at least one ROOT must be there."
        )
    return joints


def _read_declaration(text, key, joints, stack):
    """A new joint, up to and with its opening brace; its name may be a key-word, as "root"."""
    words = []
    while (word := text.word("{")) != b"{":
        if word == b"}" or (word.upper() in _KEYWORDS and (words or key == b"END")):
            raise text.error(f"expected a joint's name and {{, got {quote([word])}.")
        words.append(word)
    parent = stack[-1] if stack else -1
    inside = parent >= 0 and not joints[parent].is_end
    if (key == b"ROOT") == bool(stack) or (key != b"ROOT" and not inside):
        raise text.error(
            f"{quote([key])} stands where it cannot; a ROOT is in no joint, a JOINT or End Site in "
            "a ROOT or JOINT."
        )
    if key == b"END":
        return _Joint(joints[parent].name + "_end", parent, is_end=True)
    if not words:
        raise text.error("expected the joint's name before {.")
    return _Joint(decode(b" ".join(words)), parent)


def _read_channels(text, is_end):
    number = text.word("the number of CHANNELS")
    # There are six different channels, so no longer list can be right.
    if not number.isdigit() or len(number) > 1 or int(number) > len(_CHANNELS):
        raise text.error(f"CHANNELS needs a number from 0 to 6, got {quote([number])}.")
    channels = [text.word("the name of a channel").upper() for _ in range(int(number))]
    if not set(channels) <= set(_CHANNELS) or len(set(channels)) < len(channels):
        raise text.error(
            f"CHANNELS {int(number)} needs as many different names of Xposition ... Zrotation, "
            f"got {quote(channels)}."
        )
    if is_end and channels:
        raise text.error("an End Site has no CHANNELS.")
    return channels


def _read_motion(text, n_channels):
    """The channels (n_frames, n_channels), the stated number of frames, and frames a second."""
    n_frames = text.count(_read_field(text, b"frames"), "Frames:")
    frame_time = text.positive([_read_field(text, b"frame time")], "Frame Time:")
    values = text.table(n_channels, "a frame (one number a channel)")
    if not len(values):
        raise text.error("the file ends where frames should follow; it is not complete.")
    return values, n_frames, 1 / frame_time


def _read_field(text, name):
    words = text.line()
    key, colon, value = b" ".join(words).partition(b":")
    if not colon or b" ".join(key.lower().split()) != name:
        raise text.error(f"expected '{name.decode().title()}: <number>', got {quote(words)}.")
    return value.strip()
