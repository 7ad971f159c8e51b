"""Dense matching of two sequences by dynamic programming (Eqs. 12-17).

NumPy only; nothing here knows scikit-learn. All sequences are already linearly
normalised (Eq. 7): a *base* ``n`` has ``P`` samples, a *moving* sequence ``m``
has ``Q = (P - 1) * subframes + 1`` of them on the same interval. Sample ``p`` of
the base meets position ``q = p * subframes + d`` of the moving sequence; ``d``
is the disparity. A path makes one step ``s = q(p) - q(p - 1)`` a sample, the
local rate being ``rho = s / subframes``, and costs::

    sum_p  |x_n(p)|^2 + b_s |x_m(q)|^2 - g_s <x_n(p), x_m(q)> + mu phi(rho)

Invariants the code relies on:

- Both ends are pinned (Eq. 9) and no step is negative. A path that leaves
  ``0 <= q < Q`` can therefore never come back, so Eq. 14's infinite cost outside
  needs no test: whatever finite number stands there is never on a winning path.
- With free ends a path begins and ends at any disparity. The moving sequence then goes on for
  ``width`` positions at both ends, so that every cell of the band is inside: Q is
  ``(P - 1) * subframes + 1 + 2 * width``, and p meets ``q = width + p * subframes + d``.
- A base that is still running has no clock yet: its row holds all positions of the moving
  sequence, ``q = d`` at every p. Its begin is pinned, its end is anywhere.
- A step looks only at the row before it. A row has no dependency inside
  itself and is computed for all bases, disparities and moving sequences at once.
- The sequence index is stored last, so that every window of ``q`` is one
  contiguous slice for all moving sequences together.
"""

import math

import numpy as np
from numpy.lib.stride_tricks import as_strided

from .costs import step_table
from .rows import Bases, Bundle, group_steps, right_factor
from .warps import even_slices

__all__ = ["Trellis"]

# Sizes of one tile of pairs: the matrix product of a row stays below the size from which OpenBLAS
# packs its operands (1.0 against 0.7 ns a cell), and has enough columns. Constants, so that no
# result can depend on the number of workers or on the memory of the machine.
TILE_PRODUCT = 1_000_000
TILE_BASES = 48
# Fewer bases than this make thin products: a single one is better, if its row is long.
_FEW_BASES, LONG_ROW = 8, 1024
# Paths whose costs are added up together: what stands in between stays in the cache.
_SUMMED_AT_ONCE = 32


class Trellis:
    """The disparity-space trellis (Fig. 2) of base sequences against moving ones.

    Parameters
    ----------
    table : StepTable
    mu : float
        Weight of the rate penalty.
    max_disparity : int
        ``D``, the largest offset, in frames.
    free : bool, default=False
        Whether both ends are free. Neither then costs anything: what a path pays for is the
        samples of the base and the steps between them.
    running : bool, default=False
        Whether bases may stop at any sample and end at any position of the moving sequence, which
        has ``max_disparity * subframes + 1`` of them.
    """

    def __init__(self, table, mu, max_disparity, free=False, running=False):
        self.table, self.mu, self.free, self.running = table, mu, free, running
        self.reach = max_disparity
        self.width = max_disparity * table.subframes
        # Where sample 0 of the base meets the moving sequence, by how many positions it moves on
        # from sample to sample, and where paths may end.
        self.lead = self.width if free else 0
        self.stride = 0 if running else table.subframes
        self.ends_at = np.arange(-self.lead, (self.width if running else self.lead) + 1)
        # By how much a step changes the disparity.
        self.slopes = table.steps - self.stride
        self.groups, group_of_step = group_steps(table, mu, self.slopes)
        # Of every step: its penalty, and the weights of |x_m|^2 and of the inner product.
        self.of_step = np.stack([mu * table.penalty, table.moving, table.inner])
        weights = [(group.moving, group.inner, group.penalty) for group in self.groups]
        self.of_group = np.array(weights).T
        self.entry_of_step = np.argsort(table.steps)
        self.penalty_by_step = mu * table.penalty[self.entry_of_step]
        self.scale_by_step = table.inner[self.entry_of_step] / 2
        self.scales = bool((self.scale_by_step != 1).any())
        # So many cells at both ends of a row hold infinity.
        self.pad = int(np.abs(self.slopes).max())
        self.unit_group = group_of_step[table.steps == table.subframes][0]
        self._windows = {}

    @classmethod
    def on_clock(cls, cost, n_frames, mu, *, max_offset, max_rate, subframes=1, free=False):
        """The trellis of a cost; the largest offset is a share of the clock."""
        # Whole frames; 0.29 * 100 must not lose one to rounding.
        reach = int(np.floor(max_offset * n_frames * (1 + 1e-12)))
        # No step is longer than the clip.
        table = step_table(cost, min(max_rate, n_frames - 1), subframes)
        return cls(table, mu, min(reach, n_frames - 1), free)

    def distances(self, bases, moving):
        """Cost of the best path for every ordered pair.

        Parameters
        ----------
        bases : ndarray, shape (n_bases, P, n_features)
        moving : ndarray, shape (n_moving, Q, n_features)

        Returns
        -------
        ndarray, shape (n_bases, n_moving)
        """
        out = np.empty((len(bases), len(moving)), dtype=bases.dtype)
        for rows, columns, bundle in self.bundles(Bases(self, bases), moving):
            out[rows, columns] = bundle.distances()
        return out

    def paths(self, bases, moving, max_bytes=1 << 29, coupling=None):
        """Best path for every ordered pair.

        Parameters
        ----------
        bases : Bases, or ndarray, shape (n_bases, P, n_features)
        moving : ndarray, shape (n_moving, Q, n_features)
        max_bytes : int, default=2 ** 29
            Above this the rows of the trellis are not all kept but computed twice.
        coupling : Coupling, default=None
            What draws the paths towards others.

        Returns
        -------
        ndarray of int32, shape (n_bases, n_moving, P)
            ``d(p)`` in sub-positions; pinned ends make ``d(0) = d(P-1) = 0``. It depends on the
            pair alone: what other pairs are given changes rounding, and in double precision
            rounding decides nothing.
        """
        return self.paths_and_costs(bases, moving, max_bytes, coupling)[0]

    def paths_and_costs(self, bases, moving, max_bytes=1 << 29, coupling=None):
        """The same, and what the recurrence says that they cost: (n_bases, n_moving).

        That is rounded as the tile is, and not as `costs` adds it up: enough to compare paths by.
        """
        if not isinstance(bases, Bases):
            bases = Bases(self, bases)
        shape = len(bases), len(moving), bases.sequences.shape[1]
        disparities = np.empty(shape, dtype=np.int32)
        costs = np.empty(shape[:2], dtype=bases.sequences.dtype)
        for rows, columns, bundle in self.bundles(bases, moving, coupling):
            few = is_narrow(bundle)
            found = narrow_paths(bundle) if few else bundle.paths(max_bytes)
            disparities[rows, columns], costs[rows, columns] = found
        return disparities, costs

    def ends(self, bases, moving):
        """Cost of the best path to every end, for every ordered pair.

        Returns
        -------
        ndarray, shape (n_bases, n_moving, n_ends)
            The disparities ``ends_at``.
        """
        out = np.empty((len(bases), len(moving), len(self.ends_at)), dtype=bases.dtype)
        for rows, columns, bundle in self.bundles(Bases(self, bases), moving):
            out[rows, columns] = bundle.ends()
        return out

    def paths_to(self, ends, bases, moving, max_bytes=1 << 29):
        """Best path to each of some ends, for every ordered pair.

        Parameters
        ----------
        ends : array-like of int, shape (n_ends,)
            Disparities among ``ends_at``.
        bases, moving, max_bytes
            As in `paths`.

        Returns
        -------
        ndarray of int32, shape (n_bases, n_moving, n_ends, P)
        """
        shape = len(bases), len(moving), len(ends), bases.shape[1]
        disparities = np.empty(shape, dtype=np.int32)
        for rows, columns, bundle in self.bundles(Bases(self, bases), moving):
            disparities[rows, columns] = bundle.paths(max_bytes, ends)[0]
        return disparities

    def costs(self, base, moving, disparities):
        """Cost of given paths from one base (Eq. 12), added up frame by frame, pair by pair.

        Parameters
        ----------
        base : ndarray, shape (P, n_features)
        moving : ndarray, shape (n_moving, Q, n_features)
        disparities : ndarray of int, shape (n_moving, P)

        Returns
        -------
        ndarray, shape (n_moving,)
        """
        out = np.empty(len(moving), dtype=moving.dtype)
        for rows in even_slices(len(moving), _SUMMED_AT_ONCE):
            out[rows] = self._costs(base, moving[rows], disparities[rows])
        return out

    def _costs(self, base, moving, disparities):
        n_moving, n_positions, n_features = moving.shape
        q = disparities + (self.lead + self.stride * np.arange(len(base)))
        steps = np.full_like(q, self.table.subframes)
        np.subtract(q[:, 1:], q[:, :-1], out=steps[:, 1:])
        q += n_positions * np.arange(n_moving)[:, np.newaxis]
        differences = moving.reshape(-1, n_features).take(q, axis=0)
        if self.scales:
            differences *= self.scale_by_step.take(steps)[:, :, np.newaxis]
        differences -= base
        differences = differences.reshape(n_moving, -1)
        local = np.vecdot(differences, differences)
        return local + self.penalty_by_step.take(steps[:, 1:]).sum(axis=1).astype(local.dtype)

    def tiles(self, n_bases, n_moving, n_features):
        """Slices of bases and of moving sequences that cover all pairs.

        What a pair costs depends in its last bit on the tile it is computed in: work is
        to be divided between tiles only.
        """
        band = 2 * self.width + 1
        cells = max(1, TILE_PRODUCT // (band * (n_features + 2)))
        n_rows = min(cells, TILE_BASES)
        if min(n_rows, n_bases) < _FEW_BASES and band * min(cells, n_moving) >= LONG_ROW:
            n_rows = 1
        for rows in even_slices(n_bases, n_rows):
            for columns in even_slices(n_moving, max(1, cells // (rows.stop - rows.start))):
                yield rows, columns

    def cells(self, moving):
        """Cells of the trellis of one pair."""
        return (moving.shape[1] // self.table.subframes) * (2 * self.width + 1)

    def bundles(self, bases, moving, coupling=None):
        """Yield the slices of every tile of pairs, and the bundle of its rows."""
        for rows, columns in self.tiles(len(bases), *moving.shape[::2]):
            right = right_factor(moving[columns])
            drawn = None if coupling is None else coupling.part(rows, columns)
            yield rows, columns, Bundle(self, bases.part(rows), right, drawn)

    def windows(self, n_frames):
        """Lowest and highest disparity, at every sample, of a path in the band."""
        if self.free:
            return [-self.width] * n_frames, [self.width] * n_frames
        if self.running:
            highs = np.minimum(self.width, int(self.slopes.max()) * np.arange(n_frames))
            return [0] * n_frames, highs.tolist()
        known = self._windows.get(n_frames)
        if known is not None:
            return known
        p = np.arange(n_frames)
        down, up = self.table.subframes * p, int(self.slopes.max()) * p
        low = -np.minimum(self.width, np.minimum(down, up[::-1]))
        high = np.minimum(self.width, np.minimum(up, down[::-1]))
        windows = low.tolist(), high.tolist()
        self._windows = {n_frames: windows}
        return windows


# -- the same rows for so few pairs that NumPy's calls cost more than its arithmetic (Eqs. 16, 17)

# Bytes, for each group of steps, of all ways into the cells of a bundle that is narrow: of one base
# and of several, whose rows take longer; and at most for all groups. Measured with one group of
# three steps and five of one, on 68 and 100 frames: level at 1.2 MB for one base, 4 for several.
NARROW_BYTES = 1_300_000, 3_000_000
_MOST_BYTES = 15_000_000
# Pairs so few that Python's steps cost less than NumPy's.
_FEW_PAIRS = 4


def is_narrow(bundle):
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
