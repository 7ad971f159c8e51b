"""The journeys of docs/howto/journeys.md: from files to what is saved, in ten lines at most."""

import re
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from sklearn_motionsync import Match, Skeleton
from sklearn_motionsync.datasets import make_bending, make_walk
from sklearn_motionsync.display import SkeletonDisplay
from sklearn_motionsync.io import write_motion

from motion_files import c3d, floats, put, storage, texts, words

HOWTO = Path(__file__).resolve().parents[2] / "docs" / "howto"
PAGE = (HOWTO / "journeys.md").read_text("utf-8")
BLOCK = re.compile(r"^```python\n(.*?)^```\n", re.MULTILINE | re.DOTALL)
SECTIONS = {part.split("\n")[0]: BLOCK.findall(part) for part in PAGE.split("\n## ")[1:]}
BLOCKS = [(title, k) for title, blocks in SECTIONS.items() for k in range(len(blocks))]
TRIALS = [("ann", 1), ("ann", 2), ("ben", 1), ("ben", 2), ("cas", 1)]


def test_every_section_but_what_is_refused_has_a_journey():
    *titles, last = SECTIONS
    assert len(titles) == 12
    assert all(SECTIONS[title] for title in titles)
    assert last == "What is refused"
    assert PAGE.count("```python") == len(BLOCKS) == 15


@pytest.mark.parametrize(("title", "k"), BLOCKS)
def test_journey_is_short_and_uses_public_names(title, k):
    code = SECTIONS[title][k]
    lines = [line for line in code.split("\n") if line.strip()]
    assert len(lines) <= 10
    assert max(map(len, lines)) <= 100
    assert not re.search(r"(?<![\w\"'^\]|])_\w|\._|reshape|newaxis|transpose|swapaxes|\.T\b", code)


def go(title, folder, monkeypatch, k=0):
    """Run a block in the folder of its files; what it leaves in memory."""
    monkeypatch.chdir(folder)
    left = {}
    exec(SECTIONS[title][k], left)
    return left


# -- what is in the files: written here, known here ----------------------------------------------


@pytest.fixture(scope="module")
def curves():
    """Hip and knee of each trial, at a pace and of a length of its own."""
    rng = np.random.default_rng(0)
    found = {}
    for key, n_frames in zip(TRIALS, (80, 95, 102, 88, 91), strict=True):
        t = np.linspace(0, 1, n_frames) ** rng.uniform(0.8, 1.25)
        bend = rng.normal(60, 4) * np.exp(-(((t - 0.6) / 0.12) ** 2))
        found[key] = pd.DataFrame({"hip": 30 * np.cos(2 * np.pi * t), "knee": bend}).round(6)
    return found


@pytest.fixture(scope="module")
def bodies():
    """Positions (n_frames, n_joints, 3) in metres, y up, of four bends; and names of the joints."""
    bunch = make_bending(4, n_frames=60, noise=0, random_state=0)
    positions = [x.reshape(len(x), -1, 3).round(6) for x in bunch.data]
    return positions, list(bunch.skeleton.joints), list(bunch.skeleton.parents)


def check_saved(saved, originals, match):
    """Every column of a table against straight lines between the frames that were written.

    Parameters
    ----------
    saved : DataFrame, indexed by labels and the frame of the clock
    originals : dict of label to DataFrame
        In the order in which they were synchronised.
    match : Match
    """
    keys = list(range(saved.index.nlevels - 1))
    level = keys if len(keys) > 1 else 0
    parts = {label: x.droplevel(keys) for label, x in saved.groupby(level=level, sort=False)}
    assert list(parts) == list(originals)
    n_frames = match.times.shape[1]
    for tau, (label, x) in zip(match.times, originals.items(), strict=True):
        mine = parts[label]
        assert mine.index.tolist() == list(range(n_frames))
        frames = tau * (len(x) - 1) / (n_frames - 1)
        for name in x.columns:
            expected = np.interp(frames, np.arange(len(x)), x[name])
            np.testing.assert_allclose(mine[name], expected, atol=2e-4)
    assert match.offsets.any()


def check_labels(saved, match, n_columns):
    """Of recordings that other tests read: labels in order, whole columns, and a clock."""
    labels = [f"take{i}" for i in range(4)]
    n_frames = match.times.shape[1]
    assert list(saved.index) == [(label, p) for label in labels for p in range(n_frames)]
    assert saved.shape[1] == n_columns
    assert saved.notna().all(axis=None)
    assert match.offsets.any()


def check_picture(path):
    pixels = plt.imread(path)
    assert min(pixels.shape[:2]) > 150
    assert len(np.unique(pixels[::10, ::5].reshape(-1, pixels.shape[2]), axis=0)) > 20


# -- tables ---------------------------------------------------------------------------------------


def long_table(curves):
    """Rows in any order; trials come in that of their first rows."""
    parts = [
        x.assign(subject=subject, trial=trial, time=np.arange(len(x)) / 100)
        for (subject, trial), x in curves.items()
    ]
    table = pd.concat(parts).sample(frac=1, random_state=0)
    order = dict.fromkeys(zip(table["subject"], table["trial"], strict=True))
    return table, {key: curves[key] for key in order}


def wide_table(curves):
    """A row a trial, a column a feature and frame."""
    rows = []
    for (subject, trial), x in curves.items():
        cells = {f"{name}_{p}": v for name in x for p, v in enumerate(x[name], 1)}
        rows.append({"subject": subject, "trial": trial} | cells)
    return pd.DataFrame(rows), curves


def table_of_columns(curves):
    """A column a trial, of one feature."""
    knees = {f"{subject}_{trial}": x["knee"] for (subject, trial), x in curves.items()}
    table = pd.DataFrame(knees)
    table.insert(0, "time", np.arange(len(table)) / 100)
    return table, {name: knee.to_frame("knee") for name, knee in knees.items()}


@pytest.mark.parametrize(
    ("title", "k", "file", "made", "keys"),
    [
        ("A long table", 0, "trials.csv", long_table, ["subject", "trial"]),
        ("polars", 0, "trials.csv", long_table, ["subject", "trial"]),
        ("A wide table", 1, "trials.csv", wide_table, ["subject", "trial"]),
        ("A wide table", 2, "columns.csv", table_of_columns, ["trial"]),
    ],
)
def test_tables(title, k, file, made, keys, curves, tmp_path, monkeypatch):
    table, originals = made(curves)
    table.to_csv(tmp_path / file, index=False)
    left = go(title, tmp_path, monkeypatch, k)
    saved = pd.read_csv("aligned.csv", index_col=[*keys, "frame"])
    assert list(saved.columns) == list(next(iter(originals.values())))
    check_saved(saved, originals, left["synchronizer"].match(left["trials"]))


def test_wide_table_of_one_feature(curves, tmp_path, monkeypatch):
    rows = {}
    for (subject, trial), x in curves.items():
        at = np.linspace(0, len(x) - 1, 101)
        rows[f"{subject}_{trial}"] = np.interp(at, np.arange(len(x)), x["knee"]).round(6)
    wide = pd.DataFrame.from_dict(rows, orient="index")
    wide.to_csv(tmp_path / "knee.csv", index_label="trial")
    left = go("A wide table", tmp_path, monkeypatch)
    saved = pd.read_csv("aligned.csv", index_col="trial")
    match = left["synchronizer"].match(left["curves"])
    assert saved.shape == match.times.shape
    assert match.offsets.any()
    for tau, (name, row) in zip(match.times, rows.items(), strict=True):
        frames = tau * 100 / (saved.shape[1] - 1)
        np.testing.assert_allclose(
            saved.loc[name], np.interp(frames, np.arange(101), row), atol=1e-6
        )


def test_a_folder_of_csv_files(curves, tmp_path, monkeypatch):
    (tmp_path / "trials").mkdir()
    for (subject, trial), x in curves.items():
        timed = x.assign(time=np.arange(len(x)) / 100)
        timed.to_csv(tmp_path / "trials" / f"{subject}_{trial}.csv", index=False)
    left = go("A folder of CSV files", tmp_path, monkeypatch)
    names = [f"{subject}_{trial}" for subject, trial in TRIALS]
    timing = pd.read_csv("timing.csv", index_col=["trial", "frame"])
    match = left["synchronizer"].match(left["trials"])
    assert list(timing.index.unique("trial")) == names
    n_frames = match.times.shape[1]
    for tau, name in zip(match.times, names, strict=True):
        p = np.arange(n_frames)
        np.testing.assert_allclose(timing.loc[name, "time"], 100 * tau / (n_frames - 1))
        np.testing.assert_allclose(timing.loc[name, "offset"], 100 * (tau - p) / (n_frames - 1))
    check_picture("trials.png")


# -- files of motion capture ----------------------------------------------------------------------


MARKERS = {
    "left_hip": "LASI", "right_hip": "RASI", "left_knee": "LKNE", "right_knee": "RKNE",
    "left_ankle": "LANK", "right_ankle": "RANK", "left_shoulder": "LSHO", "right_shoulder": "RSHO",
}  # fmt: skip


def markers(x, joints, names=MARKERS, **changes):
    """Plug-in Gait's, in millimetres, z up."""
    turned = 1000 * np.stack([x[..., 0], -x[..., 2], x[..., 1]], axis=-1)
    places = turned[:, [joints.index(name) for name in names]]
    return c3d(places, changes={"LABELS": texts(*names.values())} | changes)


def write_takes(folder, ending, bodies):
    positions, joints, parents = bodies
    folder.mkdir()
    for i, x in enumerate(positions):
        path = folder / f"take{i}.{ending}"
        if ending == "c3d":
            path.write_bytes(markers(x, joints))
        else:
            write_motion(path, x.reshape(len(x), -1), Skeleton(joints, parents), frame_rate=50)


@pytest.mark.parametrize(
    ("title", "ending", "name"),
    [
        ("Markers of C3D files", "c3d", "walks"),
        ("BVH", "bvh", "bends"),
        ("TRC", "trc", "bends"),
    ],
)
def test_files_of_motion_capture(title, ending, name, bodies, tmp_path, monkeypatch):
    write_takes(tmp_path / name, ending, bodies)
    left = go(title, tmp_path, monkeypatch)
    saved = pd.read_csv(f"{name}.csv", index_col=["recording", "frame"])
    match = Match.from_estimator(left["pipe"], left[name])
    check_labels(saved, match, 37 if ending != "c3d" else 22)  # of the arms there is nothing
    if ending == "trc":
        timing = pd.read_csv("timing.csv", index_col=["recording", "frame"])
        lasting = [(len(x) - 1) / 50 for x in bodies[0]]
        assert timing["time"].groupby("recording").max().tolist() == pytest.approx(lasting)
    else:
        check_picture(f"{name}.png")
    if ending == "bvh":
        animate = SkeletonDisplay.animate
        monkeypatch.setattr(SkeletonDisplay, "animate", lambda self: animate(self, seconds=0.2))
        exec(SECTIONS[title][1], left)
        columns = list(left[name][0])
        positions = pd.read_csv("positions.csv", index_col=[0, 1])
        assert list(positions) == list(pd.read_csv("blend.csv", index_col=0)) == columns
        aligned = match.warp(left[name])
        np.testing.assert_allclose(positions.to_numpy(), aligned.reshape(-1, len(columns)))
        assert (tmp_path / "bends.gif").stat().st_size > 1_000


def write_strides(curves, folder):
    """Two strides a file, one behind the other, from heel strike to heel strike."""
    strides = {}
    for number, (a, b) in enumerate([TRIALS[:2], TRIALS[2:4]]):
        parts = [curves[key].to_numpy() for key in (a, b)]
        strikes = np.cumsum([9, len(parts[0]) - 1, len(parts[1]) - 1])
        track = np.vstack([np.zeros((9, 2)), parts[0][:-1], parts[1], np.zeros((7, 2))])
        for k in (0, 1):
            rows = track[strikes[k] : strikes[k + 1] + 1]
            angles = pd.DataFrame(rows, columns=["LHipAngles_x", "LKneeAngles_x"])
            strides[f"walk{number}", k] = angles
        points = np.zeros((len(track), 3, 3))
        points[:, 1, 0], points[:, 2, 0] = track.T
        points[:, 0] = 1
        labels = ["SACR", "LHipAngles", "LKneeAngles"]
        times = np.column_stack([np.zeros(3), strikes / 50]).ravel()
        events = {"USED": words(3), "LABELS": texts(*["Foot Strike"] * 3)}
        events |= {"CONTEXTS": texts(*["Left"] * 3), "TIMES": (4, [2, 3], floats(*times)[2])}
        changes = {"LABELS": texts(*labels), "ANGLES": texts(*labels[1:])}
        changes["ANGLE_UNITS"] = texts("deg")
        put(folder, c3d(points, changes=changes, others={"EVENT": events}), f"walk{number}.c3d")
    return strides


def test_angles_and_events(curves, tmp_path, monkeypatch):
    strides = write_strides(curves, tmp_path / "gait")
    left = go("Angles and events of C3D files", tmp_path, monkeypatch)
    saved = pd.read_csv("strides.csv", index_col=["recording", "part", "frame"])
    check_saved(saved, strides, left["synchronizer"].match(left["strides"]))
    check_picture("strides.png")


def test_gait_report(tmp_path, monkeypatch):
    """Heels and toes of Plug-in Gait; five strides of known length and time."""
    made = make_walk(1, n_strides=5, random_state=0)
    joints = made.skeleton.joints
    names = MARKERS | {"left_heel": "LHEE", "right_heel": "RHEE"}
    names |= {"left_toe": "LTOE", "right_toe": "RTOE"}
    x = made.data[0].reshape(len(made.data[0]), -1, 3)
    file = markers(x, joints, names, RATE=(4, [], floats(100.0)[2]))
    put(tmp_path / "steps", file, "walk.c3d")
    left = go("A gait report of C3D files", tmp_path, monkeypatch)
    saved = pd.read_csv("gait.csv", index_col=["recording", "parameter"]).loc["walk"]
    assert saved.loc["stride length", "unit"] == "m"
    assert saved.loc["stride length", "mean"] == pytest.approx(made.stride_length[0], rel=0.03)
    assert saved.loc["speed", "mean"] == pytest.approx(made.speed[0], rel=0.03)
    events = pd.DataFrame(made.events[0])
    is_left = (events["label"] == "Foot Strike") & (events["context"] == "Left")
    strikes = events["frame"][is_left].to_numpy()
    rows = [stride.attrs["rows"] for stride in left["strides"]]
    np.testing.assert_allclose(rows, np.stack([strikes[:-1], strikes[1:]], axis=1), atol=2)
    check_picture("gait.png")


# -- reading files --------------------------------------------------------------------------------


def test_page_of_motion_files_runs_in_order(curves, bodies, tmp_path, monkeypatch, capsys):
    write_takes(tmp_path / "walks", "c3d", bodies)
    strides = write_strides(curves, tmp_path / "gait")
    times, head = np.arange(60) / 100, "version=1\nnRows={n}\nnColumns={m}\ninDegrees=yes\n"
    labels = ["hip_flexion_r", "knee_angle_r", "pelvis_tx"]
    for name in ("walk0_ik.mot", "walk1_ik.mot"):
        file = storage(np.sin(np.outer(times, [4, 5, 6])), labels, header=head)
        put(tmp_path / "opensim", file, name)
    times += np.random.default_rng(0).uniform(0, 0.004, 60)
    file = storage(np.sin(4 * times)[:, np.newaxis], ["soleus_r"], times=times, header=head)
    put(tmp_path / "opensim", file, "muscles.sto")
    page = (HOWTO / "motion_files.md").read_text(encoding="utf-8")
    *blocks, uneven = BLOCK.findall(page)
    monkeypatch.chdir(tmp_path)
    left = {}
    for block in blocks:
        exec(block, left)
    with pytest.warns(UserWarning, match="evenly spaced"):
        exec(uneven, left)
    assert [x.shape[1] for x in left["poses"]] == [22] * 4
    assert len(left["strides"]) == len(strides)
    assert left["aligned"].shape[0::2] == (2, 2)
    assert np.ptp(np.diff(left["even"].index)) < 1e-12
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == "50.0 mm z"
    assert "angles" in printed[1]
    assert printed[2] == "['LHipAngles_x', 'LHipAngles_y'] deg"
    assert printed[3] == "deg 100.0"


# -- key-points -----------------------------------------------------------------------------------


def landmarks_of_a_video(x, joints, size):
    """MediaPipe's names, y downwards and z away from the camera."""
    pairs = ["eye_inner", "eye", "eye_outer", "ear", "shoulder", "elbow", "wrist", "pinky"]
    pairs += ["index", "thumb", "hip", "knee", "ankle", "heel", "foot_index"]
    names = ["nose", "mouth_left", "mouth_right"]
    names += [f"{side}_{part}" for part in pairs for side in ("left", "right")]
    instead = dict.fromkeys(("pinky", "index", "thumb"), "wrist")
    instead |= dict.fromkeys(("heel", "foot_index"), "ankle")
    columns = {"time": (np.arange(len(x)) / 30).round(4)}
    for name in names:
        side, _, part = name.partition("_")
        joint = f"{side}_{instead.get(part, part)}"
        place = x[:, joints.index(joint if joint in joints else "head")] * size * [1, -1, -1]
        columns |= {f"{name}_{axis}": place[:, k] for k, axis in enumerate("xyz")}
        columns[f"{name}_visibility"] = 0.9
    return pd.DataFrame(columns)


@pytest.mark.parametrize("n_dims", [3, 2])
def test_landmarks_of_a_video(n_dims, bodies, tmp_path, monkeypatch):
    positions, joints, _ = bodies
    (tmp_path / "poses").mkdir()
    for i, x in enumerate(positions):
        table = landmarks_of_a_video(x, joints, 1 if n_dims == 3 else 400)
        if n_dims == 2:
            table = table[[name for name in table if not name.endswith("_z")]]
        table.to_csv(tmp_path / "poses" / f"take{i}.csv", index=False)
    where = "in space" if n_dims == 3 else "in the picture"
    left = go(f"Landmarks of a video, {where}", tmp_path, monkeypatch)
    assert left["pipe"][0].skeleton.up == "-y"
    assert left["pipe"][0].skeleton.n_dims == n_dims
    match = Match.from_estimator(left["pipe"], left["poses"])
    if n_dims == 3:
        check_picture("poses.png")
        saved = left["pipe"].set_output(transform="pandas").fit_transform(left["poses"])
    else:
        saved = pd.read_csv("poses.csv", index_col=["trial", "frame"])
    check_labels(saved, match, 1 + 12 * n_dims)


def test_an_xarray_dataset(tmp_path, monkeypatch):
    """Two individuals a film, with a gap where confidence is low."""
    (tmp_path / "poses").mkdir()
    rng, originals, names = np.random.default_rng(0), {}, ["head", "left_wrist", "right_wrist"]
    columns = [f"{name}_{axis}" for name in names for axis in "xy"]
    dims = ("time", "space", "keypoints", "individuals")
    coords = {"time": np.arange(57) / 30, "space": ["x", "y"], "keypoints": names}
    for film in ("film0", "film1"):
        position, confidence = (
            rng.standard_normal((57, 2, 3, 2)).cumsum(axis=0),
            np.ones((57, 3, 2)),
        )
        for name, x in zip(("ann", "bob"), position.transpose(3, 0, 2, 1), strict=True):
            originals[film, name] = pd.DataFrame(x.reshape(57, 6), columns=columns)
        position[20:23, :, 1, 0], confidence[20:23, 1, 0] = 1e3, 0.1
        xr.Dataset(
            {"position": (dims, position), "confidence": ((dims[0], *dims[2:]), confidence)},
            coords | {"individuals": ["ann", "bob"]},
            {"fps": 30.0, "time_unit": "seconds"},
        ).to_netcdf(tmp_path / "poses" / f"{film}.nc", engine="scipy")
    left = go("An xarray dataset", tmp_path, monkeypatch)
    saved = pd.read_csv("poses.csv", index_col=["recording", "individual", "frame"])
    assert list(saved.columns) == columns
    doubtful = ["left_wrist_x", "left_wrist_y"]
    sure = {label: x.drop(columns=doubtful) for label, x in originals.items()}
    check_saved(saved, sure, left["synchronizer"].match(left["trials"]))
    assert saved[doubtful].abs().max().max() < 100  # and not the 1000 of a wrong guess
