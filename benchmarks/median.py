"""The sampled search for the median against the exhaustive rule, as in docs/scaling.md.

Six sets of 200, 300 and 400 performances of 100 x 16, in single precision, of each kind: bends of
the embedded action, variations of real clips (mixtures of two clips of a class, warped, with gain
and noise) and random walks. Then one larger set of each, and harder ones: few clips, each warped,
with gain and noise, over and over; two clips, which have nothing to do with each other; one clip
and noise; distances that are nothing but noise. Every set is compared exhaustively once and
searched ten times. Takes ten minutes.

    python benchmarks/median.py ../shared/data/hdm05/hdm05_positions.npz
"""

import sys

import numpy as np
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines, LinearSynchronizer
from sklearn_motionsync.datasets import load_performances, make_bending
from sklearn_motionsync.matching.matcher import Features, Matcher
from sklearn_motionsync.matching.median import sampled_median
from sklearn_motionsync.matching.units import Unit

PAPER = {"cost": "posture", "max_rate": 2, "consensus": 0, "max_offset": 0.25}
PLAIN = {"metric": None, "max_offset": 0.25, "velocity_smoothing": 0.03}
SETS, SEARCHES = 6, 10


def bends(n, seed):
    """Random bends as points of their aSpace."""
    bunch = make_bending(n, random_state=seed)
    postures = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    return LinearSynchronizer(100).fit_transform(ASpace(16).fit_transform(postures))


def walks(n, seed):
    """Random walks."""
    return np.cumsum(np.random.default_rng(seed).standard_normal((n, 100, 16)), axis=1)


class Clips:
    """Sets made of the clips of an archive."""

    def __init__(self, path):
        archive = load_performances(path)
        postures = DirectionCosines(archive.skeleton).fit_transform(archive.data)
        self._clips = LinearSynchronizer(100).fit_transform(ASpace(16).fit_transform(postures))
        self._classes = archive.target

    def variations(self, n, seed):
        """Mixtures of any two clips of a class."""
        rng = np.random.default_rng(seed)
        clips, out = self._of_a_class(rng), np.empty((n, 100, 16))
        for x in out:
            first, second = rng.choice(len(clips), 2)
            share = rng.random()
            x[:] = varied(share * clips[first] + (1 - share) * clips[second], rng)
        return out

    def few(self, n, seed):
        """Each of six clips of a class over and over."""
        rng = np.random.default_rng(seed)
        clips = self._of_a_class(rng)
        return self._repeated(clips[rng.choice(len(clips), 6, replace=False)], n, rng)

    def two(self, n, seed):
        """Two clips of any class over and over."""
        rng = np.random.default_rng(seed)
        return self._repeated(self._clips[rng.choice(len(self._clips), 2, replace=False)], n, rng)

    def one(self, n, seed):
        """One clip, with noise."""
        rng = np.random.default_rng(seed)
        clip = self._clips[rng.integers(len(self._clips))]
        return clip + 0.02 * clip.std() * rng.standard_normal((n, 100, 16))

    def _of_a_class(self, rng):
        return self._clips[self._classes == rng.choice(np.unique(self._classes))]

    def _repeated(self, clips, n, rng):
        return np.stack([varied(clips[rng.integers(len(clips))], rng) for _ in range(n)])


def varied(clip, rng):
    """A clip, warped, with gain and noise."""
    t, (bow, wave) = np.linspace(0, 1, 100), 0.05 * rng.standard_normal(2)
    phase = t + bow * np.sin(np.pi * t) + wave * np.sin(2 * np.pi * t) / 2
    phase = np.maximum.accumulate(np.clip(phase, 0, 1))
    x = np.column_stack([np.interp(phase, t, column) for column in clip.T])
    noise = 0.05 * x.std() * rng.standard_normal(x.shape)
    return x * (1 + 0.05 * rng.standard_normal()) + noise


def matrix(X, settings):
    """All synchronisation distances, by the estimator's own comparison, in single precision."""
    X = X.astype(np.float32)
    given = DenseSynchronizer(**settings).get_params()
    names = ("smoothness", "max_offset", "max_rate")
    matcher, features = Matcher.learn(
        Features(given["cost"], 1, given["velocity_smoothing"], Unit.of(X)),
        X,
        **{name: given[name] for name in names},
    )
    return matcher.trellis.distances(features, features)


def noise(n, seed):
    """Distances that say nothing."""
    distances = np.random.default_rng(seed).uniform(1, 2, size=(n, n))
    np.fill_diagonal(distances, 0)
    return distances


def searched(distances):
    """Of each search: right, certified, certified but wrong, matches, doubt, excess, as said."""
    n, sums = len(distances), distances.sum(axis=1, dtype=np.float64)

    def compare(bases, moving):
        yield slice(None), slice(None), distances[np.ix_(bases, moving)]

    for seed in range(SEARCHES):
        median = sampled_median(compare, n, 0.0, np.random.RandomState(seed))
        hit, excess = median.index == sums.argmin(), sums[median.index] / sums.min() - 1
        wrong = median.certified and not hit
        matches = median.n_matches / n
        yield hit, median.certified, wrong, matches, median.in_doubt, excess, median.excess


def report(kind, sizes, settings, rows):
    """Print a row of the table."""
    hits, certified, wrong, matches, doubt, excess, said = np.array(rows, dtype=float).T
    counts = " | ".join(f"{values.sum():.0f}" for values in (hits, certified, wrong))
    spent = f"{matches.mean():.0f}, at most {matches.max():.0f}"
    rest = f"{doubt.max():.0f} | {100 * excess.max():.2g} of {100 * said.max():.2g} %"
    print(
        f"| {kind} | {sizes} | {settings} | {len(rows)} | {counts} | {spent} | {rest} |", flush=True
    )


def main():
    """Print a table."""
    kinds = {"bends": bends, "random walks": walks}
    hard = dict(kinds)
    if len(sys.argv) > 1:
        clips = Clips(sys.argv[1])
        kinds["variations of clips"] = hard["variations of clips"] = clips.variations
        hard |= {"six clips": clips.few, "two clips": clips.two, "one clip": clips.one}
    print(
        "| sets | trials | settings | searches | right | certified | certified but wrong "
        "| matches a trial | in doubt, at most | excess, of what was said, at most |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    both = {"paper": PAPER, "without a metric": PLAIN}
    for kind, draw in kinds.items():
        for name, settings in both.items():
            sets = (draw((200, 300, 400)[seed % 3], seed) for seed in range(SETS))
            rows = [row for X in sets for row in searched(matrix(X, settings))]
            report(kind, "200 to 400", name, rows)
    for kind, draw in hard.items():
        for n, name in ((1000, "paper"), (1000, "without a metric"), (2000, "paper")):
            report(kind, n, name, list(searched(matrix(draw(n, 0), both[name]))))
    for n in (1000, 2000):
        report("nothing but noise", n, "", list(searched(noise(n, 0))))


if __name__ == "__main__":
    main()
