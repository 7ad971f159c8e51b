"""Whether one of several features dominates the energy that is compared, as with mixed units."""

import warnings

import numpy as np

from ..inputs.validation import names_of_input
from ..matching.warps import even_slices

__all__ = ["warn_of_one_feature"]

# Of 112 sets of features of people, one action each, the largest share of velocities is 0.93:
# positions, direction cosines, and their first components, two or more (HDM05, UTKinect).
_DOMINANT = 0.95
# A feature with a smaller share of the energy is constant but for rounding.
_CONSTANT = 1e-24
# Largest correlation of principal components due to rounding.
_UNCORRELATED = 1e-5
# Performances processed at a time.
BATCH = 256


def warn_of_one_feature(synchronizer, performances, store):
    """Warn if one of several features has nearly all of the energy, as with mixed units.

    Parameters
    ----------
    synchronizer : DenseSynchronizer
        Its metric is learnt.
    performances : sequence of ndarray (n_frames_i, n_features)
    store : FeatureStore
        Their features, used without a metric.
    """
    metric, names = synchronizer.metric_, names_of_input(synchronizer)
    shares = metric.energy if metric else _shares(store, synchronizer.cost)
    if shares.max() <= _DOMINANT or (shares > _CONSTANT).sum() < 2:
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


def _shares(store, cost):
    """The share of every feature in the energy that is compared without a metric."""
    total, energy, count = 0, 0, 0
    for features in map(store.plain, store.portions()):
        total += features.sum(axis=(0, 1), dtype=np.float64)
        energy += np.einsum("npk,npk->k", features, features, dtype=np.float64)
        count += features[:, :, 0].size
    if cost == "posture":
        # A common offset changes no distance.
        energy = np.maximum(energy - total**2 / count, 0)
    return energy / (energy.sum() or 1.0)


def _are_principal_components(performances):
    """Whether features are uncorrelated, the largest first, as those of an aSpace are.

    They have one unit, and the first has most of the variance by construction.
    """
    # From a posture near the mean, so that no digits are lost.
    origin = performances[0].mean(axis=0, dtype=np.float64)
    arrays, total, products, count = list(performances), 0, 0, 0
    for rows in even_slices(len(arrays), BATCH):
        frames = np.concatenate(arrays[rows]).astype(np.float64) - origin
        total, products = total + frames.sum(axis=0), products + frames.T @ frames
        count += len(frames)
    covariance = products - np.outer(total, total) / count
    variance = np.diag(covariance)
    bound = _UNCORRELATED * np.sqrt(np.outer(variance, variance))
    others = np.abs(covariance - np.diag(variance))
    return bool((others <= bound).all() and (np.diff(variance) <= 0).all())
