"""How far key moments of real people are missed: the warps that are judged, and the figures.

Every action of events.py is matched to at most a dozen of its clips, one after the other: by
synchronizers that have learnt from all clips (`to_patterns`), and by such that know nothing of
the people whose clips they match (`to_strangers`). `on_time_line` judges what a user does: all
clips are warped to one template, and compared on its time line. Errors are in frames of 100.
"""

import numpy as np
from events import EVENTS, Action, P, read_actions
from sklearn.model_selection import GroupKFold
from sklearn_motionsync import ASpace, DirectionCosines, LinearSynchronizer
from sklearn_motionsync.matching.warps import sample
from sklearn_motionsync.metrics import sobolev_least_squares

PATTERNS = 12
FOLDS = 4
# Added to an error before its logarithm is taken: a twentieth of a frame is as good as none.
FLOOR = 0.05


class People:
    """The clips of an action as postures and points of their aSpace, and who performs them."""

    def __init__(self, action, patterns=PATTERNS):
        self.name, self.archive, self.moments = action.name, action.archive, action.moments
        self.actors = action.actors
        self.postures = DirectionCosines(action.skeleton).fit_transform(action.data)
        self.X = ASpace().fit_transform(self.postures)
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
            space = ASpace().fit([self.postures[i] for i in train])
            points = space.transform(self.postures)
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

    def health(self):
        """Shares of frames that stand still and hurry; spread of velocity over the linear one."""
        patterns = self.people.patterns
        pairs = [np.delete(row, n, 0) for n, row in zip(patterns, self.times, strict=True)]
        rates = np.diff(np.concatenate(pairs))
        before = LinearSynchronizer(P).fit_transform(self.people.X)
        spread = [sobolev_least_squares(before, sample(self.people.X, t, P)) for t in self.times]
        return np.array([(rates < 0.1).mean(), (rates > 2).mean(), np.mean(spread)])


def on_time_line(times, moments):
    """How far a moment of one clip lands from that of another by way of a common time line.

    ``times`` (n_clips, P) are the warps of all clips to one template, ``moments`` (n_clips,) the
    frames of a moment, NaN where a clip does not show it. The moment of each clip is taken to the
    time line of the template, and from there to each other clip. Returns the errors of all ordered
    pairs, and the standard deviation of the moment on the time line, both in frames.
    """
    seen, frames = np.flatnonzero(np.isfinite(moments)), np.arange(P)
    # Frames of a warp that stands still are told apart by a slope too small to count.
    there = np.array([np.interp(moments[i], times[i] + 1e-7 * frames, frames) for i in seen])
    landed = np.array([np.interp(there, frames, times[i]) for i in seen])
    errors = np.abs(landed - moments[seen, np.newaxis])
    return errors[~np.eye(len(seen), dtype=bool)], there.std(ddof=1)


def read_people(folder, events=EVENTS, patterns=PATTERNS):
    """The actions of some events."""
    return [People(action, patterns) for action in read_actions(folder, events)]


def fewer_clips(folder, events, n_clips):
    """One action with only some of its clips, taken evenly from their list."""
    (action,) = read_actions(folder, events)
    kept = np.unique(np.linspace(0, len(action.data) - 1, n_clips).astype(int))
    few = Action(
        archive=action.archive,
        name=f"{action.name}, {n_clips} clips",
        data=[action.data[i] for i in kept],
        actors=action.actors[kept],
        skeleton=action.skeleton,
        moments={name: at[kept] for name, at in action.moments.items()},
    )
    return People(few)


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
