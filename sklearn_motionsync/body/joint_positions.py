"""JointPositions: where the joints of a body are, seen from its pelvis."""

import numpy as np
from sklearn.base import _fit_context
from sklearn.utils._param_validation import StrOptions

from ..utils.atomic import atomic_fit
from .axes import turned
from .base import PositionsTransformer
from .columns import AXES
from .formats import LANDMARKS, SIDES
from .skeleton import Skeleton

__all__ = ["JointPositions"]


class JointPositions(PositionsTransformer):
    """Where the joints of a body are, seen from its pelvis: 42 features.

    For each landmark of the paper's body model but the pelvis, its place relative to the pelvis,
    in leg lengths. It does not change when the body is moved, or is larger as a whole; with the
    default frame of reference, nor when it faces another way.

    A skeleton that lacks landmarks has the places of those that are there; key-points in a picture
    have two coordinates each.

    Parameters
    ----------
    skeleton : Skeleton
        Which columns are which joints: a ready one such as ``Skeleton.acclaim()``, that of a
        table, ``Skeleton.from_frame(df)``, or your own.
    reference : {"heading", "world"}, default="heading"
        The axes. ``"heading"``: those of the body at each frame, x to the left along the hips,
        y up, z forward, as in `DirectionCosines`. ``"world"``: those of the recording, of which
        y is made the vertical one. In the plane both are the picture's, x across and y up.

    Attributes
    ----------
    n_features_in_ : int
        The number of joints times that of their axes.
    feature_names_in_ : ndarray of str
        Names of the columns; only if the input had names.

    See Also
    --------
    DirectionCosines : Postures of the directions of limbs, and back: the other view of a body.

    Notes
    -----
    The unit is that of the pelvis' height in `DirectionCosines`: the length of the stretched leg,
    the median over the performance; of a body without a whole leg, the length of all its limbs.
    Without a pelvis, places are relative to the middle of the hips, the neck, the middle of the
    shoulders, or the first landmark, whichever is there first. A 2-D input is taken as one
    performance.

    To directions all limbs are alike; to positions those matter most that reach far.
    scikit-learn's ``make_union`` puts both side by side, frame by frame. It needs pandas output
    for that, as in the example: without it a union takes the list or 3-D array of each
    transformer for one matrix, and refuses it with a message about shapes. Where all widths and
    all lengths are equal (``"heading"`` beside ``"world"``, performances of the same number of
    frames) it may join a list along time. A 2-D input, one performance, needs no pandas. Keep the
    prefixes that the union puts before names, for both views have a neck.

    Examples
    --------
    >>> from sklearn_motionsync import JointPositions
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(4, random_state=0)
    >>> positions = JointPositions(bunch.skeleton).fit(bunch.data)
    >>> positions.transform(bunch.data)[0].shape[1], list(positions.get_feature_names_out()[:3])
    (42, ['neck_x', 'neck_y', 'neck_z'])

    Both views, synchronised:

    >>> from sklearn.pipeline import make_pipeline, make_union
    >>> from sklearn_motionsync import DenseSynchronizer, DirectionCosines
    >>> views = make_union(DirectionCosines(bunch.skeleton), JointPositions(bunch.skeleton))
    >>> views = views.set_output(transform="pandas")
    >>> table = views.fit_transform(bunch.data)
    >>> table.shape[1], table.index.names
    (79, FrozenList(['performance', 'frame']))
    >>> make_pipeline(views, DenseSynchronizer(50)).fit_transform(bunch.data).shape
    (4, 50, 79)
    """

    _parameter_constraints: dict = {
        "skeleton": [Skeleton],
        "reference": [StrOptions({"heading", "world"})],
    }

    def __init__(self, skeleton, reference="heading"):
        self.skeleton = skeleton
        self.reference = reference

    @atomic_fit
    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X, y=None):
        """Check the performances; nothing is learnt but the number and the names of the columns.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_dims * n_joints), 3-D array, or 2-D array
            Joint positions, joint by joint x, y, z; or x, y.
        y : ignored

        Returns
        -------
        self

        Raises
        ------
        ValueError
            As from ``transform``.
        """
        performances = self._check(X, reset=True)
        for i in range(len(performances)):
            self._body(performances, i)
        return self

    def get_feature_names_out(self, input_features=None):
        """Names of the 42 coordinates: ``neck_x``, ``neck_y``, ..., ``right_ankle_z``.

        Parameters
        ----------
        input_features : ignored

        Returns
        -------
        ndarray of str
        """
        axes = AXES[self.skeleton.n_dims]
        names = [f"{landmark}_{axis}" for landmark in self._landmarks for axis in axes]
        return np.asarray(names, dtype=object)

    @property
    def _landmarks(self):
        """Those whose places are features: all but the one that is the origin."""
        origin = _origin_of(self.skeleton)
        return [name for name in self.skeleton.landmarks if [name] != origin]

    def _features(self, body):
        origin = [body.at(name) for name in _origin_of(self.skeleton)]
        # The pelvis is the first landmark; no other is the origin if it is there.
        places = (body.points[:, 1:] - (sum(origin) / len(origin))[:, np.newaxis]) / body.size
        heading = body.heading if self.reference == "heading" else None
        if heading is not None:
            places = turned(places, heading)
        if len(self._landmarks) < places.shape[1]:
            places = places[:, [LANDMARKS.index(name) - 1 for name in self._landmarks]]
        return places.reshape(len(places), -1)


def _origin_of(skeleton):
    """The landmarks whose mean is the origin."""
    choices = [["pelvis"], [f"{side}_hip" for side in SIDES], ["neck"]]
    choices += [[f"{side}_shoulder" for side in SIDES], [next(iter(skeleton.landmarks))]]
    return next(names for names in choices if set(names) <= set(skeleton.landmarks))
