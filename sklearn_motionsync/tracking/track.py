"""Track: what is known of a body at every frame of a take."""

from typing import NamedTuple

import numpy as np

__all__ = ["Track"]


class Track(NamedTuple):
    """The body at every frame of a take; of a single frame, without the axis of frames.

    Attributes
    ----------
    postures : ndarray, shape (n_frames, n_features)
        What is expected, given what was seen.
    covariances : ndarray, shape (n_frames, n_features, n_features)
        Of the posture, phases that are possible taken together; without the noise of observations.
    phases : ndarray, shape (n_frames,)
        In frames of the clock, 0 to P - 1: the weighted median of the particles.
    rates : ndarray, shape (n_frames,)
        Their median pace: 1 is the mean of the training performances, 2 twice as fast, 0 when the
        movement is over.
    effective_sizes : ndarray, shape (n_frames,)
        How many particles of equal weight would tell as much, ``1 / sum w^2``. Of a smoothed take:
        how many different particles its paths go through.
    lost : ndarray of bool, shape (n_frames,)
        Whether the body moves otherwise, or looks otherwise, than the model says at any phase.
    """

    postures: np.ndarray
    covariances: np.ndarray
    phases: np.ndarray
    rates: np.ndarray
    effective_sizes: np.ndarray
    lost: np.ndarray

    @classmethod
    def of(cls, estimates, dtype):
        """Estimates of frames one after the other, postures in a precision."""
        postures, covariances, *numbers = map(np.array, zip(*estimates, strict=True))
        postures, covariances = (x.astype(dtype, copy=False) for x in (postures, covariances))
        return cls(postures, covariances, *numbers)

    def __repr__(self):
        postures = np.atleast_2d(self.postures)
        n_lost = int(np.count_nonzero(self.lost))
        return (
            f"Track({len(postures)} frames of {postures.shape[1]} features, {n_lost} of them lost)"
        )
