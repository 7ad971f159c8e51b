"""BVH: a tree of joints with offsets and channels, then the channels of every frame."""

from dataclasses import dataclass, field

import numpy as np

from .kinematics import Tree, check_positions
from .text import MotionText, decode, show, unique

_KEYWORDS = (b"HIERARCHY", b"ROOT", b"JOINT", b"END", b"OFFSET", b"CHANNELS", b"MOTION", b"{", b"}")
_CHANNELS = [axis + kind for kind in (b"POSITION", b"ROTATION") for axis in (b"X", b"Y", b"Z")]


@dataclass
class _Joint:
    name: str
    parent: int
    is_end: bool = False
    offset: object = None
    channels: list = field(default_factory=list)
    has_channels: bool = False


def read_bvh(path):
    """Names, parents, positions and facts of a BVH file.

    A position channel takes the place of the component of OFFSET that it names, at every
    joint; a component without a channel stays at OFFSET.
    """
    text = MotionText(path)
    joints = _read_hierarchy(text)
    n_channels = sum(len(joint.channels) for joint in joints)
    if not n_channels:
        raise text.error("no joint has CHANNELS, so nothing moves.")
    values, frame_rate = _read_motion(text, n_channels)
    check_positions(path, text.size, len(values), len(joints))
    parents = [joint.parent for joint in joints]
    turning, translations = _motion(joints)
    return {
        "joints": unique([joint.name for joint in joints]),
        "parents": parents,
        "positions": Tree(parents, turning).positions(path, values, translations),
        "frame_rate": frame_rate,
        "units": None,
        "up": "y",
        "kind": "joints",
    }


def _read_hierarchy(text):
    """The joints, parents first, up to and with the word MOTION."""
    joints, stack = [], []
    expected = "ROOT, JOINT, End Site, OFFSET, CHANNELS, a brace or MOTION"
    while (key := (word := text.word(expected)).upper()) != b"MOTION":
        if key in (b"ROOT", b"JOINT", b"END"):
            joints.append(_declare(text, key, joints, stack))
            stack.append(len(joints) - 1)
        elif key == b"}" and stack:
            _close(text, joints[stack.pop()])
        elif key == b"OFFSET" and stack and joints[stack[-1]].offset is None:
            words = [text.word("a number of OFFSET") for _ in range(3)]
            joints[stack[-1]].offset = text.numbers(words, 3, "OFFSET")
        elif key == b"CHANNELS" and stack and not joints[stack[-1]].has_channels:
            _read_channels(text, joints[stack[-1]])
        elif key != b"HIERARCHY" or joints:
            raise text.error(f"expected {expected}, got {show([word])}.")
    if stack or not joints:
        raise text.error(
            f"MOTION begins, but {len(stack)} joints are open and {len(joints)} are complete or "
            "open; every { needs a }, and at least one ROOT must be there."
        )
    return joints


def _declare(text, key, joints, stack):
    """A new joint, up to and with its opening brace."""
    words = []
    while (word := text.word("{")) != b"{":
        if word.upper() in _KEYWORDS:
            raise text.error(f"expected a joint's name and {{, got {show([word])}.")
        words.append(word)
    parent = stack[-1] if stack else -1
    inside = parent >= 0 and not joints[parent].is_end
    if (key == b"ROOT") == bool(stack) or (key != b"ROOT" and not inside):
        raise text.error(
            f"{show([key])} stands where it cannot; a ROOT is in no joint, a JOINT or End Site in "
            "a ROOT or JOINT."
        )
    if key == b"END":
        return _Joint(joints[parent].name + "_end", parent, is_end=True)
    if not words:
        raise text.error("expected the joint's name before {.")
    return _Joint(decode(b" ".join(words)), parent)


def _close(text, joint):
    if joint.offset is None:
        raise text.error(f"joint {joint.name[:60]!r} ends without an OFFSET.")


def _read_channels(text, joint):
    number = text.word("the number of CHANNELS")
    # At most six different channels exist, so no longer list can be right.
    if not number.isdigit() or len(number) > 1 or int(number) > len(_CHANNELS):
        raise text.error(f"CHANNELS needs a number from 0 to 6, got {show([number])}.")
    channels = [text.word("the name of a channel").upper() for _ in range(int(number))]
    if not set(channels) <= set(_CHANNELS) or len(set(channels)) < len(channels):
        raise text.error(
            f"CHANNELS {int(number)} needs as many different names of Xposition ... Zrotation, "
            f"got {show(channels)}."
        )
    if joint.is_end and channels:
        raise text.error("an End Site has no CHANNELS.")
    joint.channels, joint.has_channels = channels, True


def _read_motion(text, n_channels):
    """The channels (n_frames, n_channels) and the frames a second."""
    n_frames = _read_field(text, b"frames")
    if not n_frames.isdigit() or len(n_frames) > 18 or not int(n_frames):
        raise text.error(f"Frames: needs a whole number above 0, got {show([n_frames])}.")
    n_frames = int(n_frames)
    (frame_time,) = text.numbers([_read_field(text, b"frame time")], 1, "Frame Time:")
    # Outside of these bounds it is no clock of a recording, and its inverse may overflow.
    if not 1e-9 <= frame_time <= 1e9:
        raise text.error(f"Frame Time: needs seconds above 0, got {frame_time!r}.")
    # A number takes two bytes at least, with the blank behind it.
    if 2 * n_frames * n_channels - 1 > text.n_left:
        raise text.error(
            f"Frames: says {n_frames}, each of {n_channels} channels, but only {text.n_left} bytes "
            "follow; the file is not complete, or that line is wrong."
        )
    values = text.table(n_channels, "a frame (one number a channel)")
    if len(values) != n_frames:
        raise text.error(
            f"Frames: says {n_frames}, but {len(values)} frames follow; the file is not complete, "
            "or that line is wrong."
        )
    return values, 1 / frame_time


def _read_field(text, name):
    words = text.line()
    key, colon, value = b" ".join(words).partition(b":")
    if not colon or b" ".join(key.lower().split()) != name:
        raise text.error(f"expected '{name.decode().title()}: <number>', got {show(words)}.")
    return value.strip()


def _motion(joints):
    """Which channels turn the joints, and the function that turns channels into translations."""
    offsets = np.array([joint.offset for joint in joints]).T[:, :, None]
    moving, turning = [], {}
    column = 0
    for j, joint in enumerate(joints):
        axes, columns = "", []
        for channel in joint.channels:
            if channel.endswith(b"POSITION"):
                moving.append((b"XYZ".index(channel[:1]), j, column))
            else:
                axes += channel[:1].decode()
                columns.append(column)
            column += 1
        if axes:
            turning.setdefault(axes, []).append((j, columns))
    components, moved, columns = np.array(moving, dtype=int).reshape(-1, 3).T

    def translations(values):
        result = np.repeat(offsets, len(values), axis=2)
        result[components, moved] = values[:, columns].T
        return result

    return turning, translations
