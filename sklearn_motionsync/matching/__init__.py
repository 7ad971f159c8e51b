"""The matching: all that the paper computes between two performances, on NumPy and SciPy alone.

``costs`` (Eqs. 12, 16), ``trellis`` (Eqs. 13-17), ``causal`` (the same while a sequence runs),
``median`` (Eq. 19), ``warps`` (Eqs. 7, 18); beyond the paper ``metric``, ``consensus``,
``refinement`` and ``refinement_test``; ``matcher`` (all of these, one after the other),
``pairwise`` (distances of any two), ``filters`` and ``units``. Of scikit-learn it uses
``get_config()["working_memory"]`` alone; estimators are in ``synchronizers``.
"""
