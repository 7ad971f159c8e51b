"""ASF: the skeleton of Acclaim's motion files, with the bones' lengths and own axes."""

import math
from dataclasses import dataclass, field

import numpy as np

from ._text import MotionText, decode, show

_DOFS = ("tx", "ty", "tz", "rx", "ry", "rz")


@dataclass
class Bone:
    name: str = ""
    offset: object = None
    direction: object = None
    length: float | None = None
    axis: object = (0.0, 0.0, 0.0)
    axis_order: str = "xyz"
    dofs: list = field(default_factory=list)
    parent: int = -1


@dataclass
class Asf:
    """The root and the bones, in the order in which the hierarchy names them."""

    bones: list
    length_unit: float
    degrees: bool


def find_asf(path):
    """The skeleton of an AMC file, told from the names in its folder."""
    found = sorted(p for p in path.parent.iterdir() if p.suffix.lower() == ".asf" and p.is_file())
    named = [p for p in found if path.stem.lower().startswith(p.stem.lower())]
    if named:
        return max(named, key=lambda p: len(p.stem))
    if len(found) == 1:
        return found[0]
    names = ", ".join(p.name for p in found[:5]) or "none"
    raise ValueError(
        f"{path} needs the skeleton it was recorded with, and none of the .asf files in its folder "
        f"({names}) has a name that {path.name} begins with; give asf=."
    )


def read_asf(path):
    """The skeleton of an ASF file."""
    text = MotionText(path)
    root = Bone(name="root", offset=np.zeros(3), direction=(0.0, 0.0, 0.0))
    units = {"length": 1.0, "angle": b"deg"}
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
    chosen = [root] + [bones[name] for name in parents]
    return Asf(chosen, units["length"], units["angle"].startswith(b"deg"))


def _read_unit(text, words, units):
    key = words[0].lower()
    if key == b"length":
        (units["length"],) = text.numbers(words[1:], 1, ":units length")
        if units["length"] <= 0:
            raise text.error(f":units length must be above 0, got {units['length']!r}.")
    elif key == b"angle":
        if len(words) != 2 or words[1].lower()[:3] not in (b"deg", b"rad"):
            raise text.error(f":units angle must be deg or rad, got {show(words[1:])}.")
        units["angle"] = words[1].lower()


def _read_root(text, words, root):
    key = words[0].lower()
    if key == b"order":
        root.dofs = _read_dofs(text, words)
    elif key == b"axis":
        root.axis_order = _read_order(text, words[1:])
    elif key == b"position":
        root.offset = np.array(text.numbers(words[1:], 3, ":root position"))
    elif key == b"orientation":
        root.axis = text.numbers(words[1:], 3, ":root orientation")


def _read_bone(text, words, bone, bones):
    """The bone that is open after this line, or None."""
    key = words[0].lower()
    if key == b"begin" and bone is None:
        return Bone()
    if bone is None or key == b"begin":
        raise text.error(f"expected {'begin' if bone is None else 'end'}, got {show(words)}.")
    if key == b"end":
        if not bone.name or bone.name in bones or bone.direction is None or bone.length is None:
            raise text.error(
                f"bone {bone.name[:60]!r} needs a name of its own, a direction and a length."
            )
        bone.offset = [bone.length * part for part in bone.direction]
        if not all(map(math.isfinite, bone.offset)):
            raise text.error(f"bone {bone.name[:60]!r} is infinitely long.")
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
        raise text.error(f"expected an order of the axes like XYZ, got {show(words)}.")
    return order


def _read_dofs(text, words):
    dofs = [word.decode("latin-1").lower() for word in words[1:]]
    if not set(dofs) <= set(_DOFS) or len(set(dofs)) < len(dofs):
        raise text.error(
            f"{show(words[:1])} needs different ones of {' '.join(_DOFS)}, got {show(words[1:])}."
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
    """Set every bone's parent, and see that all hang on the root."""
    index = {name: i for i, name in enumerate(["root", *parents])}
    children = {}
    for name, parent in parents.items():
        # A parent that is nobody's child is not reached below, nor what hangs on it.
        bones[name].parent = index.get(parent, -1)
        children.setdefault(parent, []).append(name)
    reached = ["root"]
    for name in reached:
        reached += children.get(name, [])
    if len(reached) < len(bones):
        lost = sorted(set(bones) - set(reached))
        raise text.error(
            f":hierarchy does not connect {len(lost)} bones to the root, {lost[0][:60]!r} is one."
        )
