"""Velocities of sequences of which only the past is known.

A difference of two samples under two exponential filters: no sample after it has a say. It comes
late by twice the width of a filter; what it is compared with goes through the same, and is as late.
"""

import numpy as np

__all__ = ["CausalDerivative", "causal_velocity"]

# Gaps longer than this, in widths of the filter, are not bridged: the filter begins anew.
_BRIDGED = 3


class CausalDerivative:
    """The velocity of streams at their last sample, sample by sample.

    Before its first sample a stream has been at rest.

    Parameters
    ----------
    width : float
        Time constant of both filters, in samples; 0 for the plain difference.
    shape : tuple (n_streams, n_features)
    """

    def __init__(self, width, shape):
        self._keep = float(np.exp(-1 / width)) if width > 0 else 0.0
        self._longest = max(1.0, _BRIDGED * width)
        self._last = np.full(shape, np.nan)
        # Samples since the last was seen; what each filter holds, and of how much weight that is.
        # Steady: everything was seen in the last sample, and has been for long.
        self._steady = False
        self._age = np.zeros(shape)
        self._held = np.zeros((2, *shape))
        self._weight = np.ones((2, *shape))

    def restart(self, stream):
        """Forget what one stream has done."""
        self._last[stream], self._age[stream] = np.nan, 0
        self._held[:, stream], self._weight[:, stream] = 0, 1
        self._steady = False

    def step(self, sample):
        """Velocity by the sample, NaN where it is not known: (n_streams, n_features).

        Parameters
        ----------
        sample : ndarray, shape (n_streams, n_features)
            NaN where nothing was seen. Across a short gap a movement is taken to be even; after a
            long one the filter begins with the second sample.
        """
        if self._steady and not np.isnan(sample).any():
            velocity = sample - self._last
            for held in self._held:
                held += (1 - self._keep) * (velocity - held)
                velocity = held.copy()
            self._last = np.array(sample)
            return velocity
        return self._step(sample)

    def _step(self, sample):
        """The same where something is not seen, or was not."""
        self._age += 1
        seen = ~np.isnan(sample)
        lost = seen & (self._age > self._longest) & ~np.isnan(self._last)
        self._weight[:, lost] = 0
        first = seen & np.isnan(self._last)
        known = seen & ~lost
        gap = np.where(known, self._age, 1)
        difference = np.where(known & ~first, sample - self._last, 0) / gap
        keep = np.where(known, self._keep**gap, 1)
        velocity = difference
        for held, weight in zip(self._held, self._weight, strict=True):
            weight *= keep
            weight += 1 - keep
            # The mean of what has been seen; what had no weight is replaced.
            held += np.where(weight > 0, (1 - keep) / np.where(weight > 0, weight, 1), 0) * (
                velocity - held
            )
            velocity = held.copy()
        self._last = np.where(seen, sample, self._last)
        self._age[seen] = 0
        self._steady = bool(seen.all() and (self._weight > 1 - 1e-12).all())
        return np.where(known, velocity, np.nan)


def causal_velocity(positions, subframes, width):
    """The same of a whole sequence, at every position, by the frame.

    Parameters
    ----------
    positions : ndarray, shape (Q, n_features)
        ``subframes`` positions a frame. Every position is filtered with those whole frames before
        it, as the samples of a stream at its pace are.
    subframes : int
    width : float
        Time constant in frames.

    Returns
    -------
    ndarray, shape (Q, n_features)
    """
    n_frames = -(-(len(positions) - 1) // subframes)
    behind = np.arange(n_frames + 1)[:, np.newaxis] * subframes - np.arange(subframes)
    # Column k is k positions before whole frames; before the first position the sequence rests.
    lanes = positions[np.clip(behind, 0, len(positions) - 1)]
    derivative = CausalDerivative(width, lanes.shape[1:])
    found = np.stack([derivative.step(sample) for sample in lanes])
    out = np.empty_like(positions)
    inside = (behind >= 0) & (behind < len(positions))
    out[behind[inside]] = found[inside]
    return out
