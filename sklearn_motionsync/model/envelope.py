"""What postures are possible at a frame of the action, and new ones (Fig. 3d, Fig. 4)."""

from numbers import Integral

import numpy as np
from scipy.special import ndtr, ndtri
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted

from ..fitting import of_one_state
from ..gate import as_numbers, check_finite, check_names
from ..performances import names_of_input

__all__ = ["EnvelopeMixin"]

# A sample outside is drawn anew so many times; then it comes half-way home so many times.
_DRAWS, _STEPS_HOME = 10, 10


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

        Postures are drawn feature by feature from the normal distributions cut off at the
        envelope. Whole performances are random mixtures of the training performances'
        deviations from the mean, with their variances and their smoothness; one that falls
        outside is drawn again, and at last moved to a training performance until it is inside.

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
        samples = self._mixtures(n, random_state)
        outside = np.arange(n)
        for _ in range(_DRAWS):
            outside = outside[~self._inside(samples[outside])]
            samples[outside] = self._mixtures(len(outside), random_state)
        self._bring_home(samples, random_state)
        return samples[:, :, 0] if self._fitted_on_rows else samples

    def _mixtures(self, n, random_state):
        """Performances that deviate by random mixtures of the training ones' deviations."""
        n_kept = len(self.deviations_)
        weights = random_state.standard_normal((n, n_kept)) / np.sqrt(n_kept)
        drawn = np.tensordot(weights, self.deviations_, axes=1)
        return (self.mean_ + drawn).astype(self.mean_.dtype)

    def _bring_home(self, samples, random_state):
        """Move performances that are not the action half-way to training ones, until they are."""
        known = self.mean_ + self.deviations_
        outside = np.flatnonzero(~self._inside(samples))
        goals = known[random_state.choice(np.flatnonzero(self._inside(known)), len(outside))]
        for step in range(_STEPS_HOME):
            part = 2 if step < _STEPS_HOME - 1 else 1
            samples[outside] += (goals - samples[outside]) / part
            still = ~self._inside(samples[outside])
            outside, goals = outside[still], goals[still]

    def _inside(self, performances):
        # A little inside, so that rounding does not put the border outside.
        found = self._neighbours.dissimilarity(performances)
        return found <= self.threshold_ * (1 - 1e-6)

    def _check_frame(self, frame):
        if not isinstance(frame, Integral) or not 0 <= frame < self.n_frames_:
            raise ValueError(
                f"frame must be a whole number from 0 to {self.n_frames_ - 1}, got {frame!r}."
            )
        return int(frame)
