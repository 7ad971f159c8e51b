"""Matches of many trials in portions, shared out among jobs, with progress.

Portions have constant sizes, so that no result depends on the number of jobs.
"""

import numpy as np

from ..inputs.wording import counted
from ..matching.trellis import TILE_BASES
from ..matching.warps import even_slices
from ..utils.parallel import SharedArgument, one_blas_thread, run

__all__ = ["refuse_long_paths", "sums_in_portions", "warp_in_portions"]

# Sizes of a portion: worth sending to another process, and small enough to share out.
PORTION_CELLS = 50_000_000
_PORTION_TRIALS = 256
# Most steps of a path at a frame, all offsets together.
_MOST_STEPS = 1e9


def refuse_long_paths(settings, n_frames):
    """Refuse a trellis that takes too long."""
    steps = min(settings.max_rate, n_frames - 1) + 1
    steps *= 2 * settings.max_offset * n_frames + 1
    if steps > _MOST_STEPS:
        raise ValueError(
            f"max_rate = {settings.max_rate} and max_offset = {settings.max_offset} on {n_frames} "
            f"frames ask for {steps:.0e} steps of a path at every frame of every pair; "
            f"{_MOST_STEPS:.0e} is the limit. Use a smaller rate or offset, or fewer frames."
        )


def sums_in_portions(matcher, positions, references, compared, *, n_jobs, progress):
    """Sums of the distances of every trial, as the base, to references: (n_trials,).

    Parameters
    ----------
    matcher : Matcher
    positions : ndarray, shape (n_trials, P, n_columns)
        In the unit.
    references : ndarray of int
        Indices of trials.
    compared : ndarray, shape (n_references, n_frames, n_compared)
        Their features.
    n_jobs : int or None
    progress : Progress
    """
    n_trials, n_references = len(positions), len(references)
    cells = n_references * compared.shape[1] * (2 * matcher.trellis.width + 1)
    size = min(TILE_BASES, max(1, PORTION_CELLS // cells))
    slices = even_slices(n_trials, size)
    name = f"comparing {n_trials} with {counted(n_references, 'performance')}"
    step = progress.stage(name, len(slices))
    if n_trials == n_references:
        # The features of all trials are there.
        portions = [(matcher, compared[rows], compared) for rows in slices]
        blocks = run(_sums, portions, n_jobs=n_jobs, prefer="threads", step=step)
    else:
        common = SharedArgument(matcher), SharedArgument(positions), SharedArgument(compared)
        portions = [(rows,) for rows in slices]
        blocks = run(
            _sums_of_rows, portions, common=common, n_jobs=n_jobs, prefer="threads", step=step
        )
    return np.concatenate(list(blocks))


def _sums(matcher, bases, references):
    return matcher.trellis.distances(bases, references).sum(axis=1, dtype=np.float64)


def _sums_of_rows(matcher, positions, references, rows):
    return _sums(matcher, matcher.features(positions[rows]), references)


def warp_in_portions(warper, arrays, body_times=None, *, n_jobs, begin, name):
    """Distances and times of trials, on the clock a portion at a time.

    Parameters
    ----------
    warper : Warper
    arrays : sequence of ndarray (n_frames_i, n_columns)
        Workers are sent their own portions only.
    body_times : ndarray, shape (n_trials, P), default=None
        Warps of the whole body, to which the warper of a part couples it.
    n_jobs : int or None
    begin : callable
        ``begin(fits=False)`` gives the `Progress` of a job of several portions.
    name : str
        Of its stage.

    Returns
    -------
    distances : ndarray, shape (n_trials,)
    times : ndarray, shape (n_trials, P)
    """
    arrays = list(arrays)
    cells = len(warper.bases.sequences) * len(warper.pattern)
    cells *= 2 * warper.matcher.trellis.width + 1
    size = min(max(1, PORTION_CELLS // cells), _PORTION_TRIALS)
    if len(arrays) <= size:
        with one_blas_thread():
            return _warps(warper, arrays, body_times)
    slices = even_slices(len(arrays), size)
    portions = [
        (_Arrays(arrays[rows]), None if body_times is None else body_times[rows]) for rows in slices
    ]
    distances, times = np.empty(len(arrays)), np.empty((len(arrays), len(warper.pattern)))
    with begin(fits=False) as progress:
        step = progress.stage(name, len(slices))
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


def _warps(warper, arrays, body_times):
    positions = warper.positions(arrays)
    if body_times is None:
        return warper.warps(positions)
    return warper.warps(positions, body_times)
