"""How accurate: key moments of real people, and known warps.

    pip install . tslearn fdasrsf affinewarp
    python benchmarks/accuracy.py DATA_FOLDER [people] [unseen] [known-warps] [peers]

DATA_FOLDER holds hdm05/hdm05_positions.npz and utkinect and cmu07_walk of the same form. *People*
has the key moments of harness.py in three ways: of people held out, of all ordered pairs, and on
one common time line of a fit with the median pattern. *Peers* puts the sets on a common time line
with other packages: they are fed poses and velocities (smoothed over 3 % of the clip), and every
setting is shown, where ours have one for all. Prints Markdown.
"""

import sys
import warnings
from functools import partial

import numpy as np
import peers
from harness import (
    EVENTS,
    THROW,
    P,
    command_line,
    fewer_clips,
    figures,
    geometric_means,
    known_warps,
    on_time_line,
    percent,
    print_head,
    print_row,
    print_versions,
    ratio,
    read_people,
    read_unseen,
    run_tables,
    show_pair,
    version_of,
)
from joblib import Parallel, delayed
from sklearn_motionsync import (
    DenseSynchronizer,
    LinearSynchronizer,
)
from sklearn_motionsync.matching.filters import SMOOTHING, smooth
from sklearn_motionsync.matching.matcher import cost_features

LINEAR, PAPER = "linear normalisation", "the paper's method"
PLAIN, DEFAULTS = "`metric=None`", "`DenseSynchronizer()`"
HELD_OUT, PAIRS, TIME_LINE = "people held out", "all ordered pairs", "one common time line"
OURS = {
    LINEAR: lambda **kw: LinearSynchronizer(P, **kw),
    PAPER: lambda **kw: DenseSynchronizer.paper(n_frames=P, **kw),
    DEFAULTS: lambda **kw: DenseSynchronizer(P, **kw),
    PLAIN: lambda **kw: DenseSynchronizer(P, metric=None, **kw),
    "`consensus=0`": lambda **kw: DenseSynchronizer(P, consensus=0, **kw),
    '`cost="elastic"`': lambda **kw: DenseSynchronizer(P, cost="elastic", **kw),
    '`cost="pose"`': lambda **kw: DenseSynchronizer(P, cost="pose", **kw),
    "`refine=True` (single source)": lambda **kw: DenseSynchronizer(P, refine=True, **kw),
}
UNREFINED = {"`refine=False`": lambda **kw: DenseSynchronizer(P, refine=False, **kw)}


def ours_to(make, X, n):
    return make(pattern=n).fit(X).match(X).times


# -- known warps ------------------------------------------------------------------------

CELLS = [
    (lowest, highest, noise)
    for lowest, highest in ((0.5, 2.0), (0.75, 1.35))
    for noise in (0.005, 0.05, 0.2)
]


def known_table(folder):
    """Mean error in frames of 100, copy 0 against the others, four random sets a cell."""
    print_head("rates, noise", [f"{low}-{high}, {noise:.1%}" for low, high, noise in CELLS])
    sets = [[known_warps(seed, *cell) for seed in range(4)] for cell in CELLS]
    for name, make in (OURS | UNREFINED).items():
        errors = [
            np.mean([np.abs(ours_to(make, X, 0)[1:] - truth[1:]).mean() for X, truth in some])
            for some in sets
        ]
        print_row(name, [f"{error:.3f}" for error in errors])


# -- real people ------------------------------------------------------------------------


def people_table(folder):
    """The errors of every setting, the ratio to `metric=None`, and every moment."""
    few = fewer_clips(folder, [event for event in EVENTS if event[:2] == THROW], 12)
    people = read_people(folder)
    work = [delayed(judge)(one, make) for make in OURS.values() for one in people]
    done = Parallel(n_jobs=-1)(work)
    print_head("31 moments", [HELD_OUT, PAIRS, TIME_LINE, "spread there", "stand still"])
    errors = {}
    for i, name in enumerate(OURS):
        *parts, still = zip(*done[i * len(people) : (i + 1) * len(people)], strict=True)
        held_out, pairs, line = errors[name] = list(map(merged, parts))
        means = [show_pair(geometric_means(figures(of))) for of in (held_out, pairs)]
        print_row(name, [*means, *on_line(line), percent(np.mean(still))])
    print_head(f"defaults over {PLAIN}", ["ratio of mean errors", "of median errors"])
    for k, label in enumerate((HELD_OUT, PAIRS)):
        ours, plain = (figures(errors[name][k]) for name in (DEFAULTS, PLAIN))
        ratios = ratio(ours, plain).T
        print_row(label, [f"{mean:.2f} ({low:.2f} to {high:.2f})" for mean, low, high in ratios])
    for name in (LINEAR, DEFAULTS):
        errors[name][2] |= few.to_time_line(lambda X, m=OURS[name]: ours_to(m, X, "median"))
    event_table(errors[LINEAR], errors[DEFAULTS])


def judge(one, make):
    """Errors of an action in the three ways, and the share of frames that stand still."""
    pairs = one.to_patterns(partial(ours_to, make))
    line = one.to_time_line(lambda X: ours_to(make, X, "median"))
    return one.to_strangers(make).errors(), pairs.errors(), line, pairs.standing_still()


def merged(of_actions):
    return {event: errors for one in of_actions for event, errors in one.items()}


def on_line(of_events):
    """Cells of a table: geometric means of the errors, and of the spread, on the time line."""
    errors = geometric_means(figures({key: one for key, (one, _) in of_events.items()}))
    spread, _ = geometric_means({key: (sd, sd) for key, (_, sd) in of_events.items()})
    return [show_pair(errors), f"{spread:.2f}"]


def event_table(linear, ours):
    """A line an event: errors before and after in two ways, the spreads, and what is harmed."""
    both = [f"{way}, {name}" for way in (HELD_OUT, TIME_LINE) for name in ("linear", "defaults")]
    print_head("moment", [*both, "spread, linear", "spread, defaults", "harmed"])
    for key, (before, sd_before) in linear[2].items():
        after, sd_after = ours[2][key]
        found = [linear[0].get(key), ours[0].get(key), before, after]
        cells = ["-" if x is None else show_pair(figures({0: x})[0]) for x in found]
        spreads = [f"{sd_before:.2f}", f"{sd_after:.2f}", harm(linear[2][key], ours[2][key])]
        print_row(f"`{key[0]}`, {key[1]}", [*cells, *spreads])


def harm(before, after):
    """What of a moment, (errors, spread) each, is larger after than before, as text."""
    larger = {"error": after[0].mean() > before[0].mean(), "spread": after[1] > before[1]}
    return ", ".join(name for name, is_larger in larger.items() if is_larger)


def unseen_table(folder):
    """46 moments of 23 actions on which nothing was chosen, on one time line."""
    sets = read_unseen(folder / "events44" / "events44.npz")
    print_head("46 moments nothing was chosen on", [TIME_LINE, "spread there"])
    for name in (LINEAR, PAPER, DEFAULTS):
        print_row(name, of_unseen(sets, partial(ours_to, OURS[name], n="median")))


def of_unseen(sets, times_of):
    """Cells of a table: errors and spread of the moments of sets, given what finds their warps."""
    errors = {}
    for action, trials, moments in sets:
        times = times_of(trials)
        errors |= {(action, event): on_time_line(times, at) for event, at in moments.items()}
    return on_line(errors)


# -- other packages ---------------------------------------------------------------------


def peer_table(folder):
    """Every setting of the installed packages that put a set on one time line."""
    people, sets = read_people(folder), read_unseen(folder / "events44" / "events44.npz")
    columns = [TIME_LINE, "spread there", "46 moments nothing was chosen on", "spread there"]
    print_head("other packages", columns)
    for label, (package, *_) in peers.TIME_LINES.items():
        if version_of(package) is None:
            print(f"{label} is not installed", file=sys.stderr)
            continue
        for text, kind, align in peers.settings(label):
            times_of = partial(fed, align, kind)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                lines = merged([one.to_time_line(times_of) for one in people])
                print_row(f"{label}, {text}", [*on_line(lines), *of_unseen(sets, times_of)])


def fed(align, kind, X):
    """What a peer makes of the features that it is fed."""
    on_clock = LinearSynchronizer(P).fit_transform(X)
    on_clock = on_clock - on_clock.mean(axis=(0, 1))
    if kind == "velocity":
        return align(cost_features(on_clock, "velocity"))
    return align(smooth(on_clock, SMOOTHING * (P - 1)) if kind == "smoothed" else on_clock)


TABLES = {
    "people": people_table,
    "unseen": unseen_table,
    "known-warps": known_table,
    "peers": peer_table,
}

if __name__ == "__main__":
    print_versions(*dict.fromkeys(name for name, *_ in peers.TIME_LINES.values()))
    run_tables(TABLES, command_line(__doc__))
