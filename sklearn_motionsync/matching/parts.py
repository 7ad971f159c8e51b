"""Parts: some features of the body alone, with warps of their own that are drawn to the body's."""

from dataclasses import dataclass

import numpy as np

from .matcher import Matcher
from .rows import Coupling
from .warper import Warper
from .warps import follow, normalise

__all__ = ["PartWarper"]

# So strong a coupling leaves a part nothing; a stronger one is beyond numbers.
_RIGID = 1e6


@dataclass(frozen=True, eq=False)
class PartWarper(Warper):
    """Warps some features to the same pattern, by way of the same exemplars, as the whole body.

    Attributes
    ----------
    columns : ndarray of int
        The features.
    weight : float
        Of the coupling, in squared features of a frame by the square of a frame.
    back : ndarray, shape (1 + n_exemplars, P)
        The body's warps of the bases, inverted: what frame of the pattern their frames meet.
    """

    columns: np.ndarray
    weight: float
    back: np.ndarray

    @classmethod
    def of(cls, columns, body, times, on_clock, chosen, coupling, settings):
        """The warper of a part; None if the part does not move.

        Parameters
        ----------
        columns : ndarray of int
            Features of the part.
        body : Warper
            Of the whole body.
        times : ndarray, shape (1 + n_exemplars, P)
            The body's warps of the pattern and its exemplars.
        on_clock, chosen : ndarray, shape (n_sequences, Q, n_features)
            The training set, and the pattern and its exemplars in double precision: whole, at all
            positions, not in the unit.
        coupling : float
            ``lambda``, in mean squared features of the part, by the square of a per cent of the
            clock.
        settings : dict
            As `Matcher.learn` takes them.
        """
        features = body.matcher.features.part(columns, on_clock)
        if features is None:
            return None
        positions = features.unit(on_clock[:, :, columns])
        matcher, compared = Matcher.learn(features, positions, **settings)
        n_frames = len(body.pattern)
        energy = np.square(compared).sum(axis=2, dtype=np.float64).mean()
        weight = float(min(coupling, _RIGID) * energy * (100 / (n_frames - 1)) ** 2)
        frames = np.arange(n_frames)
        own = features.unit(chosen[:, :, columns])
        return cls.to_pattern(
            matcher,
            own[0, :: features.subframes],
            own,
            body.votes,
            body.warp_smoothing,
            Coupling(weight, times[np.newaxis, 1:] - frames) if weight else None,
            columns=columns,
            weight=weight,
            back=np.stack([np.interp(frames, t, frames) for t in times]),
        )

    def positions(self, arrays):
        """Whole performances at all positions, in double precision, not in the unit."""
        arrays = [x.astype(np.float64, copy=False) for x in arrays]
        return normalise(arrays, len(self.pattern), self.matcher.features.subframes)

    def warps(self, positions, rows, body):
        """Distances of the direct paths to the pattern, and times ``tau``, of some performances.

        Parameters
        ----------
        positions : ndarray, shape (n_sequences, Q, n_features)
            Whole performances at all positions, in double precision, not in the unit.
        rows : slice
        body : ndarray, shape (n_sequences, P)
            The warps of their bodies.
        """
        own = self.matcher.features.unit(positions[rows][:, :, self.columns])
        return self.voted(own, self._coupling(body[rows]))

    def _coupling(self, body):
        """What draws the paths from all bases: from the pattern to the body's warp, and from an
        exemplar to the body's warp from there.
        """
        if not self.weight:
            return None
        at = np.broadcast_to(self.back[:, np.newaxis], (len(self.back), *body.shape))
        from_bases = follow(np.broadcast_to(body, at.shape), at)
        return Coupling(self.weight, from_bases - np.arange(body.shape[1]))
