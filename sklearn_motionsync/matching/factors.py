"""The two factors whose product is the local costs (Eq. 12), as rows of the trellis."""

import functools

import numpy as np

__all__ = ["Bases", "right_factor"]


class Bases:
    """Base sequences, and the arrays that depend on them alone.

    Parameters
    ----------
    trellis : Trellis
    sequences : ndarray, shape (n_bases, P, n_features)
    """

    def __init__(self, trellis, sequences):
        self.trellis, self.sequences = trellis, sequences

    def __getstate__(self):
        # Cached arrays are neither sent to other processes nor saved.
        return {"trellis": self.trellis, "sequences": self.sequences}

    @functools.cached_property
    def energy(self):
        """``sum_p |x_n(p)|^2``: (n_bases,)."""
        return np.einsum("npk,npk->n", self.sequences, self.sequences)

    def by_group(self):
        """The left factor of every group of steps. It is large for long takes: not cached."""
        return self._left_factor(*self.trellis.of_group)

    @functools.cached_property
    def by_step(self):
        """The left factor of every step, in order of steps, for small tiles.

        (P, n_steps * n_bases, n_features + 2): one product a sample.
        """
        penalty, moving, inner = self.trellis.of_step[:, self.trellis.entry_of_step]
        left = self._left_factor(moving, inner, penalty).swapaxes(2, 3)
        return np.ascontiguousarray(left).reshape(len(left), -1, left.shape[3])

    def _left_factor(self, moving, inner, penalty):
        """(P, n_groups, n_features + 2, n_bases): times the right factor, the local costs.

        Given the weights of |x_m|^2 and of the inner product, and the penalty, of every group.
        """
        n_bases, n_frames, n_features = self.sequences.shape
        shape = n_frames, len(moving), n_features + 2, n_bases
        left = np.empty(shape, dtype=self.sequences.dtype)
        energy = np.einsum("npk,npk->pn", self.sequences, self.sequences)
        moving, inner, penalty = np.asarray([moving, inner, penalty], dtype=left.dtype)
        frames = self.sequences.transpose(1, 2, 0)[:, np.newaxis]
        np.multiply(frames, -inner[:, np.newaxis, np.newaxis], out=left[:, :, :-2])
        left[:, :, -2] = moving[:, np.newaxis]
        np.add(energy[:, np.newaxis], penalty[:, np.newaxis], out=left[:, :, -1])
        return left


def right_factor(moving):
    """(Q, n_moving, n_features + 2): x_m(q), |x_m(q)|^2 and 1."""
    n_moving, n_positions, n_features = moving.shape
    right = np.empty((n_positions, n_moving, n_features + 2), dtype=moving.dtype)
    right[..., :-2] = moving.transpose(1, 0, 2)
    right[..., -2] = np.einsum("mqk,mqk->mq", moving, moving).T
    right[..., -1] = 1
    return right
