"""ActionModelDisplay: its artists agree with the model, in any unit; and legends of figures."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from artists import edges, segments, texts, ys
from matplotlib.colors import to_rgba
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn_motionsync import ActionModel, ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.display import ActionModelDisplay, SynchronizationDisplay
from sklearn_motionsync.display.base import group_styles

P = 30


def test_mean_envelope_and_trials(bunch, pipe):
    display = ActionModelDisplay.from_estimator(
        pipe, bunch.data, features=["aspace1", 0], band="points"
    )
    model = pipe[-1]
    lower, upper = model.envelope()
    warped = pipe[:3].transform(bunch.data)
    for i, feature in enumerate([1, 0]):
        np.testing.assert_array_equal(display.mean_[i].get_ydata(), model.mean_[:, feature])
        bounds = lower[:, feature], upper[:, feature]
        np.testing.assert_allclose(edges(display.envelope_[i]), bounds)
        np.testing.assert_array_equal(ys(display.trials_[i]), warped[:, :, feature])
    assert {"mean ± 3 standard deviations", "9 trials"} < set(texts(display.axes_[0]))


def test_model_in_features_of_poses(bunch, pipe):
    features = ["left_leg_y", "pelvis_height"]
    display = ActionModelDisplay.from_estimator(pipe, bunch.data, features=features, band="points")
    names = list(pipe[0].get_feature_names_out())
    chosen = [names.index("left_leg_y"), names.index("pelvis_height")]
    poses = pipe[1].inverse_transform(pipe[-1].mean_)[:, chosen]
    np.testing.assert_allclose(display.mean, poses, atol=1e-12)
    # The variance is that of poses: dimensions of the aSpace are correlated.
    poses = pipe[1].inverse_transform(pipe[:3].transform(bunch.data))[:, :, chosen]
    std = poses.std(axis=0)
    np.testing.assert_allclose(display.upper - display.mean, 3 * std, atol=1e-9)
    np.testing.assert_allclose(display.mean - display.lower, 3 * std, atol=1e-9)


def legend_of(display):
    """The title of the legend, its first label, and the number of trials that leave."""
    labels = texts(display.axes_[0])
    outside = [
        int(label.split(": ")[1].split()[0])
        for label in labels
        if label.startswith("outside the band")
    ]
    return display.axes_[0].get_legend().get_title().get_text(), labels[0], *outside


def test_each_band_has_its_bounds_and_legend(bunch, pipe):
    X = pipe[:3].transform(bunch.data)
    model = ActionModel(n_std=2, coverage=0.9).fit(X)
    predicted = f"mean ± {model.simultaneous_factor():.3g} predicted standard deviations"
    for band, bounds, holds, label in (
        ("points", model.envelope(), "single poses", "mean ± 2 standard deviations"),
        ("trials", model.envelope(simultaneous=True), "90 % of new people's trials", predicted),
    ):
        display = ActionModelDisplay.from_estimator(model, X, features=[1], band=band)
        np.testing.assert_allclose([display.lower, display.upper], [x[:, [1]] for x in bounds])
        title, text, _ = legend_of(display)
        assert holds in title
        assert text == label


@pytest.mark.parametrize("band", ["points", "trials"])
def test_departures_are_the_parts_outside_the_band(bunch, pipe, band):
    still = np.repeat(bunch.data[0][:1], 40, axis=0)
    people, features = [*bunch.data[:3], still], ["pelvis_height", "torso_z"]
    display = ActionModelDisplay.from_estimator(pipe, people, features=features, band=band)
    outside = (display.trials < display.lower) | (display.trials > display.upper)
    assert outside[3].any()
    assert legend_of(display)[2] == outside.any(axis=(1, 2)).sum()
    for i, departures in enumerate(display.departures_):
        assert tuple(departures.get_colors()[0]) != tuple(display.trials_[i].get_colors()[0])
        pieces = {(x, y) for piece in segments(departures) for x, y in piece.round(9) if x % 1 == 0}
        seen = np.argwhere(outside[:, :, i])
        assert pieces == {(p, display.trials[n, p, i].round(9)) for n, p in seen}


def test_rounding_is_no_departure():
    """Trials do not differ in a feature, except by rounding."""
    X = np.tile(np.random.default_rng(0).normal(size=(9, 2)), (3, 1, 1)).astype(np.float32)
    X[:, :, 0] += np.array([0, 0.1, 0.3], dtype=np.float32)[:, np.newaxis]
    for band in ("points", "trials"):
        display = ActionModelDisplay.from_estimator(ActionModel().fit(X), X, band=band)
        assert legend_of(display)[2] == 0


def test_model_without_a_pipeline(bunch, pipe):
    warped = pipe[:3].transform(bunch.data)
    model = ActionModel(n_std=2).fit(warped)
    display = ActionModelDisplay.from_estimator(model, warped[:2])
    assert display.ylabels == ["x0", "x1", "x2"]
    assert display.trials.shape == (2, P, 3)
    with pytest.raises(ValueError, match="no feature 'pelvis_height'"):
        ActionModelDisplay.from_estimator(model, warped, features="pelvis_height")
    double = FunctionTransformer(lambda X: [2 * x for x in X])
    steps = DirectionCosines(bunch.skeleton), ASpace(3), double, DenseSynchronizer(20)
    odd = make_pipeline(*steps, ActionModel()).fit(bunch.data)
    with pytest.raises(ValueError, match="Between ASpace and ActionModel stands FunctionTrans"):
        ActionModelDisplay.from_estimator(odd, bunch.data, features="pelvis_height")


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"band": "mean"}, ValueError, "band must be one of .*got 'mean'"),
        ({"band": ["points"]}, ValueError, "band must be one of"),
        ({"features": ["knee"]}, ValueError, "no feature 'knee'; there are 37: pelvis_height"),
        ({"unit": "ms"}, ValueError, "unit must be one of .*got 'ms'"),
        ({"unit": "seconds"}, ValueError, "The frame rate of .* is not known"),
        ({"unit": "seconds", "frame_rate": 0}, ValueError, "frame_rate must be one number above"),
        ({"unit": "seconds", "frame_rate": [1, 2]}, ValueError, r"each of the 9 .* got \[1, 2\]"),
    ],
)
def test_action_model_display_refuses(bunch, pipe, arguments, error, message):
    with pytest.raises(error, match=message):
        ActionModelDisplay.from_estimator(pipe, **{"X": bunch.data} | arguments)


def test_units_of_time(bunch, pipe):
    still = np.repeat(bunch.data[0][:1], 40, axis=0)
    X = [*bunch.data[:8], still]
    median = np.median([len(x) - 1 for x in X]) / 50
    for unit, last in (("frames", P - 1), ("percent", 100), ("seconds", median)):
        display = ActionModelDisplay.from_estimator(
            pipe, X, features=[0], unit=unit, frame_rate=50, band="points"
        )
        np.testing.assert_allclose(display.mean_[0].get_xdata(), np.linspace(0, last, P))
        for artist in (*display.trials_, *display.departures_):
            for path in artist.get_paths():
                assert path.vertices[:, 0].max() <= last * (1 + 1e-9)
    # Univariate rows are trials.
    rows = np.random.default_rng(0).normal(size=(6, 21))
    display = ActionModelDisplay.from_estimator(
        ActionModel().fit(rows), rows, features=[0], unit="seconds", frame_rate=10
    )
    np.testing.assert_allclose(display.mean_[0].get_xdata(), np.arange(21) / 10)


# -- legends -----------------------------------------------------------------------------


def test_many_groups_differ_in_color_or_line_style(bunch, pipe):
    names = [f"_${i}" for i in range(9)]
    display = SynchronizationDisplay.from_estimator(pipe, bunch.data, y=names, features=[0])
    (means,) = display.group_means_
    assert len({(str(line.get_color()), line.get_linestyle()) for line in means}) == 9
    assert len({line.get_linestyle() for line in means}) == 4
    display.figure_.canvas.draw()
    shown = [text.strip().replace("\\", "") for text in texts(display.axes_[0])]
    assert shown == names
    # Black is the pattern.
    for count in (6, 7, 20):
        colors = {to_rgba(color) for color, _ in group_styles(range(count)).values()}
        assert len(colors) == count
        assert to_rgba("black") not in colors


@pytest.mark.parametrize("kind", ["model", "synchronization"])
@pytest.mark.parametrize(
    ("size", "layout"),
    [
        (None, None),  # a new figure
        ((4.2, 3), None),
        ((9, 5), "constrained"),
    ],
)
def test_legends_are_above_the_panels(bunch, pipe, layout, size, kind):
    axes = None if size is None else plt.figure(figsize=size, layout=layout).add_subplot()
    if kind == "synchronization":
        display = SynchronizationDisplay.from_estimator(
            pipe, bunch.data, y=[f"group {g}" for g in range(9)], features=[0], ax=axes
        )
    else:
        display = ActionModelDisplay.from_estimator(pipe, bunch.data, features=[0], ax=axes)
    display.figure_.canvas.draw()
    box = display.axes_[0].get_legend().get_window_extent()
    for axis in display.axes_:
        panel = axis.get_window_extent()
        assert box.y0 >= panel.y1 - 1 or box.x1 < panel.x0
        assert panel.height > 20
        if axis in display.axes_[:2] and kind == "synchronization":
            assert axis.title.get_window_extent().y0 >= box.y1 - 1
    if size != (4.2, 3):
        assert box.y1 <= display.figure_.bbox.height + 1
    # Drawing again does not lower the panels once more.
    before = [axis.get_position().bounds for axis in display.axes_]
    display.plot(display.axes_)
    np.testing.assert_allclose([axis.get_position().bounds for axis in display.axes_], before)
