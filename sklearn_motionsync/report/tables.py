"""Tables of a report: its trials, their groups and timing, and aligned curves frame by frame."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from ..comparison.curves import AlignedCurves
from ..comparison.study import GroupsOfPeople
from ..display.arguments import labels_of_signals
from ..inputs.resampling import as_frame_rates
from ..inputs.validation import labels_of_input
from ..matching.counting import first_largest
from ..synchronizers.match import UNITS, rates_of
from ..utils.groups import names_of_groups
from ..utils.pipelines import index_of_pattern

__all__ = ["TrialSet", "as_text"]

# Numbers of the tables that have a row a frame, at most: some 4 MB of text.
MOST_NUMBERS = 500_000


def as_text(label):
    """A label of a trial; the levels of one with several are joined by commas."""
    return ", ".join(map(str, label)) if isinstance(label, tuple) else str(label)


class TrialSet(NamedTuple):
    """What is known of the trials of a report.

    Attributes
    ----------
    aligned : AlignedCurves
    names : list of str
    template : int or None
        Its index, if it is one of the trials.
    design : DataFrame
        What was given of each trial: ``group``, ``person``, ``covariate``.
    of_groups : GroupsOfPeople
    frames : ndarray of int, shape (n_sequences,)
        The lengths of the trials.
    seconds : ndarray, shape (n_sequences,), or None
        Their durations, if the frame rate is known.
    signals : list of str
        Names with units, in one line or two.
    """

    aligned: AlignedCurves
    names: list
    template: int | None
    design: pd.DataFrame
    of_groups: GroupsOfPeople
    frames: np.ndarray
    seconds: np.ndarray | None
    signals: list

    @classmethod
    def of(cls, X, aligned, frame_rate, groups, people, covariate):
        """Those of the arguments of `write_report`."""
        reached, n = aligned.reached, len(aligned.curves)
        of_groups = GroupsOfPeople.of(groups, people, n)
        design = {}
        if groups is not None:
            design["group"] = names_of_groups(groups, n)
        if people is not None:
            design["person"] = names_of_groups(people, n, name="people")
        if covariate is not None:
            design["covariate"] = np.asarray(covariate, dtype=float)
        frames = np.array([len(x) for x in reached.performances])
        rates = rates_of(X, frame_rate)
        units = dict(zip(aligned.names, aligned.units, strict=True))
        return cls(
            aligned,
            list(map(as_text, labels_of_input(X, reached.performances)[0])),
            index_of_pattern(reached.synchronizer, reached.performances),
            pd.DataFrame(design, index=range(n)),
            of_groups,
            frames,
            None if rates is None else (frames - 1) / np.ravel(as_frame_rates(rates, n)),
            labels_of_signals(aligned.names, units),
        )

    @property
    def headings(self):
        """The signals in one line."""
        return [label.replace("\n", " ") for label in self.signals]

    @property
    def reasons(self):
        """Why trials are doubtful, None for those that are not; None if the match tells nothing."""
        match = self.aligned.match
        return None if match.intervals is None else match.reasons

    @property
    def columns(self):
        """Names of the columns of timing: the mean, the largest, and where that is."""
        unit = UNITS[self.aligned.unit]
        return f"mean absolute offset ({unit})", f"largest offset ({unit})", f"at ({unit})"

    def table(self):
        """A row a trial: what is known of it, its length and its timing."""
        table = self.design.copy()
        table.insert(0, "trial", self.names)
        table["frames"] = self.frames
        if self.seconds is not None:
            table["seconds"] = self.seconds
        offsets, (mean, largest, place) = self.aligned.offsets, self.columns
        at = first_largest(np.abs(offsets), axis=1)
        table[mean] = np.abs(offsets).mean(axis=1)
        table[largest], table[place] = offsets[np.arange(len(offsets)), at], self.aligned.clock[at]
        table["template"] = np.arange(len(table)) == self.template
        if self.reasons is not None:
            table["doubtful"] = self.aligned.match.doubtful
        return table

    def _members(self):
        """For each group the beginning of its row in a table, its people, and its trials."""
        for label, maker in zip(self.of_groups.labels, self.of_groups.makers, strict=True):
            yield {"group": label} if "group" in self.design else {}, maker, maker.any(axis=0)

    def groups(self):
        """A row a group: its people, its trials, and how long these are."""
        lengths = self.frames if self.seconds is None else self.seconds
        unit = "frames" if self.seconds is None else "seconds"
        rows = []
        for row, maker, members in self._members():
            if "person" in self.design:
                row["people"] = len(maker)
            row["trials"], of_group = members.sum(), lengths[members]
            spread = of_group.std(ddof=1) if len(of_group) > 1 else np.nan
            rows.append(row | {f"{unit}, mean": of_group.mean(), f"{unit}, SD": spread})
        return pd.DataFrame(rows)

    def timing(self):
        """A row a group: the offsets of its trials."""
        table, rows, (mean, largest, at) = self.table(), [], self.columns
        for row, _, members in self._members():
            of_group = table[members]
            first = of_group.loc[of_group[largest].abs().idxmax()]
            row |= {mean: of_group[mean].mean(), largest: first[largest], at: first[at]}
            rows.append(row | {"of trial": first["trial"]})
        return pd.DataFrame(rows)

    def spread(self):
        """A row a signal: how much trials differ, time-normalised and aligned."""
        even, curves = (
            np.sqrt(x.var(axis=0).mean(axis=0)) for x in (self.aligned.even, self.aligned.curves)
        )
        table = {"signal": self.headings, "time-normalised": even, "aligned": curves}
        percents = 100 * np.divide(curves, even, out=np.full_like(even, np.nan), where=even > 0)
        return pd.DataFrame(table | {"left (%)": percents})

    @property
    def step(self):
        """Every so many frames are in the tables that have a row a frame."""
        n, n_frames, width = self.aligned.curves.shape
        return -(-n * n_frames * (width + 4) // MOST_NUMBERS)

    def by_frame(self):
        """Two tables with a row a trial and frame: the timing, and the aligned curves."""
        match, clock = self.aligned.match, self.aligned.clock
        frames = np.arange(0, len(clock), self.step)
        n, unit = len(match.times), UNITS[self.aligned.unit]
        index = self.design.loc[np.repeat(range(n), len(frames))].reset_index(drop=True)
        index.insert(0, "trial", np.repeat(self.names, len(frames)))
        index["frame of the template"] = np.tile(frames, n)
        if self.aligned.unit != "frames":
            index[f"time of the template ({unit})"] = np.tile(clock[frames], n)
        timing = index.copy()
        timing[f"offset ({unit})"] = self.aligned.offsets[:, frames].ravel()
        timing["frame of the trial"] = match.frames(self.frames)[:, frames].ravel()
        timing["rate"] = match.rates[:, frames].ravel()
        curves = self.aligned.curves[:, frames].reshape(n * len(frames), -1)
        return timing, pd.concat([index, pd.DataFrame(curves, columns=self.headings)], axis=1)
