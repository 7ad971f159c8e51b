"""Metric: velocity and posture, weighted by how well they tell a moment of the action.

Noisy directions of the features count as much as reliable ones until the training set says which
are which: `learning` finds that out, and what it finds is applied here. The distance of two
moments stays that of two points, so the trellis knows nothing of it.
"""

from typing import NamedTuple

import numpy as np

__all__ = ["Metric", "compressed", "energy_shares", "without_mean"]


class Metric(NamedTuple):
    """How velocities and postures become the points that are compared.

    Attributes
    ----------
    features : ndarray of int, shape (n_told,)
        Features that tell the moments; the others are left out.
    energy : float
        Mean squared speed of the training set, in these features.
    velocity : ndarray, shape (n_told, n_compared)
        Applied to compressed velocities.
    posture : ndarray, shape (n_told, n_compared)
        Applied to postures less their own mean over time: where a person stands or how they hold
        an arm throughout tells no moment.
    """

    features: np.ndarray
    energy: float
    velocity: np.ndarray
    posture: np.ndarray

    def __call__(self, velocity, positions):
        """What is compared of sequences: (n_sequences, Q, n_compared).

        Parameters
        ----------
        velocity, positions : ndarray, shape (n_sequences, Q, n_features)
            In the unit.
        """
        return self.of_parts(*self._parts(velocity, positions))

    def of_parts(self, velocity, postures):
        """What is compared of compressed velocities and centred postures (..., n_told)."""
        dtype = postures.dtype
        # Products of one sequence each: what a sequence gives does not depend on its company.
        out = velocity @ self.velocity.astype(dtype, copy=False)
        out += postures @ self.posture.astype(dtype, copy=False)
        return out

    def shares(self, velocity, positions):
        """The share of every feature in what is compared; that of noise is about 0."""
        parts = self._parts(velocity, positions)
        compared, shares = _flat(self.of_parts(*parts)), np.zeros(positions.shape[2])
        for part, weights in zip(parts, (self.velocity, self.posture), strict=True):
            shares[self.features] += (_flat(part).T @ compared * weights).sum(axis=1)
        return shares / shares.sum()

    def part(self, columns, velocity):
        """That of some features alone, by their indices; None if it does not hear them move.

        A part has a mean squared speed of its own, and is compressed by that.

        Parameters
        ----------
        columns : ndarray of int, shape (n_columns,)
        velocity : ndarray, shape (n_sequences, Q, n_columns)
            Theirs, of the training set.
        """
        place = {int(feature): row for row, feature in enumerate(self.features)}
        heard = np.array([i for i, k in enumerate(columns) if int(k) in place], dtype=np.intp)
        rows = [place[int(k)] for k in columns[heard]]
        speed = np.square(velocity[:, :, heard]).sum(axis=2, dtype=np.float64)
        energy = float(speed.mean())
        return Metric(heard, energy, self.velocity[rows], self.posture[rows]) if energy else None

    def _parts(self, velocity, positions):
        fast = compressed(velocity[:, :, self.features], self.energy)
        return fast, without_mean(positions[:, :, self.features])


def _flat(block):
    """All frames of all sequences, one below the other."""
    return block.reshape(-1, block.shape[2])


def energy_shares(velocity):
    """The share of every feature in the energy of velocities."""
    energy = np.square(velocity).sum(axis=(0, 1), dtype=np.float64)
    return energy / energy.sum()


def without_mean(positions):
    """Sequences less their own mean over time."""
    return positions - positions.mean(axis=1, keepdims=True)


def compressed(velocity, energy):
    """Velocities whose large speeds are compressed to their square root.

    Slow moments, where a limb turns, count more beside fast ones, and the differences of pace
    between people less.

    Parameters
    ----------
    velocity : ndarray, shape (..., n_features)
    energy : float
        The mean squared speed: a speed that is the root of it is halfway between linear and root.
    """
    scaled = velocity / np.sqrt(energy).astype(velocity.dtype)
    scaled /= np.sqrt(1 + np.sqrt(np.vecdot(scaled, scaled)))[..., np.newaxis]
    return scaled
