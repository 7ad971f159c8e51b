"""Recognition of actions: a classifier of trials, and the distances between them.

`ActionClassifier` learns several actions and names that of a new trial, and
`synchronization_distances` gives the distances after matching to any method of scikit-learn that
takes a matrix of distances.
"""

from .classifier import ActionClassifier
from .distances import synchronization_distances

__all__ = [
    "ActionClassifier",
    "synchronization_distances",
]
