"""A take that is being followed: particles, what departs from the mean, and whether it is lost."""

from typing import NamedTuple

import numpy as np

from ..matching.warps import at_times
from .kalman import correct, squared_lengths, whitening
from .tracker_model import smoothed
from .velocity import Slopes

__all__ = ["Estimate", "ParticleFilter", "follow", "systematic"]

# Particles are drawn anew when fewer than such a share of them tell anything.
_DRAWN_BELOW = 0.5
# One of so many begins somewhere on the clock, for who joins a movement that has begun.
_SOMEWHERE = 10
# What is lost is sought again after so many memories of surprise.
_SOUGHT_AGAIN = 3.0


class Estimate(NamedTuple):
    """What is known at a frame, in the order of a `Track`."""

    posture: np.ndarray
    covariance: np.ndarray
    phase: float
    rate: float
    effective_size: float
    lost: bool


class ParticleFilter:
    """A take that is followed frame by frame.

    All particles share one covariance of their deviations, as it depends on what is seen and not on
    the phase; so one gain corrects them all (a Rao-Blackwellised filter).

    Parameters
    ----------
    learnt : Learnt
    seed : int

    Attributes
    ----------
    time : float or None
        Of the last frame.
    particles : Particles
        Weighted by the last frame.
    begins : bool
        Whether they knew nothing of what was before the last frame.
    anew : ndarray of bool, shape (n_particles,)
        Which began the movement once more.
    taken : ndarray of bool, shape (n_observed,)
        What of the last frame was believed.
    """

    def __init__(self, learnt, seed):
        self.learnt, self.rng = learnt, np.random.default_rng(seed)
        self.time, self.lost, self.slopes = None, False, None
        n = learnt.n_particles
        somewhere = np.arange(n) % _SOMEWHERE == _SOMEWHERE - 1
        self._begin(np.where(somewhere, np.linspace(0, learnt.clock.last, n), 0.0))

    def step(self, values, time, matrix):
        """Take an observation, and say what is known: an `Estimate`. Parameters as of `take`."""
        return self._estimate(self.take(values, time, matrix))

    def take(self, values, time, matrix):
        """Take an observation.

        Parameters
        ----------
        values : ndarray, shape (n_observed,)
            NaN where nothing is seen.
        time : float
            In frames of the training performances, later than that of the step before.
        matrix : ndarray, shape (n_observed, n_features)
            What of a posture is observed.

        Returns
        -------
        ndarray, shape (n_particles, n_features)
            The mean at the phases of the particles.
        """
        dt = 0.0 if self.time is None else time - self.time
        self.begins, self.time, self.sought = self.time is None, time, self.sought + dt
        if self.lost and self.sought > _SOUGHT_AGAIN * self.learnt.clock.memory:
            self._seek()
        elif dt > 0:
            self._go_on(dt, matrix)
        expected = at_times(self.learnt.mean, self.particles.phases)
        self.taken = np.zeros(len(values), dtype=bool)
        seen = ~np.isnan(values)
        if seen.any():
            self._observe(values, seen, matrix, expected, dt)
        return expected

    # -- steps of a step --------------------------------------------------------------------

    def _begin(self, phases):
        """Begin at phases, knowing nothing of what departs from the mean."""
        learnt, n = self.learnt, len(phases)
        self.particles = Particles(phases, learnt.pace.begin(self.rng, n))
        self.means = np.zeros((2, n, learnt.mean.shape[1]))
        self.covariance = learnt.process.stationary
        self.slopes, self.anew = None, np.zeros(n, dtype=bool)
        self.surprise, self.sought = np.ones(2), 0.0

    def _seek(self):
        """Seek the phase anew, over all of the clock."""
        n = self.learnt.n_particles
        self._begin((self.rng.random() + np.arange(n)) / n * self.learnt.clock.last)
        # Only what is seen from now on tells that it is found.
        self.begins, self.surprise = True, self.learnt.limits

    def _go_on(self, dt, matrix):
        """Let a time pass."""
        learnt = self.learnt
        if self.particles.effective_size < _DRAWN_BELOW * learnt.n_particles:
            chosen = self.particles.draw(self.rng)
            self.means = self.means[:, chosen]
            if self.slopes is not None:
                self.slopes.keep(chosen)
        self.means, self.covariance = learnt.process.predict(self.means, self.covariance, dt)
        self.anew = self.particles.move(dt, learnt.pace, learnt.clock, self.rng)
        # The body stays where it is; only what it departs from is the beginning now.
        jump = learnt.mean[-1] - learnt.mean[0]
        self.means[0, self.anew] += jump
        if self.slopes is not None and self.slopes.ages.shape[1] == len(matrix):
            self.slopes.wait(dt)
            self.slopes.shift(self.anew, matrix @ jump)
        else:
            self.slopes = None

    def _observe(self, values, seen, matrix, expected, dt):
        """Believe what is possible: correct the deviations, and weigh the particles."""
        some = matrix[seen]
        with np.errstate(over="ignore", invalid="ignore"):
            residuals = values[seen] - expected @ some.T
            innovations = residuals - self.means[0] @ some.T
            covariance, correction = correct(self.covariance, some, innovations, self.learnt.noise)
            # Not a number is impossible, too.
            possible = bool((correction.surprise <= self.learnt.possible).any())
        if not possible:
            self._wonder(2 * self.learnt.limits, dt)
            return
        self.taken = seen
        self.means += correction.moves
        self.covariance = covariance
        if self.slopes is None:
            self.slopes = Slopes(len(expected), len(matrix), self.learnt.clock.window)
        self.slopes.add(residuals, seen)
        departure = self._departure(self.particles.weights @ residuals, some)
        known = self.slopes.known(seen)
        surprise = self._weigh(known, matrix, dt) if known.any() else self.surprise[0]
        self._wonder(np.array([surprise, departure]), dt)

    def _departure(self, residuals, some):
        """Surprise by a posture of which residuals (n_seen,) from the mean are seen."""
        learnt = self.learnt
        spread = some @ learnt.process.covariance @ some.T + learnt.noise**2 * np.eye(len(some))
        white = whitening(spread) @ residuals
        return self._of_fewer(white @ white / len(some), len(some))

    def _weigh(self, known, matrix, dt):
        """Weigh the particles by the velocities that are known, bool (n_observed,).

        Returns their surprise.
        """
        learnt, clock, some = self.learnt, self.learnt.clock, matrix[known]
        slopes, noise = self.slopes.of(known)
        spread = some @ learnt.velocities @ some.T + np.diag(learnt.noise**2 * noise)
        distances = squared_lengths(slopes @ whitening(spread).T)
        # Evidence counts by the time that it stems from, so that the frame rate does not matter.
        share = 100 * min(dt, clock.window) / clock.duration
        self.particles.weigh(-0.5 * share / learnt.tempering * distances)
        return self._of_fewer(self.particles.weights @ distances / len(some), len(some))

    def _of_fewer(self, surprise, n):
        """A surprise that is the mean of n numbers: that of fewer varies more."""
        return 1 + (surprise - 1) * min(np.sqrt(n / self.learnt.mean.shape[1]), 1.0)

    def _wonder(self, surprise, dt):
        """Remember surprises (2,), of which too much says that the phase is lost."""
        limits = self.learnt.limits
        self.surprise = smoothed(self.surprise, surprise, dt, self.learnt.clock.memory)
        if self.lost:
            # Who looks odd and moves alike is found: style persists.
            found = np.array([(1 + limits[0]) / 2, limits[1]])
            self.lost = bool((self.surprise > found).any())
        elif (self.surprise > limits).any():
            self.lost, self.sought = True, np.inf

    def _estimate(self, expected):
        """What the particles say together: mean and covariance of a mixture."""
        particles, width = self.particles, expected.shape[1]
        weights = particles.weights
        postures = expected + self.means[0]
        posture = weights @ postures
        off = postures - posture
        off *= np.sqrt(weights)[:, np.newaxis]
        return Estimate(
            posture,
            self.covariance[:width, :width] + off.T @ off,
            weighted_median(particles.phases, weights),
            weighted_median(particles.rates(self.learnt.clock.last), weights),
            particles.effective_size,
            self.lost,
        )


def follow(learnt, seed, values, times, matrix):
    """Estimates of all frames of a take, each from what was seen up to it.

    Parameters and returns are those of `smooth`.
    """
    running = ParticleFilter(learnt, seed)
    return [running.step(now, float(t), matrix) for now, t in zip(values, times, strict=True)]


# -- particles of phase and rate: how they move on, are drawn anew, and what they say together


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
