"""What artists of displays show."""

import numpy as np


def segments(collection):
    """The points (n, 2) of each curve of a collection."""
    return [np.asarray(path.vertices) for path in collection.get_paths()]


def ys(collection):
    """The heights of curves of equal length, (n_curves, n)."""
    return np.array([xy[:, 1] for xy in segments(collection)])


def edges(area):
    """The lower and the upper edge of an area between two curves, (2, n)."""
    heights = area.get_paths()[0].vertices[1:-1, 1]
    n = len(heights) // 2
    return np.array([heights[:n], heights[n + 1 :][::-1]])


def texts(axis):
    """The labels of the legend."""
    return [text.get_text() for text in axis.get_legend().get_texts()]


def bones_drawn(display, panel, side=None):
    """The ends (n_bones, 2, 2) of bones of stick figures, of one side or all."""
    sides = [side] if side else list(display.bones_[panel])
    return np.concatenate([ends_of_bones(display.bones_[panel][s]) for s in sides])


def ends_of_bones(collection):
    """The ends (n_bones, 2, 2) of the bones of bodies, each of which is a line with gaps."""
    ends = [xy.reshape(-1, 3, 2)[:, :2] for xy in segments(collection)]
    return np.concatenate([np.empty((0, 2, 2)), *ends])
