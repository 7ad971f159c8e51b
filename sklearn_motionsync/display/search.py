"""SearchDisplay: hits along takes, with their scores, and what is known to be there."""

import numpy as np
import pandas as pd

from ..inputs.collections import as_collection
from ..inputs.tables import labels_of
from ..inputs.validation import read_collection
from ..segmentation.search import find_performances
from .drawing import COLORS, panels

__all__ = ["SearchDisplay"]

# Below this score nothing is told apart, so that the axis begins here; true parts lie below it.
_BOTTOM, _STRIP = 0.3, 0.06
# Panels of one figure.
_MOST = 12


class SearchDisplay:
    """Hits along takes: when, with which score, and above or below the threshold.

    Use `from_estimator`, or `from_predictions` with what `find_performances` gave.

    Parameters
    ----------
    origin : DataFrame
        ``take``, ``start``, ``stop``, ``score`` and ``threshold`` of hits.
    lengths : dict
        Frames of each take, by its label: one panel each.
    segments : DataFrame or list of (take, start, stop), default=None
        Where the action is known to happen.

    Attributes
    ----------
    figure_ : Figure
    axes_ : list of Axes
        One a take.
    hits_ : list of PatchCollection
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

    def __init__(self, origin, lengths, *, segments=None):
        self.origin, self.lengths = _as_table(origin, "origin"), dict(lengths)
        self.segments = None if segments is None else _as_table(segments, "segments")
        for name, table in (("origin", self.origin), ("segments", self.segments)):
            strange = [] if table is None else [t for t in table["take"] if t not in self.lengths]
            if strange:
                raise ValueError(
                    f"{name} names the take {strange[0]!r}, which is none of those that are "
                    f"drawn: {list(self.lengths)[:8]}."
                )

    def __repr__(self):
        count, takes = int(self._accepted().sum()), len(self.lengths)
        return f"SearchDisplay({count} hit{'s' * (count != 1)} in {takes} take{'s' * (takes != 1)})"

    @classmethod
    def from_estimator(cls, pattern, X, *, segments=None, ax=None, **params):
        """Find performances, and draw them and what comes near the threshold.

        Parameters
        ----------
        pattern, X : as for `find_performances`
        segments : DataFrame or list of (take, start, stop), default=None
            Where the action is known to happen; takes by label or index.
        ax : Axes, or one for each take, default=None
        **params : dict
            Of `find_performances`, but ``threshold``.

        Returns
        -------
        SearchDisplay
        """
        if params.get("threshold", "auto") != "auto":
            raise ValueError(
                "SearchDisplay.from_estimator draws hits beside the learnt threshold; for another "
                "one give what find_performances found to from_predictions."
            )
        _, origin = find_performances(pattern, X, **params | {"threshold": None})
        return cls.from_predictions(origin, X, segments=segments, ax=ax)

    @classmethod
    def from_predictions(cls, origin, X, *, segments=None, ax=None):
        """Draw what `find_performances` gave.

        Parameters
        ----------
        origin : DataFrame
        X : the takes that were searched
        segments, ax : as for `from_estimator`

        Returns
        -------
        SearchDisplay
        """
        takes = as_collection(X)
        takes = [X] if takes is None else takes
        if as_collection(X) is not None:
            read_collection(X)
        lengths = dict(zip(labels_of(takes)[0], map(len, takes), strict=True))
        return cls(origin, lengths, segments=segments).plot(ax)

    def plot(self, ax=None):
        """Draw.

        Parameters
        ----------
        ax : Axes, or one for each take, default=None

        Returns
        -------
        self
        """
        from matplotlib.collections import PatchCollection
        from matplotlib.patches import Rectangle

        shown = list(self.lengths)[:_MOST]
        spots = [(i, 0) for i in range(len(shown))]
        size = (8, 1.1 + 1.3 * len(shown))
        self.figure_, self.axes_ = panels(ax, spots, len(shown), 1, size)
        accepted, self.hits_ = self._accepted(), []
        for axis, take in zip(self.axes_, shown, strict=True):
            mine = (self.origin["take"] == take).to_numpy()
            boxes, colors = [], []
            rows = self.origin[mine]
            for start, stop, score, good in zip(
                rows["start"], rows["stop"], rows["score"], accepted[mine], strict=True
            ):
                height = max(score - _BOTTOM, 0)
                boxes.append(Rectangle((start, _BOTTOM), stop - start, height))
                colors.append(COLORS["performance"] if good else COLORS["shadow"])
            self.hits_.append(PatchCollection(boxes, facecolors=colors, edgecolors="white"))
            axis.add_collection(self.hits_[-1])
            self._draw_known(axis, take)
            for level in rows["threshold"].unique():
                axis.axhline(level, color=COLORS["mean"], linestyle="--", linewidth=1)
            axis.set_xlim(0, self.lengths[take])
            axis.set_ylim(_BOTTOM - _STRIP * (self.segments is not None), 1)
            axis.set_ylabel("score")
            title = f"take {take}" if len(self.lengths) > 1 else ""
            axis.set_title(title, fontsize="medium", loc="left")
        self.axes_[-1].set_xlabel("frame of the take")
        self._explain()
        return self

    def _accepted(self):
        return (self.origin["score"] >= self.origin["threshold"]).to_numpy(dtype=bool)

    def _draw_known(self, axis, take):
        """The true parts as a strip below the hits."""
        if self.segments is None:
            return
        rows = self.segments[(self.segments["take"] == take).to_numpy()]
        spans = np.column_stack([rows["start"], rows["stop"] - rows["start"]]).tolist()
        strip = _BOTTOM - _STRIP, 0.8 * _STRIP
        axis.broken_barh(spans, strip, facecolors=COLORS["pattern"], edgecolors="white")

    def _explain(self):
        from matplotlib.lines import Line2D
        from matplotlib.patches import Patch

        handles = [
            Patch(facecolor=COLORS["performance"], label="hit"),
            Patch(facecolor=COLORS["shadow"], label="below the threshold"),
            Line2D([], [], color=COLORS["mean"], linestyle="--", label="threshold"),
        ]
        if self.segments is not None:
            handles.append(Patch(facecolor=COLORS["pattern"], label="known to be there"))
        self.axes_[0].legend(
            handles=handles,
            ncols=len(handles),
            loc="lower right",
            bbox_to_anchor=(1, 1),
            fontsize="small",
            frameon=False,
            borderaxespad=0.2,
        )


def _as_table(rows, name):
    """Rows with the columns take, start and stop; hits have score and threshold, too."""
    needed = ["take", "start", "stop"] + ["score", "threshold"] * (name == "origin")
    if not isinstance(rows, pd.DataFrame):
        rows = [tuple(row) for row in rows]
        wrong = [row for row in rows if len(row) != len(needed)]
        if wrong:
            raise ValueError(f"{name} needs rows ({', '.join(needed)}), got {wrong[0]!r}.")
        rows = pd.DataFrame(rows, columns=needed)
    missing = [column for column in needed if column not in rows.columns]
    if missing:
        raise ValueError(f"{name} needs the columns {needed}; {missing} are missing.")
    return rows
