"""The phase of a running movement: how far it is from what the whole clip says, beside peers.

    python benchmarks/live.py DATA_FOLDER [phase] [intervals]

Every actor is held out in turn: aSpace, synchronizer and mean are learnt of the others, P = 100.
The reference is the phase of a whole clip, ``DenseSynchronizer(n_frames=100).match(clip)``, read
the other way round (`truth_of`). Errors are in frames of 100, of all frames after the first fifth
of a clip, up to its last.

Peers see the frames up to the present one only. They are written here from their descriptions, and
look at the clip on *ticks*, the times in which a trial of mean duration passes one frame of
the pattern.

*Intervals* are those of 90 %, all frames counted: the constants of the package were chosen on
HDM05, and nothing was chosen on UTKinect. Prints Markdown.
"""

import functools
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from harness import (
    EVENTS,
    P,
    at_frames,
    command_line,
    percent,
    print_head,
    print_row,
    read_actions,
    run_tables,
)
from scipy.signal import lfilter
from scipy.spatial.distance import cdist
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.live import OnlineSynchronizer

ARCHIVES = {"hdm05": "HDM05", "utkinect": "UTKinect"}
OURS = "OnlineSynchronizer"
# Width of the one-sided filter of the peers, in frames of the pattern.
WIDTH = 2.0

# -- peers ------------------------------------------------------------------------------


class Known(NamedTuple):
    """What training clips tell: the mean on the clock, and the mean duration."""

    mean: np.ndarray
    duration: float

    @property
    def tick(self):
        """Frames of a clip in which one of mean duration passes one frame of the pattern."""
        return (self.duration - 1) / (len(self.mean) - 1)

    def ticks(self, clip):
        """The clip at its ticks: (n_ticks, n_features)."""
        n_ticks = int((len(clip) - 1) / self.tick + 1e-9) + 1
        return at_frames(clip, np.minimum(np.arange(n_ticks) * self.tick, len(clip) - 1))

    def at_frames(self, phases, n_frames):
        """Phases at ticks as phases at frames: between two ticks it goes on at the mean pace."""
        frames = np.arange(n_frames) / self.tick
        last = np.minimum((frames + 1e-9).astype(int), len(phases) - 1)
        return np.minimum(np.asarray(phases)[last] + frames - last, len(self.mean) - 1)


def backward_velocity(x):
    """One-sided derivative by the frame, twice through a low-pass."""
    keep = np.exp(-1 / WIDTH)
    moved = x - x[0]
    for _ in range(2):
        moved = lfilter([1 - keep], [1, -keep], moved, axis=0)
    return np.diff(moved, axis=0, prepend=moved[:1])


# -- time warping -----------------------------------------------------------------------


def dixon(known, clip, kind="velocities"):
    """On-line time warping: a window that goes on by rows, columns or both, greedily.

    S. Dixon, "Live tracking of musical performances using on-line time warping", DAFx 2005. In the
    newest row and column the cheapest cell by the length of its path says which goes on; after
    ``max_run`` of a kind it is the other's turn. A path pays double for a diagonal step. Window and
    run are the best of fifteen pairs on UTKinect.
    """
    pair = known.ticks(clip), known.mean
    pair = pair if kind == "poses" else map(backward_velocity, pair)
    warping = Dixon(cdist(*pair), window=5, max_run=2)
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


PEERS = {
    "Dixon's online DTW, velocities": dixon,
    "Dixon's online DTW, poses": functools.partial(dixon, kind="poses"),
}

# -- people -----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Fold:
    """What is known of an action from all actors but one, and the clips of that one.

    ``truths``: the phases of the frames of each clip. ``wrong``: what the same actor does
    otherwise. ``positions``: the joints of the clips. ``points``: makes features of joint
    positions.
    """

    action: str
    online: OnlineSynchronizer
    known: Known
    clips: list
    truths: list
    wrong: list
    positions: list
    points: Callable

    def errors(self, phases):
        """Absolute errors of the phases of all clips, each after its first fifth."""
        pairs = zip(phases, self.truths, strict=True)
        return [np.abs(phase - truth)[-(-len(truth) // 5) :] for phase, truth in pairs]


def phase_of(times, at):
    """When, on the clock of the pattern, a warp is at ``at``: the middle of where it stays."""
    last = len(times) - 1
    return (_first(times, at) + last - _first(last - times[::-1], last - at)) / 2


def _first(times, at):
    """The first moment at which a warp from 0 to P - 1 reaches ``at``."""
    after = np.minimum(np.searchsorted(times, at), len(times) - 1)
    before = np.maximum(after - 1, 0)
    part = (at - times[before]) / np.where(after > 0, times[after] - times[before], 1)
    return before + part


def truth_of(times, n_frames):
    """The phase of every frame of a clip, of its warp."""
    return phase_of(times, np.linspace(0, len(times) - 1, n_frames))


def held_out(actions):
    """A fold for every action and actor, by action, in the aSpace of the others.

    The actions are of one archive.
    """
    cosines = {a.name: DirectionCosines(a.skeleton).fit(a.data) for a in actions}
    poses = {a.name: cosines[a.name].transform(a.data) for a in actions}
    folds: dict = {}
    for action in actions:
        own, body = poses[action.name], cosines[action.name]
        for actor in np.unique(action.actors):
            train, test = (np.flatnonzero((action.actors == actor) == held) for held in (0, 1))
            others = [own[i] for i in train]
            points = ASpace().fit(others)
            wrong = [
                poses[a.name][i]
                for a in actions
                if a is not action
                for i in np.flatnonzero(a.actors == actor)
            ]
            clips = others, [own[i] for i in test], wrong
            # Of one action alone there is nothing wrong.
            clips = [points.transform(some) if some else [] for some in clips]
            fold = _learn(action, test, *clips, make_pipeline(body, points))
            folds.setdefault(action.name, []).append(fold)
    return folds


def _learn(action, test, training, clips, wrong, features):
    online = OnlineSynchronizer(DenseSynchronizer(n_frames=P)).fit(training)
    sync = online.synchronizer_
    whole = sync.match(clips).times
    duration = float(np.mean([len(x) for x in training]))
    return Fold(
        action=action.name,
        online=online,
        known=Known(online.mean_, duration),
        clips=clips,
        truths=[truth_of(tau, len(x)) for tau, x in zip(whole, clips, strict=True)],
        wrong=wrong,
        positions=[action.data[i] for i in test],
        points=features.transform,
    )


@functools.cache
def folds_of(folder, archive):
    """{action: folds} of an archive."""
    events = [event for event in EVENTS if event.archive == archive]
    return held_out(read_actions(folder, events))


# -- how right it is --------------------------------------------------------------------


def phase_table(folder):
    """Median / 90 % quantile of the errors of each action, a line a method; and the means."""
    for archive, name in ARCHIVES.items():
        folds = folds_of(folder, archive)
        print_head(f"phase, {name}", [*folds, "mean"])
        for method in (OURS, *PEERS):
            rows = []
            for some in folds.values():
                errors = [e for fold in some for e in fold.errors(phases_of(fold, method))]
                rows.append(np.quantile(np.concatenate(errors), [0.5, 0.9]))
            means = "{:.2f} / {:.2f}".format(*np.mean(rows, axis=0))
            print_row(method, [*("{:.1f} / {:.1f}".format(*row) for row in rows), means])


def phases_of(fold, method):
    """The phases of the clips of a fold, by ours or by a peer."""
    if method == OURS:
        return [live.phase for live in fold.online.track(fold.clips)]
    return [PEERS[method](fold.known, clip) for clip in fold.clips]


# -- intervals --------------------------------------------------------------------------


def conditions(fold):
    """Yield (name, clips, truths) of a fold; truths of what is not the action are NaN."""
    rng = np.random.default_rng(0)
    yield "as recorded", fold.clips, fold.truths
    # Positions of these archives are in metres.
    noisy = [x + rng.normal(0, 0.03, x.shape) for x in fold.positions]
    yield "noise of 3 cm", fold.points(noisy), fold.truths
    yield "all hidden for a fifth", [_with_gap(x, rng) for x in fold.clips], fold.truths
    wrong = fold.wrong[::3]
    yield "another action", wrong, [np.nan] * len(wrong)


def _with_gap(x, rng):
    begin, hidden = round(rng.uniform(0.2, 0.6) * len(x)), x.copy()
    hidden[begin : begin + max(1, round(len(x) / 5))] = np.nan
    return hidden


def inside(lower, upper, truth):
    """The share of the truths that are inside, NaN of unknown ones, and the mean width."""
    held = (lower <= truth + 1e-9) & (truth <= upper + 1e-9)
    return np.where(np.isnan(truth), np.nan, held).mean(), np.mean(upper - lower)


def interval_table(folder):
    """A line a condition: truths inside (%), and mean width, means over actions."""
    for archive, name in ARCHIVES.items():
        found = {}
        for action, some in folds_of(folder, archive).items():
            for fold in some:
                for condition, clips, truths in conditions(fold):
                    rows = found.setdefault(condition, {}).setdefault(action, [])
                    for live, truth in zip(fold.online.track(clips), truths, strict=True):
                        rows.append(inside(live.lower, live.upper, truth))
        print_head(f"intervals, {name}", ["inside, %", "mean width"])
        for condition, by_action in found.items():
            held, width = np.mean([np.mean(rows, axis=0) for rows in by_action.values()], axis=0)
            print_row(condition, [percent(held), f"{width:.1f}"])


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    run_tables({"phase": phase_table, "intervals": interval_table}, command_line(__doc__))
