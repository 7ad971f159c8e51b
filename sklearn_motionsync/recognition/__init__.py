"""Recognition of actions: distances between trials, and a classifier."""

from .classifier import ActionClassifier
from .distances import synchronization_distances

__all__ = ["ActionClassifier", "synchronization_distances"]
