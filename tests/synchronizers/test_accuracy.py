"""How accurate: the elastic distance, the paper's method and real people."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.matching.costs import COSTS, step_table
from sklearn_motionsync.matching.matcher import cost_features
from sklearn_motionsync.matching.trellis import Trellis

from oracle import FEATURES, brute_force, plain_loops, step_costs

P = 100


# -- the costs against oracles of their own ---------------------------------------------


@pytest.mark.parametrize("pattern", ["median", 1])
def test_paper_settings_equal_all_admissible_paths(pattern):
    rng = np.random.default_rng(0)
    X = rng.standard_normal((4, 7, 2))
    sync = DenseSynchronizer.paper(pattern=pattern, smoothness=0.2, max_offset=0.5).fit(X)
    mu = 0.2 * np.square(X - X.mean(axis=(0, 1))).sum(axis=2).mean()
    np.testing.assert_allclose(sync.mu_, mu)
    settings = step_costs("pose", 2, 1), mu, 1, 3
    if pattern == "median":
        sums = [sum(brute_force(x, y, *settings)[0] for y in X) for x in X]
        np.testing.assert_allclose(sync.global_distances_, sums, rtol=1e-10)
        assert sync.pattern_index_ == np.argmin(sums)
    match = sync.match(X)
    for m, x in enumerate(X):
        best, paths = brute_force(X[sync.pattern_index_], x, *settings)
        np.testing.assert_allclose(match.distances[m], best, rtol=1e-10, atol=1e-12)
        assert tuple(match.times[m].astype(int)) in paths
        np.testing.assert_array_equal(match.offsets[m], match.times[m] - np.arange(7))


@pytest.mark.parametrize("cost", COSTS)
def test_distances_equal_oracle_of_the_cost(cost):
    rng, P = np.random.default_rng(1), 45
    X = np.cumsum(rng.standard_normal((3, P, 2)), axis=1)
    features = np.stack([FEATURES[cost](x - X.mean(axis=(0, 1)), 1, 0.03 * 44) for x in X])
    settings = {"cost": cost, "pattern": 0, "smoothness": 0.1, "max_offset": 0.2, "max_rate": 3}
    sync = DenseSynchronizer(consensus=0, **settings).fit(X)
    mu = 0.1 * np.square(features).sum(axis=2).mean()
    np.testing.assert_allclose(sync.mu_, mu)
    costs = step_costs(cost, 3, 1)
    expected = [plain_loops(features[0], y, costs, mu, 1, 9) for y in features]
    np.testing.assert_allclose(sync.match(X).distances, expected, rtol=1e-9, atol=1e-9)


def curve(phase):
    """A smooth closed path in space."""
    return np.column_stack(
        [np.sin(2 * np.pi * phase), np.cos(2 * np.pi * phase), np.sin(4 * np.pi * phase)]
    )


def other_curve(phase):
    return 1.2 * curve(phase) + 0.3 * np.column_stack(
        [np.cos(4 * np.pi * phase), np.sin(2 * np.pi * phase), np.cos(2 * np.pi * phase)]
    )


def elastic_distance(x, y, subframes=8):
    """Squared Fisher-Rao distance, by the trellis alone (no penalty, hardly any smoothing)."""
    fine = [
        np.column_stack(
            [
                np.interp(np.arange(0, len(z) - 1 + 1e-9, 1 / subframes), np.arange(len(z)), c)
                for c in z.T
            ]
        )
        for z in (x, y)
    ]
    q = cost_features(np.stack(fine), "elastic", smoothing=0.004, pace=subframes)
    table = step_table("elastic", max_rate=5, subframes=subframes)
    trellis = Trellis(table, 0.0, len(x) // 3)
    return trellis.distances(q[:1, ::subframes], q[1:])[0, 0]


def test_elastic_distance_equals_fdasrsf():
    """fdasrsf 2.7.3 (curve_to_q without scaling, optimum_reparam_curve) gives 0.7281, 0.7175 and
    0.7169 on 151, 301 and 601 points; its slopes are a coarser set, so it stays above the minimum.
    """
    t = np.linspace(0, 1, 301)
    found = elastic_distance(curve(t), other_curve(t))
    assert 0.97 * 0.7169 < found < 0.7169


# -- real people ------------------------------------------------------------------------


# The best of tslearn, dtaidistance, gdtw, fdasrsf and aeon, each at its best setting, mean
# and median over all ordered pairs: docs/accuracy.md.
EVENTS = {
    # action, joint, extreme: (peers' mean, median), share of both that is asked for, settings.
    # The pelvis of the bends is a price of the metric: in the median gdtw is closer.
    ("depositFloorR", "root", np.argmin): ((6.33, 1.46), (0.75, 1.25), {}),
    ("depositFloorR", "root", np.argmin, "plain"): ((6.33, 1.46), (0.7, 1), {"metric": None}),
    ("depositFloorR", "rhand", np.argmin): ((5.91, 2.56), (0.7, 0.8), {}),
    ("elbowToKnee1RepsLelbowStart", "rtibia", np.argmax): ((2.86, 2.10), (0.95, 1.01), {}),
}


@pytest.fixture(scope="module")
def times_of():
    """Times of all trials on the clock of each of them: found once for all joints."""
    known = {}

    def times(action, settings, X, skeleton):
        key = action, *settings
        if key not in known:
            points = ASpace().fit_transform(DirectionCosines(skeleton).fit_transform(X))
            fitted = [DenseSynchronizer(P, n, **settings).fit(points) for n in range(len(X))]
            assert not any(sync.refines_ for sync in fitted)
            known[key] = [sync.match(points).times for sync in fitted]
        return known[key]

    return times


# The bends by default; what takes warps of its own is left to the night.
@pytest.mark.parametrize(
    "event",
    [
        pytest.param(event, id="-".join((*event[:2], *event[3:])), marks=marks)
        for event, marks in zip(
            EVENTS, [(), pytest.mark.nightly, (), pytest.mark.nightly], strict=True
        )
    ],
)
def test_key_moment_errors_of_real_people(event, hdm05, times_of):
    action, joint, extreme = event[:3]
    (peer_mean, peer_median), (share, most), settings = EVENTS[event]
    X = [x for x, t in zip(hdm05.data, hdm05.target, strict=True) if t == action]
    height = [x[:, 3 * hdm05.joints.index(joint) + 1].astype(float) for x in X]
    moments = np.array(
        [extreme(gaussian_filter1d(h, 0.015 * len(h))) * (P - 1) / (len(h) - 1) for h in height]
    )
    errors = []
    for n, times in enumerate(times_of(action, settings, X, hdm05.skeleton)):
        landed = [np.interp(moments[n], np.arange(P), tau) for tau in times]
        errors.append(np.delete(np.abs(landed - moments), n))
    assert np.mean(errors) <= share * peer_mean
    assert np.median(errors) <= most * peer_median


def test_warps_hardly_depend_on_being_in_the_training_set(bends):
    poses = DirectionCosines(bends.skeleton).fit_transform(bends.data)
    X = ASpace(12).fit_transform(poses)
    sync = DenseSynchronizer(P).fit(X)
    k = sync.exemplars_[0]
    others = [x for i, x in enumerate(X) if i != k]
    without = DenseSynchronizer(P, pattern=sync.pattern_).fit(others)
    moved = np.abs(without.match([X[k]]).times - sync.match([X[k]]).times)
    assert np.median(moved) < 1.5
