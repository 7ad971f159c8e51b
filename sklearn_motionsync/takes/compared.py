"""What of a take is compared, and the curves whose maximum begins a cycle."""

import numpy as np

from ..body.direction_cosines import DirectionCosines
from ..body.formats import SIDES
from ..body.joint_positions import JointPositions
from ..features import choose_features, names_of

__all__ = ["compared", "names_of_compared", "start_curves"]


def compared(X, takes, skeleton):
    """What is compared of takes: directions of limbs, or the features as they are, in float64."""
    if skeleton is not None:
        cosines = DirectionCosines(skeleton).set_output(transform="default")
        takes = cosines.fit_transform(X)
    return [np.asarray(x, dtype=np.float64) for x in takes]


def names_of_compared(segmenter):
    """Names of these features."""
    if segmenter.skeleton is not None:
        return list(DirectionCosines(segmenter.skeleton).get_feature_names_out())
    return names_of(None, segmenter, segmenter.n_features_in_)


def start_curves(segmenter, X, features):
    """Curves of takes, one of which begins a cycle at its maximum: the one that reaches farthest.

    Returns
    -------
    dict of str to list of ndarray (n_frames_i,)
        By what they are called; None where any feature will do.
    """
    start, skeleton = segmenter.start, segmenter.skeleton
    if start is None and not _shows_feet(skeleton):
        return None
    if start in (None, "ahead") or (start in SIDES and skeleton is not None):
        if not _shows_feet(skeleton):
            raise ValueError(
                f"start={start!r} needs a skeleton in space with a pelvis, hips or shoulders, and "
                f"both ankles; got skeleton={skeleton!r}. Give the name or index of a feature: "
                f"{', '.join(names_of_compared(segmenter))}."
            )
        return _feet(X, skeleton, [start] if start in SIDES else SIDES)
    names = names_of_compared(segmenter)
    (k,) = choose_features([start], names)
    return {names[k]: [x[:, k] for x in features]}


def _shows_feet(skeleton):
    """Whether a skeleton tells how far each foot is ahead of the pelvis."""
    if skeleton is None or skeleton.n_dims == 2:
        return False
    turns = {"hip", "shoulder"} & set(skeleton.limbs)
    return bool(turns) and {"pelvis", "left_ankle", "right_ankle"} <= set(skeleton.landmarks)


def _feet(X, skeleton, sides):
    """How far the ankles are ahead of the pelvis, in leg lengths."""
    positions = JointPositions(skeleton).set_output(transform="default").fit(X)
    names, places = list(positions.get_feature_names_out()), positions.transform(X)
    columns = {side: names.index(f"{side}_ankle_z") for side in sides}
    return {side: [x[:, k].astype(np.float64) for x in places] for side, k in columns.items()}
