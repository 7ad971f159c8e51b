"""ActionModelDisplay: the mean of a learnt action, a band about it, who leaves it (Fig. 3d)."""

import numpy as np

from ..features import choose_features
from ..model.views import view_of
from .drawing import COLORS, curves, panels, parts_outside
from .given import as_drawn, as_names, is_number

__all__ = ["ActionModelDisplay"]

# What each band holds, said above the legend.
_HOLDS = {
    "points": "band holds single postures, not performances",
    "performances": "band holds {share:.3g} % of new people's performances",
    "mean": "band holds the mean of all people, {share:.3g} % sure",
}
# Of the largest bound, how much beyond it is rounding, in units of the last place.
_ROUNDING = 64


class ActionModelDisplay:
    """The learnt action: mean, a band about it, and the performances behind (Fig. 3d).

    Use `from_estimator`.

    Parameters
    ----------
    mean, lower, upper : ndarray, shape (P, n_shown)
    feature_names : list of str
    n_std : float, default=None
        Half-width of the band, in standard deviations; None only of the band of the mean.
    performances : ndarray, shape (n_sequences, P, n_shown), default=None
        Synchronised performances, drawn behind.
    band : {"points", "performances", "mean"}, default="points"
        What the band holds, for the legend: see `from_estimator`.
    coverage : float, default=None
        The share that it holds, between 0 and 1; None only of the band of points.
    departures : bool, default=True
        Whether parts of performances outside the band are violet. They never are when the band is
        that of the mean, which nobody needs to keep to.

    Attributes
    ----------
    figure_ : Figure
    axes_ : list of Axes
        One a feature.
    mean_ : list of Line2D
    envelope_ : list of FillBetweenPolyCollection
    performances_ : list of LineCollection
        Empty without performances.
    departures_ : list of LineCollection
        What of them is outside the band; empty where that is not drawn.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn_motionsync import ActionModel, ASpace, DenseSynchronizer, DirectionCosines
    >>> from sklearn_motionsync import ActionModelDisplay
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(6, random_state=0)
    >>> steps = DirectionCosines(bunch.skeleton), ASpace(), DenseSynchronizer(50), ActionModel()
    >>> pipe = make_pipeline(*steps).fit(bunch.data)
    >>> display = ActionModelDisplay.from_estimator(pipe, bunch.data, features="pelvis_height")
    >>> display.mean.shape
    (50, 1)
    """

    def __init__(
        self,
        mean,
        lower,
        upper,
        *,
        feature_names,
        n_std=None,
        performances=None,
        band="points",
        coverage=None,
        departures=True,
    ):
        self.mean = as_drawn(mean, "The mean", ("P", "n_shown"))
        self.lower = as_drawn(lower, "The lower bound", self.mean.shape)
        self.upper = as_drawn(upper, "The upper bound", self.mean.shape)
        n_shown = self.mean.shape[1]
        self.feature_names = as_names(feature_names, n_shown, "feature_names", "features")
        self.band = _as_band(band)
        if not (is_number(n_std, 0) or (n_std is None and band == "mean")):
            raise ValueError(f"n_std must be a number of at least 0, got {n_std!r}.")
        if not (is_number(coverage, 0, 1) or (coverage is None and band == "points")):
            raise ValueError(f"coverage must be a share between 0 and 1, got {coverage!r}.")
        self.n_std, self.coverage = n_std, coverage
        self.departures = bool(departures)
        self.performances = None
        if performances is not None:
            shape = ("n_sequences", *self.mean.shape)
            self.performances = as_drawn(performances, "What is drawn behind", shape)

    def __repr__(self):
        return f"ActionModelDisplay({self.feature_names})"

    @classmethod
    def from_estimator(
        cls, estimator, X=None, *, features=None, band="points", departures=True, ax=None, **params
    ):
        """Draw a fitted model, or a pipeline that ends in one.

        Parameters
        ----------
        estimator : ActionModel, or Pipeline with one
            Fitted.
        X : performances, as the estimator takes them, default=None
            Drawn behind, as they reach the model.
        features : int, str or list of them, default=None
            Features of the model, by index or name. In a pipeline with an `ASpace` they may also
            be features of the postures, such as ``"pelvis_height"`` or ``"left_leg_y"``: the
            model is then taken back out of the aSpace, fitted anew on the postures of the
            performances that it keeps. By default the first four of the model.
        band : {"points", "performances", "mean"}, default="points"
            Which band is drawn about the mean, and named in the legend:

            - ``"points"``: ``model.envelope()``, ``n_std`` standard deviations at every frame by
              itself. It holds most postures of new people, but few of their performances from
              the first frame to the last;
            - ``"performances"``: ``model.envelope(simultaneous=True)``, which holds the share
              ``coverage`` of whole performances of new people, in all features and at all frames.
              In features of postures it allows for what the `ASpace` leaves out, and performances
              are drawn with that;
            - ``"mean"``: ``model.mean_envelope()``, which holds the mean of all people with
              probability ``coverage``: how well the mean is known.
        departures : bool, default=True
            Whether the parts of performances that leave the band are drawn violet; they are not
            when the band is that of the mean.
        ax : Axes or array-like of Axes, default=None
            See `plot`.
        **params : dict
            What synchronizing X takes besides, such as ``keyframes``.

        Returns
        -------
        ActionModelDisplay

        See Also
        --------
        SkeletonDisplay.from_departures : Which limbs depart, on stick figures.
        """
        _as_band(band)
        if X is None and params:
            raise TypeError(
                f"{cls.__name__}.from_estimator takes {', '.join(params)} along with performances "
                "X only."
            )
        caller = f"{cls.__name__}.from_estimator"
        view = view_of(estimator, X, params, caller, features=features)
        chosen = choose_features(features, view.names)
        lower, upper, n_std = _bounds(view, band)
        shown = view.whole if band == "performances" else view.synchronised
        display = cls(
            view.model.mean_[:, chosen],
            lower[:, chosen],
            upper[:, chosen],
            feature_names=[view.names[i] for i in chosen],
            n_std=n_std,
            performances=None if shown is None else shown[:, :, chosen],
            band=band,
            coverage=None if band == "points" else view.model.coverage,
            departures=departures,
        )
        return display.plot(ax)

    def plot(self, ax=None):
        """Draw.

        Parameters
        ----------
        ax : Axes or array-like of Axes, default=None
            One of a figure's subplots is divided into the panels; or one axes a feature. None
            makes a figure.

        Returns
        -------
        self
        """
        count = len(self.feature_names)
        n_cols = 1 if count == 1 else 2
        n_rows = -(-count // n_cols)
        spots = [divmod(i, n_cols) for i in range(count)]
        size = (5 * n_cols, max(3, 2.2 * n_rows + 0.6))
        self.figure_, self.axes_ = panels(ax, spots, n_rows, n_cols, size)
        clock = np.arange(len(self.mean))
        self.mean_, self.envelope_, self.performances_, self.departures_ = [], [], [], []
        for i, (axis, name) in enumerate(zip(self.axes_, self.feature_names, strict=True)):
            bounds = self.lower[:, i], self.upper[:, i]
            style = {"color": COLORS["envelope"], "alpha": 0.35, "linewidth": 0}
            self.envelope_.append(axis.fill_between(clock, *bounds, label=self._label(), **style))
            for bound in bounds:
                axis.plot(clock, bound, color=COLORS["pattern"], linewidth=0.9)
            if self.performances is not None:
                self._draw_performances(axis, clock, i)
            style = {"color": COLORS["mean"], "linewidth": 2, "label": "mean performance"}
            self.mean_ += axis.plot(clock, self.mean[:, i], **style)
            axis.set_ylabel(name)
            if i + n_cols >= count:
                axis.set_xlabel("frame of the pattern")
        self._explain(self.axes_[0], above=ax is None)
        return self

    def _draw_performances(self, axis, clock, i):
        behind = self.performances[:, :, i]
        style = {"linewidths": 0.7, "linestyles": "dashed", "alpha": 0.55}
        style |= {"colors": COLORS["performance"], "label": f"{len(behind)} performances"}
        self.performances_.append(curves(axis, [clock] * len(behind), behind, **style))
        if self.departures and self.band != "mean":
            outside = parts_outside(behind, *(bound[:, i] for bound in self._just_outside()))
            style = {"colors": COLORS["departure"], "linewidths": 1.4, "zorder": 3}
            style["label"] = f"outside the band: {self._count_outside()} of them"
            self.departures_.append(curves(axis, *outside, **style))

    def _count_outside(self):
        """How many performances leave the band in a feature that is shown."""
        lower, upper = self._just_outside()
        outside = (self.performances < lower) | (self.performances > upper)
        return int(outside.any(axis=(1, 2)).sum())

    def _just_outside(self):
        """The bounds, so much farther out that rounding does not count."""
        largest = [np.nanmax(np.abs(b), axis=0, initial=0) for b in (self.lower, self.upper)]
        eps = np.finfo(np.result_type(self.mean, np.float32)).eps
        margin = _ROUNDING * eps * np.maximum(*largest)
        return self.lower - margin, self.upper + margin

    def _label(self):
        if self.n_std is None:
            return "where the mean may be"
        predicted = "predicted " if self.band == "performances" else ""
        return f"mean ± {self.n_std:.3g} {predicted}standard deviations"

    def _explain(self, axis, above):
        """A legend, with what the band holds as its title; above the panel it hides nothing."""
        title = _HOLDS[self.band].format(share=100 * (self.coverage or 0))
        style = {"fontsize": "small", "title_fontsize": "small", "alignment": "left"}
        if above:
            style |= {"loc": "lower left", "bbox_to_anchor": (0, 1)}
        axis.legend(frameon=not above, title=title, **style)


def _as_band(band):
    if not (isinstance(band, str) and band in _HOLDS):
        raise ValueError(f"band must be one of {list(_HOLDS)}, got {band!r}.")
    return band


def _bounds(view, band):
    """Lower and upper bound of a band, and its half-width in standard deviations."""
    if band == "mean":
        # The same picture every time.
        return *view.model.mean_envelope(random_state=0), None
    if band == "points":
        return *view.model.envelope(), view.model.n_std
    factor = view.model.simultaneous_factor()
    mean, reach = view.model.mean_, factor * view.predicted
    return mean - reach, mean + reach, factor
