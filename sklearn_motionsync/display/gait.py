"""GaitDisplay: heights of heels and toes, with strikes and foot-offs, and when each foot stands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np
import pandas as pd

from ..body.formats import SIDES
from ..body.skeleton import Skeleton
from ..gait.events import events_of, tabulate_events
from ..gait.recordings import CONTEXTS, FOOT_OFF, FOOT_STRIKE, Recordings
from ..inputs.types import Table, TrialsLike, ValuesLike
from ..inputs.wording import counted
from .arguments import as_index
from .base import COLORS, WIDTH, AxesLike, Display, legend_above

# Line styles of strikes and foot-offs.
_STYLES = {FOOT_STRIKE: "-", FOOT_OFF: ":"}


class GaitDisplay(Display):
    """Heights of heels and toes of a recording, its foot strikes and foot-offs, and the stances.

    Above each foot by itself: the heights of its heel and its toe, with lines at its events. Below
    a bar for each stance: where two bars overlap, both feet are on the ground. Use
    `from_positions`.

    Attributes
    ----------
    heights : dict of str to ndarray (n_frames,)
        Of ``left_heel``, ``left_toe``, ``right_heel`` and ``right_toe``, as far as they are known.
    events : DataFrame
        ``label``, ``context`` and ``time`` of the events, as from `gait_events`.
    axes_ : list of Axes
        A panel for each foot, and that of the stances.
    stances_ : dict of str to list of (float, float)
        Seconds of the strike and duration of each stance, by foot.

    Examples
    --------
    >>> from sklearn_motionsync.datasets import make_walk
    >>> from sklearn_motionsync.display import GaitDisplay
    >>> walk = make_walk(1, n_strides=3, random_state=0)
    >>> GaitDisplay.from_positions(walk.data, walk.skeleton, frame_rate=walk.frame_rate)
    GaitDisplay(8 strikes, 8 foot-offs)
    """

    times: np.ndarray  # of the frames, in seconds
    heights: dict[str, np.ndarray]
    events: pd.DataFrame
    unit: str  # of the heights

    def __repr__(self):
        counts = [int((self.events["label"] == label).sum()) for label in (FOOT_STRIKE, FOOT_OFF)]
        return f"GaitDisplay({counted(counts[0], 'strike')}, {counted(counts[1], 'foot-off')})"

    @classmethod
    def from_positions(
        cls,
        X: TrialsLike,
        skeleton: Skeleton | None = None,
        *,
        events: Table | None = None,
        recording: int = 0,
        feet: Mapping[str, str | Sequence[str] | None] | None = None,
        frame_rate: float | ValuesLike | None = None,
        ax: AxesLike | None = None,
    ) -> Self:
        """Draw the feet and the events of a recording.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_dims * n_joints), 3-D array, or one recording
            Joint positions, as for `gait_events`.
        skeleton : Skeleton, default=None
            As for `gait_events`.
        events : DataFrame, default=None
            As for `gait_parameters`; by default those that `gait_events` finds.
        recording : int, default=0
            The index of the recording.
        feet : mapping of str to str or tuple of str, default=None
            As for `gait_events`.
        frame_rate : float, or array-like of shape (n_recordings,), default=None
            Frames a second; by default what tables tell.
        ax : Axes or array-like of Axes, default=None
            See `plot`.

        Returns
        -------
        GaitDisplay
            The display, drawn.

        Raises
        ------
        ValueError
            If there is no such recording, or as from `gait_events`.
        """
        recordings = Recordings(X, skeleton, feet, frame_rate)
        i = as_index(recording, len(recordings), "recording")
        walk = recordings.walk(i)
        events_of_walk = events_of(walk, recordings.split_events(events)[i])
        rows = np.arange(0, walk.n_samples, walk.per_frame)
        scale, unit = recordings.length_of_leg(i, walk)
        ends = {"heel": walk.heels, "toe": walk.toes}
        heights = {
            f"{side}_{end}": scale * of_sides[side][rows, 1]
            for side in SIDES
            for end, of_sides in ends.items()
            if side in of_sides
        }
        floor = min(np.nanmin(values) for values in heights.values())
        return cls._of(
            times=recordings.times_at(i, np.arange(len(rows))),
            heights={name: values - floor for name, values in heights.items()},
            events=tabulate_events(recordings, i, walk, events_of_walk),
            unit=unit,
        ).plot(ax)

    def _layout(self):
        count = len(self._sides()) + 1
        return [(k, 0) for k in range(count)], (count, 1), (WIDTH, 1.2 + 1.5 * count)

    def _draw(self):
        from matplotlib.lines import Line2D

        sides = self._sides()
        *feet, bars = self.axes_
        self.stances_ = {side: self._stances(side) for side in sides}
        for axis, side in zip(feet, sides, strict=True):
            for end, style in (("heel", "-"), ("toe", "--")):
                if f"{side}_{end}" in self.heights:
                    height = self.heights[f"{side}_{end}"]
                    axis.plot(self.times, height, style, color=COLORS[side])
            for label, style in _STYLES.items():
                for time in self._times_of(side, label):
                    axis.axvline(time, color="black", linestyle=style, linewidth=0.9)
            axis.set_title(f"{side} foot", fontsize="medium")
        for k, side in enumerate(reversed(sides)):
            bars.broken_barh(self.stances_[side], (k - 0.35, 0.7), facecolors=COLORS[side])
        bars.set_yticks(range(len(sides)), list(reversed(sides)))
        bars.set_ylim(-0.6, len(sides) - 0.4)
        bars.set_title("on the ground", fontsize="medium")
        height = f"height ({self.unit})" if self.unit else "height"
        names = [*[height] * len(sides), "foot"]
        self._label_axes(self.axes_, names, "time (s)", ends=self.times)
        shown = [("heel", "-")] + [("toe", "--")] * any(n.endswith("toe") for n in self.heights)
        handles = [Line2D([], [], color="gray", linestyle=s, label=name) for name, s in shown]
        handles += [
            Line2D([], [], color="black", linestyle=style, linewidth=0.9, label=name)
            for name, style in (("strike", "-"), ("foot-off", ":"))
        ]
        legend_above(self.axes_[:1], handles)

    def _sides(self):
        return [side for side in SIDES if f"{side}_heel" in self.heights]

    def _times_of(self, side, label):
        rows = (self.events["context"] == CONTEXTS[side]) & (self.events["label"] == label)
        return self.events.loc[rows, "time"].to_numpy()

    def _stances(self, side):
        """The strike of each stance, and how long it lasts; it may begin or end out of sight."""
        strikes, offs = (self._times_of(side, label) for label in (FOOT_STRIKE, FOOT_OFF))
        begins = list(strikes)
        if len(offs) and not (strikes < offs[0]).any():
            begins = [self.times[0], *begins]
        spans = []
        for k, begin in enumerate(begins):
            following = begins[k + 1] if k + 1 < len(begins) else np.inf
            later = offs[(offs > begin) & (offs < following)]
            if len(later):
                spans.append((float(begin), float(later[0] - begin)))
            elif following == np.inf:
                spans.append((float(begin), float(self.times[-1] - begin)))
        return spans
