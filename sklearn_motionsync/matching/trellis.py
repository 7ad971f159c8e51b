"""Dense matching of two sequences by dynamic programming (Eqs. 12-17).

All sequences are already linearly
normalised (Eq. 7): a *base* ``n`` has ``P`` samples, a *moving* sequence ``m``
has ``Q = (P - 1) * subframes + 1`` of them on the same interval. Sample ``p`` of
the base meets position ``q = p * subframes + d`` of the moving sequence; ``d``
is the disparity. A path makes one step ``s = q(p) - q(p - 1)`` a sample, the
local rate being ``rho = s / subframes``, and costs::

    sum_p  |x_n(p)|^2 + b_s |x_m(q)|^2 - g_s <x_n(p), x_m(q)> + mu phi(rho)

Invariants of the code:

- Both ends are pinned (Eq. 9) and no step is negative. A path that leaves
  ``0 <= q < Q`` can therefore never come back, so Eq. 14's infinite cost outside
  needs no test: the finite numbers there are never on a winning path.
- With free ends a path begins and ends at any disparity. The moving sequence then goes on for
  ``width`` positions at both ends, so that every cell of the band is inside: Q is
  ``(P - 1) * subframes + 1 + 2 * width``, and p meets ``q = width + p * subframes + d``.
- A base that is still running has no clock yet: its row holds all positions of the moving
  sequence, ``q = d`` at every p. Its begin is pinned, its end is free.
- A row ``S(p, .)`` depends on the row before it only. It is computed for all bases, disparities
  and moving sequences of a tile at once.
- `tile` has the rows, and follows the paths back.
"""

from typing import NamedTuple

import numpy as np
from sklearn import get_config

from .costs import group_steps, step_table
from .counting import whole
from .tile import PRODUCT_ROWS, ROW_BYTES, TIE, Bases, Tile, right_factor, tile_paths
from .warps import even_slices

# Sizes of one tile of pairs: the matrix product of a row stays below the size from which OpenBLAS
# packs its operands (1.0 against 0.7 ns a cell), and has enough columns. Constants, so that no
# result can depend on the number of workers or on the memory of the machine.
TILE_PRODUCT = 1_000_000
TILE_BASES = 48
# Fewer bases than this make thin products: a single one is better, if its row is long.
_FEW_BASES, LONG_ROW = 8, 1024


class Coupling(NamedTuple):
    """A penalty on the distance to given offsets: the local cost of a cell grows by
    ``weight * (d - d_given)^2``.

    Attributes
    ----------
    weight : float
        In squared features of a frame, by the square of a frame.
    offsets : ndarray, shape (n_bases, n_moving, P)
        ``d_given`` of every pair, in frames.
    """

    weight: float
    offsets: np.ndarray


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
        Whether both ends are free, at no cost: a path then pays for the samples of the base and
        the steps between them only.
    running : bool, default=False
        Whether bases may stop at any sample and end at any position of the moving sequence, which
        has ``max_disparity * subframes + 1`` of them.
    anchors : Anchors, default=None
        The cost of key-frames. They are the last columns of sequences.
    unseen : float, default=None
        The cost of a frame that was not seen. With it a column of weights, from 0 to 1, follows the
        features of sequences, and a cell costs ``w |x_n(p) - x_m(q)|^2 + (1 - w) unseen``, with
        the product w of both weights.
    """

    def __init__(
        self, table, mu, max_disparity, free=False, running=False, anchors=None, unseen=None
    ):
        self.table, self.mu, self.free, self.running = table, mu, free, running
        self.unseen = unseen
        self.reach, self.anchors = max_disparity, anchors
        # The columns of features, behind which are one of weights and those of key-frames.
        n_keyframes = 0 if anchors is None else anchors.columns.n_columns
        self.weight_column = None if unseen is None else -1 - n_keyframes
        n_beside = n_keyframes + (unseen is not None)
        self.plain = slice(None, -n_beside if n_beside else None)
        self.width = max_disparity * table.subframes
        # The position that sample 0 of the base meets at disparity 0, the positions from sample to
        # sample, and the disparities at which paths may end.
        self.lead = self.width if free else 0
        self.stride = 0 if running else table.subframes
        self.ends_at = np.arange(-self.lead, (self.width if running else self.lead) + 1)
        # The change of disparity of every step.
        self.slopes = table.steps - self.stride
        self.groups, self.group_of_step = group_steps(table, mu, self.slopes)
        # Of every step: its penalty, and the weights of |x_m|^2 and of the inner product.
        self.of_step = np.stack([mu * table.penalty, table.moving, table.inner])
        weights = [(group.moving, group.inner, group.penalty) for group in self.groups]
        self.of_group = np.array(weights).T
        self.entry_of_step = np.argsort(table.steps)
        self.penalty_by_step = mu * table.penalty[self.entry_of_step]
        self.scale_by_step = table.inner[self.entry_of_step] / 2
        self.scales = bool((self.scale_by_step != 1).any())
        # Cells at both ends of a row that hold infinity.
        self.pad = int(np.abs(self.slopes).max())
        self.centre = self.width + self.pad
        self.unit_group = self.group_of_step[table.steps == table.subframes][0]

    def weighed(self, squares, base, moving, unseen=None):
        """Squared distances of samples as they count, given the samples with all columns."""
        if self.unseen is None:
            return squares
        weights = base[..., self.weight_column] * moving[..., self.weight_column]
        return weights * squares + (1 - weights) * (self.unseen if unseen is None else unseen)

    @classmethod
    def on_clock(cls, cost, n_frames, mu, *, max_offset, max_rate, subframes=1, **options):
        """The trellis of a cost; the largest offset is a share of the clock."""
        # Whole frames; 0.29 * 100 must not lose one to rounding.
        reach = whole(max_offset * n_frames, "down")
        # No step is longer than the clip.
        table = step_table(cost, min(max_rate, n_frames - 1), subframes)
        return cls(table, mu, min(reach, n_frames - 1), **options)

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
        return self.ends(bases, moving).min(axis=2)

    def ends(self, bases, moving):
        """Cost of the best path to every end, for every ordered pair.

        Returns
        -------
        ndarray, shape (n_bases, n_moving, n_ends)
            The disparities ``ends_at``.
        """
        out = np.empty((len(bases), len(moving), len(self.ends_at)), dtype=bases.dtype)
        for rows, columns, tile_bases, _ in self._tiles_of(Bases(self, bases), moving):
            out[rows, columns] = Tile(tile_bases, right_factor(moving[columns], self)).ends()
        return out

    def paths(self, bases, moving, max_bytes=None, coupling=None):
        """Best path for every ordered pair.

        Parameters
        ----------
        bases : Bases, or ndarray, shape (n_bases, P, n_features)
        moving : ndarray, shape (n_moving, Q, n_features)
        max_bytes : int, default=None
            Above this the rows of the trellis are not all kept but computed twice; by default half
            of scikit-learn's ``working_memory``.
        coupling : Coupling, default=None

        Returns
        -------
        ndarray of int32, shape (n_bases, n_moving, P)
            ``d(p)`` in sub-positions; pinned ends make ``d(0) = d(P-1) = 0``. It depends on the
            pair alone: other pairs change rounding, and in double precision rounding decides
            nothing.
        """
        return self.paths_and_costs(bases, moving, max_bytes, coupling)[0]

    def paths_and_costs(self, bases, moving, max_bytes=None, coupling=None):
        """Best paths as of `paths`, and their costs by the recurrence: (n_bases, n_moving).

        These costs are rounded as the tile is, other than those of `costs`: they serve to compare
        paths.
        """
        if max_bytes is None:
            max_bytes = get_config()["working_memory"] * 2**20 // 2
        if not isinstance(bases, Bases):
            bases = Bases(self, bases)
        n_bases, n_frames, _ = bases.sequences.shape
        disparities = np.empty((n_bases, len(moving), n_frames), dtype=np.int32)
        costs = np.empty((n_bases, len(moving)), dtype=bases.sequences.dtype)
        n_kept = n_frames if TIE[costs.dtype] else 0
        for rows, columns, tile_bases, drawn in self._tiles_of(bases, moving, coupling, n_kept):
            paths, lengths = tile_paths(tile_bases, moving[columns], drawn, max_bytes)
            disparities[rows, columns], costs[rows, columns] = paths, lengths
        return disparities, costs

    def costs(self, base, moving, disparities, unseen=None):
        """Cost of given paths from one base (Eq. 12), added up frame by frame, pair by pair.

        Parameters
        ----------
        base : ndarray, shape (P, n_features)
        moving : ndarray, shape (n_moving, Q, n_features)
        disparities : ndarray of int, shape (n_moving, P)
        unseen : float, default=None
            In place of that of the trellis.

        Returns
        -------
        ndarray, shape (n_moving,)
        """
        with_weights, all_columns = base, moving
        base, moving = base[..., self.plain], moving[..., self.plain]
        out = np.empty(len(moving), dtype=moving.dtype)
        n_positions, n_features = moving.shape[1:]
        diagonal = self.lead + self.stride * np.arange(len(base))
        for start in range(0, len(moving), PRODUCT_ROWS):
            rows = slice(start, start + PRODUCT_ROWS)
            q = disparities[rows] + diagonal
            steps = np.full_like(q, self.table.subframes)
            np.subtract(q[:, 1:], q[:, :-1], out=steps[:, 1:])
            q += n_positions * np.arange(len(q))[:, np.newaxis]
            differences = moving[rows].reshape(-1, n_features).take(q, axis=0)
            if self.scales:
                differences *= self.scale_by_step.take(steps)[:, :, np.newaxis]
            differences -= base
            penalties = self.penalty_by_step.take(steps[:, 1:]).sum(axis=1)
            if self.unseen is not None:
                met = all_columns[rows].reshape(-1, all_columns.shape[2]).take(q, axis=0)
                squares = np.vecdot(differences, differences)
                costs = self.weighed(squares, with_weights, met, unseen).sum(axis=1)
                out[rows] = costs + penalties
                continue
            differences = differences.reshape(len(q), -1)
            out[rows] = np.vecdot(differences, differences) + penalties.astype(out.dtype)
        return out

    def tiles(self, n_bases, n_moving, n_features, n_kept=0):
        """Slices of bases and of moving sequences that cover all pairs.

        ``n_kept`` is how many rows of choices are kept, if any are. The cost of a pair depends in
        its last bit on the tile it is computed in: jobs must share whole tiles only.
        """
        band = 2 * self.width + 1
        cells = max(1, TILE_PRODUCT // (band * (n_features + 2)))
        n_rows = min(cells, TILE_BASES)
        if min(n_rows, n_bases) < _FEW_BASES and band * min(cells, n_moving) >= LONG_ROW:
            n_rows = 1
        if n_kept:
            cells = min(cells, max(1, ROW_BYTES // (2 * band * n_kept)))
        if n_bases <= n_rows and 0 < n_bases * n_moving <= cells:
            return [(slice(0, n_bases), slice(0, n_moving))]
        return [
            (rows, columns)
            for rows in even_slices(n_bases, n_rows)
            for columns in even_slices(n_moving, max(1, cells // (rows.stop - rows.start)))
        ]

    def _tiles_of(self, bases, moving, coupling=None, n_kept=0):
        """Yield slices of bases and moving sequences, and the bases and the coupling, of tiles."""
        n_bases, n_moving = len(bases.sequences), len(moving)
        for rows, columns in self.tiles(n_bases, n_moving, moving.shape[2], n_kept):
            tile_bases, drawn = bases, None
            if rows != slice(0, n_bases):
                tile_bases = Bases(self, bases.sequences[rows])
            if coupling is not None:
                drawn = Coupling(coupling.weight, coupling.offsets[rows, columns])
            yield rows, columns, tile_bases, drawn

    def windows(self, n_frames):
        """Lowest and highest disparity, at every sample, of a path in the band."""
        if self.free:
            return [-self.width] * n_frames, [self.width] * n_frames
        p = np.arange(n_frames)
        up = int(self.slopes.max()) * p
        if self.running:
            return [0] * n_frames, np.minimum(self.width, up).tolist()
        down = self.table.subframes * p
        low = -np.minimum(self.width, np.minimum(down, up[::-1]))
        high = np.minimum(self.width, np.minimum(up, down[::-1]))
        return low.tolist(), high.tolist()
