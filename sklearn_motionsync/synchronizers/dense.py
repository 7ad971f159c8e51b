"""DenseSynchronizer: dense matching to the median performance (Eqs. 7-19)."""

from __future__ import annotations

from functools import partial
from numbers import Integral, Real
from typing import Any, Literal, Self

import numpy as np
from sklearn.utils import Bunch, check_random_state
from sklearn.utils._param_validation import Interval, StrOptions
from sklearn.utils.validation import check_is_fitted

from ..inputs.keyframes import Keyframes
from ..inputs.types import (
    Cost,
    Indexed,
    PerformanceLike,
    PerformancesLike,
    RandomState,
    SupportsArray,
    ValuesLike,
)
from ..matching.anchors import KeyframeColumns, add_ramps, first_meeting, pin
from ..matching.costs import COSTS
from ..matching.gaps import add_weights
from ..matching.matcher import (
    LinearWarper,
    Matcher,
    RefinedWarper,
    SharpenedWarper,
    Warper,
)
from ..matching.median import (
    Median,
    estimate_distances,
    exhaustive_median,
    rounding_bound,
    sampled_median,
)
from ..matching.modes import DistanceTable, ModalWarper, Modes
from ..matching.warps import normalise, sample
from ..utils.atomic import atomic_partial_fit, snapshot
from ..utils.threads import on_one_thread
from .anchored import AnchoredSynchronizer
from .balance import warn_of_one_feature
from .evidence import MOST_LEARNT, learn_features
from .gaps import with_confidence
from .intervals import calibrated_factor, intervals_of
from .match import Match
from .portions import FeatureStore, TrainingPortions, warp_in_portions
from .refinement import decide_on_refinement
from .subsamples import subsample, typical_share

__all__ = ["DenseSynchronizer"]

# max_offset="auto". A wide band leads paths astray without a learnt metric; with one, gestures
# need it: docs/design.md.
_NARROW, _WIDE = 0.25, 0.4
# Most performances for an exhaustive search: see docs/scaling.md.
_EXHAUSTIVE = 100


class DenseSynchronizer(AnchoredSynchronizer):
    """Align trials in time: warp all of them to the most typical one.

    That trial is the template, here the *pattern*. Every trial is matched to it by all of its
    signals at once. A warp then brings the same moments together. The time shifts are a result,
    too.

    One signal peaks at frame 40, 50 or 62 of three trials:

    >>> import numpy as np
    >>> from sklearn_motionsync import DenseSynchronizer
    >>> frames = np.arange(101)
    >>> trials = [np.exp(-(((frames[:, None] - peak) / 12) ** 2)) for peak in (40, 50, 62)]
    >>> sync = DenseSynchronizer().fit(trials)
    >>> aligned = sync.transform(trials)
    >>> aligned.shape  # trials, frames, signals
    (3, 101, 1)
    >>> aligned.argmax(axis=1).ravel().tolist()  # where the peaks are now
    [50, 50, 50]
    >>> sync.match(trials).offsets[:, 50].round().tolist()  # how late they were, in frames
    [-10.0, 0.0, 12.0]

    NaN is what was not seen. A trial is matched by what was, and stays NaN elsewhere:

    >>> trials[2][20:30] = np.nan
    >>> int(np.isnan(sync.transform(trials)[2]).sum())
    8

    One of which nothing was seen is refused:

    >>> trials[2][:] = np.nan
    >>> sync.transform(trials)
    Traceback (most recent call last):
        ...
    ValueError: Performance 2 is NaN in every frame and feature: nothing of it was seen, ...

    The defaults suit most data. Four parameters depend on the data or on the question. The others
    were set by measurements, or are for many trials and long jobs.

    Parameters
    ----------
    n_frames : int, default=None
        Frames of every aligned trial. Set it if you want a number of your own, such as 101 for 0 to
        100 %. By default it is the median length of the trials, or the length of a template that is
        given as an array. Time grows with its square.
    pattern : "median", int or array (n_frames, n_features), default="median"
        The template: the most typical trial, a trial by its index, or an array. Set it if new
        trials are to be aligned to a template that you have.
    refine : "auto" or bool, default="auto"
        Whether to place every moment to a fraction of a frame. Set it to True for repeated trials
        of a single source, which differ by noise and gain only. For counts, such as spikes, it
        harms. With ``"auto"`` a test on the trials decides (see ``refinement_``). A single signal,
        or correlated ones, cannot be tested, and without a vote there is no test.
    max_offset : "auto" or float, default="auto"
        Largest time shift, as a share of ``n_frames``, in [0, 1]. Lower it for long trials of
        nearly the same pace: that saves time and memory. ``"auto"`` is 0.4 with a learnt metric,
        and 0.25 without, where larger shifts lead astray.

    Other Parameters
    ----------------
    velocity_smoothing : "auto" or float, default="auto"
        Standard deviation of the Gaussian that smooths velocities, as a share of the trial. So it
        does not depend on the frame rate. Beyond its ends a trial is continued by its point
        reflection. ``"auto"`` is 0.02 with a learnt metric, which gives noise less weight, and 0.03
        without. Velocities that sharpen warps then have 0.01 to 0.04, as their noise asks for.
    sharpen : bool, default=True
        Whether a last local match places the moments of every warp, by velocities as sharp as their
        noise allows. It counts as far as trials agree (see ``sharpening_``). It needs a learnt
        metric, and leaves refined warps alone.
    metric : "learned" or None, default="learned"
        How signals are weighted by the velocity cost. ``"learned"``: compressed velocities, and
        poses less their own mean, count by how well trials agree at the same moment. ``fit`` learns
        this from 3 to 20 trials, and not without a vote (``consensus=0``). Distances are then pure
        numbers. None: velocities, with equal weights. Other costs have no metric.
    consensus : int, default=8
        Number of typical trials that vote on a warp. 0 takes the direct path, as in the paper,
        which is not smoothed, and refined only by ``refine=True``.
    warp_smoothing : float, default=0.02
        Standard deviation of the Gaussian that smooths time shifts after the vote, as a share of
        the trial. What sharpening changes is smoothed half as much. More gives smoother movements,
        and less accurate key moments.
    cost : {"velocity", "elastic", "posture"}, default="velocity"
        What is compared. ``"velocity"``: velocities; at the local rate rho, ``v_n`` with ``(0.8 +
        0.2 rho) v_m``. ``"elastic"``: velocities divided by the square root of the speed. Its
        weights make the distance, of Fisher and Rao, independent of the timing of either trial.
        ``"posture"``: poses, as in the paper.
    smoothness : float, default=0.003
        Weight of changes of pace, a pure number. ``mu`` is ``smoothness`` times the mean squared
        norm of what is compared.
    max_rate : float, default=4
        Largest local rate of a path; 2 in Eq. 13. What follows the match may exceed it.
    subframes : int, default=1
        Positions a frame at which a path may stand. More than 1 serves direct paths
        (``consensus=0``); vote, smoothing and refinement are finer anyway.
    unsupported : {"linear", "warp"}, default="linear"
        What becomes of ten or more trials that do not support their warps. ``"linear"``: there is a
        warning, and if ``evidence_.harmful``, they are linearly normalised. ``"warp"``: they are
        warped, without a warning. Set it if you know that they show one movement in loud noise.
    keyframe_std : float, default=0
        Standard deviation of key-frames that are given, in frames of the clock. 0: they are exact,
        and warps go through them. Above: they draw softly, as labels have errors, and a label that
        contradicts the movement by far counts little. See Notes.
    search : {"auto", "exhaustive", "sampled"}, default="auto"
        The search for the most typical trial: by all matches, or by a sequential test on matches
        with random references (see ``search_``). ``"auto"``: by all, for up to 100 trials.
    max_fit : int, default=None
        Size, at least 2, of a random sample from which ``fit`` learns everything. The other trials
        are not checked. They are not even read if ``X`` gives trials by index, so time and memory
        of a fit do not grow with their number. A template given by its index is in the sample.
        None takes all trials. See ``typical_share_``.
    random_state : int, RandomState instance or None, default=0
        Draws the references of a sampled search, and the sample of ``max_fit``. With the default,
        equal input gives equal results.
    n_jobs : int, default=None
        Number of parallel jobs in ``fit``, ``transform`` and ``match``. None means 1 unless in a
        ``joblib.parallel_config`` context, -1 all cores. Results are the same to the last bit.
    verbose : int, default=0
        Above 0, print the progress of a long job, at most once a second.

    Attributes
    ----------
    pattern_ : ndarray, shape (P, n_features)
        The template, of ``P`` frames.
    pattern_index_ : int or None
        Its index in the training set; None if it was given as an array.
    n_frames_ : int
        ``P``.
    global_distances_ : ndarray, shape (n_sequences,)
        ``C_n`` of Eq. 19 by all matches. After an exhaustive search every trial has one, after a
        sampled one the best few; the others are NaN. With a learnt metric the search may compare
        fewer frames, in single precision, and scales the sums to ``P``. So they differ a little
        from sums of the ``distances`` of `match`.
    certified_ : bool
        Whether the template is the median of Eq. 19: by all matches, or because paired tests
        rejected every other trial, with a family-wise error rate of 1 %. False if the template was
        given, or a search has spent its 150 matches a trial. After a fit to a sample: whether no
        other trial of the sample may be more typical of all.
    n_matches_ : int
        Number of matches to choose the template and the trials that vote.
    search_ : Bunch
        ``n_matches`` and ``certified``, as above. ``in_doubt``: the number of others that no test
        rejected. ``excess``: the template's ``C_n`` is at most ``1 + excess`` times the smallest,
        with a probability of 99 %. If the template was given, all are in doubt and the excess is
        NaN.
    sample_ : ndarray of int
        Indices of the training trials: all, or ``max_fit`` of them. ``global_distances_`` are sums
        over these, and NaN for all others; ``lengths_`` and ``examples_`` are theirs.
    typical_share_ : float
        Upper bound of the share of all trials that are more typical than the template, by the
        metric of this fit. 0 if the template is the certified median of all. After a fit to a
        random sample its confidence is 95 %, beside the 1 % of the search. NaN if the template was
        given.
    metric_ : Bunch or None
        The learnt metric, in single precision; None without one. ``share``: the share of every
        signal in what is compared, about 0 for noise. ``energy``: its share in the velocities,
        which are compared without a metric; if one of several exceeds 0.95 there is a warning.
        ``performances``: the indices of the trials it was learnt from.
    evidence_ : Bunch
        Whether the trials that the metric is learnt from support their warps. ``remaining``: the
        share of their differences that matching leaves. ``inconsistency``: how far, on average, the
        warp by way of a third trial is from the warp itself, over the mean time shift. It is small
        for one movement, and about 1 for noise. Ten or more trials with more than 0.7 and 0.45 are
        warned of. ``harmful``: whether the inconsistency is above 1, too. NaN without a metric, and
        for time shifts below 1 % of a trial.
    mu_ : float
        Absolute weight of the changes of pace, by the frames that the search compares.
    exemplars_ : ndarray of int
        Indices of the trials that vote: up to ``consensus``, and so many of each of several modes.
        If only some trials have key-frames, they are the exemplars.
    keyframes_ : ndarray, shape (n_keyframes,), or None
        Key-frames of the template, in frames of the clock: its own, or learnt from the trials that
        have them. None if none were given.
    modes_ : Bunch
        The ways of doing the movement that the training set holds, such as one stroke or two.
        ``labels``: the mode of each training trial, 0 being the most frequent; -1 if ``max_fit``
        left it out. ``shares``: the share of each mode, ``[1.]`` if there is a single one. At least
        6 trials and a learnt metric are needed to find several, and 3 trials of each.
    misfit_ : float
        Median share of the variance of the template in the smoothed residuals of matched poses;
        NaN unless ``refine="auto"`` finds that refining may help.
    refinement_ : Bunch
        The test of ``refine="auto"``, by signals that had no part in the warps. ``ratio``: their
        misfit after refining by the other signals, to that after matching by the others alone.
        ``p_value``: of a t test that refining does not help. Both are of the first pass if that
        rejects refining. ``ratio_to_all``: to the misfit after matching by all signals. NaN where
        there is no test.
    refines_ : bool
        Whether warps are refined.
    sharpening_ : Bunch or None
        What sharpens warps; None if nothing does. ``width``: smoothing of velocities, as a share of
        the trial. ``agreement``: how well the trials that vote agree with the template in the
        velocity of every signal, a correlation; NaN for noise. ``trust``, shape (P,): from 0 to 1,
        how far warps go to where the last match places them. It follows from the agreement, and
        from how clearly velocities change there.
    interval_factor_ : float
        By which the intervals of `Match.interval` are wider than those of the package; 1 before
        ``calibrate``.
    lengths_ : ndarray of int, shape (n_samples_fit,)
        Numbers of frames of the training trials.
    examples_ : ndarray, shape (min(n_samples_fit, 64), P, n_features)
        Training trials linearly normalised: all, or 64 of them, evenly spaced.
    features_ : callable
        Turns poses on the frames of the template into what is compared.
    n_features_in_ : int
        Signals of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the signals; only if the input had names.

    See Also
    --------
    LinearSynchronizer : The baseline without matching.
    KeyframeSynchronizer : Matching by key-frames.
    ActionModel : Mean and variation of aligned trials.
    sklearn_motionsync.display.MetricDisplay : Draws the weights of the signals in the metric.

    Notes
    -----
    A fit has six steps. Those of the paper are 1, 3 and 4, and `paper` has its settings.

    1. All trials are linearly normalised to ``P`` frames (Eq. 7).
    2. The metric is learnt: how well each signal, and combinations of them, tell the moments of the
       movement (see ``metric``).
    3. Pairs of trials are matched. Dynamic programming finds the time shifts Delta(p) with the
       smallest distance ``D_{n,m}`` (Eqs. 12-17)::

           sum_p |x_n(p) - x_m(p + Delta(p))|^2 + mu sum_p phi(rate)

       Both ends are pinned, and the local rate is between 0 and ``max_rate``. The points x are
       velocities and poses in the metric (see ``cost``).
    4. The template is the trial with the smallest sum ``C_n = sum_m D_{n,m}`` (Eq. 19), the
       "median".
    5. Some typical trials, the exemplars, vote. The template is matched to a trial directly, and by
       way of each exemplar. The weighted median of these paths outvotes a path that went astray. It
       is then smoothed. If the distances fall into several modes, exemplars vote within their mode
       only. A trial of another mode than the template is warped to the most typical one of its
       mode, and one warp joins that to the template.
    6. Trials are matched once more, near their warps and by sharper velocities. If refining helps,
       Gauss-Newton steps on the poses take the place of that.

    ``transform`` samples a trial at ``tau(p) = p + Delta(p)`` (Eq. 18).

    References
    ----------
    M. Mozerov, I. Rius, X. Roca, J. Gonzalez, "3D Human Motion Sequences Synchronization
    Using Dense Matching Algorithm".

    Examples
    --------
    A known warp is recovered. The second trial is up to 8 frames ahead in its first half, and
    behind in its second.

    >>> import numpy as np
    >>> from sklearn_motionsync import DenseSynchronizer
    >>> t = np.linspace(0, 1, 101)
    >>> phase = t + 0.08 * np.sin(2 * np.pi * t)
    >>> def movement(phase):
    ...     return np.column_stack([np.cos(4 * phase), np.sin(4 * phase)])
    >>> X = [movement(t), movement(phase)]
    >>> sync = DenseSynchronizer(pattern=0).fit(X)
    >>> truth = 100 * (np.interp(t, phase, t) - t)
    >>> float(np.abs(sync.match(X).offsets[1] - truth).mean().round(1))
    0.0
    """

    _parameter_constraints: dict = {
        **AnchoredSynchronizer._parameter_constraints,
        "velocity_smoothing": [StrOptions({"auto"}), Interval(Real, 0, 1, closed="both")],
        "refine": [StrOptions({"auto"}), "boolean"],
        "max_offset": [StrOptions({"auto"}), Interval(Real, 0, 1, closed="both")],
        "sharpen": ["boolean"],
        "metric": [StrOptions({"learned"}), None],
        "consensus": [Interval(Integral, 0, None, closed="left")],
        "warp_smoothing": [Interval(Real, 0, 1, closed="both")],
        "cost": [StrOptions(set(COSTS))],
        "smoothness": [Interval(Real, 0, None, closed="left")],
        "max_rate": [Interval(Real, 1, None, closed="left")],
        "subframes": [Interval(Integral, 1, None, closed="left")],
        "unsupported": [StrOptions({"linear", "warp"})],
        "keyframe_std": [Interval(Real, 0, None, closed="left")],
        "search": [StrOptions({"auto", "exhaustive", "sampled"})],
        "max_fit": [Interval(Integral, 2, None, closed="left"), None],
        "random_state": ["random_state"],
        "n_jobs": [Integral, None],
        "verbose": ["verbose"],
    }

    metric_: Any
    _finite = "allow-nan"
    _SMALLER = "fewer frames, subframes or performances. Or learn from some: max_fit=1000"

    def __init__(
        self,
        n_frames: int | None = None,
        pattern: PerformanceLike | int | Literal["median"] = "median",
        *,
        velocity_smoothing: float | Literal["auto"] = "auto",
        refine: bool | Literal["auto"] = "auto",
        max_offset: float | Literal["auto"] = "auto",
        sharpen: bool = True,
        metric: Literal["learned"] | None = "learned",
        consensus: int = 8,
        warp_smoothing: float = 0.02,
        cost: Cost = "velocity",
        smoothness: float = 0.003,
        max_rate: float = 4,
        subframes: int = 1,
        unsupported: Literal["linear", "warp"] = "linear",
        keyframe_std: float = 0,
        search: Literal["auto", "exhaustive", "sampled"] = "auto",
        max_fit: int | None = None,
        random_state: RandomState = 0,
        n_jobs: int | None = None,
        verbose: int = 0,
    ) -> None:
        self.n_frames = n_frames
        self.pattern = pattern
        self.velocity_smoothing = velocity_smoothing
        self.refine = refine
        self.max_offset = max_offset
        self.sharpen = sharpen
        self.metric = metric
        self.consensus = consensus
        self.warp_smoothing = warp_smoothing
        self.cost = cost
        self.smoothness = smoothness
        self.max_rate = max_rate
        self.subframes = subframes
        self.unsupported = unsupported
        self.keyframe_std = keyframe_std
        self.search = search
        self.max_fit = max_fit
        self.random_state = random_state
        self.n_jobs = n_jobs
        self.verbose = verbose

    @classmethod
    def paper(cls, **params: Any) -> Self:
        """Make a synchronizer with the settings of the paper.

        Postures are compared, rates end at 2, and a warp is the direct path to the pattern: no
        metric is learnt, no exemplars vote, and nothing is refined.

        Parameters
        ----------
        **params : dict
            Other parameters, such as ``n_frames``, or other values of these.

        Returns
        -------
        DenseSynchronizer

        Examples
        --------
        >>> from sklearn_motionsync import DenseSynchronizer
        >>> DenseSynchronizer.paper(n_frames=100)
        DenseSynchronizer(consensus=0, cost='posture', max_rate=2, n_frames=100)
        """
        return cls(**{"cost": "posture", "max_rate": 2, "consensus": 0} | params)

    def _match(self, performances, keyframes=None, frame_rate=None, confidence=None):
        performances = with_confidence(performances, confidence)
        arrays, shares = self._with_keyframes(performances, keyframes, frame_rate)
        distances, times = self._distances_and_times(arrays, shares)
        distances, mode = self._warper.matcher.features.back(distances), None
        if len(self.modes_.shares) > 1:
            mode = on_one_thread(self._warper.modes_of, arrays)
        match = Match(times, distances, mode)
        match.intervals = intervals_of(self, self._warper, arrays, match, shares)
        return match

    @atomic_partial_fit
    def calibrate(
        self,
        X: PerformancesLike,
        keyframes: Indexed[ValuesLike | None] | SupportsArray,
        frame_rate: float | ValuesLike | None = None,
    ) -> Self:
        """Fit the intervals of `Match.interval` to key-frames of your own.

        They are multiplied by one number, so that intervals of 90 % hold 90 % of the key-frames.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Performances, best of subjects that ``fit`` has not seen. They are matched without
            their key-frames.
        keyframes : list of arrays (n_keyframes,), 2-D array or DataFrame
            Moments of each, as for ``fit``: at least 9, better some dozens. Those of the template
            are ``keyframes_``, or else the median of the frames that these moments meet.
        frame_rate : float, or array-like of shape (n_sequences,), default=None
            As for ``fit``.

        Returns
        -------
        self : DenseSynchronizer
            With ``interval_factor_``.

        Raises
        ------
        ValueError
            If there are too few key-frames; and as from ``fit``.
        """
        check_is_fitted(self)
        performances = self.check_performances(X)
        given = Keyframes(keyframes, len(performances), frame_rate)
        count = None if self.keyframes_ is None else len(self.keyframes_)
        known = given.shares(performances, count) * (self.n_frames_ - 1)
        match = self._match(performances)
        self.interval_factor_ *= calibrated_factor(match, self.keyframes_, known)
        return self

    def _warp_part(self, performances, keyframes=None, frame_rate=None, confidence=None):
        performances = with_confidence(performances, confidence)
        given = self._with_keyframes(performances, keyframes, frame_rate)
        times = np.maximum.accumulate(self._distances_and_times(*given)[1], axis=1)
        return sample(performances, times, self.n_frames_)

    def _with_keyframes(self, performances, keyframes=None, frame_rate=None):
        """Performances as the warper takes them, and their key-frames as shares, or None."""
        shares = self._shares(performances, keyframes, frame_rate)
        performances = self._without_gaps(performances)
        arrays = performances
        if self._warper.matcher.features.weighs:
            arrays = add_weights(performances, performances.weights)
        if self.keyframes_ is None:
            return arrays, None
        if shares is None:
            shares = np.full((len(performances), len(self.keyframes_)), np.nan)
        return add_ramps(arrays, shares), shares

    def _distances_and_times(self, arrays, shares):
        with self._progress(fits=False) as progress:
            portions = {"n_jobs": self.n_jobs, "progress": progress, "name": "warping"}
            distances, times = warp_in_portions(self._warper, arrays, **portions)
        if shares is None or self.keyframe_std > 0:
            return distances, times
        # Linear warps go straight from one key-frame to the next.
        reach = {"reach": np.inf} if isinstance(self._warper, LinearWarper) else {}
        return distances, pin(times, self.keyframes_, shares * (self.n_frames_ - 1), **reach)

    @snapshot
    def disparity_space(
        self,
        X: PerformancesLike,
        performance: int = 0,
        keyframes: Indexed[ValuesLike | None] | SupportsArray | None = None,
        frame_rate: float | ValuesLike | None = None,
    ) -> Bunch:
        """The disparity space of the pattern and one performance, and the path through it (Fig. 2).

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Performances; the rows of a 2-D array are univariate ones.
        performance : int, default=0
            The index of one of them.
        keyframes, frame_rate : as for ``match``, default=None
            Key-frames draw the path. They are no part of the costs.

        Returns
        -------
        Bunch
            ``frames`` p and ``offsets`` d, all of them or, of long takes, evenly spaced ones;
            ``costs`` E(p, d) of Eq. 12 at rate 1, shape (n_frames, n_offsets), NaN
            where no path passes by Eqs. 9 and 13; ``path``, the offsets of the best
            path, shape (P,), before vote, smoothing and refinement.

        Raises
        ------
        ValueError
            If there is no such performance.
        """
        performances = self.check_performances(X)
        whole = isinstance(performance, Integral) and not isinstance(performance, bool)
        if not whole or not 0 <= performance < len(performances):
            raise ValueError(
                f"performance={performance} is out of range: there are {len(performances)} "
                f"performances, 0 to {len(performances) - 1}."
            )
        warper = self._warper
        arrays, _ = self._with_keyframes(performances, keyframes, frame_rate)
        positions = warper.positions([arrays[performance]])
        frames, offsets, costs, path = warper.disparity_space(positions)
        costs = warper.matcher.features.back(costs)
        return Bunch(frames=frames, offsets=offsets, costs=costs, path=path)

    # -- steps of a fit ---------------------------------------------------------------------

    def _check_training_set(self, X, confidence=None):
        some, sample, population = subsample(X, self.max_fit, self.pattern, self.random_state)
        numbers = None if sample is None else sample.tolist()
        performances = super()._check_training_set(some, numbers, confidence)
        n = len(performances)
        self.sample_ = np.arange(n) if sample is None else sample
        self._population = n if sample is None else population
        return performances

    def _number_as_given(self):
        sample, distances = self.sample_, np.full(self._population, np.nan)
        distances[sample] = self.global_distances_
        self.global_distances_, self.exemplars_ = distances, sample[self.exemplars_]
        labels = np.full(self._population, -1)
        labels[sample] = self.modes_.labels
        self.modes_.labels = labels
        if self.pattern_index_ is not None:
            self.pattern_index_ = int(sample[self.pattern_index_])
        if self.metric_ is not None:
            self.metric_.performances = sample[self.metric_.performances]

    def _n_given(self, performances):
        return self._population

    def _learn(self, performances, progress, keyframes):
        training = self._set_clock(performances, self.subframes)
        positions, arrays, columns = training.scaled, list(performances), None
        n_features, weights = positions.shape[2], performances.weights
        if weights:
            arrays = add_weights(arrays, weights)
        if keyframes is not None:
            arrays = add_ramps(arrays, keyframes)
            std = self.keyframe_std / (self.n_frames_ - 1)
            columns = KeyframeColumns(keyframes.shape[1], std)
        if self.subframes > 1 or arrays[0].shape[1] > n_features:
            positions = normalise(arrays, self.n_frames_, self.subframes)
            training.unit(positions, out=positions)
        beside = {"anchors": columns, "weighs": weights is not None}
        features = learn_features(self, training.unit, positions, beside, self._settings)
        settings = self._settings()
        searched = features.for_search(self.n_frames_, settings["max_offset"])
        store = FeatureStore(searched, positions)
        warn_of_one_feature(self, performances, store)
        searcher, shared, median, modes = self._search(searched, store, positions, progress)
        matcher = searcher
        if searched is not features:
            reach = {name: settings[name] for name in ("max_offset", "max_rate")}
            matcher = searcher.on_clock(features, self.n_frames_, **reach)
        self.features_ = features.replace(anchors=None, weighs=False)
        self.mu_ = float(features.back(matcher.trellis.mu))
        source = self._set_pattern(training, median, features.degree)
        if weights is not None:
            own = self.pattern_index_
            (source,) = add_weights([source], None if own is None else [weights[own]])
        # Sums over fewer frames, scaled to all.
        self.global_distances_ *= self.n_frames_ / (searched.frames or self.n_frames_)
        chosen = self._choose_exemplars(median.estimates, modes, keyframes)
        source = self._set_keyframes(keyframes, source, arrays, matcher, chosen[0])
        warpers = [self._warper_by(x, arrays, matcher, source) for x in chosen]
        home = modes.home(self.pattern_index_, warpers)
        tested = warpers[home], source, shared, self._settings(learnt=False), progress
        warper = decide_on_refinement(self, training, *tested)
        self.sharpening_, self.interval_factor_ = None, 1.0
        if modes.are_several and not isinstance(warper, LinearWarper):
            warpers[home] = warper
            finish = partial(self._sharpened, positions)
            settings = warpers, home, arrays, chosen, modes.signs(), finish
            warper = on_one_thread(ModalWarper.of, *settings)
            final = warper.warpers[home]
        else:
            warper = final = on_one_thread(self._sharpened, positions, warper, chosen[home])
        if isinstance(final, SharpenedWarper):
            self.sharpening_ = Bunch(**final.sharpener.found(n_features))
        self._warper = warper

    def _settings(self, learnt=None):
        """The settings of `Matcher.learn`, for a learnt metric or none; by default as fitted."""
        learnt = self.metric_ is not None if learnt is None else learnt
        max_offset = self.max_offset
        if max_offset == "auto":
            max_offset = _WIDE if learnt else _NARROW
        settings = {"smoothness": self.smoothness, "max_rate": self.max_rate}
        return {**settings, "max_offset": max_offset}

    def _search(self, features, store, positions, progress):
        """The matcher that searches, the portions of the training set, the median, and modes."""
        energy = store.energy()
        shape = len(positions), *store.template.shape[1:]
        matcher = Matcher.of_energy(features, shape, energy, **self._settings())
        portions = TrainingPortions(matcher, positions, store)
        rounding = rounding_bound(store.template.dtype, energy)
        table = DistanceTable(partial(portions.compare, n_jobs=self.n_jobs, progress=progress))
        median = self._choose_median(table, len(positions), rounding)
        is_rounded = features.single and positions.dtype != store.template.dtype
        if not is_rounded or not median.is_blurred(rounding):
            return matcher, portions, median, self._find_modes(table, store, len(positions))
        # Nearly equal trials: single precision does not tell them apart.
        features = features.replace(single=False)
        return self._search(features, FeatureStore(features, positions), positions, progress)

    def _find_modes(self, table, store, n):
        """The modes of n performances; without a learnt metric too many sets seem to have some."""
        modes = Modes.single(n)
        if self.metric_ is not None:
            modes = table.modes(n, store)
        self.modes_ = Bunch(labels=modes.labels, shares=modes.shares)
        return modes

    def _choose_median(self, compare, n, rounding):
        """The median (Eq. 19), by all matches or some; or only what chooses the exemplars."""
        wanted, population = isinstance(self.pattern, str), self._population
        if not wanted and (self.consensus == 0 or n <= self.consensus):
            # None or all of the performances are exemplars.
            median = Median.unknown(n)
        elif self.search == "exhaustive" or (self.search == "auto" and n <= _EXHAUSTIVE):
            median = exhaustive_median(compare, n, rounding, population)
        elif wanted:
            random_state = check_random_state(self.random_state)
            median = sampled_median(compare, n, rounding, random_state, population)
        else:
            median = estimate_distances(compare, n, check_random_state(self.random_state))
        known = median if wanted else Median.unknown(n, median.n_matches)
        names = "n_matches", "certified", "in_doubt", "excess"
        self.search_ = Bunch(**{name: getattr(known, name) for name in names})
        self.n_matches_, self.certified_ = known.n_matches, known.certified
        self.typical_share_ = typical_share(known.in_doubt, n, population) if wanted else np.nan
        return median

    def _choose_exemplars(self, estimates, modes, keyframes):
        """Choose the exemplars: those of every mode, a list.

        If some performances have key-frames and others none, those that have.
        """
        chosen = [np.empty(0, dtype=np.intp)] * len(modes.shares)
        if self.consensus > 0:
            known = None if keyframes is None else np.isfinite(keyframes).any(axis=1)
            chosen = modes.exemplars(estimates, self.consensus, self.pattern_index_, known)
        self.exemplars_ = np.concatenate(chosen)
        return chosen

    def _set_keyframes(self, keyframes, source, arrays, matcher, exemplars):
        """Set the key-frames of the pattern, which may have to be learnt; the pattern with them."""
        self.keyframes_ = None
        if keyframes is None:
            return source
        own = np.full(keyframes.shape[1], np.nan)
        if self.pattern_index_ is not None:
            own = keyframes[self.pattern_index_]
        last, unknown = self.n_frames_ - 1, np.isnan(own)
        if unknown.any():
            some = np.flatnonzero(np.isfinite(keyframes[:, unknown]).any(axis=1))[:MOST_LEARNT]
            (pattern,) = add_ramps([source], own[np.newaxis])
            warper = self._warper_by(exemplars, arrays, matcher, pattern)
            positions = warper.positions([arrays[k] for k in some])
            _, times = on_one_thread(warper.warps, positions)
            met = first_meeting(times, keyframes[some] * last) / last
            own = np.maximum.accumulate(np.where(unknown, np.nanmedian(met, axis=0), own))
        self.keyframes_ = own * last
        (pattern,) = add_ramps([source], own[np.newaxis])
        return pattern

    def _warper_by(self, exemplars, arrays, matcher, source):
        """The warper to the pattern by way of exemplars."""
        # In double precision, as all performances that are warped.
        both = source, *(arrays[k] for k in exemplars.tolist())
        chosen = [x.astype(np.float64, copy=False) for x in both]
        positions = matcher.features.positions(chosen, self.n_frames_)
        pattern = matcher.features.plain(positions)[0, :: self.subframes]
        linear = self.evidence_.harmful and self.unsupported == "linear"
        made = LinearWarper if linear else Warper
        given = pattern, positions, self.consensus > 0, self.warp_smoothing
        return on_one_thread(made.to_pattern, matcher, *given)

    def _sharpened(self, positions, warper, exemplars):
        """The warper that also sharpens, with a metric; the same if it refines or does not warp."""
        is_final = isinstance(warper, (LinearWarper, RefinedWarper))
        if not self.sharpen or self.metric_ is None or is_final:
            return warper
        width = None if self.velocity_smoothing == "auto" else self.velocity_smoothing
        chosen = positions[exemplars].astype(np.float64, copy=False)
        return SharpenedWarper.of(warper, chosen, width) or warper
