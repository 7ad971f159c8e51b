"""Settings: what a matcher is made with, and the metric that is learnt before it."""

from dataclasses import dataclass
from functools import partial

import numpy as np
from sklearn.utils import Bunch

from ..matching.filters import SMOOTHING
from ..matching.matcher import Features
from ..work import run

__all__ = ["Settings", "features_of", "learn_metric"]

# max_offset="auto". A wide band leads paths astray until a metric is learnt; after that gestures
# need it: docs/method.md.
_NARROW, _WIDE = 0.25, 0.4
# The largest offset that a metric is learnt by, of what is certain: docs/method.md.
_CERTAIN = 0.2
# velocity_smoothing="auto": what is noise a metric knows; without one it is smoothed away.
_SMOOTH, _SHARP = SMOOTHING, 0.02
# Steps that a path may take at a frame, all offsets together.
_MOST_WAYS = 1e9
# Of how many performances a metric is learnt, at least and at most. Two have no route but the
# direct one: what they disagree in cannot be told from a wrong path.
_FEWEST, _MOST = 3, 20


@dataclass(frozen=True)
class Settings:
    """What `Matcher.learn` takes besides the performances."""

    smoothness: float
    max_offset: float
    max_rate: float

    @classmethod
    def of(cls, synchronizer, learnt):
        """Those of a synchronizer, with a metric or without."""
        max_offset = synchronizer.max_offset
        if max_offset == "auto":
            max_offset = _WIDE if learnt else _NARROW
        return cls(synchronizer.smoothness, max_offset, synchronizer.max_rate)

    def check(self, n_frames, subframes):
        """Say what a trellis asks for before it takes for ever."""
        steps = min(self.max_rate, n_frames - 1) * subframes + 1
        ways = steps * (2 * self.max_offset * n_frames * subframes + 1)
        if ways > _MOST_WAYS:
            raise ValueError(
                f"subframes = {subframes}, max_rate = {self.max_rate} and max_offset = "
                f"{self.max_offset} on {n_frames} frames ask for {ways:.0e} steps of a path "
                f"at every frame of every pair; {_MOST_WAYS:.0e} is the limit. Use fewer "
                "subframes, a smaller rate or offset."
            )


def features_of(synchronizer, unit, learnt):
    """What a synchronizer compares, to be learnt with a metric or without one."""
    smoothing = synchronizer.velocity_smoothing
    if smoothing == "auto":
        smoothing = _SHARP if learnt else _SMOOTH
    return Features(synchronizer.cost, synchronizer.subframes, smoothing, unit)


def learn_metric(synchronizer, plain, positions):
    """What is compared, with the metric of a training set, learnt of evenly spaced ones of many.

    Parameters
    ----------
    synchronizer : DenseSynchronizer
    plain : Features
        What is compared without a metric.
    positions : ndarray, shape (n_sequences, Q, n_features)
        The performances at all positions, in the unit.

    Returns
    -------
    features : Features
        Those without a metric if there is nothing to learn.
    learnt : Bunch or None
        ``metric_`` of the synchronizer.
    """
    n = len(positions)
    if n < _FEWEST:
        return plain, None
    some = np.unique(np.round(np.linspace(0, n - 1, min(n, _MOST))).astype(np.intp))
    settings = vars(Settings.of(synchronizer, learnt=False))
    settings = {**settings, "max_offset": min(settings["max_offset"], _CERTAIN)}
    vote = {name: getattr(synchronizer, name) for name in ("consensus", "warp_smoothing")}
    features = features_of(synchronizer, plain.unit, learnt=True)
    (learnt,) = run(partial(features.learn, **vote, **settings), [(positions[some],)])
    if learnt is None:
        return plain, None
    features, share, energy = learnt
    return features, Bunch(share=share, energy=energy, performances=some)
