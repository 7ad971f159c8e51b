"""synchronization_distances: the matrix of Eq. 12 between performances."""

from __future__ import annotations

from functools import partial
from numbers import Integral, Real

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.utils._param_validation import Interval, StrOptions

from ..inputs.types import Cost, PerformancesLike
from ..inputs.validation import SequenceLevelMixin, check_performances
from ..inputs.wording import counted
from ..matching.costs import COSTS
from ..matching.warps import normalise
from ..utils.parallel import Progress, run
from ..utils.parameters import validated_function
from .pairwise import PairwiseDistance, blocks_of_pairs

__all__ = ["SETTINGS", "normalise_time", "pairwise_distances", "synchronization_distances"]

# Parameters of the comparison, and their constraints.
SETTINGS: dict = {
    "n_frames": [Interval(Integral, 2, None, closed="left")],
    "velocity_smoothing": [Interval(Real, 0, 1, closed="both")],
    "max_offset": [Interval(Real, 0, 1, closed="both")],
    "smoothness": [Interval(Real, 0, None, closed="left")],
    "max_rate": [Interval(Real, 1, None, closed="left")],
    "n_jobs": [Integral, None],
    "verbose": ["verbose"],
}
# Blocks of a job's portion: enough to outweigh its overhead, and few enough for many jobs.
_PORTION_BLOCKS = 32


@validated_function(
    {
        "cost": [StrOptions(set(COSTS))],
        "normalize": ["boolean"],
        "symmetric": ["boolean"],
        **SETTINGS,
    }
)
def synchronization_distances(
    X: PerformancesLike,
    Y: PerformancesLike | None = None,
    *,
    cost: Cost = "elastic",
    normalize: bool = True,
    symmetric: bool = True,
    n_frames: int = 50,
    velocity_smoothing: float = 0.06,
    max_offset: float = 0.25,
    smoothness: float = 0.003,
    max_rate: float = 4,
    n_jobs: int | None = None,
    verbose: int = 0,
) -> np.ndarray:
    """Synchronisation distances between all pairs of performances (Eq. 12).

    A distance is the difference of two performances after one is warped to the other: for nearest
    neighbours, kernels, clusters and embeddings. It depends on the pair alone, to the last bit,
    not on the other performances.

    Parameters
    ----------
    X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
        Performances; the rows of a 2-D array are univariate ones.
    Y : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array, default=None
        Other performances, with the same features. By default X, with 0 on the diagonal.
    cost : {"elastic", "velocity", "posture"}, default="elastic"
        The features that are compared, as in `DenseSynchronizer`.
    normalize : bool, default=True
        Whether the compared features of each performance are divided by their own root mean
        square, which removes amplitude and unit. A performance that stands still is
        ``2 * n_frames`` away from any that moves.
    symmetric : bool, default=True
        Whether to average both directions. Otherwise the rows are the performances whose
        clock is kept, ``n`` of ``D_{n,m}``, and the columns those that are warped, ``m``.
    n_frames : int, default=50
        ``P``, frames of the common clock. The distance is a sum over them.
    velocity_smoothing : float, default=0.06
        Standard deviation of the Gaussian under which velocities are estimated, as a share of the
        performance.
    max_offset : float, default=0.25
        Largest offset, as a share of the clock, in [0, 1].
    smoothness : float, default=0.003
        Weight ``mu`` of the changes of pace, in units of the mean squared norm of the features of
        a frame: that is 1 with ``normalize``. Without, it is in units of the
        data: their square, for the elastic cost their first power.
    max_rate : float, default=4
        Largest local rate of a path.
    n_jobs : int, default=None
        How many jobs share the pairs. None means 1 unless in a ``joblib.parallel_config`` context,
        -1 all cores. Results are the same to the last bit.
    verbose : int, default=0
        Above 0, print how far a long job is, at most once a second.

    Returns
    -------
    ndarray, shape (n_X, n_Y)
        0 or more, in double precision: squares of the features, summed over the clock, and ``mu``
        times the penalties of the path. With ``normalize`` uncorrelated performances are
        ``2 * n_frames`` apart, and opposite ones up to twice that.

    Raises
    ------
    ValueError
        If the input breaks the contract, the performances of Y have other features than X, or a
        parameter is invalid.

    See Also
    --------
    ActionClassifier : Which action it is, by several of these.

    Examples
    --------
    Two movements, each done in three ways, and the nearest other performance of each.

    >>> import numpy as np
    >>> from sklearn_motionsync import synchronization_distances
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
    bases, moving = check_performances(reader, X, reset=True, level="sequence"), None
    if Y is not None:
        on_rows = bases.kind == "rows"
        moving = check_performances(reader, Y, reset=False, level="sequence", on_rows=on_rows)
    comparison = PairwiseDistance(
        cost,
        normalize=normalize,
        n_frames=int(n_frames),
        velocity_smoothing=velocity_smoothing,
        max_offset=max_offset,
        smoothness=smoothness,
        max_rate=max_rate,
    )
    return pairwise_distances(
        comparison,
        comparison.features(normalise_time(bases, comparison.n_frames)),
        None
        if moving is None
        else comparison.features(normalise_time(moving, comparison.n_frames)),
        symmetric=symmetric,
        n_jobs=n_jobs,
        progress=Progress(reader, verbose),
    )


def normalise_time(performances, n_frames):
    """Performances linearly normalised in time (Eq. 7), in double precision."""
    return normalise([np.asarray(x, dtype=np.float64) for x in performances], n_frames)


def pairwise_distances(comparison, X, Y=None, *, symmetric=True, n_jobs=None, progress, name=""):
    """Distances between performances, given the features that are compared.

    Parameters
    ----------
    comparison : PairwiseDistance
    X, Y : ndarray, shape (n, P, n_features)
        Without Y, within X.
    symmetric : bool, default=True
    n_jobs : int, default=None
    progress : Progress
    name : str, default=""
        Appended to the message of the progress.

    Returns
    -------
    ndarray, shape (n_X, n_Y)
    """
    directed = partial(_directed, comparison, n_jobs=n_jobs, progress=progress, name=name)
    there = directed(X, X if Y is None else Y)
    if not symmetric:
        return there
    back = there if Y is None else directed(Y, X)
    return there / 2 + back.T / 2


def _directed(comparison, bases, moving, *, n_jobs, progress, name):
    pairs = blocks_of_pairs(len(bases), len(moving))
    portions = [(pairs[i : i + _PORTION_BLOCKS],) for i in range(0, len(pairs), _PORTION_BLOCKS)]
    stage = f"comparing {len(bases)} with {counted(len(moving), 'performance')}{name}"
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
