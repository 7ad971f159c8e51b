"""compare_groups: statistics against SciPy and slow versions, answers, designs, refusals."""

from itertools import groupby, permutations, product
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from sklearn.base import clone
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import DenseSynchronizer, FrameWise, LinearSynchronizer
from sklearn_motionsync.comparison import GroupComparison, compare_groups
from sklearn_motionsync.comparison.curves import AlignedCurves
from sklearn_motionsync.comparison.groups import compare_aligned
from sklearn_motionsync.comparison.permutations import (
    Design,
    Family,
    enhanced,
    families,
    scaled,
    share_at_most,
)
from sklearn_motionsync.comparison.study import Study
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
    z[0, :, 0], z[0, 5:9, 0] = 0.3, 0.5  # as high as a height of the sum
    found = enhanced(z)
    for i in range(4):
        for k in range(3):
            np.testing.assert_allclose(found[i, :, k], slow_enhancement(z[i, :, k]), atol=1e-3)
    np.testing.assert_array_equal(enhanced(z[:, :1]), z[:, :1])
    np.testing.assert_allclose(enhanced(np.ones((1, 2, 1)))[0, :, 0], slow_enhancement(np.ones(2)))


def test_values_are_scaled_to_a_length_of_one_if_they_vary():
    """Each feature by itself: a frame of it with a thousandth of the largest spread does not."""
    values = np.zeros((4, 4, 2))
    values[0] = [[1, 50], [2e-3, 50], [1.2e-3, 0], [1e-3, 0.04]]
    np.testing.assert_array_equal(scaled(values, False)[0], [[1, 1], [1, 1], [1, 0], [0, 0]])
    gap = np.array([1, 3, np.nan, 5])[:, np.newaxis, np.newaxis]
    np.testing.assert_allclose(scaled(gap, True)[:, 0, 0], np.array([-1, 0, 0, 1]) / np.sqrt(2))


def test_groups_without_any_spread_differ_without_a_warning():
    design = Study.of([0, 0, 0, 1, 1, 1], None, covariate=False, paired=False, n=6).design
    values = np.repeat([0.0, 1.0], 3)[:, np.newaxis, np.newaxis]
    found = design.deviates(design.observed[np.newaxis], design.prepare(values))
    assert found.ravel() == pytest.approx([8])


def test_shares_of_draws_count_equal_ones():
    family = Family(None, np.array([2.0, 1, 3, 2]), None)
    assert family.ranks.tolist() == [0.75, 1, 0.25, 0.75]
    assert family.p_value == 0.75
    assert share_at_most(family.ranks, [0.75, 0.5, 0.25]).tolist() == [0.75, 0.25, 0.25]


def deviates(design, y):
    values = design.prepare(y[:, np.newaxis, np.newaxis])
    return design.deviates(design.observed[np.newaxis], values)[0, 0, 0]


def test_deviates_have_the_tail_probabilities_of_the_tests():
    rng = np.random.default_rng(0)
    y, x = rng.standard_normal(15), rng.standard_normal(15)
    groups = np.repeat([0, 1, 2], 5)
    two = Study.of((groups > 0).tolist(), None, covariate=False, paired=False, n=15).design
    t = stats.ttest_ind(y[5:], y[:5], equal_var=False).statistic
    assert deviates(two, y) == pytest.approx(np.sign(t) * stats.norm.isf(stats.t.sf(abs(t), 13)))
    three = Study.of(groups.tolist(), None, covariate=False, paired=False, n=15).design
    weights, means = np.array([(5 / x.var(ddof=1), x.mean()) for x in y.reshape(3, 5)]).T
    explained = weights @ np.square(means - np.average(means, weights=weights)) / 2
    assert deviates(three, y) == pytest.approx(max(stats.norm.isf(stats.f.sf(explained, 2, 12)), 0))
    of_slope = stats.linregress(x, y)
    found = deviates(Study.of(x, None, covariate=True, paired=False, n=15).design, y)
    assert abs(found) == pytest.approx(stats.norm.isf(of_slope.pvalue / 2))
    assert np.sign(found) == np.sign(of_slope.slope)
    flips = Design(np.ones((15, 1)), flips=True)
    one = stats.ttest_1samp(y + 0.4, 0)
    assert deviates(flips, y + 0.4) == pytest.approx(stats.norm.isf(one.pvalue / 2))
    # At most 8, where groups explain all; and of F nothing is below 0.
    of_groups, apart = np.array([0, 1, 2])[groups], (groups > 0).astype(float)
    assert [deviates(two, apart), deviates(two, -apart), deviates(three, of_groups)] == [8, -8, 8]
    assert deviates(three, np.tile([0.0, 1, 2, 3, 4], 3) + 0.01 * groups) == 0


def of_all_arrangements(values, y):
    """How much values differ between groups, with a covariate, or from 0 (None)."""
    if y is None:
        signs = product([1, -1], repeat=len(values))
        return np.array([abs(values @ one) for one in signs])
    orders = [list(order) for order in permutations(range(len(y)))]
    if y.dtype.kind == "f":
        y = y - y.mean()
        return np.array([abs(values @ y[order]) for order in orders])
    within = [
        sum(values[groups == k].var() * np.sum(groups == k) for k in set(y))
        for groups in (y[order] for order in orders)
    ]
    return -np.array(within)


def slow_factors(groups):
    """Variances of groups (n_k, P) relative to that of all, smoothed over a fifth of the clock."""
    variances = np.array([x.var(axis=0, ddof=1) for x in groups])
    freedom = [len(x) - 1 for x in groups]
    ratios, frames = (
        variances / np.average(variances, axis=0, weights=freedom),
        range(len(groups[0].T)),
    )
    width = 0.2 * frames[-1]
    weights = [[stats.norm.pdf((a - b) / width) for b in frames] for a in frames]
    return [np.array([np.average(of_one, weights=w) for w in weights]) for of_one in ratios]


def slow_maps(values, y, draws):
    """Enhanced deviates of two groups of values (n, P): of themselves, and of each draw."""

    def enhanced_t(groups):
        factors, (a, b) = slow_factors(groups), groups
        residuals = [(x - x.mean(axis=0)) ** 2 / c for x, c in zip(groups, factors, strict=True)]
        variance = sum(r.sum(axis=0) for r in residuals) / (len(values) - 2)
        error = np.sqrt(variance * (factors[0] / len(a) + factors[1] / len(b)))
        t = (b.mean(axis=0) - a.mean(axis=0)) / error
        return slow_enhancement(np.sign(t) * stats.norm.isf(stats.t.sf(abs(t), len(values) - 2)))

    of_labels = [values[y == label] for label in ("a", "b")]
    yield enhanced_t(of_labels)
    factors = slow_factors(of_labels)
    weights = [len(x) / c for x, c in zip(of_labels, factors, strict=True)]
    middle = sum(w * x.mean(axis=0) for w, x in zip(weights, of_labels, strict=True)) / sum(weights)
    own = np.array([factors[int(label == "b")] for label in y])
    z = (values - middle) / np.sqrt(own)
    z -= z.mean(axis=0)
    for order, signs in draws:
        n, places = len(y), y[order]
        drawn = z + signs @ z / np.sqrt(n * (n - 1))
        pairs = zip(("a", "b"), factors, strict=True)
        yield enhanced_t([np.sqrt(c) * drawn[places == label] for label, c in pairs])


@pytest.mark.parametrize(
    "y",
    [
        [0, 0, 1, 1], [0, 0, 0, 1, 1], [0, 0, 0, 1, 1, 1],
        [0, 0, 1, 1, 2, 2, 2], [1.0, 2, 3, 4], [1.0, 1, 2, 5], [1.0, 2, 2, 4, 5, 7],
        "pairs", "within people",
    ],
)  # fmt: skip
def test_p_of_one_value_and_the_smallest_are_shares_of_all_arrangements(y):
    rng = np.random.default_rng(1)
    if isinstance(y, str):
        given = {"groups": np.repeat(range(7), 2), "y": [0, 1] * 7, "n": 14}
        given |= {"paired": y == "pairs", "covariate": y != "pairs"}
        y, values, extreme = None, 0.6 + rng.standard_normal(7), np.ones(7)
        of_trials = np.column_stack([np.ones(7), 1 + values]).ravel()
    else:
        given = {"y": y, "covariate": y[0] == 1, "paired": False, "groups": None, "n": len(y)}
        y, extreme = np.array(y), np.array(y)
        of_trials = values = rng.standard_normal(len(y)) + 2 * y / y.max()
    arranged = of_all_arrangements(values, y)
    exact = np.mean(arranged >= arranged[0] - 1e-9)
    study, draws = Study.of(**given), np.random.RandomState(0)
    curve, quiet = study.units(of_trials[:, np.newaxis, np.newaxis]), Progress(None, 0)
    (family,) = families(study.design, [curve], 4999, draws, progress=quiet)
    # Groups may vary differently: their test has no exact p.
    if y is None or y.dtype.kind == "f":
        assert family.p_value == pytest.approx(exact, abs=4 * np.sqrt(exact * (1 - exact) / 5e3))
    assert len(family.ranks) == 5000
    arranged = of_all_arrangements(extreme, y)
    assert study.design.smallest_p == pytest.approx(np.isclose(arranged, arranged.max()).mean())


class Handmade(AlignedCurves):
    """Curves and offsets as they are; ``others`` are the offsets without some of the signals."""

    others = ()

    def offsets_of_others(self):
        return self.others

    @classmethod
    def of_arrays(cls, curves, offsets):
        clock, match = np.linspace(0, 100, len(offsets[0])), SimpleNamespace(offsets=offsets)
        given = ["knee", "hip"], ["deg", ""], curves, curves[..., :1], offsets, clock
        return cls(*given, "percent", match, None)


LABELS = np.array(list("aabbababba"))
STUDY = Study.of(LABELS, None, covariate=False, paired=False, n=10)


def test_the_table_equals_a_slow_version():
    """Frame by frame, draw by draw, and stretch by stretch."""
    rng = np.random.default_rng(8)
    curves, offsets = rng.standard_normal((10, 12, 2)), rng.standard_normal((10, 12))
    curves[LABELS == "b", 2:6, 0] += 1.8
    curves[LABELS == "b", 7:9, 1] -= 3
    offsets[LABELS == "b", 4:7] -= 2
    random = np.random.RandomState(0)
    draws = [(random.permutation(10), random.choice([-1.0, 1.0], size=10)) for _ in range(39)]
    # Units are permuted in the order of their offsets.
    by_value = (offsets @ np.sin(1 + np.arange(12))).argsort()

    def maps(values):
        of_features = np.moveaxis(values[by_value], 2, 0)
        maps_of = [slow_maps(x, LABELS[by_value], draws) for x in of_features]
        return map(np.column_stack, zip(*maps_of, strict=True))

    of_shape, of_timing, of_linear = (
        list(maps(values)) for values in (curves, offsets[..., np.newaxis], curves[..., :1])
    )
    largest = [np.array([np.abs(one).max() for one in of]) for of in (of_shape, of_timing)]
    ranks = [np.array([np.mean(of >= (1 - 1e-6) * one) for one in of]) for of in largest]
    least = np.minimum(*ranks)

    def corrected(value, of):
        return np.mean(least <= np.mean(of >= (1 - 1e-6) * abs(value)) + 1e-9)

    rows, everywhere = [], np.column_stack([of_shape[0], of_timing[0]])
    p = [[corrected(v, largest[k == 2]) for k, v in enumerate(frame)] for frame in everywhere]
    p = np.array(p)
    level = p[p > 0.05].min()
    for k, name in enumerate(["knee", "hip", "offset"]):
        values, what = (offsets, "timing") if k == 2 else (curves[..., k], "shape")
        higher, lower = ("later than", "earlier than") if k == 2 else ("above", "below")
        for differs, frames in groupby(range(12), key=lambda f, k=k: p[f, k] <= level):
            if differs:
                frames = list(frames)
                means = values[:, frames].mean(axis=1)
                a, b = means[LABELS == "a"], means[LABELS == "b"]
                bounds = stats.ttest_ind(b, a, equal_var=False).confidence_interval()
                peak = max(frames, key=lambda f, k=k: abs(everywhere[f, k]))
                places = [100 / 11 * f for f in (frames[0], frames[-1], peak)]
                words = f"b {higher if b.mean() > a.mean() else lower} a"
                sizes = [b.mean() - a.mean(), *bounds, ["deg", "", "%"][k]]
                rows.append([what, name, *places, p[frames, k].min(), words, *sizes])
    aligned = Handmade.of_arrays(curves, offsets)
    found = compare_aligned(aligned, STUDY, 0, level, n_permutations=39)
    expected = pd.DataFrame(rows, columns=list(found.clusters))
    assert not expected["p"].is_monotonic_increasing
    assert (expected["peak"] > expected["start"]).any()
    expected = expected.sort_values("p", kind="stable").reset_index(drop=True)
    pd.testing.assert_frame_equal(found.clusters, expected)
    assert set(expected["feature"]) == {"knee", "hip", "offset"}
    assert found.p_shape == ranks[0][0]
    assert found.p_timing == ranks[1][0]
    assert found.p_joint == np.mean(least <= least[0])
    assert found.smallest_p == pytest.approx(2 / 252)
    of_linear = [np.abs(one).max() for one in of_linear]
    assert found.p_linear == np.mean(np.array(of_linear) >= (1 - 1e-6) * of_linear[0])
    assert found.to_frame()["p"].tolist() == [
        found.p_joint, found.p_shape, found.p_timing, found.p_linear]  # fmt: skip


def test_timing_is_listed_if_half_of_it_is_left_whichever_signal_is_left_out():
    rng = np.random.default_rng(0)
    curves, offsets = rng.standard_normal((10, 12, 2)), 0.5 * rng.standard_normal((10, 12))
    offsets[LABELS == "b", 4:8] += 5
    aligned = Handmade.of_arrays(curves, offsets)

    def stretches():
        clusters = compare_aligned(aligned, STUDY, 0, n_permutations=199).clusters
        clusters = clusters[clusters["what"] == "timing"]
        return [tuple(row) for row in (clusters[["start", "end"]] * 11 / 100).round().to_numpy()]

    ((start, end),) = stretches()
    within = (np.arange(12) >= start) & (np.arange(12) <= end)
    half = 0.5 * within * offsets
    first, last = (half * (np.arange(12) != frame) for frame in (start, end))
    for others, count in (
        ([half], 1), ([0.999 * half], 0), ([first], 0), ([last], 0),
        ([half, -offsets], 0), ([-offsets, offsets], 0),
    ):  # fmt: skip
        aligned.others = others
        assert len(stretches()) == count


@pytest.mark.parametrize("n", [1, 2, 10])
def test_signals_are_left_out_of_the_match_each_or_in_eight_parts(n, capsys):
    rng, t = np.random.default_rng(0), np.linspace(0, 1, 30)
    X = [np.sin(np.outer(t ** (1 + 0.1 * k), np.arange(3, 3 + n))) for k in range(5)]
    X = [x + 0.01 * rng.standard_normal(x.shape) for x in X]
    keyframes = np.full((5, 1), 12)
    sync = DenseSynchronizer(20, pattern=0).fit(X, keyframes=keyframes)
    given = {"signals": None, "features": None, "unit": "percent"}
    aligned = AlignedCurves.of(sync, X, {"keyframes": keyframes}, "here", **given)
    found = list(aligned.offsets_of_others())
    parts = [[0, 1], [2, 3], *([k] for k in range(4, 10))] if n == 10 else [[k] for k in range(n)]
    assert len(found) == len(parts) * (n > 1)
    for offsets, part in zip(found, parts, strict=False):
        rest = [k for k in range(n) if k not in part]
        of_rest = [x[:, rest] for x in X]
        one = clone(sync).set_params(pattern=sync.pattern_[:, rest])
        one.fit(of_rest, keyframes=keyframes)
        np.testing.assert_array_equal(offsets, one.match(of_rest, keyframes=keyframes).offsets)
    assert capsys.readouterr().out == ""
    np.testing.assert_allclose(aligned.clock, np.linspace(0, 100, 20))


# -- the answers --------------------------------------------------------------------------


def test_no_p_of_few_people_is_below_the_share_of_their_arrangements():
    X = np.random.default_rng(0).standard_normal((6, 30, 1))
    X[3:] += 8
    sync = LinearSynchronizer(30).fit(X)
    found = compare_groups(sync, X, [*"aaabbb"], level=0.1, n_permutations=199)
    assert found.p_joint == found.p_shape == found.smallest_p == pytest.approx(0.1)
    assert (found.clusters["p"] == found.smallest_p).all()
    assert "they differ in shape" in found.describe()
    too_few = compare_groups(sync, X, [*"aaabbb"], n_permutations=199)
    assert "too few to find a difference" in too_few.describe()


@pytest.mark.parametrize(
    ("aspects", "p", "smallest", "words"),
    [
        ([], 0.05, 0.05, "they differ, in shape or in timing"),
        ([], 0.051, 0.05, "no difference is found"),
        ([], 0.051, 0.0514, "too few to find a difference, as no p can be below 0.0514"),
        (["shape", "shape"], 0.01, 0.01, "they differ in shape"),
        (["timing"], 0.01, 0.01, "they differ in timing"),
        (["timing", "shape"], 0.01, 0.01, "they differ in shape and timing"),
    ],
)
def test_the_answer_in_words(aspects, p, smallest, words):
    clusters = pd.DataFrame({"what": aspects})
    found = GroupComparison(
        p, 0.0512, 0.05, 0.7, clusters, 8, 0.05, "a and b, 8 people", "percent", smallest
    )
    values = f"joint p = {p:.3f}, shape 0.051, timing 0.050"
    assert found.describe() == f"a and b, 8 people: {words} ({values})."
    assert repr(found) == f"GroupComparison({found.describe()!r})"
    assert found.to_frame()["differs"].tolist() == [p <= 0.05, False, True, False]


@pytest.mark.parametrize(
    ("y", "values", "what", "direction"),
    [
        ("aabb", [0.1, 0.3, 0.9, 0.8], "shape", "b above a"),
        ("aabb", [0.1, 0.3, 0.9, 0.8], "timing", "b later than a"),
        ("aabb", [0.9, 0.8, 0.1, 0.3], "shape", "b below a"),
        ("aabb", [0.9, 0.8, 0.1, 0.3], "timing", "b earlier than a"),
        ("aabbbcc", [0.4, 0.6, 0.1, 0.3, 0.3, 0.9, 0.8], "shape", "c above b"),
        ("aabbbcc", [0.9, 0.8, 0.1, 0.3, 0.3, 0.4, 0.6], "timing", "a later than b"),
        ([1, 2, 3, 4], [0.1, 0.3, 0.9, 0.8], "shape", "higher with the covariate"),
        ([1, 2, 3, 4], [0.9, 0.8, 0.1, 0.3], "shape", "lower with the covariate"),
        ([1, 2, 3, 4], [0.9, 0.8, 0.1, 0.3], "timing", "earlier with the covariate"),
        (None, [0.9, 0.8, 0.1, 0.3], "timing", "b later than a"),
        (None, [-0.9, -0.8, -0.1, -0.3], "shape", "b below a"),
    ],
)
def test_directions_and_intervals(y, values, what, direction):
    values, n = np.array([*values, np.nan]), len(values)
    if y is None:
        given = {"y": [*"ab"] * (n + 1), "groups": np.repeat(range(n + 1), 2), "paired": True}
        found = stats.ttest_1samp(values[:n], 0).confidence_interval()
    elif isinstance(y, list):
        given = {"y": [*y, 9.0], "covariate": True}
        line = stats.linregress(y, values[:n])
        half = stats.t.ppf(0.975, n - 2) * line.stderr
        found = line.slope - half, line.slope + half
    else:
        given, high, low = {"y": [*y, "a"]}, direction[0], direction[-1]
        samples = [[v for v, one in zip(values, y, strict=False) if one == k] for k in (high, low)]
        found = stats.ttest_ind(*samples, equal_var=False).confidence_interval()
    given = {"groups": None, "covariate": False, "paired": False, "n": 2 * n + 2 if y is None
             else n + 1} | given  # fmt: skip
    words, size, lower, upper = Study.of(**given).size(values, what)
    assert words == direction
    np.testing.assert_allclose([size, lower, upper], [np.mean(found), *found])


def test_slopes_within_people_and_what_is_compared_in_words():
    speed = np.array([0.1, 0.9, 0.4, 0.5, 0.5, 0.2, 0.8, 0.9, 0.1, 0.1, 0.9])
    people = np.array([0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4])
    values = np.random.default_rng(0).standard_normal(11)
    given = {"covariate": True, "paired": False, "n": 11}
    within = Study.of(speed, people, **given)
    slopes = [stats.linregress(speed[people == k], values[people == k]).slope for k in (0, 2, 3, 4)]
    np.testing.assert_allclose(within.units(values[:, None, None])[:, 0, 0], slopes)
    assert within.words == "Regression within 4 people"
    # Means of equal numbers differ in their last bits.
    ages = np.repeat([0.1, 0.7, 0.3, 0.9], 3) * 1e7 / 7
    given = {"covariate": True, "paired": False, "n": 12}
    between = Study.of(ages, np.repeat(range(4), 3), **given)
    assert between.words == "Regression, 4 people"
    np.testing.assert_allclose(between.units(ages[:, None, None])[:, 0, 0], ages[::3])
    assert Study.of(ages, None, **given).words == "Regression, 12 trials"
    given = {"y": [*"aabbcc"], "covariate": False, "paired": False, "n": 6}
    assert Study.of(**given, groups=range(6)).words == "a, b and c, 6 people of one trial each"
    assert Study.of(**given, groups=None).words == "a, b and c, 6 trials"
    given["y"] = [1.0, 1.0, 1.0, 2.0, 2.0, 2.0]  # labels, as they are whole
    assert Study.of(**given, groups=None).words == "1.0 and 2.0, 6 trials"
    given |= {"y": [*"aabb"] * 4, "groups": np.arange(16) // 4}
    assert Study.of(**given | {"paired": True, "n": 16}).words == "b less a, 4 people"


def test_bands_are_those_of_shape_and_timing_together():
    rng = np.random.default_rng(3)
    curves = np.cumsum(rng.standard_normal((10, 20, 2)), axis=1)
    # Of white noise many frames are independent, so the largest deviates are those of the timing.
    offsets = rng.standard_normal((10, 20))
    aligned = Handmade.of_arrays(curves, offsets)
    found = compare_aligned(aligned, STUDY, 0, n_permutations=199)
    units = [STUDY.units(x) for x in (curves, offsets[..., None], aligned.even, offsets[..., None])]
    shape, timing, _ = families(
        *(STUDY.design, units[:3], 199, np.random.RandomState(0)),
        by=units[3:],
        progress=Progress(None, 0),
    )
    largest = np.quantile(np.maximum(shape.peaks, timing.peaks), 0.95, method="higher")
    size, error, freedom = STUDY.change(units[0][..., 1], STUDY.changes[0][0])
    band = found.bands.query("feature == 'hip'")
    np.testing.assert_allclose(band["size"], size)
    half = stats.t.isf(stats.norm.sf(largest), freedom) * error
    np.testing.assert_allclose(band["upper"] - band["size"], half)
    assert largest > np.quantile(shape.peaks, 0.95, method="higher")


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

    # A signal that is constant leaves it so.
    knee = [np.column_stack([x[:, 1], np.ones(len(x))]) for x in gait.data]
    sync = DenseSynchronizer(P).fit(knee)
    found = compare_groups(sync, knee, gait.group, groups=gait.person, n_permutations=199)
    assert set(found.clusters["what"]) == {"timing"}


@pytest.mark.parametrize(("n_patients", "spread"), [(6, 1), (3, 3)])
def test_the_level_holds_for_noise(n_patients, spread):
    """By chance 1 of 20 studies; more than 4 come in one of 400 series."""
    wrong, rng = 0, np.random.default_rng(0)
    groups = np.repeat(["a", "b"], [12 - n_patients, n_patients])
    for seed in range(20):
        X = np.cumsum(rng.standard_normal((12, 30, 2)), axis=1)
        X[groups == "b"] *= spread
        sync = LinearSynchronizer(30).fit(X)
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


def test_copies_of_trials_change_nothing_and_another_seed_little(few):
    X, sync = few
    X = [x + 0.06 * (k % 2) for k, x in enumerate(X)]
    groups = ["a", "b"] * 8
    one = compare_groups(sync, X, groups, n_permutations=199)
    # The draws depend on the order of the units, not on that of their trials.
    people = [*range(16), *reversed(range(16))]
    given = X + X[::-1], groups + groups[::-1]
    twice = compare_groups(sync, *given, groups=people, n_permutations=199)
    assert one.to_frame().equals(twice.to_frame())
    again = compare_groups(sync, X, groups, n_permutations=199, random_state=7)
    assert 0 < abs(again.p_joint - one.p_joint) < 0.1


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


def test_names_and_chosen_features_of_tables():
    gait, _ = studied(8, timing=6)
    tables = [pd.DataFrame(x, columns=gait.feature_names) for x in gait.data]
    given = {"y": gait.group, "groups": gait.person, "n_permutations": 199, "level": 0.9}
    forces = [x[["vertical_force"]].iloc[::2] for x in tables]
    sync, p = DenseSynchronizer(P).fit(tables), []
    for name, chosen in (
        ("knee_flexion", {"features": "knee_flexion"}), ("vertical_force", {"signals": forces})
    ):  # fmt: skip
        found = compare_groups(sync, tables, **given, **chosen)
        assert set(found.clusters["feature"]) == {name, "offset"}
        p.append(found.p_timing)
    assert p[0] == p[1]


# -- refused ------------------------------------------------------------------------------

PAIRS = [f"p{i // 2}" for i in range(16)]
GROUPS = ["a", "b"] * 8


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"y": None}, "y is needed"),
        ({"y": [k + 0.5 for k in range(16)]}, "numbers such as 0.5, which are no labels"),
        ({"y": GROUPS, "groups": GROUPS}, "the same 2 sets of trials apart as y"),
        ({"y": ["a"] * 15 + ["b"]}, "At least two people a group are needed, got 15 in 'a', 1"),
        ({"y": GROUPS, "groups": PAIRS}, "'p0' has trials of several labels in y. Set paired=True"),
        ({"y": GROUPS, "paired": True}, "needs two labels in y, got 2, and groups=, .* missing"),
        (
            {"y": GROUPS[:15] + ["a"], "groups": PAIRS, "paired": True},
            "'p7' has no trial of 'b' in y",
        ),
        ({"y": range(16), "covariate": True, "paired": True}, "groups of trials, not a covariate"),
        ({"y": range(5), "covariate": True}, r"one number for each of 16 trials, got shape \(5,\)"),
        ({"y": [1.0] * 16, "covariate": True}, "must differ between trials"),
        ({"y": [np.nan] * 16, "covariate": True}, "must be finite"),
        ({"y": range(16), "covariate": True, "groups": [0, 1] * 8}, "At least 4 people are needed"),
        *(
            ({"y": GROUPS, "level": level}, "level must be a number between 0 and 1")
            for level in (0, 1, 1.5, True, "0.1")
        ),
        *(
            ({"y": GROUPS, "n_permutations": n}, f"whole number of at least 19 .*got {n}")
            for n in (18, 19.5, True)
        ),
        ({"y": GROUPS, "unit": "hours"}, "unit must be one of"),
        ({"y": GROUPS, "unit": "seconds"}, "The frame rate of trial 0 is not known"),
        ({"y": GROUPS, "signals": [np.ones((5, 1))] * 3}, "one sequence for each of 16 trials"),
        ({"y": GROUPS, "signals": [np.full((5, 1), np.nan)] * 16}, "Trial 0, frame"),
        ({"y": GROUPS, "features": "knee"}, "knee"),
    ],
)
def test_refused_arguments(given, message, few):
    X, sync = few
    with pytest.raises(ValueError, match=message):
        compare_groups(sync, X, **given)
