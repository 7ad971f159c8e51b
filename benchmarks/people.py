"""How far key moments of real people are missed: the warps that are judged, and the figures.

Every action of events.py is matched to at most a dozen of its clips, one after the other: by
synchronizers that have learnt from all clips (`to_patterns`), and by such that know nothing of
the people whose clips they match (`to_strangers`). Errors are in frames of 100.
"""

import numpy as np
from events import EVENTS, P, read_actions
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

    def __init__(self, action):
        self.name, self.archive, self.moments = action.name, action.archive, action.moments
        self.actors = action.actors
        self.postures = DirectionCosines(action.skeleton).fit_transform(action.data)
        self.X = ASpace().fit_transform(self.postures)
        n = len(self.X)
        self.patterns = np.unique(np.linspace(0, n - 1, min(n, PATTERNS)).astype(int))

    def to_patterns(self, times_to):
        """Warps of all clips to every pattern, of ``times_to(X, pattern)``."""
        return Judged(self, np.array([times_to(self.X, int(n)) for n in self.patterns]))

    def to_strangers(self, make):
        """Warps of the clips of actors that had no part in aSpace, metric and exemplars.

        The actors are dealt into four folds; a pattern serves the folds that it is not in.
        """
        times = np.full((len(self.patterns), len(self.X), P), np.nan)
        folds = GroupKFold(min(FOLDS, len(set(self.actors))))
        for train, test in folds.split(self.X, groups=self.actors):
            space = ASpace().fit([self.postures[i] for i in train])
            points = space.transform(self.postures)
            known, others = [points[i] for i in train], [points[i] for i in test]
            for row, n in enumerate(self.patterns):
                if n in train:
                    sync = make(pattern=int(np.flatnonzero(train == n)[0])).fit(known)
                    times[row, test] = sync.match(others).times
        return Judged(self, times)


class Judged:
    """Warps ``times`` (n_patterns, n_clips, P) of an action; NaN where a pair is not judged."""

    def __init__(self, people, times):
        self.people, self.times = people, times

    def errors(self, event):
        """Of every pair that shows an event: how far it lands from where it happens."""
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


def read_people(folder, events=EVENTS):
    """The actions of some events."""
    return [People(action) for action in read_actions(folder, events)]


def errors_of(judged):
    """The errors of all events, {(action, event): errors}."""
    return {
        (one.people.name, event): one.errors(event)
        for one in judged
        for event in one.people.moments
    }


def geometric_means(errors):
    """Geometric means over events of the mean and of the median error."""
    return np.exp(_logs(errors).mean(axis=0))


def _logs(errors):
    """Logarithms of mean and median errors, (n_events, 2)."""
    return np.log([[e.mean() + FLOOR, np.median(e) + FLOOR] for e in errors.values()])


def ratio(errors, to, draws=5000, random_state=0):
    """Ratio of geometric means to those of another setting, and its 95 % interval.

    Actions are drawn anew, with all their events: events of one action are judged on the same
    warps. Returns (3, 2): ratio, lower and upper end, of mean and median error.
    """
    logs = _logs(errors) - _logs(to)
    actions = np.array([action for action, _ in errors])
    members = [np.flatnonzero(actions == action) for action in dict.fromkeys(actions)]
    rng = np.random.default_rng(random_state)
    drawn = rng.integers(len(members), size=(draws, len(members)))
    means = [logs[np.concatenate([members[i] for i in row])].mean(axis=0) for row in drawn]
    ends = np.quantile(means, [0.025, 0.975], axis=0)
    return np.exp(np.concatenate([[logs.mean(axis=0)], ends]))
