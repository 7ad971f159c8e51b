"""Limbs that depart from an action: when, how far, and the bones that represent them."""

from numbers import Real
from typing import NamedTuple

import numpy as np
from sklearn.pipeline import FeatureUnion

from ..body.direction_cosines import DirectionCosines
from ..body.limbs import LIMBS
from ..model.views import view_of
from ..transformers.aspace import ASpace
from ..utils.pipelines import flat_steps
from .arguments import as_frames

__all__ = [
    "bones_of_limbs",
    "departs_outside_aspace",
    "limb_departures",
    "limb_of",
    "view_of_limbs",
]

# The pelvis is no limb; its height is marked on the hips.
_HEIGHT, _PELVIS = "pelvis_height", "hip"
# A frame given by index represents the frames around it, up to this share of the clock.
_FAR = 1 / 12


def limb_departures(scores, features, frames, limit, skeleton):
    """The frames of largest departure, and the limbs that depart around them.

    Parameters
    ----------
    scores : ndarray, shape (P, n_features)
        Deviations of one performance in predicted standard deviations.
    features : list of str
        ``pelvis_height``, ``hip_x``, ...
    frames : int or list of int
        As for `SkeletonDisplay.from_departures`.
    limit : float
        A feature departs beyond this number of standard deviations.
    skeleton : Skeleton
        Its joints are landmarks.

    Returns
    -------
    frames : list of int
        One a panel.
    titles : list of str
        The frame and the limb that departs most.
    marked : list of list of (int, int)
        The bones that depart around each frame.
    """
    limbs = list(dict.fromkeys(map(limb_of, features)))
    columns = [[k for k, name in enumerate(features) if limb_of(name) == limb] for limb in limbs]
    # The score of a limb is the largest of its cosines.
    sizes = np.stack([np.abs(scores[:, c]).max(axis=1) for c in columns], axis=1)
    shown, stretches = _stretches(frames, sizes.max(axis=1), limit)
    titles, marked = [], []
    for frame, stretch in zip(shown, stretches, strict=True):
        peaks = sizes[stretch].max(axis=0)
        departing = [limb for limb, peak in zip(limbs, peaks, strict=True) if peak > limit]
        worst, peak = limbs[int(peaks.argmax())], peaks.max()
        text = f"{worst} {peak:.{0 if peak >= 10 else 1}f} std" if departing else "no limb departs"
        titles.append(f"frame {frame}\n{text}")
        marked.append(bones_of_limbs(departing, skeleton))
    return shown, titles, marked


def _stretches(frames, largest, limit):
    """The frames to show, and the frames of the clock that each of them represents."""
    n_frames = len(largest)
    if isinstance(frames, Real):
        count = min(len(as_frames(frames, n_frames)), n_frames)
        edges = np.linspace(0, n_frames, count + 1).round().astype(int)
        stretches = np.split(np.arange(n_frames), edges[1:-1])
        peaks = [stretch[largest[stretch].argmax()] for stretch in stretches]
        middles = [stretch[(len(stretch) - 1) // 2] for stretch in stretches]
        shown = np.where(largest[peaks] > limit, peaks, middles)
        return shown.tolist(), stretches
    shown = as_frames(frames, n_frames)
    distances = np.abs(np.arange(n_frames) - np.array(shown)[:, np.newaxis])
    near = (distances == distances.min(axis=0)) & (distances <= _FAR * n_frames)
    return shown, [np.flatnonzero(of_frame) for of_frame in near]


def limb_of(feature):
    """The limb of a feature; ``"pelvis_height"`` remains."""
    return feature if feature == _HEIGHT else feature.rpartition("_")[0]


def bones_of_limbs(limbs, skeleton):
    """The bones of a skeleton that represent limbs, each once."""
    bones = [bone for limb in limbs for bone in _bones_of_limb(limb, skeleton)]
    return list(dict.fromkeys(bones))


def _bones_of_limb(limb, skeleton):
    ends = LIMBS[_PELVIS if limb == _HEIGHT else limb][:2]
    ends = tuple(skeleton.joints.index(name) for name in ends if name in skeleton.joints)
    # The hips, and the shoulders, are two bones each, from their middle.
    return [ends] if ends in skeleton.bones else [b for b in skeleton.bones if b[1] in ends]


class LimbColumns(NamedTuple):
    """The direction cosines among the features of a view, and the way back to them.

    Attributes
    ----------
    cosines : DirectionCosines
    columns : slice
        The columns of the cosines.
    steps : list of transformer
        The steps between the cosines and the features, such as scalers.
    """

    cosines: DirectionCosines
    columns: slice
    steps: list

    def invert(self, features):
        """The cosines of features of the view, (n, 37)."""
        for step in reversed(self.steps):
            features = np.asarray(step.inverse_transform(features))
        return features[:, self.columns]


def view_of_limbs(before, parts, estimator, X, params, caller):
    """A view of the model and performances of a pipeline, and its limbs.

    Parameters
    ----------
    before : Pipeline
        The steps before the synchronizer.
    parts : list of transformer
        Those of them with a skeleton.
    estimator : Pipeline
        The whole pipeline.
    X, params, caller
        As for `view_of`.
    """
    if X is None:
        raise ValueError(f"{caller} needs performances X, whose departures are drawn; got None.")
    view = view_of(estimator, X, params, caller, postures=True)
    cosines = [part for part in parts if isinstance(part, DirectionCosines)]
    # With several of them the columns are ambiguous.
    columns = _columns_of(cosines[0], view.names) if len(cosines) == 1 else None
    steps = flat_steps(before)
    found = [k for k, step in enumerate(steps) if cosines and _passes_on(step, cosines[0])]
    after = [step for step in steps[sum(found[:1]) + 1 :] if not isinstance(step, ASpace)]
    invertible = found and all(hasattr(step, "inverse_transform") for step in after)
    if columns is None or not invertible:
        raise ValueError(
            "Limbs that depart need a pipeline of DirectionCosines, an ASpace if you like, "
            "synchronizers and an ActionModel, whose features lead back to limbs; those found "
            f"are {', '.join(view.names[:4])}, ..., by way of "
            f"{[type(step).__name__ for step in steps]}."
        )
    return view, LimbColumns(cosines[0], columns, after)


def departs_outside_aspace(view, i, columns):
    """Whether limbs depart beyond what is rare, but not in the aSpace of the model."""
    kept = (view.synchronised[i] - view.model.mean_) / view.predicted
    whole, kept = (np.abs(z[:, columns]).max() for z in (view.scores[i], kept))
    return whole > view.model.simultaneous_factor() >= kept


def _passes_on(step, cosines):
    """Whether a step, or a union, returns the features of cosines unchanged."""
    if not isinstance(step, FeatureUnion):
        return step is cosines
    views = [flat_steps(view) for _, view in step.transformer_list if not isinstance(view, str)]
    return any(_passes_on(inner[-1], cosines) for inner in views if inner)


def _columns_of(cosines, names):
    """The columns of the features of DirectionCosines, also in a union; None without them."""
    own = list(cosines.get_feature_names_out())
    for k, name in enumerate(names):
        prefix = name.removesuffix(own[0])
        if names[k : k + len(own)] == [f"{prefix}{x}" for x in own]:
            return slice(k, k + len(own))
    return None
