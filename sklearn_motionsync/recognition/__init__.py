"""Recognition of actions: distances between performances, and a classifier."""

from .classifier import ActionClassifier
from .distances import synchronization_distances

__all__ = ["ActionClassifier", "synchronization_distances"]
