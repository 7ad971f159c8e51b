"""What a tracker learns of performances: their mean, how people depart from it, and their pace."""

from typing import NamedTuple

import numpy as np

from ..utils.groups import mean_of_others
from .kalman import correct, squared_lengths, whitening
from .velocity import Slopes

__all__ = ["Clock", "Learnt", "learn", "smoothed"]

# -- how postures depart from the mean: a Gaussian process in time, and the pace of people

# How far a covariance is drawn to its diagonal.
_SHRINKAGE = 0.5
# Smallest variance of a feature, as a share of the largest: one in which nobody differed, too.
_FLOOR = 1e-9
# Where the Matern-3/2 correlation (1 + x) exp(-x) is a half.
_HALF = 1.6783469900166605
# Rates beyond these, in either direction, are pauses or misses of a warp, and tell nothing.
_FASTEST = 4.0


class Process(NamedTuple):
    """A Matern-3/2 process of several features, whose states are values and their derivatives.

    ``k(s) = (1 + l s) exp(-l s) C`` for elapsed time ``s``; so the derivative has the covariance
    ``l^2 C`` and is independent of the value at the same time.

    Attributes
    ----------
    covariance : ndarray, shape (n_features, n_features)
        ``C``, of the values.
    decay : float
        ``l = sqrt(3) / length scale``, per frame.
    """

    covariance: np.ndarray
    decay: float

    @classmethod
    def learn(cls, deviations, step):
        """The process behind what performances differ by from the mean of others.

        Parameters
        ----------
        deviations : ndarray, shape (n, P, n_features)
        step : float
            Time between two of their frames.
        """
        covariance = shrunk_covariance(deviations)
        # Each feature counts by its own spread, so that units do not matter.
        lag = _lag_of(deviations / np.sqrt(np.diag(covariance)), 0.5)
        return cls(covariance, _HALF / (lag * step))

    @property
    def length_scale(self):
        return float(np.sqrt(3) / self.decay)

    @property
    def stationary(self):
        """Covariance of the states (2 n_features, 2 n_features) when nothing has been seen."""
        return np.kron(np.diag([1.0, self.decay**2]), self.covariance)

    def transition(self, dt):
        """How states (value, derivative) go on over a time: (2, 2), the same for all features."""
        decay = self.decay
        rows = [[1 + decay * dt, dt], [-(decay**2) * dt, 1 - decay * dt]]
        return np.exp(-decay * dt) * np.array(rows)

    def predict(self, means, covariance, dt):
        """States after a time in which nothing is seen.

        Parameters
        ----------
        means : ndarray, shape (2, n, n_features)
            Of n hypotheses: their values, then derivatives.
        covariance : ndarray, shape (2 n_features, 2 n_features)
        dt : float

        Returns
        -------
        means, covariance
        """
        here = self.transition(dt)
        means = (here @ means.reshape(2, -1)).reshape(means.shape)
        for _ in range(2):
            covariance = (here @ covariance.reshape(2, -1)).reshape(covariance.shape).T
        # Q = S - A S A', so that what is stationary stays.
        powers = np.diag([1.0, self.decay**2])
        pushed = (powers - here @ powers @ here.T)[:, np.newaxis, :, np.newaxis]
        blocks = pushed * self.covariance[:, np.newaxis]
        return means, covariance + blocks.reshape(covariance.shape)


class Pace(NamedTuple):
    """How fast people go through an action: a log rate about 0 that forgets.

    Attributes
    ----------
    spread : float
        Standard deviation of the log rate.
    memory : float
        Time after which its correlation is 1/e.
    """

    spread: float
    memory: float

    def begin(self, rng, n):
        """Log rates of performances that nothing is known of: (n,)."""
        return self.spread * rng.standard_normal(n)

    def expect(self, logs, dt):
        """Log rates to be expected after a time, and the standard deviation about them."""
        kept = np.exp(-dt / self.memory)
        return kept * logs, self.spread * np.sqrt(1 - kept**2)

    @classmethod
    def learn(cls, rates, step):
        """From rates (n, P) of performances along the clock, whose frames are a step apart."""
        logs = np.log(np.clip(rates, 1 / _FASTEST, _FASTEST))
        spread = float(np.sqrt(np.square(logs).mean()))
        return cls(spread, _lag_of(logs[:, :, np.newaxis], np.exp(-1)) * step)


def shrunk_covariance(deviations):
    """Second moments of deviations from 0, half-way to their diagonal, which is nowhere 0."""
    flat = deviations.reshape(-1, deviations.shape[-1])
    moments = flat.T @ flat / len(flat)
    variances = np.diag(moments).copy()
    largest = variances.max() if variances.max() > 0 else 1.0
    moments *= 1 - _SHRINKAGE
    np.fill_diagonal(moments, np.maximum(variances, _FLOOR * largest))
    return moments


def _lag_of(series, level):
    """Frames after which the autocorrelation about 0 of (n, P, n_features) falls to a level.

    It is that of all frames where it never does, or there is nothing to correlate.
    """
    n_frames, power, before = series.shape[1], float(np.square(series).mean()), 1.0
    for lag in range(1, n_frames if power > 0 else 1):
        now = float((series[:, lag:] * series[:, :-lag]).mean()) / power
        if now <= level:
            return lag - 1 + (before - level) / (before - now)
        before = now
    return float(n_frames)


# Window of causal velocities, as a share of the mean duration: that of the synchronizers' filter.
_WINDOW = 0.03
# How long a surprise is remembered, in windows.
_WINDOWS = 3.0
# So many times what the most surprising take exceeds the expected surprise by is too much.
_EXCESS = 2.0
# And so many standard deviations of what is expected are by chance.
_CHANCE = 4.0
# Postures three standard deviations of people from the mean, for long, are of nobody.
_NOBODY = 9.0
# An observation so far from all that is expected, in variances a number, or so many times farther
# than any of the training takes, shows something else.
_POSSIBLE, _FARTHER = 100.0, 10.0
# Of particles at the end so many begin anew in a hundredth of the mean duration.
_ANEW = 0.01


class Clock(NamedTuple):
    """The clock of the pattern, and time that is told in frames of the training performances.

    Attributes
    ----------
    last : float
        The last frame of the clock.
    duration : float
        Mean time from the first frame of a performance to its last.
    """

    last: float
    duration: float

    @property
    def speed(self):
        """Frames of the clock that a performance of mean duration passes a unit of time."""
        return self.last / self.duration

    def anew(self, dt):
        """How probable it is that what is over has begun anew after a time."""
        return 1 - (1 - _ANEW) ** (100 * dt / self.duration)

    @property
    def window(self):
        """Of causal velocities: at least a frame."""
        return max(_WINDOW * self.duration, 1.0)

    @property
    def memory(self):
        """Of surprises."""
        return _WINDOWS * self.window


class Learnt(NamedTuple):
    """All that a tracker goes by.

    Attributes
    ----------
    mean : ndarray, shape (P, n_features)
    process : Process
        Of deviations from the mean.
    pace : Pace
    clock : Clock
    velocities : ndarray, shape (n_features, n_features)
        Covariance of what causal velocities of people differ by from that of the mean.
    limits : ndarray, shape (2,)
        Surprise by velocities, and by postures, that nobody reaches, where 1 is expected.
    possible : float
        The same of postures at a single frame, far beyond which none is believed.
    noise, tempering : float
    n_particles : int
    """

    mean: np.ndarray
    process: Process
    pace: Pace
    clock: Clock
    velocities: np.ndarray
    limits: np.ndarray
    possible: float
    noise: float
    tempering: float
    n_particles: int


def learn(warped, rates, groups, clock, noise, tempering, n_particles):
    """Learn from synchronised performances.

    Parameters
    ----------
    warped : ndarray, shape (n, P, n_features)
        At least two performances.
    rates : ndarray, shape (n, P)
        Frames of the clock that they pass while a performance of mean duration passes one.
    groups : ndarray of int, shape (n,)
        Whose they are, at least two.
    clock : Clock
    noise, tempering, n_particles :
        As of the tracker.
    """
    deviations, step = warped - mean_of_others(warped, groups), 1 / clock.speed
    process, pace = Process.learn(deviations, step), Pace.learn(rates, step)
    slopes, unit_noise = _slopes(deviations, step, clock.window)
    velocities = shrunk_covariance(slopes)
    fast = _largest(slopes, unit_noise * noise**2, velocities, step, clock.memory)
    noises = np.full(deviations.shape[1], noise**2)
    far = _largest(deviations, noises, process.covariance, step, clock.memory)
    # As often as a memory holds windows, velocities are independent of those before.
    chance = _CHANCE * np.sqrt(2 / (warped.shape[2] * _WINDOWS))
    excess = max(_EXCESS * (fast - 1), chance), max(_EXCESS * (far - 1), _NOBODY - 1)
    limits, possible = 1 + np.array(excess), _possible(deviations, process, step, noise)
    known = warped.mean(axis=0), process, pace, clock, velocities, limits, possible
    return Learnt(*known, noise, tempering, n_particles)


def _slopes(deviations, step, window):
    """Causal velocities (n, P - 1, n_features), and what noise adds to their variances (P - 1,)."""
    n, n_frames, width = deviations.shape
    slopes, seen, found = Slopes(n, width, window), np.ones(width, dtype=bool), []
    for p in range(n_frames):
        slopes.wait(step)
        slopes.add(deviations[:, p], seen)
        if p:
            found.append(slopes.of(seen))
    values, noise = zip(*found, strict=True)
    return np.stack(values, axis=1), np.array([a[0] for a in noise])


def _largest(departures, noise, covariance, step, memory):
    """The largest surprise of takes (n, n_frames, n_features) at their own phase, at least 1."""
    surprise, largest, width = 1.0, 1.0, departures.shape[-1]
    for p, variance in enumerate(noise):
        whiten = whitening(covariance + variance * np.eye(width))
        # Noise is expected, not drawn: a fit is not random.
        here = squared_lengths(departures[:, p] @ whiten.T) + variance * np.square(whiten).sum()
        surprise = smoothed(surprise, here / width, step, memory)
        largest = np.maximum(largest, surprise)
    return float(np.max(largest))


def _possible(deviations, process, step, noise):
    """What distance of an observation is possible: at their own phase all takes are much nearer."""
    n, n_frames, width = deviations.shape
    means, covariance, largest = np.zeros((2, n, width)), process.stationary, 0.0
    for p in range(n_frames):
        if p:
            means, covariance = process.predict(means, covariance, step)
        innovations = deviations[:, p] - means[0]
        covariance, correction = correct(covariance, np.eye(width), innovations, noise)
        means = means + correction.moves
        largest = max(largest, float(correction.surprise.max()))
    return max(_POSSIBLE, _FARTHER * largest)


def smoothed(before, now, dt, memory):
    """What is remembered of a quantity, that of long ago less and less."""
    left = np.exp(-dt / memory)
    return left * before + (1 - left) * now
