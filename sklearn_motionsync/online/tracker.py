"""MotionTracker: the body behind observations with gaps and noise, by the model of its action."""

from numbers import Integral, Real
from typing import NamedTuple

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, _fit_context, clone
from sklearn.utils import check_random_state
from sklearn.utils._param_validation import HasMethods, Interval
from sklearn.utils.validation import check_is_fitted

from ..inputs.collections import as_collection
from ..inputs.numbers import as_numbers, check_finite, check_names, check_squares
from ..inputs.tables import as_pandas, labels_of, name_performance
from ..inputs.validation import SequenceLevelMixin, names_of_input
from ..synchronizers.dense import DenseSynchronizer
from ..synchronizers.match import check_answer
from ..utils.atomic import atomic_fit, snapshot
from ..utils.doc_links import DocumentedMixin
from ..utils.groups import encode_groups
from ..utils.threads import on_one_thread
from .particle_filter import ParticleFilter, follow
from .smoother import smooth
from .times import as_stamps
from .tracker_model import Clock, learn

__all__ = ["MotionTracker", "Track"]


class MotionTracker(DocumentedMixin, SequenceLevelMixin, BaseEstimator):
    """Follow a body that is partly hidden, by what its action looks like and how people vary.

    Given the phase p of the action, a posture is ``mean(p) + deviation``, and what is seen of it
    ``y = H posture + b + noise``.

    1. The mean is that of the synchronised training performances; deviations are what each differs
       by from the mean of others, so that they are those of a stranger.
    2. Deviations are a Gaussian process in *time*, Matern-3/2, with one length scale and a
       covariance of the features that is shrunk half-way to its diagonal. A Kalman filter follows
       it; what is hidden is left out.
    3. Particles carry the phase and its rate. The log rate wanders as far and as fast as
       in the training performances, about the mean pace. One Kalman gain serves all particles.
    4. Particles are weighed by causal *velocities*: what is seen should move as the mean does along
       the path of the particle. Style persists, so that the likelihood of postures would be far
       too sure; that of velocities is divided by ``tempering``.
    5. If what is seen moves otherwise at all phases than people of the training set did, or stays
       farther from the mean posture, the phase is lost: particles are spread over the whole clock,
       and again until one fits. A movement that is over may begin anew.

    Parameters
    ----------
    synchronizer : synchronizer, default=None
        Not fitted; None is `DenseSynchronizer()`.
    n_particles : int, default=500
    noise : float, default=0.05
        Standard deviation of observations, in the unit of the features; the default is one of
        direction cosines.
    tempering : float, default=10
        By what the log-likelihood of the velocities at every hundredth of the mean duration is
        divided.
    frame_rate : float, default=None
        Frames a second of the training performances; time stamps are then in seconds. None: they
        are in frames of the training performances.
    random_state : int, RandomState instance or None, default=None
        From which ``fit`` draws the seed of all takes: each begins with the same, so that the same
        observations give the same answer, alone or in company.

    Attributes
    ----------
    mean_ : ndarray, shape (P, n_features)
        The mean performance.
    n_frames_ : int
        ``P``, frames of the clock.
    duration_ : float
        Mean number of frames of the training performances.
    synchronizer_ : synchronizer
        The fitted one.
    covariance_ : ndarray, shape (n_features, n_features)
        Of deviations from the mean.
    length_scale_ : float
        Of the Matern-3/2 process, in frames of the training performances.
    rate_spread_ : float
        Standard deviation of the log rate.
    rate_memory_ : float
        Frames of the training performances after which its correlation is 1/e.
    surprise_limit_ : float
        Mean square of velocities in their standard deviations, over 9 % of the mean duration,
        beyond which the phase is lost; 1 is expected.
    departure_limit_ : float
        The same of departures from the mean posture: at least 9, three standard deviations.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    DirectionCosines : Makes postures of joint positions, which all people share.
    DenseSynchronizer : What puts the training performances on one clock.

    Notes
    -----
    Nothing seen (all NaN) is no error: the movement goes on by itself, and the covariance grows. An
    observation ten standard deviations from all that is expected, as the root mean square of its
    numbers, is taken as not seen, if no training performance came near that; where it stays, the
    phase is lost. A take may begin at any phase; most particles begin at the first frame. After a
    gap in time as long as the movement, particles wait at the end, for another beginning.

    Who stands still in a posture of the action, or does it backwards, is not called lost: postures
    are possible, and velocities not odd enough. Of few people the limit of velocities is tight.

    Examples
    --------
    A movement of which one of two features is hidden for a while.

    >>> import numpy as np
    >>> from sklearn_motionsync import LinearSynchronizer, MotionTracker
    >>> t = np.linspace(0, 1, 60)
    >>> def movement(size):
    ...     return np.column_stack([size * np.cos(6 * t), size * np.sin(6 * t)])
    >>> tracker = MotionTracker(LinearSynchronizer(), noise=0.02, random_state=0)
    >>> tracker = tracker.fit([movement(size) for size in (0.9, 1.0, 1.1, 1.2)])
    >>> take = movement(1.05)
    >>> hidden = take.copy()
    >>> hidden[20:40, 1] = np.nan
    >>> track = tracker.track(hidden)
    >>> track
    Track(60 frames of 2 features, 0 of them lost)
    >>> bool(np.abs(track.postures - take).max() < 0.1)
    True

    Frame by frame it is the same.

    >>> for frame in hidden[:30]:
    ...     now = tracker.step(frame)
    >>> bool((now.postures == track.postures[29]).all())
    True
    """

    _parameter_constraints: dict = {
        "synchronizer": [HasMethods(["fit", "match"]), None],
        "n_particles": [Interval(Integral, 1, None, closed="left")],
        "noise": [Interval(Real, 0, None, closed="neither")],
        "tempering": [Interval(Real, 0, None, closed="neither")],
        "frame_rate": [Interval(Real, 0, None, closed="neither"), None],
        "random_state": ["random_state"],
    }

    def __init__(
        self,
        synchronizer=None,
        n_particles=500,
        noise=0.05,
        tempering=10.0,
        frame_rate=None,
        random_state=None,
    ):
        self.synchronizer = synchronizer
        self.n_particles = n_particles
        self.noise = noise
        self.tempering = tempering
        self.frame_rate = frame_rate
        self.random_state = random_state

    @atomic_fit
    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X, y=None, groups=None):
        """Learn the mean, how people depart from it, and their pace.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Performances; the rows of a 2-D array are univariate ones.
        y : ignored
        groups : array-like, shape (n_sequences,), default=None
            The subject of each performance: deviations are from the mean of other groups. By
            default every performance is a group of its own.

        Returns
        -------
        self

        Raises
        ------
        ValueError
            If the input breaks the contract, there is only one performance or one group, or not one
            group for each; or their unit is such that variances are beyond the precision.
        """
        performances = self._check_training_set(X)
        n = len(performances)
        if n < 2:
            raise ValueError(
                "A tracker learns how people vary from at least 2 performances, got n_samples = 1."
            )
        codes, _ = encode_groups(groups, n, at_least=2, sort=True)
        sync = DenseSynchronizer() if self.synchronizer is None else clone(self.synchronizer)
        self.synchronizer_ = sync.fit(X)
        match = sync.match(X)
        check_answer(match, n, sync.n_frames_, type(sync).__name__)
        warped = match.warp(performances)
        lengths = np.array([len(x) for x in performances], dtype=np.float64)
        self.n_frames_, self.duration_ = int(sync.n_frames_), float(lengths.mean())
        clock = Clock(self.n_frames_ - 1.0, self.duration_ - 1.0)
        rates = clock.duration / (lengths[:, np.newaxis] - 1) / match.rates
        with np.errstate(over="ignore", invalid="ignore"):
            check_squares(warped, float(warped.var(axis=(0, 1)).max()), "variances")
        settings = self.noise, self.tempering, self.n_particles
        known = warped.astype(np.float64), rates, codes, clock
        self._model = on_one_thread(learn, *known, *settings)
        self.mean_ = self._model.mean.astype(performances[0].dtype)
        self.covariance_ = self._model.process.covariance
        self.length_scale_ = self._model.process.length_scale
        self.rate_spread_, self.rate_memory_ = self._model.pace
        self.surprise_limit_, self.departure_limit_ = map(float, self._model.limits)
        self._seed = int(check_random_state(self.random_state).randint(2**31 - 1))
        self._running = None
        return self

    @snapshot
    def track(self, X, times=None, projection=None):
        """Follow takes: what is known at every frame by what was seen up to it.

        Parameters
        ----------
        X : array-like (n_frames, n_observed), DataFrame, or a list or 3-D array of takes
            Observations, NaN where nothing is seen. After a fit on 2-D input the rows of a 2-D
            array are takes.
        times : array-like, shape (n_frames,), or a list of them, default=None
            When frames were seen, increasing: in seconds with a ``frame_rate``, else in frames of
            the training performances. None: a frame of these after the other.
        projection : array-like (n_observed, n_features) or (matrix, offset), default=None
            What is observed of postures: ``matrix @ posture + offset``. None: all of it.

        Returns
        -------
        Track, or list of Track
            A list for a collection.

        Raises
        ------
        ValueError
            If takes or times break the contract, widths differ from those of ``fit`` or the
            projection, or anything is infinite.
        """
        return self._answer(follow, X, times, projection)

    @snapshot
    def smooth(self, X, times=None, projection=None):
        """Repair takes that are over: what is known at every frame by all that was seen.

        Phases are drawn back from the end by the particles of the filter, 20 paths of them, and a
        smoother estimates the deviations along each. It needs about 0.04 MB a frame of 37 features.

        Parameters
        ----------
        X, times, projection :
            As for ``track``.

        Returns
        -------
        Track, or list of Track
            A list for a collection.

        Raises
        ------
        ValueError
            As from ``track``.
        """
        return self._answer(smooth, X, times, projection)

    def reset(self):
        """Forget what ``step`` has seen: the next observation is the first of a take."""
        check_is_fitted(self)
        self._running = None

    def step(self, observation, time=None, projection=None):
        """Take the next observation of a running take.

        Parameters
        ----------
        observation : array-like, shape (n_observed,)
            NaN where nothing is seen.
        time : float, default=None
            As for ``track``, later than that of the step before. None: a frame later.
        projection : as for ``track``

        Returns
        -------
        Track
            Of this frame: ``postures`` (n_features,), ``covariances`` (n_features, n_features),
            numbers. It is what ``track`` says of it.

        Raises
        ------
        ValueError
            As from ``track``, or if time does not increase. The take is then as it was before.
        """
        check_is_fitted(self)
        running = self._running
        after = None if running is None else running.time
        names = names_of_input(self) if projection is None else None
        projection = as_projection(projection, self._model.mean.shape[1])
        values, time = as_frame(observation, time, names, projection, self.frame_rate, after)
        if running is None:
            self._running = running = ParticleFilter(self._model, self._seed)
        estimate = on_one_thread(running.step, values, time, projection[0])
        return Track(*(part[0] for part in Track.of([estimate], self.mean_.dtype)))

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        return tags

    # -- what answers share -----------------------------------------------------------------

    def _answer(self, method, X, times, projection):
        check_is_fitted(self)
        model, on_rows = self._model, self._fitted_on_rows
        names = names_of_input(self) if projection is None else None
        projection = as_projection(projection, model.mean.shape[1])
        takes, single = as_takes(X, times, names, on_rows, projection, self.frame_rate)
        tracks = []
        for take in takes:
            # The matrices are small: threads would wait for each other.
            estimates = on_one_thread(method, model, self._seed, *take, projection[0])
            tracks.append(Track.of(estimates, self.mean_.dtype))
        return tracks[0] if single else tracks


# -- track: what is known of a body at every frame of a take -----------------------------


class Track(NamedTuple):
    """The body at every frame of a take; of a single frame, without the axis of frames.

    Attributes
    ----------
    postures : ndarray, shape (n_frames, n_features)
        What is expected, given what was seen.
    covariances : ndarray, shape (n_frames, n_features, n_features)
        Of the posture, phases that are possible taken together; without the noise of observations.
    phases : ndarray, shape (n_frames,)
        In frames of the clock, 0 to P - 1: the weighted median of the particles.
    rates : ndarray, shape (n_frames,)
        Their median pace: 1 is the mean of the training performances, 2 twice as fast, 0 when the
        movement is over.
    effective_sizes : ndarray, shape (n_frames,)
        How many particles of equal weight would tell as much, ``1 / sum w^2``. Of a smoothed take:
        how many different particles its paths go through.
    lost : ndarray of bool, shape (n_frames,)
        Whether the body moves otherwise, or looks otherwise, than the model says at any phase.
    """

    postures: np.ndarray
    covariances: np.ndarray
    phases: np.ndarray
    rates: np.ndarray
    effective_sizes: np.ndarray
    lost: np.ndarray

    @classmethod
    def of(cls, estimates, dtype):
        """Estimates of frames one after the other, postures in a precision."""
        postures, covariances, *numbers = map(np.array, zip(*estimates, strict=True))
        postures, covariances = (x.astype(dtype, copy=False) for x in (postures, covariances))
        return cls(postures, covariances, *numbers)

    def __repr__(self):
        postures = np.atleast_2d(self.postures)
        n_lost = int(np.count_nonzero(self.lost))
        return (
            f"Track({len(postures)} frames of {postures.shape[1]} features, {n_lost} of them lost)"
        )


# -- what comes in while tracking: takes and frames with gaps, and what of a posture they are


class Seen(NamedTuple):
    """A take: observations (n_frames, n_observed), NaN where nothing is seen, and their times."""

    values: np.ndarray
    times: np.ndarray


def as_projection(projection, n_features):
    """What of a posture is observed: a matrix (n_observed, n_features) and an offset (n_observed,).

    Parameters
    ----------
    projection : array-like, tuple of two of them, or None
        A matrix; or it and the offset; None is all of the posture.
    n_features : int

    Returns
    -------
    matrix, offset : ndarray

    Raises
    ------
    ValueError
        If the matrix is not of this width, or anything is not finite, or there is not one offset
        for each of its rows.
    """
    if projection is None:
        return np.eye(n_features), np.zeros(n_features)
    if isinstance(projection, tuple) and len(projection) not in (1, 2):
        raise ValueError(
            "projection must be a matrix (n_observed, n_features), or the pair (matrix, offset); "
            f"got a tuple of {len(projection)}."
        )
    if isinstance(projection, list) and len({np.ndim(part) for part in projection}) > 1:
        raise ValueError(
            "projection must be a matrix (n_observed, n_features), or the tuple (matrix, offset); "
            "got a list of things of several dimensions."
        )
    pair = projection if isinstance(projection, tuple) else (projection,)
    matrix = as_numbers(pair[0], "The projection", dtype=np.float64)
    if matrix.ndim != 2 or matrix.shape[1] != n_features or len(matrix) == 0:
        raise ValueError(
            f"projection must be a matrix of shape (n_observed, {n_features}), as postures have "
            f"{n_features} features; got shape {matrix.shape}."
        )
    check_finite(matrix, "The projection, row")
    given = len(pair) == 2 and pair[1] is not None
    offset = pair[1] if given else np.zeros(len(matrix))
    offset = as_numbers(offset, "The offset", dtype=np.float64)
    if offset.shape != (len(matrix),):
        raise ValueError(
            f"The offset of a projection must have shape ({len(matrix)},), one number a row of the "
            f"matrix; got {offset.shape}."
        )
    check_finite(offset[np.newaxis], "The offset, row")
    return matrix, offset


def as_takes(X, times, names, on_rows, projection, frame_rate):
    """Takes of any kind, checked.

    Parameters
    ----------
    X : array-like (n_frames, n_observed), DataFrame, or collection of them
        With ``on_rows`` the rows of a 2-D array are takes of a single feature.
    times : array-like, shape (n_frames,); a list of them for a collection; or None
    names : list or None
        Names of the features of ``fit``, which are not those of a projection.
    on_rows : bool
    projection : matrix and offset
        The offset is taken away.
    frame_rate : float or None

    Returns
    -------
    list of Seen, bool
        And whether it was a single take.
    """
    sequences = as_collection(X)
    single = sequences is None and not on_rows
    if sequences is None:
        sequences = _takes_of_matrix(X, on_rows)
    if len(sequences) == 0:
        raise ValueError("Found 0 takes, at least 1 is needed.")
    called = ["The take"]
    if not single:
        called = [name_performance(*pair) for pair in enumerate(labels_of(sequences)[0])]
    times = [times] if single else _one_each(times, len(sequences))
    matrix, offset = projection
    takes = []
    for what, x, stamps in zip(called, sequences, times, strict=True):
        check_names(x, names, what)
        frames = x.index if isinstance(x, pd.DataFrame) else None
        values = _as_values(x, what, len(matrix))
        check_finite(values, f"{what}, frame", names, frames, allow_nan=True)
        takes.append(Seen(values - offset, as_stamps(stamps, len(values), frame_rate, what)))
    return takes, single


def as_frame(observation, time, names, projection, frame_rate, after):
    """One observation (n_observed,) less the offset, and its time, later than ``after``."""
    what, (matrix, offset) = "The observation", projection
    if isinstance(observation, pd.Series):
        check_names(observation.to_frame().T, names, what)
    values = as_numbers(observation, what, dtype=np.float64)
    if values.ndim == 0 and len(matrix) == 1:
        values = values[np.newaxis]
    if values.shape != (len(matrix),):
        raise ValueError(
            f"{what} has shape {values.shape}, expected ({len(matrix)},): one number a feature, "
            "NaN where it is not seen. For a whole take use track."
        )
    check_finite(values[np.newaxis], f"{what}, frame", names, allow_nan=True)
    (stamp,) = as_stamps(time, 1, frame_rate, what, after)
    return values - offset, float(stamp)


def _takes_of_matrix(X, on_rows):
    X = as_pandas(X)
    if not on_rows:
        return [X]
    rows = as_numbers(X, "The input", dtype=np.float64)
    if rows.ndim != 2:
        raise ValueError(
            f"Expected 2D array, one take a row, as in fit; got an array of shape {rows.shape}."
        )
    return list(rows[:, :, np.newaxis])


def _one_each(times, n):
    if times is None:
        return [None] * n
    given = len(times) if np.iterable(times) else "no"
    if given != n:
        raise ValueError(f"There are {n} takes, but {given} sequences of times: give one for each.")
    return list(times)


def _as_values(x, what, width):
    values = as_numbers(x, what, dtype=np.float64)
    if values.ndim != 2 or len(values) == 0:
        raise ValueError(
            f"{what} has shape {values.shape}, expected (n_frames, {width}) with at least 1 frame. "
            "Reshape your data: a single feature is a column, x[:, np.newaxis]."
        )
    if values.shape[1] != width:
        raise ValueError(
            f"{what} has {values.shape[1]} features a frame, expected are {width}. What is not "
            "seen is NaN; what is another measurement of the body needs a projection."
        )
    return values
