"""Anchors: known key-frames, as an additional cost of the one trellis.

A key-frame at the time ``k`` of a trial of duration ``T`` is a column beside its features:
the ramp ``(t - k) / T``. It is linear in time, so it is normalised and sampled as a feature is. It
is NaN if the key-frame is not known. The samples p of a base beside its key-frame, at a position q
of a moving sequence, cost what the ramp there says::

    sum_a  hat(ramp_n(p)) rho(ramp_m(q))

Each term is the product of a column of the left factor and one of the right factor, so the
recurrence stays as it is.
"""

import math
from typing import NamedTuple

import numpy as np

from .counting import ROUNDING

# Most that a key-frame costs, in energies of a whole clip: a label with an error, of which some are
# wrong, and one that is exact. docs/design.md.
_LABEL, _EXACT = 0.05, 2.0
# Reach of the last correction to an exact key-frame, as a share of the clip: docs/design.md.
_REACH = 0.1
# Steepest change of that correction, in frames a frame, before it reaches farther.
_STEEPEST = 0.5


class KeyframeColumns(NamedTuple):
    """The columns of key-frames behind those of features.

    Attributes
    ----------
    n_columns : int
    std : float
        Standard deviation of the key-frames as given, as a share of the clip; 0 for exact ones.
    """

    n_columns: int
    std: float

    def features(self, columns):
        """Columns (..., n_columns) without those of key-frames."""
        return columns[..., : -self.n_columns]

    def ramps(self, columns):
        """The columns of key-frames."""
        return columns[..., -self.n_columns :]

    def on_clock(self, n_frames, energy):
        """The `Anchors` of a clock, for features of this mean squared norm."""
        most = (_LABEL if self.std else _EXACT) * energy * n_frames
        return Anchors(self, n_frames, most)


class Anchors(NamedTuple):
    """The cost of missing key-frames.

    A miss ``r`` costs ``most * (1 - exp(-r^2 / (2 w^2)))``, as of labels with errors of which some
    are wrong.

    Attributes
    ----------
    columns : KeyframeColumns
    n_frames : int
        ``P``.
    most : float
    """

    columns: KeyframeColumns
    n_frames: int
    most: float

    def at(self, n_frames):
        """The same anchors on a clock of so many frames."""
        return Anchors(self.columns, n_frames, self.most / self.n_frames * n_frames)

    def left(self, sequences):
        """Shares of key-frames in the samples of bases: (n_bases, P, count)."""
        ramps = self.columns.ramps(sequences)
        # A sample that is at least one frame away has no share.
        ramps = np.where(np.isnan(ramps), 1, ramps)
        return np.maximum(1 - np.abs(ramps) * (self.n_frames - 1), 0)

    def right(self, sequences):
        """Costs of the positions of moving sequences: (n_moving, Q, count)."""
        ramps = self.columns.ramps(sequences)
        ramps = np.where(np.isnan(ramps), 0, ramps)
        # Both key-frames of a pair have errors; exact ones cost near their most half a frame away.
        width = max(math.sqrt(2) * self.columns.std, 0.5 / (self.n_frames - 1))
        return -self.most * np.expm1(-0.5 * np.square(ramps / width))


def add_ramps(arrays, keyframes):
    """Trials with a column for every key-frame.

    Parameters
    ----------
    arrays : sequence of ndarray (n_frames_i, n_features)
    keyframes : ndarray, shape (n_sequences, n_keyframes)
        As shares of the trials; NaN where one is not known.

    Returns
    -------
    list of ndarray (n_frames_i, n_features + n_keyframes)
    """
    out = []
    for x, shares in zip(arrays, keyframes, strict=True):
        ramps = np.linspace(0, 1, len(x))[:, np.newaxis] - shares
        out.append(np.concatenate([x, ramps.astype(x.dtype)], axis=1))
    return out


def first_meeting(times, keyframes):
    """Frames of the pattern (n_sequences, n_keyframes) that meet key-frames of trials.

    Parameters
    ----------
    times : ndarray, shape (n_sequences, P)
        Their warps.
    keyframes : ndarray, shape (n_sequences, n_keyframes)
        In frames of the clock; NaN where one is not known.
    """
    frames = np.arange(times.shape[1])
    # A tiny slope makes warps that stand still invertible.
    slope = 1e-9 * frames
    met = [np.interp(own, tau + slope, frames) for own, tau in zip(keyframes, times, strict=True)]
    return np.where(np.isnan(keyframes), np.nan, met)


def pin(times, keyframes, own):
    """Warps through exact key-frames: what they miss is taken off, less and less beside them.

    A correction fades by a Gaussian, and falls to 0 linearly at the key-frames beside and at both
    ends.

    Parameters
    ----------
    times : ndarray, shape (n_sequences, P)
    keyframes : ndarray, shape (n_keyframes,)
        Of the pattern, in frames, increasing.
    own : ndarray, shape (n_sequences, n_keyframes)
        Of each trial, in frames of the clock, increasing; NaN where one is not known.

    Returns
    -------
    ndarray, shape (n_sequences, P)
    """
    out, frames, last = times.copy(), np.arange(times.shape[1]), times.shape[1] - 1
    for tau, wanted in zip(out, own, strict=True):
        is_known = np.isfinite(wanted)
        if not is_known.any():
            continue
        at, wanted = keyframes[is_known], wanted[is_known]
        misses = wanted - np.interp(at, frames, tau)
        knots = np.concatenate([[0], at, [last]])
        for a, miss in enumerate(misses):
            hat = np.interp(frames, knots, np.arange(len(knots)) == a + 1)
            sigma = max(_REACH * last, abs(miss) / _STEEPEST)
            tau += miss * hat * np.exp(-0.5 * np.square((frames - at[a]) / sigma))
        # Between two key-frames a warp stays between their times.
        below = np.concatenate([[0], wanted])[np.searchsorted(at, frames, side="right")]
        above = np.concatenate([wanted, [last]])[np.searchsorted(at, frames)]
        np.clip(tau, below, above, out=tau)
        np.maximum.accumulate(tau, out=tau)
        _meet(tau, at, wanted)
        # But for rounding it is one already.
        np.maximum.accumulate(np.clip(tau, 0, last), out=tau)
    return out


def _meet(tau, at, wanted):
    """Move the frames beside every key-frame, so that the line between them goes through it."""
    # But for rounding, a whole frame is one.
    at = np.where(np.abs(at - np.round(at)) < ROUNDING, np.round(at), at)
    lowest, frames, above = 0.0, at.astype(np.intp), [*wanted[1:], len(tau) - 1.0]
    for k, first, moment, highest in zip(at, frames, wanted, above, strict=True):
        share = k - first
        if share == 0:
            tau[first] = lowest = moment
        else:
            miss = moment - ((1 - share) * tau[first] + share * tau[first + 1])
            earlier = max(tau[first] + miss, lowest)
            later = (moment - (1 - share) * earlier) / share
            if later > highest:
                earlier, later = (moment - share * highest) / (1 - share), highest
            tau[first], tau[first + 1] = earlier, later
            lowest = later
        np.minimum(tau[:first], tau[first], out=tau[:first])
        np.maximum(tau[first + 1 :], lowest, out=tau[first + 1 :])
