"""Modes: sets of several ways of doing a movement are told from ordinary ones, and kept apart."""

import itertools
import pickle

import numpy as np
import pytest
from sklearn.metrics import silhouette_samples
from sklearn_motionsync import (
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
    Match,
)
from sklearn_motionsync.datasets import load_performances
from sklearn_motionsync.matching.modes import DistanceTable, Modes, cut_in_two, least_silhouette

P = 60
PEAKS = {0: [0.5], 1: [0.3, 0.7]}


def made(strokes, seed=0, n_frames=P):
    """Trials of so many strokes, and the times of their peaks in frames of the clock."""
    rng = np.random.default_rng(seed)
    t, X, peaks = np.linspace(0, 1, n_frames), [], []
    direction = np.random.default_rng(99).standard_normal((2, 6))
    for mode in strokes:
        own = np.array(PEAKS[mode]) + rng.uniform(-0.08, 0.08)
        strike = sum(np.exp(-(((t - p) / 0.07) ** 2)) for p in own)
        lift = np.gradient(strike) * 8
        x = strike[:, np.newaxis] * direction[0] + lift[:, np.newaxis] * direction[1]
        X.append(x * rng.uniform(0.9, 1.1) + 0.03 * rng.standard_normal(x.shape))
        peaks.append(own * (P - 1))
    return X, peaks


def apart(monkeypatch):
    """Fits that take every set for one mode."""
    monkeypatch.setattr(DistanceTable, "modes", lambda self, n, store: Modes.single(n))


def test_one_stroke_or_two():
    strokes = np.array([1, 0, 0] * 6)
    sync = DenseSynchronizer(P).fit(made(strokes)[0])
    np.testing.assert_array_equal(sync.modes_.labels, strokes)
    np.testing.assert_allclose(sync.modes_.shares, [2 / 3, 1 / 3])
    # New trials are told apart, too, and the more frequent mode is number 0.
    new = np.array([0, 1, 1, 0, 1])
    np.testing.assert_array_equal(sync.match(made(new, seed=5)[0]).mode, new)
    other = DenseSynchronizer(P).fit(made(1 - strokes)[0])
    np.testing.assert_array_equal(other.modes_.labels, strokes)


def test_three_modes_are_found_one_after_the_other():
    PEAKS[2] = [0.2, 0.5, 0.8]
    try:
        strokes = np.array([2] * 5 + [1] * 4 + [0] * 6)
        labels = DenseSynchronizer(P).fit(made(strokes)[0]).modes_.labels
    finally:
        del PEAKS[2]
    np.testing.assert_array_equal(labels, [1] * 5 + [2] * 4 + [0] * 6)


@pytest.mark.parametrize("strokes", [[0] * 12, [1] * 12, [0] * 10 + [1] * 2])
def test_an_ordinary_set_and_odd_trials_are_one_mode(strokes, monkeypatch):
    X, _ = made(strokes)
    sync = DenseSynchronizer(P).fit(X)
    np.testing.assert_array_equal(sync.modes_.labels, 0)
    np.testing.assert_array_equal(sync.modes_.shares, [1])
    assert not sync.match(X).mode.any()
    # To the last bit what it is if no modes are looked for.
    apart(monkeypatch)
    np.testing.assert_array_equal(DenseSynchronizer(P).fit(X).match(X).times, sync.match(X).times)


def errors_and_spreads(sync, X, peaks, strokes, pattern):
    """Of each mode: mean error against the pattern's peaks, and spread on the clock."""
    times, clock, found = sync.match(X).times, np.arange(P), {}
    for mode in (0, 1):
        own = [i for i in range(len(X)) if strokes[i] == mode and i != pattern]
        places = [np.interp(peaks[i], times[i] + 1e-9 * clock, clock) for i in own]
        spread = np.std(places, axis=0).mean()
        error = np.nan
        if strokes[pattern] == mode:
            error = np.abs(np.array(places) - peaks[pattern]).mean()
        found[mode] = error, spread
    return found


@pytest.mark.parametrize("home", [0, 1])
def test_votes_stay_within_modes(home, monkeypatch):
    """Peaks of both modes come together, whichever mode the template is of."""
    strokes = np.array([home] * 4 + [1 - home] * 9)
    X, peaks = made(strokes, seed=1)
    sync = DenseSynchronizer(P, pattern=0).fit(X)
    found = errors_and_spreads(sync, X, peaks, strokes, 0)
    assert found[home][0] < 1
    assert max(found[0][1], found[1][1]) < 1
    apart(monkeypatch)
    mixed = errors_and_spreads(DenseSynchronizer(P, pattern=0).fit(X), X, peaks, strokes, 0)
    assert np.nanmax([*mixed[0], *mixed[1]]) > 5


def test_one_warp_joins_two_modes():
    """Of a mode all times are those of one common warp, on the clock of its own template."""
    strokes = np.array([0] * 8 + [1] * 6)
    X, _ = made(strokes)
    times = DenseSynchronizer(P, pattern=0, refine=False).fit(X).match(X).times
    misses = []
    for template in range(8, 14):
        own = DenseSynchronizer(P, pattern=template, refine=False).fit(X).match(X).times
        joined = np.array([np.interp(times[template], np.arange(P), own[k]) for k in range(8, 14)])
        misses.append(np.abs(joined - times[8:]).max())
    # The template of the mode is one of them.
    assert min(misses) < 1e-9 < sorted(misses)[1]


def test_distances_are_of_direct_paths(monkeypatch):
    X, _ = made([0] * 7 + [1] * 7)
    found = DenseSynchronizer(P, pattern=0).fit(X).match(X).distances
    apart(monkeypatch)
    expected = DenseSynchronizer(P, pattern=0).fit(X).match(X).distances
    np.testing.assert_allclose(found, expected)


def test_a_performance_is_warped_alike_alone_and_together():
    strokes = np.array([0, 1, 1, 0, 1, 0, 0, 1, 0, 1])
    X, _ = made(strokes)
    sync = DenseSynchronizer(P).fit(X)
    together = sync.match(X)
    for i, x in enumerate(X):
        alone = sync.match([x])
        np.testing.assert_array_equal(alone.times[0], together.times[i])
        assert alone.mode[0] == together.mode[i] == sync.modes_.labels[i]
    np.testing.assert_allclose(sync.transform(X), together.warp(X))
    again = pickle.loads(pickle.dumps(sync)).match(X)
    np.testing.assert_array_equal(again.times, together.times)
    np.testing.assert_array_equal(again.mode, together.mode)


@pytest.mark.parametrize("search", ["sampled", "exhaustive"])
def test_many_performances_are_told_by_landmarks(search):
    strokes = np.array([0, 1, 0] * 40)
    X, _ = made(strokes, n_frames=30)
    sync = DenseSynchronizer(30, search=search).fit(X)
    np.testing.assert_array_equal(sync.modes_.labels, strokes)


def test_left_out_of_a_sample_is_unknown():
    strokes = np.array([0, 1, 0] * 20)
    X, _ = made(strokes, n_frames=30)
    sync = DenseSynchronizer(30, max_fit=30).fit(X)
    labels, known = sync.modes_.labels, sync.sample_
    np.testing.assert_array_equal(labels[known], strokes[known])
    np.testing.assert_array_equal(np.delete(labels, known), -1)


@pytest.mark.parametrize("home", [0, 1])
def test_a_template_that_is_given(home):
    strokes = np.array([0] * 7 + [1] * 5)
    X, peaks = made(strokes)
    given = made([home], seed=11)
    sync = DenseSynchronizer(P, pattern=given[0][0]).fit([*X])
    np.testing.assert_array_equal(sync.modes_.labels, strokes)
    found = errors_and_spreads(
        sync, [*X, given[0][0]], [*peaks, given[1][0]], [*strokes, home], len(X)
    )
    assert found[home][0] < 1


def test_refined_and_direct_warps():
    strokes = np.array([0] * 7 + [1] * 5)
    X, peaks = made(strokes)
    refined = DenseSynchronizer(P, refine=True).fit(X)
    found = errors_and_spreads(refined, X, peaks, strokes, refined.pattern_index_)
    assert max(found[0][1], found[1][1]) < 0.6
    direct = DenseSynchronizer(P, consensus=0).fit(X)
    assert not direct.match(X).mode.any()


def test_the_cut_leaves_the_least_variance_within():
    rng = np.random.default_rng(0)
    for n in (6, 7, 11):
        values = rng.standard_normal(n)
        share, halves = cut_in_two(values)
        best = np.inf
        for count in range(3, n - 2):
            for some in itertools.combinations(range(n), count):
                low, high = values[list(some)], np.delete(values, some)
                if low.max() < high.min():
                    within = low.var() * len(low) + high.var() * len(high)
                    best = min(best, within / (values.var() * n))
        np.testing.assert_allclose(share, best)
        assert values[halves == 0].max() < values[halves == 1].min()
    assert cut_in_two(np.ones(8))[0] == 1


def test_silhouettes_are_those_of_scikit_learn():
    points = np.random.default_rng(0).standard_normal((9, 2))
    distances = np.square(points[:, np.newaxis] - points).sum(axis=2)
    halves = np.array([0] * 4 + [1] * 5)
    expected = silhouette_samples(distances, halves, metric="precomputed")
    smaller = min(expected[:4].mean(), expected[4:].mean())
    np.testing.assert_allclose(least_silhouette(distances, halves), smaller)


def test_a_match_says_the_modes():
    clock = np.arange(4.0)
    match = Match([clock] * 3, mode=[0, 1, 0])
    assert repr(match) == (
        "Match(3 performances on 4 frames, several ways of doing it: 2 in mode 0, 1 in mode 1)"
    )
    table = match.to_frame()
    np.testing.assert_array_equal(table["mode"].unstack().to_numpy(), [[0] * 4, [1] * 4, [0] * 4])
    plain = Match([clock] * 3)
    assert plain.mode.tolist() == [0, 0, 0]
    assert "mode" not in plain.to_frame().columns
    assert repr(plain) == "Match(3 performances on 4 frames)"
    for wrong in ([0, 1], [0.5, 1, 1]):
        with pytest.raises(ValueError, match="mode must be one whole number for each"):
            Match([clock] * 3, mode=wrong)
    assert pickle.loads(pickle.dumps(match)).mode.tolist() == [0, 1, 0]
    X, _ = made([0] * 3)
    assert LinearSynchronizer(P).fit(X).match(X).mode.tolist() == [0, 0, 0]


def test_modes_of_collections_that_are_read_in_parts():
    class Source:
        def __init__(self, X):
            self.X = X

        def __len__(self):
            return len(self.X)

        def __getitem__(self, i):
            return self.X[i]

    strokes = np.array([0, 1] * 6)
    X, _ = made(strokes)
    sync = DenseSynchronizer(P).fit(X)
    np.testing.assert_array_equal(sync.match(Source(X)).mode, sync.modes_.labels)


@pytest.fixture(scope="module")
def hdm05(real_data):
    """Points of clips of HDM05, in an aSpace of the chosen clips."""
    bunch = load_performances(real_data / "hdm05" / "hdm05_positions.npz")

    def points(*chosen):
        clips = [bunch.data[i] for i in np.concatenate(chosen)]
        return ASpace().fit_transform(DirectionCosines(bunch.skeleton).fit_transform(clips))

    names = {name: np.flatnonzero(bunch.target == name) for name in np.unique(bunch.target)}
    return names, points


def test_people_doing_one_thing_are_one_mode(hdm05):
    names, points = hdm05
    assert len(names) == 6
    for clips in names.values():
        assert not DenseSynchronizer(P, refine=False).fit(points(clips)).modes_.labels.any()


def test_people_doing_two_things_are_two_modes(hdm05):
    names, points = hdm05
    jog, knee = names["jogLeftCircle4StepsRstart"], names["elbowToKnee1RepsLelbowStart"]
    for few, many in ((jog[:4], knee[:12]), (knee[:12:3], jog[:12])):
        sync = DenseSynchronizer(P, refine=False).fit(points(few, many))
        expected = [1] * len(few) + [0] * len(many)
        np.testing.assert_array_equal(sync.modes_.labels, expected)
