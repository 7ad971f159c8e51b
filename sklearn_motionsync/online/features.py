"""What is compared of a running performance and of the mean one, whatever part of it is seen."""

import math
from typing import NamedTuple

import numpy as np

from ..matching.causal import causal_velocity
from ..matching.matcher import cost_features
from ..matching.metric import Metric, compressed
from ..matching.warps import normalise

__all__ = ["LiveFeatures"]

# After the end a performer rests: two filters of this many widths have forgotten the movement.
_REST = 6


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

    Attributes
    ----------
    moving : ndarray, shape (Q, n_compared)
        Of the mean, and of its last posture held until the filters have come to rest.
    rest : int
        For how many frames it is held.
    """

    def __init__(self, features, mean, subframes, width):
        self.cost, self.metric, self.unit = features.cost, features.metric, features.unit
        postures = self.unit(normalise([mean.astype(np.float64)], len(mean), subframes)[0])
        self._centre, self._n_moves = postures.mean(axis=0), len(postures)
        self.rest = max(1, math.ceil(_REST * width))
        held = np.repeat(postures[-1:], self.rest * subframes, axis=0)
        postures = np.concatenate([postures, held])
        self._postures = postures - self._centre
        self._velocity = causal_velocity(postures, subframes, width)
        self._all, self.moving = self._part(None)
        self._parts = {}

    def __call__(self, velocity, postures):
        """What is compared of samples of which everything is seen.

        Parameters
        ----------
        velocity, postures : ndarray, shape (n_streams, n_features)
            In the unit.
        """
        return self._all.compare(velocity, postures - self._centre)

    def part(self, columns, velocity, postures):
        """The same of some features, and of the mean; None if nothing of these is compared.

        Parameters
        ----------
        columns : tuple of int
        velocity, postures : ndarray, shape (n_streams, n_features)
        """
        known = self._parts
        if columns not in known:
            # Who is hidden stays so for a while; two sets are enough for one that flickers. Other
            # threads may follow at the same time: what is known is replaced, never changed.
            known = {**dict(list(known.items())[-1:]), columns: self._part(list(columns))}
            self._parts = known
        found = known[columns]
        if found is None:
            return None
        part, moving = found
        return part.compare(velocity, postures - self._centre), moving

    def _part(self, columns):
        """What is compared of some features, by their indices, or of all."""
        n_features = self._velocity.shape[1]
        chosen = np.arange(n_features) if columns is None else np.array(columns, dtype=np.intp)
        metric = self.metric
        if metric is not None:
            rows = np.isin(metric.features, chosen)
            chosen = metric.features[rows]
            # The energy is that of the mean performance, in what is seen of it.
            moves = self._velocity[: self._n_moves, chosen]
            energy = float(np.square(moves).sum(axis=1).mean())
            metric = Metric(chosen, energy, metric.velocity[rows], metric.posture[rows])
            chosen = chosen if energy > 0 else chosen[:0]
        if not len(chosen):
            return None
        part = _Part(chosen, metric, self.cost)
        return part, part.compare(self._velocity, self._postures)


class _Part(NamedTuple):
    """What is compared of some features."""

    columns: np.ndarray
    metric: Metric | None
    cost: str

    def compare(self, velocity, postures):
        velocity, postures = velocity[:, self.columns], postures[:, self.columns]
        if self.metric is None:
            return cost_features(postures, self.cost, velocity=velocity)
        return self.metric.of_parts(compressed(velocity, self.metric.energy), postures)
