"""Feet of blends: those that stand, slide, swing and fly; legs, and bodies without them."""

from itertools import pairwise

import numpy as np
import pytest
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines, Match, Skeleton
from sklearn_motionsync.datasets import load_trials, make_walk
from sklearn_motionsync.synchronizers import blend_trials

from made_bodies import standing

PAPER = Skeleton.paper()
SIDES = ("left", "right")


def even(n, n_frames=50):
    """A match at the uniform pace of the pattern."""
    return Match(np.tile(np.arange(float(n_frames)), (n, 1)))


def at(x, joint, skeleton=PAPER):
    joints = x.reshape(len(x), -1, skeleton.n_dims)
    return joints[:, list(skeleton.indices_of(joint))].mean(axis=1)


def squat(depth, back, width, n_frames=60, ahead=0.0):
    """A squat with feet that stand: knees at the crossing of two circles about hip and ankle.

    The pelvis goes down and back by so many metres, with feet so far apart and ahead.
    """
    share = np.sin(np.linspace(0, np.pi, n_frames)) ** 2
    x = np.repeat(standing(), n_frames, axis=0).reshape(n_frames, -1, 3)
    x[..., 1] -= 0.06 + depth * share[:, np.newaxis]
    x[..., 2] -= back * share[:, np.newaxis]
    for side, sign in zip(SIDES, (1, -1), strict=True):
        ankle = np.tile([sign * width / 2, 0, ahead * sign], (n_frames, 1))
        hip = x[:, PAPER.index_of(f"{side}_hip")]
        way = ankle - hip
        far = np.linalg.norm(way, axis=1, keepdims=True)
        normal = np.array([0, 0, 1]) - way * way[:, 2:] / far**2
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        x[:, PAPER.index_of(f"{side}_knee")] = (
            hip + way / 2 + normal * np.sqrt(0.5**2 - (far / 2) ** 2)
        )
        x[:, PAPER.index_of(f"{side}_ankle")] = ankle
    return x.reshape(n_frames, -1)


def limbs(x, skeleton=PAPER):
    pairs = [
        (f"{s}_{a}", f"{s}_{b}") for s in SIDES for a, b in (("hip", "knee"), ("knee", "ankle"))
    ]
    return np.stack(
        [np.linalg.norm(at(x, a, skeleton) - at(x, b, skeleton), axis=1) for a, b in pairs], axis=1
    )


def drift(x, joint, skeleton=PAPER, frames=slice(None)):
    place = at(x, joint, skeleton)[frames][:, [0, 2]]
    return np.linalg.norm(place - np.median(place, axis=0), axis=1).max()


@pytest.mark.parametrize("weights", [[0.5, 0.5], [0.8, 0.2], [1.5, -0.5], [[1, 0], [0, 1]]])
def test_feet_that_stand_in_all_stand_in_the_blend(weights):
    X = [squat(0.4, 0.3, 0.2, 60), squat(0.15, 0.0, 0.5, 80, ahead=0.2)]
    found = blend_trials(even(2), X, weights, skeleton=PAPER)
    # The transition ends 0.25 m from where it would without: as far as legs are moved.
    most = 0.004 if np.ndim(weights) == 1 else 0.02
    for side in SIDES:
        assert drift(found, f"{side}_ankle") < most
        height = at(found, f"{side}_ankle")[:, 1]
        assert np.abs(height).max() < 0.004
    np.testing.assert_allclose(limbs(found), 0.5, atol=1e-9)


def test_a_nearly_straight_knee_comes_back_as_it_is():
    x = np.repeat(standing(), 60, axis=0)
    x[:, 3 * PAPER.index_of("left_knee") + 2] += 1e-8
    X = [x, squat(0.3, 0.2, 0.3)]
    found = blend_trials(even(2), X, {0: 1}, skeleton=PAPER)
    np.testing.assert_allclose(found, x, atol=1e-15, rtol=0)


@pytest.mark.parametrize("i", [0, 1])
def test_nothing_moves_at_a_weight_of_one_or_near_it(i):
    X = [squat(0.4, 0.3, 0.2), squat(0.15, 0.0, 0.5, ahead=0.2)]
    np.testing.assert_allclose(blend_trials(even(2), X, {i: 1}, skeleton=PAPER), X[i], atol=1e-12)
    for little in (1e-6, -1e-6):
        found = blend_trials(even(2), X, {i: 1 - little, 1 - i: little}, skeleton=PAPER)
        np.testing.assert_allclose(found, X[i], atol=1e-4)


def test_bodies_go_through_straight_knees():
    """Legs that are straight in one trial, and as near to it as it gets."""
    x = np.repeat(standing(), 60, axis=0)
    X = [x, squat(0.3, 0.2, 0.3)]
    found = blend_trials(even(2), X, [0.6, 0.4], skeleton=PAPER)
    np.testing.assert_allclose(limbs(found), 0.5, atol=1e-9)
    assert np.abs(np.diff(found, axis=0)).max() < 0.05
    # They bend forward.
    for side in SIDES:
        middle = (at(found, f"{side}_hip") + at(found, f"{side}_ankle")) / 2
        assert (at(found, f"{side}_knee") - middle)[:, 2].min() > -1e-9


def walks(treadmill):
    walk = make_walk(4, 4, treadmill=treadmill, noise=0, random_state=0)
    steps = DirectionCosines(walk.skeleton), ASpace(0.95), DenseSynchronizer(n_frames=120)
    pipe = make_pipeline(*steps).fit(walk.data)
    return walk, Match.from_estimator(pipe, walk.data)


def stances(walk, i, side, rate=100):
    """Frames of a recording from 12 % to 35 % of each stride of a side: the foot is flat."""
    strikes = [
        e["time"] * rate
        for e in walk.events[i]
        if e["label"] == "Foot Strike" and e["context"].lower() == side
    ]
    return [(a + 0.12 * (b - a), a + 0.35 * (b - a)) for a, b in pairwise(strikes)]


def of_blend(match, X, i, j, weights, n, ranges):
    """The frames of a blend at frames of its first trial."""
    own = Match(match.times[[i, j]]).frames([len(X[i]), len(X[j])])
    steps = np.maximum(weights @ np.diff(own, axis=1), 0.5 * np.diff(own, axis=1).min(axis=0))
    passed = np.concatenate([[0], np.cumsum(steps)])
    ends = np.interp(ranges, own[0], passed * (n - 1) / passed[-1])
    return [slice(int(np.ceil(a)), int(b) + 1) for a, b in ends]


def test_feet_of_exaggerated_walks_stand_on_the_floor():
    walk, match = walks(treadmill=False)
    soles = [walk.skeleton.joints.index(f"{s}_{part}") for s in SIDES for part in ("heel", "toe")]
    largest = []
    for i, j in ((0, 2), (2, 0), (1, 3), (3, 1)):
        X = [walk.data[i], walk.data[j]]
        found = blend_trials(Match(match.times[[i, j]]), X, [1.5, -0.5], skeleton=walk.skeleton)
        for side in SIDES:
            ranges = stances(walk, i, side)
            for frames in of_blend(
                match, walk.data, i, j, np.array([1.5, -0.5]), len(found), ranges
            ):
                largest.append(drift(found, f"{side}_ankle", walk.skeleton, frames))
        assert found.reshape(len(found), -1, 3)[:, soles, 1].min() > -0.01
    assert len(largest) > 20
    assert max(largest) < 1e-4


def test_feet_on_a_treadmill_go_with_the_belt():
    walk, match = walks(treadmill=True)
    i, j = 1, 2
    X = [walk.data[i], walk.data[j]]
    for weights in ([0.5, 0.5], [1.5, -0.5]):
        found = blend_trials(Match(match.times[[i, j]]), X, weights, skeleton=walk.skeleton)
        own = [at(x, "pelvis", walk.skeleton) for x in [*X, found]]
        # The body is not carried off.
        assert np.ptp(own[2][:, [0, 2]], axis=0).max() < 2 * np.ptp(own[0], axis=0).max()
        speeds = []
        for side in SIDES:
            ranges = stances(walk, i, side)
            for f in of_blend(match, walk.data, i, j, np.array(weights), len(found), ranges):
                place = at(found, f"{side}_ankle", walk.skeleton)[f]
                speeds.append(np.linalg.norm(place[-1] - place[0]) / (len(place) - 1) * 100)
        assert np.median(speeds) == pytest.approx(weights @ walk.speed[[i, j]], rel=0.1)


def test_feet_in_the_air_are_left_alone():
    """A jump: the body is 0.6 m higher in the middle, and the legs move."""
    X = [squat(0.4, 0.3, 0.2), squat(0.15, 0.0, 0.5)]
    up = 0.6 * np.sin(np.linspace(0, np.pi, 60)) ** 2
    flies = up > 0.3
    for x in X:
        x[:, 1::3] += up[:, np.newaxis]
    found = blend_trials(even(2), X, [0.5, 0.5], skeleton=PAPER)
    mean = [np.mean([at(x, f"{s}_ankle")[:, 1] for x in X], axis=0) for s in SIDES]
    for side, expected in zip(SIDES, mean, strict=True):
        height = at(found, f"{side}_ankle")[:, 1]
        assert np.abs(height - expected)[flies].max() < 0.1
        assert height.min() > -0.01


def test_bodies_in_pictures_are_blended_as_before():
    """Each joint at its own share of the way: pictures do not show a floor."""
    picture = Skeleton.paper(n_dims=2, up="y")
    X = [squat(0.4, 0.3, 0.2), squat(0.15, 0.0, 0.5)]
    flat = [x.reshape(len(x), -1, 3)[..., [2, 1]].reshape(len(x), -1) for x in X]
    found = blend_trials(even(2), flat, [1.5, -0.5], skeleton=picture)
    # Sideways, feet slide.
    assert np.ptp(at(found, "left_ankle", picture)[:, 0]) > 0.02


def test_one_leg_and_no_knees():
    joints = ["pelvis", "left_hip", "left_knee", "left_ankle", "right_hip", "right_ankle", "neck"]
    whole = [PAPER.joints.index(name) for name in joints]
    skeleton = Skeleton(joints, [-1, 0, 1, 2, 0, 4, 0], {name: name for name in joints})
    X = [squat(0.4, 0.3, 0.2), squat(0.15, 0.0, 0.5)]
    X = [x.reshape(len(x), -1, 3)[:, whole].reshape(len(x), -1) for x in X]
    found = blend_trials(even(2), X, [0.5, 0.5], skeleton=skeleton)
    assert drift(found, "left_ankle", skeleton) < 0.004
    back = blend_trials(even(2), X, [0, 1], skeleton=skeleton)
    np.testing.assert_allclose(back, X[1], atol=1e-9)


def test_heels_and_toes_without_parents_go_with_the_ankle():
    """As markers do."""
    names = [*PAPER.joints, "left_heel", "left_toe", "right_heel", "right_toe"]
    skeleton = Skeleton(names, [-1] * len(names), PAPER.landmarks)
    X = []
    for x in (squat(0.4, 0.3, 0.2), squat(0.15, 0.0, 0.5, ahead=0.2)):
        ends = [
            at(x, f"{side}_ankle") + shift
            for side in SIDES
            for shift in ([0, -0.05, -0.06], [0, -0.05, 0.15])
        ]
        X.append(np.column_stack([x, *ends]))
    found = blend_trials(even(2), X, [1.5, -0.5], skeleton=skeleton)
    joints = found.reshape(len(found), -1, 3)
    for side in SIDES:
        for end, shift in (("heel", [0, -0.05, -0.06]), ("toe", [0, -0.05, 0.15])):
            apart = joints[:, names.index(f"{side}_{end}")] - at(found, f"{side}_ankle", skeleton)
            np.testing.assert_allclose(apart, np.tile(shift, (len(found), 1)), atol=1e-9)


def test_recorded_walks_stand_as_they_do_themselves(real_data):
    """These takes slip by 1.6 cm a stance. Blends did by 4.0, and by 41 at worst."""
    folder = real_data / "cmu07_walk" / "cmu07_walk_positions.npz"
    takes = load_trials(folder)
    X, skeleton = [np.asarray(x, dtype=float) for x in takes.data], takes.skeleton
    steps = DirectionCosines(skeleton), ASpace(0.95), DenseSynchronizer(n_frames=120)
    match = Match.from_estimator(make_pipeline(*steps).fit(X), X)
    slips, own = [], []
    for i, j in ((3, 5), (7, 1), (3, 1), (2, 1), (4, 0)):
        pair, both = [X[i], X[j]], Match(match.times[[i, j]])
        found = blend_trials(both, pair, [1.5, -0.5], skeleton=skeleton)
        for side in SIDES:
            place = at(X[i], f"{side}_ankle", skeleton)
            speed = np.linalg.norm(np.gradient(place[:, [0, 2]], axis=0), axis=1) * 60
            still = (speed < 20) & (place[:, 1] < np.quantile(place[:, 1], 0.05) + 9)
            edges = np.flatnonzero(np.diff(np.concatenate([[0], still, [0]]))).reshape(-1, 2)
            edges = edges[np.diff(edges)[:, 0] >= 8] - [0, 1]
            own += [drift(X[i], f"{side}_ankle", skeleton, slice(a, b + 1)) for a, b in edges]
            frames = of_blend(match, X, i, j, np.array([1.5, -0.5]), len(found), edges)
            slips += [drift(found, f"{side}_ankle", skeleton, f) for f in frames]
    assert len(slips) > 20
    assert np.mean(slips) < 1.05 * np.mean(own)
    assert max(slips) < 2.8
