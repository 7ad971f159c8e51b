"""The matching: all that the paper computes between two performances, on NumPy and SciPy alone.

``costs`` (Eqs. 12, 16), ``trellis`` and ``rows`` (Eqs. 13-17), ``causal`` (the same while a sequence
runs), ``median`` (Eq. 19), ``metric``, ``consensus``, ``refinement`` and ``refinement_test`` (beyond
the paper), ``matcher`` and ``warper`` (all of these, one after the other), ``warps`` (Eqs. 7, 18),
``filters``, ``comparison`` (distances of pairs), ``units``. Of scikit-learn it knows
``get_config()["working_memory"]`` alone; estimators are in ``synchronizers``.
"""
