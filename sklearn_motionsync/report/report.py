"""write_report: one HTML file about a set of aligned trials."""

from __future__ import annotations

import pathlib
import re
from collections.abc import Mapping
from html import escape
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from sklearn import config_context
from sklearn.base import BaseEstimator

from ..body.skeleton import Skeleton
from ..comparison.curves import AlignedCurves
from ..comparison.groups import compare_aligned
from ..comparison.study import GroupsOfPeople, Study
from ..display.arguments import labels_of_signals
from ..display.base import TimeAxis, named_keyframes, pyplot, text_of_label
from ..display.groups import GroupDisplay
from ..display.synchronization import SynchronizationDisplay
from ..inputs.features import choose_features
from ..inputs.types import (
    Features,
    Labels,
    Path,
    RandomState,
    TrialsLike,
    Unit,
)
from ..inputs.wording import counted
from ..matching.counting import first_largest
from ..synchronizers.match import UNITS, Match
from ..utils.files import check_path
from ..utils.groups import names_of_groups
from ..utils.pipelines import index_of_pattern
from .page import Page, number, paragraph, picture, table_of
from .player import add_player_of

# Signals in the figure if none are named; of more, the first four.
_MOST_SIGNALS = 6
# Numbers of the tables that have a row a frame, at most: some 4 MB of text.
MOST_NUMBERS = 500_000
# The place of an object in memory, which differs from run to run.
_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")


def write_report(
    path: Path,
    estimator: BaseEstimator | Match,
    X: TrialsLike,
    y: Labels | None = None,
    *,
    groups: Labels | None = None,
    covariate: bool = False,
    paired: bool = False,
    signals: TrialsLike | None = None,
    features: Features | None = None,
    skeleton: Skeleton | None = None,
    left_out: Mapping[Any, str] | None = None,
    title: str | None = None,
    unit: Unit = "percent",
    random_state: RandomState = 0,
    **params: Any,
) -> pathlib.Path:
    """Write a report about aligned trials: one HTML file that opens anywhere without a network.

    It has the signals before and after alignment, the timing of every trial, the test of groups,
    and doubtful trials, with tables as CSV. A player shows bodies side by side.

    Parameters
    ----------
    path : str or path
        Of the file, such as ``"report.html"``, which is replaced once the report is complete.
    estimator : synchronizer, Pipeline with one, or Match of X
        Fitted, as for `compare_groups`.
    X : trials
        As the estimator takes them.
    y : sequence of length n_sequences, default=None
        What the trials are told apart by, and compared: the label of the group of each; or with
        ``covariate`` a number for each, such as speed or age.
    groups : sequence of length n_sequences, default=None
        The subject of each trial.
    covariate : bool, default=False
        Whether ``y`` are numbers: a regression.
    paired : bool, default=False
        Whether every person has trials of both of two labels.
    signals : trials, default=None
        What is shown and compared; by default as in `compare_groups`.
    features : int, str or list of them, default=None
        Those of the signals; by default all, and in figures of more than six the first four.
    skeleton : Skeleton, default=None
        Of the joint positions X, for the player; by default that of a step of the pipeline.
    left_out : mapping of label to reason, default=None
        Trials that were left out before, and why.
    title : str, default=None
        Of the page; by default "Aligned trials".
    unit : {"percent", "frames", "seconds"}, default="percent"
        Of time, as in `compare_groups`.
    random_state : int, RandomState instance or None, default=0
        Draws the permutations of the test.
    **params : dict
        What synchronizing X takes besides: ``frame_rate``, frames a second of X, which seconds need
        where tables do not tell; ``keyframes``, which are seconds where a frame rate is given.

    Returns
    -------
    Path
        Of the file.

    Raises
    ------
    FileNotFoundError, ImportError
        If there is no such folder, or matplotlib is missing.
    ValueError
        If ``path`` or ``left_out`` is no such thing; or as from `compare_groups`.

    See Also
    --------
    compare_groups : The test, with more arguments.
    write_player : The player by itself.

    Examples
    --------
    >>> from sklearn_motionsync import DenseSynchronizer
    >>> from sklearn_motionsync.report import write_report
    >>> from sklearn_motionsync.datasets import make_gait
    >>> gait = make_gait(6, n_cycles=2, random_state=0)
    >>> sync = DenseSynchronizer(n_frames=51).fit(gait.data)
    >>> path = write_report("gait.html", sync, gait.data, groups=gait.person)
    >>> path.read_text(encoding="utf-8")[:15]
    '<!DOCTYPE html>'
    """
    path = check_path(path, "report.html")
    # In the style of matplotlib itself.
    with pyplot().style.context("default"):
        aligned = AlignedCurves.of(
            estimator, X, params, "write_report", signals=signals, features=features, unit=unit
        )
        comparison = None
        labels = None if covariate else y
        if y is not None or covariate or paired:
            n = len(aligned.curves)
            study = Study.of(y, groups, covariate=covariate, paired=paired, n=n)
            comparison = compare_aligned(aligned, study, random_state=random_state)
        trials = TrialSet.of(aligned, labels, groups, y if covariate else None)
        page = Page()
        _add_set(page, trials, left_out)
        _add_signals(page, trials, features)
        _add_timing(page, trials)
        if comparison is not None:
            display = GroupDisplay.from_estimator(
                aligned.match,
                X,
                labels,
                groups=groups,
                signals=signals,
                features=features,
                comparison=comparison,
                unit=unit,
            )
            _add_test(page, comparison, display.figure_, not covariate)
        _add_doubtful(page, trials)
        add_player_of(page, trials, X, params, skeleton)
    return page.write(path, "Aligned trials" if title is None else title)


# -- the sections --------------------------------------------------------------------------


def _add_set(page, trials, left_out):
    if left_out is not None and not isinstance(left_out, Mapping):
        raise ValueError(
            "left_out must be a mapping of labels of trials to reasons, such as "
            f"{{'trial 7': 'the marker fell off'}}, or None; got {left_out!r:.80}."
        )
    text = counted(len(trials.names), "trial")
    if "person" in trials.design:
        n_people = trials.design["person"].nunique()
        text += f" of {n_people} {'person' if n_people == 1 else 'people'}"
    if "group" in trials.design:
        text += f" in {counted(len(trials.of_groups.labels), 'group')}"
    pattern = "The pattern is none of these trials."
    if trials.pattern is not None:
        pattern = f"The pattern is trial {trials.names[trials.pattern]}."
    omitted = pd.DataFrame(
        [(text_of_label(label), str(reason)) for label, reason in (left_out or {}).items()],
        columns=["trial", "reason"],
    )
    with config_context(print_changed_only=True):
        steps = [" ".join(repr(step).split()) for step in trials.aligned.reached.steps]
    listed = "".join(f"<li><code>{escape(_ADDRESS.sub('', step))}</code></li>\n" for step in steps)
    page.add(
        "The set",
        paragraph(f"{text}, on {len(trials.aligned.clock)} frames. {pattern}"),
        table_of(trials.groups(), "Trials and their lengths"),
        table_of(omitted, f"Left out before: {counted(len(omitted), 'trial')}"),
        page.offer(left_out=omitted) if len(omitted) else "",
        paragraph("They were aligned by these steps, which show what differs from the defaults:"),
        f"<ol>\n{listed}</ol>",
    )


def _add_signals(page, trials, features):
    shown, note = list(range(len(trials.signals))), ""
    if features is None and len(shown) > _MOST_SIGNALS:
        shown = choose_features(None, trials.signals)
        note = f"The figure shows {len(shown)} of {len(trials.signals)} signals."
    spread = trials.spread()
    shares, finding = spread["left (%)"].dropna(), ""
    if len(shares):
        share = f"{shares.min():.0f}"
        share += f" to {shares.max():.0f}" if f"{shares.max():.0f}" != share else ""
        finding = (
            f"Of the standard deviation between time-normalised trials, {share} % is left after "
            "alignment."
        )
    _, curves = trials.by_frame()
    page.add(
        "Before and after",
        paragraph(finding, "finding"),
        picture(
            SignalsDisplay.of_trials(trials, shown).figure_,
            f"Curves of {counted(len(trials.names), 'trial')}, on the left time-normalised, on the "
            f"right aligned, and below their offsets. {finding}",
        ),
        paragraph(note),
        table_of(spread, "Standard deviation between trials", ("time-normalised", "aligned"))
        if len(shares)
        else "",
        page.offer(aligned_curves=curves),
        paragraph(_of_frames(trials)),
    )


def _add_timing(page, trials):
    table, (_, largest, at) = trials.table(), trials.columns
    where = table[largest].abs().idxmax()
    offset, unit = table.loc[where, largest], UNITS[trials.aligned.unit]
    finding = (
        f"The largest offset is that of trial {trials.names[where]}: {number(abs(offset))} {unit} "
        f"{'later' if offset > 0 else 'earlier'} than the pattern, at "
        f"{number(table.loc[where, at])} {unit}."
    )
    if offset == 0:
        finding = "No trial is later or earlier than the pattern."
    columns = [name for name in table if name not in ("covariate", "pattern", "doubtful")]
    timing, _ = trials.by_frame()
    page.add(
        "Timing",
        paragraph(finding, "finding"),
        paragraph(
            "An offset is how much later than the pattern a trial is, less where it is earlier. "
            "All trials begin and end with the pattern: one that is slower throughout is not late. "
            "The figure above counts offsets from the mean of all trials."
        ),
        table_of(trials.timing(), "Offsets of groups") if "group" in trials.design else "",
        table_of(table[columns], "Offsets of trials"),
        page.offer(trials=table, timing=timing),
        paragraph(_of_frames(trials)),
    )


def _of_frames(trials):
    """What tables with a row a frame leave out."""
    if trials.step == 1:
        return ""
    return f"To keep this file small, its table has one of every {trials.step} frames."


def _add_test(page, comparison, figure, is_of_groups):
    clusters, unit = comparison.clusters, UNITS[comparison.unit]
    bounds = "95\u00a0% from", "95\u00a0% to"
    shown = clusters[["what", "feature", "start", "end", "direction"]].set_axis(
        ["differs in", "signal", f"from ({unit})", f"to ({unit})", "direction"], axis=1
    )
    shown[["size", *bounds, "unit", "p"]] = clusters[["size", "lower", "upper", "unit", "p"]]
    p_values = comparison.to_frame().reset_index()
    none = "" if len(clusters) else f"No stretch of frames differs at p = {comparison.level:g}."
    page.add(
        "Groups" if is_of_groups else "Covariate",
        paragraph(comparison.describe(), "finding"),
        picture(figure, f"Means, bands, and where they differ. {comparison.describe()}"),
        table_of(shown, "Where they differ", ("size", *bounds)),
        paragraph(none),
        table_of(p_values, "Probability of such differences by chance", ("p",)),
        paragraph(
            "Joint is the test of shape and timing together. Linear is the test of time-normalised "
            "curves, which does not tell them apart."
        ),
        page.offer(clusters=clusters, p_values=p_values),
    )


def _add_doubtful(page, trials):
    if trials.reasons is None:
        page.add(
            "Doubtful trials", paragraph("The synchronizer does not tell which trials to look at.")
        )
        return
    rows = [
        (name, reason)
        for name, reason in zip(trials.names, trials.reasons, strict=True)
        if reason is not None
    ]
    table = pd.DataFrame(rows, columns=["trial", "reason"])
    page.add(
        "Doubtful trials",
        paragraph("" if rows else "No trial is doubtful."),
        table_of(table, f"Look at {counted(len(rows), 'trial')} before using the warps"),
        page.offer(doubtful=table) if rows else "",
    )


# -- the tables ---------------------------------------------------------------------------


class TrialSet(NamedTuple):
    """What is known of the trials of a report.

    Attributes
    ----------
    aligned : AlignedCurves
    names : list of str
    pattern : int or None
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
    pattern: int | None
    design: pd.DataFrame
    of_groups: GroupsOfPeople
    frames: np.ndarray
    seconds: np.ndarray | None
    signals: list

    @classmethod
    def of(cls, aligned, y, groups, covariate):
        """Those of the arguments of `write_report`."""
        reached, n = aligned.reached, len(aligned.curves)
        facts = reached.facts
        of_groups = GroupsOfPeople.of(y, groups, n)
        design = {}
        if y is not None:
            design["group"] = names_of_groups(y, n, name="y")
        if groups is not None:
            design["person"] = names_of_groups(groups, n)
        if covariate is not None:
            design["covariate"] = np.asarray(covariate, dtype=float)
        units = dict(zip(aligned.names, aligned.units, strict=True))
        return cls(
            aligned,
            list(map(text_of_label, facts.labels)),
            index_of_pattern(reached.synchronizer, reached.trials),
            pd.DataFrame(design, index=range(n)),
            of_groups,
            facts.lengths.astype(int),
            facts.durations() if facts.are_timed else None,
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
        table["pattern"] = np.arange(len(table)) == self.pattern
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
        index["frame of the pattern"] = np.tile(frames, n)
        if self.aligned.unit != "frames":
            index[f"time of the pattern ({unit})"] = np.tile(clock[frames], n)
        timing = index.copy()
        timing[f"offset ({unit})"] = self.aligned.offsets[:, frames].ravel()
        timing["frame of the trial"] = match.frames(self.frames)[:, frames].ravel()
        timing["rate"] = match.rates[:, frames].ravel()
        curves = self.aligned.curves[:, frames].reshape(n * len(frames), -1)
        return timing, pd.concat([index, pd.DataFrame(curves, columns=self.headings)], axis=1)


# -- figures ---------------------------------------------------------------------------------------


class SignalsDisplay(SynchronizationDisplay):
    """Signals time-normalised and aligned, side by side, and the offsets of all trials."""

    @classmethod
    def of_trials(cls, trials, shown):
        """Draw the signals of a `TrialSet` that are shown, by their indices."""
        aligned, pattern = trials.aligned, trials.pattern
        n_frames, n = len(aligned.clock), len(aligned.even)
        lasting, reached = [aligned.clock[-1]] * n, aligned.reached
        keyframes = named_keyframes(reached.synchronizer, reached.params.get("keyframes"))
        after = aligned.curves[:, :, shown]
        display = cls._of(
            before=list(aligned.even[:, :, shown]),
            after=after,
            match=aligned.match,
            axis=TimeAxis(aligned.unit, n_frames, [n_frames] * n, lasting, keyframes=keyframes),
            ylabels=[trials.signals[i] for i in shown],
            pattern=after.mean(axis=0) if pattern is None else after[pattern],
            titles=("time-normalised", "their mean" if pattern is None else "the pattern"),
            groups=list(map(str, trials.design["group"])) if "group" in trials.design else None,
            warps=True,
        ).plot()
        # The label of time is under both columns.
        display.axes_[-3].set_xlabel(display.axes_[-2].get_xlabel())
        return display
