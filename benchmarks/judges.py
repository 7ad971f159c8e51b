"""Who tells the action from other things: the models of this package, and detectors of others.

A judge learns from the training performances of a fold and says of everything that is tried how far
inside its border it lies: ``judge(fold)`` gives {setting: {kind: decisions}}, below 0 outside.
Those of other packages see what is usual, performances stretched to one length, and get a border
that is found as ours is: every training performance is judged by what has learnt from the other
actors, and `border_of` says what is to be expected of a new one. Their own borders are of little
use here, as they accept between a quarter and all of the right performances.
"""

import importlib.metadata
from functools import partial

import numpy as np
from negatives import Fold, P
from scipy.stats import t as student
from sklearn.ensemble import IsolationForest
from sklearn.model_selection import LeaveOneGroupOut
from sklearn.neighbors import LocalOutlierFactor
from sklearn.pipeline import make_pipeline
from sklearn.svm import OneClassSVM
from sklearn_motionsync import ActionDetector, ActionModel, DenseSynchronizer, LinearSynchronizer

COVERAGE = 0.95

# -- ours -------------------------------------------------------------------------------


def action_model(fold: Fold):
    """Nearest neighbours among synchronised performances."""
    model = ActionModel(coverage=COVERAGE).fit(fold.on_clock, groups=fold.groups)
    return {"": {kind: model.decision_function(X) for kind, X in fold.synchronised.items()}}


def density(fold: Fold):
    """A root-mean-square deviation of at most three standard deviations."""
    model = ActionModel(n_std=3.0).fit(fold.on_clock)
    most = model.score_samples(model.mean_[np.newaxis])

    def decisions(X):
        squares = 2 * (most - model.score_samples(X)) / model.mean_.size
        return model.n_std - np.sqrt(np.maximum(squares, 0))

    return {"": {kind: decisions(X) for kind, X in fold.synchronised.items()}}


def action_detector(fold: Fold, duration):
    """The action model, and what synchronisation takes away."""
    pipeline = make_pipeline(DenseSynchronizer(P), ActionModel())
    detector = ActionDetector(pipeline, COVERAGE, duration).fit(fold.train, groups=fold.groups)
    return {"": {kind: detector.decision_function(X) for kind, X in fold.raw.items()}}


DENSITY = "the density, 3 standard deviations"
MODEL, DETECTOR = "`ActionModel`", "`ActionDetector`"
OURS = {
    DENSITY: density,
    MODEL: action_model,
    "`ActionDetector(duration=False)`": partial(action_detector, duration=False),
    DETECTOR: partial(action_detector, duration=True),
}

# -- of scikit-learn --------------------------------------------------------------------

TREES = 20


def lof(n_performances, n_neighbors):
    return LocalOutlierFactor(n_neighbors=min(n_neighbors, n_performances - 1), novelty=True)


def one_class_svm(n_performances, nu, gamma):
    return OneClassSVM(nu=nu, gamma=gamma)


def isolation_forest(n_performances, max_features):
    return IsolationForest(n_estimators=TREES, max_features=max_features, random_state=0)


def flat_judge(make, settings, fold: Fold):
    """A detector of points, on the numbers of the stretched performances."""
    train = as_points(fold.train)
    tried = {kind: as_points(some) for kind, some in fold.raw.items()}
    return {
        ", ".join(f"{k}={v}" for k, v in one.items()): _calibrated(
            partial(_learnt, partial(make, **one)), train, fold.groups, tried
        )
        for one in settings
    }


def border_of(left_out):
    """The bound of a new value with the nominal coverage, of values above 0 that are log-normal.

    Ours besides knows what spread is usual; of these nobody does.
    """
    logs, n = np.log(left_out), len(left_out)
    reach = student.ppf(COVERAGE, n - 1) * np.sqrt(1 + 1 / n)
    return np.exp(logs.mean() + reach * logs.std(ddof=1))


def as_points(performances):
    """Performances stretched to one length, a row of numbers each."""
    return LinearSynchronizer(P).fit_transform(performances).reshape(len(performances), -1)


def _learnt(make, X):
    """A function that tells how unlike rows are, above 0: of a detector that has learnt."""
    detector = make(len(X)).fit(X)
    if isinstance(detector, OneClassSVM):
        # Its score is a sum of Gaussian kernels: the logarithm makes a squared distance of it.
        tiny = np.finfo(float).tiny
        most = np.log(np.sum(detector.dual_coef_))
        return lambda Y: most - np.log(np.maximum(detector.score_samples(Y), tiny))
    return lambda Y: -detector.score_samples(Y)


def _calibrated(learn, train, groups, tried):
    """Decisions of a detector with the border that its judgements of left-out actors give."""
    left_out = np.empty(len(train))
    for known, unknown in LeaveOneGroupOut().split(train, groups=groups):
        left_out[unknown] = learn(train[known])(train[unknown])
    border, unlike = border_of(left_out), learn(train)
    return {kind: border - unlike(X) for kind, X in tried.items()}


# -- nearest neighbours by DTW ----------------------------------------------------------

DTW_FRAMES = 50
DTW_WINDOWS = (None, 6)
DTW_NEIGHBOURS = (1, 3)


def dtw_neighbours(fold: Fold):
    """The mean distance to the nearest training performances, stretched to 50 frames."""
    found = {}
    for centred in (False, True):
        train = _sequences(fold.train, centred)
        tried = {kind: _sequences(some, centred) for kind, some in fold.raw.items()}
        for window in DTW_WINDOWS:
            among = _distances(train, train, window)
            among[fold.groups[:, np.newaxis] == fold.groups] = np.inf
            to_train = {kind: _distances(X, train, window) for kind, X in tried.items()}
            for k in DTW_NEIGHBOURS:
                border = border_of(_nearest(among, k))
                setting = f"k={k}, window={window}" + (", own mean removed" if centred else "")
                found[setting] = {kind: border - _nearest(d, k) for kind, d in to_train.items()}
    return found


def _sequences(performances, centred):
    X = LinearSynchronizer(DTW_FRAMES).fit_transform(performances).astype(float)
    return X - X.mean(axis=1, keepdims=True) if centred else X


def _distances(X, Y, window):
    from dtaidistance import dtw_ndim

    return np.array([[dtw_ndim.distance(x, y, use_c=True, window=window) for y in Y] for x in X])


def _nearest(distances, k):
    """The mean of the k smallest that are finite, of every row."""
    nearest = np.sort(distances, axis=1)[:, :k]
    return np.nanmean(np.where(np.isfinite(nearest), nearest, np.nan), axis=1)


PEERS = {
    "LOF": partial(flat_judge, lof, [{"n_neighbors": k} for k in (3, 5, 10)]),
    "OneClassSVM": partial(
        flat_judge,
        one_class_svm,
        [{"nu": nu, "gamma": gamma} for nu in (0.05, 0.5) for gamma in ("scale", "auto")],
    ),
    "IsolationForest": partial(
        flat_judge, isolation_forest, [{"max_features": m} for m in (1.0, 0.1)]
    ),
    "DTW neighbours": dtw_neighbours,
}


def version_of(package):
    """The version of a package, or None where it is not installed."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def judges():
    """All judges by name, ours first; those of packages that are not installed are left out."""
    found = OURS | PEERS
    if version_of("dtaidistance") is None:
        del found["DTW neighbours"]
    return found
