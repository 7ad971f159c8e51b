"""A synchronizer as a user would write one: all there is to it is how it matches."""

import numpy as np
from sklearn_motionsync import Match
from sklearn_motionsync.synchronizers import Synchronizer


class ShiftSynchronizer(Synchronizer):
    """Shifts each trial to where it correlates best with the pattern."""

    def match(self, X):
        on_clock, frames = self.normalize(X), np.arange(self.n_frames_)
        base, shifts = self.pattern_ - self.pattern_.mean(axis=0), []
        for x in on_clock - on_clock.mean(axis=1, keepdims=True):
            rows = [np.correlate(a, b, "full") for a, b in zip(x.T, base.T, strict=True)]
            shifts.append(np.sum(rows, axis=0).argmax() - frames[-1])
        times = np.clip(frames + np.array(shifts)[:, np.newaxis], 0, frames[-1])
        times[:, [0, -1]] = 0, frames[-1]
        return Match(times, np.square(on_clock - self.pattern_).sum(axis=(1, 2)))
