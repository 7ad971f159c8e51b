"""MetricDisplay: its bars agree with the metric of the estimator."""

import numpy as np
import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import MetricDisplay

BUNCH = make_bending(6, n_frames=60, random_state=1)
COSINES = DirectionCosines(BUNCH.skeleton)
POSES = COSINES.fit_transform(BUNCH.data)
# The standard deviation of noise: twice the typical one of the poses.
NOISE = 2 * np.concatenate(POSES).std(axis=0).mean()


def with_noise(columns=slice(None)):
    rng = np.random.default_rng(0)
    return [np.column_stack([x[:, columns], NOISE * rng.normal(size=len(x))]) for x in POSES]


@pytest.fixture(scope="module")
def noisy():
    """The last of 38 features is noise."""
    return DenseSynchronizer(50).fit(with_noise())


def widths(bars):
    return np.array([bar.get_width() for bar in bars])


def labels(display):
    return [label.get_text() for label in display.axes_[0].get_yticklabels()]


def test_bars_agree_with_the_metric(noisy):
    display = MetricDisplay.from_estimator(noisy, features=[37, "x0", 5])
    for bars, numbers in zip(
        (display.share_, display.energy_), (noisy.metric_.share, noisy.metric_.energy), strict=True
    ):
        np.testing.assert_array_equal(widths(bars), numbers[[37, 0, 5]])
    assert labels(display) == display.feature_names == ["x37", "x0", "x5"]
    assert repr(display) == "MetricDisplay(3 rows, metric learnt from 6 trials)"


def test_noise_has_a_long_light_bar_and_a_short_dark_one(noisy):
    """The light bar is the longest of all, the dark one is short."""
    display = MetricDisplay.from_estimator(noisy)
    assert labels(display)[0] == "x37"
    light, dark = widths(display.energy_), widths(display.share_)
    assert light[0] == light.max() > 0.1
    assert abs(dark[0]) < 0.1 * light[0]
    # The light bars are behind; the first row is on top.
    assert display.energy_[0].get_height() > display.share_[0].get_height()
    assert display.axes_[0].yaxis_inverted()
    assert "share of what is compared" in display.axes_[0].get_xlabel()
    assert len(display.axes_[0].get_legend().get_texts()) == 2


def test_the_smallest_of_many_features_are_summed(noisy):
    display = MetricDisplay.from_estimator(noisy)
    assert labels(display)[-1] == "19 others"
    assert len(set(labels(display))) == len(display.share_) == 20
    larger = np.maximum(display.share, display.energy)[:-1]
    assert (np.diff(larger) <= 0).all()
    np.testing.assert_allclose([display.share.sum(), display.energy.sum()], 1)
    shown = [int(name[1:]) for name in labels(display)[:-1]]
    rest = np.delete(noisy.metric_.share, shown)
    np.testing.assert_allclose(display.share[-1], rest.sum())
    assert (
        np.delete(np.maximum(noisy.metric_.share, noisy.metric_.energy), shown).max() <= larger[-1]
    )


@pytest.mark.parametrize(("kept", "others"), [(19, []), (20, ["2 others"])])
def test_up_to_twenty_features_have_rows(kept, others):
    display = MetricDisplay.from_estimator(DenseSynchronizer(30).fit(with_noise(slice(kept))))
    assert len(labels(display)) == 20
    assert [name for name in labels(display) if "others" in name] == others


def test_rows_have_the_names_of_features_and_columns():
    inside = make_pipeline(make_pipeline(COSINES, ASpace(3)), make_pipeline(DenseSynchronizer(30)))
    display = MetricDisplay.from_estimator(inside.fit(BUNCH.data))
    assert sorted(display.feature_names) == ["aspace0", "aspace1", "aspace2"]
    direct = make_pipeline(COSINES, DenseSynchronizer(30)).fit(BUNCH.data)
    display = MetricDisplay.from_estimator(direct, features="pelvis_height")
    np.testing.assert_array_equal(display.share, direct[-1].metric_.share[:1])
    tables = [pd.DataFrame(x[:, 1:4], columns=["hip", "knee", "toe"]) for x in BUNCH.data]
    display = MetricDisplay.from_estimator(DenseSynchronizer(30).fit(tables), features=["toe"])
    assert labels(display) == ["toe"]


STILL = [np.ones((40, 2))] * 4


@pytest.mark.parametrize(
    ("change", "X", "message"),
    [
        ({"metric": None}, POSES, "It has metric=None, cost='velocity', consensus=8"),
        ({"cost": "elastic"}, POSES, "It has metric='learned', cost='elastic', consensus=8"),
        ({"consensus": 0}, POSES, "It has metric='learned', cost='velocity', consensus=0"),
        ({}, POSES[:2], "at least 3 trials .* was fitted to 2 trials; change"),
        ({}, POSES[:1], "was fitted to 1 trial; change what is missing and fit it again"),
        ({}, STILL, "in which something moves.* was fitted to 4 trials"),
    ],
)
def test_missing_metric_is_explained(change, X, message):
    with pytest.raises(ValueError, match=f"There is no metric to draw.*{message}"):
        MetricDisplay.from_estimator(DenseSynchronizer(30, **change).fit(X))
