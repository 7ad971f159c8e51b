"""Figures of a report: signals before and after alignment, and the offsets of trials."""

from contextlib import contextmanager

import numpy as np

from ..display.drawing import WIDTH, curves, front_line, group_styles, legend_above, panels, pyplot
from ..display.synchronization import SynchronizationDisplay
from ..display.time_axis import TimeAxis, clock_rate, draw_keyframes, named_keyframes, offset_label

__all__ = ["draw_offsets", "draw_signals", "own_figures"]


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
