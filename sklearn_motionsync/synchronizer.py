"""Putting performances on one clock (Eqs. 7-19)."""

from functools import partial
from numbers import Integral, Real

import numpy as np
from joblib import effective_n_jobs
from sklearn.utils import check_random_state
from sklearn.utils._param_validation import Interval, StrOptions

from .clock import Synchronizer, rounding_of
from .consensus import choose_exemplars
from .matching import Trellis, even_slices, step_table
from .median import estimate_distances, search_median, sum_all
from .refinement import choose_smoothing
from .sampling import Match
from .warping import Warper
from .work import CallbackSupportMixin, Progress, run

__all__ = ["DenseSynchronizer", "LinearSynchronizer"]

# Up to so many performances all pairs are compared: see docs/scaling.md.
_EXHAUSTIVE = 100
# Sizes of a portion of warping: worth sending away, and small enough to be shared out.
_PORTION_CELLS = 50_000_000
_PORTION_SEQUENCES = 256

# Sets of repeated trials leave 0.0001 to 0.02 (0.07 with 4 features and 20 % noise), sets of people
# 0.09 and more, single people 0.05 and more; there refining begins to help
# (benchmarks/accuracy.py); measured on at most so many performances.
_LARGEST_MISFIT = 0.07
_MISFIT_SAMPLE = 32


class LinearSynchronizer(Synchronizer):
    """Linear normalisation (Eq. 7): the same number of frames, no matching.

    The baseline that every other synchronizer is held against: each performance is
    stretched evenly to ``n_frames``; the pattern only serves as reference.

    Parameters
    ----------
    n_frames : int, default=None
        Frames of the common clock; by default the median length of the performances, or
        the length of a pattern given as an array.
    pattern : "median", int or array (n_frames, n_features), default="median"
        The reference of ``match``: the performance with the smallest sum of distances
        (Eq. 19, without matching), one chosen by its index, or another one.

    Attributes
    ----------
    pattern_ : ndarray, shape (P, n_features)
        The pattern on the common clock.
    pattern_index_ : int or None
        Its index in the training set; None if it was given as an array.
    n_frames_ : int
        ``P``.
    global_distances_ : ndarray, shape (n_sequences,)
        ``C_n`` of Eq. 19 for every performance; NaN if the pattern was given.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    DenseSynchronizer : Follows the changes of pace within a performance.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import LinearSynchronizer
    >>> X = [np.arange(5.0)[:, None], np.arange(9.0)[:, None] / 2]
    >>> LinearSynchronizer(n_frames=5).fit_transform(X)[1].ravel().tolist()
    [0.0, 1.0, 2.0, 3.0, 4.0]
    """

    def __init__(self, n_frames=None, pattern="median"):
        self.n_frames = n_frames
        self.pattern = pattern

    def _match(self, arrays):
        clock = np.arange(self.n_frames_, dtype=np.float64)
        on_clock = self._normalise(arrays, clock)
        distances = np.square(on_clock - self.pattern_).sum(axis=(1, 2))
        times = np.tile(clock, (len(arrays), 1))
        return Match(np.zeros_like(times), times, distances)


class DenseSynchronizer(CallbackSupportMixin, Synchronizer):
    """Synchronise performances by dense matching to the median one.

    1. Normalise all performances linearly to ``P`` frames (Eq. 7).
    2. Match ordered pairs: dynamic programming finds the offsets Delta(p) that
       minimise the synchronisation distance ``D_{n,m}`` (Eqs. 12-17)::

           sum_p |x_n(p) - x_m(p + Delta(p))|^2 + mu sum_p phi(rate)

       with both ends pinned and the local rate between 0 and ``max_rate``. By default
       velocities stand in for the points x (see ``cost``): people differ in where the body
       is more than in how it moves.
    3. The pattern is the performance with the smallest global distance
       ``C_n = sum_m D_{n,m}`` (Eq. 19), the "median" one; among more than 100 it is found
       by a part of all matches (see ``search``).
    4. Consensus: the time of the pattern reaches a performance straight, or by way of
       one of ``consensus`` exemplars, typical performances of the training set; the median
       of these routes outvotes a path that took a wrong valley. It is then smoothed.
    5. Refinement: if postures agree but for noise and gain, as they do in repeated trials of
       a single source, Gauss-Newton steps place every moment to a fraction of a frame.
    6. ``transform`` samples performances at ``tau(p) = p + Delta(p)`` (Eq. 18).

    The paper's exact method is ``DenseSynchronizer(cost="posture", max_rate=2, subframes=1,
    consensus=0)``. For repeated trials of a single source that are known to be such, use
    ``refine=True``.

    Parameters
    ----------
    n_frames : int, default=None
        ``P``, frames of the common clock; by default the median length of the performances,
        or the length of a pattern given as an array. Time grows with its square, as
        ``max_offset`` is a share of it.
    pattern : "median", int or array (n_frames, n_features), default="median"
        The median performance, one chosen by its index, or another one.
    cost : {"velocity", "elastic", "posture"}, default="velocity"
        What is compared. ``"velocity"``: how the point moves; at the local rate rho,
        ``v_n`` with ``(0.8 + 0.2 rho) v_m``. ``"elastic"``: its velocity
        divided by the square root of its speed, with weights that make the distance (of
        Fisher and Rao) independent of how either sequence is timed. ``"posture"``: where the
        point is, as in the paper.
    smoothness : float, default=0.003
        Weight of the changes of pace, a pure number: ``mu`` is ``smoothness`` times the
        mean squared norm of the compared features over the training set.
    max_offset : float, default=0.25
        Largest offset, as a share of ``n_frames``, in [0, 1].
    max_rate : float, default=4
        Largest local rate of a path; 2 is the limit of Eq. 13. The vote and the refinement
        may exceed it.
    subframes : int, default=1
        Positions a frame at which a path may stand. More than 1 serves direct paths
        (``consensus=0``); the vote, its smoothing and the refinement are finer anyway.
    velocity_smoothing : float, default=0.03
        Standard deviation of the Gaussian under which velocities are taken, as a share of the
        clip, so that it does not depend on the frame rate; beyond its ends a clip is
        continued by its point reflection. Noisy sensors want more: 0.1 for the Kinect.
    consensus : int, default=8
        How many exemplars vote on a warp; 0 for the direct path only, as in the paper, which
        is then neither smoothed nor, unless ``refine=True``, refined.
    warp_smoothing : float, default=0.02
        Standard deviation of the Gaussian under which the offsets are smoothed after the
        vote, as a share of the clip. More makes smoother synchronised movements and hits
        key moments less closely.
    refine : "auto" or bool, default="auto"
        Whether to refine warps by the postures. ``"auto"`` does so if there is a vote and
        the postures of the training set, matched without, leave a misfit of less than 7 % of
        their variance.
    search : {"auto", "exhaustive", "sampled"}, default="auto"
        How the median is found. ``"exhaustive"``: by all ``N (N - 1)`` matches. ``"sampled"``: by
        matches with random references, as few as it takes to be sure; see ``certified_``.
        ``"auto"``: exhaustively up to 100 performances.
    random_state : int, RandomState instance or None, default=0
        Draws the references of a sampled search. The default makes equal input give equal results.
    n_jobs : int, default=None
        How many jobs share the matches, in ``fit``, ``transform`` and ``match``. None means 1
        unless in a ``joblib.parallel_config`` context, -1 all cores. Results are the same to the
        last bit.
    verbose : int, default=0
        Above 0, print how far a long job is, at most once a second.

    Attributes
    ----------
    pattern_ : ndarray, shape (P, n_features)
        The pattern on the common clock.
    pattern_index_ : int or None
        Its index in the training set; None if it was given as an array.
    n_frames_ : int
        ``P``.
    global_distances_ : ndarray, shape (n_sequences,)
        ``C_n`` of Eq. 19 where it is exact: for every performance after an exhaustive search, for
        the best few after a sampled one; NaN for the others, and if nobody needed them.
    certified_ : bool
        Whether the pattern is the median of Eq. 19: known from all matches, or because a paired
        test rejected every other performance, all tests together erring with a probability of
        1 %. False if the pattern was given, or a sampled search ran out of the matches
        it may spend: 9 % of all, or 150 a performance if that is more.
    n_matches_ : int
        Matches made to choose the pattern and the exemplars.
    mu_ : float
        The absolute weight of the changes of pace.
    exemplars_ : ndarray of int
        Indices of the performances that vote.
    misfit_ : float
        Median share of the pattern's variance that matched postures leave, smoothed so that
        noise does not count; NaN unless ``refine="auto"`` had to find out.
    refines_ : bool
        Whether warps are refined.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    LinearSynchronizer : The baseline without matching.
    KeyframeSynchronizer : Matching by key-frames.
    ActionModel : What the synchronised performances have in common.

    References
    ----------
    M. Mozerov, I. Rius, X. Roca, J. Gonzalez, "3D Human Motion Sequences Synchronization
    Using Dense Matching Algorithm".

    Examples
    --------
    A known warp is found again. The second performance is up to 8 frames ahead in its first
    half, and behind in its second.

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
    >>> sync.transform(X).shape
    (2, 101, 2)
    """

    _parameter_constraints: dict = {
        **Synchronizer._parameter_constraints,
        "cost": [StrOptions({"velocity", "elastic", "posture"})],
        "smoothness": [Interval(Real, 0, None, closed="left")],
        "max_offset": [Interval(Real, 0, 1, closed="both")],
        "max_rate": [Interval(Real, 1, None, closed="left")],
        "subframes": [Interval(Integral, 1, None, closed="left")],
        "velocity_smoothing": [Interval(Real, 0, 1, closed="both")],
        "consensus": [Interval(Integral, 0, None, closed="left")],
        "warp_smoothing": [Interval(Real, 0, 1, closed="both")],
        "refine": [StrOptions({"auto"}), "boolean"],
        "search": [StrOptions({"auto", "exhaustive", "sampled"})],
        "random_state": ["random_state"],
        "n_jobs": [Integral, None],
        "verbose": ["verbose"],
    }

    def __init__(
        self,
        n_frames=None,
        pattern="median",
        cost="velocity",
        smoothness=0.003,
        max_offset=0.25,
        max_rate=4,
        subframes=1,
        velocity_smoothing=0.03,
        consensus=8,
        warp_smoothing=0.02,
        refine="auto",
        search="auto",
        random_state=0,
        n_jobs=None,
        verbose=0,
    ):
        self.n_frames = n_frames
        self.pattern = pattern
        self.cost = cost
        self.smoothness = smoothness
        self.max_offset = max_offset
        self.max_rate = max_rate
        self.subframes = subframes
        self.velocity_smoothing = velocity_smoothing
        self.consensus = consensus
        self.warp_smoothing = warp_smoothing
        self.refine = refine
        self.search = search
        self.random_state = random_state
        self.n_jobs = n_jobs
        self.verbose = verbose

    def _fit(self, arrays):
        with Progress(self, self.verbose) as self._progress:
            try:
                return super()._fit(arrays)
            finally:
                del self._progress

    def _prepare(self, arrays, on_clock):
        # Centred features keep the inner products of the trellis small.
        warper = Warper(
            cost=self.cost,
            subframes=self.subframes,
            velocity_smoothing=self.velocity_smoothing,
            centre=on_clock.mean(axis=(0, 1)),
            reach=self._reach,
            warp_smoothing=self.warp_smoothing,
        )
        features = warper.features(self._positions(arrays, on_clock))
        energy = np.einsum("npk,npk->", features, features, dtype=np.float64)
        self.mu_ = float(self.smoothness * energy / np.prod(features.shape[:2]))
        table = step_table(self.cost, self.max_rate, self.subframes)
        self._warper = warper._replace(trellis=Trellis(table, self.mu_, self._reach))
        return features

    @property
    def _reach(self):
        """Largest offset in whole frames; 0.29 * 100 must not lose one to rounding."""
        reach = int(np.floor(self.max_offset * self.n_frames_ * (1 + 1e-12)))
        return min(reach, self.n_frames_ - 1)

    def _positions(self, arrays, on_clock=None):
        """All performances at every sub-position of the common clock."""
        if self.subframes == 1 and on_clock is not None:
            return on_clock
        n_positions = (self.n_frames_ - 1) * self.subframes + 1
        return self._normalise(arrays, np.arange(n_positions) / self.subframes)

    def _choose_median(self, features, wanted):
        n, rounding = len(features), rounding_of(features)
        compare = partial(self._compare, features)
        if not wanted and (self.consensus == 0 or n <= self.consensus):
            # None of them, or all, are exemplars.
            median = super()._choose_median(features, wanted)
        elif self.search == "exhaustive" or (self.search == "auto" and n <= _EXHAUSTIVE):
            median = sum_all(compare, n, rounding)
        elif wanted:
            median = search_median(compare, n, rounding, check_random_state(self.random_state))
        else:
            median = estimate_distances(compare, n, check_random_state(self.random_state))
        self.n_matches_ = median.n_matches
        self.certified_ = median.certified and wanted
        return median

    def _compare(self, features, bases, moving):
        """Yield the synchronisation distances of all pairs, tile by tile."""
        trellis = self._warper.trellis
        tiles = list(trellis.tiles(len(bases), len(moving), features.shape[2]))
        cells = max(1, len(bases) * len(moving) // max(1, len(tiles))) * trellis.cells(features)
        # Which tiles go together makes no difference to the results: a few portions a worker.
        few = -(-len(tiles) // (4 * effective_n_jobs(self.n_jobs)))
        batches = even_slices(len(tiles), max(1, min(few, _PORTION_CELLS // cells)))
        portions = [(features, bases, moving, tiles[batch]) for batch in batches]
        name = f"comparing {len(bases)} with {len(moving)} performances"
        step = self._progress.stage(name, len(portions))
        compare = self._warper.distances
        for blocks in run(compare, portions, n_jobs=self.n_jobs, prefer="threads", step=step):
            yield from blocks

    def _learn(self, arrays, on_clock, source, estimates):
        self.exemplars_ = np.empty(0, dtype=np.intp)
        if self.consensus > 0:
            self.exemplars_ = choose_exemplars(estimates, self.consensus, self.pattern_index_)
        chosen = self._positions([source, *(arrays[k] for k in self.exemplars_)])
        portion = self.pattern_, chosen, self.consensus > 0
        (self._warper,) = run(self._warper.with_pattern, [portion])
        self.misfit_ = np.nan
        if self.refine == "auto":
            if self.consensus > 0:
                self.misfit_ = self._measure_misfit(arrays, on_clock)
            self.refines_ = self.misfit_ < _LARGEST_MISFIT
        else:
            self.refines_ = bool(self.refine)
        if self.refines_:
            self._warper = self._warper._replace(noise_width=choose_smoothing(on_clock))

    def _measure_misfit(self, arrays, on_clock):
        """Median misfit of the performances, or of evenly spaced ones of many."""
        others = np.array([i for i in range(len(arrays)) if i != self.pattern_index_])
        if len(others) == 0:
            return 0.0
        some = others[:: -(-len(others) // _MISFIT_SAMPLE)]
        positions = self._positions([arrays[i] for i in some], on_clock[some])
        results = self._in_portions(
            self._warper.misfits, positions, self._progress, "measuring the misfit"
        )
        return float(np.median(np.concatenate(results)))

    def _match(self, arrays):
        with Progress(self, self.verbose, fits=False) as progress:
            warps = self._warper.warps
            results = self._in_portions(warps, self._positions(arrays), progress, "warping")
        distances, times = (np.concatenate(parts) for parts in zip(*results, strict=True))
        return Match(times - np.arange(self.n_frames_), times, distances)

    def _disparity_space(self, array):
        """The disparity space of the pattern and one performance, for drawing (Fig. 2)."""
        return self._warper.disparity_space(self._positions([array]))

    def _in_portions(self, function, positions, progress, name):
        """Results of a function of the warper for portions of all performances."""
        cells = len(self._warper.bases) * self._warper.trellis.cells(positions)
        size = min(max(1, _PORTION_CELLS // cells), _PORTION_SEQUENCES)
        portions = [(positions, rows) for rows in even_slices(len(positions), size)]
        step = progress.stage(name, len(portions))
        return list(run(function, portions, n_jobs=self.n_jobs, step=step))
