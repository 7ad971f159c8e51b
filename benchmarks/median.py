"""The sampled search for the median against the exhaustive rule, as in docs/scaling.md.

Sets of 200, 300 and 400 performances of 100 x 16: bends of the embedded action, variations of
real clips (mixtures of two clips of a class, warped, with gain and noise) and random walks. Every
set is compared exhaustively once and searched three times. Takes a few minutes.

    python benchmarks/median.py ../shared/data/hdm05/hdm05_positions.npz
"""

import sys

import numpy as np
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines, LinearSynchronizer
from sklearn_motionsync.datasets import load_performances, make_bending
from sklearn_motionsync.matching.matcher import Features, Matcher
from sklearn_motionsync.matching.median import search_median
from sklearn_motionsync.matching.units import Unit

PAPER = {"cost": "posture", "max_rate": 2, "consensus": 0, "max_offset": 0.25}
PLAIN = {"metric": None, "max_offset": 0.25, "velocity_smoothing": 0.03}
SETS, SEARCHES = 20, 3


def bends(n, seed):
    """Random bends as points of their aSpace."""
    bunch = make_bending(n, random_state=seed)
    postures = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    return LinearSynchronizer(100).fit_transform(ASpace(16).fit_transform(postures))


def walks(n, seed):
    """Random walks."""
    return np.cumsum(np.random.default_rng(seed).standard_normal((n, 100, 16)), axis=1)


class Variations:
    """Variations of the clips of one class of an archive."""

    def __init__(self, path):
        archive = load_performances(path)
        postures = DirectionCosines(archive.skeleton).fit_transform(archive.data)
        self._clips = LinearSynchronizer(100).fit_transform(ASpace(16).fit_transform(postures))
        self._classes = archive.target

    def __call__(self, n, seed):
        rng, t = np.random.default_rng(seed), np.linspace(0, 1, 100)
        clips = self._clips[self._classes == rng.choice(np.unique(self._classes))]
        out = np.empty((n, 100, 16))
        for x in out:
            first, second = rng.choice(len(clips), 2)
            share, (bow, wave) = rng.random(), 0.05 * rng.standard_normal(2)
            mixed = share * clips[first] + (1 - share) * clips[second]
            phase = t + bow * np.sin(np.pi * t) + wave * np.sin(2 * np.pi * t) / 2
            phase = np.maximum.accumulate(np.clip(phase, 0, 1))
            x[:] = np.column_stack([np.interp(phase, t, column) for column in mixed.T])
            noise = 0.05 * x.std() * rng.standard_normal(x.shape)
            x[:] = x * (1 + 0.05 * rng.standard_normal()) + noise
        return out


def matrix(X, settings):
    """All synchronisation distances, by the estimator's own comparison."""
    given = DenseSynchronizer(**settings).get_params()
    names = ("smoothness", "max_offset", "max_rate")
    matcher, features = Matcher.learn(
        Features(given["cost"], 1, given["velocity_smoothing"], Unit.of(X)),
        X,
        **{name: given[name] for name in names},
    )
    return matcher.trellis.distances(features, features).astype(np.float64)


def main():
    """Print a table."""
    kinds = {"bends": bends, "random walks": walks}
    if len(sys.argv) > 1:
        kinds["variations of clips"] = Variations(sys.argv[1])
    print("| sets | settings | searches | right | certified | certified but wrong | matches |")
    print("|---|---|---|---|---|---|---|")
    for kind, draw in kinds.items():
        for name, settings in (("paper", PAPER), ("without a metric", PLAIN)):
            rows = []
            for seed in range(SETS):
                n = (200, 300, 400)[seed % 3]
                distances = matrix(draw(n, seed), settings)
                right = distances.sum(axis=1).argmin()

                def compare(bases, moving, distances=distances):
                    yield slice(None), slice(None), distances[np.ix_(bases, moving)]

                for search in range(SEARCHES):
                    median = search_median(compare, n, 0.0, np.random.RandomState(search))
                    hit = median.index == right
                    wrong = median.certified and not hit
                    rows.append((hit, median.certified, wrong, median.n_matches / n**2))
            hits, certified, wrong, shares = np.array(rows, dtype=float).T
            matches = f"{100 * shares.mean():.0f} %, at most {100 * shares.max():.0f} %"
            counts = " | ".join(f"{values.sum():.0f}" for values in (hits, certified, wrong))
            print(f"| {kind} | {name} | {len(rows)} | {counts} | {matches} |", flush=True)


if __name__ == "__main__":
    main()
