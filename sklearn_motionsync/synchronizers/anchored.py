"""AnchoredSynchronizer: the base of synchronizers that take key-frames."""

from __future__ import annotations

from typing import Any, Literal, Self

import numpy as np

from ..inputs.keyframes import Keyframes
from ..inputs.recorded import refuse_moved_events
from ..inputs.resampling import as_frame_rates
from ..inputs.types import (
    Indexed,
    NumbersLike,
    PerformancesLike,
    SupportsArray,
    Transformed,
    ValuesLike,
)
from ..utils.parameters import validated
from .base import Synchronizer
from .gaps import with_confidence
from .match import Match
from .training import TrainingSet

__all__ = ["AnchoredSynchronizer"]


class AnchoredSynchronizer(Synchronizer):
    """Base class of synchronizers whose methods take key-frames.

    A subclass defines ``_learn(training, progress)``, as `Synchronizer`, with the key-frames of the
    training set; and ``_match(performances, keyframes, frame_rate)``, which calls ``_shares`` for
    the same.
    """

    keyframes_: np.ndarray | None

    def fit(
        self,
        X: PerformancesLike,
        y: object = None,
        keyframes: Indexed[ValuesLike | None] | SupportsArray | None = None,
        frame_rate: float | ValuesLike | None = None,
        confidence: Indexed[NumbersLike] | None = None,
    ) -> Self:
        """Learn from performances, of which key-frames may be known.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Performances; the rows of a 2-D array are univariate ones.
        y : ignored
            Present for API consistency.
        keyframes : list of arrays (n_keyframes,), 2-D array or DataFrame, default=None
            One row a performance, in its own frames, counted from its first row (fractions
            allowed), increasing. NaN, or None for a whole row, where one is not known.
        frame_rate : float, or array-like of shape (n_sequences,), default=None
            Frames per second of X. With it key-frames are seconds.
        confidence : list of arrays (n_frames_i,) or (n_frames_i, n_features), default=None
            How sure it is what was seen, from 0 to 1, such as of a markerless system. Below 0.5 is
            as NaN: not seen. Above, it is the weight of what was seen.

        Returns
        -------
        self : Synchronizer
            The fitted synchronizer.

        Raises
        ------
        ValueError
            If the input breaks the contract, or the pattern does not exist or fit. If key-frames
            are not increasing, inside their performance and equally many in all; if they look like
            seconds, all below 1 or in the first fiftieth of a performance and not whole; if no
            performance has one of them; or if performances have events whose frames are not their
            rows.
        """
        self._fit(X, keyframes, frame_rate, confidence)
        return self

    @validated
    def _fit(self, X, keyframes, frame_rate, confidence):
        """Fit, and return the `TrainingSet`."""
        with self._progress(fits=True) as progress:
            training = self._read_training_set(X, confidence=confidence)
            if keyframes is not None:
                refuse_moved_events(X)
                rows = Keyframes(keyframes, training.population, frame_rate)
                shares = rows.known(training.trials)
                training = TrainingSet(
                    training.trials, training.filler, training.population, shares
                )
            elif frame_rate is not None:
                as_frame_rates(frame_rate)
            learnt = self._learn(training, progress)
        self.__dict__.update(learnt)
        return training

    # scikit-learn's takes whatever ``fit`` takes, without its name.
    def fit_transform(  # type: ignore[override]
        self,
        X: PerformancesLike,
        y: object = None,
        keyframes: Indexed[ValuesLike | None] | SupportsArray | None = None,
        frame_rate: float | ValuesLike | None = None,
        confidence: Indexed[NumbersLike] | None = None,
    ) -> Transformed:
        """Fit, and warp the same performances.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Performances; the rows of a 2-D array are univariate ones.
        y : ignored
            Present for API consistency.
        keyframes : list of arrays (n_keyframes,), 2-D array or DataFrame, default=None
            Key-frames of each performance, as for ``fit``.
        frame_rate : float, or array-like of shape (n_sequences,), default=None
            As for ``fit``.
        confidence : list of arrays (n_frames_i,) or (n_frames_i, n_features), default=None
            As for ``fit``.

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features)
            As from ``transform``.
        """
        self.fit(X, y, keyframes, frame_rate, confidence)
        return self.transform(X, keyframes, frame_rate, confidence)

    def transform(
        self,
        X: PerformancesLike,
        keyframes: Indexed[ValuesLike | None] | SupportsArray | None = None,
        frame_rate: float | ValuesLike | None = None,
        confidence: Indexed[NumbersLike] | None = None,
        *,
        fill: Literal["model"] | None = None,
    ) -> Transformed:
        """Warp performances onto the clock of the pattern (Eq. 18).

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Performances. Memory maps, and collections that give performances by index, are read in
            parts, once each, if no key-frames are given; rows of a matrix are loaded into memory.
        keyframes : list of arrays (n_keyframes,), 2-D array or DataFrame, default=None
            Key-frames of each performance, as for ``fit``.
        frame_rate : float, or array-like of shape (n_sequences,), default=None
            As for ``fit``.
        confidence : list of arrays (n_frames_i,) or (n_frames_i, n_features), default=None
            As for ``fit``.
        fill : {None, "model"}, default=None
            What becomes of NaN, which is what was hidden. None: it stays NaN, feature by feature.
            "model": it is filled from the mean of the warped training set (``examples_``) at the
            same moment, moved by how far the performance is from the mean around the gap, and in
            the features that are seen.

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features)
            ``(n_sequences, P)`` for 2-D input; a ``(performance, frame)`` frame under
            ``set_output(transform="pandas")``.
        """
        return self._warp(X, fill, **self._given(X, keyframes, frame_rate, confidence))

    def match(
        self,
        X: PerformancesLike,
        keyframes: Indexed[ValuesLike | None] | SupportsArray | None = None,
        frame_rate: float | ValuesLike | None = None,
        confidence: Indexed[NumbersLike] | None = None,
    ) -> Match:
        """Match performances to the pattern: the warps of ``transform``.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Performances; the rows of a 2-D array are univariate ones.
            Read in parts as by ``transform``.
        keyframes : list of arrays (n_keyframes,), 2-D array or DataFrame, default=None
            Key-frames of each performance, as for ``fit``.
        frame_rate : float, or array-like of shape (n_sequences,), default=None
            As for ``fit``.
        confidence : list of arrays (n_frames_i,) or (n_frames_i, n_features), default=None
            As for ``fit``.

        Returns
        -------
        Match
            ``offsets`` Delta(p) and ``times`` tau(p), shape (n_sequences, P), in frames of
            the pattern; ``distances``, shape (n_sequences,).
        """
        params = self._given(X, keyframes, frame_rate, confidence)
        if not params:
            return self._match_in_parts(X)
        return self._match(self.check_performances(X), **params)

    def _given(self, X, keyframes, frame_rate, confidence=None) -> dict[str, Any]:
        """What is given, as arguments of ``_match`` and ``_warp_part``."""
        params: dict[str, Any] = {}
        if keyframes is not None:
            refuse_moved_events(X)
            params |= {"keyframes": keyframes, "frame_rate": frame_rate}
        elif frame_rate is not None:
            as_frame_rates(frame_rate)
        if confidence is not None:
            params["confidence"] = confidence
        return params

    def _warp_part(self, performances, keyframes=None, frame_rate=None, confidence=None):
        performances = with_confidence(performances, confidence)
        return self._match(performances, keyframes, frame_rate).warp(performances)

    def _shares(self, performances, keyframes, frame_rate):
        """Key-frames of performances as shares of them, by those of the fit; None if none are."""
        if keyframes is None:
            return None
        if self.keyframes_ is None:
            raise ValueError(
                f"Key-frames are given, and this {type(self).__name__} was fitted without any, so "
                "it does not know where they are in the pattern. Fit it with keyframes=[...], too."
            )
        rows = Keyframes(keyframes, len(performances), frame_rate)
        return rows.shares(performances, len(self.keyframes_))
