"""ActionDetector: whether performances as they were recorded are the action, and why not."""

from numbers import Real

import numpy as np
import pandas as pd
from sklearn import get_config
from sklearn.base import BaseEstimator, MetaEstimatorMixin, _fit_context, clone
from sklearn.utils._param_validation import HasMethods, Interval
from sklearn.utils.metadata_routing import MetadataRouter, MethodMapping
from sklearn.utils.validation import check_is_fitted

from ..inputs.tables import index_of
from ..inputs.validation import labels_as_given
from ..utils.atomic import atomic_fit, snapshot
from ..utils.doc_links import DocumentedMixin
from ..utils.groups import encode_groups
from ..utils.pipelines import (
    MissingMetadata,
    find_step,
    find_synchronizer,
    flat_steps,
    reach_synchronizer,
    steps_to_fit,
    taken_by,
)
from .action_model import ActionModel
from .similarity import Logs, Neighbours, learn_reach
from .stream import spread_out

__all__ = ["ActionDetector", "energies"]

# What is said of a performance that is too low, or too high.
_REASONS = {
    "movement": (None, "another movement"),
    "course": (None, "another course"),
    "duration": ("too short", "too long"),
    "energy": ("too weak", "too strong"),
}


class ActionDetector(DocumentedMixin, MetaEstimatorMixin, BaseEstimator):
    """Whether performances are the action, seen as they were recorded.

    After synchronisation nobody is slow, a movement that comes twice is nearly one that comes
    once, and an `ActionModel` compares shapes more than sizes. The detector asks four questions of
    a performance. Each is answered within what people of the other groups leave open, and all four
    must be answered with yes.

    1. **movement**: how unlike it is to the model *after* synchronisation, as
       `ActionModel.dissimilarity`.
    2. **course**: the same after linear normalisation alone, where every part stays when it was.
    3. **duration**: its number of frames, as a ratio to the usual one.
    4. **energy**: the mean squared distance of its postures from their own mean, as a ratio to the
       usual one.

    Parameters
    ----------
    estimator : Pipeline
        Ends in an `ActionModel`, with a synchronizer before it. What reaches the synchronizer is
        compared. It is cloned, not changed.
    coverage : float, default=0.95
        Share of performances of people not seen that ``predict`` is to accept, between 0 and 1.
        The share that is refused is divided evenly among the questions. It takes the place of
        the model's own.
    duration : bool, default=True
        Whether the number of frames counts. Frames are time only if all performances have one
        frame rate, in ``fit`` and after it, and are cut where the action begins and ends: else
        give False, or resample them to one rate.

    Attributes
    ----------
    estimator_ : Pipeline
        The fitted clone.
    borders_ : DataFrame, shape (n_questions, 2)
        What is accepted, ``lower`` to ``upper``: dissimilarities, frames, and the unit of the
        features squared.
    offset_ : float
        The border of ``score_samples``, -1.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    ActionModel : Asks the first question only.

    Notes
    -----
    Give ``groups``, such as who performed, whenever people come more than once: the border is
    then what differs between people. What people differ in by themselves is not refused: copies
    at half or double speed are seen where people agree on how long the action takes.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn_motionsync import (
    ...     ActionDetector, ActionModel, ASpace, DenseSynchronizer, DirectionCosines
    ... )
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(12, random_state=0)
    >>> steps = DirectionCosines(bunch.skeleton), ASpace(0.95), DenseSynchronizer(50)
    >>> detector = ActionDetector(make_pipeline(*steps, ActionModel()))
    >>> detector = detector.fit(bunch.data, groups=bunch.actor)
    >>> bend = bunch.data[0]
    >>> detector.predict([bend, bend[::4], bend[:1].repeat(90, axis=0)]).tolist()
    [1, -1, -1]
    >>> detector.report([bend, bend[::4]])["reason"].tolist()
    ['', 'too short']
    """

    _parameter_constraints: dict = {
        "estimator": [HasMethods(["fit"])],
        "coverage": [Interval(Real, 0, 1, closed="neither")],
        "duration": ["boolean"],
    }

    def __init__(self, estimator, coverage=0.95, duration=True):
        self.estimator = estimator
        self.coverage = coverage
        self.duration = duration

    @atomic_fit
    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X, y=None, groups=None, **params):
        """Fit the pipeline, and learn what else people differ in.

        Parameters
        ----------
        X : performances, as the pipeline takes them
        y : ignored, but for steps of the pipeline that use it
        groups : array-like, shape (n_sequences,), default=None
            Who performed, or what else makes performances resemble each other. The model of the
            pipeline gets them, too. By default every performance counts for itself.
        **params : dict
            What the ``fit`` of the pipeline takes besides: by the names of steps, or routed
            metadata.

        Returns
        -------
        self

        Raises
        ------
        ValueError
            If the pipeline does not end in an `ActionModel` or has no synchronizer, and as from
            its ``fit``.
        """
        self.estimator_ = clone(self.estimator)
        name = self._check_steps()
        groups = params.pop(name, None) if groups is None else groups
        given = {} if groups is None else {name: groups}
        self.estimator_.fit(X, y, **given, **params)
        before, synchronizer = find_synchronizer(self.estimator_)
        also = {name.rpartition("__")[2]: value for name, value in params.items()}
        steps = [] if before is None else flat_steps(before)
        also = {k: v for step in steps for k, v in taken_by(step.transform, also).items()}
        reached = reach_synchronizer(self.estimator_, X, also, "ActionDetector.fit")
        self._learn(reached.performances, synchronizer, groups)
        for name in ("n_features_in_", "feature_names_in_"):
            if hasattr(self.estimator_, name):
                setattr(self, name, getattr(self.estimator_, name))
        return self

    @snapshot
    def predict(self, X, **params):
        """Whether performances are the action.

        Parameters
        ----------
        X : performances, as the pipeline takes them
        **params : dict
            What steps take besides in ``transform``, such as ``keyframes``.

        Returns
        -------
        ndarray of int, shape (n_sequences,)
            1 it is, -1 it is not.
        """
        return np.where(self._worst(X, params, "predict") <= 1, 1, -1)

    @snapshot
    def decision_function(self, X, **params):
        """How far within its border the question is that a performance answers worst.

        Parameters
        ----------
        X, **params : as for ``predict``

        Returns
        -------
        ndarray, shape (n_sequences,)
            ``score_samples`` less ``offset_``: negative outside.
        """
        return 1 - self._worst(X, params, "decision_function")

    @snapshot
    def score_samples(self, X, **params):
        """How well performances answer the question that they answer worst.

        Parameters
        ----------
        X, **params : as for ``predict``

        Returns
        -------
        ndarray, shape (n_sequences,)
            The largest size among the columns of ``report``, negated.
        """
        return -self._worst(X, params, "score_samples")

    @snapshot
    def report(self, X, **params):
        """What is said of performances, question by question.

        Parameters
        ----------
        X, **params : as for ``predict``

        Returns
        -------
        DataFrame, one row a performance
            ``movement`` and ``course`` in units of their border: 0 is equal, up to 1 accepted.
            ``duration`` (if it counts) and ``energy``: 0 is usual, -1 to 1 accepted, below are
            those that are too short or too weak. ``reason`` says why a performance is refused,
            such as "too long, too weak"; it is empty if it is accepted.
        """
        table, performances = self._ask(X, params, "report")
        labels, levels = labels_as_given(X, performances)
        table = pd.DataFrame(table, index=index_of(labels, levels[:-1]))
        table["reason"] = [_reason(row) for row in table.to_dict("records")]
        return table

    def get_metadata_routing(self):
        """What the detector asks for, and what it hands on to its pipeline.

        Returns
        -------
        MetadataRouter
        """
        mapping = MethodMapping().add(caller="fit", callee="fit")
        for caller in ("predict", "decision_function"):
            mapping.add(caller=caller, callee="predict")
        router = MetadataRouter(owner=type(self).__name__).add_self_request(self)
        return router.add(estimator=self.estimator, method_mapping=mapping)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.estimator_type = "outlier_detector"
        tags.input_tags.three_d_array = True
        return tags

    # -- what is learnt ---------------------------------------------------------------------

    def _check_steps(self):
        """What the groups of the model are called in the ``fit`` of the clone."""
        steps = steps_to_fit(self.estimator_)
        prefix, last = steps[-1] if steps else ("", None)
        matching = any(hasattr(step, "match") for _, step in steps)
        if not isinstance(last, ActionModel) or not matching:
            raise ValueError(
                "ActionDetector needs a pipeline that ends in an ActionModel and has a "
                "synchronizer before it, such as make_pipeline(DenseSynchronizer(), "
                f"ActionModel()); got the steps {[type(step).__name__ for _, step in steps]}."
            )
        if not get_config()["enable_metadata_routing"]:
            return f"{prefix}groups"
        last.set_fit_request(groups=True)
        return "groups"

    def _learn(self, performances, synchronizer, groups):
        """What people differ in, of performances that reach the synchronizer."""
        codes, _ = encode_groups(groups, len(performances), at_least=2)
        on_clock = synchronizer.normalize(performances)
        energy, self._floor = energies(on_clock)
        coverage = 1 - (1 - self.coverage) / (4 if self.duration else 3)
        _, model = find_step(self.estimator_, ActionModel)
        course = UnalignedDissimilarity(on_clock, codes, coverage)
        self._questions = {"course": course}
        self.borders_ = {
            "movement": (0.0, model.threshold_at(coverage)),
            "course": (0.0, course.border),
        }
        values = {"duration": _durations(performances)} if self.duration else {}
        for name, some in (values | {"energy": energy}).items():
            self._questions[name] = usual = LogPredictionInterval(some, codes, coverage)
            self.borders_[name] = usual.lower, usual.upper
        self.offset_ = -1.0

    # -- what is asked ----------------------------------------------------------------------

    def _ask(self, X, params, method):
        """The answers by question, (n_sequences,) each, and what reached the synchronizer."""
        check_is_fitted(self)
        caller = f"ActionDetector.{method}"
        try:
            reached = reach_synchronizer(self.estimator_, X, params, caller, uses=("transform",))
            performances = reached.performances
            first = 0 if reached.before is None else len(flat_steps(reached.before))
            synchronised = performances
            for step in flat_steps(self.estimator_)[first:-1]:
                synchronised = step.transform(synchronised, **taken_by(step.transform, params))
        except MissingMetadata as error:
            reason, name, _ = error.args
            raise MissingMetadata(reason, name, f"{caller}(X, {{name}}=[...])") from error
        _, model = find_step(self.estimator_, ActionModel)
        on_clock = reached.synchronizer.normalize(performances)
        seen = {
            "course": on_clock,
            "duration": _durations(performances),
            "energy": energies(on_clock, self._floor)[0],
        }
        answers = {name: asked(seen[name]) for name, asked in self._questions.items()}
        moved = model.dissimilarity(synchronised) / self.borders_["movement"][1]
        return {"movement": moved} | answers, performances

    def _worst(self, X, params, method):
        table, _ = self._ask(X, params, method)
        return np.max(np.abs(list(table.values())), axis=0)


def _durations(performances):
    return np.array([len(x) for x in performances], dtype=np.float64)


def _reason(row):
    """Why a performance with these answers is refused."""
    reasons = {
        name: _REASONS[name][int(value > 0)] for name, value in row.items() if abs(value) > 1
    }
    if "movement" in reasons:
        # Then its course is another one, too, which says nothing more.
        reasons.pop("course", None)
    return ", ".join(reasons.values())


# -- how a performance was recorded, which synchronisation hides: its course, duration and energy

# Energies below this share of all are rounding, or none.
_LEAST = 1e-9


class UnalignedDissimilarity:
    """How unlike performances are to those that were learnt, each in units of the border.

    Parameters
    ----------
    performances : sequence of ndarray (P, n_features)
        On one clock.
    groups : ndarray of int (n_sequences,)
    coverage : float
        Share of new performances below 1.

    Attributes
    ----------
    border : float
        The dissimilarity that is 1.
    """

    def __init__(self, performances, groups, coverage):
        kept = spread_out(groups)
        known = np.stack([performances[i] for i in kept]).astype(np.float64)
        self._neighbours = Neighbours(known, groups[kept])
        unlike = Logs.of(self._neighbours.dissimilarity(performances, groups))
        self.border = self._neighbours.border(unlike, coverage)

    def __call__(self, performances):
        return self._neighbours.dissimilarity(performances) / self.border


class LogPredictionInterval:
    """How far numbers above 0 are from what is usual, in units of what is allowed.

    Everything is said of logarithms: twice is as far as half. What is usual is the mean; how far
    people may be from it is learnt from each performance and the mean of the other groups.

    Parameters
    ----------
    values : ndarray (n_sequences,)
        Above 0.
    groups : ndarray of int (n_sequences,)
        From 0, at least two different ones.
    coverage : float
        Share of new values between -1 and 1.

    Attributes
    ----------
    lower, upper : float
        The values that are -1 and 1.
    """

    def __init__(self, values, groups, coverage):
        logs = np.log(values)
        self._mean = float(logs.mean())
        apart, n = logs - _mean_of_others(logs, groups), len(logs)
        # That the mean of the others is uncertain is in them, and must not be counted twice.
        self._reach = learn_reach(apart * np.sqrt((n - 1) / (n + 1)), (1 + coverage) / 2)
        with np.errstate(over="ignore"):
            ends = np.exp([self._mean - self._reach, self._mean + self._reach])
        self.lower, self.upper = map(float, ends)

    def __call__(self, values):
        return (np.log(values) - self._mean) / self._reach


def energies(on_clock, floor=None):
    """The mean squared distance of the postures of performances from their own mean posture.

    Parameters
    ----------
    on_clock : ndarray (n_sequences, P, n_features)
    floor : float, default=None
        What standing still counts as; by default a tiny share of how much the postures of all
        performances differ.

    Returns
    -------
    ndarray (n_sequences,)
        Above 0; infinite beyond any number.
    floor : float
    """
    on_clock = np.asarray(on_clock, dtype=np.float64)
    with np.errstate(over="ignore"):
        squares = np.square(on_clock - on_clock.mean(axis=1, keepdims=True))
        energy = squares.reshape(len(on_clock), -1).sum(axis=1) / on_clock.shape[1]
    if floor is None:
        about = np.square(on_clock - on_clock.mean(axis=(0, 1))).sum(axis=2).mean()
        rounding = np.square(64 * np.finfo(float).eps * np.abs(on_clock).max())
        floor = max(_LEAST * about, rounding * on_clock.shape[2], np.finfo(float).tiny)
    return np.maximum(energy, floor), float(floor)


def _mean_of_others(values, groups):
    """For each value, the mean of those of other groups."""
    total, count = np.bincount(groups, weights=values), np.bincount(groups)
    return (values.sum() - total[groups]) / (len(values) - count[groups])
