"""Trials of people who differ in style and pace."""

import numpy as np


def made_people(n, n_frames=30):
    """Trials of one movement in a few styles, each at a pace of its own."""
    rng = np.random.default_rng(0)
    t = np.linspace(0, 1, n_frames)
    styles = rng.standard_normal((5, 3))
    X = []
    for _ in range(n):
        phase = t + rng.uniform(-0.1, 0.1) * np.sin(np.pi * t)
        style = 0.15 * styles[rng.integers(5)] + 0.05 * rng.standard_normal(3)
        a, b, c = style + [0.5, 1, 1]
        X.append(np.column_stack([np.sin(3 * phase + a), b * np.cos(4 * phase), c * phase]))
    return X
