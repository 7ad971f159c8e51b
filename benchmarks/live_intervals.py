"""Intervals of the live phase: how often the truth is inside, how wide they are, and alternatives.

    python benchmarks/live_intervals.py DATA_FOLDER

Every actor is held out in turn, as in live.py, and all frames of a clip count. The constants of the
package were chosen on HDM05; nothing was chosen on UTKinect. The alternatives are calibrated on
the training set in the same way, and widened by a factor so that they hold 91 % of HDM05 as
recorded. Takes five minutes.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import functools
import warnings
from typing import NamedTuple

import numpy as np
from harness import EVENTS, P, read_actions
from live_people import held_out, truth_of
from sklearn_motionsync import DenseSynchronizer, OnlineSynchronizer
from sklearn_motionsync.online.stream import Streams
from sklearn_motionsync.online.synchronizer import Reference, calibrate
from sklearn_motionsync.utils.parallel import Progress

ARCHIVES = {"hdm05": "HDM05", "utkinect": "UTKinect"}
LIMBS = [
    (f"{side}_{a}", f"{side}_{b}")
    for side in ("left", "right")
    for a, b in (("thigh", "leg"), ("arm", "forearm"))
]
RECORDED = "as recorded"


# -- conditions -------------------------------------------------------------------------


def conditions(fold, seed=0):
    """Yield (name, clips, stamps, truths) of a fold; stamps are None where frames are even.

    Truths of what is not the action are None.
    """
    rng = np.random.default_rng(seed)
    clips, truths = fold.clips, fold.truths
    yield RECORDED, clips, None, truths
    # Positions of these archives are in metres.
    for width in (1, 3):
        noisy = [x + rng.normal(0, width / 100, x.shape) for x in fold.positions]
        yield f"noise of {width} cm", fold.points(noisy), None, truths
    yield "all hidden for a fifth", [_with_gap(x, rng) for x in clips], None, truths
    stamps = [np.arange(0.0, len(x), 4) for x in clips]
    yield "every fourth frame", [x[::4] for x in clips], stamps, [t[::4] for t in truths]
    of_limbs = [_columns(fold.names, limb) for limb in LIMBS]
    if all(map(len, of_limbs)):
        hidden = [x.copy() for x in clips]
        for x in hidden:
            x[:, of_limbs[rng.integers(len(LIMBS))]] = np.nan
        yield "one limb hidden", hidden, None, truths
    yield "another action", fold.wrong[::3], None, None
    yield "standing still", [x[[0] * len(x)] for x in clips], None, None


def _with_gap(x, rng):
    begin = round(rng.uniform(0.2, 0.6) * len(x))
    return np.where(_between(len(x), begin, begin + max(1, round(len(x) / 5))), np.nan, x)


def _between(n, begin, end):
    frames = np.arange(n)[:, np.newaxis]
    return (frames >= begin) & (frames < end)


def _columns(names, limb):
    """Features of the segments of a limb, of cosines named by segment and axis."""
    return [k for k, name in enumerate(names) if name[:-2] in limb]


# -- what is inside ---------------------------------------------------------------------


def inside(lower, upper, truth):
    """Per cent of the truths that are inside, NaN of unknown ones, and the mean width."""
    held = (lower <= truth + 1e-9) & (truth <= upper + 1e-9)
    return 100 * np.where(np.isnan(truth), np.nan, held).mean(), np.mean(upper - lower)


def measured(folds, follow):
    """Coverages and widths {condition: {action: array (n_clips, 2)}}; NaN where nothing is true.

    ``follow`` gives the bounds of (fold, clips, stamps): (lower, upper) of each.
    """
    found = {}
    for action, some in folds.items():
        for fold in some:
            for name, clips, stamps, truths in conditions(fold):
                bounds = follow(fold, clips, stamps)
                truths = [np.nan] * len(clips) if truths is None else truths
                rows = [inside(*b, truth) for b, truth in zip(bounds, truths, strict=True)]
                found.setdefault(name, {}).setdefault(action, []).extend(rows)
    return found


def summary(by_action):
    """Mean over actions of coverage and width; the least coverage of an action, and its name."""
    means = {action: np.mean(rows, axis=0) for action, rows in by_action.items()}
    worst = min(means, key=lambda action: means[action][0])
    return *np.mean(list(means.values()), axis=0), means[worst][0], worst


def by_package(fold, clips, stamps):
    return [(live.lower, live.upper) for live in fold.online.track(clips, times=stamps)]


def show_intervals(name, folds):
    """A line a condition: coverage, that of the worst action, mean width."""
    print(f"\nIntervals of 90 %, {name}: truths inside (%), of the worst action; frames of {P}")
    print("| | inside | worst action | mean width |\n|---|---|---|---|")
    for condition, by_action in measured(folds, by_package).items():
        held, width, least, worst = summary(by_action)
        cells = f"{held:.0f} | {least:.0f} ({worst})" if np.isfinite(held) else " | "
        print(f"| {condition} | {cells} | {width:.1f} |", flush=True)


def show_single(name, folds):
    """The same of people who are followed by a single training clip, each by that of another."""
    found = {}
    for action, some in folds.items():
        for fold in some:
            for clip in fold.training[:: max(1, len(fold.training) // 3)][:3]:
                online = OnlineSynchronizer(DenseSynchronizer(n_frames=P)).fit([clip])
                times = online.synchronizer_.match(fold.clips).times
                for x, live, tau in zip(fold.clips, online.track(fold.clips), times, strict=True):
                    row = inside(live.lower, live.upper, truth_of(tau, len(x)))
                    found.setdefault(action, []).append(row)
    held, width, least, worst = summary(found)
    print(
        f"   {name}, a single training clip: {held:.0f} % inside, {least:.0f} % of {worst}, "
        f"mean width {width:.1f}",
        flush=True,
    )


# -- alternatives -----------------------------------------------------------------------


def called_once(function):
    """Call a function once for the same arguments, which are kept."""
    known = {}

    @functools.wraps(function)
    def call(*args):
        if args not in known:
            known[args] = function(*args)
        return known[args]

    return call


class Moments(NamedTuple):
    """What is known at the samples of a running clip; ``rows``: path costs of positions."""

    phases: np.ndarray
    truth: np.ndarray
    excess: np.ndarray
    rows: np.ndarray


def moments(reference, clip, truth, stamps=None):
    """Follow a clip, sample by sample; features that are hidden stay so."""
    frames = np.arange(float(len(clip))) if stamps is None else stamps
    times = np.arange(0, frames[-1] + 1e-9, reference.step)
    streams, rows, found = Streams(reference, 1, clip.shape[1]), [], []
    samples = np.column_stack([np.interp(times, frames, column) for column in clip.T])
    for sample in samples:
        streams.update(sample[np.newaxis])
        rows.append(streams.trellis.costs[0])
        excess = max(streams.mean_cost[0] / reference.typical_cost, 1)
        found.append((streams.estimate(0.0).phase[0], excess))
    phases, excess = np.transpose(found)
    truth = np.full(len(times), np.nan) if truth is None else np.interp(times, frames, truth)
    return Moments(phases, truth, excess, np.array(rows))


@called_once
def learnt(fold):
    """The reference of a fold; of any mean, one that is not calibrated; and the training warps."""
    online, sync = fold.online, fold.online.synchronizer_
    settings = online.duration_, online.smoothness, online.velocity_smoothing, online.max_rate
    match = sync.match(fold.training)

    def reference_of(mean, *calibration):
        return Reference(sync.features_, mean, *settings, *calibration)

    given = fold.training, match.warp(fold.training), match.times, Progress(None, verbose=0)
    calibration = calibrate(reference_of, *given)
    return reference_of(online.mean_, *calibration), reference_of, match


@called_once
def training_moments(fold):
    """Moments of the training clips, each matched to the mean of the others."""
    known, reference_of, match = learnt(fold)
    warped, found = match.warp(fold.training), []
    for i, x in enumerate(fold.training):
        reference = reference_of(np.delete(warped, i, axis=0).mean(axis=0))
        reference.typical_cost = known.typical_cost
        found.append(moments(reference, x, truth_of(match.times[i], len(x))))
    return Moments(*map(np.concatenate, zip(*found, strict=True)))


def positions_of(rows):
    return np.minimum(np.arange(rows.shape[1]) / 2, P - 1)


def probabilities(m, temperatures):
    weights = np.exp((m.rows.min(axis=1, keepdims=True) - m.rows) / temperatures[:, np.newaxis])
    return weights / weights.sum(axis=1, keepdims=True)


def constant(fold, m):
    """Half a frame for all: the factor is the quantile of the errors."""
    return np.full(len(m.phases), 0.5)


def by_phase(fold, m):
    """The 90 % quantile of the training errors within a tenth of the clock."""
    known = training_moments(fold)
    errors, grid = np.abs(known.phases - known.truth), np.arange(0, P, 5.0)
    near = [errors[np.abs(known.phases - at) <= P / 10] for at in grid]
    values = [np.quantile(x if len(x) > 20 else errors, 0.9) for x in near]
    return np.maximum(np.interp(m.phases, grid, values), 0.5)


def spread(fold, m):
    """Mean distance from the phase by the probabilities of confidence, and half a frame."""
    p = probabilities(m, np.full(len(m.phases), learnt(fold)[0].temperature))
    return 0.5 + (p * np.abs(positions_of(m.rows) - m.phases[:, np.newaxis])).sum(axis=1)


def spread_and_cost(fold, m):
    """The same, by the excess of the cost."""
    return spread(fold, m) * m.excess


class HalfWidths:
    """The phase and so many half-widths: nine tenths of the training moments are inside."""

    def __init__(self, half_widths):
        self.half_widths = half_widths

    @called_once
    def calibration(self, fold):
        known = training_moments(fold)
        return np.quantile(np.abs(known.phases - known.truth) / self.half_widths(fold, known), 0.9)

    def bounds(self, fold, m, factor):
        half = factor * self.calibration(fold) * self.half_widths(fold, m)
        return np.maximum(m.phases - half, 0), np.minimum(m.phases + half, P - 1)


class Quantiles:
    """Quantiles of probabilities: the lowest temperature with nine tenths inside."""

    def __init__(self, power):
        self.power = power

    def _at(self, m, temperature, power):
        mass = probabilities(m, temperature * m.excess**power).cumsum(axis=1)
        positions = positions_of(m.rows)
        lower, upper = (
            positions[(mass < q).sum(axis=1).clip(max=len(positions) - 1)] for q in (0.05, 0.95)
        )
        return (
            np.maximum(np.minimum(lower, m.phases - 1), 0),
            np.minimum(np.maximum(upper, m.phases + 1), P - 1),
        )

    @called_once
    def calibration(self, fold):
        known, usual = training_moments(fold), learnt(fold)[0].temperature
        for temperature in usual * np.geomspace(0.1, 100, 25):
            if inside(*self._at(known, temperature, 0), known.truth)[0] >= 90:
                break
        return temperature

    def bounds(self, fold, m, factor):
        return self._at(m, factor * self.calibration(fold), self.power)


ALTERNATIVES = {
    "the same for all frames": HalfWidths(constant),
    "training errors by phase": HalfWidths(by_phase),
    "spread of the probabilities": HalfWidths(spread),
    "the same, times the excess": HalfWidths(spread_and_cost),
    "quantiles of the probabilities": Quantiles(0),
    "the same, temperature times the excess": Quantiles(1),
}


@called_once
def all_moments(fold):
    """Moments of all clips in all conditions: {condition: list of Moments}."""
    return {
        name: [
            moments(learnt(fold)[0], x, truth, None if stamps is None else stamps[i])
            for i, (x, truth) in enumerate(zip(clips, truths or [None] * len(clips), strict=True))
        ]
        for name, clips, stamps, truths in conditions(fold)
    }


def alternative(folds, way, factor, names):
    """Coverage and widths, as `measured`, of some conditions."""
    found = {}
    for action, some in folds.items():
        for fold in some:
            for name in names:
                rows = [
                    inside(*way.bounds(fold, m, factor), m.truth) for m in all_moments(fold)[name]
                ]
                found.setdefault(name, {}).setdefault(action, []).extend(rows)
    return found


def widened(folds, way, aim=91):
    """The factor with which so many per cent of a set as recorded are inside."""
    low, high = 0.3, 6.0
    for _ in range(10):
        factor = np.sqrt(low * high)
        held = summary(alternative(folds, way, factor, [RECORDED])[RECORDED])[0]
        low, high = (factor, high) if held < aim else (low, factor)
    return high


def show_alternatives(points):
    """A line an alternative: coverage, that of the worst action, and width, by condition."""
    names = list(all_moments(next(iter(points["HDM05"].values()))[0]))
    for archive, folds in points.items():
        print(f"\nAlternatives, {archive}: inside / of the worst action / mean width")
        print("| | factor | " + " | ".join(names) + " |\n|" + "---|" * (len(names) + 2))
        for title, way in ALTERNATIVES.items():
            factor = widened(points["HDM05"], way)
            cells = []
            for by_action in alternative(folds, way, factor, names).values():
                held, width, least, _ = summary(by_action)
                known = np.isfinite(held)
                cells.append(f"{held:.0f} / {least:.0f} / {width:.0f}" if known else f"{width:.0f}")
            print(f"| {title} | {factor:.2f} | " + " | ".join(cells) + " |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", help="folder of hdm05 and utkinect")
    parser.add_argument("--alternatives", action="store_true", help="and other intervals")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    actions = read_actions(args.folder, [e for e in EVENTS if e.archive in ARCHIVES])
    points, cosines = (
        {
            name: held_out([a for a in actions if a.archive == archive], space=space)
            for archive, name in ARCHIVES.items()
        }
        for space in (True, False)
    )
    for name in ARCHIVES.values():
        show_intervals(f"{name}, aSpace", points[name])
        show_intervals(f"{name}, cosines", cosines[name])
        show_single(f"{name}, cosines", cosines[name])
    if args.alternatives:
        show_alternatives(points)


if __name__ == "__main__":
    main()
