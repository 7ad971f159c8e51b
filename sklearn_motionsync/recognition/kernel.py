"""MotionKernel: how alike performances are, by several costs and without warps."""

import numpy as np
from scipy.spatial.distance import cdist

from ..matching.units import exponent_of
from .distances import distances_of, on_clock

__all__ = ["MotionKernel"]

# So many times the training set, what differs in it is lost beside a performance.
_FAR = 1e30
# What differs by less than this share of the size of all is rounding.
_STILL = 2.0**-44
# Frames that are averaged for the start and the end of a performance.
_ENDS = 3


class MotionKernel:
    """The mean of kernels ``exp(-gamma D / median(D))``, medians over the training pairs.

    One is of the synchronisation distances of each comparison. One is of what is seen without any
    warp: of every feature mean, standard deviation, smallest and largest value, start and end, each
    in standard deviations of the training set.

    Parameters
    ----------
    comparisons : list of Comparison
    gamma : float
    summaries : bool
        Whether the last one is there.
    """

    def __init__(self, comparisons, gamma, summaries):
        self.comparisons, self.gamma, self.summaries = comparisons, gamma, summaries

    def learn(self, performances, **work):
        """The kernel within the training set: (n, n).

        Parameters
        ----------
        performances : sequence of ndarray (n_frames_i, n_features)
        **work : dict
            ``n_jobs`` and ``progress``.
        """
        self._exponent = max(map(exponent_of, performances))
        frames = [np.ldexp(x.astype(np.float64), -self._exponent) for x in performances]
        self._centre = np.concatenate(frames).mean(axis=0)
        spread = [np.square(x - self._centre).sum(axis=1).mean() for x in frames]
        # About 1 on average, clip by clip; what does not move at all has no unit.
        self._unit = np.sqrt(np.mean(spread)) or 1.0
        scaled = self._scaled(performances)
        self._known = self._features(scaled)
        distances = [
            distances_of(c, known, name=f" by {c.cost}", **work)
            for c, known in zip(self.comparisons, self._known, strict=True)
        ]
        if self.summaries:
            seen = np.array([summary(x) for x in scaled])
            self._mean, self._std = seen.mean(axis=0), seen.std(axis=0)
            rounding = _STILL * max(1.0, np.abs(self._centre).max() / self._unit)
            # What all have in common tells nothing, not even of those who do not have it.
            self._std = np.where(self._std > rounding, self._std, np.inf)
            self._summaries = (seen - self._mean) / self._std
            distances.append(cdist(self._summaries, self._summaries, "sqeuclidean"))
        pairs = np.triu_indices(len(scaled), 1)
        self._medians = [_typical(d[pairs]) for d in distances]
        return self._mean_kernel(distances)

    def __call__(self, performances, **work):
        """The kernel of other performances and the training set: (n_other, n)."""
        scaled = self._scaled(performances)
        features = self._features(scaled)
        distances = [
            distances_of(c, new, known, name=f" by {c.cost}", **work)
            for c, new, known in zip(self.comparisons, features, self._known, strict=True)
        ]
        if self.summaries:
            seen = np.array([summary(x) for x in scaled])
            distances.append(cdist((seen - self._mean) / self._std, self._summaries, "sqeuclidean"))
        return self._mean_kernel(distances)

    def _scaled(self, performances):
        """Performances about the mean posture, in the unit of the training set."""
        scaled = []
        for i, x in enumerate(performances):
            with np.errstate(over="ignore"):
                x = np.ldexp(x.astype(np.float64), -self._exponent)
                x = (x - self._centre) / self._unit
            if not np.abs(x).max() < _FAR:
                raise ValueError(
                    f"Performance {i} is more than {_FAR:.0e} times as large as the training set: "
                    "give it in the same unit."
                )
            scaled.append(x)
        return scaled

    def _features(self, scaled):
        if not self.comparisons:
            return []
        clock = on_clock(scaled, self.comparisons[0].n_frames)
        return [c.features(clock) for c in self.comparisons]

    def _mean_kernel(self, distances):
        kernels = (
            np.exp(-self.gamma * d / median)
            for d, median in zip(distances, self._medians, strict=True)
        )
        return sum(kernels) / len(distances)


def summary(x):
    """What is seen of a performance (n_frames, n_features) without its course."""
    ends = x[:_ENDS].mean(axis=0), x[-_ENDS:].mean(axis=0)
    parts = [x.mean(axis=0), x.std(axis=0), x.min(axis=0), x.max(axis=0), *ends]
    return np.concatenate(parts)


def _typical(distances):
    """The median; if that is 0, the mean, and if that is, 1."""
    if not distances.size:
        return 1.0
    return float(np.median(distances)) or float(distances.mean()) or 1.0
