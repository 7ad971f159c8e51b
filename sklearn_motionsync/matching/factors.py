"""The two factors whose product is the local costs (Eq. 12), as rows of the trellis take them.

The left factor is of the bases, the right one of the moving sequences. Steps of equal weights form
a group and share a product; penalties that a whole group pays are in it.
"""

import functools

import numpy as np

__all__ = ["Bases", "right_factor"]


class Bases:
    """Base sequences, and what is known of them before anything is matched to them.

    Parameters
    ----------
    trellis : Trellis
    sequences : ndarray, shape (n_bases, P, n_features)
    """

    def __init__(self, trellis, sequences):
        self.trellis, self.sequences = trellis, sequences

    def __len__(self):
        return len(self.sequences)

    def __getstate__(self):
        # What can be computed again is neither sent away nor saved.
        return {"trellis": self.trellis, "sequences": self.sequences}

    def part(self, rows):
        """Some of them, by a slice."""
        if rows == slice(0, len(self)):
            return self
        return Bases(self.trellis, self.sequences[rows])

    @functools.cached_property
    def energy(self):
        """``sum_p |x_n(p)|^2``: (n_bases,)."""
        return np.einsum("npk,npk->n", self.sequences, self.sequences)

    def by_group(self):
        """The left factor of every group of steps. Long takes make it large: it is not kept."""
        return _left_factor(self.sequences, *self.trellis.of_group)

    @functools.cached_property
    def by_step(self):
        """The left factor of every step, steps in order, for narrow bundles; kept for the next."""
        penalty, moving, inner = self.trellis.of_step[:, self.trellis.entry_of_step]
        return _left_factor(self.sequences, moving, inner, penalty)


def right_factor(moving):
    """(Q, n_moving, n_features + 2): x_m(q), |x_m(q)|^2 and 1."""
    n_moving, n_positions, n_features = moving.shape
    right = np.empty((n_positions, n_moving, n_features + 2), dtype=moving.dtype)
    right[..., :-2] = moving.transpose(1, 0, 2)
    right[..., -2] = np.einsum("mqk,mqk->mq", moving, moving).T
    right[..., -1] = 1
    return right


def _left_factor(bases, moving, inner, penalty):
    """(P, n_groups, n_features + 2, n_bases): times the right factor, the local costs.

    Given the weights of |x_m|^2 and of the inner product, and the penalty, of every group.
    """
    n_bases, n_frames, n_features = bases.shape
    shape = n_frames, len(moving), n_features + 2, n_bases
    left = np.empty(shape, dtype=bases.dtype)
    frames, energy = bases.transpose(1, 2, 0), np.einsum("npk,npk->pn", bases, bases)
    moving, inner, penalty = np.asarray([moving, inner, penalty], dtype=bases.dtype)
    np.multiply(frames[:, np.newaxis], -inner[:, np.newaxis, np.newaxis], out=left[:, :, :-2])
    left[:, :, -2] = moving[:, np.newaxis]
    np.add(energy[:, np.newaxis], penalty[:, np.newaxis], out=left[:, :, -1])
    return left
