"""Proposals: windows of a take in which an action may happen, by matching with free ends.

The take is looked at through portions that overlap, at one time scale after the other: in each the
trellis with free ends (Eqs. 12-17) finds where the pattern begins and ends best. How good that is
stays open here: windows of other lengths do not compare by their paths alone.
"""

from typing import NamedTuple

import numpy as np

from ..matching.matcher import Features
from ..matching.trellis import Trellis
from ..matching.warps import at_times, even_slices

__all__ = ["Proposer", "scales"]

# On so many frames the pattern is looked for: only where it is, roughly, matters here.
_CLOCK = 50
# How far both ends are free, as a share of the clock; portions follow each other as far apart.
_SHARE = 0.2
# From one time scale to the next: ends that are free by a fifth cover what is between.
_RATIO = 1.6
_SMOOTHNESS, _MAX_RATE = 0.003, 3
# Portions matched at a time: bounds the memory, whatever the length of the take.
_AT_ONCE = 64


class Proposer(NamedTuple):
    """Finds windows of takes that a pattern may lie in.

    Attributes
    ----------
    features : Features
        What is compared of portions, of which it is made on the clock of the pattern.
    base : ndarray, shape (1, P, n_compared)
        What is compared of the pattern.
    trellis : Trellis
        With free ends.
    lengths : ndarray of int
        Usual numbers of frames, one a time scale.
    shortest, longest : int
        Numbers of frames of windows.
    """

    features: Features
    base: np.ndarray
    trellis: Trellis
    lengths: np.ndarray
    shortest: int
    longest: int

    @classmethod
    def of(cls, synchronizer, shortest, longest):
        """The proposer of the pattern of a synchronizer, for windows of so many frames."""
        n_frames = min(synchronizer.n_frames_, _CLOCK)
        features = synchronizer.training_.features.at_pace(1)
        pattern = synchronizer.pattern_.astype(np.float64)
        base = features(features.positions([pattern], n_frames))
        how = {"max_offset": _SHARE, "max_rate": _MAX_RATE, "free": True}
        mu = _SMOOTHNESS * float(np.square(base).sum()) / n_frames
        trellis = Trellis.on_clock(features.cost, n_frames, mu, **how)
        # The filter of velocities is as wide in a portion as in the pattern.
        share = (n_frames - 1) / (n_frames - 1 + 2 * trellis.width)
        features = features.at_pace(1, share * features.velocity_smoothing)
        return cls(features, base, trellis, scales(shortest, longest), shortest, longest)

    def __call__(self, take):
        """Windows of a take (n_frames, n_features), each once: (n_windows, 2) of start and stop."""
        lengths = self.lengths[self.lengths <= len(take)]
        found = [self._at_scale(take, int(length)) for length in lengths]
        windows = np.concatenate([np.empty((0, 2), dtype=np.intp), *found])
        sizes = windows[:, 1] - windows[:, 0]
        fits = (self.shortest <= sizes) & (sizes <= self.longest)
        return np.unique(windows[fits], axis=0)

    def _at_scale(self, take, length):
        """The best window of every portion, the pattern taking about this number of frames."""
        n_frames, width = self.base.shape[1], self.trellis.width
        step = (length - 1) / (n_frames - 1)
        count = int(np.ceil((len(take) - length) / max(width * step, 1.0))) + 1
        starts = np.linspace(0, len(take) - length, count)
        clock = np.arange(-width, n_frames + width) * step
        found = []
        for some in even_slices(count, _AT_ONCE):
            portions = at_times(take, starts[some, np.newaxis] + clock)
            moving = self.features(self.features.unit(portions))
            paths = self.trellis.paths(self.base, moving)[0]
            first, last = starts[some] + paths[:, 0] * step, starts[some] + length - 1
            window = np.stack([first, last + paths[:, -1] * step + 1], axis=1)
            found.append(np.clip(np.round(window).astype(np.intp), 0, len(take)))
        return np.concatenate(found)


def scales(shortest, longest):
    """Numbers of frames from the shortest to the longest, by a constant ratio or less."""
    count = int(np.ceil(np.log(longest / shortest) / np.log(_RATIO))) + 1
    return np.unique(np.round(np.geomspace(shortest, longest, count)).astype(np.intp))
