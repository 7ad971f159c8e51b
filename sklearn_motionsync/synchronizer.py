"""Putting performances on one clock (Eqs. 7-19)."""

from numbers import Integral, Real

import numpy as np
from sklearn.utils._param_validation import Interval, StrOptions

from .clock import Synchronizer, distances_to_all
from .consensus import choose_exemplars, vote
from .features import cost_features, smooth
from .matching import Match, Trellis, step_table
from .refinement import choose_smoothing, misfit, refine_warps

__all__ = ["DenseSynchronizer", "LinearSynchronizer"]

# Bases handled between two looks at the result: bounds the memory of all pairs.
_BASES_AT_ONCE = 256

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

    def _global_distances(self, arrays, features):
        return distances_to_all(features)

    def _match(self, arrays):
        clock = np.arange(self.n_frames_, dtype=np.float64)
        on_clock = self._normalise(arrays, clock)
        distances = np.square(on_clock - self.pattern_).sum(axis=(1, 2))
        times = np.tile(clock, (len(arrays), 1))
        return Match(np.zeros_like(times), times, distances)


class DenseSynchronizer(Synchronizer):
    """Synchronise performances by dense matching to the median one.

    1. Normalise all performances linearly to ``P`` frames (Eq. 7).
    2. Match every ordered pair: dynamic programming finds the offsets Delta(p) that
       minimise the synchronisation distance ``D_{n,m}`` (Eqs. 12-17)::

           sum_p |x_n(p) - x_m(p + Delta(p))|^2 + mu sum_p phi(rate)

       with both ends pinned and the local rate between 0 and ``max_rate``. By default
       velocities stand in for the points x (see ``cost``): people differ in where the body
       is more than in how it moves.
    3. The pattern is the performance with the smallest global distance
       ``C_n = sum_m D_{n,m}`` (Eq. 19), the "median" one.
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
        or the length of a pattern given as an array. Time and memory grow with its square.
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

    Attributes
    ----------
    pattern_ : ndarray, shape (P, n_features)
        The pattern on the common clock.
    pattern_index_ : int or None
        Its index in the training set; None if it was given as an array.
    n_frames_ : int
        ``P``.
    global_distances_ : ndarray, shape (n_sequences,)
        ``C_n`` of Eq. 19 for every performance; NaN if neither pattern nor consensus
        needed them.
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

    @property
    def _compares_all(self):
        return self.consensus > 0

    def _prepare(self, arrays, on_clock):
        # Centred features keep the inner products of the trellis small.
        self._centre = on_clock.mean(axis=(0, 1))
        features = self._features(arrays)
        self.mu_ = float(self.smoothness * np.square(features).sum(axis=2).mean(dtype=np.float64))
        return features

    @property
    def _reach(self):
        """Largest offset in whole frames; 0.29 * 100 must not lose one to rounding."""
        reach = int(np.floor(self.max_offset * self.n_frames_ * (1 + 1e-12)))
        return min(reach, self.n_frames_ - 1)

    def _trellis(self):
        table = step_table(self.cost, self.max_rate, self.subframes)
        return Trellis(table, self.mu_, self._reach)

    def _features(self, arrays):
        """What is compared, of every performance, at every sub-position."""
        n_positions = (self.n_frames_ - 1) * self.subframes + 1
        positions = self._normalise(arrays, np.arange(n_positions) / self.subframes)
        return cost_features(
            positions - self._centre, self.cost, self.subframes, self.velocity_smoothing
        )

    def _global_distances(self, arrays, features):
        trellis, bases = self._trellis(), features[:, :: self.subframes]
        sums = [
            trellis.distances(bases[i : i + _BASES_AT_ONCE], features).sum(axis=1, dtype=np.float64)
            for i in range(0, len(bases), _BASES_AT_ONCE)
        ]
        return np.concatenate(sums)

    def _learn(self, arrays, on_clock, source):
        self.exemplars_ = np.empty(0, dtype=np.intp)
        if self.consensus > 0:
            self.exemplars_ = choose_exemplars(
                self.global_distances_, self.consensus, self.pattern_index_
            )
        chosen = self._features([source, *(arrays[k] for k in self.exemplars_)])
        self._bases = chosen[:, :: self.subframes].copy()
        self._to_exemplars = self._paths(self._bases[0], chosen[1:])[1]
        self.misfit_ = np.nan
        if self.refine == "auto":
            if self.consensus > 0:
                self.misfit_ = self._measure_misfit(arrays, on_clock)
            self.refines_ = self.misfit_ < _LARGEST_MISFIT
        else:
            self.refines_ = bool(self.refine)
        if self.refines_:
            self._smoothing = choose_smoothing(on_clock)

    def _measure_misfit(self, arrays, on_clock):
        """Median misfit of the performances, or of evenly spaced ones of many."""
        others = np.array([i for i in range(len(arrays)) if i != self.pattern_index_])
        if len(others) == 0:
            return 0.0
        some = others[:: -(-len(others) // _MISFIT_SAMPLE)]
        times = self._vote([arrays[i] for i in some])[1]
        return float(np.median(misfit(self.pattern_, on_clock[some], times)))

    def _match(self, arrays):
        distances, times = self._vote(arrays)
        if self.refines_:
            on_clock = self._normalise(arrays, np.arange(self.n_frames_))
            curves = np.concatenate([self.pattern_[np.newaxis], on_clock])
            if self._smoothing > 0:
                curves = smooth(curves, self._smoothing)
            times = refine_warps(curves[0], curves[1:], times, self._reach)
        return Match(times - np.arange(self.n_frames_), times, distances)

    def _vote(self, arrays):
        """Distances of the direct paths, and smoothed times after the vote of the exemplars."""
        moving = self._features(arrays)
        distances, direct = self._paths(self._bases[0], moving)
        if self.consensus == 0:
            return distances, direct
        times = direct
        if len(self.exemplars_):
            routes = np.stack([self._paths(base, moving)[1] for base in self._bases[1:]])
            times = vote(direct, self._to_exemplars, routes)
        times = self._smooth_warps(times)
        # A path without any distance is right: the pattern keeps its own pace.
        rounding = 64 * np.finfo(moving.dtype).eps * np.square(self._bases[0]).sum()
        return distances, np.where((distances <= rounding)[:, np.newaxis], direct, times)

    def _smooth_warps(self, times):
        """Warps whose offsets are smoothed and in the band, pinned and non-decreasing."""
        frames, sigma = np.arange(self.n_frames_), self.warp_smoothing * (self.n_frames_ - 1)
        offsets = times - frames
        if sigma > 1 / 3:
            offsets = smooth(offsets[:, :, np.newaxis], sigma)[:, :, 0]
            offsets[:, [0, -1]] = 0
        times = frames + np.clip(offsets, -self._reach, self._reach)
        return np.maximum.accumulate(np.clip(times, 0, self.n_frames_ - 1), axis=1)

    def _paths(self, base, moving):
        distances, disparities = self._trellis().paths(base, moving)
        return distances, np.arange(self.n_frames_) + disparities / self.subframes
