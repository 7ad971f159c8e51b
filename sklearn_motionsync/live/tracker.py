"""MotionTracker: a body that is partly hidden, by state-space models of its action."""

from __future__ import annotations

from numbers import Integral, Real
from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator, clone
from sklearn.utils import check_random_state
from sklearn.utils._param_validation import HasMethods, Interval
from sklearn.utils.validation import check_is_fitted

from ..body.joint_noise import JointNoise
from ..inputs.collections import as_collection
from ..inputs.numbers import LARGEST
from ..inputs.types import Indexed, Labels, RandomState, TrialsLike, ValuesLike
from ..inputs.validation import SequenceLevelMixin, names_of_input
from ..synchronizers.dense import DenseSynchronizer
from ..synchronizers.match import check_match
from ..utils.groups import encode_groups
from ..utils.parallel import LongWorkMixin, one_blas_thread
from ..utils.parameters import FRAME_RATE, validated
from .members import RunningTake, Track, filter_take, smooth_take, stack_frames
from .state_space import Clock, TrackerModel
from .stream import check_observations, check_recordings, check_times


class MotionTracker(LongWorkMixin, SequenceLevelMixin, BaseEstimator):
    """Track a body that is partly hidden, by the mean of its action and the variation of people.

    Given the phase p of the action, a pose is ``mean(p) + deviation``, and an observation
    ``y = pose + noise``.

    1. The mean is that of the synchronised training trials. Deviations are those from the
       mean of the other groups, so that they are those of a new person.
    2. Deviations are a Matern-3/2 process in time, as a state-space model, with one length scale
       and a covariance of the features that is shrunk half-way to its diagonal. A Kalman filter
       estimates them; hidden features are left out of the observation.
    3. A Rao-Blackwellised particle filter estimates the phase and its rate. The log rate is an
       Ornstein-Uhlenbeck process with the spread and the memory of the training trials. All
       particles share one Kalman gain.
    4. The weights are likelihoods of causal velocities, compared with those of the mean along the
       path of the particle. The style of a person persists, so frames are not independent:
       log-likelihoods of poses are not used, and those of the velocities of every hundredth of the
       mean duration are divided by 10.
    5. A second Kalman filter knows no phase: deviations are those from the mean of all frames. Both
       estimates are multiplied as densities, each to the power of its weight. The weights are 3 to
       1, divided by the mean variance of each estimate. The covariance of either is larger by its
       evidence, the average normalised innovation squared (NIS), where that is above 1.
    6. If the average NIS of velocities, or of poses about the mean, exceeds its limit, the phase
       is lost: particles are spread over the whole clock, until they agree with the observations.
       At the end of a movement restart times are exponential.

    Parameters
    ----------
    synchronizer : synchronizer, default=None
        Synchronises the training trials; a clone of it is fitted. None is `DenseSynchronizer()`.
    n_particles : int, default=500
        Particles of phase and rate.
    noise : float or JointNoise, default=0.05
        Standard deviation of observations, in the unit of the features, up to 1e9; the default is
        one of direction cosines. ``JointNoise(0.02, cosines)`` is that of joint positions, 2 cm
        for metres, which shows more in short limbs.
    frame_rate : float, default=None
        Frames a second of the training trials. Times are then in seconds; without it
        in frames of the training trials.
    random_state : int, RandomState instance or None, default=0
        Determines the seed that ``fit`` draws. Every take begins with this seed, so that equal
        observations have equal results, alone or among other takes.

    Attributes
    ----------
    mean_ : ndarray, shape (P, n_features)
        The mean trial.
    n_frames_ : int
        ``P``, frames of the clock.
    duration_ : float
        Mean time from the first frame of a training trial to its last, in frames: the mean
        of ``n_frames - 1``.
    synchronizer_ : synchronizer
        The fitted synchronizer.
    covariance_ : ndarray, shape (n_features, n_features)
        Of deviations from the mean.
    length_scale_ : float
        Of the Matern-3/2 process, in frames of the training trials.
    rate_spread_ : float
        Standard deviation of the log rate.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    DirectionCosines : Makes poses of joint positions, which all people share.
    JointNoise : Noise of joint positions, as it shows in them.
    DenseSynchronizer : Puts the training trials on one clock.

    Notes
    -----
    Without observations (all NaN) the movement goes on at the mean pace, and the covariance grows.
    A frame is ignored if its NIS exceeds 100, and ten times the largest NIS of the training
    trials; after several such frames the phase is lost. A take may begin at any phase; most
    particles begin at the first frame. After a gap in time as long as the movement, particles are
    at the end, or have restarted.

    Standing still in a pose of the action, or doing it backwards, is not called lost: the
    poses are possible, and the velocities not improbable enough. Takes of another action are
    drawn to poses of this one, with wider bands. Part of their frames is called lost: of people
    14 to 74 %, the less the noisier the joints.

    Examples
    --------
    A movement with one of two features hidden for a while.

    >>> import numpy as np
    >>> from sklearn_motionsync import LinearSynchronizer
    >>> from sklearn_motionsync.live import MotionTracker
    >>> t = np.linspace(0, 1, 60)
    >>> def movement(size):
    ...     return np.column_stack([size * np.cos(6 * t), size * np.sin(6 * t)])
    >>> tracker = MotionTracker(LinearSynchronizer(), noise=0.02)
    >>> tracker = tracker.fit([movement(size) for size in (0.9, 1.0, 1.1, 1.2)])
    >>> take = movement(1.05)
    >>> hidden = take.copy()
    >>> hidden[20:40, 1] = np.nan
    >>> track = tracker.track(hidden)
    >>> track
    Track(60 frames of 2 features, 0 of them lost)
    >>> bool(np.abs(track.poses - take).max() < 0.1)
    True

    Frame by frame the result is the same.

    >>> for frame in hidden[:30]:
    ...     now = tracker.step(frame)
    >>> bool((now.poses == track.poses[29]).all())
    True
    """

    _parameter_constraints: dict = {
        "synchronizer": [HasMethods(["fit", "match"]), None],
        "n_particles": [Interval(Integral, 1, None, closed="left")],
        "noise": [Interval(Real, 0, LARGEST, closed="right"), JointNoise],
        "frame_rate": [FRAME_RATE, None],
        "random_state": ["random_state"],
    }

    _running: RunningTake | None

    def __init__(
        self,
        synchronizer: BaseEstimator | None = None,
        n_particles: int = 500,
        noise: float | JointNoise = 0.05,
        frame_rate: float | None = None,
        random_state: RandomState = 0,
    ) -> None:
        self.synchronizer = synchronizer
        self.n_particles = n_particles
        self.noise = noise
        self.frame_rate = frame_rate
        self.random_state = random_state

    @validated
    def fit(self, X: TrialsLike, y: object = None, groups: Labels | None = None) -> Self:
        """Learn the mean, the deviations of people, and their rates.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.
        y : ignored
            Present for API consistency.
        groups : array-like, shape (n_sequences,), default=None
            The subject of each trial: deviations are from the mean of other groups. By
            default every trial is a group of its own.

        Returns
        -------
        MotionTracker
            The fitted estimator.

        Raises
        ------
        ValueError
            If the input breaks the contract, there is only one trial or one group, or not one
            group for each.
        """
        trials = self._check_training_set(X)
        n = len(trials)
        if n < 2:
            raise ValueError(
                "A tracker learns how people vary from at least 2 trials, got n_samples = 1."
            )
        codes, _ = encode_groups(groups, n, at_least=2, sort=True)
        sync = DenseSynchronizer() if self.synchronizer is None else clone(self.synchronizer)
        with self._progress(fits=True) as progress:
            with progress.fitting(sync, "synchronizing"):
                sync.fit(X)
            match = sync.match(X)
            check_match(match, n, sync.n_frames_, type(sync).__name__)
            warped = match.warp(trials)
            durations = np.array([len(x) for x in trials], dtype=np.float64) - 1
            clock = Clock(int(sync.n_frames_) - 1.0, float(durations.mean()))
            rates = clock.duration / durations[:, np.newaxis] / match.rates
            warped = warped.astype(np.float64)
            if isinstance(self.noise, JointNoise):
                noise = self.noise.covariance(warped.mean(axis=0))
            else:
                noise = self.noise**2 * np.eye(warped.shape[2])
            step = progress.stage("learning how people vary", 1)
            with one_blas_thread():
                model = TrackerModel.learn(warped, rates, codes, clock, noise, self.n_particles)
            step()
        seed = int(check_random_state(self.random_state).randint(2**31 - 1))
        self.synchronizer_, self.n_frames_ = sync, int(sync.n_frames_)
        self.duration_ = clock.duration
        self.mean_ = model.mean.astype(trials[0].dtype)
        self.covariance_ = model.process.covariance
        self.length_scale_ = float(np.sqrt(3) / model.process.decay)
        self.rate_spread_ = model.rates.spread
        self._model, self._seed, self._running = model, seed, None
        return self

    def track(
        self,
        X: TrialsLike,
        times: Indexed[ValuesLike] | ValuesLike | None = None,
    ) -> Any:
        """Track takes: poses and phases at every frame, given the observations up to it.

        Parameters
        ----------
        X : array-like (n_frames, n_features), DataFrame, or a list or 3-D array of takes
            Observations, NaN where nothing is seen. After a fit on 2-D input the rows of a 2-D
            array are takes.
        times : array-like, shape (n_frames,), or a list of them, default=None
            Times of the frames, increasing: in seconds with a ``frame_rate``, else in frames of
            the training trials. None: one frame of these after the other.

        Returns
        -------
        Track, or list of Track
            A list for a collection.

        Raises
        ------
        ValueError
            If takes or times break the contract, widths differ from those of ``fit``, or anything
            is infinite or above 1e9.
        """
        return self._estimate(filter_take, X, times)

    def smooth(
        self,
        X: TrialsLike,
        times: Indexed[ValuesLike] | ValuesLike | None = None,
    ) -> Any:
        """Smooth whole takes: poses and phases at every frame, given all observations.

        20 paths of phases are drawn by forward filtering and backward simulation, and a
        Rauch-Tung-Striebel smoother in the form of Bryson and Frazier estimates the deviations
        along each, and those of the filter that knows no phase. It needs about 0.1 MB a frame of
        37 features.

        Parameters
        ----------
        X : array-like (n_frames, n_features), DataFrame, or a list or 3-D array of takes
            Observations, NaN where nothing is seen.
        times : array-like, shape (n_frames,), or a list of them, default=None
            Times of the frames, as for ``track``.

        Returns
        -------
        Track, or list of Track
            A list for a collection.

        Raises
        ------
        ValueError
            As from ``track``.
        """
        return self._estimate(smooth_take, X, times)

    def reset(self) -> None:
        """End the running take: the next observation of ``step`` is the first of another."""
        check_is_fitted(self, "mean_")
        self._running = None

    def step(self, observation: ValuesLike, time: float | None = None) -> Track:
        """Take the next observation of a running take.

        Parameters
        ----------
        observation : array-like, shape (n_features,)
            NaN where nothing is seen.
        time : float, default=None
            As for ``track``, later than that of the step before. None: a frame later.

        Returns
        -------
        Track
            Of this frame, as from ``track``: ``poses`` (n_features,), ``covariances``
            (n_features, n_features), numbers.

        Raises
        ------
        ValueError
            As from ``track``, or if time does not increase. The take is then as it was before.
        """
        check_is_fitted(self, "mean_")
        what, width = "The observation", self.mean_.shape[1]
        values = check_observations(observation, what, names_of_input(self), width)
        last = None if self._running is None else self._running.time
        time = float(check_times(time, 1, self.frame_rate, what, last)[0])
        if self._running is None:
            self._running = RunningTake(self._model, self._seed, time)
        with one_blas_thread():
            frame = self._running.step(values, time)
        return Track(*(part[0] for part in stack_frames([frame], self.mean_.dtype)))

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        return tags

    def _estimate(self, method, X, times):
        check_is_fitted(self, "mean_")
        single = as_collection(X) is None and not self._fitted_on_rows
        if single:
            X, times = [X], None if times is None else [times]
        tracks = []
        for x, t in zip(*check_recordings(self, X, times, self._fitted_on_rows), strict=True):
            # The matrices are small: several threads would wait for each other.
            with one_blas_thread():
                frames = method(self._model, self._seed, x, t)
            tracks.append(stack_frames(frames, self.mean_.dtype))
        return tracks[0] if single else tracks
