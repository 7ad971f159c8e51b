"""Particles of phase and rate: how they move on, are drawn anew, and what they say together."""

import numpy as np

__all__ = ["Particles", "systematic", "weighted_median"]


class Particles:
    """Phases and log rates, with log-weights.

    The phase goes on by the rate; the log rate is drawn back to 0, the mean pace, and pushed at
    random, so that its spread and memory are those of people. At the last frame the phase stays,
    until, at an hour that nobody knows, the movement begins anew.

    Parameters
    ----------
    phases : ndarray, shape (n,)
        Frames of the clock.
    logs : ndarray, shape (n,)
        Log rates.
    """

    def __init__(self, phases, logs):
        self.phases, self.logs = phases, logs
        self.log_weights = np.full(len(phases), -np.log(len(phases)))

    @property
    def weights(self):
        return np.exp(self.log_weights)

    @property
    def effective_size(self):
        """``1 / sum w^2``: as many particles of equal weight tell as much."""
        return float(1 / np.square(self.weights).sum())

    def move(self, dt, pace, clock, rng):
        """Go on for a time; bool (n,), which begin anew.

        Parameters
        ----------
        dt : float
        pace : Pace
        clock : Clock
        rng : numpy.random.Generator
        """
        n, before = len(self.logs), self.logs
        expected, pushed = pace.expect(before, dt)
        self.logs = expected + pushed * rng.standard_normal(n)
        anew = (self.phases >= clock.last) & (rng.random(n) < clock.anew(dt))
        fresh = pace.begin(rng, n)
        # The rate on the way is that half-way between its logs.
        moved = self.phases + np.exp((before + self.logs) / 2) * dt * clock.speed
        self.phases = np.where(anew, 0.0, np.minimum(moved, clock.last))
        self.logs = np.where(anew, fresh, self.logs)
        return anew

    def weigh(self, log_likelihoods):
        """Bayes' rule, weights summing up to 1."""
        weights = self.log_weights + log_likelihoods
        top = weights.max()
        self.log_weights = weights - (top + np.log(np.exp(weights - top).sum()))

    def draw(self, rng):
        """Draw them anew by their weights; the indices of those that go on."""
        chosen = systematic(self.weights, rng.random(), len(self.phases))
        self.__init__(self.phases[chosen], self.logs[chosen])
        return chosen

    def rates(self, last):
        """Rates, 0 where the movement is over."""
        return np.where(self.phases < last, np.exp(self.logs), 0.0)


def systematic(weights, start, n):
    """Systematic resampling: n indices by evenly spaced pointers, of which one draw, start, tells.

    Each index comes as often as n times its share of the weights, rounded up or down.
    """
    edges = np.cumsum(weights)
    pointers = (start + np.arange(n)) / n * edges[-1]
    return np.minimum(np.searchsorted(edges, pointers, side="right"), len(weights) - 1)


def weighted_median(values, weights):
    """The smallest value up to which half of the weight lies."""
    order = np.argsort(values, kind="stable")
    edges = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(edges, 0.5 * edges[-1])]])
