"""compare_events: means and spread of people, tests against SciPy, tables, gaps, refusals."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from sklearn_motionsync import to_frame, to_trials
from sklearn_motionsync.comparison import compare_events
from sklearn_motionsync.datasets import make_gait

GAIT = make_gait(16, 2, timing=3, random_state=0)
K = pd.DataFrame(GAIT.keyframes, columns=GAIT.keyframe_names)
SHARES = 100 * GAIT.keyframes / [[len(x) - 1] for x in GAIT.data]
GIVEN = {"y": GAIT.group, "groups": GAIT.person}


def of_people(values=SHARES):
    return pd.DataFrame(values).groupby(list(GAIT.person), sort=False).mean().to_numpy()


def test_means_spreads_sizes_and_p_values_are_those_of_people(capsys):
    found = compare_events(GAIT.data, K, **GIVEN)
    a, b = of_people()[::2], of_people()[1::2]
    for label, people in (("A", a), ("B", b)):
        np.testing.assert_allclose(found[f"{label} mean"], people.mean(axis=0))
        np.testing.assert_allclose(found[f"{label} sd"], people.std(axis=0, ddof=1))
        assert (found[f"{label} n"] == 8).all()
    welch = stats.ttest_ind(b, a, equal_var=False)
    np.testing.assert_allclose(found["size"], b.mean(axis=0) - a.mean(axis=0))
    np.testing.assert_allclose(found["lower"], welch.confidence_interval().low)
    np.testing.assert_allclose(found["upper"], welch.confidence_interval().high)
    assert found.loc["toe-off", "direction"] == "B later than A"
    assert found.loc["toe-off", "differs"]
    # Corrected for five events: the share of draws of which the largest t is as large.
    random = np.random.RandomState(0)
    draws = [(random.permutation(16), random.choice([-1, 1], 16)) for _ in range(1999)]
    # People are permuted in the order of their values, less the common mean, by Welch's t.
    by_value = (of_people() @ np.sin(1 + np.arange(5))).argsort()
    people, group = of_people()[by_value], by_value % 2
    spread = np.array([x.std(axis=0, ddof=1) for x in (a, b)])
    middle = np.average([a.mean(axis=0), b.mean(axis=0)], axis=0, weights=spread**-2)
    z = (people - middle) / spread[group]
    z -= z.mean(axis=0)
    drawn = [(group[order], z + signs @ z / np.sqrt(16 * 15)) for order, signs in draws]
    of_draws = [[x[y == k] * spread[k] for y, x in drawn] for k in (0, 1)]
    t = stats.ttest_ind(*map(np.array, of_draws), axis=1, equal_var=False).statistic
    t = np.concatenate([[stats.ttest_ind(a, b, equal_var=False).statistic], t])
    largest = np.abs(t).max(axis=1)
    shares = [np.mean(largest >= (1 - 1e-9) * abs(one)) for one in t[0]]
    assert found["p"].tolist() == shares
    least = found["p"].min()
    at_level = compare_events(GAIT.data, K, **GIVEN, level=least)
    assert at_level["differs"].tolist() == (found["p"] == least).tolist()
    assert capsys.readouterr().out == ""


def test_a_table_in_seconds_without_groups():
    names = pd.MultiIndex.from_arrays([GAIT.person, GAIT.cycle], names=["subject", "trial"])
    trials = to_trials(to_frame(GAIT.data, trials=names))
    rows = (K.set_axis(names) / 100).rename_axis(columns="event").stack().rename("seconds")
    found = compare_events(trials, rows.reset_index(), groups=GAIT.person, frame_rate=100)
    assert list(found) == ["mean", "sd", "n"]
    np.testing.assert_allclose(found["mean"].loc[list(K)], of_people().mean(axis=0))
    seconds = compare_events(trials, rows.reset_index(), unit="seconds", frame_rate=100)
    np.testing.assert_allclose(seconds["mean"].loc[list(K)], K.mean() / 100)
    frames = compare_events(trials, K.set_axis(names), unit="frames")
    np.testing.assert_allclose(frames["mean"], K.mean())


def test_events_in_attrs():
    trials = [pd.DataFrame(x) for x in GAIT.data]
    for x, row in zip(trials, GAIT.keyframes, strict=True):
        x.attrs["events"] = [{"label": "Foot Off", "context": "Right", "frame": row[3]}]
    found = compare_events(trials)
    assert found.index.tolist() == [("Foot Off", "Right")]
    assert found["mean"].iloc[0] == pytest.approx(SHARES[:, 3].mean())


def test_pairs_and_a_covariate():
    second = np.tile([0, 1], 16)
    paired = compare_events(GAIT.data, K, second, groups=GAIT.person, paired=True)
    differences = SHARES[1::2] - SHARES[::2]
    np.testing.assert_allclose(paired["size"], differences.mean(axis=0))
    half = stats.t.ppf(0.975, 15) * stats.sem(differences)
    np.testing.assert_allclose(paired["upper"], differences.mean(axis=0) + half)
    speed = dict(zip(dict.fromkeys(GAIT.person), np.linspace(1, 2, 16), strict=True))
    values = [speed[p] for p in GAIT.person]
    found = compare_events(GAIT.data, K, y=values, covariate=True, groups=GAIT.person)
    slope = stats.linregress(np.linspace(1, 2, 16), of_people()[:, 3]).slope
    assert found.loc["toe-off", "size"] == pytest.approx(slope)
    assert "with the covariate" in found.loc["toe-off", "direction"]
    # What hardly differs within people is one of people; else slopes within them are tested.
    up = np.where(second, 1, -1)
    for off in (1e-12, 1e-7, 1e-4, 0.02):
        nearly = compare_events(
            GAIT.data, K, y=values + off * up, covariate=True, groups=GAIT.person
        )
        pd.testing.assert_frame_equal(nearly, found)
    within = np.array(values) + np.where(np.repeat(range(16), 2), 0.2 * up, 1e-9 * up)
    with pytest.warns(UserWarning, match=r"y differs by 0\.194 within people, and by 0\.307 betw"):
        slopes = compare_events(GAIT.data, K, y=within, covariate=True, groups=GAIT.person)
    # Of the first person there is no slope.
    assert slopes.loc["toe-off", "size"] == pytest.approx(differences[1:, 3].mean() / 0.4)


def test_events_that_some_trials_and_people_lack():
    events = K.copy()
    events.iloc[0, 3] = np.nan  # person 0 has another trial
    events.iloc[2:4, 3] = np.nan  # person 1 has none
    found = compare_events(GAIT.data, events, **GIVEN)
    assert found.loc["toe-off", ["A n", "B n"]].tolist() == [8, 7]
    assert found.loc["peak knee flexion", "B n"] == 8
    values = SHARES.copy()
    values[0, 3] = np.nan
    values[2:4, 3] = np.nan
    people = of_people(values)[:, 3]
    assert found.loc["toe-off", "A mean"] == pytest.approx(people[::2].mean())
    assert found.loc["toe-off", "B mean"] == pytest.approx(np.nanmean(people[1::2]))
    welch = stats.ttest_ind(people[3::2], people[::2], equal_var=False).confidence_interval()
    assert found.loc["toe-off", "lower"] == pytest.approx(welch.low)
    events.iloc[6::4, 3] = events.iloc[7::4, 3] = np.nan
    events.iloc[6:8, 3] = K.iloc[6:8, 3]  # persons 3 and 5 alone of group B
    events.iloc[10:12, 3] = K.iloc[10:12, 3]
    assert compare_events(GAIT.data, events, **GIVEN).loc["toe-off", "B n"] == 2


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"events": np.ones((3, 2))}, "events must be a list of 32 arrays"),
        ({"events": K.iloc[:, ::-1]}, "key-frames must be 5 increasing frames"),
        ({"unit": "hours"}, "unit must be one of"),
        ({"unit": "seconds"}, "The frame rate of trial 0 is not known"),
        ({"level": 0}, "level must be a number"),
        ({"n_permutations": 18}, "whole number of at least 19"),
        ({"y": [0, 1] * 16, "paired": True, "events": K[K.index % 4 % 3 > 0].reindex(K.index)},
         "'first force peak' is known in 0 people whose trials are compared"),
        ({"y": None, "covariate": True}, "y is needed"),
        ({"y": ["A"] * 30 + ["B"] * 2, "groups": None, "events": K.iloc[:31].reindex(K.index)},
         "'first force peak' is known in 1 people of group 'B', and at least 2 are needed"),
    ],
)  # fmt: skip
def test_refused_arguments(given, message):
    with pytest.raises(ValueError, match=message):
        compare_events(GAIT.data, **({"events": K} | GIVEN | given))
