"""Modes: several ways of doing a movement in one training set, such as one stroke or two.

Distances of all pairs show them: principal coordinates of the distances (classical scaling) fall
into two heaps. A warp between modes means little, so routes of a vote stay within one.
"""

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from .consensus import choose_exemplars
from .factors import Bases
from .matcher import Warper
from .warps import evaluate_warps, even_slices

__all__ = ["DistanceTable", "ModalWarper", "Modes", "cut_in_two", "least_silhouette"]

# Fewest performances of a mode.
_FEWEST = 3
# Two modes along a principal coordinate: the variance within them is at most this share of all; the
# typical distance between them, as a share of both energies, and the smaller of their mean
# silhouettes are at least so large. Measured in docs/design.md.
_WITHIN, _BETWEEN, _SILHOUETTE = 0.1, 0.15, 0.3
# So many coordinates are looked at: a few odd performances may take the first one.
_COORDINATES = 2
# Most performances whose distances to all are kept.
_LANDMARKS = 100
# Most typical performances that stand for a mode.
_SIGNS = 3
# Fewest performances with key-frames that are enough exemplars.
_LEAST_KNOWN = 2
# Performances at a time whose modes are found.
_ROWS = 256


class Modes(NamedTuple):
    """The modes of a training set.

    Attributes
    ----------
    labels : ndarray of int, shape (n_sequences,)
        Numbered from the most frequent mode.
    typical : ndarray, shape (n_sequences,)
        Mean distance of each to its own mode, as a share of both energies; NaN with a single mode.
    """

    labels: np.ndarray
    typical: np.ndarray

    @classmethod
    def single(cls, n):
        """One mode of n performances."""
        return cls(np.zeros(n, dtype=np.intp), np.full(n, np.nan))

    @property
    def shares(self):
        """The share of each mode."""
        return np.bincount(self.labels) / len(self.labels)

    @property
    def are_several(self):
        return bool(self.labels.max(initial=0) > 0)

    def exemplars(self, typical, n_exemplars, pattern, known=None):
        """Indices of exemplars of every mode, a list of arrays.

        Parameters
        ----------
        typical : ndarray, shape (n_sequences,)
            The global distances of all: they choose the exemplars of a single mode.
        n_exemplars : int
        pattern : int or None
        known : ndarray of bool, shape (n_sequences,), default=None
            Which performances have key-frames. If a mode has some, they are its exemplars.
        """
        if not self.are_several and known is None:
            return [choose_exemplars(typical, n_exemplars, [pattern])[:, 0]]
        typical, chosen = self.typical if self.are_several else typical, []
        for mode in range(len(self.shares)):
            own = np.flatnonzero((self.labels == mode) & (np.arange(len(self.labels)) != pattern))
            if known is not None and known[own].sum() >= _LEAST_KNOWN:
                own = own[known[own]]
            chosen.append(own[choose_exemplars(typical[own], n_exemplars, [None])[:, 0]])
        return chosen

    def home(self, pattern, warpers):
        """The mode of the pattern, given its index; without one, that of the nearest exemplars."""
        if pattern is not None:
            return int(self.labels[pattern])
        lengths = [warper.to_lengths for warper in warpers]
        return int(np.argmin([x.mean() if len(x) else np.inf for x in lengths]))

    def signs(self):
        """Indices of the most typical performances, shape (n_modes, n_signs)."""
        order = np.argsort(self.typical, kind="stable")
        own = [order[self.labels[order] == mode] for mode in range(len(self.shares))]
        return np.array([some[:_SIGNS] for some in own])


class DistanceTable:
    """Compares as a search for the median does, and keeps the distances that tell modes.

    Of the first comparison it keeps those to all moving performances, or to evenly spaced ones of
    many.

    Parameters
    ----------
    compare : callable
        As `median.exhaustive_median` takes it.
    """

    def __init__(self, compare):
        self._compare, self._landmarks, self._table = compare, None, None

    def __call__(self, bases, moving):
        """Yield what ``compare`` does."""
        if self._table is not None:
            yield from self._compare(bases, moving)
            return
        n = len(moving)
        some = np.unique(np.linspace(0, n - 1, min(n, _LANDMARKS)).round().astype(np.intp))
        place = np.full(n, -1)
        place[some] = np.arange(len(some))
        self._landmarks, self._table = moving[some], np.zeros((len(bases), len(some)), np.float32)
        for rows, columns, block in self._compare(bases, moving):
            kept = place[columns] >= 0
            self._table[rows, place[columns][kept]] = block[:, kept]
            yield rows, columns, block

    def modes(self, n, store):
        """The `Modes` of n performances, given the store of their features.

        Without distances of them all, or with few, they are taken for one mode.
        """
        single, marks, table = Modes.single(n), self._landmarks, self._table
        if table is None or len(table) < n or len(marks) < 2 * _FEWEST:
            return single
        subframes = store.positions_a_frame
        own = _energies(store.plain(store.select(marks)), subframes)
        among = _shares(table[marks], own, own)
        among = (among + among.T) / 2
        np.fill_diagonal(among, 0)
        heaps = _heaps(among, np.arange(len(marks)))
        if len(heaps) == 1:
            return single
        energies = [_energies(store.plain(x), subframes) for x in store.portions()]
        energies = np.concatenate(energies)
        shares, distances = _shares(table, energies, own), np.empty((len(heaps), n))
        shares[marks] = among
        for mode, heap in enumerate(heaps):
            # No performance counts as near to itself.
            others = np.full(n, len(heap))
            others[marks[heap]] -= 1
            distances[mode] = shares[:, heap].sum(axis=1) / others
        labels = distances.argmin(axis=0)
        for mode, heap in enumerate(heaps):
            labels[marks[heap]] = mode
        typical = distances[labels, np.arange(n)]
        order = np.argsort(-np.bincount(labels), kind="stable")
        return Modes(np.argsort(order)[labels], typical)


def _energies(features, subframes=1):
    """The energy of each performance by the frame: (n_sequences,)."""
    features = features[:, ::subframes]
    return np.einsum("npk,npk->n", features, features, dtype=np.float64)


def _shares(distances, energies, others):
    """Distances as shares of both energies, at least 0: 1 is as far as standing still."""
    both = np.add.outer(energies, others)
    return np.divide(np.maximum(distances, 0), both, out=np.zeros(both.shape), where=both > 0)


def _heaps(distances, members):
    """Divide performances, by symmetric distances, until no part holds two modes.

    Returns
    -------
    list of ndarray of int
    """
    halves = _halves(distances[np.ix_(members, members)])
    if halves is None:
        return [members]
    return [heap for half in (0, 1) for heap in _heaps(distances, members[halves == half])]


def _halves(distances):
    """0 or 1 for each of two modes; None if there is one."""
    n = len(distances)
    if n < 2 * _FEWEST:
        return None
    centred = distances - distances.mean(axis=0)
    centred -= centred.mean(axis=1)[:, np.newaxis]
    axes = np.linalg.eigh(-centred / 2)[1][:, ::-1]
    for coordinate in axes[:, :_COORDINATES].T:
        within, halves = cut_in_two(coordinate)
        if within > _WITHIN:
            continue
        between = distances[np.ix_(halves == 0, halves == 1)]
        if np.median(between) < _BETWEEN:
            continue
        if least_silhouette(distances, halves) >= _SILHOUETTE:
            return halves
    return None


def least_silhouette(distances, halves):
    """The smaller mean silhouette of two halves."""
    own = halves[:, np.newaxis] == halves
    counts = own.sum(axis=1)
    within = (distances * own).sum(axis=1) / (counts - 1)
    between = (distances * ~own).sum(axis=1) / (len(halves) - counts)
    sure = (between - within) / np.maximum(np.maximum(between, within), np.finfo(float).tiny)
    return min(sure[halves == half].mean() for half in (0, 1))


def cut_in_two(values):
    """The cut in two that leaves the least variance within: its share of all, and 0 or 1."""
    order = np.argsort(values, kind="stable")
    ranked = values[order] - values.mean()
    below = np.cumsum(ranked)[:-1]
    counts = np.arange(1, len(values))
    explained = np.square(below) * (1 / counts + 1 / counts[::-1])
    allowed = slice(_FEWEST - 1, len(values) - _FEWEST)
    last = _FEWEST - 1 + int(explained[allowed].argmax())
    halves = np.zeros(len(values), dtype=np.intp)
    halves[order[last + 1 :]] = 1
    energy = np.square(ranked).sum()
    return (1 - explained[last] / energy if energy > 0 else 1.0), halves


@dataclass(frozen=True, eq=False)
class ModalWarper(Warper):
    """Warps performances of several modes: votes, and templates, are of their own modes.

    A performance of another mode than the pattern is warped to the most typical one of its mode.
    One warp joins that to the pattern, the same for the whole mode. What this class inherits is of
    the mode of the pattern.

    Attributes
    ----------
    warpers : list of Warper
        One a mode, to the pattern or to the most typical performance of the mode.
    across : ndarray, shape (n_modes, P)
        The times, on the clock of the template of each mode, of the pattern.
    signs : Bases
        Features of performances that stand for the modes, as many of each.
    home : int
        The mode of the pattern.
    """

    warpers: list
    across: np.ndarray
    signs: Bases
    home: int

    @classmethod
    def of(cls, warpers, home, performances, exemplars, signs, finish):
        """The warper by warpers of all modes to the pattern.

        Parameters
        ----------
        warpers : list of Warper
        home : int
            The mode of the pattern. If its warper refines, all do.
        performances : sequence of ndarray (n_frames_i, n_features)
            The training set.
        exemplars : list of ndarray of int
            Of each mode.
        signs : ndarray of int, shape (n_modes, n_signs)
            The most typical performances of each mode.
        finish : callable
            ``finish(warper, exemplars)``: the warper that is used for one by way of exemplars.
        """
        own = warpers[home]
        matcher, subframes = own.matcher, own.matcher.features.subframes
        to_own, across = [], np.tile(np.arange(len(own.pattern), dtype=float), (len(signs), 1))
        for mode, (warper, some) in enumerate(zip(warpers, exemplars, strict=True)):
            # Without a vote there is only the direct path to the pattern.
            if mode == home or not own.votes:
                to_own.append(finish(own, exemplars[home]))
                continue
            chosen = [signs[mode, 0], *some[some != signs[mode, 0]]]
            positions = own.positions([performances[k] for k in chosen])
            across[mode] = warper.warps(positions[:1])[1][0]
            settings = positions, True, own.warp_smoothing
            pattern = matcher.features.plain(positions)[0, ::subframes]
            found = Warper.to_pattern(matcher, pattern, *settings)
            to_own.append(finish(type(own)(**vars(own) | vars(found)), chosen[1:]))
        features = matcher.features(own.positions([performances[k] for k in signs.ravel()]))
        return cls(
            **{field.name: getattr(own, field.name) for field in fields(Warper)},
            warpers=to_own,
            across=across,
            signs=Bases(matcher.trellis, features[:, ::subframes].copy()),
            home=home,
        )

    def warps(self, positions):
        """Distances of the direct paths to the pattern, and warps by way of the own mode."""
        modes = self.modes(positions)
        distances, times = np.empty(len(modes)), np.empty((len(modes), len(self.pattern)))
        for mode in np.unique(modes):
            own, warper = modes == mode, self.warpers[mode]
            distances[own], times[own] = warper.warps(positions[own])
            if warper.pattern is not self.pattern:
                distances[own] = self._direct(positions[own])
                times[own] = evaluate_warps(times[own], self.across[mode : mode + 1])
        return distances, times

    def _direct(self, positions):
        """Distances of the paths straight to the pattern."""
        base, moving = self.bases.sequences[:1], self.matcher.features(positions)
        trellis, base = self.matcher.trellis, base.astype(moving.dtype, copy=False)
        return trellis.costs(base[0], moving, trellis.paths(base, moving)[0])

    def modes(self, positions):
        """The mode of each performance, at all positions in the unit: that of the nearest signs."""
        moving, signs = self.matcher.features(positions), self.signs
        if moving.dtype != signs.sequences.dtype:
            signs = Bases(signs.trellis, signs.sequences.astype(moving.dtype))
        distances = signs.trellis.paths_and_costs(signs, moving)[1]
        features = self.matcher.features
        own = _energies(features.plain(moving), features.subframes)
        shares = _shares(distances, _energies(signs.features), own)
        return shares.reshape(len(self.warpers), -1, len(moving)).mean(axis=1).argmin(axis=0)

    def modes_of(self, arrays):
        """The mode of each performance."""
        slices = even_slices(len(arrays), _ROWS)
        return np.concatenate([self.modes(self.positions(arrays[rows])) for rows in slices])
