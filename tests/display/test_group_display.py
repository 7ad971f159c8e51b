"""GroupDisplay: means, bands, offsets, events and clusters of people, in true units."""

import numpy as np
import pandas as pd
import pytest
from artists import edges, segments, texts
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import ASpace, DenseSynchronizer, FrameWise, Match
from sklearn_motionsync.comparison import compare_groups
from sklearn_motionsync.datasets import make_gait
from sklearn_motionsync.display import GroupDisplay

P = 51
GAIT = make_gait(14, 2, timing=6, amplitude=20, random_state=0)
TRIALS = [pd.DataFrame(x, columns=GAIT.feature_names) for x in GAIT.data]
for x in TRIALS:
    x.attrs["units"] = list(GAIT.units)
GIVEN = {"y": GAIT.group, "groups": GAIT.person}


@pytest.fixture(scope="module")
def pipe():
    return make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(P)).fit(TRIALS)


@pytest.fixture(scope="module")
def found(pipe):
    return compare_groups(pipe, TRIALS, **GIVEN, n_permutations=199)


def means_of_people(values, group):
    """Of the people of a group, in pandas: (n_people, ...)."""
    flat = pd.DataFrame(values.reshape(len(values), -1)).groupby(list(GAIT.person), sort=False)
    of = pd.Series(list(GAIT.group)).groupby(list(GAIT.person), sort=False).first() == group
    return flat.mean()[of].to_numpy().reshape(-1, *values.shape[1:])


def offsets_from_mean(match):
    """Offsets in per cent, less their mean over trials."""
    offsets = pd.DataFrame(match.offsets_in("percent"))
    return (offsets - offsets.mean()).to_numpy()


def test_means_and_bands_are_of_people_in_degrees(pipe):
    display = GroupDisplay.from_estimator(pipe, TRIALS, **GIVEN)
    match = Match.from_estimator(pipe, TRIALS)
    curves, offsets = match.warp(GAIT.data), offsets_from_mean(match)
    for k, group in enumerate("AB"):
        for axis, values in enumerate([*np.moveaxis(curves, 2, 0), offsets]):
            people = means_of_people(np.asarray(values), group)
            mean, half = people.mean(axis=0), people.std(axis=0, ddof=1)
            assert len(people) == 7
            np.testing.assert_allclose(display.means_[axis][k].get_ydata(), mean)
            bounds = mean - half, mean + half
            np.testing.assert_allclose(edges(display.bands_[axis][k]), bounds, atol=1e-9)
    assert [axis.get_ylabel() for axis in display.axes_[:2]] == [
        "hip_flexion (deg)",
        "knee_flexion (deg)",
    ]
    title = display.axes_[0].get_legend().get_title().get_text()
    assert "standard deviation of people" in title.replace("\n", " ")
    assert texts(display.axes_[0]) == ["A: 14 trials of 7 people", "B: 14 trials of 7 people"]


def test_clusters_are_bars_where_the_table_says(pipe, found):
    display = GroupDisplay.from_estimator(pipe, TRIALS, **GIVEN, comparison=found)
    drawn = [[tuple(xy[:, 0]) for xy in segments(lines)] for lines in display.clusters_]
    for name, bars in zip([*GAIT.feature_names, "offset"], drawn, strict=True):
        rows = found.clusters[found.clusters["feature"] == name]
        assert bars == list(zip(rows["start"], rows["end"], strict=True))
    assert sum(map(len, drawn)) == len(found.clusters) > 1
    assert texts(display.axes_[0])[-1] == "differs, p at most 0.05"
    # Dots are at the peaks of timing, one a person.
    peaks = found.clusters.loc[found.clusters["what"] == "timing", "peak"]
    for k, dots in enumerate(display.dots_):
        at, offset = dots.get_offsets().T
        assert len(at) == 7 * len(peaks)
        assert np.abs(np.unique(at) - np.sort(peaks)).max() < 2
        people = means_of_people(offsets_from_mean(Match.from_estimator(pipe, TRIALS)), "AB"[k])
        frames = (peaks.to_numpy() * (P - 1) / 100).round().astype(int)
        np.testing.assert_allclose(np.sort(offset), np.sort(people[:, frames].ravel()))


def test_differences_in_signals_that_are_not_shown_are_named(pipe, found):
    display = GroupDisplay.from_estimator(
        pipe, TRIALS, **GIVEN, features=["hip_flexion"], comparison=found
    )
    assert "knee_flexion" in display.axes_[0].get_legend().get_title().get_text()
    wide = [np.repeat(x, 2, axis=1) for x in GAIT.data]
    display = GroupDisplay.from_estimator(pipe, TRIALS, **GIVEN, signals=wide)
    assert display.title.endswith("of people; 4 of 8 signals")
    assert len(display.axes_) == 5


def test_events_are_lines_at_their_mean_place_with_the_spread_of_people(pipe):
    events = pd.DataFrame(GAIT.keyframes, columns=GAIT.keyframe_names)
    events.iloc[3, 2] = np.nan
    display = GroupDisplay.from_estimator(pipe, TRIALS, **GIVEN, events=events)
    match = Match.from_estimator(pipe, TRIALS)
    lengths = np.array([[len(x) - 1] for x in TRIALS])
    own = events.to_numpy() / lengths * (P - 1)
    places = np.array([np.interp(o, t, range(P)) for o, t in zip(own, match.times, strict=True)])
    people = pd.DataFrame(places).groupby(list(GAIT.person), sort=False).mean()
    drawn = [line.get_xdata()[0] for line in display.events_[0]]
    np.testing.assert_allclose(drawn, people.mean() * 100 / (P - 1))
    np.testing.assert_allclose(np.sort(display.events.std()), np.sort(people.std()))
    offsets = means_of_people(offsets_from_mean(match), "A")
    expected = [np.interp(people.mean(), range(P), row) for row in offsets]
    np.testing.assert_allclose(display.dots_[0].get_offsets()[:, 1], np.ravel(expected))
    # Key-frames that the match is given are events, too.
    aligned = DenseSynchronizer(P).fit(GAIT.data, keyframes=GAIT.keyframes)
    display = GroupDisplay.from_estimator(aligned, GAIT.data, keyframes=GAIT.keyframes)
    drawn = [line.get_xdata()[0] for line in display.events_[0]]
    np.testing.assert_allclose(drawn, aligned.keyframes_ * 100 / (P - 1), atol=0.5)


def test_seconds_and_labels(pipe):
    display = GroupDisplay.from_estimator(
        pipe,
        TRIALS,
        GAIT.group,
        features="knee_flexion",
        unit="seconds",
        frame_rate=100,
        units={"knee_flexion": "degrees"},
        xlabel="time of the cycle (s)",
    )
    assert display.axes_[1].get_xlabel() == "time of the cycle (s)"
    assert display.axes_[0].get_ylabel() == "knee_flexion\n(degrees)"
    assert display.axes_[1].get_ylabel().endswith("the mean (s)")
    seconds = (np.median([len(x) for x in TRIALS]) - 1) / 100
    assert display.axes_[1].get_xlim() == pytest.approx((0, seconds))
    assert texts(display.axes_[0]) == ["A: 14 trials", "B: 14 trials"]
    assert "of trials" in display.axes_[0].get_legend().get_title().get_text()


def test_pairs_are_joined_and_one_group_needs_no_label(pipe):
    halves = [("left", "right")[k % 2] for k in range(len(TRIALS))]
    display = GroupDisplay.from_estimator(pipe, TRIALS, halves, groups=GAIT.person)
    pairs = [line for line in display.axes_[-1].get_lines() if len(line.get_xdata()) == 2]
    assert len(pairs) == 14 + 1  # and the line at 0
    display = GroupDisplay.from_estimator(pipe, TRIALS, groups=GAIT.person)
    assert texts(display.axes_[0]) == ["28 trials of 14 people"]
    alone = GroupDisplay.from_estimator(pipe, TRIALS[:2], groups=GAIT.person[:2])
    assert alone.bands_[0][0].get_paths() == []


def test_signals_are_what_reaches_an_aspace():
    pipe = make_pipeline(ASpace(2), DenseSynchronizer(P)).fit(GAIT.data)
    display = GroupDisplay.from_estimator(pipe, GAIT.data, GAIT.group)
    assert display.feature_names == ["aspace0", "aspace1"]
    display = GroupDisplay.from_estimator(pipe, GAIT.data, GAIT.group, signals=TRIALS)
    assert display.feature_names == list(GAIT.feature_names)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"features": "elbow"}, "There is no feature 'elbow'"),
        ({"units": ["a"]}, "units must be a list of text, one for each of the 4 signals"),
        ({"units": {"elbow": "deg"}}, "units: there is no signal 'elbow'; there are hip_flexion"),
        ({"unit": "seconds"}, "frame_rate"),
        ({"signals": TRIALS[:3]}, "one sequence for each of 28 trials, got 3"),
        ({"events": np.ones((3, 1))}, "events must be a list of 28 arrays"),
        ({"y": ["A"]}, "y must have one label"),
    ],
)
def test_refused_arguments(pipe, given, message):
    with pytest.raises(ValueError, match=message):
        GroupDisplay.from_estimator(pipe, TRIALS, **(GIVEN | given))


def test_a_comparison_in_another_unit_is_refused(pipe, found):
    with pytest.raises(ValueError, match="in percent, and the figure in frames"):
        GroupDisplay.from_estimator(pipe, TRIALS, **GIVEN, comparison=found, unit="frames")
