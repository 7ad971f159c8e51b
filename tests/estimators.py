"""A small, fast instance of every public estimator, for the tests that all of them must pass.

A public estimator that is missing here fails
``test_every_public_estimator_is_in_the_contract``.
"""

import inspect

import numpy as np
import pandas as pd
from sklearn.decomposition import PCA
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionClassifier,
    ActionDetector,
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    FrameWise,
    JointPositions,
    LinearSynchronizer,
    PartSynchronizer,
    Skeleton,
    TimingChannel,
)
from sklearn_motionsync.datasets import make_gait
from sklearn_motionsync.live import MotionTracker, OnlineSynchronizer
from sklearn_motionsync.takes import CycleSegmenter

from public import OBJECTS
from shift_synchronizer import ShiftSynchronizer

N_JOINTS = 15
WIDTH = 3 * N_JOINTS
NAMES = Skeleton.paper().column_names

# Inside other estimators: the interface of the defaults, without what they learn and try.
QUICK = DenseSynchronizer(metric=None, refine=False)
WHOLE = DenseSynchronizer(n_frames=30, metric=None, consensus=1, refine=False)


class AlternatingClassifier(ActionClassifier):
    """Classes 0 and 1 in turn, for tests of collections, which give no labels."""

    def fit(self, X, y=None):
        if y is None:
            trials = X.index.unique(0) if isinstance(X, pd.DataFrame) else list(X)
            y = np.arange(len(trials)) % 2
        return super().fit(X, y)


# By the name of the class; ``Synchronizer`` is abstract: a subclass from outside stands for it.
INSTANCES = {
    "DirectionCosines": [DirectionCosines(Skeleton.paper())],
    "JointPositions": [JointPositions(Skeleton.paper())],
    "ASpace": [ASpace()],
    "FrameWise": [FrameWise(PCA(2))],
    "LinearSynchronizer": [LinearSynchronizer()],
    "DenseSynchronizer": [DenseSynchronizer()],
    "PartSynchronizer": [PartSynchronizer({"first": [0]}, synchronizer=WHOLE)],
    "Synchronizer": [ShiftSynchronizer()],
    "TimingChannel": [TimingChannel(LinearSynchronizer())],
    "ActionModel": [ActionModel()],
    "ActionDetector": [ActionDetector(make_pipeline(QUICK, ActionModel()))],
    "OnlineSynchronizer": [OnlineSynchronizer(LinearSynchronizer())],
    "MotionTracker": [MotionTracker(LinearSynchronizer(), n_particles=10, random_state=0)],
    "ActionClassifier": [AlternatingClassifier(n_frames=8)],
    "CycleSegmenter": [CycleSegmenter(start=0)],
}


def all_of(*names):
    """The instances of these classes."""
    return [estimator for name in names for estimator in INSTANCES[name]]


SYNCHRONIZERS = all_of(
    "LinearSynchronizer",
    "DenseSynchronizer",
    "PartSynchronizer",
    "Synchronizer",
)
# Their width is fixed by their skeleton.
BODY = all_of("DirectionCosines", "JointPositions")
# They take long recordings of a movement that repeats, not trials.
OF_TAKES = all_of("CycleSegmenter")
EVERY = all_of(*INSTANCES)
ESTIMATORS = [e for e in EVERY if e not in OF_TAKES]
TRANSFORMERS = [e for e in ESTIMATORS if hasattr(e, "transform")]
SEQUENCE_LEVEL = [e for e in ESTIMATORS if e not in [*BODY, *all_of("ASpace", "FrameWise")]]


def public_estimators():
    """Names of the public estimators."""
    return {n for n, each in OBJECTS.items() if inspect.isclass(each) and hasattr(each, "fit")}


def by_name(value):
    """The id of an estimator in the name of a test."""
    return type(value).__name__ if hasattr(value, "get_params") else None


def make_trials(n, n_frames=30):
    """Trials of 15 joints, of equal length."""
    rng = np.random.RandomState(0)
    t = np.linspace(0, 1, n_frames)[:, np.newaxis]
    base = rng.uniform(-1, 1, (1, WIDTH)) + np.sin(2 * t + rng.uniform(0, 6, (1, WIDTH)))
    return [base + 0.1 * rng.standard_normal(base.shape) for _ in range(n)]


def data_for(estimator):
    """What an instance can be fitted on."""
    if estimator in OF_TAKES:
        return make_gait(2, n_cycles=4, takes=True, random_state=0).data
    return make_trials(6)


def outputs(estimator, X):
    """All results of a fitted estimator for trials, or takes, as a list of plain arrays."""
    results = []
    if hasattr(estimator, "transform"):
        results += [np.asarray(x) for x in estimator.transform(X)]
    if hasattr(estimator, "match"):
        match = estimator.match(X)
        results += [match.times, match.distances]
    if isinstance(estimator, OnlineSynchronizer):
        results += list(zip(*estimator.track(X), strict=True))
    if isinstance(estimator, MotionTracker):
        # A tracker also takes single takes and gaps: what it is given here is checked before.
        estimator.check_trials(X)
        results += [np.stack([track.poses[:9] for track in estimator.track(X)])]
    if hasattr(estimator, "score_samples"):
        results += [estimator.score_samples(X), estimator.decision_function(X)]
        results += [estimator.predict(X)]
    if hasattr(estimator, "predict_proba"):
        results += [estimator.predict_proba(X)]
    elif hasattr(estimator, "score"):
        results += [np.array(estimator.score(X))]
    if hasattr(estimator, "segment"):
        results += estimator.segment(X)[0]
    return results
