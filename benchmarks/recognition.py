"""Which action it is, of people not seen: the classifier, and other ways.

    pip install . aeon
    python benchmarks/recognition.py DATA_FOLDER [actions] [rejected]

DATA_FOLDER holds hdm05/hdm05_positions.npz and utkinect of the same form, with
utkinect/utkinect_splits.json: ten halves of the actors to learn from, on which published results
stand. Nothing of `ActionClassifier` is chosen here. Every other way has the view (cosines,
positions or both) and the length that were the best of three views and two lengths by their result.
Ways of packages that are not installed are left out. Unknown actions are left out of the training
in turn: the area under the curve of the novelty of all test clips, mean over splits and actions.
*Rejected* is what ``reject_below="auto"`` rejects. Prints Markdown.

A recognizer is bound to recordings and takes indices of them: what it learns from, and what it is
asked about. Other ways are functions ``decide(train, test)`` that give classes and scores
(n_test, n_classes), the larger the more like the class; `Scored` calls new what has no large score.
"""

import json
import re
import warnings
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from harness import (
    command_line,
    percent,
    print_head,
    print_row,
    print_versions,
    run_tables,
    version_of,
)
from joblib import Parallel, delayed
from sklearn.linear_model import RidgeClassifierCV
from sklearn.metrics import roc_auc_score
from sklearn.model_selection import LeaveOneGroupOut
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC
from sklearn_motionsync import (
    ActionClassifier,
    DirectionCosines,
    JointPositions,
    LinearSynchronizer,
)
from sklearn_motionsync.datasets import load_trials

from model import SPOILT

# -- recordings -------------------------------------------------------------------------

COSINES, POSITIONS, BOTH = VIEWS = ("cosines", "positions", "cosines + positions")


class Recordings(NamedTuple):
    """Trials (n_frames_i, n_features) by view, what is done in them, and by whom."""

    name: str
    views: dict
    actions: np.ndarray
    actors: np.ndarray

    def some(self, view, chosen):
        """The trials of some indices."""
        return [self.views[view][i] for i in chosen]


def as_recordings(name, bunch):
    """Every pose as 37 cosines, as 14 joints seen from the pelvis, and as both in a row."""
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

    def __init__(self, recordings, view):
        self._recordings, self._view = recordings, view

    def predict(self, train, test):
        """Actions of trials (n_test,)."""
        return self.learnt(train).predict(self._recordings.some(self._view, test))

    def novelty(self, train, test):
        """The larger, the less like any class (n_test,)."""
        return -self.learnt(train).score_samples(self._recordings.some(self._view, test))

    def learnt(self, train):
        """The classifier of some of the recordings."""
        actions, actors = self._recordings.actions[train], self._recordings.actors[train]
        # Of one person alone it cannot learn how people differ.
        groups = actors if len(set(actors)) > 1 else None
        return ActionClassifier().fit(self._recordings.some(self._view, train), actions, groups)


# -- scores, and what is made of them ---------------------------------------------------


class Scored:
    """A recognizer of a function ``decide(train, test)``: classes, scores (n_test, n_classes)."""

    def __init__(self, decide):
        self._decide = decide

    def predict(self, train, test):
        """Actions of trials (n_test,)."""
        classes, scores = self._decide(train, test)
        return classes[scores.argmax(axis=1)]

    def novelty(self, train, test):
        """The larger, the less like any class (n_test,)."""
        return -self._decide(train, test)[1].max(axis=1)


# -- dynamic time warping ---------------------------------------------------------------

# With 1 all are worse, by 1 to 4 in 100; with 100 as good.
C = 10


def dtw_distances(recordings, view):
    """Roots of aeon's distances, which do better."""
    import aeon.distances

    X = np.ascontiguousarray(on_clock(recordings, view, 50).transpose(0, 2, 1))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return np.sqrt(aeon.distances.dtw_pairwise_distance(X))


def nearest_neighbour(recordings):
    D = dtw_distances(recordings, BOTH)

    def decide(train, test):
        labels, to_train = recordings.actions[train], D[np.ix_(test, train)]
        each = [-to_train[:, labels == c].min(axis=1) for c in np.unique(labels)]
        return np.unique(labels), np.stack(each, axis=1)

    return Scored(decide)


def machines_on_dtw(recordings):
    return machines(recordings, partial(kernel_of, dtw_distances(recordings, POSITIONS)))


def kernel_of(D, train):
    """exp(-D / median D) of all pairs (n, n), the median over pairs of the training set."""
    pairs = np.triu_indices(len(train), 1)
    return np.exp(-D / np.median(D[np.ix_(train, train)][pairs]))


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

    return Scored(decide)


# -- what does not warp -----------------------------------------------------------------


def pyramid(recordings):
    """A linear support vector machine on a Fourier temporal pyramid."""
    X = fourier_pyramid(on_clock(recordings, BOTH, 100))

    def kernel(train):
        centred = X - X[train].mean(axis=0)
        return centred @ centred.T / np.square(centred[train]).sum(axis=1).mean()

    return machines(recordings, kernel)


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


def rocket(recordings):
    """Ridge regression on MiniRocket's features, as in aeon's classifier.

    The thresholds of the features are those of all clips, the tested ones as well.
    """
    from aeon.transformations.collection.convolution_based import MiniRocket

    X = np.ascontiguousarray(on_clock(recordings, COSINES, 50).transpose(0, 2, 1))
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

    return Scored(decide)


# -- all of them ------------------------------------------------------------------------

# What makes a recognizer of recordings, and the package that it needs.
WAYS = {
    **{
        f"`ActionClassifier`, {view}": (partial(Classifier, view=view), None)
        for view in (COSINES, BOTH)
    },
    f"1-NN DTW, {BOTH}, 50 frames": (nearest_neighbour, "aeon"),
    f"SVM on DTW, {POSITIONS}, 50 frames": (machines_on_dtw, "aeon"),
    f"MiniRocket + ridge, {COSINES}, 50 frames": (rocket, "aeon"),
    f"Fourier pyramid + SVM, {BOTH}, 100 frames": (pyramid, None),
}


# -- folds ------------------------------------------------------------------------------


def published_splits(path, actors):
    """Indices of the training and of the test clips of every split; 1 is actor s01."""
    splits = json.loads(Path(path).read_text())
    numbers = np.array([int(re.search(r"\d+$", actor).group()) for actor in actors])
    halves = zip(splits["train_actors"], splits["test_actors"], strict=True)
    return [tuple(np.flatnonzero(np.isin(numbers, half)) for half in both) for both in halves]


def actors_left_out(actors):
    """Folds (train, test) with an actor each to be tested."""
    return list(LeaveOneGroupOut().split(actors, groups=actors))


# -- what is found on folds -------------------------------------------------------------

SPLITS, LEFT_OUT, AREA = "ten splits", "leave one subject out", "AUC of unknown actions"


def unknown_area(recognizer, actions, action, train, test):
    """How well the novelty tells an action that nothing was learnt of; NaN if nobody tests it."""
    unknown = actions[test] == action
    if unknown.all() or not unknown.any():
        return np.nan
    return roc_auc_score(unknown, recognizer.novelty(train[actions[train] != action], test))


def recognition_table(recordings, splits):
    """The shares that each way recognises, and how well it tells unknown actions."""
    print_head(recordings.name, [f"{SPLITS}, mean", "worst split", LEFT_OUT, AREA])
    left_out = actors_left_out(recordings.actors)
    for name, (make, package) in WAYS.items():
        if package is not None and version_of(package) is None:
            continue
        one = make(recordings)
        right, others = (
            [np.mean(one.predict(*fold) == recordings.actions[fold[1]]) for fold in folds]
            for folds in (splits, left_out)
        )
        areas = Parallel(n_jobs=-1)(
            delayed(unknown_area)(one, recordings.actions, action, train, test)
            for train, test in splits
            for action in np.unique(recordings.actions[train])
        )
        cells = [percent(x, 1) for x in (np.mean(right), np.min(right), np.mean(others))]
        print_row(name, [*cells, f"{np.nanmean(areas):.3f}"])


# -- what is rejected -------------------------------------------------------------------

KNOWN, UNKNOWN = "known actions", "an unknown action"


def rejected_on_split(recordings, train, test):
    """{kind: (novelties, border)} for ``reject_below="auto"``: known, spoilt, and unknown actions.

    Spoilt are the trials of the known actions; unknown is each action left out in turn.
    """
    ours = Classifier(recordings, COSINES)
    model, tried = ours.learnt(train), recordings.some(COSINES, test)
    border = -model.threshold_at(0.95)
    found = {kind: [spoil(x) for x in tried] for kind, spoil in {KNOWN: np.copy, **SPOILT}.items()}
    found = {kind: [(-model.score_samples(some), border)] for kind, some in found.items()}
    actions = recordings.actions
    for action in np.unique(actions[train]):
        some = test[actions[test] == action]
        if len(some):
            model = ours.learnt(train[actions[train] != action])
            novelties = -model.score_samples(recordings.some(COSINES, some))
            found.setdefault(UNKNOWN, []).append((novelties, -model.threshold_at(0.95)))
    return found


def rejection_table(recordings, splits, name):
    """What the classifier rejects on cosines."""
    head = f'`ActionClassifier(reject_below="auto")`, {recordings.name}, {name}'
    print_head(head, ["rejected"])
    work = [delayed(rejected_on_split)(recordings, *split) for split in splits]
    found = Parallel(n_jobs=-1)(work)
    for kind in found[0]:
        parts = [part for one in found for part in one[kind]]
        rejected = np.mean([np.mean(novelties > border) for novelties, border in parts])
        print_row(kind, [percent(rejected, 1)])


# -- all of it --------------------------------------------------------------------------


def rejection_tables(kinect, optical, splits):
    rejection_table(kinect, splits, SPLITS)
    for recordings in (kinect, optical):
        rejection_table(recordings, actors_left_out(recordings.actors), LEFT_OUT)


def read(folder):
    """UTKinect, HDM05, and the splits of UTKinect."""
    kinect, optical = (
        as_recordings(name, load_trials(folder / archive / f"{archive}_positions.npz"))
        for archive, name in (("utkinect", "UTKinect"), ("hdm05", "HDM05"))
    )
    splits = published_splits(folder / "utkinect" / "utkinect_splits.json", kinect.actors)
    return kinect, optical, splits


if __name__ == "__main__":
    command = command_line(__doc__)
    print_versions("scipy", "scikit-learn", "aeon")
    tables = {
        "actions": lambda folder: recognition_table(*read(folder)[::2]),
        "rejected": lambda folder: rejection_tables(*read(folder)),
    }
    run_tables(tables, command)
