"""Tiles of pairs: the rows of the trellis, and the paths through it (Eqs. 16 and 17).

Rows are flat, the disparity first and the pair last: the predecessors of all cells by one step are
one contiguous slice. Local costs (Eq. 12) are matrix products of a left factor (the bases) and a
right factor (the moving sequences), one for each group of steps of equal weights.
"""

import functools
import math

import numpy as np
from numpy.lib.stride_tricks import as_strided

# Samples of a single base that share one product.
PRODUCT_ROWS = 16
# Costs of paths that differ by less than this share of all energy are ties. Rounding to
# double precision moves them by a thousandth of it; in single precision there is no room between
# rounding and data, so that rounding decides.
TIE = {np.dtype(np.float64): 2.0**-40, np.dtype(np.float32): 0.0}
# Bytes, for each group of steps, of all step costs of a tile that is small: of one base
# and of several, whose rows take longer. Measured with one group of three steps and five of one, on
# 68 and 100 frames: level at 1.2 MB for one base, 4 for several.
SMALL_BYTES = 1_300_000, 3_000_000
# Up to so many bytes the rows of a tile are kept for the back-tracking: malloc reuses such arrays.
# Beyond, in double precision, one byte a cell is, for the step that reached it.
ROW_BYTES = 32_000_000


def tile_paths(bases, moving, coupling, max_bytes):
    """Disparities of the best paths of a tile, (n_bases, n_moving, P), and their costs.

    Parameters
    ----------
    bases : Bases
    moving : ndarray, shape (n_moving, Q, n_columns)
    coupling : Coupling or None
    max_bytes : int
        Above this the rows are not all kept but computed twice.
    """
    tile = Tile(bases, right_factor(moving, bases.trellis), coupling)
    return tile.small_paths() if tile.is_small else tile.paths(max_bytes)


class Bases:
    """Base sequences, and the arrays that depend on them alone.

    Parameters
    ----------
    trellis : Trellis
    sequences : ndarray, shape (n_bases, P, n_features)
    """

    def __init__(self, trellis, sequences):
        self.trellis, self.sequences = trellis, sequences

    def __getstate__(self):
        # Cached arrays are neither sent to other processes nor saved.
        return {"trellis": self.trellis, "sequences": self.sequences}

    @functools.cached_property
    def energy(self):
        """``sum_p |x_n(p)|^2``: (n_bases,)."""
        features = self.features
        return np.einsum("npk,npk->n", features, features)

    @property
    def features(self):
        """The sequences without columns of weights and key-frames."""
        return self.sequences[..., self.trellis.plain]

    def by_group(self):
        """The left factor of every group of steps. It is large for long takes: not cached."""
        return self._left_factor(*self.trellis.of_group)

    @functools.cached_property
    def by_step(self):
        """The left factor of every step, in order of steps, for small tiles.

        (P, n_steps * n_bases, n_features + 2): one product a sample.
        """
        penalty, moving, inner = self.trellis.of_step[:, self.trellis.entry_of_step]
        left = self._left_factor(moving, inner, penalty).swapaxes(2, 3)
        return np.ascontiguousarray(left).reshape(len(left), -1, left.shape[3])

    def _left_factor(self, moving, inner, penalty):
        """(P, n_groups, n_columns + 2, n_bases): times the right factor, the local costs.

        Given the weights of |x_m|^2 and of the inner product, and the penalty, of every group.
        """
        n_bases, n_frames, n_columns = self.sequences.shape
        features, anchors = self.features, self.trellis.anchors
        n_features = features.shape[2]
        left = np.empty((n_frames, len(moving), n_columns + 2, n_bases), dtype=features.dtype)
        energy = np.einsum("npk,npk->pn", features, features)
        moving, inner, penalty = np.asarray([moving, inner, penalty], dtype=left.dtype)
        frames = features.transpose(1, 2, 0)[:, np.newaxis]
        np.multiply(frames, -inner[:, np.newaxis, np.newaxis], out=left[:, :, :n_features])
        if anchors is not None:
            shares = anchors.left(self.sequences).transpose(1, 2, 0)
            left[:, :, -2 - shares.shape[1] : -2] = shares[:, np.newaxis]
        left[:, :, -2] = moving[:, np.newaxis]
        unseen, column = self.trellis.unseen, self.trellis.weight_column
        if column is None:
            np.add(energy[:, np.newaxis], penalty[:, np.newaxis], out=left[:, :, -1])
            return left
        weights = self.sequences[..., column].T[:, np.newaxis]
        left[:, :, :n_features] *= weights[:, :, np.newaxis]
        left[:, :, n_features] = weights * (energy[:, np.newaxis] - unseen)
        left[:, :, -2] *= weights
        left[:, :, -1] = penalty[:, np.newaxis] + left.dtype.type(unseen)
        return left


def right_factor(moving, trellis):
    """(Q, n_moving, n_columns + 2): x_m(q), weight, costs of anchors, |x_m(q)|^2 and 1.

    With weights the first and the last but one are multiplied by them.
    """
    n_moving, n_positions, n_columns = moving.shape
    features, column, anchors = moving[..., trellis.plain], trellis.weight_column, trellis.anchors
    n_features = features.shape[2]
    right = np.empty((n_positions, n_moving, n_columns + 2), dtype=moving.dtype)
    right[..., :n_features] = features.transpose(1, 0, 2)
    if anchors is not None:
        costs = anchors.right(moving).transpose(1, 0, 2)
        right[..., -2 - costs.shape[2] : -2] = costs
    right[..., -2] = np.einsum("mqk,mqk->mq", features, features).T
    if column is not None:
        weights = moving[..., column].T
        right[..., n_features] = 1
        right[..., : n_features + 1] *= weights[:, :, np.newaxis]
        right[..., -2] *= weights
    right[..., -1] = 1
    return right


# -- the rows of one tile: the inner loop of the matching ------------------------------------------


class Tile:
    """The pairs of one tile, whose rows are computed together.

    A row holds the disparities of all pairs, flat: (2 * (width + pad) + 1, n_moving,
    n_bases), with ``pad`` cells at both sides for the steps that leave the band.

    Parameters
    ----------
    bases : Bases
    right : ndarray
        The right factor of the moving sequences.
    coupling : Coupling, default=None
    """

    def __init__(self, bases, right, coupling=None):
        self.trellis, self.bases, self.right = bases.trellis, bases, right
        self.coupling = coupling
        self.n_bases, self.n_frames = bases.sequences.shape[:2]
        self.dtype = bases.sequences.dtype
        self.pairs = right.shape[1] * self.n_bases

    @functools.cached_property
    def left(self):
        """The left factor of the bases."""
        return self.bases.by_group()

    @functools.cached_property
    def tie_breakers(self):
        """Extra costs of steps in the back-tracking: (n_steps, n_pairs).

        They increase along the step table, so that the first of equal steps wins. Two tiles that
        hold the same pair round differently, but both far less than this.
        """
        energy = self.right[..., -2].sum(axis=0)[:, np.newaxis] + self.bases.energy
        rank = np.arange(len(self.trellis.slopes), dtype=self.dtype)[:, np.newaxis]
        return TIE[self.dtype] * rank * energy.ravel()

    def states(self, n_rows):
        """Rows of cells that no path has reached."""
        n_cells = (2 * self.trellis.centre + 1) * self.pairs
        return np.full((n_rows, n_cells), np.inf, dtype=self.dtype)

    def ends(self):
        """Costs of the best paths to every end: (n_bases, n_moving, n_ends).

        The ends are disparities, rising: 0 alone if they are pinned.
        """
        states = self.states(2)
        for _ in self.advance(states):
            pass
        costs = np.maximum(self._last_row(states), 0)
        return costs.reshape(len(costs), -1, self.n_bases).transpose(2, 1, 0)

    def _last_row(self, states):
        """``S(P - 1, d)`` of the disparities at which a path may end: (n_ends, pairs)."""
        ends = self.trellis.ends_at + self.trellis.centre
        cells = states[(self.n_frames - 1) % len(states)].reshape(-1, self.pairs)
        return cells[ends[0] : ends[-1] + 1]

    def _coupling_costs(self, p, low, high):
        """Penalties of the coupling in a row, for the disparities from low to high, flat."""
        offsets = np.arange(low, high + 1)[:, np.newaxis] / self.trellis.table.subframes
        penalties = self.coupling.weight * np.square(offsets - self._coupled_to[p])
        return penalties.astype(self.dtype).ravel()

    @functools.cached_property
    def _coupled_to(self):
        """The offsets of the coupling, sample by sample: (P, pairs)."""
        return self.coupling.offsets.transpose(2, 1, 0).reshape(self.n_frames, -1)

    # -- forward: the recurrence, Eq. 16 --------------------------------------

    def advance(self, states, first=0, last=None, choices=None):
        """Compute the rows ``S(p, .)`` from ``first`` on, before ``last``, in a ring of rows.

        Yields every p when its row is there. If ``first`` is not 0 its row must be there already.
        A ring of rows ``choices`` gets the step by which each cell was reached, as its index in
        the step table.
        """
        last = self.n_frames if last is None else last
        # Products of blocks are rounded differently: a running base must not use them.
        in_blocks = self.n_bases == 1 and not self.trellis.running
        costs = self._costs_of_blocks if in_blocks else self.costs_of_samples
        lows, highs = self.trellis.windows(self.n_frames)
        for p, local in costs(first, last, lows, highs):
            if p == 0 or p > first:
                chosen = None if choices is None else choices[p % len(choices)]
                self.take_row(states, p, local, lows[p], highs[p], chosen)
            yield p

    def take_row(self, states, p, local, low, high, chosen=None):
        """``S(p, .)`` of the row before it and the costs of its window, one flat array a group.

        Cells that no path reaches stay infinite: the windows first only grow, over
        cells never written, then only shrink, reading inside the row before.
        """
        pairs, n_rows, centre = self.pairs, len(states), self.trellis.centre
        start, stop = (centre + low) * pairs, (centre + high + 1) * pairs
        new, old = states[p % n_rows, start:stop], states[(p - 1) % n_rows]
        if p == 0:
            unit = self.trellis.unit_group
            np.subtract(local[unit], self.trellis.groups[unit].penalty, out=new)
        elif chosen is not None:
            self._choose(old, start, stop, local, new, chosen[start:stop])
        else:
            first, *rest = self._levels
            total, level = self._buffers[:, : stop - start]
            best = _best_step(old, start, stop, first, new, level)
            np.add(best, local[0], out=new)
            for i, levels in enumerate(rest, 1):
                best = _best_step(old, start, stop, levels, total, level)
                np.minimum(new, np.add(best, local[i], out=total), out=new)
        if self.coupling is not None:
            new += self._coupling_costs(p, low, high)

    def _choose(self, old, start, stop, local, new, chosen):
        """The same row step by step, and the step that the back-tracking would take."""
        margin, better, index = (x[: stop - start] for x in self._choosing)
        total, least = self._buffers[:, : stop - start]
        chosen.fill(0)
        for i, (shift, penalty, group) in enumerate(self._steps):
            view = old[start - shift : stop - shift]
            if penalty is not None:
                view = np.add(view, penalty, out=total)
            if i == 0:
                np.add(view, local[group], out=new)
                continue
            np.add(view, local[group], out=total)
            # The least so far, with the difference of the tie-breakers taken off.
            so_far = new if i == 1 else np.minimum(least, new, out=least)
            np.less(total, np.subtract(so_far, margin, out=least), out=better)
            np.multiply(better.view(np.uint8), index.dtype.type(i), out=index)
            np.maximum(chosen, index, out=chosen)
            np.minimum(new, total, out=new)

    @functools.cached_property
    def _steps(self):
        """Of every step: its shift in flat rows, its penalty beyond that of its group, if it has
        one, and its group."""
        trellis = self.trellis
        beyond = trellis.of_step[0] - trellis.of_group[2, trellis.group_of_step]
        penalties = [np.array(x, self.dtype) if x else None for x in beyond.tolist()]
        return list(zip(trellis.slopes * self.pairs, penalties, trellis.group_of_step, strict=True))

    @functools.cached_property
    def _choosing(self):
        """Rows: by how much a later step must be better, whether it is, and its index."""
        n_cells = 2 * self.trellis.width + 1
        margin = np.tile(self.tie_breakers[1], n_cells)
        index = np.empty(margin.shape, np.min_scalar_type(len(self.trellis.slopes)))
        return margin, np.empty(margin.shape, bool), index

    @functools.cached_property
    def _levels(self):
        """Levels of all groups for flat rows; penalties as arrays spare NumPy a conversion."""
        return [
            [
                (
                    np.array(penalty, self.dtype) if penalty else None,
                    [k * self.pairs for k in slopes],
                )
                for penalty, slopes in group.levels
            ]
            for group in self.trellis.groups
        ]

    @functools.cached_property
    def _buffers(self):
        return np.empty((2, (2 * self.trellis.width + 1) * self.pairs), dtype=self.dtype)

    @functools.cached_property
    def _cost_buffer(self):
        n_cells = (2 * self.trellis.width + 1) * self.pairs
        return np.empty(len(self.trellis.groups) * n_cells, dtype=self.dtype)

    def costs_of_samples(self, first, last, lows, highs):
        """Yield ``p`` and the costs of its window, one flat array a group: a product a sample."""
        for p in range(first, last):
            yield p, self.costs_of_sample(p, self.left[p], lows[p], highs[p])

    def costs_of_sample(self, p, left, low, high):
        """Costs of one sample, given its left factor (n_groups, n_features + 2, n_bases)."""
        at = self.trellis.lead + p * self.trellis.stride
        factor = self.right[at + low : at + high + 1].reshape(-1, self.right.shape[2])
        costs = self._cost_buffer[: len(left) * len(factor) * self.n_bases]
        costs = costs.reshape(len(left), -1)
        np.matmul(factor, left, out=costs.reshape(len(left), -1, self.n_bases))
        return costs

    def _costs_of_blocks(self, first, last, lows, highs):
        """The same for a single base: a product a block of samples."""
        sub, n_groups = self.trellis.table.subframes, len(self.trellis.groups)
        n_factors, lead = self.right.shape[2], self.trellis.lead
        for start in range(first, last, PRODUCT_ROWS):
            # Whole blocks even beyond the last sample: equal products, equal bits.
            stop = min(start + PRODUCT_ROWS, self.n_frames)
            # The ends of the windows never move back.
            lowest = start * sub + lows[start]
            highest = (stop - 1) * sub + highs[stop - 1]
            factor = self.right[lead + lowest : lead + highest + 1].reshape(-1, n_factors)
            left = self.left[start:stop].reshape(-1, n_factors)
            costs = np.matmul(left, factor.T).reshape(stop - start, n_groups, -1)
            for p, rows in zip(range(start, min(stop, last)), costs, strict=False):
                at = p * sub - lowest
                low, high = at + lows[p], at + highs[p] + 1
                yield p, rows[:, low * self.pairs : high * self.pairs]

    # -- backward: the path, Eq. 17 -------------------------------------------

    def paths(self, max_bytes):
        """Disparities of the best paths, (n_bases, n_moving, P), and their costs.

        All rows are kept, or all choices. If not all of them may be, every ``length``-th row is,
        and those between two of them are computed again, from the last to the first.
        """
        trellis, pairs = self.trellis, self.pairs
        n_frames, length = self.n_frames, self.n_frames
        n_cells, kept = (2 * trellis.centre + 1) * pairs, self.dtype
        if n_cells * n_frames * kept.itemsize > ROW_BYTES and TIE[self.dtype]:
            kept = self._choosing[2].dtype
        if n_cells * n_frames * kept.itemsize > max_bytes:
            length = PRODUCT_ROWS * math.ceil(math.sqrt(n_frames) / PRODUCT_ROWS)
        choices = None if kept == self.dtype else np.empty((min(length, n_frames), n_cells), kept)
        states = self.states(n_frames if length >= n_frames and choices is None else 2)
        checkpoints = {}
        for p in self.advance(states, choices=choices if length >= n_frames else None):
            if length < n_frames and p % length == 0:
                checkpoints[p] = states[p % 2].copy()
        last_row = self._last_row(states)
        ends = np.zeros(pairs, dtype=np.intp)
        if len(trellis.ends_at) > 1:
            # Of equal ends the nearest to the middle.
            nearest = np.argsort(np.abs(trellis.ends_at), kind="stable")
            costs = last_row[nearest]
            costs += self.tie_breakers[1] * np.arange(len(nearest))[:, np.newaxis]
            ends = trellis.ends_at[nearest[costs.argmin(axis=0)]]
        costs = last_row[ends - trellis.ends_at[0], np.arange(pairs)]
        at = np.empty((n_frames, pairs), dtype=np.intp)
        at[-1] = (ends + trellis.centre) * pairs + np.arange(pairs)
        for first in range(0, n_frames, length)[::-1]:
            last = min(first + length, n_frames)
            if checkpoints:
                states = self.states(length if choices is None else 2)
                states[first % len(states)] = checkpoints.pop(first)
                # A choice stands in the row that it leads to.
                end = last if choices is None else min(last + 1, n_frames)
                for _ in self.advance(states, first, end, choices):
                    pass
            if choices is None:
                self._backtrack(states, at, first, last)
            else:
                self._follow(choices, at, first, last)
        disparities = self._by_pair(at // pairs - trellis.centre)
        return disparities, np.maximum(costs, 0).reshape(-1, self.n_bases).T

    def _backtrack(self, states, at, first, last):
        """Follow the paths back from row ``last`` to ``first`` by their best steps."""
        trellis, pairs = self.trellis, self.pairs
        shift = trellis.slopes * pairs
        back = shift[:, np.newaxis]
        penalties, weight, inner = trellis.of_step.astype(states.dtype)[:, :, np.newaxis]
        charges = penalties + self.tie_breakers
        n_moving, n_factors = self.right.shape[1:]
        positions, features = self.right.reshape(-1, n_factors), self.bases.features
        weights = None
        if trellis.weight_column is not None:
            weights = self.bases.sequences[..., trellis.weight_column]
            features = features * weights[:, :, np.newaxis]
            weights = np.tile(weights.T, n_moving)
        start = min(last, self.n_frames - 1)
        here = at[start]
        for p in range(start, first, -1):
            value = states[(p - 1) % len(states)].take(here - back)
            value += charges
            if len(trellis.groups) > 1:
                q = trellis.lead + p * trellis.stride - trellis.centre
                y = positions.take(here // self.n_bases + q * n_moving, axis=0)
                energy = y[:, -2] if weights is None else weights[p] * y[:, -2]
                value += weight * energy
                y = y.reshape(-1, self.n_bases, n_factors)[..., : features.shape[2]]
                products = np.einsum("mnk,nk->mn", y, features[:, p])
                value -= inner * products.ravel()
            here = here - shift.take(value.argmin(axis=0))
            at[p - 1] = here

    def _follow(self, choices, at, first, last):
        """The same by the choices."""
        shift = self.trellis.slopes * self.pairs
        for p in range(min(last, self.n_frames - 1), first, -1):
            steps = choices[p % len(choices)].take(at[p])
            np.subtract(at[p], shift.take(steps), out=at[p - 1])

    def _by_pair(self, at):
        """(n_bases, n_moving, P), from (P, pairs)."""
        return at.T.reshape(-1, self.n_bases, self.n_frames).swapaxes(0, 1)

    # -- both, for so few pairs that NumPy's calls cost more than its arithmetic ---------------

    @property
    def is_small(self):
        """Whether the costs of all steps to all cells may be stored."""
        trellis, n_steps = self.trellis, len(self.trellis.slopes)
        if trellis.free or trellis.running or n_steps != trellis.table.steps.max() + 1:
            return False
        n_cells = self.n_frames * (2 * trellis.width + 1) * self.pairs
        room = SMALL_BYTES[self.n_bases > 1] * len(trellis.groups)
        return n_cells * n_steps * self.dtype.itemsize <= room

    def small_paths(self):
        """The same as `paths`, for a small tile: every row by all of its steps at once."""
        trellis, right, n_bases = self.trellis, self.right, self.n_bases
        sub, width, n_frames = trellis.table.subframes, trellis.width, self.n_frames
        n_moving, n_cells = right.shape[1], (2 * width + 1) * right.shape[1]
        # Local costs, with the penalty, of every step to every cell, base by base: (P, n_steps,
        # n_bases, cells).
        padded = np.zeros((len(right) + 2 * width, *right.shape[1:]), self.dtype)
        padded[width : width + len(right)] = right
        stride, *strides = padded.strides
        windows = as_strided(
            padded,
            shape=(n_frames, right.shape[2], n_cells),
            strides=(sub * stride, *strides[::-1]),
            writeable=False,
        )
        costs = np.matmul(self.bases.by_step, windows).reshape(n_frames, -1, n_bases, n_cells)
        # The first sample is reached by no step, so it pays no penalty.
        costs[0] -= trellis.of_step[0, trellis.entry_of_step, np.newaxis, np.newaxis]
        if self.coupling is not None:
            for p, row in enumerate(costs):
                extra = self._coupling_costs(p, -width, width)
                row += extra.reshape(n_cells, n_bases).T
        edge = trellis.pad * n_moving
        states = np.full((n_frames, n_bases, n_cells + 2 * edge), np.inf, dtype=self.dtype)
        # S(p - 1, d - k) of every cell, step by step.
        before = as_strided(
            states[..., edge + sub * n_moving :],
            shape=costs.shape,
            strides=(states.strides[0], -n_moving * states.itemsize, *states.strides[1:]),
            writeable=False,
        )
        rows = states[..., edge : edge + n_cells]
        middle = slice(width * n_moving, (width + 1) * n_moving)
        rows[0, :, middle] = costs[0, sub, :, middle]
        add, smallest = np.add, np.minimum.reduce
        for own, last, row in zip(costs[1:], before[:-1], rows[1:], strict=True):
            smallest(add(own, last, own), 0, None, row)
        lengths = np.maximum(rows[-1, :, middle], 0)
        # For a single pair Python is faster than NumPy.
        walk = _backtrack_each if self.pairs == 1 else _backtrack_all
        here = n_cells * np.arange(n_bases)[:, np.newaxis] + np.arange(middle.start, middle.stop)
        ties = self.tie_breakers.reshape(-1, n_moving, n_bases).swapaxes(1, 2)
        totals = costs.reshape(n_frames, len(trellis.slopes), -1)
        shift = trellis.slopes * n_moving
        at = walk(totals, here.ravel(), trellis.table.steps, shift, ties.reshape(len(shift), -1))
        disparities = at % n_cells // n_moving - width
        return disparities.T.reshape(n_bases, n_moving, n_frames), lengths


def _best_step(old, start, stop, levels, out, scratch):
    """``min_s S(p-1, d - k_s) + mu phi_s`` over the steps of one group.

    ``levels`` come by falling penalty, less their smallest. The result is in ``out``, or in
    ``old`` itself where there is nothing to compute.
    """
    best = None
    for penalty, (shift, *others) in levels:
        view = old[start - shift : stop - shift]
        target = out if best is None else scratch
        for other in others:
            view = np.minimum(view, old[start - other : stop - other], out=target)
        if penalty is not None:
            view = np.add(view, penalty, out=target)
        best = view if best is None else np.minimum(best, view, out=out)
    return best


def _backtrack_each(totals, last_cells, steps, shift, tie_breakers):
    """Cells of the best paths, (P, pairs), pair by pair; totals are (P, n_steps, cells)."""
    at = np.empty((len(totals), len(last_cells)), dtype=np.intp)
    at[-1] = last_cells
    total_of, steps, shift = totals.item, steps.tolist(), shift.tolist()
    for pair, cell in enumerate(last_cells.tolist()):
        entries = list(zip(steps, shift, tie_breakers[:, pair].tolist(), strict=True))
        cells = []
        for p in range(len(totals) - 1, 0, -1):
            best, moved = math.inf, 0
            for step, move, extra in entries:
                total = total_of(p, step, cell) + extra
                if total < best:
                    best, moved = total, move
            cell -= moved
            cells.append(cell)
        at[:-1, pair] = cells[::-1]
    return at


def _backtrack_all(totals, last_cells, steps, shift, tie_breakers):
    """The same for all pairs at once."""
    n_frames, _, n_cells = totals.shape
    # The cell of every entry of the step table; that of the first tells where the path is.
    cells = np.empty((n_frames, len(steps), len(last_cells)), dtype=np.intp)
    cells[-1] = last_cells + (steps * n_cells)[:, np.newaxis]
    rows, value = totals.reshape(n_frames, -1), np.empty(cells.shape[1:], totals.dtype)
    add, subtract = np.add, np.subtract
    for row, here, before in zip(rows[:0:-1], cells[:0:-1], cells[-2::-1], strict=True):
        # Indices are valid; mode="clip" only spares NumPy a copy of the result.
        row.take(here, out=value, mode="clip")
        add(value, tie_breakers, value)
        subtract(here, shift.take(value.argmin(axis=0)), before)
    return cells[:, 0] - steps[0] * n_cells
