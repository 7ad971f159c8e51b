"""Whether the warps of a training set agree with each other, and what follows if they do not."""

import warnings

import numpy as np
from sklearn.utils import Bunch

__all__ = ["SynchronizationWarning", "no_evidence", "weigh_evidence"]

# Warps explain little if matching leaves more of the differences, and the inconsistency is larger,
# too; beyond the third number they are like those of noise. So many performances are enough to
# tell. Measured in docs/design.md.
_REMAINING, _INCONSISTENT, _NOISE, _ENOUGH = 0.7, 0.45, 1.0, 10


class SynchronizationWarning(UserWarning):
    """The trials do not support their warps: these explain little, and contradict each other.

    See ``evidence_`` of `DenseSynchronizer`.

    Examples
    --------
    >>> import warnings
    >>> import numpy as np
    >>> from sklearn_motionsync import DenseSynchronizer, SynchronizationWarning
    >>> noise = np.random.default_rng(0).standard_normal((12, 60, 3))
    >>> with warnings.catch_warnings(record=True) as caught:
    ...     warnings.simplefilter("always", SynchronizationWarning)
    ...     sync = DenseSynchronizer().fit(noise)
    >>> [each.category.__name__ for each in caught]
    ['SynchronizationWarning']
    >>> sync.evidence_.harmful  # so there are no time shifts
    True
    """


def no_evidence():
    """The evidence where there is none: too few performances, or no metric."""
    return Bunch(remaining=np.nan, inconsistency=np.nan, harmful=False)


def weigh_evidence(found, n, unsupported):
    """Whether warps harm, by the evidence; warns if they do, or explain little.

    Parameters
    ----------
    found : Evidence
        Of the training set.
    n : int
        The number of performances it is from.
    unsupported : {"linear", "warp"}
        The parameter; there is no warning for ``"warp"``.

    Returns
    -------
    Bunch
        ``remaining``, ``inconsistency``, ``harmful``.
    """
    remaining, inconsistency = found.remaining, found.inconsistency
    doubtful = n >= _ENOUGH and remaining > _REMAINING and inconsistency > _INCONSISTENT
    harmful = bool(doubtful and inconsistency > _NOISE)
    if doubtful and unsupported == "linear":
        consequence = (
            "That is as in noise, so they are linearly normalised, without warps. Check that all "
            "show one movement, cut at the same moments; if so, set unsupported='warp'."
            if harmful
            else "Compare them with LinearSynchronizer. Less noise helps, and so do features that "
            "show the movement; unsupported='warp' silences this."
        )
        warnings.warn(
            f"Matching leaves {remaining:.0%} of the differences between these performances, and "
            "by way of a third performance a moment lands "
            f"{inconsistency:.2f} times a typical offset away (evidence_; {_REMAINING:.0%} and "
            f"{_INCONSISTENT} are the limits): the warps explain little. {consequence}",
            SynchronizationWarning,
            stacklevel=2,
        )
    return Bunch(remaining=remaining, inconsistency=inconsistency, harmful=harmful)
