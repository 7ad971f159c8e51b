"""Whether refining helps: tried on some of a training set, before a synchronizer does it."""

from functools import partial

import numpy as np

from ..matching.holdout import RefinementTrial, Verdict, deal_features
from ..matching.refinement import choose_smoothing
from ..work import run
from .portions import in_portions

__all__ = ["try_refinement"]

# Fewer performances do not tell after a few steps whether refining may help; of twice as many
# every second one is looked at first.
_SEVERAL = 3


def try_refinement(warper, source, scaled, shared, some, settings, **portions):
    """The verdict on refining some performances of a training set.

    Parameters
    ----------
    warper : Warper
    source : ndarray, shape (n_frames, n_features)
        The pattern at its own pace.
    scaled : ndarray, shape (n_sequences, P, n_features)
        The training set, in the unit.
    shared : Common
        The `shared_training_set`.
    some : ndarray of int
        Indices of those to try it on.
    settings : dict
        As `Matcher.learn` takes them.
    **portions : dict
        ``n_jobs`` and ``progress``.

    Returns
    -------
    Verdict
        Without any figure if nothing can be told.
    """
    hands = deal_features(scaled[some]) if len(some) else []
    if not hands:
        return Verdict()
    positions = shared.here.positions[some].astype(np.float64, copy=False)
    every = 1 if len(some) < 2 * _SEVERAL else 2
    source, width = warper.positions([source]), choose_smoothing(scaled[some[::every]])
    portion = warper, source, positions, hands, width
    (trial,) = run(partial(RefinementTrial.of, **settings), [portion])
    energy = np.square(trial.pattern - trial.pattern.mean(axis=0)).sum() or 1.0

    def misfits(method, name, every=1):
        how = {"name": name, "found": (shared, some[::every]), **portions}
        return np.concatenate(in_portions(trial, method, positions[::every], **how), axis=1)

    def verdict_on(tried):
        return Verdict.of(np.concatenate([np.full_like(tried[:1], np.nan), tried]), energy)

    if len(some) >= _SEVERAL:
        seen = verdict_on(misfits("glimpse", "trying a little to refine", every))
        if seen.is_hopeless:
            return seen
    tried = misfits("misfits", "trying to refine")
    verdict = verdict_on(tried)
    if not verdict.may_help:
        return verdict
    by_all = misfits("misfits_by_all", "matching without refining")
    return Verdict.of(np.concatenate([by_all, tried]), energy)
