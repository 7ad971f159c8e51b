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
- A step looks only at the row before it. A row has no dependency inside
  itself and is computed for all bases, disparities and moving sequences at once.
- The sequence index is stored last, so that every window of ``q`` is one
  contiguous slice for all moving sequences together.
"""

import itertools
from typing import NamedTuple

import numpy as np

from .bundle import Bundle, group_steps, right_factor

__all__ = ["StepTable", "Trellis", "even_slices", "step_table"]

# Sizes of one tile of pairs: the matrix product of a row stays below the size from which OpenBLAS
# packs its operands (1.0 against 0.7 ns a cell), and has enough columns. Constants, so that no
# result can depend on the number of workers or on the memory of the machine.
_TILE_PRODUCT = 1_000_000
_TILE_BASES = 48
# Fewer bases than this make thin products: a single one is better, if its row is long.
_FEW_BASES, _LONG_ROW = 8, 1024

# w of the velocity cost, from the measurement in docs/method.md.
_RATE_WEIGHT = 0.2


class StepTable(NamedTuple):
    """What every admissible step costs: the difference between one cost and another.

    Attributes
    ----------
    steps : ndarray of int, shape (n_steps,)
        Admissible steps ``s``, in sub-positions, the preferred ones first: among
        paths of equal cost the back-tracking takes the earlier entry.
    moving : ndarray, shape (n_steps,)
        ``b_s``, the weight of ``|x_m(q)|^2``.
    inner : ndarray, shape (n_steps,)
        ``g_s``, the weight of the inner product.
    penalty : ndarray, shape (n_steps,)
        ``phi(rho)``, multiplied by ``mu``.
    subframes : int
        Sub-positions a frame.
    """

    steps: np.ndarray
    moving: np.ndarray
    inner: np.ndarray
    penalty: np.ndarray
    subframes: int


def step_table(cost="posture", max_rate=2, subframes=1):
    """Build the step table of a cost.

    ==========  ========  ===========  =============
    cost        b_s       g_s          phi
    ==========  ========  ===========  =============
    posture     1         2            abs(rho - 1)
    velocity    omega^2   2 omega      (rho - 1)^2
    elastic     rho       2 sqrt(rho)  (rho - 1)^2
    ==========  ========  ===========  =============

    The two penalties agree on the rates 0, 1 and 2 of Eq. 16. A velocity counts with the
    weight ``omega = 1 - w + w rho``, ``w = 0.2``: run at the rate rho a sequence moves rho times
    as fast, but taking that whole (w = 1) makes wrong moments agree by changing the pace, and
    not at all (w = 0) stands still and jumps.

    Parameters
    ----------
    cost : {"posture", "velocity", "elastic"}, default="posture"
        ``"posture"`` with the other defaults is exactly Eqs. 12 and 16.
    max_rate : float, default=2
        Largest local rate; 2 is the limit that follows from Eq. 13.
    subframes : int, default=1
        Sub-positions a frame.

    Returns
    -------
    StepTable
    """
    steps = np.arange(int(np.floor(max_rate * subframes)) + 1)
    steps = steps[np.argsort(np.abs(steps - subframes), kind="stable")]
    rates = steps / subframes
    ones = np.ones(len(steps))
    if cost == "posture":
        return StepTable(steps, ones, 2 * ones, np.abs(rates - 1), subframes)
    penalty = np.square(rates - 1)
    if cost == "velocity":
        omega = 1 + _RATE_WEIGHT * (rates - 1)
        return StepTable(steps, omega**2, 2 * omega, penalty, subframes)
    if cost == "elastic":
        return StepTable(steps, rates, 2 * np.sqrt(rates), penalty, subframes)
    raise ValueError(f"cost={cost!r} is unknown; use 'posture', 'velocity' or 'elastic'.")


class Trellis:
    """The disparity-space trellis (Fig. 2) of base sequences against moving ones.

    Parameters
    ----------
    table : StepTable
    mu : float
        Weight of the rate penalty.
    max_disparity : int
        ``D``, the largest offset, in frames.
    """

    def __init__(self, table, mu, max_disparity):
        self.table = table
        self.width = max_disparity * table.subframes
        self.groups, group_of_step = group_steps(table, mu)
        # Of every step: its penalty, and the weights of |x_m|^2 and of the inner product.
        self.of_step = np.stack([mu * table.penalty, table.moving, table.inner])
        # By how much it changes the disparity; ``pad`` cells at both ends of a row hold infinity.
        self.slopes = table.steps - table.subframes
        self.pad = int(np.abs(self.slopes).max())
        self.unit_group = group_of_step[self.slopes == 0][0]
        self._windows = {}

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
        for rows, columns, bundle in self._bundles(bases, moving):
            states = bundle.states(2)
            for _ in bundle.advance(states):
                pass
            out[rows, columns] = bundle.cost(states)
        return out

    def paths(self, bases, moving, max_bytes=1 << 29):
        """Best path for every ordered pair.

        Parameters
        ----------
        bases : ndarray, shape (n_bases, P, n_features)
        moving : ndarray, shape (n_moving, Q, n_features)
        max_bytes : int, default=2 ** 29
            Above this the rows of the trellis are not all kept but computed twice.

        Returns
        -------
        distances : ndarray, shape (n_bases, n_moving)
        disparities : ndarray of int32, shape (n_bases, n_moving, P)
            ``d(p)`` in sub-positions; ``d(0) = d(P-1) = 0``.
        """
        shape = len(bases), len(moving)
        distances = np.empty(shape, dtype=bases.dtype)
        disparities = np.empty((*shape, bases.shape[1]), dtype=np.int32)
        for rows, columns, bundle in self._bundles(bases, moving):
            distances[rows, columns], disparities[rows, columns] = bundle.paths(max_bytes)
        return distances, disparities

    def tiles(self, n_bases, n_moving, n_features):
        """Slices of bases and of moving sequences that cover all pairs.

        What a pair costs depends in its last bit on the tile it is computed in: work is
        to be divided between tiles only.
        """
        band = 2 * self.width + 1
        cells = max(1, _TILE_PRODUCT // (band * (n_features + 2)))
        n_rows = min(cells, _TILE_BASES)
        if min(n_rows, n_bases) < _FEW_BASES and band * min(cells, n_moving) >= _LONG_ROW:
            n_rows = 1
        for rows in even_slices(n_bases, n_rows):
            for columns in even_slices(n_moving, max(1, cells // (rows.stop - rows.start))):
                yield rows, columns

    def cells(self, moving):
        """Cells of the trellis of one pair."""
        return (moving.shape[1] // self.table.subframes) * (2 * self.width + 1)

    def _bundles(self, bases, moving):
        for rows, columns in self.tiles(len(bases), *moving.shape[::2]):
            right = right_factor(moving[columns])
            yield rows, columns, Bundle(self, bases[rows], right)

    def windows(self, n_frames):
        """Lowest and highest disparity, at every sample, of a pinned path in the band."""
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


def even_slices(n, size):
    """Slices that cover ``n`` items: as few as can be of at most ``size``, of even sizes."""
    count = -(-n // size)
    edges = [i * n // count for i in range(count + 1)] if count else []
    return [slice(start, stop) for start, stop in itertools.pairwise(edges)]
