"""What the displays draw, read back from their artists."""

import subprocess
import sys

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from sklearn.exceptions import NotFittedError
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
    to_frame,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import ActionModelDisplay, SynchronizationDisplay, TrellisDisplay
from sklearn_motionsync.display.drawing import pyplot


@pytest.fixture(scope="module")
def bunch():
    return make_bending(7, n_frames=40, random_state=3)


@pytest.fixture(scope="module")
def pipe(bunch):
    steps = DirectionCosines(bunch.skeleton), ASpace(3), DenseSynchronizer(30), ActionModel()
    return make_pipeline(*steps).fit(bunch.data)


def segments(collection):
    return [np.asarray(path.vertices) for path in collection.get_paths()]


def ys(collection):
    return np.array([xy[:, 1] for xy in segments(collection)])


# -- SynchronizationDisplay -------------------------------------------------------------


def test_features_before_and_after_and_the_warps(bunch, pipe):
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
    np.testing.assert_array_equal(ys(display.warps_), synchronizer.match(points).times)
    low, high = display.axes_[0].get_ylim()
    assert low <= min(x[:, 2].min() for x in points) <= max(x[:, 2].max() for x in points) <= high


def test_titles_say_what_is_aligned_to_what(bunch, pipe):
    title = SynchronizationDisplay.from_estimator(pipe, bunch.data).axes_[1].get_title()
    assert f"performance {pipe[2].pattern_index_}" in title
    others = [x for i, x in enumerate(bunch.data) if i != pipe[2].pattern_index_]
    title = SynchronizationDisplay.from_estimator(pipe, others).axes_[1].get_title()
    assert "pattern" in title
    assert "performance" not in title


def test_groups_color_the_performances(bunch, pipe):
    groups = ["a", "b", "a", "b", "a", "b", "c"]
    display = SynchronizationDisplay.from_estimator(pipe, bunch.data, groups=groups)
    for artist in (display.before_[0], display.after_[0], display.warps_):
        colors = [tuple(color[:3]) for color in artist.get_colors()]
        same = [[a == b for b in colors] for a in colors]
        assert same == [[a == b for b in groups] for a in groups]
    legend = display.axes_[0].get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["a", "b", "c"]
    with pytest.raises(ValueError, match=r"each of the 7 performances, got 2"):
        SynchronizationDisplay.from_estimator(pipe, bunch.data, groups=["a", "b"])


def test_many_groups_all_have_a_color(bunch, pipe):
    groups = list(range(7))
    display = SynchronizationDisplay.from_estimator(
        pipe, bunch.data * 2, groups=[*groups, *range(7, 14)]
    )
    assert len({tuple(color) for color in display.after_[0].get_colors()}) == 14


@pytest.mark.parametrize("feature", ["knee", 3, -1, 1.5])
def test_a_feature_that_does_not_exist(bunch, pipe, feature):
    with pytest.raises(ValueError, match=r"no feature .*there are 3: aspace0, aspace1, aspace2"):
        SynchronizationDisplay.from_estimator(pipe, bunch.data, features=feature)


def test_no_features(bunch, pipe):
    with pytest.raises(ValueError, match="at least one feature"):
        SynchronizationDisplay.from_estimator(pipe, bunch.data, features=[])


def test_every_kind_of_input(bunch):
    rows = np.sin(np.linspace(0, 6, 25) + np.linspace(0, 1, 5)[:, np.newaxis])
    display = SynchronizationDisplay.from_estimator(DenseSynchronizer(20).fit(rows), rows)
    assert display.after.shape == (5, 20, 1)
    frames = [pd.DataFrame(x[:, :2], columns=["knee", "hip"]) for x in bunch.data]
    linear = LinearSynchronizer(20).fit(frames)
    for X in (frames, to_frame(frames)):
        display = SynchronizationDisplay.from_estimator(linear, X, features="hip")
        np.testing.assert_array_equal(display.after[0, :, 0], linear.transform(frames)[0, :, 1])


def test_pandas_output_draws_the_same(bunch, pipe):
    steps = DirectionCosines(bunch.skeleton), ASpace(3), DenseSynchronizer(30), ActionModel()
    framed = make_pipeline(*steps).set_output(transform="pandas").fit(bunch.data)
    one = SynchronizationDisplay.from_estimator(pipe, bunch.data)
    other = SynchronizationDisplay.from_estimator(framed, bunch.data)
    np.testing.assert_allclose(ys(one.after_[1]), ys(other.after_[1]), atol=1e-12)
    for features in (None, ["pelvis_height"]):
        one = ActionModelDisplay.from_estimator(pipe, bunch.data, features=features)
        other = ActionModelDisplay.from_estimator(framed, bunch.data, features=features)
        np.testing.assert_allclose(one.performances, other.performances, atol=1e-12)


def test_from_predictions_draws_what_from_estimator_does(bunch, pipe):
    points = pipe[:2].transform(bunch.data)
    one = SynchronizationDisplay.from_estimator(pipe, bunch.data, features=1)
    other = SynchronizationDisplay.from_predictions(
        points, pipe[2].match(points).times, pattern=pipe[2].pattern_, features=1
    )
    np.testing.assert_array_equal(ys(one.after_[0]), ys(other.after_[0]))
    np.testing.assert_array_equal(ys(one.warps_), ys(other.warps_))
    np.testing.assert_array_equal(one.pattern_[0].get_ydata(), other.pattern_[0].get_ydata())
    without = SynchronizationDisplay.from_predictions(points, pipe[2].match(points).times)
    np.testing.assert_allclose(
        without.pattern_[0].get_ydata(), pipe[2].transform(points)[:, :, 0].mean(axis=0)
    )
    assert "mean" in without.axes_[1].get_title()
    with pytest.raises(ValueError, match=r"each of the 7 performances; got \(2, 30\)"):
        SynchronizationDisplay.from_predictions(points, np.zeros((2, 30)))
    for wrong in (-1.0, 30.0, np.nan):
        with pytest.raises(ValueError, match="times must be from 0 to P - 1 = 29"):
            SynchronizationDisplay.from_predictions(points, np.full((7, 30), wrong))


def test_from_predictions_takes_tables_and_their_names(bunch):
    frames = [pd.DataFrame(x[:, :2], columns=["knee", "hip"]) for x in bunch.data]
    times = LinearSynchronizer(20).fit(frames).match(frames).times
    for X in (frames, to_frame(frames)):
        display = SynchronizationDisplay.from_predictions(X, times, features="hip")
        assert display.feature_names == ["hip"]
        np.testing.assert_array_equal(segments(display.before_[0])[2][:, 1], frames[2]["hip"])


def test_steps_that_do_not_name_their_features(bunch):
    some = FunctionTransformer(lambda X: [x[:, :3] for x in X])
    pipe = make_pipeline(some, DenseSynchronizer(20), ActionModel()).fit(bunch.data)
    assert SynchronizationDisplay.from_estimator(pipe, bunch.data).feature_names[0] == "x0"
    assert ActionModelDisplay.from_estimator(pipe).feature_names == ["x0", "x1", "x2"]


def test_axes_given(bunch, pipe):
    figure, axes = plt.subplots(2, 2)
    display = SynchronizationDisplay.from_estimator(pipe, bunch.data, features=0, ax=axes[0, 1])
    assert display.figure_ is figure
    assert len(display.axes_) == 3
    assert not axes[0, 1].axison
    # The panels stand where the divided axes stood.
    figure.canvas.draw()
    box = axes[0, 1].get_position()
    for axis in display.axes_:
        assert box.x0 - 1e-9 <= axis.get_position().x0 <= axis.get_position().x1 <= box.x1 + 1e-9
    _, axes = plt.subplots(2, 1)
    display.plot(axes, warps=False)
    assert display.axes_ == list(axes)
    assert display.warps_ is None
    with pytest.raises(ValueError, match="or 3 axes, one a panel; got 2"):
        display.plot(axes)
    with pytest.raises(ValueError, match="must be Axes of matplotlib, got str"):
        display.plot("left")
    with pytest.raises(ValueError, match="one of a figure's subplots"):
        display.plot(plt.figure().add_axes([0, 0, 1, 1]))


def test_an_estimator_without_synchronizer(bunch, pipe):
    with pytest.raises(ValueError, match=r"no synchronizer in Pipeline; its steps are \['Dir"):
        SynchronizationDisplay.from_estimator(pipe[:2], bunch.data)


# -- TrellisDisplay ---------------------------------------------------------------------


def reachable(n_frames, width, steps, sub):
    """Which (p, d) some pinned path within the band passes, by walking all of them."""
    forward = [{0}]
    for _ in range(n_frames - 1):
        forward.append(
            {d + s - sub for d in forward[-1] for s in steps if abs(d + s - sub) <= width}
        )
    passed = [{0}]
    for before in forward[-2::-1]:
        passed.append({d for d in before if any(d + s - sub in passed[-1] for s in steps)})
    return passed[::-1]


@pytest.mark.parametrize(("max_rate", "sub"), [(2, 1), (3, 1), (2, 2)])
def test_the_disparity_space_against_brute_force(bunch, pipe, max_rate, sub):
    points = pipe[:2].transform(bunch.data)
    dense = DenseSynchronizer(
        16, cost="posture", max_rate=max_rate, subframes=sub, consensus=0, pattern=2
    ).fit(points)
    display = TrellisDisplay.from_estimator(dense, points, performance=5)
    grid = np.arange((16 - 1) * sub + 1) / sub
    base, moving = (
        np.array([np.interp(grid, np.linspace(0, 15, len(x)), k) for k in x.T]).T
        for x in (points[2], points[5])
    )
    passed = reachable(16, 4 * sub, range(max_rate * sub + 1), sub)
    expected = np.full((16, 8 * sub + 1), np.nan)
    for p, offsets in enumerate(passed):
        for d in offsets:
            difference = base[p * sub] - moving[p * sub + d]
            expected[p, d + 4 * sub] = difference @ difference
    np.testing.assert_allclose(display.costs, expected, atol=1e-12)
    np.testing.assert_array_equal(display.offsets, np.arange(-4 * sub, 4 * sub + 1) / sub)
    # The image is the space, the best path its cheapest way through, as match tells.
    np.testing.assert_array_equal(display.image_.get_array().T.filled(np.nan), display.costs)
    path = display.path_.get_ydata()
    at = ((path + 4) * sub).round().astype(int)
    rates = np.diff(np.arange(16) + path)
    total = display.costs[np.arange(16), at].sum() + dense.mu_ * np.abs(rates - 1).sum()
    match = dense.match([points[5]])
    np.testing.assert_allclose(total, match.distances[0])
    np.testing.assert_array_equal(display.warp_.get_ydata(), match.offsets[0])
    np.testing.assert_array_equal(display.warp_.get_ydata(), path)


def test_the_cells_of_the_image_lie_around_their_offsets(bunch, pipe):
    display = TrellisDisplay.from_estimator(pipe, bunch.data, performance=1)
    left, right, bottom, top = display.image_.get_extent()
    assert (left, right) == (-0.5, 29.5)
    assert (bottom, top) == (display.offsets[0] - 0.5, display.offsets[-1] + 0.5)
    assert f"pattern {pipe[2].pattern_index_}" in display.ax_.get_xlabel()
    assert "performance 1" in display.ax_.get_title()
    points = pipe[:2].transform(bunch.data)
    np.testing.assert_array_equal(display.warp_.get_ydata(), pipe[2].match(points).offsets[1])


def test_the_trellis_of_a_later_synchronizer(bunch):
    """What is drawn is what reaches the dense one, after the linear one."""
    X = [x[:, :3] for x in bunch.data]
    linear, dense = LinearSynchronizer(25), DenseSynchronizer(20)
    pipe = make_pipeline(linear, dense).fit(X)
    display = TrellisDisplay.from_estimator(pipe, X, performance=4)
    expected = TrellisDisplay.from_estimator(dense, linear.transform(X), performance=4)
    np.testing.assert_array_equal(display.costs, expected.costs)
    np.testing.assert_array_equal(display.warp_.get_ydata(), expected.warp_.get_ydata())


def test_the_disparity_space_of_long_takes_is_thinned(bunch, pipe, monkeypatch):
    points = pipe[:2].transform(bunch.data)
    whole = TrellisDisplay.from_estimator(pipe[2], points, performance=1)
    monkeypatch.setattr("sklearn_motionsync.matching.matcher.DRAWN_CELLS", whole.costs.size // 7)
    thin = TrellisDisplay.from_estimator(pipe[2], points, performance=1)
    np.testing.assert_array_equal(thin.frames, np.arange(0, 30, 3))
    np.testing.assert_array_equal(thin.offsets, np.arange(-12, 13, 3))
    columns = np.searchsorted(whole.offsets, thin.offsets)
    np.testing.assert_array_equal(thin.costs, whole.costs[::3, columns])
    np.testing.assert_array_equal(thin.path_.get_xydata(), whole.path_.get_xydata())
    assert thin.image_.get_extent() == [-1.5, 28.5, -13.5, 13.5]


def test_a_trellis_on_given_axes(bunch, pipe):
    _, ax = plt.subplots()
    display = TrellisDisplay.from_estimator(pipe, bunch.data, ax=ax, colorbar=False)
    assert display.ax_ is ax
    assert display.colorbar_ is None
    with pytest.raises(ValueError, match="performance=7 is out of range: there are 7"):
        TrellisDisplay.from_estimator(pipe, bunch.data, performance=7)
    with pytest.raises(ValueError, match="no DenseSynchronizer in LinearSynchronizer"):
        TrellisDisplay.from_estimator(LinearSynchronizer(9).fit(bunch.data), bunch.data)


# -- ActionModelDisplay -----------------------------------------------------------------


def test_mean_envelope_and_performances(bunch, pipe):
    display = ActionModelDisplay.from_estimator(pipe, bunch.data, features=["aspace1", 0])
    model = pipe[-1]
    lower, upper = model.envelope()
    warped = pipe[:3].transform(bunch.data)
    for i, feature in enumerate([1, 0]):
        np.testing.assert_array_equal(display.mean_[i].get_ydata(), model.mean_[:, feature])
        corners = display.envelope_[i].get_paths()[0].vertices
        for p in range(30):
            heights = corners[corners[:, 0] == p, 1]
            np.testing.assert_allclose(heights.min(), lower[p, feature])
            np.testing.assert_allclose(heights.max(), upper[p, feature])
        np.testing.assert_array_equal(ys(display.performances_[i]), warped[:, :, feature])
    labels = [text.get_text() for text in display.axes_[0].get_legend().get_texts()]
    assert "mean ± 3 standard deviations" in labels
    assert "7 performances" in labels


def test_a_model_in_posture_features(bunch, pipe):
    display = ActionModelDisplay.from_estimator(pipe, features=["left_leg_y", "pelvis_height"])
    names = list(pipe[0].get_feature_names_out())
    chosen = [names.index("left_leg_y"), names.index("pelvis_height")]
    postures = pipe[1].inverse_transform(pipe[-1].mean_)[:, chosen]
    np.testing.assert_allclose(display.mean, postures, atol=1e-12)
    assert display.performances_ == display.departures_ == []
    # The variance of postures, from postures: dimensions of the aSpace vary together.
    postures = pipe[1].inverse_transform(pipe[:3].transform(bunch.data))[:, :, chosen]
    std = postures.std(axis=0)
    np.testing.assert_allclose(display.upper - display.mean, 3 * std, atol=1e-9)
    np.testing.assert_allclose(display.mean - display.lower, 3 * std, atol=1e-9)


def said(display):
    """The legend: what the band holds, what it is, and how many performances leave it."""
    legend = display.axes_[0].get_legend()
    texts = [text.get_text() for text in legend.get_texts()]
    outside = [int(text.split()[3]) for text in texts if text.startswith("outside the band")]
    return legend.get_title().get_text(), texts[0], *outside


def test_bands_say_what_they_hold(bunch, pipe):
    model = ActionModel(n_std=2, coverage=0.9).fit(pipe[:3].transform(bunch.data))
    factor = model.simultaneous_factor()
    expected = {
        "points": (model.envelope(), "single postures", "mean ± 2 standard deviations"),
        "performances": (
            model.envelope(simultaneous=True),
            "90 % of new people's performances",
            f"mean ± {factor:.3g} predicted standard deviations",
        ),
        "mean": (
            model.mean_envelope(random_state=0),
            "the mean of all people, 90 % sure",
            "where the mean may be",
        ),
    }
    for band, ((lower, upper), holds, label) in expected.items():
        display = ActionModelDisplay.from_estimator(model, features=[1], band=band)
        np.testing.assert_array_equal(display.lower, lower[:, [1]])
        np.testing.assert_array_equal(display.upper, upper[:, [1]])
        title, text = said(display)
        assert holds in title
        assert text == label
    for features in ("torso_z", "aspace0"):
        wide, narrow = (
            ActionModelDisplay.from_estimator(pipe, features=features, band=band)
            for band in ("performances", "mean")
        )
        assert (wide.upper > narrow.upper).all()
        assert (wide.lower < narrow.lower).all()


@pytest.mark.parametrize("band", ["points", "performances"])
def test_what_leaves_the_band_is_seen_at_once(bunch, pipe, band):
    still = np.repeat(bunch.data[0][:1], 40, axis=0)
    people, features = [*bunch.data[:3], still], ["pelvis_height", "torso_z"]
    display = ActionModelDisplay.from_estimator(pipe, people, features=features, band=band)
    outside = (display.performances < display.lower) | (display.performances > display.upper)
    assert outside[3].any()
    assert said(display)[2] == outside.any(axis=(1, 2)).sum()
    for i, departures in enumerate(display.departures_):
        assert tuple(departures.get_colors()[0]) != tuple(display.performances_[i].get_colors()[0])
        drawn = {(x, y) for piece in segments(departures) for x, y in piece.round(9) if x % 1 == 0}
        seen = np.argwhere(outside[:, :, i])
        assert drawn == {(p, display.performances[n, p, i].round(9)) for n, p in seen}
    given = {"features": features, "band": band}
    assert (
        ActionModelDisplay.from_estimator(pipe, people, departures=False, **given).departures_ == []
    )
    assert ActionModelDisplay.from_estimator(pipe, people, band="mean").departures_ == []


def test_what_is_as_the_mean_leaves_no_band():
    """Features in which nobody differs, whatever rounding says."""
    X = np.tile(np.random.default_rng(0).normal(size=(9, 2)), (3, 1, 1)).astype(np.float32)
    X[:, :, 0] += np.array([0, 0.1, 0.3], dtype=np.float32)[:, np.newaxis]
    for band in ("points", "performances"):
        display = ActionModelDisplay.from_estimator(ActionModel().fit(X), X, band=band)
        assert said(display)[2] == 0


@pytest.mark.parametrize("features", [1, np.int64(1), [1], np.array([1]), range(1, 2), "aspace1"])
def test_ways_to_name_a_feature(bunch, pipe, features):
    for display in (
        ActionModelDisplay.from_estimator(pipe, features=features),
        SynchronizationDisplay.from_estimator(pipe, bunch.data, features=features),
    ):
        assert display.feature_names == ["aspace1"]


def test_postures_out_of_reach(bunch):
    double = FunctionTransformer(lambda X: [2 * x for x in X])
    steps = DirectionCosines(bunch.skeleton), ASpace(3), double, DenseSynchronizer(20)
    pipe = make_pipeline(*steps, ActionModel()).fit(bunch.data)
    with pytest.raises(ValueError, match="Between ASpace and ActionModel stands FunctionTrans"):
        ActionModelDisplay.from_estimator(pipe, features="pelvis_height")


def test_a_model_by_itself(bunch, pipe):
    warped = pipe[:3].transform(bunch.data)
    model = ActionModel(n_std=2).fit(warped)
    display = ActionModelDisplay.from_estimator(model, warped[:2])
    assert display.feature_names == ["x0", "x1", "x2"]
    assert display.performances.shape == (2, 30, 3)
    with pytest.raises(ValueError, match="no feature 'pelvis_height'"):
        ActionModelDisplay.from_estimator(model, features="pelvis_height")
    with pytest.raises(ValueError, match="no feature 'knee'; there are 37: pelvis_height"):
        ActionModelDisplay.from_estimator(pipe, features=["knee"])


def test_a_model_of_univariate_sequences():
    rows = np.random.default_rng(0).normal(size=(6, 20))
    model = ActionModel().fit(rows)
    display = ActionModelDisplay.from_estimator(model, rows)
    assert display.feature_names == ["x0"]
    np.testing.assert_allclose(display.mean_[0].get_ydata(), rows.mean(axis=0))


# -- all of them ------------------------------------------------------------------------


@pytest.mark.parametrize("display", [SynchronizationDisplay, TrellisDisplay, ActionModelDisplay])
def test_not_fitted(bunch, display):
    steps = DirectionCosines(bunch.skeleton), DenseSynchronizer(), ActionModel()
    with pytest.raises(NotFittedError):
        display.from_estimator(make_pipeline(*steps), bunch.data)


def test_matplotlib_is_not_imported_before_drawing():
    code = "import sys, sklearn_motionsync; assert 'matplotlib' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_without_matplotlib(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(ImportError, match="Drawing needs matplotlib: pip install matplotlib"):
        pyplot()
