"""Whether refining helps: tried on some of a training set, before a synchronizer does it."""

from functools import partial

import numpy as np

from ..matching.holdout import RefinementTrial, Verdict, deal_features
from ..matching.refinement import choose_smoothing
from ..work import run
from .portions import in_portions

__all__ = ["try_refinement"]


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
    source, width = warper.positions([source]), choose_smoothing(scaled[some])
    portion = warper, source, positions, hands, width
    (trial,) = run(partial(RefinementTrial.of, **settings), [portion])
    how = {"name": "trying to refine", "found": (shared, some), **portions}
    results = in_portions(trial, "misfits", positions, **how)
    energy = np.square(trial.pattern - trial.pattern.mean(axis=0)).sum()
    return Verdict.of(np.concatenate(results, axis=1), energy or 1.0)
