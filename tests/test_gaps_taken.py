"""Gaps (NaN): every estimator takes them, or refuses them with the call that cures it."""

import numpy as np
import pandas as pd
import pytest
from sklearn.decomposition import PCA
from sklearn.impute import KNNImputer
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils import get_tags
from sklearn_motionsync import (
    ActionClassifier,
    ActionDetector,
    ActionModel,
    ASpace,
    DirectionCosines,
    FrameWise,
    LinearSynchronizer,
    Match,
)
from sklearn_motionsync.datasets import make_bending, make_gait
from sklearn_motionsync.io import fill_gaps
from sklearn_motionsync.model.similarity import movement_energies
from sklearn_motionsync.synchronizers import blend_trials
from sklearn_motionsync.takes import CycleSegmenter


@pytest.fixture(scope="module")
def bunch():
    return make_bending(12, n_actors=4, n_frames=40, random_state=0)


@pytest.fixture(scope="module")
def gaps(bunch):
    """A wrist is hidden for a while, in every third bend."""
    X, wrist = [x.copy() for x in bunch.data], 3 * bunch.skeleton.index_of("left_wrist")
    for x in X[1::3]:
        x[10:20, wrist : wrist + 3] = np.nan
    return X


def test_a_classifier_names_the_step_that_takes_gaps(bunch, gaps):
    X = gaps + [x[: len(x) // 2] for x in gaps]
    y = np.repeat(["bend", "half"], 12)
    cosines = DirectionCosines(bunch.skeleton, hidden="nan")
    classifier = ActionClassifier(n_frames=20)
    message = r"Trial 1, frame 10, .* is NaN.*Put ASpace\(1\.0\) before it"
    with pytest.raises(ValueError, match=message):
        make_pipeline(cosines, classifier).fit(X, y)
    pipe = make_pipeline(cosines, ASpace(1.0), classifier).fit(X, y)
    assert pipe.score(X, y) == 1


def test_a_segmenter_names_the_call_that_fills_gaps():
    takes = make_gait(2, n_cycles=5, takes=True, random_state=0).data
    takes[1][100:104, 2] = np.nan
    with pytest.raises(ValueError, match=r"Trial 1, frame 100, .* NaN.*fill_gaps\(x, max_gap"):
        CycleSegmenter(start=0).fit(takes)
    takes = ASpace(1.0).fit_transform(takes)
    assert len(CycleSegmenter().fit(takes).segment(takes)[0]) == 10


def test_blends_name_the_call_that_fills_gaps(bunch, gaps):
    tables = [pd.DataFrame(x, columns=bunch.skeleton.column_names) for x in gaps]
    whole = [fill_gaps(x, max_gap=10).to_numpy() for x in tables]
    pipe = make_pipeline(DirectionCosines(bunch.skeleton), LinearSynchronizer(50)).fit(whole)
    weights = {0: 0.5, 1: 0.5}
    for estimator in (pipe, Match.from_estimator(pipe, whole)):
        with pytest.raises(ValueError, match=r"Trial 1, frame 10, .* NaN.*fill_gaps\(x, max_g"):
            blend_trials(estimator, gaps, weights, skeleton=bunch.skeleton)
    assert np.isfinite(blend_trials(pipe, whole, weights)).all()


def test_a_detector_takes_what_its_pipeline_takes(bunch, gaps):
    steps = ASpace(0.95), LinearSynchronizer(30), ActionModel()
    careful, detector = (
        ActionDetector(make_pipeline(DirectionCosines(bunch.skeleton, hidden=hidden), *steps))
        for hidden in ("raise", "nan")
    )
    assert not get_tags(careful).input_tags.allow_nan
    with pytest.raises(ValueError, match=r"Trial 1, frame 10, .* is NaN"):
        careful.fit(gaps)
    assert get_tags(detector).input_tags.allow_nan
    detector.fit(gaps, groups=bunch.actor)
    assert (detector.predict(gaps) == 1).mean() > 0.8
    still = [x[:1].repeat(len(x), axis=0) for x in gaps]
    assert (detector.predict(still) == -1).all()


def test_tags_of_frame_wise_are_those_of_its_transformer():
    for transformer, takes in (
        (KNNImputer(), True),
        (StandardScaler(), True),
        (PCA(2), False),
        (make_pipeline(KNNImputer(), PCA(2)), True),
    ):
        assert get_tags(FrameWise(transformer)).input_tags.allow_nan is takes


def test_energies_of_movements_are_those_of_what_was_seen():
    rng = np.random.default_rng(0)
    X = np.cumsum(rng.standard_normal((5, 400, 3)), axis=1) * [1, 2, 3]
    gaps = np.where(rng.random(X.shape) < 0.2, np.nan, X)
    gaps[1, :, 2] = np.nan
    found, floor = movement_energies(gaps)
    own = np.nanvar(np.delete(gaps, 1, axis=0), axis=1)
    np.testing.assert_allclose(np.delete(found, 1), own.sum(axis=1), rtol=1e-9)
    np.testing.assert_allclose(floor, 1e-9 * np.nanvar(gaps, axis=(0, 1)).sum(), rtol=1e-9)
    # A feature that is never shown has the share that it has in the others.
    shown = np.nanvar(gaps[1, :, :2], axis=0)
    usual = np.vstack([own[:, :2], shown]).mean(axis=0).sum()
    share = 1 + own[:, 2].mean() / usual
    np.testing.assert_allclose(found[1], shown.sum() * share, rtol=1e-9)
    assert movement_energies(np.where(np.isnan(gaps), np.nan, 7.0), floor)[0].max() == floor
