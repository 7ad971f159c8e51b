"""Sharpening: a last local match places the moments of voted warps where velocities agree.

Velocities are smoothed, and warps after the vote once more, so that matching goes the right way.
Both blur the moments themselves. Here every warp is matched once more, near where it is, between
frames and by velocities as sharp as their noise allows. What is compared are signed roots of
velocities: steep where a movement turns, and, under the elastic cost, independent of pace. Each
counts by how well trials agree in it. A warp follows the local match where the roots change
clearly, and stays as it was where they tell little.
"""

import functools
import math
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from .consensus import smooth_warps
from .factors import Bases
from .filters import LEAST_SIGMA, smooth
from .trellis import Trellis
from .warps import even_slices

__all__ = ["Sharpener", "choose_width"]

# Widths of the smoothing of velocities, as shares of the clip. The first is chosen whose share of
# noise in their energy is at most this, times the root of the number of features: noise averages
# out. Noise is what is left of differences of this order: docs/design.md.
_WIDTHS = (0.01, 0.014, 0.02, 0.028, 0.04)
_NOISE, _ORDER = 0.01, 6
# Speed, in units of the typical one, below which a root is linear.
_SLOW = 0.05
# The local trellis: its most frames, positions a frame, largest offset as a share of the clip,
# largest rate, and weight of changes of pace.
_FRAMES, _SUBFRAMES, _REACH, _MAX_RATE, _SMOOTHNESS = 201, 3, 0.06, 2, 0.05
# Smoothing of what sharpening changes, in units of that of the vote.
_FINER = 0.5
# Share of the mean energy of a component that is added to all before anything is divided.
_RIDGE = 0.03
# Weights of components are their evidence to this power: docs/design.md.
_POWER = 0.75
# How far warps may go is the mean agreement to this power. They go half of it where the precision
# of the local match, in one over squared per cent of the clip, is this: docs/design.md.
_TRUST, _HALF = 1.5, 0.02
# Decimals of a frame to which changes are rounded.
_DECIMALS = 7
# Numbers that are sampled at a time: bounds the memory.
_BATCH_SIZE = 1 << 22


def choose_width(positions):
    """The smoothing of velocities that suits their noise, as a share of the clip.

    Parameters
    ----------
    positions : ndarray, shape (n_sequences, P, n_features)

    Returns
    -------
    float
        The smallest width at which white noise has a small share in the energy of velocities, in
        the mean over features: at most 1 % of one feature, and 4 % of sixteen.
    """
    last = positions.shape[1] - 1
    differences = np.diff(positions, _ORDER, axis=1)
    noise = np.square(differences).mean(axis=(0, 1)) / math.comb(2 * _ORDER, _ORDER)
    for width in _WIDTHS:
        sigma = max(width * last, LEAST_SIGMA)
        energy = np.square(smooth(positions, sigma, order=1)).mean(axis=(0, 1))
        moves = energy > 0
        # The variance of the derivative of white noise under a Gaussian.
        share = noise[moves] / (4 * math.sqrt(math.pi) * sigma**3 * energy[moves])
        if len(share) and share.mean() <= _NOISE * math.sqrt(len(share)):
            break
    return width


class Sharpener(NamedTuple):
    """Sharpens warps to a pattern.

    Attributes
    ----------
    features : ndarray of int, shape (n_used,)
        Features that are compared.
    width : float
        Smoothing of velocities, as a share of the clip.
    maps : ndarray, shape (n_used, n_components)
        From velocities to components in units of their typical speed: every feature, and the axes
        of the metric.
    weights : ndarray, shape (n_components,)
    bases : Bases
        Weighted signed roots of the pattern.
    agreement : ndarray, shape (n_used,)
        How well trials agree with the pattern in every feature, at matched moments: a correlation.
    precision : ndarray, shape (P,)
        Of the local match, frame by frame: squared slopes of the roots over the disagreement.
    gain : ndarray, shape (P,)
        Factor of the smoothed product of precision and change.
    smoothing : float
        That of the vote, as a share of the clip.
    """

    features: np.ndarray
    width: float
    maps: np.ndarray
    weights: np.ndarray
    bases: Bases
    agreement: np.ndarray
    precision: np.ndarray
    gain: np.ndarray
    smoothing: float

    @classmethod
    def learn(cls, metric, pattern, positions, times, smoothing, width=None):
        """The sharpener of some performances, given their warps; None if it has no evidence.

        Parameters
        ----------
        metric : Metric
        pattern : ndarray, shape (P, n_features)
            In the unit.
        positions : ndarray, shape (n_sequences, P, n_features)
            At least one other performance, in the unit.
        times : ndarray, shape (n_sequences, P)
            Their warps.
        smoothing : float
            That of the vote, as a share of the clip.
        width : float, default=None
            Smoothing of velocities; by default as their noise asks for.
        """
        n_frames = len(pattern)
        count = min(n_frames, _FRAMES)
        if math.floor(_REACH * count) < 1:
            return None
        used = metric.features
        if width is None:
            width = choose_width(positions[:, :, used])
        curves = np.concatenate([pattern[np.newaxis], positions])[:, :, used]
        velocity = smooth(curves, width * (n_frames - 1), order=1)
        speed = np.sqrt(np.square(velocity).mean(axis=(0, 1)))
        axes = metric.velocity.astype(np.float64)
        typical = np.sqrt(np.square(velocity @ axes).mean())
        parts = np.diag(1 / np.where(speed > 0, speed, np.inf)), axes / (typical or np.inf)
        maps = np.concatenate(parts, axis=1)
        roots = _roots(velocity @ maps)
        base, moving = roots[0], _at_pace(roots[1:], times, np.arange(n_frames))
        disagreement = np.square(moving - base).mean(axis=(0, 1))
        energy = np.square(roots).mean(axis=(0, 1))
        ridge = _RIDGE * energy.mean()
        agreement = 1 - disagreement / np.where(energy > 0, 2 * energy, 1)
        if not ridge > 0 or not agreement.mean() > 0:
            return None
        # The rule of the metric, one component at a time.
        evidence = 1 / (disagreement + ridge) - 1 / (2 * energy + ridge)
        weights = np.maximum(evidence, 0) ** _POWER
        if not weights.any():
            return None
        slopes = np.gradient(np.concatenate([base[np.newaxis], moving]) * weights, axis=1)
        # Squared slopes without noise: those of the mean, less the share that differences explain.
        clear = np.square(slopes.mean(axis=0)) - slopes.var(axis=0, ddof=1) / len(slopes)
        noise = (np.square(weights) * disagreement).sum() or ridge
        precision = np.maximum(clear.sum(axis=1), 0) / noise * (n_frames / 100) ** 2
        trust = float(agreement.mean()) ** _TRUST
        gain = trust / (_smooth_along(precision, smoothing) + _HALF)
        own_pace = np.arange(n_frames, dtype=np.float64)[np.newaxis]
        base = _at_pace(base[np.newaxis], own_pace, _grid(n_frames, 1))
        base *= weights
        mu = _SMOOTHNESS * float(np.square(base).sum(axis=2).mean())
        local = {"max_offset": _REACH, "max_rate": _MAX_RATE, "subframes": _SUBFRAMES}
        bases = Bases(Trellis.on_clock("elastic", count, mu, **local), base)
        own = agreement[: len(used)]
        return cls(used, width, maps, weights, bases, own, precision, gain, smoothing)

    @property
    def trust(self):
        """How far warps go to where the local match places them, frame by frame: (P,)."""
        return self.gain * _smooth_along(self.precision, self.smoothing)

    def found(self, n_features):
        """What `DenseSynchronizer` tells of it, given the number of all features."""
        agreement = np.full(n_features, np.nan)
        agreement[self.features] = self.agreement
        return {"agreement": agreement, "width": self.width, "trust": self.trust}

    def __call__(self, positions, times, reach):
        """Sharpened warps (n_sequences, P).

        Parameters
        ----------
        positions : ndarray, shape (n_sequences, P, n_features)
            Performances in the unit.
        times : ndarray, shape (n_sequences, P)
            Their warps after the vote.
        reach : int
            Largest offset, in frames.
        """
        n_frames = times.shape[1]
        frames, at = np.arange(n_frames), _grid(n_frames, _SUBFRAMES)
        voted, times = times, smooth_warps(times, reach, self.smoothing)
        out = np.empty_like(times)
        for rows in even_slices(len(times), max(1, _BATCH_SIZE // (len(at) * len(self.weights)))):
            curves = positions[rows][:, :, self.features]
            velocity = smooth(curves, self.width * (n_frames - 1), order=1)
            moving = _at_pace(_roots(velocity @ self.maps) * self.weights, times[rows], at)
            disparities = self.bases.trellis.paths(self.bases, moving)[0]
            local = disparities + _SUBFRAMES * np.arange(disparities.shape[1])
            for row, tau, steps in zip(out[rows], times[rows], at[local], strict=True):
                row[:] = np.interp(frames, at[::_SUBFRAMES], np.interp(steps, frames, tau))
        changes = self.gain * _smooth_along(self.precision * (out - voted), self.smoothing)
        # The last bits of a metric depend on the unit of the data; warps must not.
        changes = np.round(changes, _DECIMALS)
        changes[:, [0, -1]] = 0
        return smooth_warps(voted + changes, reach, 0)


@functools.lru_cache(maxsize=8)
def _grid(n_frames, subframes):
    """Times of the local clock, in frames, with so many positions a frame of it."""
    grid = np.linspace(0, n_frames - 1, (min(n_frames, _FRAMES) - 1) * subframes + 1)
    grid.flags.writeable = False
    return grid


def _roots(velocity):
    """Signed roots of velocities in units of their typical speed; linear about 0."""
    return velocity / (np.square(velocity) + _SLOW**2) ** 0.25


def _at_pace(roots, times, at):
    """Roots (n_sequences, P, n_components) along warps, at some times, times the root of the rate.

    So warped, the roots are those of the warped velocities.
    """
    n_frames = roots.shape[1]
    frames, step = np.arange(n_frames), at[-1] / (len(at) - 1)
    out = np.empty((len(roots), len(at), roots.shape[2]))
    for one, warp, warped in zip(roots, times, out, strict=True):
        tau = np.interp(at, frames, warp)
        # Central differences, one-sided at the ends.
        edges = np.concatenate([tau[:1], tau, tau[-1:]])
        rates = (edges[2:] - edges[:-2]) / (2 * step)
        rates[[0, -1]] *= 2
        left = np.minimum(tau.astype(np.intp), n_frames - 2)
        scale = np.sqrt(np.maximum(rates, 0))
        following = (tau - left) * scale
        np.multiply(one.take(left, axis=0), (scale - following)[:, np.newaxis], out=warped)
        left += 1
        warped += one.take(left, axis=0) * following[:, np.newaxis]
    return out


def _smooth_along(values, smoothing):
    """Values (..., P) under a Gaussian, half as wide as that of the vote; 0 beyond the ends."""
    sigma = _FINER * smoothing * (values.shape[-1] - 1)
    return gaussian_filter1d(values, sigma, axis=-1, mode="constant") if sigma > 0.1 else values
