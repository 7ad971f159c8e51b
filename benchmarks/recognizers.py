"""Who tells actions from each other: the classifier of this package, and other ways.

A recognizer is bound to recordings and takes indices of them: what it learns from, and what it is
asked about. Other ways are functions ``decide(train, test)`` that give classes and scores
(n_test, n_classes), the larger the more like the class; `Scored` makes probabilities of scores
with one temperature, learnt of people left out, and calls new what has no large score. `WAYS` give
for a view and a length, to which performances are stretched where a way needs one length,
{name: {setting: recognizer}}. Ways of packages that are not installed are left out.
"""

import warnings
from functools import partial
from typing import NamedTuple

import numpy as np
from judges import version_of
from scipy.optimize import minimize_scalar
from scipy.special import log_softmax, softmax
from sklearn.linear_model import RidgeClassifierCV
from sklearn.model_selection import LeaveOneGroupOut
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC
from sklearn_motionsync import (
    ActionClassifier,
    ActionModel,
    DenseSynchronizer,
    DirectionCosines,
    JointPositions,
    LinearSynchronizer,
)

# -- recordings -------------------------------------------------------------------------

COSINES, POSITIONS, BOTH = VIEWS = ("cosines", "positions", "cosines + positions")


class Recordings(NamedTuple):
    """Performances (n_frames_i, n_features) by view, what is done in them, and by whom."""

    name: str
    views: dict
    actions: np.ndarray
    actors: np.ndarray

    def some(self, view, chosen):
        """The performances of some indices."""
        return [self.views[view][i] for i in chosen]


def as_recordings(name, bunch):
    """Every posture as 37 cosines, as 14 joints seen from the pelvis, and as both in a row."""
    cosines = list(DirectionCosines(bunch.skeleton).fit_transform(bunch.data))
    positions = list(JointPositions(bunch.skeleton).fit_transform(bunch.data))
    both = [np.hstack(pair) for pair in zip(cosines, positions, strict=True)]
    views = dict(zip(VIEWS, (cosines, positions, both), strict=True))
    return Recordings(name, views, np.asarray(bunch.target), np.asarray(bunch.actor))


def on_clock(recordings, view, n_frames):
    """(n, n_frames, n_features), stretched to one length."""
    return LinearSynchronizer(n_frames).fit_transform(recordings.views[view]).astype(float)


# -- ours -------------------------------------------------------------------------------


class Classifier:
    """`ActionClassifier` with its defaults, which knows who performs what it learns from."""

    tempered = True

    def __init__(self, recordings, view):
        self._recordings, self._view = recordings, view

    def predict(self, train, test):
        """Actions of performances (n_test,)."""
        return self.learnt(train).predict(self._recordings.some(self._view, test))

    def probabilities(self, train, test):
        """Classes, and their probabilities (n_test, n_classes)."""
        model = self.learnt(train)
        return model.classes_, model.predict_proba(self._recordings.some(self._view, test))

    def novelty(self, train, test):
        """The larger, the less like any class (n_test,)."""
        return -self.learnt(train).score_samples(self._recordings.some(self._view, test))

    def contrast(self, train, test):
        """The larger, the more like the second of two classes (n_test,)."""
        return self.learnt(train).decision_function(self._recordings.some(self._view, test))

    def learnt(self, train):
        """The classifier of some of the recordings."""
        actions, actors = self._recordings.actions[train], self._recordings.actors[train]
        # Of one person alone it cannot learn how people differ.
        groups = actors if len(set(actors)) > 1 else None
        return ActionClassifier().fit(self._recordings.some(self._view, train), actions, groups)


def classifier(recordings, view, n_frames):
    return {CLASSIFIER: {"": Classifier(recordings, view)}}


# -- scores, and what is made of them ---------------------------------------------------


class Scored:
    """A recognizer of a function ``decide(train, test)``: classes, scores (n_test, n_classes).

    Without a temperature, which takes as many fits as there are people, it is certain.
    """

    def __init__(self, recordings, decide, tempered=True):
        self._actions, self._actors = recordings.actions, recordings.actors
        self._decide, self.tempered = decide, tempered

    def predict(self, train, test):
        """Actions of performances (n_test,)."""
        classes, scores = self._decide(train, test)
        return classes[scores.argmax(axis=1)]

    def probabilities(self, train, test):
        """Classes, and their probabilities (n_test, n_classes)."""
        classes, scores = self._decide(train, test)
        if not self.tempered:
            return classes, np.eye(len(classes))[scores.argmax(axis=1)]
        return classes, softmax(self._slope(classes, train) * scores, axis=1)

    def novelty(self, train, test):
        """The larger, the less like any class (n_test,)."""
        return -self._decide(train, test)[1].max(axis=1)

    def contrast(self, train, test):
        """The larger, the more like the second of two classes (n_test,)."""
        return np.diff(self._decide(train, test)[1], axis=1)[:, 0]

    def _slope(self, classes, train):
        """Of everybody in the training set, when the others are learnt from."""
        scores = np.full((len(train), len(classes)), np.nan)
        for known, held in LeaveOneGroupOut().split(train, groups=self._actors[train]):
            seen, found = self._decide(train[known], train[held])
            scores[np.ix_(held, np.searchsorted(classes, seen))] = found
        # What nobody else does is thought of last.
        scores = np.where(np.isnan(scores), np.nanmin(scores), scores)
        return slope_of(scores, np.searchsorted(classes, self._actions[train]))


def slope_of(scores, targets):
    """One over the temperature: the factor of scores (n, n_classes) with the least log-loss."""
    below = scores - scores.max(axis=1, keepdims=True)
    unit, rows = np.abs(below).mean(), np.arange(len(targets))

    def loss(logarithm):
        return -log_softmax(np.exp(logarithm) / unit * below, axis=1)[rows, targets].mean()

    return np.exp(minimize_scalar(loss, bounds=(-7, 7), method="bounded").x) / unit


# -- the density under the model of each class ------------------------------------------


def densities(recordings, view, n_frames):
    """Log-densities of performances synchronised to every class in turn."""
    known: dict = {}

    def of_class(train, test):
        key = train.tobytes(), test.tobytes()
        if key not in known:
            pipe = make_pipeline(DenseSynchronizer(n_frames), ActionModel())
            pipe.fit(recordings.some(view, train))
            known[key] = pipe.score_samples(recordings.some(view, test))
        return known[key]

    def decide(train, test):
        labels = recordings.actions[train]
        each = [of_class(train[labels == c], test) for c in np.unique(labels)]
        return np.unique(labels), np.stack(each, axis=1)

    return {DENSITY: {"": Scored(recordings, decide, tempered=False)}}


# -- dynamic time warping ---------------------------------------------------------------

# With 1 all are worse, by 1 to 4 in 100; with 100 as good.
C = 10


def dtw(recordings, view, n_frames):
    """Nearest neighbours, and support vector machines on the kernel exp(-D / median D)."""
    points, derivatives = dtw_distances(on_clock(recordings, view, n_frames))

    def nearest(train, test):
        labels, D = recordings.actions[train], points[np.ix_(test, train)]
        each = [-D[:, labels == c].min(axis=1) for c in np.unique(labels)]
        return np.unique(labels), np.stack(each, axis=1)

    return {
        NEAREST: {"": Scored(recordings, nearest)},
        DTW_SVM: {"": machines(recordings, partial(mean_kernel, [points]))},
        DDTW_SVM: {"": machines(recordings, partial(mean_kernel, [points, derivatives]))},
    }


def dtw_distances(X):
    """Of all pairs, by points and by derivatives; roots of aeon's, as distances do better."""
    import aeon.distances

    X = np.ascontiguousarray(X.transpose(0, 2, 1))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        functions = aeon.distances.dtw_pairwise_distance, aeon.distances.ddtw_pairwise_distance
        return [np.sqrt(function(X)) for function in functions]


def mean_kernel(matrices, train):
    """(n, n) the mean of exp(-D / median D), medians over pairs of the training set."""
    pairs = np.triu_indices(len(train), 1)
    medians = [np.median(D[np.ix_(train, train)][pairs]) for D in matrices]
    return np.mean([np.exp(-D / m) for D, m in zip(matrices, medians, strict=True)], axis=0)


def machines(recordings, kernel):
    """One support vector machine a class against the rest, on ``kernel(train)`` of all with all."""

    def decide(train, test):
        K, labels = kernel(train), recordings.actions[train]
        among, to_train = K[np.ix_(train, train)], K[np.ix_(test, train)]
        each = [
            SVC(C=C, kernel="precomputed").fit(among, labels == k).decision_function(to_train)
            for k in np.unique(labels)
        ]
        return np.unique(labels), np.stack(each, axis=1)

    return Scored(recordings, decide)


# -- what does not warp -----------------------------------------------------------------


def pyramid(recordings, view, n_frames):
    """A linear support vector machine on a Fourier temporal pyramid."""
    X = fourier_pyramid(on_clock(recordings, view, n_frames))

    def kernel(scaled, train):
        Z = StandardScaler(with_std=scaled).fit(X[train]).transform(X)
        return Z @ Z.T / np.square(Z[train]).sum(axis=1).mean()

    settings = {"": False, "standardised": True}
    return {PYRAMID: {k: machines(recordings, partial(kernel, v)) for k, v in settings.items()}}


def fourier_pyramid(X, n_levels=3, n_frequencies=6):
    """Amplitudes of the lowest frequencies of the whole, its halves, its quarters, and so on.

    X is (n, P, n_features).
    """
    found = []
    for level in range(n_levels):
        for part in np.array_split(X, 2**level, axis=1):
            waves = np.fft.rfft(part, axis=1)[:, :n_frequencies] / part.shape[1]
            found.append(np.abs(waves).reshape(len(X), -1))
    return np.concatenate(found, axis=1)


def rocket(recordings, view, n_frames):
    """Ridge regression on MiniRocket's features, as in aeon's classifier.

    The thresholds of the features are those of all clips, the tested ones as well.
    """
    from aeon.transformations.collection.convolution_based import MiniRocket

    X = np.ascontiguousarray(on_clock(recordings, view, n_frames).transpose(0, 2, 1))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        X = np.asarray(MiniRocket(random_state=0).fit_transform(X.astype(np.float32)))

    def decide(train, test):
        ridge = RidgeClassifierCV(np.logspace(-3, 3, 10))
        pipe = make_pipeline(StandardScaler(with_mean=False), ridge)
        pipe.fit(X[train], recordings.actions[train])
        scores = pipe.decision_function(X[test])
        # Of two classes the library gives one column.
        return pipe.classes_, scores if scores.ndim > 1 else np.column_stack([-scores, scores])

    return {ROCKET: {"": Scored(recordings, decide)}}


# -- all of them ------------------------------------------------------------------------

CLASSIFIER, DENSITY = "`ActionClassifier`", "`ActionModel` of each class, log-density"
NEAREST, DTW_SVM, DDTW_SVM = "1-NN DTW", "SVM on DTW", "SVM on DTW and derivative DTW"
PYRAMID, ROCKET = "Fourier pyramid + SVM", "MiniRocket + ridge"
# The function, the views, the lengths, the package.
WAYS = [
    (dtw, VIEWS, (50,), "aeon"),
    (rocket, VIEWS, (50, 100), "aeon"),
    (classifier, (COSINES, BOTH), (None,), None),
    (densities, (COSINES, POSITIONS), (50,), None),
    (pyramid, VIEWS, (50, 100), None),
]


def ways():
    """(function, view, length) of everything that is installed; those that take long first."""
    return [
        (way, view, n_frames)
        for way, views, lengths, package in WAYS
        for view in views
        for n_frames in lengths
        if package is None or version_of(package) is not None
    ]
