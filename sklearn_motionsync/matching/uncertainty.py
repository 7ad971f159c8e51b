"""How far the times of warps may be off, by what was matched.

Paths that cost hardly more than the best one tell how far a warp may move. Their mean distance
from it gives the half-width of an interval, by constants that were fitted to key moments of people:
see docs/accuracy.md.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from .sizes import BATCH, EQUAL
from .tile import Bases, Tile, right_factor
from .trellis import Trellis
from .warps import even_slices

# Half-widths of 90 %, in mean distances of the paths: docs/design.md.
_SCALE = 2.2
# Half-widths grow with the coverage c as ln(1 / (1 - c)) to this power, for warps of people.
_HEAVY = 1.2
# Most frames of the clock on which paths are compared.
_FRAMES = 81
# A path counts by exp(-1) where it costs this share more than the best one.
_TEMPERATURE = 0.1


class Uncertainty(NamedTuple):
    """How far the times of warps may be off.

    Attributes
    ----------
    half_widths : ndarray, shape (n_sequences, P)
        Of intervals that hold 90 %, in frames, where nothing pins a warp.
    is_normal : ndarray of bool, shape (n_sequences,)
        Whether errors are normal, or have heavier tails: see `coverage_factor`.
    shares : ndarray, shape (n_sequences,)
        Distances of the direct paths as shares of the energy of both sequences: 1 is as far as
        standing still.
    widest : ndarray, shape (n_sequences,)
        The widest interval of 90 %, by the paths, as a share of the clip.
    """

    half_widths: np.ndarray
    is_normal: np.ndarray
    shares: np.ndarray
    widest: np.ndarray


def coverage_factor(coverage, is_normal):
    """Half-widths of a coverage, in those of 90 %."""
    normal = ndtri((1 + coverage) / 2) / ndtri(0.95)
    return np.where(is_normal, normal, (np.log1p(-coverage) / np.log(0.1)) ** _HEAVY)


def uncertainty_of_paths(matcher, base, moving, times):
    """The uncertainty of warps, by the trellis of their direct paths.

    Parameters
    ----------
    matcher : Matcher
    base : ndarray, shape (1, P, n_features)
        Features of the pattern.
    moving : ndarray, shape (n_sequences, Q, n_features)
        Features of the trials.
    times : ndarray, shape (n_sequences, P)
        Their warps.

    Returns
    -------
    Uncertainty
    """
    n_frames, trellis = times.shape[1], matcher.trellis
    coarse = np.unique(np.round(np.linspace(0, n_frames - 1, _FRAMES)).astype(np.intp))
    base, moving = base[:, coarse], moving[:, coarse]
    trellis = Trellis.on_clock(
        matcher.features.cost,
        len(coarse),
        trellis.mu,
        max_offset=trellis.reach / n_frames,
        max_rate=trellis.table.steps.max(),
        unseen=trellis.unseen,
        anchors=trellis.anchors and trellis.anchors.at(len(coarse)),
    )
    per_frame = (n_frames - 1) / (len(coarse) - 1)
    spread, shares = _spread_of_paths(trellis, base, moving, times[:, coarse] / per_frame)
    frames, scale = np.arange(n_frames), _SCALE * per_frame
    widths = np.array([np.interp(frames, coarse, scale * row) for row in spread])
    widest = np.minimum(2 * widths.max(axis=1) / (n_frames - 1), 1)
    return Uncertainty(widths, np.zeros(len(times), bool), shares, widest)


def _spread_of_paths(trellis, base, moving, times):
    """Mean distance of near-optimal paths from given times, and the costs of the best ones.

    The best path through a cell is one to it, and one from there: a cell of the trellis, and one of
    that of the reversed sequences. It counts by ``exp(-excess / T)``, where T is a share of the
    cost of the best path.

    Parameters
    ----------
    trellis : Trellis
        With one position a frame.
    base : ndarray, shape (1, P, n_features)
    moving : ndarray, shape (n_moving, P, n_features)
    times : ndarray, shape (n_moving, P)

    Returns
    -------
    spread : ndarray, shape (n_moving, P)
        In frames.
    shares : ndarray, shape (n_moving,)
        Costs of the best paths, as shares of the energy of both sequences.
    """
    n_frames, width = base.shape[1], trellis.width
    energies = np.square(moving[..., trellis.plain]).sum(axis=(1, 2), dtype=np.float64)
    energies += np.square(base[..., trellis.plain]).sum()
    energies = np.maximum(energies, np.finfo(np.float64).tiny)
    spread, shares = np.empty(times.shape), np.empty(len(times))
    offsets = np.arange(-width, width + 1)[:, np.newaxis]
    for rows in even_slices(len(times), BATCH):
        totals = _rows(trellis, base, moving[rows])
        shares[rows] = np.maximum(totals[-1, width], 0) / energies[rows]
        totals += _rows(trellis, base[:, ::-1], moving[rows, ::-1])[::-1, ::-1]
        totals /= -np.maximum(_TEMPERATURE * shares[rows], EQUAL[totals.dtype]) * energies[rows]
        weights = np.exp(totals, out=totals)
        sums = weights.sum(axis=1)
        weights *= np.abs(offsets - (times[rows] - np.arange(n_frames)).T[:, np.newaxis])
        spread[rows] = (weights.sum(axis=1) / sums).T
    return spread, shares


def _rows(trellis, base, moving):
    """Costs of the best paths to every cell: (P, 2 * width + 1, n_moving)."""
    tile = Tile(Bases(trellis, base), right_factor(moving, trellis))
    states = tile.states(base.shape[1])
    for _ in tile.advance(states):
        pass
    rows = states.reshape(len(states), 2 * trellis.centre + 1, len(moving))
    return rows[:, trellis.pad : rows.shape[1] - trellis.pad]
