"""OnlineSynchronizer: the phase of trials that are still running."""

from __future__ import annotations

import math
from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator, MetaEstimatorMixin, clone
from sklearn.utils.validation import check_is_fitted

from ..inputs.numbers import check_magnitude
from ..inputs.types import Indexed, NumbersLike, SupportsArray, TrialsLike, ValuesLike
from ..inputs.validation import SequenceLevelMixin, names_of_input
from ..matching.costs import step_table
from ..matching.counting import first_largest
from ..matching.filters import SMOOTHING
from ..matching.matcher import cost_features
from ..matching.metric import Metric, compressed
from ..matching.trellis import Trellis
from ..matching.warps import normalise
from ..matching.warps import sample as sample_at
from ..synchronizers.base import Synchronizer
from ..synchronizers.dense import DenseSynchronizer
from ..utils.parallel import LongWorkMixin
from ..utils.parameters import FRAME_RATE, validated_with_nested
from .causal import CausalTrellis, causal_velocity
from .stream import (
    LivePhase,
    Session,
    check_observations,
    check_recordings,
    check_times,
    gains_of,
    phase_bounds,
    phase_probabilities,
    stack_phases,
    window_length,
)


class OnlineSynchronizer(LongWorkMixin, SequenceLevelMixin, MetaEstimatorMixin, BaseEstimator):
    """The phase of a trial while it runs, frame by frame, however long it will last.

    The frames so far are the base of the trellis, and the mean of the synchronised training
    trials is the moving sequence (Eqs. 12-17). A trial begins with frame 0 of the
    pattern; its phase is the best cell of the last row. A frame costs one row of the trellis,
    whatever came before it, and no phase depends on later frames. With ``cyclic=True`` the mean is
    one cycle of a movement that goes on, such as walking, and the row is a circle.

    Parameters
    ----------
    synchronizer : Synchronizer, default=None
        Synchronises the training trials; a clone of it is fitted. None is ``DenseSynchronizer()``.
    frame_rate : float, default=None
        Frames a second of the training trials. Times are then in seconds; without it
        in frames of the training trials.
    cyclic : bool, default=False
        Whether the training trials are cycles of a movement that repeats, such as strides cut
        by `CycleSegmenter`: each ends where it begins. The phase then begins anywhere in the cycle,
        goes on with 0 after P - 1, and ``LivePhase.cycle`` counts cycles.

    Attributes
    ----------
    synchronizer_ : Synchronizer
        The fitted synchronizer.
    mean_ : ndarray, shape (P, n_features)
        Mean of the training trials on the clock of the pattern; of cycles the last frame is
        the first one.
    duration_ : float
        Mean time from the first frame of a training trial to its last, in frames: the mean
        of ``n_frames - 1``.
    n_frames_ : int
        ``P``.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    MotionTracker : Poses and phase of a body that is partly hidden.
    DenseSynchronizer : For whole trials.

    Notes
    -----
    ``step`` and ``reset`` change the estimator, which holds the running trials. A copy, or an
    unpickled estimator, goes on by itself from there.

    The features are those of the synchronizer, with its learnt metric, from causal velocities and
    from poses less the mean pose. The velocity filters delay both sequences alike. The rate
    is at most 3. The phase may go back when later frames contradict it. No rest is needed before
    the beginning: a performer at rest there stays in the first frames of the clock. In the last
    pose the phase is the end, P - 1.

    When the movement begins anew, before its end or after it, the phase goes back and
    ``LivePhase.cycle`` rises: as soon as a path that began again, at a cost of 6 temperatures,
    is cheaper than the one so far. While a performer stands still no such path gains on it, so a
    pause is none. ``reset`` says for certain that the next frame is the first one.

    A cyclic movement needs no ``reset``. Its first frame may show any phase: the phase is 0 with
    confidence 0 until velocities are known, in the second frame. When the phase passes P - 1,
    which is the same as 0, ``LivePhase.cycle`` rises; in cycles cut at foot strikes that is a
    strike. Where it goes back over the beginning by a twentieth of the clock at most it stays at
    0, so that no cycle begins twice; where it goes back farther, ``cycle`` falls. ``lower`` and
    ``upper`` lie half a cycle from the phase at most, and may be below 0 or above P - 1.

    The confidence is the probability mass within a twentieth of the clock of the phase, divided by
    the square of the recent cost in units of the typical cost, where it is above that. The
    temperature of the probabilities and the typical cost are learnt: each training trial is
    matched to the mean of the others. From a single trial they cannot be learnt, and are
    the medians of 16 actions of people. Other actions cost more. A movement that is its own
    reverse, such as a bend, costs no more backwards, and standing still costs nothing where the
    mean stands still. The typical cost of a cycle is the geometric mean of that and the cost of
    standing still, in the pose of the cycle where that costs least.

    Features that are NaN are not compared. During frames of NaN, or time without frames,
    the phase moves on at the mean pace. Between the frames that show it a feature is interpolated
    linearly, across gaps of a quarter of the clock at most.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import ASpace, DirectionCosines
    >>> from sklearn_motionsync.live import OnlineSynchronizer
    >>> from sklearn_motionsync.datasets import make_bending
    >>> from sklearn.pipeline import make_pipeline
    >>> bunch = make_bending(12, random_state=0)
    >>> features = make_pipeline(DirectionCosines(bunch.skeleton), ASpace())
    >>> X = features.fit_transform(bunch.data[:11])
    >>> live = OnlineSynchronizer(frame_rate=30).fit(X)
    >>> frames = features.transform(bunch.data[11:])[0]
    >>> for k, frame in enumerate(frames[: len(frames) // 2]):
    ...     live_phase = live.step(frame, time=k / 30)
    >>> 0.4 < live_phase.phase / (live.n_frames_ - 1) < 0.6
    True
    >>> 1 < live.time_left() < len(frames) / 30  # seconds
    True

    In the first pose the trial does not go on:

    >>> live.reset()
    >>> for k in range(200):
    ...     live_phase = live.step(frames[0])
    >>> live_phase.rate
    0.0

    Strides of a walk are counted. It shows nine, the end of one before, and the beginning of one
    after them:

    >>> from sklearn_motionsync.datasets import make_gait
    >>> strides, walk = make_gait(6, random_state=0), make_gait(7, 9, takes=True, random_state=0)
    >>> live = OnlineSynchronizer(cyclic=True).fit(strides.data)
    >>> for frame in walk.data[6]:
    ...     live_phase = live.step(frame)
    >>> live_phase.cycle, len(walk.data[6])
    (10, 1026)
    """

    _parameter_constraints: dict = {
        "synchronizer": [Synchronizer, None],
        "frame_rate": [FRAME_RATE, None],
        "cyclic": ["boolean"],
    }

    _session: Session | None

    def __init__(
        self,
        synchronizer: Synchronizer | None = None,
        frame_rate: float | None = None,
        cyclic: bool = False,
    ) -> None:
        self.synchronizer = synchronizer
        self.frame_rate = frame_rate
        self.cyclic = cyclic

    @validated_with_nested
    def fit(
        self,
        X: TrialsLike,
        y: object = None,
        keyframes: Indexed[ValuesLike | None] | SupportsArray | None = None,
    ) -> Self:
        """Learn the mean trial, its duration, and the scale of path costs.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.
        y : ignored
            Passed to the synchronizer.
        keyframes : list of arrays (n_keyframes,), 2-D array or DataFrame, default=None
            Key-frames of each trial, passed to the synchronizer, which has to take them. With a
            ``frame_rate`` they are seconds.

        Returns
        -------
        OnlineSynchronizer
            The fitted estimator.

        Raises
        ------
        ValueError
            As from the ``fit`` of the synchronizer; or if ``cyclic=True`` and the trials do
            not end where they begin.
        """
        sync = DenseSynchronizer() if self.synchronizer is None else clone(self.synchronizer)
        trials = self._check_training_set(X)
        metadata: dict[str, Any] = {} if keyframes is None else {"keyframes": keyframes}
        if metadata and self.frame_rate is not None:
            metadata["frame_rate"] = self.frame_rate
        with self._progress(fits=True) as progress:
            with progress.fitting(sync, "synchronizing"):
                sync.fit(X, y, **metadata)
            match = sync.match(X, **metadata)
            warped = match.warp(trials)
            if self.cyclic:
                check_cycles(sync.features_.unit(warped.mean(axis=0)))
                trials, warped = list(map(closed, trials)), closed(warped)
            mean = warped.mean(axis=0)
            duration = float(np.mean([len(x) for x in trials]) - 1)

            def reference_of(mean, *calibration):
                return Reference(sync.features_, mean, duration, *calibration, cyclic=self.cyclic)

            calibration = calibrate(reference_of, trials, warped, match.times, progress)
            reference = reference_of(mean, *calibration, _RESTART * calibration[0])
        self.synchronizer_, self.n_frames_ = sync, sync.n_frames_
        self.mean_, self.duration_ = mean, duration
        self._reference, self._session = reference, None
        return self

    def step(self, frame: NumbersLike, time: float | None = None) -> LivePhase:
        """Take the next frame, and estimate the phase.

        Parameters
        ----------
        frame : array-like, shape (n_features,), or (n_streams, n_features)
            A frame of one trial, or of several that run side by side. NaN is not seen.
        time : float, default=None
            Time of the frame: in seconds if there is a ``frame_rate``, else in frames of the
            training trials; from any origin. None: a frame of the training trials
            after the one before.

        Returns
        -------
        LivePhase
            ``phase``, ``rate``, ``confidence``, ``lower`` and ``upper``: numbers for one
            trial, arrays (n_streams,) for several.

        Raises
        ------
        ValueError
            If the frame is infinite or above 1e9, has another width or other names, there are not
            as many streams as in the frames before, or time does not increase, by 1e-9 to 1e9
            frames. The trial then goes on as if the frame had not been given.
        """
        if "_session" not in self.__dict__:
            check_is_fitted(self, "mean_")
        width = self.mean_.shape[1]
        frame = check_observations(frame, "The frame", names_of_input(self), width, (1, 2))
        largest = np.abs(frame).max(initial=0.0, where=~np.isnan(frame))
        check_magnitude(float(largest), "The frame", training=False)
        session = self._session
        last = None if session is None else session.time
        time = float(check_times(time, 1, self.frame_rate, "The frame", last)[0])
        if session is None:
            session = self._session = Session(self._reference, frame, time)
        return session.step(frame, time)

    def reset(self) -> None:
        """Begin other trials, and time, with the next frame, and count from 0 again."""
        check_is_fitted(self, "mean_")
        self._session = None

    def time_left(self) -> Any:
        """Estimate the time until the trial ends, or the cycle that runs.

        Of a cycle what is left of the phase, at the pace of the last cycle. Otherwise a weighted
        mean of what is left of the mean duration after the elapsed time, and of what is left of the
        phase at the mean pace; the phase, as a share of the clock, is the weight of the second.
        docs/design.md has a table of its errors.

        Returns
        -------
        float, or ndarray of shape (n_streams,)
            Seconds if there is a ``frame_rate``, else frames of the training trials.
        """
        check_is_fitted(self, "mean_")
        session = self._session
        left = self._reference.duration if session is None else session.time_left()
        return left if self.frame_rate is None else left / self.frame_rate

    def track(
        self,
        X: TrialsLike,
        times: Indexed[ValuesLike] | ValuesLike | None = None,
    ) -> list[LivePhase]:
        """The phases of whole trials, as ``step`` estimates them frame by frame.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials, each independent of the others and of ``step``. NaN is not seen.
        times : list of array-like (n_frames_i,), default=None
            Times of the frames of each trial, as in ``step``.

        Returns
        -------
        list of LivePhase
            Of arrays (n_frames_i,).

        Raises
        ------
        ValueError
            As from ``step``; or if there are not as many times as trials.
        """
        check_is_fitted(self, "mean_")
        tracks = []
        for frames, t in zip(*check_recordings(self, X, times, self._fitted_on_rows), strict=True):
            session = Session(self._reference, frames[0], t[0])
            tracks.append(stack_phases(list(map(session.step, frames, t))))
        return tracks


# -- the reference: what running trials are matched to -------------------------------

# Positions a frame of the pattern.
_SUBFRAMES = 2
# Weight of the change of pace, ``mu``, in units of the mean squared norm of the features; and the
# largest rate, in units of the mean pace.
_SMOOTHNESS, _MAX_RATE = 0.1, 3
# After the end the last pose is held for so many widths of the velocity filters, after which
# these have forgotten the movement.
_REST = 6


class Reference:
    """A mean trial that running trials are matched to, and its trellis.

    The features are those of the synchronizer, from causal velocities and poses. Velocities of
    both sequences have the same delay. Poses are centred at the mean pose of the reference,
    as the mean of a running trial is not known yet.

    Parameters
    ----------
    features : Features
        Of the fitted synchronizer.
    mean : ndarray, shape (P, n_features)
        The mean trial.
    duration : float
        Mean duration of the training trials, in their frames.
    temperature : float, default=1.0
        Path costs over it are negative log-probabilities of phases.
    typical_cost : float, default=inf
        Mean cost of a sample that half of the training trials never exceed.
    interval_temperature : float, default=1.0
        Path costs over it give the probabilities whose quantiles bound the phase.

    Attributes
    ----------
    n_frames : int
        ``P``.
    duration : float
        Mean duration, in frames of the training trials.
    width : float
        Time constant of the velocity filters, in frames of the clock.
    step : float
        A frame of the clock, in frames of the training trials.
    features : FeatureSubset
        All features.
    moving : ndarray, shape (Q, n_compared)
        Those of the mean trial, with its last pose held.
    poses : ndarray, shape (Q, n_features)
        Its poses, in the unit of the features.
    speed : ndarray, shape (n_features,)
        The mean square of its velocity.
    trellis : Trellis
    """

    def __init__(
        self,
        features,
        mean,
        duration,
        temperature=1.0,
        typical_cost=np.inf,
        interval_temperature=1.0,
        restart_cost=np.inf,
        cyclic=False,
    ):
        last = len(mean) - 1
        self.cyclic, self.restart_cost = cyclic, restart_cost
        self.cost, self.metric, self.unit = features.cost, features.metric, features.unit
        self.n_frames, self.width, self.step = len(mean), SMOOTHING * last, duration / last
        self.duration = self.step * last
        self.temperature, self.typical_cost = temperature, typical_cost
        self.interval_temperature = interval_temperature
        poses = self.unit(normalise([mean.astype(np.float64)], len(mean), _SUBFRAMES)[0])
        self.centre, self._n_positions = poses.mean(axis=0), len(poses)
        rest = 0 if cyclic else max(1, math.ceil(_REST * self.width))
        held = np.repeat(poses[-1:], rest * _SUBFRAMES, axis=0)
        self.poses = np.concatenate([poses, held])
        self._velocity = causal_velocity(self.poses, _SUBFRAMES, self.width, cyclic)
        self.speed = np.square(self._velocity[: self._n_positions]).mean(axis=0)
        self.features, self._cached = self._subset(np.arange(mean.shape[1])), {}
        self.moving = self.features.moving
        mu = _SMOOTHNESS * float(np.square(self.moving).sum(axis=1).mean())
        # No step is longer than the pattern.
        table = step_table(self.cost, min(_MAX_RATE, last), _SUBFRAMES)
        self.trellis = Trellis(table, mu, last + rest, running=True)

    def begin(self, n_streams=1):
        """The `CausalTrellis` of so many streams."""
        return CausalTrellis(self.trellis, self.moving, n_streams, self.cyclic, self.restart_cost)

    def subset(self, columns):
        """The `FeatureSubset` of some columns, a tuple; None if none of them is compared."""
        cached = self._cached
        if columns not in cached:
            # A hidden feature stays hidden for a while, and two subsets serve one that flickers.
            # Threads share the cache, so it is replaced, never changed.
            subset = self._subset(np.array(columns, dtype=np.intp))
            # Features that are constant in the mean say nothing of the phase.
            if subset is not None and not subset.moving.any():
                subset = None
            cached = self._cached = {**dict(list(cached.items())[-1:]), columns: subset}
        return cached[columns]

    def _subset(self, columns):
        metric = self.metric
        if metric is not None:
            rows = np.isin(metric.features, columns)
            columns = metric.features[rows]
            # The energy of the mean trial in these features.
            velocity = self._velocity[: self._n_positions, columns]
            energy = float(np.square(velocity).sum(axis=1).mean())
            metric = Metric(columns, energy, metric.velocity[rows], metric.pose[rows])
            columns = columns if energy > 0 else columns[:0]
        if not len(columns):
            return None
        return FeatureSubset(self, columns, metric, self._velocity, self.poses)


class FeatureSubset:
    """Some of the features of a `Reference`; ``moving`` (Q, n_compared) are those of its mean."""

    def __init__(self, reference, columns, metric, velocity, poses):
        self._cost, self._centre = reference.cost, reference.centre
        self._columns, self._metric = columns, metric
        self.moving = self.compare(velocity, poses)

    def compare(self, velocity, poses):
        """Features of velocities and poses (n, n_features) in the unit of the reference."""
        velocity = velocity[:, self._columns]
        poses = (poses - self._centre)[:, self._columns]
        if self._metric is None:
            return cost_features(poses, self._cost, velocity=velocity)
        return self._metric.of_parts(compressed(velocity, self._metric.energy), poses)


# -- calibration: what path costs say, learnt from the training trials ---------------

# Trials, and moments of each, that calibration uses at most.
_MAX_TRIALS, _MAX_MOMENTS = 24, 120
# Largest distance of the ends of a cycle, in root mean square deviations. Measured: 0.01 to 0.8 for
# strides, 1.7 to 2.5 for sitting down, standing up, picking up, throwing.
_APART = 1.5
# A cycle is repeated so many times, of which all but the first count.
_REPEATED = 3
# Poses of a cycle in which a stream may stand still. That cost, in typical costs, is at least so
# much: the confidence is then below one half.
_POSES, _STANDING = 16, 1.5
# Temperatures that are tried, in mean squared features of a sample; the smallest probability.
_TEMPERATURES = np.geomspace(0.01, 1e3, 41)
_MIN_PROBABILITY = 1e-12
# For a single training trial: medians of 16 actions of people, in mean squared features.
_DEFAULT_TEMPERATURE, _DEFAULT_COST = 0.7, 0.5
# Share of the training phases inside the intervals. Other training trials are partly of the
# same person. For new people temperatures are raised, of actions and of cycles: docs/design.md.
_COVERAGE, _NEW_PEOPLE = 0.9, (1.5, 6.0)
# The cost of beginning anew, in temperatures.
_RESTART = 6.0
# Of intervals, for a single training trial: by pairs of people of HDM05.
_DEFAULT_INTERVAL = 8.0


def calibrate(reference_of, trials, warped, times, progress):
    """Learn the temperature, the typical cost and the interval temperature of a `Reference`.

    Each training trial is matched to the mean of the others, of which ``reference_of`` makes a
    `Reference`. The temperature maximises the likelihood of the phases of the synchronizer,
    ``times`` (n_sequences, P). That of the intervals is the lowest at which nine tenths of these
    phases are inside, raised for new people. ``warped`` (n_sequences, P, n_features) are the
    synchronised trials.
    """
    n, total = len(trials), warped.sum(axis=0, dtype=np.float64)
    chosen = np.unique(np.linspace(0, n - 1, _MAX_TRIALS).round().astype(np.intp))
    (scores, shares), largest = np.zeros((2, len(_TEMPERATURES))), []
    # Of a constant mean all costs are 0, in any unit.
    whole = reference_of(total / n)
    energy = float(np.square(whole.moving).sum(axis=1).mean()) or 1.0
    # Copies of one trial have no costs but rounding, and nor has a mean that stands still.
    least = _MIN_PROBABILITY * energy
    standing = max(cost_of_standing(whole), least) if whole.cyclic else np.inf
    if n == 1:
        typical_cost = min(energy * _DEFAULT_COST, standing / _STANDING)
        return energy * _DEFAULT_TEMPERATURE, typical_cost, energy * _DEFAULT_INTERVAL
    step = progress.stage("calibrating", len(chosen))
    for i in chosen:
        reference = reference_of((total - warped[i]) / (n - 1))
        costs, truth, largest_cost = _match_live(reference, trials[i], times[i])
        largest.append(largest_cost)
        subframes, last = reference.trellis.table.subframes, reference.n_frames - 1
        phases, right_phases = np.minimum(costs.argmin(axis=1) / subframes, last), truth / subframes
        gains = gains_of(costs)
        if reference.cyclic:
            # By the shorter way from the phases.
            right_phases = right_phases + last * np.round((phases - right_phases) / last)
        for k, temperature in enumerate((energy * _TEMPERATURES).tolist()):
            right = phase_probabilities(gains, temperature)[np.arange(len(costs)), truth]
            scores[k] += np.log(np.maximum(right, _MIN_PROBABILITY)).mean()
            every = np.full(len(gains), temperature)
            at_frames = gains[:, ::subframes]
            lower, upper = phase_bounds(at_frames, every, phases, last, reference.cyclic)
            shares[k] += np.mean((lower <= right_phases) & (right_phases <= upper)) / len(chosen)
        step()
    typical_cost = max(np.median(largest), least)
    if whole.cyclic:
        # Cycles of new people cost more than those of the training set, less than standing still.
        typical_cost = min(np.sqrt(typical_cost * standing), standing / _STANDING)
    temperature = float(energy * _TEMPERATURES[first_largest(scores)])
    enough = np.append(np.flatnonzero(shares >= _COVERAGE), len(shares) - 1)[0]
    interval_temperature = _NEW_PEOPLE[whole.cyclic] * energy * _TEMPERATURES[enough]
    return temperature, float(typical_cost), float(interval_temperature)


def cost_of_standing(reference):
    """The mean cost of a sample while standing still, in the pose of a cycle that costs least.

    The first half of a cycle is left out.
    """
    poses = reference.poses[:: max(1, len(reference.poses) // _POSES)]
    samples = reference.features.compare(np.zeros_like(poses), poses)
    live, costs = reference.begin(len(samples)), []
    for _ in range(reference.n_frames):
        live.advance(samples)
        costs.append(live.best()[1])
    half = reference.n_frames // 2
    return float((costs[-1] - costs[-1 - half]).min() / half)


def _match_live(reference, trial, times):
    """Path costs at even moments, the true positions there, and the largest mean cost.

    The costs are above the least of their moment, in single precision. A cycle is repeated, and
    the first time is left out.
    """
    duration, last, first, stop = len(trial) - 1, reference.n_frames - 1, 0, 1
    if reference.cyclic:
        first, stop = 1, _REPEATED
        trial = np.concatenate([trial[:-1]] * (stop - 1) + [trial])
    moments = np.arange(0, stop * duration * (1 + 1e-9), reference.step) / duration
    samples = sample_at([trial], moments[np.newaxis] * last, stop * last + 1)[0]
    poses = reference.unit(samples)
    base = reference.features.compare(causal_velocity(poses, 1, reference.width), poses)
    live, costs, total = reference.begin(), [], 0.0
    mean_cost = largest = 0.0
    counted = np.flatnonzero(moments >= first)
    every, window = -(-len(counted) // _MAX_MOMENTS), window_length(reference.n_frames)
    for k, sample in enumerate(base):
        live.advance(sample[np.newaxis])
        now = float(live.best()[1][0])
        mean_cost, total = mean_cost + (now - total - mean_cost) / min(k + 1, window), now
        if k < counted[0]:
            continue
        largest = max(largest, mean_cost)
        if (k - counted[0]) % every == 0:
            row = live.costs[0]
            costs.append(row - row.min())
    # Where tau is constant, any phase of that interval is right.
    rising = times + 1e-9 * np.arange(len(times))
    shares = moments[counted[::every]]
    shares -= np.minimum(np.floor(shares), stop - 1)
    phases = np.interp(shares * last, rising, np.arange(len(times)))
    truth = np.round(phases * reference.trellis.table.subframes).astype(np.intp)
    # What overflows has no probability.
    with np.errstate(over="ignore"):
        return np.array(costs, dtype=np.float32), truth % len(costs[0]), largest


def closed(cycles):
    """Cycles (..., n_frames, n_features) whose last frame is the first, by what drifts evenly."""
    drift = cycles[..., -1:, :] - cycles[..., :1, :]
    out = cycles - np.linspace(-0.5, 0.5, cycles.shape[-2])[:, np.newaxis] * drift
    # Rounding leaves no difference.
    out[..., -1, :] = out[..., 0, :]
    return out.astype(cycles.dtype, copy=False)


def check_cycles(mean):
    """Refuse a mean trial (P, n_features) that does not end where it begins."""
    size = np.sqrt(np.square(mean - mean.mean(axis=0)).sum(axis=1).mean())
    apart = np.linalg.norm(mean[-1] - mean[0])
    if apart > _APART * size:
        raise ValueError(
            f"With cyclic=True trials are cycles, each ends where it begins; but the mean of "
            f"these ends {apart / size:.1f} times its root mean square deviation away from its "
            f"first frame, and {_APART:g} is the limit. Cut takes with CycleSegmenter, or set "
            "cyclic=False for a movement that is done once."
        )
