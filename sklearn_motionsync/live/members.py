"""The members of a tracker, with and without a phase, their pool, and its smoother."""

from typing import NamedTuple

import numpy as np

from ..inputs.wording import counted
from ..matching.counting import ROUNDING
from ..matching.warps import at_times
from .state_space import (
    CausalSlopes,
    DeviationFilter,
    exponential_average,
    squared_norms,
    whitening,
)

# Weights before anything is observed: of the member that knows phases, and of the other one.
_PRIOR = np.array([0.75, 0.25])
# Covariances are larger by this share of the pooled variances, so that they can be inverted.
_MARGIN = 1e-9


class Track(NamedTuple):
    """The body at every frame of a take; of a single frame, without the axis of frames.

    Parameters
    ----------
    poses : ndarray, shape (n_frames, n_features)
        Expected poses, given the observations.
    covariances : ndarray, shape (n_frames, n_features, n_features)
        Of the poses, over all possible phases, and larger where what is seen is improbable;
        without the noise of observations.
    phases : ndarray, shape (n_frames,)
        Weighted medians of the particles, in frames of the clock, 0 to P - 1.
    rates : ndarray, shape (n_frames,)
        Weighted medians of the pace: 1 is the mean of the training trials, 2 twice as fast,
        0 at the end of the movement.
    lost : ndarray of bool, shape (n_frames,)
        Whether velocities or poses are improbable at all phases.

    See Also
    --------
    MotionTracker : Estimates it.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import LinearSynchronizer
    >>> from sklearn_motionsync.live import MotionTracker
    >>> X = [size * np.sin(np.linspace(0, 3, 40))[:, np.newaxis] for size in (0.9, 1.0, 1.1)]
    >>> track = MotionTracker(LinearSynchronizer()).fit(X).track(X[0])
    >>> track
    Track(40 frames of 1 feature, 0 of them lost)
    >>> track.covariances.shape
    (40, 1, 1)
    """

    poses: np.ndarray
    covariances: np.ndarray
    phases: np.ndarray
    rates: np.ndarray
    lost: np.ndarray

    def __repr__(self):
        n_frames, n_features = np.size(self.lost), self.poses.shape[-1]
        n_lost = np.count_nonzero(self.lost)
        return (
            f"Track({n_frames} frames of {counted(n_features, 'feature')}, {n_lost} of them lost)"
        )


class PooledFilter:
    """A Kalman filter of deviations from the mean of all phases: it knows no phase.

    ``accepted`` (n_features,) are the observations of the last frame that were used, and
    ``innovation`` is their NIS, None without any.
    """

    def __init__(self, model):
        self.model, self.deviations = model, DeviationFilter(model.pooled, 1)

    @property
    def estimate(self):
        """The expected pose, and its covariance."""
        mean = self.model.pooled_mean + self.deviations.means[0, 0]
        return mean, self.deviations.pose_covariance

    def update(self, values, dt):
        """Take an observation, a time after the one before."""
        if dt > 0:
            self.deviations.predict(dt)
        seen = ~np.isnan(values)
        self.accepted, self.innovation = np.zeros_like(seen), None
        if not seen.any():
            return
        model, residuals = self.model, (values - self.model.pooled_mean)[np.newaxis, seen]
        update = self.deviations.correct(residuals, seen, model.noise, model.gate)
        if update is not None:
            self.accepted, self.innovation = seen, float(update.nis[0])


class RunningTake:
    """A take that is tracked frame by frame, by both members, ``phases`` and ``pooled``.

    Its parameters are those of `ParticleFilter`. ``evidence`` (2,) has the averages of the NIS of
    innovations of both, of which 1 is expected.
    """

    def __init__(self, model, seed, time):
        self.model = model
        self.phases = ParticleFilter(model, seed, time)
        self.pooled = PooledFilter(model)
        self.evidence = np.ones(2)

    @property
    def time(self):
        """Of the last frame."""
        return self.phases.time

    def update(self, values, time):
        """Take an observation; parameters as of `ParticleFilter.update`."""
        dt = time - self.time
        self.phases.update(values, time)
        self.pooled.update(values, dt)
        for k, member in enumerate((self.phases, self.pooled)):
            if member.innovation is not None:
                memory = self.model.clock.memory
                now = exponential_average(self.evidence[k], member.innovation, dt, memory)
                self.evidence[k] = now

    def step(self, values, time):
        """Take an observation; the `Track` of its frame."""
        self.update(values, time)
        particles = self.phases.particles
        return Track(
            *pool((self.phases.estimate, self.pooled.estimate), self.evidence, self.model),
            weighted_median(particles.phases, particles.weights),
            weighted_median(particles.rates(self.model.clock), particles.weights),
            self.phases.lost,
        )


def pool(estimates, evidence, model):
    """The logarithmic opinion pool of Gaussian estimates: ``C^-1 = sum_m w_m C_m^-1``, sum of w 1.

    ``estimates`` has the mean (n_features,) and the covariance of each member, and so has the
    result. Covariances are larger by the evidence: by the average NIS where that is above 1. The
    weights are those before, divided by the mean variance in units of the pooled variances.
    """
    scale = np.diag(model.pooled.covariance)
    excess = np.maximum(evidence, 1.0)
    sizes = [np.mean(np.diag(C) / scale) * e for (_, C), e in zip(estimates, excess, strict=True)]
    weights = _PRIOR / np.maximum(sizes, _MARGIN)
    weights /= weights.sum()
    total, moment = 0.0, 0.0
    for (mean, covariance), share, e in zip(estimates, weights, excess, strict=True):
        precision = (share / e) * np.linalg.inv(covariance + _MARGIN * np.diag(scale))
        total, moment = total + precision, moment + precision @ mean
    covariance = np.linalg.inv(total)
    return covariance @ moment, covariance


def stack_frames(frames, dtype):
    """The `Track` of each frame as one, poses in this precision."""
    poses, covariances, *numbers = map(np.array, zip(*frames, strict=True))
    return Track(*(x.astype(dtype, copy=False) for x in (poses, covariances)), *numbers)


def filter_take(model, seed, values, times):
    """The filtered frames of a take, each given the observations up to it.

    It is called, and returns, as `smooth_take` does.
    """
    running = RunningTake(model, seed, times[0])
    return [running.step(now, time) for now, time in zip(values, times, strict=True)]


def smooth_take(model, seed, values, times):
    """The smoothed frames of a take, each a `Track` given all observations.

    ``values`` (n_frames, n_features) were seen at ``times`` (n_frames,). Paths of phases are drawn
    by backward simulation from the particles of the filter. Along each path the deviations are
    smoothed; the paths have equal weights. So are those of the member that knows no phase.
    """
    running = RunningTake(model, seed, times[0])
    history, accepted, evidence = [], [], []
    for now, time in zip(values, times, strict=True):
        dt = time - running.time
        running.update(now, time)
        phases = running.phases
        history.append(HistoryFrame(dt, phases.particles, phases.initial, phases.lost))
        accepted.append([np.where(m.accepted, now, np.nan) for m in (phases, running.pooled)])
        evidence.append(running.evidence.copy())
    paths = simulate_backwards(model, history, running.phases.rng)
    jump = model.mean[-1] - model.mean[0]
    on_paths, without = [], []
    for past, path, (by_phase, by_pool) in zip(history, paths, accepted, strict=True):
        expected = at_times(model.mean, past.particles.phases[path])
        restarted = past.particles.restarted[path]
        jumps = np.outer(restarted, jump) if restarted.any() else None
        on_paths.append(PathFrame(past.dt, past.initial, expected, jumps, by_phase))
        first = not without
        without.append(PathFrame(past.dt, first, model.pooled_mean[np.newaxis], None, by_pool))
    smoothed = zip(
        history,
        paths,
        evidence,
        smooth_deviations(model.process, on_paths, model.noise),
        smooth_deviations(model.pooled, without, model.noise),
        strict=True,
    )
    return [_smooth_frame(model, *frame) for frame in smoothed]


def _smooth_frame(model, past, path, evidence, on_paths, without):
    """The `Track` of a frame from the poses and covariances of both members."""
    poses, covariance = on_paths
    off = poses - poses.mean(axis=0)
    estimates = (
        (poses.mean(axis=0), covariance + off.T @ off / len(off)),
        (without[0][0], without[1]),
    )
    return Track(
        *pool(estimates, evidence, model),
        np.median(past.particles.phases[path]),
        np.median(past.particles.rates(model.clock)[path]),
        past.lost,
    )


# -- all frames of a recording at once -------------------------------------------------------------

# Phase paths that are drawn.
_N_PATHS = 20
# Standard deviation of the phases of a path about those of the particles, in frames of the clock.
_PHASE_SPREAD = 0.5


class HistoryFrame(NamedTuple):
    """A frame of the particle filter."""

    dt: float
    particles: "Particles"
    initial: bool
    lost: bool


class PathFrame(NamedTuple):
    """A frame of several hypotheses that share their observations.

    ``dt`` is the time since the frame before, of which nothing is known if it is ``initial``.
    Deviations are from ``expected`` (n_paths, n_features), and change by ``jumps`` of that shape
    where it changes. ``values`` (n_features,) are NaN where nothing was accepted.
    """

    dt: float
    initial: bool
    expected: np.ndarray
    jumps: np.ndarray | None
    values: np.ndarray


def simulate_backwards(model, history, rng):
    """Indices of the particles on each path, given each `HistoryFrame`: (n_frames, n_paths)."""
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


def smooth_deviations(process, frames, noise):
    """Poses of several hypotheses given all observations, and their common covariance.

    Of each `PathFrame` there are the poses (n_paths, n_features), and the covariance. That is the
    modified Bryson-Frazier smoother, which inverts the innovation covariance only.
    """
    # Of each frame the poses, the columns of the state covariance that belong to the values,
    # (2 n_features, n_features), and the `KalmanUpdate`, None without observations.
    running, filtered = DeviationFilter(process, len(frames[0].expected)), []
    for frame in frames:
        if frame.initial:
            running.begin(len(frame.expected))
        else:
            running.predict(frame.dt)
        if frame.jumps is not None:
            running.means[0] += frame.jumps
        update, seen = None, ~np.isnan(frame.values)
        if seen.any():
            update = running.correct((frame.values - frame.expected)[:, seen], seen, noise)
        columns = running.covariance[:, : len(seen)].copy()
        filtered.append((frame.expected + running.means[0], columns, update))
    out, later = [], None
    for frame, (poses, columns, update) in zip(frames[::-1], filtered[::-1], strict=True):
        covariance = columns[: columns.shape[1]]
        if later is not None:
            adjoint, information = later
            poses = poses - adjoint @ columns
            covariance = covariance - columns.T @ information @ columns
        out.append((poses, covariance))
        later = _adjoint_step(process, frame, update, later)
    return out[::-1]


def _adjoint_step(process, frame, update, later):
    """Adjoint (n_paths, 2 n_features) and information of the states at the frame before.

    ``later`` are those of the states at the frame, by later observations; None without any.
    """
    if frame.initial:
        return None
    n_paths, width = frame.expected.shape
    if later is None:
        later = np.zeros((n_paths, 2 * width)), np.zeros((2 * width, 2 * width))
    adjoint, information = later
    if update is not None:
        rest, rows = np.eye(2 * width), np.zeros((len(update.gain_rows), width))
        rows[:, update.seen] = update.whiten
        rest[:, :width] -= update.gain_rows.T @ rows
        adjoint, information = adjoint @ rest, rest.T @ information @ rest
        adjoint[:, :width] -= update.whitened @ rows
        information[:width, :width] += rows.T @ rows
    transition = np.kron(process.transition(frame.dt), np.eye(width))
    return adjoint @ transition, transition.T @ information @ transition


# -- the Rao-Blackwellised particle filter: particles of phase and rate --------------------------

# Particles are resampled when their effective size is below this share of them.
_MIN_EFFECTIVE = 0.5
# One particle of so many begins elsewhere on the clock, for a take that begins in mid-movement.
_ELSEWHERE = 10
# Probability of a restart at the end of the movement in a hundredth of the mean duration.
_RESTART = 0.01
# Divides the log-likelihood of the velocities of every hundredth of the mean duration.
_TEMPERING = 10.0
# While the phase is lost, particles are reinitialised after so many memories of the NIS.
_RETRY = 3.0


class ParticleFilter:
    """Particles of phase and rate, with a Kalman filter of the deviations of each.

    All particles share one covariance of their deviations, which depends on what is observed and
    not on the phase; so one Kalman gain serves them all. ``time`` is that of the first frame, which
    ``update`` still has to take, and then of the last one.

    ``particles`` are weighted by the last frame, and ``initial`` tells whether they know nothing of
    what was before it. ``expected`` (n_particles, n_features) is the mean trial at their phases.
    ``accepted`` (n_features,) are the observations of the last frame that were used, and
    ``innovation`` is their NIS, the mean over the particles before they were weighted; None without
    any.
    """

    def __init__(self, model, seed, time):
        self.model, self.rng = model, np.random.default_rng(seed)
        self.deviations = DeviationFilter(model.process, model.n_particles)
        self.time, self.lost = time, False
        n = model.n_particles
        elsewhere = np.arange(n) % _ELSEWHERE == _ELSEWHERE - 1
        self._initialise(np.where(elsewhere, np.linspace(0, model.clock.last, n), 0.0))

    @property
    def estimate(self):
        """The expected pose, and its covariance over all phases."""
        weights = self.particles.weights
        poses = self.expected + self.deviations.means[0]
        pose = weights @ poses
        off = poses - pose
        off *= np.sqrt(weights)[:, np.newaxis]
        return pose, self.deviations.pose_covariance + off.T @ off

    def update(self, values, time):
        """Take an observation (n_features,), NaN where nothing is seen.

        Its time, in frames of the training trials, is later than that of the frame before.
        """
        dt, self.time = time - self.time, time
        self.since_search += dt
        if self.lost and self.since_search > _RETRY * self.model.clock.memory:
            # Over the whole clock.
            n = self.model.n_particles
            phases = (self.rng.random() + np.arange(n)) / n * self.model.clock.last
            self._initialise(phases)
            # The phase stays lost until later observations agree with it.
            self.nis = self.model.nis_limits
        elif dt > 0:
            self._predict(dt)
        self.expected = at_times(self.model.mean, self.particles.phases)
        seen = ~np.isnan(values)
        self.accepted, self.innovation = np.zeros_like(seen), None
        if seen.any():
            self._observe(values, seen, dt)

    def _initialise(self, phases):
        """Begin at these phases, without knowledge of the deviations."""
        model, n = self.model, len(phases)
        self.particles = Particles.uniform(phases, model.rates.draw(self.rng, n))
        self.deviations.begin(n)
        self.slopes = CausalSlopes(n, model.mean.shape[1], model.clock.window)
        self.nis, self.since_search, self.initial = np.ones(2), 0.0, True

    def _predict(self, dt):
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
        self.slopes.shift(self.particles.restarted, jump)

    def _observe(self, values, seen, dt):
        """Correct the deviations and the weights, unless the observation is outside the gate."""
        model, residuals = self.model, (values - self.expected)[:, seen]
        update = self.deviations.correct(residuals, seen, model.noise, model.gate)
        if update is None:
            self._update_nis(2 * model.nis_limits, dt)
            return
        self.accepted = seen
        self.innovation = float(self.particles.weights @ update.nis)
        self.slopes.add(residuals, seen)
        # Of the pose, from the mean.
        spread = (model.process.covariance + model.noise)[np.ix_(seen, seen)]
        whitened = whitening(spread) @ (self.particles.weights @ residuals)
        pose_nis = self._shrink_nis(whitened @ whitened / len(whitened), len(whitened))
        known = self.slopes.have_slopes(seen)
        velocity_nis = self._reweight(known, dt) if known.any() else self.nis[0]
        self._update_nis(np.array([velocity_nis, pose_nis]), dt)

    def _reweight(self, known, dt):
        """Weigh the particles by the velocities with this mask (n_features,); their NIS."""
        model, clock, block = self.model, self.model.clock, np.ix_(known, known)
        slopes, shares = self.slopes.fit(known)
        deviations = np.sqrt(shares)
        noise = model.noise[block] * np.outer(deviations, deviations)
        covariance = model.velocities[block] + noise
        distances = squared_norms(slopes @ whitening(covariance).T)
        # Evidence is weighted by its duration, so that the frame rate does not matter.
        share = 100 * min(dt, clock.window) / clock.duration
        # Bayes' rule; the weights sum to 1.
        log_weights = self.particles.log_weights - 0.5 * share / _TEMPERING * distances
        top = log_weights.max()
        log_weights -= top + np.log(np.exp(log_weights - top).sum())
        self.particles = self.particles._replace(log_weights=log_weights)
        n_known = len(shares)
        return self._shrink_nis(self.particles.weights @ distances / n_known, n_known)

    def _shrink_nis(self, nis, n):
        """A mean of n squares, drawn towards 1 to vary as that of all features."""
        return 1 + (nis - 1) * min(np.sqrt(n / self.model.mean.shape[1]), 1.0)

    def _update_nis(self, nis, dt):
        """Average the NIS (2,) of velocities and poses, and compare them with their limits."""
        limits = self.model.nis_limits
        self.nis = exponential_average(self.nis, nis, dt, self.model.clock.memory)
        if self.lost:
            # The limit of poses stays: a person's style persists.
            self.lost = bool((self.nis > [(1 + limits[0]) / 2, limits[1]]).any())
        elif (self.nis > limits).any():
            self.lost, self.since_search = True, np.inf


class Particles(NamedTuple):
    """Weighted particles of phase, in frames of the clock, and log rate: (n,) each.

    The phase goes on by the rate, and the log rate is an Ornstein-Uhlenbeck process. At the last
    frame the phase stays, until the movement restarts, as ``restarted`` says of the last move;
    restart times are exponential.
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
        # Restart times are exponential.
        restarts = rng.random(n) < 1 - (1 - _RESTART) ** (100 * dt / clock.duration)
        restarted = (self.phases >= clock.last) & restarts
        fresh = rate_process.draw(rng, n)
        # The rate in between is that of the mean log rate.
        moved = self.phases + np.exp((before + log_rates) / 2) * dt * clock.speed
        return Particles(
            np.where(restarted, 0.0, np.minimum(moved, clock.last)),
            np.where(restarted, fresh, log_rates),
            self.log_weights,
            restarted,
        )


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
