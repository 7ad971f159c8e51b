"""aSpace: the principal components of the poses of an action (Eqs. 3-5)."""

from __future__ import annotations

import warnings
from numbers import Integral
from typing import Self

import numpy as np
from sklearn.base import BaseEstimator, ClassNamePrefixFeaturesOutMixin
from sklearn.decomposition import PCA
from sklearn.utils._param_validation import Interval, RealNotInt
from sklearn.utils.extmath import svd_flip
from sklearn.utils.validation import check_is_fitted

from ..inputs.features import check_input_features
from ..inputs.types import NamesLike, Transformed, TrialsLike
from ..inputs.validation import (
    TrialTransformerMixin,
    check_input,
    check_transformed,
    restore,
)
from ..inputs.wording import counted
from ..matching.counting import ROUNDING
from ..matching.gaps import Filler, is_gappy, moments_of_seen
from ..utils.parallel import LongWorkMixin
from ..utils.parameters import validated


class ASpace(LongWorkMixin, ClassNamePrefixFeaturesOutMixin, TrialTransformerMixin, BaseEstimator):
    """Principal components of all poses of a movement: few numbers instead of many.

    The second of these signals is twice the first, and the third is constant. One number a frame
    tells all:

    >>> import numpy as np
    >>> from sklearn_motionsync import ASpace
    >>> t = np.linspace(0, 1, 50)
    >>> trials = [np.column_stack([x, 2 * x, 0 * x]) for x in (t, t**2)]
    >>> aspace = ASpace(0.95).fit(trials)
    >>> aspace.n_components_
    1
    >>> [x.shape for x in aspace.transform(trials)]
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
        The mean pose.
    explained_variance_ : ndarray, shape (b,)
        The eigenvalues, the variances along the components.
    explained_variance_ratio_ : ndarray, shape (b,)
        Their shares of the whole variance (0 where all poses are the same).
    n_components_ : int
        ``b``.
    residual_variance_ : float
        ``eps_b`` of Eq. 4: the variance left out, the sum of the other eigenvalues.
    left_out_variance_ : ndarray, shape (n_features,)
        The variance left out of each feature; the sum is ``eps_b``.
    missing_ : ndarray, shape (n_features,)
        The share of the training poses in which a feature was missing (NaN).
    n_features_in_ : int
        Features of a pose.
    feature_names_in_ : ndarray of str
        Names of the columns; only if the input had names.

    See Also
    --------
    DirectionCosines : Poses from joint positions.
    DenseSynchronizer : Synchronises the projected trials.

    Notes
    -----
    The poses of all trials are pooled, and their covariance is diagonalised (Eq. 3). The first
    ``b`` eigenvectors are kept, the fewest that reach the share of the variance (Eq. 4). Poses are
    projected onto them (Eq. 5).

    **Gaps.** NaN is what was not seen. ``fit`` takes the mean of a feature over the poses that show
    it, and the covariance of two over those that show both. ``transform`` interpolates short gaps
    over time, those of one frame at least, and projects the conditional expectation of a pose given
    all that was seen of its trial. There poses are normal, and over time they are autoregressions
    of second order: they forget their values in one time, and their velocities in another. So a
    hidden arm follows the other limbs, and joins smoothly the frames before and after the gap.
    Features that predict others are taken to have noise, a fifth of their variance, as few people
    show them together.
    Rows of a 2-D array are poses without order, each expected by itself. A pose of which nothing
    was seen becomes NaN.

    Without any gap ``transform`` computes nothing of this.

    An elbow is hidden for a while:

    >>> from sklearn_motionsync import DirectionCosines
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(6, random_state=0)
    >>> elbow = 3 * bunch.skeleton.index_of("left_elbow")
    >>> gappy = [x.copy() for x in bunch.data]
    >>> gappy[0][30:60, elbow : elbow + 3] = np.nan
    >>> cosines = DirectionCosines(bunch.skeleton, hidden="nan").fit(gappy)
    >>> poses = cosines.transform(gappy)
    >>> aspace = ASpace().fit(poses)
    >>> names = cosines.get_feature_names_out()
    >>> names[aspace.missing_ > 0].tolist()[:3], round(float(aspace.missing_.max()), 3)
    (['left_arm_x', 'left_arm_y', 'left_arm_z'], 0.049)
    >>> bool(np.isnan(aspace.transform(poses)[0]).any())
    False
    """

    _parameter_constraints: dict = {
        "n_components": [
            Interval(Integral, 1, None, closed="left"),
            Interval(RealNotInt, 0, 1, closed="right"),
        ],
    }

    def __init__(self, n_components: float = 0.95) -> None:
        self.n_components = n_components

    @validated
    def fit(self, X: TrialsLike, y: object = None) -> Self:
        """Find the components.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials, or poses in rows; NaN where something was not seen.
        y : ignored
            Present for API consistency.

        Returns
        -------
        ASpace
            The fitted estimator.

        Raises
        ------
        ValueError
            If there are fewer than two poses, or fewer than ``n_components`` poses or
            features; if a feature was seen in fewer than two poses.

        Warns
        -----
        UserWarning
            If a feature was seen in fewer poses than there are features: too few to learn how it
            depends on the others.
        """
        arrays = check_input(self, X, reset=True, level="pose", finite="allow-nan")
        poses = np.concatenate(arrays)
        has_gaps = is_gappy(poses)
        if len(poses) < 2:
            raise ValueError("ASpace needs at least 2 poses, got n_samples=1.")
        missing = np.zeros(poses.shape[1])
        if has_gaps:
            hidden = np.isnan(poses)
            self._check_seen(hidden)
            missing, poses = hidden.mean(axis=0), poses[~hidden.all(axis=1)]
        most = min(poses.shape)
        if isinstance(self.n_components, Integral) and self.n_components > most:
            raise ValueError(
                f"n_components={self.n_components} is more than the "
                f"{counted(len(poses), 'pose')} of {counted(poses.shape[1], 'feature')} "
                f"can span; use at most {most}, or a share of the variance such as 0.95."
            )
        with self._progress(fits=True):
            estimate = _components_of_seen if has_gaps else _components
            mean, components, variance, covariance = estimate(poses)
        b = self._count(variance)
        filler = Filler.of(mean, covariance, [] if arrays.kind == "rows" else arrays)
        self.components_ = np.ascontiguousarray(components[:b])
        self.mean_ = mean
        self.explained_variance_ = variance[:b]
        self.explained_variance_ratio_ = variance[:b] / (variance.sum() or 1.0)
        self.residual_variance_ = float(variance[b:].sum())
        self.left_out_variance_ = variance[b:] @ np.square(components[b:])
        self.n_components_ = b
        self.missing_ = missing
        self._filler = filler
        return self

    def transform(self, X: TrialsLike) -> Transformed:
        """Project poses into the aSpace (Eq. 5).

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials, or poses in rows; NaN where something was not seen.

        Returns
        -------
        list of ndarray (n_frames_i, b), or ndarray
            Points of the aSpace, of the same kind as ``X``; a ``(trial, frame)`` frame under
            ``set_output(transform="pandas")``. NaN where nothing of a pose was seen.
        """
        check_is_fitted(self, "components_")
        trials = check_input(self, X, reset=False, level="pose", finite="allow-nan")
        components, timed = self.components_.T, trials.kind != "rows"
        arrays = []
        for a in trials:
            whole = a
            if is_gappy(a):
                whole = self._filler.expect(a, timed)
                # Poses of which nothing was seen stay as they are.
                whole[np.isnan(a).all(axis=1)] = np.nan
            arrays.append(((whole - self.mean_) @ components).astype(a.dtype, copy=False))
        return restore(self, trials, arrays)

    def inverse_transform(self, X: TrialsLike) -> Transformed:
        """Reconstruct poses from points of the aSpace; exact if all components were kept.

        Parameters
        ----------
        X : list of arrays (n_frames_i, b), 3-D array, or 2-D array
            Points of the aSpace.

        Returns
        -------
        list of ndarray (n_frames_i, n_features), or ndarray
            Poses, of the same kind as ``X``; NaN where a coordinate is NaN.
        """
        check_is_fitted(self, "components_")
        names = self.get_feature_names_out()
        trials = check_transformed(self, X, names, finite="allow-nan")
        arrays = [(a @ self.components_ + self.mean_).astype(a.dtype, copy=False) for a in trials]
        columns = getattr(self, "feature_names_in_", range(self.n_features_in_))
        return restore(self, trials, arrays, columns=columns)

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
        tags.input_tags.allow_nan = True
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        return tags

    @property
    def _n_features_out(self):
        return self.n_components_

    def _check_seen(self, hidden):
        """Refuse features that were never seen, by what is hidden (n_poses, n_features)."""
        seen, n_features = len(hidden) - hidden.sum(axis=0), hidden.shape[1]
        names = getattr(self, "feature_names_in_", None)
        called = [f"{k}" if names is None else f"{k} ({names[k]!r})" for k in range(n_features)]
        if seen.min() < 2:
            k = int(seen.argmin())
            times = "never seen" if seen[k] == 0 else "seen in one pose only"
            raise ValueError(
                f"Feature {called[k]} was {times}. Of {counted(n_features, 'feature')} "
                f"{(seen < 2).sum()} was seen in fewer than 2 poses: leave such out, or fit on "
                "trials that show them."
            )
        if seen.min() < n_features:
            k = int(seen.argmin())
            warnings.warn(
                f"Feature {called[k]} was seen in {counted(int(seen[k]), 'pose')} of "
                f"{len(hidden)}, and a pose has {counted(n_features, 'feature')}: fewer "
                "poses than features hardly tell what it is where it is hidden. Leave it out, "
                "or fit on trials that show it.",
                UserWarning,
                stacklevel=2,
            )

    def _count(self, variance):
        """The smallest number of eigenvalues that reach the share to be kept (Eq. 4)."""
        if isinstance(self.n_components, Integral):
            return int(self.n_components)
        share = np.cumsum(variance)
        reached = share >= self.n_components * share[-1] * (1 - ROUNDING)
        return int(np.argmax(reached)) + 1


def _components(poses):
    """Mean, eigenvectors and eigenvalues of the covariance of poses, and that itself."""
    # Of poses that are all equal PCA divides 0 by 0.
    with np.errstate(invalid="ignore"):
        pca = PCA().set_output(transform="default").fit(poses)
    variance, components = pca.explained_variance_, pca.components_
    return pca.mean_, components, variance, (components.T * variance) @ components


def _components_of_seen(poses):
    """The same of poses with gaps, by what was seen of them."""
    mean, covariance = moments_of_seen([poses])
    covariance *= len(poses) / (len(poses) - 1)
    variance, vectors = np.linalg.eigh(covariance)
    largest = slice(None, -1 - min(poses.shape), -1)
    _, components = svd_flip(None, vectors.T[largest], u_based_decision=False)
    variance = np.maximum(variance[largest], 0)
    mean, components, variance = (x.astype(poses.dtype) for x in (mean, components, variance))
    return mean, components, variance, covariance
