"""SynchronizationDisplay: its artists agree with the synchronizer."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from artists import segments, texts, ys
from matplotlib.colors import to_rgba
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler
from sklearn_motionsync import (
    ActionModel,
    DenseSynchronizer,
    DirectionCosines,
    FrameWise,
    LinearSynchronizer,
    Match,
    TimingChannel,
    to_frame,
)
from sklearn_motionsync.datasets import make_gait
from sklearn_motionsync.display import ActionModelDisplay, SynchronizationDisplay

GROUPS = ["young", "old", "young", "old", "young", "old", "young", "old", "one"]
P = 30


def test_features_before_and_after_and_warps(bunch, pipe):
    display = SynchronizationDisplay.from_estimator(pipe, bunch.data, features=[2, "aspace0"])
    points, synchronizer = pipe[:2].transform(bunch.data), pipe[2]
    warped = synchronizer.transform(points)
    assert len(display.axes_) == 5
    for row, feature in enumerate([2, 0]):
        for xy, x in zip(segments(display.before_[row]), points, strict=True):
            np.testing.assert_array_equal(xy, np.column_stack([np.arange(len(x)), x[:, feature]]))
        np.testing.assert_array_equal(ys(display.after_[row]), warped[:, :, feature])
        line = display.pattern_[row]
        np.testing.assert_array_equal(line.get_ydata(), synchronizer.pattern_[:, feature])
        assert display.axes_[2 * row].get_ylabel() == f"aspace{feature}"
        assert line.get_zorder() >= display.after_[row].get_zorder()
    offsets = synchronizer.match(points).offsets
    np.testing.assert_allclose(ys(display.offsets_), offsets - offsets.mean(axis=0), atol=1e-12)
    assert display.axes_[4].get_ylabel() == "later than\nthe mean (frames)"
    low, high = display.axes_[0].get_ylim()
    assert low <= min(x[:, 2].min() for x in points) <= max(x[:, 2].max() for x in points) <= high
    assert display.group_means_ == [[], []]
    # The title names the pattern, if it is among the trials.
    index = pipe[2].pattern_index_
    assert display.axes_[1].get_title() == f"aligned\nblack: the pattern, trial {index}"
    others = [x for i, x in enumerate(bunch.data) if i != index]
    display = SynchronizationDisplay.from_estimator(pipe, others, features=0)
    assert display.axes_[1].get_title() == "aligned\nblack: the pattern"


def test_the_mean_of_each_group_is_in_front(bunch, pipe):
    display = SynchronizationDisplay.from_estimator(
        pipe, bunch.data, y=np.array(GROUPS), features=[0, 2]
    )
    warped = pipe[:3].transform(bunch.data)
    for row, feature in enumerate([0, 2]):
        for name, line in zip(["young", "old", "one"], display.group_means_[row], strict=True):
            of = np.array(GROUPS) == name
            np.testing.assert_allclose(line.get_ydata(), warped[of][:, :, feature].mean(axis=0))
            assert line.get_zorder() > display.after_[row].get_zorder()
            for artist in (display.before_[row], display.after_[row], display.offsets_):
                colors = artist.get_colors()[of][:, :3]
                assert (colors == to_rgba(line.get_color())[:3]).all()
    assert texts(display.axes_[0]) == ["young", "old", "one"]


def test_rows_tables_and_unnamed_features_are_accepted(bunch):
    rows = np.sin(np.linspace(0, 6, 25) + np.linspace(0, 1, 5)[:, np.newaxis])
    display = SynchronizationDisplay.from_estimator(DenseSynchronizer(20).fit(rows), rows)
    assert display.after.shape == (5, 20, 1)
    frames = [pd.DataFrame(x[:, :2], columns=["knee", "hip"]) for x in bunch.data]
    linear = LinearSynchronizer(20).fit(frames)
    for X in (frames, to_frame(frames)):
        for estimator in (linear, Match.from_estimator(linear, X)):
            display = SynchronizationDisplay.from_estimator(estimator, X, features="hip")
            assert display.ylabels == ["hip"]
            np.testing.assert_array_equal(display.before[2][:, 0], frames[2]["hip"])
            np.testing.assert_array_equal(display.after[0, :, 0], linear.transform(frames)[0, :, 1])
    some = FunctionTransformer(lambda X: [x[:, :3] for x in X])
    pipe = make_pipeline(some, LinearSynchronizer(20)).fit(bunch.data)
    assert SynchronizationDisplay.from_estimator(pipe, bunch.data).ylabels == ["x0", "x1", "x2"]


def test_axes_of_the_user(bunch, pipe):
    figure, axes = plt.subplots(2, 2)
    display = SynchronizationDisplay.from_estimator(pipe, bunch.data, features=0, ax=axes[0, 1])
    assert display.figure_ is figure
    assert len(display.axes_) == 3
    assert not axes[0, 1].axison
    # The panels take the place of the divided axes.
    figure.canvas.draw()
    box = axes[0, 1].get_position()
    for axis in display.axes_:
        assert box.x0 - 1e-9 <= axis.get_position().x0 <= axis.get_position().x1 <= box.x1 + 1e-9
    _, axes = plt.subplots(2, 1)
    with pytest.raises(ValueError, match="or 3 axes, one a panel; got 2"):
        display.plot(axes)
    display.warps = False
    assert display.plot(axes).axes_ == list(axes)
    assert display.offsets_ is None
    with pytest.raises(ValueError, match="one of a figure's subplots"):
        display.plot(plt.figure().add_axes([0, 0, 1, 1]))


def test_units_of_time_and_frame_rates_of_tables(bunch, pipe):
    lengths = np.array([len(x) for x in bunch.data])
    times = pipe[2].match(pipe[:2].transform(bunch.data)).times
    tables, rates = [pd.DataFrame(x) for x in bunch.data], np.linspace(20, 100, 9)
    for x in tables:
        x.attrs["frame_rate"] = 20.0
    for X, unit, rate, ends, last in (
        (bunch.data, "frames", None, lengths - 1, P - 1),
        (bunch.data, "percent", None, np.full(9, 100), 100),
        (bunch.data, "seconds", 50, (lengths - 1) / 50, np.median(lengths - 1) / 50),
        (bunch.data, "seconds", rates, (lengths - 1) / rates, np.median((lengths - 1) / rates)),
        (tables, "seconds", None, (lengths - 1) / 20, np.median(lengths - 1) / 20),
    ):
        display = SynchronizationDisplay.from_estimator(
            pipe, X, features=[0], unit=unit, frame_rate=rate
        )
        for path, n, end in zip(display.before_[0].get_paths(), lengths, ends, strict=True):
            np.testing.assert_allclose(path.vertices[:, 0], np.linspace(0, end, n))
        clock = np.linspace(0, last, P)
        np.testing.assert_allclose(display.pattern_[0].get_xdata(), clock)
        scale = {"frames": 1, "percent": 100 / (P - 1)}.get(unit, ends[:, None] / (P - 1))
        offsets = (times - np.arange(P)) * scale
        for path in display.offsets_.get_paths():
            np.testing.assert_allclose(path.vertices[:, 0], clock)
        np.testing.assert_allclose(ys(display.offsets_), offsets - offsets.mean(axis=0), atol=1e-9)
        labels = " ".join(axis.get_xlabel() for axis in display.axes_)
        assert {"frames": "frame of", "percent": "% of", "seconds": "(s)"}[unit] in labels
    with pytest.raises(ValueError, match=r"The frame rate of .* is not known"):
        SynchronizationDisplay.from_estimator(pipe, bunch.data, unit="seconds")


# -- how sure the warps are ------------------------------------------------------------------


def twice(x):
    """A trial in which the movement is repeated; it is doubtful."""
    return np.concatenate([x, x])


def is_dotted(lines):
    """Whether each line is dotted."""
    return [dashes is not None for _, dashes in lines.get_linestyle()]


def test_bands_are_the_intervals_of_the_match_in_any_unit(bunch, pipe):
    match, given = Match.from_estimator(pipe, bunch.data), {"features": 0, "frame_rate": 50}
    for unit in ("frames", "percent", "seconds"):
        display = SynchronizationDisplay.from_estimator(pipe, bunch.data, unit=unit, **given)
        given_to = unit, bunch.data, 50
        times = match.to_frame(*given_to)["time"].to_numpy().reshape(9, -1)
        offsets = match.offsets_in(*given_to)
        mean = times - offsets + offsets.mean(axis=0)
        lower, upper = (bound - mean for bound in match.interval(0.9, *given_to))
        clock = display.pattern_[0].get_xdata()
        corners = np.array(segments(display.intervals_))
        np.testing.assert_allclose(corners[:, :-1, 0], [[*clock, *clock[::-1]]] * 9)
        np.testing.assert_allclose(corners[:, :P, 1], lower, atol=1e-12)
        np.testing.assert_allclose(corners[:, P:-1, 1], upper[:, ::-1], atol=1e-12)
    assert display.axes_[-1].get_title().endswith("shaded: 90 % intervals")
    assert display.intervals_.get_zorder() < display.offsets_.get_zorder()


def test_doubtful_trials_are_dotted_in_all_panels(bunch, pipe):
    X = [*bunch.data[:4], twice(bunch.data[4]), *bunch.data[5:]]
    points = pipe[:2].transform(X)
    match = pipe[2].match(points)
    doubtful = [i == 4 for i in range(9)]
    assert match.doubtful.tolist() == doubtful
    # A match that is known already tells the same.
    for estimator, trials, groups in ((pipe, X, None), (pipe, X, GROUPS), (match, points, None)):
        display = SynchronizationDisplay.from_estimator(estimator, trials, features=[0], y=groups)
        for lines in (*display.before_, *display.after_, display.offsets_):
            assert is_dotted(lines) == doubtful
        title = "offsets\nshaded: 90 % intervals; dotted: 1 doubtful trial"
        assert display.axes_[-1].get_title() == title
        assert display.axes_[0].get_title() == "as recorded\n9 trials"
        colors = display.offsets_.get_colors()
        np.testing.assert_array_equal(display.intervals_.get_facecolor()[:, :3], colors[:, :3])
        display.figure_.canvas.draw()
    display = SynchronizationDisplay.from_estimator(pipe, X, features=0, warps=False)
    assert display.intervals_ is None
    assert display.axes_[0].get_title() == "as recorded\n9 trials, dotted: 1 doubtful trial"
    assert is_dotted(display.before_[0]) == doubtful


def test_nothing_is_drawn_of_a_match_that_does_not_tell(bunch):
    X = [*bunch.data[:8], twice(bunch.data[8])]
    linear, marks = LinearSynchronizer(30).fit(X), {"keyframes": bunch.keyframes}
    by_marks = LinearSynchronizer(30).fit(bunch.data, **marks)
    for display in (
        SynchronizationDisplay.from_estimator(linear, X),
        SynchronizationDisplay.from_estimator(by_marks, bunch.data, **marks),
    ):
        assert display.doubtful is display.intervals_ is None
        assert display.axes_[-1].get_title() == "offsets"
        assert not any(is_dotted(display.offsets_))


def test_many_bands_are_lighter_than_few(bunch, pipe):
    def opacity(n, doubtful=()):
        X = [bunch.data[0]] * n
        for i in doubtful:
            X[i] = twice(X[i])
        display = SynchronizationDisplay.from_estimator(pipe, X, features=0)
        plt.close(display.figure_)
        return display.intervals_.get_facecolor()[:, 3]

    few, many, one = opacity(6), opacity(40), opacity(40, [7])
    assert len(set(few)) == len(set(many)) == 1
    assert 0.01 < many[0] < 0.05 < few[0] <= 0.2
    # All that overlap leave the paper visible.
    assert 1 - (1 - many[0]) ** 40 < 0.5
    # The wide band of a single doubtful trial stays visible.
    assert one[7] > 4 * one[0]


# -- signals as recorded ---------------------------------------------------------------------


def test_scaled_signals_are_drawn_as_recorded_with_names_and_units():
    gait = make_gait(4, 2, random_state=0)
    tables = [pd.DataFrame(x, columns=gait.feature_names) for x in gait.data]
    for x in tables:
        x.attrs["units"] = list(gait.units)
    tables[1].iloc[5:8, 0] = np.nan
    steps = FrameWise(StandardScaler()), DenseSynchronizer(51), ActionModel()
    pipe = make_pipeline(*steps).fit(tables)
    given = {"features": ["vertical_force", "hip_flexion"], "xlabel": "% gait cycle"}
    display = SynchronizationDisplay.from_estimator(pipe, tables, **given)
    match = Match.from_estimator(pipe, tables)
    for row, k in enumerate([3, 0]):
        for drawn, x in zip(segments(display.before_[row]), tables, strict=True):
            np.testing.assert_allclose(drawn[:, 1], x.iloc[:, k], atol=1e-12)
        warped = match.warp(tables)[:, :, k]
        np.testing.assert_allclose(ys(display.after_[row]), warped, atol=1e-12)
        pattern = pipe[0].inverse_transform(pipe[1].pattern_)[:, k]
        np.testing.assert_allclose(display.pattern_[row].get_ydata(), pattern)
    labels = ["vertical_force\n(body weights)", "hip_flexion (deg)"]
    assert [axis.get_ylabel() for axis in display.axes_[:4:2]] == labels
    assert [axis.get_xlabel() for axis in display.axes_] == ["", "", *["% gait cycle"] * 3]
    # A model, and its band.
    for band in ("points", "trials"):
        model = ActionModelDisplay.from_estimator(pipe, tables, band=band, **given)
        lower, upper = pipe[2].envelope(simultaneous=band == "trials")
        drawn = model.mean, model.lower, model.upper
        for found, scaled in zip(drawn, (pipe[2].mean_, lower, upper), strict=True):
            expected = pipe[0].inverse_transform(scaled)[:, [3, 0]]
            np.testing.assert_allclose(found, expected, atol=1e-9)
        trials = pipe[0].inverse_transform(list(pipe[:2].transform(tables)))
        np.testing.assert_allclose(model.trials, np.stack(trials)[:, :, [3, 0]])
        assert [axis.get_ylabel() for axis in model.axes_] == labels
        assert model.axes_[0].get_xlabel() == "% gait cycle"


def test_features_of_other_steps_are_unscaled(bunch):
    cosines = DirectionCosines(bunch.skeleton)
    scaled = make_pipeline(cosines, FrameWise(StandardScaler()), DenseSynchronizer(30))
    scaled.fit(bunch.data)
    display = SynchronizationDisplay.from_estimator(scaled, bunch.data, features=4)
    unscaled = cosines.transform(bunch.data)
    for drawn, x in zip(segments(display.before_[0]), unscaled, strict=True):
        np.testing.assert_allclose(drawn[:, 1], x[:, 4], atol=1e-12)
    # Features that are added after the scaler are as they are.
    steps = *scaled[:2], TimingChannel(DenseSynchronizer(30)), ActionModel()
    pipe = make_pipeline(*steps).fit(bunch.data)
    last = pipe[-1].mean_.shape[1] - 1
    model = ActionModelDisplay.from_estimator(pipe, bunch.data, features=[4, last])
    whole = pipe[:-1].transform(bunch.data)
    np.testing.assert_allclose(model.trials[8][:, 1], whole[8][:, last])
    unscaled = pipe[1].inverse_transform(whole[8][:, :last])
    np.testing.assert_allclose(model.trials[8][:, 0], unscaled[:, 4])
    # A scaler of the frames of rows is none of their one feature.
    rows = np.sin(np.linspace(0, 6, 25) + np.linspace(0, 1, 5)[:, np.newaxis])
    pipe = make_pipeline(StandardScaler(), DenseSynchronizer(20)).fit(rows)
    display = SynchronizationDisplay.from_estimator(pipe, rows)
    np.testing.assert_array_equal(ys(display.before_[0]), pipe[0].transform(rows))
