"""find_trials: planted movements, recordings, parameters and errors."""

import copy
import tracemalloc

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionDetector,
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
    SynchronizationWarning,
)
from sklearn_motionsync.matching.costs import step_table
from sklearn_motionsync.matching.trellis import Trellis
from sklearn_motionsync.matching.warps import normalise
from sklearn_motionsync.takes import find_trials
from sklearn_motionsync.takes.search import (
    Proposer,
    search_windows,
)
from sklearn_motionsync.takes.windows import (
    WindowDissimilarity,
    random_movements,
)

import oracle

COLUMNS = ["take", "start", "stop", "score", "threshold"]


def movement(n_frames, pace=1.0, size=1.0):
    phase = np.linspace(0, 1, n_frames) ** pace
    return size * np.column_stack(
        [np.sin(7 * phase), np.cos(4 * phase) - 1, np.sin(12 * phase) * phase]
    )


def other(n_frames):
    phase = np.linspace(0, 1, n_frames)
    return np.column_stack([np.cos(20 * phase), phase, np.sin(3 * phase) ** 2])


def take_of(parts, n_frames=500, noise=0.02, seed=0):
    """A take of noise about a pose, and movements at frames."""
    take = noise * np.random.default_rng(seed).standard_normal((n_frames, 3))
    for start, part in parts.items():
        take[start : start + len(part)] += part
    return take


def spans(locations):
    return locations[["start", "stop"]].to_numpy().tolist()


# Six subjects, two trials each, each subject at another pace.
SUBJECTS = np.repeat(np.arange(6), 2)
TRAINING = [
    movement(50 + 4 * person + trial, 0.85 + 0.06 * person, 1 + 0.05 * (trial - person / 3))
    for trial, person in enumerate(SUBJECTS)
]
TAKE = take_of({60: movement(62, 1.05), 122: movement(55, 0.9), 300: movement(70), 400: other(60)})
TRUE = [[60, 122], [122, 177], [300, 370]]


@pytest.fixture(scope="module")
def pipe():
    steps = DenseSynchronizer(40), ActionModel()
    return make_pipeline(*steps).fit(TRAINING, actionmodel__groups=SUBJECTS)


# -- results ---------------------------------------------------------------------------------------


def test_adjacent_trials_are_found_and_other_movements_are_not(pipe):
    _, locations = find_trials(pipe, TAKE)
    np.testing.assert_allclose(spans(locations), TRUE, atol=6)
    assert (locations["score"] >= locations["threshold"]).all()
    level = float(locations["score"].nlargest(2).min())
    assert len(find_trials(pipe, TAKE, threshold=level)[1]) == 2
    assert spans(find_trials(pipe, take_of({100: other(60), 300: other(90)}))[1]) == []


def test_pipeline_detector_and_synchronizer_find_the_same(pipe):
    expected = find_trials(pipe, TAKE)[1]
    detector = ActionDetector(pipe).fit(TRAINING, groups=SUBJECTS)
    labels = pd.Series(SUBJECTS, index=np.arange(len(SUBJECTS)) + 7)
    for estimator, groups in ((detector, None), (pipe[0], SUBJECTS), (pipe[0], labels)):
        pd.testing.assert_frame_equal(find_trials(estimator, TAKE, groups=groups)[1], expected)
    linear = LinearSynchronizer(40).fit(TRAINING)
    found = spans(find_trials(linear, TAKE, groups=SUBJECTS)[1])
    np.testing.assert_allclose(found, TRUE, atol=8)


def test_best_window_is_that_of_an_exhaustive_search():
    pattern, shortest, longest = movement(12), 8, 18
    take = take_of({15: movement(13)}, 45, noise=0.1)
    _, locations = find_trials(pattern, take, threshold=None)
    locations = locations.nlargest(1, "score")
    scores = {
        (start, start + n): np.exp(-brute_unlikeness(take[start : start + n], pattern))
        for n in range(shortest, longest + 1)
        for start in range(len(take) - n + 1)
    }
    best = max(scores, key=scores.get)
    assert spans(locations) == [list(best)]
    np.testing.assert_allclose(locations["score"], scores[best], rtol=1e-9)


def brute_unlikeness(window, pattern, n=None):
    """Dissimilarity of a window to a single pattern, by the formulas of the docstrings."""
    n, given = n or len(pattern), len(pattern)
    x, pattern = (
        np.transpose([np.interp(np.linspace(0, len(y) - 1, n), np.arange(len(y)), c) for c in y.T])
        for y in (window, pattern)
    )
    ratios = []
    views = [
        [y - y.mean(axis=0) for y in (x, pattern)],
        [oracle.slow_filter(y, 0.03 * (n - 1), 1) for y in (x, pattern)],
    ]
    stood = 0.1 * n * np.square(x.mean(axis=0) - pattern.mean(axis=0)).sum()
    for (a, b), more in zip(views, (stood, 0), strict=True):
        ratios.append((np.square(a - b).sum() + more) / (np.square(a).sum() + np.square(b).sum()))
    energy = np.log(np.square(views[0][0]).sum() / np.square(views[0][1]).sum())
    length = np.log(len(window) / given)
    # A single trial: the usual variance 0.07 counts like three, the own one is 0.
    return np.mean(ratios) * np.exp(min(0.05 * (energy**2 + length**2) / (0.07 * 3 / 4), 3))


def test_windows_are_compared_at_no_more_than_a_hundred_positions():
    pattern = movement(150)
    take = take_of({0: movement(150, 1.1), 200: 1000 * pattern}, 400, noise=0.1)
    windows = np.array([[0, 150], [10, 130], [3, 160], [200, 350]])
    sync = DenseSynchronizer(150, pattern=0).fit([pattern])
    expected = [brute_unlikeness(take[a:b], pattern, 100) for a, b in windows]
    # However large the movement is, the factor is at most e to the third.
    assert 10 < expected[-1] < 2 * np.exp(3)
    np.testing.assert_allclose(WindowDissimilarity(sync)(take, windows), expected, rtol=1e-9)


def hits_of(scores, proposed, n_frames=60, threshold=0.5, shortest=1, longest=90):
    """Those of a take in which windows have these scores, by (start, stop), and others 0.01."""

    def dissimilarity(take, windows):
        return np.array([-np.log(scores.get(tuple(w), 0.01)) for w in windows.tolist()])

    take, windows = np.zeros((n_frames, 1)), np.array(proposed)
    found = search_windows(take, windows, dissimilarity, shortest, longest, threshold**2)
    return [hit[:3] for hit in found if hit.score >= threshold]


def test_hits_may_touch_each_other_and_the_ends_of_the_take():
    scores = {(0, 20): 0.9, (20, 40): 0.8, (40, 60): 0.7}
    expected = [(*window, pytest.approx(score)) for window, score in scores.items()]
    for order in ([0, 1, 2], [2, 0, 1]):
        assert hits_of(scores, np.array(list(scores))[order]) == expected
    assert hits_of(scores, list(scores), threshold=0.75) == expected[:2]
    # One that overlaps a better one by a frame is none.
    assert hits_of({(0, 21): 0.9, (20, 40): 0.8}, [(0, 21), (20, 40)])[1:] == []
    assert hits_of({(0, 20): 0.8, (19, 40): 0.9}, [(0, 20), (19, 40)])[1:] == []


def test_ends_are_moved_by_an_eighth_and_by_less():
    # From 32 frames by 4, then by 4 no more; by 2; by 1.
    scores = {(10, 42): 0.6, (14, 42): 0.7, (14, 44): 0.8, (13, 45): 0.9, (12, 45): 0.95}
    assert hits_of(scores, [(10, 42)]) == [(12, 45, pytest.approx(0.95))]
    # Neither by 8 nor by 5, nor both ends by different numbers.
    for far in ((2, 42), (10, 47), (6, 44)):
        assert hits_of({(10, 42): 0.6, far: 0.9}, [(10, 42)])[0][:2] == (10, 42)
    # Short windows are moved, too: by 1.
    assert hits_of({(10, 13): 0.6, (11, 14): 0.9}, [(10, 13)])[0][:2] == (11, 14)
    # Into no other hit, to no length that is not allowed, and not out of the take.
    scores = {(10, 42): 0.9, (42, 60): 0.6, (41, 60): 0.7, (42, 59): 0.65, (42, 61): 0.8}
    assert [hit[:2] for hit in hits_of(scores, [(10, 42), (42, 60)])] == [(10, 42), (42, 59)]
    assert hits_of(scores, [(42, 60)], shortest=18, longest=18)[0][:2] == (42, 60)
    assert hits_of({(0, 9): 0.6, (-1, 9): 0.9, (0, 10): 0.7}, [(0, 9)])[0][:2] == (0, 10)


def test_windows_of_twice_the_dissimilarity_of_the_threshold_are_not_refined():
    for proposed, found in ((0.26, True), (0.24, False)):
        hits = hits_of({(10, 42): proposed, (10, 41): 0.9}, [(10, 42)])
        assert [hit[:2] for hit in hits] == [(10, 41)] * found


def test_proposer_has_the_smoothness_and_the_filter_of_the_method():
    sync = DenseSynchronizer(40).fit(TRAINING)
    learnt = Proposer(sync)
    size = np.square(learnt.base).sum(axis=2).mean()
    np.testing.assert_allclose(learnt.trellis.mu, 0.003 * size)
    # The Gaussian has as many frames in a portion, which is longer by the free ends.
    n_frames = 39 + 2 * learnt.trellis.width
    width = learnt.features.velocity_smoothing * n_frames
    np.testing.assert_allclose(width, sync.features_.velocity_smoothing * 39)
    # What is nowhere long enough has no windows.
    assert learnt(np.zeros((29, 3)), *learnt.limits(1.0)).shape == (0, 2)


def test_proposals_are_the_best_paths_of_their_portions():
    sync = DenseSynchronizer(4, pattern=0).fit([movement(4)])
    table, mu, reach = step_table("velocity", 2), 0.1, 2
    proposer = Proposer(sync)
    proposer.trellis = Trellis(table, mu, reach, free=True)
    costs = dict(zip(table.steps, zip(*table[1:4], strict=True), strict=True))
    paths = list(oracle.all_free_paths(4, sorted(costs), 1, reach))
    take, expected = np.random.default_rng(0).standard_normal((12, 3)), set()
    for start in range(0, 9, 2):
        portion = take[np.clip(np.arange(start - reach, start + 4 + reach), 0, 11)]
        moving = proposer.features(proposer.features.unit(portion[np.newaxis]))[0]
        best = min(paths, key=lambda q: oracle.path_cost(proposer.base[0], moving, q, costs, mu, 1))
        ends = start - reach + best[0], start - reach + best[-1] + 1
        expected.add(tuple(np.clip(ends, 0, 12).tolist()))
    assert {tuple(window) for window in proposer.at_scale(take, 4).tolist()} == expected


@pytest.mark.filterwarnings("ignore::sklearn_motionsync.SynchronizationWarning")
def test_sitting_down_is_found_in_recordings_of_a_new_actor(utkinect, real_data):
    file = np.load(real_data / "utkinect" / "utkinect_takes.npz")
    teach = np.flatnonzero((utkinect.target == "sitDown") & (utkinect.actor != "s10"))
    steps = DirectionCosines(utkinect.skeleton), ASpace(), DenseSynchronizer(50), ActionModel()
    pipe = make_pipeline(*steps)
    pipe.fit([utkinect.data[i] for i in teach], actionmodel__groups=utkinect.actor[teach])
    searched = np.flatnonzero(file["actor"] == "s10")
    frames = np.split(file["positions"].reshape(len(file["positions"]), -1), file["offsets"][1:-1])
    _, locations = find_trials(pipe, [frames[i] for i in searched])
    segments = pd.DataFrame({k: file[f"segment_{k}"] for k in ("take", "label", "start", "stop")})
    true = segments[segments["label"] == "sitDown"].set_index("take")[["start", "stop"]]
    assert len(locations) == 2
    for take, start, stop in locations[["take", "start", "stop"]].to_numpy().astype(int):
        first, last = true.loc[searched[take]]
        shared = min(stop, last) - max(start, first)
        assert shared >= 0.5 * (stop - start + last - first - shared)


# -- kinds of input --------------------------------------------------------------------------------


def test_tables_keep_names_and_float32_stays_float32(pipe):
    table = pd.DataFrame(TAKE, columns=["hip", "knee", "ankle"])
    sync = DenseSynchronizer(40).fit([pd.DataFrame(x, columns=table.columns) for x in TRAINING])
    takes = pd.concat([table.iloc[:250], table], keys=["ann", "bob"])
    trials, locations = find_trials(sync, takes)
    assert locations["take"].tolist() == ["ann"] * 2 + ["bob"] * 3
    assert trials[4].attrs["trial"] == ("bob", 2)
    assert list(trials[0].columns) == ["hip", "knee", "ankle"]
    turned = find_trials(sync, table[["knee", "hip", "ankle"]])[1]
    assert spans(turned) == spans(locations[locations["take"] == "bob"])
    with pytest.raises(ValueError, match="names"):
        find_trials(sync, table.rename(columns={"hip": "chest"}))
    single, there = find_trials(pipe, TAKE.astype(np.float32))
    assert {part.dtype for part in single} == {np.dtype(np.float32)}
    assert spans(there) == spans(find_trials(pipe, TAKE)[1])


def test_unit_does_not_matter_and_input_is_not_changed(pipe):
    large = TAKE * 2.0**20
    large.setflags(write=False)
    sync = DenseSynchronizer(40).fit([x * 2.0**20 for x in TRAINING])
    before = sorted(vars(sync))
    found = find_trials(sync, large, groups=SUBJECTS)[1]
    assert spans(found) == spans(find_trials(pipe, TAKE)[1])
    assert sorted(vars(sync)) == before


def test_rows_are_takes_of_one_feature():
    row = np.sin(np.linspace(0, 9, 50))
    take = np.concatenate([np.zeros(70), row, np.full(60, row[-1])])
    assert spans(find_trials(row, take)[1].nlargest(1, "score")) == [[70, 120]]


@pytest.mark.parametrize("take", [np.ones((300, 3)), np.ones((4, 3)), movement(20)])
def test_takes_without_the_action_give_no_hits(pipe, take):
    for pattern in (pipe, movement(60)):
        rates = {"frame_rate": 30, "pattern_rate": 30}
        trials, locations = find_trials(pattern, take, **rates)
        assert trials == []
        assert list(locations.columns) == COLUMNS
        assert locations[["start", "stop"]].dtypes.tolist() == [np.dtype(int)] * 2


# -- frame rates ----------------------------------------------------------------------------------


def table(x, rate=None):
    """A table at so many frames a second, of frames recorded at 30."""
    at = np.arange(0, len(x) - 1 + 1e-9, 30 / (rate or 30))
    columns = [np.interp(at, np.arange(len(x)), column) for column in np.transpose(x)]
    df = pd.DataFrame(np.transpose(columns), columns=["hip", "knee", "ankle"])
    return df if rate is None else attributed(df, frame_rate=rate)


def attributed(df, **attrs):
    df.attrs |= attrs
    return df


@pytest.fixture(scope="module")
def at_30():
    steps = DenseSynchronizer(40), ActionModel()
    X = [table(x, 30) for x in TRAINING]
    return make_pipeline(*steps).fit(X, actionmodel__groups=SUBJECTS)


@pytest.mark.parametrize("rate", [7.5, 120])
def test_takes_of_another_frame_rate_have_hits_of_as_many_seconds(at_30, rate):
    take = table(TAKE, rate)
    trials, locations = find_trials(at_30, take)
    np.testing.assert_allclose(np.array(spans(locations)) * 30 / rate, TRUE, atol=6)
    assert (locations["stop"].to_numpy()[:-1] <= locations["start"].to_numpy()[1:]).all()
    for part, (start, stop) in zip(trials, spans(locations), strict=True):
        np.testing.assert_array_equal(part, take.iloc[start:stop])
        assert part.attrs["frame_rate"] == rate
    by_index = take.set_axis(pd.Index(np.arange(len(take)) / rate, name="time"))
    by_index.attrs.clear()
    pd.testing.assert_frame_equal(find_trials(at_30, by_index)[1], locations)
    together = find_trials(at_30, [table(TAKE, 30), take])[1]
    own = together[together["take"] == 1].assign(take=0).reset_index(drop=True)
    pd.testing.assert_frame_equal(own, locations)


def test_patterns_have_frame_rates(pipe, at_30):
    take, pattern = table(TAKE, 120), table(movement(60), 30)
    found = np.array(spans(find_trials(pattern, take)[1]))
    np.testing.assert_allclose(found / 4, TRUE, atol=6)
    assert spans(find_trials(at_30, table(TAKE[:2], 120).iloc[:3])[1]) == []
    # What is given goes before what tables tell.
    expected = find_trials(at_30, take)[1]
    wrong = attributed(take.copy(), frame_rate=29)
    pd.testing.assert_frame_equal(find_trials(at_30, wrong, frame_rate=120)[1], expected)
    arrays = [take.to_numpy(), TAKE]
    parts, found = find_trials(pipe, arrays, frame_rate=[120, 30], pattern_rate=30)
    first = found["take"] == 0
    assert spans(found[first]) == spans(expected)
    assert spans(found[~first]) == spans(find_trials(pipe, TAKE)[1])
    np.testing.assert_array_equal(parts[0], arrays[0][slice(*spans(found)[0])])
    assert len(find_trials(TRAINING[0], arrays[0], frame_rate=120, pattern_rate=30)[1]) == 3


def test_warns_if_one_frame_rate_only_is_known(pipe, at_30):
    with pytest.warns(UserWarning, match=r"Trial 1 has no known .* the pattern has 30 frames"):
        assert len(find_trials(at_30, [table(TAKE, 30), table(TAKE)])[1]) == 6
    sync = DenseSynchronizer(40).fit([table(x) for x in TRAINING])
    with pytest.warns(UserWarning, match=r"The pattern has no known .* trial 0 has 60 frames"):
        find_trials(sync, table(TAKE, 60))
    for rate in (0.2, 4000):
        with pytest.raises(ValueError, match=rf"Trial 0 has {rate} frames .* the pattern 30"):
            find_trials(at_30, attributed(table(TAKE), frame_rate=rate))
    with pytest.warns(UserWarning, match="Trial 1 has 60 frames"):
        sync = DenseSynchronizer(40).fit([table(TRAINING[0], 30), table(TRAINING[1], 60)])
    with pytest.warns(UserWarning, match="The pattern has no known"):
        find_trials(sync, table(TAKE, 60))


def test_rates_within_a_hundredth_are_one(at_30):
    take = table(TAKE, 30)
    found = find_trials(at_30, attributed(take.copy(), frame_rate=29.97))[1]
    pd.testing.assert_frame_equal(found, find_trials(at_30, take)[1])


# -- threshold and number of hits ------------------------------------------------------------------


@pytest.fixture(scope="module")
def noisy():
    """Training trials with noise, and what is fitted to them."""
    rng = np.random.default_rng(0)
    X = [x + 0.3 * rng.standard_normal(x.shape) for x in TRAINING]
    with pytest.warns(SynchronizationWarning):
        return X, DenseSynchronizer(40).fit(X)


def test_auto_threshold_falls_with_coverage(noisy):
    X, sync = noisy
    origins = [find_trials(sync, X, coverage=c, groups=SUBJECTS)[1] for c in (0.3, 0.7, 0.95)]
    thresholds = [locations["threshold"].iloc[0] for locations in origins]
    assert 0.87 > thresholds[0] > thresholds[1] > thresholds[2] > 0.5
    assert all((locations["score"] >= locations["threshold"]).all() for locations in origins)
    # The model knows the groups; by themselves trials of a subject resemble each other.
    model = ActionModel().fit(sync.transform(X), groups=SUBJECTS)
    for pattern, equal in ((make_pipeline(sync, model), True), (sync, False)):
        found = find_trials(pattern, X, coverage=0.7)[1]["threshold"].iloc[0]
        assert (found == thresholds[1]) == equal


def wander(n_frames, rng):
    """Moving averages over 20 frames of white noise in two features."""
    noise = rng.standard_normal((n_frames + 19, 2))
    return np.lib.stride_tricks.sliding_window_view(noise, 20, axis=0).sum(axis=2) / np.sqrt(20)


def test_auto_threshold_rejects_random_movements():
    """One in 200 of them is below it; their length costs nothing."""
    rng = np.random.default_rng(0)
    bump = np.sin(np.linspace(0, np.pi, 20))[:, np.newaxis]
    training = [bump * [1, 0.5 * (-1) ** k] + 0.8 * wander(20, rng) for k in range(9)]
    shorter = [x[: 12 + k] for k, x in enumerate(training)]
    sync = DenseSynchronizer(20, metric=None).fit(shorter)
    usual = copy.copy(sync)
    usual.lengths_ = np.full(9, 20)
    measure = WindowDissimilarity(usual)
    positions = normalise(list(sync.examples_.astype(float)), 20)
    (some,) = random_movements(positions, [1000])
    windows = np.arange(0, 20000, 20)[:, np.newaxis] + [0, 20]
    limit = np.quantile(measure(some.reshape(20000, 2), windows), 0.005)
    np.testing.assert_allclose(WindowDissimilarity(sync).threshold(0.99), limit, rtol=1e-6)


def test_threshold_of_a_take_rejects_a_crowd_and_lies_in_gaps():
    measure = WindowDissimilarity(DenseSynchronizer(40).fit(TRAINING), SUBJECTS)
    logs, limit = np.log(measure.known), 0.4
    spread = np.sqrt((np.square(logs - logs.mean()).sum() + 3 * 0.07) / (len(logs) + 3))

    def value(level, hits, n):
        """What is maximised."""
        share = norm.cdf((np.log(1.5 * level) - logs.mean()) / spread)
        near = np.exp(-np.square(np.log(hits / level) / 0.05) / 2).sum()
        return share - (0.02 * (hits < level).sum() + 0.1 * near) / n

    assert measure.threshold_of_take(limit, np.empty(0), 1000) == pytest.approx(limit)
    typical = np.exp(np.log([len(x) for x in TRAINING]).mean())
    for hits in ([0.1, 0.39], [0.11, *np.linspace(0.2, 0.4, 60)], [0.3] * 9):
        hits = np.array(hits)
        for n_lengths, n in ((9, 1), (45, 1), (450, 10)):
            found = measure.threshold_of_take(limit, hits, n_lengths * typical)
            best = max(value(level, hits, n) for level in np.linspace(0.1, limit, 600))
            assert value(found, hits, n) == pytest.approx(best, abs=0.01)
            assert found < limit or n > 1
    # Of a single trial nothing is known.
    alone = WindowDissimilarity(DenseSynchronizer(40, pattern=0).fit(TRAINING[:1]))
    assert alone.threshold_of_take(0.5, np.linspace(0.1, 0.5, 99), 900) == 0.5


def test_threshold_of_a_take_is_that_of_the_take(noisy, capsys):
    crowd = take_of({k: movement(60, 0.7 + k / 1500) for k in range(0, 900, 65)}, 960, 0.4)
    _, both = find_trials(noisy[1], [TAKE, crowd], threshold=None, verbose=1)
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith("[find_trials] searching: 100 %")
    for i, take in enumerate((TAKE, crowd)):
        alone = find_trials(noisy[1], take, threshold=None)[1]
        own = both[both["take"] == i].assign(take=0).reset_index(drop=True)
        pd.testing.assert_frame_equal(own, alone)
        auto = find_trials(noisy[1], take)[1]
        kept = alone[alone["score"] >= alone["threshold"]]
        assert auto.to_numpy().tolist() == kept.to_numpy().tolist()
    assert both.groupby("take")["threshold"].nunique().tolist() == [1, 1]
    assert both["threshold"].nunique() == 2
    # Windows are up to a tenth shorter and longer than the training trials.
    shortest, *_, longest = sorted(map(len, TRAINING))
    sizes = both["stop"] - both["start"]
    assert sizes.between(shortest / 1.1 - 1, np.ceil(longest * 1.1)).all()


def test_auto_threshold_of_trials_that_share_nothing_is_at_most_half_of_all_scores():
    noise = list(np.random.default_rng(0).standard_normal((12, 40, 30)))
    dissimilarity = WindowDissimilarity(DenseSynchronizer(40, metric=None).fit(noise))
    assert dissimilarity.threshold(0.95) == 0.7


def test_chance_movements_have_mean_covariance_and_autocorrelation_of_the_poses():
    positions = np.random.default_rng(0).standard_normal((30, 50, 3)) * [3, 1, 0] + [5, 0, 7]
    (some,) = random_movements(positions, [2000])
    mean, spread = some.mean(axis=(0, 1)), np.std(some[:, [0, -1]], axis=(0, 1))
    np.testing.assert_allclose(mean, positions.mean(axis=(0, 1)), atol=0.15)
    np.testing.assert_allclose(spread, [3, 1, 0], rtol=0.1, atol=1e-9)
    # Half a length later exp(-1/2) of it is left.
    left = [np.corrcoef(some[:, 10, k], some[:, 35, k])[0, 1] for k in (0, 1)]
    np.testing.assert_allclose(left, np.exp(-0.5), atol=0.08)
    np.testing.assert_array_equal(some, next(random_movements(positions, [2000])))


def test_large_training_sets_are_subsampled():
    many = [movement(57 + i % 7, 0.9 + i / 500, 1 + i / 300) for i in range(70)]
    sync = LinearSynchronizer(30).fit(many)
    assert len(sync.examples_) == 64
    assert len(sync.lengths_) == 70
    groups = [f"subject {i // 8}" for i in range(70)]
    _, locations = find_trials(sync, TAKE[:130], groups=groups)
    np.testing.assert_allclose(spans(locations), TRUE[:1], atol=8)
    pipe = make_pipeline(sync, ActionModel()).fit(many, actionmodel__groups=groups)
    with pytest.warns(UserWarning, match="groups of 64 of 70 .* Give groups"):
        find_trials(pipe, TAKE[:60])


def test_warns_if_the_model_was_updated_with_other_trials():
    many = [movement(30 + i, 0.9 + i / 20, 1) for i in range(6)]
    sync = LinearSynchronizer(30).fit(many)
    model = ActionModel().fit(sync.transform(many[:4]), groups=[0, 0, 1, 1])
    model.partial_fit(sync.transform(many[2:]), groups=[0, 0, 1, 1])
    with pytest.warns(UserWarning, match="groups of 8 of 8 .* fitted on 6: .* Give groups"):
        find_trials(make_pipeline(sync, model), TAKE[:60])


def test_memory_does_not_grow_with_the_take(pipe):
    take = np.concatenate([TAKE] * 12)
    tracemalloc.start()
    _, locations = find_trials(pipe, take)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(locations) >= 36
    assert peak < 8e6


# -- errors ----------------------------------------------------------------------------------------


GAP = TAKE.copy()
GAP[7, 1] = np.nan
ROWS = DenseSynchronizer().fit(np.stack([TAKE[:60, 0], TAKE[60:120, 0]]))


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"threshold": 1.5}, "The 'threshold' parameter"),
        ({"threshold": "learned"}, "The 'threshold' parameter"),
        ({"coverage": 1}, "The 'coverage' parameter"),
        ({"frame_rate": [30, 30]}, "frame_rate must be one number above 0"),
        ({"X": [TAKE, GAP]}, r"Trial 1.*frame 7"),
        ({"X": TAKE[:, :2]}, "2 features"),
        ({"X": TAKE[:1]}, "at least 2 frames"),
        ({"pattern": movement(2)}, "give one trial"),
        ({"pattern": movement(60), "groups": [1]}, "an array has none"),
        ({"pattern": GAP}, "Trial 0, frame 7"),
        ({"pattern": TRAINING}, "a synchronizer that was fitted to several"),
        ({"pattern": ROWS, "X": TAKE[:, 0]}, "rows of a 2-D array"),
        ({"pattern": np.ones((30, 3))}, "The pattern does not move"),
        ({"pattern": DenseSynchronizer()}, "not fitted"),
        ({"pattern": ASpace().fit(TRAINING)}, "no synchronizer"),
    ],
)
def test_refuses_invalid_parameters(pipe, params, message):
    with pytest.raises(ValueError, match=message):
        find_trials(**({"pattern": pipe, "X": TAKE} | params))
