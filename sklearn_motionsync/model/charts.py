"""Coordinates in which performances are mixed: numbers as they are, directions on the sphere."""

import numpy as np

from ..body.limbs import unit
from ..body.sphere import away, mean_direction, towards

__all__ = ["Chart", "directions_in"]

# Directions are of length 1. Warps that fall between frames shorten them, half of the time by less
# than this, and where trackers leap nearly to nothing: to 0.06 among 190 performances of a Kinect.
_USUALLY, _AT_LEAST, _AT_MOST = 0.99, 1e-3, 1 + 1e-3


class Chart:
    """Coordinates of performances about a mean: tangents for directions, differences for numbers.

    Parameters
    ----------
    mean : ndarray, shape (P, n_features)
    deviations : ndarray, shape (n, P, n_features)
        Performances less the mean.

    Attributes
    ----------
    directions : list of slice
        Of features; see `directions_in`.
    coordinates : ndarray, shape (n, P, n_features)
        Of the performances.
    """

    def __init__(self, mean, deviations):
        known = mean + deviations
        self.mean, self.directions = mean, directions_in(known)
        self.coordinates, self._bases = deviations, []
        even = np.full(len(known), 1 / len(known)).reshape(-1, 1)
        if self.directions:
            self.coordinates = deviations.copy()
        for columns in self.directions:
            directions = unit(known[..., columns])
            base = mean_direction(directions, even)
            self._bases.append(base)
            self.coordinates[..., columns] = towards(base, directions)

    def performances(self, coordinates):
        """Performances (m, P, n_features) at coordinates: their directions have the length 1."""
        found = self.mean + coordinates
        for columns, base in zip(self.directions, self._bases, strict=True):
            tangents = coordinates[..., columns]
            tangents = tangents - (tangents * base).sum(axis=-1, keepdims=True) * base
            found[..., columns] = away(base, tangents)
        return found.astype(self.mean.dtype)


def directions_in(performances):
    """Which features are directions: three, or two, side by side, of length 1 in all performances.

    Parameters
    ----------
    performances : ndarray, shape (n, P, n_features)

    Returns
    -------
    list of slice
    """
    found, start = [], 0
    with np.errstate(over="ignore"):
        squares = np.square(performances.astype(np.float64))
    while start < squares.shape[2]:
        for width in (3, 2):
            columns = slice(start, start + width)
            if columns.stop <= squares.shape[2] and _are_one(squares[..., columns]):
                found.append(columns)
                break
        start = found[-1].stop if found and found[-1].start == start else start + 1
    return found


def _are_one(squares):
    lengths = np.sqrt(squares.sum(axis=-1))
    in_bounds = lengths.min() > _AT_LEAST and lengths.max() < _AT_MOST
    return in_bounds and np.median(lengths) > _USUALLY
