"""The base of the transformers of joint positions: what they accept, and the body they see."""

from typing import NamedTuple

import numpy as np
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_is_fitted

from ..inputs.numbers import column_names
from ..inputs.validation import check_performances, names_of_input, restore
from ..utils.atomic import atomic_fit, snapshot
from ..utils.doc_links import DocumentedMixin
from .axes import heading_axes, heading_axes_with_gaps, to_y_up
from .formats import AXES, LANDMARKS
from .limbs import (
    LATERAL_LIMBS,
    LIMB_NAMES,
    LIMBS,
    body_size,
    landmark_positions,
    limb_vectors,
    median_lengths,
)
from .skeleton import Skeleton, check_columns
from .upright import check_upright

__all__ = ["Body", "PositionsTransformer", "mask_hidden"]


def mask_hidden(points):
    """Make points (n_frames, n, n_dims) NaN, in place, of which a coordinate is NaN."""
    points[np.isnan(points).any(axis=2)] = np.nan


class Body(NamedTuple):
    """The body of a performance, y up.

    Attributes
    ----------
    points : ndarray, shape (n_frames, 15, n_dims)
        The landmarks; 0 if the skeleton lacks them, NaN where they are hidden.
    limbs : ndarray, shape (n_frames, 12, n_dims)
        The limbs; 0 if the skeleton lacks them, NaN where an end is hidden.
    lengths : ndarray, shape (n_frames, 12)
        Lengths of the limbs; 0 if the skeleton lacks them, and for hips and shoulders that a
        picture shows end-on; NaN where they are hidden.
    skeleton : Skeleton
    """

    points: np.ndarray
    limbs: np.ndarray
    lengths: np.ndarray
    skeleton: Skeleton

    def position_of(self, landmark):
        """Positions (n_frames, n_dims) of a landmark."""
        return self.points[:, LANDMARKS.index(landmark)]

    @property
    def size(self):
        """The unit of length: the stretched leg, or without one the sum of all limbs."""
        return body_size(median_lengths(self.lengths), self.skeleton.limbs)

    @property
    def directions(self):
        """Limbs (n_frames, 12, n_dims) divided by their length; 0 without a length."""
        lengths = self.lengths
        if not lengths.all():
            lengths = np.where(lengths > 0, lengths, 1)
        return self.limbs / lengths[:, :, np.newaxis]

    @property
    def axes(self):
        """Axes (n_frames, 3, 3) that turn with the body: rows x to the left, y up, z forward.

        None in the plane, and without hips and shoulders.
        """
        lateral = [name for name in LATERAL_LIMBS if name in self.skeleton.limbs]
        if not lateral or self.skeleton.n_dims == 2:
            return None
        first, *others = map(self._direction, lateral)
        if not np.isnan(first[:, 0]).any():
            return heading_axes(first)
        return heading_axes_with_gaps(first, *others)

    def _direction(self, limb):
        i = LIMB_NAMES.index(limb)
        return self.limbs[:, i] / self.lengths[:, i, np.newaxis]


class PositionsTransformer(DocumentedMixin, TransformerMixin, BaseEstimator):
    """Base of the transformers that compute features of joint positions, body by body.

    A subclass has a ``skeleton``, a ``fit`` that calls ``_check(X, reset=True)``, a
    ``get_feature_names_out``, and a ``_features(body)`` that returns the features of a `Body`.
    """

    # How `check_performances` treats NaN; "allow-nan" admits hidden joints.
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
        list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            The features that ``get_feature_names_out`` names, in the kind that was given.

        Raises
        ------
        ValueError
            If the width is not that of the skeleton, a column of the skeleton has the place of
            another one, a limb has length 0, or a body is upside down: in nine of ten frames its
            pelvis is below the ankles, and its head is below the pelvis on average. If the body
            has only one of the two segments, that one decides.
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
        # Tables have their columns in the order of fit; if it had none, in that of the first.
        first = X[0] if isinstance(X, (list, tuple, np.ndarray)) else X
        names = names_of_input(self) or column_names(first)
        check_columns(names or (), skeleton, "Performance 0")
        return performances

    def _body(self, performances, i):
        """The body of a performance, checked."""
        skeleton = self.skeleton
        points = to_y_up(landmark_positions(performances[i], skeleton), skeleton)
        if self._finite is not True:
            mask_hidden(points)
        limbs = limb_vectors(points)
        lengths = np.linalg.norm(limbs, axis=2)
        # A shorter limb is rounding of the largest coordinate.
        largest = np.fmax.reduce(np.abs(points), axis=None, initial=0)
        zero = lengths <= np.finfo(lengths.dtype).eps * largest
        there = skeleton.limbs
        for k, name in enumerate(LIMB_NAMES):
            if name not in there:
                limbs[:, k], lengths[:, k], zero[:, k] = 0, 0, False
            elif skeleton.n_dims == 2 and name in LATERAL_LIMBS:
                end_on = zero[:, k].copy()
                if (end_on | np.isnan(lengths[:, k])).all():
                    limbs[end_on, k], lengths[end_on, k], zero[end_on, k] = 0, 0, False
        if zero.any():
            frame, limb = np.argwhere(zero)[0]
            name = LIMB_NAMES[limb]
            raise ValueError(
                f"{performances.called(i)}, frame {frame}: the limb {name!r} has no length, its "
                f"joints {[skeleton.landmarks[j] for j in LIMBS[name][:2]]} coincide. Repair "
                "the frame, or choose other landmarks."
            )
        check_upright(points, lengths, skeleton, performances.called(i))
        return Body(points, limbs, lengths, skeleton)
