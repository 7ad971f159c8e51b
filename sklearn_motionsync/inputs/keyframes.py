"""Key-frames that are given: one row a trial, in frames or seconds, NaN for not known."""

import numpy as np
import pandas as pd

from .numbers import as_numbers
from .recorded import refuse_seconds
from .resampling import as_frame_rates
from .wording import counted

__all__ = ["Keyframes"]


class Keyframes:
    """The key-frames of a set of trials.

    Parameters
    ----------
    keyframes : list of arrays (n_keyframes,), 2-D array or DataFrame
        One row a trial; None for one of which nothing is known.
    n_sequences : int
        Trials in the set.
    frame_rate : float, or array-like of shape (n_sequences,), default=None
        Frames per second: key-frames are seconds.
    name : str, default="keyframes"
        The argument, for messages.
    """

    def __init__(self, keyframes, n_sequences, frame_rate=None, *, name="keyframes"):
        self._labels, self._name = None, name
        if isinstance(keyframes, (pd.DataFrame, pd.Series)):
            # One row a trial; iterating would give columns.
            if not isinstance(keyframes.index, pd.RangeIndex):
                self._labels = keyframes.index.to_list()
            keyframes = keyframes.to_numpy()
        if not hasattr(keyframes, "__len__") or len(keyframes) != n_sequences:
            raise ValueError(
                f"{name} must be a list of {n_sequences} arrays (n_keyframes,), one a "
                f"trial; got {keyframes!r:.200}."
            )
        self._rows, self._rates = list(keyframes), None
        if frame_rate is not None:
            rates = as_frame_rates(frame_rate, n_sequences)
            self._rates = np.broadcast_to(rates, (n_sequences, 1))[:, 0]

    def shares(self, trials, count=None):
        """Key-frames (n_sequences, n_keyframes) as shares of the trials, NaN for not known.

        Parameters
        ----------
        trials : Trials
            All or, by their ``numbers``, some of the set.
        count : int, default=None
            Key-frames of each; by default as many as the first has.
        """
        numbers = range(len(self._rows))
        if len(trials) < len(self._rows):
            numbers = trials.numbers
        self._check_labels([trials.labels[i] for i in range(len(trials))], numbers)
        if count is None:
            counts = [np.size(row) for row in self._rows if row is not None]
            count = counts[0] if counts else 0
        out = np.full((len(trials), count), np.nan)
        for row, i, x in zip(out, numbers, trials, strict=True):
            if self._rows[i] is not None:
                row[:] = self._checked(i, len(x), count)
        return out

    def known(self, trials):
        """Key-frames of a training set as from `shares`, each of them known in some trial."""
        out = self.shares(trials)
        missing = np.flatnonzero(np.isnan(out).all(axis=0))
        if len(missing) or not out.shape[1]:
            which = f"key-frame {missing[0]}" if len(missing) else "a key-frame"
            raise ValueError(
                f"{self._name}: {which} is known in no trial. Leave it out, or give its "
                "frame in at least one."
            )
        return out

    def _checked(self, i, n_frames, count):
        """The key-frames of one trial, as shares."""
        row = self._rows[i]
        frames = as_numbers(row, f"Trial {i}: {self._name}", dtype=np.float64)
        known_frames = frames[~np.isnan(frames)] if frames.shape == (count,) else frames.ravel()
        if self._rates is not None:
            frames, known_frames = frames * self._rates[i], known_frames * self._rates[i]
        else:
            refuse_seconds(known_frames, n_frames, f"Trial {i}")
        path = np.concatenate([[0], known_frames, [n_frames - 1]])
        if frames.shape != (count,) or count == 0 or not (np.diff(path) > 0).all():
            unit = "" if self._rates is None else f" times {self._rates[i]:g} frames per second"
            raise ValueError(
                f"Trial {i}: key-frames must be "
                f"{counted(count, 'increasing frame') if count else 'some increasing frames'} "
                f"between 0 and {n_frames - 1}, both excluded, NaN where one is not known, "
                f"got {row}{unit}."
            )
        return frames / (n_frames - 1)

    def _check_labels(self, labels, numbers):
        """Refuse rows of a table that are labelled otherwise than the trials."""
        if self._labels is None:
            return
        in_order = list(range(len(self._labels)))
        if labels == list(numbers):
            # Of trials without labels only their numbers tell another order.
            if self._labels != in_order and set(self._labels) == set(in_order):
                raise ValueError(
                    f"The rows of {self._name} are labelled {self._labels[:8]}: the numbers of the "
                    f"trials, in another order. Give {self._name}.sort_index(), or, if "
                    "they are in the order of the trials, "
                    f"{self._name}.reset_index(drop=True)."
                )
            return
        for place, (label, i) in enumerate(zip(labels, numbers, strict=True)):
            if self._labels[i] != label:
                raise ValueError(
                    f"Trial {place} is labelled {label!r}, and its row of {self._name} "
                    f"{self._labels[i]!r}. Give rows in the order of the trials: "
                    f"{self._name}.loc[labels]."
                )
