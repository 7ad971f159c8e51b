"""ActionModelDisplay: the mean and the envelope of a learnt action (Fig. 3d)."""

import numpy as np
from sklearn.utils.validation import check_is_fitted

from ..aspace import ASpace
from ..features import as_features, choose_features, names_of
from ..model.action_model import ActionModel
from ..pipelines import find_step, flat_steps, transform_through
from .drawing import COLORS, curves, panels
from .given import as_drawn, as_names, is_number

__all__ = ["ActionModelDisplay"]


class ActionModelDisplay:
    """The learnt action: mean, envelope, and the performances behind (Fig. 3d).

    Use `from_estimator`.

    Parameters
    ----------
    mean, lower, upper : ndarray, shape (P, n_shown)
    feature_names : list of str
    n_std : float
        Half-width of the envelope, in standard deviations.
    performances : ndarray, shape (n_sequences, P, n_shown), default=None
        Synchronised performances, drawn behind.

    Attributes
    ----------
    figure_ : Figure
    axes_ : list of Axes
        One a feature.
    mean_ : list of Line2D
    envelope_ : list of FillBetweenPolyCollection
    performances_ : list of LineCollection
        Empty without performances.

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

    def __init__(self, mean, lower, upper, *, feature_names, n_std, performances=None):
        self.mean = as_drawn(mean, "The mean", ("P", "n_shown"))
        self.lower = as_drawn(lower, "The lower bound", self.mean.shape)
        self.upper = as_drawn(upper, "The upper bound", self.mean.shape)
        n_shown = self.mean.shape[1]
        self.feature_names = as_names(feature_names, n_shown, "feature_names", "features")
        if not is_number(n_std, 0):
            raise ValueError(f"n_std must be a number of at least 0, got {n_std!r}.")
        self.n_std = n_std
        self.performances = None
        if performances is not None:
            shape = ("n_sequences", *self.mean.shape)
            self.performances = as_drawn(performances, "What is drawn behind", shape)

    def __repr__(self):
        return f"ActionModelDisplay({self.feature_names})"

    @classmethod
    def from_estimator(cls, estimator, X=None, *, features=None, ax=None, **params):
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
            model is then taken back out of the aSpace, mean and variance alike. By default the
            first four of the model.
        ax : Axes or array-like of Axes, default=None
            See `plot`.
        **params : dict
            What synchronizing X takes besides, such as ``keyframes``.

        Returns
        -------
        ActionModelDisplay
        """
        before, model = find_step(estimator, ActionModel)
        check_is_fitted(model)
        synchronised = None
        if X is None and params:
            raise TypeError(
                f"{cls.__name__}.from_estimator takes {', '.join(params)} along with performances "
                "X only."
            )
        if X is not None:
            given = transform_through(before, X, params, f"{cls.__name__}.from_estimator")
            synchronised = np.stack(model.check_performances(given))
        mean, std = model.mean_, np.sqrt(model.variance_)
        names = names_of(before, model, mean.shape[1])
        space = _posture_space(before, names, features)
        if space is not None:
            aspace, names = space
            mean = mean @ aspace.components_ + aspace.mean_
            std = np.sqrt(model.variance_ @ np.square(aspace.components_))
            if synchronised is not None:
                synchronised = synchronised @ aspace.components_ + aspace.mean_
        chosen = choose_features(features, names)
        mean, reach = mean[:, chosen], model.n_std * std[:, chosen]
        display = cls(
            mean,
            mean - reach,
            mean + reach,
            feature_names=[names[i] for i in chosen],
            n_std=model.n_std,
            performances=None if synchronised is None else synchronised[:, :, chosen],
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
        self.mean_, self.envelope_, self.performances_ = [], [], []
        for i, (axis, name) in enumerate(zip(self.axes_, self.feature_names, strict=True)):
            bounds = self.lower[:, i], self.upper[:, i]
            label = f"mean ± {self.n_std:g} standard deviations"
            fill = axis.fill_between(
                clock, *bounds, color=COLORS["envelope"], alpha=0.35, linewidth=0, label=label
            )
            self.envelope_.append(fill)
            for bound in bounds:
                axis.plot(clock, bound, color=COLORS["pattern"], linewidth=0.9)
            if self.performances is not None:
                behind = self.performances[:, :, i]
                self.performances_.append(
                    curves(
                        axis,
                        [clock] * len(behind),
                        behind,
                        colors=COLORS["performance"],
                        linewidths=0.7,
                        linestyles="dashed",
                        alpha=0.55,
                        label=f"{len(behind)} performances",
                    )
                )
            style = {"color": COLORS["mean"], "linewidth": 2, "label": "mean performance"}
            self.mean_ += axis.plot(clock, self.mean[:, i], **style)
            axis.set_ylabel(name)
            if i + n_cols >= count:
                axis.set_xlabel("frame of the pattern")
        self.axes_[0].legend(loc="best", fontsize="small", frameon=True)
        return self


def _posture_space(before, names, features):
    """The ASpace before the model and the names of its postures, if the features ask for them."""
    asked = as_features(features)
    if before is None or all(not isinstance(f, str) or f in names for f in asked):
        return None
    before_aspace, aspace = find_step(before, ASpace)
    steps = flat_steps(before)
    between = [s for s in steps[steps.index(aspace) + 1 :] if not hasattr(s, "match")]
    if between:
        raise ValueError(
            f"Between ASpace and ActionModel stands {between[0]}: the model cannot be taken back "
            f"to postures. Draw features of the model: {', '.join(names)}."
        )
    return aspace, names_of(before_aspace, aspace, aspace.n_features_in_)
