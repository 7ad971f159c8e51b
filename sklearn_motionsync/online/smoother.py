"""The way back through a take that is over: paths of particles, and what is known along them."""

from typing import NamedTuple

import numpy as np

from ..matching.warps import at_times
from .kalman import Correction, correct
from .particle_filter import Estimate, ParticleFilter, systematic

__all__ = ["smooth"]

# Phase paths that are drawn, each with deviations of its own.
_PATHS = 20
# Frames of the clock by which a path may miss where a particle would have gone.
_LOOSE = 0.5
# Frames of which the way back keeps all states at once.
_PART = 100


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
    """What a backwards pass needs of a frame of the filter along known phases.

    Postures are (n_paths, n_features); the spread is what of the covariance of the states concerns
    the values, (2 n_features, n_features); a correction is None where nothing is seen.
    """

    postures: np.ndarray
    spread: np.ndarray
    correction: Correction | None


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
    running, pasts = ParticleFilter(learnt, seed), []
    for now, time in zip(values, times, strict=True):
        dt = 0.0 if running.time is None else time - running.time
        running.take(now, time, matrix)
        p, seen = running.particles, np.where(running.taken, now, np.nan)
        past = dt, p.phases, p.logs, p.log_weights, running.anew, running.begins, seen
        pasts.append(_Past(*past, running.lost))
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
    """The mixture over the paths, at every frame.

    The filter runs along the paths twice, first for its states at the beginning of each part.
    """
    parts, states = [slice(i, i + _PART) for i in range(0, len(pasts), _PART)], [None]
    for part in parts[:-1]:
        states.append(_along(learnt, pasts[part], chosen[part], matrix, states[-1])[1])
    out, later = [], None
    for part, state in zip(parts[::-1], states[::-1], strict=True):
        passed, _ = _along(learnt, pasts[part], chosen[part], matrix, state)
        frames = zip(pasts[part], chosen[part], passed, strict=True)
        for past, some, frame in reversed(list(frames)):
            out.append(_estimate(learnt, past, some, *_smoothed(frame, later)))
            later = _taken_back(learnt, past, frame, later)
    return out[::-1]


def _estimate(learnt, past, some, postures, covariance):
    """What paths with these postures (n_paths, n_features) say together."""
    phases = past.phases[some]
    rates = np.where(phases < learnt.clock.last, np.exp(past.logs[some]), 0.0)
    spread = covariance + np.cov(postures.T, ddof=0).reshape(covariance.shape)
    whole = postures.mean(axis=0), spread, np.median(phases), np.median(rates)
    return Estimate(*whole, float(len(np.unique(some))), past.lost)


def _along(learnt, pasts, chosen, matrix, state):
    """The Kalman filter along all paths, which one gain serves, on from a state.

    Returns the frames as a list of `_Passed`, and the state after them: means and covariance.
    """
    width, passed = learnt.mean.shape[1], []
    for past, some in zip(pasts, chosen, strict=True):
        if past.begins:
            means, covariance = np.zeros((2, len(some), width)), learnt.process.stationary
        else:
            means, covariance = learnt.process.predict(*state, past.dt)
            means[0, past.anew[some]] += learnt.mean[-1] - learnt.mean[0]
        expected, correction = at_times(learnt.mean, past.phases[some]), None
        seen = ~np.isnan(past.values)
        if seen.any():
            rows = matrix[seen]
            innovations = past.values[seen] - (expected + means[0]) @ rows.T
            covariance, correction = correct(covariance, rows, innovations, learnt.noise)
            means = means + correction.moves
        passed.append(_Passed(expected + means[0], covariance[:, :width].copy(), correction))
        state = means, covariance
    return passed, state


def _smoothed(frame, later):
    """Postures and their covariance at a frame, by what was seen later, too.

    ``later`` is an adjoint (n_paths, 2 n_features) and an information (2 n_features,) * 2 of the
    states at the frame; None if nothing later tells of them.
    """
    postures, spread = frame.postures, frame.spread
    covariance = spread[: spread.shape[1]]
    if later is None:
        return postures, covariance
    adjoint, information = later
    return postures - adjoint @ spread, covariance - spread.T @ information @ spread


def _taken_back(learnt, past, frame, later):
    """What a frame and those later tell of the states at the frame before."""
    if past.begins:
        return None
    (n, width), correction = frame.postures.shape, frame.correction
    if later is None:
        later = np.zeros((n, 2 * width)), np.zeros((2 * width, 2 * width))
    adjoint, information = later
    if correction is not None:
        looks, rest = correction.looks, np.eye(2 * width)
        rest[:, :width] -= correction.told.T @ looks
        adjoint, information = adjoint @ rest, rest.T @ information @ rest
        adjoint[:, :width] -= correction.white @ looks
        information[:width, :width] += looks.T @ looks
    whole = np.kron(learnt.process.transition(past.dt), np.eye(width))
    return adjoint @ whole, whole.T @ information @ whole
