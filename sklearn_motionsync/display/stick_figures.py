"""SkeletonDisplay: stick figures of poses, models (Fig. 4), and trials in motion."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Real
from textwrap import fill
from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from ..body.skeleton import Skeleton
from ..inputs.types import RandomState, TrialsLike
from ..inputs.wording import counted
from ..matching.counting import whole
from ..model.action_model import ActionModel
from ..synchronizers.match import Match
from ..utils.pipelines import (
    find_step,
    find_synchronizer,
    index_of_pattern,
    route_to_synchronizer,
)
from .animation import MovingDisplay
from .arguments import as_frames, as_indices, as_trials, names_of_trials
from .base import WIDTH, AxesLike
from .bodies import (
    BodyPanel,
    bounds,
    place_on_floor,
    project,
    read_positions,
    stage,
)
from .limb_departures import departing_bodies, split_at_synchronizer

# The largest number of panels in a row.
_PANELS_A_ROW = 4
# The height of a heading in inches, and its characters a line.
_HEADING, _LINE_LENGTH = 0.6, 78
# The distance of bodies side by side, in heights of the tallest.
_SPACING = 0.7
# The number of trials by default, and of random poses of a model.
_N_TRIALS, _N_SAMPLES = 6, 12


class SkeletonDisplay(MovingDisplay):
    """Stick figures of joint positions: poses side by side, or trials in motion.

    Make one with `from_positions` (poses), `from_model` (Fig. 4), `from_departures` (departures
    of a trial from an action), `from_trials` or `from_estimator` (trials, also
    before and after synchronisation, to `animate`). Left limbs are blue, right ones orange. Where
    limbs depart from an action these are violet and all others grey. Bodies face the same way in
    the first frame, and their lowest joint of all frames is on the floor. The view follows the
    pelvis of single poses, and of a body that walks far.

    A skeleton may lack landmarks. Where a landmark is the mean of joints, limbs are drawn between
    the landmarks; the joints of a skeleton without bones are drawn as points. Positions in a plane
    are drawn as the camera saw them, whatever the ``azimuth``.

    Attributes
    ----------
    scenes : list of list of ndarray (n_frames_i, n_joints, n_dims)
        The trials of each panel: joint positions in axes of which the second is vertical.
    titles : list of str
        One a panel.
    marked : list of list of (int, int), or None
        The violet bones of each panel: pairs of ``skeleton.bones``. All others are grey.
    behind : list of list of ndarray (n_frames_i, n_joints, n_dims), or None
        Trials of each panel that are drawn behind as pale shadows, such as the mean.
    heading : str or None
        The heading of a figure that the display makes.
    axes_ : list of Axes
        The panels.
    bones_ : list of dict
        For each panel the LineCollections of the ``"left"``, ``"middle"`` and ``"right"`` bones,
        and of the ``"departing"`` ones if bones are marked. Each body is one line with gaps.
    heads_ : list of Line2D
        The heads, one line a panel; without a skeleton, or without bones, all joints.
    behind_ : list of LineCollection
        The shadows, one collection a panel; empty without them.
    heading_ : Text or None
        The heading.

    Examples
    --------
    >>> from sklearn_motionsync.display import SkeletonDisplay
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(3, random_state=0)
    >>> display = SkeletonDisplay.from_positions(bunch.data[0], bunch.skeleton, frames=5)
    >>> len(display.axes_)
    5
    """

    scenes: Sequence[Sequence[np.ndarray]]
    skeleton: Skeleton | None
    titles: Sequence[str]
    # How many frames each trial of each panel lasts, if that is not what it has.
    durations: Sequence[Sequence[float]] | None = None
    # Names under the trials of a panel, which are then side by side instead of in one place.
    labels: Sequence[str] | None = None
    marked: Sequence[Sequence[tuple[int, int]]] | None = None
    behind: Sequence[Sequence[np.ndarray]] | None = None
    heading: str | None = None

    def __repr__(self):
        return f"SkeletonDisplay({len(self.scenes)} panels)"

    @classmethod
    def from_positions(
        cls,
        X: TrialsLike,
        skeleton: Skeleton | None,
        *,
        frames: int | Sequence[int] | np.ndarray = 6,
        ax: AxesLike | None = None,
    ) -> Self:
        """Draw poses of one trial, or of synchronised ones over each other.

        Parameters
        ----------
        X : array-like, shape (n_frames, n_dims * n_joints), or (n_sequences, n_frames, ...)
            Joint positions.
        skeleton : Skeleton or None
            None draws the joints as points without bones, y up. They have three axes, or two if
            their number is no multiple of three or columns are named ``_x``, ``_y``.
        frames : int or list of int, default=6
            The number of frames, evenly spaced from the first to the last, or their indices.
        ax : Axes or array-like of Axes, default=None
            See `plot`.

        Returns
        -------
        SkeletonDisplay
            The display, drawn.
        """
        bodies = [
            place_on_floor(read_positions(x, skeleton, i), skeleton, follow=True)
            for i, x in enumerate(as_trials(X, skeleton))
        ]
        shown = as_frames(frames, min(map(len, bodies)))
        titles = [f"frame {frame}" for frame in shown]
        scenes = [[x[[frame]] for x in bodies] for frame in shown]
        return cls._of(scenes=scenes, skeleton=skeleton, titles=titles).plot(ax)

    @classmethod
    def from_trials(
        cls,
        X: TrialsLike,
        skeleton: Skeleton | None,
        *,
        match: Match | None = None,
        names: Sequence[str] | None = None,
        ax: AxesLike | None = None,
    ) -> Self:
        """Draw trials side by side, each at its own pace, such as two subjects and a blend.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_dims * n_joints)
            Joint positions.
        skeleton : Skeleton or None
            None draws the joints as points without bones, y up.
        match : Match, default=None
            That of the trials, such as ``synchronizer.match(points)``: below them the same
            ones are drawn aligned.
        names : list of str, default=None
            The names under the trials; by default their labels in X, or numbers.
        ax : Axes or array-like of Axes, default=None
            See `plot`.

        Returns
        -------
        SkeletonDisplay
            The display, drawn at the beginning; see `animate`.
        """
        X = as_trials(X, skeleton)
        bodies = [place_on_floor(read_positions(x, skeleton, i), skeleton) for i, x in enumerate(X)]
        labels, durations = names_of_trials(names, X), None
        scenes, titles = [bodies], ["each at its own pace"]
        if match is not None:
            warped = match.warp([x.reshape(len(x), -1) for x in bodies])
            aligned = list(warped.reshape(*warped.shape[:2], *bodies[0].shape[1:]))
            recorded = [float(len(x) - 1) for x in bodies]
            scenes, titles = [bodies, aligned], ["as recorded", "aligned"]
            durations = [recorded, [float(np.median(recorded))] * len(bodies)]
        return cls._of(
            scenes=scenes, skeleton=skeleton, titles=titles, durations=durations, labels=labels
        ).plot(ax)

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: TrialsLike,
        *,
        trials: Sequence[int] | np.ndarray | None = None,
        ax: AxesLike | None = None,
        **params: Any,
    ) -> Self:
        """Draw trials as recorded above the same ones synchronised by a pipeline.

        Parameters
        ----------
        estimator : Pipeline
            Fitted, from `DirectionCosines`, `JointPositions` or both to a synchronizer or further.
        X : list of arrays (n_frames_i, n_dims * n_joints)
            Joint positions.
        trials : list of int, default=None
            The indices of the trials; by default the pattern, if it is one of them, and
            others up to six in all.
        ax : Axes or array-like of Axes, default=None
            See `plot`.
        **params : dict
            Further arguments of the ``match`` of the synchronizer, such as ``keyframes``.

        Returns
        -------
        SkeletonDisplay
            The display, drawn at the beginning; see `animate`.
        """
        _, views = split_at_synchronizer(estimator)
        reached = route_to_synchronizer(estimator, X, params, f"{cls.__name__}.from_estimator")
        match = reached.match()
        pattern = index_of_pattern(reached.synchronizer, reached.trials)
        if trials is None:
            pattern_first = sorted(range(len(match.times)), key=lambda i: i != pattern)
            trials = pattern_first[:_N_TRIALS]
        trials = as_indices(trials, len(match.times), "trials")
        return cls.from_trials(
            [as_trials(X, views[0].skeleton)[i] for i in trials],
            views[0].skeleton,
            match=Match(match.times[trials]),
            names=[f"{i} (pattern)" if i == pattern else str(i) for i in trials],
            ax=ax,
        )

    @classmethod
    def from_model(
        cls,
        estimator: BaseEstimator,
        *,
        frames: Sequence[float] | np.ndarray = (0.1, 0.4),
        random_state: RandomState = None,
        ax: AxesLike | None = None,
    ) -> Self:
        """Draw mean poses of a model, and of twelve random poses those that it accepts (Fig. 4).

        Parameters
        ----------
        estimator : Pipeline
            Fitted, from `DirectionCosines` to an `ActionModel`; the steps before the
            synchronizer need ``inverse_transform``.
        frames : list of int or float, default=(0.1, 0.4)
            Frames of the model; fractions below 1 are shares of the action.
        random_state : int, RandomState instance or None, default=None
            Determines the random poses; None draws others each time.
        ax : Axes or array-like of Axes, default=None
            See `plot`.

        Returns
        -------
        SkeletonDisplay
            The display, drawn.
        """
        _, model = find_step(estimator, ActionModel)
        before, views = split_at_synchronizer(estimator)
        check_is_fitted(model)
        if not hasattr(before, "inverse_transform"):
            raise ValueError(
                "Stick figures of a model need steps with inverse_transform before the "
                f"synchronizer; they are {[type(step).__name__ for _, step in before.steps]}. Use "
                "from_positions with bodies of your own."
            )
        skeleton = views[0].skeleton.body()
        # Features that a synchronizer adds are not part of a pose.
        width = find_synchronizer(estimator)[1].pattern_.shape[1]
        mean = model.mean_[:, :width]

        def bodies_of(points):
            # Together with the mean: the inverse puts the lowest joint of all frames on the floor.
            bodies = np.asarray(before.inverse_transform(np.concatenate([mean, points])))
            return bodies[len(mean) :].reshape(len(points), -1, skeleton.n_dims)

        floor = np.zeros(skeleton.n_dims)
        floor[1] = bodies_of(mean)[..., 1].min()
        scenes: list[list[np.ndarray]] = []
        titles: list[str] = []
        for frame in _frames_of_model(frames, model.n_frames_):
            samples = model.sample(_N_SAMPLES, frame=frame, random_state=random_state)
            accepted = model.accepts(samples, frame)
            for points in (mean[[frame]], samples[accepted, :width]):
                scenes.append([x[np.newaxis] - floor for x in bodies_of(points)])
            titles += [
                f"frame {frame}\nmean pose",
                f"frame {frame}\n{counted(sum(accepted), 'sample')}",
            ]
        return cls._of(scenes=scenes, skeleton=skeleton, titles=titles).plot(ax)

    @classmethod
    def from_departures(
        cls,
        estimator: BaseEstimator,
        X: TrialsLike,
        *,
        trial: int = 0,
        frames: int | Sequence[int] | np.ndarray = 6,
        reference: TrialsLike | None = None,
        ax: AxesLike | None = None,
        **params: Any,
    ) -> Self:
        """Draw what is wrong with a trial: when, and with which limbs.

        The figure shows poses of the trial on the clock of the model, before pale shadows
        of what is expected. Limbs that depart are violet: those of the rows of `find_departures`
        that are rare; without one, those of all rows if the model refuses the trial, and otherwise
        none; for the height of the pelvis the hips are marked.
        Titles tell the most important departure: the limb, and by how much it is off, late, or
        moves too little or too far. The heading says whether the model accepts the trial, and
        what is rare; it may accept it although limbs depart, because it evaluates only what the
        `ASpace` keeps.

        Parameters
        ----------
        estimator : Pipeline or ActionDetector
            Fitted, from `DirectionCosines` to an `ActionModel`, with an `ASpace` or without. The
            cosines may be one part of a union, whose other features count for the decision and are
            not drawn.
        X : list of arrays (n_frames_i, n_dims * n_joints)
            Joint positions.
        trial : int, default=0
            The index of the trial.
        frames : int or list of int, default=6
            A number cuts the clock into as many equal parts, each shown at the peak of its most
            important departure, or in its middle without one. A list gives frames of the model,
            each of which represents the frames that are nearest to it, up to a twelfth of the clock
            away. A limb is marked if it departs anywhere in its part.
        reference : trials, default=None
            One to five right trials of the same person, as for `find_departures`.
        ax : Axes or array-like of Axes, default=None
            See `plot`.
        **params : dict
            Further arguments of the synchronizer, such as ``keyframes``.

        Returns
        -------
        SkeletonDisplay
            The display, drawn.

        Raises
        ------
        ValueError
            If there is no such trial or frame, or the features of the model cannot be inverted to
            those of `DirectionCosines`.

        See Also
        --------
        sklearn_motionsync.model.find_departures : The departures as a table.
        ActionModelDisplay : The curves of the trial, and the band that they leave.
        """
        caller = f"{cls.__name__}.from_departures"
        return cls._of(
            **departing_bodies(
                estimator, X, params, caller, trial=trial, frames=frames, reference=reference
            )
        ).plot(ax)

    def plot(
        self, ax: AxesLike | None = None, *, at: float = 0.0, azimuth: float | None = None
    ) -> Self:
        """Draw.

        Parameters
        ----------
        ax : Axes or array-like of Axes, default=None
            One of a figure's subplots is divided into the panels; or one axes a panel. None
            makes a figure.
        at : float in [0, 1], default=0.0
            The time, as a share of the longest duration.
        azimuth : float, default=None
            The direction of the viewer in degrees: 0 in front of the bodies, 90 on their left, -90
            on their right. By default that of the last plot, at first -60; `animate` keeps it.

        Returns
        -------
        SkeletonDisplay
            The display itself.
        """
        if not 0 <= at <= 1:
            raise ValueError(f"at must be a share of the time from 0 to 1, got {at!r}.")
        self._at = at
        self._azimuth = getattr(self, "_azimuth", -60) if azimuth is None else azimuth
        self._drawn, self._behind = (
            [[project(x, self.skeleton, self._azimuth) for x in scene] for scene in scenes]
            for scenes in (self.scenes, self.behind or [[] for _ in self.scenes])
        )
        self._gap = 0.0
        if self.labels is not None:
            tallest = max(np.nanmax(x[..., 1]) - np.nanmin(x[..., 1]) for x in self._drawn[0])
            self._gap = _SPACING * tallest
            self._drawn, self._behind = (
                [[x + [self._gap * i, 0] for i, x in enumerate(scene)] for scene in scenes]
                for scenes in (self._drawn, self._behind)
            )
        places = [x.reshape(-1, 2) for scene in self._drawn + self._behind for x in scene]
        self._corners = bounds(np.concatenate(places))
        super().plot(ax)
        self.heading_ = None
        if ax is None and self.heading is not None:
            lines = [fill(line, _LINE_LENGTH) for line in self.heading.splitlines()]
            self.heading_ = self.figure_.suptitle("\n".join(lines), fontsize="medium")
        return self

    def _layout(self):
        count, n_cols = len(self.scenes), 1
        if self.labels is None:
            n_cols = -(-count // -(-count // _PANELS_A_ROW))
        n_rows = -(-count // n_cols)
        width, height = np.subtract(*self._corners[::-1])
        # All panels have one scale.
        scale = min(
            (WIDTH - 0.15 * n_cols) / (1.1 * n_cols * width), (2.6 if n_rows == 1 else 2) / height
        )
        size = n_cols * (1.1 * width * scale + 0.15), n_rows * (1.1 * height * scale + 0.8) + 0.25
        # Titles have the room of short words.
        size = max(size[0], min(WIDTH, 1.5 * n_cols)), size[1]
        if self.labels is not None or self.heading is not None:
            size = WIDTH, size[1] + _HEADING * (self.heading is not None)
        return [divmod(i, n_cols) for i in range(count)], (n_rows, n_cols), size

    def _draw(self):
        self._bodies = []
        marked = self.marked or [None] * len(self.scenes)
        for axis, title, scene, bones in zip(
            self.axes_, self.titles, self._drawn, marked, strict=True
        ):
            alpha = 1.0 if self.labels is not None or len(scene) == 1 else 0.45
            self._bodies.append(BodyPanel(axis, self.skeleton, marked=bones, alpha=alpha))
            if self._at > 0:
                title = f"{title}, at {100 * self._at:.0f} % of the time"
            stage(axis, title, *self._corners)
            if self.labels is not None:
                axis.set_xticks(self._gap * np.arange(len(self.labels)), self.labels)
        self.bones_ = [panel.bones for panel in self._bodies]
        self.heads_ = [panel.dots for panel in self._bodies]
        self.behind_ = [panel.shadows for panel in self._bodies] if self.behind else []
        self._show(self._at)

    def _show(self, at):
        """Move all stick figures to a share of the time."""
        durations = self.durations
        if durations is None:
            durations = [[len(x) - 1 for x in scene] for scene in self._drawn]
        longest = max(max(of_scene, default=0) for of_scene in durations)
        for panel, scene, of_scene, behind in zip(
            self._bodies, self._drawn, durations, self._behind, strict=True
        ):
            shares = [min(1.0, at * longest / d) if d > 0 else 0.0 for d in of_scene]
            bodies = [
                x[whole(share * (len(x) - 1))] for x, share in zip(scene, shares, strict=True)
            ]
            panel.show(bodies, [x[whole(at * (len(x) - 1))] for x in behind])


def _frames_of_model(frames, n_frames):
    """Frames by index, or as shares of the action between 0 and 1."""
    listed = [frames] if isinstance(frames, Real) else frames
    if isinstance(listed, (list, tuple, np.ndarray)):
        listed = [
            whole(f * (n_frames - 1)) if isinstance(f, Real) and 0 < f < 1 else f for f in listed
        ]
    return as_indices(listed, n_frames, "frames, those that are no shares between 0 and 1,")
