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
from .counting import ROUNDING
from .filters import noise_width, smooth
from .metric import RETAINED, RIDGE
from .sizes import BATCH_NUMBERS, FRAMES
from .tile import Bases
from .trellis import Trellis

# Narrowest smoothing of velocities, and that of what sharpening changes, as shares of the clip.
_FINEST = 0.01
# Speed, in units of the typical one, below which a root is linear: docs/design.md.
_SLOW = 0.05
# The local trellis: positions a frame, largest offset as a share of the clip, largest rate, and
# weight of changes of pace. Of a long clip it has every frame of which half would tell as much.
_SUBFRAMES, _REACH, _MAX_RATE, _SMOOTHNESS = 3, 0.06, 2, 0.05
# How far warps may go is the mean agreement to this power. They go half of it where the precision
# of the local match, in one over squared per cent of the clip, is this: docs/design.md.
_TRUST, _HALF = 1.5, 0.02


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
    axes : ndarray, shape (n_components, n_compared)
        From signed roots of components to what is compared: weighted, along principal axes.
    bases : Bases
        That of the pattern.
    agreement : ndarray, shape (n_used,)
        How well trials agree with the pattern in every feature, at matched moments: a correlation.
    precision : ndarray, shape (P,)
        Of the local match, frame by frame: squared slopes of the roots over the disagreement.
    gain : ndarray, shape (P,)
        Factor of the smoothed product of precision and change.
    """

    features: np.ndarray
    width: float
    maps: np.ndarray
    axes: np.ndarray
    bases: Bases
    agreement: np.ndarray
    precision: np.ndarray
    gain: np.ndarray

    @classmethod
    def learn(cls, metric, pattern, positions, times):
        """The sharpener of some trials, given their warps; None if it has no evidence.

        Parameters
        ----------
        metric : Metric
        pattern : ndarray, shape (P, n_features)
            In the unit.
        positions : ndarray, shape (n_sequences, P, n_features)
            At least one other trial, in the unit.
        times : ndarray, shape (n_sequences, P)
            Their warps.
        """
        n_frames = len(pattern)
        count = min(n_frames, 2 * FRAMES + 1)
        if math.floor(_REACH * count) < 1:
            return None
        used = metric.features
        width = max(noise_width(positions[:, :, used]) / (n_frames - 1), _FINEST)
        curves = np.concatenate([pattern[np.newaxis], positions])[:, :, used]
        velocity = smooth(curves, width * (n_frames - 1), order=1)
        speed = np.sqrt(np.square(velocity).mean(axis=(0, 1)))
        axes = metric.velocity.astype(np.float64)
        typical = np.sqrt(np.square(velocity @ axes).mean())
        by_feature = np.diag(1 / np.where(speed > 0, speed, np.inf))
        maps = np.concatenate([by_feature, axes / (typical or np.inf)], axis=1)
        roots = _roots(velocity @ maps)
        base, moving = roots[0], _at_pace(roots[1:], times, np.arange(n_frames))
        disagreement = np.square(moving - base).mean(axis=(0, 1))
        energy = np.square(roots).mean(axis=(0, 1))
        ridge = RIDGE * energy.mean()
        agreement = 1 - disagreement / np.where(energy > 0, 2 * energy, 1)
        if not ridge > 0 or not agreement.mean() > 0:
            return None
        # The rule of the metric, one component at a time.
        evidence = 1 / (disagreement + ridge) - 1 / (2 * energy + ridge)
        weights = np.maximum(evidence, 0)
        if not weights.any():
            return None
        compared = np.concatenate([base[np.newaxis], moving]) * weights
        slopes = np.gradient(compared, axis=1)
        # Squared slopes without noise: those of the mean, less the share that differences explain.
        clear = np.square(slopes.mean(axis=0)) - slopes.var(axis=0, ddof=1) / len(slopes)
        noise = (np.square(weights) * disagreement).sum() or ridge
        precision = np.maximum(clear.sum(axis=1), 0) / noise * (n_frames / 100) ** 2
        trust = float(agreement.mean()) ** _TRUST
        gain = trust / (_smooth_along(precision) + _HALF)
        axes = weights[:, np.newaxis] * _principal_axes(compared)
        pace = np.arange(n_frames, dtype=np.float64)[np.newaxis]
        base = _at_pace((base @ axes)[np.newaxis], pace, _grid(n_frames, 1))
        mu = _SMOOTHNESS * float(np.square(base).sum(axis=2).mean())
        trellis = Trellis.on_clock(
            "elastic", count, mu, max_offset=_REACH, max_rate=_MAX_RATE, subframes=_SUBFRAMES
        )
        of_features = agreement[: len(used)]
        return cls(used, width, maps, axes, Bases(trellis, base), of_features, precision, gain)

    @property
    def trust(self):
        """How far warps go to where the local match places them, frame by frame: (P,)."""
        return self.gain * _smooth_along(self.precision)

    def __call__(self, positions, times, reach):
        """Sharpened warps (n_sequences, P).

        Parameters
        ----------
        positions : ndarray, shape (n_sequences, P, n_features)
            Trials in the unit.
        times : ndarray, shape (n_sequences, P)
            Their warps after the vote.
        reach : int
            Largest offset, in frames.
        """
        n_frames = times.shape[1]
        frames, at = np.arange(n_frames), _grid(n_frames, _SUBFRAMES)
        out = np.empty_like(times)
        size = max(1, BATCH_NUMBERS // (len(at) * len(self.axes)))
        for rows in (slice(start, start + size) for start in range(0, len(times), size)):
            curves = positions[rows][:, :, self.features]
            velocity = smooth(curves, self.width * (n_frames - 1), order=1)
            moving = _at_pace(_roots(velocity @ self.maps) @ self.axes, times[rows], at)
            disparities = self.bases.trellis.paths(self.bases, moving)[0]
            local = disparities + _SUBFRAMES * np.arange(disparities.shape[1])
            for row, tau, steps in zip(out[rows], times[rows], at[local], strict=True):
                row[:] = np.interp(frames, at[::_SUBFRAMES], np.interp(steps, frames, tau))
        changes = self.gain * _smooth_along(self.precision * (out - times))
        # The last bits of a metric depend on the unit of the data; warps must not.
        changes = np.round(changes, 7)
        changes[:, [0, -1]] = 0
        return smooth_warps(times + changes, reach, 0)


@functools.lru_cache(maxsize=8)
def _grid(n_frames, subframes):
    """Times of the local clock, in frames, with so many positions a frame of it."""
    grid = np.linspace(0, n_frames - 1, (min(n_frames, 2 * FRAMES + 1) - 1) * subframes + 1)
    grid.flags.writeable = False
    return grid


def _principal_axes(compared):
    """Principal axes of (n_trials, P, n_components), as columns, that retain nearly all variance.

    Every fourth frame tells them.
    """
    rows = compared[:, ::4].reshape(-1, compared.shape[2])
    _, size, axes = np.linalg.svd(rows, full_matrices=False)
    energy = np.cumsum(np.square(size))
    return axes[: 1 + int(np.searchsorted(energy, RETAINED * (1 - ROUNDING) * energy[-1]))].T


def _roots(velocity):
    """Signed roots of velocities in units of their typical speed; linear about 0."""
    speed = np.square(velocity)
    speed += _SLOW**2
    np.sqrt(speed, out=speed)
    return velocity / np.sqrt(speed, out=speed)


def _at_pace(roots, times, at):
    """Roots (n_sequences, P, n_components) along warps, at some times, times the root of the rate.

    So warped, the roots are those of the warped velocities.
    """
    n_frames = roots.shape[1]
    frames, step = np.arange(n_frames), at[-1] / (len(at) - 1)
    out = np.empty((len(roots), len(at), roots.shape[2]))
    for curve, warp, warped in zip(roots, times, out, strict=True):
        tau = np.interp(at, frames, warp)
        # Central differences, one-sided at the ends.
        edges = np.concatenate([tau[:1], tau, tau[-1:]])
        rates = (edges[2:] - edges[:-2]) / (2 * step)
        rates[[0, -1]] *= 2
        before = np.minimum(tau.astype(np.intp), n_frames - 2)
        scale = np.sqrt(np.maximum(rates, 0))
        following = (tau - before) * scale
        np.multiply(curve.take(before, axis=0), (scale - following)[:, np.newaxis], out=warped)
        before += 1
        warped += curve.take(before, axis=0) * following[:, np.newaxis]
    return out


def _smooth_along(values):
    """Values (..., P) under a Gaussian; 0 beyond the ends."""
    sigma = _FINEST * (values.shape[-1] - 1)
    return gaussian_filter1d(values, sigma, axis=-1, mode="constant") if sigma > 0.1 else values
