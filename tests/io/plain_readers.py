"""Parsers of a page of plain NumPy, which share no code with `read_motion`.

They believe every file: no checks, no messages, no encodings, no gaps.
"""

import numpy as np


def plain_bvh(path):
    """Positions (n_frames, n_joints, 3) of a BVH file."""
    words = path.read_text().split()
    motion = words.index("MOTION")
    values = np.array(words[motion + 6 :], float).reshape(int(words[motion + 2]), -1).T
    columns = iter(values)
    worlds, positions, stack, i = [], [], [], 1
    while i < motion:
        if words[i] == "OFFSET":
            offset = [float(word) for word in words[i + 1 : i + 4]]
            turn = np.broadcast_to(np.eye(3), (values.shape[1], 3, 3))
            if words[i + 4] == "CHANNELS":
                for channel in words[i + 6 : i + 6 + int(words[i + 5])]:
                    if channel.endswith("position"):
                        offset["XYZ".index(channel[0])] = next(columns)
                    else:
                        turn = turn @ rotation(channel[0], np.radians(next(columns)))
            offset = np.stack(np.broadcast_arrays(*offset, values[0])[:3], axis=-1)
            if len(stack) > 1:
                above = stack[-2]
                offset = positions[above] + (worlds[above] @ offset[:, :, None])[:, :, 0]
                turn = worlds[above] @ turn
            positions.append(offset)
            worlds.append(turn)
        elif words[i] == "{":
            stack.append(len(positions))
        elif words[i] == "}":
            stack.pop()
        i += 1
    return np.stack(positions, axis=1)


def rotation(axis, angles):
    """Rotation matrices (n_frames, 3, 3) about one axis."""
    c, s = np.cos(angles), np.sin(angles)
    matrices = np.zeros((len(angles), 3, 3))
    i, j, k = {"X": (0, 1, 2), "Y": (1, 2, 0), "Z": (2, 0, 1)}[axis.upper()]
    matrices[:, i, i] = 1
    matrices[:, j, j] = matrices[:, k, k] = c
    matrices[:, j, k], matrices[:, k, j] = -s, s
    return matrices


def plain_amc(path):
    """Positions (n_frames, n_bones, 3) of an AMC file, in metres; its skeleton is beside it."""
    skeletons = [p for p in path.parent.glob("*.asf") if path.name.startswith(p.stem)]
    bones, parents, unit = plain_asf(max(skeletons, key=lambda p: len(p.stem)))
    values = {name: [] for name in bones}
    for line in path.read_text(encoding="latin-1").splitlines():
        name, *rest = line.split()
        if name in values:
            values[name].append(np.array(rest, float))
    n_frames = len(values["root"])
    worlds, positions = {}, {}
    for name, bone in bones.items():
        turn, offset = np.eye(3), np.zeros((n_frames, 3))
        for dof, column in zip(bone["dof"], np.array(values[name]).T, strict=False):
            if dof[0] == "t":
                offset[:, "xyz".index(dof[1])] = column
            else:
                turn = rotation(dof[1], np.radians(column)) @ turn
        own = np.eye(3)
        for axis, angle in zip("xyz", bone["axis"], strict=True):
            own = rotation(axis, np.radians(np.array([angle])))[0] @ own
        if name == "root":
            worlds[name], positions[name] = own @ turn, offset
            continue
        above = parents[name]
        worlds[name] = worlds[above] @ (own @ turn @ own.T)
        positions[name] = positions[above] + worlds[name] @ bone["offset"]
    order = ["root", *parents]
    return np.stack([positions[name] for name in order], axis=1) * 0.0254 / unit


def plain_asf(path):
    """Bones and parents by name, and the unit of length."""
    bones = {"root": {"axis": [0.0, 0.0, 0.0], "dof": [], "offset": np.zeros(3)}}
    parents, bone, unit, in_hierarchy = {}, {}, 1.0, False
    for line in path.read_text(encoding="latin-1").splitlines():
        key, *words = line.split() or [""]
        in_hierarchy |= key == ":hierarchy"
        if in_hierarchy:
            parents |= dict.fromkeys(words, key) if key in bones else {}
        elif key == "order":
            bones["root"]["dof"] = [word.lower() for word in words]
        elif key == "begin":
            bone = {"dof": []}
        elif key == "name":
            bones[words[0]] = bone
        elif key in ("direction", "axis") and bone:
            bone[key] = [float(word) for word in words[:3]]
        elif key == "dof":
            bone["dof"] = words
        elif key == "length" and bone:
            bone["offset"] = float(words[0]) * np.array(bone["direction"])
        elif key == "length":
            unit = float(words[0])
    return {name: bones[name] for name in ["root", *parents]}, parents, unit


PLAIN = {".bvh": plain_bvh, ".amc": plain_amc}
