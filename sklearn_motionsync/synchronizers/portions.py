"""Portions: the matches of many performances, shared out among jobs, with progress."""

import functools
import threading

import numpy as np
from joblib import effective_n_jobs

from ..matching.warps import even_slices
from ..utils.parallel import SharedArgument, on_cluster, run

__all__ = [
    "Compared",
    "compare_in_portions",
    "in_portions",
    "shared_training_set",
    "warp_in_portions",
]

# Sizes of a portion of warping: worth sending away, and small enough to be shared out.
PORTION_CELLS = 50_000_000
_PORTION_SEQUENCES = 256
# So many times as long a portion may get for features that need not be made again.
_LONGEST = 4
# Up to this share of a training set the pattern and the exemplars are worth sending after it.
_LARGEST_SHARE = 0.4


class _TrainingSet:
    """A training set as portions use it; sent away it holds one array, of which all else is made.

    Parameters
    ----------
    matcher : Matcher
    positions : ndarray, shape (n_sequences, Q, n_features)
        The performances at all positions.
    compared : Compared, default=None
        What is compared of them.
    """

    def __init__(self, matcher, positions, compared=None):
        self.matcher, self.positions = matcher, positions
        self._compared = compared or Compared(matcher.features, positions)
        self._held, self._lock = (b"", None), threading.Lock()

    def __getstate__(self):
        return self.matcher, self.positions

    def __setstate__(self, state):
        self.__init__(*state)

    def batches(self, bases, moving, size):
        """Tiles of pairs, in batches of ``size(n_tiles)`` that need few features.

        If they are not kept, those of the fewer performances are held, and a batch has all tiles of
        some of the others.
        """
        n_compared = self._compared.like.shape[2]
        tiles = list(self.matcher.trellis.tiles(len(bases), len(moving), n_compared))
        size = size(len(tiles))
        if self._compared.is_kept:
            return [tiles[batch] for batch in even_slices(len(tiles), size)]
        along, batches, last = _along(bases, moving), [], None
        for tile in sorted(tiles, key=lambda t: (t[along].start, t[1 - along].start)):
            count, goes_on = len(batches[-1]) if batches else 0, tile[along].start == last
            if not batches or count >= (_LONGEST * size if goes_on else size):
                batches.append([])
            batches[-1].append(tile)
            last = tile[along].start
        return batches

    def distances(self, bases, moving, tiles):
        """Of the tiles of one of the `batches` for the same arrays of indices."""
        return self.matcher.distances(self._features(bases, moving, tiles), bases, moving, tiles)

    def _features(self, bases, moving, tiles):
        if self._compared.is_kept:
            return self._compared.kept
        along = _along(bases, moving)
        fewer, more = (moving, bases) if along == 0 else (bases, moving)
        some = [tile[along] for tile in tiles]
        own = more[min(s.start for s in some) : max(s.stop for s in some)]
        return Found((own, self._compared.of(own)), self._features_held(fewer))

    def _features_held(self, indices):
        """Those of many portions: made once in a process, whatever number of its threads ask."""
        key = indices.tobytes()
        with self._lock:
            if self._held[0] != key:
                self._held = key, (indices, self._compared.of(indices))
            return self._held[1]


def _along(bases, moving):
    """Along which axis of the table of pairs the portions lie: that of more performances."""
    return int(len(moving) > len(bases))


def shared_training_set(matcher, positions, compared):
    """A training set as the portions of a fit share it: others are sent its positions once."""
    return SharedArgument(_TrainingSet(matcher, positions, compared))


def compare_in_portions(training, bases, moving, *, n_jobs, progress):
    """Yield the synchronisation distances of all pairs of two index arrays, tile by tile.

    Which tiles go together makes no difference to the results: a few portions a worker.
    """
    here = training.value

    def size(n_tiles):
        cells = max(1, len(bases) * len(moving) // max(1, n_tiles))
        cells *= here.matcher.trellis.cells(here.positions)
        few = -(-n_tiles // (4 * effective_n_jobs(n_jobs)))
        return max(1, min(few, PORTION_CELLS // cells))

    portions = [(bases, moving, batch) for batch in here.batches(bases, moving, size)]
    step = progress.stage(f"comparing {len(bases)} with {len(moving)} performances", len(portions))
    jobs = {"n_jobs": n_jobs, "prefer": "threads", "step": step}
    for blocks in run(_distances, portions, common=(training,), **jobs):
        yield from blocks


def _distances(training, bases, moving, tiles):
    return training.distances(bases, moving, tiles)


def warp_in_portions(warper, arrays, *along, n_jobs, progress, name):
    """Distances and times of performances, at all positions a portion at a time.

    Parameters
    ----------
    warper : Warper
    arrays : sequence of ndarray (n_frames_i, n_features)
        As they are: nobody is sent more of them.
    *along : ndarray, shape (n_sequences, ...)
        What the warper takes besides.
    n_jobs : int or None
    progress : Progress
    name : str
        Of the stage.

    Returns
    -------
    distances : ndarray, shape (n_sequences,)
    times : ndarray, shape (n_sequences, P)
    """
    slices = _slices(warper, len(arrays))
    portions = _Portions(slices, lambda rows: (_Arrays(arrays[rows]), *(x[rows] for x in along)))
    distances, times = np.empty(len(arrays)), np.empty((len(arrays), len(warper.pattern)))
    jobs = {"n_jobs": n_jobs, "step": progress.stage(name, len(slices))}
    results = run(_warps, portions, common=(SharedArgument(warper),), **jobs)
    for rows, (lengths, warps) in zip(slices, results, strict=True):
        distances[rows], times[rows] = lengths, warps
    return distances, times


class _Portions:
    """Portions that are made when it is their turn, so that not all of them are there at once."""

    def __init__(self, slices, make):
        self._slices, self._make = slices, make

    def __len__(self):
        return len(self._slices)

    def __iter__(self):
        return map(self._make, self._slices)


class _Arrays(list):
    """Arrays that are one where they are sent."""

    def __reduce__(self):
        return _apart, (np.concatenate(self), [len(x) for x in self])


def _apart(frames, lengths):
    ends = np.cumsum(lengths)
    return [frames[end - n : end] for end, n in zip(ends, lengths, strict=True)]


def _warps(warper, arrays, *along):
    return warper.warps(warper.positions(arrays), np.s_[:], *along)


def _slices(warper, n):
    cells = len(warper.bases) * len(warper.pattern) * (2 * warper.matcher.trellis.width + 1)
    return even_slices(n, min(max(1, PORTION_CELLS // cells), _PORTION_SEQUENCES))


def in_portions(warper, method, positions, *, n_jobs, progress, name, found):
    """Results of a method of a warper, for portions of some of a training set at all positions.

    Parameters
    ----------
    warper : Warper
    method : str
        Of its methods one that takes positions and rows.
    positions : ndarray, shape (n_sequences, Q, n_features)
    n_jobs : int or None
    progress : Progress
    name : str
        Of the stage.
    found : tuple (training, rows)
        Where a cluster finds them: the `shared_training_set`, and which of it they are.
    """
    slices = _slices(warper, len(positions))
    jobs = {"n_jobs": n_jobs, "step": progress.stage(name, len(slices))}
    if on_cluster():
        training, rows = found
        if _LARGEST_SHARE * len(training.value.positions) < len(warper.bases):
            jobs["n_jobs"] = 1
        portions = [(method, rows[some]) for some in slices]
        return list(run(_of_training, portions, common=(SharedArgument(warper), training), **jobs))
    portions = [(method, positions[some]) for some in slices]
    return list(run(_of_own, portions, common=(SharedArgument(warper),), **jobs))


def _of_training(warper, training, method, rows):
    return getattr(warper, method)(training.positions, rows)


def _of_own(warper, method, positions):
    return getattr(warper, method)(positions, np.s_[:])


# -- what is compared of a training set: kept of a small one, made in portions of a large one

# Up to so many bytes features are kept; beyond, making them again takes a few per cent of what
# comparing by them takes, and keeping them would be one copy more of all performances.
KEPT_BYTES = 1 << 25


class Compared:
    """What is compared of performances.

    Parameters
    ----------
    features : Features
    positions : ndarray, shape (n_sequences, Q, n_features)
        In the unit.

    Attributes
    ----------
    is_kept : bool
        Whether the features of all are.
    """

    def __init__(self, features, positions):
        self._features, self._positions = features, positions
        self.is_kept = positions.nbytes <= KEPT_BYTES
        self._kept, self._lock = None, threading.Lock()

    def __len__(self):
        return len(self._positions)

    @functools.cached_property
    def like(self):
        """An array of no performance that is of the kind of the features: (0, Q, n_compared)."""
        return self.of(np.arange(1))[:0].copy()

    @property
    def kept(self):
        """Of all, (n_sequences, Q, n_compared): made once, whatever number of threads ask."""
        with self._lock:
            if self._kept is None:
                self._kept = self._features(self._positions)
            return self._kept

    def of(self, indices):
        """Of some, (n_indices, Q, n_compared)."""
        portions = [indices[rows] for rows in self._slices(len(indices))]
        first = self._features(self._positions[portions[0]])
        if len(portions) == 1:
            return first
        out, stop = np.empty((len(indices), *first.shape[1:]), first.dtype), len(first)
        out[:stop] = first
        for some in portions[1:]:
            start, stop = stop, stop + len(some)
            out[start:stop] = self._features(self._positions[some])
        return out

    def portions(self):
        """Yield those of all, a portion at a time."""
        if self.is_kept:
            yield self.kept
            return
        for rows in self._slices(len(self)):
            yield self._features(self._positions[rows])

    def _slices(self, n):
        """Of so many performances, slices whose features take half a dozen copies in the making."""
        return even_slices(n, max(1, KEPT_BYTES // (16 * self._positions[0].nbytes)))

    def energy(self):
        """The sum of the squares of all."""
        parts = [np.einsum("npk,npk->", x, x, dtype=np.float64) for x in self.portions()]
        return parts[0] if len(parts) == 1 else float(np.sum(parts))


class Found:
    """Features of some performances, found by the indices of these among all.

    Parameters
    ----------
    *parts : tuple (indices, features)
        Those who are asked for together are in one of them.
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
