"""Stick figures: strips of postures, samples of a model (Fig. 4), and people moving in step."""

import numpy as np
from sklearn.utils.validation import check_is_fitted

from ..body.direction_cosines import DirectionCosines
from ..body.skeleton import Skeleton
from ..model.action_model import ActionModel
from ..pipelines import find_step, find_synchronizer, index_of_pattern, reach_synchronizer
from ..sequences import as_collection
from ..synchronizers.match import as_match
from .animation import playable
from .bodies import (
    bodies_of,
    bodies_of_postures,
    bones_by_side,
    limits,
    on_screen,
    placed,
    upright,
)
from .drawing import COLORS, panels, stage
from .given import (
    as_durations,
    as_frames,
    as_indices,
    as_labels,
    as_moments,
    as_names,
    as_pictures,
    as_scenes,
    as_skeleton,
    check_view,
)

__all__ = ["SkeletonDisplay"]

# Performances side by side in a moving picture, if not chosen; panels in one row of a strip.
_FEW_PERFORMANCES, _PANELS_A_ROW = 6, 6
# Between two stick figures, in heights of the tallest.
_SPACING = 0.7


class SkeletonDisplay:
    """Stick figures of joint positions: strips of postures, or performances in motion.

    Make one with `from_positions`, `from_postures` (strips), `from_model` (Fig. 4),
    `from_estimator` or `from_predictions` (performances before and after synchronisation, to
    `animate`). Left limbs are blue, right ones orange. People are turned to face the same way
    at first. Their lowest joint ever is on the floor; the pictures of a strip, and those of people
    who walk away, go with the pelvis.

    Parameters
    ----------
    scenes : list of list of ndarray (n_frames_i, n_joints, 3)
        For each panel its performances: joint positions in axes of which the second is vertical.
    skeleton : Skeleton or None
        Joints and bones; None draws all joints as points, without bones.
    titles : list of str
        One a panel.
    durations : list of list of float, default=None
        How long each performance of each panel takes, in frames; by default as many frames
        as it has, less one.
    labels : list of str, default=None
        Names under the performances of a panel, which then stand side by side instead of in one
        place.

    Attributes
    ----------
    figure_ : Figure
    axes_ : list of Axes
    bones_ : list of dict
        For each panel the LineCollections of the ``"left"``, ``"middle"`` and ``"right"`` bones.
    heads_ : list of Line2D
        Without a skeleton, all joints.

    Examples
    --------
    >>> from sklearn_motionsync import SkeletonDisplay
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(3, random_state=0)
    >>> display = SkeletonDisplay.from_positions(bunch.data[0], bunch.skeleton, frames=5)
    >>> len(display.axes_)
    5
    """

    def __init__(self, scenes, skeleton, titles, *, durations=None, labels=None):
        self.skeleton = as_skeleton(skeleton)
        self.scenes = as_scenes(scenes, skeleton)
        self.titles = as_names(titles, len(self.scenes), "titles", "panels")
        self.durations = None if durations is None else as_durations(durations, self.scenes)
        self.labels = None if labels is None else as_labels(labels, self.scenes)

    def __repr__(self):
        return f"SkeletonDisplay({len(self.scenes)} panels)"

    @classmethod
    def from_positions(cls, X, skeleton, *, frames=6, ax=None, **view):
        """Draw a strip of postures of one performance, or of synchronised ones over each other.

        Parameters
        ----------
        X : array-like, shape (n_frames, 3 * n_joints), or (n_sequences, n_frames, 3 * n_joints)
            Joint positions.
        skeleton : Skeleton or None
            None draws the joints as points without bones, turned as they are, y up.
        frames : int or list of int, default=6
            How many, evenly spaced from the first to the last, or which ones.
        ax : Axes or array-like of Axes, default=None
            See `plot`.
        **view : at, azimuth
            See `plot`.

        Returns
        -------
        SkeletonDisplay
        """
        as_skeleton(skeleton)
        performances = [upright(x, skeleton, i) for i, x in enumerate(_as_performances(X))]
        n_frames = min(len(x) for x in performances)
        frames = as_frames(frames, n_frames)
        standing = [placed(x, skeleton, follow=True) for x in performances]
        scenes = [[x[[frame]] for x in standing] for frame in frames]
        titles = [f"frame {frame}" for frame in frames]
        return cls(scenes, skeleton, titles).plot(ax, **view)

    @classmethod
    def from_postures(cls, X, cosines, *, frames=6, ax=None, **view):
        """Draw a strip of postures given by their direction cosines.

        Parameters
        ----------
        X : array-like, shape (n_frames, 37), or (n_sequences, n_frames, 37)
            Postures.
        cosines : DirectionCosines
            Fitted; knows how long the limbs are.
        frames, ax, **view : as for `from_positions`

        Returns
        -------
        SkeletonDisplay
        """
        positions = bodies_of_postures(_as_performances(X), cosines)
        return cls.from_positions(positions, Skeleton.paper(), frames=frames, ax=ax, **view)

    @classmethod
    def from_model(
        cls, estimator, *, frames=(0.1, 0.4), n_samples=12, random_state=0, ax=None, **view
    ):
        """Draw mean postures of a model, and postures that it accepts (Fig. 4).

        Parameters
        ----------
        estimator : Pipeline
            Fitted, from `DirectionCosines` to an `ActionModel`; the steps before the
            synchronizer need ``inverse_transform``.
        frames : list of int or float, default=(0.1, 0.4)
            Frames of the model; fractions below 1 are shares of the action.
        n_samples : int, default=12
            Accepted postures a frame.
        random_state : int, RandomState instance or None, default=0
        ax, **view : as for `from_positions`

        Returns
        -------
        SkeletonDisplay
        """
        _, model = find_step(estimator, ActionModel)
        space, _ = _before_synchronizer(estimator)
        check_is_fitted(model)
        bodies = bodies_of(space, model.mean_)
        # The floor is the lowest that the mean performance ever reaches.
        floor = [0, bodies(model.mean_)[..., 1].min(), 0]
        scenes, titles = [], []
        for frame in as_moments(frames, model.n_frames_):
            samples = model.sample(n_samples, frame=frame, random_state=random_state)
            accepted = model.accepts(samples, frame)
            for points in (model.mean_[[frame]], samples[accepted]):
                scenes.append([x[np.newaxis] - floor for x in bodies(points)])
            titles += [f"frame {frame}\nmean posture", f"frame {frame}\n{sum(accepted)} samples"]
        return cls(scenes, Skeleton.paper(), titles).plot(ax, **view)

    @classmethod
    def from_estimator(
        cls, estimator, X, *, performances=None, ax=None, at=0.0, azimuth=-60, **params
    ):
        """Performances as they were recorded, above the same ones synchronised.

        Parameters
        ----------
        estimator : Pipeline
            Fitted, from `DirectionCosines` to a synchronizer or further.
        X : list of arrays (n_frames_i, 3 * n_joints)
            Joint positions.
        performances : list of int, default=None
            Which of them to draw; by default the pattern, if it is one of them, and others up to
            six in all.
        ax, at, azimuth : as for `plot`
        **params : dict
            What the ``match`` of the synchronizer takes besides, such as ``keyframes``.

        Returns
        -------
        SkeletonDisplay
            At the beginning; see `animate`.
        """
        _, cosines = _before_synchronizer(estimator)
        reached = reach_synchronizer(estimator, X, params, f"{cls.__name__}.from_estimator")
        match = reached.match()
        pattern = index_of_pattern(reached.synchronizer, reached.performances)
        if performances is None:
            others = [i for i in range(len(match.times)) if i != pattern]
            performances = ([] if pattern is None else [pattern]) + others
            performances = performances[:_FEW_PERFORMANCES]
        performances = as_indices(performances, len(match.times), "performances")
        return cls.from_predictions(
            [_as_performances(X)[i] for i in performances],
            match.times[performances],
            cosines.skeleton,
            names=[f"{i} (pattern)" if i == pattern else str(i) for i in performances],
            ax=ax,
            at=at,
            azimuth=azimuth,
        )

    @classmethod
    def from_predictions(cls, X, times, skeleton, *, names=None, ax=None, **view):
        """The same for warps that are there already, whoever made them.

        Parameters
        ----------
        X : list of arrays (n_frames_i, 3 * n_joints)
            Joint positions.
        times : array-like, shape (n_sequences, P)
            tau(p) from 0 to P - 1, such as ``synchronizer.match(points).times``.
        skeleton : Skeleton or None
            None draws the joints as points without bones, turned as they are, y up.
        names : list of str, default=None
            What stands under the performances; by default their numbers.
        ax, **view : as for `plot`

        Returns
        -------
        SkeletonDisplay
        """
        X, skeleton = _as_performances(X), as_skeleton(skeleton)
        raw = [placed(upright(x, skeleton, i), skeleton) for i, x in enumerate(X)]
        match = as_match(times, len(X))
        labels = list(range(len(X))) if names is None else names
        labels = as_names(labels, len(X), "names", "performances")
        flat = [x.reshape(len(x), -1) for x in raw]
        warped = match.warp(flat)
        warped = warped.reshape(*warped.shape[:2], -1, 3)
        lengths = [len(x) - 1 for x in raw]
        return cls(
            [raw, list(warped)],
            skeleton,
            ["as recorded: each at its own pace", "synchronised: all on one clock"],
            durations=[lengths, [float(np.median(lengths))] * len(raw)],
            labels=labels,
        ).plot(ax, **view)

    def plot(self, ax=None, *, at=0.0, azimuth=-60):
        """Draw.

        Parameters
        ----------
        ax : Axes or array-like of Axes, default=None
            One of a figure's subplots is divided into the panels; or one axes a panel. None
            makes a figure.
        at : float in [0, 1], default=0.0
            When, as a share of the time until the longest performance ends.
        azimuth : float, default=-60
            Where the viewer stands, in degrees: 0 before the people, who face the viewer, 90 on
            their left, -90 on their right.

        Returns
        -------
        self
        """
        check_view(at, azimuth)
        drawn = [[on_screen(x, azimuth) for x in scene] for scene in self.scenes]
        places = None
        if self.labels is not None:
            gap = _SPACING * max(np.nanmax(x[..., 1]) - np.nanmin(x[..., 1]) for x in drawn[0])
            places = gap * np.arange(len(self.labels))
            drawn = [[x + [gap * i, 0] for i, x in enumerate(scene)] for scene in drawn]
        n_cols = 1 if self.labels is not None else min(len(drawn), _PANELS_A_ROW)
        n_rows = -(-len(drawn) // n_cols)
        everything = np.concatenate([x.reshape(-1, 2) for scene in drawn for x in scene])
        low, high = limits(everything)
        width, height = high - low
        # All panels have one scale, which makes figures of about 10 inches.
        scale = min(9.5 / (1.1 * n_cols * width), 3 / height)
        size = n_cols * (1.1 * width * scale + 0.15), n_rows * (1.1 * height * scale + 0.75)
        spots = [divmod(i, n_cols) for i in range(len(drawn))]
        before = getattr(self, "axes_", [])
        self.figure_, self.axes_ = panels(ax, spots, n_rows, n_cols, size)
        for axis in self.axes_:
            if axis in before:
                axis.clear()
        self._drawn, self.bones_, self.heads_ = drawn, [], []
        self._bones_by_side = bones_by_side(self.skeleton)
        for axis, title, scene in zip(self.axes_, self.titles, drawn, strict=True):
            self._prepare(axis, title, len(scene), low, high)
            if places is not None:
                axis.set_xticks(places, self.labels)
        self._show(at)
        return self

    def animate(self, ax=None, *, seconds=5.0, fps=15, azimuth=-60):
        """The performances in motion, which a notebook plays.

        Parameters
        ----------
        ax : Axes or array-like of Axes, default=None
            As for `plot`; by default where the display was drawn last.
        seconds : float, default=5.0
            Until the longest performance ends.
        fps : int, default=15
            Pictures a second; each takes some 70 kB of a notebook.
        azimuth : as for `plot`

        Returns
        -------
        Animation
            Shown by a notebook as its last value; ``to_jshtml()`` gives the HTML, ``save(path)``
            a file.
        """
        count = as_pictures(seconds, fps)
        self.plot(getattr(self, "axes_", None) if ax is None else ax, azimuth=azimuth)
        return playable(
            self.figure_.canvas.figure,
            lambda k: self._show(k / (count - 1)),
            count,
            fps,
            closes=ax is None,
        )

    def _prepare(self, axis, title, n_bodies, low, high):
        from matplotlib.collections import LineCollection

        alpha = 1.0 if self.labels is not None or n_bodies == 1 else 0.45
        width = 2.2 if alpha == 1 else 1.1
        sides = {}
        for side in ("middle", "left", "right"):
            lines = LineCollection([], colors=COLORS[side], linewidths=width, alpha=alpha)
            lines.set_capstyle("round")
            sides[side] = axis.add_collection(lines, autolim=False)
        self.bones_.append(sides)
        size = 3 * width if self.skeleton is not None else 1.5 * width
        style = {"color": COLORS["middle"], "alpha": alpha, "markersize": size}
        self.heads_ += axis.plot([], [], "o", **style)
        stage(axis, title, low, high)

    def _show(self, at):
        """Put all stick figures where they are after a share of the time; the artists."""
        durations = self.durations
        if durations is None:
            durations = [[len(x) - 1 for x in scene] for scene in self._drawn]
        longest = max(max(of_scene, default=0) for of_scene in durations)
        heads = slice(None) if self.skeleton is None else [self.skeleton.index_of("head")]
        bones = self._bones_by_side
        artists = []
        for i, (scene, taking) in enumerate(zip(self._drawn, durations, strict=True)):
            shares = [min(1.0, at * longest / d) if d > 0 else 0.0 for d in taking]
            bodies = [
                x[round(share * (len(x) - 1))] for x, share in zip(scene, shares, strict=True)
            ]
            for side, lines in self.bones_[i].items():
                lines.set_segments([body[list(bone)] for body in bodies for bone in bones[side]])
                artists.append(lines)
            dots = [body[heads] for body in bodies]
            self.heads_[i].set_data(np.concatenate(dots).T if dots else ([], []))
            artists.append(self.heads_[i])
        return artists


def _as_performances(X):
    """Performances one by one, of a collection or a single one."""
    collection = as_collection(X)
    if collection is not None and len(collection) == 0:
        raise ValueError("Found 0 performances (n_samples=0); there is nothing to draw.")
    return [X] if collection is None else collection


def _before_synchronizer(estimator):
    """The steps of a pipeline before its synchronizer, and the DirectionCosines among them."""
    before, _ = find_synchronizer(estimator)
    if before is None:
        raise ValueError(
            "Stick figures need a pipeline that begins with DirectionCosines; for a synchronizer "
            "by itself use from_predictions with the joint positions."
        )
    return before, find_step(before, DirectionCosines)[1]
