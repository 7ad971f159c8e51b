"""Where in takes of known movement they repeat."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from sklearn_motionsync.display import CycleDisplay
from sklearn_motionsync.takes import CycleSegmenter
from sklearn_motionsync.takes.self_correlation import find_repeats


def waves(n_frames, period, first=0):
    t = 2 * np.pi * (first + np.arange(n_frames)[:, np.newaxis]) / period
    return np.sin(t + np.arange(3)) + 0.4 * np.cos(2 * t + np.arange(3) ** 2)


def standing(n_frames, seed=0, size=0.02):
    """A pose that sways slowly."""
    noise = np.random.default_rng(seed).normal(size=(n_frames, 3))
    slow = gaussian_filter1d(noise, 10, axis=0)
    return np.array([0.3, -0.8, 0.5]) + size * (slow / slow.std() + 0.2 * noise)


def places(x, **params):
    return CycleSegmenter(**params).report([x]).loc[0, "stretches"]


@pytest.mark.parametrize(("n_cycles", "n_still"), [(1.8, 60), (3, 400), (1.8, 2000), (20, 400)])
def test_a_movement_between_standing_is_found(n_cycles, n_still):
    n = round(n_cycles * 60)
    x = np.concatenate([standing(n_still), waves(n, 60), standing(n_still, 1)])
    (row,) = CycleSegmenter().report([x]).itertuples()
    ((start, stop),) = row.stretches
    assert row.cyclic
    assert row.period == pytest.approx(60, rel=0.02)
    assert row.n_cycles == pytest.approx((stop - start) / 60, rel=0.02)
    assert abs(start - n_still) <= 9
    assert abs(stop - n_still - n) <= 9


def test_several_stretches_are_numbered_and_counted_on():
    gap = standing(150)
    x = np.concatenate([gap, waves(240, 60), gap, waves(300, 50, 17), gap])
    segmenter = CycleSegmenter(start=0, incomplete=True).fit([waves(400, 60)])
    cycles, table = segmenter.segment([x])
    whole = table[table["complete"]]
    assert whole["stretch"].unique().tolist() == [0, 1]
    assert whole["stretch"].value_counts().tolist() == [6, 3]
    ends = table.groupby("stretch").agg({"start": "min", "stop": "max"})
    np.testing.assert_allclose(ends, [[150, 390], [540, 840]], rtol=0, atol=8)
    assert [len(x) for x in cycles] == (table["stop"] - table["start"]).tolist()
    display = CycleDisplay.from_estimator(segmenter, [x])
    assert len(display.stretches_) == 2
    assert repr(display).startswith(f"CycleDisplay({len(x)} frames, 2 stretches, period")
    assert repr(display).endswith(f"{len(whole)} whole cycles)")


def test_only_what_follows_the_pattern_is_complete():
    """Another movement repeats for a while; the fit leaves it out, and so does segment."""
    t = 2 * np.pi * np.arange(150)[:, np.newaxis] / 50
    other = np.sin(t + 2 * np.pi / 3 * np.array([0, 2, 1]) + 0.5)
    x = np.concatenate([waves(420, 60), standing(120), other])
    X = [x, waves(600, 60, 23)]
    segmenter = CycleSegmenter(start=0, incomplete=True).fit(X)
    assert len(places(x)) == 2
    table = segmenter.segment([x])[1]
    assert table["stretch"].unique().tolist() == [0]
    assert table["stop"].max() < 430
    assert segmenter.report([x])["n_cycles"][0] == pytest.approx(7, abs=0.1)
    alone = CycleSegmenter(start=0).fit([x[: places(x)[0][1]], X[1]])
    assert np.vdot(segmenter.pattern_, alone.pattern_) > 0.99 * np.square(alone.pattern_).sum()
    np.testing.assert_allclose(segmenter.periods_, 60, rtol=0.01)
    assert segmenter.set_params(incomplete=False).segment([x])[1]["complete"].all()


def test_a_fit_learns_from_stretches_only():
    walk = waves(300, 60)
    around = np.concatenate([standing(500), walk, standing(500, 1)])
    segmenters = [CycleSegmenter(start=0).fit([x]) for x in (walk, around)]
    np.testing.assert_allclose(segmenters[1].periods_, segmenters[0].periods_, rtol=0.01)
    # The two maxima of the feature are nearly equal: either may begin the cycle.
    one, other = (s.pattern_ / np.linalg.norm(s.pattern_) for s in segmenters)
    assert max(np.vdot(one, np.roll(other, k, axis=0)) for k in range(32)) > 0.99


@pytest.mark.parametrize("gap", [60, 100, 300])
def test_a_pause_parts_stretches_of_the_same_movement(gap):
    x = np.concatenate([waves(240, 60), standing(gap), waves(240, 60, 20)])
    (first, second) = places(x)
    for found, expected in zip((*first, *second), (0, 240, 240 + gap, len(x)), strict=True):
        assert abs(found - expected) < 9


def test_ends_are_those_of_the_take_if_little_is_left():
    x = waves(300, 60)
    assert places(x) == [(0, 300)]
    assert places(np.concatenate([x, np.repeat(x[-1:], 20, axis=0)])) == [(0, 320)]
    ((start, stop),) = places(np.concatenate([x, np.repeat(x[-1:], 60, axis=0)]))
    assert start == 0
    assert stop < 312


def test_a_changing_pace_is_one_stretch_and_two_movements_are_two():
    t = np.linspace(0, 1, 1000)
    angle = 2 * np.pi * 12 * (t + 0.05 * np.sin(np.pi * t))[:, np.newaxis]
    x = np.sin(angle + np.arange(3)) + 0.5 * np.cos(2 * angle)
    # A fit follows the pattern at any pace; of the self-correlation alone it may be several.
    (row,) = CycleSegmenter(start=0).fit([x]).report([x]).itertuples()
    assert row.stretches == [(0, 1000)]
    for cycles in (row.n_cycles, CycleSegmenter().report([x])["n_cycles"][0]):
        assert cycles == pytest.approx(12, abs=0.2)
    quick = np.concatenate([waves(300, 60), waves(300, 25)])
    ends = places(quick)
    assert len(ends) == 2
    assert abs(ends[0][1] - 300) < 15


@pytest.mark.parametrize("n_features", [1, 4, 20])
def test_noise_and_single_movements_repeat_nowhere(n_features):
    """As in whole takes: at most one in twenty of white noise in few features."""
    rng = np.random.default_rng(3)
    noise = rng.normal(size=(20, 300, n_features))
    assert CycleSegmenter().report(list(noise))["cyclic"].sum() <= 1
    bump = np.sin(np.pi * np.arange(80) / 80)[:, np.newaxis] ** 2 * rng.normal(size=n_features)
    once = np.concatenate([np.zeros((200, n_features)), bump, np.zeros((200, n_features))])
    assert places(once + 0.01 * rng.normal(size=once.shape)) == []


def test_a_higher_strength_is_required_of_one_of_many_places():
    """The same weak repetition is cyclic alone, and one of many chances among noise."""
    rng = np.random.default_rng(5)
    weak = waves(110, 60) + 0.75 * gaussian_filter1d(rng.normal(size=(110, 3)), 4, axis=0) * 4
    moving = gaussian_filter1d(rng.normal(size=(3000, 3)), 6, axis=0) * 6
    still = np.repeat(weak[:1], 1000, axis=0)
    alone = find_repeats(np.concatenate([still, weak, weak[-1:] + 0 * still]), 0.3)
    among = find_repeats(np.concatenate([moving, weak, moving[::-1]]), 0.3)
    assert any(s.start < 1110 and s.stop > 1000 for s in alone.stretches)
    assert not any(s.start < 3110 and s.stop > 3000 for s in among.stretches)


def test_rate_and_unit_change_nothing():
    x = np.concatenate([standing(300), waves(240, 60), standing(300, 1)])
    ((start, stop),) = places(x)
    for other in (1e4 * x, 1e-6 * x + 3, x.astype(np.float32)):
        assert places(other) == [(start, stop)]
    ((first, last),) = places(gaussian_filter1d(np.repeat(x, 4, axis=0), 2, axis=0))
    assert abs(first / 4 - start) < 6
    assert abs(last / 4 - stop) < 6
