"""TrellisDisplay: the disparity space of one pair, and the path through it (Fig. 2)."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator

from ..inputs.types import NumbersLike, PerformanceLike, PerformancesLike, ValuesLike
from ..synchronizers.dense import DenseSynchronizer
from ..utils.pipelines import index_of_pattern, route_to_synchronizer
from .arguments import AxesLike
from .drawing import COLORS, WIDTH, legend_above, panels
from .time_axis import own_keyframes

__all__ = ["TrellisDisplay"]


class TrellisDisplay:
    """The disparity space of one pair of performances, and the path through it (Fig. 2).

    Use `from_estimator`.

    Parameters
    ----------
    frames : array-like, shape (n_frames,)
        Frames p of the pattern: all of them or, of long takes, evenly spaced ones.
    offsets : array-like, shape (n_offsets,)
        Offsets d in frames of the pattern, evenly spaced.
    costs : array-like, shape (n_frames, n_offsets)
        E(p, d), the difference between the pattern at p and the performance at p + d; NaN where no
        path that obeys Eqs. 9 and 13 can pass.
    path : array-like, shape (P,)
        The offsets of the best path between the pattern and the performance.
    warp : array-like, shape (P,)
        The final offsets Delta(p), after consensus, smoothing and refinement.
    names : (str, str), default=("template", "trial")
        Names of the pattern and of the performance.
    keyframes : array-like, shape (n_keyframes, 2), default=None
        The frame of each key-frame in the pattern, and the offset of the performance there; NaN
        where one is not known.

    Attributes
    ----------
    figure_ : Figure
        The figure of the last plot.
    ax_ : Axes
        The axes of the last plot.
    image_ : AxesImage
        The costs.
    path_, warp_ : Line2D
        The best path, and the final warp.
    keyframes_ : Line2D or None
        The key-frames, as points.
    colorbar_ : Colorbar or None
        The scale of the costs.

    Examples
    --------
    >>> from sklearn_motionsync import DenseSynchronizer, DirectionCosines
    >>> from sklearn_motionsync.display import TrellisDisplay
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(6, random_state=0)
    >>> X = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    >>> display = TrellisDisplay.from_estimator(DenseSynchronizer(50).fit(X), X, performance=2)
    >>> display.costs.shape
    (50, 41)
    """

    def __init__(
        self,
        frames: ValuesLike,
        offsets: ValuesLike,
        costs: PerformanceLike,
        path: ValuesLike,
        warp: ValuesLike,
        *,
        names: tuple[str, str] = ("template", "trial"),
        keyframes: NumbersLike | None = None,
    ) -> None:
        self.frames, self.offsets = np.asarray(frames, dtype=np.float64), np.asarray(offsets)
        self.costs, self.path, self.warp = np.asarray(costs), np.asarray(path), np.asarray(warp)
        self.names = names
        self.keyframes = None if keyframes is None else np.asarray(keyframes, dtype=np.float64)

    def __repr__(self):
        return f"TrellisDisplay({self.names[1]} matched to {self.names[0]})"

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: PerformancesLike,
        *,
        performance: int = 0,
        ax: AxesLike | None = None,
        colorbar: bool = True,
        keyframe_points: bool = True,
        **params: Any,
    ) -> Self:
        """Draw the disparity space of the pattern and one performance.

        Parameters
        ----------
        estimator : DenseSynchronizer, or Pipeline with one
            Fitted.
        X : performances
            As the estimator takes them.
        performance : int, default=0
            The index of the performance that is matched to the pattern.
        ax : Axes, default=None
            Axes to draw on. None makes a figure.
        colorbar : bool, default=True
            Whether to draw a scale of the costs.
        keyframe_points : bool, default=True
            Whether to draw the key-frames that are given for the performance.
        **params : dict
            Further arguments of the synchronizer and of steps before, such as ``keyframes``.

        Returns
        -------
        TrellisDisplay
            The display, drawn.
        """
        caller = f"{cls.__name__}.from_estimator"
        reached = route_to_synchronizer(estimator, X, params, caller, kind=DenseSynchronizer)
        synchronizer, performances = reached.synchronizer, reached.performances
        space = synchronizer.disparity_space(performances, performance, **reached.params)
        if reached.params:
            warp = reached.match().offsets[performance]
        else:
            warp = synchronizer.match(performances.take([performance])).offsets[0]
        index = index_of_pattern(synchronizer, performances)
        names = ("template" if index is None else f"template {index}", f"trial {performance}")
        keyframes = own_keyframes(synchronizer, performances, reached.params)
        if keyframes is not None:
            last = (synchronizer.n_frames_ - 1) / (len(performances[performance]) - 1)
            at = synchronizer.keyframes_
            keyframes = np.column_stack([at, keyframes[performance] * last - at])
        display = cls(
            space.frames,
            space.offsets,
            space.costs,
            space.path,
            warp,
            names=names,
            keyframes=keyframes,
        )
        return display.plot(ax, colorbar=colorbar, keyframe_points=keyframe_points)

    def plot(
        self,
        ax: AxesLike | None = None,
        *,
        colorbar: bool = True,
        keyframe_points: bool = True,
    ) -> Self:
        """Draw.

        Parameters
        ----------
        ax : Axes, default=None
            Axes to draw on. None makes a figure.
        colorbar : bool, default=True
            Whether to draw a scale of the costs.
        keyframe_points : bool, default=True
            Whether to draw key-frames, if there are some.

        Returns
        -------
        TrellisDisplay
            The display itself.
        """
        from matplotlib.colors import PowerNorm
        from matplotlib.patches import Patch
        from matplotlib.patheffects import Normal, Stroke

        self.figure_, (self.ax_,) = panels(ax, [(0, 0)], 1, 1, (WIDTH, 4))
        frames = np.arange(len(self.path))
        # Low costs are dark; the square root resolves differences among them.
        self.image_ = self.ax_.imshow(
            np.ma.masked_invalid(self.costs.T),
            origin="lower",
            aspect="auto",
            extent=(*_edges(self.frames), *_edges(self.offsets)),
            interpolation="nearest",
            cmap="cividis",
            norm=PowerNorm(0.5, vmin=0),
        )
        self.ax_.set_facecolor("0.85")
        outline = [Stroke(linewidth=4, foreground="white"), Normal()]
        (self.path_,) = self.ax_.plot(
            frames, self.path, color="#D55E00", linewidth=2, path_effects=outline, label="best path"
        )
        (self.warp_,) = self.ax_.plot(
            frames,
            self.warp,
            "--",
            color=COLORS["pattern"],
            linewidth=1.6,
            path_effects=[Stroke(linewidth=3, foreground="white"), Normal()],
            label="warp in the end",
        )
        self.ax_.set_title(f"{self.names[1]} matched to {self.names[0]}", fontsize="medium")
        self.ax_.set_xlabel(f"frame p of {self.names[0]}")
        self.ax_.set_ylabel(f"offset d of {self.names[1]} (frames)")
        outside = Patch(facecolor="0.85", edgecolor="0.6", label="no path can pass")
        handles, self.keyframes_ = [self.path_, self.warp_, outside], None
        points = self.keyframes if keyframe_points else None
        if points is not None and np.isfinite(points).all(axis=1).any():
            (self.keyframes_,) = self.ax_.plot(
                points[:, 0],
                points[:, 1],
                "o",
                color="white",
                markersize=7,
                markeredgecolor="black",
                linestyle="none",
                zorder=5,
                label="key-frame",
            )
            handles.append(self.keyframes_)
        legend_above([self.ax_], handles, [handle.get_label() for handle in handles])
        self.ax_.grid(False)
        self.colorbar_ = None
        if colorbar:
            self.colorbar_ = self.figure_.colorbar(self.image_, ax=self.ax_)
            self.colorbar_.set_label("difference E(p, d); dark: alike")
        return self


def _edges(centres):
    """The outer edges of cells around evenly spaced centres."""
    half = (centres[1] - centres[0]) / 2 if len(centres) > 1 else 0.5
    return centres[0] - half, centres[-1] + half
