"""synchronization_distances: the matrix of Eq. 12 between performances."""

import itertools
from numbers import Integral, Real

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.utils._param_validation import Interval, Options, StrOptions

from ..inputs.validation import SequenceLevelMixin, check_performances
from ..matching.costs import COSTS
from ..matching.pairwise import BLOCK, PairwiseDistance
from ..matching.warps import normalise
from ..utils.parallel import Common, Progress, run

__all__ = ["SETTINGS", "distances_of", "on_clock", "synchronization_distances"]

# What performances are compared with, and what is accepted.
SETTINGS: dict = {
    "n_frames": [Interval(Integral, 2, None, closed="left")],
    "velocity_smoothing": [Interval(Real, 0, 1, closed="both")],
    "max_offset": [Interval(Real, 0, 1, closed="both")],
    "smoothness": [Interval(Real, 0, None, closed="left")],
    "max_rate": [Interval(Real, 1, None, closed="left")],
    "n_jobs": [Integral, None],
    "verbose": ["verbose"],
}
# Blocks of a portion: worth sending away, and few enough to be shared out.
_PORTION_BLOCKS = 32


def synchronization_distances(
    X,
    Y=None,
    *,
    cost="elastic",
    normalize=True,
    symmetric=True,
    n_frames=50,
    velocity_smoothing=0.06,
    max_offset=0.25,
    smoothness=0.003,
    max_rate=4,
    n_jobs=None,
    verbose=0,
):
    """Synchronisation distances between performances (Eq. 12), the matrix of all pairs.

    How much two performances differ once each moment of one is compared with the best moment of
    the other: a number for neighbours, kernels, clusters and maps. Each distance is that of
    the pair alone, to the last bit, whatever else is in the lists.

    Parameters
    ----------
    X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
        Performances; the rows of a 2-D array are univariate ones.
    Y : the same, default=None
        Others, with the same features. By default distances within X, of 0 on the diagonal.
    cost : {"elastic", "velocity", "posture"}, default="elastic"
        What is compared, as in `DenseSynchronizer`.
    normalize : bool, default=True
        Whether what is compared of each performance is divided by its own root mean square:
        then it does not matter who moves more, nor in which unit. A performance that stands still
        has nothing in common with any that moves: they are ``2 * n_frames`` apart.
    symmetric : bool, default=True
        Whether to average both directions. Otherwise the rows are the performances whose
        clock is kept, ``n`` of ``D_{n,m}``, and the columns those that are warped, ``m``.
    n_frames : int, default=50
        ``P``, frames of the common clock. The distance is a sum over them.
    velocity_smoothing : float, default=0.06
        Standard deviation of the Gaussian under which velocities are taken, as a share of the clip.
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
        times the penalties of the path. With ``normalize`` performances with nothing in common
        are ``2 * n_frames`` apart, and the opposite movement up to twice that.

    Raises
    ------
    ValueError
        If the input breaks the contract, the performances of Y have other features than X, or a
        parameter is none of those that are accepted.

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
    settings = {
        "n_frames": n_frames,
        "velocity_smoothing": velocity_smoothing,
        "max_offset": max_offset,
        "smoothness": smoothness,
        "max_rate": max_rate,
    }
    _check(cost=cost, normalize=normalize, symmetric=symmetric, **settings)
    settings["n_frames"] = int(n_frames)
    reader = type("synchronization_distances", (SequenceLevelMixin, BaseEstimator), {})()
    both = [check_performances(reader, X, reset=True, level="sequence")]
    if Y is not None:
        on_rows = both[0].kind == "rows"
        given = {"reset": False, "level": "sequence", "on_rows": on_rows}
        both.append(check_performances(reader, Y, **given))
    comparison = PairwiseDistance(cost, normalize=normalize, **settings)
    features = [comparison.features(on_clock(some, int(n_frames))) for some in both]
    progress = Progress(reader, verbose)
    return distances_of(
        comparison, *features, symmetric=symmetric, n_jobs=n_jobs, progress=progress
    )


def _check(**given):
    flag = Options(bool, {True, False})
    accepted = {"cost": [StrOptions(set(COSTS))], "normalize": [flag], "symmetric": [flag]}
    accepted |= SETTINGS
    for name, value in given.items():
        if not any(constraint.is_satisfied_by(value) for constraint in accepted[name]):
            raise ValueError(
                f"The {name!r} parameter of synchronization_distances must be "
                f"{' or '.join(map(str, accepted[name]))}. Got {value!r} instead."
            )


def on_clock(performances, n_frames):
    """Performances linearly normalised (Eq. 7), in double precision."""
    return normalise([np.asarray(x, dtype=np.float64) for x in performances], n_frames)


def distances_of(comparison, X, Y=None, *, symmetric=True, n_jobs=None, progress, name=""):
    """Distances between performances, of which these are the features to be compared.

    Parameters
    ----------
    comparison : PairwiseDistance
    X, Y : ndarray, shape (n, P, n_features)
        Without Y, within X.
    symmetric : bool, default=True
    n_jobs : int, default=None
    progress : Progress
    name : str, default=""
        What is said of them in the progress.

    Returns
    -------
    ndarray, shape (n_X, n_Y)
    """
    shared = {"n_jobs": n_jobs, "progress": progress, "name": name}
    there = _ordered(comparison, X, X if Y is None else Y, **shared)
    if not symmetric:
        return there
    back = there if Y is None else _ordered(comparison, Y, X, **shared)
    return there / 2 + back.T / 2


def _ordered(comparison, bases, moving, *, n_jobs, progress, name):
    rows, columns = (
        [slice(i, i + BLOCK) for i in range(0, len(some), BLOCK)] for some in (bases, moving)
    )
    blocks = list(itertools.product(rows, columns))
    portions = [(blocks[i : i + _PORTION_BLOCKS],) for i in range(0, len(blocks), _PORTION_BLOCKS)]
    stage = f"comparing {len(bases)} with {len(moving)} performances{name}"
    # Blocks are too small for threads, which wait for each other between them.
    jobs = {"n_jobs": n_jobs, "step": progress.stage(stage, len(portions))}
    out = np.empty((len(bases), len(moving)))
    common = (Common((comparison, bases, moving)),)
    for found in run(_blocks, portions, common=common, **jobs):
        for (i, j), distances in found:
            out[i, j] = distances
    return out


def _blocks(shared, blocks):
    comparison, bases, moving = shared
    return [((i, j), comparison.block(bases[i], moving[j])) for i, j in blocks]
