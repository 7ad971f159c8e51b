"""The steps 2, 3, 5 and 6 of the fit of a `DenseSynchronizer`: each a function of values.

The steps 1 and 4, linear normalisation and the pattern, are `training.put_on_clock` and
`training.pattern_of`, which all synchronizers share. Matches of many trials are shared out among
jobs in portions of constant sizes, so that no result depends on the number of jobs.
"""

import warnings
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from sklearn.utils import Bunch, check_random_state

from ..inputs.wording import counted
from ..matching.anchors import add_ramps, first_meeting
from ..matching.consensus import choose_exemplars, smooth_warps
from ..matching.costs import COSTS
from ..matching.filters import FINE_SMOOTHING, SMOOTHING, noise_width, white_noise
from ..matching.gaps import add_weights
from ..matching.matcher import (
    Features,
    Matcher,
    PathSettings,
    Warper,
    features_energy,
    learn_features,
)
from ..matching.median import Median, draw_references, median_of_sums, rounding_bound
from ..matching.refinement import SAME_SOURCE, Refiner, unexplained_variance
from ..matching.sharpening import Sharpener
from ..matching.trellis import TILE_BASES
from ..matching.warps import even_slices, sample
from ..utils.parallel import one_blas_thread, run
from .training import known_whole, warn_of_one_feature

# max_offset="auto". A wide band leads paths astray without a learnt metric; with one, gestures
# need it: docs/design.md.
_NARROW, _WIDE = 0.25, 0.4
# The largest offset while the metric is learnt: docs/design.md.
_LEARNING_OFFSET = 0.2
# Numbers of trials a metric is learnt from. Two have no route but the direct one: their differences
# cannot be told from a wrong path.
_FEWEST, MOST_LEARNT = 3, 20
# Largest rounding, as a share of the smallest global distance, that tells distances apart.
_LARGEST_ROUNDING = 0.01
# Most steps of a path at a frame, all offsets together.
_MOST_STEPS = 1e9


# -- step 2: the metric ---------------------------------------------------------------------


class MetricStep(NamedTuple):
    """The features that are compared, and what is known of their metric.

    Attributes
    ----------
    features : Features
    settings : PathSettings
    metric : Bunch or None
        As ``metric_`` of `DenseSynchronizer`, with indices in the training set.
    evidence : Bunch
        As ``evidence_``.
    """

    features: Features
    settings: PathSettings
    metric: Bunch | None
    evidence: Bunch


def learn_metric(clock, *, cost, metric, consensus, smoothness, max_offset, max_rate):
    """Learn how features are weighted, from evenly spaced trials if there are many.

    Parameters
    ----------
    clock : CommonClock
    cost, metric, consensus, smoothness, max_offset, max_rate : as of `DenseSynchronizer`

    Returns
    -------
    MetricStep
    """
    n_trials = len(clock.positions)
    learns = metric == "learned" and cost == "velocity" and consensus > 0
    narrow, wide = (_NARROW, _WIDE) if max_offset == "auto" else (max_offset, max_offset)
    settings = PathSettings(smoothness, wide if learns else narrow, max_rate)
    steps = min(max_rate, clock.n_frames - 1) + 1
    steps *= 2 * settings.max_offset * clock.n_frames + 1
    if steps > _MOST_STEPS:
        raise ValueError(
            f"max_rate = {max_rate} and max_offset = {settings.max_offset} on {clock.n_frames} "
            f"frames ask for {steps:.0e} steps of a path at every frame of every pair; "
            f"{_MOST_STEPS:.0e} is the limit. Use a smaller rate or offset, or fewer frames."
        )
    smoothing = FINE_SMOOTHING if learns else SMOOTHING
    plain = Features(cost, smoothing, clock.unit, anchors=clock.anchors, weighs=clock.weighs)
    learnt = None
    if learns and n_trials >= _FEWEST:
        count = min(n_trials, MOST_LEARNT)
        rows = np.unique(np.round(np.linspace(0, n_trials - 1, count)).astype(np.intp))
        learning = PathSettings(smoothness, min(narrow, _LEARNING_OFFSET), max_rate)
        learnt = learn_features(plain, clock.positions[rows], learning, consensus, FINE_SMOOTHING)
    if learnt is None:
        plain = plain._replace(velocity_smoothing=SMOOTHING)
        settings = PathSettings(smoothness, narrow, max_rate)
        return MetricStep(plain, settings, None, weigh_evidence(None, 0))
    features, share, energy, evidence = learnt
    described = Bunch(share=share, energy=energy, trials=rows)
    return MetricStep(features, settings, described, weigh_evidence(evidence, len(rows)))


# -- step 3: all pairs are matched ------------------------------------------------------------


class PairsStep(NamedTuple):
    """Distances of all pairs, and what matches any two trials.

    Attributes
    ----------
    matcher : Matcher
    median : Median or None
        None if no distances were asked for.
    """

    matcher: Matcher
    median: Median | None


def match_pairs(clock, step, wanted, *, trials, names, random_state, n_jobs, progress):
    """Match all pairs of a training set, or each trial with at most 100 drawn ones.

    With a learnt metric distances are from fewer frames and in single precision, if that is much
    faster, and scaled to all frames.

    Parameters
    ----------
    clock : CommonClock
    step : MetricStep
    wanted : bool
        Whether distances are wanted; else only the matcher is.
    trials : Trials
        The same training set, for a warning if a single feature has nearly all of the energy.
    names : sequence or None
        Of the features.
    random_state, n_jobs : as of a synchronizer
    progress : Progress

    Returns
    -------
    PairsStep
    """
    features, settings, positions = step.features, step.settings, clock.positions
    references = draw_references(len(positions), check_random_state(random_state))

    def search(searched):
        compared = searched(positions[references])
        return searched, compared, Matcher.of(searched, compared, settings)

    def sums_and_rounding(searched, compared, matcher):
        sums = sums_in_portions(
            matcher, positions, references, compared, n_jobs=n_jobs, progress=progress
        )
        return sums, rounding_bound(compared.dtype, features_energy(searched, compared))

    searched, compared, matcher = search(features.for_search(clock.n_frames))
    shares = _energy_shares(searched, compared) if step.metric is None else step.metric.energy
    warn_of_one_feature(shares, trials, names)
    median = None
    if wanted:
        sums, rounding = sums_and_rounding(searched, compared, matcher)
        is_rounded = searched.single and positions.dtype != compared.dtype
        if is_rounded and rounding > _LARGEST_ROUNDING * sums.min():
            # Nearly equal trials: single precision does not tell them apart.
            searched, compared, matcher = search(searched._replace(single=False))
            sums, rounding = sums_and_rounding(searched, compared, matcher)
        median = median_of_sums(sums, references, rounding)
    if searched is not features:
        matcher = matcher.on_clock(features, clock.n_frames, settings)
    if median is not None:
        # Sums over fewer frames, scaled to all, in the unit of the data.
        scale = clock.n_frames / (searched.frames or clock.n_frames)
        distances = features.back(median.distances) * scale
        median = Median(median.trial, distances)
    return PairsStep(matcher, median)


def _energy_shares(features, compared):
    """The share of every feature in the energy that is compared without a metric."""
    plain = features.plain(compared)
    energy = np.einsum("npk,npk->k", plain, plain, dtype=np.float64)
    if not COSTS[features.cost].of_velocity:
        # A common offset changes no distance.
        total = plain.sum(axis=(0, 1), dtype=np.float64)
        energy = np.maximum(energy - total**2 / plain[:, :, 0].size, 0)
    return energy / (energy.sum() or 1.0)


# -- step 5: exemplars vote -----------------------------------------------------------------------


class VoteStep(NamedTuple):
    """The exemplars, and the warper by way of them.

    Attributes
    ----------
    exemplars : ndarray of int
        Indices in the training set.
    warper : Warper
    keyframes : ndarray, shape (n_keyframes,), or None
        Of the pattern, as shares of it.
    """

    exemplars: np.ndarray
    warper: Warper
    keyframes: np.ndarray | None


def let_exemplars_vote(clock, training, pattern, pairs, consensus):
    """Match the pattern with the exemplars, by way of which trials are warped.

    If only some trials have key-frames, they are the exemplars. Key-frames of the pattern that are
    not known are the median of where those of other trials meet it.

    Parameters
    ----------
    clock : CommonClock
    training : TrainingSet
    pattern : Pattern
    pairs : PairsStep
    consensus : int
        Number of exemplars; 0 for direct paths.

    Returns
    -------
    VoteStep
    """
    exemplars = _choose_exemplars(training, pattern, pairs.median, consensus)
    smoothing = FINE_SMOOTHING if consensus > 0 else None
    source = pattern.array
    if clock.weighs:
        weights = np.ones(len(source))
        if pattern.trial is not None:
            weights = training.trials.weights[pattern.trial]
        source = add_weights([source], [weights])[0]

    def warper_to(array):
        arrays = [array, *(clock.arrays[k] for k in exemplars)]
        # In double precision, as all trials that are warped.
        arrays = [x.astype(np.float64, copy=False) for x in arrays]
        positions = pairs.matcher.features.positions(arrays, clock.n_frames)
        return Warper.to_pattern(pairs.matcher, positions, smoothing)

    if training.keyframes is None:
        return VoteStep(exemplars, warper_to(source), None)
    keyframes = np.full(training.keyframes.shape[1], np.nan)
    if pattern.trial is not None:
        keyframes = training.keyframes[pattern.trial]
    unknown = np.isnan(keyframes)
    if unknown.any():
        # Of every one the first trials that know it.
        known = np.isfinite(training.keyframes[:, unknown])
        rows = np.flatnonzero((known & (known.cumsum(axis=0) <= MOST_LEARNT)).any(axis=1))
        warper = warper_to(add_ramps([source], keyframes[np.newaxis])[0])
        _, times = warper.warps(warper.positions([clock.arrays[k] for k in rows]))
        last = clock.n_frames - 1
        met = first_meeting(times, training.keyframes[rows] * last) / last
        learnt = np.where(unknown, np.nanmedian(met, axis=0), keyframes)
        keyframes = np.maximum.accumulate(learnt)
    warper = warper_to(add_ramps([source], keyframes[np.newaxis])[0])
    return VoteStep(exemplars, warper, keyframes)


def _choose_exemplars(training, pattern, median, consensus):
    """Indices of the exemplars, in the training set: two with key-frames are enough."""
    n_trials = len(training.trials)
    if consensus == 0:
        return np.empty(0, dtype=np.intp)
    # If there are no distances, all are exemplars.
    distances = np.zeros(n_trials) if median is None else median.distances
    candidates = np.arange(n_trials)
    if training.keyframes is not None:
        has_some = np.isfinite(training.keyframes).any(axis=1)
        if has_some[candidates != pattern.trial].sum() >= 2:
            candidates = np.flatnonzero(has_some)
    candidates = candidates[candidates != pattern.trial]
    return candidates[choose_exemplars(distances[candidates], consensus)]


# -- step 6: warps are sharpened, or refined ---------------------------------------------------


class FinishStep(NamedTuple):
    """The warper that finishes warps, and why it does so.

    Attributes
    ----------
    warper : Warper
    unexplained : float
        Share of the variance of the pattern that matching and white noise leave unexplained.
    refines : bool
    """

    warper: Warper
    unexplained: float
    refines: bool


def finish_warps(clock, training, pattern, vote, refine):
    """Sharpen warps of people, and refine those of copies of one source.

    Parameters
    ----------
    clock : CommonClock
    training : TrainingSet
    pattern : Pattern
    vote : VoteStep
    refine : "auto" or bool
        As of `DenseSynchronizer`.

    Returns
    -------
    FinishStep
    """
    warper, unexplained = vote.warper, np.nan
    # Poses would take away again what soft key-frames draw.
    draws = clock.anchors is not None and clock.anchors.std > 0
    if refine == "auto" and not draws:
        unexplained = _unexplained(clock, training, pattern, vote)
    refines = bool(unexplained < SAME_SOURCE if refine == "auto" else refine)
    features = warper.matcher.features
    exemplars = clock.poses[vote.exemplars].astype(np.float64, copy=False)
    finish = None
    if refines:
        poses = np.concatenate([warper.pattern[np.newaxis], exemplars])
        # Poses need three quarters of the smoothing that velocities do: docs/design.md.
        finish = Refiner.of(warper.pattern, 0.75 * noise_width(poses))
    elif features.metric is not None and len(exemplars):
        reach = warper.matcher.trellis.reach
        times = smooth_warps(warper.to_exemplars, reach, warper.smoothing)
        finish = Sharpener.learn(features.metric, warper.pattern, exemplars, times)
    return FinishStep(replace(warper, finish=finish), unexplained, refines)


def _unexplained(clock, training, pattern, vote):
    """The share of the variance that matching leaves, from evenly spaced trials without gaps.

    NaN if there are none but the pattern, or no vote.
    """
    whole = known_whole(training.trials, pattern.trial)
    if not len(whole) or vote.warper.smoothing is None:
        return np.nan
    evenly = np.linspace(0, len(whole) - 1, min(len(whole), MOST_LEARNT))
    rows = whole[np.round(evenly).astype(np.intp)]
    warper = vote.warper
    # Direct paths tell as much as voted ones.
    times = warper.direct_warps(warper.positions([clock.arrays[k] for k in rows]))
    trials = [training.trials[k].astype(np.float64) for k in rows]
    aligned = clock.unit(sample(trials, times, clock.n_frames))
    noise = white_noise([pattern.array, *trials]) / clock.unit.size**2
    return unexplained_variance(warper.pattern, aligned, noise)


# -- whether the warps of a training set agree with each other ------------------------------

# Warps explain little if matching leaves more of the differences, and the inconsistency is larger,
# too. So many trials are enough to tell. Measured in docs/design.md.
_REMAINING, _INCONSISTENT, _ENOUGH = 0.7, 0.4, 10


class SynchronizationWarning(UserWarning):
    """The trials do not support their warps: these explain little, and contradict each other.

    See ``evidence_`` of `DenseSynchronizer`.

    Examples
    --------
    >>> import warnings
    >>> import numpy as np
    >>> from sklearn_motionsync import DenseSynchronizer, SynchronizationWarning
    >>> noise = np.random.default_rng(0).standard_normal((12, 60, 3))
    >>> with warnings.catch_warnings(record=True) as caught:
    ...     warnings.simplefilter("always", SynchronizationWarning)
    ...     sync = DenseSynchronizer().fit(noise)
    >>> [each.category.__name__ for each in caught]
    ['SynchronizationWarning']
    >>> sync.evidence_.weak
    True
    """


def weigh_evidence(evidence, n_trials):
    """Whether warps explain little, by the evidence; warns if they do.

    Parameters
    ----------
    evidence : Evidence or None
        Of the training set. None if there is no metric.
    n_trials : int
        The number of trials it is from.

    Returns
    -------
    Bunch
        ``remaining``, ``inconsistency``, ``weak``.
    """
    if evidence is None:
        return Bunch(remaining=np.nan, inconsistency=np.nan, weak=False)
    remaining, inconsistency = evidence.remaining, evidence.inconsistency
    weak = n_trials >= _ENOUGH and remaining > _REMAINING and inconsistency > _INCONSISTENT
    if weak:
        warnings.warn(
            f"Matching leaves {remaining:.0%} of the differences between these trials, and "
            "by way of a third trial a moment lands "
            f"{inconsistency:.2f} times a typical offset away (evidence_; {_REMAINING:.0%} and "
            f"{_INCONSISTENT} are the limits): the warps explain little. Compare them with "
            "LinearSynchronizer, and check that all show one movement, cut at the same moments. "
            "Less noise helps, and so do features that show the movement.",
            SynchronizationWarning,
            stacklevel=2,
        )
    return Bunch(remaining=remaining, inconsistency=inconsistency, weak=bool(weak))


# -- matches of many trials in portions, shared out among jobs ----------------------------

# Sizes of a portion: worth sending to another process, and small enough to share out.
PORTION_CELLS = 50_000_000
_PORTION_TRIALS = 256


def sums_in_portions(matcher, positions, references, compared, *, n_jobs, progress):
    """Sums of the distances of every trial, as the base, to references: (n_trials,).

    Parameters
    ----------
    matcher : Matcher
    positions : ndarray, shape (n_trials, P, n_columns)
        In the unit.
    references : ndarray of int
        Indices of trials.
    compared : ndarray, shape (n_references, n_frames, n_compared)
        Their features.
    n_jobs : int or None
    progress : Progress
    """
    n_trials, n_references = len(positions), len(references)
    cells = n_references * compared.shape[1] * (2 * matcher.trellis.width + 1)
    size = min(TILE_BASES, max(1, PORTION_CELLS // cells))
    slices = even_slices(n_trials, size)
    name = f"comparing {n_trials} with {counted(n_references, 'trial')}"
    step = progress.stage(name, len(slices))
    common, portions = (matcher, positions, compared), [(rows,) for rows in slices]
    blocks = run(_sums, portions, common=common, n_jobs=n_jobs, prefer="threads", step=step)
    return np.concatenate(list(blocks))


def _sums(matcher, positions, references, rows):
    distances = matcher.trellis.distances(matcher.features(positions[rows]), references)
    return distances.sum(axis=1, dtype=np.float64)


def warp_in_portions(warper, arrays, body_times=None, *, n_jobs, begin, name):
    """Distances and times of trials, on the clock a portion at a time.

    Parameters
    ----------
    warper : Warper
    arrays : sequence of ndarray (n_frames_i, n_columns)
        Workers are sent their own portions only.
    body_times : ndarray, shape (n_trials, P), default=None
        Warps of the whole body, to which the warper of a part couples it.
    n_jobs : int or None
    begin : callable
        ``begin(fits=False)`` gives the `Progress` of a job of several portions.
    name : str
        Of its stage.

    Returns
    -------
    distances : ndarray, shape (n_trials,)
    times : ndarray, shape (n_trials, P)
    """
    arrays = list(arrays)
    cells = len(warper.bases.sequences) * len(warper.pattern)
    cells *= 2 * warper.matcher.trellis.width + 1
    size = min(max(1, PORTION_CELLS // cells), _PORTION_TRIALS)
    if len(arrays) <= size:
        with one_blas_thread():
            return _warps(warper, arrays, body_times)
    slices = even_slices(len(arrays), size)
    portions = [
        (_Arrays(arrays[rows]), None if body_times is None else body_times[rows]) for rows in slices
    ]
    distances, times = np.empty(len(arrays)), np.empty((len(arrays), len(warper.pattern)))
    with begin(fits=False) as progress:
        step = progress.stage(name, len(slices))
        results = run(_warps, portions, common=(warper,), n_jobs=n_jobs, step=step)
        for rows, (lengths, warps) in zip(slices, results, strict=True):
            distances[rows], times[rows] = lengths, warps
    return distances, times


class _Arrays:
    """Arrays that are sent to another process as one, made when they are sent.

    No list: most versions of Dask send the items of a list to different workers.
    """

    def __init__(self, arrays):
        self._arrays = arrays

    def __iter__(self):
        return iter(self._arrays)

    def __sizeof__(self):
        # By which joblib tells what Dask sends to a worker ahead of the call.
        return sum(x.nbytes for x in self)

    def __reduce__(self):
        return _split, (np.concatenate(self._arrays), [len(x) for x in self])


def _split(frames, lengths):
    ends = np.cumsum(lengths)
    return [frames[end - n : end] for end, n in zip(ends, lengths, strict=True)]


def _warps(warper, arrays, body_times):
    positions = warper.positions(arrays)
    if body_times is None:
        return warper.warps(positions)
    return warper.warps(positions, body_times)
