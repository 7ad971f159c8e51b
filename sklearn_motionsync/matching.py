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

from typing import NamedTuple

import numpy as np

__all__ = ["Match", "StepTable", "Trellis", "step_table"]

# Sizes of one tile of pairs: what a row needs stays in the second-level cache, and
# a matrix product has enough rows to be worth calling. Constants, so that no
# result can depend on the number of workers or on the memory of the machine.
_TILE_BYTES = 1 << 20
_TILE_SEQUENCES = 64
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
        self._groups, self._group_of_step = _group_steps(table, mu)
        self._penalties = mu * table.penalty
        self._slopes = table.steps - table.subframes
        self._pad = int(np.abs(self._slopes).max())
        self._unit_group = self._group_of_step[self._slopes == 0][0]

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
        n_frames = bases.shape[1]
        out = np.empty((len(bases), len(moving)), dtype=bases.dtype)
        for columns in _tiles(len(moving), _TILE_SEQUENCES):
            right = _right_factor(moving[columns])
            size = _TILE_BYTES // (8 * right.shape[1] * (2 * self.width + 1))
            for rows in _tiles(len(bases), max(1, size)):
                states = self._forward(bases[rows], right, keep=2)
                best = states[(n_frames - 1) % 2, self.width + self._pad]
                out[rows, columns] = best.reshape(right.shape[1], -1).T
        return np.maximum(out, 0, out=out)

    def paths(self, base, moving):
        """Best paths of many sequences to one base.

        Parameters
        ----------
        base : ndarray, shape (P, n_features)
        moving : ndarray, shape (n_moving, Q, n_features)

        Returns
        -------
        distances : ndarray, shape (n_moving,)
        disparities : ndarray of int, shape (n_moving, P)
            ``d(p)`` in sub-positions; ``d(0) = d(P-1) = 0``.
        """
        n_frames = len(base)
        distances = np.empty(len(moving), dtype=base.dtype)
        disparities = np.empty((len(moving), n_frames), dtype=np.intp)
        for columns in _tiles(len(moving), _TILE_SEQUENCES):
            right = _right_factor(moving[columns])
            states = self._forward(base[np.newaxis], right, keep=n_frames)
            distances[columns] = states[-1, self.width + self._pad]
            disparities[columns] = self._backward(states, base, right)
        return np.maximum(distances, 0, out=distances), disparities

    # -- forward: the recurrence, Eq. 16 --------------------------------------

    def _windows(self, n_frames):
        """Lowest and highest disparity, at every sample, of a pinned path in the band."""
        p = np.arange(n_frames)
        down, up = self.table.subframes, int(self._slopes.max())
        low = np.maximum(-self.width, np.maximum(-down * p, -up * p[::-1]))
        high = np.minimum(self.width, np.minimum(up * p, down * p[::-1]))
        return low.tolist(), high.tolist()

    def _forward(self, bases, right, keep):
        """Rows ``S(p, .)`` of the recurrence, in a ring of ``keep`` rows.

        The shape is (keep, 2 * (width + pad) + 1, n_moving * n_bases). Cells that no
        path reaches stay infinite: the windows first only grow, over cells never
        written, then only shrink, reading inside the row before.
        """
        n_bases = len(bases)
        centre, pairs = self.width + self._pad, right.shape[1] * n_bases
        states = np.full((keep, 2 * centre + 1, pairs), np.inf, dtype=bases.dtype)
        scratch = np.empty((2, 2 * self.width + 1, pairs), dtype=bases.dtype)
        for p, low, high, local in self._local_costs(bases, right):
            start, length = centre + low, high - low + 1
            new = states[p % keep, start : start + length]
            if p == 0:
                new[...] = local[self._unit_group]
                continue
            old = states[(p - 1) % keep]
            trial, level = scratch[:, :length]
            for i, group in enumerate(self._groups):
                target = trial if i else new
                _best_step(old, start, group.levels, target, level)
                target += local[i]
                if i:
                    np.minimum(new, target, out=new)
        return states

    def _local_costs(self, bases, right):
        """Yield ``p, low, high, costs``; costs is (n_groups, window, n_moving * n_bases).

        They come from matrix products: many bases fill one for each sample,
        for a single base a block of samples does.
        """
        n_bases, n_frames, _ = bases.shape
        sub, n_groups, n_factors = self.table.subframes, len(self._groups), right.shape[2]
        left = self._left_factor(bases)
        lows, highs = self._windows(n_frames)
        block = 1 if n_bases > 1 else _PRODUCT_ROWS
        for start in range(0, n_frames, block):
            samples = range(start, min(start + block, n_frames))
            first = min(p * sub + lows[p] for p in samples)
            last = max(p * sub + highs[p] for p in samples)
            factor = right[first : last + 1].reshape(-1, n_factors)
            if n_bases > 1:
                costs = np.matmul(factor, left[start].transpose(0, 2, 1))
            else:
                costs = left[start : samples.stop].reshape(-1, n_factors) @ factor.T
            costs = costs.reshape(len(samples), n_groups, last - first + 1, -1)
            for p in samples:
                at = p * sub - first
                local = costs[p - start, :, at + lows[p] : at + highs[p] + 1]
                yield p, lows[p], highs[p], local

    def _left_factor(self, bases):
        """(P, n_groups, n_bases, n_factors): times the right factor, the local costs."""
        frames = bases.transpose(1, 0, 2)
        n_frames, n_bases, n_features = frames.shape
        left = np.empty((n_frames, len(self._groups), n_bases, n_features + 2), bases.dtype)
        for i, group in enumerate(self._groups):
            left[:, i, :, :-2] = -group.inner * frames
            left[:, i, :, -2] = group.moving
        left[..., -1] = np.einsum("pnk,pnk->pn", frames, frames)[:, np.newaxis]
        return left

    # -- backward: the path, Eq. 17 -------------------------------------------

    def _backward(self, states, base, right):
        """Read the paths back from the kept rows: at each sample, the step that won."""
        n_frames, _, n_moving = states.shape
        centre, sequence = self.width + self._pad, np.arange(n_moving)
        back = self._slopes[:, np.newaxis] * n_moving
        penalties = self._penalties.astype(base.dtype)[:, np.newaxis]
        left = self._left_factor(base[np.newaxis])[:, :, 0]
        at = np.empty((n_frames, n_moving), dtype=np.intp)
        at[-1] = centre * n_moving + sequence
        for p in range(n_frames - 1, 0, -1):
            value = states[p - 1].ravel().take(at[p] - back) + penalties
            if len(self._groups) > 1:
                q = p * self.table.subframes + at[p] // n_moving - centre
                value += (left[p] @ right[q, sequence].T)[self._group_of_step]
            at[p - 1] = at[p] - back[value.argmin(axis=0), 0]
        return (at // n_moving - centre).T


def _tiles(n, size):
    """Slices of at most ``size`` items that cover ``n`` of them."""
    return [slice(start, min(start + size, n)) for start in range(0, n, size)]


class _Group(NamedTuple):
    """Steps whose local cost is the same, by falling penalty."""

    moving: float
    inner: float
    levels: list


def _group_steps(table, mu):
    """Groups of steps of equal weights, and the group of every step."""
    weights = np.column_stack([table.moving, table.inner])
    unique, group_of_step = np.unique(weights, axis=0, return_inverse=True)
    group_of_step = group_of_step.ravel()
    slopes = table.steps - table.subframes
    groups = []
    for i, (moving, inner) in enumerate(unique):
        penalties = mu * table.penalty[group_of_step == i]
        levels = [
            (float(value), slopes[group_of_step == i][penalties == value].tolist())
            for value in np.unique(penalties)[::-1]
        ]
        groups.append(_Group(moving, inner, levels))
    return groups, group_of_step


def _best_step(old, start, levels, out, scratch):
    """``min_s S(p-1, d - k_s) + mu phi_s`` over the steps of one group, into ``out``.

    ``levels`` come by falling penalty, so the free steps need no addition.
    """
    length = len(out)
    for j, (penalty, slopes) in enumerate(levels):
        views = [old[start - k : start - k + length] for k in slopes]
        if j and penalty == 0:
            for view in views:
                np.minimum(out, view, out=out)
            continue
        target = scratch if j else out
        if len(views) == 1:
            np.add(views[0], penalty, out=target)
        else:
            np.minimum(views[0], views[1], out=target)
            for view in views[2:]:
                np.minimum(target, view, out=target)
            if penalty:
                target += penalty
        if j:
            np.minimum(out, target, out=out)


def _right_factor(moving):
    """(Q, n_moving, n_features + 2): x_m(q), |x_m(q)|^2 and 1."""
    frames = moving.transpose(1, 0, 2)
    right = np.empty((*frames.shape[:2], frames.shape[2] + 2), dtype=moving.dtype)
    right[..., :-2] = frames
    np.einsum("qmk,qmk->qm", frames, frames, out=right[..., -2])
    right[..., -1] = 1
    return right
