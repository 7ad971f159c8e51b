"""The way back through a take that is over: paths of particles, and what is known along them."""

from typing import NamedTuple

import numpy as np

from .kalman import correct
from .learnt import at_phases
from .particles import systematic
from .running import Estimate, Running

__all__ = ["smooth"]

# Phase paths that are drawn, each with deviations of its own.
_PATHS = 20
# Frames of the clock by which a path may miss where a particle would have gone.
_LOOSE = 0.5


class _Past(NamedTuple):
    """A frame as the filter left it; what it saw, and whether it knew what was before."""

    dt: float
    phases: np.ndarray
    logs: np.ndarray
    log_weights: np.ndarray
    anew: np.ndarray
    begins: bool
    values: np.ndarray
    lost: bool


class _Passed(NamedTuple):
    """What a backwards pass needs of a frame of the filter along known phases."""

    expected: np.ndarray
    means: np.ndarray
    covariance: np.ndarray
    matrix: np.ndarray
    innovations: np.ndarray
    correction: object


def smooth(learnt, seed, values, times, matrix):
    """Estimates of all frames of a take, each from what was seen before and after.

    The phases are drawn by backward simulation from the particles of the filter; along each path
    the deviations are those of the smoother of Bryson and Frazier, which inverts nothing but the
    spread of what is seen. The paths are equally probable.

    Parameters
    ----------
    learnt : Learnt
    seed : int
    values : ndarray, shape (n_frames, n_observed)
    times : ndarray, shape (n_frames,)
    matrix : ndarray, shape (n_observed, n_features)

    Returns
    -------
    list of Estimate
        One a frame.
    """
    running, pasts = Running(learnt, seed), []
    for now, time in zip(values, times, strict=True):
        dt = 0.0 if running.time is None else time - running.time
        lost = running.step(now, time, matrix).lost
        p, seen = running.particles, np.where(running.taken, now, np.nan)
        past = dt, p.phases, p.logs, p.log_weights, running.anew, running.begins, seen, lost
        pasts.append(_Past(*past))
    chosen = _draw_back(learnt, pasts, running.rng)
    return _estimates(learnt, pasts, chosen, matrix)


def _draw_back(learnt, pasts, rng):
    """Indices of the particles that paths go through: (n_frames, n_paths)."""
    last = pasts[-1]
    chosen = [systematic(np.exp(last.log_weights), rng.random(), _PATHS)]
    for before, after in zip(pasts[-2::-1], pasts[:0:-1], strict=True):
        log_odds = np.tile(before.log_weights, (_PATHS, 1))
        if not after.begins:
            log_odds += _log_transition(learnt, before, after, chosen[-1])
        odds = np.exp(log_odds - log_odds.max(axis=1, keepdims=True))
        edges = np.cumsum(odds, axis=1)
        drawn = (edges < rng.random((_PATHS, 1)) * edges[:, -1:]).sum(axis=1)
        chosen.append(drawn)
    return np.array(chosen[::-1])


def _log_transition(learnt, before, after, chosen):
    """How probable it is, but for a factor, that particles before went on to those chosen after."""
    pace, clock, dt = learnt.pace, learnt.clock, after.dt
    phases, logs = after.phases[chosen, np.newaxis], after.logs[chosen, np.newaxis]
    gone = before.phases + np.exp((before.logs + logs) / 2) * dt * clock.speed
    odds = -0.5 * np.square((phases - np.minimum(gone, clock.last)) / _LOOSE)
    expected, pushed = pace.expect(before.logs, dt)
    if pushed > 0:
        odds -= 0.5 * np.square((logs - expected) / pushed)
    # What began anew had been over.
    over = np.where(before.phases >= clock.last, 0.0, -np.inf)
    return np.where(after.anew[chosen, np.newaxis], over, odds)


def _estimates(learnt, pasts, chosen, matrix):
    """The mixture over the paths, at every frame."""
    passed = _along(learnt, pasts, chosen, matrix)
    states = _back(learnt, pasts, passed)
    out = []
    for past, some, frame, (means, covariance) in zip(pasts, chosen, passed, states, strict=True):
        width = frame.expected.shape[1]
        postures = frame.expected + means[:, :width]
        phases = past.phases[some]
        rates = np.where(phases < learnt.clock.last, np.exp(past.logs[some]), 0.0)
        spread = covariance[:width, :width] + np.cov(postures.T, ddof=0).reshape(width, width)
        whole = postures.mean(axis=0), spread, np.median(phases), np.median(rates)
        out.append(Estimate(*whole, float(len(np.unique(some))), past.lost))
    return out


def _along(learnt, pasts, chosen, matrix):
    """The Kalman filter along all paths, which one gain serves."""
    width, passed = learnt.mean.shape[1], []
    for past, some in zip(pasts, chosen, strict=True):
        if past.begins:
            means = np.zeros((len(some), 2 * width))
            covariance = learnt.process.stationary
        else:
            means, covariance = learnt.process.predict(means, covariance, past.dt)
            means[past.anew[some], :width] += learnt.mean[-1] - learnt.mean[0]
        expected = at_phases(learnt.mean, past.phases[some])
        seen = ~np.isnan(past.values)
        rows = matrix[seen]
        innovations, correction = None, None
        if seen.any():
            innovations = past.values[seen] - (expected + means[:, :width]) @ rows.T
            covariance, correction = correct(covariance, rows, innovations, learnt.noise)
            means = means + innovations @ correction.gain.T
        passed.append(_Passed(expected, means, covariance, rows, innovations, correction))
    return passed


def _back(learnt, pasts, passed):
    """Means and covariance of the states at every frame, by what was seen later, too."""
    shape = passed[-1].means.shape
    adjoint, information = np.zeros(shape), np.zeros((shape[1], shape[1]))
    states = []
    for past, frame in zip(pasts[::-1], passed[::-1], strict=True):
        spread = frame.covariance
        means = frame.means - adjoint @ spread
        states.append((means, spread - spread @ information @ spread))
        if frame.correction is not None:
            gain, weigh, n_features = *frame.correction[:2], len(frame.correction.weigh)
            rest = np.eye(shape[1])
            rest[:, :n_features] -= gain @ frame.matrix
            adjoint = adjoint @ rest
            adjoint[:, :n_features] -= frame.innovations @ weigh.T
            information = rest.T @ information @ rest
            information[:n_features, :n_features] += weigh @ frame.matrix
        if past.begins:
            adjoint, information = np.zeros_like(adjoint), np.zeros_like(information)
        else:
            whole = np.kron(learnt.process.transition(past.dt), np.eye(shape[1] // 2))
            adjoint, information = adjoint @ whole, whole.T @ information @ whole
    return states[::-1]
