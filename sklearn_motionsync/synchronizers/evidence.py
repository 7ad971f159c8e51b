"""Whether the warps of a training set agree with each other, and a warning if they do not."""

import warnings

import numpy as np
from sklearn.utils import Bunch

__all__ = ["SynchronizationWarning", "weigh_evidence"]

# Warps explain little if matching leaves more of the differences, and the inconsistency is larger,
# too. So many trials are enough to tell. Measured in docs/design.md.
_REMAINING, _INCONSISTENT, _ENOUGH = 0.7, 0.4, 10


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
    >>> sync.evidence_.weak
    True
    """


def weigh_evidence(evidence, n_trials):
    """Whether warps explain little, by the evidence; warns if they do.

    Parameters
    ----------
    evidence : Evidence or None
        Of the training set. None if there is no metric.
    n_trials : int
        The number of trials it is from.

    Returns
    -------
    Bunch
        ``remaining``, ``inconsistency``, ``weak``.
    """
    if evidence is None:
        return Bunch(remaining=np.nan, inconsistency=np.nan, weak=False)
    remaining, inconsistency = evidence.remaining, evidence.inconsistency
    weak = n_trials >= _ENOUGH and remaining > _REMAINING and inconsistency > _INCONSISTENT
    if weak:
        warnings.warn(
            f"Matching leaves {remaining:.0%} of the differences between these performances, and "
            "by way of a third performance a moment lands "
            f"{inconsistency:.2f} times a typical offset away (evidence_; {_REMAINING:.0%} and "
            f"{_INCONSISTENT} are the limits): the warps explain little. Compare them with "
            "LinearSynchronizer, and check that all show one movement, cut at the same moments. "
            "Less noise helps, and so do features that show the movement.",
            SynchronizationWarning,
            stacklevel=2,
        )
    return Bunch(remaining=remaining, inconsistency=inconsistency, weak=bool(weak))
