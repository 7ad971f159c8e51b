"""synchronization_distances: the matrix of Eq. 12, whose pairs do not depend on each other.

In a fit distances are rounded as the tile they are computed in. Here no distance depends on the
other trials, not in its last bit: every pair has matrix products of its own, of one size, and
all else is done element by element.
"""

from __future__ import annotations

import itertools
from functools import partial
from numbers import Integral

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.utils._param_validation import Interval, StrOptions

from ..inputs.types import Cost, TrialsLike
from ..inputs.validation import SequenceLevelMixin, check_input
from ..inputs.wording import counted
from ..matching.costs import COSTS
from ..matching.matcher import cost_features
from ..matching.sizes import CONSTANT, EQUAL
from ..matching.tile import PRODUCT_ROWS, Bases, Tile, right_factor
from ..matching.trellis import Trellis
from ..matching.warps import even_slices, normalise
from ..utils.parallel import Progress, run
from ..utils.parameters import validated_function

# Bases, and moving sequences, of a block; of few of the one there are more of the other. Of 50
# frames 8 x 8 take 1.5 times as long a pair, 16 x 32 as long, 1 x 256 1.2 times.
BLOCK = 16
# Blocks of a job's portion: enough to outweigh its overhead, and few enough for many jobs.
_PORTION_BLOCKS = 32
# Standard deviation of the Gaussian under which velocities are estimated, as a share of the trial.
_SMOOTHING = 0.06
# Weight of the changes of pace, ``mu``, in units of the squared features of a frame, and the
# largest rate of a path.
_SMOOTHNESS, _MAX_RATE = 0.003, 4


@validated_function(
    {
        "cost": [StrOptions(set(COSTS))],
        "n_frames": [Interval(Integral, 2, None, closed="left")],
        "n_jobs": [Integral, None],
        "verbose": ["verbose"],
    }
)
def synchronization_distances(
    X: TrialsLike,
    Y: TrialsLike | None = None,
    *,
    cost: Cost = "elastic",
    n_frames: int = 50,
    n_jobs: int | None = None,
    verbose: int = 0,
) -> np.ndarray:
    """Synchronisation distances between all pairs of trials (Eq. 12).

    A distance is the difference of two trials after one is warped to the other, in the mean of both
    directions: for nearest neighbours, kernels, clusters and embeddings. It depends on the pair
    alone, to the last bit, not on the other trials. The compared features of each trial are divided
    by their own root mean square, which removes amplitude and unit.

    Parameters
    ----------
    X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
        Trials; the rows of a 2-D array are univariate ones.
    Y : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array, default=None
        Other trials, with the same features. By default X, with 0 on the diagonal.
    cost : {"elastic", "velocity", "pose"}, default="elastic"
        The features that are compared, as in `DenseSynchronizer`.
    n_frames : int, default=50
        ``P``, frames of the common clock. The distance is a sum over them.
    n_jobs : int, default=None
        How many jobs share the pairs. None means 1 unless in a ``joblib.parallel_config`` context,
        -1 all cores. Results are the same to the last bit.
    verbose : int, default=0
        Above 0, print how far a long job is, at most once a second.

    Returns
    -------
    ndarray, shape (n_X, n_Y)
        0 or more, in double precision: squares of the features, summed over the clock, and 0.003
        times the penalties of the path. Uncorrelated trials are ``2 * n_frames`` apart, and
        opposite ones up to twice that. A trial that stands still is ``2 * n_frames`` away from any
        that moves.

    Raises
    ------
    ValueError
        If the input breaks the contract, the trials of Y have other features than X, or a
        parameter is invalid.

    See Also
    --------
    ActionClassifier : Which action it is, by several of these.

    Examples
    --------
    Two movements, each done in three ways, and the nearest other trial of each.

    >>> import numpy as np
    >>> from sklearn_motionsync.recognition import synchronization_distances
    >>> t = np.linspace(0, 1, 60)
    >>> X = [np.column_stack([np.sin(5 * t**a), np.cos(b * t**a)])
    ...      for b in (5, 9) for a in (0.8, 1, 1.3)]
    >>> D = synchronization_distances(X)
    >>> (D + 1e9 * np.eye(6)).argmin(axis=1).tolist()
    [1, 0, 1, 4, 3, 4]

    As a classifier: distances to the training set only.

    >>> from sklearn.neighbors import KNeighborsClassifier
    >>> known, new = X[::2], X[1::2]
    >>> nearest = KNeighborsClassifier(1, metric="precomputed")
    >>> nearest = nearest.fit(synchronization_distances(known), ["slow", "slow", "fast"])
    >>> nearest.predict(synchronization_distances(new, known)).tolist()
    ['slow', 'fast', 'fast']
    """
    reader = type("synchronization_distances", (SequenceLevelMixin, BaseEstimator), {})()
    bases, moving = check_input(reader, X, reset=True, level="sequence"), None
    if Y is not None:
        on_rows = bases.kind == "rows"
        moving = check_input(reader, Y, reset=False, level="sequence", on_rows=on_rows)
    comparison = PairwiseDistance(cost, n_frames=int(n_frames))
    return pairwise_distances(
        comparison,
        comparison.features(normalise_time(bases, comparison.n_frames)),
        None
        if moving is None
        else comparison.features(normalise_time(moving, comparison.n_frames)),
        n_jobs=n_jobs,
        progress=Progress(reader, verbose),
    )


def normalise_time(trials, n_frames):
    """Trials linearly normalised in time (Eq. 7), in double precision."""
    return normalise([np.asarray(x, dtype=np.float64) for x in trials], n_frames)


def pairwise_distances(comparison, X, Y=None, *, n_jobs=None, progress, name=""):
    """Distances (n_X, n_Y) between trials, given the features (n, P, n_features) that are compared.

    They are means of both directions; without Y they are those within X. The name is appended to
    the message of the progress.
    """
    directed = partial(_directed, comparison, n_jobs=n_jobs, progress=progress, name=name)
    there = directed(X, X if Y is None else Y)
    back = there if Y is None else directed(Y, X)
    return there / 2 + back.T / 2


def _directed(comparison, bases, moving, *, n_jobs, progress, name):
    pairs = blocks_of_pairs(len(bases), len(moving))
    portions = [(pairs[i : i + _PORTION_BLOCKS],) for i in range(0, len(pairs), _PORTION_BLOCKS)]
    stage = f"comparing {len(bases)} with {counted(len(moving), 'trial')}{name}"
    step = progress.stage(stage, len(portions))
    out = np.empty((len(bases), len(moving)))
    common = ((comparison, bases, moving),)
    for blocks in run(_blocks, portions, common=common, n_jobs=n_jobs, step=step):
        for (i, j), distances in blocks:
            out[i, j] = distances
    return out


def _blocks(shared, blocks):
    comparison, bases, moving = shared
    return [((i, j), comparison.block(bases[i], moving[j])) for i, j in blocks]


# -- a pair by itself -----------------------------------------------------------------------------


class PairwiseDistance:
    """The synchronisation distance of trials on the clock, under one cost.

    Parameters
    ----------
    cost : str
        A key of ``costs.COSTS``.
    n_frames : int
        Of the clock.
    normalize : bool, default=True
        Whether the features of every trial are divided by their own root mean square.
    max_offset : float, default=0.25
        As a share of the clock.
    dtype : type, default=numpy.float64
        Of the features that are compared, and of distances. numpy.float32 takes 0.6 of the time.
    """

    def __init__(self, cost, *, n_frames, normalize=True, max_offset=0.25, dtype=np.float64):
        self.cost, self.normalize, self.n_frames, self.dtype = cost, normalize, n_frames, dtype
        self.trellis = Trellis.on_clock(
            cost, n_frames, _SMOOTHNESS, max_offset=max_offset, max_rate=_MAX_RATE
        )

    def features(self, on_clock):
        """Features of trials (n, P, n_features) on the clock: (n, P, n_compared)."""
        on_clock = on_clock.astype(np.float64)
        size = np.abs(on_clock).max(axis=(1, 2), keepdims=True, initial=0)
        if self.normalize:
            # The same bits in any unit: powers of two are taken out.
            exponents = np.frexp(size)[1]
            on_clock, size = np.ldexp(on_clock, -exponents), np.ldexp(size, -exponents)
        is_constant = np.ptp(on_clock, axis=1, keepdims=True) <= CONSTANT * size
        on_clock = np.where(is_constant, on_clock[:, :1], on_clock)
        features = cost_features(on_clock, self.cost, smoothing=_SMOOTHING)
        if not self.normalize:
            return features.astype(self.dtype, copy=False)
        energy = _energies(features)[:, np.newaxis, np.newaxis] / self.n_frames
        # All energy of a trial that stands still is in a feature that is 0 in others.
        residue = np.broadcast_to(energy == 0, (*features.shape[:2], 1))
        features /= np.sqrt(np.where(energy > 0, energy, 1))
        return np.concatenate([features, residue], axis=2, dtype=self.dtype)

    def block(self, bases, moving):
        """Distances (n_bases, n_moving) of the features of bases to moving sequences."""
        distances = PairTile(self.trellis, bases, moving).ends()[:, :, 0]
        energies = _energies(bases)[:, np.newaxis] + _energies(moving)
        return np.where(distances <= EQUAL[distances.dtype] * energies, 0, distances)


def _energies(features):
    """``sum_p |x(p)|^2`` of every trial."""
    flat = features.reshape(len(features), -1)
    return np.vecdot(flat, flat)


class PairTile(Tile):
    """A tile that multiplies every pair of sequences (n, P, n_features) by itself."""

    def __init__(self, trellis, bases, moving):
        super().__init__(Bases(trellis, bases), right_factor(moving, trellis))
        self.moving = moving

    def costs_of_samples(self, first, last, lows, highs):
        """Yield ``p`` and the costs of its window, one flat array a group, less ``|x_n(p)|^2``."""
        bases, moving, n_groups = self.bases.sequences, self.moving, len(self.trellis.groups)
        of_group = self.trellis.of_group.astype(self.dtype)
        weights, inner, penalty = of_group[:, :, np.newaxis, np.newaxis]
        if n_groups == 1:
            # All but a constant is in the product.
            energies = np.vecdot(moving, moving)[:, :, np.newaxis]
            moving = np.concatenate([moving, weights * energies + penalty], axis=2)
            bases = np.concatenate([-inner * bases, np.ones_like(bases[:, :, :1])], axis=2)
        else:
            energies = np.vecdot(moving, moving).T
            fixed = np.repeat(weights * energies + penalty, len(bases), axis=2)
        for start in range(first, last, PRODUCT_ROWS):
            stop = min(start + PRODUCT_ROWS, last)
            lowest, highest = start + lows[start], stop + highs[stop - 1]
            columns = moving[:, np.newaxis, lowest:highest].swapaxes(2, 3)
            products = self._products(stop - start, highest - lowest)
            np.matmul(bases[:, start:stop], columns, out=products)
            products = products.reshape(self.pairs, stop - start, -1).transpose(1, 2, 0)
            for p, row in enumerate(np.ascontiguousarray(products), start):
                window = slice(p + lows[p], p + highs[p] + 1)
                row = row[window.start - lowest : window.stop - lowest]
                if n_groups == 1:
                    yield p, row.reshape(1, -1)
                    continue
                costs = self._cost_buffer[: n_groups * row.size].reshape(n_groups, *row.shape)
                np.multiply(row, -inner, out=costs)
                costs += fixed[:, window]
                yield p, costs.reshape(n_groups, -1)

    def _products(self, n_rows, n_columns):
        """An array (n_moving, n_bases, n_rows, n_columns) whose pairs are read side by side."""
        # An odd number of cache lines from pair to pair: other distances share few of its sets.
        line = 64 // self.dtype.itemsize
        size = n_rows * n_columns
        pitch = (-(-size // line) | 1) * line
        products = np.empty((self.pairs, pitch), self.dtype)[:, :size]
        return products.reshape(len(self.moving), -1, n_rows, n_columns)

    # Of a single base, too.
    _costs_of_blocks = costs_of_samples

    def _last_row(self, states):
        return super()._last_row(states) + np.tile(
            _energies(self.bases.sequences), len(self.moving)
        )


def blocks_of_pairs(n_bases, n_moving):
    """Slices of bases and of moving sequences that cover all pairs."""
    rows = even_slices(n_bases, max(BLOCK, BLOCK**2 // n_moving))
    columns = even_slices(n_moving, max(BLOCK, BLOCK**2 // n_bases))
    return list(itertools.product(rows, columns))
