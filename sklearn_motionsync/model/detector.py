"""ActionDetector: whether performances as they were recorded are the action, and why not."""

from __future__ import annotations

from numbers import Real
from typing import Any, Self

import numpy as np
import pandas as pd
from sklearn import get_config
from sklearn.base import BaseEstimator, MetaEstimatorMixin, clone
from sklearn.utils._param_validation import HasMethods, Interval
from sklearn.utils.metadata_routing import MetadataRouter, MethodMapping
from sklearn.utils.validation import check_is_fitted

from ..inputs.tables import index_of
from ..inputs.types import Labels, PerformancesLike
from ..inputs.validation import labels_of_input
from ..utils.atomic import atomic_fit, snapshot
from ..utils.doc_links import DocumentedMixin
from ..utils.groups import encode_groups, sums_of_groups
from ..utils.parallel import LongWorkMixin
from ..utils.parameters import validated_with_nested
from ..utils.pipelines import (
    MissingMetadata,
    accepted_params,
    find_step,
    find_synchronizer,
    flat_steps,
    route_to_synchronizer,
    steps_to_fit,
    takes_gaps,
)
from .action_model import ActionModel
from .similarity import movement_energies, t_prediction_limit

__all__ = ["ActionDetector"]

# Reasons for the rejection of a performance below, or above, the accepted interval.
_REASONS = {
    "movement": (None, "another movement"),
    "course": (None, "another course"),
    "duration": ("too short", "too long"),
    "energy": ("too weak", "too strong"),
}


class ActionDetector(DocumentedMixin, LongWorkMixin, MetaEstimatorMixin, BaseEstimator):
    """Whether trials are the movement, by its shape, timing and size.

    It learns from trials of one movement, by a pipeline with a synchronizer and an `ActionModel`.
    A trial four times as fast, and one without movement, are refused:

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

    Parameters
    ----------
    estimator : Pipeline
        Ends in an `ActionModel`, with a synchronizer before it. The features that the synchronizer
        gets are compared. It is cloned, not changed.
    coverage : float, default=0.95
        Share of performances of new people that ``predict`` is to accept, between 0 and 1.
        The share that is rejected is divided evenly among the tests. It replaces the coverage
        of the model.
    duration : bool, default=True
        Whether the number of frames counts. Frames are time only if all performances have one
        frame rate, in ``fit`` and after it, and are cut where the action begins and ends: else
        give False, or resample them to one rate.

    Attributes
    ----------
    estimator_ : Pipeline
        The fitted clone.
    borders_ : dict of str to (float, float)
        The accepted interval of each test: of dissimilarities, frames, and squared features.
    offset_ : float
        The threshold of ``score_samples``, -1.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    ActionModel : Makes the first test only.

    Notes
    -----
    A trial must pass four tests. The acceptance region of each is estimated from how people differ.

    1. **movement**: the dissimilarity to the model *after* alignment, `ActionModel.dissimilarity`.
    2. **course**: the same after linear normalisation alone, which keeps the timing of its parts.
    3. **duration**: the number of frames, as a ratio to the geometric mean.
    4. **energy**: the mean squared distance of the poses from their own mean, as a ratio to the
       geometric mean.

    Give ``groups``, such as subjects, whenever people come more than once: acceptance regions
    are then those of differences between people. Variation between people is accepted: copies
    at half or double speed are rejected only where people agree on the duration of the action.

    Gaps (NaN) are accepted if the pipeline accepts them. Movement, course and energy are those of
    what was seen.

    The detector has no ``score``, as one kind of trial alone cannot tell whether it is right. A
    search needs a scorer, and trials that are to be refused. This one is the balanced accuracy. It
    can be compared between all ``n_frames``, features and scalings:

    Examples
    --------
    >>> from sklearn.model_selection import GridSearchCV, GroupKFold
    >>> others = [x[::-1] for x in bunch.data]
    >>> def balanced_accuracy(detector, X, y=None):
    ...     accepted, refused = detector.predict(X) == 1, detector.predict(others) == -1
    ...     return (accepted.mean() + refused.mean()) / 2
    >>> search = GridSearchCV(
    ...     detector, {"coverage": [0.5, 0.95]}, cv=GroupKFold(3), scoring=balanced_accuracy
    ... )
    >>> search.fit(bunch.data, groups=bunch.actor).best_params_
    {'coverage': 0.95}
    """

    _parameter_constraints: dict = {
        "estimator": [HasMethods(["fit"])],
        "coverage": [Interval(Real, 0, 1, closed="neither")],
        "duration": ["boolean"],
    }

    def __init__(
        self, estimator: BaseEstimator, coverage: float = 0.95, duration: bool = True
    ) -> None:
        self.estimator = estimator
        self.coverage = coverage
        self.duration = duration

    @atomic_fit
    @validated_with_nested
    def fit(
        self, X: PerformancesLike, y: object = None, groups: Labels | None = None, **params: Any
    ) -> Self:
        """Fit the pipeline, and estimate the acceptance regions.

        Parameters
        ----------
        X : performances
            As the pipeline takes them.
        y : array-like, default=None
            Passed to the pipeline; ignored by the detector.
        groups : array-like, shape (n_sequences,), default=None
            The subject of each performance, or what else makes performances resemble each other.
            The model of the pipeline gets them, too. By default every performance is a group of
            its own.
        **params : dict
            What the ``fit`` of the pipeline takes besides: by the names of steps, or routed
            metadata.

        Returns
        -------
        self : ActionDetector
            The fitted detector.

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
        with self._progress(fits=True) as progress:
            with progress.fitting(self.estimator_, "fitting the pipeline"):
                self.estimator_.fit(X, y, **given, **params)
            before, synchronizer = find_synchronizer(self.estimator_)
            also = {name.rpartition("__")[2]: value for name, value in params.items()}
            steps = [] if before is None else flat_steps(before)
            taken = [accepted_params(step.transform, also) for step in steps]
            also = {name: value for params in taken for name, value in params.items()}
            reached = route_to_synchronizer(self.estimator_, X, also, "ActionDetector.fit")
            self._learn(reached.performances, synchronizer, groups)
        for name in ("n_features_in_", "feature_names_in_"):
            if hasattr(self.estimator_, name):
                setattr(self, name, getattr(self.estimator_, name))
        return self

    @snapshot
    def predict(self, X: PerformancesLike, **params: Any) -> np.ndarray:
        """Whether performances are the action.

        Parameters
        ----------
        X : performances
            As the pipeline takes them.
        **params : dict
            What steps take besides in ``transform``, such as ``keyframes``.

        Returns
        -------
        ndarray of int, shape (n_sequences,)
            1 if all tests are passed, else -1.
        """
        return np.where(self._largest_statistic(X, params, "predict") <= 1, 1, -1)

    @snapshot
    def decision_function(self, X: PerformancesLike, **params: Any) -> np.ndarray:
        """Distance of the largest test statistic of performances from its limit.

        Parameters
        ----------
        X : performances
            As the pipeline takes them.
        **params : dict
            What steps take besides in ``transform``, such as ``keyframes``.

        Returns
        -------
        ndarray, shape (n_sequences,)
            ``score_samples`` less ``offset_``: negative for performances that are rejected.
        """
        return 1 - self._largest_statistic(X, params, "decision_function")

    @snapshot
    def score_samples(self, X: PerformancesLike, **params: Any) -> np.ndarray:
        """The largest absolute test statistic of performances, negated.

        Parameters
        ----------
        X : performances
            As the pipeline takes them.
        **params : dict
            What steps take besides in ``transform``, such as ``keyframes``.

        Returns
        -------
        ndarray, shape (n_sequences,)
            At least ``offset_`` for performances that are accepted.
        """
        return -self._largest_statistic(X, params, "score_samples")

    @snapshot
    def report(self, X: PerformancesLike, **params: Any) -> pd.DataFrame:
        """The test statistics of performances, and the reason for a rejection.

        Parameters
        ----------
        X : performances
            As the pipeline takes them.
        **params : dict
            What steps take besides in ``transform``, such as ``keyframes``.

        Returns
        -------
        DataFrame, one row a performance
            ``movement`` and ``course`` in units of their limit: 0 is equal, up to 1 accepted.
            ``duration`` (if it counts) and ``energy``: 0 is the mean, -1 to 1 accepted, below are
            those that are too short or too weak. ``reason`` of a rejection, such as "too long,
            too weak"; empty if the performance is accepted.
        """
        table, performances = self._test(X, params, "report")
        labels, levels = labels_of_input(X, performances)
        table = pd.DataFrame(table, index=index_of(labels, levels[:-1]))
        table["reason"] = [_reason(row) for row in table.to_dict("records")]
        return table

    def get_metadata_routing(self):
        """The metadata that the detector requests, and routes to its pipeline.

        Returns
        -------
        MetadataRouter
            As scikit-learn's meta-estimators return it.
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
        tags.input_tags.allow_nan = takes_gaps(self.estimator)
        return tags

    def _check_steps(self):
        """The name of the model's groups in the ``fit`` of the clone."""
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
        """Estimate acceptance regions from performances as the synchronizer gets them."""
        codes, _ = encode_groups(groups, len(performances), at_least=2)
        on_clock = synchronizer.normalize(performances)
        coverage = 1 - (1 - self.coverage) / (4 if self.duration else 3)
        _, model = find_step(self.estimator_, ActionModel)
        self._unaligned = ActionModel(coverage=coverage).fit(on_clock, groups=codes)
        self.borders_ = {
            "movement": (0.0, model.threshold_at(coverage)),
            "course": (0.0, self._unaligned.threshold_),
        }
        measures = {"duration": _durations(performances)} if self.duration else {}
        measures["energy"], self._energy_floor = movement_energies(on_clock)
        self._intervals = {
            name: LogPredictionInterval(values, codes, coverage)
            for name, values in measures.items()
        }
        self.borders_ |= {name: (i.lower, i.upper) for name, i in self._intervals.items()}
        self.offset_ = -1.0

    def _test(self, X, params, method):
        """Test statistics by name, (n_sequences,) each, and the synchronizer's performances."""
        check_is_fitted(self)
        caller = f"ActionDetector.{method}"
        try:
            reached = route_to_synchronizer(self.estimator_, X, params, caller, uses=("transform",))
            performances = reached.performances
            first = 0 if reached.before is None else len(flat_steps(reached.before))
            synchronised = performances
            for step in flat_steps(self.estimator_)[first:-1]:
                synchronised = step.transform(
                    synchronised, **accepted_params(step.transform, params)
                )
        except MissingMetadata as error:
            reason, name, _ = error.args
            raise MissingMetadata(reason, name, f"{caller}(X, {{name}}=[...])") from error
        _, model = find_step(self.estimator_, ActionModel)
        on_clock = reached.synchronizer.normalize(performances)
        measures = {
            "duration": _durations(performances),
            "energy": movement_energies(on_clock, self._energy_floor)[0],
        }
        statistics = {
            "movement": model.dissimilarity(synchronised) / self.borders_["movement"][1],
            "course": self._unaligned.dissimilarity(on_clock) / self._unaligned.threshold_,
        }
        for name, interval in self._intervals.items():
            statistics[name] = interval.standardize(measures[name])
        return statistics, performances

    def _largest_statistic(self, X, params, method):
        statistics, _ = self._test(X, params, method)
        return np.max(np.abs(list(statistics.values())), axis=0)


def _durations(performances):
    return np.array([len(x) for x in performances], dtype=np.float64)


def _reason(row):
    """The reason for the rejection of a performance with these statistics."""
    reasons = {
        name: _REASONS[name][int(value > 0)] for name, value in row.items() if abs(value) > 1
    }
    if "movement" in reasons:
        # Another movement has another course.
        reasons.pop("course", None)
    return ", ".join(reasons.values())


class LogPredictionInterval:
    """Prediction interval of positive values of new people, by their logarithms.

    Its middle is the mean logarithm; its width follows from the deviations of values from the mean
    of the other groups.

    Parameters
    ----------
    values : ndarray (n_sequences,)
        Above 0.
    groups : ndarray of int (n_sequences,)
        From 0, at least two different ones.
    coverage : float
        Share of new values in the interval.

    Attributes
    ----------
    lower, upper : float
    """

    def __init__(self, values, groups, coverage):
        logs, n = np.log(values), len(values)
        self._mean = float(logs.mean())
        # The uncertainty of the mean of the others is in the deviations, and in the limit.
        sums, counts = sums_of_groups(logs, groups)
        of_others = (logs.sum() - sums[groups]) / (n - counts[groups])
        deviations = (logs - of_others) * np.sqrt((n - 1) / (n + 1))
        squares = np.square(deviations).sum()
        self._half_width = t_prediction_limit(n, squares, (1 + coverage) / 2)
        ends = np.exp([self._mean - self._half_width, self._mean + self._half_width])
        self.lower, self.upper = map(float, ends)

    def standardize(self, values):
        """Values on the scale on which the interval is -1 to 1."""
        return (np.log(values) - self._mean) / self._half_width
