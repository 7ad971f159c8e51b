"""write_report: one HTML file about a set of aligned trials."""

from __future__ import annotations

import pathlib
import re
from collections.abc import Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import pandas as pd
from sklearn import config_context
from sklearn.base import BaseEstimator

from ..body.skeleton import Skeleton
from ..comparison.curves import AlignedCurves
from ..comparison.groups import compare_aligned
from ..comparison.study import Study
from ..display.drawing import WIDTH, curves, front_line, group_styles, legend_above, panels, pyplot
from ..display.groups import display_of_groups
from ..display.synchronization import SynchronizationDisplay
from ..display.time_axis import TimeAxis, clock_rate, draw_keyframes, named_keyframes, offset_label
from ..inputs.features import choose_features
from ..inputs.types import (
    Features,
    Labels,
    Path,
    PerformancesLike,
    RandomState,
    Unit,
    ValuesLike,
)
from ..inputs.wording import counted
from ..synchronizers.match import UNITS
from ..utils.pipelines import flat_steps
from .page import Page, check_path, list_of, number, paragraph, picture, table_of
from .player import add_player, bodies_of, player_of
from .tables import TrialSet, as_text

__all__ = [
    "draw_offsets",
    "draw_signals",
    "own_figures",
    "write_report",
]

# Signals in the figure if none are named; of more, the first four.
_MOST_SIGNALS = 6
# The place of an object in memory, which differs from run to run.
_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")


def write_report(
    path: Path,
    estimator: BaseEstimator,
    X: PerformancesLike,
    *,
    groups: Labels | None = None,
    people: Labels | None = None,
    paired: bool = False,
    covariate: ValuesLike | None = None,
    signals: PerformancesLike | None = None,
    features: Features | None = None,
    skeleton: Skeleton | None = None,
    left_out: Mapping[Any, str] | None = None,
    title: str | None = None,
    unit: Unit = "percent",
    frame_rate: float | ValuesLike | None = None,
    random_state: RandomState = 0,
    **params: Any,
) -> pathlib.Path:
    """Write a report about aligned trials: one HTML file that opens anywhere without a network.

    It has the set, the signals before and after alignment, the timing of every trial, the test of
    groups, and doubtful trials. Its tables can be saved as CSV. Where there are bodies, a player
    shows them side by side on one clock, or each at its own pace: at first two, others by choice.

    Parameters
    ----------
    path : str or path
        Of the file, such as ``"report.html"``. Its folder must exist. A file that is there already
        is replaced once the report is complete.
    estimator : synchronizer, or Pipeline with one
        Fitted, as for `compare_groups`.
    X : performances
        As the estimator takes them.
    groups : sequence of length n_sequences, default=None
        The group of each performance: two or more. They are compared.
    people : sequence of length n_sequences, default=None
        The subject of each performance.
    paired : bool, default=False
        Whether every person has trials in both of two groups.
    covariate : array-like of numbers, shape (n_sequences,), default=None
        Such as speed or age, instead of groups: a regression.
    signals : performances, default=None
        What is shown and compared, such as joint angles in degrees; by default as in
        `compare_groups`.
    features : int, str or list of them, default=None
        Those of the signals that are shown and compared. By default all; of more than six, the
        figures show the first four.
    skeleton : Skeleton, default=None
        Of the joint positions X, for the player. By default that of a step of the pipeline, such
        as `DirectionCosines`; without one there is no player.
    left_out : mapping of label to reason, default=None
        Trials that were left out before, and why.
    title : str, default=None
        Of the page; by default "Aligned trials".
    unit : {"percent", "frames", "seconds"}, default="percent"
        Of time, as in `compare_groups`.
    frame_rate : float, or array-like of shape (n_sequences,), default=None
        Frames a second of X; by default what tables tell, as in `Match.offsets_in`. If it is known,
        durations are in seconds. Where it is given, key-frames are in seconds, as for ``match``.
    random_state : int, RandomState instance or None, default=0
        Draws the permutations of the test.
    **params : dict
        What synchronizing X takes besides, such as ``keyframes``.

    Returns
    -------
    Path
        Of the file.

    Raises
    ------
    FileNotFoundError
        If there is no such folder.
    ImportError
        If matplotlib is missing.
    ValueError
        If the path is that of a folder, or ``left_out`` is not a mapping; or as from
        `compare_groups`.

    See Also
    --------
    compare_groups : The test, with more arguments.
    write_player : The player by itself.
    sklearn_motionsync.display.GroupDisplay : The figure of groups, with more arguments.

    Notes
    -----
    Size is limited. Joint positions have a precision of a 30 000th of the largest, and take 4 MB at
    most: of more, longer trials have fewer frames in the player. Tables of frames take about 4 MB
    at most: of more, they have every second frame, or fewer. The page names it.

    The same input gives the same file, but for the date.

    Examples
    --------
    >>> from sklearn_motionsync import DenseSynchronizer, write_report
    >>> from sklearn_motionsync.datasets import make_gait
    >>> gait = make_gait(6, n_cycles=2, random_state=0)
    >>> sync = DenseSynchronizer(n_frames=51).fit(gait.data)
    >>> path = write_report("gait.html", sync, gait.data, people=gait.person)
    >>> path.read_text(encoding="utf-8")[:15]
    '<!DOCTYPE html>'
    """
    path = check_path(path, "report")
    if left_out is not None and not isinstance(left_out, Mapping):
        raise ValueError(
            "left_out must be a mapping of labels of trials to reasons, such as "
            f"{{'trial 7': 'the marker fell off'}}, or None; got {left_out!r:.80}."
        )
    with own_figures():
        aligned = AlignedCurves.of(
            estimator,
            X,
            params,
            "write_report",
            signals=signals,
            features=features,
            unit=unit,
            frame_rate=frame_rate,
        )
        comparison = figure = None
        if groups is not None or covariate is not None or paired:
            study = Study.of(groups, covariate, people, paired, len(aligned.curves))
            comparison = compare_aligned(aligned, study, random_state=random_state)
            display = display_of_groups(aligned, groups, people, comparison, features=features)
            figure = display.plot().figure_
        trials = TrialSet.of(X, aligned, frame_rate, groups, people, covariate)
        page = Page()
        _add_set(page, trials, estimator, left_out)
        _add_signals(page, trials, features)
        _add_timing(page, trials)
        if comparison is not None:
            _add_test(page, comparison, figure, groups is not None)
        _add_doubtful(page, trials)
        bodies = X
        if skeleton is None:
            bodies, skeleton = bodies_of(estimator, X, params)
        if skeleton is not None:
            add_player(page, *player_of(trials, bodies, skeleton))
    return page.write(path, "Aligned trials" if title is None else title)


# -- the sections --------------------------------------------------------------------------


def _add_set(page, trials, estimator, left_out):
    text = counted(len(trials.names), "trial")
    if "person" in trials.design:
        n_people = trials.design["person"].nunique()
        text += f" of {n_people} {'person' if n_people == 1 else 'people'}"
    if "group" in trials.design:
        text += f" in {counted(len(trials.of_groups.labels), 'group')}"
    template = "The template is none of these trials."
    if trials.template is not None:
        template = f"The template is trial {trials.names[trials.template]}."
    omitted = pd.DataFrame(
        [(as_text(label), str(reason)) for label, reason in (left_out or {}).items()],
        columns=["trial", "reason"],
    )
    with config_context(print_changed_only=True):
        steps = [" ".join(repr(step).split()) for step in flat_steps(estimator)]
    page.add(
        "The set",
        paragraph(f"{text}, on {len(trials.aligned.clock)} frames. {template}"),
        table_of(trials.groups(), "Trials and their lengths"),
        table_of(omitted, f"Left out before: {counted(len(omitted), 'trial')}"),
        page.offer(left_out=omitted) if len(omitted) else "",
        paragraph("They were aligned by these steps, which show what differs from the defaults:"),
        list_of(_ADDRESS.sub("", step) for step in steps),
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
            draw_signals(trials, shown),
            f"Curves of {counted(len(trials.names), 'trial')}, on the left time-normalised, on the "
            f"right aligned. {finding}",
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
        f"{'later' if offset > 0 else 'earlier'} than the template, at "
        f"{number(table.loc[where, at])} {unit}."
    )
    if offset == 0:
        finding = "No trial is later or earlier than the template."
    columns = [name for name in table if name not in ("covariate", "template", "doubtful")]
    timing, _ = trials.by_frame()
    page.add(
        "Timing",
        paragraph(finding, "finding"),
        paragraph(
            "An offset is how much later than the template a trial is, less where it is earlier. "
            "All trials begin and end with the template: one that is slower throughout is not late."
        ),
        picture(
            draw_offsets(trials),
            f"Offsets of {counted(len(trials.names), 'trial')} along the template. {finding}",
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
    shown = clusters[["what", "feature"]].set_axis(["differs in", "signal"], axis=1)
    ends = [f"{number(a)} to {number(b)}" for a, b in clusters[["start", "end"]].to_numpy(float)]
    shown[f"from, to ({unit})"] = ends
    shown["direction"] = clusters["direction"]
    sizes = clusters[["size", "lower", "upper"]].to_numpy(dtype=float)
    shown["size"] = [
        f"{number(size)} {unit}" for size, unit in zip(sizes[:, 0], clusters["unit"], strict=True)
    ]
    shown["interval of 95\u00a0%"] = [
        f"{number(low)} to {number(high)}" for low, high in sizes[:, 1:]
    ]
    shown["p"] = clusters["p"].map("{:.3f}".format)
    p_values = comparison.to_frame().reset_index()
    none = "" if len(clusters) else f"No stretch of frames differs at p = {comparison.level:g}."
    page.add(
        "Groups" if is_of_groups else "Covariate",
        paragraph(comparison.describe(), "finding"),
        picture(figure, f"Means, bands, and where they differ. {comparison.describe()}"),
        table_of(shown, "Where they differ"),
        paragraph(none),
        table_of(
            p_values.assign(p=p_values["p"].map("{:.3f}".format)),
            "Probability of such differences by chance",
        ),
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


# -- figures ---------------------------------------------------------------------------------------


@contextmanager
def own_figures():
    """Figures in the style of matplotlib itself, which are closed at the end."""
    plt = pyplot()
    before = set(plt.get_fignums())
    try:
        with plt.style.context("default", after_reset=True):
            yield
    finally:
        for number in set(plt.get_fignums()) - before:
            plt.close(number)


def _keyframes_of(aligned):
    """The key-frames on the clock, by name; None if there are none."""
    return named_keyframes(aligned.reached.synchronizer, aligned.reached.params.get("keyframes"))


def draw_signals(trials, shown):
    """Signals time-normalised and aligned, side by side.

    Parameters
    ----------
    trials : TrialSet
    shown : list of int
        The signals.
    """
    aligned, template = trials.aligned, trials.template
    n_frames = len(aligned.clock)
    display = SynchronizationDisplay(
        aligned.even[:, :, shown],
        aligned.curves[:, :, shown],
        aligned.match,
        TimeAxis(aligned.unit, n_frames, [n_frames] * len(aligned.even), clock_rate(aligned.clock)),
        feature_names=[trials.signals[i] for i in shown],
        pattern=None if template is None else aligned.curves[template][:, shown],
        groups=trials.design.get("group"),
        pattern_keyframes=_keyframes_of(aligned),
    ).plot(warps=False)
    left = display.axes_[0]
    left.title.set_text(left.get_title().replace("as recorded", "time-normalised"))
    display.axes_[-2].set_xlabel(display.axes_[-1].get_xlabel())
    return display.figure_


def draw_offsets(trials):
    """The offsets of all trials, and the mean of each group."""
    aligned = trials.aligned
    offsets, clock = aligned.offsets, aligned.clock
    axis_of_time = TimeAxis.of_clock(aligned.unit, clock)
    figure, (axis,) = panels(None, [(0, 0)], 1, 1, (WIDTH, 3.4))
    names = list(trials.design.get("group", [""] * len(offsets)))
    styles = group_styles(names)
    colors = [styles[name][0] for name in names]
    curves(axis, [clock] * len(offsets), offsets, colors=colors, linewidths=0.9, alpha=0.4)
    means = [
        front_line(axis, clock, offsets[np.array(names) == name].mean(axis=0), color=c, linestyle=s)
        for name, (c, s) in styles.items()
    ]
    axis.axhline(0, color="0.4", linewidth=0.8, zorder=0)
    axis.set_xlim(clock[0], clock[-1])
    axis.set_xlabel(axis_of_time.label)
    axis.set_ylabel(offset_label(aligned.unit))
    keyframes = _keyframes_of(aligned)
    if keyframes is not None:
        draw_keyframes(axis, axis_of_time.convert(keyframes.to_numpy()), keyframes.index)
    labels = [f"mean of {name}" for name in styles] if "group" in trials.design else ["their mean"]
    legend_above([axis], means, labels)
    return figure
