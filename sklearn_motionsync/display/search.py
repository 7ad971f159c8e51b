"""SearchDisplay: the hits of a search along takes, with their scores and the true segments."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any, Self

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator

from ..inputs.tables import labels_of
from ..inputs.types import TrialLike, TrialsLike
from ..inputs.wording import counted
from ..takes.search import find_trials
from .arguments import as_trials
from .base import COLORS, WIDTH, AxesLike, Display, legend_above

# The lowest score of the axis, and the height of the strip of true segments below it.
_BOTTOM, _STRIP = 0.3, 0.06
# The largest number of panels.
_MAX_PANELS = 12


class SearchDisplay(Display):
    """The hits of a search along takes: their times, scores, and the threshold.

    Use `from_estimator`.

    Attributes
    ----------
    origin : DataFrame
        ``take``, ``start``, ``stop``, ``score`` and ``threshold`` of the hits.
    axes_ : list of Axes
        The panels, one a take.
    hits_ : list of BarContainer
        The hits of each take; grey are those below the threshold.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync.display import SearchDisplay
    >>> t = np.linspace(0, 1, 40)
    >>> wave = np.column_stack([np.sin(6 * t), np.sin(9 * t)])
    >>> take = np.zeros((120, 2))
    >>> take[50:90] = wave
    >>> SearchDisplay.from_estimator(wave, take, segments=[(0, 50, 90)])
    SearchDisplay(1 hit in 1 take)
    """

    origin: pd.DataFrame
    lengths: Mapping[Any, int]  # of the takes, by their labels
    segments: pd.DataFrame | None = None  # ``take``, ``start`` and ``stop`` of true ones

    def __repr__(self):
        count, takes = int(self._accepted().sum()), len(self.lengths)
        return f"SearchDisplay({counted(count, 'hit')} in {counted(takes, 'take')})"

    @classmethod
    def from_estimator(
        cls,
        pattern: BaseEstimator | TrialLike,
        X: TrialsLike,
        *,
        segments: pd.DataFrame | Sequence[tuple[Hashable, int, int]] | None = None,
        ax: AxesLike | None = None,
        **params: Any,
    ) -> Self:
        """Search takes, and draw the hits above and below the threshold.

        Parameters
        ----------
        pattern : trials, or estimator
            The pattern of `find_trials`.
        X : takes
            The takes of `find_trials`.
        segments : DataFrame or list of (take, start, stop), default=None
            True segments of the action, by the labels of the takes.
        ax : Axes or array-like of Axes, default=None
            See `plot`.
        **params : dict
            Arguments of `find_trials`, without ``threshold``: the figure shows the hits
            above and below the automatic one.

        Returns
        -------
        SearchDisplay
            The display, drawn.

        Raises
        ------
        ValueError
            If segments are of other takes; or as from `find_trials`.
        """
        _, origin = find_trials(pattern, X, threshold=None, **params)
        takes = as_trials(X)
        lengths = dict(zip(labels_of(takes)[0], map(len, takes), strict=True))
        true_segments = None
        if segments is not None:
            true_segments = pd.DataFrame(segments, columns=["take", "start", "stop"])
            unknown = [take for take in true_segments["take"] if take not in lengths]
            if unknown:
                raise ValueError(
                    f"segments names the take {unknown[0]!r}; the takes are {list(lengths)[:8]}."
                )
        return cls._of(origin=origin, lengths=lengths, segments=true_segments).plot(ax)

    def _shown(self):
        return list(self.lengths)[:_MAX_PANELS]

    def _layout(self):
        count = len(self._shown())
        return [(i, 0) for i in range(count)], (count, 1), (WIDTH, 1.1 + 1.3 * count)

    def _draw(self):
        from matplotlib.lines import Line2D
        from matplotlib.patches import Patch

        shown = self._shown()
        accepted, self.hits_ = self._accepted(), []
        for axis, take in zip(self.axes_, shown, strict=True):
            in_take = (self.origin["take"] == take).to_numpy()
            rows = self.origin[in_take]
            colors = [COLORS["trial" if is_hit else "shadow"] for is_hit in accepted[in_take]]
            bars = axis.bar(
                rows["start"],
                np.maximum(rows["score"] - _BOTTOM, 0),
                rows["stop"] - rows["start"],
                bottom=_BOTTOM,
                align="edge",
                color=colors,
                edgecolor="white",
            )
            self.hits_.append(bars)
            if self.segments is not None:
                true = self.segments[(self.segments["take"] == take).to_numpy()]
                spans = np.column_stack([true["start"], true["stop"] - true["start"]]).tolist()
                strip = _BOTTOM - _STRIP, 0.8 * _STRIP
                axis.broken_barh(spans, strip, facecolors=COLORS["pattern"], edgecolors="white")
            for level in rows["threshold"].unique():
                axis.axhline(level, color=COLORS["mean"], linestyle="--", linewidth=1)
            axis.set_xlim(0, self.lengths[take])
            axis.set_ylim(_BOTTOM - _STRIP * (self.segments is not None), 1)
            title = f"take {take}" if len(self.lengths) > 1 else ""
            axis.set_title(title, fontsize="medium")
        self._label_axes(self.axes_, ["score (1: alike)"] * len(shown), "frame of the take")
        handles = [
            Patch(facecolor=COLORS["trial"], label="hit"),
            Patch(facecolor=COLORS["shadow"], label="below the threshold"),
            Line2D([], [], color=COLORS["mean"], linestyle="--", label="threshold"),
        ]
        if self.segments is not None:
            handles.append(Patch(facecolor=COLORS["pattern"], label="known to be there"))
        legend_above(self.axes_[:1], handles)

    def _accepted(self):
        return (self.origin["score"] >= self.origin["threshold"]).to_numpy(dtype=bool)
