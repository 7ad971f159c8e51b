"""What postures are possible at a frame of the action, and new ones (Fig. 3d, Fig. 4)."""

from numbers import Integral

import numpy as np
from sklearn.utils import check_random_state

from ..fitting import of_one_state
from ..gate import as_numbers, check_finite, check_names
from ..performances import names_of_input
from .sampling import sample_performances, sample_postures
from .variation import mean_band, simultaneous_factor

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
        self._check_learnt()
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
        mean, reach = self.mean_[frame], self.n_std * np.sqrt(self.variance_[frame])
        return ((postures >= mean - reach) & (postures <= mean + reach)).all(axis=1)

    @of_one_state
    def envelope(self, simultaneous=False):
        """A band about the mean performance, for postures or for whole performances.

        Parameters
        ----------
        simultaneous : bool, default=False
            False: ``n_std`` standard deviations of the training performances on both sides. At 3
            it holds nearly all *postures* of people, but few whole performances: those leave it
            somewhere. True: it holds ``coverage`` of the *whole performances* of new people, at
            all frames and in all features: `simultaneous_factor` predicted standard deviations.

        Returns
        -------
        lower, upper : ndarray, shape (P, n_features)

        See Also
        --------
        mean_envelope : Holds the mean, not performances.
        """
        self._check_learnt()
        if simultaneous:
            reach = self.simultaneous_factor() * np.sqrt(self.predictive_variance_)
        else:
            reach = self.n_std * np.sqrt(self.variance_)
        return self.mean_ - reach, self.mean_ + reach

    @of_one_state
    def mean_envelope(self, random_state=None):
        """A band that holds the mean of all people at all frames and in all features.

        With probability ``coverage``, by a bootstrap over groups: what is to be expected
        of the mean if other people had been recorded, as many with as many performances. Of more
        than 64 performances it is the band of those that are kept, wider than need be.

        Parameters
        ----------
        random_state : int, RandomState instance or None, default=None

        Returns
        -------
        lower, upper : ndarray, shape (P, n_features)
        """
        self._check_learnt()
        reach = mean_band(self._known(), self.groups_, self.coverage, random_state)
        reach = reach.astype(self.mean_.dtype)
        return self.mean_ - reach, self.mean_ + reach

    @of_one_state
    def simultaneous_factor(self):
        """How many predicted standard deviations the performances of new people stay within.

        Whole performances, at all frames and in all features, with probability ``coverage``:
        learnt by leaving out group by group, of the largest deviation of each performance.

        Returns
        -------
        float
        """
        self._check_learnt()
        return simultaneous_factor(self._known(), self.groups_, self.coverage)

    @of_one_state
    def standard_scores(self, X):
        """How far performances are from the mean, in standard deviations predicted for new people.

        Parameters
        ----------
        X : array, shape (n_sequences, P, n_features), or list of arrays (P, n_features)
            Synchronised performances.

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features)
            Negative below the mean; the root of ``predictive_variance_`` is 1.

        See Also
        --------
        find_departures : Where they are large, as a table.
        """
        performances = np.stack(self.check_performances(X))
        # What is too far away for any number is infinitely far.
        with np.errstate(over="ignore"):
            return (performances - self.mean_) / np.sqrt(self.predictive_variance_)

    @of_one_state
    def sample(self, n=1, frame=None, random_state=None):
        """Draw accepted postures at a frame (Fig. 4), or whole performances.

        Both are drawn about those of training performances chosen at random, with mean, variance
        and covariance of all: what belongs together stays together, and styles stay apart.
        Postures are cut off at the envelope. Performances are inside for ``predict``; one that
        would fall outside is drawn in to its training performance. Features of theirs that are
        directions, such as those of `DirectionCosines`, are mixed on the sphere and keep the
        length 1. Dimensions of an `ASpace` are no directions: limbs drawn there get their length
        from ``inverse_transform`` of the cosines.

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

        See Also
        --------
        blend_performances : Mixtures of one's own, in timing too.
        """
        self._check_learnt()
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

    def _known(self):
        """The training performances that are kept."""
        return self._seen.kept.astype(np.float64)

    def _check_frame(self, frame):
        if not isinstance(frame, Integral) or not 0 <= frame < self.n_frames_:
            raise ValueError(
                f"frame must be a whole number from 0 to {self.n_frames_ - 1}, got {frame!r}."
            )
        return int(frame)
