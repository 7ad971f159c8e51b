"""MetricDisplay: the weight of each feature in the learnt metric."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from ..inputs.features import choose_features, names_of_features
from ..inputs.types import Features
from ..inputs.wording import counted
from ..synchronizers.dense import DenseSynchronizer
from ..utils.pipelines import find_step
from .base import COLORS, WIDTH, AxesLike, Display, legend_above

# The largest number of rows.
_MAX_ROWS = 20


@dataclass(eq=False, repr=False)
class MetricDisplay(Display):
    """The weight of each feature in the learnt metric, beside its share of the plain velocities.

    A feature with a short dark bar and a long light one moves much and says little about time: it
    is noise, or the style of a subject. Use `from_estimator`.

    Parameters
    ----------
    share : ndarray, shape (n_shown,)
        The share of each feature, or of several together, in the learnt metric; about 0, or
        slightly below, for noise.
    energy : ndarray, shape (n_shown,)
        Its share in the velocities, which are compared without a metric.
    feature_names : list of str
        One name a row.
    n_trials : int
        The number of trials from which the metric was learnt.

    Attributes
    ----------
    axes_ : list of Axes
        The panel.
    share_, energy_ : BarContainer
        Dark and light bars, from the top.

    Examples
    --------
    A column of noise moves most and has hardly any weight.

    >>> import numpy as np
    >>> from sklearn_motionsync import DenseSynchronizer, DirectionCosines
    >>> from sklearn_motionsync.display import MetricDisplay
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch, rng = make_bending(6, random_state=0), np.random.default_rng(0)
    >>> X = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    >>> X = [np.column_stack([x, rng.normal(size=len(x))]) for x in X]
    >>> display = MetricDisplay.from_estimator(DenseSynchronizer(50).fit(X), features="x37")
    >>> bool(display.energy[0] > 0.7), bool(display.share[0] < 0.1)
    (True, True)
    """

    share: np.ndarray
    energy: np.ndarray
    feature_names: Sequence[str]
    n_trials: int

    def __repr__(self):
        return f"MetricDisplay({counted(len(self.feature_names), 'row')}, {self._describe()})"

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        *,
        features: Features | None = None,
        ax: AxesLike | None = None,
    ) -> Self:
        """Draw the metric of a fitted synchronizer, or of a pipeline with one.

        Parameters
        ----------
        estimator : DenseSynchronizer, or Pipeline with one
            Fitted. The trials are not needed again.
        features : int, str or list of them, default=None
            Features by index or name, as they reach the synchronizer, such as dimensions of the
            aSpace. By default all, in the order of the larger of the two shares; of more than 20
            the smallest are summed in one row.
        ax : Axes, default=None
            See `plot`.

        Returns
        -------
        MetricDisplay
            The display, drawn.

        Raises
        ------
        ValueError
            If no metric was learnt, or there is no such feature.
        """
        before, synchronizer = find_step(estimator, DenseSynchronizer)
        check_is_fitted(synchronizer)
        metric = synchronizer.metric_
        if metric is None:
            n = len(synchronizer.global_distances_)
            settings = "metric", "cost", "consensus"
            values = ", ".join(f"{name}={getattr(synchronizer, name)!r}" for name in settings)
            raise ValueError(
                "There is no metric to draw, metric_ is None: DenseSynchronizer learns one with "
                "metric='learned', cost='velocity' and consensus above 0, from at least 3 trials "
                f"in which something moves. It has {values} and was fitted to "
                f"{counted(n, 'trial')}; change what is missing and fit it again."
            )
        names = names_of_features(before, synchronizer, len(metric.share))
        shares = np.column_stack([metric.share, metric.energy])
        if features is None:
            names, shares = _sort_and_sum(names, shares)
        else:
            chosen = choose_features(features, names)
            names, shares = [names[i] for i in chosen], shares[chosen]
        share, energy = shares.T
        return cls(share, energy, names, len(metric.trials)).plot(ax)

    def _layout(self):
        return [(0, 0)], (1, 1), (WIDTH, max(2.2, 0.27 * len(self.share) + 1.3))

    def _draw(self):
        (axis,) = self.axes_
        rows = np.arange(len(self.share))
        self.energy_ = axis.barh(
            rows,
            self.energy,
            label="without weights",
            height=0.8,
            color=COLORS["envelope"],
            alpha=0.6,
        )
        # Narrower and in front: both bars are visible, whichever is longer.
        self.share_ = axis.barh(
            rows,
            self.share,
            label="with the learnt weights",
            height=0.4,
            color=COLORS["trial"],
        )
        axis.axvline(0, color="0.3", linewidth=0.8)
        axis.set_yticks(rows, self.feature_names)
        axis.set_ylim(len(rows) - 0.4, -0.6)
        self._label_axes([axis], ["feature"], "share of what is compared (0 to 1)")
        axis.set_title(self._describe(), fontsize="medium")
        legend_above([axis], [self.energy_, self.share_])
        axis.grid(False, axis="y")

    def _describe(self):
        return f"metric learnt from {counted(self.n_trials, 'trial')}"


def _sort_and_sum(names, shares):
    """Features in the order of the larger share; the smallest of many are summed."""
    order = np.argsort(-shares.max(axis=1), kind="stable")
    names, shares = [names[i] for i in order], shares[order]
    if len(names) <= _MAX_ROWS:
        return names, shares
    n_summed = len(names) - (_MAX_ROWS - 1)
    names = [*names[:-n_summed], f"{n_summed} others"]
    return names, np.vstack([shares[:-n_summed], shares[-n_summed:].sum(axis=0)])
