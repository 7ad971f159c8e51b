"""OnlineSynchronizer: the phase of performances that are still running."""

from numbers import Real

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, MetaEstimatorMixin, _fit_context, clone
from sklearn.utils._param_validation import Interval
from sklearn.utils.validation import check_is_fitted

from ..inputs.numbers import as_numbers, check_names
from ..inputs.validation import SequenceLevelMixin, check_performances, names_of_input
from ..matching.costs import step_table
from ..matching.filters import SMOOTHING
from ..matching.trellis import Trellis
from ..matching.warps import sample as sample_at
from ..synchronizers.base import Synchronizer
from ..synchronizers.dense import DenseSynchronizer
from ..utils.atomic import atomic_fit
from ..utils.doc_links import DocumentedMixin
from .features import LiveFeatures
from .stream import UNKNOWN, Calibration, Course, Session, Stream, gathered
from .times import as_stamps

__all__ = ["OnlineSynchronizer"]

# Positions a frame of the pattern: docs/method.md.
_SUBFRAMES = 2


class OnlineSynchronizer(DocumentedMixin, SequenceLevelMixin, MetaEstimatorMixin, BaseEstimator):
    """The phase of a performance while it runs, frame by frame, however long it will last.

    The frames that have come so far are the base of the trellis, the mean of the synchronised
    training performances is the moving sequence (Eqs. 12-17). A performance begins with frame 0 of
    the pattern; where it is now is the best cell of the last row. A frame costs a row of the
    trellis, whatever has been before it, and is never looked at before it is there.

    Parameters
    ----------
    synchronizer : Synchronizer, default=None
        What the training performances are synchronised with; a clone of it is fitted. None is
        ``DenseSynchronizer()``.
    frame_rate : float, default=None
        Frames a second of the training performances. Time stamps are then in seconds; without it
        in frames of the training performances.
    smoothness : float, default=0.1
        Weight of the change of pace, ``mu``, in units of the mean squared norm of what is compared.
    smoothing : float, default=0.03
        Time constant of the causal filter of velocities, as a share of the clock.
    max_rate : float, default=3
        Largest rate, in units of the mean pace.

    Attributes
    ----------
    synchronizer_ : Synchronizer
        Fitted.
    mean_ : ndarray, shape (P, n_features)
        Mean of the training performances on the clock of the pattern.
    duration_ : float
        Mean duration of them, from the first to the last frame, in their frames.
    n_frames_ : int
        ``P``.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    MotionTracker : Postures and phase from what is seen of a body.
    DenseSynchronizer : For performances that are over.

    Notes
    -----
    ``step`` is the one method that changes an estimator: it holds the performances that run.
    A copy, or what comes out of a pickle, goes on by itself from where it was.

    What is compared is what the synchronizer has learnt, made of causal velocities and of postures
    less the mean posture; the filter of velocities comes late, on both sides alike. The phase may
    go back when a frame shows that it was wrong. Nobody has to stand still before the beginning;
    whoever does stays where the mean performance has not moved much yet. Who stays in the last
    posture is at the end, P - 1: call ``reset`` for the next performance.

    The confidence is the share of probability within a twentieth of the clock of the phase, from
    costs that are scaled so that the training performances, each followed with the mean of the
    others, have theirs right (of a single one, what is usual among people is taken); it falls with
    the square of what recent frames cost more than is usual among these. Another action costs more;
    a movement that is its own reverse, such as a bend, costs no more backwards, and standing still
    costs nothing where the mean stands still.

    Features that are NaN are not compared; a frame of NaN, or time without frames,
    moves the phase on at the mean pace. Between frames, movements are taken to be straight
    for a quarter of the clock at most.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import ASpace, DirectionCosines, OnlineSynchronizer
    >>> from sklearn_motionsync.datasets import make_bending
    >>> from sklearn.pipeline import make_pipeline
    >>> bunch = make_bending(12, random_state=0)
    >>> features = make_pipeline(DirectionCosines(bunch.skeleton), ASpace())
    >>> X = features.fit_transform(bunch.data[:11])
    >>> live = OnlineSynchronizer(frame_rate=30).fit(X)
    >>> frames = features.transform(bunch.data[11:])[0]
    >>> for k, frame in enumerate(frames[: len(frames) // 2]):
    ...     here = live.step(frame, time=k / 30)
    >>> 0.4 < here.phase / (live.n_frames_ - 1) < 0.6
    True
    >>> 1 < live.time_left() < len(frames) / 30  # seconds
    True

    Somebody who only stands there does not get on:

    >>> live.reset()
    >>> for k in range(200):
    ...     here = live.step(frames[0])
    >>> here.rate
    0.0
    """

    _parameter_constraints: dict = {
        "synchronizer": [Synchronizer, None],
        "frame_rate": [Interval(Real, 0, None, closed="neither"), None],
        "smoothness": [Interval(Real, 0, None, closed="left")],
        "smoothing": [Interval(Real, 0, 1, closed="left")],
        "max_rate": [Interval(Real, 1, None, closed="left")],
    }

    def __init__(
        self,
        synchronizer=None,
        frame_rate=None,
        smoothness=0.1,
        smoothing=SMOOTHING,
        max_rate=3,
    ):
        self.synchronizer = synchronizer
        self.frame_rate = frame_rate
        self.smoothness = smoothness
        self.smoothing = smoothing
        self.max_rate = max_rate

    @atomic_fit
    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X, y=None):
        """Learn the mean performance, its pace, and what its costs say.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Performances; the rows of a 2-D array are univariate ones.
        y : ignored, but for synchronizers that use it

        Returns
        -------
        self

        Raises
        ------
        ValueError
            As from the ``fit`` of the synchronizer.
        """
        sync = DenseSynchronizer() if self.synchronizer is None else clone(self.synchronizer)
        performances = self._check_training_set(X)
        self.synchronizer_ = sync.fit(X, y)
        match = sync.match(X)
        warped = match.warp(performances)
        self.n_frames_ = sync.n_frames_
        self.mean_ = warped.mean(axis=0)
        self.duration_ = float(np.mean([len(x) for x in performances]) - 1)
        found = calibrate(self._course, performances, warped, match.times)
        self._following = self._course(self.mean_, found)
        self._session = Session()
        return self

    def step(self, frame, time=None):
        """Take the next frame.

        Parameters
        ----------
        frame : array-like, shape (n_features,), or (n_streams, n_features)
            What is seen at this time, of one performance, or of several that run side by side.
            NaN is not seen.
        time : float, default=None
            When: seconds if there is a ``frame_rate``, else frames of the training performances;
            from any origin. None: a frame of the training performances after the one before.

        Returns
        -------
        LivePhase
            ``phase``, ``rate`` and ``confidence``: numbers for one performance, arrays
            (n_streams,) for several.

        Raises
        ------
        ValueError
            If the frame is infinite, has another width or other names, there are not as many
            streams as in the frames before, or time stands still or goes back. The performance
            then goes on as if the frame had not been given.
        """
        if "_session" not in vars(self):
            check_is_fitted(self)
        frame, given = self._frame(frame), None if time is None else [time]
        stamps = as_stamps(given, 1, self.frame_rate, "The frame", self._session.stamp)
        return self._session.step(self._following, frame, float(stamps[0]))

    def reset(self, stream=None):
        """Begin anew with the next frame.

        Parameters
        ----------
        stream : int or array-like of int, default=None
            Of several performances those that begin anew, while the others go on. None: all of
            them, and time begins anew, too.
        """
        check_is_fitted(self)
        self._session.reset(stream)

    def time_left(self):
        """How long the performance will go on: a guess, without promise.

        A mean of what is left of the mean duration after the time that has passed, and of what is
        left of the phase at the mean pace, which counts the more the farther the phase is.
        docs/method.md has a table of how wrong it is.

        Returns
        -------
        float, or ndarray of shape (n_streams,)
            Seconds if there is a ``frame_rate``, else frames of the training performances.
        """
        check_is_fitted(self)
        left = self._session.time_left(self._following)
        return left if self.frame_rate is None else left / self.frame_rate

    @property
    def history(self):
        """Phases, rates and confidences since the last ``reset`` of all: `LivePhase` of arrays.

        Of a stream that goes on and on it is the last 100,000 frames.
        """
        check_is_fitted(self)
        return self._session.history

    def follow(self, X, times=None):
        """What ``step`` says at every frame of performances, each by itself.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            NaN is not seen.
        times : list of array-like (n_frames_i,), default=None
            As in ``step``.

        Returns
        -------
        list of LivePhase
            Of arrays (n_frames_i,).

        Raises
        ------
        ValueError
            As from ``step``; or if there are not as many times as performances.
        """
        check_is_fitted(self)
        performances = check_performances(
            self, X, reset=False, level="sequence", on_rows=self._fitted_on_rows, finite="allow-nan"
        )
        if times is None:
            times = [None] * len(performances)
        if len(times) != len(performances):
            raise ValueError(
                f"There are {len(performances)} performances, but times of {len(times)}: give one "
                "list of times for each."
            )
        found = []
        for i, (x, t) in enumerate(zip(performances, times, strict=True)):
            stamps = as_stamps(t, len(x), self.frame_rate, performances.called(i))
            session, frames = Session(), zip(x.astype(np.float64), stamps, strict=True)
            found.append(gathered([session.step(self._following, *frame) for frame in frames]))
        return found

    def _course(self, mean, calibration=UNKNOWN):
        """What is followed with this mean."""
        features = self.synchronizer_.features_
        width = self.smoothing * (self.n_frames_ - 1)
        compared = LiveFeatures(features, mean, _SUBFRAMES, width)
        mu = self.smoothness * float(np.square(compared.moving).sum(axis=1).mean())
        last = self.n_frames_ - 1
        # No step is longer than the pattern.
        table = step_table(features.cost, min(self.max_rate, last), _SUBFRAMES)
        trellis = Trellis(table, mu, last + compared.rest, running=True)
        step = self.duration_ / last
        return Course(self.n_frames_, trellis, compared, width, step, calibration)

    def _frame(self, frame):
        """A frame as numbers, of one stream or of several."""
        if type(frame) is not np.ndarray or frame.dtype != np.float64:
            # A row of a table has the names of its columns.
            row = frame.to_frame().T if isinstance(frame, pd.Series) else frame
            check_names(row, names_of_input(self), "The frame")
            frame = as_numbers(frame, "The frame", dtype=np.float64)
        width = self.mean_.shape[1]
        if frame.ndim == 0 and width == 1:
            frame = frame[np.newaxis]
        if frame.ndim not in (1, 2) or frame.shape[-1] != width or not frame.size:
            raise ValueError(
                f"A frame must have shape ({width},), or (n_streams, {width}) for several "
                f"performances side by side; got {frame.shape}."
            )
        if np.isinf(frame).any():
            raise ValueError(
                f"Feature {np.argwhere(np.isinf(frame))[0][-1]} of the frame is infinite. Give NaN "
                "for what is not seen."
            )
        return frame


# -- what costs of running performances are worth, learnt from those of the training set -

# So many performances, and so many moments of each, tell enough.
_MOST, _MOMENTS = 24, 120
# Temperatures that are tried, in mean squared features of a sample; the least chance that counts.
_TEMPERATURES = np.geomspace(0.01, 1e3, 41)
_LEAST = 1e-12
# Of one performance alone: temperature and usual cost as 16 actions of people have them, in mean
# squared features.
_ALONE = 0.7, 0.5


def calibrate(course_of, performances, warped, times):
    """The calibration of a training set.

    Parameters
    ----------
    course_of : callable
        The course of a mean performance (P, n_features).
    performances : list of ndarray (n_frames_i, n_features)
    warped : ndarray, shape (n_sequences, P, n_features)
        Those, synchronised.
    times : ndarray, shape (n_sequences, P)
        ``tau`` of each.

    Returns
    -------
    Calibration
    """
    n, total = len(performances), warped.sum(axis=0, dtype=np.float64)
    chosen = np.unique(np.linspace(0, n - 1, _MOST).round().astype(np.intp))
    scores, recent = np.zeros(len(_TEMPERATURES)), []
    # What does not move costs nothing, whatever the unit.
    energy = float(np.square(course_of(total / n).features.moving).sum(axis=1).mean()) or 1.0
    if n == 1:
        return Calibration(*(energy * share for share in _ALONE))
    for i in chosen:
        course = course_of((total - warped[i]) / (n - 1))
        rows, truth, costs = _followed(course, performances[i], times[i])
        recent.append(costs)
        for k, temperature in enumerate(energy * _TEMPERATURES):
            right = Stream.chances(rows, temperature)[np.arange(len(rows)), truth]
            scores[k] += np.log(np.maximum(right, _LEAST)).mean()
    # Copies of one performance cost each other nothing, but for rounding.
    usual = max(np.median([np.max(costs) for costs in recent]), _LEAST * energy)
    return Calibration(float(energy * _TEMPERATURES[scores.argmax()]), float(usual))


def _followed(course, performance, times):
    """Costs of all phases at even moments, the right phases there, and recent costs of ticks."""
    stream, duration = Stream(course, 1, performance.shape[1]), len(performance) - 1
    ticks = np.arange(0, duration * (1 + 1e-9), course.step)
    share = ticks / duration
    last = course.n_frames - 1
    rows, recent, every = [], [], -(-len(ticks) // _MOMENTS)
    for k, sample in enumerate(sample_at([performance], share[np.newaxis] * last, last + 1)[0]):
        stream.tick(sample[np.newaxis])
        recent.append(stream.recent[0])
        if k % every == 0:
            rows.append(stream.running.costs[0])
    # Where tau stands still, any phase of that while is as right.
    rising = times + 1e-9 * np.arange(len(times))
    phases = np.interp(share * last, rising, np.arange(len(times)))
    truth = np.round(phases * course.trellis.table.subframes).astype(np.intp)
    return np.array(rows), truth[::every], np.array(recent)
