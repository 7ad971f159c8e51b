"""A parser of plain NumPy, which shares no code with `read_motion`.

It believes every file: no checks, no messages, no encodings, no gaps.
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
