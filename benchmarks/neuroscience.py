"""Trials of spike counts, judged by neurons that were held out; affinewarp beside.

    python -m venv peers && peers/bin/pip install . affinewarp
    peers/bin/python benchmarks/neuroscience.py

Without affinewarp its rows are left out. The first column has the data of affinewarp's example
``piecewise_warping.ipynb``, written anew: 100 trials of 150 bins, 100 neurons, Poisson counts. The
pattern of a neuron is sparse noise, and the warp of a trial has one knot. Ends are free: a trial
begins and stops somewhere about the ends of the pattern. In the second column trials are shifted,
by up to a tenth of their length, and in the third they are not warped at all.

Warps are fitted to the counts of one half of the neurons. The others are the judge: a pattern is
averaged from four fifths of their trials, and warped to each trial of the last fifth. R^2 is the
share of the variance of its counts that this explains, beyond the mean rate of each neuron. All
methods have the same averages, and no judged count is interpolated. Means over data sets.
"""

import argparse
import importlib.util

import numpy as np
from harness import at_frames, print_head, print_row
from scipy.ndimage import gaussian_filter1d
from sklearn_motionsync import DenseSynchronizer

TRIALS, BINS, NEURONS = 100, 150, 100
# Of the example: spread of the knots, mean of a pattern before its filter where it is not zero,
# share of the zeros, width of the filter in bins.
SPREAD, SCALE, ZEROS, WIDTH = 0.1, 1.0, 0.9, 2.0
FOLDS = 5
# Width of the filter of the averages, in bins, and the weight of the mean rate in them.
AVERAGED, PRIOR = 1.0, 1e-3
KINDS = ("one knot", "shift", "no warp")


def make_trials(seed, kind="one knot"):
    """Counts (trials, bins, neurons), and the bin of the pattern at every bin of each trial."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, BINS)
    if kind == "one knot":
        x, y = np.linspace(0, 1, 3) + SPREAD * rng.standard_normal((2, TRIALS, 3))
        x.sort(axis=1)
        y.sort(axis=1)
        x = (x - x[:, :1]) / (x[:, -1:] - x[:, :1])
        moments = np.array([np.interp(t, *knots) for knots in zip(x, y, strict=True)])
    else:
        moments = t + (kind == "shift") * rng.uniform(-SPREAD, SPREAD, (TRIALS, 1))
    shape = BINS, NEURONS
    pattern = rng.exponential(SCALE, shape) * (rng.random(shape) > ZEROS)
    pattern = gaussian_filter1d(pattern, WIDTH, axis=0)
    pattern[[0, -1]] = 0
    positions = (BINS - 1) * moments
    return rng.poisson(sample(pattern, positions)).astype(float), positions


def sample(pattern, positions):
    """A pattern (bins, neurons) at positions (trials, bins), linearly between its bins."""
    return at_frames(pattern, positions.ravel()).reshape(*positions.shape, -1)


def split(positions):
    """The bin to the left of each position, and the part of a bin that is beyond it."""
    positions = np.clip(positions, 0, BINS - 1)
    left = np.minimum(positions.astype(int), BINS - 2)
    return left, positions - left


def average(counts, positions):
    """The pattern (bins, neurons) of trials that are at such positions of it."""
    left, part = (each.ravel() for each in split(positions))
    counts = counts.reshape(len(left), -1)
    sums, weights = np.zeros((BINS, counts.shape[1])), np.zeros((BINS, 1))
    for bins, share in ((left, 1 - part), (left + 1, part)):
        np.add.at(sums, bins, share[:, np.newaxis] * counts)
        np.add.at(weights, bins, share[:, np.newaxis])
    sums, weights = (gaussian_filter1d(each, AVERAGED, axis=0) for each in (sums, weights))
    return (sums + PRIOR * counts.mean(axis=0)) / (weights + PRIOR)


def held_out_r2(counts, positions):
    """R^2 of trials that have no part in the pattern they are held against."""
    fold = np.arange(len(counts)) % FOLDS
    missed = total = 0.0
    for k in range(FOLDS):
        known, new = counts[fold != k], counts[fold == k]
        expected = sample(average(known, positions[fold != k]), positions[fold == k])
        missed += np.square(new - expected).sum()
        total += np.square(new - known.mean(axis=(0, 1))).sum()
    return 1 - missed / total


def unaligned(counts):
    return np.tile(np.arange(BINS, dtype=float), (len(counts), 1))


def dense(width=0.0, margin=0, **params):
    """Positions by ``DenseSynchronizer``, from counts or rates, with margins at both ends."""

    def align(counts):
        rates = gaussian_filter1d(counts, width, axis=1) if width else counts
        rates = np.pad(rates, ((0, 0), (margin, margin), (0, 0)), mode="edge")
        times = DenseSynchronizer(**params).fit(rates).match(rates).times
        frames = np.arange(BINS + 2 * margin)
        positions = np.array([np.interp(frames, tau, frames) for tau in times])
        return positions[:, margin : margin + BINS] - margin

    return align


def affinewarp(n_knots):
    """Positions by affinewarp, with the settings of its example."""

    def align(counts):
        from affinewarp import PiecewiseWarping, ShiftWarping

        np.random.seed(0)  # noqa: NPY002, affinewarp draws from the global generator
        params = {"smoothness_reg_scale": 20.0}
        t = np.linspace(0, 1, BINS)
        if n_knots < 0:
            model = ShiftWarping(**params).fit(counts, iterations=50, verbose=False)
            return (BINS - 1) * (t - model.fractional_shifts[:, np.newaxis])
        model = PiecewiseWarping(n_knots=n_knots, warp_reg_scale=1e-6, **params)
        model.fit(counts, iterations=50, warp_iterations=200, verbose=False)
        knots = zip(model.x_knots, model.y_knots, strict=True)
        return (BINS - 1) * np.array([np.interp(t, x, y) for x, y in knots])

    return align


METHODS = {
    "trials as recorded": unaligned,
    "`DenseSynchronizer()` on counts": dense(),
    "on rates, Gaussian filter of 2 bins": dense(2),
    "the same, margins of 15 bins": dense(2, 15),
    "the same, `refine=True`": dense(2, 15, refine=True),
}
PEERS = {
    "affinewarp, shift": affinewarp(-1),
    "affinewarp, linear": affinewarp(0),
    "affinewarp, 1 knot": affinewarp(1),
    "affinewarp, 2 knots": affinewarp(2),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=4, help="data sets of each kind")
    n_sets = parser.parse_args().sets
    methods = METHODS | (PEERS if importlib.util.find_spec("affinewarp") else {})
    print_head("held-out R²", KINDS)
    for name, align in {"true warps": None, **methods}.items():
        shares = []
        for kind in KINDS:
            for seed in range(n_sets):
                counts, positions = make_trials(seed, kind)
                judges = np.random.default_rng(seed).permutation(NEURONS) < NEURONS // 2
                found = positions if align is None else align(counts[:, :, ~judges])
                shares.append(held_out_r2(counts[:, :, judges], found))
        means = np.reshape(shares, (len(KINDS), n_sets)).mean(axis=1)
        print_row(name, [f"{mean:.3f}" for mean in means])


if __name__ == "__main__":
    main()
