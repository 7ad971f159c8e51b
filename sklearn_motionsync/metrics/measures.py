"""How well performances are synchronised: timing errors, spread, health of warps.

Times are those of ``match``: tau(p), shape (n_sequences, P), in frames of the common clock.
"""

import numpy as np

from ..matching.warps import follow

__all__ = [
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
