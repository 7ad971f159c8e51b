"""Which action it is: distances between performances, and a classifier that stands on them."""

from .classifier import ActionClassifier
from .distances import synchronization_distances

__all__ = ["ActionClassifier", "synchronization_distances"]
