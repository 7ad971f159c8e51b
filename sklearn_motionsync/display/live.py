"""PhaseDisplay: where running performances are, and what is expected of the rest of them."""

from copy import copy
from itertools import pairwise
from textwrap import fill

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from ..body.direction_cosines import DirectionCosines
from ..inputs.collections import as_collection
from ..inputs.features import choose_features, names_of_features
from ..inputs.numbers import is_integer
from ..inputs.tables import labels_of
from ..online.stream import LivePhase, check_times
from ..online.synchronizer import OnlineSynchronizer
from ..utils.pipelines import find_step
from .animation import playable
from .drawing import legend_above, panels
from .given import (
    as_drawn,
    as_index,
    as_indices,
    as_names,
    as_pictures,
    as_skeleton,
    check_view,
    is_number,
)
from .live_rows import Action, Followed, Row

__all__ = ["PhaseDisplay", "from_zero", "one_each", "taken", "times_of"]

# Performances below each other, if not chosen.
_FEW_PERFORMANCES = 4
# Columns of the grid that a panel takes: a body, a dial, the phase, a curve.
_BODY, _DIAL, _PHASE, _CURVE = 3, 3, 5, 5
# Inches of a column, and of a row.
_COLUMN, _ROW = 0.72, 2.35
# Letters of a name in a line above a panel.
_LETTERS = 24
_UNITS = {"frames": "time (frames)", "seconds": "time (s)"}


class PhaseDisplay:
    """Running performances: where they are, how sure that is, and what will come.

    A row for each performance: a dial of its phase, with an arc ahead that ends where it will be
    after a tenth of the mean duration at the present rate; the phase over time with its confidence;
    and features, as far as they were seen, with the predicted rest: the mean from the phase on, for
    as long as `OnlineSynchronizer.time_left` guesses. With ``body`` also a stick figure, before the
    mean one at the end of that arc. Make one with `from_estimator` or `from_predictions`.

    Parameters
    ----------
    phases : LivePhase, or list of LivePhase
        Of arrays (n_frames_i,); or of arrays (n_frames, n_streams).
    n_frames : int
        Of the clock, ``P``.
    times : list of array-like (n_frames_i,), default=None
        When the frames came; by default one after the other.
    duration : float, default=None
        Mean duration of the action in the unit of the times; None predicts nothing.
    seen : list of array-like (n_frames_i, n_shown), default=None
        Features that are drawn.
    mean, spread : array-like, shape (P, n_shown), default=None
        What is expected of them, and its standard deviation.
    afterwards : list of array-like (n_frames_i,) or None, default=None
        Phases as they are known when a performance is over.
    features : list of str, default=None
        Names of what is drawn.
    bodies : list of array-like (n_frames_i, n_joints, n_dims), default=None
        Joint positions, y up; NaN where they were not seen.
    mean_body : array-like, shape (P, n_joints, n_dims), default=None
        The mean of them; together with bodies.
    skeleton : Skeleton, default=None
        Of the bodies.
    names : list of str, default=None
        Of the performances.
    unit : {"frames", "seconds"}, default="frames"
        Of the times.

    Attributes
    ----------
    figure_ : Figure
    axes_ : list of Axes
        Row by row: a body if there are bodies, the dial, the phase, and one a feature.
    rows_ : list
        What is drawn of each performance: ``row.dial.passed``, ``row.phase``, ``row.confidence``,
        ``row.afterwards``, ``row.rest``, ``row.curves[k].seen``, ``row.curves[k].expected`` are
        artists.

    Examples
    --------
    >>> from sklearn_motionsync import ASpace, DirectionCosines, OnlineSynchronizer
    >>> from sklearn_motionsync.display import PhaseDisplay
    >>> from sklearn_motionsync.datasets import make_bending
    >>> from sklearn.pipeline import make_pipeline
    >>> bunch = make_bending(8, random_state=0)
    >>> features = make_pipeline(DirectionCosines(bunch.skeleton), ASpace())
    >>> X = features.fit_transform(bunch.data)
    >>> live = OnlineSynchronizer().fit(X[:6])
    >>> display = PhaseDisplay.from_estimator(live, X[6:], frame=40)
    >>> display, len(display.axes_)
    (PhaseDisplay(2 performances), 6)
    """

    def __init__(
        self,
        phases,
        n_frames,
        *,
        times=None,
        duration=None,
        seen=None,
        mean=None,
        spread=None,
        afterwards=None,
        features=None,
        bodies=None,
        mean_body=None,
        skeleton=None,
        names=None,
        unit="frames",
    ):
        if not is_integer(n_frames) or n_frames < 2:
            raise ValueError(f"n_frames must be frames of the clock, at least 2; got {n_frames!r}.")
        if duration is not None and not (is_number(duration, 0) and duration > 0):
            raise ValueError(f"duration must be a number above 0, or None; got {duration!r}.")
        if unit not in list(_UNITS):
            raise ValueError(f"unit must be one of {list(_UNITS)}, got {unit!r}.")
        phases = as_phases(phases, n_frames)
        count = len(phases)
        names = [str(i) for i in range(count)] if names is None else names
        self.names = as_names(names, count, "names", "performances")
        self.unit, self.skeleton = unit, as_skeleton(skeleton)
        lengths = [len(of.phase) for of in phases]
        times = each_of(times, lengths, "times", ())
        seen = each_of(seen, lengths, "seen", ("n_shown",))
        afterwards = each_of(afterwards, lengths, "afterwards", (), gaps=True)
        n_shown = 0 if seen[0] is None else seen[0].shape[1]
        # All of them have the features of the first.
        seen = each_of(None if seen[0] is None else seen, lengths, "seen", (n_shown,))
        mean, spread = as_expected(mean, spread, n_frames, n_shown)
        if features is None:
            features = [f"x{k}" for k in range(n_shown)]
        self.features = as_names(features, n_shown, "features", "features that are seen")
        bodies, mean_body = as_moving(bodies, mean_body, lengths, n_frames, self.skeleton)
        self.action = Action(int(n_frames), duration, mean, spread, mean_body)
        self.followed = [
            Followed(*phases[i], from_zero(times[i], n, i), self.names[i], *rest)
            for i, (n, *rest) in enumerate(zip(lengths, seen, afterwards, bodies, strict=True))
        ]

    def __repr__(self):
        count = len(self.followed)
        return f"PhaseDisplay({count} performance{'s' * (count != 1)})"

    @classmethod
    def from_estimator(
        cls,
        estimator,
        X,
        *,
        times=None,
        performances=None,
        features=None,
        training=None,
        body=None,
        names=None,
        frame=None,
        ax=None,
        azimuth=-60,
    ):
        """Follow performances, and draw what was said of them.

        Parameters
        ----------
        estimator : OnlineSynchronizer
            Fitted. Nothing that it follows is changed.
        X : performances, as ``estimator.track`` takes them; or one, array (n_frames, n_features)
        times : list of array-like (n_frames_i,), default=None
            As ``estimator.track`` takes them; of one performance an array.
        performances : int or list of int, default=None
            Which of them are drawn; by default the first four.
        features : int, str or list of them, default=None
            By index or name; by default the one that varies most in the mean performance.
        training : the performances of ``fit``, default=None
            Their spread about the mean is drawn as a band.
        body : DirectionCosines or Pipeline, default=None
            Fitted; what made the features, with ``inverse_transform``. The body is then drawn, too;
            limbs of which a cosine is NaN are not. In a pipeline one NaN hides the body.
        names : list of str, default=None
            Of those that are drawn; by default their labels in X, or numbers.
        frame, ax, azimuth : as for `plot`

        Returns
        -------
        PhaseDisplay

        Raises
        ------
        ValueError
            As from ``estimator.track``; or if there is no such performance, feature or frame.
        """
        if not isinstance(estimator, OnlineSynchronizer):
            raise ValueError(
                f"estimator must be an OnlineSynchronizer, got {type(estimator).__name__}."
            )
        live = estimator
        given, arrays, labels, single = taken(live, X)
        if performances is None:
            performances = range(min(_FEW_PERFORMANCES, len(arrays)))
        chosen = as_indices(performances, len(arrays), "performances")
        if times is not None:
            times = times_of(live, [times] if single else times, chosen, arrays, labels)
        phases = live.track(given(chosen), times)
        seen = [np.asarray(arrays[i], dtype=np.float64) for i in chosen]
        own = names_of_features(body, live, live.mean_.shape[1])
        if features is None:
            features = [int(live.mean_.var(axis=0).argmax())]
        shown = choose_features(features, own)
        rate = 1.0 if live.frame_rate is None else live.frame_rate
        bodies, mean_body, skeleton = bodies_of_features(body, seen, live.mean_)
        display = cls(
            phases,
            live.n_frames_,
            times=times if times or rate == 1 else [np.arange(len(x)) / rate for x in seen],
            duration=live.duration_ / rate,
            seen=[x[:, shown] for x in seen],
            mean=live.mean_[:, shown],
            spread=None if training is None else spread_of(live, training)[:, shown],
            afterwards=[
                None if np.isnan(x).any() else path_of(live, given([i]), len(x))
                for i, x in zip(chosen, seen, strict=True)
            ],
            features=[own[k] for k in shown],
            bodies=bodies,
            mean_body=mean_body,
            skeleton=skeleton,
            names=[labels[i] for i in chosen] if names is None else names,
            unit="frames" if live.frame_rate is None else "seconds",
        )
        return display.plot(ax, frame=frame, azimuth=azimuth)

    @classmethod
    def from_predictions(cls, phases, n_frames, *, frame=None, ax=None, azimuth=-60, **known):
        """Draw phases that are there already, such as ``live.history``.

        Parameters
        ----------
        phases : LivePhase, or list of LivePhase
        n_frames : int
            Of the clock, ``live.n_frames_``.
        frame, ax, azimuth : as for `plot`
        **known : dict
            What else is known of them: the parameters of the class.

        Returns
        -------
        PhaseDisplay
        """
        return cls(phases, n_frames, **known).plot(ax, frame=frame, azimuth=azimuth)

    def plot(self, ax=None, *, frame=None, azimuth=-60):
        """Draw how it was at a frame.

        Parameters
        ----------
        ax : Axes or array-like of Axes, default=None
            One of a figure's subplots is divided into the panels; or one axes a panel. None
            makes a figure.
        frame : int, default=None
            Of the longest performance; the others are where they were at that time. None: the last.
        azimuth : float, default=-60
            From where bodies are seen, as in `SkeletonDisplay`.

        Returns
        -------
        self
        """
        check_view(0, azimuth)
        longest = max((of.times for of in self.followed), key=lambda times: times[-1])
        if frame is None:
            frame = len(longest) - 1
        frame = as_index(frame, len(longest), "frame")
        has_body = self.followed[0].bodies is not None
        widths = [_BODY] * has_body + [_DIAL, _PHASE] + [_CURVE] * len(self.features)
        starts = np.cumsum([0, *widths])
        columns = [slice(a, b) for a, b in pairwise(starts)]
        n_rows, n_cols = len(self.followed), int(starts[-1])
        spots = [(row, column) for row in range(n_rows) for column in columns]
        size = n_cols * _COLUMN, n_rows * _ROW + 0.5
        before = getattr(self, "axes_", [])
        self.figure_, self.axes_ = panels(ax, spots, n_rows, n_cols, size)
        for axis in self.axes_:
            if axis in before:
                axis.clear()
        end = max(self.action.latest(of) for of in self.followed)
        by_row = np.array(self.axes_, dtype=object).reshape(n_rows, -1)
        self.rows_ = [
            Row(axes, of, self.action, self.skeleton, self.features, 1.02 * end or 1.0, azimuth)
            for axes, of in zip(by_row, self.followed, strict=True)
        ]
        for row, of in zip(self.rows_, self.followed, strict=True):
            row.axes[0].set_title(fill(of.name, _LETTERS), fontsize="medium", parse_math=False)
        for axis in by_row[:-1, has_body + 1 :].flat:
            axis.tick_params(labelbottom=False)
        for axis in by_row[-1, has_body + 1 :]:
            axis.set_xlabel(_UNITS[self.unit])
        self._show(longest[frame])
        # Curves share the legend of the first.
        for axis in by_row[0, has_body + 1 : has_body + 3]:
            handles, labels = axis.get_legend_handles_labels()
            legend_above([axis], handles, labels, n_cols=2)
        return self

    def animate(self, ax=None, *, seconds=5.0, fps=15, azimuth=-60):
        """The performances as they run, which a notebook plays.

        Parameters
        ----------
        ax : Axes or array-like of Axes, default=None
            As for `plot`; by default where the display was drawn last.
        seconds : float, default=5.0
            Until the longest performance ends.
        fps : int, default=15
            Pictures a second.
        azimuth : as for `plot`

        Returns
        -------
        Animation
            Shown by a notebook as its last value; ``to_jshtml()`` gives the HTML, ``save(path)``
            a file.
        """
        count = as_pictures(seconds, fps)
        self.plot(getattr(self, "axes_", None) if ax is None else ax, azimuth=azimuth)
        longest = max(of.times[-1] for of in self.followed)
        return playable(
            self.figure_.canvas.figure,
            lambda k: self._show(longest * k / (count - 1)),
            count,
            fps,
            closes=ax is None,
        )

    def _show(self, time):
        """Let it be so late in all performances; the artists that have changed."""
        return [artist for row in self.rows_ for artist in row.show(time)]


# -- what `PhaseDisplay` is given, checked, and what it gets out of an estimator ---------

_PARTS = "phase", "rate", "confidence"
# By how much rounding may take a phase or a confidence beyond its bounds.
_ROUNDING = 1e-9


def as_phases(phases, n_frames):
    """A list of LivePhase of checked arrays (n_frames_i,)."""
    listed = [phases] if isinstance(phases, LivePhase) else phases
    sound = isinstance(listed, (list, tuple)) and len(listed) > 0
    if not sound or not all(isinstance(of, LivePhase) for of in listed):
        raise ValueError(
            "phases must be a LivePhase of arrays, such as live.history, or a list of them, such "
            f"as live.track(X) gives; got {phases!r:.80}."
        )
    if len(listed) == 1 and np.ndim(listed[0].phase) == 2:
        listed = [
            LivePhase(*streams) for streams in zip(*map(np.transpose, listed[0]), strict=True)
        ]
    checked = []
    for i, of in enumerate(listed):
        shape, arrays, bounds = ("n_frames",), [], (n_frames - 1, np.inf, 1)
        for what, values, most in zip(_PARTS, of, bounds, strict=True):
            array = as_drawn(values, f"Performance {i}: the {what}", shape)
            if not ((array >= -_ROUNDING) & (array <= most + _ROUNDING)).all():
                raise ValueError(f"Performance {i}: the {what} must be from 0 to {most}.")
            arrays.append(np.clip(array.astype(np.float64), 0, most))
            shape = array.shape
        checked.append(LivePhase(*arrays))
    return checked


def one_each(values, count, what, each="performances"):
    """A list with something for each of so many performances."""
    if not hasattr(values, "__len__") or isinstance(values, str) or len(values) != count:
        got = len(values) if hasattr(values, "__len__") else repr(values)
        raise ValueError(
            f"There are {count} {each}, but {what} of {got}: give a list with one for each."
        )
    return list(values)


def each_of(values, lengths, what, shape, gaps=False):
    """Something of each performance, of this shape after its frames; None where it is not known."""
    if values is None:
        return [None] * len(lengths)
    return [
        None
        if gaps and x is None
        else as_drawn(x, f"Performance {i}: {what}", (n, *shape)).astype(np.float64)
        for i, (x, n) in enumerate(zip(one_each(values, len(lengths), what), lengths, strict=True))
    ]


def as_expected(mean, spread, n_frames, n_shown):
    """Mean and spread (P, n_shown) of what is shown, checked, or None."""
    for what, given, needs, there in (
        ("mean", mean, "seen", n_shown > 0),
        ("spread", spread, "mean", mean is not None),
    ):
        if given is not None and not there:
            raise ValueError(f"{what} is of what is drawn; give {needs}, too.")
    mean, spread = (
        x if x is None else as_drawn(x, what, (n_frames, n_shown))
        for x, what in ((mean, "The mean"), (spread, "The spread"))
    )
    if spread is not None and (spread < 0).any():
        raise ValueError("The spread must be a standard deviation, of at least 0.")
    return mean, spread


def as_moving(bodies, mean_body, lengths, n_frames, skeleton):
    """The body of each performance, and the mean one, checked; None without bodies."""
    if bodies is None:
        return [None] * len(lengths), None
    if mean_body is None or skeleton is None:
        raise ValueError("Bodies are drawn before the mean one: give mean_body and skeleton, too.")
    shape = len(skeleton.joints), skeleton.n_dims
    bodies = each_of(bodies, lengths, "bodies", shape)
    return bodies, as_drawn(mean_body, "The mean body", (n_frames, *shape))


def from_zero(times, n, i):
    """Time since the first frame, which increases."""
    if times is None:
        return np.arange(float(n))
    if not (np.diff(times) > 0).all():
        raise ValueError(f"Performance {i}: times must increase from frame to frame, got {times}.")
    return times - times[0]


def taken(live, X, what="X"):
    """How to choose of X what ``track`` takes, its arrays, their labels; if it is a single one."""
    check_is_fitted(live)
    collection = as_collection(X)
    if collection is not None and len(collection) == 0:
        raise ValueError("Found 0 performances (n_samples=0); there is nothing to draw.")
    if collection is None and np.ndim(X) != 2:
        raise ValueError(
            f"{what} must be performances, or one of them, 2-D; got an array of shape "
            f"{np.shape(X)}."
        )
    on_rows = live.mean_.shape[1] != live.n_features_in_
    if collection is None and on_rows:
        rows = np.asarray(X)
        arrays = list(rows[:, :, np.newaxis])
        names = X.index if isinstance(X, pd.DataFrame) else range(len(rows))
        return (lambda chosen: rows[chosen]), arrays, list(map(str, names)), False
    members = [X] if collection is None else collection
    names = [", ".join(map(str, n)) if isinstance(n, tuple) else n for n in labels_of(members)[0]]
    return (lambda chosen: [members[i] for i in chosen]), members, names, collection is None


def times_of(live, times, chosen, arrays, labels, each="performances"):
    """Of those that are chosen the times, which the estimator takes."""
    listed = one_each(times, len(arrays), "times", each)
    for i in chosen:
        check_times(listed[i], len(arrays[i]), live.frame_rate, f"Performance {labels[i]}")
    return [listed[i] for i in chosen]


def path_of(live, X, n):
    """The phases of the n frames of one performance that is over."""
    (tau,) = live.synchronizer_.match(X).times
    clock = np.arange(live.n_frames_)
    # Where tau stands still, any phase of that while is as right.
    return np.interp(np.linspace(0, clock[-1], n), tau + 1e-9 * clock, clock)


def spread_of(live, training):
    """The standard deviation of the training performances about their mean, (P, n_features)."""
    match = live.synchronizer_.match(training)
    warped = match.warp(taken(live, training)[1])
    return np.asarray(warped).reshape(len(warped), *live.mean_.shape).std(axis=0)


def bodies_of_features(body, seen, mean):
    """Joint positions of what is seen and of the mean, and whose they are."""
    if body is None:
        return None, None, None
    skeleton = find_step(body, DirectionCosines)[1].skeleton.body()
    *bodies, mean_body = (_positions(body, x, skeleton) for x in (*seen, mean))
    return bodies, mean_body, skeleton


def _positions(body, x, skeleton):
    """Joint positions (n_frames, n_joints, n_dims), NaN where nothing is known of them."""
    whole = ~np.isnan(x).any(axis=1)
    if isinstance(body, DirectionCosines):
        # Limbs are hidden one by one.
        body, whole = copy(body).set_params(hidden="nan"), np.ones(len(x), dtype=bool)
    found = np.full((len(x), len(skeleton.joints) * skeleton.n_dims), np.nan)
    if whole.any():
        found[whole] = np.asarray(body.inverse_transform(x[whole]))
    return found.reshape(len(x), -1, skeleton.n_dims)
