"""The matching: all that the paper computes between two trials, on NumPy and SciPy alone.

``costs`` (Eqs. 12, 16), ``trellis`` on ``tile`` (Eqs. 13-17), ``median`` (Eq. 19), ``warps`` (Eqs.
7, 18); beyond the paper ``metric``, ``consensus``, ``sharpening``, ``refinement``, ``gaps`` and
``uncertainty``; ``matcher`` (all of these, one after the other); ``filters``, ``units``,
``counting`` and ``sizes`` (numbers of engineering). Of scikit-learn it uses
``get_config()["working_memory"]`` alone; estimators are in ``synchronizers``.
"""
