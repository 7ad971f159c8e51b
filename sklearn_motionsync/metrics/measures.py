"""How well performances are synchronised: timing errors, and the health of warps.

Times are those of ``match``: tau(p), shape (n_sequences, P), from 0 to P - 1, in frames of the
common clock. They may step back, as warps that others made do by rounding, or altogether.
"""

import numpy as np

from ..matching.warps import evaluate_warps
from .arguments import (
    as_frame_rates,
    as_keyframes,
    as_lengths,
    as_moments,
    as_quantile,
    as_times,
    check_same_shape,
)

__all__ = [
    "group_timing_error",
    "inverse_consistency",
    "keyframe_error",
    "pause_share",
    "roughness",
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

    Raises
    ------
    ValueError
        If times are not all from 0 to P - 1, or differ in shape, or there is no such quantile.

    Examples
    --------
    >>> from sklearn_motionsync.metrics import timing_error
    >>> timing_error([[0, 1.5, 2, 3]], [[0, 1, 1.5, 3]])
    0.25
    """
    times, true_times = as_times(times), as_times(true_times, "true_times")
    check_same_shape(times, true_times, "true_times")
    return _summary(np.abs(times - true_times), quantile)


def group_timing_error(times, moments, *, quantile=None):
    """How far synchronised performances of a group are from the same moment, without a pattern.

    With ``phi_m`` the true share of the action that is over at each frame of performance m, and
    ``phi_m(tau_m(p))`` what it shows at frame p: ``(P-1) mean_{m,p} |phi_m(tau_m(p)) - mean_m
    phi_m(tau_m(p))|``. Zero if and only if all performances show the same moment at every frame; of
    one performance alone it is zero.

    Parameters
    ----------
    times : array-like, shape (n_sequences, P)
    moments : list of array-like (n_frames_i,)
        ``phi``, from 0 to 1 and never decreasing, at the performances' own frames, such as
        ``make_bending().times``.
    quantile : float in [0, 1], default=None
        That quantile instead of the mean.

    Returns
    -------
    float
        In frames of the clock.

    Raises
    ------
    ValueError
        If times are not all from 0 to P - 1, there are not as many moments as warps, or these are
        no shares of an action.

    Examples
    --------
    >>> from sklearn_motionsync.metrics import group_timing_error
    >>> group_timing_error([[0, 1, 2], [0, 1, 2]], [[0, 0.5, 1], [0, 0.7, 1]])
    0.0666...
    """
    times = as_times(times)
    moments = as_moments(moments, len(times))
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
        True key-frames, in the performances' own frames, from 0 to ``n_frames_i - 1``, increasing.
    pattern_keyframes : array-like, shape (n_keyframes,)
        Those of the pattern, in frames of the clock, from 0 to ``P - 1``, increasing.
    n_frames : array-like of int, shape (n_sequences,)
        Lengths of the performances, at least 2.
    frame_rate : float or array-like of shape (n_sequences,), default=None
        Frames a second of the performances, one for each if they differ: gives the error in
        seconds.
    quantile : float in [0, 1], default=None
        That quantile instead of the mean.

    Returns
    -------
    float
        In frames of the clock, or in seconds.

    Raises
    ------
    ValueError
        If there are not as many warps, key-frames and lengths, a key-frame is outside its clip, or
        a frame rate is not above 0.

    Examples
    --------
    >>> from sklearn_motionsync.metrics import keyframe_error
    >>> keyframe_error([[0, 1, 2, 3, 4]], [[5]], [2], [9])
    0.5
    >>> keyframe_error([[0, 1, 2, 3, 4]], [[5]], [2], [9], frame_rate=10)
    0.1
    """
    times = as_times(times)
    n_sequences, P = times.shape
    lengths = as_lengths(n_frames, n_sequences)
    keyframes, pattern_keyframes = as_keyframes(keyframes, pattern_keyframes, lengths, P)
    own = (lengths[:, np.newaxis] - 1) / (P - 1)
    landed = evaluate_warps(times, np.tile(pattern_keyframes, (n_sequences, 1)))
    errors = np.abs(landed - keyframes / own)
    if frame_rate is not None:
        with np.errstate(over="ignore"):
            errors = errors * own / as_frame_rates(frame_rate, n_sequences)
        if not np.isfinite(errors).all():
            raise ValueError(f"frame_rate={frame_rate!r} is too small: the error is infinite.")
    return _summary(errors, quantile)


# -- health of the warps ------------------------------------------------------------------


def pause_share(times):
    """Share of frames at which a performance stands still: ``mean [tau(p+1) <= tau(p)]``.

    Equal to a billionth of a frame; a step back counts as standing still, too.

    Parameters
    ----------
    times : array-like, shape (n_sequences, P)

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If times are not all from 0 to P - 1.

    Examples
    --------
    >>> from sklearn_motionsync.metrics import pause_share
    >>> pause_share([[0, 0, 2, 3, 4]])
    0.25
    """
    return float((np.diff(as_times(times)) <= 1e-9).mean())


def roughness(times):
    """Root mean square of the changes of rate, ``tau(p+1) - 2 tau(p) + tau(p-1)``.

    On a clock of two frames there is one rate, which cannot change: 0.

    Parameters
    ----------
    times : array-like, shape (n_sequences, P)

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If times are not all from 0 to P - 1.

    Examples
    --------
    >>> from sklearn_motionsync.metrics import roughness
    >>> roughness([[0, 0, 1, 3]])
    1.0
    """
    changes = np.diff(as_times(times), 2)
    return float(np.sqrt(np.square(changes).mean())) if changes.size else 0.0


def inverse_consistency(times, back):
    """How far there and back misses: ``mean |tau_mn(tau_nm(p)) - p|``, in frames.

    Parameters
    ----------
    times, back : array-like, shape (n_sequences, P)
        Warps from a base to sequences, and from each of these to the base.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If times are not all from 0 to P - 1, or differ in shape.

    Examples
    --------
    >>> from sklearn_motionsync.metrics import inverse_consistency
    >>> inverse_consistency([[0, 2, 3, 3.5, 4]], [[0, 1, 2, 3, 4]])
    0.5
    """
    times, back = as_times(times), as_times(back, "back")
    check_same_shape(times, back, "back")
    return float(np.abs(evaluate_warps(back, times) - np.arange(times.shape[1])).mean())


# -- helpers --------------------------------------------------------------------------------


def _summary(errors, quantile):
    quantile = as_quantile(quantile)
    return float(errors.mean() if quantile is None else np.quantile(errors, quantile))
