"""How accurate: known warps and real people, against other packages.

    pip install . dtaidistance tslearn gdtw fdasrsf aeon affinewarp scikit-fda
    python benchmarks/accuracy.py DATA_FOLDER [TABLES ...] [--peers]

DATA_FOLDER holds hdm05/hdm05_positions.npz and utkinect and cmu07_walk of the same form. Every
peer is fed postures and velocities (smoothed over 3 % of the clip). Aligned pairs are reported at
the best of a peer's settings, for each number of each cell by itself; of common time lines, every
setting is shown. Ours have one setting for all. Of people, harness.py has what the best peers
reached, where they are not installed. Prints Markdown.
"""

import sys
import time
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
    print_head,
    print_row,
    print_versions,
    ratio,
    read_people,
    run_tables,
    show_pair,
)
from joblib import Parallel, delayed
from sklearn_motionsync import (
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.matching.filters import SMOOTHING, smooth
from sklearn_motionsync.matching.matcher import cost_features
from sklearn_motionsync.metrics import group_timing_error, keyframe_error

WITH_PEER = "moments with a peer"
LINEAR, PLAIN, DEFAULTS = "linear normalisation", "`metric=None`", "`DenseSynchronizer()`"
TIME_LINE, SPREAD = "one common time line", "spread there"
OURS = {
    LINEAR: lambda **kw: LinearSynchronizer(P, **kw),
    "the paper's method": lambda **kw: DenseSynchronizer.paper(n_frames=P, **kw),
    DEFAULTS: lambda **kw: DenseSynchronizer(P, **kw),
    PLAIN: lambda **kw: DenseSynchronizer(P, metric=None, **kw),
    "`consensus=0`": lambda **kw: DenseSynchronizer(P, consensus=0, **kw),
    '`cost="elastic"`': lambda **kw: DenseSynchronizer(P, cost="elastic", **kw),
    '`cost="posture"`': lambda **kw: DenseSynchronizer(P, cost="posture", **kw),
    "`refine=True` (single source)": lambda **kw: DenseSynchronizer(P, refine=True, **kw),
}
MAIN = [LINEAR, "the paper's method", PLAIN, DEFAULTS]
UNREFINED = {"`refine=False`": lambda **kw: DenseSynchronizer(P, refine=False, **kw)}

# -- known warps ------------------------------------------------------------------------

CELLS = [
    (lowest, highest, noise)
    for lowest, highest in ((0.5, 2.0), (0.75, 1.35))
    for noise in (0.005, 0.05, 0.2)
]


def random_warp(rng, lowest, highest):
    """tau on [0, 1] with rates between the two."""
    t = np.linspace(0, 1, 2001)
    while True:
        wave = sum(
            rng.standard_normal() / k * np.sin(np.pi * k * t + rng.uniform(0, 2 * np.pi))
            for k in (1, 2, 3)
        )
        wave = np.tanh(1.5 * wave)
        rate = np.where(wave > 0, highest, 1 / lowest) ** wave
        tau = np.concatenate([[0], np.cumsum((rate[1:] + rate[:-1]) / 2)])
        tau /= tau[-1]
        rates = np.diff(tau) * (len(t) - 1)
        if rates.min() >= lowest and rates.max() <= highest:
            return t, tau


def known_warps(seed, lowest, highest, noise, n=8, n_features=16, gain=0.05):
    """Warped copies of a random movement, and the time of each that shows what copy 0 shows."""
    rng = np.random.default_rng(seed)
    waves = np.arange(1, 7)[:, np.newaxis]
    size = rng.standard_normal((n_features, 6)) / np.arange(1, 7) ** 0.7
    shift = rng.uniform(0, 2 * np.pi, (n_features, 6, 1))

    def movement(phase):
        return np.einsum("fk,fkt->tf", size, np.sin(np.pi * waves * phase + shift))

    frames = np.linspace(0, 1, P)
    spread = movement(np.linspace(0, 1, 400)).std()
    X, truth = [], []
    for m in range(n):
        t, tau = random_warp(rng, lowest, highest) if m else (np.linspace(0, 1, 2001),) * 2
        x = movement(np.interp(frames, tau, t))
        gains = 1 + gain * rng.standard_normal(n_features) if m else 1
        X.append(x * gains + noise * spread * rng.standard_normal(x.shape))
        truth.append(np.interp(frames, t, tau) * (P - 1))
    return X, np.array(truth)


def known_table(folder):
    """Mean error in frames of 100, copy 0 against the others, four random sets a cell."""
    sets = {cell: [known_warps(seed, *cell) for seed in range(4)] for cell in CELLS}

    def row(times_of):
        return [
            np.mean([np.abs(times_of(X)[1:] - truth[1:]).mean() for X, truth in sets[cell]])
            for cell in CELLS
        ]

    ours = OURS | UNREFINED
    rows = {name: row(lambda X, m=m: ours_to(m, X, 0)) for name, m in ours.items()}
    rows |= best_of_peers(lambda align, kind: row(lambda X: peer_to(align, kind, X, 0)))
    header = [f"{low}-{high}, noise {noise:.1%}" for low, high, noise in CELLS]
    print_table("known warps: rates, noise", header, rows, show_mean)


# -- real people ------------------------------------------------------------------------


def people_tables(folder):
    """People held out, all ordered pairs, one common time line, and the other settings."""
    people = read_people(folder)
    work = [delayed(judge)(one, make) for make in OURS.values() for one in people]
    done = Parallel(n_jobs=-1)(work)
    held_out, pairs, lines, health = {}, {}, {}, {}
    for i, name in enumerate(OURS):
        parts = zip(*done[i * len(people) : (i + 1) * len(people)], strict=True)
        of_others, of_all, of_lines, health[name] = parts
        held_out[name], pairs[name], lines[name] = map(merged, (of_others, of_all, of_lines))
    scores = {
        name: [
            *(show_pair(geometric_means(figures(of[name]))) for of in (held_out, pairs)),
            *on_line(lines[name]),
        ]
        for name in OURS
    }
    head = ["people held out", "all ordered pairs", TIME_LINE, SPREAD]
    print_head("31 moments", head)
    for name in MAIN:
        print_row(name, scores[name])
    for name, line in best_time_lines(people).items():
        print_row(name, ["-", "-", *on_line(line)])
    of_peers = best_peer(people)
    event_table("people held out", held_out)
    event_table("all ordered pairs", pairs, {"best peer": of_peers})
    print_head("ratio of geometric means", ["of the mean errors", "of the median errors"])
    for label, errors in (("people held out", held_out), ("all ordered pairs", pairs)):
        for keys, which in ((list(errors[LINEAR]), "all moments"), (with_peer(), WITH_PEER)):
            print_row(f"{label}, {which}", compared(errors, PLAIN, keys))
    print_head("geometric mean", [*head, "stand still", "hurry", "spread of velocity"])
    for name in OURS:
        still, hurry, spread = np.mean(health[name], axis=0)
        print_row(name, [*scores[name], f"{still:.0%}", f"{hurry:.0%}", f"{spread:.2f}"])


def judge(one, make):
    """Errors of an action: actors held out, all pairs, one time line; the health of all pairs."""
    pairs = one.to_patterns(partial(ours_to, make))
    line = one.to_time_line(lambda X: ours_to(make, X, "median"))
    return one.to_strangers(make).errors(), pairs.errors(), line, pairs.health()


def merged(of_actions):
    return {event: errors for one in of_actions for event, errors in one.items()}


def event_table(corner, errors, others=None):
    """A line an event: mean / median error of three settings, and other figures; their means."""
    columns = {name: figures(errors[name]) for name in (LINEAR, PLAIN, DEFAULTS)} | (others or {})
    print_head(corner, ["pairs", *columns])
    for key, found in errors[LINEAR].items():
        cells = [show_pair(column[key]) if key in column else "-" for column in columns.values()]
        print_row(f"`{key[0]}`, {key[1]}", [str(len(found)), *cells])
    for label, keys in (("all moments", list(errors[LINEAR])), (WITH_PEER, with_peer())):
        cells = [""]
        for column in columns.values():
            some = {key: column[key] for key in keys if key in column}
            cells.append(show_pair(geometric_means(some)) if len(some) == len(keys) else "-")
        print_row(f"geometric mean, {label}", cells)


def compared(errors, name, keys):
    """The defaults over what they are without a metric, with 95 % intervals."""
    ours, other = (figures({k: errors[one][k] for k in keys}) for one in (DEFAULTS, name))
    return [f"{r:.2f} ({low:.2f} to {high:.2f})" for r, low, high in ratio(ours, other).T]


def with_peer():
    """The events that peers were measured on."""
    return [(event.action, event.name) for event in EVENTS if event.peers]


def best_peer(people):
    """Mean and median error of the best peer: as measured here, or else as in harness.py."""

    def row(align, kind):
        warps = [one.to_patterns(partial(peer_to, align, kind)) for one in people]
        return [list(figures(one.errors()).items()) for one in warps]

    best, single = {}, {}
    for label, actions in best_of_peers(row).items():
        by_setting = zip(*actions, strict=True)
        for (text, *_), parts in zip(peers.settings(label), by_setting, strict=True):
            errors = {event: pair for part in parts for event, pair in part}
            some = {event: errors[event] for event in with_peer()}
            single[f"{label}, {text}"] = geometric_means(some)
            for event, pair in errors.items():
                best[event] = np.min([pair, best.get(event, pair)], axis=0)
    if single:
        label = min(single, key=lambda name: single[name][0])
        print_head("the best single setting of a peer", [f"geometric mean, {WITH_PEER}"])
        print_row(label, [show_pair(single[label])])
    return best or {(event.action, event.name): event.peers for event in EVENTS if event.peers}


# -- one common time line ---------------------------------------------------------------


def on_line(of_events):
    """Cells of a table: geometric means of the errors, and of the spread, on the time line."""
    errors = geometric_means(figures({key: one for key, (one, _) in of_events.items()}))
    spread, _ = geometric_means({key: (sd, sd) for key, (_, sd) in of_events.items()})
    return [show_pair(errors), f"{spread:.2f}"]


def time_line_tables(folder):
    """Each moment on one common time line, sets that are harmed, and what the median is worth."""
    people = read_people(folder)
    few = fewer_clips(folder, [event for event in EVENTS if event[:2] == THROW], 12)
    lines = {
        name: merged(
            one.to_time_line(lambda X, make=OURS[name]: ours_to(make, X, "median"))
            for one in (*people, few)
        )
        for name in MAIN
    }
    whole = [(event.action, event.name) for event in EVENTS]
    parts = (("all moments", whole), (WITH_PEER, with_peer()))
    linear, ours = lines[LINEAR], lines[DEFAULTS]
    header = [*MAIN, "spread, linear", "spread, defaults", "harmed"]
    print_head(TIME_LINE, header)
    harmed = {}
    for key in linear:
        (before, sd_before), (after, sd_after) = linear[key], ours[key]
        told = harm(linear[key], ours[key])
        cells = [show_pair(figures({0: line[key][0]})[0]) for line in lines.values()]
        spreads = [f"{sd_before:.2f}", f"{sd_after:.2f}"]
        print_row(f"`{key[0]}`, {key[1]}", [*cells, *spreads, told])
        if told:
            means = [f"{before.mean():.2f}", f"{after.mean():.2f}"]
            harmed[f"`{key[0]}`, {key[1]}"] = [*means, *spreads]
    for label, keys in parts:
        means = {name: on_line({key: lines[name][key] for key in keys}) for name in lines}
        spreads = [means[LINEAR][1], means[DEFAULTS][1]]
        print_row(f"geometric mean, {label}", [*(m for m, _ in means.values()), *spreads, ""])
    print_head("harmed", ["error, linear", "error, defaults", "spread, linear", "spread, defaults"])
    for name, cells in harmed.items():
        print_row(name, cells)
    print_head("template of the defaults", [TIME_LINE, SPREAD])
    print_row("the median", on_line({key: ours[key] for key in whole}))
    print_row("each trial in turn, mean", on_line(merged(map(of_each_template, people))))
    print_time_lines_of_peers(people)


def harm(before, after):
    """What of a moment, (errors, spread) each, is larger after than before, as text."""
    larger = {"error": after[0].mean() > before[0].mean(), "spread": after[1] > before[1]}
    return ", ".join(name for name, is_larger in larger.items() if is_larger)


def of_each_template(one):
    """The errors with each clip as the template, and the mean of the spreads."""
    every = [
        one.to_time_line(lambda X, n=n: ours_to(OURS[DEFAULTS], X, n)) for n in range(len(one.X))
    ]
    return {
        key: (np.concatenate([e[key][0] for e in every]), np.mean([e[key][1] for e in every]))
        for key in every[0]
    }


def print_time_lines_of_peers(people):
    """Every setting of the installed packages that put a set on one time line."""
    found = time_lines_of_peers(people)
    if found:
        print_head("other packages", [TIME_LINE, f"{TIME_LINE}, {WITH_PEER}", SPREAD])
    for label, of_settings in found.items():
        for text, line in of_settings.items():
            errors, spread = on_line(line)
            some, _ = on_line({key: line[key] for key in with_peer()})
            print_row(f"{label}, {text}", [errors, some, spread])


def time_lines_of_peers(people):
    """{label: {setting: {(action, event): (errors, spread)}}} of the installed packages."""

    def row(align, kind):
        return merged(one.to_time_line(lambda X: align(peer_features(X, kind))) for one in people)

    return {
        label: {text: line for (text, *_), line in zip(peers.settings(label), lines, strict=True)}
        for label, lines in of_peers(row, peers.TIME_LINES).items()
    }


def best_time_lines(people):
    """Of each installed package, the setting with the smallest mean error."""
    best = {}
    for label, of_settings in time_lines_of_peers(people).items():
        means = {
            text: geometric_means(figures({key: one for key, (one, _) in line.items()}))[0]
            for text, line in of_settings.items()
        }
        text = min(means, key=means.get)
        best[f"{label}, {text}"] = of_settings[text]
    return best


# -- refining, key-frames ---------------------------------------------------------------


def refinement_table(folder):
    """What refine="auto" goes by, and what refining really does to the error."""
    head = "| data | unexplained variance | refines | error without | error with |"
    print(f"\n{head}\n|---|---|---|---|---|")
    for name, X, pattern, error in refinement_cases(folder):
        sync = DenseSynchronizer(P, pattern).fit(X)
        texts = [f"{sync.unexplained_variance_:.3f}", "yes" if sync.refines_ else "no"]
        for refine in (False, True):
            sync = DenseSynchronizer(P, sync.pattern_index_, refine=refine).fit(X)
            texts += [f"{error(sync.match(X).times, sync.pattern_index_):.2f}"]
        print(f"| {name} | " + " | ".join(texts) + " |", flush=True)


def refinement_cases(folder):
    """Name, performances, pattern, and the error of times to a pattern."""
    for n_features in (16, 4, 2, 1):
        for cell in CELLS[:3]:
            X, truth = known_warps(0, *cell, n_features=n_features)
            name = f"known warps, {n_features} features, noise {cell[2]:.1%}"
            yield name, X, 0, lambda times, n, truth=truth: np.abs(times[1:] - truth[1:]).mean()
    for style in (1.0, 4.0):
        bunch = make_bending(24, style=style, random_state=0)
        postures = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
        points = ASpace().fit_transform(postures)
        name = f"make_bending, style {style:g}"
        yield name, points, "median", lambda times, n, b=bunch: group_timing_error(times, b.times)
    for one in read_people(folder):
        yield f"`{one.name}`", one.X, "median", error_of_events(one)
        if one.name == "walk":
            first = [x[:, :1] for x in one.X]
            yield "`walk`, first feature", first, "median", error_of_events(one)


def error_of_events(one):
    """The mean error over the events of an action, of all clips to one of them, or NaN."""

    def error(times, n):
        found = []
        for at in one.moments.values():
            landed = np.array([np.interp(at[n], np.arange(P), tau) for tau in times])
            found.append(np.delete(np.abs(landed - at), n))
        found = np.concatenate(found)
        return found[np.isfinite(found)].mean() if np.isfinite(found).any() else np.nan

    return error


def bending_table(folder):
    """make_bending, four random sets: key-frames missed, and timing error without a pattern."""
    given = "`LinearSynchronizer`, true key-frames"
    makers = {name: OURS[name] for name in list(OURS)[:4]}
    makers |= {given: lambda: LinearSynchronizer(P)}
    rows = {name: ([], []) for name in makers}
    for seed in range(4):
        bunch = make_bending(random_state=seed)
        postures = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
        X, lengths = ASpace().fit_transform(postures), [len(x) for x in bunch.data]
        for name, make in makers.items():
            known = {"keyframes": bunch.keyframes} if name == given else {}
            sync = make().fit(X, **known)
            times, n = sync.match(X, **known).times, sync.pattern_index_
            pattern = bunch.keyframes[n] * (P - 1) / (lengths[n] - 1)
            rows[name][0].append(keyframe_error(times, bunch.keyframes, pattern, lengths))
            rows[name][1].append(group_timing_error(times, bunch.times))
    header = ["key-frames missed by", "timing error of the group"]
    cells = {name: [np.mean(values) for values in row] for name, row in rows.items()}
    print_table("make_bending", header, cells, show_mean)


# -- shared -----------------------------------------------------------------------------


def ours_to(make, X, n):
    return make(pattern=n).fit(X).match(X).times


def peer_features(X, kind):
    on_clock = LinearSynchronizer(P).fit_transform(X)
    on_clock = on_clock - on_clock.mean(axis=(0, 1))
    if kind == "velocity":
        return cost_features(on_clock, "velocity")
    if kind == "speed":
        return np.linalg.norm(cost_features(on_clock, "velocity"), axis=2, keepdims=True)
    return smooth(on_clock, SMOOTHING * (P - 1)) if kind == "smoothed" else on_clock


def peer_to(align, kind, X, n):
    features = peer_features(X, kind)
    clock = np.arange(P, dtype=float)
    return np.array([align(features[n], y) if m != n else clock for m, y in enumerate(features)])


def best_of_peers(row):
    """Rows of the installed peers: every cell holds one result a setting."""
    found = of_peers(row, peers.PEERS)
    return {label: list(zip(*cells, strict=True)) for label, cells in found.items()}


def of_peers(row, labels):
    """What ``row(align, kind)`` finds for each setting of the installed peers, by label."""
    rows = {}
    for label in labels:
        if peers.installed(label) is None:
            print(f"{label} is not installed", file=sys.stderr)
            continue
        found = []
        for text, kind, align in peers.settings(label):
            start = time.perf_counter()
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found.append(row(align, kind))
            seconds = time.perf_counter() - start
            print(f"{label}, {text}: {seconds:.0f} s", file=sys.stderr, flush=True)
        rows[label] = found
    return rows


def show_mean(settings):
    return f"{min(settings):.3f}"


def print_table(corner, header, rows, show):
    """Markdown; a cell holds a tuple with one value a setting, or a single value."""
    print_head(corner, header)
    for name, cells in rows.items():
        print_row(name, [show(cell if isinstance(cell, tuple) else (cell,)) for cell in cells])


TABLES = {
    "refining": refinement_table,
    "bends": bending_table,
    "known-warps": known_table,
    "time-line": time_line_tables,
    "people": people_tables,
}


def prepare(options):
    if not options.peers:
        peers.leave_out()
    print_versions(*dict.fromkeys(name for name, *_ in (peers.PEERS | peers.TIME_LINES).values()))


if __name__ == "__main__":
    command = command_line(__doc__)
    command.add_argument("--peers", action="store_true", help="with other packages")
    run_tables(TABLES, command, prepare)
