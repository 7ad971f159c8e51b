"""Walking followed live: how far the phase is from foot strikes.

    python benchmarks/live_cycles.py DATA_FOLDER [jogs] [walks] [kinect]

By ``OnlineSynchronizer(cyclic=True)``. A pattern is learnt from the cycles that `CycleSegmenter`
cuts from the takes of others. A minute is chained from the cycles of the person held out, as foot
strikes cut them (cycles.py): each is drawn to the beginning of the next, the pace goes from 0.75 to
1.25 of its own within 20 seconds, the body travels, turns round twice, and begins in mid-cycle. The
truth is a line between foot strikes; the phase of the other foot is that of the training cycles.
Errors are in per cent of a cycle, from the second cycle on. A strike is told when the number of the
cycle rises; it is missed where none is within a quarter of a cycle. The walks of CMU are of one
person, so that takes are held out. UTKinect has one or two cycles a take, and many of its strikes
are no strikes: four of ten people have a cycle with the other foot in its middle. Takes three
minutes.
"""

import warnings
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from cycles import foot_strikes, turned
from harness import P, at_frames, command_line, print_head, print_row, read_takes, run_tables
from sklearn_motionsync import DenseSynchronizer, DirectionCosines, Skeleton
from sklearn_motionsync.live import OnlineSynchronizer
from sklearn_motionsync.takes import CycleSegmenter

from live import phase_of

SECONDS = 60
# Amplitude and seconds of the changes of pace; seconds at which turns begin, and of one turn.
PACE, WAVE, TURNS, TURN = 0.25, 20, (20, 40), 2
# Share of a cycle in which it is drawn to the next one.
SEAM = 0.25
# Frames a second of UTKinect, which are not known.
KINECT_RATE = 15


class Walker(NamedTuple):
    """What is known of others, and a minute of the person held out.

    ``minute``: features; ``truth``: cycles of each frame, whole at the beginning of a cycle;
    ``still``: features of standing still.
    """

    name: str
    live: OnlineSynchronizer
    minute: np.ndarray
    truth: np.ndarray
    still: np.ndarray


class Takes(NamedTuple):
    """Takes of positions, of people, with frames a second and a skeleton."""

    data: list
    people: list
    rate: float
    skeleton: Skeleton

    def of(self, person, held=True):
        """The takes of a person, or of all others."""
        chosen = [i for i, own in enumerate(self.people) if (own == person) == held]
        data, people = ([values[i] for i in chosen] for values in self[:2])
        return Takes(data, people, self.rate, self.skeleton)


def takes_of(folder, archive, label):
    bunch = read_takes(folder, archive, label)
    rate = bunch.frame_rate[0] if np.isfinite(bunch.frame_rate[0]) else KINECT_RATE
    # Of one person every take is held out.
    people = bunch.actor if len(set(bunch.actor)) > 1 else np.arange(len(bunch.data))
    return Takes(bunch.data, people.tolist(), float(rate), bunch.skeleton)


# -- takes to a minute --------------------------------------------------------------------


def upright(positions, skeleton):
    """Points (n_frames, n_joints, 3) below the pelvis, heading along z."""
    points = np.asarray(positions, dtype=float).reshape(len(positions), -1, 3)
    points = points - points[:, [skeleton.index_of("pelvis")]] * [1, 0, 1]
    across = points[:, skeleton.index_of("left_hip")] - points[:, skeleton.index_of("right_hip")]
    return turned(points, np.arctan2(across[:, 2], across[:, 0]))


def whole_cycles(points, strikes, others, phase):
    """Yield cycles from strike to strike, and the share of each frame, ``phase`` at the other's."""
    for first, stop in pairwise(strikes):
        inside = others[(others > first) & (others < stop)]
        if len(inside) == 1 and 0.35 < (inside[0] - first) / (stop - first) < 0.65:
            frames = np.linspace(first, stop, round(stop - first) + 1)
            shares = np.interp(frames, [first, inside[0], stop], [0, phase, 1])
            yield at_frames(points, frames), shares


def chain(cycles, n_frames, rng):
    """Cycles in any order, each drawn to the beginning of the next; and the cycles of frames."""
    values, phases, n = [], [], 0
    x, share = cycles[rng.integers(len(cycles))]
    while sum(map(len, values)) < n_frames:
        following = cycles[rng.integers(len(cycles))]
        ramp = np.clip((share - 1 + SEAM) / SEAM, 0, 1).reshape(-1, 1, 1)
        values.append((x + ramp * (following[0][0] - x[-1]))[:-1])
        phases.append(n + share[:-1])
        (x, share), n = following, n + 1
    return np.concatenate(values)[:n_frames], np.concatenate(phases)[:n_frames]


def paced(x, truth, rate, begin=0.4):
    """The same at a changing pace, from mid-cycle on."""
    pace = 1 + PACE * np.sin(2 * np.pi * np.arange(len(x)) / rate / WAVE)
    frames = np.searchsorted(truth, truth[0] + begin) + np.cumsum(pace)
    frames = frames[frames <= len(x) - 1]
    return at_frames(x, frames), np.interp(frames, np.arange(len(x)), truth)


def travelling(points, rate):
    """Points that go on along their heading, and turn round twice."""
    t, height = np.arange(len(points)) / rate, np.ptp(points[0, :, 1])
    heading = np.pi * sum(np.clip((t - begin) / TURN, 0, 1) for begin in TURNS)
    steps = np.stack([np.sin(heading), 0 * t, np.cos(heading)], axis=1) * 0.8 * height / rate
    return turned(points, heading) + np.cumsum(steps, axis=0)[:, np.newaxis]


# -- people -------------------------------------------------------------------------------


def walkers(takes, start):
    """Yield a `Walker` of each person with cycles."""
    for person in dict.fromkeys(takes.people):
        known = takes.of(person, held=False)
        segmenter = CycleSegmenter(takes.skeleton, start=start, not_cyclic="skip")
        cycles, _ = segmenter.fit(known.data).segment(known.data)
        cosines = DirectionCosines(takes.skeleton).fit(cycles)
        features = cosines.transform(cycles)
        live = OnlineSynchronizer(DenseSynchronizer(P), frame_rate=takes.rate, cyclic=True)
        phase = phase_of_other_foot(live.fit(features), features, cycles, takes, start)
        own = []
        for x in takes.of(person).data:
            strikes = foot_strikes(x, takes.skeleton, takes.rate)
            strikes = strikes if start == "left" else strikes[::-1]
            own += whole_cycles(upright(x, takes.skeleton), *strikes, phase)
        if not own:
            continue
        rng = np.random.default_rng(0)
        minute, truth = paced(*chain(own, round(SECONDS * takes.rate), rng), takes.rate)
        minute = travelling(minute, takes.rate).reshape(len(minute), -1)
        minute, still = cosines.transform([minute, minute[[0] * len(minute)]])
        yield Walker(str(person), live, minute, truth, still)


def phase_of_other_foot(live, features, cycles, takes, start):
    found = []
    for tau, x in zip(live.synchronizer_.match(features).times, cycles, strict=True):
        strikes = foot_strikes(x, takes.skeleton, takes.rate)[start == "left"] / (len(x) - 1)
        inside = strikes[(strikes > 0.2) & (strikes < 0.8)]
        found += [float(phase_of(tau, share * (P - 1))) for share in inside[:1]]
    return np.median(found) / (P - 1)


# -- figures ------------------------------------------------------------------------------


def figures(walker):
    """Errors in per cent of a cycle and confidences, of frames; and of strikes."""
    (found,) = walker.live.track([walker.minute])
    truth, after = walker.truth, walker.truth > walker.truth[0] + 1
    ahead = found.phase / (P - 1) - truth
    # In the cycle that is nearest to the phase.
    error = 100 * np.abs(ahead - np.round(ahead))[after]
    frames = np.arange(len(truth))
    due = np.interp(np.arange(np.ceil(truth[after][0]), truth[-1]), truth, frames)
    told = 1 + np.flatnonzero(np.diff(found.cycle) > 0)
    told = told[after[told]]
    cycle = np.median(np.diff(due))
    off = told[np.abs(told - due[:, np.newaxis]).argmin(axis=1)] - due
    hit = np.abs(off) < cycle / 4
    rate = walker.live.frame_rate
    return {
        "error": error,
        "confidence": found.confidence[after],
        "strikes": [len(due), np.sum(~hit), len(told) - np.sum(hit)],
        "late": 1000 * off[hit] / rate,
    }


def cycle_table(name, people):
    """Of each person and of all, from the second cycle on; and confidences of standing still."""
    columns = ["error (%) median / 90 %", "confidence > .5", "strikes, missed, extra"]
    print_head(name, [*columns, "late (ms) median, 90 % of distances"])
    rows, still = [], []
    for walker in people:
        rows.append(figures(walker))
        (found,) = walker.live.track([walker.still])
        still.append(found.confidence[len(walker.still) // 5 :])
        print_row(walker.name, cells_of(rows[-1]))
    whole = {key: [row[key] for row in rows] for key in rows[0]}
    sums = {"strikes": np.sum(whole.pop("strikes"), axis=0)}
    print_row("all", cells_of(sums | {key: np.concatenate(each) for key, each in whole.items()}))
    print_row("standing still", ["", f"{np.mean(np.concatenate(still) > 0.5):.2f}", "", ""])


def cells_of(row):
    error, late = row["error"], row["late"]
    return [
        f"{np.median(error):.1f} / {np.quantile(error, 0.9):.1f}",
        f"{np.mean(row['confidence'] > 0.5):.2f}",
        ", ".join(map(str, row["strikes"])),
        f"{np.median(late):.0f}, {np.quantile(np.abs(late), 0.9):.0f}",
    ]


def jogs(folder):
    takes = takes_of(folder, "hdm05", "jogLeftCircle4StepsRstart")
    cycle_table("jogs (HDM05), people held out", walkers(takes, "left"))


def walks(folder):
    takes = takes_of(folder, "cmu07_walk", "walk")
    cycle_table("walks (CMU), takes held out", walkers(takes, "right"))


def kinect(folder):
    takes = takes_of(folder, "utkinect", "walk")
    cycle_table("walks (UTKinect), people held out", walkers(takes, "right"))


if __name__ == "__main__":
    # Takes without cycles, and of other movements, warn.
    warnings.simplefilter("ignore")
    tables = {"jogs": jogs, "walks": walks, "kinect": kinect}
    run_tables(tables, command_line(__doc__))
