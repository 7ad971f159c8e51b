"""find_trials: where in long takes an action happens."""

from __future__ import annotations

import warnings
from bisect import bisect, insort
from functools import partial
from numbers import Real
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator
from sklearn.utils._param_validation import Interval, StrOptions
from sklearn.utils.validation import check_is_fitted

from ..inputs.collections import as_collection, check_members
from ..inputs.facts import facts_in_fit, facts_of
from ..inputs.recorded import SAME_RATE
from ..inputs.resampling import as_frame_rates
from ..inputs.tables import as_pandas
from ..inputs.types import Labels, TrialLike, TrialsLike, ValuesLike
from ..inputs.validation import SequenceLevelMixin, check_input
from ..inputs.wording import counted, within
from ..matching.counting import first_largest, whole
from ..matching.trellis import Trellis
from ..matching.warps import at_times, even_slices
from ..model.action_model import ActionModel
from ..synchronizers.dense import DenseSynchronizer
from ..utils.groups import encode_groups
from ..utils.parallel import Progress
from ..utils.parameters import FRAME_RATE, validated_function
from ..utils.pipelines import (
    find_synchronizer,
    flat_steps,
    route_to_synchronizer,
    union_transformers,
)
from .cutting import as_takes, cut_takes
from .windows import WindowDissimilarity, example_indices

# The clock of a pattern that is given as an array has at most so many frames.
_CLOCK = 100
# Hits may be shorter and longer than the training trials by this ratio; the larger one is for
# a single pattern.
_MARGIN, _MARGIN_OF_ONE = 1.1, 1.5
# Rates that differ by a larger ratio are mistakes.
_MOST = 100
# The shortest window, in frames.
_SHORTEST = 3
# The first step by which ends of a hit are moved, as a share of its length; later steps are halved.
_FIRST_MOVE = 1 / 8
_MOVES = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)])
# A window of more than so many times the dissimilarity of the threshold is not refined.
_HOPELESS = 2
# Dissimilarities that differ by less are equal: of exact copies they are the roots of rounding.
_EQUAL = 1e-6
# Scores are above it, whatever the dissimilarity.
_NO_SCORE = 1e-300


@validated_function(
    {
        "threshold": [Interval(Real, 0, 1, closed="both"), StrOptions({"auto"}), None],
        "coverage": [Interval(Real, 0, 1, closed="neither")],
        "pattern_rate": [FRAME_RATE, None],
        "verbose": ["verbose"],
    }
)
def find_trials(
    pattern: BaseEstimator | TrialLike,
    X: TrialsLike,
    *,
    threshold: float | Literal["auto"] | None = "auto",
    coverage: float = 0.8,
    groups: Labels | None = None,
    frame_rate: float | ValuesLike | None = None,
    pattern_rate: float | None = None,
    verbose: int = 0,
) -> tuple[list[Any], pd.DataFrame]:
    """Find an action in long takes, and cut its trials out of them.

    1. The pattern is matched to overlapping portions of a take, at several time scales. Both ends
       of a path are free, so the match proposes a window: a start and a stop.
    2. Each window is compared with the training trials after linear normalisation: by its
       dissimilarity to the two nearest ones in pose and in the synchronizer's features, and by
       its length and energy. The score is ``exp(-dissimilarity)``: 1 is equal, 0.37 as
       dissimilar as standing still. Windows have from 10 % fewer to 10 % more frames than the
       training trials; those of a single pattern from 2/3 to 3/2 of its length.
    3. The ends of the best window are moved to where its score is best; then those of the best
       window that does not overlap it, and so on. Windows that reach the threshold are hits.

    Time grows with the length of a take, memory does not: an hour at 30 frames a second takes a few
    seconds. It can be interrupted at any time.

    Parameters
    ----------
    pattern : fitted synchronizer, Pipeline, ActionDetector, or array (n_frames, n_features)
        The action to find. A pipeline ends in a synchronizer or in what follows one; its first step
        takes the takes. An array is a single trial, which carries no information about the
        differences between trials.
    X : array (n_frames, n_features), list of such arrays, or other collection
        One take, or several. A take of a single feature may be one-dimensional. Of another frame
        rate than the training trials they have as many more or fewer frames a trial. Tables know
        their rate, by ``attrs["frame_rate"]`` or an index in seconds; for others give
        ``frame_rate`` and ``pattern_rate``. If neither is known, both are taken to have the same.
    threshold : "auto", float or None, default="auto"
        The lowest score of a hit. ``"auto"``: learnt from the training trials, each compared
        with those of other groups, but not below what random movements among their poses rarely
        exceed; at least 0.50 and at most 0.90. In a take it is higher where many windows reach it.
        For an array 0.61, half as dissimilar as standing still. None: all windows that are better
        than those they overlap.
    coverage : float, default=0.8
        Share of trials of new subjects, cut out by hand, that the learnt threshold accepts,
        unless random movements score as high; less where many windows of a take do.
    groups : array-like, default=None
        Group of each training trial, such as its subject. By default the groups that an
        `ActionModel` in the pipeline was fitted with; it keeps those of at most 64 trials.
    frame_rate : float, or array-like of shape (n_takes,), default=None
        Frames a second of the takes. By default what tables tell.
    pattern_rate : float, default=None
        Frames a second of the training trials, or of an array. By default what tables told
        the synchronizer in ``fit``.
    verbose : int, default=0
        Above 0 prints the progress, take by take.

    Returns
    -------
    trials : list of array, or of DataFrame, (n_frames_i, n_features)
        Cut out of the takes, take by take, in order of time. DataFrames keep columns, and are
        labelled by the label of their take and their number in it.
    locations : DataFrame
        One row a trial: ``take``, its index or label; ``start`` and ``stop``, frames of the
        take as it was given, ``stop`` excluded; ``score``; ``threshold``, the given one, or that of
        its take.

    Raises
    ------
    ValueError
        If the takes break the input contract or have other features than the training set, or a
        parameter is invalid.

    Warns
    -----
    UserWarning
        If one frame rate only is known.

    See Also
    --------
    ActionDetector : Whether a trial that is cut out already is the action.
    sklearn_motionsync.display.SearchDisplay : Draws hits along the takes.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync.takes import find_trials
    >>> t = np.linspace(0, 1, 40)
    >>> wave = np.column_stack([np.sin(6 * t), np.sin(9 * t)])
    >>> take = np.zeros((300, 2))
    >>> take[50:90], take[200:250] = wave, np.column_stack(
    ...     [np.interp(np.linspace(0, 1, 50), t, x) for x in wave.T])
    >>> trials, locations = find_trials(wave, take)
    >>> locations[["take", "start", "stop"]].to_numpy().tolist()
    [[0, 50, 90], [0, 200, 250]]
    """
    X = as_takes(X, univariate=True)
    checker = type("find_trials", (SequenceLevelMixin, BaseEstimator), {})()
    checked = check_input(checker, X, reset=True, level="sequence", facts=())
    paces = _paces_of(pattern, checked, frame_rate, pattern_rate)
    with warnings.catch_warnings():
        # Windows are as long as the frame rate of their take makes them.
        warnings.filterwarnings("ignore", ".* frames a second, and", UserWarning)
        synchronizer, takes, codes = _reach(pattern, X, groups)
    _check_lengths(checked, takes, checked.called)
    dissimilarity = WindowDissimilarity(synchronizer, codes)
    propose = Proposer(synchronizer)
    with Progress(checker, verbose) as progress:
        hits = _search_takes(takes, paces, propose, dissimilarity, threshold, coverage, progress)
    rows = []
    for i, (hits_of_take, level) in enumerate(hits):
        best = [hit[:3] for hit in hits_of_take if threshold is None or hit.score >= level]
        rows += [(i, *hit, level) for hit in best]
    types = {"take": int, "start": int, "stop": int, "score": float, "threshold": float}
    table = pd.DataFrame(rows, columns=list(types)).astype(types)
    return cut_takes(X, checked, table)


def _check_lengths(before, after, called):
    """Refuse takes whose number of frames is changed before they reach the synchronizer."""
    for i, (take, reached) in enumerate(zip(before, after, strict=True)):
        if len(take) != len(reached):
            raise ValueError(
                f"{called(i)} has {len(take)} frames, and {len(reached)} after the steps before "
                "the synchronizer, so frames of hits are unknown. Resample the takes first."
            )


def _search_takes(takes, paces, propose, dissimilarity, threshold, coverage, progress):
    """The hits of every take, and the threshold that holds for it.

    A pace is the number of frames of a take in a frame of the pattern.
    """
    fixed = None if threshold is None or threshold == "auto" else max(threshold, _NO_SCORE)
    limit = dissimilarity.threshold(coverage) if fixed is None else -np.log(fixed)
    hopeless = float(np.exp(-_HOPELESS * limit))
    step, out = progress.stage("searching", len(takes)), []
    for take, pace in zip(takes, paces, strict=True):
        take = take.astype(np.float64, copy=False)
        lowest = 0.0 if threshold is None else hopeless
        limits, at_pace = propose.limits(pace), partial(dissimilarity, pace=pace)
        hits = search_windows(take, propose(take, *limits), at_pace, *limits, lowest)
        level = threshold
        if fixed is None:
            u = -np.log([hit.score for hit in hits if hit.proposed >= hopeless])
            level = float(np.exp(-dissimilarity.threshold_of_take(limit, u, len(take) / pace)))
        out.append((hits, level))
        step()
    return out


def _paces_of(pattern, checked, frame_rate, pattern_rate):
    """The number of frames of each take in a frame of the training set."""
    rates = [facts.get("frame_rate") for facts in checked.facts] or [None] * len(checked)
    if frame_rate is not None:
        n = len(checked)
        rates = np.broadcast_to(as_frame_rates(frame_rate, n).ravel(), n).tolist()
    rate_of_pattern = _frame_rate_of(pattern) if pattern_rate is None else float(pattern_rate)
    unsure = [i for i, rate in enumerate(rates) if (rate is None) != (rate_of_pattern is None)]
    if unsure:
        rate = rates[unsure[0]]
        first, second = ("The pattern", checked.called(unsure[0]))[
            :: 1 if rate_of_pattern is None else -1
        ]
        warnings.warn(
            f"{first} has no known frame rate, {within(second)} has "
            f"{rate_of_pattern or rate:g} frames a second: both are taken to have the same. "
            f"Give the other one, {'pattern_rate' if rate_of_pattern is None else 'frame_rate'}=.",
            UserWarning,
            stacklevel=4,
        )
    paces = [
        1.0 if rate_of_pattern is None or rate is None else rate / rate_of_pattern for rate in rates
    ]
    paces = [1.0 if abs(pace - 1) <= SAME_RATE else pace for pace in paces]
    for i, pace in enumerate(paces):
        if not 1 / _MOST <= pace <= _MOST:
            raise ValueError(
                f"{checked.called(i)} has {rates[i]:g} frames a second, the pattern "
                f"{rate_of_pattern:g}: one is more than {_MOST} times the other. Correct the wrong "
                "one, attrs['frame_rate'], an index in seconds, frame_rate or pattern_rate."
            )
    return paces


def _frame_rate_of(pattern):
    """The frame rate of the training set; None if it is unknown, or if there are several."""
    if not hasattr(pattern, "fit"):
        return facts_of(as_pandas(pattern)).get("frame_rate")
    steps = [each for step in flat_steps(pattern) for each in union_transformers(step)]
    steps.append(find_synchronizer(pattern)[1])
    rates_of_steps = (facts_in_fit(step).get("frame_rate", ()) for step in steps)
    rates = next(filter(None, rates_of_steps), ())
    return rates[0] if len(rates) == 1 else None


class Hit(NamedTuple):
    """A window of a take whose ends were moved to where its score is best.

    ``proposed`` is the score before its ends were moved.
    """

    start: int
    stop: int
    score: float
    proposed: float


def search_windows(take, windows, dissimilarity, shortest, longest, lowest):
    """A `Hit` of each of windows (n, 2) that overlaps no better one, in order of time.

    Its ends are moved, by smaller and smaller steps, to the best score. Windows whose score is
    below ``lowest`` are not refined. One that is refined excludes those it overlaps, whatever the
    threshold is, so that this selects among hits and changes none.
    """
    scores = np.exp(-dissimilarity(take, windows))
    # Equally good ones in their order.
    levels = whole(-np.log(np.maximum(scores, _NO_SCORE)) / _EQUAL)
    refined = []
    for k in np.argsort(levels, kind="stable"):
        if scores[k] < lowest:
            continue
        window, score = windows[k], scores[k]
        # The free interval about the window.
        at = bisect(refined, tuple(window))
        first = refined[at - 1][1] if at else 0
        last = refined[at][0] if at < len(refined) else len(take)
        if not (first <= window[0] and window[1] <= last):
            continue
        move = max(1, int(_FIRST_MOVE * (window[1] - window[0])))
        while move:
            candidates = window + move * _MOVES
            sizes = candidates[:, 1] - candidates[:, 0]
            inside = (candidates[:, 0] >= first) & (candidates[:, 1] <= last)
            candidates = candidates[inside & (sizes >= shortest) & (sizes <= longest)]
            moved = np.exp(-dissimilarity(take, candidates))
            if moved.max(initial=0) > score * (1 + _EQUAL):
                window, score = candidates[first_largest(moved, _EQUAL * score)], moved.max()
            else:
                move //= 2
        insort(refined, Hit(int(window[0]), int(window[1]), float(score), float(scores[k])))
    return refined


def _reach(pattern, X, groups):
    """The synchronizer, the takes as they reach it, and the groups of its training set."""
    if not hasattr(pattern, "fit"):
        if groups is not None:
            raise ValueError("groups are those of training trials; an array has none.")
        pattern = _check_pattern(pattern)
        synchronizer = DenseSynchronizer(min(len(pattern[0]), _CLOCK), pattern=0).fit(pattern)
        return synchronizer, synchronizer.check_trials(X), None
    _, synchronizer = find_synchronizer(pattern)
    check_is_fitted(synchronizer)
    if synchronizer.examples_.shape[2] != synchronizer.n_features_in_:
        raise ValueError(
            f"{type(synchronizer).__name__} was fitted on the rows of a 2-D array, all of one "
            "length, but hits differ in length: fit it on [row[:, np.newaxis] for row in X]."
        )
    reached = route_to_synchronizer(pattern, X, {}, "find_trials")
    return reached.synchronizer, reached.trials, _training_groups(pattern, reached, groups)


def _check_pattern(pattern):
    """One trial, a DataFrame or an array (n_frames, n_features), as a collection of one."""
    pattern = as_takes(pattern, univariate=True)
    trials = check_members(as_collection(pattern))
    if len(trials) > 1 or len(trials[0]) < _SHORTEST:
        raise ValueError(
            f"The pattern has {counted(len(trials), 'trial')}, the first of {len(trials[0])} "
            f"frames: give one trial, (n_frames, n_features), of at least {_SHORTEST} frames, or "
            "a synchronizer that was fitted to several."
        )
    return pattern


def _training_groups(pattern, reached, groups):
    """Codes of the groups of the training trials that the synchronizer keeps, or None."""
    synchronizer = reached.synchronizer
    count = len(synchronizer.lengths_)
    if groups is not None:
        codes, _ = encode_groups(groups, count, at_least=min(count, 2))
        return codes[example_indices(synchronizer)]
    if count < 2:
        return None
    models = [step for step in flat_steps(pattern) if isinstance(step, ActionModel)]
    if not models or not hasattr(models[0], "groups_"):
        return None
    model_groups, n_seen = models[0].groups_, models[0].n_samples_seen_
    # The model may have learnt from other trials since, by partial_fit.
    if len(model_groups) == n_seen == count:
        return model_groups
    if len(np.unique(model_groups)) < len(model_groups):
        warnings.warn(
            f"The model keeps the groups of {len(model_groups)} of "
            f"{counted(n_seen, 'trial')}, the synchronizer was fitted on {count}: their "
            "groups are unknown, each counts as its own, and the threshold will be too high. Give "
            "groups, one for each trial.",
            UserWarning,
            stacklevel=5,
        )
    return None


# -- proposals: windows of a take that may hold the action, by matching with free ends ------

# Frames of the clock of proposals, which need only be rough.
_CLOCK_FRAMES = 50
# Free offset of both ends, as a share of the clock; also the distance between portions.
_SHARE = 0.2
# Ratio between time scales: free ends cover those between.
_RATIO = 1.6
_SMOOTHNESS, _MAX_RATE = 0.003, 3
# Portions matched at a time, which bounds the memory.
_PROPOSAL_BATCH = 64


class Proposer:
    """Proposes windows of takes that may hold the pattern of a synchronizer."""

    def __init__(self, synchronizer):
        n_frames = min(synchronizer.n_frames_, _CLOCK_FRAMES)
        features = synchronizer.features_
        pattern = synchronizer.pattern_.astype(np.float64)
        self.base = features(features.positions([pattern], n_frames))
        mu = _SMOOTHNESS * float(np.square(self.base).sum()) / n_frames
        self.trellis = Trellis.on_clock(
            features.cost, n_frames, mu, max_offset=_SHARE, max_rate=_MAX_RATE, free=True
        )
        # The filter of velocities is as wide in a portion as in the pattern.
        share = (n_frames - 1) / (n_frames - 1 + 2 * self.trellis.width)
        self.features = features._replace(velocity_smoothing=share * features.velocity_smoothing)
        self._lengths = synchronizer.lengths_

    def limits(self, pace):
        """The least and the largest number of frames of hits in a take of this pace."""
        margin = _MARGIN if len(self._lengths) > 1 else _MARGIN_OF_ONE
        shortest = max(_SHORTEST, whole(self._lengths.min() / margin * pace, "down"))
        return shortest, max(shortest, whole(self._lengths.max() * margin * pace, "up"))

    def __call__(self, take, shortest, longest):
        """Distinct windows of a take (n_frames, n_features): (n_windows, 2) of start and stop."""
        # Typical numbers of frames at the time scales.
        lengths = scales(shortest, longest)
        lengths = lengths[lengths <= len(take)]
        windows_of_scales = [self.at_scale(take, int(length)) for length in lengths]
        windows = np.concatenate([np.empty((0, 2), dtype=np.intp), *windows_of_scales])
        sizes = windows[:, 1] - windows[:, 0]
        fits = (shortest <= sizes) & (sizes <= longest)
        return np.unique(windows[fits], axis=0)

    def at_scale(self, take, length):
        """The best window of every portion, for a pattern of about this number of frames."""
        n_frames, width = self.base.shape[1], self.trellis.width
        pace = (length - 1) / (n_frames - 1)
        count = whole((len(take) - length) / max(width * pace, 1.0), "up") + 1
        starts = np.linspace(0, len(take) - length, count)
        clock = np.arange(-width, n_frames + width) * pace
        windows = []
        for rows in even_slices(len(starts), _PROPOSAL_BATCH):
            portions = at_times(take, starts[rows, np.newaxis] + clock)
            moving = self.features(self.features.unit(portions))
            paths = self.trellis.paths(self.base, moving)[0]
            first, last = starts[rows] + paths[:, 0] * pace, starts[rows] + length - 1
            window = np.stack([first, last + paths[:, -1] * pace + 1], axis=1)
            windows.append(np.clip(whole(window), 0, len(take)))
        return np.concatenate(windows)


def scales(shortest, longest):
    """Numbers of frames from the shortest to the longest, by a constant ratio of at most 1.6."""
    count = whole(np.log(longest / shortest) / np.log(_RATIO), "up") + 1
    return np.unique(whole(np.geomspace(shortest, longest, count)))
