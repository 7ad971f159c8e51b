"""Live: performances that are still running, frame by frame."""
