"""gait_events: strikes and foot-offs of made walks, where the truth is known, and of people."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation
from sklearn_motionsync import DenseSynchronizer, Skeleton
from sklearn_motionsync.datasets import make_walk
from sklearn_motionsync.gait import gait_events
from sklearn_motionsync.gait.recordings import Walk, joints_of_feet
from sklearn_motionsync.io import cut_at_events, keyframes_from_events

LABELS = ("Foot Strike", "Foot Off")


@pytest.fixture(scope="module")
def ruler(benchmark):
    return benchmark("gait")


@pytest.fixture(scope="module")
def walk():
    return make_walk(4, random_state=0)


def errors(walk, found, ruler):
    """Errors in milliseconds by label, the number missed, and that in excess."""
    triples = []
    for i, events in enumerate(walk.events):
        own = found[found["trial"] == i]
        listed = list(own[["label", "context", "time"]].itertuples(index=False, name=None))
        true = [(event["label"], event["context"], event["time"]) for event in events]
        triples.append(ruler.compare(listed, true))
    by_label = {
        label: 1000 * np.concatenate([np.array(e[label]) for e, *_ in triples]) for label in LABELS
    }
    missed = sum(sum(m.values()) for _, m, _ in triples)
    return by_label, missed, sum(x for *_, x in triples)


@pytest.mark.parametrize(
    ("how", "bias", "error"),
    [
        ({}, 7, 7),
        ({"treadmill": True}, 7, 7),
        ({"frame_rate": 25}, 7, 8),
        ({"frame_rate": 250, "asymmetry": 8}, 7, 7),
        ({"frame_rate": 120, "noise": 0.01}, 9, 10),
        ({"frame_rate": 30, "noise": 0.01}, 10, 12),
    ],
)
def test_events_of_made_walks(ruler, how, bias, error):
    walk = make_walk(8, random_state=1, **how)
    found = gait_events(walk.data, walk.skeleton, frame_rate=walk.frame_rate)
    by_label, missed, more = errors(walk, found, ruler)
    assert (missed, more) == (0, 0)
    for label in LABELS:
        assert abs(by_label[label].mean()) < bias, label
        assert np.abs(by_label[label]).mean() < error, label


def test_side_view_from_a_camera(walk, ruler):
    """Two axes, y down, pixels; the camera sees the walk from the other side, too."""
    for sign in (1, -1):
        pictures = []
        for x in walk.data:
            points = x.reshape(len(x), -1, 3)
            image = np.stack([sign * points[..., 2], 2 - points[..., 1]], axis=2)
            pictures.append(500 * image.reshape(len(x), -1))
        joints = walk.skeleton.joints
        flat = Skeleton(
            joints, walk.skeleton.parents, dict(walk.skeleton.landmarks), up="-y", n_dims=2
        )
        found = gait_events(pictures, flat, frame_rate=100)
        by_label, missed, more = errors(walk, found, ruler)
        assert (missed, more) == (0, 0)
        assert all(np.abs(of_label).mean() < 8 for of_label in by_label.values())


def test_units_place_and_axes_do_not_matter(walk):
    (x,), skeleton = walk.data[:1], walk.skeleton
    expected = gait_events([x], skeleton, frame_rate=100)
    turn = Rotation.from_euler("y", 2.0).as_matrix()
    turned = 1000 * x.reshape(len(x), -1, 3) @ turn.T + [500, -200, 30]
    upright = Skeleton(skeleton.joints, skeleton.parents, dict(skeleton.landmarks), up="z")
    # x, y, z of "y up" are y, z, x of "z up".
    found = gait_events([turned[..., [2, 0, 1]].reshape(len(x), -1)], upright, frame_rate=100)
    pd.testing.assert_frame_equal(found, expected, rtol=1e-6)


def test_heading_across_a_gap_of_the_hips(walk):
    """Straight lines lead across it; curves that swing out would turn the body."""
    x = walk.data[0].reshape(len(walk.data[0]), -1, 3).copy()
    feet = joints_of_feet(walk.skeleton)
    whole = Walk(x, walk.skeleton, feet, 100, "walk").forward
    for side in ("left", "right"):
        x[100:200, walk.skeleton.indices_of(f"{side}_hip")] = np.nan
    hidden = Walk(x, walk.skeleton, feet, 100, "walk").forward
    turned = np.degrees(np.arccos(np.clip((whole * hidden).sum(axis=1), -1, 1)))
    assert turned.max() < 1


def test_names_of_markers():
    """Of one subject among nameless points; a heel that is never seen leaves the ankle."""
    made = make_walk(1, random_state=0)
    names = {
        "left_hip": "LASI", "right_hip": "RASI", "left_knee": "LKNE", "right_knee": "RKNE",
        "left_ankle": "LANK", "right_ankle": "RANK", "left_heel": "LHEE", "right_heel": "RHEE",
        "left_toe": "LTOE", "right_toe": "RTOE",
    }  # fmt: skip
    columns = {f"{a}_{x}": f"Ann:{b}_{x}" for a, b in names.items() for x in "xyz"}
    df = pd.DataFrame(made.data[0], columns=made.skeleton.column_names)
    df = df[list(columns)].rename(columns=columns)
    df[["M1_x", "M1_y", "M1_z"]] = 0.0
    df.attrs |= {"frame_rate": 100.0, "up": "y"}
    found = gait_events(df)
    expected = gait_events(made.data, made.skeleton, frame_rate=100)
    assert np.abs(found["frame"] - expected["frame"]).max() < 2
    for axis in "xyz":
        df[f"Ann:LHEE_{axis}"] = np.nan
    left = [
        t[(t["context"] == "Left") & (t["label"] == "Foot Strike")]
        for t in (found, gait_events(df))
    ]
    assert np.abs(left[0]["frame"].to_numpy() - left[1]["frame"].to_numpy()).max() < 3


def test_table_fits_the_other_functions(walk):
    """A recording that begins at frame 30: events count its frames, and cut it into strides."""
    columns = walk.skeleton.column_names
    df = pd.DataFrame(walk.data[0], columns=columns)
    df.attrs |= {"frame_rate": 100.0, "units": "m", "up": "y"}
    events = gait_events(df)
    later = gait_events(df.iloc[30:])
    shared = events[events["frame"] > 60].reset_index(drop=True)
    rows = later["frame"] > 60
    np.testing.assert_allclose(later[rows]["frame"], shared["frame"], atol=0.5)
    np.testing.assert_allclose(later["time"], later["frame"] / 100)
    df.attrs["events"] = events.to_dict("records")
    strides = cut_at_events(df, ("Foot Strike", "Left"))
    n_strikes = ((events["label"] == "Foot Strike") & (events["context"] == "Left")).sum()
    assert len(strides) == n_strikes - 1
    keyframes = keyframes_from_events(strides)
    assert set(keyframes.columns) == {
        ("Foot Off", "Right"), ("Foot Strike", "Right"), ("Foot Off", "Left")
    }  # fmt: skip
    DenseSynchronizer(50).fit(strides, keyframes=keyframes)


@pytest.mark.parametrize("every", [63, pytest.param(21, marks=pytest.mark.nightly)])
def test_nothing_of_people_that_stand(every, ruler, real_data, capsys):
    """Standing, sitting down and squatting have no strikes; only a lunge has steps."""
    ruler.refused(real_data, every)
    _, _, *lines = capsys.readouterr().out.strip().splitlines()
    assert len(lines) == 6
    for line in lines:
        name, _, share = line.strip("| ").split(" | ")
        assert (share == "0.0") is ("lunge" not in name), name


def test_rate_and_noise_hardly_matter_on_people(ruler, real_data):
    """Twelve walks: 30 frames a second, and a centimetre of noise."""
    (label, metres) = ruler.PEOPLE["cmu07_walk"]
    bunch = ruler.load_trials(real_data / "cmu07_walk" / "cmu07_walk_positions.npz")
    walks = [metres * np.asarray(x, dtype=float) for x in bunch.data]
    whole = [ruler.find(x, 60, bunch.skeleton) for x in walks]
    for rate, noise, most in ((30, 0, 5), (None, 0.01, 12)):
        triples = []
        for k, x in enumerate(walks):
            x = x + np.random.default_rng(k).normal(0, noise, x.shape)
            triples.append(
                ruler.compare(ruler.find(*ruler.thinned(x, 60, rate), bunch.skeleton), whole[k])
            )
        for label in LABELS:
            off = 1000 * np.concatenate([np.array(e[label]) for e, *_ in triples])
            missed = sum(m[label] for _, m, _ in triples)
            assert len(off) > 55
            assert missed <= 3
            assert np.abs(off).mean() < most


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"frame_rate": None}, "The frame rate of trial 0 is not known: give frame_rate="),
        ({"skeleton": None}, "Arrays do not name their joints: give a skeleton"),
        ({"feet": {"heel": "left_heel"}}, "feet: 'heel' is none of left_heel, left_toe"),
        ({"feet": {"left_heel": "LHEE"}}, "feet: 'left_heel' is at 'LHEE', which is no joint"),
        ({"X": [np.zeros((20, 57))]}, "Trial 0 has 20 frames at 100 a second; 0.25 s and 4"),
        ({"X": [np.zeros((50, 6))]}, "Trial 0 has 6 features a frame, but the skeleton's 19"),
    ],
)
def test_refused(walk, arguments, message):
    given = {"X": walk.data, "skeleton": walk.skeleton, "frame_rate": 100} | arguments
    with pytest.raises(ValueError, match=message):
        gait_events(**given)


def test_bodies_that_cannot_be_read(walk):
    (x,), skeleton = walk.data[:1], walk.skeleton
    hidden = x.copy()
    for side in ("left", "right"):
        for part in ("heel", "ankle"):
            column = 3 * skeleton.joints.index(f"{side}_{part}")
            hidden[:, column : column + 3] = np.nan
    with pytest.raises(ValueError, match="Trial 0: no heel and no ankle is seen"):
        gait_events([hidden], skeleton, frame_rate=100)
    upside = Skeleton(skeleton.joints, skeleton.parents, dict(skeleton.landmarks), up="-y")
    with pytest.raises(ValueError, match="Trial 0: the pelvis is never seen above the feet"):
        gait_events([x], upside, frame_rate=100)
    legs = {"left_knee": "left_knee", "left_ankle": "left_ankle"}
    with pytest.raises(ValueError, match="Trial 0: the skeleton has no pelvis and no hip"):
        gait_events([x], Skeleton(skeleton.joints, skeleton.parents, legs), frame_rate=100)
