"""Matches of many performances in portions, shared out among jobs, with progress."""

import functools
import threading

import numpy as np
from joblib import effective_n_jobs

from ..inputs.wording import counted
from ..matching.warps import even_slices
from ..utils.parallel import SharedArgument, on_cluster, run
from ..utils.threads import on_one_thread

__all__ = [
    "FeatureStore",
    "TrainingPortions",
    "measure_in_portions",
    "refuse_long_paths",
    "warp_in_portions",
]

# Sizes of a portion of warping: worth sending to another process, and small enough to share out.
PORTION_CELLS = 50_000_000
_PORTION_SEQUENCES = 256
# Most steps of a path at a frame, all offsets together.
_MOST_STEPS = 1e9
# How many times longer a portion may be that reuses features.
_LONGEST = 4
# Up to this share of a training set the pattern and the exemplars are worth sending after it.
_LARGEST_SHARE = 0.4
# Most bytes of features that are cached; beyond, computing them again takes a few per cent of the
# time of comparing them, and caching them one more copy of all performances.
CACHE_BYTES = 1 << 25


def refuse_long_paths(subframes, max_rate, max_offset, n_frames):
    """Refuse a trellis that takes too long."""
    steps = min(max_rate, n_frames - 1) * subframes + 1
    steps *= 2 * max_offset * n_frames * subframes + 1
    if steps > _MOST_STEPS:
        raise ValueError(
            f"subframes = {subframes}, max_rate = {max_rate} and max_offset = "
            f"{max_offset} on {n_frames} frames ask for {steps:.0e} steps of a path "
            f"at every frame of every pair; {_MOST_STEPS:.0e} is the limit. Use fewer "
            "subframes, a smaller rate or offset."
        )


# -- pairs of a training set ------------------------------------------------------------------


class TrainingPortions:
    """A training set whose pairs are compared in portions.

    Other processes are sent the matcher and the positions once, and make the features.

    Parameters
    ----------
    matcher : Matcher
    positions : ndarray, shape (n_sequences, Q, n_features)
        The performances at all positions.
    store : FeatureStore, default=None
    """

    def __init__(self, matcher, positions, store=None):
        self.matcher, self.positions = matcher, positions
        self._store = store or FeatureStore(matcher.features, positions)
        self._held, self._lock = (b"", None), threading.Lock()

    def __getstate__(self):
        return self.matcher, self.positions

    def __setstate__(self, state):
        self.__init__(*state)

    @functools.cached_property
    def common(self):
        """The training set as all portions share it: a copy, so that there is no cycle."""
        return SharedArgument(TrainingPortions(self.matcher, self.positions, self._store))

    def compare(self, bases, moving, *, n_jobs, progress):
        """Yield the synchronisation distances of all pairs of two index arrays, tile by tile.

        Results do not depend on the portions: a few a worker.
        """
        trellis, (n_bases, n_moving) = self.matcher.trellis, map(len, (bases, moving))
        tiles = trellis.tiles(n_bases, n_moving, self._store.template.shape[2])
        n_frames = self.positions.shape[1] // trellis.table.subframes
        cells = max(1, n_bases * n_moving // max(1, len(tiles)))
        cells *= n_frames * (2 * trellis.width + 1)
        few = -(-len(tiles) // (4 * effective_n_jobs(n_jobs)))
        size = max(1, min(few, PORTION_CELLS // cells))
        portions = [(bases, moving, x) for x in self._batches(tiles, size, n_moving > n_bases)]
        name = f"comparing {n_bases} with {counted(n_moving, 'performance')}"
        step = progress.stage(name, len(portions))
        if len(portions) == 1:
            yield from on_one_thread(self.distances, *portions[0])
            step()
            return
        jobs = {"n_jobs": n_jobs, "prefer": "threads", "step": step}
        for blocks in run(TrainingPortions.distances, portions, common=(self.common,), **jobs):
            yield from blocks

    def _batches(self, tiles, size, axis):
        """Tiles in batches of ``size``.

        If features are not cached, those of the fewer performances are held, and a batch has all
        tiles of some of the others, along this axis.
        """
        if self._store.is_cached:
            return [tiles[start : start + size] for start in range(0, len(tiles), size)]
        batches, last = [], None
        for tile in sorted(tiles, key=lambda t: (t[axis].start, t[1 - axis].start)):
            count, goes_on = len(batches[-1]) if batches else 0, tile[axis].start == last
            if not batches or count >= (_LONGEST * size if goes_on else size):
                batches.append([])
            batches[-1].append(tile)
            last = tile[axis].start
        return batches

    def distances(self, bases, moving, tiles):
        """Distances of the tiles of one portion."""
        if self._store.is_cached:
            return self.matcher.distances(self._store.cached, bases, moving, tiles)
        axis = len(moving) > len(bases)
        fewer, more = (bases, moving) if axis else (moving, bases)
        some = [tile[axis] for tile in tiles]
        own = more[min(s.start for s in some) : max(s.stop for s in some)]
        # Those of many portions: made once in a process, by the first of its threads.
        key = fewer.tobytes()
        with self._lock:
            if self._held[0] != key:
                self._held = key, (fewer, self._store.select(fewer))
            held = self._held[1]
        features = IndexedFeatures((own, self._store.select(own)), held)
        return self.matcher.distances(features, bases, moving, tiles)


# -- performances one by one ------------------------------------------------------------------


def warp_in_portions(warper, arrays, *along, n_jobs, progress, name):
    """Distances and times of performances, at all positions a portion at a time.

    Parameters
    ----------
    warper : Warper
    arrays : sequence of ndarray (n_frames_i, n_features)
        Workers are sent their own portions only.
    *along : ndarray, shape (n_sequences, ...)
        Further arguments of the warper, by performance.
    n_jobs : int or None
    progress : Progress
    name : str
        Of the stage.

    Returns
    -------
    distances : ndarray, shape (n_sequences,)
    times : ndarray, shape (n_sequences, P)
    """
    arrays = list(arrays)
    slices = _slices(warper, len(arrays))
    step = progress.stage(name, len(slices))
    if len(slices) == 1:
        found = on_one_thread(warper.warps, warper.positions(arrays), *along)
        step()
        return found
    portions = [(_Arrays(arrays[rows]), *(x[rows] for x in along)) for rows in slices]
    distances, times = np.empty(len(arrays)), np.empty((len(arrays), len(warper.pattern)))
    results = run(_warps, portions, common=(SharedArgument(warper),), n_jobs=n_jobs, step=step)
    for rows, (lengths, warps) in zip(slices, results, strict=True):
        distances[rows], times[rows] = lengths, warps
    return distances, times


class _Arrays:
    """Arrays that are sent to another process as one, made when they are sent.

    No list: most versions of Dask send the items of a list to different workers.
    """

    def __init__(self, arrays):
        self._arrays = arrays

    def __iter__(self):
        return iter(self._arrays)

    def __sizeof__(self):
        # By which joblib tells what Dask sends to a worker ahead of the call.
        return sum(x.nbytes for x in self)

    def __reduce__(self):
        return _split, (np.concatenate(self._arrays), [len(x) for x in self])


def _split(frames, lengths):
    ends = np.cumsum(lengths)
    return [frames[end - n : end] for end, n in zip(ends, lengths, strict=True)]


def _warps(warper, arrays, *along):
    return warper.warps(warper.positions(arrays), *along)


def _slices(warper, n):
    cells = len(warper.bases.sequences) * len(warper.pattern)
    cells *= 2 * warper.matcher.trellis.width + 1
    size = min(max(1, PORTION_CELLS // cells), _PORTION_SEQUENCES)
    return [slice(0, n)] if n <= size else even_slices(n, size)


def measure_in_portions(warper, method, positions, found, *, n_jobs, progress, name):
    """Results of a method of a warper, for portions of some performances at all positions.

    Parameters
    ----------
    warper : Warper
    method : str
        Of its methods one that takes positions.
    positions : ndarray, shape (n_sequences, Q, n_features)
    found : tuple (training, rows)
        Where the workers of a cluster find them: the `TrainingPortions`, and their indices in it.
    n_jobs : int or None
    progress : Progress
    name : str
        Of the stage.
    """
    slices = _slices(warper, len(positions))
    jobs = {"n_jobs": n_jobs, "step": progress.stage(name, len(slices))}
    if len(slices) == 1:
        found = on_one_thread(getattr(warper, method), positions)
        jobs["step"]()
        return [found]
    if on_cluster():
        training, rows = found
        if _LARGEST_SHARE * len(training.positions) < len(warper.bases.sequences):
            jobs["n_jobs"] = 1
        portions = [(method, rows[some]) for some in slices]
        common = SharedArgument(warper), training.common
        return list(run(_measure_of_training, portions, common=common, **jobs))
    portions = [(method, positions[some]) for some in slices]
    return list(run(_measure, portions, common=(SharedArgument(warper),), **jobs))


def _measure_of_training(warper, training, method, rows):
    return getattr(warper, method)(training.positions[rows])


def _measure(warper, method, positions):
    return getattr(warper, method)(positions)


# -- features of a training set: cached of a small one, made in portions of a large one ----------


class FeatureStore:
    """Features of performances, made when they are needed.

    Parameters
    ----------
    features : Features
    positions : ndarray, shape (n_sequences, Q, n_features)
        In the unit.

    Attributes
    ----------
    is_cached : bool
        Whether the features of all performances are cached.
    """

    def __init__(self, features, positions):
        self._features, self._positions = features, positions
        self.is_cached = positions.nbytes <= CACHE_BYTES
        self._cached, self._lock = None, threading.Lock()
        self.plain = features.plain

    @functools.cached_property
    def template(self):
        """Features of no performance, with the right shape and dtype: (0, Q, n_compared)."""
        some = self.cached if self.is_cached else self._features(self._positions[:1])
        return some[:0].copy()

    @property
    def cached(self):
        """All features, (n_sequences, Q, n_compared): made once, by the first thread."""
        with self._lock:
            if self._cached is None:
                self._cached = self._features(self._positions)
            return self._cached

    def select(self, indices):
        """Features of some performances, (n_indices, Q, n_compared)."""
        if self.is_cached:
            return self.cached[indices]
        out = np.empty((len(indices), *self.template.shape[1:]), self.template.dtype)
        for rows in self._slices(len(indices)):
            out[rows] = self._features(self._positions[indices[rows]])
        return out

    def portions(self):
        """Yield the features of all performances, a portion at a time."""
        if self.is_cached:
            yield self.cached
            return
        for rows in self._slices(len(self._positions)):
            yield self._features(self._positions[rows])

    def _slices(self, n):
        """Slices of n performances whose features take half a dozen copies in the making."""
        return even_slices(n, max(1, CACHE_BYTES // (16 * self._positions[0].nbytes)))

    @property
    def positions_a_frame(self):
        """Positions of the features a frame that is compared."""
        return self._features.subframes if self._features.frames is None else 1

    def energy(self):
        """The sum of the squares of all features."""
        parts = map(self.plain, self.portions())
        parts = [np.einsum("npk,npk->", x, x, dtype=np.float64) for x in parts]
        return parts[0] if len(parts) == 1 else float(np.sum(parts))


class IndexedFeatures:
    """Features of some performances, by their indices in the training set.

    Parameters
    ----------
    *parts : tuple (indices, features)
        An index array selects from one of them.
    """

    def __init__(self, *parts):
        self._parts = []
        for indices, features in parts:
            place = np.full(indices.max(initial=-1) + 1, -1)
            place[indices] = np.arange(len(indices))
            self._parts.append((place, features))

    def __getitem__(self, key):
        indices, *other = key if isinstance(key, tuple) else (key,)
        for place, features in self._parts:
            if indices.max(initial=-1) < len(place) and (place[indices] >= 0).all():
                return features[(place[indices], *other)]
        raise IndexError("These performances are not in one part.")
