"""Balance: whether one of several features drowns the others in what is compared."""

import warnings

import numpy as np

from ..matching.warps import even_slices
from ..performances import names_of_input

__all__ = ["warn_of_one_feature"]

# Of 112 sets of features of people, one action each, the largest share of velocities is 0.93:
# positions, direction cosines, and their first components, two or more (HDM05, UTKinect).
_DROWNS = 0.95
# A feature with less of the energy does not move, but for rounding.
_STILL = 1e-24
# Correlations of principal components are not larger by rounding.
_UNCORRELATED = 1e-5
# Performances that are looked at together.
AT_ONCE = 256


def warn_of_one_feature(synchronizer, performances, compared):
    """Say if one of several features has nearly all of the energy, as other units have.

    Parameters
    ----------
    synchronizer : DenseSynchronizer
        Its metric is learnt.
    performances : sequence of ndarray (n_frames_i, n_features)
    compared : Compared
        What is compared of them without a metric; not looked at with one.
    """
    metric, names = synchronizer.metric_, names_of_input(synchronizer)
    shares = metric.energy if metric else _shares(compared, synchronizer.cost)
    if shares.max() <= _DROWNS or (shares > _STILL).sum() < 2:
        return
    if _are_principal_components(performances):
        return
    k = int(shares.argmax())
    name = k if names is None else repr(names[k])
    warnings.warn(
        f"Feature {name} holds {100 * shares[k]:.4g} % of the energy that is compared: of "
        f"{len(shares)} features the others hardly count. If units differ, scale them: "
        "make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer()). If it alone shall tell "
        "the moments, leave the others out, and warp them by Match.warp.",
        UserWarning,
        stacklevel=2,
    )


def _shares(compared, cost):
    """The share of every feature in what is compared without a metric."""
    sums = [_sums(x) for x in compared.portions()]
    if cost == "posture":
        # Where all of them are makes no difference.
        centre = sum(total for total, _, _ in sums) / sum(count for _, _, count in sums)
        sums = [_sums(x - centre.astype(x.dtype)) for x in compared.portions()]
    energy = sum(squares for _, squares, _ in sums)
    return energy / (energy.sum() or 1.0)


def _sums(features):
    """Of every feature its sum and that of its squares, and how many frames there are."""
    squares = np.einsum("npk,npk->k", features, features, dtype=np.float64)
    return features.sum(axis=(0, 1), dtype=np.float64), squares, features[:, :, 0].size


def _are_principal_components(performances):
    """Whether features are uncorrelated, the largest first, as those of an aSpace are.

    They have one unit, and the first has most of the variance by construction.
    """
    largest = max(float(np.abs(x).max()) for x in performances) or 1.0
    # About a posture that is near, so that no digits are lost.
    origin = performances[0].mean(axis=0, dtype=np.float64) / largest
    total, products, count = 0, 0, 0
    for rows in even_slices(len(performances), AT_ONCE):
        frames = np.concatenate(list(performances[rows])).astype(np.float64) / largest
        frames -= origin
        total, products = total + frames.sum(axis=0), products + frames.T @ frames
        count += len(frames)
    covariance = products - np.outer(total, total) / count
    variance = np.diag(covariance)
    bound = _UNCORRELATED * np.sqrt(np.outer(variance, variance))
    others = np.abs(covariance - np.diag(variance))
    return bool((others <= bound).all() and (np.diff(variance) <= 0).all())
