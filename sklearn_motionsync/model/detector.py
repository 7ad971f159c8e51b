"""ActionDetector: whether trials as they were recorded are the action, and why not."""

from __future__ import annotations

from functools import partial
from numbers import Real
from typing import Any, Literal, NamedTuple, Self

import numpy as np
import pandas as pd
from sklearn import get_config
from sklearn.base import BaseEstimator, MetaEstimatorMixin, clone
from sklearn.utils._param_validation import HasMethods, Interval, StrOptions
from sklearn.utils.metadata_routing import MetadataRouter, MethodMapping
from sklearn.utils.validation import check_is_fitted

from ..body.limbs import PARTS, names_of_cosines
from ..body.mirror import exchange_of_sides
from ..inputs.types import Labels, TrialsLike
from ..matching.counting import first_largest
from ..matching.gaps import fill_with_mean
from ..utils.groups import encode_groups, group_counts
from ..utils.parallel import LongWorkMixin
from ..utils.parameters import validated_with_nested
from ..utils.pipelines import (
    accepted_params,
    flat_steps,
    matches_of_a_fit,
    remembered_matches,
    steps_to_fit,
    takes_gaps,
)
from .acceptance import (
    Acceptance,
    Contrast,
    LogPredictionInterval,
    backwards,
    dissimilarity_tails,
)
from .action_model import ActionModel
from .similarity import PersonalReference, TrialStream, movement_energies, warn_of_reference
from .views import curves_of

# Reasons for the rejection of a trial below, or above, the accepted interval.
_REASONS = {
    "movement": (None, "another movement"),
    "own": (None, "unlike the reference"),
    "course": (None, "another course"),
    "duration": ("too short", "too long"),
    "energy": ("too weak", "too strong"),
    "mirror": (None, "the other side"),
    "arms": (None, "the other arm"),
    "reversal": (None, "the other way"),
}
_TWO_SIDED = "duration", "energy"
# A statistic beyond so many times its limit is a rejection, whatever the others are.
_ALONE = 1.5


class ActionDetector(LongWorkMixin, MetaEstimatorMixin, BaseEstimator):
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
        Share of trials of new people that ``predict`` is to accept, between 0 and 1.
        It replaces the coverage of the model.
    duration : bool, default=True
        Whether the number of frames counts. Frames are time only if all trials have one
        frame rate, in ``fit`` and after it, and are cut where the action begins and ends: else
        give False, or resample them to one rate.
    sides : bool or "auto", default="auto"
        Whether it matters on which side of the body the movement is done. ``"auto"``: if the
        training set shows that it does.

    Attributes
    ----------
    estimator_ : Pipeline
        The fitted clone.
    borders_ : dict of str to (float, float)
        The interval of each test beyond which it is a reason for a rejection: of dissimilarities,
        frames, and squared features.
    images_ : list of str
        The images that the movement clearly differs from: ``"mirror"``, ``"arms"``, ``"reversal"``.
    offset_ : float
        The threshold of ``score_samples``, -1.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    ActionModel : Makes the first test only.
    find_departures : The reasons for a rejection: which limb, when, and how far.

    Notes
    -----
    Four tests are learnt from how people differ, each by leaving people out.

    1. **movement**: the dissimilarity after alignment, `ActionModel.dissimilarity`. With an
       `ASpace` in the pipeline it is that of whole poses, with what the aSpace leaves out.
    2. **course**: the same after linear normalisation alone, which keeps the timing of its parts.
    3. **duration**: the number of frames, as a ratio to the geometric mean.
    4. **energy**: the mean squared distance of the poses from their own mean, as a ratio to the
       geometric mean.

    Each gives the probability p of a deviation as large. Their score is
    ``sqrt(- log p_movement - 0.15 (log p_course + log p_duration + log p_energy))``, Fisher's
    combination with weights. Its limit is learnt from the scores of trials of people left out, and
    reaches the two people farthest from the others. A trial is also refused if one test
    alone is one and a half times beyond its limit.

    Where the movement clearly differs from an image of itself, a trial that is more like the image
    is refused: **mirror** (left and right exchanged), **arms** (only the arms exchanged) and
    **reversal** (the way back). The first two need `DirectionCosines` in the pipeline, or poses
    from it. The contrast is the projection of a trial less its image on the mean of such
    differences. It counts if its mean is at least twice its standard deviation.

    With good trials of the person as ``reference``, **own** is one more test: the dissimilarity to
    the most similar of them. Their mean is first moved towards that of all people, by the variances
    within and between people. The limit is that of training trials compared with as many others of
    the same person, so some ``groups`` need several trials. It has weight 1, and all others 0.15.

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
        "sides": ["boolean", StrOptions({"auto"})],
    }

    def __init__(
        self,
        estimator: BaseEstimator,
        coverage: float = 0.95,
        duration: bool = True,
        sides: bool | Literal["auto"] = "auto",
    ) -> None:
        self.estimator = estimator
        self.coverage = coverage
        self.duration = duration
        self.sides = sides

    @validated_with_nested
    def fit(
        self, X: TrialsLike, y: object = None, groups: Labels | None = None, **params: Any
    ) -> Self:
        """Fit the pipeline, and estimate the acceptance regions.

        Parameters
        ----------
        X : trials
            As the pipeline takes them.
        y : array-like, default=None
            Passed to the pipeline; ignored by the detector.
        groups : array-like, shape (n_sequences,), default=None
            The subject of each trial, or what else makes trials resemble each other. The model of
            the pipeline gets them, too. By default every trial is a group of its own.
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
            If the pipeline does not end in an `ActionModel` or has no synchronizer, if ``sides``
            is True and there are no limbs with a left and a right, and as from its ``fit``.
        """
        pipeline = clone(self.estimator)
        name = _check_steps(pipeline)
        groups = params.pop(name, None) if groups is None else groups
        fit_params = params if groups is None else {**params, name: groups}
        with self._progress(fits=True) as progress:
            with progress.fitting(pipeline, "fitting the pipeline"), matches_of_a_fit() as matches:
                pipeline.fit(X, y, **fit_params)
            also = {name.rpartition("__")[2]: value for name, value in params.items()}
            takers = [getattr(step, "match", step.transform) for step in flat_steps(pipeline)[:-1]]
            accepted = [accepted_params(taker, also) for taker in takers]
            also = {name: value for params in accepted for name, value in params.items()}
            tests = self._learn(pipeline, X, also, groups, matches)
        self.estimator_, self._tests = pipeline, tests
        self.borders_ = {
            "movement": (0.0, tests.aligned.threshold_),
            "course": (0.0, tests.unaligned.threshold_),
            **{name: (each.lower, each.upper) for name, each in tests.intervals.items()},
        }
        self.images_ = [name for name in _REASONS if name in tests.contrasts]
        self.offset_ = -1.0
        return self

    @property
    def n_features_in_(self) -> int:
        """Features of a frame (columns, for 2-D input)."""
        return self.estimator_.n_features_in_

    @property
    def feature_names_in_(self) -> np.ndarray:
        """Names of the features; only if the input had names."""
        return self.estimator_.feature_names_in_

    def predict(
        self, X: TrialsLike, reference: TrialsLike | None = None, **params: Any
    ) -> np.ndarray:
        """Whether trials are the action.

        Parameters
        ----------
        X : trials
            As the pipeline takes them.
        reference : trials, as the pipeline takes them, default=None
            Good ones of the person that X is of, two to five. It needs training groups with several
            trials. If the detector refuses most of them, a `SynchronizationWarning` says so.
        **params : dict
            What steps take besides in ``transform``, such as ``keyframes``.

        Returns
        -------
        ndarray of int, shape (n_sequences,)
            1 if the score is below its limit, and all contrasts are above theirs; else -1.
        """
        scores = self._test(X, reference, params, "ActionDetector.predict")[0]
        return np.where(scores <= 1, 1, -1)

    def decision_function(
        self, X: TrialsLike, reference: TrialsLike | None = None, **params: Any
    ) -> np.ndarray:
        """Distance of the score of trials from its limit.

        Parameters
        ----------
        X : trials
            As for ``predict``.
        reference : trials, default=None
            As for ``predict``.
        **params : dict
            As for ``predict``.

        Returns
        -------
        ndarray, shape (n_sequences,)
            ``score_samples`` less ``offset_``: negative for trials that are rejected.
        """
        return 1 - self._test(X, reference, params, "ActionDetector.decision_function")[0]

    def score_samples(
        self, X: TrialsLike, reference: TrialsLike | None = None, **params: Any
    ) -> np.ndarray:
        """The score of trials in units of its limit, negated.

        Parameters
        ----------
        X : trials
            As for ``predict``.
        reference : trials, default=None
            As for ``predict``.
        **params : dict
            As for ``predict``.

        Returns
        -------
        ndarray, shape (n_sequences,)
            At least ``offset_`` for trials that are accepted.
        """
        return -self._test(X, reference, params, "ActionDetector.score_samples")[0]

    def report(
        self, X: TrialsLike, reference: TrialsLike | None = None, **params: Any
    ) -> pd.DataFrame:
        """The test statistics of trials, and the reason for a rejection.

        Parameters
        ----------
        X : trials
            As for ``predict``.
        reference : trials, default=None
            As for ``predict``.
        **params : dict
            As for ``predict``.

        Returns
        -------
        DataFrame, one row a trial
            ``movement``, ``own`` (with a reference), ``course``, and the contrasts that count,
            ``mirror``, ``arms`` and ``reversal``, in units of their limit: up to 1 is usual.
            ``duration`` (if it counts) and ``energy``: 0 is the mean, -1 to 1 usual, below are
            those that are too short or too weak. ``score``: up to 1 is accepted. ``reason`` of a
            rejection, such as "too long, too weak"; empty if the trial is accepted.
        """
        scores, facts, statistics, tails, acceptance = self._test(
            X, reference, params, "ActionDetector.report"
        )
        table = pd.DataFrame(statistics, index=facts.index)
        table["score"] = scores
        # What no test alone explains is that which adds most to the score.
        names, shares = list(tails), acceptance.shares(tails)
        reasons = []
        for i, score in enumerate(scores):
            of_one = {name: values[i] for name, values in statistics.items()}
            most = names[first_largest(shares[i])]
            reasons.append(_reason(of_one, most) if score > 1 else "")
        table["reason"] = reasons
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

    def _check_reference(self, reference, known, caller):
        """Warn if a reference is refused, unless the person does the movement the other way."""
        _, _, statistics, tails, acceptance = self._test(reference, None, {}, caller, known)
        contrasts = [values for name, values in statistics.items() if name in self._tests.contrasts]
        if not any(values.mean() > 1 for values in contrasts):
            warn_of_reference(acceptance.scores(tails) > 1)

    def _learn(self, pipeline, X, params, groups, matches):
        """All tests, by the training trials of a fitted pipeline."""
        curves = curves_of(pipeline, X, params, "ActionDetector.fit", matches)
        trials, synchronizer = curves.match.reached.trials, curves.match.reached.synchronizer
        codes, _ = encode_groups(groups, len(trials), at_least=2)
        coverage = 1 - (1 - self.coverage) / (4 if self.duration else 3)
        columns = _seen_columns(curves.whole, codes)
        whole, on_clock = curves.whole[..., columns], synchronizer.normalize(trials)
        aligned = ActionModel(coverage=coverage).fit(whole, groups=codes)
        unaligned = ActionModel(coverage=coverage).fit(on_clock, groups=codes)
        measures = {"duration": _durations(trials)} if self.duration else {}
        measures["energy"], energy_floor = movement_energies(on_clock)
        intervals = {
            name: LogPredictionInterval(values, codes, coverage)
            for name, values in measures.items()
        }
        tails = {
            name: dissimilarity_tails(model.dissimilarities_)
            for name, model in (("movement", aligned), ("course", unaligned))
        }
        for name, interval in intervals.items():
            tails[name] = interval.tails(interval.deviations)
        names = [curves.names[k] for k in columns]
        stream, _, is_kept = TrialStream.starting_at(whole[0]).extend(whole, codes)
        return _Tests(
            columns,
            aligned,
            unaligned,
            intervals,
            energy_floor,
            Acceptance(tails, codes, self.coverage),
            self._learn_contrasts(whole, aligned.mean_, names, codes),
            stream,
            {name: values[is_kept] for name, values in tails.items()},
        )

    def _learn_contrasts(self, whole, mean, names, codes):
        """Contrasts to images of the action that count, by their names."""
        exchanges = {"reversal": backwards}
        cosines = names_of_cosines(whole, names)
        if self.sides is not False and cosines is not None:
            arms = [limb for arm in ("left arm", "right arm") for limb in PARTS[arm]]
            for name, limbs in (("mirror", None), ("arms", arms)):
                exchange = exchange_of_sides(cosines, limbs)
                if exchange is not None:
                    columns, signs = exchange
                    exchanges[name] = partial(_exchanged, columns, signs)
        if self.sides is True and len(exchanges) == 1:
            raise ValueError(
                "sides=True needs limbs with a left and a right: put a DirectionCosines before the "
                f"synchronizer. The features are {', '.join(names[:4])}, ..."
            )
        filled = fill_with_mean(whole, mean)
        contrasts = {name: Contrast(filled, e, codes) for name, e in exchanges.items()}
        always = () if self.sides == "auto" else ("mirror", "arms")
        return {
            name: c
            for name, c in contrasts.items()
            if c.is_clear or (name in always and c.middle > 0)
        }

    def _test(self, X, reference, params, caller, known=None):
        """Scores of trials, their facts, and what their reasons are found in."""
        check_is_fitted(self)
        tests = self._tests
        curves = curves_of(self.estimator_, X, params, caller, known)
        whole, reached = curves.whole[..., tests.columns], curves.match.reached
        of_person = None
        if reference is not None:
            known_of_theirs = remembered_matches().get("reference", {})
            theirs = curves_of(self.estimator_, reference, {}, caller, known_of_theirs)
            self._check_reference(reference, theirs.known, caller)
            of_person = fill_with_mean(theirs.whole[..., tests.columns], tests.aligned.mean_)
        trials = reached.trials
        on_clock = reached.synchronizer.normalize(trials)
        statistics, tails, acceptance = {}, {}, tests.acceptance

        def compare(name, dissimilarity, held_out, limit):
            statistics[name] = dissimilarity / limit
            tails[name] = dissimilarity_tails(held_out, dissimilarity)

        model = tests.aligned
        compare("movement", model.dissimilarity(whole), model.dissimilarities_, model.threshold_)
        if of_person is not None:
            stream = tests.stream
            training, of_person = (x.astype(np.float64) for x in (stream.kept, of_person))
            person = PersonalReference(training, stream.groups, stream.mean, of_person)
            is_compared = np.isfinite(person.held_out)
            held_out, dissimilarity = person.held_out[is_compared], person.dissimilarity(whole)
            compare("own", dissimilarity, held_out, person.limit(model.coverage))
            held = {name: values[is_compared] for name, values in tests.kept_tails.items()}
            held["own"] = dissimilarity_tails(held_out)
            acceptance = Acceptance(held, stream.groups[is_compared], self.coverage, main="own")
        model = tests.unaligned
        compare("course", model.dissimilarity(on_clock), model.dissimilarities_, model.threshold_)
        measures = {
            "duration": _durations(trials),
            "energy": movement_energies(on_clock, tests.energy_floor)[0],
        }
        for name, interval in tests.intervals.items():
            statistics[name] = interval.standardize(measures[name])
            tails[name] = interval.tails(statistics[name])
        scores = acceptance.scores(tails)
        # A person may differ from others, but not from the reference.
        alone = [
            values for name, values in statistics.items() if of_person is None or name != "movement"
        ]
        far = np.abs(alone).max(axis=0) / _ALONE
        filled = fill_with_mean(whole, tests.aligned.mean_)
        for name, contrast in tests.contrasts.items():
            if of_person is not None and contrast.standardize(of_person).mean() > 1:
                # The person does it the other way.
                continue
            statistics[name] = contrast.standardize(filled)
            # More like the image than like the action.
            far = np.maximum(far, statistics[name])
        scores = np.where(far > 1, np.maximum(scores, far), scores)
        return scores, curves.facts, statistics, tails, acceptance


def _check_steps(pipeline):
    """The name of the model's groups in the ``fit`` of a pipeline, which requests them."""
    steps = steps_to_fit(pipeline)
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


class _Tests(NamedTuple):
    """What is learnt of training trials, for the tests of others.

    Attributes
    ----------
    columns : ndarray of int
        The features that are compared.
    aligned, unaligned : ActionModel
        Of trials after alignment, and after linear normalisation alone.
    intervals : dict of str to LogPredictionInterval
        Of durations, if they count, and energies.
    energy_floor : float
        The energy of standing still.
    acceptance : Acceptance
    contrasts : dict of str to Contrast
        To the images that count.
    stream : TrialStream
        Those that a reference is judged by, at most 64.
    kept_tails : dict of str to ndarray (n_kept,)
        Their log-probabilities in each test.
    """

    columns: np.ndarray
    aligned: ActionModel
    unaligned: ActionModel
    intervals: dict
    energy_floor: float
    acceptance: Acceptance
    contrasts: dict
    stream: TrialStream
    kept_tails: dict


def _exchanged(columns, signs, trials):
    return signs * trials[..., columns]


def _seen_columns(whole, codes):
    """Features of which two groups show every frame: all, unless there are gaps."""
    n_groups = (group_counts(whole, codes) > 0).sum(axis=0)
    return np.flatnonzero(n_groups.min(axis=0) > 1)


def _durations(trials):
    return np.array([len(x) for x in trials], dtype=np.float64)


def _reason(statistics, most):
    """The reason for the rejection of a trial: the tests beyond their limits, or that one."""
    sizes = {k: abs(v) if k in _TWO_SIDED else v for k, v in statistics.items()}
    beyond = [name for name, size in sizes.items() if size > 1]
    beyond = beyond or [most]
    if "movement" in beyond:
        # Another movement has another course.
        beyond = [name for name in beyond if name != "course"]
    return ", ".join(_REASONS[name][int(statistics[name] > 0)] for name in beyond)
