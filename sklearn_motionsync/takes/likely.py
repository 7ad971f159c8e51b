"""How unlike windows of a take are to performances that were learnt, and how unlike they may be.

Windows are compared as they are, linearly normalised to the clock: warping them to a pattern makes
what is another movement look like it, and windows that begin too early or late look right.
"""

import numpy as np

from ..matching.metric import without_mean
from ..matching.warps import even_slices, normalise
from ..model.likeness import as_codes, learn_border
from ..model.manner import energies
from .chance import chance_movements

__all__ = ["Unlikeness"]

# Of the nearest performances so many count: one alone may be a stray.
_NEAREST = 2
# Say of the mean posture, as in `ActionModel`.
_SAY_OF_MEAN = 0.1
# Say of length and energy: of the sum of their squared standard deviations.
_SAY_OF_MANNER = 0.05
# They make nothing more unlike than e to this.
_MOST = 3.0
# The variance of both logarithms that is usual of people; it counts like so many values.
_USUAL_VARIANCE, _USUAL_COUNT = 0.07, 3
# Who stands still is as unlike as 1. What is not clearly more alike is not the action, however
# unlike people are; and takes are noisier than clips, and windows begin at whole frames.
_MOST_BORDER, _LEAST_BORDER = 0.7, 0.15
# The border where a single performance tells nothing of how people differ.
_BORDER_OF_ONE = 0.5
# Of so many movements by chance, this share may be as alike as the border.
_BY_CHANCE, _CHANCE_SHARE = 1000, 0.005
# Windows that are compared at a time: bounds the memory, whatever the length of the take.
_AT_ONCE = 256
# They are compared at so many positions at most: their paths are not asked for.
_MOST_POSITIONS = 100


class Unlikeness:
    """How unlike windows are to training performances: 0 equal, 1 as unlike as standing still.

    The mean over the two most similar training performances of::

        r(y, y_i) = |y - y_i|^2 / (|y|^2 + |y_i|^2),

    half of postures less their own mean over time, to which a tenth of the squared distance of
    these means is added, half of what the synchronizer compares; times e to a twentieth of the
    squared standard deviations that length and energy are from what is usual.

    Parameters
    ----------
    synchronizer : fitted Synchronizer
    groups : array-like (n_kept,), default=None
        Of the training performances that it keeps; by default each is its own.
    length : bool, default=True
        Whether the length counts.

    Attributes
    ----------
    known : ndarray (n_kept,)
        That of the training performances, each compared with those of other groups.
    """

    def __init__(self, synchronizer, groups=None, length=True):
        training = synchronizer.training_
        self._set_clock(training.features, synchronizer.n_frames_)
        self._length = _Usual(training.durations) if length else np.zeros_like
        self._usual_length = np.exp(np.log(training.durations).mean())
        count = len(training.kept)
        positions = self._positions(training.on_clock)
        self._center = positions.mean(axis=(0, 1))
        energy, self._floor = energies(positions)
        if energy.max() <= self._floor:
            raise ValueError(
                "Nobody moves in what is looked for: all times of a take where somebody stands "
                "are alike. Give a pattern, or fit on performances, that move."
            )
        self._energy = _Usual(energy)
        self._known = self._views(positions)
        self._squares = [np.vecdot(view, view) for view in self._known]
        self._training, self.known = positions, np.empty(0)
        if count > 1:
            self._groups = as_codes(groups, count)
            own = training.durations[training.kept]
            self.known = self._of(positions, own, self._groups)

    def border(self, coverage):
        """Up to how unlike a share of the performances of new people is expected to be.

        Movements by chance are more unlike, whatever that share.
        """
        if not len(self.known):
            return _BORDER_OF_ONE
        learnt = min(learn_border(self.known, coverage), _MOST_BORDER)
        return max(min(learnt, self._chance()), _LEAST_BORDER)

    def __call__(self, take, windows):
        """Of windows (n_windows, 2), start and stop, of a take (n_frames, n_features)."""
        out = np.empty(len(windows))
        for rows in even_slices(len(windows), _AT_ONCE):
            positions = self._positions([take[start:stop] for start, stop in windows[rows]])
            out[rows] = self._of(positions, windows[rows, 1] - windows[rows, 0])
        return out

    def _set_clock(self, features, n_frames):
        """Positions of windows, and features of these that are as by the frame of the clock."""
        self._n_positions = min((n_frames - 1) * features.subframes + 1, _MOST_POSITIONS)
        by_frame = (self._n_positions - 1) / (n_frames - 1)
        self._features = features.at_pace(by_frame)

    def _chance(self):
        """How unlike movements by chance are, all but the most alike."""
        portions = even_slices(_BY_CHANCE, _AT_ONCE)
        counts = [portion.stop - portion.start for portion in portions]
        movements = chance_movements(self._training, counts)
        found = [self._of(some, np.full(len(some), self._usual_length)) for some in movements]
        return float(np.quantile(np.concatenate(found), _CHANCE_SHARE))

    def _positions(self, performances):
        """Performances at all positions, in the unit, in double precision."""
        arrays = [np.asarray(x, dtype=np.float64) for x in performances]
        return self._features.unit(normalise(arrays, self._n_positions))

    def _views(self, positions):
        """What is compared of performances: postures beside their mean, and features, as rows."""
        n, n_positions, _ = positions.shape
        stood = np.sqrt(_SAY_OF_MEAN * n_positions) * (positions.mean(axis=1) - self._center)
        moved = without_mean(positions).reshape(n, -1)
        return np.hstack([moved, stood]), moved, self._features(positions).reshape(n, -1)

    def _of(self, positions, lengths, groups=None):
        ratios = self._ratios(positions)
        if groups is not None:
            ratios[groups[:, np.newaxis] == self._groups] = np.inf
        nearest = np.sort(ratios, axis=1)[:, :_NEAREST]
        counts = np.isfinite(nearest)
        shape = np.where(counts, nearest, 0).sum(axis=1) / counts.sum(axis=1)
        energy, _ = energies(positions, self._floor)
        manner = np.square(self._energy(energy)) + np.square(self._length(lengths))
        return shape * np.exp(np.minimum(_SAY_OF_MANNER * manner, _MOST))

    def _ratios(self, positions):
        """How unlike performances are to each of those that are known: (n, n_kept)."""
        stood, moved, compared = self._views(positions)
        squares = np.vecdot(moved, moved), np.vecdot(compared, compared)
        out = np.empty((len(positions), len(self._known[0])))
        tiny = np.finfo(np.float64).tiny
        # Row by row, so that no result depends on the others.
        for i, column in enumerate(out.T):
            posture, feature = stood - self._known[0][i], compared - self._known[2][i]
            column[:] = np.vecdot(posture, posture) / (squares[0] + self._squares[1][i] + tiny)
            column += np.vecdot(feature, feature) / (squares[1] + self._squares[2][i] + tiny)
        return out / 2


class _Usual:
    """How many standard deviations the logarithms of numbers are from those that are usual."""

    def __init__(self, values):
        logs = np.log(values)
        self._mean = logs.mean()
        squares = np.square(logs - self._mean).sum() + _USUAL_COUNT * _USUAL_VARIANCE
        self._std = np.sqrt(squares / (len(logs) + _USUAL_COUNT))

    def __call__(self, values):
        return (np.log(values) - self._mean) / self._std
