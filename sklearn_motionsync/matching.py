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
import math
from typing import NamedTuple

import numpy as np

__all__ = ["Match", "StepTable", "Trellis", "even_slices", "step_table"]

# Sizes of one tile of pairs: the rows stay in the second-level cache, the matrix product of a
# row stays below the size from which OpenBLAS packs its operands (1.0 against 0.7 ns a cell), and
# it has enough columns. Constants, so that no result can depend on the number of workers or
# on the memory of the machine.
_TILE_PRODUCT = 1_000_000
_TILE_BASES = 48
# Fewer bases than this make thin products: a single one is better, if its row is long.
_FEW_BASES, _LONG_ROW = 8, 1024
# Cells of a trellis so small that NumPy's calls cost more than its arithmetic.
_SMALL_TABLE = 20_000
# Samples of a single base that share one product.
_PRODUCT_ROWS = 16

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


class Match(NamedTuple):
    """Warps of a set of sequences to one base.

    Attributes
    ----------
    offsets : ndarray, shape (n_sequences, P)
        ``Delta(p)``, in frames of the base.
    times : ndarray, shape (n_sequences, P)
        ``tau(p) = p + Delta(p)``, non-decreasing, ``tau(0) = 0``, ``tau(P-1) = P-1``.
    distances : ndarray, shape (n_sequences,)
        The synchronisation distance ``D_{n,m}`` of Eq. 12, of the path straight to the base.
    """

    offsets: np.ndarray
    times: np.ndarray
    distances: np.ndarray


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
        self._groups, group_of_step = _group_steps(table, mu)
        self._of_step = np.stack([mu * table.penalty, table.moving, table.inner])
        self._slopes = table.steps - table.subframes
        self._pad = int(np.abs(self._slopes).max())
        self._unit_group = group_of_step[self._slopes == 0][0]
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
            right = _right_factor(moving[columns])
            yield rows, columns, _Bundle(self, bases[rows], right)

    def windows(self, n_frames):
        """Lowest and highest disparity, at every sample, of a pinned path in the band."""
        if n_frames in self._windows:
            return self._windows[n_frames]
        p = np.arange(n_frames)
        down, up = self.table.subframes * p, int(self._slopes.max()) * p
        low = -np.minimum(self.width, np.minimum(down, up[::-1]))
        high = np.minimum(self.width, np.minimum(up, down[::-1]))
        self._windows = {n_frames: (low.tolist(), high.tolist())}
        return self._windows[n_frames]


class _Bundle:
    """The pairs of one tile, whose rows are computed together.

    A row holds the disparities of all pairs, flat: (2 * (width + pad) + 1, n_moving,
    n_bases), with ``pad`` cells at both sides for the steps that leave the band.
    """

    def __init__(self, trellis, bases, right):
        self.trellis, self.bases, self.right = trellis, bases, right
        self.n_frames, self.n_bases = bases.shape[1], len(bases)
        self.pairs = right.shape[1] * self.n_bases
        self.centre = trellis.width + trellis._pad
        self.left = _left_factor(bases, trellis._groups)
        self.low, self.high = trellis.windows(self.n_frames)
        # Where the window of every sample is in a flat row.
        self.starts = [(self.centre + low) * self.pairs for low in self.low]
        self.stops = [(self.centre + high + 1) * self.pairs for high in self.high]

    def states(self, n_rows):
        """Rows of cells that no path has reached."""
        cells = (2 * self.centre + 1) * self.pairs
        return np.full((n_rows, cells), np.inf, dtype=self.bases.dtype)

    def cost(self, states):
        """Costs of the best paths, from the last row."""
        at = self.centre * self.pairs
        best = states[(self.n_frames - 1) % len(states), at : at + self.pairs]
        return np.maximum(best, 0).reshape(-1, self.n_bases).T

    # -- forward: the recurrence, Eq. 16 --------------------------------------

    def advance(self, states, first=0, last=None):
        """Compute the rows ``S(p, .)`` from ``first`` on, before ``last``, in a ring of rows.

        Yields every p when its row is there. If ``first`` is not 0 its row must be there already.
        Cells that no path reaches stay infinite: the windows first only grow, over
        cells never written, then only shrink, reading inside the row before.
        """
        pairs, rows, keep = self.pairs, list(states), len(states)
        plan = [_plan(group, pairs, states.dtype) for group in self.trellis._groups]
        room, level = np.empty((2, (2 * self.trellis.width + 1) * pairs), dtype=states.dtype)
        last = self.n_frames if last is None else last
        costs = self._costs_of_samples if self.n_bases > 1 else self._costs_of_blocks
        starts, stops, rest = self.starts, self.stops, plan[1:]
        for p, local in costs(first, last):
            start, stop = starts[p], stops[p]
            new, old = rows[p % keep][start:stop], rows[(p - 1) % keep]
            if p == 0:
                unit = self.trellis._unit_group
                np.subtract(local[unit], self.trellis._groups[unit].penalty, out=new)
            elif p > first:
                best = _best_step(old, start, stop, plan[0], new, level)
                np.add(best, local[0], out=new)
                for i, levels in enumerate(rest, 1):
                    trial = room[: stop - start]
                    best = _best_step(old, start, stop, levels, trial, level)
                    np.minimum(new, np.add(best, local[i], out=trial), out=new)
            yield p

    def _costs_of_samples(self, first, last):
        """Yield ``p`` and the costs of its window, one flat array a group: a product a sample."""
        sub, n_groups = self.trellis.table.subframes, len(self.trellis._groups)
        n_factors = self.right.shape[2]
        widest = (2 * self.trellis.width + 1) * self.pairs
        room = np.empty(n_groups * widest, dtype=self.bases.dtype)
        for p in range(first, last):
            window = self.right[p * sub + self.low[p] : p * sub + self.high[p] + 1]
            factor = window.reshape(-1, n_factors)
            costs = room[: n_groups * len(factor) * self.n_bases].reshape(n_groups, -1)
            products = costs.reshape(n_groups, -1, self.n_bases)
            np.matmul(factor, self.left[p], out=products)
            yield p, costs

    def _costs_of_blocks(self, first, last):
        """The same for a single base: a product a block of samples."""
        sub, n_groups = self.trellis.table.subframes, len(self.trellis._groups)
        n_factors = self.right.shape[2]
        for start in range(first, last, _PRODUCT_ROWS):
            # Whole blocks even if their end is not asked for: equal products, equal bits.
            stop = min(start + _PRODUCT_ROWS, self.n_frames)
            # The ends of the windows never move back.
            lowest = start * sub + self.low[start]
            highest = (stop - 1) * sub + self.high[stop - 1]
            factor = self.right[lowest : highest + 1].reshape(-1, n_factors)
            left = self.left[start:stop].reshape(-1, n_factors)
            costs = np.matmul(left, factor.T).reshape(stop - start, n_groups, -1)
            for p, rows in zip(range(start, min(stop, last)), costs, strict=False):
                # From disparities to places in the block.
                shift = (p * sub - lowest - self.centre) * self.pairs
                yield p, rows[:, self.starts[p] + shift : self.stops[p] + shift]

    # -- backward: the path, Eq. 17 -------------------------------------------

    def paths(self, max_bytes):
        """Costs and disparities of the best paths.

        If not all rows may be kept, every ``length``-th is, and the rows between two of them
        are computed again, from the last to the first.
        """
        n_frames, length = self.n_frames, self.n_frames
        if self.states(1).nbytes * n_frames > max_bytes:
            length = _PRODUCT_ROWS * math.ceil(math.sqrt(n_frames) / _PRODUCT_ROWS)
        states = self.states(n_frames if length >= n_frames else 2)
        kept = {}
        for p in self.advance(states):
            if length < n_frames and p % length == 0:
                kept[p] = states[p % 2].copy()
        cost = self.cost(states)
        at = np.empty((n_frames, self.pairs), dtype=np.intp)
        at[-1] = self.centre * self.pairs + np.arange(self.pairs)
        for first in range(0, n_frames, length)[::-1]:
            last = min(first + length, n_frames)
            if kept:
                states = self.states(length)
                states[first % length] = kept.pop(first)
                for _ in self.advance(states, first, last):
                    pass
            self._retrace(states, at, first, last)
        disparities = (at // self.pairs - self.centre).T
        return cost, disparities.reshape(-1, self.n_bases, n_frames).swapaxes(0, 1)

    def _retrace(self, states, at, first, last):
        """Follow the paths back from row ``last`` to ``first``: the step that won each time."""
        trellis, pairs = self.trellis, self.pairs
        several = len(trellis._groups) > 1
        shift = trellis._slopes * pairs
        back = shift[:, np.newaxis]
        if not several and len(states) == self.n_frames and states.size <= _SMALL_TABLE:
            return self._look_up(states, at, shift)
        penalties, weight, inner = trellis._of_step.astype(states.dtype)[:, :, np.newaxis]
        moving, base = np.divmod(np.arange(pairs), self.n_bases)
        start = min(last, self.n_frames - 1)
        here = at[start]
        for p in range(start, first, -1):
            value = states[(p - 1) % len(states)].take(here - back)
            value += penalties
            if several:
                q = p * trellis.table.subframes + here // pairs - self.centre
                y, x = self.right[q, moving], self.bases[base, p]
                value += weight * y[:, -2]
                value -= inner * np.einsum("ik,ik->i", x, y[:, :-2])
            here = here - shift.take(value.argmin(axis=0))
            at[p - 1] = here

    def _look_up(self, states, at, shift):
        """The same for a small trellis: the winning steps of all its cells, then a walk."""
        edge = self.trellis._pad * self.pairs
        cells = np.arange(edge, states.shape[1] - edge)
        values = states[:-1].take(cells - shift[:, np.newaxis], axis=1)
        values += self.trellis._of_step[0].astype(states.dtype)[:, np.newaxis]
        steps = shift.take(values.argmin(axis=1))
        for pair, here in enumerate(at[-1].tolist()):
            for p in range(len(steps) - 1, -1, -1):
                here -= steps.item(p, here - edge)
                at[p, pair] = here


def even_slices(n, size):
    """Slices that cover ``n`` items: as few as can be of at most ``size``, of even sizes."""
    count = -(-n // size)
    edges = [i * n // count for i in range(count + 1)] if count else []
    return [slice(start, stop) for start, stop in itertools.pairwise(edges)]


class _Group(NamedTuple):
    """Steps whose local cost is the same; what their penalties have in common belongs to it."""

    moving: float
    inner: float
    penalty: float
    levels: list


def _group_steps(table, mu):
    """Groups of steps of equal weights, and the group of every step."""
    weights = np.column_stack([table.moving, table.inner])
    unique, group_of_step = np.unique(weights, axis=0, return_inverse=True)
    group_of_step = group_of_step.ravel()
    slopes = table.steps - table.subframes
    groups = []
    for i, (moving, inner) in enumerate(unique):
        mine = group_of_step == i
        penalties = mu * table.penalty[mine]
        least = penalties.min()
        levels = [
            (float(value - least), slopes[mine][penalties == value].tolist())
            for value in np.unique(penalties)[::-1]
        ]
        groups.append(_Group(moving, inner, float(least), levels))
    return groups, group_of_step


def _plan(group, pairs, dtype):
    """The levels of a group for flat rows; arrays spare NumPy the conversion of numbers."""
    return [
        (np.array(penalty, dtype) if penalty else None, [k * pairs for k in slopes])
        for penalty, slopes in group.levels
    ]


def _best_step(old, start, stop, levels, out, scratch):
    """``min_s S(p-1, d - k_s) + mu phi_s`` over the steps of one group.

    ``levels`` come by falling penalty; what all steps have in common is not in them. The
    result is in ``out``, or in ``old`` itself where there is nothing to compute.
    """
    best = None
    for penalty, (shift, *others) in levels:
        view = old[start - shift : stop - shift]
        target = out if best is None else scratch[: stop - start]
        for other in others:
            view = np.minimum(view, old[start - other : stop - other], out=target)
        if penalty is not None:
            view = np.add(view, penalty, out=target)
        best = view if best is None else np.minimum(best, view, out=out)
    return best


def _right_factor(moving):
    """(Q, n_moving, n_features + 2): x_m(q), |x_m(q)|^2 and 1."""
    n_moving, n_positions, n_features = moving.shape
    right = np.empty((n_positions, n_moving, n_features + 2), dtype=moving.dtype)
    right[..., :-2] = moving.transpose(1, 0, 2)
    np.einsum("mqk,mqk->qm", moving, moving, out=right[..., -2])
    right[..., -1] = 1
    return right


def _left_factor(bases, groups):
    """(P, n_groups, n_features + 2, n_bases): times the right factor, the local costs."""
    n_bases, n_frames, n_features = bases.shape
    left = np.empty((n_frames, len(groups), n_features + 2, n_bases), dtype=bases.dtype)
    frames = bases.transpose(1, 2, 0)
    energy = np.einsum("npk,npk->pn", bases, bases)
    for i, group in enumerate(groups):
        np.multiply(frames, -group.inner, out=left[:, i, :-2])
        left[:, i, -2] = group.moving
        np.add(energy, group.penalty, out=left[:, i, -1])
    return left
