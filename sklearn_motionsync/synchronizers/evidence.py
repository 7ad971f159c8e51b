"""Whether the warps of a training set agree with each other, and what follows if they do not."""

import warnings

import numpy as np
from sklearn.utils import Bunch

__all__ = ["SynchronizationWarning", "no_evidence", "weigh_evidence"]

# Matching that leaves more of the differences explains little; if the inconsistency is larger, too,
# warps did no good. So many performances are enough to tell. Measured in docs/design.md.
_REMAINING, _INCONSISTENT, _ENOUGH = 0.7, 0.7, 10


class SynchronizationWarning(UserWarning):
    """The trials do not support their warps: these explain little, or contradict each other, too.

    See ``evidence_`` of `DenseSynchronizer`.

    Examples
    --------
    >>> import warnings
    >>> import numpy as np
    >>> from sklearn_motionsync import DenseSynchronizer, SynchronizationWarning
    >>> noise = np.random.default_rng(0).standard_normal((20, 60, 3))
    >>> with warnings.catch_warnings(record=True) as caught:
    ...     warnings.simplefilter("always", SynchronizationWarning)
    ...     sync = DenseSynchronizer().fit(noise)
    >>> print(str(caught[0].message).split(":")[0])
    Matching leaves 79% of the differences between these performances (evidence_.remaining
    >>> sync.evidence_.harmful
    True
    """


def no_evidence():
    """The evidence where there is none: too few performances, or no metric."""
    return Bunch(inconsistency=np.nan, remaining=np.nan, harmful=False)


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
        ``inconsistency``, ``remaining``, ``harmful``.
    """
    explains_little = n >= _ENOUGH and found.remaining > _REMAINING
    harmful, message = bool(explains_little and found.inconsistency > _INCONSISTENT), ""
    if explains_little:
        message = (
            f"Matching leaves {found.remaining:.0%} of the differences between these performances "
            f"(evidence_.remaining; {_REMAINING:.0%} is the limit): the warps explain little."
        )
    if harmful:
        message += (
            " They contradict each other, too: by way of a third performance a moment lands "
            f"{found.inconsistency:.2f} times a typical offset away (evidence_.inconsistency; "
            f"{_INCONSISTENT} is the limit). So they are linearly normalised, without warps. Check "
            "that all show one movement, cut at the same moments; if so, set unsupported='warp'."
        )
    elif explains_little:
        message += (
            " Compare them with LinearSynchronizer. Less noise helps, and so do features that show "
            "the movement; unsupported='warp' silences this."
        )
    if message and unsupported == "linear":
        warnings.warn(message, SynchronizationWarning, stacklevel=2)
    return Bunch(remaining=found.remaining, inconsistency=found.inconsistency, harmful=harmful)
