"""What postures are possible at a frame of the action, and new ones (Fig. 3d, Fig. 4)."""

from numbers import Integral

import numpy as np
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted

from ..fitting import of_one_state
from ..gate import as_numbers, check_finite, check_names
from ..performances import names_of_input
from .sampling import sample_performances, sample_postures

__all__ = ["EnvelopeMixin"]


class EnvelopeMixin:
    """What a model of an action says of postures: those it accepts, bounds for them, samples."""

    @of_one_state
    def accepts(self, postures, frame):
        """Whether postures lie inside the envelope at a frame.

        For the pruning of a tracker, which asks for postures that are possible at this instant. It
        does not tell whether a performance is the action: ``predict`` does.

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

        Both are drawn about those of training performances chosen at random, with mean, variance
        and covariance of all: what belongs together stays together, and styles stay apart.
        Postures are cut off at the envelope. Performances are inside for ``predict``; one that
        would fall outside is drawn in to its training performance.

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
        if frame is not None:
            frame = self._check_frame(frame)
            of_frame = self.mean_[frame], self.variance_[frame], self.deviations_[:, frame]
            return sample_postures(*of_frame, n, self.n_std, random_state)
        samples = sample_performances(
            self.mean_,
            self.variance_,
            self.deviations_,
            n,
            self._neighbours.dissimilarity,
            self.threshold_,
            random_state,
        )
        return samples[:, :, 0] if self._fitted_on_rows else samples

    def _check_frame(self, frame):
        if not isinstance(frame, Integral) or not 0 <= frame < self.n_frames_:
            raise ValueError(
                f"frame must be a whole number from 0 to {self.n_frames_ - 1}, got {frame!r}."
            )
        return int(frame)
