"""Portions: the matches of many performances, shared out among jobs, with progress."""

import threading

import numpy as np
from joblib import effective_n_jobs

from ..matching.warps import even_slices
from ..work import Common, on_cluster, run

__all__ = ["compare_in_portions", "in_portions", "shared_training_set"]

# Sizes of a portion of warping: worth sending away, and small enough to be shared out.
PORTION_CELLS = 50_000_000
_PORTION_SEQUENCES = 256
# Up to this share of a training set the pattern and the exemplars are worth sending after it.
_LARGEST_SHARE = 0.4


class _TrainingSet:
    """A training set as portions use it; sent away it holds one array, which gives the other.

    Parameters
    ----------
    matcher : Matcher
    positions : ndarray, shape (n_sequences, Q, n_features)
        The performances at all positions.
    features : ndarray, shape (n_sequences, Q, n_features), default=None
        What is compared of them: if given, this is what is sent; if not, it is made of the
        positions where it is needed.
    """

    def __init__(self, matcher, positions, features=None):
        self.matcher, self.positions = matcher, positions
        self._given = self._features = features
        self._lock = threading.Lock()

    def __getstate__(self):
        positions = self.positions if self._given is None else None
        return self.matcher, positions, self._given

    def __setstate__(self, state):
        self.__init__(*state)

    @property
    def features(self):
        """Made once in a process, whatever number of its threads ask."""
        with self._lock:
            if self._features is None:
                self._features = self.matcher.features(self.positions)
            return self._features


def shared_training_set(matcher, positions, features):
    """A training set as the portions of a fit share it: a cluster is sent its positions once."""
    sent = _TrainingSet(matcher, positions)
    return Common(_TrainingSet(matcher, positions, features), sent)


def compare_in_portions(training, bases, moving, *, n_jobs, progress):
    """Yield the synchronisation distances of all pairs of two index arrays, tile by tile.

    Which tiles go together makes no difference to the results: a few portions a worker.
    """
    trellis, features = training.here.matcher.trellis, training.here.features
    tiles = list(trellis.tiles(len(bases), len(moving), features.shape[2]))
    cells = max(1, len(bases) * len(moving) // max(1, len(tiles))) * trellis.cells(features)
    few = -(-len(tiles) // (4 * effective_n_jobs(n_jobs)))
    batches = even_slices(len(tiles), max(1, min(few, PORTION_CELLS // cells)))
    portions = [(bases, moving, tiles[batch]) for batch in batches]
    step = progress.stage(f"comparing {len(bases)} with {len(moving)} performances", len(portions))
    jobs = {"n_jobs": n_jobs, "prefer": "threads", "step": step}
    for blocks in run(_distances, portions, common=(training,), **jobs):
        yield from blocks


def _distances(training, bases, moving, tiles):
    return training.matcher.distances(training.features, bases, moving, tiles)


def in_portions(warper, method, positions, *along, n_jobs, progress, name, found=None):
    """Results of a method of a warper, for portions of all performances at all positions.

    Parameters
    ----------
    warper : Warper
    method : str
        Of its methods one that takes positions and rows.
    positions : ndarray, shape (n_sequences, Q, n_features)
    *along : ndarray, shape (n_sequences, ...)
        What the method takes besides.
    n_jobs : int or None
    progress : Progress
    name : str
        Of the stage.
    found : tuple (training, rows), default=None
        Where a cluster finds them: the `shared_training_set`, and which of it they are.
    """
    cells = len(warper.bases) * warper.matcher.trellis.cells(positions)
    size = min(max(1, PORTION_CELLS // cells), _PORTION_SEQUENCES)
    slices = even_slices(len(positions), size)
    jobs = {"n_jobs": n_jobs, "step": progress.stage(name, len(slices))}
    if found is not None and on_cluster():
        training, rows = found
        if _LARGEST_SHARE * len(training.here.features) < len(warper.bases):
            jobs["n_jobs"] = 1
        portions = [(method, rows[some]) for some in slices]
        return list(run(_of_training, portions, common=(Common(warper), training), **jobs))
    portions = [(method, positions[some], *(x[some] for x in along)) for some in slices]
    return list(run(_of_own, portions, common=(Common(warper),), **jobs))


def _of_training(warper, training, method, rows):
    return getattr(warper, method)(training.positions, rows)


def _of_own(warper, method, positions, *along):
    return getattr(warper, method)(positions, np.s_[:], *along)
