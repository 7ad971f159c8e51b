"""Transformers of poses, frame by frame."""
