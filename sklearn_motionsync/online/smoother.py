"""The smoother of a tracker: backward simulation of phases, and deviations along them."""

from copy import copy
from typing import NamedTuple

import numpy as np

from .kalman import DeviationFilter
from .particle_filter import Particles, systematic_resampling

__all__ = ["HistoryFrame", "PathFrame", "simulate_backwards", "smooth_deviations"]

# Phase paths that are drawn.
_N_PATHS = 20
# Standard deviation of the phases of a path about those of the particles, in frames of the clock.
_PHASE_SPREAD = 0.5
# Frames whose filtered states are in memory at once.
_BLOCK = 100


class HistoryFrame(NamedTuple):
    """A frame of the particle filter."""

    dt: float
    particles: Particles
    initial: bool
    lost: bool


class PathFrame(NamedTuple):
    """A frame of several hypotheses that share their observations.

    Parameters
    ----------
    dt : float
        Time since the frame before.
    initial : bool
        Whether nothing is known of what was before.
    expected : ndarray, shape (n_paths, n_features)
        What the deviations are from.
    jumps : ndarray, shape (n_paths, n_features), or None
        By which deviations change where what they are from changes.
    values : ndarray, shape (n_observed,)
        NaN where nothing was accepted.
    """

    dt: float
    initial: bool
    expected: np.ndarray
    jumps: np.ndarray | None
    values: np.ndarray


def simulate_backwards(model, history, rng):
    """Indices of the particles on each path: (n_frames, n_paths).

    Parameters
    ----------
    model : TrackerModel
    history : list of HistoryFrame
    rng : Generator
    """
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


def smooth_deviations(process, frames, observer):
    """Postures of several hypotheses given all observations, and their common covariance.

    That is the modified Bryson-Frazier smoother, which inverts the innovation covariance only. The
    Kalman filter runs twice, first for the states at the beginning of each block of frames.

    Parameters
    ----------
    process : MaternProcess
    frames : list of PathFrame
    observer : Observer

    Returns
    -------
    list of tuple
        Of each frame the postures (n_paths, n_features), and the covariance.
    """
    blocks = [slice(i, i + _BLOCK) for i in range(0, len(frames), _BLOCK)]
    states = [DeviationFilter(process, len(frames[0].expected))]
    for block in blocks[:-1]:
        states.append(_filter_block(frames[block], observer, states[-1])[1])
    out, later = [], None
    for block, state in zip(blocks[::-1], states[::-1], strict=True):
        filtered, _ = _filter_block(frames[block], observer, state)
        for frame, (postures, columns, update) in reversed(
            list(zip(frames[block], filtered, strict=True))
        ):
            covariance = columns[: columns.shape[1]]
            if later is not None:
                adjoint, information = later
                postures = postures - adjoint @ columns
                covariance = covariance - columns.T @ information @ columns
            out.append((postures, covariance))
            later = _adjoint_step(process, frame, update, later)
    return out[::-1]


def _filter_block(frames, observer, state):
    """The Kalman filter on from a state, a `DeviationFilter` that stays as it is.

    Returns a list of filtered frames, and the state after them. A filtered frame has the postures
    (n_paths, n_features), the columns of the state covariance that belong to the values,
    (2 n_features, n_features), and the `KalmanUpdate`, None without observations.
    """
    running, filtered = copy(state), []
    for frame in frames:
        if frame.initial:
            running.begin(len(frame.expected))
        else:
            running.predict(frame.dt)
        if frame.jumps is not None:
            running.means[0] += frame.jumps
        update, seen = None, ~np.isnan(frame.values)
        if seen.any():
            rows, noise = observer.of(seen)
            update = running.correct(frame.values[seen] - frame.expected @ rows.T, rows, noise)
        width = frame.expected.shape[1]
        columns = running.covariance[:, :width].copy()
        filtered.append((frame.expected + running.means[0], columns, update))
    return filtered, running


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
        rows, rest = update.obs_rows, np.eye(2 * width)
        rest[:, :width] -= update.gain_rows.T @ rows
        adjoint, information = adjoint @ rest, rest.T @ information @ rest
        adjoint[:, :width] -= update.whitened @ rows
        information[:width, :width] += rows.T @ rows
    transition = np.kron(process.transition(frame.dt), np.eye(width))
    return adjoint @ transition, transition.T @ information @ transition
