"""MetricDisplay: which features the learnt metric listens to, and which it takes for noise."""

import numpy as np
from sklearn.utils.validation import check_is_fitted

from ..inputs.features import choose_features, names_of_features
from ..inputs.numbers import is_integer
from ..synchronizers.dense import DenseSynchronizer
from ..utils.pipelines import find_step
from .drawing import COLORS, panels
from .given import as_drawn, as_names

__all__ = ["MetricDisplay"]

# Rows that can be read at one glance.
_MOST_ROWS = 20


class MetricDisplay:
    """What the learnt metric makes of every feature, beside its part in the plain velocities.

    A feature whose dark bar is far shorter than its light one moves much and tells little: noise,
    or the style of a person. Use `from_estimator`.

    Parameters
    ----------
    share : ndarray, shape (n_shown,)
        The part of every feature, or of several together, in what is compared; that of noise is
        about 0, and may be a little below.
    energy : ndarray, shape (n_shown,)
        Its part in the plain velocities, which are compared without a metric.
    feature_names : list of str
    n_performances : int, default=None
        From how many performances the metric was learnt, for the title.

    Attributes
    ----------
    figure_ : Figure
    ax_ : Axes
    share_, energy_ : BarContainer
        Dark and light bars, from the top.

    Examples
    --------
    Most of all that moves is a column of noise, and it is hardly listened to.

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

    def __init__(self, share, energy, *, feature_names, n_performances=None):
        self.share = as_drawn(share, "The share", ("n_shown",))
        self.energy = as_drawn(energy, "The energy", self.share.shape)
        self.feature_names = as_names(
            feature_names, len(self.share), "feature_names", "features shown"
        )
        if n_performances is not None and not (is_integer(n_performances) and n_performances > 0):
            raise ValueError(
                "n_performances must be a whole number above 0, or None for a title without it; "
                f"got {n_performances!r}."
            )
        self.n_performances = n_performances

    def __repr__(self):
        return f"MetricDisplay({len(self.feature_names)} rows, {self._describe()})"

    @classmethod
    def from_estimator(cls, estimator, *, features=None, ax=None):
        """Draw the metric of a fitted synchronizer, or of a pipeline with one.

        Parameters
        ----------
        estimator : DenseSynchronizer, or Pipeline with one
            Fitted. Its performances are not needed again.
        features : int, str or list of them, default=None
            Which features to draw, by index or name: those that reach the synchronizer, which
            may be dimensions of the aSpace. By default all, the largest of either share first;
            of more than 20 the smallest are drawn as one row.
        ax : Axes, default=None

        Returns
        -------
        MetricDisplay

        Raises
        ------
        ValueError
            If no metric was learnt, or there is no such feature.
        """
        before, synchronizer = find_step(estimator, DenseSynchronizer)
        check_is_fitted(synchronizer)
        metric = synchronizer.metric_
        if metric is None:
            raise ValueError(_why_none(synchronizer))
        names = names_of_features(before, synchronizer, len(metric.share))
        shares = np.column_stack([metric.share, metric.energy])
        if features is None:
            names, shares = _largest(names, shares)
        else:
            chosen = choose_features(features, names)
            names, shares = [names[i] for i in chosen], shares[chosen]
        display = cls(*shares.T, feature_names=names, n_performances=len(metric.performances))
        return display.plot(ax)

    def plot(self, ax=None):
        """Draw.

        Parameters
        ----------
        ax : Axes, default=None

        Returns
        -------
        self
        """
        rows = np.arange(len(self.share))
        size = (7, max(2.2, 0.27 * len(rows) + 1.3))
        self.figure_, (self.ax_,) = panels(ax, [(0, 0)], 1, 1, size)
        self.energy_ = self.ax_.barh(
            rows,
            self.energy,
            height=0.8,
            color=COLORS["envelope"],
            alpha=0.6,
            label="of plain velocities, without a metric",
        )
        # Thinner and in front, so that both show, whichever is longer.
        self.share_ = self.ax_.barh(
            rows,
            self.share,
            height=0.4,
            color=COLORS["performance"],
            label="with the learnt metric",
        )
        self.ax_.axvline(0, color="0.3", linewidth=0.8)
        self.ax_.set_yticks(rows, self.feature_names)
        self.ax_.set_ylim(len(rows) - 0.4, -0.6)
        self.ax_.set_xlabel("share of what is compared")
        self.ax_.set_title(self._describe(), fontsize="medium")
        self.ax_.legend(loc="best", fontsize="small", frameon=True)
        self.ax_.grid(False, axis="y")
        return self

    def _describe(self):
        if self.n_performances is None:
            return "learnt metric"
        return f"metric learnt from {self.n_performances} performances"


def _largest(names, shares):
    """Features by the larger of their two shares; the last of many as one row."""
    order = np.argsort(-shares.max(axis=1), kind="stable")
    names, shares = [names[i] for i in order], shares[order]
    if len(names) <= _MOST_ROWS:
        return names, shares
    rest = len(names) - (_MOST_ROWS - 1)
    names = [*names[:-rest], f"{rest} others"]
    return names, np.vstack([shares[:-rest], shares[-rest:].sum(axis=0)])


def _why_none(synchronizer):
    """What a metric needs, and what the synchronizer has of it."""
    n = len(synchronizer.global_distances_)
    has = {name: getattr(synchronizer, name) for name in ("metric", "cost", "consensus")}
    return (
        "There is no metric to draw, metric_ is None: DenseSynchronizer learns one with "
        "metric='learned', cost='velocity' and consensus above 0, from at least 3 performances "
        f"in which something moves. It has {', '.join(f'{k}={v!r}' for k, v in has.items())} and "
        f"was fitted to {n} performance{'s' * (n != 1)}; change what is missing and fit it again."
    )
