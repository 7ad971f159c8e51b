"""Groups, units of time, and legends of displays."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_rgba
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ActionModel, ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import ActionModelDisplay, SynchronizationDisplay
from sklearn_motionsync.display.drawing import group_colors

GROUPS = ["young", "old", "young", "old", "young", "old", "young", "old", "one"]
PEOPLE = ["a", "b", "c", "d", "a", "b", "e", "d", "f"]
P = 30


@pytest.fixture(scope="module")
def bunch():
    return make_bending(9, n_frames=40, random_state=3)


@pytest.fixture(scope="module")
def pipe(bunch):
    steps = DirectionCosines(bunch.skeleton), ASpace(3), DenseSynchronizer(P), ActionModel()
    return make_pipeline(*steps).fit(bunch.data)


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def texts(axis):
    return [text.get_text() for text in axis.get_legend().get_texts()]


def xs(line):
    return line.get_xdata()


# -- groups of the model -----------------------------------------------------------------


@pytest.mark.parametrize("band", ["points", "performances", "mean"])
def test_mean_and_band_of_each_group_are_those_of_its_own_model(bunch, pipe, band):
    display = ActionModelDisplay.from_estimator(
        pipe, bunch.data, groups=GROUPS, people=PEOPLE, band=band, features=[1, 0]
    )
    warped = pipe[:3].transform(bunch.data)
    for k, name in enumerate(["young", "old"]):
        of = [i for i, group in enumerate(GROUPS) if group == name]
        people = None if band == "points" else [PEOPLE[i] for i in of]
        model = ActionModel().fit(warped[of], groups=people)
        lower, upper = {
            "points": model.envelope(),
            "performances": model.envelope(simultaneous=True),
            "mean": model.mean_envelope(random_state=0),
        }[band]
        for drawn, expected in (
            (display.mean, model.mean_),
            (display.lower, lower),
            (display.upper, upper),
        ):
            np.testing.assert_allclose(drawn[k], expected[:, [1, 0]], atol=1e-12)
        # The means are sorted by feature, then by group.
        np.testing.assert_array_equal(display.mean_[3 + k].get_ydata(), display.mean[k, :, 1])
    np.testing.assert_array_equal(display.mean[2], warped[8][:, [1, 0]])
    assert np.isnan(display.lower[2]).all()
    assert len(display.mean_) == len(display.performances_) == 6
    assert len(display.envelope_) == 4
    assert texts(display.axes_[0])[:3] == [
        "young: 4 performances of 3 people",
        "old: 4 performances of 2 people",
        "one: 1 performance of 1 person, no band",
    ]


def test_default_band_of_groups_is_that_of_performances(bunch, pipe):
    one = ActionModelDisplay.from_estimator(pipe, bunch.data, groups=GROUPS)
    assert one.band == "performances"
    assert "95 % of new people's performances" in one.axes_[0].get_legend().get_title().get_text()
    alike = ActionModelDisplay.from_estimator(pipe, bunch.data, groups=["all"] * 9)
    plain = ActionModelDisplay.from_estimator(
        pipe[-1], pipe[:3].transform(bunch.data), band="performances"
    )
    np.testing.assert_allclose(alike.upper[0], plain.upper)
    assert ActionModelDisplay.from_estimator(pipe).band == "points"


def test_groups_are_drawn_in_features_of_postures(bunch, pipe):
    display = ActionModelDisplay.from_estimator(
        pipe, bunch.data, groups=GROUPS, features=["pelvis_height", "torso_z"]
    )
    young = [i for i, group in enumerate(GROUPS) if group == "young"]
    expected = display.performances[young].mean(axis=0)
    np.testing.assert_allclose(display.mean[0], expected)
    outside = (display.performances[young] > display.upper[0]).any()
    outside |= (display.performances[young] < display.lower[0]).any()
    assert not outside


def test_a_group_of_one_subject_has_no_band_of_performances(bunch, pipe):
    groups, people = ["a"] * 5 + ["b"] * 4, [1, 2, 3, 4, 5, 6, 6, 6, 6]
    given = {"groups": groups, "people": people, "features": [0]}
    display = ActionModelDisplay.from_estimator(pipe, bunch.data, **given)
    assert "b: 4 performances of 1 person, no band" in texts(display.axes_[0])
    display = ActionModelDisplay.from_estimator(pipe, bunch.data, band="points", **given)
    assert "b: 4 performances of 1 person" in texts(display.axes_[0])


def test_legend_counts_departures_from_the_band_of_the_own_group(bunch, pipe):
    X = [*bunch.data, bunch.data[0][::-1]]
    display = ActionModelDisplay.from_estimator(
        pipe, X, groups=[*GROUPS[:8], "old", "young"], band="points", features=[0, 1, 2]
    )
    own = [["young", "old"].index(g) for g in [*GROUPS[:8], "old", "young"]]
    out = display.performances > display.upper[own]
    out |= display.performances < display.lower[own]
    assert f"outside the band of its group: {out.any(axis=(1, 2)).sum()} of them" in texts(
        display.axes_[0]
    )


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({"groups": ["a"]}, ValueError, "groups must be .* each of the 9 performances, got 1"),
        ({"groups": GROUPS, "people": [1]}, ValueError, "people must be .* each of the 9"),
        ({"groups": GROUPS, "people": [np.nan, *PEOPLE[1:]]}, ValueError, "people .* entry 0 is"),
        ({"band": "all"}, ValueError, "band must be one of .*got 'all'"),
        ({"band": ["mean"]}, ValueError, "band must be one of"),
        ({"people": PEOPLE}, TypeError, "takes people along with groups only"),
        ({"groups": GROUPS, "X": None}, TypeError, "takes groups along with performances X"),
        ({"people": PEOPLE, "X": None}, TypeError, "takes people along with performances X"),
        ({"unit": "ms"}, ValueError, "unit must be one of .*got 'ms'"),
        ({"unit": "seconds"}, ValueError, "needs frame_rate"),
        ({"unit": "seconds", "frame_rate": 0}, ValueError, "frame_rate must be one number above"),
        (
            {"unit": "seconds", "frame_rate": [1, 2]},
            ValueError,
            "each of the 9 performances, got 2",
        ),
    ],
)
def test_action_model_display_refuses(bunch, pipe, given, error, message):
    with pytest.raises(error, match=message):
        ActionModelDisplay.from_estimator(pipe, **{"X": bunch.data} | given)


def test_many_groups_differ_in_color_or_line_style(bunch, pipe):
    names = [f"_${i}" for i in range(9)]
    display = ActionModelDisplay.from_estimator(pipe, bunch.data, groups=names, features=[0])
    assert len({(line.get_color().__str__(), line.get_linestyle()) for line in display.mean_}) == 9
    display.figure_.canvas.draw()
    assert [text.strip().replace("\\", "") for text in texts(display.axes_[0])] == [
        f"{name}: 1 performance, no band" for name in names
    ]
    before = SynchronizationDisplay.from_estimator(pipe, bunch.data, groups=names, features=[0])
    assert len({line.get_linestyle() for line in before.group_means_[0]}) == 4
    # Black is the pattern.
    for count in (6, 7, 20):
        color_of = group_colors(range(count))
        assert len({to_rgba(c) for c in color_of.values()}) == count
        assert to_rgba("black") not in {to_rgba(c) for c in color_of.values()}


def test_constructor_accepts_groups():
    mean = np.zeros((2, 5, 1))
    given = {"feature_names": ["knee"], "band": "performances", "coverage": 0.9}
    given |= {"performances": np.zeros((3, 5, 1)), "groups": [1, 2, 2]}
    display = ActionModelDisplay(mean, mean - 1, mean + 1, **given).plot()
    assert texts(display.axes_[0])[:2] == ["1: 1 performance", "2: 2 performances"]


# -- groups of the synchronizer ----------------------------------------------------------


def test_the_mean_of_each_group_is_in_front(bunch, pipe):
    display = SynchronizationDisplay.from_estimator(
        pipe, bunch.data, groups=np.array(GROUPS), features=[0, 2]
    )
    warped = pipe[:3].transform(bunch.data)
    for row, feature in enumerate([0, 2]):
        for name, line in zip(["young", "old", "one"], display.group_means_[row], strict=True):
            of = np.array(GROUPS) == name
            np.testing.assert_allclose(line.get_ydata(), warped[of][:, :, feature].mean(axis=0))
            assert line.get_zorder() > display.after_[row].get_zorder()
            assert to_rgba(line.get_color())[:3] == tuple(
                display.after_[row].get_colors()[GROUPS.index(name)][:3]
            )
    assert texts(display.axes_[0]) == ["young", "old", "one"]
    assert SynchronizationDisplay.from_estimator(pipe, bunch.data).group_means_ == [[], [], []]


# -- units -------------------------------------------------------------------------------


def test_units_of_the_synchronization_display(bunch, pipe):
    lengths = np.array([len(x) for x in bunch.data])
    times = pipe[2].match(pipe[:2].transform(bunch.data)).times
    rates = np.linspace(20, 100, 9)
    for unit, rate, ends, last in (
        ("frames", None, lengths - 1, P - 1),
        ("percent", None, np.full(9, 100), 100),
        ("seconds", 50, (lengths - 1) / 50, np.median(lengths - 1) / 50),
        ("seconds", rates, (lengths - 1) / rates, np.median((lengths - 1) / rates)),
    ):
        display = SynchronizationDisplay.from_estimator(
            pipe, bunch.data, features=[0], unit=unit, frame_rate=rate
        )
        for path, n, end in zip(display.before_[0].get_paths(), lengths, ends, strict=True):
            np.testing.assert_allclose(path.vertices[:, 0], np.linspace(0, end, n))
        clock = np.linspace(0, last, P)
        np.testing.assert_allclose(xs(display.pattern_[0]), clock)
        for path, tau in zip(display.warps_.get_paths(), times, strict=True):
            np.testing.assert_allclose(path.vertices[:, 0], clock)
            np.testing.assert_allclose(path.vertices[:, 1], tau * last / (P - 1))
        said = " ".join(axis.get_xlabel() for axis in display.axes_)
        assert {"frames": "frame of", "percent": "% of", "seconds": "(s)"}[unit] in said
    given = SynchronizationDisplay.from_predictions(
        pipe[:2].transform(bunch.data), times, features=[0], unit="percent"
    )
    np.testing.assert_allclose(xs(given.pattern_[0]), np.linspace(0, 100, P))
    with pytest.raises(ValueError, match="needs frame_rate"):
        SynchronizationDisplay.from_estimator(pipe, bunch.data, unit="seconds")


@pytest.mark.parametrize("groups", [None, GROUPS])
def test_units_of_the_action_model_display(bunch, pipe, groups):
    still = np.repeat(bunch.data[0][:1], 40, axis=0)
    X = [*bunch.data[:8], still]
    median = np.median([len(x) - 1 for x in X]) / 50
    for unit, last in (("frames", P - 1), ("percent", 100), ("seconds", median)):
        display = ActionModelDisplay.from_estimator(
            pipe, X, features=[0], unit=unit, frame_rate=50, groups=groups, band="points"
        )
        np.testing.assert_allclose(xs(display.mean_[0]), np.linspace(0, last, P))
        for artist in (*display.performances_, *display.departures_):
            for path in artist.get_paths():
                assert path.vertices[:, 0].max() <= last * (1 + 1e-9)
    # Without performances the frame rate is that of the clock.
    display = ActionModelDisplay.from_estimator(pipe, features=[0], unit="seconds", frame_rate=10)
    np.testing.assert_allclose(xs(display.mean_[0]), np.arange(P) / 10)


def test_a_model_of_univariate_rows_in_seconds():
    rows = np.random.default_rng(0).normal(size=(6, 21))
    display = ActionModelDisplay.from_estimator(
        ActionModel().fit(rows), rows, unit="seconds", frame_rate=10, groups=list("aabbab")
    )
    np.testing.assert_allclose(xs(display.mean_[0]), np.arange(21) / 10)


# -- legends -----------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["model", "model of groups", "synchronization"])
@pytest.mark.parametrize(
    ("size", "layout"),
    [
        (None, None),  # a new figure
        *((size, layout) for size in ((4.2, 3), (9, 5)) for layout in (None, "constrained")),
    ],
)
def test_legends_are_above_the_panels(bunch, pipe, layout, size, kind):
    axes = None if size is None else plt.figure(figsize=size, layout=layout).add_subplot()
    if kind == "synchronization":
        display = SynchronizationDisplay.from_estimator(
            pipe, bunch.data, groups=[f"group {g}" for g in range(9)], features=[0], ax=axes
        )
    else:
        groups = GROUPS if "groups" in kind else None
        display = ActionModelDisplay.from_estimator(
            pipe, bunch.data, groups=groups, features=[0], ax=axes
        )
    display.figure_.canvas.draw()
    box = display.axes_[0].get_legend().get_window_extent()
    for axis in display.axes_:
        panel = axis.get_window_extent()
        assert box.y0 >= panel.y1 - 1 or box.x1 < panel.x0
        assert panel.height > 20
        if axis.get_title() and kind == "synchronization":
            assert axis.title.get_window_extent().y0 >= box.y1 - 1
    if size != (4.2, 3):
        assert box.y1 <= display.figure_.bbox.height + 1


@pytest.mark.parametrize("layout", [None, "constrained"])
def test_legend_of_many_groups_fits_on_small_axes(layout):
    rng = np.random.default_rng(0)
    X = np.sin(np.linspace(0, 3, 40)) + rng.normal(size=(16, 1))
    axes = plt.figure(figsize=(4, 3), layout=layout).add_subplot()
    display = ActionModelDisplay.from_estimator(
        ActionModel().fit(X), X, groups=[f"group {i // 2}" for i in range(16)], ax=axes
    )
    display.figure_.canvas.draw()
    legend = display.axes_[0].get_legend()
    assert sum(text.startswith("group") for text in texts(display.axes_[0])) == 8
    assert legend.get_window_extent().y1 <= display.figure_.bbox.height
    assert display.axes_[0].get_window_extent().height > 100


def test_plotting_again_keeps_the_height_of_the_axes(bunch, pipe):
    _, ax = plt.subplots()
    display = ActionModelDisplay.from_estimator(pipe, bunch.data, features=[0], ax=ax)
    height = ax.get_position().height
    display.plot(ax)
    np.testing.assert_allclose(ax.get_position().height, height)
