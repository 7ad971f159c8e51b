"""The curves and the offsets of trials on one clock, which are compared between people."""

from __future__ import annotations

import warnings
from typing import NamedTuple

import numpy as np
from sklearn.base import clone

from ..inputs.collections import as_collection
from ..inputs.facts import units_of_columns
from ..inputs.features import choose_features, names_of_features
from ..inputs.numbers import check_finite
from ..inputs.validation import read_collection
from ..inputs.wording import counted
from ..synchronizers.dense import DenseSynchronizer
from ..synchronizers.match import Match, check_unit
from ..utils.pipelines import Routed, route_to_synchronizer

# Features are left out of a match in so many parts.
_MOST_PARTS = 8


class AlignedCurves(NamedTuple):
    """Signals of trials on the clock of the pattern, and the timing that this took away.

    Attributes
    ----------
    names : list of str
        Of the signals.
    units : list of str
        Of the signals; empty where none is known.
    curves, even : ndarray, shape (n_sequences, P, n_signals)
        Aligned, and after linear normalisation.
    offsets : ndarray, shape (n_sequences, P)
        In the unit of time.
    clock : ndarray, shape (P,)
        The times of the frames of the pattern, in the unit of time.
    unit : str
        Of time.
    match : Match
    reached : Routed
        The synchronizer, and the trials that reach it.
    """

    names: list
    units: list
    curves: np.ndarray
    even: np.ndarray
    offsets: np.ndarray
    clock: np.ndarray
    unit: str
    match: Match
    reached: Routed

    @classmethod
    def of(cls, estimator, X, params, caller, *, signals, features, unit):
        """Match trials, and warp their signals.

        Parameters
        ----------
        estimator : synchronizer, Pipeline with one, or Match
            Fitted.
        X : trials, as the estimator takes them
        params : dict
            Other arguments of ``match``.
        caller : str
            The function that the user called, for messages.
        signals : trials, or None
            One sequence of any length a trial. None: X itself, if what reaches the
            synchronizer has the same features, such as after scaling; otherwise that.
        features : int, str or list of them, or None
            Those of the signals; None for all.
        unit : {"frames", "percent", "seconds"}
            Of time.
        """
        check_unit(unit)
        reached = route_to_synchronizer(estimator, X, params, caller)
        names, units, sequences = _signals(X, reached, signals, features)
        match, n = reached.match(), len(reached.trials)
        last = reached.synchronizer.n_frames_ - 1
        offsets = match.offsets_in(unit)
        clock = np.arange(last + 1.0)
        if unit == "percent":
            clock *= 100 / last
        elif unit == "seconds":
            clock *= np.median(reached.facts.durations()) / last
        even = Match(np.tile(np.arange(last + 1.0), (n, 1))).warp(sequences)
        return cls(names, units, match.warp(sequences), even, offsets, clock, unit, match, reached)

    def offsets_of_others(self):
        """Offsets of matches in which some features are left out, each in turn: at most 8 parts.

        Yields
        ------
        ndarray, shape (n_sequences, P)
            In frames. Nothing with a single feature, of other synchronizers than a
            `DenseSynchronizer`, or where the features that are left support no warps.
        """
        reached = self.reached
        sync, trials = reached.synchronizer, reached.trials
        n = trials[0].shape[1]
        if not isinstance(sync, DenseSynchronizer) or n < 2:
            return
        # Confidences belong to all features.
        params = {k: v for k, v in reached.params.items() if k in ("keyframes", "frame_rate")}
        for out in np.array_split(np.arange(n), min(n, _MOST_PARTS)):
            reduced = [np.delete(x, out, axis=1) for x in trials]
            one = clone(sync).set_params(pattern=np.delete(sync.pattern_, out, axis=1), verbose=0)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                offsets = one.fit(reduced, **params).match(reduced, **params).offsets
            if offsets.any():
                yield offsets


def _signals(X, reached, signals, features):
    """Names and units of the chosen signals, and their arrays (n_frames_i, n_chosen)."""
    sequences = reached.trials
    n, width = len(sequences), sequences[0].shape[1]
    names = names_of_features(reached.before, reached.synchronizer, width)
    units = [""] * width
    if signals is None and as_collection(X) is not None:
        arrays, columns = read_collection(X)
        if (columns or [f"x{i}" for i in range(arrays[0].shape[1])]) == names:
            signals = X
    if signals is not None:
        sequences, columns = read_collection(signals)
        if len(sequences) != n:
            raise ValueError(
                f"signals must have one sequence for each of {counted(n, 'trial')}, got "
                f"{len(sequences)}."
            )
        names = columns or [f"x{i}" for i in range(sequences[0].shape[1])]
        unit_by_name = units_of_columns(as_collection(signals)[0])
        units = [unit_by_name.get(name, "") for name in names]
    chosen = range(len(names)) if features is None else choose_features(features, names)
    names, units = [names[i] for i in chosen], [units[i] for i in chosen]
    sequences = [x[:, chosen] for x in sequences]
    for i, x in enumerate(sequences):
        check_finite(x, f"Trial {i}, frame", names)
    return names, units, sequences
