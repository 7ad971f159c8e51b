"""make_bending: the true warps and key-frames, the body, and the parameters."""

import numpy as np
import pytest
from sklearn_motionsync.datasets import make_bending


def joint(bunch, i, name):
    j = bunch.skeleton.joints.index(name)
    return bunch.data[i][:, 3 * j : 3 * j + 3]


def test_times_and_keyframes_fit_the_frames(bending):
    assert len(bending.data) == 40
    assert bending.keyframes.shape == (40, 5)
    for i, (x, times) in enumerate(zip(bending.data, bending.times, strict=True)):
        assert x.shape == (len(times), 45)
        assert times[0] == 0
        assert times[-1] == 1
        assert (np.diff(times) > 0).all()
        at = np.interp(bending.keyframes[i], np.arange(len(times)), times)
        np.testing.assert_allclose(at, [0.12, 0.30, 0.48, 0.68, 0.88])
    lengths = [len(x) for x in bending.data]
    assert len(set(lengths)) > 10
    assert 75 <= min(lengths) < 90
    assert 110 < max(lengths) <= 125


def test_body_is_upright_at_both_ends_and_the_hand_low_at_its_keyframe(bending):
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
            ends = (joint(bunch, i, bunch.skeleton.joints[k]) for k in (a, b))
            length = np.linalg.norm(np.subtract(*ends), axis=1)
            np.testing.assert_allclose(length, length[0])


def test_parameters_of_warps_actors_frames_and_draws():
    for times in make_bending(2, warp=0, random_state=0).times:
        np.testing.assert_allclose(times, np.linspace(0, 1, len(times)))
    rates = np.concatenate([np.diff(t) * (len(t) - 1) for t in make_bending(random_state=1).times])
    assert 0.5 < rates.min() < 0.75
    assert 1.3 < rates.max() < 2
    assert len(set(make_bending(9, n_actors=3, random_state=0).actor)) == 3
    a, b, c = (make_bending(1, n_frames=40, random_state=seed).data[0] for seed in (0, 0, 1))
    assert len(a) <= 50
    np.testing.assert_array_equal(a, b)
    assert a.shape != c.shape or not np.allclose(a, c)


@pytest.mark.parametrize(
    "params",
    [
        *({"n_trials": value} for value in (0, 2.0)),
        {"n_frames": 3},
        {"n_actors": 10**12},
        *({"style": value} for value in (np.nan, -1)),
        *({"warp": value} for value in (11, None)),
        {"noise": np.inf},
        {"frame_rate": 0},
    ],
    ids=str,
)
def test_parameters_out_of_range_are_refused(params):
    with pytest.raises(ValueError, match=f"'{next(iter(params))}' parameter of make_bending"):
        make_bending(**params)


def test_largest_parameters_give_finite_trials():
    bunch = make_bending(4, n_frames=400, random_state=0, warp=10, noise=1000, style=100)
    for x, times, keyframes in zip(bunch.data, bunch.times, bunch.keyframes, strict=True):
        assert np.isfinite(x).all()
        assert (np.diff(times) > 0).all()
        assert (np.diff(keyframes) > 0).all()
