"""What transformers of joint positions share: how they take them, and what bodies they see."""

from typing import NamedTuple

import numpy as np
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_is_fitted

from ..inputs.validation import check_performances, restore
from ..utils.atomic import atomic_fit, snapshot
from ..utils.doc_links import DocumentedMixin
from .axes import heading
from .columns import AXES, check_columns
from .formats import LANDMARKS
from .hidden import hide_whole, seen_heading, typical_lengths
from .limbs import LIMB_NAMES, LIMBS, landmarks_of, largest_of, limbs_of, size_of
from .skeleton import Skeleton
from .upright import check_upright, y_up

__all__ = ["ACROSS", "Body", "PositionsTransformer"]

# Limbs that point at the camera when a body is seen from the side.
ACROSS = ("hip", "shoulder")


class Body(NamedTuple):
    """The body of a performance, y up, in units of ``2**exponent`` of the positions.

    Attributes
    ----------
    points : ndarray, shape (n_frames, 15, n_dims)
        Of the landmarks; 0 for those that lack, NaN where they are hidden.
    limbs : ndarray, shape (n_frames, 12, n_dims)
        Those of `skeleton`; whatever the others. NaN where an end is hidden.
    lengths : ndarray, shape (n_frames, 12)
        Of the limbs, above 0; of hips and shoulders that a picture shows end-on, 0; NaN where
        they are hidden.
    exponent : int
    skeleton : Skeleton
    """

    points: np.ndarray
    limbs: np.ndarray
    lengths: np.ndarray
    exponent: int
    skeleton: Skeleton

    def at(self, landmark):
        """Where a landmark is: (n_frames, n_dims)."""
        return self.points[:, LANDMARKS.index(landmark)]

    @property
    def typical(self):
        """Lengths (12,) of the performance's median limbs; NaN of those never seen."""
        return typical_lengths(self.lengths)

    @property
    def size(self):
        """Length of their stretched leg; of a body without a whole one, of all of them."""
        return size_of(self.typical, self.skeleton.limbs)

    @property
    def directions(self):
        """Limbs of length 1; of those that lack or have no length, 0."""
        lengths = self.lengths
        if not lengths.all():
            lengths = np.where(lengths > 0, lengths, 1)
        return self.limbs / lengths[:, :, np.newaxis]

    @property
    def heading(self):
        """Axes that turn with the body: (n_frames, 3, 3), rows x to the left, y up, z forward.

        None where nothing tells them: in the plane, and without hips and shoulders.
        """
        across = [name for name in ACROSS if name in self.skeleton.limbs]
        if not across or self.skeleton.n_dims == 2:
            return None
        ways = self._along(across.pop(0))
        if not np.isnan(ways[:, 0]).any():
            return heading(ways)
        return seen_heading(ways, *map(self._along, across))

    def _along(self, limb):
        """Directions (n_frames, n_dims) of a limb that has a length."""
        i = LIMB_NAMES.index(limb)
        return self.limbs[:, i] / self.lengths[:, i, np.newaxis]


class PositionsTransformer(DocumentedMixin, TransformerMixin, BaseEstimator):
    """Base of what turns joint positions into features, body by body.

    Whoever inherits has a ``skeleton``, a ``fit`` that calls ``_check(X, reset=True)``, a
    ``get_feature_names_out``, and tells by ``_features(body)`` what is made of a body.
    """

    # What the contract asks of the input: "allow-nan" of who takes hidden joints.
    _finite = True

    fit_transform = atomic_fit(TransformerMixin.fit_transform)

    @snapshot
    def transform(self, X):
        """Features of joint positions.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_dims * n_joints), 3-D array, or 2-D array
            Joint positions, joint by joint x, y, z; or x, y.

        Returns
        -------
        The kind that was given, with the features that ``get_feature_names_out`` names

        Raises
        ------
        ValueError
            If the width is not that of the skeleton, a column of the skeleton stands in another
            one's place, a limb has no length, or a body is upside down: in nine of ten frames its
            pelvis is below the ankles, and its head is below the pelvis on average. Of a body of
            which only one of the two is there, that one decides.
        """
        check_is_fitted(self)
        performances = self._check(X, reset=False)
        features = [self._features(self._body(performances, i)) for i in range(len(performances))]
        return restore(self, performances, features)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        tags.input_tags.allow_nan = self._finite == "allow-nan"
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        return tags

    def _check(self, X, *, reset):
        finite = self._finite
        performances = check_performances(self, X, reset=reset, level="posture", finite=finite)
        skeleton = self.skeleton
        width, expected = performances[0].shape[1], skeleton.n_dims * len(skeleton.joints)
        if width != expected:
            raise ValueError(
                f"Performance 0 has {width} features a frame, but the skeleton's "
                f"{len(skeleton.joints)} joints need {expected}: "
                f"{', '.join(AXES[skeleton.n_dims])} of each."
            )
        # All tables of a list have the names of the first.
        first = X[0] if isinstance(X, (list, tuple, np.ndarray)) else X
        check_columns(first, skeleton, "Performance 0")
        return performances

    def _body(self, performances, i):
        """The body of a performance, or a refusal."""
        skeleton = self.skeleton
        points, exponent = landmarks_of(performances[i], skeleton)
        points = y_up(points, skeleton)
        if self._finite is not True:
            hide_whole(points)
        limbs = limbs_of(points)
        lengths = np.linalg.norm(limbs, axis=2)
        # What is less is rounding of the coordinates.
        without = lengths <= np.finfo(lengths.dtype).eps * largest_of(points)
        there = skeleton.limbs
        for k, name in enumerate(LIMB_NAMES):
            if name not in there:
                limbs[:, k], lengths[:, k], without[:, k] = 0, 0, False
            elif skeleton.n_dims == 2 and name in ACROSS:
                end_on = without[:, k].copy()
                if (end_on | np.isnan(lengths[:, k])).all():
                    limbs[end_on, k], lengths[end_on, k], without[end_on, k] = 0, 0, False
        if without.any():
            frame, limb = np.argwhere(without)[0]
            name = LIMB_NAMES[limb]
            raise ValueError(
                f"{performances.called(i)}, frame {frame}: the limb {name!r} has no length, its "
                f"joints {[skeleton.landmarks[j] for j in LIMBS[name][:2]]} coincide. Repair "
                "the frame, or choose other landmarks."
            )
        check_upright(points, lengths, skeleton, performances.called(i))
        return Body(points, limbs, lengths, exponent, skeleton)
