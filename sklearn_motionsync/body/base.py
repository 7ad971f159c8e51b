"""The base of the transformers of joint positions: what they accept, and the body they see."""

from __future__ import annotations

import functools
import warnings
from typing import Self

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from ..inputs.features import check_input_features
from ..inputs.numbers import column_names
from ..inputs.types import NamesLike, Transformed, TrialsLike
from ..inputs.validation import (
    TrialTransformerMixin,
    check_input,
    names_of_input,
    restore,
)
from ..utils.parallel import LongWorkMixin
from ..utils.parameters import validated
from .axes import check_upright, fill_heading, heading_axes, to_y_up
from .columns import check_columns, plain_positions
from .formats import LANDMARKS, SIDES
from .limbs import (
    LATERAL_LIMBS,
    LIMB_NAMES,
    LIMBS,
    body_size,
    landmark_positions,
    limb_indices,
    limb_vectors,
    lowest_height,
    median_lengths,
    scale_missing_lengths,
)


def mask_hidden(points):
    """Make points (n_frames, n, n_dims) NaN, in place, of which a coordinate is NaN."""
    points[np.isnan(points).any(axis=2)] = np.nan


class Body:
    """The body of a trial, y up, checked.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_dims * n_joints)
    skeleton : Skeleton
    hides : bool
        Whether NaN are hidden joints.
    called : str
        The name of the trial, with a capital letter.

    Attributes
    ----------
    points : ndarray, shape (n_frames, 15, n_dims)
        The landmarks; 0 if the skeleton lacks them, NaN where they are hidden.
    limbs : ndarray, shape (n_frames, 12, n_dims)
        The limbs; 0 if the skeleton lacks them, NaN where an end is hidden.
    lengths : ndarray, shape (n_frames, 12)
        Lengths of the limbs; 0 if the skeleton lacks them, and for hips and shoulders that a
        picture shows end-on; NaN where they are hidden.
    floor : float
        The smallest height of an ankle; NaN if all are hidden.
    """

    def __init__(self, positions, skeleton, hides, called):
        self._skeleton = skeleton
        self.points = to_y_up(landmark_positions(positions, skeleton), skeleton)
        if hides:
            mask_hidden(self.points)
        self.limbs = limb_vectors(self.points)
        self.lengths = np.linalg.norm(self.limbs, axis=2)
        self._check_lengths(called)
        check_upright(self.points, self.lengths, skeleton, called)
        self.limbs[self.lengths == 0] = 0
        ankles = [f"{side}_ankle" for side in SIDES if f"{side}_ankle" in skeleton.landmarks]
        self.floor = lowest_height([self.position_of(name)[:, 1] for name in ankles])

    @functools.cached_property
    def median_lengths(self):
        """Medians (12,) of the lengths over the frames that show a limb; NaN without any."""
        return median_lengths(self.lengths)

    def position_of(self, landmark):
        """Positions (n_frames, n_dims) of a landmark."""
        return self.points[:, LANDMARKS.index(landmark)]

    @property
    def directions(self):
        """Limbs (n_frames, 12, n_dims) divided by their length; 0 without a length."""
        return self.limbs / np.where(self.lengths > 0, self.lengths, 1)[:, :, np.newaxis]

    @property
    def axes(self):
        """Axes (n_frames, 3, 3) that turn with the body: rows x to the left, y up, z forward.

        None in the plane, and without hips and shoulders; NaN before the first heading.
        """
        names = [name for name in LATERAL_LIMBS if name in self._skeleton.limbs]
        if not names or self._skeleton.n_dims == 2:
            return None
        places = [LIMB_NAMES.index(name) for name in names]
        directions = self.limbs[:, places] / self.lengths[:, places, np.newaxis]
        left = directions[:, 0]
        if np.isnan(left).any():
            left = fill_heading(*directions.swapaxes(0, 1))
        axes = heading_axes(left)
        axes[np.isnan(left[:, 0])] = np.nan
        return axes

    def _check_lengths(self, called):
        """Refuse limbs without length; those that are not there have length 0."""
        lengths, skeleton, limbs = self.lengths, self._skeleton, self._skeleton.limbs
        largest = np.fmax.reduce(np.abs(self.points), axis=None, initial=0)
        # A shorter limb is rounding of the largest coordinate.
        zero = lengths <= np.finfo(lengths.dtype).eps * largest
        for k, name in enumerate(LIMB_NAMES):
            if name not in limbs:
                lengths[:, k], zero[:, k] = 0, False
            elif skeleton.n_dims == 2 and name in LATERAL_LIMBS:
                end_on = zero[:, k].copy()
                if (end_on | np.isnan(lengths[:, k])).all():
                    lengths[end_on, k], zero[end_on, k] = 0, False
        if zero.any():
            frame, limb = np.argwhere(zero)[0]
            name = LIMB_NAMES[limb]
            raise ValueError(
                f"{called}, frame {frame}: the limb {name!r} has no length, its "
                f"joints {[skeleton.landmarks[j] for j in LIMBS[name][:2]]} coincide. Repair "
                "the frame, or choose other landmarks."
            )


class PositionsTransformer(LongWorkMixin, TrialTransformerMixin, BaseEstimator):
    """Base of the transformers that compute features of joint positions, body by body.

    A subclass has a ``skeleton``; ``hidden``, which is "raise" or "nan"; ``_names``, of its
    features; and a ``_features(body)`` that returns the features of a `Body`.
    """

    # What an error about NaN advises.
    _on_gaps = "Set hidden='nan', which takes hidden joints, interpolate the gap"
    # Lengths count in those of the body, so units do not matter.
    _facts = "frame_rate", "up"

    @validated
    def fit(self, X: TrialsLike, y: object = None) -> Self:
        """Check the trials, and learn the limb lengths.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_dims * n_joints), 3-D array, or 2-D array
            Joint positions, joint by joint x, y, z; or x, y. Arrays may have an axis of joints,
            (n_frames_i, n_joints, n_dims), and tables the spellings of `Skeleton.from_frame`.
        y : ignored
            Present for API consistency.

        Returns
        -------
        self : object
            The fitted transformer.

        Raises
        ------
        ValueError
            As from ``transform``, or if a limb is hidden throughout.
        """
        self.limb_lengths_ = self._measure(X)
        return self

    def get_feature_names_out(self, input_features: NamesLike | None = None) -> np.ndarray:
        """Names of the features, such as ``hip_x`` or ``neck_x``: a limb or a joint, and an axis.

        Parameters
        ----------
        input_features : array-like of str, default=None
            Names of the columns before it, which are checked only.

        Returns
        -------
        ndarray of str
            One name a feature.
        """
        check_input_features(self, input_features)
        return np.asarray(self._names, dtype=object)

    def transform(self, X: TrialsLike) -> Transformed:
        """Features of joint positions.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_dims * n_joints), 3-D array, or 2-D array
            Joint positions, joint by joint x, y, z; or x, y. Arrays may have an axis of joints,
            (n_frames_i, n_joints, n_dims), and tables the spellings of `Skeleton.from_frame`.

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
        check_is_fitted(self, "limb_lengths_")
        trials = self._check(X, reset=False)
        features = [self._features(self._body(trials, i)) for i in range(len(trials))]
        return restore(self, trials, features)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        tags.input_tags.allow_nan = self._finite == "allow-nan"
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        return tags

    @property
    def _finite(self):
        """How `check_trials` treats NaN."""
        return "allow-nan" if self.hidden == "nan" else True

    def _measure(self, X):
        """Check trials of a fit, and return the median length of each of their limbs."""
        trials = self._check(X, reset=True)
        limbs = self.skeleton.limbs
        with self._progress(fits=True) as progress:
            step, lengths = progress.stage("measuring limbs", len(trials)), []
            for i in range(len(trials)):
                lengths.append(self._body(trials, i).lengths)
                step()
        lengths = np.concatenate(lengths) if len(lengths) > 1 else lengths[0]
        medians = median_lengths(lengths)[limb_indices(limbs)]
        if np.isnan(medians).any():
            never = [name for name, length in zip(limbs, medians, strict=True) if np.isnan(length)]
            raise ValueError(
                f"The limbs {never} are hidden in every frame of every trial, so that their "
                "lengths cannot be learnt. Fit on trials that show them, or leave their "
                "landmarks out of the skeleton: Skeleton(..., landmarks={'left_wrist': None, ...})."
            )
        return medians

    def _size_of(self, body):
        """The unit of length: the stretched leg, or without one the sum of all limbs.

        Of limbs that a body never shows, the lengths are those of ``fit``, scaled to it.
        """
        size = body_size(body.median_lengths, self.skeleton.limbs)
        if not np.isnan(size):
            return size
        learnt = self._all_lengths(self.limb_lengths_)
        lengths = scale_missing_lengths(body.median_lengths, learnt)
        return body_size(lengths, self.skeleton.limbs)

    def _all_lengths(self, lengths):
        """Lengths (12,) of all limbs, 0 of those that the skeleton lacks."""
        of_all = np.zeros(len(LIMB_NAMES), dtype=lengths.dtype)
        of_all[limb_indices(self.skeleton.limbs)] = lengths
        return of_all

    def _check(self, X, *, reset):
        skeleton = self.skeleton
        X = plain_positions(X, skeleton)
        trials = check_input(self, X, reset=reset, level="pose", finite=self._finite)
        # Tables have their columns in the order of fit; if it had none, in that of the first.
        first = X[0] if isinstance(X, (list, tuple, np.ndarray)) else X
        names = names_of_input(self) or column_names(first)
        check_columns(names or (), skeleton, "Trial 0", trials[0].shape[1])
        for i, facts in enumerate(trials.facts):
            up = facts.get("up", skeleton.up)
            if up != skeleton.up:
                warnings.warn(
                    f"{trials.called(i)} has the vertical axis {up!r} in its attrs, and the "
                    f"skeleton {skeleton.up!r}. Use Skeleton.from_frame(x), or set x.attrs['up'].",
                    UserWarning,
                    stacklevel=2,
                )
                break
        return trials

    def _body(self, trials, i):
        """The body of a trial, checked."""
        hides = self._finite is not True
        return Body(trials[i], self.skeleton, hides, trials.called(i))
