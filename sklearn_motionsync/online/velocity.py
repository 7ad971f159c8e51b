"""Causal velocity of sequences with gaps, at uneven times: slopes of weighted lines."""

import numpy as np

__all__ = ["Slopes"]

# What was seen before counts if it weighs at least this, beside 1 of what is seen now.
_LEAST = 1e-3


class Slopes:
    """The slopes of lines through the last values, whose weights decay with their age.

    The weights ``exp(-age / window)`` are the same for all sequences. The slope of a difference is
    the difference of the slopes, of the same delay on both sides, which so cancels.

    Parameters
    ----------
    n : int
        Sequences.
    width : int
        Features.
    window : float
        Age at which a value weighs 1/e.
    """

    def __init__(self, n, width, window):
        self.window = window
        # Sums of weights, and of their squares, times the age to the power 0, 1, 2.
        self.ages, self.squares = np.zeros((3, width)), np.zeros((3, width))
        # Sums of weighted values times the age to the power 0, 1.
        self.values = np.zeros((2, n, width))

    def wait(self, dt):
        """Let everything be older by dt."""
        left = np.exp(-dt / self.window)
        for (zero, one, two), share in ((self.ages, left), (self.squares, left**2)):
            two += 2 * dt * one + dt**2 * zero
            one += dt * zero
            for moment in (zero, one, two):
                moment *= share
        on = left * np.array([[1.0, 0.0], [dt, 1.0]])
        self.values = (on @ self.values.reshape(2, -1)).reshape(self.values.shape)

    def add(self, values, seen):
        """Take values (n, n_seen) of the features that are seen now, bool (width,)."""
        self.ages[0, seen] += 1
        self.squares[0, seen] += 1
        self.values[0][:, _where(seen)] += values

    def keep(self, chosen):
        """Go on with some of the sequences, maybe several times."""
        self.values = self.values[:, chosen]

    def shift(self, chosen, by):
        """Change all values so far of some sequences by a constant (width,)."""
        self.values[:, chosen] += (self.ages[:2] * by)[:, np.newaxis]

    def known(self, seen):
        """Which of the features that are seen now were so lately, too: bool (width,)."""
        return seen & (self.ages[0] - 1 > _LEAST)

    def of(self, known):
        """Slopes (n, n_known), and their variance under unit noise of the values (n_known,)."""
        known = _where(known)
        zero, one, two = self.ages[:, known]
        zeros, ones, twos = self.squares[:, known]
        spread = zero * two - one**2
        values, aged = self.values[:, :, known]
        slopes = (one / spread) * values
        slopes -= (zero / spread) * aged
        noise = (zero**2 * twos - 2 * zero * one * ones + one**2 * zeros) / spread**2
        return slopes, noise


def _where(mask):
    """An index that makes no copy where all is meant."""
    return slice(None) if mask.all() else mask
