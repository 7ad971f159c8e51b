"""JointPositions: positions of the joints of a body relative to its pelvis."""

from __future__ import annotations

from typing import Literal

import numpy as np
from sklearn.utils._param_validation import StrOptions

from .axes import project_on_axes
from .base import PositionsTransformer
from .formats import AXES, LANDMARKS, SIDES
from .skeleton import Skeleton


class JointPositions(PositionsTransformer):
    """Positions of the joints of a body relative to its pelvis: 42 features.

    For each landmark of the paper's body model except the pelvis, its position relative to the
    pelvis in leg lengths. The features are invariant to the place and the size of the body, and
    with the default axes to its heading.

    A skeleton that lacks landmarks has the positions of its own; key-points in a picture
    have two coordinates each.

    Parameters
    ----------
    skeleton : Skeleton
        Which columns are which joints: a known one such as ``Skeleton.acclaim()``, that of a
        table, ``Skeleton.from_frame(df)``, or your own.
    reference : {"heading", "world"}, default="heading"
        The axes. ``"heading"``: those of the body at each frame, x to the left along the hips,
        y up, z forward, as in `DirectionCosines`. ``"world"``: those of the recording, turned so
        that y is vertical. In the plane both are the picture's, x across and y up.
    hidden : {"raise", "nan"}, default="raise"
        How NaN, the positions of hidden joints, are treated. ``"raise"``: they are an error.
        ``"nan"``: a joint is hidden in a frame if any of its coordinates is NaN, and its features
        are NaN in that frame. Where the origin is hidden, the pelvis, all are.

    Attributes
    ----------
    limb_lengths_ : ndarray, shape (n_limbs,)
        Median length of each of ``skeleton.limbs`` over the frames of ``fit`` that show it, in
        the unit of the positions.
    n_features_in_ : int
        The number of joints times that of their axes.
    feature_names_in_ : ndarray of str
        Names of the columns; only if the input had names.

    See Also
    --------
    DirectionCosines : Poses of the directions of limbs, with an inverse.

    Notes
    -----
    The unit is that of the pelvis' height in `DirectionCosines`: the length of the stretched leg,
    the median over the trial; of a body without a complete leg, the sum of its limbs.
    Without a pelvis, positions are relative to the first of these that is there: the middle of the
    hips, the neck, the middle of the shoulders, the first landmark. A 2-D input is one trial.

    Hidden hips, and lengths of limbs that a trial never shows, are treated as in
    `DirectionCosines`.

    `DirectionCosines` weighs all limbs alike; positions weigh long limbs more.
    scikit-learn's ``make_union`` joins the features of both, frame by frame. It needs pandas output
    for that, as in the example: without it a union takes the list or 3-D array of each
    transformer for one matrix, and refuses it with a message about shapes. Where all widths and
    all lengths are equal (``"heading"`` beside ``"world"``, trials of the same number of
    frames) it may join a list along time. A 2-D input, one trial, needs no pandas. Keep the
    prefixes that the union puts before names: "neck" is both a limb and a joint.

    Examples
    --------
    >>> from sklearn_motionsync import JointPositions
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(4, random_state=0)
    >>> positions = JointPositions(bunch.skeleton).fit(bunch.data)
    >>> positions.transform(bunch.data)[0].shape[1], list(positions.get_feature_names_out()[:3])
    (42, ['neck_x', 'neck_y', 'neck_z'])

    Both kinds of features, synchronised:

    >>> from sklearn.pipeline import make_pipeline, make_union
    >>> from sklearn_motionsync import DenseSynchronizer, DirectionCosines
    >>> views = make_union(DirectionCosines(bunch.skeleton), JointPositions(bunch.skeleton))
    >>> views = views.set_output(transform="pandas")
    >>> table = views.fit_transform(bunch.data)
    >>> table.shape[1], table.index.names
    (79, FrozenList(['trial', 'frame']))
    >>> make_pipeline(views, DenseSynchronizer(50)).fit_transform(bunch.data).shape
    (4, 50, 79)
    """

    _parameter_constraints: dict = {
        "skeleton": [Skeleton],
        "reference": [StrOptions({"heading", "world"})],
        "hidden": [StrOptions({"raise", "nan"})],
    }

    def __init__(
        self,
        skeleton: Skeleton,
        reference: Literal["heading", "world"] = "heading",
        hidden: Literal["raise", "nan"] = "raise",
    ) -> None:
        self.skeleton = skeleton
        self.reference = reference
        self.hidden = hidden

    @property
    def _names(self):
        axes = AXES[self.skeleton.n_dims]
        return [f"{landmark}_{axis}" for landmark in self._landmarks for axis in axes]

    @property
    def _landmarks(self):
        """The landmarks whose positions are features: all but the origin."""
        origin = _origin_of(self.skeleton)
        return [name for name in self.skeleton.landmarks if [name] != origin]

    def _features(self, body):
        origin = [body.position_of(name) for name in _origin_of(self.skeleton)]
        # The pelvis is the first landmark, and the origin if it is there.
        middle = (sum(origin) / len(origin))[:, np.newaxis]
        places = (body.points[:, 1:] - middle) / self._size_of(body)
        axes = body.axes if self.reference == "heading" else None
        if axes is not None:
            places = project_on_axes(places, axes)
        places = places[:, [LANDMARKS.index(name) - 1 for name in self._landmarks]]
        return places.reshape(len(places), -1)


def _origin_of(skeleton):
    """The landmarks whose mean is the origin."""
    choices = [["pelvis"], [f"{side}_hip" for side in SIDES], ["neck"]]
    choices += [[f"{side}_shoulder" for side in SIDES], [next(iter(skeleton.landmarks))]]
    return next(names for names in choices if set(names) <= set(skeleton.landmarks))
