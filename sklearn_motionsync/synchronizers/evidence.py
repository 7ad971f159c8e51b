"""Whether the warps of a training set agree with each other, and what follows if they do not."""

import warnings
from functools import partial

import numpy as np
from sklearn.utils import Bunch

from ..matching.filters import SMOOTHING
from ..matching.matcher import Features
from ..utils.threads import on_one_thread
from .portions import refuse_long_paths

__all__ = ["MOST_LEARNT", "SynchronizationWarning", "learn_features"]

# The largest offset while the metric is learnt: docs/design.md.
_LEARNING_OFFSET = 0.2
# velocity_smoothing="auto": a metric weights noise down; without one it is smoothed away.
_SMOOTH, _SHARP = SMOOTHING, 0.02
# Numbers of performances a metric is learnt from. Two have no route but the
# direct one: their differences cannot be told from a wrong path.
_FEWEST, MOST_LEARNT = 3, 20

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
    return Bunch(remaining=np.nan, inconsistency=np.nan, weak=False, harmful=False)


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
        ``remaining``, ``inconsistency``, ``weak``, ``harmful``.
    """
    remaining, inconsistency = found.remaining, found.inconsistency
    weak = bool(n >= _ENOUGH and remaining > _REMAINING and inconsistency > _INCONSISTENT)
    harmful = bool(weak and inconsistency > _NOISE)
    if weak and unsupported == "linear":
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
    return Bunch(remaining=remaining, inconsistency=inconsistency, weak=weak, harmful=harmful)


def learn_features(sync, unit, positions, beside, settings_if):
    """The features with the learnt metric, from evenly spaced performances if there are many.

    Sets ``metric_`` and ``evidence_`` of the synchronizer.

    Parameters
    ----------
    sync : DenseSynchronizer
    unit : Unit
    positions : ndarray, shape (n_sequences, Q, n_features)
        The training set at all positions, in the unit.
    beside : dict
        Attributes of `Features` that tell the columns beside them.
    settings_if : callable
        The settings of `Matcher.learn`, given whether a metric is learnt.
    """
    learns = sync.metric == "learned" and sync.cost == "velocity" and sync.consensus > 0
    given = sync.subframes, sync.max_rate, settings_if(learns)["max_offset"]
    refuse_long_paths(*given, sync.n_frames_)
    smoothing, sync.metric_ = sync.velocity_smoothing, None
    sync.evidence_ = no_evidence()
    sharp, smooth = (_SHARP, _SMOOTH) if smoothing == "auto" else (smoothing, smoothing)
    plain, n = Features(sync.cost, sync.subframes, smooth, unit), len(positions)
    plain = plain.replace(**beside)
    if not learns or n < _FEWEST:
        return plain
    some = np.unique(np.round(np.linspace(0, n - 1, min(n, MOST_LEARNT))).astype(np.intp))
    settings = settings_if(False)
    settings["max_offset"] = min(settings["max_offset"], _LEARNING_OFFSET)
    settings |= {"consensus": sync.consensus, "warp_smoothing": sync.warp_smoothing}
    features = plain.replace(velocity_smoothing=sharp)
    learnt = on_one_thread(partial(features.learn, **settings), positions[some])
    if learnt is None:
        return plain
    features, share, energy, evidence = learnt
    sync.evidence_ = weigh_evidence(evidence, len(some), sync.unsupported)
    sync.metric_ = Bunch(share=share, energy=energy, performances=some)
    return features
