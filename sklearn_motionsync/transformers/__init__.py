"""Transformers of postures, frame by frame."""
