"""Which action it is, of people not seen: the classifier, and other ways.

    pip install . aeon
    python benchmarks/recognition.py DATA_FOLDER [actions] [rejected]

DATA_FOLDER holds hdm05/hdm05_positions.npz and utkinect of the same form, with
utkinect/utkinect_splits.json: ten halves of the actors to learn from, on which published results
stand. Nothing of `ActionClassifier` is chosen here. Of every other way the best setting is shown,
chosen by the result: view (cosines, positions or both), length and scale with the largest accuracy;
and in a row of its own the best that any of their settings reaches, every number by itself. Ways of
packages that are not installed are left out. Unknown actions are left out of the training in turn:
the area under the curve of the novelty of all test clips, mean over splits and actions. Prints
Markdown.

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
from sklearn_motionsync.datasets import load_performances

from model import SPOILT

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

    def __init__(self, recordings, view):
        self._recordings, self._view = recordings, view

    def predict(self, train, test):
        """Actions of performances (n_test,)."""
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


def classifier(recordings, view, n_frames):
    return {CLASSIFIER: {"": Classifier(recordings, view)}}


# -- scores, and what is made of them ---------------------------------------------------


class Scored:
    """A recognizer of a function ``decide(train, test)``: classes, scores (n_test, n_classes)."""

    def __init__(self, decide):
        self._decide = decide

    def predict(self, train, test):
        """Actions of performances (n_test,)."""
        classes, scores = self._decide(train, test)
        return classes[scores.argmax(axis=1)]

    def novelty(self, train, test):
        """The larger, the less like any class (n_test,)."""
        return -self._decide(train, test)[1].max(axis=1)


# -- dynamic time warping ---------------------------------------------------------------

# With 1 all are worse, by 1 to 4 in 100; with 100 as good.
C = 10


def dtw(recordings, view, n_frames):
    """Nearest neighbours, and support vector machines on the kernel exp(-D / median D).

    Distances are the roots of aeon's, which do better.
    """
    import aeon.distances

    X = np.ascontiguousarray(on_clock(recordings, view, n_frames).transpose(0, 2, 1))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        D = np.sqrt(aeon.distances.dtw_pairwise_distance(X))

    def nearest(train, test):
        labels, to_train = recordings.actions[train], D[np.ix_(test, train)]
        each = [-to_train[:, labels == c].min(axis=1) for c in np.unique(labels)]
        return np.unique(labels), np.stack(each, axis=1)

    return {
        NEAREST: {"": Scored(nearest)},
        DTW_SVM: {"": machines(recordings, partial(kernel_of, D))},
    }


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

    return {ROCKET: {"": Scored(decide)}}


# -- all of them ------------------------------------------------------------------------

CLASSIFIER, NEAREST, DTW_SVM = "`ActionClassifier`", "1-NN DTW", "SVM on DTW"
PYRAMID, ROCKET = "Fourier pyramid + SVM", "MiniRocket + ridge"
# The function, the views, the lengths, the package.
WAYS = [
    (dtw, VIEWS, (50,), "aeon"),
    (rocket, VIEWS, (50, 100), "aeon"),
    (classifier, (COSINES, BOTH), (None,), None),
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


# -- what is found on a fold ------------------------------------------------------------

SPLITS, LEFT_OUT, AREA = "ten splits", "leave one subject out", "AUC of unknown actions"


def examine_split(recognizer, recordings, train, test):
    """{figure: values} of everything that is told of a split."""
    actions = recordings.actions
    classes = np.unique(actions[train])
    return {
        SPLITS: [np.mean(recognizer.predict(train, test) == actions[test])],
        AREA: [unknown_area(recognizer, actions, action, train, test) for action in classes],
    }


def unknown_area(recognizer, actions, action, train, test):
    """How well the novelty tells an action that nothing was learnt of; NaN if nobody tests it."""
    unknown = actions[test] == action
    if unknown.all() or not unknown.any():
        return np.nan
    return roc_auc_score(unknown, recognizer.novelty(train[actions[train] != action], test))


def examine_fold(figure, recognizer, recordings, train, test):
    """{figure: share that is recognised}"""
    return {figure: [np.mean(recognizer.predict(train, test) == recordings.actions[test])]}


def examine(way, view, n_frames, recordings, tasks):
    """{(name, setting): {figure: values}} of tasks, each a function and folds."""
    found: dict = {}
    for name, settings in way(recordings, view, n_frames).items():
        for setting, recognizer in settings.items():
            lengths = [f"{n_frames} frames"] if n_frames else []
            text = ", ".join([view, *lengths, *filter(None, [setting])])
            figures = found.setdefault((name, text), {})
            for look, folds in tasks:
                for fold in folds:
                    for figure, values in look(recognizer, recordings, *fold).items():
                        figures.setdefault(figure, []).extend(values)
    return found


def examine_all(recordings, tasks):
    """{name: {setting: {figure: values}}} of all ways.

    Those that know nothing to share between folds are given one at a time.
    """
    work = []
    for way, view, n_frames in ways():
        parts = [tasks]
        if way is classifier:
            parts = [[(look, [fold])] for look, folds in tasks for fold in folds]
        work += [(way, view, n_frames, recordings, part) for part in parts]
    found: dict = {}
    for part in Parallel(n_jobs=-1)(delayed(examine)(*one) for one in work):
        for (name, setting), figures in part.items():
            known = found.setdefault(name, {}).setdefault(setting, {})
            for figure, values in figures.items():
                known[figure] = known.get(figure, []) + values
    return found


# -- tables -----------------------------------------------------------------------------


to_tenth = partial(percent, digits=1)


def three_digits(value):
    return "-" if np.isnan(value) else f"{value:.3f}"


# Header, figure, what is made of its values, how it is shown, and which is best.
SPLIT_COLUMNS = [
    (f"{SPLITS}, mean", SPLITS, np.mean, to_tenth, max),
    ("worst split", SPLITS, np.min, to_tenth, max),
    (LEFT_OUT, LEFT_OUT, np.mean, to_tenth, max),
    (AREA, AREA, np.nanmean, three_digits, max),
]


def recognition_table(name, found, columns):
    """Ours on both views, others' best settings, and the best of all of those."""
    print_head(name, [column[0] for column in columns])
    rows = {
        f"{CLASSIFIER}, {view}": numbers(figures, columns)
        for view, figures in found[CLASSIFIER].items()
    }
    others = {way: settings for way, settings in found.items() if way != CLASSIFIER}
    for way, settings in others.items():
        best = max(settings, key=lambda s: shares(settings[s], columns))
        rows[f"{way}, {best}"] = numbers(settings[best], columns)
    every = [numbers(figures, columns) for of in others.values() for figures in of.values()]
    best = [
        better([n for n in column if not np.isnan(n)])
        for column, (*_, better) in zip(zip(*every, strict=True), columns, strict=bool(others))
    ]
    if others:
        rows["*the best of others' settings, every number by itself*"] = best
    for row, values in rows.items():
        print_row(row, [show(v) for v, (*_, show, _) in zip(values, columns, strict=True)])


def shares(figures, columns):
    """What settings are chosen by: shares that are recognised, ties by the next column."""
    return [summary(figures[figure]) for _, figure, summary, show, _ in columns if show is to_tenth]


def numbers(figures, columns):
    """One of a column."""
    return [summary(figures[figure]) for _, figure, summary, *_ in columns]


# -- what is rejected -------------------------------------------------------------------

KNOWN, UNKNOWN = "known actions", "an unknown action"


def rejected_on_split(recordings, train, test):
    """{kind: (novelties, border)} for ``reject_below="auto"``: known, spoilt, and unknown actions.

    Spoilt are the performances of the known actions; unknown is each action left out in turn.
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
    """What the classifier rejects on cosines, and how well its novelty tells that."""
    head = f'`ActionClassifier(reject_below="auto")`, {recordings.name}, {name}'
    print_head(head, ["rejected", "AUC to known actions"])
    work = [delayed(rejected_on_split)(recordings, *split) for split in splits]
    found = Parallel(n_jobs=-1)(work)
    for kind in found[0]:
        parts = [part for one in found for part in one[kind]]
        rejected = np.mean([np.mean(novelties > border) for novelties, border in parts])
        areas = []
        for one in found if kind not in (KNOWN, UNKNOWN) else ():
            both = [one[KNOWN][0][0], one[kind][0][0]]
            strange = np.repeat([0, 1], list(map(len, both)))
            areas.append(roc_auc_score(strange, np.concatenate(both)))
        print_row(kind, [to_tenth(rejected), f"{np.mean(areas):.2f}" if areas else "-"])


# -- all of it --------------------------------------------------------------------------


def action_table(kinect, optical, splits):
    tasks = [(examine_split, splits)]
    tasks.append((partial(examine_fold, LEFT_OUT), actors_left_out(kinect.actors)))
    recognition_table(kinect.name, examine_all(kinect, tasks), SPLIT_COLUMNS)


def rejection_tables(kinect, optical, splits):
    rejection_table(kinect, splits, SPLITS)
    for recordings in (kinect, optical):
        rejection_table(recordings, actors_left_out(recordings.actors), LEFT_OUT)


def read(folder):
    """UTKinect, HDM05, and the splits of UTKinect."""
    kinect, optical = (
        as_recordings(name, load_performances(folder / archive / f"{archive}_positions.npz"))
        for archive, name in (("utkinect", "UTKinect"), ("hdm05", "HDM05"))
    )
    splits = published_splits(folder / "utkinect" / "utkinect_splits.json", kinect.actors)
    return kinect, optical, splits


if __name__ == "__main__":
    command = command_line(__doc__)
    print_versions("scipy", "scikit-learn", "aeon")
    tables = {
        "actions": lambda folder: action_table(*read(folder)),
        "rejected": lambda folder: rejection_tables(*read(folder)),
    }
    run_tables(tables, command)
