"""What is known of recorded trials beside their numbers: read once, and carried from there on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from .collections import NOT_ONE, Trials, as_collection, as_source
from .numbers import as_numbers
from .recorded import frame_rate_of_rows
from .resampling import as_frame_rates
from .tables import INDEX_NAMES, index_of, labels_of, name_trial
from .wording import counted, within


class TrialFacts(NamedTuple):
    """The lengths of trials, their frame rates, and what they are called.

    Attributes
    ----------
    lengths : ndarray of float, shape (n_sequences,)
        How many frames each has as recorded.
    frame_rates : ndarray, shape (n_sequences,)
        Frames a second: as they were given, or else as tables tell them; NaN where not known.
    labels : list
        Of the trials: those of tables, or their numbers.
    levels : tuple of str
        Names of the levels of the labels, and of frames.
    """

    lengths: np.ndarray
    frame_rates: np.ndarray
    labels: list
    levels: tuple

    @classmethod
    def of(cls, X, frame_rate=None, checked=None):
        """The facts of trials.

        Parameters
        ----------
        X : trials of any kind, or array-like of numbers, shape (n_sequences,)
            Or how many frames each has.
        frame_rate : float, or array-like of shape (n_sequences,), default=None
            Frames a second of all or of each; by default what tables tell.
        checked : Trials, default=None
            The same trials after the check of an estimator, which rows of a matrix need, and what
            is read in parts.

        Returns
        -------
        TrialFacts

        Raises
        ------
        ValueError
            If X is no set of trials, or there is no such frame rate.
        """
        is_plain = hasattr(X, "__len__") and not isinstance(X, Mapping)
        is_plain = is_plain and not hasattr(X, "columns") and all(np.ndim(n) == 0 for n in X)
        is_plain = is_plain or isinstance(X, Trials)
        is_read = is_plain or (checked is not None and as_source(X) is not None)
        sequences = None if is_read else as_collection(X)
        if sequences is None and not is_plain and checked is not None:
            X = checked
        if isinstance(X, Trials):
            labels, levels, lengths = X.labels, X.levels, [len(x) for x in X]
            rates = [each.get("frame_rate") for each in X.facts]
        elif sequences is not None:
            labels, levels = labels_of(sequences)
            lengths, rates = list(map(len, sequences)), list(map(frame_rate_of_rows, sequences))
        elif is_plain:
            lengths, rates, labels, levels = X, [], list(range(len(X))), INDEX_NAMES
        else:
            raise ValueError(
                f"{NOT_ONE} For univariate trials in rows give how many frames each has, "
                "[X.shape[1]] * len(X)."
            )
        lengths = as_numbers(lengths, "The lengths", dtype=np.float64)
        sound = (lengths >= 2) & (lengths == np.floor(lengths))
        if not sound.all():
            i = int(np.argmin(sound))
            raise ValueError(
                f"Trial {i} has {counted(lengths[i], 'frame')}; give the trials, or "
                "how many frames each has, whole numbers of at least 2."
            )
        rates = np.array(rates if len(rates) == len(lengths) else [None] * len(lengths))
        facts = cls(lengths, rates.astype(np.float64), labels, levels)
        return facts if frame_rate is None else facts.at(frame_rate)

    @classmethod
    def joined(cls, parts):
        """The facts of trials that were read in parts; they are numbered where labels repeat."""
        lengths, rates, labels, levels = zip(*parts, strict=True)
        labels, levels = [label for each in labels for label in each], set(levels)
        if len(levels) > 1 or len(set(labels)) < len(labels):
            labels, levels = list(range(len(labels))), {INDEX_NAMES}
        return cls(np.concatenate(lengths), np.concatenate(rates), labels, levels.pop())

    def label(self, trials):
        """Checked trials, called as they were when they were recorded."""
        trials.labels, trials.levels = self.labels, self.levels
        return trials

    def at(self, frame_rate):
        """The same with a frame rate that is given."""
        return self._replace(frame_rates=as_frame_rates(frame_rate, len(self.lengths)))

    @property
    def are_timed(self):
        """Whether the frame rates of all are known."""
        return not np.isnan(self.frame_rates).any()

    def known_rates(self):
        """The frame rates; an error if one is not known."""
        if not self.are_timed:
            i = int(np.isnan(self.frame_rates).argmax())
            raise ValueError(
                f"The frame rate of {within(name_trial(i, self.labels[i]))} is not known: give "
                "frame_rate=, or tables whose attrs or index tell it."
            )
        return self.frame_rates

    def durations(self):
        """How many seconds each trial lasts: (n_sequences,)."""
        return (self.lengths - 1) / self.known_rates()

    @property
    def index(self):
        """The labels as an index, of several levels if they have several."""
        return index_of(self.labels, self.levels[:-1])
