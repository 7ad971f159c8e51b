"""write_player: positions, warps and marks in the page, decoded by other means; what is refused."""

import base64
import re

import numpy as np
import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import DenseSynchronizer, DirectionCosines, Match, Skeleton
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.report import write_player

from pages import Page

BENDS = make_bending(5, n_frames=40, random_state=0)
PIPE = make_pipeline(DirectionCosines(BENDS.skeleton), DenseSynchronizer(31)).fit(BENDS.data)


def whole_numbers(text, dtype):
    return np.frombuffer(base64.b64decode(text), dtype)


def positions_of(data):
    """The points (n_frames_i, n_points, n_dims) of each trial."""
    numbers = whole_numbers(data["positions"], "<i2").astype(float)
    numbers[numbers == -32768] = np.nan
    points = (numbers * data["scale"]).reshape(-1, data["points"], data["dims"])
    return np.split(points, np.cumsum(data["lengths"])[:-1])


def write(tmp_path, X=BENDS.data, skeleton=BENDS.skeleton, **given):
    path = write_player(tmp_path / "a.html", X, skeleton, **given)
    return Page(path.read_text(encoding="utf-8"))


# -- what the page holds ----------------------------------------------------------------------


def test_positions_are_those_given(tmp_path):
    page = write(tmp_path, match=PIPE, frame_rate=50, names=list("abcde"), title="Bends & more")
    data, skeleton = page.data["player"], BENDS.skeleton
    assert data["names"] == list("abcde")
    assert data["shown"] == [0, 1, 2, 3, 4]
    assert "<title>Bends &amp; more</title>" in page.page
    assert data["alone"]
    assert "To keep this file small" not in page.page
    places = {name: skeleton.indices_of(name)[0] for name in ("left_hip", "right_hip", "head")}
    for x, points in zip(BENDS.data, positions_of(data), strict=True):
        x, joints = x.reshape(len(x), -1, 3), points[:, :15]
        assert points.shape == (len(x), 16, 3)
        np.testing.assert_array_equal(points[:, 15], points[:, places["head"]])
        # Turned about the vertical and moved: heights, and distances between joints, remain.
        np.testing.assert_allclose(joints[..., 1], x[..., 1] - x[..., 1].min(), atol=1e-3)
        drawn, given = (
            np.linalg.norm(x[:, :, np.newaxis] - x[:, np.newaxis], axis=-1) for x in (joints, x)
        )
        np.testing.assert_allclose(drawn, given, atol=1e-3)
        # It faces the reader at first: its left hip is to the right of the other one.
        across = points[0, places["left_hip"]] - points[0, places["right_hip"]]
        assert across[0] > 0.99 * np.hypot(across[0], across[2])
    pairs = {(child, parent) for child, parent in enumerate(skeleton.parents) if parent >= 0}
    assert {(b, a) for _, bones in data["bones"] for a, b in bones} == pairs
    for side, bones in data["bones"]:
        of_side = [skeleton.joints[b].partition("_")[0] in (side, "head", "neck") for _, b in bones]
        assert all(of_side)
    assert data["dots"] == [15]
    assert data["durations"] == [(len(x) - 1) / 50 for x in BENDS.data]
    assert (data["seconds"], data["pace"]) == (True, 1)
    tau = whole_numbers(data["warps"], "<u2").reshape(5, 31) / 65535
    times = Match.from_estimator(PIPE, BENDS.data).times
    np.testing.assert_allclose(tau, times / 30, atol=2e-5)


def test_the_page_is_one_file_that_needs_nothing(tmp_path):
    for page in (write(tmp_path), write(tmp_path, match=PIPE, keyframes=[[3]] * 5)):
        page.check_that_nothing_is_loaded()
        ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
        assert len(set(ids)) == len(ids)
        used = set(re.findall(r'find\("(\w+)"\)', page.page))
        assert used <= set(ids)
        assert "prefers-color-scheme: dark" in page.page
        assert "<nav" not in page.page
        # The only clock of a browser that is asked in this way.
        assert set(re.findall(r"(\w+)\.now\(\)", page.page)) == {"performance"}


def test_without_a_frame_rate_or_a_match(tmp_path):
    data = write(tmp_path).data["player"]
    assert (data["seconds"], data["warps"], data["frames"]) == (False, None, 0)
    assert data["pace"] * data["median"] == pytest.approx(4)
    assert data["durations"] == [len(x) - 1 for x in BENDS.data]
    assert data["median"] == np.median(data["durations"])
    tables = [pd.DataFrame(x) for x in BENDS.data]
    for k, x in enumerate(tables):
        x.attrs |= {"frame_rate": 20.0 + k, "trial": f"bend {k}"}
    data = write(tmp_path, tables).data["player"]
    assert data["names"][3] == "bend 3"
    assert data["durations"][3] == pytest.approx((len(tables[3]) - 1) / 23)


def test_keyframes_are_marked_on_both_axes_of_time(tmp_path):
    frames = np.array([[9, np.nan], [10, np.nan], [12, np.nan], [8, 20], [np.nan, 30]])
    table = pd.DataFrame(frames, columns=["down", "up"])
    match = Match.from_estimator(PIPE, BENDS.data)
    down, up = write(tmp_path, match=match, keyframes=table).data["player"]["keyframes"]
    assert (down["name"], up["name"]) == ("down", "up")
    last = np.array([len(x) - 1 for x in BENDS.data])
    assert down["own"] == [9 / last[0], 10 / last[1], 12 / last[2], 8 / last[3], None]
    # On the clock they are where the warp of their trial comes by, between two of its frames.
    places = []
    for tau, n, frame in zip(match.times, last, frames[:4, 0], strict=False):
        p = max(p for p in range(30) if tau[p] / 30 * n <= frame)
        before, after = tau[p : p + 2] / 30 * n
        places.append((p + (frame - before) / (after - before)) / 30)
    assert down["clock"] == pytest.approx(np.median(places))
    # The first and the last frame are key-frames; of a third one nothing is known.
    frames = np.column_stack([np.zeros(5), last, np.full(5, np.nan)])
    marks = write(tmp_path, match=match, keyframes=frames).data["player"]["keyframes"]
    assert [mark["clock"] for mark in marks] == [0, 1, None]
    (only,) = write(tmp_path, keyframes=frames[:, :1]).data["player"]["keyframes"]
    assert (only["name"], only["clock"]) == ("key-frame 0", None)


def test_points_in_a_plane_and_as_many_trials_as_there_may_be(tmp_path):
    rng = np.random.default_rng(0)
    names = [f"j{k}_{axis}" for k in range(4) for axis in "xy"]
    trials = [rng.standard_normal((2 + k, 8)) for k in range(24)]
    data = write(tmp_path, [pd.DataFrame(x, columns=names) for x in trials], None).data["player"]
    assert (data["points"], data["dims"], data["most"]) == (4, 2, 24)
    assert data["shown"] == list(range(24))
    for x, points in zip(trials, positions_of(data), strict=True):
        x = x.reshape(-1, 4, 2)
        between, given = np.diff(points, axis=1), np.diff(x, axis=1)
        np.testing.assert_allclose(between, given, atol=1e-3)
        np.testing.assert_allclose(points[..., 1], x[..., 1] - x[..., 1].min(), atol=1e-3)


def test_points_without_bones_gaps_and_one_trial(tmp_path):
    x = BENDS.data[0].copy()
    x[5:9, :3] = np.nan
    at_rest = write(tmp_path, PLANE, None).data["player"]
    assert (at_rest["scale"], not np.any(positions_of(at_rest))) == (1, True)
    data = write(tmp_path, x, None).data["player"]
    assert (data["bones"], len(data["dots"]), data["lengths"]) == ([], 15, [len(x)])
    (points,) = positions_of(data)
    assert np.isnan(points).any(axis=(1, 2)).sum() == 4
    bare = Skeleton(BENDS.skeleton.joints, [-1] * 15)
    assert write(tmp_path, skeleton=bare).data["player"]["dots"] == list(range(15))


# -- what is refused --------------------------------------------------------------------------

PLANE = pd.DataFrame(np.ones((9, 6)), columns=[f"j{k}_{axis}" for k in range(3) for axis in "xy"])
SPACE = pd.DataFrame(np.ones((9, 6)), columns=[f"j{k}_{axis}" for k in range(2) for axis in "xyz"])


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({"X": [PLANE, SPACE], "skeleton": None}, ValueError, r"Trial 1 has \(2, 3\) points and"),
        ({"keyframes": [3] * 5}, ValueError, "keyframes|key-frames"),
        *(
            ({"keyframes": [[3]] * 4 + [[k]]}, ValueError, "Trial 4: key-frames must .* included")
            for k in (-1, len(BENDS.data[4]))
        ),
        ({"X": BENDS.data * 5}, ValueError, r"X has 25 trials, .* 24 .* such as X\[:24\]"),
        ({"X": [BENDS.data[0], BENDS.data[1][:1]]}, ValueError, "Trial 1 has 1 frame"),
        ({"names": ["a"]}, ValueError, "names must be a list of text, one for each of the 5"),
        ({"match": Match([[0, 1, 2]])}, ValueError, "match must be of the 5 trials of X"),
        ({"match": DenseSynchronizer()}, ValueError, "not fitted"),
        ({"keyframes": [[3]]}, ValueError, r"list of 5 arrays .*, one a trial"),
        ({"skeleton": "acclaim"}, ValueError, "skeleton must be a Skeleton"),
        ({"frame_rate": 0}, ValueError, "frame_rate"),
        ({"X": []}, ValueError, "0 trials"),
    ],
)
def test_refused_arguments_leave_the_file_as_it_was(tmp_path, given, error, message):
    path = tmp_path / "a.html"
    path.write_text("before")
    given = {"X": BENDS.data, "skeleton": BENDS.skeleton} | given
    with pytest.raises(error, match=message):
        write_player(path, **given)
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]
