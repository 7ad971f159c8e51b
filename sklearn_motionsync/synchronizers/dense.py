"""DenseSynchronizer: dense matching to the median trial (Eqs. 7-19)."""

from __future__ import annotations

from numbers import Integral, Real
from typing import Any, Literal, Self

import numpy as np
from sklearn.utils import Bunch
from sklearn.utils._param_validation import Interval, StrOptions
from sklearn.utils.validation import check_is_fitted

from ..inputs.keyframes import Keyframes
from ..inputs.types import (
    Cost,
    Indexed,
    RandomState,
    SupportsArray,
    TrialLike,
    TrialsLike,
    ValuesLike,
)
from ..inputs.validation import names_of_input
from ..inputs.wording import counted
from ..matching.anchors import add_ramps, first_meeting, pin
from ..matching.costs import COSTS
from ..matching.counting import whole
from ..matching.gaps import add_weights
from ..matching.sharpening import Sharpener
from ..matching.warps import normalise
from ..utils.parallel import one_blas_thread
from .base import AnchoredSynchronizer
from .intervals import intervals_of
from .learning import (
    finish_warps,
    learn_metric,
    let_exemplars_vote,
    match_pairs,
    warp_in_portions,
)
from .match import Match
from .training import check_pattern, draw_sample, pattern_of


class DenseSynchronizer(AnchoredSynchronizer):
    """Align trials in time: warp all of them to the most typical one.

    That trial is the *pattern*; others call it a template. Every other trial is matched to it by
    all of its signals at once. A warp then brings the same moments together. The time shifts are a
    result, too.

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
    7

    One of which nothing was seen is refused:

    >>> trials[2][:] = np.nan
    >>> sync.transform(trials)
    Traceback (most recent call last):
        ...
    ValueError: Trial 2 is NaN in every frame and feature: nothing of it was seen, ...

    The defaults suit most data. Four parameters depend on the data or on the question. The others
    were set by measurements, or are for many trials and long jobs.

    Parameters
    ----------
    n_frames : int, default=None
        Frames of every aligned trial. Set it if you want a number of your own, such as 101 for 0 to
        100 %. By default it is the median length of the trials, or the length of a pattern that is
        given as an array. Time grows with its square.
    pattern : "median", int or array (n_frames, n_features), default="median"
        The pattern: the most typical trial, a trial by its index, or an array. Set it if new
        trials are to be aligned to a pattern that you have.
    refine : "auto" or bool, default="auto"
        Whether to place every moment to a fraction of a frame by the poses themselves. That helps
        with repeated trials of a single source, which differ by noise and gain only, and harms with
        different people, and with counts such as spikes. With ``"auto"`` one number decides: trials
        are refined if ``unexplained_variance_`` is below 0.025. Without a vote (``consensus=0``)
        only True refines.
    max_offset : "auto" or float, default="auto"
        Largest time shift, as a share of ``n_frames``, in [0, 1]. Lower it for long trials of
        nearly the same pace: that saves time and memory. ``"auto"`` is 0.4 with a learnt metric,
        and 0.25 without, where larger shifts lead astray.

    Other Parameters
    ----------------
    cost : {"velocity", "elastic", "pose"}, default="velocity"
        What is compared. ``"velocity"``: velocities; at the local rate rho, ``v_n`` with ``(0.8 +
        0.2 rho) v_m``. ``"elastic"``: velocities divided by the square root of the speed. Its
        weights make the distance, of Fisher and Rao, independent of the timing of either trial.
        ``"pose"``: poses, as in the paper.
    smoothness : float, default=0.003
        Weight of changes of pace, a pure number. ``mu`` of Eq. 12 is ``smoothness`` times the mean
        squared norm of what is compared.
    max_rate : float, default=4
        Largest local rate of a path; 2 in Eq. 13. What follows the match may exceed it.
    metric : "learned" or None, default="learned"
        How signals are weighted by the velocity cost. ``"learned"``: compressed velocities, and
        poses less their own mean, count by how well trials agree at the same moment. ``fit`` learns
        this from 3 to 20 trials, and not without a vote (``consensus=0``). Distances are then pure
        numbers. None: velocities, with equal weights. Other costs have no metric.
    consensus : int, default=8
        Number of typical trials that vote on a warp. 0 takes the direct path, as in the paper,
        which is not smoothed, and refined only by ``refine=True``.
    keyframe_std : float, default=0
        Standard deviation of key-frames that are given, in frames of the clock. 0: they are exact,
        and warps go through them. Above: they draw softly, as labels have errors, and a label that
        contradicts the movement by far counts little; only ``refine=True`` refines.
    max_fit : int, default=None
        Size, at least 2, of a random sample from which ``fit`` learns everything. The other trials
        are not checked. They are not even read if ``X`` gives trials by index, so time and memory
        of a fit do not grow with their number. A pattern given by its index is in the sample.
        None takes all trials.
    random_state : int, RandomState instance or None, default=0
        Draws the sample of ``max_fit``, and the trials that all are compared with where there are
        more than 100. With the default, equal input gives equal results.
    n_jobs : int, default=None
        Number of parallel jobs in ``fit``, ``transform`` and ``match``. None means 1 unless in a
        ``joblib.parallel_config`` context, -1 all cores. Results are the same to the last bit.
    verbose : int, default=0
        Above 0, print the progress of a long job, at most once a second.

    Attributes
    ----------
    pattern_ : ndarray, shape (P, n_features)
        The pattern, of ``P`` frames.
    pattern_index_ : int or None
        Its index in the training set; None if it was given as an array.
    n_frames_ : int
        ``P``.
    global_distances_ : ndarray, shape (n_sequences,)
        ``C_n`` of Eq. 19, the sum of the distances of each trial to all others. Of more than 100
        trials it is estimated from the distances to 100 of them, drawn at random: its standard
        error is 4 to 8 % of it, and in six sets of 180 to 300 trials the pattern's own sum was at
        most 2 % above the smallest. With a learnt metric the distances may be those of fewer
        frames, in single precision, scaled to ``P``, so they differ a little from sums of the
        ``distances`` of `match`. NaN if the pattern was given, and for trials outside of the
        sample.
    sample_ : ndarray of int
        Indices of the training trials: all, or ``max_fit`` of them. ``lengths_`` and ``examples_``
        are theirs.
    metric_ : Bunch or None
        The learnt metric, in single precision; None without one. ``share``: the share of every
        signal in what is compared, about 0 for noise. ``energy``: its share in the velocities,
        which are compared without a metric; if one of several exceeds 0.95 there is a warning.
        ``trials``: the indices of the trials it was learnt from.
    evidence_ : Bunch
        Whether the trials that the metric is learnt from support their warps. ``remaining``: the
        share of their differences that matching leaves. ``inconsistency``: how far, on average, the
        warp by way of a third trial is from the warp itself, over the mean time shift. It is small
        for one movement, and about 1 for noise. ``weak``: whether there are ten or more trials with
        more than 0.7 and 0.4; a `SynchronizationWarning` says so. NaN without a metric, and for
        time shifts below 1 % of a trial.
    mu_ : float
        Absolute weight of the changes of pace (Eq. 12).
    exemplars_ : ndarray of int
        Indices of the trials that vote, at most ``consensus``. If only some trials have key-frames,
        they are the exemplars.
    keyframes_ : ndarray, shape (n_keyframes,), or None
        Key-frames of the pattern, in frames of the clock: its own, or learnt from the trials that
        have them. None if none were given.
    unexplained_variance_ : float
        The variance that is left after matching, less what white noise explains, as a share of the
        pattern's: the median over at most 20 trials, evenly spaced. Copies of one source have at
        most 0.022 at any noise, whole movements of people 0.03 and more. Single signals of people
        may have less, and are then refined by mistake: set ``refine=False``. NaN unless
        ``refine="auto"`` asks for it, and without trials that have no gaps.
    refines_ : bool
        Whether warps are refined.
    sharpening_ : Bunch or None
        What sharpens warps; None if nothing does. ``width``: smoothing of velocities, as a share of
        the trial. ``agreement``: how well the trials that vote agree with the pattern in the
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
        Turns poses on the frames of the pattern into what is compared.
    n_features_in_ : int
        Signals of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the signals; only if the input had names.

    See Also
    --------
    LinearSynchronizer : The baseline without matching, also between key-frames.
    ActionModel : Mean and variation of aligned trials.

    Notes
    -----
    A fit has six steps, a function each in ``sklearn_motionsync.synchronizers``. Those of the paper
    are 1, 3 and 4, and `paper` has its settings.

    1. ``training.put_on_clock``: all trials are linearly normalised to ``P`` frames (Eq. 7).
    2. ``learning.learn_metric``: how well each signal, and combinations of them, tell the moments
       of the movement (see ``metric``). Velocities are smoothed by a Gaussian of 2 % of the trial,
       of 3 % without a metric; beyond its ends a trial is continued by its point reflection.
    3. ``learning.match_pairs``: dynamic programming finds the time shifts Delta(p) with the
       smallest distance ``D_{n,m}`` (Eqs. 12-17)::

           sum_p |x_n(p) - x_m(p + Delta(p))|^2 + mu sum_p phi(rate)

       Both ends are pinned, and the local rate is between 0 and ``max_rate``. The points x are
       velocities and poses in the metric (see ``cost``). All pairs are matched, or of more than 100
       trials each with 100 drawn ones.
    4. ``training.pattern_of``: the pattern is the trial with the smallest sum ``C_n = sum_m
       D_{n,m}`` (Eq. 19), the "median".
    5. ``learning.let_exemplars_vote``: some typical trials, the exemplars, vote. The pattern is
       matched to a trial directly, and by way of each exemplar. The median of these paths outvotes
       a path that went astray. Its time shifts are smoothed by a Gaussian of 2 % of the trial.
    6. ``learning.finish_warps``: trials are matched once more, near their warps and by velocities
       as sharp as their noise allows (see ``sharpening_``). For trials of one source (see
       ``refine``), Gauss-Newton steps on the poses take the place of that. Without a metric, warps
       that are not refined stay as they are.

    ``match`` and ``transform`` take new trials through the steps 1, 3, 5 and 6.

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
        "refine": [StrOptions({"auto"}), "boolean"],
        "max_offset": [StrOptions({"auto"}), Interval(Real, 0, 1, closed="both")],
        "cost": [StrOptions(set(COSTS))],
        "smoothness": [Interval(Real, 0, None, closed="left")],
        "max_rate": [Interval(Real, 1, None, closed="left")],
        "metric": [StrOptions({"learned"}), None],
        "consensus": [Interval(Integral, 0, None, closed="left")],
        "keyframe_std": [Interval(Real, 0, None, closed="left")],
        "max_fit": [Interval(Integral, 2, None, closed="left"), None],
        "random_state": ["random_state"],
        "n_jobs": [Integral, None],
        "verbose": ["verbose"],
    }

    metric_: Any
    _SMALLER = "fewer frames or trials. Or learn from some: max_fit=1000"

    def __init__(
        self,
        n_frames: int | None = None,
        pattern: TrialLike | int | Literal["median"] = "median",
        *,
        refine: bool | Literal["auto"] = "auto",
        max_offset: float | Literal["auto"] = "auto",
        cost: Cost = "velocity",
        smoothness: float = 0.003,
        max_rate: float = 4,
        metric: Literal["learned"] | None = "learned",
        consensus: int = 8,
        keyframe_std: float = 0,
        max_fit: int | None = None,
        random_state: RandomState = 0,
        n_jobs: int | None = None,
        verbose: int = 0,
    ) -> None:
        self.n_frames = n_frames
        self.pattern = pattern
        self.refine = refine
        self.max_offset = max_offset
        self.cost = cost
        self.smoothness = smoothness
        self.max_rate = max_rate
        self.metric = metric
        self.consensus = consensus
        self.keyframe_std = keyframe_std
        self.max_fit = max_fit
        self.random_state = random_state
        self.n_jobs = n_jobs
        self.verbose = verbose

    @classmethod
    def paper(cls, **params: Any) -> Self:
        """Make a synchronizer with the settings of the paper.

        Poses are compared, rates end at 2, and a warp is the direct path to the pattern: no
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
        DenseSynchronizer(consensus=0, cost='pose', max_rate=2, n_frames=100)
        """
        return cls(**{"cost": "pose", "max_rate": 2, "consensus": 0, **params})

    def _read_training_set(self, X, confidence=None):
        sample, numbers, population = draw_sample(X, self.max_fit, self.pattern, self.random_state)
        return super()._read_training_set(sample, numbers, population, confidence)

    def _learn(self, training, progress):
        trials, names = training.trials, names_of_input(self)
        pattern = check_pattern(self.pattern, trials, names)
        with one_blas_thread():
            # 1. All trials are linearly normalised (Eq. 7).
            clock = self._put_on_clock(training, pattern, self.keyframe_std)
            # 2. The metric is learnt.
            compared = learn_metric(
                clock,
                cost=self.cost,
                metric=self.metric,
                consensus=self.consensus,
                smoothness=self.smoothness,
                max_offset=self.max_offset,
                max_rate=self.max_rate,
            )
            # 3. All pairs are matched (Eqs. 12-17), if the pattern or the exemplars need that.
            needed = isinstance(pattern, str) or 0 < self.consensus < len(trials)
            pairs = match_pairs(
                clock,
                compared,
                needed,
                trials=trials,
                names=names,
                random_state=self.random_state,
                n_jobs=self.n_jobs,
                progress=progress,
            )
            # 4. The trial with the smallest sum of distances is the pattern (Eq. 19).
            chosen = pattern_of(training, pattern, pairs.median)
            # 5. Exemplars vote.
            vote = let_exemplars_vote(clock, training, chosen, pairs, self.consensus)
            # 6. Warps are sharpened or refined.
            final = finish_warps(clock, training, chosen, vote, self.refine)
        numbers = np.array(trials.numbers)
        features, finish = pairs.matcher.features, final.warper.finish
        distances = np.full(training.population, np.nan)
        distances[numbers] = chosen.distances
        metric, keyframes = compared.metric, vote.keyframes
        return {
            "pattern_": normalise([chosen.array], clock.n_frames)[0],
            "pattern_index_": None if chosen.trial is None else int(numbers[chosen.trial]),
            "n_frames_": clock.n_frames,
            "global_distances_": distances,
            "sample_": numbers,
            "metric_": metric and Bunch(**metric | {"trials": numbers[metric.trials]}),
            "evidence_": compared.evidence,
            "mu_": float(features.back(pairs.matcher.trellis.mu)),
            "exemplars_": numbers[vote.exemplars],
            "keyframes_": None if keyframes is None else keyframes * (clock.n_frames - 1),
            "unexplained_variance_": final.unexplained,
            "refines_": final.refines,
            "sharpening_": _described(finish, clock.poses.shape[2]),
            "interval_factor_": 1.0,
            "lengths_": clock.lengths,
            "examples_": clock.examples,
            "features_": features._replace(anchors=None, weighs=False),
            "_filler": training.filler,
            "_settings": compared.settings,
            "_warper": final.warper,
        }

    def _match(self, trials, keyframes=None, frame_rate=None):
        arrays, shares = self._for_warper(trials, keyframes, frame_rate)
        distances, times = warp_in_portions(
            self._warper, arrays, n_jobs=self.n_jobs, begin=self._progress, name="warping"
        )
        pinned = None
        if shares is not None and self.keyframe_std == 0:
            times = pin(times, self.keyframes_, shares * (self.n_frames_ - 1))
            pinned = self.keyframes_, np.isfinite(shares)
        intervals = intervals_of(
            self._warper, arrays, times, self.interval_factor_, self.evidence_, pinned
        )
        return Match(times, self._warper.matcher.features.back(distances), intervals)

    def calibrate(
        self,
        X: TrialsLike,
        keyframes: Indexed[ValuesLike | None] | SupportsArray,
        frame_rate: float | ValuesLike | None = None,
    ) -> Self:
        """Fit the intervals of `Match.interval` to key-frames of your own.

        They are multiplied by one number, so that intervals of 90 % hold 90 % of the key-frames.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials, best of subjects that ``fit`` has not seen. They are matched without
            their key-frames.
        keyframes : list of arrays (n_keyframes,), 2-D array or DataFrame
            Moments of each, as for ``fit``: at least 9, better some dozens. Those of the pattern
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
        trials = self.check_trials(X)
        keyframe_rows = Keyframes(keyframes, len(trials), frame_rate)
        count = None if self.keyframes_ is None else len(self.keyframes_)
        # In frames of the clock; NaN where one is not known.
        known = keyframe_rows.shares(trials, count) * (self.n_frames_ - 1)
        match, frames, seen = self._match(trials), np.arange(self.n_frames_), np.isfinite(known)
        of_pattern = self.keyframes_
        if of_pattern is None:
            of_pattern = np.nanmedian(first_meeting(match.times, known), axis=0)

        def at_keyframes(curves):
            return np.array([np.interp(of_pattern, frames, curve) for curve in curves])[seen]

        errors = np.abs(at_keyframes(match.times) - known[seen])
        widths = at_keyframes(match.intervals.measured()[0])
        # As many as hold 90 % of new ones, too (split conformal prediction).
        n = len(errors)
        rank = whole(0.9 * (n + 1), "up")
        if rank > n:
            raise ValueError(
                f"{counted(n, 'key-frame')} of the trials do not tell 90 %: at least 9 are "
                "needed, and some dozens tell it well."
            )
        factors = errors / np.maximum(widths, np.finfo(np.float64).tiny)
        self.interval_factor_ *= float(np.sort(factors)[rank - 1])
        return self

    def _for_warper(self, trials, keyframes=None, frame_rate=None):
        """Trials as the warper takes them, and their key-frames as shares, or None."""
        shares = None
        if keyframes is not None:
            shares = self._shares(trials, keyframes, frame_rate)
        trials = self._without_gaps(trials)
        arrays = trials
        if self._warper.matcher.features.weighs:
            arrays = add_weights(trials, trials.weights)
        if self.keyframes_ is None:
            return arrays, None
        if shares is None:
            shares = np.full((len(trials), len(self.keyframes_)), np.nan)
        return add_ramps(arrays, shares), shares

    def disparity_space(
        self,
        X: TrialsLike,
        trial: int = 0,
        keyframes: Indexed[ValuesLike | None] | SupportsArray | None = None,
        frame_rate: float | ValuesLike | None = None,
    ) -> Bunch:
        """The disparity space of the pattern and one trial, and the path through it (Fig. 2).

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.
        trial : int, default=0
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
            If there is no such trial.
        """
        trials = self.check_trials(X)
        is_index = isinstance(trial, Integral) and not isinstance(trial, bool)
        if not is_index or not 0 <= trial < len(trials):
            raise ValueError(
                f"trial={trial} is out of range: there are {len(trials)} "
                f"trials, 0 to {len(trials) - 1}."
            )
        warper = self._warper
        arrays, _ = self._for_warper(trials, **self._given(X, keyframes, frame_rate))
        positions = warper.positions([arrays[trial]])
        frames, offsets, costs, path = warper.disparity_space(positions)
        costs = warper.matcher.features.back(costs)
        return Bunch(frames=frames, offsets=offsets, costs=costs, path=path)


def _described(finish, n_features):
    """What sharpens warps, as ``sharpening_``; None if nothing does."""
    if not isinstance(finish, Sharpener):
        return None
    # NaN for what is not compared.
    agreement = np.full(n_features, np.nan)
    agreement[finish.features] = finish.agreement
    return Bunch(agreement=agreement, width=finish.width, trust=finish.trust)
