"""The rows of the trellis for a bundle of pairs (Eqs. 16 and 17): the inner loop of the matching.

What the code relies on:

- A row ``S(p, .)`` looks only at the row before it, so it is computed for all offsets and all
  pairs of the bundle at once.
- Rows are flat, the offset first and the pair last: the cells before a step are one slice.
- Local costs are matrix products of a left factor (the bases) and a right one (the moving
  sequences), as `factors` makes them, one a group of steps.
"""

import functools
import math
from typing import NamedTuple

import numpy as np

__all__ = ["PRODUCT_ROWS", "TIE", "Bases", "Bundle", "Coupling", "group_steps", "right_factor"]

# Samples of a single base that share one product.
PRODUCT_ROWS = 16
# Ties: costs of paths that differ by less than this share of all energy are equal. Rounding to
# double precision moves them by a thousandth of it; in single precision there is no room between
# rounding and data, so that rounding decides.
TIE = {np.dtype(np.float64): 2.0**-40, np.dtype(np.float32): 0.0}


class Coupling(NamedTuple):
    """What draws paths towards others: ``weight * (d - d_other)^2`` is added to the local cost.

    Attributes
    ----------
    weight : float
        In squared features of a frame, by the square of a frame.
    offsets : ndarray, shape (n_bases, n_moving, P)
        ``d_other`` of every pair, in frames.
    """

    weight: float
    offsets: np.ndarray

    def part(self, rows, columns):
        """That of some pairs, by slices."""
        return self._replace(offsets=self.offsets[rows, columns])

    def cost(self, times):
        """What warps ``tau`` of all pairs pay, (n_bases, n_moving, P): (n_bases, n_moving)."""
        away = times - np.arange(times.shape[-1]) - self.offsets
        return self.weight * np.square(away).sum(axis=-1)


class Bundle:
    """The pairs of one tile, whose rows are computed together.

    A row holds the disparities of all pairs, flat: (2 * (width + pad) + 1, n_moving,
    n_bases), with ``pad`` cells at both sides for the steps that leave the band.
    """

    def __init__(self, trellis, bases, right, coupling=None):
        self.trellis, self.bases, self.right = trellis, bases, right
        self.coupling = coupling
        self.n_bases, self.n_frames = bases.sequences.shape[:2]
        self.dtype = bases.sequences.dtype
        self.pairs = right.shape[1] * self.n_bases
        self.centre = trellis.width + trellis.pad
        self.row_cells = (2 * self.centre + 1) * self.pairs

    @functools.cached_property
    def left(self):
        """The left factor of the bases."""
        return self.bases.by_group()

    @functools.cached_property
    def handicaps(self):
        """What the back-tracking charges the steps of every pair: (n_steps, n_pairs).

        The entries of the step table, one after the other, pay a little more, so that the first of
        equal ones wins. Two bundles that hold the same pair round differently, but both far less
        than this.
        """
        energy = self.right[..., -2].sum(axis=0)[:, np.newaxis] + self.bases.energy
        rank = np.arange(len(self.trellis.slopes), dtype=self.dtype)[:, np.newaxis]
        return TIE[self.dtype] * rank * energy.ravel()

    @functools.cached_property
    def drawn_to(self):
        """The offsets that the coupling draws to, sample by sample: (P, pairs)."""
        return self.coupling.offsets.transpose(2, 1, 0).reshape(self.n_frames, -1)

    def coupled(self, p, low, high):
        """What the coupling adds to the cells of a row, the disparities from low to high, flat."""
        offsets = np.arange(low, high + 1)[:, np.newaxis] / self.trellis.table.subframes
        added = self.coupling.weight * np.square(offsets - self.drawn_to[p])
        return added.astype(self.dtype).ravel()

    def states(self, n_rows):
        """Rows of cells that no path has reached."""
        return np.full((n_rows, self.row_cells), np.inf, dtype=self.dtype)

    def distances(self):
        """Costs of the best paths: (n_bases, n_moving)."""
        return self.ends().min(axis=2)

    def ends(self):
        """Costs of the best paths to every end: (n_bases, n_moving, n_ends).

        The ends are disparities, rising: 0 alone if they are pinned.
        """
        states = self.states(2)
        for _ in self.advance(states):
            pass
        return self._by_pair(np.maximum(self._last_row(states), 0))

    def _by_pair(self, costs):
        """(n_bases, n_moving, n_ends), from (n_ends, pairs)."""
        return costs.reshape(len(costs), -1, self.n_bases).transpose(2, 1, 0)

    def _last_row(self, states):
        """``S(P - 1, d)`` of the disparities at which a path may end: (n_ends, pairs)."""
        ends = self.trellis.ends_at + self.centre
        cells = states[(self.n_frames - 1) % len(states)].reshape(-1, self.pairs)
        return cells[ends[0] : ends[-1] + 1]

    def _best_ends(self, last_row):
        """Where the best paths end, (pairs,); of equal ends the nearest to the middle."""
        ends = self.trellis.ends_at
        if len(ends) == 1:
            return np.repeat(ends, self.pairs)
        nearest = np.argsort(np.abs(ends), kind="stable")
        costs = last_row[nearest]
        costs += self.handicaps[1] * np.arange(len(nearest))[:, np.newaxis]
        return ends[nearest[costs.argmin(axis=0)]]

    # -- forward: the recurrence, Eq. 16 --------------------------------------

    def advance(self, states, first=0, last=None):
        """Compute the rows ``S(p, .)`` from ``first`` on, before ``last``, in a ring of rows.

        Yields every p when its row is there. If ``first`` is not 0 its row must be there already.
        """
        last = self.n_frames if last is None else last
        # Blocks round differently: who is still running does not know them yet.
        alone = self.n_bases == 1 and not self.trellis.running
        costs = self.costs_of_blocks if alone else self.costs_of_samples
        lows, highs = self.trellis.windows(self.n_frames)
        for p, local in costs(first, last, lows, highs):
            if p == 0 or p > first:
                self.take_row(states, p, local, lows[p], highs[p])
            yield p

    def take_row(self, states, p, local, low, high):
        """``S(p, .)`` of the row before it and the costs of its window, one flat array a group.

        Cells that no path reaches stay infinite: the windows first only grow, over
        cells never written, then only shrink, reading inside the row before.
        """
        pairs, keep = self.pairs, len(states)
        start, stop = (self.centre + low) * pairs, (self.centre + high + 1) * pairs
        new, old = states[p % keep, start:stop], states[(p - 1) % keep]
        if p == 0:
            unit = self.trellis.unit_group
            np.subtract(local[unit], self.trellis.groups[unit].penalty, out=new)
        else:
            first, *rest = self._levels
            room, level = self._rooms
            best = _best_step(old, start, stop, first, new, level)
            np.add(best, local[0], out=new)
            for i, levels in enumerate(rest, 1):
                trial = room[: stop - start]
                best = _best_step(old, start, stop, levels, trial, level)
                np.minimum(new, np.add(best, local[i], out=trial), out=new)
        if self.coupling is not None:
            new += self.coupled(p, low, high)

    @functools.cached_property
    def _levels(self):
        return [_plan(group, self.pairs, self.dtype) for group in self.trellis.groups]

    @functools.cached_property
    def _rooms(self):
        return np.empty((2, (2 * self.trellis.width + 1) * self.pairs), dtype=self.dtype)

    def costs_of_samples(self, first, last, lows, highs):
        """Yield ``p`` and the costs of its window, one flat array a group: a product a sample."""
        for p in range(first, last):
            yield p, self.costs_of_sample(p, self.left[p], lows[p], highs[p])

    def costs_of_sample(self, p, left, low, high):
        """The same of one sample, of its left factor (n_groups, n_features + 2, n_bases)."""
        at = self.trellis.lead + p * self.trellis.stride
        factor = self.right[at + low : at + high + 1].reshape(-1, self.right.shape[2])
        costs = self._room_of_costs[: len(left) * len(factor) * self.n_bases]
        costs = costs.reshape(len(left), -1)
        np.matmul(factor, left, out=costs.reshape(len(left), -1, self.n_bases))
        return costs

    @functools.cached_property
    def _room_of_costs(self):
        widest = (2 * self.trellis.width + 1) * self.pairs
        return np.empty(len(self.trellis.groups) * widest, dtype=self.dtype)

    def costs_of_blocks(self, first, last, lows, highs):
        """The same for a single base: a product a block of samples."""
        sub, n_groups = self.trellis.table.subframes, len(self.trellis.groups)
        n_factors = self.right.shape[2]
        for start in range(first, last, PRODUCT_ROWS):
            # Whole blocks even if their end is not asked for: equal products, equal bits.
            stop = min(start + PRODUCT_ROWS, self.n_frames)
            # The ends of the windows never move back.
            lowest = start * sub + lows[start]
            highest = (stop - 1) * sub + highs[stop - 1]
            lead = self.trellis.lead
            factor = self.right[lead + lowest : lead + highest + 1].reshape(-1, n_factors)
            left = self.left[start:stop].reshape(-1, n_factors)
            costs = np.matmul(left, factor.T).reshape(stop - start, n_groups, -1)
            for p, rows in zip(range(start, min(stop, last)), costs, strict=False):
                at = p * sub - lowest
                low, high = at + lows[p], at + highs[p] + 1
                yield p, rows[:, low * self.pairs : high * self.pairs]

    # -- backward: the path, Eq. 17 -------------------------------------------

    def paths(self, max_bytes, ends=None):
        """Disparities of the best paths, (n_bases, n_moving, P), and the costs (n_bases, n_moving).

        Given ``ends``, those of the best paths to each of them: (n_bases, n_moving, n_ends, P), and
        (n_bases, n_moving, n_ends).

        If not all rows may be kept, every ``length``-th is, and the rows between two of them
        are computed again, from the last to the first.
        """
        n_frames, length = self.n_frames, self.n_frames
        if self.row_cells * n_frames * self.dtype.itemsize > max_bytes:
            length = PRODUCT_ROWS * math.ceil(math.sqrt(n_frames) / PRODUCT_ROWS)
        states = self.states(n_frames if length >= n_frames else 2)
        kept = {}
        for p in self.advance(states):
            if length < n_frames and p % length == 0:
                kept[p] = states[p % 2].copy()
        last_row = self._last_row(states)
        there = self._best_ends(last_row) if ends is None else np.asarray(ends)[:, np.newaxis]
        lines = np.broadcast_to(there, (1 if ends is None else len(ends), self.pairs))
        costs = np.take_along_axis(last_row, lines - self.trellis.ends_at[0], axis=0)
        costs = self._by_pair(np.maximum(costs, 0))
        here = (there + self.centre) * self.pairs + np.arange(self.pairs)
        at = np.empty((n_frames, here.size), dtype=np.intp)
        at[-1] = here.ravel()
        for first in range(0, n_frames, length)[::-1]:
            last = min(first + length, n_frames)
            if kept:
                states = self.states(length)
                states[first % length] = kept.pop(first)
                for _ in self.advance(states, first, last):
                    pass
            self._retrace(states, at, first, last)
        found = self.disparities(at // self.pairs - self.centre)
        if ends is None:
            return found, costs[:, :, 0]
        return found.reshape(self.n_bases, len(ends), -1, n_frames).swapaxes(1, 2), costs

    def _retrace(self, states, at, first, last):
        """Follow the paths back from row ``last`` to ``first``: the step that won each time."""
        trellis, pairs = self.trellis, self.pairs
        several = len(trellis.groups) > 1
        shift = trellis.slopes * pairs
        back = shift[:, np.newaxis]
        penalties, weight, inner = trellis.of_step.astype(states.dtype)[:, :, np.newaxis]
        charges = np.tile(penalties + self.handicaps, at.shape[1] // pairs)
        n_moving, n_factors = self.right.shape[1:]
        positions = self.right.reshape(-1, n_factors)
        start = min(last, self.n_frames - 1)
        here = at[start]
        for p in range(start, first, -1):
            value = states[(p - 1) % len(states)].take(here - back)
            value += charges
            if several:
                q = trellis.lead + p * trellis.stride - self.centre
                y = positions.take(here // self.n_bases + q * n_moving, axis=0)
                value += weight * y[:, -2]
                y = y.reshape(-1, self.n_bases, n_factors)[..., :-2]
                products = np.einsum("mnk,nk->mn", y, self.bases.sequences[:, p])
                value -= inner * products.ravel()
            here = here - shift.take(value.argmin(axis=0))
            at[p - 1] = here

    def disparities(self, at):
        """(n_bases, n_moving, P), pair by pair, from (P, pairs)."""
        return at.T.reshape(-1, self.n_bases, self.n_frames).swapaxes(0, 1)


class _Group(NamedTuple):
    """Steps whose local cost is the same; what their penalties have in common belongs to it."""

    moving: float
    inner: float
    penalty: float
    levels: list


def group_steps(table, mu, slopes):
    """Groups of steps of equal weights, and the group of every step."""
    weights = list(zip(table.moving.tolist(), table.inner.tolist(), strict=True))
    unique = sorted(set(weights))
    group_of_step = np.array([unique.index(pair) for pair in weights])
    groups = []
    for i, (moving, inner) in enumerate(unique):
        mine = group_of_step == i
        penalties = mu * table.penalty[mine]
        least = penalties.min()
        levels = [
            (value - float(least), slopes[mine][penalties == value].tolist())
            for value in sorted(set(penalties.tolist()), reverse=True)
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


# -- the two factors whose product is the local costs (Eq. 12), as rows of the trellis take them


class Bases:
    """Base sequences, and what is known of them before anything is matched to them.

    Parameters
    ----------
    trellis : Trellis
    sequences : ndarray, shape (n_bases, P, n_features)
    """

    def __init__(self, trellis, sequences):
        self.trellis, self.sequences = trellis, sequences

    def __len__(self):
        return len(self.sequences)

    def __getstate__(self):
        # What can be computed again is neither sent away nor saved.
        return {"trellis": self.trellis, "sequences": self.sequences}

    def part(self, rows):
        """Some of them, by a slice."""
        if rows == slice(0, len(self)):
            return self
        return Bases(self.trellis, self.sequences[rows])

    @functools.cached_property
    def energy(self):
        """``sum_p |x_n(p)|^2``: (n_bases,)."""
        return np.einsum("npk,npk->n", self.sequences, self.sequences)

    def by_group(self):
        """The left factor of every group of steps. Long takes make it large: it is not kept."""
        return _left_factor(self.sequences, *self.trellis.of_group)

    @functools.cached_property
    def by_step(self):
        """The left factor of every step, steps in order, for narrow bundles; kept for the next."""
        penalty, moving, inner = self.trellis.of_step[:, self.trellis.entry_of_step]
        return _left_factor(self.sequences, moving, inner, penalty)


def right_factor(moving):
    """(Q, n_moving, n_features + 2): x_m(q), |x_m(q)|^2 and 1."""
    n_moving, n_positions, n_features = moving.shape
    right = np.empty((n_positions, n_moving, n_features + 2), dtype=moving.dtype)
    right[..., :-2] = moving.transpose(1, 0, 2)
    right[..., -2] = np.einsum("mqk,mqk->mq", moving, moving).T
    right[..., -1] = 1
    return right


def _left_factor(bases, moving, inner, penalty):
    """(P, n_groups, n_features + 2, n_bases): times the right factor, the local costs.

    Given the weights of |x_m|^2 and of the inner product, and the penalty, of every group.
    """
    n_bases, n_frames, n_features = bases.shape
    shape = n_frames, len(moving), n_features + 2, n_bases
    left = np.empty(shape, dtype=bases.dtype)
    frames, energy = bases.transpose(1, 2, 0), np.einsum("npk,npk->pn", bases, bases)
    moving, inner, penalty = np.asarray([moving, inner, penalty], dtype=bases.dtype)
    np.multiply(frames[:, np.newaxis], -inner[:, np.newaxis, np.newaxis], out=left[:, :, :-2])
    left[:, :, -2] = moving[:, np.newaxis]
    np.add(energy[:, np.newaxis], penalty[:, np.newaxis], out=left[:, :, -1])
    return left
