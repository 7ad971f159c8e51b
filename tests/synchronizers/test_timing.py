"""TimingChannel: curves and their timing, by itself and in pipelines."""

import numpy as np
import pandas as pd
import pytest
from sklearn import config_context
from sklearn.decomposition import PCA
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionDetector,
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
    Match,
    TimingChannel,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import ActionModelDisplay, SkeletonDisplay
from sklearn_motionsync.metrics import FeatureHoldoutScorer, SpreadScorer
from sklearn_motionsync.model import find_departures

from shift_synchronizer import ShiftSynchronizer


@pytest.fixture(scope="module")
def bunch():
    return make_bending(7, n_frames=40, random_state=3)


@pytest.fixture(scope="module")
def points(bunch):
    return ASpace(3).fit_transform(DirectionCosines(bunch.skeleton).fit_transform(bunch.data))


@pytest.fixture(scope="module")
def pipes(bunch):
    """Of a channel and of its synchronizer, fitted."""
    steps, sync = (DirectionCosines(bunch.skeleton), ASpace(3)), DenseSynchronizer(30)
    made = (make_pipeline(*steps, each, ActionModel()) for each in (TimingChannel(sync), sync))
    return [pipe.fit(bunch.data) for pipe in made]


def test_the_offset_is_the_last_feature(points):
    synchronizer = DenseSynchronizer(30).fit(points)
    channel = TimingChannel(DenseSynchronizer(30)).fit(points)
    out, match = channel.transform(points), synchronizer.match(points)
    np.testing.assert_array_equal(out[:, :, :3], synchronizer.transform(points))
    np.testing.assert_array_equal(out[:, :, 3], match.offsets_in("percent"))
    assert channel.get_feature_names_out().tolist() == ["x0", "x1", "x2", "offset"]
    single = channel.fit_transform([x.astype(np.float32) for x in points])
    assert (single.dtype, single.shape) == (np.float32, (7, 30, 4))


def test_rows_give_curves_followed_by_offsets():
    rows = np.sin(np.linspace(0, 6, 25) + np.linspace(0, 1, 5)[:, np.newaxis])
    channel = TimingChannel(DenseSynchronizer(20)).set_output(transform="pandas")
    out, inner = channel.fit_transform(rows), channel.synchronizer_
    names = ("densesynchronizer", "offset")
    assert list(out.columns) == [f"{name}{k}" for name in names for k in range(20)]
    np.testing.assert_array_equal(out.iloc[:, :20], inner.transform(rows))
    np.testing.assert_array_equal(out.iloc[:, 20:], inner.match(rows).offsets_in("percent"))
    plain = TimingChannel(DenseSynchronizer(20))
    assert make_pipeline(plain, PCA(2)).fit_transform(rows).shape == (5, 2)


def test_keyframes_are_routed_by_name_and_by_request(bunch):
    X, given = bunch.data, {"keyframes": bunch.keyframes}
    expected = LinearSynchronizer(30).fit(X, **given).match(X, **given)
    channel = TimingChannel(LinearSynchronizer(30)).fit(X, **given)
    out = channel.transform(X, **given)
    np.testing.assert_array_equal(out[:, :, -1], expected.offsets_in("percent"))
    np.testing.assert_array_equal(channel.fit_transform(X, **given), out)
    with pytest.raises(ValueError, match="fitted with key-frames"):
        channel.transform(X)
    with pytest.raises(TypeError, match="keyframes"):
        TimingChannel(ShiftSynchronizer()).fit(X, **given)
    np.testing.assert_array_equal(Match.from_estimator(channel, X, **given).times, expected.times)
    with pytest.raises(TypeError, match="got 'moments', which is no argument"):
        Match.from_estimator(channel, X, moments=[1])
    with config_context(enable_metadata_routing=True):
        asking = LinearSynchronizer(30).set_fit_request(keyframes=True)
        asking.set_transform_request(keyframes=True)
        pipe = make_pipeline(TimingChannel(asking), ActionModel())
        pipe.fit(X, **given)
        np.testing.assert_array_equal(pipe[:1].transform(X, **given), out)
        np.testing.assert_array_equal(TimingChannel(asking).fit_transform(X, **given), out)
        fits_only = LinearSynchronizer(30).set_fit_request(keyframes=True)
        fits_only.set_transform_request(keyframes=False)
        with pytest.raises(ValueError, match="fitted with key-frames"):
            TimingChannel(fits_only).fit_transform(X, **given)
        with pytest.raises(TypeError, match="moments"):
            TimingChannel(asking).fit_transform(X, moments=[1])


def test_scorers_and_detectors_find_the_synchronizer(bunch, pipes):
    (pipe, plain), X = pipes, bunch.data
    times = [Match.from_estimator(each, X).times for each in pipes]
    np.testing.assert_array_equal(*times)
    for scorer in (SpreadScorer(), FeatureHoldoutScorer()):
        assert scorer(pipe, X) == scorer(plain, X)
    assert len(SkeletonDisplay.from_model(pipe, frames=[5]).axes_) == 2
    assert (ActionDetector(pipe).fit(X).predict(X) == 1).all()


def test_model_displays_show_the_channel_beside_poses(bunch, pipes):
    pipe, plain = pipes
    display = ActionModelDisplay.from_estimator(pipe, bunch.data)
    assert display.ylabels == ["aspace0", "aspace1", "aspace2", "offset"]
    features = ["offset", "pelvis_height"]
    for band in ("points", "trials"):
        display = ActionModelDisplay.from_estimator(pipe, bunch.data, features=features, band=band)
        offsets = Match.from_estimator(pipe, bunch.data).offsets_in("percent")
        np.testing.assert_allclose(display.trials[:, :, 0], offsets)
        np.testing.assert_allclose(display.mean[:, 0], offsets.mean(axis=0))
        expected = ActionModelDisplay.from_estimator(
            plain, bunch.data, features="pelvis_height", band=band
        )
        np.testing.assert_allclose(display.trials[:, :, 1:], expected.trials)
    # A limb varies by what the aSpace leaves out, too; the channel does not.
    strange = [*bunch.data[:2], bunch.data[2][::-1]]
    found = find_departures(pipe, strange, features="offset", limit=0.1)
    assert set(found["feature"]) == {"offset"}
    found = found.groupby("trial").head(1)
    deviations = (pipe[:-1].transform(strange) - pipe[-1].mean_)[:, :, -1]
    scores = deviations / np.sqrt(pipe[-1].predictive_variance_[:, -1])
    inside = [np.abs(scores[row.trial, row.first : row.last + 1]) for row in found.itertuples()]
    peaks = [row.first + x.argmax() for row, x in zip(found.itertuples(), inside, strict=True)]
    assert found["peak"].tolist() == peaks
    assert set(found["trial"]) == {0, 1, 2}


@pytest.mark.parametrize("wrong", [ASpace(), TimingChannel(DenseSynchronizer())])
def test_the_synchronizer_is_validated(points, wrong):
    with pytest.raises(ValueError, match=r"The 'synchronizer' parameter .* 'sklearn_motionsync"):
        TimingChannel(wrong).fit(points)


def test_fit_refuses_a_feature_with_the_name_of_the_channel(points):
    frames = [pd.DataFrame(x, columns=["p", "offset", "r"]) for x in points]
    with pytest.raises(ValueError, match="has the name of the offset, 'offset': rename it"):
        TimingChannel(LinearSynchronizer()).fit(frames)
