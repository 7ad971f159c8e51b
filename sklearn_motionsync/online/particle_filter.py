"""The Rao-Blackwellised particle filter of a tracker, and its smoother by backward simulation."""

from typing import NamedTuple

import numpy as np

from ..inputs.wording import counted
from ..matching.warps import at_times
from .state_space import CausalSlopes, exponential_average, kalman_update, squared_norms, whitening

__all__ = ["ParticleFilter", "Track", "filter_take", "smooth_take", "stack_frames"]

# Particles are resampled when their effective size is below this share of them.
_MIN_EFFECTIVE = 0.5
# One particle of so many begins elsewhere on the clock, for a take that begins in mid-movement.
_ELSEWHERE = 10
# While the phase is lost, particles are reinitialised after so many memories of the NIS.
_RETRY = 3.0


class Track(NamedTuple):
    """The body at every frame of a take; of a single frame, without the axis of frames.

    Parameters
    ----------
    postures : ndarray, shape (n_frames, n_features)
        Expected postures, given the observations.
    covariances : ndarray, shape (n_frames, n_features, n_features)
        Of the postures, over all possible phases; without the noise of observations.
    phases : ndarray, shape (n_frames,)
        Weighted medians of the particles, in frames of the clock, 0 to P - 1.
    rates : ndarray, shape (n_frames,)
        Weighted medians of the pace: 1 is the mean of the training performances, 2 twice as fast,
        0 at the end of the movement.
    effective_sizes : ndarray, shape (n_frames,)
        Effective sample sizes of the particles, ``1 / sum w^2``. Of a smoothed take: the number of
        different particles on its paths.
    lost : ndarray of bool, shape (n_frames,)
        Whether velocities or postures are improbable at all phases.

    See Also
    --------
    MotionTracker : Estimates it.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import LinearSynchronizer, MotionTracker
    >>> X = [size * np.sin(np.linspace(0, 3, 40))[:, np.newaxis] for size in (0.9, 1.0, 1.1)]
    >>> track = MotionTracker(LinearSynchronizer()).fit(X).track(X[0])
    >>> track
    Track(40 frames of 1 feature, 0 of them lost)
    >>> track.covariances.shape
    (40, 1, 1)
    """

    postures: np.ndarray
    covariances: np.ndarray
    phases: np.ndarray
    rates: np.ndarray
    effective_sizes: np.ndarray
    lost: np.ndarray

    def __repr__(self):
        n_frames, n_features = np.size(self.lost), self.postures.shape[-1]
        n_lost = np.count_nonzero(self.lost)
        return (
            f"Track({n_frames} frames of {counted(n_features, 'feature')}, {n_lost} of them lost)"
        )


def stack_frames(frames, dtype):
    """The `Track` of each frame as one, postures in this precision."""
    postures, covariances, *numbers = map(np.array, zip(*frames, strict=True))
    return Track(*(x.astype(dtype, copy=False) for x in (postures, covariances)), *numbers)


def filter_take(model, seed, values, times, matrix):
    """The filtered frames of a take, each given the observations up to it.

    Parameters and returns are those of `smooth_take`.
    """
    running = ParticleFilter(model, seed, times[0], len(matrix))
    return [running.step(*frame, matrix) for frame in zip(values, times, strict=True)]


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
    accepted : ndarray of bool, shape (n_observed,)
        The observations of the last frame that were used.
    lost : bool
    """

    def __init__(self, model, seed, time, n_observed):
        self.model, self.rng = model, np.random.default_rng(seed)
        self.time, self.lost = time, False
        n = model.n_particles
        elsewhere = np.arange(n) % _ELSEWHERE == _ELSEWHERE - 1
        self._initialise(np.where(elsewhere, np.linspace(0, model.clock.last, n), 0.0), n_observed)

    def step(self, values, time, matrix):
        """Take an observation; the `Track` of its frame. Parameters as of `update`."""
        postures, particles = self.update(values, time, matrix) + self.means[0], self.particles
        posture = particles.weights @ postures
        off = postures - posture
        off *= np.sqrt(particles.weights)[:, np.newaxis]
        return Track(
            posture,
            self.covariance[: len(posture), : len(posture)] + off.T @ off,
            weighted_median(particles.phases, particles.weights),
            weighted_median(particles.rates(self.model.clock), particles.weights),
            particles.effective_size,
            self.lost,
        )

    def update(self, values, time, matrix):
        """Take an observation.

        Parameters
        ----------
        values : ndarray, shape (n_observed,)
            NaN where nothing is seen.
        time : float
            In frames of the training performances, later than that of the frame before.
        matrix : ndarray, shape (n_observed, n_features)
            The observation matrix.

        Returns
        -------
        ndarray, shape (n_particles, n_features)
            The mean performance at the phases of the particles.
        """
        dt, self.time = time - self.time, time
        self.since_search += dt
        if self.slopes.width != len(matrix):
            self.slopes = CausalSlopes(len(self.means[0]), len(matrix), self.model.clock.window)
        if self.lost and self.since_search > _RETRY * self.model.clock.memory:
            self._reinitialise()
        elif dt > 0:
            self._predict(dt, matrix)
        expected = at_times(self.model.mean, self.particles.phases)
        seen = ~np.isnan(values)
        self.accepted = np.zeros_like(seen)
        if seen.any():
            self._observe(values, seen, matrix, expected, dt)
        return expected

    def _initialise(self, phases, n_observed):
        """Begin at these phases, without knowledge of the deviations."""
        model, n = self.model, len(phases)
        self.particles = Particles.uniform(phases, model.rates.draw(self.rng, n))
        self.means = np.zeros((2, n, model.mean.shape[1]))
        self.covariance = model.process.stationary
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
            self.means = self.means[:, indices]
            self.slopes.resample(indices)
        self.means, self.covariance = model.process.predict(self.means, self.covariance, dt)
        self.particles = particles.move(dt, model.rates, model.clock, self.rng)
        self.initial = False
        # A restart leaves the body where it is: its deviation is now from the first frame.
        jump = model.mean[-1] - model.mean[0]
        self.means[0, self.particles.restarted] += jump
        self.slopes.advance(dt)
        self.slopes.shift(self.particles.restarted, matrix @ jump)

    def _observe(self, values, seen, matrix, expected, dt):
        """Correct the deviations and the weights, unless the observation is outside the gate."""
        model, rows = self.model, matrix[seen]
        residuals = values[seen] - expected @ rows.T
        innovations = residuals - self.means[0] @ rows.T
        # What overflows is outside the gate.
        with np.errstate(over="ignore", invalid="ignore"):
            covariance, update = kalman_update(self.covariance, rows, innovations, model.noise)
            in_gate = (update.nis <= model.gate).any()
        if not in_gate:
            self._update_nis(2 * model.nis_limits, dt)
            return
        self.accepted = seen
        self.means += update.corrections
        self.covariance = covariance
        self.slopes.add(residuals, seen)
        posture_nis = self._posture_nis(self.particles.weights @ residuals, rows)
        known = self.slopes.have_slopes(seen)
        velocity_nis = self._reweight(known, matrix, dt) if known.any() else self.nis[0]
        self._update_nis(np.array([velocity_nis, posture_nis]), dt)

    def _posture_nis(self, residuals, rows):
        """NIS of a posture with these residuals (n_seen,) from the mean."""
        model = self.model
        covariance = rows @ model.process.covariance @ rows.T + model.noise**2 * np.eye(len(rows))
        whitened = whitening(covariance) @ residuals
        return self._shrink_nis(whitened @ whitened / len(rows), len(rows))

    def _reweight(self, known, matrix, dt):
        """Weigh the particles by the velocities with this mask (n_observed,); their NIS."""
        model, clock, rows = self.model, self.model.clock, matrix[known]
        slopes, noise = self.slopes.fit(known)
        covariance = rows @ model.velocities @ rows.T + np.diag(model.noise**2 * noise)
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
    """The smallest value up to which half of the weight lies."""
    order = np.argsort(values, kind="stable")
    edges = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(edges, 0.5 * edges[-1])]])


# -- smoother: forward filtering, backward simulation of phases, and deviations along them --

# Phase paths that are drawn.
_N_PATHS = 20
# Standard deviation of the phases of a path about those of the particles, in frames of the clock.
_PHASE_SPREAD = 0.5
# Frames whose filtered states are in memory at once.
_BLOCK = 100


class HistoryFrame(NamedTuple):
    """A frame of the particle filter, and the observations it accepted."""

    dt: float
    particles: Particles
    initial: bool
    values: np.ndarray
    lost: bool


def smooth_take(model, seed, values, times, matrix):
    """The smoothed frames of a take, each given all observations.

    Paths of phases are drawn by backward simulation from the particles of the filter. Along each
    path the deviations are smoothed by the modified Bryson-Frazier smoother, which inverts the
    innovation covariance only. The paths have equal weights.

    Parameters
    ----------
    model : TrackerModel
    seed : int
    values : ndarray, shape (n_frames, n_observed)
    times : ndarray, shape (n_frames,)
    matrix : ndarray, shape (n_observed, n_features)

    Returns
    -------
    list of Track
        One a frame.
    """
    running, history = ParticleFilter(model, seed, times[0], len(matrix)), []
    for now, time in zip(values, times, strict=True):
        dt = time - running.time
        running.update(now, time, matrix)
        accepted = np.where(running.accepted, now, np.nan)
        frame = HistoryFrame(dt, running.particles, running.initial, accepted, running.lost)
        history.append(frame)
    paths = _simulate_backwards(model, history, running.rng)
    return _smooth_paths(model, history, paths, matrix)


def _simulate_backwards(model, history, rng):
    """Indices of the particles on each path: (n_frames, n_paths)."""
    paths = [systematic_resampling(history[-1].particles.weights, rng.random(), _N_PATHS)]
    for before, after in zip(history[-2::-1], history[:0:-1], strict=True):
        log_weights = np.tile(before.particles.log_weights, (_N_PATHS, 1))
        if not after.initial:
            log_weights += _log_transition(model, before.particles, after, paths[-1])
        weights = np.exp(log_weights - log_weights.max(axis=1, keepdims=True))
        edges = np.cumsum(weights, axis=1)
        paths.append((edges < rng.random((_N_PATHS, 1)) * edges[:, -1:]).sum(axis=1))
    return np.array(paths[::-1])


def _log_transition(model, before, after, path):
    """Log-densities of moves from all particles to those on the paths, (n_paths, n_particles)."""
    clock, particles, dt = model.clock, after.particles, after.dt
    phases, log_rates = particles.phases[path, np.newaxis], particles.log_rates[path, np.newaxis]
    moved = before.phases + np.exp((before.log_rates + log_rates) / 2) * dt * clock.speed
    log_density = -0.5 * np.square((phases - np.minimum(moved, clock.last)) / _PHASE_SPREAD)
    means, deviation = model.rates.predict(before.log_rates, dt)
    if deviation > 0:
        log_density -= 0.5 * np.square((log_rates - means) / deviation)
    # Restarts begin at the end of the movement.
    at_end = np.where(before.phases >= clock.last, 0.0, -np.inf)
    return np.where(particles.restarted[path, np.newaxis], at_end, log_density)


def _smooth_paths(model, history, paths, matrix):
    """The mixture over the paths, at every frame.

    The Kalman filter runs twice, first for the states at the beginning of each block of frames.
    """
    blocks = [slice(i, i + _BLOCK) for i in range(0, len(history), _BLOCK)]
    states = [None]
    for block in blocks[:-1]:
        states.append(_filter_paths(model, history[block], paths[block], matrix, states[-1])[1])
    out, later = [], None
    for block, state in zip(blocks[::-1], states[::-1], strict=True):
        filtered, _ = _filter_paths(model, history[block], paths[block], matrix, state)
        frames = zip(history[block], paths[block], filtered, strict=True)
        for past, path, (postures, columns, update) in reversed(list(frames)):
            out.append(_smooth_frame(model, past, path, postures, columns, later))
            later = _adjoint_step(model, past, update, later)
    return out[::-1]


def _filter_paths(model, history, paths, matrix, state):
    """The Kalman filter along all paths, on from a state.

    Returns a list of filtered frames, and the state after them: means and covariance. A filtered
    frame has the postures (n_paths, n_features), the columns of the state covariance that belong to
    the values, (2 n_features, n_features), and the `KalmanUpdate`, None without observations.
    """
    width, filtered = model.mean.shape[1], []
    for past, path in zip(history, paths, strict=True):
        if past.initial:
            means, covariance = np.zeros((2, len(path), width)), model.process.stationary
        else:
            means, covariance = model.process.predict(*state, past.dt)
            means[0, past.particles.restarted[path]] += model.mean[-1] - model.mean[0]
        expected, update = at_times(model.mean, past.particles.phases[path]), None
        seen = ~np.isnan(past.values)
        if seen.any():
            rows = matrix[seen]
            innovations = past.values[seen] - (expected + means[0]) @ rows.T
            covariance, update = kalman_update(covariance, rows, innovations, model.noise)
            means = means + update.corrections
        filtered.append((expected + means[0], covariance[:, :width].copy(), update))
        state = means, covariance
    return filtered, state


def _smooth_frame(model, past, path, postures, columns, later):
    """The `Track` of a frame: a filtered frame, and what later observations add.

    ``later`` is the adjoint (n_paths, 2 n_features) and the information (2 n_features,) * 2 of the
    states at the frame; None without later observations.
    """
    covariance = columns[: columns.shape[1]]
    if later is not None:
        adjoint, information = later
        postures = postures - adjoint @ columns
        covariance = covariance - columns.T @ information @ columns
    return Track(
        postures.mean(axis=0),
        covariance + np.cov(postures.T, ddof=0).reshape(covariance.shape),
        np.median(past.particles.phases[path]),
        np.median(past.particles.rates(model.clock)[path]),
        float(len(np.unique(path))),
        past.lost,
    )


def _adjoint_step(model, past, update, later):
    """Adjoint and information of the states at the frame before."""
    if past.initial:
        return None
    width = model.mean.shape[1]
    if later is None:
        later = np.zeros((_N_PATHS, 2 * width)), np.zeros((2 * width, 2 * width))
    adjoint, information = later
    if update is not None:
        rows, rest = update.obs_rows, np.eye(2 * width)
        rest[:, :width] -= update.gain_rows.T @ rows
        adjoint, information = adjoint @ rest, rest.T @ information @ rest
        adjoint[:, :width] -= update.whitened @ rows
        information[:width, :width] += rows.T @ rows
    transition = np.kron(model.process.transition(past.dt), np.eye(width))
    return adjoint @ transition, transition.T @ information @ transition
