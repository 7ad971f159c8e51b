"""compare_groups: statistics against SciPy and slow versions, answers, designs, refusals."""

from itertools import permutations

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from sklearn.base import clone
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import DenseSynchronizer, FrameWise, LinearSynchronizer
from sklearn_motionsync.comparison import compare_groups
from sklearn_motionsync.comparison.study import Design, Study, enhanced, families, scaled
from sklearn_motionsync.datasets import make_gait
from sklearn_motionsync.utils.parallel import Progress

P = 61


def studied(people=16, **params):
    """Gait of two cycles a person and a synchronizer; features in units of their spread."""
    gait = make_gait(people, 2, random_state=0, **params)
    pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(P)).fit(gait.data)
    return gait, pipe


@pytest.fixture(scope="module")
def late():
    return studied(timing=6)


@pytest.fixture(scope="module")
def few():
    """Curves of one feature that need no warp, for designs."""
    rng, t = np.random.default_rng(1), np.linspace(0, 1, 30)
    X = [np.sin(3 * t)[:, np.newaxis] + 0.1 * rng.standard_normal((30, 1)) for _ in range(16)]
    return X, LinearSynchronizer(30).fit(X)


# -- the statistics -----------------------------------------------------------------------


def slow_enhancement(z, step=0.1):
    """Run by run and height by height."""
    out = np.zeros(len(z))
    for sign in (1, -1):
        for p in range(len(z)):
            for h in np.arange(step, sign * z[p] + 1e-9, step):
                first = last = p
                while first > 0 and sign * z[first - 1] >= h - 1e-9:
                    first -= 1
                while last < len(z) - 1 and sign * z[last + 1] >= h - 1e-9:
                    last += 1
                out[p] += sign * (last - first + 1) ** 0.5 * h**2 * step
    return out


def test_enhancement_equals_its_definition():
    rng = np.random.default_rng(0)
    z = np.cumsum(rng.standard_normal((4, 40, 3)), axis=1) / 4
    found = enhanced(z)
    for i in range(4):
        for k in range(3):
            np.testing.assert_allclose(found[i, :, k], slow_enhancement(z[i, :, k]), atol=1e-3)


def deviates(design, y):
    values = scaled(y[:, np.newaxis, np.newaxis], not design.flips)
    return design.deviates(design.rows[np.newaxis], values)[0, 0, 0]


def test_deviates_have_the_tail_probabilities_of_the_tests():
    rng = np.random.default_rng(0)
    y, x = rng.standard_normal(15), rng.standard_normal(15)
    groups = np.repeat([0, 1, 2], 5)
    two = Study.of((groups > 0).tolist(), None, covariate=False, paired=False, n=15).design
    of_two = stats.ttest_ind(y[5:], y[:5])
    assert deviates(two, y) == pytest.approx(
        np.sign(of_two.statistic) * stats.norm.isf(of_two.pvalue / 2)
    )
    three = Study.of(groups.tolist(), None, covariate=False, paired=False, n=15).design
    of_three = stats.f_oneway(*(y[groups == g] for g in range(3)))
    assert deviates(three, y) == pytest.approx(max(stats.norm.isf(of_three.pvalue), 0))
    of_slope = stats.linregress(x, y)
    found = deviates(Study.of(x, None, covariate=True, paired=False, n=15).design, y)
    assert abs(found) == pytest.approx(stats.norm.isf(of_slope.pvalue / 2))
    assert np.sign(found) == np.sign(of_slope.slope)
    flips = Design(np.ones((15, 1)), flips=True)
    one = stats.ttest_1samp(y + 0.4, 0)
    assert deviates(flips, y + 0.4) == pytest.approx(stats.norm.isf(one.pvalue / 2))


def test_p_values_of_one_value_are_those_of_a_permutation_test():
    rng = np.random.default_rng(3)
    y = rng.standard_normal(14) + np.repeat([0, 0.9], 7)
    labels = ["a"] * 7 + ["b"] * 7
    design = Study.of(labels, None, covariate=False, paired=False, n=14).design
    curve, quiet = y[:, np.newaxis, np.newaxis], Progress(None, 0)
    found = families(design, [curve], 1999, rng, progress=quiet)[0].p_value
    exact = stats.permutation_test(
        (y[:7], y[7:]),
        lambda a, b: abs(a.mean() - b.mean()),
        n_resamples=np.inf,
        alternative="greater",
    )
    # Deviates that are a tenth apart are ties, which count against a difference.
    assert exact.pvalue - 0.01 < found < exact.pvalue + 0.04


# -- the answers --------------------------------------------------------------------------


def test_a_difference_in_timing_is_called_timing(late):
    gait, pipe = late
    found = compare_groups(
        pipe, gait.data, gait.group, groups=gait.person, signals=gait.data, n_permutations=199
    )
    assert found.to_frame()["differs"].tolist() == [True, False, True, True]
    assert set(found.clusters["what"]) == {"timing"}
    # Made 6 % later at 60 % of the cycle, and less around it.
    worst = found.clusters.iloc[0]
    assert worst.start < 60 < worst.end
    assert worst.direction == "B later than A"
    assert 2 < worst.lower < worst["size"] < worst.upper < 6
    assert "they differ in timing (joint p = 0.0" in found.describe()
    assert found.n_units == 16


def test_a_difference_in_shape_is_called_shape_in_its_unit():
    gait, pipe = studied(24, amplitude=18)
    found = compare_groups(
        pipe, gait.data, gait.group, groups=gait.person, signals=gait.data, n_permutations=199
    )
    answers = found.to_frame()["differs"]
    assert answers[["joint", "shape"]].all()
    assert not answers["timing"]
    assert set(found.clusters["what"]) == {"shape"}
    largest = found.clusters.loc[found.clusters["size"].abs().idxmax()]
    assert 4 < abs(largest["size"]) < 25  # degrees, not standard deviations
    assert largest.lower < largest["size"] < largest.upper


def test_a_bump_in_one_of_four_signals_is_not_called_timing():
    """The warps follow the bump; without that signal the groups do not differ in timing."""
    gait = make_gait(20, 2, random_state=4)
    trials = []
    for x, group in zip(gait.data, gait.group, strict=True):
        t = np.linspace(0, 1, len(x))
        bump = 20 * np.exp(-(((t - 0.2) / 0.06) ** 2) / 2) * (group == "B")
        trials.append(x + bump[:, np.newaxis] * [0, 1, 0, 0])
    pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(P)).fit(trials)
    given = {"y": gait.group, "groups": gait.person, "n_permutations": 199}
    found = compare_groups(pipe, trials, **given)
    assert found.p_timing < 0.05  # the offsets do differ
    assert set(found.clusters["what"]) == {"shape"}
    assert set(found.clusters["feature"]) == {"x1"}
    # Of the knee alone it stays open, and the warps take what they can.
    knee = [x[:, [1]] for x in trials]
    alone = compare_groups(DenseSynchronizer(P).fit(knee), knee, **given)
    assert "timing" in set(alone.clusters["what"])
    # Where shapes are not looked at, neither is found, and the answer says so.
    hip = compare_groups(pipe, trials, **given, features=0)
    assert "A and B, 20 people: they differ, in shape or in timing (joint" in hip.describe()
    assert len(hip.clusters) == 0


def test_a_constant_signal_leaves_timing_what_it_is(late):
    gait, _ = late
    knee = [np.column_stack([x[:, 1], np.ones(len(x))]) for x in gait.data]
    sync = DenseSynchronizer(P).fit(knee)
    found = compare_groups(sync, knee, gait.group, groups=gait.person, n_permutations=199)
    assert set(found.clusters["what"]) == {"timing"}


def test_nothing_is_found_where_nothing_differs():
    gait, pipe = studied(16)
    found = compare_groups(pipe, gait.data, gait.group, groups=gait.person, n_permutations=99)
    assert found.p_joint > 0.05
    assert len(found.clusters) == 0
    assert "no difference is found" in repr(found)


def test_the_level_holds_for_noise():
    """By chance 1 of 20 studies; more than 4 come in one of 400 series."""
    wrong, rng = 0, np.random.default_rng(0)
    for seed in range(20):
        X = np.cumsum(rng.standard_normal((12, 30, 2)), axis=1)
        sync = LinearSynchronizer(30).fit(X)
        groups = ["a", "b"] * 6
        found = compare_groups(sync, X, groups, n_permutations=99, random_state=seed)
        wrong += found.p_joint <= 0.05
    assert wrong <= 4


@pytest.mark.parametrize(("name", "what"), [("SimulatedA", "shape"), ("SimulatedB", "timing")])
def test_published_simulations(name, what, real_data):
    """Made by their authors to differ in amplitude, and in timing."""
    table = np.loadtxt(real_data / "nlreg1d" / f"{name}.csv", delimiter=",")
    X, groups = list(table[:, 1:, np.newaxis]), table[:, 0].astype(int)
    sync = DenseSynchronizer(101).fit(X)
    found = compare_groups(sync, X, groups, n_permutations=499)
    assert found.p_joint < 0.02
    assert set(found.clusters["what"]) == {what}


# -- designs ------------------------------------------------------------------------------


def bumps(heights, delays):
    t = np.linspace(0, 1, 60)
    noise = np.random.default_rng(0).standard_normal((len(heights), 60)) * 0.02
    moments = t - np.asarray(delays)[:, np.newaxis] * np.sin(np.pi * t) ** 2
    bump = np.exp(-(((moments - 0.5) / 0.1) ** 2))
    return list((np.asarray(heights)[:, np.newaxis] * bump + noise)[:, :, np.newaxis])


@pytest.mark.filterwarnings("ignore::sklearn_motionsync.SynchronizationWarning")
@pytest.mark.parametrize("design", ["paired", "between", "within", "three"])
def test_designs_find_a_later_bump_and_a_higher_one(design):
    rng, n = np.random.default_rng(5), 12
    people = np.repeat(np.arange(n), 2)
    second = np.tile([0, 1], n)
    given = {"groups": people.tolist(), "n_permutations": 199}
    if design == "paired":
        by, given = second, {**given, "y": second.tolist(), "paired": True}
    elif design == "within":
        speed = second + 0.2 * rng.standard_normal(2 * n)
        by, given = speed, {**given, "y": speed, "covariate": True}
    elif design == "between":
        age = np.repeat(rng.uniform(0, 1, n), 2)
        by, given = age, {**given, "y": age, "covariate": True}
    else:
        by = np.repeat(np.arange(n) % 3, 2) / 2
        given["y"] = (2 * by).astype(int).tolist()
    own = np.repeat(rng.normal(0, 0.05, n), 2)
    for what in ("shape", "timing"):
        heights = 1 + own + (0.5 * by if what == "shape" else 0)
        delays = 0.2 * own + (0.08 * by if what == "timing" else 0)
        X = bumps(heights, delays)
        sync = DenseSynchronizer(60).fit(X)
        found = compare_groups(sync, X, **given)
        assert found.clusters.iloc[0]["what"] == what, (what, found)
        assert found.n_units == n
        word = found.clusters.iloc[0].direction
        right = ("above", "higher") if what == "shape" else ("later",)
        assert any(part in word for part in right)


def test_sizes_are_those_of_welch_and_of_a_slope(few):
    X, sync = few
    groups = ["a"] * 9 + ["b"] * 7
    X = [x + (k >= 9) + 0.3 * k * (k >= 9) for k, x in enumerate(X)]
    found = compare_groups(sync, X, groups, n_permutations=199).clusters.iloc[0]
    first, end = round(found.start * 29 / 100), round(found.end * 29 / 100) + 1
    values = np.array([x[first:end].mean() for x in X])
    welch = stats.ttest_ind(values[9:], values[:9], equal_var=False).confidence_interval()
    np.testing.assert_allclose([found.lower, found.upper], welch)
    assert found.direction == "b above a"
    ages = np.linspace(20, 60, 16)
    tilted = [x + 0.02 * age for x, age in zip(few[0], ages, strict=True)]
    found = compare_groups(sync, tilted, y=ages, covariate=True, n_permutations=199).clusters.iloc[
        0
    ]
    first, end = round(found.start * 29 / 100), round(found.end * 29 / 100) + 1
    slope = stats.linregress(ages, [x[first:end].mean() for x in tilted])
    assert found["size"] == pytest.approx(slope.slope)
    half = stats.t.ppf(0.975, 14) * slope.stderr
    np.testing.assert_allclose([found.lower, found.upper], slope.slope + np.array([-half, half]))
    assert found.direction == "higher with the covariate"


def test_order_units_and_copies_of_trials_change_nothing(few):
    X, sync = few
    X = [x + 0.06 * (k % 2) for k, x in enumerate(X)]
    groups = ["a", "b"] * 8
    one = compare_groups(sync, X, groups, n_permutations=199)
    # The draws depend on the order of the units, not on that of their trials.
    twice = compare_groups(
        sync,
        X + X[::-1],
        groups + groups[::-1],
        groups=[*range(16), *reversed(range(16))],
        n_permutations=199,
    )
    assert one.to_frame().equals(twice.to_frame())
    big = compare_groups(
        LinearSynchronizer(30).fit([1e3 * x for x in X]),
        [1e3 * x for x in X],
        groups,
        n_permutations=199,
    )
    np.testing.assert_allclose(big.to_frame()["p"], one.to_frame()["p"])
    frames = compare_groups(sync, X, groups, n_permutations=199, unit="frames")
    assert frames.p_joint == one.p_joint
    again = compare_groups(sync, X, groups, n_permutations=199, random_state=7)
    assert abs(again.p_joint - one.p_joint) < 0.1


def test_sizes_are_in_the_units_of_the_trials(late, capsys):
    gait, pipe = late
    tables = [pd.DataFrame(x, columns=gait.feature_names) for x in gait.data]
    for x in tables:
        x.attrs["units"] = list(gait.units)
    of_tables = clone(pipe).fit(tables)
    given = {"groups": gait.person, "n_permutations": 99, "level": 0.5}
    found = compare_groups(of_tables, tables, gait.group, **given, n_jobs=2, verbose=1)
    assert "[compare_groups] permutations: 100 %" in capsys.readouterr().out
    plain = compare_groups(pipe, gait.data, gait.group, **given, signals=gait.data)
    pd.testing.assert_frame_equal(
        found.clusters.drop(columns=["feature", "unit"]),
        plain.clusters.drop(columns=["feature", "unit"]),
    )
    assert set(found.clusters["unit"]) <= {"deg", "body weight", "%"}
    assert set(plain.clusters["unit"]) == {"", "%"}
    seconds = compare_groups(of_tables, tables, gait.group, **given, unit="seconds", frame_rate=100)
    lasts = np.array([len(x) - 1 for x in tables]) / 100
    # Curves have no unit of time: their stretches are the same, in seconds of the median trial.
    starts = [x.clusters.loc[x.clusters["what"] == "shape", "start"] for x in (seconds, found)]
    np.testing.assert_allclose(starts[0], starts[1] * np.median(lasts) / 100)
    # A second is another share of each trial, so that a stretch of timing may have other ends.
    (timing,) = seconds.clusters[seconds.clusters["what"] == "timing"].itertuples()
    assert timing.unit == "s"
    first, last = np.rint(np.array([timing.start, timing.end]) * (P - 1) / np.median(lasts))
    scaler, sync = of_tables[0], of_tables[1]
    frames = sync.match(scaler.transform(tables)).offsets[:, int(first) : int(last) + 1]
    delays = pd.Series(frames.mean(axis=1) / (P - 1) * lasts)
    of_people = delays.groupby([gait.group, gait.person]).mean().groupby(level=0).mean()
    assert timing.size == pytest.approx(of_people["B"] - of_people["A"])


def test_all_of_many_features_are_compared():
    rng = np.random.default_rng(0)
    X = [np.cumsum(rng.standard_normal((30, 7)), axis=0) for _ in range(12)]
    for x in X[::2]:
        x[:, 6] += 30
    sync = LinearSynchronizer(30).fit(X)
    found = compare_groups(sync, X, ["a", "b"] * 6, n_permutations=199)
    assert found.clusters["feature"].tolist() == ["x6"]


def test_names_and_chosen_features_of_tables():
    gait, _ = studied(8, timing=6)
    tables = [pd.DataFrame(x, columns=gait.feature_names) for x in gait.data]
    sync = DenseSynchronizer(P).fit(tables)
    found = compare_groups(
        sync, tables, gait.group, groups=gait.person, features="knee_flexion", n_permutations=199
    )
    assert set(found.clusters["feature"]) <= {"knee_flexion", "offset"}
    forces = [x[["vertical_force"]].iloc[::2] for x in tables]
    other = compare_groups(
        sync, tables, gait.group, groups=gait.person, signals=forces, n_permutations=199
    )
    assert set(other.clusters["feature"]) <= {"vertical_force", "offset"}
    assert other.p_timing == found.p_timing


# -- refused ------------------------------------------------------------------------------

PAIRS = [f"p{i // 2}" for i in range(16)]
GROUPS = ["a", "b"] * 8


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"y": None}, "y is needed"),
        ({"y": [k + 0.5 for k in range(16)]}, "numbers such as 0.5, which are no labels"),
        ({"y": GROUPS, "groups": GROUPS}, "the same 2 sets of trials apart as y"),
        (
            {"y": ["a"] * 15 + ["b"]},
            "At least two people a group are needed, got 15 in 'a', 1",
        ),
        ({"y": GROUPS, "groups": PAIRS}, "'p0' has trials of several labels in y. Set paired=True"),
        (
            {"y": GROUPS, "paired": True},
            "needs two labels in y, got 2, and groups=, .* missing",
        ),
        (
            {"y": GROUPS[:15] + ["a"], "groups": PAIRS, "paired": True},
            "'p7' has no trial of 'b' in y",
        ),
        (
            {"y": range(16), "covariate": True, "paired": True},
            "groups of trials, not a covariate",
        ),
        ({"y": range(5), "covariate": True}, r"one number for each of 16 trials, got shape \(5,\)"),
        ({"y": [1.0] * 16, "covariate": True}, "must differ between trials"),
        ({"y": [np.nan] * 16, "covariate": True}, "must be finite"),
        (
            {"y": range(16), "covariate": True, "groups": [0, 1] * 8},
            "At least 4 people are needed",
        ),
        ({"y": GROUPS, "level": 5}, "level must be a number between 0 and 1"),
        (
            {"y": GROUPS, "n_permutations": 9},
            "n_permutations must be a whole number of at least 19",
        ),
        ({"y": GROUPS, "unit": "hours"}, "unit must be one of"),
        ({"y": GROUPS, "unit": "seconds"}, "Time in seconds needs frame_rate"),
        ({"y": GROUPS, "signals": [np.ones((5, 1))] * 3}, "one sequence for each of 16 trials"),
        ({"y": GROUPS, "signals": [np.full((5, 1), np.nan)] * 16}, "Trial 0, frame"),
        ({"y": GROUPS, "features": "knee"}, "knee"),
    ],
)
def test_refused_arguments(given, message, few):
    X, sync = few
    with pytest.raises(ValueError, match=message):
        compare_groups(sync, X, **given)


def share_of_most_extreme(statistics):
    return np.isclose(statistics, max(statistics)).mean()


def by_all_arrangements(y, covariate=False):
    """The share of arrangements that separate units as well as the best one."""
    if not covariate:
        groups = np.array(y)
        arranged = [groups[list(order)] for order in permutations(range(len(groups)))]
        return share_of_most_extreme(
            [-sum(groups[labels == k].var() for k in set(groups)) for labels in arranged]
        )
    centred = np.array(y) - np.mean(y)
    orders = permutations(range(len(centred)))
    return share_of_most_extreme([abs(centred @ centred[list(order)]) for order in orders])


@pytest.mark.parametrize(
    "of",
    [
        {"y": [0, 0, 1, 1]},
        {"y": [0, 0, 0, 1, 1]},
        {"y": [0, 0, 1, 1, 2, 2]},
        {"y": [1.0, 2, 3, 4], "covariate": True},
        {"y": [1.0, 2, 3, 7], "covariate": True},
        {"y": [1.0, 1, 2, 5], "covariate": True},
    ],
)
def test_smallest_p_is_that_of_all_arrangements(of):
    given = {"covariate": False} | of
    study = Study.of(**given, groups=None, paired=False, n=len(of["y"]))
    assert study.smallest_p == pytest.approx(by_all_arrangements(**of))


def test_too_few_people_are_told_so():
    """Of four pairs no p is below 0.125, however much they differ; of six it is 0.03."""
    rng, t = np.random.default_rng(0), np.linspace(0, 1, 50)
    for n, words in ((4, "too few to find a difference, as no p can be below 0.125"), (6, "they")):
        curves = [np.sin(6 * t) + 100 * k + rng.normal(0, 0.1) for _ in range(n) for k in (0, 1)]
        X = [curve[:, np.newaxis] for curve in curves]
        sync = LinearSynchronizer(50).fit(X)
        people = np.repeat(np.arange(n), 2)
        given = {"groups": people, "paired": True, "n_permutations": 199}
        found = compare_groups(sync, X, ["a", "b"] * n, **given)
        assert f": {words}" in found.describe()
        assert found.smallest_p == 2 / 2**n


def test_people_of_one_trial_each_are_told():
    gait = make_gait(8, 2, random_state=0)
    sync = LinearSynchronizer(20).fit(gait.data)
    given = {"y": gait.group, "n_permutations": 19}
    of_trials = compare_groups(sync, gait.data, groups=range(len(gait.data)), **given)
    assert "A and B, 16 people of one trial each: " in of_trials.describe()
    assert "A and B, 16 trials: " in compare_groups(sync, gait.data, **given).describe()
    of_people = compare_groups(sync, gait.data, groups=gait.person, **given)
    assert "A and B, 8 people: " in of_people.describe()
