"""Small files of motion capture."""

import io
import itertools
import json
import struct

import numpy as np

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
    path.parent.mkdir(exist_ok=True)
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


def texts(*words):
    """A parameter of texts."""
    width = max(map(len, words))
    return -1, [width, len(words)], "".join(word.ljust(width) for word in words).encode()


def floats(*values):
    """A parameter of floats."""
    return 4, [len(values)], struct.pack(f"<{len(values)}f", *values)


def words(*values):
    """A parameter of integers of 16 bits."""
    return 2, [len(values)], struct.pack(f"<{len(values)}H", *(v % 65536 for v in values))


def c3d(
    positions,
    machine=84,
    real=True,
    changes=None,
    header=None,
    tail=b"",
    others=None,
    analog=None,
    words=None,
    order=None,
    rotations=None,
):
    """A C3D file of positions (n_frames, n_points, 3); NaN is invalid.

    `others` are groups of parameters beside POINT, `analog` raw values (n_frames, samples,
    channels), `words` the fourth numbers of the points, `order` that of integers, `rotations`
    (n_frames, n_segments, 17) what follows the points.
    """
    n_frames, n_points = positions.shape[:2]
    float_order = ">" if machine == 86 else "<"
    order = order or float_order

    def number(value):
        return dec(value) if machine == 85 else struct.pack(float_order + "f", value)

    def whole(*values):
        return struct.pack(f"{order}{len(values)}H", *values)

    scale = -1.0 if real else 0.5
    analog = np.zeros((n_frames, 1, 0)) if analog is None else analog
    point = {
        "USED": (2, [], whole(n_points)),
        "FRAMES": (2, [], whole(min(n_frames, 65535))),
        "SCALE": (4, [], number(scale)),
        "RATE": (4, [], number(50.0)),
        "DATA_START": (2, [], whole(4)),
        "LABELS": texts(*(f"M{i}".ljust(4) for i in range(n_points))) if n_points else None,
        "UNITS": (-1, [4], b"mm  "),
        "Y_SCREEN": (-1, [2], b"+Z"),
    } | (changes or {})

    n_data = n_frames * (4 * n_points + analog[0].size if n_frames else 0) * (4 if real else 2)

    def written(start):
        if point["DATA_START"] is not None:
            point["DATA_START"] = (2, [], whole(start))
        if rotations is not None:
            others["ROTATION"]["DATA_START"] = (2, [], whole(start + -(-n_data // 512)))
        section = b""
        for number, (group, members) in enumerate(({"POINT": point} | (others or {})).items(), 1):
            section += bytes([len(group), 256 - number]) + group.encode() + whole(3) + b"\0"
            for name, content in members.items():
                if content is not None:
                    size, dimensions, values = content
                    block = struct.pack("bB", size, len(dimensions)) + bytes(dimensions) + values
                    section += bytes([len(name), number]) + name.encode()
                    section += whole(len(block) + 3) + block + b"\0"
        return section + bytes(2)

    needed = max(2, -(-(4 + len(written(4))) // 512))
    section = bytes([1, 0x50, needed, machine]) + written(2 + needed)
    fields = {"points": n_points, "analog": analog[0].size if n_frames else 0, "first": 1}
    fields |= {"last": min(n_frames, 65535), "start": 2 + needed} | (header or {})
    head = bytes([2, 0x50]) + whole(*(fields[k] for k in ("points", "analog", "first", "last")))
    head += whole(10) + number(scale) + whole(fields["start"], analog.shape[1]) + number(50.0)
    if "events" in fields:
        events = fields["events"]
        head = head.ljust(298, b"\0") + whole(12345, len(events), 0)
        head += b"".join(number(time) for _, time in events)
        head = head.ljust(396, b"\0") + b"".join(label.ljust(4).encode() for label, _ in events)
    seen = ~np.isnan(positions).any(axis=2)
    words = np.where(seen, 0.0, -1.0) if words is None else words
    places = np.where(seen[..., np.newaxis], positions, 0.0) / (1 if real else scale)
    points = np.concatenate([places, words[..., np.newaxis]], axis=2)
    data = b""
    for frame, samples in zip(points, analog, strict=True):
        values = [*frame.ravel(), *samples.ravel()]
        integers = (round(x) % 65536 for x in values)
        data += b"".join(map(number, values)) if real else whole(*integers)
    data += bytes(-len(data) % 512)
    if rotations is not None:
        data += b"".join(map(number, rotations.ravel()))
    data += bytes(-len(data) % 512)
    return head.ljust(512, b"\0") + section.ljust(512 * needed, b"\0") + data + tail


def poses(n_frames=40):
    """Matrices of two segments, column by column, and their reliability, of which 0 is good."""
    rng = np.random.default_rng(1)
    matrices = np.zeros((n_frames, 2, 4, 4))
    matrices[..., :3, :3] = rng.integers(-9, 9, (n_frames, 2, 3, 3))
    matrices[..., :3, 3] = rng.integers(-900, 900, (n_frames, 2, 3)) / 2
    matrices[..., 3, 3] = 1
    columns = matrices.swapaxes(2, 3).reshape(n_frames, 2, 16)
    return np.concatenate([columns, np.zeros((n_frames, 2, 1))], axis=2)


def rotation_parameters(**changes):
    labels = texts("pelvis_4X4", "l_thigh_4X4")
    return {"USED": words(2), "LABELS": labels, "DATA_START": None} | changes


def analog_parameters(n=3, **changes):
    return {
        "USED": words(n),
        "LABELS": texts("Fx", "EMG"),
        "LABELS2": texts("EMG"),
        "UNITS": texts("N", "V"),
        "SCALE": floats(0.5, 2, -1),
        "OFFSET": words(10, -20, 0),
        "GEN_SCALE": floats(0.25),
    } | changes


def event_parameters(**changes):
    return {
        "USED": words(3),
        "LABELS": texts("Foot Off", "Foot Strike", "Turn"),
        "CONTEXTS": texts("Left", "Right"),
        "TIMES": floats(0, 2.5, 0, 2.2, 1, 0.5),
    } | changes


def tracks(n_frames=40, gap=None):
    positions = np.random.default_rng(0).integers(-900, 900, (n_frames, 3, 3)) / 2
    if gap:
        positions[slice(*gap), 1] = np.nan
    return positions


def everything():
    """What a C3D file may hold beside markers, for `c3d`."""
    return {
        "positions": tracks(gap=(3, 9)),
        "analog": np.random.default_rng(0).integers(-900, 900, (40, 2, 3)),
        "changes": {"ANGLES": texts("M2"), "ANGLE_UNITS": texts("deg")},
        "others": {
            "EVENT": event_parameters(),
            "ANALOG": analog_parameters(),
            "ROTATION": rotation_parameters(),
        },
        "rotations": poses(),
        "header": {"first": 101, "last": 140, "events": [("RHS", 0.5), ("RTO", 0.1)]},
    }


def trc(positions, names, rate=50, times=None, units="mm", blank="", digits=3, **header):
    """A TRC file of positions (n_frames, n_markers, 3); NaN is `blank`."""
    n_frames, n_markers = positions.shape[:2]
    times = np.arange(n_frames) / rate if times is None else times
    rates = dict.fromkeys(["DataRate", "CameraRate"], f"{rate:.2f}")
    counts = {"NumFrames": n_frames, "NumMarkers": n_markers, "Units": units}
    original = {"OrigDataRate": f"{rate:.2f}", "OrigDataStartFrame": 1, "OrigNumFrames": n_frames}
    header = rates | counts | original | header
    lines = ["PathFileType\t4\t(X/Y/Z)\ttrial.trc", "\t".join(header)]
    lines += ["\t".join(map(str, header.values()))]
    lines += ["Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t"]
    lines += ["\t\t" + "\t".join(f"{axis}{i + 1}" for i in range(n_markers) for axis in "XYZ"), ""]
    for number, (time, frame) in enumerate(zip(times, positions, strict=True), 1):
        numbers = [blank if np.isnan(x) else str(x) for x in frame.ravel()]
        lines.append("\t".join([str(number), f"{time:.{digits}f}", *numbers]))
    return "\n".join(lines) + "\n"


def storage(values, labels, rate=100, times=None, header="version=1\nnRows={n}\nnColumns={m}\n"):
    """A MOT or STO file of values (n_frames, n_columns)."""
    times = np.arange(len(values)) / rate if times is None else times
    text = "Coordinates\n" + header.format(n=len(values), m=1 + len(labels)) + "endheader\n"
    text += "\t".join(["time", *labels]) + "\n"
    for time, row in zip(times, values, strict=True):
        text += "\t".join([f"{time:.8f}", *(str(value) for value in row)]) + "\n"
    return text


def cells(*rows, separator=","):
    """Rows of text, of lists of cells or of arrays of numbers; NaN is a blank cell."""
    lines = []
    for row in rows:
        many = np.ndim(row) == 2
        for each in row if many else [row]:
            texts = ["" if isinstance(x, float) and np.isnan(x) else str(x) for x in each]
            lines.append(separator.join(texts))
    return "\n".join(lines) + "\n"


def vicon(title, rate, names, values, axes="XYZ", units="mm", first=1, per_frame=1, separator=","):
    """A section of a CSV of Vicon Nexus, of values (n_rows, n_names * n_axes)."""
    n = np.arange(len(values))
    rows = [[first + k // per_frame, k % per_frame, *map(float, values[k])] for k in n]
    spread = [x for name in names for x in [name, *[""] * (len(axes) - 1)]]
    units = [units] * len(spread) if isinstance(units, str) else units
    head = [["", "", *spread], ["Frame", "Sub Frame", *[*axes] * len(names)], ["", "", *units]]
    return cells([title], [rate], *head, *rows, separator=separator)


def qtm(names, values, columns=True, header=(), rate=100, contents="3D"):
    """A TSV of QTM of values (n_frames, n_columns)."""
    noun = "BODY" if contents == "6D" else "MARKER"
    of = "BODIES" if contents == "6D" else "MARKERS"
    head = {"NO_OF_FRAMES": len(values), "NO_OF_CAMERAS": 8, f"NO_OF_{of}": len(names)}
    head |= {"FREQUENCY": rate, "NO_OF_ANALOG": 0, "DESCRIPTION": "--", "DATA_INCLUDED": contents}
    rows = [[key, value] for key, value in (head | dict(header)).items()]
    rows += [[f"{noun}_NAMES", *names]]
    if columns:
        rows += [["Frame", "Time", *(f"{name} {axis}" for name in names for axis in "XYZ")]]
    for k, each in enumerate(values):
        rows.append([*([k + 1, f"{k / rate:.5f}"] if columns else []), *map(float, each)])
    return cells(*rows, separator="\t")


def motive(columns, values, rate=120, parents=None, first=0, **facts):
    """A CSV of Motive of values (n_frames, n_columns), by (type, name, id, what, axis) of each."""
    facts = {"Format Version": "1.23", "Take Name": "T", "Capture Frame Rate": 2 * rate} | {
        "Export Frame Rate": f"{rate:.6f}", "Total Exported Frames": len(values),
        "Length Units": "Meters", "Coordinate Space": "Global",
    } | facts  # fmt: skip
    kinds, names, ids, what, axes = zip(*columns, strict=True)
    rows = [[x for fact in facts.items() for x in fact], [], ["", "Type", *kinds]]
    rows += [["", "Name", *names], ["", "ID", *(f'"{x}"' for x in ids)]]
    rows += [["", "Parent", *(f'"{x}"' for x in parents)]] if parents else []
    rows += [["", "", *what], ["Frame", "Time (Seconds)", *axes]]
    for k, each in enumerate(values, first):
        rows.append([k, f"{k / rate:.6f}", *map(float, each)])
    return cells(*rows)


def part(kind, name, mark, turns=True):
    """The columns of a bone, a rigid body or a marker in a CSV of Motive."""
    rotation = [(kind, name, mark, "Rotation", axis) for axis in "XYZW"] if turns else []
    return rotation + [(kind, name, mark, "Position", axis) for axis in "XYZ"]


def nexus():
    """A CSV of Vicon Nexus with events, model outputs, trajectories and devices."""
    rng, columns = np.random.default_rng(0), ["Ann:LKneeAngles", "Ann:LHipMoment"]
    events = cells(
        ["Events"], [100], ["Subject", "Context", "Name", "Time (s)", "Description"],
        ["Ann", "Right", "Foot Strike", 1.23, "heel"], ["Ann", "Left", "Foot Off", 1.1, "x"], [""],
        ["Gait Cycle Parameters"], ["Subject", "Context", "Name", "Value", "Units"],
        ["Ann", "Left", "Cadence", 110, "steps/min"],
    )  # fmt: skip
    values = rng.integers(-900, 900, (3, 20, 6)) / 8
    units = ["deg"] * 3 + ["N.mm/kg"] * 3
    outputs = vicon("Model Outputs", 100, columns, values[0], units=units, first=101)
    markers = vicon("Trajectories", 100, ["Ann:LASI", "Ann:RASI"], values[1], first=101)
    forces = rng.integers(-900, 900, (80, 2)) / 8
    devices = vicon("Devices", 400, ["Plate 1 - Force"], forces, ["Fx", "EMG"], ["N", "V"], 101, 4)
    return "\n".join([events, outputs, markers, devices]), values, forces


def table(columns, rows, separator=","):
    return cells(columns, *rows, separator=separator)


def deeplabcut(tracked, joints, animals=None):
    """A CSV file of DeepLabCut of x, y and likelihood (n_frames, n_columns, 3)."""
    names = [name for _ in animals or [0] for name in joints for _ in range(3)]
    header = [["scorer"] + ["net"] * len(names), ["bodyparts", *names]]
    if animals:
        header.insert(1, ["individuals", *np.repeat(animals, 3 * len(joints))])
    header.append(["coords"] + ["x", "y", "likelihood"] * (len(names) // 3))
    rows = [[k, *frame.ravel().tolist()] for k, frame in enumerate(tracked)]
    return table(header[0], header[1:] + rows)


def sleap(tracked, tracks, joints, start=0):
    """A CSV file of SLEAP of x, y and score (n_frames, n_tracks, n_joints, 3)."""
    columns = [f"{joint}.{tail}" for joint in joints for tail in ("x", "y", "score")]
    rows = [
        [track, start + k, 0.9, *frame[i].ravel().tolist()]
        for k, frame in enumerate(tracked)
        for i, track in enumerate(tracks)
    ]
    return table(["track", "frame_idx", "instance.score", *columns], rows)


def openpose(frames, name="a/a_{:012d}_keypoints.json", first=0):
    """The files of a folder of OpenPose: for each frame a list of people (n_joints, 3)."""
    files = {}
    for number, people in enumerate(frames, first):
        found = [{"person_id": [-1], "pose_keypoints_2d": x.ravel().tolist()} for x in people]
        files[name.format(number)] = json.dumps({"version": 1.3, "people": found}).encode()
    return files


def npy(array):
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def tracked(*shape):
    """Positions in pixels and, last, a confidence between 0.5 and 1."""
    numbers = np.random.default_rng(0).integers(20, 900, shape) / 4
    numbers[..., -1] = 0.5 + numbers[..., -1] / 900
    return numbers


def landmarks(n_frames=6):
    columns = [f"{a}{k}" for k in range(33) for a in "xyzv"]
    rows = tracked(n_frames, 33, 4).reshape(n_frames, -1)
    times = [[k, 20 * k] for k in range(n_frames)]
    return table(["frame", "timestamp_ms", *columns], np.hstack([times, rows]).tolist())


def mvnx(positions, angles=None, rate=60, times=None, label="Suit 1", head="", more=""):
    """An MVNX file of segments in a row; positions and angles (n_frames, n, 3) of frames."""
    n = positions.shape[1]
    names = ["Pelvis", "L5", "L3", "T12"][:n]
    times = [round(1000 * k / rate) for k in range(len(positions))] if times is None else times
    zeros = " ".join("0" * 3 * n)

    def frame(kind, of, numbers):
        inside = "".join(f"<{k}>{' '.join(map(str, v))}</{k}>\n" for k, v in numbers.items())
        time = "" if of is None else f' time="{of}"'
        return f'<frame{time} index="0" type="{kind}">\n{inside}</frame>\n'

    joints = "".join(
        f'<joint label="j{b}"><connector1>{a}/j{b}</connector1>\n'
        f"<connector2>{b}/j{b}</connector2></joint>\n"
        for a, b in itertools.pairwise(names)
    )
    text = f'''<?xml version="1.0" encoding="UTF-8"?>\n{head}
<mvnx xmlns="http://www.xsens.com/mvn/mvnx" version="4">
<subject label="{label}" frameRate="{rate}" segmentCount="{n}">
<segments>'''
    text += "".join(f'<segment label="{name}"><points/></segment>\n' for name in names)
    text += f"</segments>\n<joints>\n{joints}</joints>\n<frames>\n"
    text += "".join(frame(kind, 0, {"position": [zeros]}) for kind in ("identity", "tpose"))
    for i, (time, x) in enumerate(zip(times, positions, strict=True)):
        of_joints = {} if angles is None else {"jointAngle": angles[i].ravel()}
        text += frame("normal", time, {"orientation": [1], "position": x.ravel()} | of_joints)
    return text + f"</frames>\n{more}</subject>\n</mvnx>\n"


VECTORS, VEC3 = [["1,2,3", "~[4,5,6]"]] * 20, "DataType=Vec3\nDataRate=100\n"
# For each format a function that returns the files of a small example, {name: bytes}, the first of
# which is read, or its folder for a file of JSON.
EXAMPLES = {
    "bvh": lambda: {"a.bvh": body().encode()},
    "amc": lambda: {"a.amc": AMC.encode(), "a.asf": ASF.encode("latin-1")},
    "c3d": lambda: {"a.c3d": c3d(**everything())},
    "trc": lambda: {"a.trc": trc(tracks(gap=(3, 9)), ["LASI", "R Knee", "V_Sacral"]).encode()},
    "mot": lambda: {"a.mot": storage([[1.5, -2], [2, 0]] * 9, ["knee", "force_vx"]).encode()},
    "sto": lambda: {"a.sto": storage(VECTORS, ["pelvis", "torso"], header=VEC3).encode()},
    "mvnx": lambda: {"a.mvnx": mvnx(tracks(), tracks()[:, :2]).encode()},
    "vicon": lambda: {"a.csv": nexus()[0].encode()},
    "qtm": lambda: {
        "a.tsv": qtm(
            ["LASI", "R Knee"],
            tracks()[:, :2].reshape(40, 6),
            header={"EVENT": "Step\t11\t0.10000", "TIME_STAMP": "2026-01-19, 10:19:43.755\t20.5"},
        ).encode()
    },
    "motive": lambda: {
        "a.csv": motive(
            part("Bone", "S:Hip", 1)
            + part("Bone", "S:LThigh", 2)
            + part("Marker", "S:HTop", 3, False),
            np.random.default_rng(0).integers(-9, 9, (20, 17)) / 8,
            parents=[0] * 7 + [1] * 7 + [""] * 3,
        ).encode()
    },
    "sleap": lambda: {"a.csv": sleap(tracked(9, 1, 2, 3), ["ann"], ["hip", "knee"]).encode()},
    "deeplabcut": lambda: {
        "a.csv": deeplabcut(tracked(9, 2, 3), ["hip", "knee"], ["ann"]).encode()
    },
    "openpose": lambda: openpose([tracked(1, 25, 3), tracked(1, 25, 3) + 1]),
    "mediapipe": lambda: {"a.csv": landmarks().encode()},
    "array": lambda: {"a.npy": npy(tracked(9, 4, 3))},
    "table": lambda: {
        "a.csv": table(
            ["Time", "HipLeft X", "HipLeft Y", "HipLeft Z", "HipLeft State"],
            [[k / 50, *row, "Tracked"] for k, row in enumerate(tracked(9, 3).tolist())],
        ).encode()
    },
}
