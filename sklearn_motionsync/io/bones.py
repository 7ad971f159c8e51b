"""BVH and Acclaim: trees of joints that turn in their parents, and where that puts them."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..inputs.wording import counted
from .text import MotionText, decode, make_unique, quote

# -- BVH: a tree of joints with offsets and channels, then the channels of every frame ------------

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
    n_stated = text.count(_read_field(text, b"frames"), "Frames:")
    frame_time = text.positive([_read_field(text, b"frame time")], "Frame Time:")
    values = text.table(n_channels, "a frame (one number a channel)")
    if not len(values):
        raise text.error("the file ends where frames should follow; it is not complete.")
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
        "frame_rate": 1 / frame_time,
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
    n = int(number) if number.isdigit() and len(number) == 1 else -1
    channels = [text.word("the name of a channel").upper() for _ in range(n)]
    unique = set(channels)
    if len(unique) != n or not unique <= set(_CHANNELS) or (is_end and channels):
        raise text.error(
            "CHANNELS needs a number from 0 to 6 and as many different names of Xposition ... "
            f"Zrotation, of an End Site none; got {quote([number, *channels])}."
        )
    return channels


def _read_field(text, name):
    words = text.line()
    key, colon, value = b" ".join(words).partition(b":")
    if not colon or b" ".join(key.lower().split()) != name:
        raise text.error(f"expected '{name.decode().title()}: <number>', got {quote(words)}.")
    return value.strip()


# -- Acclaim: an ASF file with the skeleton, and AMC files with its motion -----------------------

_METRES_PER_INCH = 0.0254
_DOFS = ("tx", "ty", "tz", "rx", "ry", "rz")


def read_acclaim(path, *, asf=None):
    """An AMC file as a reader of `motion.FORMATS` returns it; `asf` is its skeleton."""
    asf = find_asf(path) if asf is None else Path(asf)
    bones, length_unit, in_degrees = read_asf(asf)
    text = MotionText(path)
    values, header = _read_amc(text, bones, in_degrees, asf)
    text.check_size(len(values), len(bones))
    positions = _place_bones(bones, in_degrees, values, header["degrees"])
    positions /= length_unit
    positions *= _METRES_PER_INCH
    return {
        "joints": [bone.name for bone in bones],
        "parents": [bone.parent for bone in bones],
        "positions": positions,
        "frame_rate": header["frame_rate"],
        "first_frame": header["first_frame"],
        "units": "m",
        "up": "y",
        "kind": "joints",
    }


@dataclass
class _Bone:
    name: str = ""
    offset: object = None
    direction: object = None
    length: float | None = None
    axis: object = (0.0, 0.0, 0.0)
    axis_order: str = "xyz"
    dofs: list = field(default_factory=list)
    parent: int = -1


def find_asf(path):
    """The skeleton of an AMC file, by the names of the files in its folder."""
    paths = sorted(p for p in path.parent.iterdir() if p.suffix.lower() == ".asf" and p.is_file())
    named = [p for p in paths if path.stem.lower().startswith(p.stem.lower())]
    if named or len(paths) == 1:
        return max(named or paths, key=lambda p: len(p.stem))
    names = ", ".join(p.name for p in paths[:5]) or "none"
    raise ValueError(
        f"{path} needs the skeleton it was recorded with, and none of the .asf files in its folder "
        f"({names}) has a name that {path.name} begins with; give asf=."
    )


def read_asf(path):
    """The root and the bones in the order of the hierarchy, unit of length, whether in degrees."""
    text = MotionText(path)
    root = _Bone(name="root", offset=np.zeros(3))
    units = {"length": 1.0, "degrees": True}
    bones, bone, parents = {"root": root}, None, {}
    section = b""
    for words in text.lines():
        if words[0].startswith(b"#"):
            continue
        if words[0].startswith(b":"):
            section = words[0].lower()
        elif section == b":units":
            _read_unit(text, words, units)
        elif section == b":root":
            _read_root(text, words, root)
        elif section == b":bonedata":
            bone = _read_bone(text, words, bone, bones)
        elif section == b":hierarchy":
            _read_children(text, words, bones, parents)
    if bone is not None or len(bones) == 1 or not root.dofs:
        raise text.error(
            "the file ends without a complete :root, :bonedata and :hierarchy; an .asf has all."
        )
    _connect(text, bones, parents)
    return [root, *(bones[name] for name in parents)], units["length"], units["degrees"]


def _read_unit(text, words, units):
    key = words[0].lower()
    if key == b"length":
        units["length"] = text.positive(words[1:], ":units length")
    elif key == b"angle":
        if len(words) != 2 or words[1].lower()[:3] not in (b"deg", b"rad"):
            raise text.error(f":units angle must be deg or rad, got {quote(words[1:])}.")
        units["degrees"] = words[1].lower().startswith(b"deg")


def _read_root(text, words, root):
    key = words[0].lower()
    if key == b"order":
        root.dofs = _read_dofs(text, words)
    elif key == b"axis":
        root.axis_order = _read_order(text, words[1:])
    elif key == b"position":
        root.offset = text.numbers(words[1:], 3, ":root position")
    elif key == b"orientation":
        root.axis = text.numbers(words[1:], 3, ":root orientation")


def _read_bone(text, words, bone, bones):
    """The bone that is open after this line, or None."""
    key = words[0].lower()
    if key == b"begin" and bone is None:
        return _Bone()
    if bone is None or key == b"begin":
        raise text.error(f"expected {'begin' if bone is None else 'end'}, got {quote(words)}.")
    if key == b"end":
        if not bone.name or bone.name in bones or bone.direction is None or bone.length is None:
            raise text.error(
                f"bone {bone.name[:60]!r} needs a name of its own, a direction and a length."
            )
        bone.offset = [bone.length * component for component in bone.direction]
        bones[bone.name] = bone
        return None
    if key == b"name":
        bone.name = decode(b" ".join(words[1:]))
    elif key == b"direction":
        bone.direction = text.numbers(words[1:], 3, "direction")
    elif key == b"length":
        (bone.length,) = text.numbers(words[1:], 1, "length")
    elif key == b"axis":
        bone.axis = text.numbers(words[1:4], 3, "axis")
        bone.axis_order = _read_order(text, words[4:])
    elif key == b"dof":
        bone.dofs = _read_dofs(text, words)
    return bone


def _read_order(text, words):
    order = b" ".join(words).decode("latin-1").lower()
    if sorted(order) != ["x", "y", "z"]:
        raise text.error(f"expected an order of the axes like XYZ, got {quote(words)}.")
    return order


def _read_dofs(text, words):
    dofs = [word.decode("latin-1").lower() for word in words[1:]]
    if not set(dofs) <= set(_DOFS) or len(set(dofs)) < len(dofs):
        raise text.error(
            f"{quote(words[:1])} needs different ones of {' '.join(_DOFS)}, got {quote(words[1:])}."
        )
    return dofs


def _read_children(text, words, bones, parents):
    names = [decode(word) for word in words]
    if len(names) == 1 and names[0].lower() in ("begin", "end"):
        return
    for name in names:
        if name not in bones:
            raise text.error(f":hierarchy names {name[:60]!r}, which is not in :bonedata.")
    for name in names[1:]:
        if name == "root" or name in parents:
            raise text.error(f":hierarchy gives {name[:60]!r} two parents, or the root one.")
        parents[name] = names[0]


def _connect(text, bones, parents):
    """Set every bone's parent, and check that all are connected to the root."""
    index = {name: i for i, name in enumerate(["root", *parents])}
    children = {}
    for name, parent in parents.items():
        # A parent without a parent is not reached from the root below, nor are its children.
        bones[name].parent = index.get(parent, -1)
        children.setdefault(parent, []).append(name)
    reached = ["root"]
    for name in reached:
        reached += children.get(name, [])
    if len(reached) < len(bones):
        lost = sorted(set(bones) - set(reached))
        raise text.error(
            f":hierarchy does not connect {counted(len(lost), 'bone')} to the root, "
            f"{lost[0][:60]!r} is one."
        )


def _read_amc(text, bones, in_degrees, asf):
    """Values (n_frames, n_dofs) in the order of the bones, and what else the file tells."""
    n_dofs = {bone.name: len(bone.dofs) for bone in bones}
    moving = [name for name, n in n_dofs.items() if n]
    header = {"degrees": in_degrees, "frame_rate": None}
    frames = []
    for number, frame in _frames(text, n_dofs, header, asf):
        if len(frame) < len(moving):
            lost = next(name for name in moving if name not in frame)
            raise text.error(
                f"frame {number} has no values of {lost[:60]!r}, which {asf.name} gives some; the "
                "file is not complete, or asf= is not its skeleton."
            )
        frames.append(b"".join(frame[name] for name in moving))
    if not frames:
        raise text.error("the file ends without a frame; each begins with its number.")
    header["first_frame"] = number - len(frames) + 1
    return np.frombuffer(b"".join(frames)).reshape(len(frames), -1), header


def _frames(text, n_dofs, header, asf):
    """The number of each frame and the values of its bones, by name."""
    number, frame = None, {}
    for words in text.lines():
        if words[0].startswith((b"#", b":")):
            key = words[0].upper()
            if key in (b":DEGREES", b":RADIANS"):
                header["degrees"] = key == b":DEGREES"
            elif key == b":SAMPLES-PER-SECOND":
                header["frame_rate"] = text.positive(words[1:], ":SAMPLES-PER-SECOND")
        elif len(words) == 1 and words[0].isdigit():
            if len(words[0]) > 18 or (number is not None and int(words[0]) != number + 1):
                raise text.error(
                    f"frame {quote(words)} follows frame {number}; frames must be numbered one by "
                    "one, since a lost frame would shift all that follow in time."
                )
            if number is not None:
                yield number, frame
            number, frame = int(words[0]), {}
        else:
            name = decode(words[0])
            if number is None or not n_dofs.get(name) or name in frame:
                raise text.error(
                    f"expected the number of a frame, or a bone that moves in {asf.name}, once a "
                    f"frame, and its values; got {quote(words)}."
                )
            frame[name] = text.numbers(words[1:], n_dofs[name], f"bone {name[:60]!r}")
    if number is not None:
        yield number, frame


def _place_bones(bones, in_degrees, values, degrees):
    """Positions of the far ends of the bones, in the unit of the skeleton.

    A bone turns about its own axes, C: its rotation in its parent is C M inv(C), with M the
    motion, which it is moved before, along C. Its joint is its far end, so its own rotation acts
    on its offset. The root's C is its orientation at the start, so its rotation is C M; it moves
    along the axes of space, from its offset, and the axes of its children are given in the axes
    that it has turned to.
    """
    bone_axes = []
    for bone in bones:
        angles = np.radians(bone.axis) if in_degrees else np.array(bone.axis)
        # Rotations about fixed axes are those about turning axes in the opposite order.
        bone_axes.append(turn(np.eye(3), bone.axis_order[::-1].upper(), angles[::-1]))
    bone_axes = np.stack(bone_axes, axis=2)
    back = bone_axes.swapaxes(0, 1).copy()
    back[:, :, 0] = np.eye(3)
    offsets = np.array([bone.offset for bone in bones]).T
    far_ends = rotate(back, offsets)
    start = np.zeros((3, len(bones), 1))
    start[:, 0, 0], far_ends[:, 0] = offsets[:, 0], 0
    parents = [bone.parent for bone in bones]
    above = back[:, :, parents]
    above[:, :, 0] = np.eye(3)
    at_rest = rotate(above[:, :, None], bone_axes)
    shifts = at_rest.copy()
    shifts[:, :, 0] = np.eye(3)
    channels = [[(kind, axis.upper()) for kind, axis in bone.dofs] for bone in bones]
    (axes, moved, columns), turns = split_channels(channels)
    # Degrees of freedom act in their order, about fixed axes.
    turns = [(names[::-1], columns[::-1]) for names, columns in turns]

    def translations(values):
        steps = np.zeros((3, len(bones), len(values)))
        steps[axes, moved] = values[:, columns].T
        return rotate(shifts[..., None], steps) + start

    return place_joints(
        parents, turns, values, translations, degrees=degrees, at_rest=at_rest, bones=far_ends
    )


# -- forward kinematics: positions of joints, from how each moves in its parent ------------------

# Frames, and frames times joints, that are placed at once: enough for the overhead of NumPy's calls
# not to count, and few enough for the processor's cache and the memory.
_FRAMES = 2**12
_BLOCK = 2**18
# The two axes that turn about a third, the first to where the second was.
_OTHERS = {"X": (1, 2), "Y": (2, 0), "Z": (0, 1)}


def split_channels(channels):
    """Columns that move joints, and columns that turn them.

    Of each joint come its channels in the order of their columns: ("t" or "r", axis), with the axis
    "X", "Y" or "Z". ``moving`` (3, n) has axis, joint and column of each translation, ``turns`` for
    each joint the axes about which it turns, such as "ZXY", and their columns.
    """
    moving, turns, column = [], [], 0
    for j, joint_channels in enumerate(channels):
        axes, columns = "", []
        for kind, axis in joint_channels:
            if kind == "t":
                moving.append(("XYZ".index(axis), j, column))
            else:
                axes += axis
                columns.append(column)
            column += 1
        turns.append((axes, columns))
    return np.array(moving, dtype=int).reshape(-1, 3).T, turns


def place_joints(parents, turns, values, translations, *, degrees=True, at_rest=None, bones=None):
    """Positions (n_frames, n_joints, 3) of the joints of a tree, each with axes that turn with it.

    Joints turn by ``values`` (n_frames, n_channels), in ``turns`` as `split_channels` returns them,
    each axis turned by those before it. ``translations(values)`` returns, for some frames, the
    translation of each joint along the axes of its parent, (3, n_joints, n_frames), which is
    overwritten. ``at_rest`` (3, 3, n_joints) are the axes of joints before they turn, as columns,
    in those of their parents, by default the same; ``bones`` (3, n_joints) lead from where a joint
    turns to its position, along its axes.
    """
    children = {-1: []}
    for j, parent in enumerate(parents):
        children.setdefault(parent, []).append(j)
    order = children[-1]
    for j in order:
        order += children.get(j, ())
    positions = np.empty((len(values), len(parents), 3))
    step = max(1, min(_FRAMES, _BLOCK // len(parents)))
    for first in range(0, len(values), step):
        block = values[first : first + step]
        angles = np.radians(block.T) if degrees else np.ascontiguousarray(block.T)
        places, axes_of = translations(block), {-1: np.eye(3)[:, :, None]}
        for j in order:
            above = axes_of[parents[j]]
            places[:, j] = rotate(above, places[:, j])
            if parents[j] >= 0:
                places[:, j] += places[:, parents[j]]
            # The rotation of a leaf moves nothing but its bone.
            if j in children or bones is not None:
                axes = np.repeat(above, len(block) // above.shape[2], axis=2)
                if at_rest is not None:
                    axes = rotate(axes[:, :, None], at_rest[:, :, j, None])
                names, columns = turns[j]
                axes_of[j] = turn(axes, names, angles[columns])
            if bones is not None:
                places[:, j] += rotate(axes_of[j], bones[:, j, None])
        positions[first : first + step] = places.transpose(2, 1, 0)
    return positions


def rotate(axes, vectors):
    """Vectors (3, ...) given along axes (3, 3, ...), in the coordinates of the axes."""
    result = axes[:, 0] * vectors[0]
    result += axes[:, 1] * vectors[1]
    result += axes[:, 2] * vectors[2]
    return result


def turn(axes, names, angles):
    """Turn axes (3, 3, ...) about some of themselves, as they are then, by angles (n, ...)."""
    for name, c, s in zip(names, np.cos(angles), np.sin(angles), strict=True):
        i, j = _OTHERS[name]
        first, second = axes[:, i], axes[:, j]
        across = s * first
        first *= c
        first += s * second
        second *= c
        second -= across
    return axes
