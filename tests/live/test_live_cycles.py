"""OnlineSynchronizer: cycles that go on, and movements that begin anew, against made truths."""

import copy

import numpy as np
import pytest
from scipy.signal import find_peaks
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines, LinearSynchronizer
from sklearn_motionsync.datasets import load_trials
from sklearn_motionsync.live import OnlineSynchronizer
from sklearn_motionsync.live.stream import Course, go_round
from sklearn_motionsync.takes import CycleSegmenter

P, LENGTH = 50, 60
NAMES = ("phase", "rate", "confidence", "lower", "upper", "cycle")


def pose(phase, style=0.0):
    """Three features of a cycle, at phases in cycles, of a person."""
    angle = 2 * np.pi * np.asarray(phase)[..., np.newaxis]
    waves = np.sin(angle), np.cos(angle + 0.3 * style), 0.6 * np.sin(2 * angle + 0.4 + style)
    return np.concatenate(waves, axis=-1)


def paced(n_frames, begin=0.0, swing=0.3, pace=1.0):
    """Phases of frames, in cycles, at a pace that goes up and down."""
    t = np.arange(n_frames)
    return begin + np.cumsum(pace * (1 + swing * np.sin(2 * np.pi * t / 400))) / LENGTH


@pytest.fixture(scope="module")
def fitted():
    rng = np.random.default_rng(0)
    styles, lengths = np.linspace(-0.3, 0.3, 7), (52, 64, 58, 61, 66, 60, 59)
    X = [pose(np.linspace(0, 1, n), s) for n, s in zip(lengths, styles, strict=True)]
    X = [x + 0.02 * rng.standard_normal(x.shape) for x in X]
    return OnlineSynchronizer(DenseSynchronizer(P), cyclic=True).fit(X)


@pytest.fixture
def live(fitted):
    return copy.deepcopy(fitted)


@pytest.fixture(scope="module")
def walk():
    """Frames of ten cycles of another person, and their phases."""
    truth = paced(600, begin=0.37)
    noise = 0.02 * np.random.default_rng(1).standard_normal((600, 3))
    return pose(truth, 0.1) + noise, truth


def errors(found, truth):
    """Errors in per cent of a cycle."""
    return 100 * ((found.phase / (P - 1) - truth + 0.5) % 1 - 0.5)


# -- cycles ---------------------------------------------------------------------------------


def test_phase_goes_round_cycles_are_counted_and_bounds_hold_the_truth(fitted, walk):
    x, truth = walk
    (found,) = fitted.track([x])
    off = errors(found, truth)[LENGTH:]
    assert np.median(np.abs(off)) < 2
    assert np.abs(off).max() < 8
    # Every beginning is told once, within a twentieth of a cycle, and none is taken back.
    rises = 1 + np.flatnonzero(np.diff(found.cycle))
    begins = np.searchsorted(truth, np.arange(1, truth[-1]))
    assert np.diff(found.cycle).min() == 0
    np.testing.assert_allclose(rises, begins, atol=0.05 * LENGTH)
    assert found.cycle[-1] == int(truth[-1])
    assert found.confidence[LENGTH:].min() > 0.9
    assert found.phase.min() >= 0
    assert found.phase.max() <= P - 1
    assert (found.lower <= found.phase).all()
    assert (found.phase <= found.upper).all()
    assert (found.upper - found.lower).max() <= P
    # At the beginning of a cycle they reach into the one before, at its end into the next.
    near = (truth + np.round(found.phase / (P - 1) - truth)) * (P - 1)
    after = slice(LENGTH, None)
    inside = (found.lower <= near) & (near <= found.upper)
    assert inside[after].mean() > 0.85
    assert found.lower[after].min() < 0
    assert found.upper[after].max() > P - 1


@pytest.mark.parametrize("begin", [0.0, 0.25, 0.95])
def test_it_begins_anywhere(fitted, begin):
    truth = paced(400, begin, 0.0, 0.75)
    (found,) = fitted.track([pose(truth)])
    assert (found.phase[0], found.confidence[0], found.cycle[0]) == (0, 0, 0)
    assert found.upper[0] - found.lower[0] > 0.8 * P
    assert np.abs(errors(found, truth)[LENGTH // 5 :]).max() < 5
    # Also where a cycle begins.
    np.testing.assert_allclose(found.rate[200:], 0.75, atol=0.2)


@pytest.mark.parametrize("cyclic", [True, False])
def test_track_equals_step_and_no_phase_depends_on_later_frames(cyclic, fitted, walk, single):
    known = fitted if cyclic else single[0]
    x = walk[0][:300].copy() if cyclic else np.tile(single[1], (3, 1))
    x[100:110] = x[0, 1] = x[30, 1] = np.nan
    live, (whole, *parts) = copy.deepcopy(known), known.track([x, x[:41], x[:163]])
    steps = [live.step(frame) for frame in x]
    for name in NAMES:
        values = getattr(whole, name)
        for part in parts:
            n = len(part.phase)
            np.testing.assert_array_equal(values[:n], getattr(part, name))
        np.testing.assert_array_equal(values, [getattr(step, name) for step in steps])
    assert all(isinstance(value, float) for value in steps[0][:5])
    assert isinstance(steps[0].cycle, int)
    assert whole.cycle.dtype.kind == "i"


def test_cycles_go_on_while_nothing_is_seen(fitted, walk):
    x, truth = pose(paced(600, 0.2, 0.0)), paced(600, 0.2, 0.0)
    gone = x.copy()
    gone[200:350] = np.nan
    (hidden,) = fitted.track([gone])
    seen = np.r_[:200, 350:600]
    (gap,) = fitted.track([x[seen]], [seen])
    for found, at in ((hidden, np.arange(600)), (gap, seen)):
        assert found.cycle[-1] == int(truth[-1])
        assert np.abs(errors(found, truth[at])[-150:]).max() < 5
    assert hidden.confidence[340] < 0.2
    assert (hidden.upper - hidden.lower)[340] > 2.5 * (hidden.upper - hidden.lower)[190]


def test_confidence_is_low_for_standing_still_and_other_movements(fitted, walk):
    x = walk[0]
    still, backwards = np.repeat(x[100:101], 400, axis=0), x[::-1]
    other = np.column_stack([x[:, 0], -x[:, 1], x[::-1, 2]])
    right, *wrong = fitted.track([x, still, backwards, other])
    for found in wrong:
        assert np.quantile(found.confidence[LENGTH:], 0.9) < 0.5
        assert found.confidence[LENGTH:].mean() < right.confidence[LENGTH:].mean() / 3


def test_standing_still_within_a_walk_is_no_cycle(fitted):
    truth = paced(500, 0.3, 0.0)
    order = np.r_[:250, np.full(300, 250), 250:500]
    (found,) = fitted.track([pose(truth)[order]])
    assert found.cycle[-1] == int(truth[-1])
    assert np.abs(errors(found, truth[order])[-150:]).max() < 5
    assert found.confidence[500] < 0.5 < found.confidence[-50:].min()


def test_phases_go_on_by_the_shorter_way():
    """Small steps back over the beginning stay there; large ones are taken back."""
    phase, cycle, told = np.array([0.0]), np.array([0]), []
    for now in (48, 2, 22, 45, 2, 48, 47, 1, 20, 44, 3, 40, 46, 1):
        phase, turns = go_round(phase, np.array([now]), cycle, 49, 2.5)
        cycle = np.maximum(cycle + turns, 0)
        told.append((int(cycle[0]), int(phase[0])))
    assert told == [
        (0, 48), (1, 2), (1, 22), (1, 45), (2, 2), (2, 0), (2, 0), (2, 1), (2, 20), (2, 44), (3, 3),
        (2, 40), (2, 46), (3, 1),
    ]  # fmt: skip


def test_course_of_made_phases():
    """Beginnings at the mean pace, and the duration of the last whole cycle."""
    course = Course(11, 20.0, True)
    assert course.time_left() == 20
    follow = course.follow
    follow(100.0, np.array([5.0]), np.array([0]))
    assert course.time_left() == 10
    # The first cycle was not whole. The second lasts from 108 to 134.
    follow(110.0, np.array([1.0]), np.array([1]))
    assert course.time_left() == 18
    follow(138.0, np.array([2.0]), np.array([2]))
    assert course.time_left() == pytest.approx(0.8 * 26)
    # A cycle that lasts longer than three mean ones, and two at once.
    follow(900.0, np.array([0.0]), np.array([3]))
    assert course.time_left() == 60
    follow(910.0, np.array([0.0]), np.array([5]))
    assert course.time_left() == 60
    single = Course(11, 20.0, False)
    single.follow(0.0, np.array([0.0]), np.array([0]))
    single.follow(12.0, np.array([5.0]), np.array([0]))
    assert single.time_left() == (8 + 10) / 2
    # Begun anew 4 before.
    single.follow(16.0, np.array([2.0]), np.array([1]))
    assert single.time_left() == 0.8 * 16 + 0.2 * 16


def test_walks_of_a_real_person(real_data):
    """Takes held out, against the moments at which the right ankle is farthest ahead."""
    bunch = load_trials(real_data / "cmu07_walk" / "cmu07_walk_positions.npz")
    held = (0, 3, 7, 11)
    known = [x for i, x in enumerate(bunch.data) if i not in held]
    cosines = DirectionCosines(bunch.skeleton)
    cycles, _ = CycleSegmenter(bunch.skeleton, start="right").fit(known).segment(known)
    features = cosines.fit_transform(cycles)
    live = OnlineSynchronizer(DenseSynchronizer(P), frame_rate=60, cyclic=True).fit(features)
    late = []
    for i in held:
        points = bunch.data[i].reshape(len(bunch.data[i]), -1, 3).astype(float)
        hips = [bunch.skeleton.index_of(f"{side}_hip") for side in ("left", "right")]
        across = points[:, hips[0]] - points[:, hips[1]]
        ahead = np.cross(across * [1, 0, 1], [0, 1, 0])
        ankle, pelvis = (bunch.skeleton.index_of(k) for k in ("right_ankle", "pelvis"))
        reach = ((points[:, ankle] - points[:, pelvis]) * ahead).sum(axis=1)
        strikes, _ = find_peaks(reach, prominence=0.3 * np.ptp(reach), distance=20)
        # In another direction, and on its way.
        path = np.arange(len(points))[:, np.newaxis, np.newaxis] * [1.0, 0, 2.0]
        turned = points[..., [2, 1, 0]] * [1, 1, -1] + path
        frames, other = cosines.transform([bunch.data[i], turned.reshape(len(points), -1)])
        found, same = live.track([frames, other])
        np.testing.assert_allclose(same.phase, found.phase, atol=1e-3)
        rises = 1 + np.flatnonzero(np.diff(found.cycle))
        for strike in strikes[strikes > 35]:
            late.append(np.abs(rises - strike).min())
        assert np.mean(found.confidence[60:] > 0.5) > 0.6
    # A cycle has about 70 frames.
    assert len(late) >= 6
    assert max(late) <= 6


@pytest.mark.parametrize("cost", ["velocity", "pose"])
def test_settings_single_precision_and_a_single_cycle(cost, walk):
    x, truth = walk
    cycle = pose(np.linspace(0, 1, LENGTH + 1)).astype(np.float32)
    live = OnlineSynchronizer(DenseSynchronizer(P, cost=cost), cyclic=True).fit([cycle])
    assert live.mean_.dtype == np.float32
    np.testing.assert_array_equal(live.mean_[0], live.mean_[-1])
    right, still = live.track([x, np.repeat(x[100:101], 300, axis=0)])
    assert np.median(np.abs(errors(right, truth)[LENGTH:])) < 4
    assert right.cycle[-1] == int(truth[-1])
    assert still.confidence[-1] < 0.5 or cost == "pose"


@pytest.mark.parametrize("n", [1, 3])
def test_constant_and_equal_cycles(n):
    constant = OnlineSynchronizer(LinearSynchronizer(), cyclic=True).fit([np.ones((40, 3))] * n)
    (found,) = constant.track([np.ones((90, 3))])
    assert np.isfinite(found).all()
    equal = OnlineSynchronizer(LinearSynchronizer(), cyclic=True)
    truth = np.arange(200) / 60
    (found,) = equal.fit([pose(np.linspace(0, 1, 61))] * n).track([pose(truth)])
    assert np.median(np.abs((found.phase / 60 - truth + 0.5) % 1 - 0.5)) < 0.01
    assert found.cycle[-1] == 3


def test_actions_that_do_not_end_where_they_begin_are_refused():
    X = [np.sin(np.linspace(-1.5, 1.5, n))[:, np.newaxis] ** [1, 3] for n in (40, 45, 50)]
    with pytest.raises(ValueError, match=r"ends 3.* times .* CycleSegmenter"):
        OnlineSynchronizer(DenseSynchronizer(P), cyclic=True).fit(X)


# -- single actions that begin anew ---------------------------------------------------------


@pytest.fixture(scope="module")
def single():
    """A movement of three features, of phases from 0 to 1, and a person of it."""

    def movement(phase, style=0.0):
        phase = np.asarray(phase)[..., np.newaxis]
        waves = np.cos(np.pi * phase), np.sin(2 * np.pi * phase), np.sin(np.pi * phase + style) ** 2
        return np.concatenate(waves, axis=-1)

    rng = np.random.default_rng(2)
    pairs = zip(range(50, 80, 4), rng.uniform(0, 0.2, 8), strict=True)
    X = [movement(np.linspace(0, 1, n), style) for n, style in pairs]
    X = [x + 0.02 * rng.standard_normal(x.shape) for x in X]
    t = np.linspace(0, 1, 65)
    phase = t + 0.2 * np.sin(2 * np.pi * t) / (2 * np.pi)
    new = movement(phase, 0.1) + 0.02 * rng.standard_normal((65, 3))
    return OnlineSynchronizer(DenseSynchronizer(P)).fit(X), new, phase * (P - 1)


def test_after_the_end_the_movement_begins_again(single):
    live, x, phase = single
    whole = np.concatenate([x, np.repeat(x[-1:], 40, axis=0), x])
    (found,) = live.track([whole])
    assert found.cycle[100] == 0
    assert found.cycle[-1] == 1
    assert np.abs(found.phase[105 + 13 :] - phase[13:]).max() < 6


@pytest.mark.parametrize("sway", [0.0, 0.002])
@pytest.mark.parametrize("at", [0, 20, 50])
def test_a_pause_is_no_new_attempt(single, at, sway):
    """It lasts almost as long as the movement."""
    live, x, phase = single
    order = np.insert(np.arange(65), at, np.full(50, at))
    noise = sway * np.random.default_rng(3).standard_normal((115, 3))
    (found,) = live.track([x[order] + noise])
    assert not found.cycle.any()
    assert np.abs(found.phase - phase[order])[-20:].max() < 6


@pytest.mark.parametrize("cyclic", [True, False])
def test_streams_equal_those_alone(cyclic, fitted, walk, single):
    live = copy.deepcopy(fitted if cyclic else single[0])
    x, y = single[1], single[1].copy()
    x, y[20:24] = np.concatenate([x[:27], x])[:65], np.nan
    if cyclic:
        x, y = walk[0][:400], np.roll(walk[0], 223, axis=0)[:400].copy()
        y[100:120] = y[250:260, 2] = np.nan
    both, alone = [live.step(frames) for frames in np.stack([x, y], axis=1)], live.track([x, y])
    for i, one in enumerate(alone):
        for name in ("phase", "rate", "confidence", "cycle"):
            found = [getattr(step, name)[i] for step in both]
            np.testing.assert_allclose(found, getattr(one, name), atol=1e-6)
    assert cyclic or both[-1].cycle.tolist() == [1, 0]


def test_second_attempts_of_real_people_held_out(hdm05):
    off, told, n = [], 0, 0
    for action in ("depositFloorR", "grabHighR"):
        features = make_pipeline(DirectionCosines(hdm05.skeleton), ASpace())
        chosen = hdm05.target == action
        known, new = (
            [hdm05.data[i][::4] for i in np.flatnonzero(chosen & ((hdm05.actor == "tr") == held))]
            for held in (False, True)
        )
        live = OnlineSynchronizer(DenseSynchronizer(100)).fit(features.fit_transform(known))
        new = features.transform(new[::2])
        first = [round(0.4 * (len(x) - 1)) + 1 for x in new]
        twice = [np.concatenate([x[:k], x]) for x, k in zip(new, first, strict=True)]
        once = live.track(new)
        for one, two, k in zip(once, live.track(twice), first, strict=True):
            late = len(one.phase) // 5
            off.append(np.abs(two.phase[k:] - one.phase)[late:])
            told, n = told + two.cycle[-1], n + 1
            assert one.cycle[-1] == 0
    # Some are told twice, as a jump of the pose is no movement.
    assert n <= told < 1.3 * n
    assert np.quantile(np.concatenate(off), 0.9) < 5
