"""Stick figures: strips of postures, samples of a model (Fig. 4), and people moving in step."""

import numpy as np

from ..inputs.tables import labels_of
from ..synchronizers.match import match_of_times
from .animation import playable
from .bodies import (
    bodies_of_postures,
    bones_by_side,
    limits,
    on_screen,
    place_of,
    placed,
    upright,
    with_landmarks,
)
from .drawing import COLORS, panels, stage, sticks
from .given import (
    as_behind,
    as_durations,
    as_frames,
    as_labels,
    as_marked,
    as_names,
    as_performances,
    as_pictures,
    as_scenes,
    as_skeleton,
    check_view,
)
from .pipeline_figures import PipelineFigures

__all__ = ["SkeletonDisplay"]

# Panels in one row of a strip.
_PANELS_A_ROW = 6
# Inches across that a heading needs, and up.
_HEADING = 7.8, 0.4
# Between two stick figures, in heights of the tallest.
_SPACING = 0.7


class SkeletonDisplay(PipelineFigures):
    """Stick figures of joint positions: strips of postures, or performances in motion.

    Make one with `from_positions`, `from_postures` (strips), `from_model` (Fig. 4),
    `from_departures` (what is wrong with a performance), `from_performances`, `from_estimator` or
    `from_predictions` (performances, also before and after synchronisation, to `animate`). Left
    limbs are blue, right ones orange; limbs that depart from an action are violet, and then all
    others grey. People are turned to face the same way at first. Their lowest joint ever is on the
    floor; the pictures of a strip, and those of people who walk away, go with the pelvis.

    A skeleton may lack landmarks. Where a landmark is the mean of joints, limbs are drawn between
    the landmarks; a skeleton that joins nothing is drawn as its joints, too. Key-points of a
    picture are drawn as the camera saw them, from where it stood: ``azimuth`` has no meaning then.

    Parameters
    ----------
    scenes : list of list of ndarray (n_frames_i, n_joints, n_dims)
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
    marked : list of list of (int, int), default=None
        For each panel the bones to be seen at once, such as those of limbs that depart from the
        action: pairs of ``skeleton.bones``. They are violet, all others grey.
    behind : list of list of ndarray (n_frames_i, n_joints, n_dims), default=None
        For each panel performances that stand behind as pale shadows, such as the mean.
    heading : str, default=None
        What stands above all panels, if the figure is the display's own.

    Attributes
    ----------
    figure_ : Figure
    axes_ : list of Axes
    bones_ : list of dict
        For each panel the LineCollections of the ``"left"``, ``"middle"`` and ``"right"`` bones,
        and of the ``"departing"`` ones if bones are marked.
    heads_ : list of Line2D
        Without a skeleton, or without bones, all joints.
    behind_ : list of LineCollection
        One a panel, if something stands behind.
    heading_ : Text or None

    Examples
    --------
    >>> from sklearn_motionsync.display import SkeletonDisplay
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(3, random_state=0)
    >>> display = SkeletonDisplay.from_positions(bunch.data[0], bunch.skeleton, frames=5)
    >>> len(display.axes_)
    5
    """

    def __init__(
        self,
        scenes,
        skeleton,
        titles,
        *,
        durations=None,
        labels=None,
        marked=None,
        behind=None,
        heading=None,
    ):
        self.skeleton = as_skeleton(skeleton)
        self.scenes = as_scenes(scenes, skeleton)
        self.titles = as_names(titles, len(self.scenes), "titles", "panels")
        self.durations = None if durations is None else as_durations(durations, self.scenes)
        self.labels = None if labels is None else as_labels(labels, self.scenes)
        n_panels = len(self.scenes)
        self.marked = None if marked is None else as_marked(marked, n_panels, skeleton)
        self.behind = None if behind is None else as_behind(behind, n_panels, skeleton)
        self.heading = None if heading is None else str(heading)

    def __repr__(self):
        return f"SkeletonDisplay({len(self.scenes)} panels)"

    @classmethod
    def from_positions(cls, X, skeleton, *, frames=6, ax=None, **view):
        """Draw a strip of postures of one performance, or of synchronised ones over each other.

        Parameters
        ----------
        X : array-like, shape (n_frames, n_dims * n_joints), or (n_sequences, n_frames, ...)
            Joint positions.
        skeleton : Skeleton or None
            None draws the joints as points without bones, turned as they are, y up. They have
            three axes, or two if columns are called so (``_x``, ``_y``) or are no triples.
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
        performances = [upright(x, skeleton, i) for i, x in enumerate(as_performances(X))]
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
        X : array-like, shape (n_frames, n_features), or (n_sequences, n_frames, n_features)
            Postures.
        cosines : DirectionCosines
            Fitted; knows how long the limbs are.
        frames, ax, **view : as for `from_positions`

        Returns
        -------
        SkeletonDisplay
        """
        positions = bodies_of_postures(as_performances(X), cosines)
        return cls.from_positions(positions, cosines.skeleton.body(), frames=frames, ax=ax, **view)

    @classmethod
    def from_predictions(cls, X, times, skeleton, *, names=None, ax=None, **view):
        """The same for warps that are there already, whoever made them.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_dims * n_joints)
            Joint positions.
        times : array-like, shape (n_sequences, P)
            tau(p) from 0 to P - 1, such as ``synchronizer.match(points).times``.
        skeleton : Skeleton or None
            None draws the joints as points without bones, turned as they are, y up.
        names : list of str, default=None
            What stands under the performances; by default their labels in X, or numbers.
        ax, **view : as for `plot`

        Returns
        -------
        SkeletonDisplay
        """
        raw, labels = _beside_each_other(X, skeleton, names)
        match = match_of_times(times, len(raw))
        flat = [x.reshape(len(x), -1) for x in raw]
        warped = match.warp(flat)
        warped = warped.reshape(*warped.shape[:2], *raw[0].shape[1:])
        lengths = [len(x) - 1 for x in raw]
        return cls(
            [raw, list(warped)],
            skeleton,
            ["as recorded: each at its own pace", "synchronised: all on one clock"],
            durations=[lengths, [float(np.median(lengths))] * len(raw)],
            labels=labels,
        ).plot(ax, **view)

    @classmethod
    def from_performances(cls, X, skeleton, *, names=None, ax=None, **view):
        """Performances beside each other, each at its own pace: two people and their blend.

        Parameters
        ----------
        X, skeleton, names, ax, **view : as for `from_predictions`

        Returns
        -------
        SkeletonDisplay
            At the beginning; see `animate`.
        """
        raw, labels = _beside_each_other(X, skeleton, names)
        return cls([raw], skeleton, ["each at its own pace"], labels=labels).plot(ax, **view)

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
        n_panels = len(self.scenes)
        behind = [[] for _ in range(n_panels)] if self.behind is None else self.behind
        drawn, behind = (
            [
                [on_screen(with_landmarks(x, self.skeleton), azimuth) for x in scene]
                for scene in scenes
            ]
            for scenes in (self.scenes, behind)
        )
        places = None
        if self.labels is not None:
            gap = _SPACING * max(np.nanmax(x[..., 1]) - np.nanmin(x[..., 1]) for x in drawn[0])
            places = gap * np.arange(len(self.labels))
            drawn, behind = (
                [[x + [gap * i, 0] for i, x in enumerate(scene)] for scene in scenes]
                for scenes in (drawn, behind)
            )
        n_cols = 1 if self.labels is not None else min(len(drawn), _PANELS_A_ROW)
        n_rows = -(-len(drawn) // n_cols)
        everything = np.concatenate([x.reshape(-1, 2) for scene in drawn + behind for x in scene])
        low, high = limits(everything)
        width, height = high - low
        # All panels have one scale, which makes figures of about 10 inches.
        scale = min(9.5 / (1.1 * n_cols * width), 3 / height)
        size = n_cols * (1.1 * width * scale + 0.15), n_rows * (1.1 * height * scale + 0.75)
        if self.heading is not None:
            size = max(size[0], _HEADING[0]), size[1] + _HEADING[1]
        spots = [divmod(i, n_cols) for i in range(len(drawn))]
        before = getattr(self, "axes_", [])
        self.figure_, self.axes_ = panels(ax, spots, n_rows, n_cols, size)
        for axis in self.axes_:
            if axis in before:
                axis.clear()
        self.heading_ = None
        if ax is None and self.heading is not None:
            self.heading_ = self.figure_.suptitle(self.heading, fontsize="medium")
        self._drawn, self._behind, self.bones_, self.heads_ = drawn, behind, [], []
        self.behind_ = []
        self._bones = self._sorted_bones()
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

    def _sorted_bones(self):
        """For each panel the bones of each side of the body, and the marked ones apart."""
        by_side = bones_by_side(self.skeleton)
        if self.marked is None:
            return [by_side] * len(self.scenes)
        return [
            {side: [b for b in bones if b not in marked] for side, bones in by_side.items()}
            | {"departing": marked}
            for marked in self.marked
        ]

    def _prepare(self, axis, title, n_bodies, low, high):
        alpha = 1.0 if self.labels is not None or n_bodies == 1 else 0.45
        width = 2.2 if alpha == 1 else 1.1
        colors = {side: COLORS[side] for side in ("middle", "left", "right")}
        if self.marked is not None:
            colors = dict.fromkeys(colors, COLORS["quiet"])
        drawn = {side: sticks(axis, color, width, alpha) for side, color in colors.items()}
        if self.marked is not None:
            drawn["departing"] = sticks(axis, COLORS["departure"], 2 * width, alpha, zorder=3)
        self.bones_.append(drawn)
        if self.behind is not None:
            self.behind_.append(sticks(axis, COLORS["shadow"], 3 * width, zorder=1))
        joined = self.skeleton is not None and self.skeleton.bones
        size = 3 * width if joined else 1.5 * width
        style = {"color": colors["middle"], "alpha": alpha, "markersize": size}
        self.heads_ += axis.plot([], [], "o", **style)
        stage(axis, title, low, high)

    def _show(self, at):
        """Put all stick figures where they are after a share of the time; the artists."""
        durations = self.durations
        if durations is None:
            durations = [[len(x) - 1 for x in scene] for scene in self._drawn]
        longest = max(max(of_scene, default=0) for of_scene in durations)
        artists = []
        for axis, title in zip(self.axes_, self.titles, strict=True) if longest > 0 else ():
            axis.set_title(f"{title}, at {100 * at:.0f} % of the time", fontsize="medium")
        for i, (scene, taking) in enumerate(zip(self._drawn, durations, strict=True)):
            shares = [min(1.0, at * longest / d) if d > 0 else 0.0 for d in taking]
            bodies = [
                x[round(share * (len(x) - 1))] for x, share in zip(scene, shares, strict=True)
            ]
            for side, lines in self.bones_[i].items():
                lines.set_segments(_segments(bodies, self._bones[i][side]))
                artists.append(lines)
            dots = [self._dots_of(body) for body in bodies]
            self.heads_[i].set_data(np.concatenate(dots).T if dots else ([], []))
            artists.append(self.heads_[i])
        for lines, scene in zip(self.behind_, self._behind, strict=bool(self.behind_)):
            bodies = [x[round(at * (len(x) - 1))] for x in scene]
            everywhere = [b for bones in bones_by_side(self.skeleton).values() for b in bones]
            lines.set_segments(_segments(bodies, everywhere))
            artists.append(lines)
        return artists

    def _dots_of(self, body):
        """Where dots are: at the head, or at all joints if nothing joins them."""
        skeleton = self.skeleton
        if skeleton is None or not skeleton.bones:
            return body if skeleton is None else body[: len(skeleton.joints)]
        if "head" not in skeleton.landmarks:
            return body[:0]
        return place_of(body[np.newaxis], skeleton, "head")


def _beside_each_other(X, skeleton, names):
    """Performances that are put on the floor, facing forward, and what they are called."""
    X, skeleton = as_performances(X), as_skeleton(skeleton)
    raw = [placed(upright(x, skeleton, i), skeleton) for i, x in enumerate(X)]
    if names is None:
        names = [", ".join(map(str, n)) if isinstance(n, tuple) else n for n in labels_of(X)[0]]
    return raw, as_names(names, len(X), "names", "performances")


def _segments(bodies, bones):
    return [body[list(bone)] for body in bodies for bone in bones]
