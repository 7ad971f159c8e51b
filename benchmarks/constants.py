"""What every constant of a fit is worth: switched off, halved and doubled, on five sorts of data.

    python benchmarks/constants.py [--data ../shared/data] [--only _RIDGE ...]

`CONSTANTS` lists what the defaults of `DenseSynchronizer` rest on. Prints by how many per cent the
error grows, in the geometric mean over moments, joints or sets:

- pairs: key moments of the people on whom the defaults were chosen, from patterns to trials;
- one clock: the same moments, from any trial to any other over the clock of one fit;
- unseen: moments of other actions over one clock (events44), on which nothing was chosen;
- forces: the spread that is left of landmarks of single curves (nlreg1d), by two patterns a set;
- warps: how far known warps are missed, with noise of 0.5, 5 and 20 % and 16, 2 and 1 signals.

The worth of a constant is its largest change of all; those of less than 1 % could as well have
another value, or go. "No effect" are those that nothing here depends on, to the last bit. To be
quick every column but the second is thinned: two patterns, and every second trial, an action;
every second unseen action; two random sets. So a change of pairs, of unseen moments or of warps by
2 % may be chance. Takes five minutes on two free cores. Prints Markdown.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse
import importlib
import sys
import time
import warnings
from contextlib import ExitStack, contextmanager
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
from harness import (
    DATA,
    EVENTS,
    P,
    figures,
    geometric_means,
    known_warps,
    moment,
    on_time_line,
    print_head,
    print_row,
    read_people,
    read_unseen,
)
from joblib import Parallel, delayed
from sklearn_motionsync import DenseSynchronizer

# -- the constants ----------------------------------------------------------------------

PARAMETERS = "parameters"


class Constant(NamedTuple):
    """A constant, and what is tried in its place.

    Attributes
    ----------
    module : str
        Where it stands in the package, or ``PARAMETERS`` for a default of `DenseSynchronizer`.
    name : str
    what : str
    off : object, default=None
        The value that takes its effect away; None if there is none, or twice the value does.
    half, double : object, default=None
        By default half the value and twice the value; whole numbers stay whole.
    also : tuple of str, default=()
        Other modules that import it by its name.
    """

    module: str
    name: str
    what: str
    off: object = None
    half: object = None
    double: object = None
    also: tuple = ()

    def __str__(self):
        return f"{self.module.rsplit('.', maxsplit=1)[-1]}.{self.name}"

    @property
    def modules(self):
        """All modules that hold it."""
        names = (self.module, *self.also)
        return [importlib.import_module(f"sklearn_motionsync.{name}") for name in names]

    @property
    def value(self):
        """What it is now."""
        if self.module == PARAMETERS:
            return defaults()[self.name]
        return getattr(self.modules[0], self.name)

    def tried(self):
        """{"off", "half", "double": value} of what is tried."""
        values = {
            "off": self.off,
            "half": scaled(self.value, 0.5) if self.half is None else self.half,
            "double": scaled(self.value, 2) if self.double is None else self.double,
        }
        return {label: value for label, value in values.items() if value is not None}

    @contextmanager
    def switched(self, value):
        """The package with another value."""
        if self.module == PARAMETERS:
            with patch.dict(defaults(), {self.name: value}):
                yield
            return
        with ExitStack() as stack:
            for module in self.modules:
                stack.enter_context(patch.object(module, self.name, value))
            yield


def scaled(value, factor):
    """A number times a factor; a whole number stays whole, and 1 at least."""
    return max(1, int(value * factor)) if isinstance(value, int) else value * factor


def defaults():
    """The defaults of `DenseSynchronizer`, which can be changed."""
    return DenseSynchronizer.__init__.__kwdefaults__


FILTERS = "matching.filters"
LEARNING, PARTS = "synchronizers.learning", "synchronizers.parts"
MATCHER, METRIC, COSTS = "matching.matcher", "matching.metric", "matching.costs"
SHARPENING, REFINEMENT = "matching.sharpening", "matching.refinement"
CONSENSUS = "matching.consensus"
# Not here, as nothing below depends on them: what guards against rounding, what bounds memory, what
# only gaps, key-frames, intervals, warnings, or more than 100 trials or frames meet.
CONSTANTS = [
    Constant(PARAMETERS, "consensus", "number of trials that vote", off=0),
    Constant(PARAMETERS, "smoothness", "weight of changes of pace", off=0.0),
    Constant(PARAMETERS, "max_rate", "largest rate of a path", off=20),
    Constant(COSTS, "RATE_WEIGHT", "weight of the rate", off=0.0, also=(METRIC,)),
    Constant(LEARNING, "_WIDE", "largest time shift with a metric", off=1.0),
    Constant(LEARNING, "_NARROW", "largest time shift without one", off=1.0),
    Constant(LEARNING, "_LEARNING_OFFSET", "largest time shift while learning", off=1.0),
    Constant(
        FILTERS,
        "FINE_SMOOTHING",
        "smoothing with a metric, and of shifts",
        off=0.0,
        also=(LEARNING,),
    ),
    Constant(LEARNING, "SMOOTHING", "smoothing of velocities without one", off=0.0),
    Constant(LEARNING, "MOST_LEARNT", "trials to learn from", off=10_000, also=(PARTS,)),
    Constant(LEARNING, "SAME_SOURCE", "variance left of one source", off=0.0),
    Constant(MATCHER, "FRAMES", "frames to learn from", off=10_000),
    Constant(MATCHER, "_WORTH", "when the search takes fewer frames", off=np.inf),
    Constant(METRIC, "_RELIABLE", "standard errors of a reliable signal", off=-np.inf),
    Constant(METRIC, "RIDGE", "ridge of covariances", off=1e-9, also=(SHARPENING,)),
    Constant(METRIC, "_SHRINKAGE", "power of eigenvalues", off=1.0),
    Constant(
        METRIC,
        "RETAINED",
        "variance that axes retain",
        off=0.99999,
        half=0.995,
        double=0.98,
        also=(SHARPENING,),
    ),
    Constant(
        METRIC, "LONGEST_LAG", "longest lag of the autocorrelation", off=0.0, also=(REFINEMENT,)
    ),
    Constant(FILTERS, "_NOISE", "share of noise that is allowed", off=np.inf),
    Constant(FILTERS, "_ORDER", "order of the differences that are noise"),
    Constant(FILTERS, "LEAST_SIGMA", "narrowest Gaussian on frames", also=(CONSENSUS,)),
    Constant(SHARPENING, "_FINEST", "narrowest smoothing", off=0.001),
    Constant(SHARPENING, "_SLOW", "speed below which roots are linear", off=1e-6),
    Constant(SHARPENING, "_SUBFRAMES", "positions a frame", off=1, half=2),
    Constant(SHARPENING, "_REACH", "largest change of a warp", off=0.0),
    Constant(SHARPENING, "_MAX_RATE", "largest rate of a change", off=20, half=1.5),
    Constant(SHARPENING, "_SMOOTHNESS", "weight of changes of pace", off=0.0),
    Constant(SHARPENING, "_TRUST", "power of the agreement", off=0.0),
    Constant(SHARPENING, "_HALF", "precision of which half is believed", off=1e-9),
    Constant(REFINEMENT, "_RATE_CHANGE", "change of the rate to be expected", off=100.0),
    Constant(REFINEMENT, "_SHORTEST_STEP", "step at which refining ends", off=0.0),
]

# -- the columns: each a function of the data that gives {what is judged: error} ---------------

# Landmarks of the curves of nlreg1d, as `events.moment` tells them.
LANDMARKS = {
    "Besier2009-vastus": ("rise", "fall"),
    "Pataky2014-anteroposterior": ("rise",),
    "Pataky2014-mediolateral": ("max", "fall"),
    "SimulatedA": ("max", "rise", "fall"),
    "SimulatedB": ("max", "rise", "fall"),
}
NOISE, SIGNALS = (0.005, 0.05, 0.2), (16, 2, 1)
RATES = (0.5, 2.0), (0.75, 1.35)


def patterns_of(one):
    """Two patterns of an action that show all of its moments."""
    shown = np.isfinite([at[one.patterns] for at in one.moments.values()]).all(axis=0)
    able = one.patterns[shown]
    return able[[len(able) // 3, 2 * len(able) // 3]]


def errors_of_pairs(one, pattern, others):
    """Errors of the moments of an action, from a pattern to other trials."""
    sync = DenseSynchronizer(P, pattern=int(pattern)).fit(one.X)
    others = others[others != pattern]
    times = sync.match([one.X[i] for i in others]).times
    for event, at in one.moments.items():
        landed = np.array([np.interp(at[pattern], np.arange(P), tau) for tau in times])
        yield event, np.abs(landed - at[others])


def pairs(people):
    """Mean errors of moments from patterns to trials."""
    errors: dict = {}
    for one in people:
        others = np.arange(0, len(one.X), 2)
        for pattern in patterns_of(one):
            for event, misses in errors_of_pairs(one, pattern, others):
                errors.setdefault((one.name, event), []).extend(misses[np.isfinite(misses)])
    return {event: np.mean(misses) for event, misses in errors.items()}


def on_one_clock(sets):
    """Mean errors of moments of sets, (name, trials, moments), over one clock each."""
    errors = {}
    for name, trials, moments in sets:
        times = DenseSynchronizer(P).fit(trials).match(trials).times
        for event, at in moments.items():
            errors[name, event] = on_time_line(times, at)[0].mean()
    return errors


def read_landmarks(folder):
    """(name, curves, {landmark: times}) of sets of nlreg1d."""
    sets = []
    for name, kinds in LANDMARKS.items():
        curves = np.loadtxt(folder / f"{name}.csv", delimiter=",")[:, 1:]
        moments = {
            kind: np.array([moment(curve, kind) for curve in curves]) * (P - 1) for kind in kinds
        }
        sets.append((name, list(curves[:, :, np.newaxis]), moments))
    return sets


def forces(sets):
    """Standard deviations of landmarks on the clocks of two patterns, in the mean."""
    spread = {}
    for name, curves, moments in sets:
        patterns = 2 * len(curves) // 5, 3 * len(curves) // 5
        syncs = [DenseSynchronizer(P, pattern=n).fit(curves) for n in patterns]
        warps = [sync.match(curves).times for sync in syncs]
        for landmark, at in moments.items():
            spread[name, landmark] = np.mean([on_time_line(times, at)[1] for times in warps])
    return spread


def make_warps():
    """{(noise, signals): sets with their true warps}."""
    return {
        (noise, signals): [
            known_warps(seed, lowest, highest, noise, n_features=signals)
            for seed, (lowest, highest) in enumerate(RATES)
        ]
        for noise, signals in product(NOISE, SIGNALS)
    }


def missed_warps(cells):
    """Mean errors of warps to the first copy."""

    def error(X, truth):
        times = DenseSynchronizer(P, pattern=0).fit(X).match(X).times
        return np.abs(times[1:] - truth[1:]).mean()

    return {cell: np.mean([error(X, truth) for X, truth in sets]) for cell, sets in cells.items()}


def columns(folder):
    """Functions, by the names of the columns, that give the errors of the package as it is."""
    people = read_people(folder, [event for event in EVENTS if event.chosen])
    unseen = read_unseen(folder / "events44" / "events44.npz")[::2]
    return {
        "pairs": partial(pairs, people),
        "one clock": partial(on_one_clock, [(one.name, one.X, one.moments) for one in people]),
        "unseen": partial(on_one_clock, unseen),
        "forces": partial(forces, read_landmarks(folder / "nlreg1d")),
        "warps": partial(missed_warps, make_warps()),
    }


# -- the table --------------------------------------------------------------------------


def judged(of_columns):
    """Geometric mean of the errors of every column: (n_columns,)."""
    return np.array(
        [
            geometric_means(figures({what: [error] for what, error in errors().items()}))[0]
            for errors in of_columns.values()
        ]
    )


def judge_all(tasks, folder):
    """The errors of every column for each task: a constant and a value, or None."""
    warnings.simplefilter("ignore")
    of_columns, errors = columns(folder), []
    for constant, value in tasks:
        start = time.process_time()
        if constant is None:
            errors.append(judged(of_columns))
        else:
            with constant.switched(value):
                errors.append(judged(of_columns))
        seconds = time.process_time() - start
        print(f"{constant}, {value}: {seconds:.1f} s", file=sys.stderr, flush=True)
    return errors


def changes_of(constants, folder, n_jobs=2):
    """{constant: {label: changes (n_columns,) in per cent}}."""
    tried = [(one, *each) for one in constants for each in one.tried().items()]
    tasks = [(None, None), *((one, value) for one, _, value in tried)]
    # A process reads the data once.
    shares = [tasks[i::n_jobs] for i in range(n_jobs)]
    done = Parallel(n_jobs)(delayed(judge_all)(share, folder) for share in shares)
    errors = np.empty((len(tasks), len(done[0][0])))
    for i, share in enumerate(done):
        errors[i::n_jobs] = share
    changes: dict = {one: {} for one in constants}
    for (one, label, _), switched in zip(tried, errors[1:], strict=True):
        changes[one][label] = 100 * (switched / errors[0] - 1)
    return changes


def show_change(change):
    return "0" if change == 0 else f"{change:+.1f}"


def worth(of_labels):
    """The largest change of a constant."""
    return max(np.abs(change).max() for change in of_labels.values())


def print_changes(changes, names):
    """A line for each value, the constants of the largest worth first; then the others."""
    ranked = sorted(changes, key=lambda one: -worth(changes[one]))
    print_head("constant", ["what it is", "", "value", *names, "worth"])
    for one in ranked:
        size = worth(changes[one])
        mark = f"{size:.1f}" if size >= 1 else "no effect" if size == 0 else f"{size:.1f}, below 1"
        head = [f"`{one}` = {one.value}", one.what]
        for label, change in changes[one].items():
            cells = [show_change(x) for x in change]
            print_row(head[0], [head[1], label, str(one.tried()[label]), *cells, mark])
            head, mark = ["", ""], ""
    small = [f"`{one}`" for one in ranked if worth(changes[one]) < 1]
    print(f"\nWorth less than 1 % in all columns: {', '.join(small) or 'none'}.")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("--only", nargs="+", help="names of some constants; by default all")
    options = parser.parse_args()
    chosen = [one for one in CONSTANTS if options.only is None or one.name in options.only]
    changes = changes_of(chosen, options.data)
    print_changes(changes, ["pairs", "one clock", "unseen", "forces", "warps"])


if __name__ == "__main__":
    main()
