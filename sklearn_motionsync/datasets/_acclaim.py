"""AMC: the motion of an Acclaim skeleton, which is a file of its own."""

import array

import numpy as np

from ._asf import read_asf
from ._kinematics import Tree, along, check_positions, turn
from ._text import MotionText, decode, show

_METRES_PER_INCH = 0.0254


def read_acclaim(path, asf):
    """Names, parents, positions in metres and facts of an AMC file; `asf` is its skeleton."""
    skeleton = read_asf(asf)
    text = MotionText(path)
    values, degrees, frame_rate = _read_amc(text, skeleton, asf)
    bones = skeleton.bones
    check_positions(path, text.size, len(values), len(bones))
    parents = [bone.parent for bone in bones]
    with np.errstate(over="ignore", invalid="ignore"):
        tree, translations = _body(skeleton, parents, degrees)
        positions = tree.positions(path, values, translations)
        positions /= skeleton.length_unit
        positions *= _METRES_PER_INCH
    if not np.isfinite(positions).all():
        raise ValueError(f"{asf}: with :units length {skeleton.length_unit} positions overflow.")
    return {
        "joints": [bone.name for bone in bones],
        "parents": parents,
        "positions": positions,
        "frame_rate": frame_rate,
        "units": "m",
        "up": "y",
        "kind": "joints",
    }


def _read_amc(text, skeleton, asf):
    """Values (n_frames, n_dofs) in the order of the bones, and what the header says."""
    n_dofs = {bone.name: len(bone.dofs) for bone in skeleton.bones}
    moving = [name for name, n in n_dofs.items() if n]
    header = {"degrees": skeleton.degrees, "frame_rate": None}
    values, n_frames = array.array("d"), 0
    for number, frame in _frames(text, n_dofs, header, asf):
        if len(frame) < len(moving):
            lost = next(name for name in moving if name not in frame)
            raise text.error(
                f"frame {number} has no values of {lost[:60]!r}, which {asf.name} gives some; the "
                "file is not complete, or asf= is not its skeleton."
            )
        for name in moving:
            values.extend(frame[name])
        n_frames += 1
    if not n_frames:
        raise text.error("the file ends without a frame; each begins with its number.")
    return np.frombuffer(values).reshape(n_frames, -1), header["degrees"], header["frame_rate"]


def _frames(text, n_dofs, header, asf):
    """The number of each frame and the values of its bones, by name."""
    number, frame = None, {}
    for words in text.lines():
        if words[0].startswith((b"#", b":")):
            _read_setting(text, words, header)
        elif len(words) == 1 and words[0].isdigit():
            if len(words[0]) > 18 or (number is not None and int(words[0]) != number + 1):
                raise text.error(
                    f"frame {show(words)} follows frame {number}; frames must be numbered one by "
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
                    f"frame, and its values; got {show(words)}."
                )
            frame[name] = text.numbers(words[1:], n_dofs[name], f"bone {name[:60]!r}")
    if number is not None:
        yield number, frame


def _read_setting(text, words, header):
    key = words[0].upper()
    if key in (b":DEGREES", b":RADIANS"):
        header["degrees"] = key == b":DEGREES"
    elif key == b":SAMPLES-PER-SECOND":
        (rate,) = text.numbers(words[1:], 1, ":SAMPLES-PER-SECOND")
        if rate <= 0:
            raise text.error(f":SAMPLES-PER-SECOND must be above 0, got {rate!r}.")
        header["frame_rate"] = rate


def _body(skeleton, parents, degrees):
    """The tree of the bones, and the function that turns values into translations.

    A bone turns about its own axes, C: its rotation in its parent is C M inv(C), with M the
    motion, which it is moved before, along C. Its joint is its far end, so its own rotation acts
    on its offset. The root's C is where it begins, so its rotation is C M; it moves along the axes
    of the world, from its offset, and bones that hang on it are told in what it turns to.
    """
    bones = skeleton.bones
    own = _own_axes(bones, skeleton.degrees)
    back = own.swapaxes(0, 1).copy()
    back[:, :, 0] = np.eye(3)
    offsets = np.array([bone.offset for bone in bones]).T
    far_ends = along(back, offsets)
    begin = np.zeros((3, len(bones), 1))
    begin[:, 0, 0], far_ends[:, 0] = offsets[:, 0], 0
    above = back[:, :, parents]
    above[:, :, 0] = np.eye(3)
    at_rest = along(above[:, :, None], own)
    shifts = at_rest.copy()
    shifts[:, :, 0] = np.eye(3)
    (axes, moved, columns), turning = _columns(bones)

    def translations(values):
        steps = np.zeros((3, len(bones), len(values)))
        steps[axes, moved] = values[:, columns].T
        return along(shifts[..., None], steps) + begin

    return Tree(parents, turning, degrees, at_rest, far_ends), translations


def _own_axes(bones, degrees):
    """C (3, 3, n_bones)."""
    axes = np.repeat(np.eye(3)[:, :, None], len(bones), axis=2)
    orders = {}
    for j, bone in enumerate(bones):
        orders.setdefault(bone.axis_order, []).append(j)
    for order, members in orders.items():
        angles = np.array([bones[j].axis for j in members]).T
        turned = axes[:, :, members]
        # Axes that stay where they are turn as those that turn along, the last first.
        turn(turned, order[::-1].upper(), np.radians(angles[::-1]) if degrees else angles[::-1])
        axes[:, :, members] = turned
    return axes


def _columns(bones):
    """Axes, joints and columns of the translations (3, n), and the turns by their axes.

    Degrees of freedom act in the order in which they are named, about axes that stay.
    """
    moving, turning, column = [], {}, 0
    for j, bone in enumerate(bones):
        order, columns = "", []
        for kind, axis in bone.dofs:
            if kind == "t":
                moving.append(("xyz".index(axis), j, column))
            else:
                order += axis.upper()
                columns.append(column)
            column += 1
        if order:
            turning.setdefault(order[::-1], []).append((j, columns[::-1]))
    return np.array(moving, dtype=int).reshape(-1, 3).T, turning
