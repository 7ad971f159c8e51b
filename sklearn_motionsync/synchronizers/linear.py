"""LinearSynchronizer: linear normalisation (Eq. 7), and between key-frames (Figs. 1c and 3c)."""

from __future__ import annotations

import numpy as np

from ..inputs.validation import names_of_input
from ..matching.anchors import first_meeting
from ..matching.sizes import BATCH
from ..matching.warps import even_slices, normalise, sample
from .base import AnchoredSynchronizer
from .match import Match
from .training import check_pattern


class LinearSynchronizer(AnchoredSynchronizer):
    """Linear normalisation (Eq. 7): the same number of frames, no matching.

    The baseline of all other synchronizers: each trial is stretched evenly to ``n_frames``.
    If key-frames are given, it is stretched evenly between them, so that they coincide with those
    of the pattern, as in Figs. 1c and 3c of the paper. A key-frame that is not known is left out.

    Parameters
    ----------
    n_frames : int, default=None
        Frames of the common clock; by default the median length of the trials, or
        the length of a pattern given as an array.
    pattern : "median", int or array (n_frames, n_features), default="median"
        The reference of ``match``: the trial with the smallest sum of distances (Eq. 19,
        after warping by the key-frames if there are any), one chosen by its index, or another one.

    Attributes
    ----------
    pattern_ : ndarray, shape (P, n_features)
        The pattern on the common clock.
    pattern_index_ : int or None
        Its index in the training set; None if it was given as an array.
    n_frames_ : int
        ``P``.
    global_distances_ : ndarray, shape (n_sequences,)
        ``C_n`` of Eq. 19 for every trial; NaN if the pattern was given.
    keyframes_ : ndarray, shape (n_keyframes,), or None
        Key-frames of the pattern, in frames of the clock: its own, and for those it lacks the
        median of where those of the others meet it. None if none were given.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    lengths_ : ndarray of int, shape (n_sequences,)
        Numbers of frames of the training trials.
    examples_ : ndarray, shape (min(n_sequences, 64), P, n_features)
        Training trials linearly normalised: all, or 64 of them, evenly spaced.
    features_ : callable
        Turns poses on the clock into the features that searches compare.
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    DenseSynchronizer : Follows the changes of pace within a trial, and between key-frames.
    io.keyframes_from_events : Makes key-frames of a table of events.

    Notes
    -----
    After a fit with key-frames nothing else aligns trials, so ``match`` and ``transform``
    need them, too; None in the place of a row says that none of a trial are known. They are
    metadata: in a Pipeline enable scikit-learn's metadata routing and request them with
    ``set_fit_request(keyframes=True)`` and ``set_transform_request(keyframes=True)``, for scorers
    with ``set_score_request(keyframes=True)``. Scorers that are called directly, displays and
    ``Match.from_estimator`` take ``keyframes=...``.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import LinearSynchronizer
    >>> X = [np.arange(5.0)[:, None], np.arange(9.0)[:, None] / 2]
    >>> sync = LinearSynchronizer(n_frames=5, pattern=0)
    >>> sync.fit_transform(X)[1].ravel().tolist()
    [0.0, 1.0, 2.0, 3.0, 4.0]
    >>> sync.fit_transform(X, keyframes=[[2], [6]])[1].ravel().tolist()
    [0.0, 1.5, 3.0, 3.5, 4.0]
    """

    def _given(self, X, keyframes, frame_rate, confidence=None):
        if keyframes is None and getattr(self, "keyframes_", None) is not None:
            raise ValueError(
                "The synchronizer was fitted with key-frames: give those of these trials too, as "
                "keyframes=[...] beside X. Searches and cross_val_score pass them on by metadata "
                "routing, with set_score_request(keyframes=True) of the scorer."
            )
        return super()._given(X, keyframes, frame_rate, confidence)

    def _match(self, trials, keyframes=None, frame_rate=None):
        shares, n_frames = self._shares(trials, keyframes, frame_rate), self.n_frames_
        if shares is None:
            times = np.tile(np.arange(n_frames, dtype=np.float64), (len(trials), 1))
        else:
            times = piecewise_linear(self.keyframes_, shares * (n_frames - 1), n_frames)
        arrays, distances = list(self._without_gaps(trials)), np.empty(len(trials))
        for rows in even_slices(len(trials), BATCH):
            if shares is None:
                warped = normalise(arrays[rows], n_frames)
            else:
                warped = sample(arrays[rows], times[rows], n_frames)
            differences = np.square(warped - self.pattern_)
            distances[rows] = differences.sum(axis=(1, 2), dtype=np.float64)
        return Match(times, distances)

    def _learn(self, training, progress):
        pattern = check_pattern(self.pattern, training.trials, names_of_input(self))
        clock = self._put_on_clock(training._replace(keyframes=None), pattern)
        if training.keyframes is None:
            return self._learnt(training, clock, pattern, clock.poses) | {"keyframes_": None}
        keyframes = training.keyframes * (clock.n_frames - 1)
        # On the mean key-frames all trials are comparable, as on one clock.
        mean = np.maximum.accumulate(np.nanmean(keyframes, axis=0))
        times = piecewise_linear(mean, keyframes, clock.n_frames)
        comparable = clock.unit(sample(training.trials, times, clock.n_frames))
        learnt = self._learnt(training, clock, pattern, comparable)
        of_pattern = keyframes_of_pattern(learnt["pattern_index_"], keyframes, clock.n_frames)
        return learnt | {"keyframes_": of_pattern}


def piecewise_linear(keyframes, of_trials, n_frames):
    """The warps of straight lines between the key-frames that are known: (n_trials, P).

    Parameters
    ----------
    keyframes : ndarray, shape (n_keyframes,)
        Of the pattern, in frames of the clock, increasing; NaN where one is not known.
    of_trials : ndarray, shape (n_trials, n_keyframes)
        Those of the trials.
    n_frames : int
        ``P``.
    """
    frames, last = np.arange(n_frames), n_frames - 1
    times = np.empty((len(of_trials), n_frames))
    for tau, shown in zip(times, of_trials, strict=True):
        known = np.isfinite(keyframes + shown)
        tau[:] = np.interp(frames, [0, *keyframes[known], last], [0, *shown[known], last])
    return times


def keyframes_of_pattern(index, keyframes, n_frames):
    """Key-frames of the pattern: its own, or the median of where those of the others meet it.

    Parameters
    ----------
    index : int or None
        Of the pattern among the trials.
    keyframes : ndarray, shape (n_trials, n_keyframes)
        In frames of the clock; NaN where one is not known.
    n_frames : int
        ``P``.

    Returns
    -------
    ndarray, shape (n_keyframes,)
    """
    known = np.full(keyframes.shape[1], np.nan) if index is None else keyframes[index]
    if np.isfinite(known).all():
        return known
    times = piecewise_linear(known, keyframes, n_frames)
    met = np.nanmedian(first_meeting(times, keyframes), axis=0)
    return np.maximum.accumulate(np.where(np.isnan(known), met, known))
