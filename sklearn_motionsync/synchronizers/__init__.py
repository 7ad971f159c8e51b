"""Synchronizers: estimators that put trials on the clock of a pattern (Eqs. 6-19).

``base`` holds what all of them share and ``match`` what they answer; ``linear`` and ``dense`` only
say how they match; ``timing`` puts the warps of any of them beside the curves.
"""
