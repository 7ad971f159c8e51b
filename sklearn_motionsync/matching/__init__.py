"""The matching: all that the paper computes between two performances, on NumPy and SciPy alone.

``costs`` (Eqs. 12, 16), ``trellis`` with ``rows`` and ``narrow`` (Eqs. 13-17), ``median`` (Eq. 19),
``metric`` with ``learning``, ``consensus`` and ``refinement`` (beyond the paper), ``matcher`` and
``warper`` (all of these, one after the other),
``warps`` (Eqs. 7, 18), ``keyframes`` (Fig. 1c), ``filters``. Of scikit-learn it knows
``get_config()["working_memory"]`` and nothing else; estimators are in ``synchronizers``.
"""
