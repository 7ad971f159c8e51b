"""What transformers of joint positions share: how they take them, and what bodies they see."""

from typing import NamedTuple

import numpy as np
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_is_fitted

from ..fitting import at_once, of_one_state
from ..notebook import DocumentedMixin
from ..performances import check_performances, restore
from .axes import heading
from .limbs import LIMB_NAMES, LIMBS, check_upright, landmarks_of, leg_length, limbs_of
from .skeleton import LANDMARKS, check_columns

__all__ = ["Body", "PositionsTransformer"]


class Body(NamedTuple):
    """The body of a performance, y up, in units of ``2**exponent`` of the positions.

    Attributes
    ----------
    points : ndarray, shape (n_frames, 15, 3)
        Of the landmarks.
    limbs : ndarray, shape (n_frames, 12, 3)
    lengths : ndarray, shape (n_frames, 12)
        Of the limbs, above 0.
    exponent : int
    """

    points: np.ndarray
    limbs: np.ndarray
    lengths: np.ndarray
    exponent: int

    def at(self, landmark):
        """Where a landmark is: (n_frames, 3)."""
        return self.points[:, LANDMARKS.index(landmark)]

    @property
    def leg(self):
        """Length of the stretched leg: of the performance's median limbs."""
        return leg_length(np.median(self.lengths, axis=0))

    @property
    def directions(self):
        """Limbs of length 1."""
        return self.limbs / self.lengths[:, :, np.newaxis]

    @property
    def heading(self):
        """Axes that turn with the body: (n_frames, 3, 3), rows x to the left, y up, z forward."""
        hip = LIMB_NAMES.index("hip")
        return heading(self.limbs[:, hip] / self.lengths[:, hip, np.newaxis])


class PositionsTransformer(DocumentedMixin, TransformerMixin, BaseEstimator):
    """Base of what turns joint positions into features, body by body.

    Whoever inherits has a ``skeleton``, a ``fit`` that calls ``_check(X, reset=True)``, a
    ``get_feature_names_out``, and tells by ``_features(body)`` what is made of a body.
    """

    fit_transform = at_once(TransformerMixin.fit_transform)

    @of_one_state
    def transform(self, X):
        """Features of joint positions.

        Parameters
        ----------
        X : list of arrays (n_frames_i, 3 * n_joints), 3-D array, or 2-D array
            Joint positions, joint by joint x, y, z.

        Returns
        -------
        The kind that was given, with the features that ``get_feature_names_out`` names

        Raises
        ------
        ValueError
            If the width is not that of the skeleton, a column of the skeleton stands in another
            one's place, a limb has no length, or a body is upside down: in nine of ten frames its
            pelvis is below the ankles, and its head is below the pelvis on average.
        """
        check_is_fitted(self)
        performances = self._check(X, reset=False)
        features = [self._features(self._body(performances, i)) for i in range(len(performances))]
        return restore(self, performances, features)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        return tags

    def _check(self, X, *, reset):
        performances = check_performances(self, X, reset=reset, level="posture")
        width, expected = performances[0].shape[1], 3 * len(self.skeleton.joints)
        if width != expected:
            raise ValueError(
                f"Performance 0 has {width} features a frame, but the skeleton's "
                f"{len(self.skeleton.joints)} joints need {expected}: x, y, z of each."
            )
        # All tables of a list have the names of the first.
        first = X[0] if isinstance(X, (list, tuple, np.ndarray)) else X
        check_columns(first, self.skeleton, "Performance 0")
        return performances

    def _body(self, performances, i):
        """The body of a performance, or a refusal."""
        points, exponent = landmarks_of(performances[i], self.skeleton)
        limbs = limbs_of(points)
        lengths = np.linalg.norm(limbs, axis=2)
        # What is less is rounding of the coordinates.
        largest = max(points.max(), -points.min())
        without = lengths <= np.finfo(lengths.dtype).eps * largest
        if without.any():
            frame, limb = np.argwhere(without)[0]
            name = LIMB_NAMES[limb]
            raise ValueError(
                f"{performances.called(i)}, frame {frame}: the limb {name!r} has no length, its "
                f"joints {[self.skeleton.landmarks[j] for j in LIMBS[name][:2]]} coincide. Repair "
                "the frame, or choose other landmarks."
            )
        check_upright(points, lengths, self.skeleton, performances.called(i))
        return Body(points, limbs, lengths, exponent)
