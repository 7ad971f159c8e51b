"""People whose phase is told live: what is known of an action from others, and what is true.

The phase of a frame is read off the warp of the whole clip, the other way round (`truth_of`).
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from harness import P
from live_peers import Known
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines, OnlineSynchronizer


@dataclass(frozen=True, eq=False)
class Fold:
    """What is known of an action from all actors but one, and the clips of that one.

    ``truths``: the phases of the frames of each clip. ``moments`` {event: (n_clips,)}: when the
    clips show the events of harness.py. ``landed`` {event: phase}: where the pattern has them.
    ``wrong``: what the same actor does otherwise. ``positions``: the joints of the clips.
    ``points``: makes features of joint positions, ``names`` are theirs.
    """

    action: str
    online: OnlineSynchronizer
    known: Known
    training: list
    clips: list
    truths: list
    moments: dict
    landed: dict
    wrong: list
    positions: list
    points: Callable
    names: list

    @functools.cached_property
    def live(self):
        """What is said of the clips, frame by frame: a `LivePhase` of arrays each."""
        return self.online.track(self.clips)

    @property
    def phases(self):
        return [live.phase for live in self.live]

    def phases_with(self, **params):
        """The same of a synchronizer with other parameters, on the clock of the same pattern."""
        pattern = self.online.synchronizer_.pattern_index_
        sync = DenseSynchronizer(n_frames=P, pattern=pattern, **params)
        online = OnlineSynchronizer(sync).fit(self.training)
        return [live.phase for live in online.track(self.clips)]

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


def held_out(actions, space=True):
    """A fold for every action and actor, by action; in the aSpace of the others, or cosines.

    The actions are of one archive.
    """
    cosines = {a.name: DirectionCosines(a.skeleton).fit(a.data) for a in actions}
    postures = {a.name: cosines[a.name].transform(a.data) for a in actions}
    folds: dict = {}
    for action in actions:
        own, body = postures[action.name], cosines[action.name]
        for actor in np.unique(action.actors):
            train, test = (np.flatnonzero((action.actors == actor) == held) for held in (0, 1))
            others = [own[i] for i in train]
            points = ASpace().fit(others) if space else None
            wrong = [
                postures[a.name][i]
                for a in actions
                if a is not action
                for i in np.flatnonzero(a.actors == actor)
            ]
            clips = others, [own[i] for i in test], wrong
            if space:
                # Of one action alone there is nothing wrong.
                clips = [points.transform(some) if some else [] for some in clips]
            fold = _learn(action, train, test, *clips, make_pipeline(*filter(None, (body, points))))
            folds.setdefault(action.name, []).append(fold)
    return folds


def _learn(action, train, test, training, clips, wrong, features):
    online = OnlineSynchronizer(DenseSynchronizer(n_frames=P)).fit(training)
    sync = online.synchronizer_
    seen, whole = sync.match(training).times, sync.match(clips).times
    landed = {}
    for event, moments in action.moments.items():
        pairs = zip(seen, moments[train], strict=True)
        found = [float(phase_of(tau, m)) for tau, m in pairs if np.isfinite(m)]
        landed[event] = np.median(found) if found else np.nan
    duration = float(np.mean([len(x) for x in training]))
    return Fold(
        action=action.name,
        online=online,
        known=Known(online.mean_, sync.pattern_, duration),
        training=training,
        clips=clips,
        truths=[truth_of(tau, len(x)) for tau, x in zip(whole, clips, strict=True)],
        moments={event: moments[test] for event, moments in action.moments.items()},
        landed=landed,
        wrong=wrong,
        positions=[action.data[i] for i in test],
        points=features.transform,
        names=list(features.get_feature_names_out()),
    )
