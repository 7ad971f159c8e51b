"""How sure a match is: intervals of its times, and which trials are doubtful."""

import threading
from collections.abc import Callable, Iterable
from itertools import chain

import numpy as np

from ..matching.counting import whole
from ..matching.sizes import BATCH
from ..matching.uncertainty import coverage_factor
from ..matching.warps import even_slices
from ..utils.parallel import one_blas_thread

# A trial is doubtful if the share of its movement that no path explains, times the widest
# interval of 90 %, as a share of the clip, is larger: docs/design.md.
_DOUBTFUL = 0.2


# Half-widths (n_sequences, P) of 90 %, in frames, 0 where a warp is pinned; whether errors are
# normal, bool (n_sequences,), as of `Uncertainty`; and why each trial is doubtful.
Measured = tuple[np.ndarray, np.ndarray, list[str | None]]


class Intervals:
    """Intervals of the times of a match, measured when they are first asked for.

    Parameters
    ----------
    times : ndarray, shape (n_sequences, P)
    measure : callable
        Gives `Measured`. It is called once.
    """

    def __init__(self, times: np.ndarray, measure: Callable[[], Measured]) -> None:
        self.times, self._measure = times, measure
        self._measured: Measured | None = None
        self._lock = threading.Lock()

    def __getstate__(self):
        return self.times, self.measured()

    def __setstate__(self, state):
        self.times, self._measured = state
        self._lock = threading.Lock()

    def measured(self) -> Measured:
        """What is known of the trials, which are not needed any more."""
        with self._lock:
            if self._measured is None:
                self._measured = self._measure()
                del self._measure
            return self._measured

    def bounds(self, coverage: float) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper times, (n_sequences, P) each, non-decreasing and inside the clip."""
        widths, is_normal, _ = self.measured()
        half = widths * coverage_factor(coverage, is_normal)[:, np.newaxis]
        last = self.times.shape[1] - 1
        lower, upper = np.maximum(self.times - half, 0), np.minimum(self.times + half, last)
        # A warp does not decrease: it is above what it was above before.
        lower = np.maximum.accumulate(lower, axis=1)
        return lower, np.minimum.accumulate(upper[:, ::-1], axis=1)[:, ::-1]


def joined(parts: Iterable[Measured]) -> Measured:
    """What was measured of trials that were matched in parts."""
    widths, is_normal, reasons = zip(*parts, strict=True)
    return np.concatenate(widths), np.concatenate(is_normal), [*chain(*reasons)]


def intervals_of(warper, arrays, times, factor, evidence, pinned=None):
    """The intervals of the times of a match of a `DenseSynchronizer`.

    Parameters
    ----------
    warper : Warper
    arrays : list of ndarray (n_frames_i, n_columns)
        Trials as the warper takes them.
    times : ndarray, shape (n_trials, P)
        Their warps.
    factor : float
        By which half-widths are multiplied.
    evidence : Bunch
        As ``evidence_``.
    pinned : tuple of ndarray (n_keyframes,) and of bool (n_trials, n_keyframes), default=None
        Key-frames of the pattern, in frames, and those that were given for each trial: warps go
        through them.
    """

    def measure():
        with one_blas_thread():
            batches = [
                warper.uncertainty(warper.positions(arrays[rows]), times[rows])
                for rows in even_slices(len(times), BATCH)
            ]
        widths, is_normal, unlike, widest = (
            np.concatenate(values) for values in zip(*batches, strict=True)
        )
        widths[:, [0, -1]] = 0
        if pinned is not None:
            keyframes, is_known = pinned
            for way in ("down", "up"):
                widths[:, whole(keyframes, way)] *= ~is_known
        reasons = []
        for share, width in zip(unlike, widest, strict=True):
            why = None
            if share * width > _DOUBTFUL:
                why = (
                    f"no warp explains {share:.0%} of its movement, and an interval of 90 % holds "
                    f"{width:.0%} of the clip: it may be cut off, repeated or another movement"
                )
            elif evidence.weak:
                why = (
                    f"matching leaves {evidence.remaining:.0%} of the differences in the training "
                    "set, and its warps contradict each other (evidence_)"
                )
            reasons.append(why)
        return widths * factor, is_normal, reasons

    return Intervals(times, measure)
