"""The decision of a fit whether postures refine warps: its test, shared out among jobs."""

from functools import partial

import numpy as np
from sklearn.utils import Bunch

from ..matching.filters import choose_smoothing
from ..matching.matcher import LinearWarper, RefinedWarper
from ..matching.refinement_test import RefinementTest, Verdict, split_features
from ..utils.threads import on_one_thread
from .gaps import known_whole
from .portions import measure_in_portions

__all__ = ["decide_on_refinement", "try_refinement"]

# Most performances for the refinement test.
_TESTED = 12

# Fewer performances have no first pass, and with twice as many it takes every second one.
_SEVERAL = 3


def decide_on_refinement(sync, training, warper, source, portions, settings, progress):
    """Decide whether warps are refined by postures; the warper that does so or not.

    Sets ``refinement_``, ``misfit_`` and ``refines_`` of the synchronizer.

    Parameters
    ----------
    sync : DenseSynchronizer
    training : TrainingSet
    warper : Warper
    source, portions, settings, progress : as for `try_refinement`
    """
    verdict, linear = Verdict(), isinstance(warper, LinearWarper)
    if sync.refine == "auto" and sync.consensus > 0 and not linear:
        others = known_whole(training.performances, sync.pattern_index_)
        some = others[:: -(-len(others) // _TESTED) or 1]
        given = training.scaled, warper, source, some, portions, settings
        verdict = try_refinement(*given, n_jobs=sync.n_jobs, progress=progress)
    names = "ratio", "p_value", "ratio_to_all"
    sync.refinement_ = Bunch(**{name: getattr(verdict, name) for name in names})
    sync.misfit_ = verdict.misfit
    helps = verdict.helps if sync.refine == "auto" else sync.refine
    sync.refines_ = bool(helps and not linear)
    if not sync.refines_:
        return warper
    return RefinedWarper(**vars(warper), noise_width=choose_smoothing(training.scaled))


def try_refinement(scaled, warper, source, some, portions, settings, *, n_jobs, progress):
    """The verdict on refining some performances; without any figure if there are no two folds of
    features.

    Parameters
    ----------
    scaled : ndarray, shape (n_sequences, P, n_features)
        The training set on the clock, in the unit.
    warper : Warper
    source : ndarray, shape (n_frames, n_features)
        The pattern at its own pace.
    some : ndarray of int
        Indices of performances.
    portions : TrainingPortions
    settings : dict
        Those of `Matcher.learn`.
    n_jobs : int or None
    progress : Progress

    Returns
    -------
    Verdict
    """
    folds = split_features(scaled[some]) if len(some) else []
    if not folds:
        return Verdict()
    positions = portions.positions[some].astype(np.float64, copy=False)
    every = 1 if len(some) < 2 * _SEVERAL else 2
    width = choose_smoothing(scaled[some[::every]])
    given = warper, warper.positions([source]), positions, folds, width
    test = on_one_thread(partial(RefinementTest.of, **settings), *given)
    energy = np.square(test.pattern - test.pattern.mean(axis=0)).sum() or 1.0
    how = {"n_jobs": n_jobs, "progress": progress}

    def misfits(method, name, every=1):
        given = test, method, positions[::every], (portions, some[::every])
        return np.concatenate(measure_in_portions(*given, name=name, **how), axis=1)

    def verdict_of(by_fold, by_all=None):
        by_all = np.full_like(by_fold[:1], np.nan) if by_all is None else by_all
        return Verdict.of(np.concatenate([by_all, by_fold]), energy)

    if len(some) >= _SEVERAL:
        first = verdict_of(misfits("first_misfits", "first pass of the refinement test", every))
        if first.is_hopeless:
            return first
    by_fold = misfits("misfits", "refinement test")
    verdict = verdict_of(by_fold)
    if not verdict.may_help:
        return verdict
    return verdict_of(by_fold, misfits("misfits_by_all", "refinement test, unrefined"))
