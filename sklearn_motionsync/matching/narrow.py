"""The same rows for so few pairs that NumPy's calls cost more than its arithmetic (Eqs. 16, 17).

All steps to all cells of all rows are laid out at once, each step a group of its own, so that a
row takes two calls. The band is computed whole: what lies outside the sequences is never on a
winning path.
"""

import math

import numpy as np
from numpy.lib.stride_tricks import as_strided

__all__ = ["NARROW_BYTES", "narrow_paths", "suits"]

# Bytes, for each group of steps, of all ways into the cells of a bundle that is narrow: of one base
# and of several, whose rows take longer; and at most for all groups. Measured with one group of
# three steps and five of one, on 68 and 100 frames: level at 1.2 MB for one base, 4 for several.
NARROW_BYTES = 1_300_000, 3_000_000
_MOST_BYTES = 15_000_000
# Pairs so few that Python's steps cost less than NumPy's.
_FEW_PAIRS = 4


def suits(bundle):
    """Whether all steps of all rows of a bundle may be laid out."""
    trellis = bundle.trellis
    n_steps = len(trellis.table.steps)
    consecutive = n_steps == trellis.table.steps.max() + 1
    cells = bundle.n_frames * (2 * trellis.width + 1) * bundle.pairs
    room = min(NARROW_BYTES[bundle.n_bases > 1] * len(trellis.groups), _MOST_BYTES)
    few = cells * n_steps * bundle.dtype.itemsize <= room
    return consecutive and few and not (trellis.free or trellis.running)


def narrow_paths(bundle):
    """Disparities of the best paths of a bundle, (n_bases, n_moving, P), and their costs."""
    trellis, pairs = bundle.trellis, bundle.pairs
    ways, states = _ways(bundle), bundle.states(bundle.n_frames)
    edge, item = trellis.pad * pairs, states.itemsize
    # S(p - 1, d - k) of every cell, step by step.
    before = as_strided(
        states[:, edge + trellis.table.subframes * pairs :],
        shape=ways.shape,
        strides=(states.strides[0], -pairs * item, item),
        writeable=False,
    )
    rows = states[:, edge : states.shape[1] - edge]
    middle = slice(trellis.width * pairs, (trellis.width + 1) * pairs)
    rows[0, middle] = ways[0, trellis.table.subframes, middle]
    add, smallest = np.add, np.minimum.reduce
    for way, last, row in zip(ways[1:], before[:-1], rows[1:], strict=True):
        smallest(add(way, last, way), 0, None, row)
    costs = np.maximum(rows[-1, middle], 0).reshape(-1, bundle.n_bases).T
    return _walk(bundle, ways), costs


def _ways(bundle):
    """Local costs, with the penalty, of every step to every cell: (P, n_steps, cells)."""
    trellis, right = bundle.trellis, bundle.right
    table, width = trellis.table, trellis.width
    n_moving, n_factors = right.shape[1:]
    padded = np.zeros((len(right) + 2 * width, n_moving, n_factors), right.dtype)
    padded[width : width + len(right)] = right
    windows = as_strided(
        padded,
        shape=(bundle.n_frames, 1, (2 * width + 1) * n_moving, n_factors),
        strides=(table.subframes * padded.strides[0], 0, *padded.strides[1:]),
        writeable=False,
    )
    ways = np.matmul(windows, bundle.bases.by_step)
    ways = ways.reshape(bundle.n_frames, len(table.steps), -1)
    # The first sample is reached by no step, so it pays no penalty.
    ways[0] -= trellis.of_step[0, trellis.entry_of_step, np.newaxis]
    if bundle.coupling is not None:
        for p, way in enumerate(ways):
            way += bundle.coupled(p, -width, width)
    return ways


def _walk(bundle, ways):
    """Disparities: at each sample the first of the best steps."""
    trellis, pairs = bundle.trellis, bundle.pairs
    order, (n_frames, _, n_cells) = trellis.table.steps, ways.shape
    shift = trellis.slopes * pairs
    here = trellis.width * pairs + np.arange(pairs)
    if pairs <= _FEW_PAIRS:
        at = np.empty((n_frames, pairs), dtype=np.intp)
        at[-1] = here
        for pair, cell in enumerate(here.tolist()):
            at[:-1, pair] = _walk_alone(ways, cell, order, shift, bundle.handicaps[:, pair])
    else:
        # The cell of every entry of the step table; that of the first tells where the path is.
        cells = np.empty((n_frames, len(order), pairs), dtype=np.intp)
        cells[-1] = here + (order * n_cells)[:, np.newaxis]
        flat, handicaps, subtract = ways.reshape(n_frames, -1), bundle.handicaps, np.subtract
        for way, there, before in zip(flat[:0:-1], cells[:0:-1], cells[-2::-1], strict=True):
            value = way[there]
            value += handicaps
            subtract(there, shift[value.argmin(axis=0)], before)
        at = cells[:, 0] - order[0] * n_cells
    return bundle.disparities(at // pairs - trellis.width)


def _walk_alone(ways, cell, *steps):
    """The cells of one path at all samples before the last."""
    entries = list(zip(*(values.tolist() for values in steps), strict=True))
    cost_of, cells = ways.item, []
    for p in range(len(ways) - 1, 0, -1):
        best, way = math.inf, 0
        for step, moved, handicap in entries:
            cost = cost_of(p, step, cell) + handicap
            if cost < best:
                best, way = cost, moved
        cell -= way
        cells.append(cell)
    return cells[::-1]
