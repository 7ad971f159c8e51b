"""Balance: whether one of several features drowns the others in what is compared."""

import warnings

import numpy as np

from ..performances import names_of_input

__all__ = ["warn_of_one_feature"]

# Of 112 sets of features of people, one action each, the largest share of velocities is 0.93:
# positions, direction cosines, and their first components, two or more (HDM05, UTKinect).
_DROWNS = 0.95
# A feature with less of the energy does not move, but for rounding.
_STILL = 1e-24
# Correlations of principal components are not larger by rounding.
_UNCORRELATED = 1e-5


def warn_of_one_feature(synchronizer, performances, compared):
    """Say if one of several features has nearly all of the energy, as other units have.

    Parameters
    ----------
    synchronizer : DenseSynchronizer
        Its metric is learnt.
    performances : sequence of ndarray (n_frames_i, n_features)
    compared : ndarray, shape (n_sequences, Q, n_features)
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
    if cost == "posture":
        # Where all of them are makes no difference.
        compared = compared - compared.mean(axis=(0, 1))
    energy = np.einsum("npk,npk->k", compared, compared, dtype=np.float64)
    return energy / (energy.sum() or 1.0)


def _are_principal_components(performances):
    """Whether features are uncorrelated, the largest first, as those of an aSpace are.

    They have one unit, and the first has most of the variance by construction.
    """
    frames = np.concatenate(performances).astype(np.float64)
    frames /= np.abs(frames).max() or 1.0
    frames -= frames.mean(axis=0)
    covariance = frames.T @ frames
    variance = np.diag(covariance)
    bound = _UNCORRELATED * np.sqrt(np.outer(variance, variance))
    others = np.abs(covariance - np.diag(variance))
    return bool((others <= bound).all() and (np.diff(variance) <= 0).all())
