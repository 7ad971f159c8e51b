"""`read_motion` against parsers of a page of plain NumPy, for docs/speed.md.

The plain ones believe every file: no checks, no messages, no encodings, no gaps. Both give the same
positions, which is checked first; then they run in turns. Beside the files given, two BVH
files of 31 joints are written, of 200 and of 20,000 frames.

    python benchmarks/readers.py ../shared/data/original_files/*/*.*
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import statistics
import tempfile
import time
from pathlib import Path

import numpy as np
from sklearn_motionsync.io import read_motion

# -- the plain parsers ------------------------------------------------------------------


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

# -- files ------------------------------------------------------------------------------

# The parents of a body of 31 joints: legs, trunk and head, arms with fingers.
BODY = [-1, 0, 1, 2, 3, 4, 0, 6, 7, 8, 9, 0, 11, 12, 13, 14, 15]
BODY += [13, 17, 18, 19, 20, 21, 20, 13, 24, 25, 26, 27, 28, 27]


def write_bvh(path, n_frames, seed=0):
    """A file of the body, with channels as most programs write them."""
    rng = np.random.default_rng(seed)
    lines, open_joints = ["HIERARCHY"], []
    for j, parent in enumerate(BODY):
        while open_joints and open_joints[-1] != parent:
            lines += close(open_joints.pop(), j)
        offset = " ".join(f"{x:.6f}" for x in rng.uniform(-20, 20, 3))
        position = "Xposition Yposition Zposition " * (parent < 0)
        lines += [f"{'JOINT' if open_joints else 'ROOT'} joint_{j}", "{", f"OFFSET {offset}"]
        lines += [f"CHANNELS {3 + 3 * (parent < 0)} {position}Zrotation Xrotation Yrotation"]
        open_joints.append(j)
    while open_joints:
        lines += close(open_joints.pop(), len(BODY))
    lines += ["MOTION", f"Frames: {n_frames}", "Frame Time: 0.008333"]
    walks = np.cumsum(rng.standard_normal((n_frames, 3 + 3 * len(BODY))), axis=0)
    lines += [" ".join([f"{x:.6f}" for x in row]) for row in (walks + 180) % 360 - 180]
    path.write_text("\n".join(lines) + "\n")


def close(j, n_before):
    """The lines that end joint j, with an End Site where no joint follows in it."""
    is_leaf = j not in BODY[:n_before]
    return ["End Site", "{", "OFFSET 0.0 5.0 0.0", "}", "}"] if is_leaf else ["}"]


# -- the table --------------------------------------------------------------------------


def compare(path, rounds):
    """Milliseconds of both, median of the ratios with quartiles, and the largest difference."""
    plain = PLAIN[path.suffix.lower()]
    expected = plain(path)
    ours = read_motion(path).to_numpy().reshape(expected.shape)
    difference = np.abs(ours - expected).max() / np.abs(expected).max()
    assert difference < 1e-12, f"{path}: positions differ by {difference:.1e}"
    times = []
    for _ in range(rounds):
        times.append([])
        for function in (read_motion, plain):
            start = time.process_time()
            function(path)
            times[-1].append(1e3 * (time.process_time() - start))
    ratios = statistics.quantiles([a / b for a, b in times], n=4)
    return *map(statistics.median, zip(*times, strict=True)), ratios, expected.shape


def against_loadtxt(path, rounds):
    """The time of `read_motion` by that of `numpy.loadtxt` on the numbers alone, medians."""
    n_before = path.read_bytes().partition(b"Frame Time")[0].count(b"\n") + 1
    ratios = []
    for _ in range(rounds):
        start = time.process_time()
        read_motion(path)
        middle = time.process_time()
        np.loadtxt(path, skiprows=n_before)
        ratios.append((middle - start) / (time.process_time() - middle))
    return statistics.median(ratios)


def main():
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--rounds", type=int, default=15)
    args = parser.parse_args()
    files = [path for path in args.files if path.suffix.lower() in PLAIN]
    print("| file | frames x joints | `read_motion`, ms | plain NumPy, ms | ratio |")
    print("|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for n_frames in (200, 20_000):
            files.append(Path(folder) / f"made_{n_frames}.bvh")
            write_bvh(files[-1], n_frames)
        for path in files:
            ours, plain, (low, ratio, high), shape = compare(path, args.rounds)
            size = f"{shape[0]} x {shape[1]}"
            print(
                f"| {path.name} | {size} | {ours:.1f} | {plain:.1f} | "
                f"{ratio:.2f} ({low:.2f} to {high:.2f}) |",
                flush=True,
            )
        path = Path(folder) / "made_20000.bvh"
        ratio = against_loadtxt(path, args.rounds)
        print(f"\n{path.name}: {ratio:.2f} of the time of numpy.loadtxt")


if __name__ == "__main__":
    main()
