"""Each effect of a study with several factors, against nested models and plain t tests."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from scipy.ndimage import gaussian_filter1d
from sklearn_motionsync import LinearSynchronizer
from sklearn_motionsync.comparison import compare_effects, compare_groups
from sklearn_motionsync.comparison.effects import studies_of
from sklearn_motionsync.comparison.permutations import EffectDesign, GroupDesign, families
from sklearn_motionsync.comparison.study import Study
from sklearn_motionsync.utils.parallel import Progress

N = 17
GROUP, SEX = np.array(list("abcab" * 4))[:N], np.array(list("mffmmffmfmm" * 2))[:N]
AGE = np.random.default_rng(3).uniform(20, 60, N)
PEOPLE = {"group": GROUP, "sex": SEX, "age": AGE}
COLUMNS = {
    "age": [AGE - AGE.mean()],
    "group": [1.0 * (x == GROUP) - (GROUP == "a") for x in "bc"],
    "sex": [1.0 * (SEX == "f") - (SEX == "m")],
}
COLUMNS["group:sex"] = [a * COLUMNS["sex"][0] for a in COLUMNS["group"]]
COLUMNS["sex:age"] = [COLUMNS["sex"][0] * COLUMNS["age"][0]]


def deviate(study, values):
    """Of the units as they are, for one value a trial and each contrast."""
    units = study.units(values[:, np.newaxis, np.newaxis])
    design = study.design
    return design.deviates(design.observed[np.newaxis], design.prepare(units))[0, 0]


def squares_left(columns, values, scale):
    model = np.column_stack([np.ones(len(values)), *columns]) / scale[:, np.newaxis]
    values = values / scale
    return np.square(values - model @ np.linalg.lstsq(model, values, rcond=None)[0]).sum()


@pytest.mark.parametrize(
    ("formula", "effects"),
    [
        ("group + age", ["group", "age"]),
        ("group * sex + age", ["group", "sex", "age", "group:sex"]),
        ("sex*age", ["sex", "age", "sex:age"]),
    ],
)
def test_effects_of_people_have_the_tails_of_nested_models_of_scaled_people(formula, effects):
    values = np.random.default_rng(0).standard_normal(N) + 0.03 * AGE + 2 * (GROUP == "b")
    studies = studies_of(PEOPLE, formula, None, N)
    assert list(studies) == effects
    columns = [column for effect in effects for column in COLUMNS[effect]]
    freedom = N - 1 - len(columns)
    for effect in effects:
        others = [column for other in effects if other != effect for column in COLUMNS[other]]
        k, study = len(COLUMNS[effect]), studies[effect]
        scale = study.design.scale_of(study.units(values[:, np.newaxis, np.newaxis]))
        left = squares_left(columns, values, scale)
        f = (squares_left(others, values, scale) - left) / k / (left / freedom)
        z = deviate(study, values)[0]
        # One column has a signed t; several have F, which below its median has the deviate 0.
        tail = 2 * stats.norm.sf(abs(z)) if k == 1 else stats.norm.sf(z)
        expected = stats.f.sf(f, k, freedom)
        assert tail == pytest.approx(expected if k == 1 else min(expected, 0.5), rel=1e-3)


def test_signs_are_flipped_of_what_others_leave_and_standardised():
    """One draw against its definition, for two columns; and in any order of people."""
    rng, n = np.random.default_rng(10), 15
    # With an effect, as F below its median has the deviate 0.
    values = rng.standard_normal((n, 1, 1)) + 5 * (np.arange(n) % 3 == 1)[:, None, None]
    age = rng.uniform(20, 60, n)
    design = studies_of({"group": [*"abc"] * 5, "age": age}, "group + age", None, n)["group"].design
    scale = design.scale_of(values)[:, np.newaxis]
    others, columns = design.others / scale, design.columns / scale
    project = np.eye(n) - others @ np.linalg.pinv(others)
    left, signs = project @ (values[:, :, 0] / scale), np.ones((n, 1))
    signs[[2, 5, 9]] = -1
    flipped = signs * (project @ columns)
    score = flipped.T @ left
    explained = score.T @ np.linalg.inv(flipped.T @ project @ flipped) @ score / (left.T @ left)
    f = explained.item() / (1 - explained.item()) * (n - 4) / 2
    for order in (np.arange(n), rng.permutation(n)):
        moved = design.rearranged(order)
        np.testing.assert_allclose(moved.scale_of(values[order]), scale[order, 0])
        z = moved.deviates(signs[order][np.newaxis], moved.prepare(values[order])).item()
        assert z == pytest.approx(stats.norm.isf(stats.f.sf(f, 2, n - 4)), abs=1e-4)
        assert z > 0.1
    assert design.critical(2.0, 11) ** 2 == pytest.approx(2 * stats.f.isf(stats.norm.sf(2), 2, 11))


def test_few_people_of_a_group_are_not_told_to_vary_less():
    values = np.random.default_rng(11).standard_normal((9, 3000, 1))
    data = {"group": [*"aaaaaabbb"], "age": [30.0, 40, 50] * 3}
    scale = studies_of(data, "group + age", None, 9)["group"].design.scale_of(values)
    np.testing.assert_allclose(scale, scale.mean(), rtol=0.05)


def test_the_spread_of_groups_is_told_from_all_frames():
    rng, person = np.random.default_rng(8), np.arange(60)
    data = {"group": np.array([*"xyy"])[person % 3], "sex": np.array([*"fm"])[person // 3 % 2]}
    spread = np.where(data["group"] == "y", 3, 1) * np.where(data["sex"] == "m", 2, 1)
    values = spread[:, None, None] * rng.standard_normal((60, 40, 2)) * [1, 50]
    scale = studies_of(data, "group + sex", None, 60)["group"].design.scale_of(values)
    np.testing.assert_allclose(scale / scale[0], spread / spread[0], rtol=0.2)


@pytest.mark.parametrize(("shift", "factor"), [(0, 1), (1e5, 1), (0, 1e8), (7e5, -365)])
def test_sizes_of_people_are_those_of_weighed_least_squares(shift, factor):
    """In the unit of the covariate, however large its numbers are."""
    values = np.random.default_rng(1).standard_normal(N) + 2 * (SEX == "f") + 0.05 * AGE
    studies = studies_of({"sex": SEX, "age": factor * AGE + shift}, "sex + age", None, N)
    of_units = values[:, np.newaxis, np.newaxis]
    model = np.column_stack([np.ones(N), SEX == "m", AGE])
    for name, k in (("sex", 1), ("age", 2)):
        scale = studies[name].design.scale_of(of_units)
        inverse = np.linalg.inv((model.T / scale**2) @ model)
        fitted = inverse @ (model.T / scale**2) @ values
        left = (np.square((values - model @ fitted) / scale)).sum() / (N - 3)
        half = stats.t.ppf(0.975, N - 3) * np.sqrt(left * inverse[k, k])
        expected = np.array([fitted[k], fitted[k] - half, fitted[k] + half])
        if name == "age":
            expected = np.sort(expected / factor)[[1, 0, 2]]
        found, *numbers = studies[name].size(values, "shape", scale=scale)
        assert found == (
            "m below f" if k == 1 else f"{'higher' if factor > 0 else 'lower'} with age"
        )
        np.testing.assert_allclose(numbers, expected, rtol=1e-6)


def test_factors_of_people_cross_in_differences_of_differences():
    cells = {("A", "f"): 0, ("A", "m"): 1, ("B", "f"): 0, ("B", "m"): 3}
    group, sex = np.array(list("AABB" * 5)), np.array(list("fm" * 10))
    values = np.array([cells[pair] for pair in zip(group, sex, strict=True)], dtype=float)
    values += 0.01 * np.random.default_rng(0).standard_normal(20)
    data = {"group": group, "sex": sex}
    study = studies_of(data, "group * sex + sex:group", None, 20)["group:sex"]
    words, size, lower, upper = study.size(values, "shape")
    assert words == "B less A: m above f"
    assert size == pytest.approx(2, abs=0.02)
    assert lower < 2 < upper
    assert [change.name for change in study.changes[0]] == ["B less A: m less f"]
    # The slope with a covariate, by group.
    age = np.random.default_rng(1).uniform(20, 60, 20)
    slopes = studies_of(data | {"age": age}, "group * age", None, 20)["group:age"]
    words, size, *_ = slopes.size(np.where(group == "B", 0.1, 0.02) * age, "shape")
    assert words == "slope with age: B above A"
    assert size == pytest.approx(0.08)


def test_conditions_are_compared_two_by_two_in_each_person():
    rng = np.random.default_rng(2)
    person, condition = np.repeat(range(8), 6), np.array(list("abcabc") * 8)
    values = rng.standard_normal(48) + rng.standard_normal(8)[person] + (condition == "c")
    group = np.array(["x", "y"])[person % 2]
    data = pd.DataFrame({"shoe": condition, "group": group})
    studies = studies_of(data, "shoe * group", person, 48)
    assert list(studies) == ["shoe", "group", "shoe:group"]
    means = pd.Series(values).groupby([person, condition]).mean().unstack()
    pairs = [("a", "b"), ("a", "c"), ("b", "c")]
    changes = np.array([means[b] - means[a] for a, b in pairs])
    of_group = Study.of(group[::6], None, covariate=False, paired=False, n=8)
    z = deviate(studies["shoe:group"], values)
    for k, (a, b) in enumerate(pairs):
        # Between groups as compare_groups compares them, of which group is a plain column.
        assert z[k] == pytest.approx(deviate(of_group, changes[k])[0])
        words, size, *_ = studies["shoe"].size(changes[k], "shape", k)
        assert words == f"{b} {'above' if size > 0 else 'below'} {a}"
        assert studies["shoe:group"].size(changes[k], "timing", k)[0].startswith(f"{b} less {a}: y")
    alone = studies_of(data, "shoe", person, 48)["shoe"]
    z = deviate(alone, values)
    expected = [stats.ttest_rel(means[b], means[a]).pvalue for a, b in pairs]
    np.testing.assert_allclose(2 * stats.norm.sf(np.abs(z)), expected, rtol=1e-3)
    mean = deviate(of_group, means.mean(axis=1).to_numpy())
    assert deviate(studies["group"], values) == pytest.approx(mean)


def test_two_conditions_cross_in_differences_of_differences():
    person, n = np.repeat(range(5), 4), 20
    data = {"shoe": ["old", "old", "new", "new"] * 5, "slope": ["up", "down"] * 10}
    values = np.random.default_rng(4).standard_normal(n)
    studies = studies_of(data, "shoe * slope", person, n)
    study = studies["shoe:slope"]
    # Levels are sorted: new before old, down before up.
    old_up, old_down, new_up, new_down = values.reshape(5, 4).T
    expected = (old_up - new_up) - (old_down - new_down)
    np.testing.assert_allclose(study.units(values[:, None, None])[:, 0, 0], expected)
    words, size, *_ = study.size(expected, "shape")
    assert words == f"old less new: up {'above' if size > 0 else 'below'} down"
    # An effect alone is the mean over the other condition.
    mean = ((old_up - new_up) + (old_down - new_down)) / 2
    np.testing.assert_allclose(studies["shoe"].units(values[:, None, None])[:, 0, 0], mean)


def test_contrasts_stand_one_behind_the_other_with_all_features():
    person, data = np.repeat(range(4), 3), {"shoe": ["a", "b", "c"] * 4, "group": [*"xxxyyy"] * 2}
    data["age"] = 10.0 * person
    values = np.random.default_rng(9).standard_normal((12, 5, 2))
    studies = studies_of(data, "shoe * group + age", person, 12)
    by_shoe = values.reshape(4, 3, 5, 2)
    pairs = [by_shoe[:, high] - by_shoe[:, low] for low, high in ((0, 1), (0, 2), (1, 2))]
    np.testing.assert_allclose(studies["shoe"].units(values), np.concatenate(pairs, axis=2))
    # An age is beside the groups in the means, and not in the differences of conditions.
    assert isinstance(studies["shoe:group"].design, GroupDesign)
    assert isinstance(studies["group"].design, EffectDesign)
    four = {"a": [*"xxyy"], "b": [*"xyxy"]}
    with pytest.raises(ValueError, match="cannot be told from the others with these 4 people"):
        studies_of(four, "a * b", None, 4)


def test_two_conditions_alone_are_pairs_of_compare_groups():
    rng, t = np.random.default_rng(5), np.linspace(0, 1, 30)
    person, y = np.repeat(range(7), 2), ["before", "after"] * 7
    X = [np.sin(3 * t + rng.normal(0, 0.1) + 0.2 * (k % 2))[:, None] for k in range(14)]
    match = LinearSynchronizer(30).fit(X).match(X)
    pairs = compare_groups(match, X, y, groups=person, paired=True, n_permutations=199)
    when = pd.Categorical(y, categories=["before", "after"])
    effects = compare_effects(match, X, {"when": when}, "when", groups=person, n_permutations=199)
    assert list(effects) == ["when"]
    assert effects["when"].p_shape == pairs.p_shape <= 0.05
    columns = ["feature", "start", "end", "p", "direction", "size", "lower", "upper"]
    pd.testing.assert_frame_equal(effects["when"].clusters[columns], pairs.clusters[columns])


def test_bands_hold_intervals_of_welch_and_grow_with_what_is_held():
    rng, t = np.random.default_rng(6), np.linspace(0, 1, 25)
    y = np.array(list("aab" * 5))
    spread = np.where(y == "a", 0.1, 0.6)
    X = [np.outer(np.sin(3 * t + rng.normal(0, s)), [1, 2]) + rng.normal(0, s) for s in spread]
    found = compare_groups(LinearSynchronizer(25).fit(X), X, y, n_permutations=199)
    assert "15 trials, variance of b" in found.describe()
    assert found.bands.groupby(["what", "feature"], sort=False).size().tolist() == [25, 25, 25]
    assert set(found.bands["difference"]) == {"b less a"}
    curves = np.array(X)
    test = stats.ttest_ind(curves[y == "b"], curves[y == "a"], equal_var=False)
    of_shape = found.bands[found.bands["what"] == "shape"]
    for k, (_, band) in enumerate(of_shape.groupby("feature")):
        np.testing.assert_allclose(band["time"], np.linspace(0, 100, 25))
        interval = test.confidence_interval(0.9)
        np.testing.assert_allclose(band["least"], interval.low[:, k])
        np.testing.assert_allclose(band["most"], interval.high[:, k])
        assert (band["lower"] < test.confidence_interval(0.95).low[:, k]).all()
        largest = np.abs([interval.low[:, k], interval.high[:, k]]).max()
        assert found.within().loc["shape", f"x{k}", "b less a"] == pytest.approx(largest)
    # The margin is that of both signs; people who vary alike have no ratio of variances.
    negative = [-x for x in X]
    less = compare_groups(LinearSynchronizer(25).fit(negative), negative, y, n_permutations=99)
    np.testing.assert_allclose(less.within().to_numpy(), found.within().to_numpy())
    # Several groups: each two of them.
    y = np.array(list("abc" * 5))
    found = compare_groups(LinearSynchronizer(25).fit(X), X, y, n_permutations=199, features=[0])
    differences = found.bands.loc[found.bands["what"] == "shape", "difference"]
    assert differences.unique().tolist() == ["b less a", "c less a", "c less b"]
    alike = [x + rng.normal(0, 0.2) for x in [X[0]] * 20]
    found = compare_groups(LinearSynchronizer(25).fit(alike), alike, [*"ab"] * 10)
    assert "variance" not in found.describe()


@pytest.mark.parametrize(
    ("ratio", "n", "n_studies"),
    [
        (3, (9, 5), 60),
        pytest.param(1, (8, 8), 300, marks=pytest.mark.nightly),
        pytest.param(3, (9, 5), 300, marks=pytest.mark.nightly),
    ],
)
def test_bands_hold_the_true_difference_at_all_frames(ratio, n, n_studies):
    """In 95 % of studies, with 199 permutations each, also if groups vary differently."""
    group = np.repeat([0, 1], n)
    study = Study.of(group.tolist(), None, covariate=False, paired=False, n=len(group))
    truth = 1.5 * np.exp(-0.5 * np.square((np.arange(30) - 15) / 4))[:, np.newaxis]
    held = []
    for seed in range(n_studies):
        rng = np.random.default_rng(seed)
        noise = gaussian_filter1d(rng.standard_normal((len(group), 50, 1)), 4, axis=1)[:, 10:40]
        values = noise * np.where(group, ratio, 1)[:, None, None] + group[:, None, None] * truth
        (family,) = families(
            study.design, [values], 199, np.random.RandomState(seed), progress=Progress(None, 0)
        )
        z = np.quantile(family.peaks, 0.95, method="higher")
        size, error, freedom = study.change(values, study.changes[0][0])
        held.append((np.abs(size - truth) <= study.design.critical(z, freedom) * error).all())
    error = np.sqrt(0.95 * 0.05 / n_studies)
    assert np.mean(held) == pytest.approx(0.95, abs=3 * error)


@pytest.mark.parametrize(
    ("formula", "changed", "message"),
    [
        ("group + weight", {}, "'weight' is no column of data, which has 'group', 'sex', 'age'"),
        ("y ~ group", {}, "without 'y ~' and '1'"),
        ("group:sex", {}, "has group:sex without group: write group \\* sex"),
        ("group + side", {"side": ["l", "r"] + ["l"] * (N - 2)}, "groups: 2 has no trial of r"),
        (
            "group + age",
            {"age": AGE[:-1]},
            "17 trials; its column 'age' has 16",
        ),
        (
            "group + same",
            {"same": [GROUP[1], *GROUP[1:]]},
            "'group' cannot be told",
        ),
        ("sex", {"sex": ["f"] * N}, "all trials have 'f' in 'sex'"),
        ("age", {"age": np.where(np.arange(N) == 0, 90, AGE)}, "'age' differs within people"),
        ("age", {"age": [np.nan, *AGE[1:]]}, "must be finite"),
    ],
)
def test_what_cannot_be_compared_is_told(formula, changed, message):
    # Two trials are of one person, whose number is that of the second.
    data = {name: np.array(values) for name, values in PEOPLE.items()}
    for values in data.values():
        values[0] = values[1]
    data |= {name: np.array(values) for name, values in changed.items()}
    with pytest.raises(ValueError, match=message):
        studies_of(data, formula, [1, *range(1, N)], N)
