"""Data sets: what is promised of the synthetic one, and archives good and bad."""

import numpy as np
import pytest
from sklearn_motionsync import Skeleton
from sklearn_motionsync.datasets import load_performances, make_bending


def joint(bunch, i, name):
    j = bunch.joints.index(name)
    return bunch.data[i][:, 3 * j : 3 * j + 3]


# -- make_bending -----------------------------------------------------------------------


def test_bending_is_what_it_says(bending):
    assert len(bending.data) == 40
    assert bending.keyframes.shape == (40, 5)
    for i, (x, times) in enumerate(zip(bending.data, bending.times, strict=True)):
        assert x.shape == (len(times), 45)
        assert times[0] == 0
        assert times[-1] == 1
        assert (np.diff(times) > 0).all()
        at = np.interp(bending.keyframes[i], np.arange(len(times)), times)
        np.testing.assert_allclose(at, bending.keyframe_times)
    lengths = [len(x) for x in bending.data]
    assert len(set(lengths)) > 10
    assert 75 <= min(lengths) < 90
    assert 110 < max(lengths) <= 125


def test_somebody_bends(bending):
    """Upright at both ends, right hand near the floor at its key-frame, feet where they are."""
    for i in range(len(bending.data)):
        head, hand = joint(bending, i, "head")[:, 1], joint(bending, i, "right_wrist")[:, 1]
        deepest = round(bending.keyframes[i, 2])
        assert head[0] > 1.3
        assert head[-1] > 1.3
        assert hand[deepest] < 0.35
        assert abs(int(np.argmin(hand)) - deepest) <= 6
        assert joint(bending, i, "left_ankle").std(axis=0).max() < 0.01


def test_limbs_keep_their_length():
    bunch = make_bending(3, noise=0, random_state=0)
    for i in range(3):
        for a, b in bunch.skeleton.bones:
            ends = (joint(bunch, i, bunch.joints[k]) for k in (a, b))
            length = np.linalg.norm(np.subtract(*ends), axis=1)
            np.testing.assert_allclose(length, length[0])


def test_equal_times_show_the_same_moment():
    """Without style and noise, performances of one body differ only in their clock."""
    a, b = (make_bending(1, style=0, noise=0, n_actors=1, random_state=0) for _ in range(2))
    np.testing.assert_array_equal(a.data[0], b.data[0])
    bunch = make_bending(2, style=0, noise=0, n_actors=1, random_state=0)
    heights = [joint(bunch, i, "pelvis")[:, 1] for i in range(2)]
    again = np.interp(bunch.times[0], bunch.times[1], heights[1])
    assert np.abs(again - heights[0]).max() < 2e-3


def test_parameters_do_what_they_say():
    even = make_bending(2, warp=0, random_state=0)
    for times in even.times:
        np.testing.assert_allclose(times, np.linspace(0, 1, len(times)))
    rates = np.concatenate([np.diff(t) * (len(t) - 1) for t in make_bending(random_state=1).times])
    assert 0.5 < rates.min() < 0.75
    assert 1.3 < rates.max() < 2
    assert len(set(make_bending(9, n_actors=3, random_state=0).actor)) == 3
    assert make_bending(1, n_frames=40, random_state=0).data[0].shape[0] <= 50


def test_random_state_decides():
    a, b, c = (make_bending(2, random_state=seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(a.data[1], b.data[1])
    assert a.data[1].shape != c.data[1].shape or not np.allclose(a.data[1], c.data[1])


@pytest.mark.parametrize(
    "params",
    [{"n_performances": 0}, {"noise": -1}, {"n_frames": 3}, {"style": np.nan}, {"frame_rate": 0}],
    ids=str,
)
def test_nonsense_parameters(params):
    with pytest.raises(ValueError, match=f"'{next(iter(params))}' parameter"):
        make_bending(**params)


# -- load_performances ------------------------------------------------------------------


def fields():
    kinect = Skeleton.kinect()
    return {
        "positions": np.random.default_rng(0).standard_normal((12, 20, 3)).astype(np.float32),
        "offsets": [0, 5, 12],
        "label": ["bow", "wave"],
        "actor": ["A", "B"],
        "take": ["1", "1"],
        "fps": [30.0, np.nan],
        "joints": kinect.joints,
        "parents": kinect.parents,
    }


def test_an_archive(tmp_path):
    content = fields()
    np.savez(tmp_path / "a.npz", **content)
    bunch = load_performances(str(tmp_path / "a.npz"))
    assert [x.shape for x in bunch.data] == [(5, 60), (7, 60)]
    assert bunch.data[0].dtype == np.float32
    np.testing.assert_array_equal(bunch.data[1], content["positions"][5:].reshape(7, 60))
    assert bunch.target.tolist() == ["bow", "wave"]
    assert bunch.actor.tolist() == ["A", "B"]
    assert bunch.skeleton == Skeleton.kinect()
    assert bunch.frame_rate[0] == 30
    assert np.isnan(bunch.frame_rate[1])


def test_an_archive_of_something_else_than_a_body(tmp_path):
    np.savez(tmp_path / "a.npz", **fields() | {"joints": [f"m{i}" for i in range(20)]})
    assert load_performances(tmp_path / "a.npz").skeleton is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"offsets": None}, r"lacks \['offsets'\]"),
        ({"positions": np.zeros((12, 60))}, r"shape \(frames, joints, 3\)"),
        ({"positions": np.zeros((12, 20, 3), int)}, "must be floats"),
        ({"offsets": [0, 5, 11]}, "offsets must increase from 0 to the 12 frames"),
        ({"offsets": [0, 12, 5]}, "offsets must increase"),
        ({"offsets": [0, 0, 12]}, "offsets must increase"),
        ({"offsets": [0.0, 5.0, 12.0]}, "whole numbers"),
        ({"label": ["bow"]}, r"label must have shape \(2,\), got \(1,\)"),
        ({"joints": ["a"]}, r"joints must have shape \(20,\)"),
        ({"label": np.array([{}, {}], dtype=object)}, "cannot be read"),
    ],
    ids=str,
)
def test_bad_archives(tmp_path, change, message):
    content = {k: v for k, v in (fields() | change).items() if v is not None}
    np.savez(tmp_path / "a.npz", **content)
    with pytest.raises(ValueError, match=message):
        load_performances(tmp_path / "a.npz")


@pytest.mark.parametrize("content", [b"", b"text", b"PK\x03\x04 and then nothing"])
def test_files_that_are_no_archives(tmp_path, content):
    (tmp_path / "a.npz").write_bytes(content)
    with pytest.raises(ValueError, match=r"cannot be read as a NumPy \.npz archive"):
        load_performances(tmp_path / "a.npz")


def test_a_single_array_is_no_archive(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros(3))
    with pytest.raises(ValueError, match="cannot be read"):
        load_performances(tmp_path / "a.npy")


def test_no_file(tmp_path):
    with pytest.raises(FileNotFoundError, match="no archive at"):
        load_performances(tmp_path / "a.npz")


def test_real_archives(real_data):
    bunch = load_performances(real_data / "hdm05" / "hdm05_positions.npz")
    assert len(bunch.data) == len(bunch.target) == 132
    assert bunch.skeleton == Skeleton.acclaim()
    assert load_performances(real_data / "utkinect" / "utkinect_positions.npz").skeleton is not None
    assert load_performances(real_data / "cmu07_walk" / "cmu07_walk_positions.npz").skeleton
