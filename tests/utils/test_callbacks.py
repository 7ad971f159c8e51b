"""scikit-learn's callbacks on the fit of every estimator."""

import numpy as np
import pytest
from sklearn import clone
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn_motionsync import (
    ActionDetector,
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    FrameWise,
    LinearSynchronizer,
    PartSynchronizer,
    Skeleton,
    TimingChannel,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.live import MotionTracker, OnlineSynchronizer

from estimators import EVERY, WHOLE, by_name, data_for, make_trials, outputs

pytest.importorskip("sklearn.callback", reason="callbacks came with scikit-learn 1.9")


class Recorder:
    """Keeps what it is told, and fails at an event, of a number or of a hook and a task."""

    def __init__(self, fails_at=None):
        self.fails_at = fails_at
        self.contexts, self.open, self.torn_down = [], [], 0

    @property
    def events(self):
        return [(hook, c.estimator_name, c.task_name) for hook, c in self.contexts]

    def _record(self, hook, context):
        self.contexts.append((hook, context))
        if self.fails_at in (len(self.contexts) - 1, (hook, context.task_name)):
            raise StopFitError

    def setup(self, estimator, context):
        self._record("setup", context)

    def on_fit_task_begin(self, estimator, context):
        self.open.append(context)
        self._record("begin", context)

    def on_fit_task_end(self, estimator, context):
        assert self.open.pop() is context
        self._record("end", context)

    def teardown(self, estimator, context):
        self.torn_down += 1


class Propagating(Recorder):
    """A recorder that estimators pass on to those that they fit."""

    max_propagation_depth = None


class StopFitError(Exception):
    """Raised to stop a fit."""


def bits(estimator, X):
    return [np.asarray(result).tobytes() for result in outputs(estimator, X)]


@pytest.mark.parametrize("estimator", EVERY, ids=by_name)
def test_callbacks_follow_every_fit_and_change_no_bit(estimator):
    X, recorder, name = data_for(estimator), Recorder(), type(estimator).__name__
    watched = clone(estimator).set_callbacks(recorder).fit(X)
    assert recorder.events[:2] == [("setup", name, "fit"), ("begin", name, "fit")]
    assert recorder.events[-1] == ("end", name, "fit")
    assert recorder.open == []
    assert recorder.torn_down == 1
    seen = len(recorder.contexts)
    plain, expected = clone(estimator).fit(X), bits(watched, X)
    assert len(recorder.contexts) == seen
    # A fit that is stopped at its end leaves the earlier one as it was.
    attributes = vars(plain).keys() | {"_skl_callbacks"}
    with pytest.raises(StopFitError):
        plain.set_callbacks(Recorder(("end", "fit"))).fit(X[1:])
    assert vars(plain).keys() == attributes
    assert bits(plain, X) == expected


@pytest.mark.parametrize("where", ["setup", "first task", "middle"])
def test_a_callback_that_raises_stops_the_fit(where):
    """The earlier fit is as it was."""
    estimator, all_of_it = DenseSynchronizer(), Recorder()
    X = data_for(estimator)
    clone(estimator).set_callbacks(all_of_it).fit(X[1:])
    fitted = clone(estimator).fit(X)
    expected, attributes = bits(fitted, X), vars(fitted).keys() | {"_skl_callbacks"}
    last = len(all_of_it.contexts) - 1
    recorder = Recorder({"setup": 0, "first task": 1, "middle": last // 2}[where])
    with pytest.raises(StopFitError):
        fitted.set_callbacks(recorder).fit(X[1:])
    assert len(recorder.contexts) == recorder.fails_at + 1
    assert recorder.torn_down == 1
    assert vars(fitted).keys() == attributes
    assert bits(fitted, X) == expected


@pytest.mark.parametrize(("n_trials", "n_tasks"), [(7, 7), (100, 100), (101, 100), (1000, 100)])
def test_portions_are_at_most_a_hundred_tasks_of_a_stage(n_trials, n_tasks):
    bend = make_bending(1, n_frames=10, random_state=0)
    recorder = Recorder()
    DirectionCosines(bend.skeleton).set_callbacks(recorder).fit(bend.data * n_trials)
    assert recorder.events.count(("end", "DirectionCosines", "portion")) == n_tasks


# -- estimators that fit others --------------------------------------------------------------

DENSE = DenseSynchronizer(n_frames=30)
PARTS = "learning the body"
# What each fits within, and the stage of its own that this takes the place of.
NESTED = [
    (PartSynchronizer({"first": [0]}, synchronizer=WHOLE), "DenseSynchronizer", PARTS),
    (TimingChannel(DENSE), "DenseSynchronizer", "synchronizing"),
    (OnlineSynchronizer(DENSE), "DenseSynchronizer", "synchronizing"),
    (MotionTracker(DENSE, n_particles=5), "DenseSynchronizer", "synchronizing"),
    (ActionDetector(make_pipeline(DENSE, ActionModel())), "Pipeline", "fitting the pipeline"),
    (FrameWise(ASpace(2)), "ASpace", "fitting the transformer"),
]


@pytest.mark.parametrize(("estimator", "within", "stage"), NESTED, ids=by_name)
def test_callbacks_reach_what_is_fitted_within(estimator, within, stage):
    X, recorder = make_trials(6), Propagating()
    watched = clone(estimator).set_callbacks(recorder).fit(X)
    begun = [context for hook, context in recorder.contexts if hook == "begin"]
    (inner,) = [c for c in begun if c.estimator_name == within and c.task_name == "fit"]
    source = inner.source_estimator_name, inner.source_task_name
    assert source == (type(estimator).__name__, stage)
    assert inner.parent is begun[0]
    assert recorder.open == []
    assert recorder.torn_down == 1
    # What was fitted within keeps no callbacks.
    found = [vars(watched)[name] for name in vars(watched) if name.endswith("r_")]
    assert [type(each).__name__ for each in found] == [within]
    assert not {"_skl_callbacks", "_parent_callback_ctx"} & vars(found[0]).keys()


def test_all_steps_of_a_pipeline_take_callbacks():
    """A step that does not is warned of, and warnings are errors."""
    steps = DirectionCosines(Skeleton.paper()), ASpace(3), LinearSynchronizer(), ActionModel()
    recorder = Propagating()
    make_pipeline(*steps).set_callbacks(recorder).fit(make_trials(6))
    names = {context.estimator_name for _, context in recorder.contexts}
    assert names == {"Pipeline", *(type(step).__name__ for step in steps)}
    # What cannot take them is a task like any other.
    recorder = Propagating()
    FrameWise(FunctionTransformer()).set_callbacks(recorder).fit(make_trials(3))
    tasks = [context.task_name for hook, context in recorder.contexts if hook == "end"]
    assert tasks == ["fitting the transformer", "fit"]
