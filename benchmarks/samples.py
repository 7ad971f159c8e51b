"""Samples of an action against people who had no part in it, and whether styles bring anything.

    python benchmarks/samples.py --data ../shared/data

People are dealt into four folds. (1) How near drawn postures and performances come to those of the
people left out: the energy score (proper; less is better), and the distances of a sample to the
nearest one of theirs and of one of theirs to the nearest sample, all as shares of those of samples
in the first row. (2) Styles: what clusters of the synchronised performances, with a density and
a model each, bring: the log-density of the people left out, for each feature and frame; the share
of what is not the action (other actions, standing still, a weak copy, halves exchanged) that is
rejected where 95 % of their performances are accepted, and the area under the curve.
"""

import argparse
from pathlib import Path

import numpy as np
from scipy.spatial.distance import cdist
from scipy.special import logsumexp
from sklearn.cluster import KMeans
from sklearn.metrics import roc_auc_score
from sklearn.model_selection import GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ActionModel, ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import load_performances
from sklearn_motionsync.model.sampling import sample_performances, sample_postures

FOLDS, P, N = 4, 100, 150
POSTURES = {
    "feature by feature": (0, 0, 1),
    "normal, covariance half shrunk": (0, 0.5, 0.5),
    "normal, covariance as it is": (0, 1, 0),
    "about one trial's pose, widely": (0.5, 0.45, 0.05),
    "about one trial's pose": (0.84, 0.14, 0.02),
    "about one trial's pose, shrunk": (0.84, 0.08, 0.08),
    "poses of training trials": (1, 0, 0),
}
PERFORMANCES = {name: (a, 1 - a) for name, a in (("mixtures", 0), ("0.36", 0.36), ("0.64", 0.64))}
PERFORMANCES |= {"0.84": (0.84, 0.16), "training trials": (1, 0)}


def moments(X):
    return X.mean(axis=0), X.var(axis=0), X - X.mean(axis=0)


def read_actions(folder):
    """(archive, action): postures, actors, and the postures of other actions with their actors."""
    for archive in ("hdm05", "utkinect"):
        bunch = load_performances(folder / archive / f"{archive}_positions.npz")
        enough = [i for i, x in enumerate(bunch.data) if len(x) >= 8]
        X = DirectionCosines(bunch.skeleton).fit_transform([bunch.data[i] for i in enough])
        actor, target = bunch.actor[enough], bunch.target[enough]
        for action in np.unique(target):
            own, other = np.flatnonzero(target == action), np.flatnonzero(target != action)
            yield (
                (archive, action),
                ([X[i] for i in own], actor[own], [X[i] for i in other], actor[other]),
            )


def folds(X, actors, others, whose):
    """Training performances on one clock, their actors; those left out; what is not the action."""
    for train, test in GroupKFold(FOLDS).split(X, groups=actors):
        pipe = make_pipeline(ASpace(0.95), DenseSynchronizer(n_frames=P))
        known = pipe.fit_transform([X[i] for i in train])
        left_out = [X[i] for i in test]
        wrong = [x for x, a in zip(others, whose, strict=True) if a in set(actors[test])]
        wrong += [np.repeat(x[:1], len(x), axis=0) for x in left_out]
        wrong += [x.mean(axis=0) + 0.3 * (x - x.mean(axis=0)) for x in left_out]
        wrong += [np.roll(x, len(x) // 2, axis=0) for x in left_out]
        yield known, actors[train], pipe.transform(left_out), pipe.transform(wrong)


def closeness(drawn, real):
    """Energy score; sample to nearest real one; real one to nearest sample."""
    apart, among = (cdist(drawn, x) for x in (real, drawn))
    score = apart.mean() - among.sum() / 2 / (len(drawn) * (len(drawn) - 1))
    return score, apart.min(axis=1).mean(), apart.min(axis=0).mean()


def of_postures(known, new):
    mean, variance, deviations = moments(known)

    def drawn(f, shares):
        at = (mean[f], variance[f], deviations[:, f])
        return sample_postures(*at, N, 3.0, np.random.RandomState(f), shares)

    return {
        name: np.mean([closeness(drawn(f, shares), new[:, f]) for f in range(5, P, 10)], axis=0)
        for name, shares in POSTURES.items()
    }


def of_performances(known, new):
    def drawn(shares):
        state = np.random.RandomState(0)
        args = (N, lambda Y: np.zeros(len(Y)), 1, state, shares)
        return sample_performances(*moments(known), *args).reshape(N, -1)

    new = new.reshape(len(new), -1)
    return {name: closeness(drawn(shares), new) for name, shares in PERFORMANCES.items()}


def labelled(X, k):
    return KMeans(k, n_init=10, random_state=0).fit_predict(X.reshape(len(X), -1))


def log_density(X, labels, new):
    """Log-density a feature and frame of a mixture of styles, each with its mean and variance."""
    styles = [X[labels == k] for k in np.unique(labels)]
    squares = [np.square(x - x.mean(axis=0)).sum(axis=0) for x in styles]
    pooled = np.sum(squares, axis=0) / max(len(X) - len(styles), 1)
    found = []
    for x, square in zip(styles, squares, strict=True):
        n = len(x)
        v = (square + 2.5 * (pooled + pooled.mean())) / (n + 4) * (1 + 1 / n)
        log = -np.square(new - x.mean(axis=0)) / v / 2 - np.log(2 * np.pi * v) / 2
        found.append(np.log(n / len(X)) + log.sum(axis=(1, 2)))
    return logsumexp(found, axis=0).mean() / X[0].size


def likeness(X, groups, labels, new):
    """The best answer of a model for each style; of one person, nobody is left out."""
    answers = []
    for k in np.unique(labels):
        rows = labels == k
        if rows.sum() > 1:
            several = len(set(groups[rows])) > 1
            model = ActionModel().fit(X[rows], groups=groups[rows] if several else None)
            answers.append(
                np.log(model.threshold_) - np.log(model.threshold_ - model.decision_function(new))
            )
    return np.max(answers, axis=0)


def separation(own, wrong):
    """Share that is rejected where 95 % are accepted; the area under the curve."""
    truth = np.repeat([1, 0], [len(own), len(wrong)])
    return (wrong < np.quantile(own, 0.05)).mean(), roc_auc_score(truth, np.r_[own, wrong])


def of_styles(parts):
    """{number of styles: log-density, share rejected, area}."""
    found = {}
    for k in (1, 2, 3):
        density, own, wrong = [], [], []
        for known, groups, new, other in parts:
            labels = labelled(known, k)
            density.append(log_density(known, labels, new))
            own.append(likeness(known, groups, labels, new))
            wrong.append(likeness(known, groups, labels, other))
        found[k] = (np.mean(density), *separation(np.concatenate(own), np.concatenate(wrong)))
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--data", type=Path, required=True)
    tables: dict = {}
    for (archive, action), people in read_actions(parser.parse_args().data):
        parts = [tuple(np.asarray(x) for x in part) for part in folds(*people)]
        for what, of in (("postures", of_postures), ("performances", of_performances)):
            found = [of(known, new) for known, _, new, _ in parts]
            mean = {name: np.mean([f[name] for f in found], axis=0) for name in found[0]}
            base = next(iter(mean.values()))
            for name, row in mean.items():
                tables.setdefault((what, archive), {}).setdefault(name, []).append(row / base)
        styles = of_styles(parts)
        print(
            f"{archive} {action}: styles", {k: np.round(v, 3).tolist() for k, v in styles.items()}
        )
        for k, row in styles.items():
            tables.setdefault(("styles", archive), {}).setdefault(k, []).append(row)
    for title, rows in tables.items():
        print("\n" + " ".join(title))
        for name, found in rows.items():
            print(f"| {name} |", " | ".join(f"{x:.3f}" for x in np.mean(found, axis=0)), "|")


if __name__ == "__main__":
    main()
