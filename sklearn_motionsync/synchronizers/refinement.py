"""The decision of a fit whether postures refine warps: its test, shared out among jobs."""

from functools import partial

import numpy as np

from ..matching.filters import choose_smoothing
from ..matching.refinement_test import RefinementTest, Verdict, split_features
from ..utils.threads import on_one_thread
from .portions import measure_in_portions

__all__ = ["try_refinement"]

# Fewer performances have no first pass, and with twice as many it takes every second one.
_SEVERAL = 3


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
