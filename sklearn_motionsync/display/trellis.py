"""TrellisDisplay: the disparity space of one pair, and the path through it (Fig. 2)."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.utils import Bunch

from ..inputs.types import TrialsLike
from ..synchronizers.dense import DenseSynchronizer
from ..utils.pipelines import index_of_pattern, route_to_synchronizer
from .base import COLORS, WIDTH, AxesLike, Display, front_line, legend_above


class TrellisDisplay(Display):
    """The disparity space of one pair of trials, and the path through it (Fig. 2).

    Use `from_estimator`.

    Attributes
    ----------
    space : Bunch
        From `DenseSynchronizer.disparity_space`: frames, offsets, costs, and the best path.
    warp : ndarray, shape (P,)
        The final offsets Delta(p), after consensus, smoothing and refinement.
    axes_ : list of Axes
        The panel.
    image_ : AxesImage
        The costs.
    path_, warp_ : Line2D
        The best path, and the final warp.
    colorbar_ : Colorbar
        The scale of the costs.

    Examples
    --------
    >>> from sklearn_motionsync import DenseSynchronizer, DirectionCosines
    >>> from sklearn_motionsync.display import TrellisDisplay
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(6, random_state=0)
    >>> X = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    >>> display = TrellisDisplay.from_estimator(DenseSynchronizer(50).fit(X), X, trial=2)
    >>> display.space.costs.shape
    (50, 41)
    """

    space: Bunch
    warp: np.ndarray
    names: tuple[str, str]  # of the pattern and of the trial

    def __repr__(self):
        return f"TrellisDisplay({self.names[1]} matched to {self.names[0]})"

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: TrialsLike,
        *,
        trial: int = 0,
        ax: AxesLike | None = None,
        **params: Any,
    ) -> Self:
        """Draw the disparity space of the pattern and one trial.

        Parameters
        ----------
        estimator : DenseSynchronizer, or Pipeline with one
            Fitted.
        X : trials
            As the estimator takes them.
        trial : int, default=0
            The index of the trial that is matched to the pattern.
        ax : Axes, default=None
            See `plot`.
        **params : dict
            Further arguments of the synchronizer and of steps before, such as ``keyframes``.

        Returns
        -------
        TrellisDisplay
            The display, drawn.
        """
        caller = f"{cls.__name__}.from_estimator"
        reached = route_to_synchronizer(estimator, X, params, caller, kind=DenseSynchronizer)
        synchronizer, trials = reached.synchronizer, reached.trials
        index = index_of_pattern(synchronizer, trials)
        pattern = "pattern" if index is None else f"pattern {index}"
        return cls._of(
            space=synchronizer.disparity_space(trials, trial, **reached.params),
            warp=reached.match().offsets[trial],
            names=(pattern, f"trial {trial}"),
        ).plot(ax)

    def _layout(self):
        return [(0, 0)], (1, 1), (WIDTH, 4)

    def _draw(self):
        from matplotlib.colors import PowerNorm
        from matplotlib.patches import Patch

        (axis,), space = self.axes_, self.space
        frames = np.arange(len(space.path))
        # Low costs are dark; the square root resolves differences among them.
        self.image_ = axis.imshow(
            np.ma.masked_invalid(space.costs.T),
            origin="lower",
            aspect="auto",
            extent=(*_edges(space.frames), *_edges(space.offsets)),
            interpolation="nearest",
            cmap="cividis",
            norm=PowerNorm(0.5, vmin=0),
        )
        axis.set_facecolor("0.85")
        orange, black = COLORS["mean"], COLORS["pattern"]
        self.path_ = front_line(
            axis, frames, space.path, color=orange, linewidth=2, label="best path"
        )
        self.warp_ = front_line(
            axis, frames, self.warp, color=black, linestyle="--", label="warp in the end"
        )
        axis.set_title(f"{self.names[1]} matched to {self.names[0]}", fontsize="medium")
        offset = f"offset d of {self.names[1]} (frames)"
        self._label_axes([axis], [offset], f"frame p of {self.names[0]}")
        outside = Patch(facecolor="0.85", edgecolor="0.6", label="no path can pass")
        legend_above([axis], [self.path_, self.warp_, outside])
        axis.grid(False)
        self.colorbar_ = self.figure_.colorbar(self.image_, ax=axis)
        self.colorbar_.set_label("difference E(p, d); dark: alike")


def _edges(centres):
    """The outer edges of cells around evenly spaced centres."""
    half = (centres[1] - centres[0]) / 2 if len(centres) > 1 else 0.5
    return centres[0] - half, centres[-1] + half
