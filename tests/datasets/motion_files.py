"""Small files of motion capture, and what they must be read as."""

import struct

import numpy as np


def turn(axis, degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    matrix = np.eye(4)
    i, j = {"X": (1, 2), "Y": (2, 0), "Z": (0, 1)}[axis]
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def bvh_oracle(text):
    """Positions by name, one (n_frames, 3) array each."""
    words = text.split()
    at = words.index("MOTION")
    n_frames = int(words[at + 2])
    numbers = list(map(float, words[at + 6 :]))
    per_frame = len(numbers) // n_frames
    result = {}
    for frame in range(n_frames):
        values = iter(numbers[frame * per_frame : (frame + 1) * per_frame])
        worlds, names, i = [np.eye(4)], [], 1
        while i < at:
            word = words[i]
            if word in ("ROOT", "JOINT"):
                names.append(words[i + 1])
                i += 3
            elif word == "End":
                names.append(names[-1] + "_end")
                i += 3
            elif word == "OFFSET":
                offset = list(map(float, words[i + 1 : i + 4]))
                rotation = np.eye(4)
                i += 4
                if words[i] == "CHANNELS":
                    for channel in words[i + 2 : i + 2 + int(words[i + 1])]:
                        if channel.endswith("position"):
                            offset["XYZ".index(channel[0])] = next(values)
                        else:
                            rotation = rotation @ turn(channel[0], next(values))
                    i += 2 + int(words[i + 1])
                local = np.eye(4)
                local[:3, 3] = offset
                worlds.append(worlds[-1] @ local @ rotation)
                result.setdefault(names[-1], []).append(worlds[-1][:3, 3])
            else:
                worlds.pop()
                names.pop()
                i += 1
    return {name: np.array(track) for name, track in result.items()}


BODY = """HIERARCHY
ROOT hips
{{
  OFFSET 1 2 3
  CHANNELS 6 Xposition Yposition Zposition {a}rotation {b}rotation {c}rotation
  JOINT spine
  {{
    OFFSET 0.5 10 0.25
    CHANNELS 4 {c}rotation Yposition {a}rotation {b}rotation
    JOINT neck
    {{
      OFFSET 1 5 -2
      CHANNELS 1 {b}rotation
      End Site
      {{
        OFFSET 0 3 1
      }}
    }}
  }}
  JOINT leg
  {{
    OFFSET 2 -10 0
    JOINT foot
    {{
      OFFSET 0 -9 3
      CHANNELS 2 {b}rotation {a}rotation
    }}
  }}
}}
MOTION
Frames: 3
Frame Time: 0.02
"""


def body(order="ZXY"):
    numbers = np.random.default_rng(0).uniform(-170, 170, (3, 13)).round(3)
    rows = "\n".join(" ".join(map(str, row)) for row in numbers)
    return BODY.format(a=order[0], b=order[1], c=order[2]) + rows + "\n"


def put(folder, text, name="a.bvh"):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode("latin-1"))
    return path


def joint(df, name):
    return df[[f"{name}_{axis}" for axis in "xyz"]].to_numpy()


ASF = """# a comment in any encoding: \xfc
:version 1.10
:units
  mass 1.0
  length 0.5
  angle deg
:documentation
  begin whatever
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name thigh
    direction 0 -1 0
    length 4
    axis 0 0 90 XYZ
    dof rx rz
    limits (-10 10)
           (-20 20)
  end
  begin
    id 2
    name shin
    direction 0 -1 0
    length 3
    axis 0 0 0 XYZ
  end
:hierarchy
  begin
    root thigh
    thigh shin
  end
"""


AMC = """#!OML:ASF
:FULLY-SPECIFIED
:DEGREES
1
root 1 2 3 0 0 0
thigh 0 0
2
root 1 2 3 0 90 0
thigh 90 0
"""


def dec(value):
    """A number as DEC machines wrote it, for numbers that are not tiny."""
    low, high = struct.unpack("<HH", struct.pack("<f", value * 4))
    return struct.pack("<HH", high, low) if value else bytes(4)


def c3d(positions, machine=84, real=True, changes=None, header=None, tail=b""):
    """A C3D file of positions (n_frames, n_points, 3); NaN is invalid."""
    n_frames, n_points = positions.shape[:2]
    order = ">" if machine == 86 else "<"

    def number(value):
        return dec(value) if machine == 85 else struct.pack(order + "f", value)

    def whole(*values):
        return struct.pack(f"{order}{len(values)}H", *values)

    scale = -1.0 if real else 0.5
    names = [f"M{i}" for i in range(n_points)]
    parameters = {
        "USED": (2, [], whole(n_points)),
        "FRAMES": (2, [], whole(min(n_frames, 65535))),
        "SCALE": (4, [], number(scale)),
        "RATE": (4, [], number(50.0)),
        "DATA_START": (2, [], whole(4)),
        "LABELS": (-1, [4, n_points], "".join(n.ljust(4) for n in names).encode()),
        "UNITS": (-1, [4], b"mm  "),
        "Y_SCREEN": (-1, [2], b"+Z"),
    } | (changes or {})
    section = bytes([1, 0x50, 2, machine])
    section += bytes([5, 255]) + b"POINT" + whole(3) + b"\0"
    for name, content in parameters.items():
        if content is not None:
            size, dimensions, values = content
            block = struct.pack("bB", size, len(dimensions)) + bytes(dimensions) + values + b"\0"
            section += bytes([len(name), 1]) + name.encode() + whole(len(block) + 2) + block
    section += bytes(2)
    fields = {"points": n_points, "analog": 0, "first": 1, "last": min(n_frames, 65535), "start": 4}
    fields |= header or {}
    head = bytes([2, 0x50]) + whole(*(fields[k] for k in ("points", "analog", "first", "last")))
    head += whole(10) + number(scale) + whole(fields["start"], 0) + number(50.0)
    data = b""
    for point in positions.reshape(-1, 3):
        seen = not np.isnan(point).any()
        values = [*(point if seen else (0.0, 0.0, 0.0)), 0.0 if seen else -1.0]
        if real:
            data += b"".join(map(number, values))
        else:
            values[:3] = [value / scale for value in values[:3]]
            data += struct.pack(order + "4h", *map(round, values))
    data += bytes(-len(data) % 512)
    return head.ljust(512, b"\0") + section.ljust(1024, b"\0") + data + tail


def tracks(n_frames=40, gap=None):
    positions = np.random.default_rng(0).integers(-900, 900, (n_frames, 3, 3)) / 2
    if gap:
        positions[slice(*gap), 1] = np.nan
    return positions
