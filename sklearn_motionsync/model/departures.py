"""Departures of performances from a model: runs of frames beyond a limit."""

from __future__ import annotations

from numbers import Real
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator

from ..inputs.features import choose_features
from ..inputs.types import Features, PerformancesLike
from ..utils.pipelines import find_synchronizer, route_to_synchronizer
from .views import models_of_classes, view_of

__all__ = ["find_departures"]


def find_departures(
    estimator: BaseEstimator,
    X: PerformancesLike,
    *,
    features: Features | None = None,
    limit: float | None = None,
    **params: Any,
) -> pd.DataFrame:
    """Departures of performances from a model: when, in which feature, and how far.

    A posture departs if its deviation from the mean exceeds a limit, in the standard deviations
    predicted for a *new person* (`ActionModel.standard_scores`). Postures include the residuals of
    an `ASpace`.

    Parameters
    ----------
    estimator : ActionModel, ActionClassifier, or Pipeline with one
        Fitted. With a classifier, the model is that of the class that is predicted before any
        rejection; these models are fitted by the call (`ActionClassifier.model_of`).
    X : performances
        As the estimator takes them.
    features : int, str or list of them, default=None
        Features of the model, or of the postures before its `ASpace`, by index or name. By default
        those of postures, if there is such an aSpace, otherwise all of the model.
    limit : float, default=None
        Largest deviation that is no departure, in standard deviations; by default ``n_std`` of the
        model. About half of all correct performances exceed 3 somewhere, few by much.
    **params : dict
        What synchronizing X takes besides, such as ``keyframes``.

    Returns
    -------
    DataFrame
        One row a run of frames, by performance and then the largest deviation first:
        ``performance``, its number or label, a tuple if an index has several levels; with a
        classifier ``class``, the predicted one; ``feature``; ``first`` and ``last``, frames of the
        model, counted from 0; ``peak``, the frame of the largest deviation; ``deviation``, in
        standard deviations, negative below the mean; ``rare``, whether it exceeds
        `ActionModel.simultaneous_factor`, which a share of ``coverage`` of the performances of new
        people does at no frame and in no feature; ``timing``, whether the clock may be the reason:
        inside the intervals of 90 % of its times (`Match.interval`) the performance has values
        within the limit. False where no `DenseSynchronizer` tells.

    Raises
    ------
    ValueError
        If there is no ActionModel, no such feature, or the limit is not above 0.

    See Also
    --------
    compare_to_norm : A verdict of each subject, also on timing.
    sklearn_motionsync.display.SkeletonDisplay.from_departures : Draws them as stick figures.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import ActionModel, find_departures
    >>> t = np.linspace(0, 1, 50)[:, np.newaxis]
    >>> model = ActionModel().fit([a * np.sin(3 * t) for a in (0.8, 0.9, 1.0, 1.1, 1.2)])
    >>> new = np.sin(3 * t)
    >>> new[20:25] += 3
    >>> find_departures(model, [np.sin(3 * t), new]).round(0)
       performance feature  first  last  peak  deviation  rare  timing
    0            1      x0     20    24    20       19.0  True   False
    """
    is_number = isinstance(limit, Real) and not isinstance(limit, bool)
    if limit is not None and not (is_number and 0 < limit < np.inf):
        raise ValueError(f"limit must be a number above 0, or None; got {limit!r}.")
    caller = "find_departures"
    models = models_of_classes(estimator, X, params, caller)
    if models is None:
        return _departures(estimator, X, params, caller, features, limit)
    # Params are those of the steps before a classifier; its models take none.
    parts = [
        _departures(part.estimator, part.performances, {}, caller, features, limit, part)
        for part in models
    ]
    order = np.concatenate(
        [part.indices[t.pop("index")] for part, t in zip(models, parts, strict=True)]
    )
    table = pd.concat(parts).iloc[np.argsort(order, kind="stable")]
    return table.reset_index(drop=True).infer_objects()


def _departures(estimator, X, params, caller, features, limit, part=None):
    """The table of one model; of the model of a class with the class, and indices in it."""
    view = view_of(estimator, X, params, caller, features=features, postures=features is None)
    names, scores, curves = view.names, view.scores, view.whole
    mean, std = view.model.mean_, view.predicted
    if features is not None:
        chosen = choose_features(features, names)
        names, scores, curves = (
            [names[i] for i in chosen],
            scores[:, :, chosen],
            curves[..., chosen],
        )
        mean, std = mean[:, chosen], std[:, chosen]
    limit = view.model.n_std if limit is None else limit
    found = runs(scores, limit)
    labels = view.labels if part is None else part.labels
    # A label may be a tuple, which an array would unpack.
    columns = {"performance": pd.Series([labels[i] for i in found.performance], dtype=object)}
    if part is not None:
        columns["class"] = np.full(len(found.first), part.label, dtype=object)
        columns["index"] = found.performance
    columns |= {
        "feature": np.array(names, dtype=object)[found.feature],
        "first": found.first,
        "last": found.last,
        "peak": found.peak,
        "deviation": found.score,
        "rare": np.abs(found.score) > view.model.simultaneous_factor(),
        "timing": np.zeros(len(found.first), dtype=bool),
    }
    match = _match_of(estimator, X, params) if len(found.first) else None
    if match is not None:
        bounds = mean - limit * std, mean + limit * std
        columns["timing"] = explained_by_timing(found, curves, *bounds, match)
    table = pd.DataFrame(columns)
    order = np.lexsort((found.first, found.feature, -np.abs(found.score), found.performance))
    return table.iloc[order].reset_index(drop=True).infer_objects()


def _match_of(estimator, X, params):
    """The match of performances, if a synchronizer of the estimator tells how sure it is."""
    try:
        find_synchronizer(estimator)
    except ValueError:
        return None
    match = route_to_synchronizer(estimator, X, params, "find_departures").match()
    return None if match.intervals is None else match


class Runs(NamedTuple):
    """Runs of consecutive frames beyond a limit, by performance, feature and frame.

    Attributes
    ----------
    performance, feature : ndarray of int, shape (n_runs,)
    first, last : ndarray of int, shape (n_runs,)
        The first and the last frame of the run.
    peak : ndarray of int, shape (n_runs,)
        The frame of the largest score, the first of several.
    score : ndarray, shape (n_runs,)
        The score there, with its sign.
    """

    performance: np.ndarray
    feature: np.ndarray
    first: np.ndarray
    last: np.ndarray
    peak: np.ndarray
    score: np.ndarray


def runs(scores, limit):
    """Runs of consecutive frames in which a feature's scores exceed a limit.

    Parameters
    ----------
    scores : ndarray, shape (n, P, n_features)
        Standard deviations from the mean.
    limit : float
        Positive, of absolute values.

    Returns
    -------
    Runs
    """
    scores = np.moveaxis(scores, 1, 2)
    size = np.abs(scores)
    edges = np.diff(size > limit, axis=2, prepend=False, append=False)
    # Each run gives two edges: its first frame and the one after its last.
    performance, feature, frame = (at.reshape(-1, 2).T for at in np.nonzero(edges))
    first, last = frame[0], frame[1] - 1
    lengths = last - first + 1
    of = np.repeat(np.arange(len(first)), lengths)
    frames = np.arange(len(of)) - np.repeat(np.cumsum(lengths) - lengths - first, lengths)
    inside = size[performance[0][of], feature[0][of], frames]
    # By run, the largest first, among equal ones the first frame.
    order = np.lexsort((frames, -inside, of))[np.cumsum(lengths) - lengths]
    peak = frames[order]
    score = scores[performance[0], feature[0], peak]
    return Runs(performance[0], feature[0], first, last, peak, score)


def explained_by_timing(found, curves, lower, upper, match):
    """Whether a wrong clock may be the reason of runs, (n_runs,).

    The time of every frame of the run may then be another one inside its interval, where the
    performance has values between the bounds.

    Parameters
    ----------
    found : Runs
    curves : ndarray, shape (n, P, n_features)
        Performances on the clock.
    lower, upper : ndarray, shape (P, n_features)
        Bounds of what is no departure.
    match : Match
        Of the performances.
    """
    n_frames, pairs = curves.shape[1], zip(match.times, *match.interval(), strict=True)
    # The frames of the clock whose times are inside the interval of a frame.
    spans = np.array([(t.searchsorted(a), t.searchsorted(b, "right")) for t, a, b in pairs])
    frames, explained = np.arange(n_frames), np.empty(len(found.first), dtype=bool)
    starts, ends = np.minimum(spans[:, 0], frames), np.maximum(spans[:, 1], frames + 1)
    for k, (i, feature) in enumerate(zip(found.performance, found.feature, strict=True)):
        own, run = curves[i, :, feature], frames[found.first[k] : found.last[k] + 1]
        seen = [own[starts[i, p] : ends[i, p]] for p in run]
        low, high = (np.array([extreme(x) for x in seen]) for extreme in (np.nanmin, np.nanmax))
        explained[k] = np.all((low <= upper[run, feature]) & (high >= lower[run, feature]))
    return explained
