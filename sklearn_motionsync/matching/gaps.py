"""Gaps: hidden features are filled by what is known, and weighed by how well that tells them.

A hidden feature is interpolated along time. It then follows the features that are seen: those show
what they did besides their own interpolation over the same gap, and a regression tells what the
hidden one did meanwhile. How much of its velocity remains unknown comes from the same regression.
It is a share of the frame, and its complement the weight of the frame in the trellis. So a short
gap counts nearly like none, and a frame of which nothing is known counts nothing.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from .filters import smooth
from .warps import normalise

__all__ = ["UNSEEN", "Filler", "add_weights"]

# Cost of a frame of which nothing was seen, in mean squared features: about that of two matched
# ones. Without it a path would stay where nothing was seen. docs/design.md.
UNSEEN = 0.3

# Frames of the clock on which covariances are learnt.
_FRAMES = 101
# Standard deviation of the Gaussian under the velocities whose covariances are learnt, as a share
# of the clip, and the share of their mean variance that is added before anything is inverted.
_SMOOTHING, _RIDGE = 0.02, 0.1
# Most directions of a covariance.
_DIRECTIONS = 64
# Frames at each side of a gap that its interpolation uses.
_BESIDE = 3


class Filler(NamedTuple):
    """Fills the gaps of performances.

    Attributes
    ----------
    mean : ndarray, shape (n_features,)
    energy : ndarray, shape (n_features,)
        Mean squared velocities, by the frame of the clock.
    factors : dict of int to ndarray (n_features, n_directions)
        ``W`` of the covariance ``W W'`` of velocities less their mean over as many frames of the
        clock at both sides; 0: of velocities.
    ridge : dict of int to float
        Added to the variances of these.
    """

    mean: np.ndarray
    energy: np.ndarray
    factors: dict
    ridge: dict

    @classmethod
    def learn(cls, arrays):
        """The filler of a training set (n_frames_i, n_features), which may have gaps.

        Every feature is seen somewhere.
        """
        mean = _mean(arrays)
        on_clock = normalise([_without_gaps(x, mean) for x in arrays], _FRAMES)
        velocity = smooth(on_clock, _SMOOTHING * (_FRAMES - 1), order=1)
        factors, ridge, reach = {}, {}, 0
        while 2 * reach < _FRAMES - 1:
            part = velocity
            if reach:
                ahead, behind = on_clock[:, 2 * reach :], on_clock[:, : -2 * reach]
                part = velocity[:, reach:-reach] - (ahead - behind) / (2 * reach)
            factors[reach], ridge[reach] = _factor(part.reshape(-1, part.shape[2]))
            reach = 2 * reach or 1
        return cls(mean, np.square(velocity).mean(axis=(0, 1)), factors, ridge)

    def __call__(self, array, confidence=1.0):
        """A performance without gaps, and the weight of each of its frames.

        Parameters
        ----------
        array : ndarray, shape (n_frames, n_features)
            NaN where a feature is hidden.
        confidence : ndarray, shape (n_frames, n_features), default=1.0
            Weights of what is seen.

        Returns
        -------
        filled : ndarray, shape (n_frames, n_features)
        weights : ndarray, shape (n_frames,)
            From 0 to 1.
        """
        seen = np.isfinite(array)
        before = _without_gaps(array.astype(np.float64), self.mean)
        filled, unknown = before.copy(), np.where(seen, 1 - confidence, 0) * self.energy
        for (first, last), hidden in _gaps_of(~seen).items():
            base, reach = self._base(before, first, last)
            rows, columns = slice(first, last + 1), np.array(hidden)
            others, kept = seen[rows], before[rows] - base
            for mask in np.unique(others, axis=0):
                own = (others == mask).all(axis=1)
                slopes, left = self.regression(reach, mask, columns)
                at = np.ix_(first + np.flatnonzero(own), columns)
                filled[at] = base[np.ix_(own, columns)] + kept[np.ix_(own, mask)] @ slopes
                unknown[at] = left
        weights = 1 - unknown.sum(axis=1) / (self.energy.sum() or 1)
        return filled.astype(array.dtype), np.clip(weights, 0, 1)

    def _base(self, curves, first, last):
        """All features from first to last by those beside, and the reach of their velocities."""
        n, length = len(curves), last - first + 1
        if length == n:
            return np.broadcast_to(self.mean, curves.shape), 0
        if first == 0 or last == n - 1:
            held = curves[last + 1] if first == 0 else curves[first - 1]
            return np.broadcast_to(held, (length, len(held))), 0
        beside = np.r_[max(0, first - _BESIDE) : first, last + 1 : min(n, last + 1 + _BESIDE)]
        rows = np.arange(first, last + 1)
        reach = (length + 1) / 2 * (_FRAMES - 1) / (n - 1)
        nearest = 2 ** int(np.clip(np.round(np.log2(reach)), 0, np.log2(max(self.factors))))
        return _along(beside, curves[beside], rows), nearest

    def regression(self, reach, seen, hidden):
        """Slopes (n_seen, n_hidden) of hidden on seen features, and the variances that remain."""
        factor, ridge = self.factors[reach], self.ridge[reach]
        known, wanted = factor[seen], factor[hidden]
        inner = known.T @ known
        inner.flat[:: len(inner) + 1] += ridge
        solved = np.linalg.solve(inner, wanted.T)
        return known @ solved, ridge * np.einsum("hq,qh->h", wanted, solved)


def _interpolated(array):
    """A performance whose hidden features are interpolated, and held beyond what is seen.

    A feature that is never seen stays NaN.
    """
    out, frames = array.astype(np.float64), np.arange(len(array))
    for column in out.T:
        seen = np.flatnonzero(np.isfinite(column))
        if 0 < len(seen) < len(column):
            hidden = np.isnan(column)
            inside = np.clip(frames[hidden], seen[0], seen[-1])
            column[hidden] = _along(seen, column[seen], inside)
    return out


def _runs(mask):
    """First and last index of every run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    return edges[::2], edges[1::2] - 1


def add_weights(arrays, weights):
    """Performances with a column of weights behind their features.

    Parameters
    ----------
    arrays : sequence of ndarray (n_frames_i, n_features)
    weights : sequence of ndarray (n_frames_i,), or None
        None: all have the weight 1.

    Returns
    -------
    list of ndarray (n_frames_i, n_features + 1)
    """
    if weights is None:
        weights = [np.ones(len(x)) for x in arrays]
    columns = (w[:, np.newaxis].astype(x.dtype) for x, w in zip(arrays, weights, strict=True))
    return [np.concatenate([x, w], axis=1) for x, w in zip(arrays, columns, strict=True)]


def _along(frames, values, at):
    """Values (n_frames, ...) of some frames at times between them, by Akima's polynomials."""
    if len(frames) < 3:
        return np.apply_along_axis(lambda y: np.interp(at, frames, y), 0, values)
    return Akima1DInterpolator(frames, values)(at)


def _without_gaps(array, mean):
    """The same as `_interpolated`, and the mean where a feature is never seen."""
    if np.isfinite(array).all():
        return array
    out = _interpolated(array)
    return np.where(np.isnan(out), mean, out)


def _mean(arrays):
    """Mean of every feature over all frames that show it."""
    count = sum(np.isfinite(x).sum(axis=0) for x in arrays)
    return sum(np.nansum(x, axis=0, dtype=np.float64) for x in arrays) / np.maximum(count, 1)


def _gaps_of(hidden):
    """The features of every gap, by its first and last frame."""
    gaps = {}
    for column in np.flatnonzero(hidden.any(axis=0)).tolist():
        for gap in zip(*(x.tolist() for x in _runs(hidden[:, column])), strict=True):
            gaps.setdefault(gap, []).append(column)
    return gaps


def _factor(frames):
    """``W`` of the covariance ``W W'`` of centred frames, in few directions, and the ridge."""
    covariance = (frames.T @ frames).astype(np.float64) / len(frames)
    values, vectors = np.linalg.eigh(covariance)
    values, vectors = values[::-1][:_DIRECTIONS], vectors[:, ::-1][:, :_DIRECTIONS]
    ridge = _RIDGE * np.trace(covariance) / len(covariance)
    return vectors * np.sqrt(np.maximum(values, 0)), ridge or 1.0
