"""How well performances are synchronised: timing errors, spread, health of warps, scorers.

Times are those of ``match``: tau(p), shape (n_sequences, P), in frames of the common clock.
"""

import numpy as np
from sklearn.base import clone
from sklearn.pipeline import Pipeline
from sklearn.utils import check_random_state

from .clock import Synchronizer
from .consensus import follow
from .sequences import check_performances

__all__ = [
    "FeatureHoldoutScorer",
    "SpreadScorer",
    "group_timing_error",
    "inverse_consistency",
    "keyframe_error",
    "least_squares",
    "pairwise_correlation",
    "pause_share",
    "roughness",
    "sobolev_least_squares",
    "timing_error",
]


# -- timing, against the truth ----------------------------------------------------------


def timing_error(times, true_times, *, quantile=None):
    """Mean distance of warps from known ones, in frames of the clock.

    ``mean_{m,p} |tau_m(p) - tau*_m(p)|``

    Parameters
    ----------
    times, true_times : array-like, shape (n_sequences, P)
    quantile : float in [0, 1], default=None
        That quantile of the distances instead of their mean; 0.95 for the 95th percentile.

    Returns
    -------
    float

    Examples
    --------
    >>> from sklearn_motionsync.metrics import timing_error
    >>> timing_error([[0, 1.5, 3, 4]], [[0, 1, 2, 4]])
    0.375
    """
    times, true_times = _as_times(times), _as_times(true_times)
    if times.shape != true_times.shape:
        raise ValueError(f"times {times.shape} and true_times {true_times.shape} differ in shape.")
    return _summary(np.abs(times - true_times), quantile)


def group_timing_error(times, moments, *, quantile=None):
    """How far synchronised performances of a group are from the same moment, without a pattern.

    With ``phi_m`` the true share of the action that is over at each frame of performance m, and
    ``phi_m(tau_m(p))`` what it shows at frame p: ``(P-1) mean_{m,p} |phi_m(tau_m(p)) - mean_m
    phi_m(tau_m(p))|``. Zero if and only if all performances show the same moment at every frame.

    Parameters
    ----------
    times : array-like, shape (n_sequences, P)
    moments : list of array-like (n_frames_i,)
        ``phi``, from 0 to 1, at the performances' own frames, such as ``make_bending().times``.
    quantile : float in [0, 1], default=None
        That quantile instead of the mean.

    Returns
    -------
    float
        In frames of the clock.

    Examples
    --------
    >>> from sklearn_motionsync.metrics import group_timing_error
    >>> group_timing_error([[0, 1, 2], [0, 1, 2]], [[0, 0.5, 1], [0, 0.7, 1]])
    0.0666...
    """
    times = _as_times(times)
    if len(moments) != len(times):
        raise ValueError(f"There are {len(times)} warps and {len(moments)} sets of moments.")
    last = times.shape[1] - 1
    shown = np.stack(
        [
            np.interp(tau * (len(phi) - 1) / last, np.arange(len(phi)), phi)
            for tau, phi in zip(times, moments, strict=True)
        ]
    )
    return last * _summary(np.abs(shown - shown.mean(axis=0)), quantile)


def keyframe_error(
    times, keyframes, pattern_keyframes, n_frames, *, frame_rate=None, quantile=None
):
    """Distance of where the pattern's key-frames land in performances from where they are.

    ``mean_{m,k} |tau_m(k_n) - k_m|``, with all key-frames on the clock: frame f of F is
    ``f (P-1) / (F-1)``.

    Parameters
    ----------
    times : array-like, shape (n_sequences, P)
    keyframes : array-like, shape (n_sequences, n_keyframes)
        True key-frames, in the performances' own frames.
    pattern_keyframes : array-like, shape (n_keyframes,)
        Those of the pattern, in frames of the clock.
    n_frames : array-like of int, shape (n_sequences,)
        Lengths of the performances.
    frame_rate : float, default=None
        Frames a second of the performances: gives the error in seconds.
    quantile : float in [0, 1], default=None
        That quantile instead of the mean.

    Returns
    -------
    float
        In frames of the clock, or in seconds.

    Examples
    --------
    >>> from sklearn_motionsync.metrics import keyframe_error
    >>> keyframe_error([[0, 1, 2, 3, 4]], [[5]], [2], [9])
    0.5
    >>> keyframe_error([[0, 1, 2, 3, 4]], [[5]], [2], [9], frame_rate=10)
    0.1
    """
    times, keyframes = _as_times(times), np.asarray(keyframes, dtype=np.float64)
    pattern_keyframes = np.asarray(pattern_keyframes, dtype=np.float64)
    if keyframes.shape != (len(times), *pattern_keyframes.shape) or len(n_frames) != len(times):
        raise ValueError(
            f"{len(times)} warps and {pattern_keyframes.shape} key-frames of the pattern do not go "
            f"with keyframes of shape {keyframes.shape} and {len(n_frames)} lengths."
        )
    own = (np.asarray(n_frames)[:, np.newaxis] - 1) / (times.shape[1] - 1)
    landed = follow(times, np.tile(pattern_keyframes, (len(times), 1)))
    errors = np.abs(landed - keyframes / own)
    return _summary(errors if frame_rate is None else errors * own / frame_rate, quantile)


# -- spread, before and after -----------------------------------------------------------


def least_squares(before, after):
    """Share of the spread that is left: 1 for no gain, 0 for identical performances.

    ``mean_i  int |y_i - mean_{j != i} y_j|^2 dt / int |x_i - mean_{j != i} x_j|^2 dt``, the norm
    taken over all features; a performance that was no different before does not count.

    Parameters
    ----------
    before, after : array-like, shape (n_sequences, P, n_features)
        On one clock, linearly normalised and synchronised.

    Returns
    -------
    float

    Notes
    -----
    Small values are easily had by distorting time: judge on features that were not matched
    (`FeatureHoldoutScorer`).

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync.metrics import least_squares
    >>> x = np.zeros((2, 3, 1))
    >>> x[1] = 2
    >>> least_squares(x, x / 2)
    0.25
    """
    x, y = _as_pair(before, after)
    old, new = (_integral(_from_others(z)) for z in (x, y))
    counts = old > 0
    return float(np.mean(new[counts] / old[counts])) if counts.any() else 1.0


def sobolev_least_squares(before, after):
    """Share of the spread of velocities that is left.

    ``sum_i int |y_i' - mean_j y_j'|^2 dt / sum_i int |x_i' - mean_j x_j'|^2 dt``

    Parameters
    ----------
    before, after : array-like, shape (n_sequences, P, n_features)

    Returns
    -------
    float

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync.metrics import sobolev_least_squares
    >>> x = np.stack([np.zeros((3, 1)), np.arange(3.0)[:, None]])
    >>> sobolev_least_squares(x, x + 5)
    1.0
    """
    x, y = (np.gradient(z, axis=1) for z in _as_pair(before, after))
    old, new = (_integral(z - z.mean(axis=0)).sum() for z in (x, y))
    return float(new / old) if old > 0 else 1.0


def pairwise_correlation(before, after):
    """Gain in the correlation of pairs: more than 1 if synchronising made them more alike.

    ``sum_{i != j} cc(y_i, y_j) / sum_{i != j} cc(x_i, x_j)``, where cc is the correlation over
    time, features centred one by one and pooled.

    Parameters
    ----------
    before, after : array-like, shape (n_sequences, P, n_features)

    Returns
    -------
    float

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync.metrics import pairwise_correlation
    >>> x = np.array([[0, 1, 2.0], [0, 2, 1.0]])[:, :, None]
    >>> pairwise_correlation(x, x[[0, 0]])
    2.0
    """
    old, new = (_mean_correlation(z) for z in _as_pair(before, after))
    return float(new / old) if old != 0 else np.inf


# -- health of the warps ------------------------------------------------------------------


def pause_share(times):
    """Share of frames at which a performance stands still: ``mean [tau(p+1) = tau(p)]``.

    Parameters
    ----------
    times : array-like, shape (n_sequences, P)

    Returns
    -------
    float

    Examples
    --------
    >>> from sklearn_motionsync.metrics import pause_share
    >>> pause_share([[0, 0, 2, 3, 4]])
    0.25
    """
    return float((np.diff(_as_times(times)) <= 1e-9).mean())


def roughness(times):
    """Root mean square of the changes of rate, ``tau(p+1) - 2 tau(p) + tau(p-1)``.

    Parameters
    ----------
    times : array-like, shape (n_sequences, P)

    Returns
    -------
    float

    Examples
    --------
    >>> from sklearn_motionsync.metrics import roughness
    >>> roughness([[0, 1, 2, 4]])
    0.707...
    """
    return float(np.sqrt(np.square(np.diff(_as_times(times), 2)).mean()))


def inverse_consistency(times, back):
    """How far there and back misses: ``mean |tau_mn(tau_nm(p)) - p|``, in frames.

    Parameters
    ----------
    times, back : array-like, shape (n_sequences, P)
        Warps from a base to sequences, and from each of these to the base.

    Returns
    -------
    float

    Examples
    --------
    >>> from sklearn_motionsync.metrics import inverse_consistency
    >>> inverse_consistency([[0, 2, 3, 3.5, 4]], [[0, 1, 2, 3, 4]])
    0.5
    """
    times, back = _as_times(times), _as_times(back)
    if times.shape != back.shape:
        raise ValueError(f"times {times.shape} and back {back.shape} differ in shape.")
    return float(np.abs(follow(back, times) - np.arange(times.shape[1])).mean())


# -- scorers --------------------------------------------------------------------------------

_SPREADS = {
    "least_squares": (least_squares, -1),
    "sobolev": (sobolev_least_squares, -1),
    "correlation": (pairwise_correlation, 1),
}


class _SpreadMeasure:
    """Which measure a scorer takes, and its sign: greater scores are better."""

    def __init__(self, spread):
        if spread not in _SPREADS:
            raise ValueError(f"spread={spread!r} is unknown; use one of {list(_SPREADS)}.")
        self.spread = spread

    def _score(self, before, after):
        measure, sign = _SPREADS[self.spread]
        return sign * measure(before, after)


class SpreadScorer(_SpreadMeasure):
    """Scorer of a synchronizer, or of a pipeline with one: how alike it makes performances.

    Parameters
    ----------
    spread : {"least_squares", "sobolev", "correlation"}, default="least_squares"
        The measure; greater is better, so the first two are negated.

    Notes
    -----
    In-sample spread rewards over-warping: prefer `FeatureHoldoutScorer` to choose parameters.

    Examples
    --------
    >>> from sklearn.model_selection import cross_val_score
    >>> from sklearn_motionsync import DenseSynchronizer, DirectionCosines
    >>> from sklearn_motionsync.datasets import make_bending
    >>> from sklearn_motionsync.metrics import SpreadScorer
    >>> bunch = make_bending(8, random_state=0)
    >>> X = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    >>> scores = cross_val_score(DenseSynchronizer(40), X, cv=2, scoring=SpreadScorer())
    >>> scores.shape
    (2,)
    """

    def __init__(self, spread="least_squares"):
        super().__init__(spread)

    def __call__(self, estimator, X, y=None):
        """Score a fitted estimator on performances.

        Parameters
        ----------
        estimator : a synchronizer, or a Pipeline with one
        X : performances, as the estimator takes them
        y : ignored

        Returns
        -------
        float
        """
        synchronizer, arrays = _split(estimator, X)
        before = synchronizer._normalise(arrays, np.arange(synchronizer.n_frames_))
        after = synchronizer._sample(arrays, synchronizer._match(arrays).times)
        return self._score(before, after)


class FeatureHoldoutScorer(_SpreadMeasure):
    """Scorer that aligns on some features and judges by the others.

    Features are dealt into ``n_folds`` hands. For each hand a clone of the synchronizer is
    fitted without it, to a median pattern, and its warps are judged by the spread of the hand
    alone. Warping more than the time tells does not help features that had no say.

    Parameters
    ----------
    spread : {"least_squares", "sobolev", "correlation"}, default="least_squares"
        The measure; greater is better, so the first two are negated.
    n_folds : int, default=3
        At least 2, and at most the number of features.
    random_state : int, RandomState instance or None, default=0
        How features are dealt.

    Examples
    --------
    >>> from sklearn.model_selection import GridSearchCV
    >>> from sklearn_motionsync import DenseSynchronizer, DirectionCosines
    >>> from sklearn_motionsync.datasets import make_bending
    >>> from sklearn_motionsync.metrics import FeatureHoldoutScorer
    >>> bunch = make_bending(8, random_state=0)
    >>> X = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    >>> grid = {"max_offset": [0, 0.25]}
    >>> search = GridSearchCV(DenseSynchronizer(40), grid, cv=2, scoring=FeatureHoldoutScorer())
    >>> search.fit(X).best_params_
    {'max_offset': 0.25}
    """

    def __init__(self, spread="least_squares", n_folds=3, random_state=0):
        super().__init__(spread)
        self.n_folds = n_folds
        self.random_state = random_state

    def __call__(self, estimator, X, y=None):
        """Score a fitted estimator on performances.

        Parameters
        ----------
        estimator : a synchronizer, or a Pipeline with one
        X : performances, as the estimator takes them
        y : ignored

        Returns
        -------
        float
        """
        synchronizer, arrays = _split(estimator, X)
        n_features = arrays[0].shape[1]
        if not 2 <= self.n_folds <= n_features:
            raise ValueError(
                f"n_folds={self.n_folds} must be between 2 and the {n_features} features there are."
            )
        dealt = check_random_state(self.random_state).permutation(n_features)
        scores = []
        for held in np.array_split(dealt, self.n_folds):
            shown = np.setdiff1d(dealt, held)
            blind = clone(synchronizer).set_params(
                n_frames=synchronizer.n_frames_, pattern="median"
            )
            seen, hidden = ([x[:, part] for x in arrays] for part in (shown, held))
            times = blind.fit(seen).match(seen).times
            before = blind._normalise(hidden, np.arange(blind.n_frames_))
            scores.append(self._score(before, blind._sample(hidden, times)))
        return float(np.mean(scores))


def _split(estimator, X):
    """The synchronizer of an estimator, and the performances as they reach it."""
    steps = [("", estimator)] if not isinstance(estimator, Pipeline) else estimator.steps
    for i, (_, step) in enumerate(steps):
        if isinstance(step, Synchronizer):
            features = estimator[:i].transform(X) if i else X
            return step, check_performances(step, features, reset=False, level="sequence").arrays
    raise ValueError(
        f"There is no synchronizer in {type(estimator).__name__}; its steps are {steps}."
    )


# -- helpers --------------------------------------------------------------------------------


def _as_times(times):
    times = np.asarray(times, dtype=np.float64)
    if times.ndim != 2 or times.shape[1] < 2:
        raise ValueError(
            f"times must have shape (n_sequences, P) with P at least 2, got {times.shape}."
        )
    return times


def _as_pair(before, after):
    pair = [np.asarray(z, dtype=np.float64) for z in (before, after)]
    if pair[0].shape != pair[1].shape or pair[0].ndim != 3 or len(pair[0]) < 2:
        raise ValueError(
            "before and after must have one shape (n_sequences, P, n_features), of at least 2 "
            f"sequences; got {pair[0].shape} and {pair[1].shape}."
        )
    return pair


def _summary(errors, quantile):
    return float(errors.mean() if quantile is None else np.quantile(errors, quantile))


def _integral(z):
    """int |z_i|^2 dt, by the trapezoidal rule over [0, 1], of every sequence."""
    return np.trapezoid(np.square(z).sum(axis=2), dx=1 / (z.shape[1] - 1), axis=1)


def _from_others(z):
    return (z - z.mean(axis=0)) * len(z) / (len(z) - 1)


def _mean_correlation(z):
    centred = (z - z.mean(axis=1, keepdims=True)).reshape(len(z), -1)
    norms = np.linalg.norm(centred, axis=1)
    correlation = centred @ centred.T / np.maximum(np.outer(norms, norms), np.finfo(float).tiny)
    off = ~np.eye(len(z), dtype=bool)
    return correlation[off].mean()
