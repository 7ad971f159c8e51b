"""Portions: the matches of many performances, shared out among jobs, with progress."""

from joblib import effective_n_jobs

from ..matching.warps import even_slices
from ..work import run

__all__ = ["compare_in_portions", "in_portions"]

# Sizes of a portion of warping: worth sending away, and small enough to be shared out.
_PORTION_CELLS = 50_000_000
_PORTION_SEQUENCES = 256


def compare_in_portions(matcher, features, bases, moving, *, n_jobs, progress):
    """Yield the synchronisation distances of all pairs of two index arrays, tile by tile.

    Which tiles go together makes no difference to the results: a few portions a worker.
    """
    trellis = matcher.trellis
    tiles = list(trellis.tiles(len(bases), len(moving), features.shape[2]))
    cells = max(1, len(bases) * len(moving) // max(1, len(tiles))) * trellis.cells(features)
    few = -(-len(tiles) // (4 * effective_n_jobs(n_jobs)))
    batches = even_slices(len(tiles), max(1, min(few, _PORTION_CELLS // cells)))
    portions = [(features, bases, moving, tiles[batch]) for batch in batches]
    name = f"comparing {len(bases)} with {len(moving)} performances"
    step = progress.stage(name, len(portions))
    for blocks in run(matcher.distances, portions, n_jobs=n_jobs, prefer="threads", step=step):
        yield from blocks


def in_portions(warper, method, positions, *, n_jobs, progress, name):
    """Results of a method of a warper, for portions of all performances at all positions."""
    cells = len(warper.bases) * warper.matcher.trellis.cells(positions)
    size = min(max(1, _PORTION_CELLS // cells), _PORTION_SEQUENCES)
    portions = [(positions, rows) for rows in even_slices(len(positions), size)]
    step = progress.stage(name, len(portions))
    return list(run(getattr(warper, method), portions, n_jobs=n_jobs, step=step))
