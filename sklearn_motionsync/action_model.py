"""The action model: mean performance, variance at every posture, envelope (section 4)."""

from numbers import Integral, Real

import numpy as np
from scipy.special import ndtr, ndtri
from sklearn.base import BaseEstimator, _fit_context
from sklearn.utils import check_random_state
from sklearn.utils._param_validation import Interval
from sklearn.utils.validation import check_is_fitted

from .fitting import at_once, of_one_state
from .gate import as_numbers, check_finite, check_names, check_squares
from .notebook import DocumentedMixin
from .performances import SequenceLevelMixin, names_of_input

__all__ = ["ActionModel"]

# Smallest variance of a density, as a share of the variance of all the data: a feature
# in which nobody differed is not infinitely improbable to differ.
_VARIANCE_FLOOR = 1e-9


class ActionModel(DocumentedMixin, SequenceLevelMixin, BaseEstimator):
    """What an action looks like at every instant, and how much people vary there.

    1. The mean performance and the variance of every posture, over synchronised
       performances (Fig. 3d).
    2. The envelope: the mean, plus and minus ``n_std`` standard deviations. A posture is
       accepted at a frame if all of its features lie inside.
    3. The density of a performance: independent normal distributions with that mean
       and variance. A performance is inside if it is at least as probable as the envelope
       itself, that is, if its root-mean-square deviation is at most ``n_std``
       standard deviations.

    Parameters
    ----------
    n_std : float, default=3.0
        Half-width of the envelope, in standard deviations.

    Attributes
    ----------
    mean_ : ndarray, shape (P, n_features)
        The mean performance.
    variance_ : ndarray, shape (P, n_features)
        The variance of the performances (divided by their number) at every posture.
    deviations_ : ndarray, shape (n_sequences, P, n_features)
        The training performances less the mean, from which whole performances are drawn.
    offset_ : float
        Log-density of the envelope; ``predict`` gives 1 to performances not below it.
    n_frames_ : int
        ``P``.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    DenseSynchronizer : Makes the input of this model.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import ActionModel
    >>> t = np.linspace(0, 1, 20)[:, np.newaxis]
    >>> model = ActionModel().fit([t, 2 * t, 3 * t])
    >>> bool(np.allclose(model.mean_, 2 * t))
    True
    >>> model.predict([2.5 * t, -9 * t]).tolist()
    [1, -1]
    >>> model.accepts([[2.0], [9.0]], frame=19).tolist()
    [True, False]
    """

    _parameter_constraints: dict = {"n_std": [Interval(Real, 0, None, closed="neither")]}

    def __init__(self, n_std=3.0):
        self.n_std = n_std

    @at_once
    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X, y=None):
        """Learn the mean performance and the variances.

        Parameters
        ----------
        X : array, shape (n_sequences, P, n_features), or list of arrays (P, n_features)
            Synchronised performances. The rows of a 2-D array are univariate ones.
        y : ignored

        Returns
        -------
        self

        Raises
        ------
        ValueError
            If the performances have different lengths, or there is only one, or their unit is such
            that variances are beyond the precision.
        """
        X = np.stack(_alike(self._check_training_set(X)))
        if len(X) < 2:
            raise ValueError(
                "A model of how performances vary needs at least 2 performances, got n_samples = 1."
            )
        self.n_frames_ = X.shape[1]
        with np.errstate(over="ignore", invalid="ignore"):
            self.mean_ = X.mean(axis=0)
            self.deviations_ = X - self.mean_
            self.variance_ = np.square(self.deviations_).mean(axis=0)
            spread = float(X.var(axis=(0, 1)).max())
        check_squares(X, spread, "variances")
        self._floor = _VARIANCE_FLOOR * (spread if spread > 0 else 1.0)
        with np.errstate(over="ignore"):
            squares = np.square(np.float64(self.n_std)) * self.mean_.size
        self.offset_ = float(self._log_density(squares))
        return self

    def check_performances(self, X):
        """Check that performances are synchronised, and to the clock of the model.

        Parameters
        ----------
        X : array, shape (n_sequences, P, n_features), or list of arrays (P, n_features)
            Synchronised performances. The rows of a 2-D array are univariate ones.

        Returns
        -------
        sequence of ndarray (P, n_features)
            All of one dtype, float32 or float64; not to be written to.

        Raises
        ------
        ValueError
            If the input breaks the contract, performances have different lengths, or others than
            the model.
        """
        performances = _alike(super().check_performances(X))
        if len(performances[0]) != self.n_frames_:
            raise ValueError(
                f"The performances have {len(performances[0])} frames, the model "
                f"{self.n_frames_}: synchronise them with the synchronizer that the model was "
                "fitted after."
            )
        return performances

    @of_one_state
    def score_samples(self, X):
        """Log-density of performances under the model.

        Parameters
        ----------
        X : array, shape (n_sequences, P, n_features), or list of arrays (P, n_features)
            Synchronised performances.

        Returns
        -------
        ndarray, shape (n_sequences,)
        """
        X = np.stack(self.check_performances(X))
        # What is too far away for any number has the density 0.
        with np.errstate(over="ignore"):
            squares = np.square((X - self.mean_) / self._std()).sum(axis=(1, 2))
        return self._log_density(squares)

    @of_one_state
    def score(self, X, y=None):
        """Mean log-density of performances.

        Parameters
        ----------
        X : as for ``score_samples``
        y : ignored

        Returns
        -------
        float
        """
        return float(self.score_samples(X).mean())

    @of_one_state
    def predict(self, X):
        """Whether performances are inside the model.

        Parameters
        ----------
        X : as for ``score_samples``

        Returns
        -------
        ndarray of int, shape (n_sequences,)
            1 inside, -1 outside.
        """
        return np.where(self.score_samples(X) >= self.offset_, 1, -1)

    @of_one_state
    def accepts(self, postures, frame):
        """Whether postures lie inside the envelope at a frame.

        Parameters
        ----------
        postures : array-like, shape (n_postures, n_features)
        frame : int
            Frame of the model, 0 to P - 1.

        Returns
        -------
        ndarray of bool, shape (n_postures,)
        """
        check_is_fitted(self)
        frame = self._check_frame(frame)
        check_names(postures, names_of_input(self), "postures")
        postures = as_numbers(postures, "postures", dtype=self.mean_.dtype)
        width = self.mean_.shape[1]
        if postures.ndim != 2 or postures.shape[1] != width:
            raise ValueError(
                f"postures must have shape (n_postures, {width}), got {postures.shape}. Give one "
                "posture as [posture]."
            )
        check_finite(postures, "postures, row", names_of_input(self))
        lower, upper = self.envelope()
        return ((postures >= lower[frame]) & (postures <= upper[frame])).all(axis=1)

    @of_one_state
    def envelope(self):
        """The mean performance, minus and plus ``n_std`` standard deviations.

        Returns
        -------
        lower, upper : ndarray, shape (P, n_features)
        """
        check_is_fitted(self)
        reach = self.n_std * np.sqrt(self.variance_)
        return self.mean_ - reach, self.mean_ + reach

    @of_one_state
    def sample(self, n=1, frame=None, random_state=None):
        """Draw accepted postures at a frame (Fig. 4), or whole performances.

        Postures are drawn feature by feature from the normal distributions cut off at the
        envelope. Whole performances are random mixtures of the training performances'
        deviations from the mean, with their variances and their smoothness; one that would
        fall outside is drawn in to the border.

        Parameters
        ----------
        n : int, default=1
            How many.
        frame : int, default=None
            Frame of the model, 0 to P - 1; None for whole performances.
        random_state : int, RandomState instance or None, default=None

        Returns
        -------
        ndarray, shape (n, n_features) or (n, P, n_features)
            (n, P) for whole performances of a model fitted on 2-D input.
        """
        check_is_fitted(self)
        if not isinstance(n, Integral) or n < 1:
            raise ValueError(f"n must be a whole number of samples, at least 1; got {n!r}.")
        random_state = check_random_state(random_state)
        dtype = self.mean_.dtype
        if frame is not None:
            frame = self._check_frame(frame)
            shape = (n, self.mean_.shape[1])
            # The normal distribution between -n_std and n_std, by inverting its integral.
            z = ndtri(random_state.uniform(ndtr(-self.n_std), ndtr(self.n_std), size=shape))
            lower, upper = (bound[frame] for bound in self.envelope())
            postures = self.mean_[frame] + z * np.sqrt(self.variance_[frame])
            return np.clip(postures.astype(dtype), lower, upper)
        weights = random_state.standard_normal((n, len(self.deviations_)))
        drawn = np.tensordot(weights / np.sqrt(len(self.deviations_)), self.deviations_, axes=1)
        far = np.sqrt(np.square(drawn / self._std()).mean(axis=(1, 2), keepdims=True))
        # A little inside, so that rounding does not put the border outside.
        drawn *= np.minimum(1, self.n_std * (1 - 1e-6) / np.maximum(far, np.finfo(dtype).tiny))
        samples = (self.mean_ + drawn).astype(dtype)
        return samples[:, :, 0] if self._fitted_on_rows else samples

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        return tags

    def _check_frame(self, frame):
        if not isinstance(frame, Integral) or not 0 <= frame < self.n_frames_:
            raise ValueError(
                f"frame must be a whole number from 0 to {self.n_frames_ - 1}, got {frame!r}."
            )
        return int(frame)

    def _std(self):
        return np.sqrt(np.maximum(self.variance_, self._floor))

    def _log_density(self, squares):
        """Log-density of performances with these sums of squared standard deviations."""
        log_std = np.log(self._std()).sum(dtype=np.float64)
        return -0.5 * squares - log_std - 0.5 * self.mean_.size * np.log(2 * np.pi)


def _alike(performances):
    """Performances, all of the same length."""
    n_frames = len(performances[0])
    for i, x in enumerate(performances):
        if len(x) != n_frames:
            raise ValueError(
                f"Performance {i} has {len(x)} frames, performance 0 has {n_frames}: a model "
                "needs synchronised performances. Put a DenseSynchronizer before it."
            )
    return performances
