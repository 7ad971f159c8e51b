"""What displays refuse, and the words they say: one line a fault. What they draw all the same."""

import numpy as np
import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
    Skeleton,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import (
    ActionModelDisplay,
    MetricDisplay,
    SkeletonDisplay,
    SynchronizationDisplay,
    TrellisDisplay,
)
from sklearn_motionsync.display.drawing import panels

PAPER = Skeleton.paper()
NAMES = PAPER.column_names
BUNCH = make_bending(4, n_frames=20, random_state=2)
POSITIONS = BUNCH.data
X = [x[:, :3] for x in POSITIONS]
TIMES = np.tile(np.linspace(0, 9, 10), (4, 1))
BACKWARDS = np.vstack([TIMES[:3], TIMES[:1, ::-1]])
PATTERN = np.zeros((10, 3))
BODY = np.zeros((2, 15, 3))
MEAN = np.zeros((5, 2))


def with_one(x, value, at=(3, 1)):
    x = np.array(x)
    x[at] = value
    return x


def masked(x):
    return np.ma.array(x, mask=np.arange(np.size(x)).reshape(np.shape(x)) == 4)


@pytest.fixture(scope="module")
def pipe():
    steps = DirectionCosines(BUNCH.skeleton), ASpace(3), DenseSynchronizer(20), ActionModel()
    return make_pipeline(*steps).fit(POSITIONS)


def refuses(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def drawn(**given):
    return SynchronizationDisplay.from_predictions(**({"X": X, "times": TIMES} | given))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"X": []}, "Found 0 performances"),
        ({"X": X[0]}, r"single 2-D input\. Wrap one performance as \[X\]"),
        ({"X": "knee"}, "A set of performances is a list"),
        ({"X": [*X[:3], masked(X[3])]}, "Performance 3 has masked values"),
        ({"X": [*X[:3], X[3].astype(str)]}, "Performance 3 is not a numeric array"),
        ({"X": [*X[:3], X[3] + 1j]}, "Performance 3: complex data"),
        ({"X": [*X[:3], with_one(X[3], np.inf)]}, r"Performance 3 is infinite at \(3, 1\); make"),
        ({"times": TIMES[:2]}, r"each of the 4 performances; got \(2, 10\)"),
        ({"times": TIMES + 1}, "times must be from 0 to P - 1 = 9"),
        ({"feature_names": ["knee"]}, "feature_names .* each of the 3 features, got 1"),
        ({"feature_names": list("abcd")}, "each of the 3 features, got 4"),
        ({"feature_names": "abc"}, "feature_names must be a list of text.* got 'abc'"),
        ({"feature_names": [["a"], ["b"], ["c"]]}, "feature_names must be a list of text"),
        ({"feature_names": 3}, "feature_names must be a list of text.* got 3"),
        ({"feature_names": list("aab"), "features": "a"}, "'a' comes 2 times"),
        *(({"features": bad}, "There is no feature .*there are 3: x0, x1, x2")
          for bad in (3, -1, 1.0, True, "knee", [0, "x3"], [[0, 1]], None.__class__, {"x9": 1})),
        ({"features": []}, "at least one feature"),
        ({"pattern": PATTERN[:, :2]}, r"The pattern must have the shape \(10, 3\), got \(10, 2\)"),
        ({"pattern": PATTERN[:9]}, r"must have the shape \(10, 3\), got \(9, 3\)"),
        ({"pattern": PATTERN[:, 0]}, r"must have the shape \(10, 3\), got \(10,\)"),
        ({"pattern": masked(PATTERN)}, "The pattern has masked values"),
        ({"pattern": "mean"}, "The pattern is not a numeric array"),
        ({"pattern": PATTERN + np.inf}, r"The pattern is infinite at \(0, 0\)"),
        ({"ax": []}, "ax must be Axes of matplotlib, got none of them"),
        ({"ax": "left"}, "ax must be Axes of matplotlib, got str"),
    ],
)  # fmt: skip
def test_a_synchronization_that_cannot_be_drawn(given, message):
    refuses(lambda: drawn(**given), message)


@pytest.mark.parametrize("times", [BACKWARDS, masked(TIMES), TIMES.astype(str), TIMES * 1j])
def test_times_that_are_none(times):
    """A match refuses them."""
    refuses(lambda: drawn(times=times), "(?i)times")
    refuses(lambda: SkeletonDisplay.from_predictions(POSITIONS, times, PAPER), "(?i)times")


def test_columns_of_the_pattern_in_another_order():
    frames = [pd.DataFrame(x, columns=list("abc")) for x in X]
    pattern = pd.DataFrame(PATTERN, columns=list("cab"))
    refuses(lambda: drawn(X=frames, pattern=pattern), "The pattern has the columns")
    assert drawn(X=frames, pattern=pattern[list("abc")]).feature_names == list("abc")


def test_gaps_stay_gaps():
    gaps = [with_one(X[0], np.nan, slice(0, 4)), *X[1:]]
    display = drawn(X=gaps)
    assert np.isnan(display.after[0, 0]).all()
    mean = display.pattern_[0].get_ydata()
    np.testing.assert_allclose(mean, np.nanmean(display.after[:, :, 0], axis=0))
    nothing = drawn(X=[np.full_like(x, np.nan) for x in X])
    assert np.isnan(nothing.pattern_[0].get_ydata()).all()
    nothing.figure_.canvas.draw()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"before": X[:3]}, r"each of the 3 performances; got \(4, 10\)"),
        ({"before": 5}, "A set of performances"),
        ({"before": [x[:, :2] for x in X]}, r"Performance 0 must have the shape \(n_frames, 3\)"),
        ({"after": np.zeros((4, 9, 3))}, r"What is synchronised must have the shape \(4, 10, 3\)"),
        ({"after": 1.0}, "feature_names"),
        ({"pattern": PATTERN[:, :1]}, r"The pattern must have the shape \(10, 3\)"),
        ({"feature_names": ["a"]}, "each of the 3 features"),
    ],
)
def test_a_synchronization_made_by_hand(change, message):
    given = {"before": X, "after": np.zeros((4, 10, 3)), "times": TIMES, "feature_names": "abc"}
    given["feature_names"] = list("abc")
    assert len(SynchronizationDisplay(**given).plot().axes_) == 7
    refuses(lambda: SynchronizationDisplay(**given | change), message)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mean": MEAN[:, 0]}, r"The mean must have the shape \(P, n_shown\), got \(5,\)"),
        ({"lower": MEAN[:4]}, r"The lower bound must have the shape \(5, 2\)"),
        ({"upper": "high"}, "The upper bound is not a numeric array"),
        ({"feature_names": ["a"]}, "each of the 2 features, got 1"),
        ({"n_std": "3"}, "n_std must be a number of at least 0, got '3'"),
        ({"n_std": np.nan}, "n_std must be a number of at least 0, got nan"),
        ({"n_std": None}, "n_std must be a number of at least 0, got None"),
        ({"band": "all"}, r"band must be one of \['points', 'performances', 'mean'\], got 'all'"),
        ({"band": ["mean"]}, "band must be one of"),
        ({"band": "performances"}, "coverage must be a share between 0 and 1, got None"),
        ({"coverage": 95}, "coverage must be a share between 0 and 1, got 95"),
        ({"performances": MEAN}, r"behind must have the shape \(n_sequences, 5, 2\)"),
        ({"performances": [MEAN + np.inf]}, r"behind is infinite at \(0, 0, 0\)"),
    ],
)
def test_a_model_made_by_hand(change, message):
    given = {"mean": MEAN, "lower": MEAN - 1, "upper": MEAN + 1, "n_std": 1, "performances": [MEAN]}
    given["feature_names"] = ["a", "b"]
    assert len(ActionModelDisplay(**given).plot().axes_) == 2
    refuses(lambda: ActionModelDisplay(**given | change), message)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frames": "p"}, "The frames is not a numeric array"),
        ({"costs": np.zeros((2, 3))}, r"The costs must have the shape \(5, 3\)"),
        ({"warp": np.zeros(4)}, r"The warp must have the shape \(5,\), got \(4,\)"),
        ({"names": ["pattern"]}, "names must be a list of text, one for each of the 2"),
        ({"names": "ab"}, "names must be a list of text"),
    ],
)
def test_a_trellis_made_by_hand(change, message):
    given = {"frames": range(5), "offsets": range(-1, 2), "costs": np.ones((5, 3))}
    given |= {"path": np.zeros(5), "warp": np.zeros(5)}
    assert TrellisDisplay(**given).plot().image_ is not None
    refuses(lambda: TrellisDisplay(**given | change), message)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"share": "all"}, "The share is not a numeric array"),
        ({"share": []}, r"The share must have the shape \(n_shown,\), got \(0,\)"),
        ({"energy": [1.0]}, r"The energy must have the shape \(2,\), got \(1,\)"),
        ({"energy": [np.inf, 0]}, r"The energy is infinite at \(0,\)"),
        ({"feature_names": ["a"]}, "feature_names .* each of the 2 features shown, got 1"),
        *(({"n_performances": bad}, "n_performances must be a whole number above 0")
          for bad in (0, -1, 2.5, "3", True)),
    ],
)  # fmt: skip
def test_a_metric_made_by_hand(change, message):
    given = {"share": [-0.1, 1.1], "energy": [0.5, np.nan], "feature_names": ["a", "b"]}
    display = MetricDisplay(**given).plot()
    assert repr(display) == "MetricDisplay(2 rows, learnt metric)"
    display.figure_.canvas.draw()
    refuses(lambda: MetricDisplay(**given | change), message)


@pytest.mark.parametrize("features", [3, -1, True, "aspace9", [0, "x1"]])
def test_a_feature_of_the_metric_that_does_not_exist(pipe, features):
    message = "There is no feature .*there are 3: aspace0, aspace1, aspace2"
    refuses(lambda: MetricDisplay.from_estimator(pipe, features=features), message)


@pytest.mark.parametrize("estimator", [None, "dense", 3, LinearSynchronizer(9)])
def test_what_has_no_metric(estimator):
    refuses(lambda: MetricDisplay.from_estimator(estimator), "There is no DenseSynchronizer in")


@pytest.mark.parametrize("performance", [99, -1, 1.5, "1", None, np.nan])
def test_a_performance_of_the_trellis_that_does_not_exist(pipe, performance):
    message = "is out of range: there are 4 performances"
    refuses(
        lambda: TrellisDisplay.from_estimator(pipe, POSITIONS, performance=performance), message
    )


@pytest.mark.parametrize("display", [ActionModelDisplay, SynchronizationDisplay, TrellisDisplay])
@pytest.mark.parametrize("estimator", [None, "dense", 3])
def test_what_is_no_estimator(display, estimator):
    refuses(lambda: display.from_estimator(estimator, X), "There is no ")


# -- stick figures --------------------------------------------------------------------------


def strip(x=POSITIONS[0], skeleton=PAPER, **given):
    return SkeletonDisplay.from_positions(x, skeleton, **given)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"x": []}, "Found 0 performances"),
        ({"x": None}, r"Performance 0 has shape \(\)"),
        ({"x": "walk.bvh"}, "A set of performances"),
        ({"x": POSITIONS[0][:, :6]}, r"15 joints are \(n_frames, 45\)"),
        ({"x": POSITIONS[0][:0]}, r"shape \(0, 45\)"),
        ({"x": [POSITIONS[0], masked(POSITIONS[1])]}, "Performance 1 has masked values"),
        ({"x": [POSITIONS[0], POSITIONS[1].astype(str)]}, "Performance 1 is not a numeric"),
        ({"x": with_one(POSITIONS[0], np.inf)}, "Performance 0, frame 3, column 1 is infinite"),
        ({"x": with_one(POSITIONS[0], 1e200)}, "frame 3, column 1 is too large to draw"),
        ({"x": POSITIONS[0] * np.nan}, "No frame shows the hips"),
        ({"x": pd.DataFrame(POSITIONS[0], columns=NAMES[::-1])}, "column 0 is 'right_ankle_z'"),
        ({"skeleton": "paper"}, "skeleton must be a Skeleton, .* or None .*; got str"),
        ({"skeleton": Skeleton}, "skeleton must be a Skeleton, .* or None .*; got type"),
        ({"skeleton": None, "x": POSITIONS[0][:, :7]}, r"joints are \(n_frames, 3 \* n_joints\)"),
        ({"skeleton": None, "x": POSITIONS[0] * np.nan}, "No frame shows the joints"),
        *(({"frames": bad}, "frames must be how many, a whole number from 1 to 1000")
          for bad in (0, -2, 2.5, True, np.nan, 10**9)),
        *(({"frames": bad}, r"frames must be from 0 to \d+, got")
          for bad in ([-1], [99], [0.5], [], "03", [True], None, ["1"], [[1]], {3})),
        *(({"at": bad}, "at must be a share of the time from 0 to 1, got")
          for bad in (-0.1, 1.5, "0.5", None, np.nan, [0.5], True)),
        *(({"azimuth": bad}, "azimuth must be a number of degrees, got")
          for bad in ("left", None, np.inf, [1])),
    ],
)  # fmt: skip
def test_a_strip_that_cannot_be_drawn(given, message):
    refuses(lambda: strip(**given), message)


def test_frames_of_any_whole_numbers():
    for frames in ([0, 5], np.array([0.0, 5.0]), (np.int64(0), 5)):
        assert [axis.get_title() for axis in strip(frames=frames).axes_] == ["frame 0", "frame 5"]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"names": ["a"]}, "names .* each of the 4 performances, got 1"),
        ({"names": "abcd"}, "names must be a list of text"),
        ({"names": 4}, "names must be a list of text"),
        ({"times": TIMES[:2]}, r"each of the 4 performances; got \(2, 10\)"),
        ({"skeleton": 15}, "skeleton must be a Skeleton"),
        ({"X": POSITIONS[:3]}, "each of the 3 performances"),
        ({"X": None}, r"Performance 0 has shape \(\)"),
        ({"X": [x[:, :9] for x in POSITIONS]}, "15 joints are"),
    ],
)
def test_people_in_step_that_cannot_be_drawn(given, message):
    given = {"X": POSITIONS, "times": TIMES, "skeleton": PAPER} | given
    refuses(lambda: SkeletonDisplay.from_predictions(**given), message)


@pytest.mark.parametrize("performances", [[99], [-1], [0.5], [], "01", [True], [None], 4, {0}])
def test_performances_that_do_not_exist(pipe, performances):
    refuses(
        lambda: SkeletonDisplay.from_estimator(pipe, POSITIONS, performances=performances),
        "performances must be from 0 to 3, got",
    )


def test_one_performance_of_several(pipe):
    display = SkeletonDisplay.from_estimator(pipe, POSITIONS, performances=2)
    assert len(display.scenes[0]) == 1


@pytest.mark.parametrize("frames", [[-1], [-0.5], [20], [1.5], "ab", [], [np.nan], [True], None])
def test_frames_that_a_model_does_not_have(pipe, frames):
    refuses(lambda: SkeletonDisplay.from_model(pipe, frames=frames), "frames, .* from 0 to 19")


def test_ways_to_name_a_frame_of_a_model(pipe):
    for frames in (0.5, [0.5], np.float32([0.5]), 10, [10.0]):
        titles = SkeletonDisplay.from_model(pipe, frames=frames, n_samples=2).titles
        assert titles[0] == "frame 10\nmean posture"


def test_models_without_a_way_back():
    some = FunctionTransformer(lambda X: [x[:, :5] for x in X])
    steps = DirectionCosines(PAPER), some, LinearSynchronizer(9), ActionModel()
    pipe = make_pipeline(*steps).fit(POSITIONS)
    pipe.steps[1] = ("some", type("OneWay", (), {"transform": None})())
    message = r"steps with inverse_transform .* they are \['DirectionCosines', 'OneWay'\]"
    refuses(lambda: SkeletonDisplay.from_model(pipe), message)


def test_postures_of_all_kinds(pipe):
    cosines = DirectionCosines(PAPER).set_output(transform="pandas")
    table = cosines.fit_transform(pd.DataFrame(POSITIONS[0], columns=NAMES))
    refuses(lambda: SkeletonDisplay.from_postures(table, None), "cosines must be a fitted")
    faulty = np.array(table)
    faulty[2, 1:4] = 0
    refuses(
        lambda: SkeletonDisplay.from_postures([np.array(table), faulty], cosines),
        "Performance 1, frame 2: the limb 'hip' has no direction",
    )
    assert len(SkeletonDisplay.from_postures(np.array(table)[:3, None], cosines).axes_) == 6


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"scenes": 5}, "scenes must be a list"),
        ({"scenes": BODY}, "scenes must be a list"),
        ({"scenes": [BODY]}, "scenes must be a list"),
        (
            {"scenes": [[BODY[0]]]},
            r"Panel 0, performance 0 must .* \(n_frames, 15, 3\)",
        ),
        ({"scenes": [[BODY + np.inf]]}, "Panel 0, performance 0 is infinite"),
        ({"scenes": [[BODY + np.nan]]}, "scenes must hold positions to draw"),
        ({"scenes": [[]]}, "scenes must hold positions to draw"),
        ({"skeleton": "paper"}, "skeleton must be a Skeleton"),
        ({"titles": ["a", "b"]}, "titles .* each of the 1 panels, got 2"),
        ({"titles": "a"}, "titles must be a list of text"),
        ({"labels": ["a", "b"]}, "labels .* each of the 1 performances of panel 0, got 2"),
        ({"durations": [3]}, "durations must be a list"),
        ({"durations": [[3, 4]]}, "durations must be a list"),
        ({"durations": [[-1]]}, "durations must be numbers of at least 0"),
        ({"durations": [["1"]]}, "durations must be numbers of at least 0"),
        *(({"marked": bad}, "marked must be a list with, for each of the 1 panels, a list of bones")
          for bad in (3, "left", [], [[], []], [3], [(0, 1), (1, 2)], {(0, 1)})),
        *(({"marked": [bad]}, "marked, panel 0: .* is no bone of the skeleton; its bones are")
          for bad in ([1], ["ab"], [(0, 2)], [(1, 0)], [(0, True)], [(0, 1, 2)], [(0, 1), None])),
        ({"marked": [[(0, 1)]], "skeleton": None}, r"is no bone .* its bones are \[\]"),
        ({"behind": 5}, "behind must be a list with, for each panel"),
        ({"behind": [BODY]}, "behind must be a list with, for each panel"),
        ({"behind": [[BODY], [BODY]]}, "performances for each of the 1 panels, .* got 2"),
        ({"behind": [[BODY[:, :9]]]}, r"Behind panel 0, performance 0 .* \(n_frames, 15, 3\)"),
        ({"behind": [[BODY]], "skeleton": None}, "there must be a skeleton"),
    ],
)  # fmt: skip
def test_stick_figures_made_by_hand(change, message):
    given = {"scenes": [[BODY]], "skeleton": PAPER, "titles": ["one"]}
    assert len(SkeletonDisplay(**given).plot().axes_) == 1
    refuses(lambda: SkeletonDisplay(**given | change), message)


@pytest.mark.parametrize("given", [{"fps": "15"}, {"seconds": np.nan}, {"fps": -1}, {"fps": True}])
def test_animations_that_cannot_play(given):
    refuses(lambda: strip().animate(**given), "seconds and fps must be above 0")
    refuses(lambda: strip().animate(seconds=1e9), r"are 1.5e\+10 pictures, more than 25000")


# -- without a skeleton ---------------------------------------------------------------------


def test_joints_without_a_skeleton_are_points():
    """As they are but for their place: not turned, the lowest of all on the floor."""
    x = POSITIONS[0] + np.tile([5.0, 3.0, -2.0], 15)
    display = strip(x, None, frames=[4], azimuth=0)
    assert all(len(lines.get_paths()) == 0 for lines in display.bones_[0].values())
    points = x.reshape(-1, 15, 3)
    expected = points[4, :, :2] - [points[4, :, 0].mean(), points[..., 1].min()]
    np.testing.assert_allclose(np.transpose(display.heads_[0].get_data()), expected)
    for joint in (0, 7):
        markers = np.delete(points, joint, axis=1).reshape(len(x), -1)
        assert len(strip(markers, None, frames=1).heads_[0].get_xdata()) == 14


def test_points_in_step_and_in_motion():
    display = SkeletonDisplay.from_predictions(POSITIONS, TIMES, None, at=0.5)
    assert [len(dots.get_xdata()) for dots in display.heads_] == [60, 60]
    assert display.animate(seconds=1, fps=2).to_jshtml().count("data:image/png") == 2


@pytest.mark.parametrize("path", [[[0.0, 1, 0]] * 5, [[0.0, t, 0] for t in range(5)]])
def test_a_single_marker(path):
    display = strip(np.array(path), None, frames=2)
    display.figure_.canvas.draw()
    gone = np.array(path)
    gone[1] = np.nan
    assert len(strip(gone, None, frames=[0, 1]).axes_) == 2


def test_no_panels_to_divide():
    refuses(lambda: panels([], [(0, 0)], 1, 1, (2, 2)), "got none of them")
