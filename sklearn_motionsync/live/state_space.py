"""The state-space model of a tracker: the mean, deviations from it, the rate, and limits."""

from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dtrtri

from ..utils.groups import mean_of_others

# Window of causal velocities, as a share of the mean duration: that of the synchronizers' filter.
_WINDOW = 0.03
# Time constant of the averages of the NIS, in windows.
_MEMORY = 3.0
# The limits of the NIS of velocities and poses are so many times farther from 1 than the largest
# of the training set.
_EXCESS = 4.0, 2.0
# And that of velocities at least so many standard deviations of the average of a NIS.
_CHANCE = 8.0
# The limit of the NIS of poses is at least three standard deviations squared.
_MIN_POSE_LIMIT = 9.0
# The gate of single observations: a NIS, or so many times the largest of the training set.
_MIN_GATE, _GATE_FACTOR = 100.0, 10.0


class TrackerModel(NamedTuple):
    """What a `MotionTracker` has learnt, and its settings.

    Parameters
    ----------
    mean : ndarray, shape (P, n_features)
    process : MaternProcess
        Of deviations from the mean.
    pooled_mean : ndarray, shape (n_features,)
        Of all phases.
    pooled : MaternProcess
        Of deviations from that, whatever the phase.
    rates : RateProcess
    clock : Clock
    velocities : ndarray, shape (n_features, n_features)
        Covariance of the differences of causal velocities from those of the mean.
    nis_limits : ndarray, shape (2,)
        Averages of the normalised innovation squared (NIS) of velocities, and of poses, beyond
        which the phase is lost; 1 is expected.
    gate : float
        The NIS of a single frame beyond which it is ignored.
    noise : ndarray, shape (n_features, n_features)
        Covariance of the noise of a whole observed pose.
    n_particles : int
    """

    mean: np.ndarray
    process: "MaternProcess"
    pooled_mean: np.ndarray
    pooled: "MaternProcess"
    rates: "RateProcess"
    clock: "Clock"
    velocities: np.ndarray
    nis_limits: np.ndarray
    gate: float
    noise: np.ndarray
    n_particles: int

    @classmethod
    def learn(cls, warped, rates, groups, clock, noise, n_particles):
        """Learn from at least two synchronised trials (n, P, n_features), of at least two groups.

        ``rates`` (n, P) are those along the clock, and groups are counted from 0. The other
        arguments are kept in the model as they are.
        """
        deviations, step = warped - mean_of_others(warped, groups), 1 / clock.speed
        process = MaternProcess.learn(deviations, _SHRINKAGE, step)
        pooled_mean = warped.mean(axis=(0, 1))
        pooled = MaternProcess.learn(warped - pooled_mean, _POOLED_SHRINKAGE, step)
        rates = RateProcess.learn(rates, step)
        n, n_frames, width = deviations.shape
        # Causal velocities (n, P - 1, n_features), and their variances by unit noise (P - 1,); and
        # the largest NIS of a frame, of a Kalman filter of each take at its own phase.
        causal, fits, seen = CausalSlopes(n, width, clock.window), [], np.ones(width, dtype=bool)
        running, largest = DeviationFilter(process, n), 0.0
        for p in range(n_frames):
            causal.advance(step)
            causal.add(deviations[:, p], seen)
            if p:
                fits.append(causal.fit(seen))
                running.predict(step)
            update = running.correct(deviations[:, p], seen, noise)
            largest = max(largest, float(update.nis.max()))
        slopes = np.stack([values for values, _ in fits], axis=1)
        unit_noise = np.array([variances[0] for _, variances in fits])
        velocities = _shrunk_covariance(slopes, _SHRINKAGE)
        by_velocity = _largest_nis(slopes, unit_noise, noise, velocities, step, clock.memory)
        once = np.ones(n_frames)
        by_pose = _largest_nis(deviations, once, noise, process.covariance, step, clock.memory)
        # Velocities of different windows are independent.
        chance = _CHANCE * np.sqrt(2 / (width * _MEMORY))
        excess = (
            max(_EXCESS[0] * (by_velocity - 1), chance),
            max(_EXCESS[1] * (by_pose - 1), _MIN_POSE_LIMIT - 1),
        )
        gate = max(_MIN_GATE, _GATE_FACTOR * largest)
        return cls(
            warped.mean(axis=0),
            process,
            pooled_mean,
            pooled,
            rates,
            clock,
            velocities,
            1 + np.array(excess),
            gate,
            noise,
            n_particles,
        )


class Clock(NamedTuple):
    """The clock of the pattern, and times in frames of the training trials.

    ``last`` is the last frame of the clock, ``duration`` the mean time from the first frame of a
    trial to its last.
    """

    last: float
    duration: float

    @property
    def speed(self):
        """Frames of the clock that a trial of mean duration passes a unit of time."""
        return self.last / self.duration

    @property
    def window(self):
        """Of causal velocities: at least a frame."""
        return max(_WINDOW * self.duration, 1.0)

    @property
    def memory(self):
        """Time constant of the averages of the NIS."""
        return _MEMORY * self.window


# -- processes: deviations from the mean, and rates --------------------------------------

# Weights of the diagonal in the covariance of deviations from the mean, and from that of all
# phases, of which more frames differ.
_SHRINKAGE, _POOLED_SHRINKAGE = 0.5, 0.15
# The longest length scale, as a share of the mean duration.
_LONGEST = 0.4
# Smallest variance of a feature, as a share of the largest: that of constant features.
_MIN_VARIANCE = 1e-9
# Where the Matern-3/2 correlation (1 + x) exp(-x) is a half.
_HALF = 1.6783469900166605
# Rates beyond these, in either direction, are pauses or errors of a warp.
_MAX_RATE = 4.0


class MaternProcess(NamedTuple):
    """A Matern-3/2 process of several features as a state-space model.

    ``k(s) = (1 + l s) exp(-l s) C`` for elapsed time ``s``. The states are values and derivatives;
    the derivative has the covariance ``l^2 C`` and is independent of the value at the same time.

    Parameters
    ----------
    covariance : ndarray, shape (n_features, n_features)
        ``C``, of the values.
    decay : float
        ``l = sqrt(3) / length scale``, per frame.
    """

    covariance: np.ndarray
    decay: float

    @classmethod
    def learn(cls, deviations, shrinkage, step):
        """Learn from deviations (n, P, n_features), whose frames are a step apart.

        The shrinkage is the weight of the diagonal of the covariance.
        """
        covariance = _shrunk_covariance(deviations, shrinkage)
        # Each feature is scaled by its standard deviation, so that units do not matter.
        lag = _correlation_lag(deviations / np.sqrt(np.diag(covariance)), 0.5)
        longest = _LONGEST * _HALF / np.sqrt(3) * deviations.shape[1]
        return cls(covariance, _HALF / (min(lag, longest) * step))

    @property
    def stationary(self):
        """The prior covariance of the states, (2 n_features, 2 n_features)."""
        return np.kron(np.diag([1.0, self.decay**2]), self.covariance)

    def transition(self, dt):
        """The transition matrix (2, 2) of (value, derivative), the same for all features."""
        decay = self.decay
        rows = [[1 + decay * dt, dt], [-(decay**2) * dt, 1 - decay * dt]]
        return np.exp(-decay * dt) * np.array(rows)

    def predict(self, means, covariance, dt):
        """The Kalman prediction of means (2, n, n_features) and their common covariance."""
        transition = self.transition(dt)
        means = (transition @ means.reshape(2, -1)).reshape(means.shape)
        for _ in range(2):
            covariance = (transition @ covariance.reshape(2, -1)).reshape(covariance.shape).T
        # Q = S - A S A', so that the stationary covariance stays.
        powers = np.diag([1.0, self.decay**2])
        process_noise = (powers - transition @ powers @ transition.T)[:, np.newaxis, :, np.newaxis]
        blocks = process_noise * self.covariance[:, np.newaxis]
        return means, covariance + blocks.reshape(covariance.shape)


class RateProcess(NamedTuple):
    """The log rate: an Ornstein-Uhlenbeck process about 0, the mean pace.

    ``spread`` is its standard deviation, ``memory`` the time after which its correlation is 1/e.
    """

    spread: float
    memory: float

    @classmethod
    def learn(cls, rates, step):
        """Learn from rates (n, P) along the clock, whose frames are a step apart."""
        logs = np.log(np.clip(rates, 1 / _MAX_RATE, _MAX_RATE))
        spread = float(np.sqrt(np.square(logs).mean()))
        return cls(spread, _correlation_lag(logs[:, :, np.newaxis], np.exp(-1)) * step)

    def draw(self, rng, n):
        """Draw n log rates from the stationary distribution."""
        return self.spread * rng.standard_normal(n)

    def predict(self, log_rates, dt):
        """Means of log rates after a time, and their standard deviation."""
        left = np.exp(-dt / self.memory)
        return left * log_rates, self.spread * np.sqrt(1 - left**2)


def _shrunk_covariance(deviations, shrinkage):
    """Second moments of deviations (..., n_features) about 0, shrunk towards their diagonal.

    No variance is 0.
    """
    flat = deviations.reshape(-1, deviations.shape[-1])
    moments = flat.T @ flat / len(flat)
    variances = np.diag(moments)
    largest = variances.max() if variances.max() > 0 else 1.0
    shrunk = (1 - shrinkage) * moments
    np.fill_diagonal(shrunk, np.maximum(variances, _MIN_VARIANCE * largest))
    return shrunk


def _correlation_lag(series, level):
    """Frames after which the autocorrelation about 0 of (n, P, n_features) falls to a level.

    P where it never does, or all is 0.
    """
    n_frames, power, before = series.shape[1], float(np.square(series).mean()), 1.0
    for lag in range(1, n_frames if power > 0 else 1):
        now = float((series[:, lag:] * series[:, :-lag]).mean()) / power
        if now <= level:
            return lag - 1 + (before - level) / (before - now)
        before = now
    return float(n_frames)


# -- limits of the normalised innovation squared, from the training trials ---------


def _largest_nis(departures, shares, noise, covariance, step, memory):
    """The largest average NIS of takes (n, n_frames, n_features) at their own phase, at least 1.

    ``shares`` (n_frames,) of the covariance of the noise are theirs at each frame.
    """
    nis, largest, width = 1.0, 1.0, departures.shape[-1]
    for p, share in enumerate(shares):
        whiten = whitening(covariance + share * noise)
        # The expected effect of the noise: a fit draws no samples.
        now = squared_norms(departures[:, p] @ whiten.T)
        now += share * np.einsum("ij,jk,ik->", whiten, noise, whiten, optimize=True)
        nis = exponential_average(nis, now / width, step, memory)
        largest = np.maximum(largest, nis)
    return float(np.max(largest))


def exponential_average(before, now, dt, memory):
    """An exponential moving average after a time, by the one before and a new value."""
    left = np.exp(-dt / memory)
    return left * before + (1 - left) * now


# -- causal velocities: slopes of weighted regression lines ------------------------------

# A feature has a slope if its earlier values weigh at least this, beside 1 of the value now.
_MIN_WEIGHT = 1e-3


class CausalSlopes:
    """Slopes of regression lines through past values with weights ``exp(-age / window)``.

    All n sequences of ``width`` features share the weights. So the slope of a difference is the
    difference of the slopes, whose delays cancel.
    """

    def __init__(self, n, width, window):
        self.width, self.window = width, window
        # Sums of weights, and of their squares, times the age to the power 0, 1, 2.
        self.ages, self.squares = np.zeros((3, width)), np.zeros((3, width))
        # Sums of weighted values times the age to the power 0, 1.
        self.values = np.zeros((2, n, width))

    def advance(self, dt):
        """Let a time pass."""
        left = np.exp(-dt / self.window)
        for (zero, one, two), share in ((self.ages, left), (self.squares, left**2)):
            two += 2 * dt * one + dt**2 * zero
            one += dt * zero
            for moment in (zero, one, two):
                moment *= share
        transition = left * np.array([[1.0, 0.0], [dt, 1.0]])
        self.values = (transition @ self.values.reshape(2, -1)).reshape(self.values.shape)

    def add(self, values, seen):
        """Add values (n, n_seen) of the features with the mask ``seen`` (width,)."""
        self.ages[0, seen] += 1
        self.squares[0, seen] += 1
        self.values[0][:, _as_slice(seen)] += values

    def resample(self, indices):
        """Replace the sequences by those of these indices."""
        self.values = self.values[:, indices]

    def shift(self, chosen, offset):
        """Add a constant (width,) to all past values of some sequences."""
        self.values[:, chosen] += (self.ages[:2] * offset)[:, np.newaxis]

    def have_slopes(self, seen):
        """Which of the features that are seen now were seen lately, too: bool (width,)."""
        return seen & (self.ages[0] - 1 > _MIN_WEIGHT)

    def fit(self, chosen):
        """Slopes (n, n_chosen) of some features, and their variances by unit noise (n_chosen,)."""
        chosen = _as_slice(chosen)
        zero, one, two = self.ages[:, chosen]
        zeros, ones, twos = self.squares[:, chosen]
        determinant = zero * two - one**2
        values, aged = self.values[:, :, chosen]
        slopes = (one / determinant) * values
        slopes -= (zero / determinant) * aged
        noise = (zero**2 * twos - 2 * zero * one * ones + one**2 * zeros) / determinant**2
        return slopes, noise


def _as_slice(mask):
    """The mask, or, to save a copy, a slice where it is all True."""
    return slice(None) if mask.all() else mask


# -- Kalman filters of deviations: many hypotheses share one covariance, and so one gain -------

# The innovation covariance is larger by this share, so that rounding leaves the updated covariance
# positive, however small the noise.
_MARGIN = 1e-13


class KalmanUpdate(NamedTuple):
    """The update of states by an observation; ``W' W = S^-1`` for the innovation covariance S.

    Parameters
    ----------
    seen : ndarray of bool, shape (n_features,)
    whiten : ndarray, shape (n_seen, n_seen)
        ``W``.
    whitened : ndarray, shape (n, n_seen)
        Whitened innovations ``W v`` of each hypothesis.
    gain_rows : ndarray, shape (n_seen, 2 n_features)
        ``gain_rows' W v = K v``, with the Kalman gain ``K``.
    """

    seen: np.ndarray
    whiten: np.ndarray
    whitened: np.ndarray
    gain_rows: np.ndarray

    @property
    def nis(self):
        """Normalised innovation squared per observed number: (n,)."""
        return squared_norms(self.whitened) / self.whitened.shape[1]


def whitening(covariance):
    """The inverse of the Cholesky factor of a covariance."""
    return dtrtri(np.linalg.cholesky(covariance), lower=1)[0]


def squared_norms(vectors):
    """Of vectors (n, n_dims): (n,)."""
    return np.einsum("ij,ij->i", vectors, vectors)


class DeviationFilter:
    """A Kalman filter of the deviations of n hypotheses, from what each expects.

    ``means`` (2, n, n_features) are of values and derivatives. The ``covariance`` (2 n_features, 2
    n_features) depends on what is observed and not on the hypothesis.
    """

    def __init__(self, process, n):
        self.process = process
        self.begin(n)

    def begin(self, n):
        """Forget what was observed."""
        self.means = np.zeros((2, n, len(self.process.covariance)))
        self.covariance = self.process.stationary

    @property
    def pose_covariance(self):
        """Of the values: (n_features, n_features)."""
        width = self.means.shape[2]
        return self.covariance[:width, :width]

    def predict(self, dt):
        """Let a time pass."""
        self.means, self.covariance = self.process.predict(self.means, self.covariance, dt)

    def correct(self, residuals, seen, noise, gate=np.inf):
        """Take an observation, unless its NIS is beyond the gate of every hypothesis.

        ``residuals`` (n, n_seen) of the features with the mask ``seen`` are from what each
        hypothesis expects without a deviation; ``noise`` is the covariance of that of all features.
        Returns the `KalmanUpdate`, or None if the observation is ignored.
        """
        width, innovations = len(seen), residuals - self.means[0][:, seen]
        # What overflows is outside the gate.
        with np.errstate(over="ignore", invalid="ignore"):
            cross_covariance = self.covariance[:, :width][:, seen]
            innovation_covariance = cross_covariance[:width][seen] + noise[np.ix_(seen, seen)]
            innovation_covariance[np.diag_indices(len(innovation_covariance))] *= 1 + _MARGIN
            whiten = whitening(innovation_covariance)
            gain_rows = whiten @ cross_covariance.T
            update = KalmanUpdate(seen, whiten, innovations @ whiten.T, gain_rows)
            covariance = self.covariance - gain_rows.T @ gain_rows
            if not (update.nis <= gate).any():
                return None
        # The Kalman gain times the innovations.
        gains = gain_rows.reshape(len(gain_rows), 2, width).swapaxes(0, 1)
        self.means = self.means + update.whitened @ gains
        self.covariance = covariance
        return update
