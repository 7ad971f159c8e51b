"""The steps 2 to 6 of the fit of a `DenseSynchronizer`: each a function of values.

Step 1, linear normalisation, is `training.put_on_clock`, which all synchronizers share.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from sklearn.utils import Bunch, check_random_state

from ..matching.anchors import add_ramps, first_meeting
from ..matching.consensus import choose_exemplars
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
from ..matching.warps import sample
from .evidence import weigh_evidence
from .gaps import known_whole
from .portions import refuse_long_paths, sums_in_portions
from .training import pattern_of, warn_of_one_feature

__all__ = [
    "MOST_LEARNT",
    "choose_pattern",
    "finish_warps",
    "learn_metric",
    "let_exemplars_vote",
    "match_pairs",
]

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
    refuse_long_paths(settings, clock.n_frames)
    smoothing = FINE_SMOOTHING if learns else SMOOTHING
    plain = Features(cost, smoothing, clock.unit, anchors=clock.anchors, weighs=clock.weighs)
    learnt = None
    if learns and n_trials >= _FEWEST:
        count = min(n_trials, MOST_LEARNT)
        rows = np.unique(np.round(np.linspace(0, n_trials - 1, count)).astype(np.intp))
        learning = PathSettings(smoothness, min(narrow, _LEARNING_OFFSET), max_rate)
        learnt = learn_features(plain, clock.positions[rows], learning, consensus, FINE_SMOOTHING)
    if learnt is None:
        plain = plain.replace(velocity_smoothing=SMOOTHING)
        settings = PathSettings(smoothness, narrow, max_rate)
        return MetricStep(plain, settings, None, weigh_evidence(None, 0))
    described = Bunch(share=learnt.share, energy=learnt.energy, performances=rows)
    evidence = weigh_evidence(learnt.evidence, len(rows))
    return MetricStep(learnt.features, settings, described, evidence)


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
    trials : Performances
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
            searched, compared, matcher = search(searched.replace(single=False))
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


# -- step 4: the pattern ------------------------------------------------------------------------


def choose_pattern(training, pattern, pairs):
    """Choose the pattern: the trial with the smallest sum of distances, or the one that is given.

    Parameters
    ----------
    training : TrainingSet
    pattern : "median", int or ndarray
        As checked.
    pairs : PairsStep

    Returns
    -------
    Pattern
    """
    return pattern_of(training, pattern, pairs.median if isinstance(pattern, str) else None)


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
        times = warper.exemplar_warps()
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
