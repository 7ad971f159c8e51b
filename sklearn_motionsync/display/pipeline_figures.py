"""Stick figures of what a fitted pipeline knows: its model (Fig. 4), people on its clock."""

from functools import partial
from typing import NamedTuple

import numpy as np
from sklearn.pipeline import FeatureUnion
from sklearn.utils.validation import check_is_fitted

from ..body.base import PositionsTransformer
from ..body.direction_cosines import DirectionCosines
from ..inputs.tables import name_performance
from ..model.action_model import ActionModel
from ..model.views import models_of_classes, view_of
from ..transformers.aspace import ASpace
from ..utils.pipelines import (
    find_step,
    find_synchronizer,
    flat_steps,
    index_of_pattern,
    route_to_synchronizer,
    union_transformers,
)
from .bodies import bodies_of
from .departing import strip_of
from .given import as_indices, as_limit, as_moments, as_performance, as_performances

__all__ = ["PipelineFigures"]

# Performances side by side in a moving picture, if not chosen.
_FEW_PERFORMANCES = 6


class PipelineFigures:
    """Ways to make a `SkeletonDisplay` of a fitted pipeline."""

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
        space, views = _before_synchronizer(estimator)
        check_is_fitted(model)
        skeleton = views[0].skeleton.body()
        # What a synchronizer puts beside them is no posture.
        width = find_synchronizer(estimator)[1].pattern_.shape[1]
        mean = model.mean_[:, :width]
        bodies = bodies_of(space, mean, skeleton.n_dims)
        # The floor is the lowest that the mean performance ever reaches.
        floor = np.zeros(skeleton.n_dims)
        floor[1] = bodies(mean)[..., 1].min()
        scenes, titles = [], []
        for frame in as_moments(frames, model.n_frames_):
            samples = model.sample(n_samples, frame=frame, random_state=random_state)
            accepted = model.accepts(samples, frame)
            for points in (mean[[frame]], samples[accepted, :width]):
                scenes.append([x[np.newaxis] - floor for x in bodies(points)])
            titles += [f"frame {frame}\nmean posture", f"frame {frame}\n{sum(accepted)} samples"]
        return cls(scenes, skeleton, titles).plot(ax, **view)

    @classmethod
    def from_departures(
        cls,
        estimator,
        X,
        *,
        performance=0,
        frames=6,
        limit=None,
        ax=None,
        at=0.0,
        azimuth=-60,
        **params,
    ):
        """Draw where a performance departs from the action, and with which limbs.

        A strip of the performance on the model's clock. Limbs that depart are violet, and the mean
        performance stands behind as a pale shadow. A limb departs where one of its cosines is
        farther from the mean than ``limit``; for the height of the pelvis the hips are marked. The
        titles name the limb that departs most, and above them stands whether the model accepts
        the performance. It may accept limbs that depart far: it sees no more of them than the
        `ASpace` keeps. That is then said.

        Parameters
        ----------
        estimator : Pipeline
            Fitted, from `DirectionCosines` to an `ActionModel`, with an `ASpace` or without; or to
            an `ActionClassifier`, and the model is that of the class the performance is given. The
            cosines may be one part of a union, whose other features decide but are not drawn.
        X : list of arrays (n_frames_i, n_dims * n_joints)
            Joint positions.
        performance : int, default=0
            Which of them is drawn.
        frames : int or list of int, default=6
            How many: the clock is cut into as many equal parts, and each is shown at the frame of
            its worst departure, in its middle if there is none. Or which frames of the model:
            each stands for those that are nearer to it than to the others, at most a twelfth of
            the clock away. A limb is marked if it departs anywhere in that part.
        limit : float, default=None
            In standard deviations that are predicted for a new person; by default ``n_std`` of
            the model. Right performances go somewhat beyond 3 here and there; what is rare
            (`ActionModel.simultaneous_factor`) stands above the panels.
        ax, at, azimuth : as for `plot`
        **params : dict
            What synchronizing X takes besides, such as ``keyframes``.

        Returns
        -------
        SkeletonDisplay

        Raises
        ------
        ValueError
            If there is no such performance or frame, ``limit`` is not above 0, or the features of
            the model cannot be taken back to those of `DirectionCosines`.

        See Also
        --------
        find_departures : The same in a table.
        ActionModelDisplay : The curves of the performance, and the band that they leave.
        """
        caller = f"{cls.__name__}.from_departures"
        chosen = partial(as_performance, performance)
        models = models_of_classes(estimator, X, params, caller, chosen)
        if models is None:
            view, limbs = _in_limbs(estimator, X, params, caller)
            i = chosen(len(view.given))
            called, by = name_performance(i, view.labels[i]), ""
        else:
            (of_class,) = models
            given = of_class.estimator, of_class.performances, {}, caller
            view, limbs = _in_limbs(*given)
            i, by = 0, " by the model of that class"
            called = name_performance(int(of_class.indices[0]), of_class.labels[0])
            called = f"{called}, most like {str(of_class.label)!r},"
        limit = view.model.n_std if limit is None else as_limit(limit)
        names = list(limbs.cosines.get_feature_names_out())
        skeleton = limbs.cosines.skeleton.body()
        strip = strip_of(view.scores[i][:, limbs.columns], names, frames, limit, skeleton)
        # Each on a floor of its own, as heights of the pelvis are.
        positions = limbs.cosines.inverse_transform
        bodies, shadows = (
            np.asarray(positions(limbs.back(x))).reshape(len(x), -1, skeleton.n_dims)
            for x in (view.whole[i], view.model.mean_)
        )
        if not skeleton.has_height:
            # What has no height is above the lowest that either ever reaches.
            floor = min(bodies[..., 1].min(), shadows[..., 1].min())
            bodies[..., 1] -= floor
            shadows[..., 1] -= floor
        verdict = "accepted" if view.own.predict(view.given.take([i]))[0] == 1 else "not accepted"
        if verdict == "accepted" and _is_unseen(view, i, limbs.columns):
            by += ": the model sees what the aSpace keeps,\n"
            by += "which leaves out how far some limbs depart"
        display = cls(
            [[bodies[[frame]]] for frame in strip.frames],
            skeleton,
            strip.titles,
            marked=strip.marked,
            behind=[[shadows[[frame]]] for frame in strip.frames],
            heading=f"{called} is {verdict}{by}.\nViolet: limbs more than {limit:.3g} standard "
            "deviations from what is expected of a new person, at or around\nthat frame; beyond "
            f"{view.model.simultaneous_factor():.2g} is rare. Pale: the mean performance.",
        )
        return display.plot(ax, at=at, azimuth=azimuth)

    @classmethod
    def from_estimator(
        cls, estimator, X, *, performances=None, ax=None, at=0.0, azimuth=-60, **params
    ):
        """Performances as they were recorded, above the same ones synchronised.

        Parameters
        ----------
        estimator : Pipeline
            Fitted, from `DirectionCosines`, `JointPositions` or both to a synchronizer or further.
        X : list of arrays (n_frames_i, n_dims * n_joints)
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
        _, views = _before_synchronizer(estimator)
        reached = route_to_synchronizer(estimator, X, params, f"{cls.__name__}.from_estimator")
        match = reached.match()
        pattern = index_of_pattern(reached.synchronizer, reached.performances)
        if performances is None:
            others = [i for i in range(len(match.times)) if i != pattern]
            performances = ([] if pattern is None else [pattern]) + others
            performances = performances[:_FEW_PERFORMANCES]
        performances = as_indices(performances, len(match.times), "performances")
        return cls.from_predictions(
            [as_performances(X)[i] for i in performances],
            match.times[performances],
            views[0].skeleton,
            names=[f"{i} (pattern)" if i == pattern else str(i) for i in performances],
            ax=ax,
            at=at,
            azimuth=azimuth,
        )


class _Limbs(NamedTuple):
    """Where the direction cosines are among the features of a view, and the way back to them.

    Attributes
    ----------
    cosines : DirectionCosines
    columns : slice
    steps : list of transformer
        Between the cosines and those features, such as scalers.
    """

    cosines: DirectionCosines
    columns: slice
    steps: list

    def back(self, features):
        """Cosines of features of the view, (n, 37)."""
        for step in reversed(self.steps):
            features = np.asarray(step.inverse_transform(features))
        return features[:, self.columns]


def _in_limbs(estimator, X, params, caller):
    """A view of the model and performances, and where its limbs are."""
    before, views = _before_synchronizer(estimator)
    if X is None:
        raise ValueError(f"{caller} needs performances X, whose departures are drawn; got None.")
    view = view_of(estimator, X, params, caller, postures=True)
    cosines = [part for part in views if isinstance(part, DirectionCosines)]
    # Of several there is no telling whose columns they are.
    columns = _columns_of(cosines[0], view.names) if len(cosines) == 1 else None
    steps = flat_steps(before)
    found = [k for k, step in enumerate(steps) if cosines and _gives(step, cosines[0])]
    after = [step for step in steps[sum(found[:1]) + 1 :] if not isinstance(step, ASpace)]
    back = found and all(hasattr(step, "inverse_transform") for step in after)
    if columns is None or not back:
        raise ValueError(
            "Limbs that depart need a pipeline of DirectionCosines, an ASpace if you like, "
            "synchronizers and an ActionModel, whose features lead back to limbs; those found "
            f"are {', '.join(view.names[:4])}, ..., by way of "
            f"{[type(step).__name__ for step in steps]}."
        )
    return view, _Limbs(cosines[0], columns, after)


def _is_unseen(view, i, columns):
    """Whether limbs depart rarely, and only by what the aSpace of a model leaves out of them."""
    seen = (view.synchronised[i] - view.model.mean_) / view.predicted
    whole, kept = (np.abs(z[:, columns]).max() for z in (view.scores[i], seen))
    return whole > view.model.simultaneous_factor() >= kept


def _gives(step, cosines):
    """Whether the features of cosines leave a step, or a union with them, as they are."""
    if not isinstance(step, FeatureUnion):
        return step is cosines
    views = [flat_steps(view) for _, view in step.transformer_list if not isinstance(view, str)]
    return any(_gives(inner[-1], cosines) for inner in views if inner)


def _columns_of(cosines, names):
    """Where the features of DirectionCosines are, by themselves or in a union; None if nowhere."""
    own = list(cosines.get_feature_names_out())
    for k, name in enumerate(names):
        prefix = name.removesuffix(own[0])
        if names[k : k + len(own)] == [f"{prefix}{x}" for x in own]:
            return slice(k, k + len(own))
    return None


def _before_synchronizer(estimator):
    """The steps of a pipeline before its synchronizer, and those of them that see bodies."""
    before, _ = find_synchronizer(estimator)
    if before is None:
        raise ValueError(
            "Stick figures need a pipeline that begins with DirectionCosines; for a synchronizer "
            "by itself use from_predictions with the joint positions."
        )
    parts = [part for step in flat_steps(before) for part in union_transformers(step)]
    views = [part for part in parts if isinstance(part, PositionsTransformer)]
    if not views:
        # Which tells that there are none.
        find_step(before, DirectionCosines)
    return before, views
