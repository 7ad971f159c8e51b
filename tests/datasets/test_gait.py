"""make_gait: cycles and takes, the differences of the groups, and the parameters."""

import numpy as np
import pytest
from sklearn_motionsync.datasets import make_gait

HIP, KNEE, ANKLE, FORCE = range(4)
PEAK, VALLEY, SECOND, TOE_OFF, SWING = range(5)


@pytest.fixture(scope="module")
def gait():
    return make_gait(n_people=7, n_cycles=4, random_state=0)


@pytest.fixture(scope="module")
def takes():
    return make_gait(n_people=7, n_cycles=4, takes=True, random_state=0)


def shares(bunch):
    """Per cent of each cycle at which its key-frames come."""
    lengths = np.array([len(x) for x in bunch.data])
    return 100 * bunch.keyframes / (lengths[:, np.newaxis] - 1)


def on_clock(bunch, frames=101):
    """Every cycle at the true moments: (n, frames, 4)."""
    moments = np.linspace(0, 1, frames)
    cycles = zip(bunch.data, bunch.times, strict=True)
    return np.array([[np.interp(moments, times, f) for f in x.T] for x, times in cycles]).mT


def test_times_keyframes_and_labels_fit_the_cycles(gait):
    assert len(gait.data) == len(gait.times) == 28
    assert gait.keyframes.shape == (28, len(gait.keyframe_names))
    assert gait.person.tolist() == [f"person{i}" for i in range(7) for _ in range(4)]
    assert "".join(gait.group) == 3 * "AAAABBBB" + "AAAA"
    assert gait.cycle.tolist() == 7 * [1, 2, 3, 4]
    assert gait.feature_names[KNEE] == "knee_flexion"
    assert gait.units == 3 * ["degrees"] + ["body weights"]
    for i, (x, times) in enumerate(zip(gait.data, gait.times, strict=True)):
        assert x.shape == (len(times), 4)
        assert 80 <= len(x) <= 120
        assert (times[0], times[-1]) == (0, 1)
        assert (np.diff(times) > 0).all()
        at = np.interp(gait.keyframes[i], np.arange(len(times)), times)
        # The pace between two frames is nearly even.
        np.testing.assert_allclose(at, [0.14, 0.30, 0.48, 0.62, 0.73], atol=1e-4)
    assert len({len(x) for x in gait.data}) > 10


def test_curves_are_those_of_gait(gait):
    for x, keyframes in zip(gait.data, gait.keyframes, strict=True):
        hip, knee, ankle, force = x.T
        peak, valley, second, toe_off, swing = keyframes
        assert abs(np.argmax(knee) - swing) < 4
        assert 45 < knee.max() < 80
        assert hip[0] > 15 > 0 > hip.min() > -25
        assert abs(np.argmin(ankle) - toe_off) < 6
        middle = round(valley)
        assert abs(np.argmax(force[:middle]) - peak) < 4
        assert abs(middle + np.argmax(force[middle:]) - second) < 4
        assert force[:middle].max() > 1 > force[middle] > 0.5
        frames = np.arange(len(x))
        assert (force[frames >= toe_off] == 0)[:-1].all()
        assert (force >= 0).all()
        assert (force[1 : int(toe_off) - 2] > 0).all()


# -- differences between the groups -----------------------------------------------------


def test_timing_delays_toe_off_of_group_b():
    same, later = (make_gait(4, timing=t, style=0, warp=0, random_state=0) for t in (0, 5))
    in_b = same.group == "B"
    difference = shares(later) - shares(same)
    assert (difference[~in_b] == 0).all()
    np.testing.assert_allclose(difference[in_b][:, TOE_OFF], 5, atol=1e-3)
    # Moments near it are shifted with it, those near the heel strikes hardly.
    assert (difference[in_b][:, PEAK] < 0.2).all()
    assert (difference[in_b][:, [SECOND, SWING]] > 2.5).all()
    # The same people, as long as before: only the timing of group B has changed.
    for i in np.flatnonzero(~in_b):
        np.testing.assert_array_equal(same.data[i], later.data[i])
    assert [len(x) for x in same.data] == [len(x) for x in later.data]


def test_timing_keeps_poses_and_amplitude_keeps_times():
    changes = {}, {"timing": 6}, {"amplitude": 15}
    plain, later, larger = (make_gait(4, noise=0, random_state=0, **each) for each in changes)
    assert np.abs(on_clock(later) - on_clock(plain)).max() < 0.3
    in_b = plain.group == "B"
    np.testing.assert_array_equal(larger.keyframes, plain.keyframes)
    change = on_clock(larger) - on_clock(plain)
    assert np.abs(change[~in_b]).max() == 0
    assert np.abs(change[..., [HIP, ANKLE, FORCE]]).max() == 0
    knee = change[in_b][:, :, KNEE]
    assert np.abs(knee.max(axis=1) / 15 - 1).max() < 0.2  # people have a scale of their own
    assert np.abs(knee[:, :50]).max() < 0.2


@pytest.mark.parametrize(("timing", "amplitude"), [(4, 0), (-12, -40), (12, 40)])
def test_timing_and_amplitude_are_those_of_the_data(timing, amplitude):
    same = {"style": 0, "warp": 0, "noise": 0, "random_state": 0}
    gait = make_gait(2, 1, timing=timing, amplitude=amplitude, **same)
    assert all((np.diff(times) > 0).all() for times in gait.times)
    # When toe-off is, in per cent of the cycle.
    in_a, in_b = (np.interp(0.62, x, np.linspace(0, 100, len(x))) for x in gait.times)
    assert in_b - in_a == pytest.approx(timing, abs=0.2)
    without, higher = on_clock(gait)
    assert (higher - without)[73, KNEE] == pytest.approx(amplitude, abs=0.15)
    assert np.abs(higher - without)[:40].max() < 0.05


def test_people_differ_more_than_the_cycles_of_a_person():
    at = shares(make_gait(80, 4, random_state=0))[:, TOE_OFF].reshape(80, 4)
    assert at.mean(axis=1).std() == pytest.approx(1.25, abs=0.25)
    assert np.sqrt(at.var(axis=1, ddof=1).mean()) == pytest.approx(0.42, abs=0.1)


# -- takes ------------------------------------------------------------------------------


def test_takes_are_continuous_walks_with_their_events(takes):
    assert len(takes.data) == 7
    assert "".join(takes.group) == "ABABABA"
    assert "cycle" not in takes
    for x, times, events in zip(takes.data, takes.times, takes.events, strict=True):
        assert x.shape == (len(times), 4)
        assert (np.diff(times) > 0).all()
        assert -0.5 < times[0] < 0
        assert 4 < times[-1] < 4.5
        labels = [event["label"] for event in events]
        assert labels == [*(4 * ["Foot Strike", "Foot Off"]), "Foot Strike"]
        assert set(events[0]) == {"label", "context", "time", "frame"}
        at = [event["frame"] for event in events]
        assert [event["time"] * 100 for event in events] == pytest.approx(at)
        moments = np.interp(at, np.arange(len(x)), times)
        expected = np.array([0, 0.62, 1, 1.62, 2, 2.62, 3, 3.62, 4])
        np.testing.assert_allclose(moments, expected, atol=1e-3)
        # No jump where a cycle meets the next.
        assert np.abs(np.diff(x[:, :3], axis=0)).max() < 9


def test_takes_and_cycles_show_the_same_people(gait, takes):
    for i in range(7):
        lasting = np.diff(takes.keyframes[i][::6])
        cycles = [len(gait.data[4 * i + c]) for c in range(4)]
        np.testing.assert_allclose(lasting, cycles, atol=0.51)
        foot_off = takes.keyframes[i][4::6] - takes.keyframes[i][:-1:6]
        expected = shares(gait)[4 * i : 4 * i + 4, TOE_OFF]
        np.testing.assert_allclose(100 * foot_off / lasting, expected, atol=1e-6)


# -- parameters -------------------------------------------------------------------------


def test_random_state_makes_people_reproducible():
    a, b, c = (make_gait(2, random_state=seed) for seed in (0, np.random.RandomState(0), 1))
    np.testing.assert_array_equal(a.data[1], b.data[1])
    assert a.data[1].shape != c.data[1].shape or not np.allclose(a.data[1], c.data[1])


@pytest.mark.parametrize("takes", [False, True])
def test_smallest_and_largest_parameters_give_finite_cycles(takes):
    largest = {"warp": 10, "timing": 12, "noise": 1000, "style": 100, "amplitude": -40}
    for params in ({"n_people": 1, "n_cycles": 1, "n_frames": 20}, largest):
        gait = make_gait(**{"n_people": 3, "takes": takes, "random_state": 0} | params)
        for x, times, keyframes in zip(gait.data, gait.times, gait.keyframes, strict=True):
            assert np.isfinite(x).all()
            assert (x[:, FORCE] >= 0).all()
            assert (x[times % 1 > 0.6201, FORCE] == 0).all()
            assert (np.diff(times) > 0).all()
            assert (np.diff(keyframes) > 0).all()
            assert keyframes[0] > 0
            assert keyframes[-1] < len(x) - 1


@pytest.mark.parametrize(
    "params",
    [
        *({"n_people": value} for value in (0, 2.0)),
        {"n_cycles": 10**5},
        *({"amplitude": value} for value in (-41, np.nan)),
        {"timing": 12.5},
        *({"takes": value} for value in (1, None)),
        {"n_frames": 19},
        {"style": -1},
        {"warp": 11},
        {"noise": np.nan},
        {"frame_rate": np.inf},
    ],
    ids=str,
)
def test_parameters_out_of_range_are_refused(params):
    with pytest.raises(ValueError, match=f"'{next(iter(params))}' parameter of make_gait"):
        make_gait(**params)
