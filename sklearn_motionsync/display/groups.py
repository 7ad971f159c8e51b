"""GroupDisplay and NormDisplay: groups, and a subject before a norm, in shape and timing."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any, Self

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator
from sklearn.utils import Bunch

from ..comparison.curves import AlignedCurves
from ..comparison.groups import GroupComparison
from ..comparison.norm import NormComparison
from ..comparison.study import GroupsOfPeople
from ..inputs.features import choose_features
from ..inputs.keyframes import Keyframes
from ..inputs.types import Features, Labels, NumbersLike, TrialsLike, Unit
from ..inputs.wording import counted
from ..matching.counting import first_largest
from ..synchronizers.match import Match
from .arguments import labels_of_signals
from .base import (
    COLORS,
    AxesLike,
    Display,
    TimeAxis,
    curves,
    draw_keyframes,
    empty_lists,
    front_line,
    group_styles,
    legend_above,
    offset_label,
    parts_outside,
    signal_layout,
    text_of_keyframe,
)

# Signals that are shown when none are named; of more, the first few.
_MOST = 6
# The place of bars of differences, as a share of the panel, and dots beside each other, of the
# clock.
_BAR, _BESIDE = 0.015, 0.014


class GroupDisplay(Display):
    """Means of groups with bands, the timing of their people, and where they differ.

    A panel for each signal, and one of the offsets, with a dot a person. Offsets are counted from
    the mean offset of all trials, so a group at 0 is as early and as late as all of them together.
    Use `from_estimator`.

    Attributes
    ----------
    groups : list of Bunch
        For each group ``mean`` and ``half``, shape (P, n_signals + 1): the mean and the standard
        deviation of its people, NaN of a single one, of the signals and of their offsets at last;
        ``offsets`` (n_people, P), from the mean of all trials, in the unit of time; its ``label``
        in the legend, and the ``color`` and the ``line`` style of the mean.
    events : DataFrame (n_people, n_events), or None
        Where the events of people are on the clock, in frames: lines and their spread.
    axes_ : list of Axes
        One a signal, then that of the offsets.
    means_ : list of list of Line2D
        For each panel the mean of each group.
    bands_ : list of list of FillBetweenPolyCollection
        For each panel the bands; a group of one person has none.
    dots_ : list of PathCollection
        The people of each group, in the panel of the offsets.
    clusters_ : list of LineCollection
        For each panel the bars; empty without clusters.
    events_ : list of list of Line2D
        For each panel the events; empty without any.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn.preprocessing import StandardScaler
    >>> from sklearn_motionsync import DenseSynchronizer, FrameWise
    >>> from sklearn_motionsync.display import GroupDisplay
    >>> from sklearn_motionsync.datasets import make_gait
    >>> gait = make_gait(8, timing=5, random_state=0)
    >>> pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(101)).fit(gait.data)
    >>> display = GroupDisplay.from_estimator(
    ...     pipe, gait.data, gait.group, groups=gait.person, features=[0, 1], units="degrees"
    ... )
    >>> [group.label for group in display.groups]
    ['A: 12 trials of 4 people', 'B: 12 trials of 4 people']
    """

    groups: Sequence[Bunch]
    axis: TimeAxis
    ylabels: Sequence[str]
    feature_names: Sequence[str]  # as in the table of clusters
    title: str  # what the bands are of
    events: pd.DataFrame | None
    comparison: GroupComparison | None
    pairs: bool  # whether people of all groups are the same, whose dots are joined

    def __repr__(self):
        return f"GroupDisplay({[group.label for group in self.groups]}, {self.feature_names})"

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator | Match,
        X: TrialsLike,
        y: Labels | None = None,
        *,
        groups: Labels | None = None,
        signals: TrialsLike | None = None,
        features: Features | None = None,
        comparison: GroupComparison | None = None,
        events: NumbersLike | pd.DataFrame | None = None,
        units: str | Sequence[str] | Mapping[str, str] | None = None,
        unit: Unit = "percent",
        xlabel: str | None = None,
        ax: AxesLike | None = None,
        **params: Any,
    ) -> Self:
        """Draw groups of trials on the clock of one pattern.

        Parameters
        ----------
        estimator : synchronizer, Pipeline with one, or Match of X
            Fitted on the trials of all groups together.
        X : trials
            As the estimator takes them.
        y : sequence of length n_sequences, default=None
            What the trials are told apart by: the group of each. None draws all as one group.
        groups : sequence of length n_sequences, default=None
            The subject of each trial. Means, and bands of one standard deviation, are of the means
            of people. By default every trial counts as a person.
        signals : trials, default=None
            What is drawn, as in `compare_groups`. By default X in its own units, if the same
            features reach the synchronizer, scaled or not.
        features : int, str or list of them, default=None
            Those of the signals that are drawn. By default all, or of more than six the first four;
            the legend then names how many there are.
        comparison : GroupComparison, default=None
            From `compare_groups` of the same groups: its clusters are bars at the lower edges.
        events : array-like, shape (n_sequences, n_events), default=None
            Events in frames of each trial, NaN where one is not known, such as of
            `keyframes_from_events`: lines at their mean place, in a band of one standard deviation
            of people. The columns of a table are their names. By default ``keyframes``. The panel
            of offsets has its dots there; without events, where timing differs most: at the peak of
            a cluster, or where offsets of people vary most.
        units : str, list of str or dict, default=None
            The units of the signals: of all, one each, or by name. By default what tables tell in
            ``attrs["units"]``.
        unit : {"frames", "percent", "seconds"}, default="percent"
            Unit of time, as in `compare_groups`.
        xlabel : str, default=None
            The label of time axes, such as ``"% gait cycle"``, in place of that of the unit.
        ax : Axes or array-like of Axes, default=None
            See `plot`.
        **params : dict
            Further arguments of the ``match`` of the synchronizer: ``frame_rate``, frames a second
            of X, which seconds need where tables do not tell; ``keyframes``, which are seconds
            where a frame rate is given.

        Returns
        -------
        GroupDisplay
            The display, drawn.

        Raises
        ------
        ValueError
            If there is no such feature or unit; labels or units do not fit the signals;
            the comparison is in another unit; or as from `compare_groups`.

        See Also
        --------
        sklearn_motionsync.comparison.compare_groups : Tests what this figure shows.
        """
        if comparison is not None and comparison.unit != unit:
            raise ValueError(
                f"The comparison is in {comparison.unit}, and the figure in {unit}. Set "
                f"unit={comparison.unit!r}."
            )
        caller = f"{cls.__name__}.from_estimator"
        aligned = AlignedCurves.of(
            estimator, X, params, caller, signals=signals, features=features, unit=unit
        )
        names, notes = aligned.names, []
        chosen = list(range(len(names)))
        if features is None and len(names) > _MOST:
            chosen = choose_features(None, names)
            notes.append(f"{len(chosen)} of {len(names)} signals")
        names = [names[i] for i in chosen]
        if comparison is not None:
            differing = comparison.clusters.query("what == 'shape'")["feature"]
            others = list(dict.fromkeys(differing[~differing.isin(names)]))
            notes += [f"differences also in {', '.join(others)}"] * bool(others)
        has_people = groups is not None
        title = f"mean ± standard deviation of {'people' if has_people else 'trials'}"
        of_people = GroupsOfPeople.of(y, groups, len(aligned.curves))
        known_units = dict(zip(aligned.names, aligned.units, strict=True))
        return cls._of(
            groups=_curves_of_groups(of_people, aligned, chosen, has_people),
            axis=TimeAxis.of_clock(aligned.unit, aligned.clock, xlabel),
            ylabels=labels_of_signals(names, known_units, units),
            feature_names=names,
            title="; ".join(filter(None, [title, ", ".join(notes)])),
            events=_events_on_clock(events, aligned, of_people),
            comparison=comparison,
            pairs=has_people and of_people.are_pairs,
        ).plot(ax)

    @property
    def offsets(self) -> list[np.ndarray]:
        """For each group the offsets of its people from the mean of all trials, (n_people, P)."""
        return [group.offsets for group in self.groups]

    def _layout(self):
        more = 0.6 + 0.2 * max(len(self.groups) - 2, 0) + 0.5 * (self.events is not None)
        return signal_layout(len(self.ylabels), more)

    def _draw(self):
        *above, timing = self.axes_
        clock = self.axis.clock
        self.bands_, self.means_ = empty_lists(2)
        for i, axis in enumerate(self.axes_):
            self.bands_.append([])
            self.means_.append([])
            for group in self.groups:
                color, mean, half = group.color, group.mean[:, i], group.half[:, i]
                for bound in (mean - half, mean + half):
                    axis.plot(clock, bound, color=color, linewidth=0.5)
                style = {"color": color, "alpha": 0.18, "linewidth": 0}
                self.bands_[-1].append(axis.fill_between(clock, mean - half, mean + half, **style))
                style = {"color": color, "linestyle": group.line, "linewidth": 2}
                self.means_[-1].append(front_line(axis, clock, mean, **style))
        timing.axhline(0, color="0.6", linewidth=0.8, zorder=0)
        ylabels = [*self.ylabels, offset_label(self.axis.unit)]
        self._label_axes(self.axes_, ylabels, self.axis.label, ends=clock)
        self.dots_, self.clusters_, self.events_ = empty_lists(3)
        if self.events is not None:
            self._draw_events()
        self._draw_dots(timing)
        handles = list(zip(self.bands_[0], self.means_[0], strict=True))
        labels = [group.label for group in self.groups]
        if self.comparison is not None and (bars := self._draw_clusters()):
            handles.append(bars[0])
            labels.append(f"differs, p at most {self.comparison.level:g}")
        legend_above(above, handles, labels, self.title, below=above[:2], n_cols=1)

    def _draw_events(self):
        """Draw the mean place of each event, and its spread between people, in all panels."""
        mean, spread = self.events.mean().to_numpy(), self.events.std().to_numpy()
        at, spread = self.axis.convert(mean), self.axis.convert(spread)
        for axis in self.axes_:
            for middle, half in zip(at, spread, strict=True):
                axis.axvspan(middle - half, middle + half, color="0.5", alpha=0.12, linewidth=0)
            self.events_.append(draw_keyframes(axis, at))
        texts = [text_of_keyframe(name) for name in self.events.columns]
        self.axes_[-1].secondary_xaxis("top").set_xticks(
            at, texts, rotation=20, rotation_mode="anchor", ha="left", fontsize="small"
        )

    def _draw_dots(self, axis):
        """Draw the offsets of people at the events, or where the timing differs most."""
        width, at = self.axis.clock[-1], self._moments()
        low, high = np.floor(at).astype(int), np.ceil(at).astype(int)
        xs, ys = [], []
        for k, group in enumerate(self.groups):
            beside = (k - (len(self.groups) - 1) / 2) * _BESIDE * width
            x = np.clip(self.axis.convert(at) + beside, 0, width)
            before, after = group.offsets[:, low], group.offsets[:, high]
            y = before + (at - low) * (after - before)
            xs.append(np.broadcast_to(x, y.shape))
            ys.append(y)
        if self.pairs:
            shape = len(xs), -1
            x, y = np.reshape(xs, shape), np.reshape(ys, shape)
            axis.plot(x, y, color="0.6", linewidth=0.6, zorder=4)
        for x, y, group in zip(xs, ys, self.groups, strict=True):
            self.dots_.append(
                axis.scatter(
                    x.ravel(),
                    y.ravel(),
                    zorder=5,
                    s=12,
                    color=group.color,
                    edgecolor="white",
                    linewidth=0.4,
                )
            )

    def _moments(self):
        """The frames of the clock at which offsets are shown person by person."""
        if self.events is not None:
            return self.events.mean().to_numpy()
        if self.comparison is not None and len(timing := self._clusters_of("timing")):
            clock = self.axis.clock
            return timing["peak"].to_numpy() * (len(clock) - 1) / clock[-1]
        offsets = np.concatenate([group.offsets for group in self.groups])
        return np.array([first_largest(offsets.var(axis=0))], dtype=float)

    def _clusters_of(self, what, feature=None):
        """The clusters of the timing, or of a signal."""
        clusters = self.comparison.clusters
        clusters = clusters[clusters["what"] == what]
        return clusters if feature is None else clusters[clusters["feature"] == feature]

    def _draw_clusters(self):
        """Draw the clusters of each panel as bars along its lower edge."""
        from matplotlib.collections import LineCollection

        for axis, name in zip(self.axes_, [*self.feature_names, None], strict=True):
            clusters = self._clusters_of("timing" if name is None else "shape", name)
            ends = clusters[["start", "end"]].to_numpy()
            lines = LineCollection(
                np.stack([ends, np.full_like(ends, _BAR)], axis=2),
                colors="black",
                linewidths=3.5,
                capstyle="butt",
                zorder=6,
                transform=axis.get_xaxis_transform(),
            )
            self.clusters_.append(axis.add_collection(lines, autolim=False))
        return [lines for lines in self.clusters_ if len(lines.get_segments())]


def _curves_of_groups(of_people, aligned, chosen, named):
    """The curves of each group in the panels of the signals and of the offsets."""
    # Offsets are counted from the mean of all trials.
    offsets = (aligned.offsets - aligned.offsets.mean(axis=0))[:, :, np.newaxis]
    signals = aligned.curves[:, :, chosen]
    of_groups = []
    for label, (color, line), panels in zip(
        of_people.describe(named),
        group_styles(of_people.labels).values(),
        of_people.means(np.concatenate([signals, offsets], axis=2)),
        strict=True,
    ):
        half = np.full(panels.shape[1:], np.nan)
        if len(panels) > 1:
            half = panels.std(axis=0, ddof=1)
        of_groups.append(
            Bunch(
                mean=panels.mean(axis=0),
                half=half,
                offsets=panels[:, :, -1],
                label=label,
                color=color,
                line=line,
            )
        )
    return of_groups


def _events_on_clock(events, aligned, of_people):
    """Where the events of people are on the clock, in frames: a table; None without events."""
    trials, shares = aligned.reached.trials, aligned.reached.keyframes
    if events is not None:
        known = Keyframes(events, len(trials), name="events").known(trials)
        shares = pd.DataFrame(known, columns=getattr(events, "columns", None))
    if shares is None:
        return None
    last = len(aligned.clock) - 1
    frames = np.arange(last + 1.0)
    places = np.array(
        [
            np.interp(s * last, t, frames)
            for s, t in zip(shares.to_numpy(), aligned.match.times, strict=True)
        ]
    )
    return pd.DataFrame(np.concatenate(of_people.means(places)), columns=shares.columns)


class NormDisplay(Display):
    """A subject before a norm: a panel for each signal, and one of the offset.

    The subject is the strongest line, violet where it departs. The offset is counted from the mean
    offset of the norm, which is flat. Use `from_comparison`.

    Attributes
    ----------
    axes_ : list of Axes
        One a signal, then that of the offset.
    subject_, mean_ : list of Line2D
        The subject and the mean of the norm, one a panel.
    bands_ : list of FillBetweenPolyCollection
        The limits of the norm, one a panel.
    spread_ : list of FillBetweenPolyCollection
        One standard deviation of the norm, one a panel.
    departures_ : list of LineCollection
        The parts of the subject that depart, one a panel: outside the limits, or a bump.

    Examples
    --------
    >>> from sklearn_motionsync import DenseSynchronizer
    >>> from sklearn_motionsync.comparison import compare_to_norm
    >>> from sklearn_motionsync.display import NormDisplay
    >>> from sklearn_motionsync.datasets import make_gait
    >>> gait = make_gait(16, timing=6, random_state=0)
    >>> sync = DenseSynchronizer(n_frames=101).fit(gait.data)
    >>> found = compare_to_norm(sync, gait.data, gait.group, norm="A", groups=gait.person)
    >>> display = NormDisplay.from_comparison(found, "person1", features=[0, 1], units="degrees")
    >>> len(display.axes_)
    3
    """

    comparison: NormComparison
    subject: Hashable
    signals: Sequence[int]  # those that are drawn, by index
    labels: Sequence[str]  # of these
    axis: TimeAxis

    def __repr__(self):
        return f"NormDisplay({self.comparison.describe(self.subject)!r})"

    @classmethod
    def from_comparison(
        cls,
        comparison: NormComparison,
        subject: Hashable,
        *,
        features: Features | None = None,
        units: str | Sequence[str] | Mapping[str, str] | None = None,
        xlabel: str | None = None,
        ax: AxesLike | None = None,
    ) -> Self:
        """Draw a subject of a comparison.

        Parameters
        ----------
        comparison : NormComparison
            From `compare_to_norm`.
        subject : label
            One of ``comparison.verdicts.index``.
        features : int, str or list of them, default=None
            Signals that are drawn, by index or name. By default those with a departure and the
            first ones, four in all. The offset is always drawn.
        units : str, list of str or dict, default=None
            The units of the signals: of all, one each, or by name. By default what tables tell in
            ``attrs["units"]``.
        xlabel : str, default=None
            The label of time axes, such as ``"% gait cycle"``, in place of that of the unit.
        ax : Axes or array-like of Axes, default=None
            See `plot`.

        Returns
        -------
        NormDisplay
            The display, drawn.

        Raises
        ------
        ValueError
            If there is no such subject or feature, or labels or units do not fit the signals.

        See Also
        --------
        sklearn_motionsync.comparison.compare_to_norm : Makes the comparison.
        """
        if not isinstance(comparison, NormComparison):
            raise ValueError(f"Give what compare_to_norm returns, got {type(comparison).__name__}.")
        subjects = comparison.verdicts.index.to_list()
        if subject not in subjects:
            raise ValueError(f"There is no subject {subject!r}; there are {subjects[:8]}.")
        signals = comparison.features[:-1]
        if features is None:
            table = comparison.departures
            is_departure = (table["subject"] == subject) & (table["what"] == "shape")
            departing = map(signals.index, table[is_departure]["feature"])
            order = list(dict.fromkeys([*departing, *range(len(signals))]))
            chosen = sorted(order[: len(choose_features(None, signals))])
        else:
            chosen = choose_features(features, signals)
        names = [signals[k] for k in chosen]
        known_units = dict(zip(comparison.features, comparison.units, strict=True))
        labels = labels_of_signals(names, known_units, units)
        axis = TimeAxis.of_clock(comparison.unit, comparison.clock, xlabel)
        return cls._of(
            comparison=comparison, subject=subject, signals=chosen, labels=labels, axis=axis
        ).plot(ax)

    def _layout(self):
        return signal_layout(len(self.signals), 1.0)

    def _draw(self):
        norm = self.comparison
        subject = norm.verdicts.index.get_loc(self.subject)
        departures = norm.departures[norm.departures["subject"] == self.subject]
        self.subject_, self.mean_, self.bands_, self.spread_, self.departures_ = empty_lists(5)
        clock, grey, violet = norm.clock, COLORS["envelope"], COLORS["departure"]
        for axis, k in zip(self.axes_, [*self.signals, -1], strict=True):
            # The offset is the last of the signals, and counted from the mean of the norm.
            zero = norm.mean[:, k] if k == -1 else 0
            mean, std, curve = norm.mean[:, k] - zero, norm.std[:, k], norm.curves[subject, :, k]
            curve, reach = curve - zero, norm.limits[subject, k] * std
            for half, alpha, areas in ((reach, 0.3, self.bands_), (std, 0.5, self.spread_)):
                areas.append(
                    axis.fill_between(
                        clock, mean - half, mean + half, color=grey, alpha=alpha, linewidth=0
                    )
                )
            self.mean_.extend(axis.plot(clock, mean, color="0.3", linewidth=1, linestyle="--"))
            line = front_line(axis, clock, curve, color=COLORS["trial"], linewidth=2.4)
            self.subject_.append(line)
            xs, ys = parts_outside(curve[np.newaxis], mean - reach, mean + reach)
            xs, ys = [*self.axis.convert(xs)], [*ys]
            rows = departures[departures["feature"] == norm.features[k]]
            for start, end in zip(rows["start"], rows["end"], strict=True):
                part = (clock >= start) & (clock <= end)
                # A bump may stand out inside the limits.
                if not np.any(np.abs(curve - mean)[part] > reach[part]):
                    xs.append(clock[part])
                    ys.append(curve[part])
            lines = curves(axis, xs, ys, colors=violet, linewidths=2.8, zorder=5)
            self.departures_.append(lines)
        ylabels = [*self.labels, offset_label(norm.unit)]
        self._label_axes(self.axes_, ylabels, self.axis.label, ends=clock)
        handles = [self.subject_[0], (self.spread_[0], self.mean_[0]), self.bands_[0]]
        n_trials = int(norm.verdicts["n_trials"].iloc[subject])
        labels = [
            f"{self.subject}: {counted(n_trials, 'trial')}",
            f"norm: mean and standard deviation of {norm.n_people} people",
            f"at least {100 * (1 - norm.level):.3g} % of new people stay inside in all panels",
        ]
        if any(len(lines.get_segments()) for lines in self.departures_):
            handles.insert(1, self.departures_[0])
            labels.insert(1, "departs")
        title, above = norm.describe(self.subject), self.axes_[:-1]
        legend_above(above, handles, labels, title, below=above[:2], n_cols=1)
