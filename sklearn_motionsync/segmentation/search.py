"""find_performances: where in long takes an action happens."""

import warnings
from bisect import bisect, insort
from numbers import Integral, Real
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.signal import lfilter
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from ..inputs.collections import as_collection
from ..inputs.numbers import as_numbers, check_finite
from ..inputs.tables import as_pandas
from ..inputs.validation import SequenceLevelMixin, check_performances
from ..matching.filters import SMOOTHING, smooth
from ..matching.matcher import Features
from ..matching.metric import without_mean
from ..matching.trellis import Trellis
from ..matching.warps import at_times, even_slices, normalise
from ..model.action_model import ActionModel
from ..model.detector import energies
from ..model.similarity import as_codes, learn_border
from ..synchronizers.dense import DenseSynchronizer
from ..utils.pipelines import find_synchronizer, flat_steps, reach_synchronizer
from .cutting import cut_takes

__all__ = ["find_performances"]

# A pattern that is given as an array is compared on at most so many frames.
_CLOCK = 100
# How much shorter and longer than those that were learnt performances may be: of many, and where
# there is only a pattern.
_MARGIN, _MARGIN_OF_ONE = 1.1, 1.5
# No window is shorter.
_FEWEST = 3
# Ends of a hit are moved by this share of its length at first, then by ever less.
_FIRST_MOVE = 1 / 8
_MOVES = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)])
# Twice as unlike as the threshold allows: no move of the ends makes that up.
_HOPELESS = 2


def find_performances(
    pattern, X, *, threshold="learned", coverage=0.6, max_hits=None, durations=None, groups=None
):
    """Where in long takes an action happens: performances cut out of them.

    1. The pattern is looked for in portions of a take that overlap, at several time scales: the
       trellis with free ends finds where in each it begins and ends best.
    2. Each of these windows is compared with the training performances, as they are: how unlike
       it is to the two most similar ones in posture and in what the synchronizer compares, in
       length and in energy. The score is ``exp(-unlikeness)``: 1 is equal, 0.37 as unlike as
       standing still.
    3. The ends of the best window are moved to where its score is best; then those of the best
       that does not overlap it, and so on. What reaches the threshold is a hit.

    Time grows with the length of a take, memory does not.

    Parameters
    ----------
    pattern : fitted synchronizer, Pipeline, ActionDetector, or array (n_frames, n_features)
        What to look for. A pipeline ends in a synchronizer or in what follows one; its first step
        takes the takes. An array (one performance) has nobody beside it: it says what
        to look for, not how people differ.
    X : array (n_frames, n_features), list of such arrays, or other collection
        One take, or several, at the frame rate of the training performances. A single
        feature may be one-dimensional.
    threshold : "learned", float or None, default="learned"
        The lowest score of a hit. ``"learned"``: from the training performances, each compared
        with those of other groups, but no lower than what movements by chance among their postures
        hardly ever reach; at least 0.50 and at most 0.86. 0.61 for an array, half as unlike as
        standing still. None: whatever is better than what it overlaps, to be compared
        with the learnt one.
    coverage : float, default=0.6
        Share of performances of people not seen, cut out by hand, that a learnt threshold lets in,
        unless chance gets as far.
    max_hits : int, default=None
        How many are kept of each take, the best ones; by default all.
    durations : (int, int), default=None
        Numbers of frames of the shortest and the longest performance looked for. By default a
        tenth beyond those of the training set, and what is unusually short or long counts as
        unlike; for an array from 2/3 to 3/2 of its length.
    groups : array-like, default=None
        Who performed each training performance, or what else makes them resemble each other. By
        default those that an `ActionModel` in the pipeline was fitted with, which it knows of at
        most 64 performances.

    Returns
    -------
    performances : list of array, or of DataFrame, (n_frames_i, n_features)
        Cut out of the takes, in the order of their time, take by take. DataFrames keep columns, and
        are called by the label of their take and their number in it.
    origin : DataFrame
        One row each: ``take``, its index or label; ``start`` and ``stop``, frames of the take, the
        last excluded; ``score``; ``threshold``, the one that was given or learnt.

    Raises
    ------
    ValueError
        If the takes break the input contract or have other features than the training set, or a
        parameter is none of those that are accepted.

    See Also
    --------
    ActionDetector : Whether what was cut out already is the action.
    SearchDisplay : Draws hits along the takes.

    Notes
    -----
    A learnt threshold takes for known how people differ. How much else in a take looks like the
    action nobody knows before: give more ``coverage`` to miss less, a higher threshold for fewer
    false hits, and see docs/method.md for figures. What people do in entirely different ways
    is hardly found.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import find_performances
    >>> t = np.linspace(0, 1, 40)
    >>> wave = np.column_stack([np.sin(6 * t), np.sin(9 * t)])
    >>> take = np.zeros((300, 2))
    >>> take[50:90], take[200:250] = wave, np.column_stack(
    ...     [np.interp(np.linspace(0, 1, 50), t, x) for x in wave.T])
    >>> performances, origin = find_performances(wave, take)
    >>> origin[["take", "start", "stop"]].to_numpy().tolist()
    [[0, 50, 90], [0, 200, 250]]
    """
    _check(threshold=threshold, coverage=coverage, max_hits=max_hits, durations=durations)
    X = _as_takes(X)
    reader = type("find_performances", (SequenceLevelMixin, BaseEstimator), {})()
    given = check_performances(reader, X, reset=True, level="sequence")
    synchronizer, takes, groups = _reach(pattern, X, groups)
    _check_lengths(given, takes)
    shortest, longest = _durations(synchronizer, durations)
    propose = Proposer.of(synchronizer, shortest, longest)
    unlikeness = Unlikeness(synchronizer, groups, length=durations is None)
    level = _level(unlikeness, threshold, coverage)
    lowest = 0.0 if threshold is None else level
    rows = []
    for i, take in enumerate(takes):
        take = take.astype(np.float64, copy=False)
        search = _Search(take, unlikeness, shortest, longest)
        rows += [(i, *hit) for hit in search.hits(propose(take), lowest, max_hits)]
    rows = pd.DataFrame(rows, columns=["take", "start", "stop", "score"])
    rows = rows.astype({"take": int, "start": int, "stop": int, "score": float})
    return cut_takes(X, given, rows.assign(threshold=level))


class _Search:
    """The best windows of a take that do not overlap."""

    def __init__(self, take, unlikeness, shortest, longest):
        self._take, self._unlikeness = take, unlikeness
        self._shortest, self._longest = shortest, min(longest, len(take))

    def hits(self, windows, threshold, most):
        """Start, stop and score of the best of windows (n, 2), in the order of time.

        Windows are tried the best first, and each takes its place whether it is accepted or not:
        so a threshold chooses among hits, and changes none.
        """
        scores = np.exp(-self._unlikeness(self._take, windows))
        tried = []
        for k in np.argsort(-scores, kind="stable"):
            if scores[k] < threshold**_HOPELESS:
                break
            room = self._room(windows[k], tried)
            if room is not None:
                insort(tried, self._moved(windows[k], scores[k], *room))
        found = sorted((hit for hit in tried if hit[2] >= threshold), key=lambda hit: -hit[2])
        return sorted(found[:most])

    def _room(self, window, tried):
        """From where to where a window may reach; None if it overlaps what was tried.

        What was tried is in order of time, and does not overlap.
        """
        at = bisect(tried, tuple(window))
        before = tried[at - 1][1] if at else 0
        after = tried[at][0] if at < len(tried) else len(self._take)
        return (before, after) if before <= window[0] and window[1] <= after else None

    def _moved(self, window, score, first, last):
        """The window with its ends moved, by ever less, to where its score is best."""
        window, move = np.asarray(window), max(1, int(_FIRST_MOVE * (window[1] - window[0])))
        while move:
            some = window + move * _MOVES
            sizes = some[:, 1] - some[:, 0]
            inside = (some[:, 0] >= first) & (some[:, 1] <= last)
            some = some[inside & (sizes >= self._shortest) & (sizes <= self._longest)]
            scores = np.exp(-self._unlikeness(self._take, some))
            if scores.max(initial=0) > score:
                window, score = some[scores.argmax()], scores.max()
            else:
                move //= 2
        return int(window[0]), int(window[1]), float(score)


def _as_takes(X):
    """A collection of takes, one being wrapped."""
    X = as_pandas(X)
    if as_collection(X) is not None:
        return X
    if isinstance(X, pd.DataFrame):
        return [X]
    array = as_numbers(X, "The take")
    return [array[:, np.newaxis] if array.ndim == 1 else array]


def _reach(pattern, X, groups):
    """The synchronizer, the takes as they reach it, and the groups of what it keeps."""
    if not hasattr(pattern, "fit"):
        if groups is not None:
            raise ValueError("groups tell training performances apart; an array is only one.")
        pattern = _as_pattern(pattern)
        synchronizer = DenseSynchronizer(min(len(pattern), _CLOCK), pattern=0).fit([pattern])
        return synchronizer, synchronizer.check_performances(X), None
    _check_synchronizer(find_synchronizer(pattern)[1])
    reached = reach_synchronizer(pattern, X, {}, "find_performances")
    return reached.synchronizer, reached.performances, _groups(pattern, reached, groups)


def _as_pattern(pattern):
    """One performance: a DataFrame, or an array (n_frames, n_features)."""
    pattern = as_pandas(pattern)
    several = isinstance(pattern, (list, tuple, np.ndarray, pd.DataFrame))
    if several and as_collection(pattern) is not None:
        raise ValueError(
            "The pattern is a list of performances, or a 3-D array: give one of them, "
            "(n_frames, n_features), or fit a synchronizer to all, and give that."
        )
    array = as_numbers(pattern, "The pattern")
    array = array[:, np.newaxis] if array.ndim == 1 else array
    if array.ndim != 2 or len(array) < _FEWEST:
        raise ValueError(
            f"The pattern has shape {array.shape}: give one performance, (n_frames, "
            f"n_features), of at least {_FEWEST} frames, or a fitted synchronizer."
        )
    check_finite(array, "The pattern, frame")
    return pattern if isinstance(pattern, pd.DataFrame) else array


def _check_synchronizer(synchronizer):
    check_is_fitted(synchronizer)
    if synchronizer.examples_.shape[2] != synchronizer.n_features_in_:
        raise ValueError(
            f"{type(synchronizer).__name__} was fitted on the rows of a 2-D array, all of one "
            "length, and hits differ in theirs: fit it on [row[:, np.newaxis] for row in X]."
        )


def _check_lengths(given, takes):
    for i, (before, after) in enumerate(zip(given, takes, strict=True)):
        if len(before) != len(after):
            raise ValueError(
                f"{given.called(i)} has {len(before)} frames, and {len(after)} after the steps "
                "before the synchronizer: where a hit is could not be told. Resample the takes "
                "before you give them."
            )


def _groups(pattern, reached, groups):
    n = len(reached.synchronizer.lengths_)
    if n < 2:
        return None
    if groups is not None:
        # Those of the examples, which are evenly spaced.
        some = np.linspace(0, n - 1, len(reached.synchronizer.examples_)).round()
        return as_codes(groups, n)[some.astype(np.intp)]
    models = [step for step in flat_steps(pattern) if isinstance(step, ActionModel)]
    fitted = [model for model in models if hasattr(model, "groups_")]
    if not fitted:
        return None
    known, n_seen = fitted[0].groups_, fitted[0].n_samples_seen_
    # A model may have learnt of others since.
    if len(known) == n_seen == n:
        return known
    if len(np.unique(known)) < len(known):
        warnings.warn(
            f"The model keeps {len(known)} of {n_seen} performances, the synchronizer learnt of "
            f"{n}, so that who gave these is not known, and each counts for "
            "itself: the threshold will be too high. Give groups, one for each performance.",
            UserWarning,
            stacklevel=4,
        )
    return None


def _durations(synchronizer, durations):
    """The shortest and the longest window."""
    known = synchronizer.lengths_
    if durations is not None:
        return max(int(durations[0]), 2), int(durations[1])
    margin = _MARGIN if len(known) > 1 else _MARGIN_OF_ONE
    return max(_FEWEST, int(known.min() / margin)), int(np.ceil(known.max() * margin))


def _level(unlikeness, threshold, coverage):
    """The score that is given, or learnt."""
    if threshold is None or isinstance(threshold, str):
        return float(np.exp(-unlikeness.border(coverage)))
    return float(threshold)


def _check(*, threshold, coverage, max_hits, durations):
    def is_number(x, kind=Real):
        return isinstance(x, kind) and not isinstance(x, bool)

    if not (
        threshold is None
        or (isinstance(threshold, str) and threshold == "learned")
        or (is_number(threshold) and 0 <= threshold <= 1)
    ):
        raise ValueError(
            f"threshold must be 'learned', a score from 0 to 1, or None; got {threshold!r}."
        )
    if not (is_number(coverage) and 0 < coverage < 1):
        raise ValueError(f"coverage must be a share between 0 and 1, got {coverage!r}.")
    if not (max_hits is None or (is_number(max_hits, Integral) and max_hits >= 1)):
        raise ValueError(f"max_hits must be a whole number from 1 on, or None; got {max_hits!r}.")
    if durations is None:
        return
    pair = tuple(durations) if isinstance(durations, (tuple, list, np.ndarray)) else ()
    if not (
        len(pair) == 2 and all(is_number(n, Integral) for n in pair) and 2 <= pair[0] <= pair[1]
    ):
        raise ValueError(
            "durations must be two whole numbers of frames, the shortest from 2 on and the longest "
            f"performance; got {durations!r}."
        )


# -- proposals: windows of a take in which an action may happen, by matching with free ends

# On so many frames the pattern is looked for: only where it is, roughly, matters here.
_CLOCK_FRAMES = 50
# How far both ends are free, as a share of the clock; portions follow each other as far apart.
_SHARE = 0.2
# From one time scale to the next: ends that are free by a fifth cover what is between.
_RATIO = 1.6
_SMOOTHNESS, _MAX_RATE = 0.003, 3
# Portions matched at a time: bounds the memory, whatever the length of the take.
_PROPOSAL_BATCH = 64


class Proposer(NamedTuple):
    """Finds windows of takes that a pattern may lie in.

    Attributes
    ----------
    features : Features
        What is compared of portions, of which it is made on the clock of the pattern.
    base : ndarray, shape (1, P, n_compared)
        What is compared of the pattern.
    trellis : Trellis
        With free ends.
    lengths : ndarray of int
        Usual numbers of frames, one a time scale.
    shortest, longest : int
        Numbers of frames of windows.
    """

    features: Features
    base: np.ndarray
    trellis: Trellis
    lengths: np.ndarray
    shortest: int
    longest: int

    @classmethod
    def of(cls, synchronizer, shortest, longest):
        """The proposer of the pattern of a synchronizer, for windows of so many frames."""
        n_frames = min(synchronizer.n_frames_, _CLOCK_FRAMES)
        features = synchronizer.features_.at_pace(1)
        pattern = synchronizer.pattern_.astype(np.float64)
        base = features(features.positions([pattern], n_frames))
        how = {"max_offset": _SHARE, "max_rate": _MAX_RATE, "free": True}
        mu = _SMOOTHNESS * float(np.square(base).sum()) / n_frames
        trellis = Trellis.on_clock(features.cost, n_frames, mu, **how)
        # The filter of velocities is as wide in a portion as in the pattern.
        share = (n_frames - 1) / (n_frames - 1 + 2 * trellis.width)
        features = features.at_pace(1, share * features.velocity_smoothing)
        return cls(features, base, trellis, scales(shortest, longest), shortest, longest)

    def __call__(self, take):
        """Windows of a take (n_frames, n_features), each once: (n_windows, 2) of start and stop."""
        lengths = self.lengths[self.lengths <= len(take)]
        found = [self._at_scale(take, int(length)) for length in lengths]
        windows = np.concatenate([np.empty((0, 2), dtype=np.intp), *found])
        sizes = windows[:, 1] - windows[:, 0]
        fits = (self.shortest <= sizes) & (sizes <= self.longest)
        return np.unique(windows[fits], axis=0)

    def _at_scale(self, take, length):
        """The best window of every portion, the pattern taking about this number of frames."""
        n_frames, width = self.base.shape[1], self.trellis.width
        step = (length - 1) / (n_frames - 1)
        count = int(np.ceil((len(take) - length) / max(width * step, 1.0))) + 1
        starts = np.linspace(0, len(take) - length, count)
        clock = np.arange(-width, n_frames + width) * step
        found = []
        for some in even_slices(count, _PROPOSAL_BATCH):
            portions = at_times(take, starts[some, np.newaxis] + clock)
            moving = self.features(self.features.unit(portions))
            paths = self.trellis.paths(self.base, moving)[0]
            first, last = starts[some] + paths[:, 0] * step, starts[some] + length - 1
            window = np.stack([first, last + paths[:, -1] * step + 1], axis=1)
            found.append(np.clip(np.round(window).astype(np.intp), 0, len(take)))
        return np.concatenate(found)


def scales(shortest, longest):
    """Numbers of frames from the shortest to the longest, by a constant ratio or less."""
    count = int(np.ceil(np.log(longest / shortest) / np.log(_RATIO))) + 1
    return np.unique(np.round(np.geomspace(shortest, longest, count)).astype(np.intp))


# -- how unlike windows of a take are to performances that were learnt, and how unlike they may be

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
        lengths, examples = synchronizer.lengths_, synchronizer.examples_
        self._set_clock(synchronizer.features_, synchronizer.n_frames_)
        self._length = _Usual(lengths) if length else np.zeros_like
        self._usual_length = np.exp(np.log(lengths).mean())
        count = len(examples)
        positions = self._positions(examples)
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
            own = lengths[np.linspace(0, len(lengths) - 1, count).round().astype(np.intp)]
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


# -- movements by chance: what a take may hold that is like an action without being it ---


def chance_movements(positions, counts):
    """Movements with the mean and the covariance of postures, smooth as those of people.

    Parameters
    ----------
    positions : ndarray, shape (n_sequences, Q, n_features)
        Performances on the clock.
    counts : iterable of int
        How many at a time; always the same ones for the same ``counts``.

    Yields
    ------
    ndarray, shape (count, Q, n_features)
    """
    _, n_positions, n_features = positions.shape
    postures = positions.reshape(-1, n_features)
    center = postures.mean(axis=0)
    _, spread, axes = np.linalg.svd(postures - center, full_matrices=False)
    axes *= spread[:, np.newaxis] / np.sqrt(len(postures))
    kept, rng = np.exp(-1 / n_positions), np.random.default_rng(0)
    for count in counts:
        steps = rng.standard_normal((count, n_positions, len(axes)))
        # Stationary from the first position on.
        steps[:, 1:] *= np.sqrt(1 - kept**2)
        course = lfilter([1], [1, -kept], steps, axis=1)
        yield smooth(course, SMOOTHING * (n_positions - 1)) @ axes + center
