"""Which action it is, of people not seen: the classifier, and other packages' and other ways.

    pip install . aeon dtaidistance
    python benchmarks/recognition.py DATA_FOLDER [TABLES ...]

TABLES are some of actions, rejected, exercises and times; without them all are printed.
DATA_FOLDER holds hdm05/hdm05_positions.npz and utkinect of the same form, with
utkinect/utkinect_splits.json: ten halves of the actors to learn from, on which published results
stand; and uiprmd/uiprmd_odd_positions.npz, exercises done right and wrong.
Nothing of `ActionClassifier` is chosen here. Of every other way the best setting is shown,
chosen by the result: view (cosines, positions or both), length and scale with the largest
accuracy; and in a row of its own the best that any of their settings reaches, every number by
itself. Probabilities of theirs have one temperature, learnt of training actors left out in turn.
Unknown actions are left out of the training in turn: the area under the curve of the novelty of
all test clips (theirs: minus the largest score), mean over splits and actions.
Exercises are told right from wrong, of one subject after the other, by all trials of the others or
by every second: the area under the curve of all subjects together. Prints Markdown.
"""

import json
import re
import sys
import time
import warnings
from functools import partial
from pathlib import Path

import numpy as np
from accuracy import print_head, print_row
from exercises import read_exercises
from joblib import Parallel, delayed
from judges import version_of
from negatives import SPOILT
from recognizers import (
    BOTH,
    CLASSIFIER,
    COSINES,
    ROCKET,
    Classifier,
    Recordings,
    as_recordings,
    classifier,
    on_clock,
    rocket,
    ways,
)
from sklearn.metrics import roc_auc_score
from sklearn.model_selection import LeaveOneGroupOut
from sklearn_motionsync import synchronization_distances
from sklearn_motionsync.datasets import load_performances
from threadpoolctl import threadpool_limits

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


def actors_alone(actors):
    """Folds (train, test) with an actor each to learn from."""
    return [(alone, others) for others, alone in actors_left_out(actors)]


# -- what is found on a fold ------------------------------------------------------------

SPLITS, LEFT_OUT, ALONE = "ten splits", "leave one subject out", "learn from one subject"
LOSS, ERROR, AREA = "log-loss", "ECE", "AUC of unknown actions"


def examine_split(recognizer, recordings, train, test):
    """{figure: values} of everything that is told of a split."""
    actions = recordings.actions
    classes, probabilities = recognizer.probabilities(train, test)
    right = classes[probabilities.argmax(axis=1)] == actions[test]
    true = probabilities[np.arange(len(test)), np.searchsorted(classes, actions[test])]
    loss = -np.log(np.maximum(true, np.finfo(float).eps)).mean()
    error = calibration_error(probabilities.max(axis=1), right)
    return {
        SPLITS: [right.mean()],
        LOSS: [loss if recognizer.tempered else np.nan],
        ERROR: [error if recognizer.tempered else np.nan],
        AREA: [unknown_area(recognizer, actions, action, train, test) for action in classes],
    }


def calibration_error(confidence, right, n_bins=10):
    """How far shares of right answers are from confidence: mean over bins, by their counts."""
    bins = np.minimum((confidence * n_bins).astype(int), n_bins - 1)
    apart = [np.abs(np.sum((confidence - right)[bins == i])) for i in range(n_bins)]
    return np.sum(apart) / len(right)


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
    """{name: {setting: {figure: values}}} of tasks, each a function and folds."""
    found: dict = {}
    for name, settings in way(recordings, view, n_frames).items():
        for setting, recognizer in settings.items():
            lengths = [f"{n_frames} frames"] if n_frames else []
            text = ", ".join([view, *lengths, *filter(None, [setting])])
            figures = found.setdefault(name, {}).setdefault(text, {})
            for look, folds in tasks:
                for fold in folds:
                    for figure, values in look(recognizer, recordings, *fold).items():
                        figures.setdefault(figure, []).extend(values)
    return found


def examine_all(recordings, tasks):
    """Of all ways; those that know nothing to share between folds are given one at a time."""
    work = []
    for way, view, n_frames in ways():
        parts = [tasks]
        if way is classifier:
            parts = [[(look, [fold])] for look, folds in tasks for fold in folds]
        work += [(way, view, n_frames, recordings, part) for part in parts]
    found: dict = {}
    for part in Parallel(n_jobs=-1)(delayed(examine)(*one) for one in work):
        for name, settings in part.items():
            for setting, figures in settings.items():
                known = found.setdefault(name, {}).setdefault(setting, {})
                for figure, values in figures.items():
                    known[figure] = known.get(figure, []) + values
    return found


# -- tables -----------------------------------------------------------------------------


def share(value):
    return f"{100 * value:.1f}"


def three_digits(value):
    return "-" if np.isnan(value) else f"{value:.3f}"


# Header, figure, what is made of its values, how it is shown, and which is best.
SPLIT_COLUMNS = [
    (f"{SPLITS}, mean", SPLITS, np.mean, share, max),
    ("worst split", SPLITS, np.min, share, max),
    (LEFT_OUT, LEFT_OUT, np.mean, share, max),
    (LOSS, LOSS, np.mean, three_digits, min),
    (ERROR, ERROR, np.mean, three_digits, min),
    (AREA, AREA, np.nanmean, three_digits, max),
]
FOLD_COLUMNS = [
    (LEFT_OUT, LEFT_OUT, np.mean, share, max),
    (ALONE, ALONE, np.mean, share, max),
    (f"{ALONE}, worst", ALONE, np.min, share, max),
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
    return [summary(figures[figure]) for _, figure, summary, show, _ in columns if show is share]


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
        print_row(kind, [share(rejected), f"{np.mean(areas):.2f}" if areas else "-"])


# -- exercises done right and wrong -----------------------------------------------------


def exercise_recordings(folder):
    """Of each exercise, whether a trial is done right is its action."""
    for name, trials, actors, right, _ in read_exercises(folder):
        trials = [np.asarray(x) for x in trials]
        yield Recordings(str(name), {COSINES: trials}, np.asarray(right).astype(int), actors)


def every_second(recordings):
    """Whether a trial is the first, third, fifth ... of its subject and kind (n,)."""
    chosen = np.zeros(len(recordings.actors), dtype=bool)
    for actor in np.unique(recordings.actors):
        for action in np.unique(recordings.actions):
            own = (recordings.actors == actor) & (recordings.actions == action)
            chosen[np.flatnonzero(own)[::2]] = True
    return chosen


def judged_exercise(recognizer, recordings, learnt):
    """Area under the curve, of all subjects, each judged by the learnt trials of the others."""
    scores = np.empty(len(recordings.actors))
    for train, test in actors_left_out(recordings.actors):
        scores[test] = recognizer.contrast(train[learnt[train]], test)
    return roc_auc_score(recordings.actions, scores)


def exercise_table(every, name, choose):
    """Of all exercises, by trials that ``choose(recordings)`` tells to learn from."""
    makers = {CLASSIFIER: partial(Classifier, view=COSINES)}
    if version_of("aeon") is not None:
        for n_frames in (50, 100):
            way = f"{ROCKET}, {n_frames} frames"
            makers[way] = lambda recordings, n=n_frames: rocket(recordings, COSINES, n)[ROCKET][""]
    print_head(f"right against wrong, {name}", makers)
    found = []
    for recordings in every:
        learnt = choose(recordings)
        areas = [judged_exercise(make(recordings), recordings, learnt) for make in makers.values()]
        print_row(recordings.name, map(three_digits, areas))
        found.append(areas)
    print_row("mean", map(three_digits, np.mean(found, axis=0)))


def exercise_tables(every):
    """By all trials, and by every second."""
    every = list(every)
    exercise_table(every, "learnt from all trials", lambda some: np.ones(len(some.actors), bool))
    exercise_table(every, "learnt from every second trial", every_second)


# -- time -------------------------------------------------------------------------------

ROUNDS, PAIRS = 3, 300
BAND = 0.25


def took(function):
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def print_times(rows, peers):
    """Median seconds of functions that run in turns, and medians of ratios to those of peers.

    rows and peers are {name: function}. One thread each; a first round, in which functions are
    compiled, does not count.
    """
    functions = [*rows.values(), *peers.values()]
    with threadpool_limits(1), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        seconds = np.array([[took(f) for f in functions] for _ in range(ROUNDS + 1)])[1:]
    medians = np.median(seconds, axis=0)
    for i, row in enumerate(rows):
        ratios = np.median(seconds[:, [i]] / seconds[:, len(rows) :], axis=0)
        pairs = zip(medians[len(rows) :], ratios, strict=True)
        print_row(row, [f"{medians[i]:.2f}", *(f"{m:.2f} ({r:.2f})" for m, r in pairs)])


def time_table(recordings, train, test):
    """Learning from a split and asking, against the nearest neighbour by aeon's DTW."""
    bands = {}
    if version_of("aeon") is not None:
        bands = {"aeon's 1-NN DTW": {}, f"the same, band of {BAND}": {"window": BAND}}
    print_head("learn and predict, s (ratio)", [CLASSIFIER, *bands])
    for view in (COSINES, BOTH):
        X = np.ascontiguousarray(on_clock(recordings, view, 50).transpose(0, 2, 1))
        ours = partial(Classifier(recordings, view).predict, train, test)
        peers = {
            name: partial(nearest, X, recordings.actions, train, test, band)
            for name, band in bands.items()
        }
        print_times({f"{len(train)} and {len(test)} clips, {view}": ours}, peers)


def nearest(X, actions, train, test, params):
    from aeon.classification.distance_based import KNeighborsTimeSeriesClassifier

    model = KNeighborsTimeSeriesClassifier(distance="dtw", distance_params=params)
    model.fit(X[train], actions[train]).predict(X[test])


def distance_table(recordings):
    """Both directions of all pairs of 50 frames, against one direction by dtaidistance."""
    windows = {}
    if version_of("dtaidistance") is not None:
        window = int(BAND * 50) + 1
        windows = {"dtaidistance": None, f"dtaidistance, window={window}": window}
    print_head("`synchronization_distances`, s (ratio)", ["ours", *windows])
    for view in (COSINES, BOTH):
        X = on_clock(recordings, view, 50)
        X = X[np.arange(PAIRS) % len(X)]
        ours = {
            f"{PAIRS} x {PAIRS}, {view}, {cost}": partial(synchronization_distances, X, cost=cost)
            for cost in ("velocity", "elastic", "posture")
        }
        print_times(ours, {name: partial(warped, X, window) for name, window in windows.items()})


def warped(X, window):
    from dtaidistance import dtw_ndim

    dtw_ndim.distance_matrix_fast(list(X), window=window, parallel=False)


# -- all of it --------------------------------------------------------------------------


TABLES = "actions", "rejected", "exercises", "times"


def print_tables(kinect, splits, optical, every, tables=TABLES):
    """Of clips with splits of their actors, of clips of few actors, and of exercises."""
    left_out = partial(examine_fold, LEFT_OUT)
    if "actions" in tables:
        tasks = [(examine_split, splits), (left_out, actors_left_out(kinect.actors))]
        recognition_table(kinect.name, examine_all(kinect, tasks), SPLIT_COLUMNS)
        tasks = [
            (left_out, actors_left_out(optical.actors)),
            (partial(examine_fold, ALONE), actors_alone(optical.actors)),
        ]
        recognition_table(optical.name, examine_all(optical, tasks), FOLD_COLUMNS)
    if "rejected" in tables:
        rejection_table(kinect, splits, SPLITS)
        for recordings in (kinect, optical):
            rejection_table(recordings, actors_left_out(recordings.actors), LEFT_OUT)
    if "exercises" in tables:
        exercise_tables(every)
    if "times" in tables:
        time_table(kinect, *splits[0])
        distance_table(kinect)


def main():
    """Print the tables."""
    if len(sys.argv) < 2 or not set(sys.argv[2:]) <= set(TABLES):
        sys.exit(__doc__)
    folder, tables = Path(sys.argv[1]), sys.argv[2:] or TABLES
    packages = ("sklearn_motionsync", "numpy", "scipy", "scikit-learn", "aeon", "dtaidistance")
    versions = {package: version_of(package) for package in packages}
    print(", ".join(f"{name} {version or 'not installed'}" for name, version in versions.items()))
    for package in ("aeon", "dtaidistance"):
        if versions[package] is None:
            print(f"\nWithout {package} there are no rows and columns of it.")
    kinect, optical = (
        as_recordings(name, load_performances(folder / archive / f"{archive}_positions.npz"))
        for archive, name in (("utkinect", "UTKinect"), ("hdm05", "HDM05"))
    )
    splits = published_splits(folder / "utkinect" / "utkinect_splits.json", kinect.actors)
    print_tables(kinect, splits, optical, exercise_recordings(folder), tables)


if __name__ == "__main__":
    main()
