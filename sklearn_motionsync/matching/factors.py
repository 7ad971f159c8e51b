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
        features = self.features
        return np.einsum("npk,npk->n", features, features)

    @property
    def features(self):
        """The sequences without columns of weights and key-frames."""
        return self.trellis.features(self.sequences)

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
        """(P, n_groups, n_columns + 2, n_bases): times the right factor, the local costs.

        Given the weights of |x_m|^2 and of the inner product, and the penalty, of every group.
        """
        n_bases, n_frames, n_columns = self.sequences.shape
        features, anchors = self.features, self.trellis.anchors
        n_features = features.shape[2]
        left = np.empty((n_frames, len(moving), n_columns + 2, n_bases), dtype=features.dtype)
        energy = np.einsum("npk,npk->pn", features, features)
        moving, inner, penalty = np.asarray([moving, inner, penalty], dtype=left.dtype)
        frames = features.transpose(1, 2, 0)[:, np.newaxis]
        np.multiply(frames, -inner[:, np.newaxis, np.newaxis], out=left[:, :, :n_features])
        if anchors is not None:
            shares = anchors.left(self.sequences).transpose(1, 2, 0)
            left[:, :, -2 - shares.shape[1] : -2] = shares[:, np.newaxis]
        left[:, :, -2] = moving[:, np.newaxis]
        unseen, weights = self.trellis.unseen, self.trellis.weights(self.sequences)
        if weights is None:
            np.add(energy[:, np.newaxis], penalty[:, np.newaxis], out=left[:, :, -1])
            return left
        weights = weights.T[:, np.newaxis]
        left[:, :, :n_features] *= weights[:, :, np.newaxis]
        left[:, :, n_features] = weights * (energy[:, np.newaxis] - unseen)
        left[:, :, -2] *= weights
        left[:, :, -1] = penalty[:, np.newaxis] + left.dtype.type(unseen)
        return left


def right_factor(moving, trellis):
    """(Q, n_moving, n_columns + 2): x_m(q), weight, costs of anchors, |x_m(q)|^2 and 1.

    With weights the first and the last but one are multiplied by them.
    """
    n_moving, n_positions, n_columns = moving.shape
    features, weights, anchors = trellis.features(moving), trellis.weights(moving), trellis.anchors
    n_features = features.shape[2]
    right = np.empty((n_positions, n_moving, n_columns + 2), dtype=moving.dtype)
    right[..., :n_features] = features.transpose(1, 0, 2)
    if anchors is not None:
        costs = anchors.right(moving).transpose(1, 0, 2)
        right[..., -2 - costs.shape[2] : -2] = costs
    right[..., -2] = np.einsum("mqk,mqk->mq", features, features).T
    if weights is not None:
        right[..., n_features] = 1
        right[..., : n_features + 1] *= weights.T[:, :, np.newaxis]
        right[..., -2] *= weights.T
    right[..., -1] = 1
    return right
