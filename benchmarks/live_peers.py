"""Other ways to tell the phase of a running movement, beside `OnlineSynchronizer`.

Every follower is a function of what is known of an action (`Known`) and a clip, and gives the phase
at every frame of the clip, of which it sees the frames up to that one only: in frames of the
pattern. `linear_known` alone is told how long the clip will be. All of them are written here from
their descriptions; those that match look at the clip on *ticks*, the times in which a performance
of mean duration passes one frame of the pattern.
"""

from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.distance import cdist

# Of the rows: positions a frame, largest rate, share of the rate in velocities.
SUBFRAMES, MAX_RATE, RATE_WEIGHT = 4, 4, 0.2
# Width of the one-sided filter, in frames of the pattern, and weight of changes of pace.
WIDTH, SMOOTHNESS = 2.0, 0.3


class Known(NamedTuple):
    """What training clips tell: the mean and the median one on the clock, their mean duration."""

    mean: np.ndarray
    median: np.ndarray
    duration: float

    @property
    def tick(self):
        """Frames of a clip in which one of mean duration passes one frame of the pattern."""
        return (self.duration - 1) / (len(self.mean) - 1)

    def ticks(self, clip):
        """The clip at its ticks: (n_ticks, n_features)."""
        n_ticks = int((len(clip) - 1) / self.tick + 1e-9) + 1
        return sampled(clip, np.minimum(np.arange(n_ticks) * self.tick, len(clip) - 1))

    def at_frames(self, phases, n_frames):
        """Phases at ticks as phases at frames: between two ticks it goes on at the mean pace."""
        frames = np.arange(n_frames) / self.tick
        last = np.minimum((frames + 1e-9).astype(int), len(phases) - 1)
        return np.minimum(np.asarray(phases)[last] + frames - last, len(self.mean) - 1)


def sampled(x, times):
    """A sequence at times between its frames."""
    before = np.clip(np.floor(times).astype(int), 0, len(x) - 2)
    part = (times - before)[:, np.newaxis]
    return x[before] * (1 - part) + x[before + 1] * part


# -- rows of the trellis, by hand -------------------------------------------------------


def backward_velocity(x, samples):
    """One-sided derivative by the frame, of so many samples a frame: twice through a low-pass."""
    keep = np.exp(-1 / (WIDTH * samples))
    moved = x - x[0]
    for _ in range(2):
        moved = lfilter([1 - keep], [1, -keep], moved, axis=0)
    return samples * np.diff(moved, axis=0, prepend=moved[:1])


def central_velocity(x, samples):
    """Two-sided derivative by the frame, of so many samples a frame."""
    return samples * np.gradient(x, axis=0)


def follow_rows(base, moving, smoothness=SMOOTHNESS, rate_weight=RATE_WEIGHT):
    """Where the cheapest path to every row ends: the beginning is pinned, the end free.

    Parameters
    ----------
    base : ndarray, shape (n_ticks, n_compared)
    moving : ndarray, shape ((P - 1) * SUBFRAMES + 1, n_compared)

    Returns
    -------
    ndarray, shape (n_ticks,)
    """
    energy = np.square(moving).sum(axis=1)
    rates = np.arange(MAX_RATE * SUBFRAMES + 1) / SUBFRAMES
    weights = 1 + rate_weight * (rates - 1)
    penalties = smoothness * energy.mean() * (rates - 1) ** 2
    row = np.full(len(moving), np.inf)
    row[0] = 0
    phases = [0.0]
    for x in base[1:]:
        inner, best = moving @ x, np.full(len(moving), np.inf)
        for step, (weight, penalty) in enumerate(zip(weights, penalties, strict=True)):
            here = slice(step, None)
            cost = weight**2 * energy[here] - 2 * weight * inner[here] + penalty
            best[here] = np.minimum(best[here], row[: len(row) - step] + cost)
        row = best + x @ x
        phases.append(int(row.argmin()) / SUBFRAMES)
    return np.array(phases)


def rows(known, clip, pattern="mean", velocity=backward_velocity):
    """Velocities, by the rows of the trellis; ``velocity`` is that of the pattern alone."""
    pattern = getattr(known, pattern)
    fine = sampled(pattern, np.linspace(0, len(pattern) - 1, (len(pattern) - 1) * SUBFRAMES + 1))
    base = backward_velocity(known.ticks(clip), 1)
    return known.at_frames(follow_rows(base, velocity(fine, SUBFRAMES)), len(clip))


def rows_of_postures(known, clip):
    """Postures, by the rows of the trellis."""
    centre = known.mean.mean(axis=0)
    fine = np.linspace(0, len(known.mean) - 1, (len(known.mean) - 1) * SUBFRAMES + 1)
    moving = sampled(known.mean - centre, fine)
    phases = follow_rows(known.ticks(clip) - centre, moving, rate_weight=0)
    return known.at_frames(phases, len(clip))


# -- time warping -----------------------------------------------------------------------


def _compared(known, clip, kind):
    """What time warping compares: clip and pattern as postures or one-sided velocities."""
    pair = known.ticks(clip), known.mean
    return pair if kind == "postures" else tuple(backward_velocity(x, 1) for x in pair)


def open_end_dtw(known, clip, kind="velocities"):
    """DTW with the usual steps whose end is free: the best cell of the row by its path's length."""
    costs = cdist(*_compared(known, clip, kind))
    columns = np.arange(costs.shape[1])
    row, phases = None, []
    for i, cost in enumerate(costs):
        along = np.cumsum(cost)
        if row is None:
            row = along
        else:
            # Either from the row before, the diagonal costing double, or along this row.
            enter = row + cost
            enter[1:] = np.minimum(enter[1:], row[:-1] + 2 * cost[1:])
            row = along + np.minimum.accumulate(enter - along)
        phases.append(np.argmin(row / (i + columns + 1)))
    return known.at_frames(phases, len(clip))


def dixon(known, clip, kind="velocities", window=5, max_run=2):
    """On-line time warping: a window that goes on by rows, columns or both, greedily.

    S. Dixon, "Live tracking of musical performances using on-line time warping", DAFx 2005. In the
    newest row and column the cheapest cell by the length of its path says which goes on; after
    ``max_run`` of a kind it is the other's turn. A path pays double for a diagonal step. Window and
    run are the best of fifteen pairs on UTKinect.
    """
    warping = Dixon(cdist(*_compared(known, clip, kind)), window, max_run)
    phases = [warping.next() for _ in range(len(warping.costs))]
    return known.at_frames(phases, len(clip))


class Dixon:
    def __init__(self, costs, window, max_run):
        self.costs, self.window, self.max_run = costs, window, max_run
        self.total = np.full(costs.shape, np.inf)
        self.total[0, 0] = costs[0, 0]
        self.row = self.column = self.run = 0
        self.before = self.turn = None

    def next(self):
        """The column of the best cell, after one more row and columns until a row is wanted."""
        if self.turn is not None:
            self.row += 1
            for j in range(max(0, self.column - self.window + 1), self.column + 1):
                self._evaluate(self.row, j)
            if self.turn == "both":
                self._next_column()
        while self._choose() == "column":
            self._next_column()
        return self._best()[1]

    def _next_column(self):
        self.column += 1
        for i in range(max(0, self.row - self.window + 1), self.row + 1):
            self._evaluate(i, self.column)

    def _choose(self):
        if self.column == self.costs.shape[1] - 1:
            turn = "row"
        elif self.row < self.window:
            turn = "both"
        elif self.run > self.max_run:
            turn = "column" if self.before == "row" else "row"
        else:
            i, j = self._best()
            turn = "column" if i < self.row else "row" if j < self.column else "both"
        self.run = self.run + 1 if turn == self.before else 1
        if turn != "both":
            self.before = turn
        self.turn = turn
        return turn

    def _best(self):
        """The cell of the newest row and column whose path is cheapest by its length."""
        i, j = self.row, self.column
        columns = np.arange(max(0, j - self.window + 1), j + 1)
        by_row = self.total[i, columns] / (i + columns + 1)
        lines = np.arange(max(0, i - self.window + 1), i + 1)
        by_column = self.total[lines, j] / (lines + j + 1)
        if by_row.min() <= by_column.min():
            return i, int(columns[by_row.argmin()])
        return int(lines[by_column.argmin()]), j

    def _evaluate(self, i, j):
        cost, total = self.costs[i, j], self.total
        ways = [total[i - 1, j] + cost] if i else []
        ways += [total[i, j - 1] + cost] if j else []
        ways += [total[i - 1, j - 1] + 2 * cost] if i and j else []
        total[i, j] = min(ways, default=cost)


# -- without matching -------------------------------------------------------------------


def linear_known(known, clip):
    """Evenly, as if it were known when the clip ends."""
    return np.linspace(0, len(known.mean) - 1, len(clip))


def linear_mean(known, clip):
    """Evenly, as a clip of mean duration."""
    return np.minimum(np.arange(len(clip)) / known.tick, len(known.mean) - 1)


def nearest_posture(known, clip):
    """Where the mean is nearest to what is seen, whatever came before."""
    return cdist(clip, known.mean).argmin(axis=1).astype(float)


PEERS = {
    "velocities by hand: mean, one-sided on both sides": rows,
    "the same, median performance instead of the mean": lambda *given: rows(
        *given, pattern="median"
    ),
    "the same, central derivative of the pattern": lambda *given: rows(
        *given, velocity=central_velocity
    ),
    "the same, postures instead of velocities": rows_of_postures,
    "open-end DTW, velocities": open_end_dtw,
    "open-end DTW, postures": lambda *given: open_end_dtw(*given, kind="postures"),
    "Dixon's online DTW, velocities": dixon,
    "Dixon's online DTW, postures": lambda *given: dixon(*given, kind="postures"),
    "nearest posture": nearest_posture,
    "linear, duration known": linear_known,
    "linear, mean duration": linear_mean,
}
