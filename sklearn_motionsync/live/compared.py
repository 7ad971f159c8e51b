"""What is compared of a running performance and of the mean one, whatever part of it is seen."""

import numpy as np

from ..matching.causal import causal_velocity
from ..matching.costs import COSTS
from ..matching.metric import compressed
from ..matching.warps import normalise

__all__ = ["LiveFeatures"]


class LiveFeatures:
    """Features of causal velocities and postures, with the metric of a synchronizer.

    Velocities of both sides come late by as much. Postures are those of the unit, less the mean
    posture of the pattern: their own mean over time is not known before they are over.

    Parameters
    ----------
    features : Features
        What the synchronizer compares.
    mean : ndarray, shape (P, n_features)
        The learnt mean.
    subframes : int
        Positions a frame of it.
    width : float
        Time constant of the filters, in frames of the clock.
    """

    def __init__(self, features, mean, subframes, width):
        self.cost, self.metric, self.unit = features.cost, features.metric, features.unit
        postures = self.unit(normalise([mean.astype(np.float64)], len(mean), subframes)[0])
        self._centre = postures.mean(axis=0)
        self._postures = postures - self._centre
        self._velocity = causal_velocity(postures, subframes, width)
        self.moving = self._of(self._velocity, self._postures, None)
        self._parts = {}

    def __call__(self, velocity, postures):
        """What is compared of samples of which everything is seen.

        Parameters
        ----------
        velocity, postures : ndarray, shape (n_streams, n_features)
            In the unit.
        """
        return self._of(velocity, postures - self._centre, None)

    def part(self, columns, velocity, postures):
        """The same of some features, and of the mean; None if nothing of these is compared.

        Parameters
        ----------
        columns : tuple of int
        velocity, postures : ndarray, shape (n_streams, n_features)
        """
        if columns not in self._parts:
            # Who is hidden stays so for a while; two sets are enough for one that flickers.
            self._parts = dict(list(self._parts.items())[-1:])
            self._parts[columns] = self._of(self._velocity, self._postures, columns)
        moving = self._parts[columns]
        if moving is None:
            return None
        return self._of(velocity, postures - self._centre, columns), moving

    def _of(self, velocity, postures, columns):
        if self.metric is None:
            chosen = slice(None) if columns is None else list(columns)
            derived = velocity[:, chosen]
            if not derived.shape[1]:
                return None
            return COSTS[self.cost].features(postures[:, chosen], lambda _: derived)
        told, rows = self.metric.features, slice(None)
        if columns is not None:
            rows = np.isin(told, columns)
            told = told[rows]
        # The energy is that of the mean performance, in what is seen of it.
        energy = np.square(self._velocity[:, told]).sum(axis=1).mean()
        if not energy > 0:
            return None
        metric = self.metric._replace(
            velocity=self.metric.velocity[rows], posture=self.metric.posture[rows]
        )
        return metric.of_parts(compressed(velocity[:, told], energy), postures[:, told])
