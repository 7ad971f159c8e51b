"""Synchronizers: estimators that put trials on the clock of a pattern (Eqs. 6 to 19).

`DenseSynchronizer` matches dense velocities, `LinearSynchronizer` stretches trials evenly, between
their ends or between key-frames, and `PartSynchronizer` matches parts of the body on their own.
`TimingChannel` puts the warps of any of them beside the curves, and `blend_trials` mixes trials
that were aligned. A `Match` is what they answer: the warps, with their intervals and doubts.
"""

from .base import Synchronizer
from .blending import blend_trials
from .dense import DenseSynchronizer
from .learning import SynchronizationWarning
from .linear import LinearSynchronizer
from .match import Match
from .parts import Lags, PartSynchronizer
from .timing import TimingChannel

__all__ = [
    "DenseSynchronizer",
    "Lags",
    "LinearSynchronizer",
    "Match",
    "PartSynchronizer",
    "SynchronizationWarning",
    "Synchronizer",
    "TimingChannel",
    "blend_trials",
]
