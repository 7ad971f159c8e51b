"""Key-frames that are given: one row a trial, in frames or seconds, NaN for not known."""

from collections import Counter

import numpy as np
import pandas as pd

from .numbers import as_numbers
from .recorded import refuse_seconds
from .resampling import as_frame_rates
from .wording import counted


class Keyframes:
    """The key-frames of a set of trials.

    Parameters
    ----------
    keyframes : list of arrays (n_keyframes,), 2-D array or DataFrame
        One row a trial; None for one of which nothing is known. Rows of a table go by the labels of
        the trials, if these have some.
    n_sequences : int
        Trials in the set.
    frame_rate : float, or array-like of shape (n_sequences,), default=None
        Frames per second: key-frames are seconds.
    name : str, default="keyframes"
        The argument, for messages.
    anywhere : bool, default=False
        Whether they may be in any order, and the first or last frame of a trial: marks, by which
        nothing is matched.
    """

    def __init__(
        self, keyframes, n_sequences, frame_rate=None, *, name="keyframes", anywhere=False
    ):
        self._labels, self._name, self._anywhere = None, name, anywhere
        if isinstance(keyframes, (pd.DataFrame, pd.Series)):
            # One row a trial; iterating would give columns.
            if not keyframes.index.equals(pd.RangeIndex(len(keyframes))):
                self._labels = keyframes.index.to_list()
            keyframes = keyframes.to_numpy()
        self._count = n_sequences
        if not hasattr(keyframes, "__len__") or (
            self._labels is None and len(keyframes) != n_sequences
        ):
            self._refuse_count(keyframes)
        self._rows, self._rates = list(keyframes), None
        if frame_rate is not None:
            self._rates = as_frame_rates(frame_rate, n_sequences)

    def shares(self, trials, count=None):
        """Key-frames (n_sequences, n_keyframes) as shares of the trials, NaN for not known.

        Parameters
        ----------
        trials : Trials
            All or, by their ``numbers``, some of the set.
        count : int, default=None
            Key-frames of each; by default as many as the first has.
        """
        numbers, rows = self._numbers(trials), self.in_order(trials)
        if count is None:
            counts = [np.size(row) for row in self._rows if row is not None]
            count = counts[0] if counts else 0
        out = np.full((len(trials), count), np.nan)
        for shares, row, i, x in zip(out, rows, numbers, trials, strict=True):
            if row is not None:
                shares[:] = self._checked(row, i, len(x), count)
        return out

    def in_order(self, trials):
        """The rows of trials, as they were given."""
        labels, numbers = list(trials.labels[: len(trials)]), self._numbers(trials)
        if self._labels is None or labels == list(numbers):
            # Of trials without labels only their numbers tell another order.
            all_numbers = list(range(len(self._rows)))
            if len(all_numbers) != self._count:
                self._refuse_count(self._rows)
            if self._labels not in (None, all_numbers) and set(self._labels) == set(all_numbers):
                raise ValueError(
                    f"The rows of {self._name} are labelled {self._labels[:8]}: the numbers of the "
                    f"trials, in another order. Give {self._name}.sort_index(), or, if "
                    "they are in the order of the trials, "
                    f"{self._name}.reset_index(drop=True)."
                )
            return [self._rows[i] for i in numbers]
        counts = Counter(self._labels)
        for place, label in enumerate(labels):
            if counts[label] != 1:
                raise ValueError(
                    f"Trial {place} is labelled {label!r}, and {self._name} has "
                    f"{counted(counts[label], 'row')} of this label: give one for each trial, or "
                    f"{self._name}.to_numpy() in the order of the trials."
                )
        row_by_label = dict(zip(self._labels, self._rows, strict=True))
        return [row_by_label[label] for label in labels]

    def _numbers(self, trials):
        return trials.numbers if len(trials) < self._count else range(self._count)

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

    def _checked(self, row, i, n_frames, count):
        """The key-frames of one trial, as shares."""
        frames = as_numbers(row, f"Trial {i}: {self._name}", dtype=np.float64)
        known_frames = frames[~np.isnan(frames)] if frames.shape == (count,) else frames.ravel()
        if self._rates is not None:
            frames, known_frames = frames * self._rates[i], known_frames * self._rates[i]
        else:
            refuse_seconds(known_frames, n_frames, f"Trial {i}")
        path = np.concatenate([[0], known_frames, [n_frames - 1]])
        is_inside = (np.diff(path) > 0).all()
        kind, ends = "increasing frame", "excluded"
        if self._anywhere:
            is_inside = ((path >= 0) & (path <= n_frames - 1)).all()
            kind, ends = "frame", "included"
        if frames.shape != (count,) or count == 0 or not is_inside:
            unit = "" if self._rates is None else f" times {self._rates[i]:g} frames per second"
            raise ValueError(
                f"Trial {i}: key-frames must be "
                f"{counted(count, kind) if count else f'some {kind}s'} "
                f"between 0 and {n_frames - 1}, both {ends}, NaN where one is not known, "
                f"got {row}{unit}."
            )
        return frames / (n_frames - 1)

    def _refuse_count(self, keyframes):
        raise ValueError(
            f"{self._name} must be a list of {self._count} arrays (n_keyframes,), one a "
            f"trial; got {keyframes!r:.200}."
        )
