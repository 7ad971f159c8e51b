"""The Rao-Blackwellised particle filter of a tracker: particles of phase and rate."""

from typing import NamedTuple

import numpy as np

from ..matching.counting import ROUNDING
from ..matching.warps import at_times
from .kalman import DeviationFilter, squared_norms, whitening
from .state_space import CausalSlopes, exponential_average

__all__ = ["ParticleFilter", "Particles", "systematic_resampling", "weighted_median"]

# Particles are resampled when their effective size is below this share of them.
_MIN_EFFECTIVE = 0.5
# One particle of so many begins elsewhere on the clock, for a take that begins in mid-movement.
_ELSEWHERE = 10
# While the phase is lost, particles are reinitialised after so many memories of the NIS.
_RETRY = 3.0


class ParticleFilter:
    """Particles of phase and rate, with a Kalman filter of the deviations of each.

    All particles share one covariance of their deviations, which depends on what is observed and
    not on the phase; so one Kalman gain serves them all.

    Parameters
    ----------
    model : TrackerModel
    seed : int
    time : float
        Of the first frame, which ``step`` still has to take.
    n_observed : int
        Its numbers.

    Attributes
    ----------
    time : float
        Of the last frame.
    particles : Particles
        Weighted by the last frame.
    initial : bool
        Whether the particles know nothing of what was before the last frame.
    expected : ndarray, shape (n_particles, n_features)
        The mean performance at their phases.
    deviations : DeviationFilter
    accepted : ndarray of bool, shape (n_observed,)
        The observations of the last frame that were used.
    innovation : float or None
        Their NIS, the mean over the particles before they were weighted; None without any.
    lost : bool
    """

    def __init__(self, model, seed, time, n_observed):
        self.model, self.rng = model, np.random.default_rng(seed)
        self.deviations = DeviationFilter(model.process, model.n_particles)
        self.time, self.lost = time, False
        n = model.n_particles
        elsewhere = np.arange(n) % _ELSEWHERE == _ELSEWHERE - 1
        self._initialise(np.where(elsewhere, np.linspace(0, model.clock.last, n), 0.0), n_observed)

    @property
    def estimate(self):
        """The expected posture, and its covariance over all phases."""
        weights = self.particles.weights
        postures = self.expected + self.deviations.means[0]
        posture = weights @ postures
        off = postures - posture
        off *= np.sqrt(weights)[:, np.newaxis]
        return posture, self.deviations.posture_covariance + off.T @ off

    def update(self, values, time, observer):
        """Take an observation.

        Parameters
        ----------
        values : ndarray, shape (n_observed,)
            NaN where nothing is seen.
        time : float
            In frames of the training performances, later than that of the frame before.
        observer : Observer
        """
        dt, self.time = time - self.time, time
        self.since_search += dt
        n_observed = len(observer.matrix)
        if self.slopes.width != n_observed:
            self.slopes = CausalSlopes(self.model.n_particles, n_observed, self.model.clock.window)
        if self.lost and self.since_search > _RETRY * self.model.clock.memory:
            self._reinitialise()
        elif dt > 0:
            self._predict(dt, observer.matrix)
        self.expected = at_times(self.model.mean, self.particles.phases)
        seen = ~np.isnan(values)
        self.accepted, self.innovation = np.zeros_like(seen), None
        if seen.any():
            self._observe(values, seen, observer, dt)

    def _initialise(self, phases, n_observed):
        """Begin at these phases, without knowledge of the deviations."""
        model, n = self.model, len(phases)
        self.particles = Particles.uniform(phases, model.rates.draw(self.rng, n))
        self.deviations.begin(n)
        self.slopes = CausalSlopes(n, n_observed, model.clock.window)
        self.nis, self.since_search, self.initial = np.ones(2), 0.0, True

    def _reinitialise(self):
        """Spread the particles over the whole clock."""
        n = self.model.n_particles
        phases = (self.rng.random() + np.arange(n)) / n * self.model.clock.last
        self._initialise(phases, self.slopes.width)
        # The phase stays lost until later observations agree with it.
        self.nis = self.model.nis_limits

    def _predict(self, dt, matrix):
        """Resample the particles if need be, and let a time pass."""
        model, particles = self.model, self.particles
        if particles.effective_size < _MIN_EFFECTIVE * model.n_particles:
            weights, n = particles.weights, model.n_particles
            indices = systematic_resampling(weights, self.rng.random(), n)
            particles = Particles.uniform(particles.phases[indices], particles.log_rates[indices])
            self.deviations.means = self.deviations.means[:, indices]
            self.slopes.resample(indices)
        self.deviations.predict(dt)
        self.particles = particles.move(dt, model.rates, model.clock, self.rng)
        self.initial = False
        # A restart leaves the body where it is: its deviation is now from the first frame.
        jump = model.mean[-1] - model.mean[0]
        self.deviations.means[0, self.particles.restarted] += jump
        self.slopes.advance(dt)
        self.slopes.shift(self.particles.restarted, matrix @ jump)

    def _observe(self, values, seen, observer, dt):
        """Correct the deviations and the weights, unless the observation is outside the gate."""
        model, (rows, noise) = self.model, observer.of(seen)
        residuals = values[seen] - self.expected @ rows.T
        update = self.deviations.correct(residuals, rows, noise, model.gate)
        if update is None:
            self._update_nis(2 * model.nis_limits, dt)
            return
        self.accepted = seen
        self.innovation = float(self.particles.weights @ update.nis)
        self.slopes.add(residuals, seen)
        posture_nis = self._posture_nis(self.particles.weights @ residuals, rows, noise)
        known = self.slopes.have_slopes(seen)
        velocity_nis = self._reweight(known, observer, dt) if known.any() else self.nis[0]
        self._update_nis(np.array([velocity_nis, posture_nis]), dt)

    def _posture_nis(self, residuals, rows, noise):
        """NIS of a posture with these residuals (n_seen,) from the mean."""
        covariance = rows @ self.model.process.covariance @ rows.T + noise
        whitened = whitening(covariance) @ residuals
        return self._shrink_nis(whitened @ whitened / len(rows), len(rows))

    def _reweight(self, known, observer, dt):
        """Weigh the particles by the velocities with this mask (n_observed,); their NIS."""
        model, clock, (rows, noise) = self.model, self.model.clock, observer.of(known)
        slopes, shares = self.slopes.fit(known)
        deviations = np.sqrt(shares)
        covariance = rows @ model.velocities @ rows.T + noise * np.outer(deviations, deviations)
        distances = squared_norms(slopes @ whitening(covariance).T)
        # Evidence is weighted by its duration, so that the frame rate does not matter.
        share = 100 * min(dt, clock.window) / clock.duration
        self.particles = self.particles.reweight(-0.5 * share / model.tempering * distances)
        return self._shrink_nis(self.particles.weights @ distances / len(rows), len(rows))

    def _shrink_nis(self, nis, n):
        """A mean of n squares, drawn towards 1 to vary as that of all features."""
        return 1 + (nis - 1) * min(np.sqrt(n / self.model.mean.shape[1]), 1.0)

    def _update_nis(self, nis, dt):
        """Average the NIS (2,) of velocities and postures, and compare them with their limits."""
        limits = self.model.nis_limits
        self.nis = exponential_average(self.nis, nis, dt, self.model.clock.memory)
        if self.lost:
            # The limit of postures stays: a person's style persists.
            self.lost = bool((self.nis > [(1 + limits[0]) / 2, limits[1]]).any())
        elif (self.nis > limits).any():
            self.lost, self.since_search = True, np.inf


class Particles(NamedTuple):
    """Weighted particles of phase and log rate.

    The phase goes on by the rate, and the log rate is an Ornstein-Uhlenbeck process. At the last
    frame the phase stays, until the movement restarts; restart times are exponential.

    Parameters
    ----------
    phases : ndarray, shape (n,)
        Frames of the clock.
    log_rates : ndarray, shape (n,)
    log_weights : ndarray, shape (n,)
    restarted : ndarray of bool, shape (n,)
        Whether the movement restarted in the last move.
    """

    phases: np.ndarray
    log_rates: np.ndarray
    log_weights: np.ndarray
    restarted: np.ndarray

    @classmethod
    def uniform(cls, phases, log_rates):
        """Particles of equal weight."""
        n = len(phases)
        return cls(phases, log_rates, np.full(n, -np.log(n)), np.zeros(n, dtype=bool))

    @property
    def weights(self):
        return np.exp(self.log_weights)

    @property
    def effective_size(self):
        """The effective sample size, ``1 / sum w^2``."""
        return float(1 / np.square(self.weights).sum())

    def rates(self, clock):
        """Rates, 0 at the end of the movement."""
        return np.where(self.phases < clock.last, np.exp(self.log_rates), 0.0)

    def move(self, dt, rate_process, clock, rng):
        """The particles after a time, of the same weights."""
        n, before = len(self.phases), self.log_rates
        means, deviation = rate_process.predict(before, dt)
        log_rates = means + deviation * rng.standard_normal(n)
        restarted = (self.phases >= clock.last) & (rng.random(n) < clock.restart_probability(dt))
        fresh = rate_process.draw(rng, n)
        # The rate in between is that of the mean log rate.
        moved = self.phases + np.exp((before + log_rates) / 2) * dt * clock.speed
        return Particles(
            np.where(restarted, 0.0, np.minimum(moved, clock.last)),
            np.where(restarted, fresh, log_rates),
            self.log_weights,
            restarted,
        )

    def reweight(self, log_likelihoods):
        """Bayes' rule; the weights sum to 1."""
        log_weights = self.log_weights + log_likelihoods
        top = log_weights.max()
        log_weights = log_weights - (top + np.log(np.exp(log_weights - top).sum()))
        return self._replace(log_weights=log_weights)


def systematic_resampling(weights, start, n):
    """Systematic resampling: n indices by evenly spaced pointers, the first at ``start / n``.

    Each index comes as often as n times its share of the weights, rounded up or down.
    """
    edges = np.cumsum(weights)
    pointers = (start + np.arange(n)) / n * edges[-1]
    return np.minimum(np.searchsorted(edges, pointers, side="right"), len(weights) - 1)


def weighted_median(values, weights):
    """The smallest value up to which half of the weight lies, but for rounding."""
    order = np.argsort(values, kind="stable")
    edges = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(edges, (0.5 - ROUNDING) * edges[-1])]])
