"""What the benchmarks share: real people, their key moments, figures, tables, the command line.

`EVENTS` lists moments of real movements that can be told from positions alone: the extremum, the
crossing of half the height or a turning point of one coordinate of the body. A clip takes part in
an event only where that moment is unambiguous (`moment`, `turning_points`): a plateau, two rival
peaks or a clip cut short would measure the event, not the method. `read_actions` gives the clips.

`People` are the clips of an action, matched to a dozen of them at most: by synchronizers that have
learnt from all clips (`to_patterns`), and by such that know nothing of the people whose clips they
match (`to_strangers`). `on_time_line` judges what a user does: all clips are warped to one
pattern, and compared on its time line. Errors are in frames of 100.
"""

import argparse
import importlib.metadata
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks
from sklearn.model_selection import GroupKFold
from sklearn_motionsync import ASpace, DirectionCosines
from sklearn_motionsync.datasets import load_trials
from threadpoolctl import threadpool_limits

P = 100
PATTERNS = 12
DATA = Path(__file__).resolve().parents[2] / "shared" / "data"

# -- the events as data -----------------------------------------------------------------


class Event(NamedTuple):
    """One moment of one action.

    ``kind`` is "min", "max", "rise", "fall" or, of a curve that must turn exactly as ``turns``
    says, the number of the turning point. ``chosen``: constants of the package were chosen on it.
    """

    archive: str
    action: str
    name: str
    curve: str
    kind: str | int
    turns: str = ""
    chosen: bool = False


BEND, ELBOW, GRAB = (
    ("hdm05", name) for name in ("depositFloorR", "elbowToKnee1RepsLelbowStart", "grabHighR")
)
HOP, JOG, SNEAK = (
    ("hdm05", name)
    for name in ("hopBothLegs1hops", "jogLeftCircle4StepsRstart", "sneak2StepsLStart")
)
PICK, SIT, STAND, THROW, PUSH, PULL = (
    ("utkinect", name) for name in ("pickUp", "sitDown", "standUp", "throw", "push", "pull")
)
WALK = ("cmu07_walk", "walk")
STEPS = "max min max min"
EVENTS = [
    Event(*BEND, "pelvis lowest", "pelvis", "min", chosen=True),
    Event(*BEND, "hand lowest", "low hand", "min", chosen=True),
    Event(*BEND, "head lowest", "head", "min"),
    Event(*ELBOW, "ankle highest", "right ankle", "max", chosen=True),
    Event(*ELBOW, "head lowest", "head", "min"),
    Event(*GRAB, "hand rises", "right hand", "rise", chosen=True),
    Event(*GRAB, "hand falls", "right hand", "fall", chosen=True),
    Event(*HOP, "pelvis highest", "pelvis", "max", chosen=True),
    Event(*HOP, "ankle highest", "right ankle", "max", chosen=True),
    Event(*HOP, "head highest", "head", "max"),
    Event(*HOP, "ankle rises", "right ankle", "rise"),
    Event(*JOG, "right foot ahead, first", "step", 0, STEPS),
    Event(*JOG, "left foot ahead, first", "step", 1, STEPS, True),
    Event(*JOG, "right foot ahead, second", "step", 2, STEPS, True),
    Event(*JOG, "left foot ahead, second", "step", 3, STEPS),
    Event(*SNEAK, "ankle highest", "right ankle", "max", chosen=True),
    Event(*SNEAK, "right foot ahead", "step", "max", chosen=True),
    Event(*PICK, "hand lowest", "low hand", "min", chosen=True),
    Event(*PICK, "head lowest", "head", "min", chosen=True),
    Event(*SIT, "head lowest", "head", "min", chosen=True),
    Event(*SIT, "pelvis falls", "pelvis", "fall"),
    Event(*STAND, "head rises", "head", "rise", chosen=True),
    Event(*STAND, "pelvis rises", "pelvis", "rise"),
    Event(*STAND, "head lowest", "head", "min"),
    Event(*THROW, "hand falls", "right hand", "fall", chosen=True),
    Event(*PUSH, "hand furthest ahead", "reach", "max"),
    Event(*PUSH, "hand goes ahead", "reach", "rise"),
    Event(*PULL, "hand rises", "right hand", "rise"),
    Event(*WALK, "left foot ahead", "step", "min"),
    Event(*WALK, "right ankle highest", "right ankle", "max"),
    Event(*WALK, "left ankle highest", "left ankle", "max"),
]

# What the archives call what the curves are made of.
PARTS = ("pelvis", "head", "right hand", "left hand", "right ankle", "left ankle")
PARTS += ("right hip", "left hip")
JOINTS = {
    "hdm05": "root head rhand lhand rtibia ltibia rhipjoint lhipjoint",
    "utkinect": "HipCenter Head HandRight HandLeft AnkleRight AnkleLeft HipRight HipLeft",
    "cmu07_walk": "CC_Base_Hip CC_Base_Head CC_Base_R_Hand CC_Base_L_Hand CC_Base_R_Foot "
    "CC_Base_L_Foot CC_Base_R_Thigh CC_Base_L_Thigh",
}
# Width of the Gaussian under which curves are looked at: a share of the clip, and frames at least.
SMOOTHING = {"hdm05": 0.015, "utkinect": 0.03, "cmu07_walk": 0.015}
LEAST_FRAMES = 0.6
# Clips of fewer frames show no action.
LEAST_LENGTH = 8

# -- the rule of unambiguous moments ----------------------------------------------------


def moment(curve, kind):
    """When a smoothed curve has its extremum, or crosses half its height: in [0, 1], or NaN."""
    if kind in ("rise", "fall"):
        return _crossing(curve if kind == "rise" else -np.asarray(curve))
    return _summit(curve if kind == "max" else -np.asarray(curve))


def _crossing(curve):
    """Upwards through half the height: once, and back once at most."""
    above = curve - (curve.max() + curve.min()) / 2
    changes = np.diff((above >= 0).astype(int))
    upwards = np.flatnonzero(changes > 0)
    if len(upwards) != 1 or np.count_nonzero(changes < 0) > 1:
        return np.nan
    before = upwards[0]
    part = above[before] / (above[before] - above[before + 1])
    return (before + part) / (len(curve) - 1)


def _summit(curve):
    """The maximum: not at an end, no plateau, and no rival of three quarters' height."""
    height = (curve - curve.min()) / (np.ptp(curve) or 1)
    top, last = int(np.argmax(height)), len(curve) - 1
    if min(top, last - top) < 0.04 * last or np.mean(height > 0.97) > 0.25:
        return np.nan
    # Peaks at the ends are peaks as well.
    peaks = find_peaks(np.pad(height, 1, constant_values=-1), prominence=0.1)[0] - 1
    rivals = peaks[height[peaks] > 0.75]
    if np.any(np.abs(rivals - top) > 0.08 * len(curve)):
        return np.nan
    return vertex(height, top) / last


def vertex(curve, frame):
    """The extremum of the parabola through three frames, half a frame from the middle at most."""
    if not 0 < frame < len(curve) - 1:
        return float(frame)
    before, here, after = curve[frame - 1 : frame + 2]
    bend = before - 2 * here + after
    return frame + (np.clip((before - after) / (2 * bend), -0.5, 0.5) if bend else 0)


def turning_points(curve, turns):
    """When a smoothed curve turns, if it turns exactly like that ("max min"): in [0, 1], or NaN."""
    least = 0.3 * np.ptp(curve)
    found = [
        (int(frame), kind)
        for kind, sign in (("max", 1), ("min", -1))
        for frame in find_peaks(sign * np.asarray(curve), prominence=least)[0]
    ]
    found.sort()
    wanted = turns.split()
    if [kind for _, kind in found] != wanted:
        return np.full(len(wanted), np.nan)
    return np.array([frame for frame, _ in found]) / (len(curve) - 1)


# -- curves of the body -----------------------------------------------------------------


def body_curve(positions, part):
    """One coordinate of the body over time, of positions by part: height, step or reach."""
    if part == "low hand":
        return np.minimum(positions["right hand"][:, 1], positions["left hand"][:, 1])
    if part == "step":
        return ahead(positions, positions["right ankle"] - positions["left ankle"])
    if part == "reach":
        return ahead(positions, positions["right hand"] - positions["pelvis"])
    return positions[part][:, 1]


def ahead(positions, vectors):
    """The part of vectors that points where the hips face."""
    across = positions["left hip"] - positions["right hip"]
    facing = np.cross(across, [0.0, 1.0, 0.0])
    length = np.linalg.norm(facing, axis=1)
    return np.einsum("tk,tk->t", vectors, facing) / (length + 1e-12)


def find(curves, event, smoothing):
    """When an event happens in every clip, in frames of the clock; NaN where it is ambiguous."""
    moments, ranges = [], []
    for curve in curves:
        width = max(smoothing * len(curve), LEAST_FRAMES)
        smoothed = gaussian_filter1d(curve, width, mode="nearest")
        if event.turns:
            moments.append(turning_points(smoothed, event.turns)[event.kind])
        else:
            moments.append(moment(smoothed, event.kind))
        ranges.append(np.ptp(smoothed))
    moments, ranges = np.array(moments), np.array(ranges)
    # Who hardly moves that part of the body does not show the event.
    moments[ranges < 0.4 * np.median(ranges)] = np.nan
    return moments * (P - 1)


# -- the clips --------------------------------------------------------------------------


class Action(NamedTuple):
    """The clips of an action: joint positions, who performs, and the moments by event."""

    archive: str
    name: str
    data: list
    actors: np.ndarray
    skeleton: object
    moments: dict


def read_actions(folder, events=EVENTS):
    """Read the actions of some events, in their order, from the folder of the archives."""
    bunches, actions = {}, []
    for archive, name in dict.fromkeys((event.archive, event.action) for event in events):
        if archive not in bunches:
            bunches[archive] = read_archive(folder, archive)
        bunch = bunches[archive]
        parts = _joints_of_parts(bunch, archive)
        chosen = np.flatnonzero(bunch.target == name)
        data = [bunch.data[i] for i in chosen]
        by_part = [_by_part(x, parts) for x in data]
        moments = {
            e.name: find([body_curve(b, e.curve) for b in by_part], e, SMOOTHING[archive])
            for e in events
            if (e.archive, e.action) == (archive, name)
        }
        actions.append(Action(archive, name, data, bunch.actor[chosen], bunch.skeleton, moments))
    return actions


def read_takes(folder, archive, label=None):
    """The takes of an archive, or of one action, that have eight frames at least."""
    bunch = load_trials(Path(folder) / archive / f"{archive}_positions.npz")
    is_chosen = np.array([len(x) >= LEAST_LENGTH for x in bunch.data])
    chosen = np.flatnonzero(is_chosen & (True if label is None else bunch.target == label))
    bunch.data = [bunch.data[i] for i in chosen]
    for name in ("target", "actor", "frame_rate"):
        bunch[name] = bunch[name][chosen]
    return bunch


def read_archive(folder, archive):
    """The takes of an archive; those of walking are cut into cycles."""
    bunch = read_takes(folder, archive)
    if archive == "cmu07_walk":
        return _cut_into_cycles(bunch, _joints_of_parts(bunch, archive))
    return bunch


def _joints_of_parts(bunch, archive):
    joints = list(bunch.joints)
    return dict(zip(PARTS, map(joints.index, JOINTS[archive].split()), strict=True))


def _by_part(x, parts):
    joints = x.reshape(len(x), -1, 3).astype(float)
    return {part: joints[:, joint] for part, joint in parts.items()}


def _cut_into_cycles(bunch, parts):
    """Walks, cut from right foot ahead to right foot ahead, two cycles of a take at most.

    All are one person's: the take stands for the actor.
    """
    data, takes = [], []
    for take, x in enumerate(bunch.data):
        step = body_curve(_by_part(x, parts), "step")
        step = gaussian_filter1d(step, max(0.02 * len(step), 1), mode="nearest")
        peaks = find_peaks(step, prominence=0.4 * np.ptp(step))[0]
        cycles = [(a, b) for a, b in pairwise(peaks) if b - a >= 10]
        data += [x[a : b + 1] for a, b in cycles[:2]]
        takes += [take] * len(cycles[:2])
    bunch.data, bunch.actor = data, np.array(takes)
    bunch.target = np.full(len(data), "walk")
    return bunch


# -- people held out --------------------------------------------------------------------

FOLDS = 4
# Added to an error before its logarithm is taken: a twentieth of a frame is as good as none.
FLOOR = 0.05


class People:
    """The clips of an action as poses and points of their aSpace, and who performs them."""

    def __init__(self, action, patterns=PATTERNS):
        self.name, self.archive, self.moments = action.name, action.archive, action.moments
        self.actors = action.actors
        self.poses = DirectionCosines(action.skeleton).fit_transform(action.data)
        self.X = ASpace().fit_transform(self.poses)
        n = len(self.X)
        self.patterns = np.unique(np.linspace(0, n - 1, min(n, patterns)).astype(int))

    def to_patterns(self, times_to):
        """Warps of all clips to every pattern, of ``times_to(X, pattern)``."""
        return Judged(self, np.array([times_to(self.X, int(n)) for n in self.patterns]))

    def to_strangers(self, make):
        """Warps of the clips of actors that had no part in aSpace, metric and exemplars."""
        times = np.full((len(self.patterns), len(self.X), P), np.nan)
        for row, test, match in self.matches_of_strangers(make):
            times[row, test] = match.times
        return Judged(self, times)

    def matches_of_strangers(self, make):
        """Yield the row of a pattern, the clips of a fold and their match to the pattern.

        The actors are dealt into four folds; a pattern serves the folds that it is not in.
        """
        folds = GroupKFold(min(FOLDS, len(set(self.actors))))
        for train, test in folds.split(self.X, groups=self.actors):
            space = ASpace().fit([self.poses[i] for i in train])
            points = space.transform(self.poses)
            known, others = [points[i] for i in train], [points[i] for i in test]
            for row, n in enumerate(self.patterns):
                if n in train:
                    sync = make(pattern=int(np.flatnonzero(train == n)[0])).fit(known)
                    yield row, test, sync.match(others)

    def to_time_line(self, times_of):
        """Each moment on the common time line of one fit, of warps ``times_of(X)``.

        Returns {(action, event): (errors, standard deviation)} as `on_time_line` gives them.
        """
        times = times_of(self.X)
        return {(self.name, event): on_time_line(times, at) for event, at in self.moments.items()}


class Judged:
    """Warps ``times`` (n_patterns, n_clips, P) of an action; NaN where a pair is not judged."""

    def __init__(self, people, times):
        self.people, self.times = people, times

    def errors(self):
        """How far an event lands from where it happens, of every pair that shows it.

        Returns {(action, event): errors}.
        """
        return {(self.people.name, event): self._of(event) for event in self.people.moments}

    def _of(self, event):
        moments, found = self.people.moments[event], []
        for n, times in zip(self.people.patterns, self.times, strict=True):
            landed = np.array([np.interp(moments[n], np.arange(P), tau) for tau in times])
            found.append(np.delete(np.abs(landed - moments), n))
        found = np.concatenate(found)
        return found[np.isfinite(found)]

    def standing_still(self):
        """The share of frames at which a rate is below 0.1."""
        patterns = self.people.patterns
        pairs = [np.delete(row, n, 0) for n, row in zip(patterns, self.times, strict=True)]
        return (np.diff(np.concatenate(pairs)) < 0.1).mean()


def on_time_line(times, moments):
    """How far a moment of one clip lands from that of another by way of a common time line.

    ``times`` (n_clips, n_frames) are the warps of all clips to one pattern, and ``moments``
    (n_clips,) the frames of a moment, NaN where a clip does not show it. The moment of each clip is
    taken to the time line of the pattern, and from there to each other clip. Returns the errors of
    all ordered pairs, and the standard deviation of the moment on the time line, both in frames.
    """
    seen, frames = np.flatnonzero(np.isfinite(moments)), np.arange(times.shape[1])
    # Frames of a warp that stands still are told apart by a slope too small to count.
    there = np.array([np.interp(moments[i], times[i] + 1e-7 * frames, frames) for i in seen])
    landed = np.array([np.interp(there, frames, times[i]) for i in seen])
    errors = np.abs(landed - moments[seen, np.newaxis])
    return errors[~np.eye(len(seen), dtype=bool)], there.std(ddof=1)


def read_people(folder, events=EVENTS, patterns=PATTERNS):
    """The actions of some events."""
    return [People(action, patterns) for action in read_actions(folder, events)]


def read_unseen(path):
    """(action, trials, {event: times}) of every action of events44."""
    with np.load(path) as file:
        archive = dict(file)
    shapes = np.repeat(archive["n_features"], archive["n_trials"])
    sizes = archive["n_frames"] * shapes
    flat = np.split(archive["values"], np.cumsum(sizes)[:-1])
    trials = [x.reshape(-1, width) for x, width in zip(flat, shapes, strict=True)]
    ends, place, sets = np.cumsum(archive["n_trials"]), 0, []
    for number, (action, end) in enumerate(zip(archive["action"], ends, strict=True)):
        count, moments = archive["n_trials"][number], {}
        for event in archive["event"][archive["event_action"] == number]:
            moments[str(event)] = archive["times"][place : place + count]
            place += count
        sets.append((str(action), trials[end - count : end], moments))
    return sets


def fewer_clips(folder, events, n_clips):
    """One action with only some of its clips, taken evenly from their list."""
    (action,) = read_actions(folder, events)
    kept = np.unique(np.linspace(0, len(action.data) - 1, n_clips).astype(int))
    few = {"data": [action.data[i] for i in kept], "actors": action.actors[kept]}
    few["moments"] = {name: at[kept] for name, at in action.moments.items()}
    return People(action._replace(name=f"{action.name}, {n_clips} clips", **few))


def figures(errors):
    """Mean and median error of every event."""
    return {event: (np.mean(some), np.median(some)) for event, some in errors.items()}


def geometric_means(of_events):
    """Of the mean and of the median errors of events."""
    return np.exp(np.mean([_logs(pair) for pair in of_events.values()], axis=0))


def ratio(of_events, to, draws=5000, random_state=0):
    """Ratio of geometric means to those of another setting, and its 95 % interval.

    Actions are drawn anew, with all their events: events of one action are judged on the same
    warps. Returns (3, 2): ratio, lower and upper end, of mean and median errors.
    """
    logs: dict = {}
    for (action, event), pair in of_events.items():
        logs.setdefault(action, []).append(_logs(pair) - _logs(to[action, event]))
    actions = [np.array(some) for some in logs.values()]
    rng = np.random.default_rng(random_state)
    drawn = rng.integers(len(actions), size=(draws, len(actions)))
    means = [np.concatenate([actions[i] for i in row]).mean(axis=0) for row in drawn]
    ends = np.quantile(means, [0.025, 0.975], axis=0)
    return np.exp([np.concatenate(actions).mean(axis=0), *ends])


def _logs(pair):
    return np.log(np.asarray(pair) + FLOOR)


# -- made movements ----------------------------------------------------------------------


def at_frames(x, frames):
    """A sequence (n_frames, ...) at moments between its frames, on straight lines."""
    columns = x.reshape(len(x), -1).T
    values = [np.interp(frames, np.arange(len(x)), column) for column in columns]
    return np.stack(values, axis=1).reshape(-1, *x.shape[1:])


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


# -- tables and the command line --------------------------------------------------------


def print_head(corner, header):
    print(f"\n| {corner} | " + " | ".join(header) + " |")
    print("|---|" + "---|" * len(header))


def print_row(name, cells):
    print(f"| {name} | " + " | ".join(cells) + " |", flush=True)


def show_pair(figures):
    return f"{figures[0]:.2f} / {figures[1]:.2f}"


def percent(share, digits=0):
    return "-" if np.isnan(share) else f"{100 * share:.{digits}f}"


def version_of(package):
    """The version of a package, or None where it is not installed."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def print_versions(*packages):
    """A line of what is installed."""
    versions = {name: version_of(name) for name in ("sklearn_motionsync", "numpy", *packages)}
    print(", ".join(f"{name} {version}" for name, version in versions.items() if version))


def command_line(text):
    """The parser of a benchmark's arguments, whose first is the folder of the recordings.

    Numerical libraries run one thread from then on.
    """
    threadpool_limits(1)
    parser = argparse.ArgumentParser(description=text.split("\n", maxsplit=1)[0])
    parser.add_argument("folder", type=Path, nargs="?", default=DATA, help="of the recordings")
    return parser


def run_tables(tables, parser, prepare=None):
    """Print the tables that the command line names, or all: functions of the folder, by name.

    ``prepare`` is called with the options before.
    """
    parser.add_argument("tables", nargs="*", help=f"some of {', '.join(tables)}; by default all")
    options = parser.parse_args()
    if prepare is not None:
        prepare(options)
    unknown = set(options.tables) - set(tables)
    if unknown:
        parser.error(f"there is no table {', '.join(sorted(unknown))}")
    for name in options.tables or tables:
        tables[name](options.folder)
