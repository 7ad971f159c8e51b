"""aSpace: the principal components of the postures of an action (Eqs. 3-5)."""

from __future__ import annotations

from numbers import Integral
from typing import ClassVar, Self

import numpy as np
from sklearn.base import (
    BaseEstimator,
    ClassNamePrefixFeaturesOutMixin,
    TransformerMixin,
)
from sklearn.decomposition import PCA
from sklearn.utils._param_validation import Interval, RealNotInt
from sklearn.utils.validation import check_is_fitted

from ..inputs.features import check_input_features
from ..inputs.types import FitTransform, NamesLike, PerformancesLike, Transformed
from ..inputs.validation import check_performances, check_transformed, restore
from ..inputs.wording import counted
from ..utils.atomic import atomic_fit, snapshot, whole_fit_transform
from ..utils.doc_links import DocumentedMixin
from ..utils.parallel import LongWorkMixin
from ..utils.parameters import validated

__all__ = ["ASpace"]


class ASpace(
    DocumentedMixin,
    LongWorkMixin,
    ClassNamePrefixFeaturesOutMixin,
    TransformerMixin,
    BaseEstimator,
):
    """Principal components of all poses of a movement: few numbers instead of many.

    The second of these signals is twice the first, and the third is constant. One number a frame
    tells all:

    >>> import numpy as np
    >>> from sklearn_motionsync import ASpace
    >>> t = np.linspace(0, 1, 50)
    >>> performances = [np.column_stack([x, 2 * x, 0 * x]) for x in (t, t**2)]
    >>> aspace = ASpace(0.95).fit(performances)
    >>> aspace.n_components_
    1
    >>> [x.shape for x in aspace.transform(performances)]
    [(50, 1), (50, 1)]

    Parameters
    ----------
    n_components : float or int, default=0.95
        A float in (0, 1]: the share of the variance to keep. An int: ``b`` itself.

    Attributes
    ----------
    components_ : ndarray, shape (b, n_features)
        The eigenvectors, as rows.
    mean_ : ndarray, shape (n_features,)
        The mean posture.
    explained_variance_ : ndarray, shape (b,)
        The eigenvalues, the variances along the components.
    explained_variance_ratio_ : ndarray, shape (b,)
        Their shares of the whole variance (0 where all postures are the same).
    n_components_ : int
        ``b``.
    residual_variance_ : float
        ``eps_b`` of Eq. 4: the variance left out, the sum of the other eigenvalues.
    left_out_variance_ : ndarray, shape (n_features,)
        The variance left out of each feature; the sum is ``eps_b``.
    n_features_in_ : int
        Features of a posture.
    feature_names_in_ : ndarray of str
        Names of the columns; only if the input had names.

    See Also
    --------
    DirectionCosines : Postures from joint positions.
    DenseSynchronizer : Synchronises the projected performances.

    Notes
    -----
    The poses of all trials are pooled, and their covariance is diagonalised (Eq. 3). The first
    ``b`` eigenvectors are kept, the fewest that reach the share of the variance (Eq. 4). Poses are
    projected onto them (Eq. 5).
    """

    _parameter_constraints: dict = {
        "n_components": [
            Interval(Integral, 1, None, closed="left"),
            Interval(RealNotInt, 0, 1, closed="right"),
        ],
    }

    def __init__(self, n_components: float = 0.95) -> None:
        self.n_components = n_components

    @atomic_fit
    @validated
    def fit(self, X: PerformancesLike, y: object = None) -> Self:
        """Find the components.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Performances, or postures in rows.
        y : ignored
            Present for API consistency.

        Returns
        -------
        ASpace
            The fitted estimator.

        Raises
        ------
        ValueError
            If there are fewer than two postures, or fewer than ``n_components`` postures or
            features.
        """
        arrays = check_performances(self, X, reset=True, level="posture")
        postures = np.concatenate(arrays)
        if len(postures) < 2:
            raise ValueError("ASpace needs at least 2 postures, got n_samples=1.")
        most = min(postures.shape)
        if isinstance(self.n_components, Integral) and self.n_components > most:
            raise ValueError(
                f"n_components={self.n_components} is more than the "
                f"{counted(len(postures), 'posture')} of {counted(postures.shape[1], 'feature')} "
                f"can span; use at most {most}, or a share of the variance such as 0.95."
            )
        # Of postures that are all equal PCA divides 0 by 0.
        with self._progress(fits=True), np.errstate(invalid="ignore"):
            pca = PCA().set_output(transform="default").fit(postures)
        variance = pca.explained_variance_
        b = self._count(variance)
        self.components_ = np.ascontiguousarray(pca.components_[:b])
        self.mean_ = pca.mean_
        self.explained_variance_ = variance[:b]
        self.explained_variance_ratio_ = variance[:b] / (variance.sum() or 1.0)
        self.residual_variance_ = float(variance[b:].sum())
        self.left_out_variance_ = variance[b:] @ np.square(pca.components_[b:])
        self.n_components_ = b
        return self

    fit_transform: ClassVar[FitTransform] = whole_fit_transform

    @snapshot
    def transform(self, X: PerformancesLike) -> Transformed:
        """Project postures into the aSpace (Eq. 5).

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Performances, or postures in rows.

        Returns
        -------
        list of ndarray (n_frames_i, b), or ndarray
            Points of the aSpace, of the same kind as ``X``; a ``(performance, frame)`` frame under
            ``set_output(transform="pandas")``.
        """
        check_is_fitted(self)
        performances = check_performances(self, X, reset=False, level="posture")
        components = self.components_.T
        arrays = [((a - self.mean_) @ components).astype(a.dtype, copy=False) for a in performances]
        return restore(self, performances, arrays)

    @snapshot
    def inverse_transform(self, X: PerformancesLike) -> Transformed:
        """Reconstruct postures from points of the aSpace; exact if all components were kept.

        Parameters
        ----------
        X : list of arrays (n_frames_i, b), 3-D array, or 2-D array
            Points of the aSpace.

        Returns
        -------
        list of ndarray (n_frames_i, n_features), or ndarray
            Postures, of the same kind as ``X``.
        """
        check_is_fitted(self)
        performances = check_transformed(self, X, self.get_feature_names_out())
        arrays = [
            (a @ self.components_ + self.mean_).astype(a.dtype, copy=False) for a in performances
        ]
        names = getattr(self, "feature_names_in_", range(self.n_features_in_))
        return restore(self, performances, arrays, columns=names)

    def get_feature_names_out(self, input_features: NamesLike | None = None) -> np.ndarray:
        """Names of the coordinates: ``aspace0``, ``aspace1``, ...

        Parameters
        ----------
        input_features : array-like of str, default=None
            Names of the features before it, which are checked only.

        Returns
        -------
        ndarray of str
            One name a component.
        """
        check_input_features(self, input_features)
        return super().get_feature_names_out(input_features)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        return tags

    @property
    def _n_features_out(self):
        return self.n_components_

    def _count(self, variance):
        """The smallest number of eigenvalues that reach the share to be kept (Eq. 4)."""
        if isinstance(self.n_components, Integral):
            return int(self.n_components)
        share = np.cumsum(variance)
        reached = share >= self.n_components * share[-1]
        return int(np.argmax(reached)) + 1
