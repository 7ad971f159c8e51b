"""PhaseDisplay: where running performances are, and what is expected of the rest of them."""

from itertools import pairwise
from textwrap import fill

import numpy as np

from ..body.checks import is_whole
from ..features import choose_features
from ..features import names_of as names_of_features
from ..live.online import OnlineSynchronizer
from .animation import playable
from .drawing import legend_above, panels
from .given import (
    as_index,
    as_indices,
    as_names,
    as_pictures,
    as_skeleton,
    check_view,
    is_number,
)
from .live_given import (
    as_expected,
    as_moving,
    as_phases,
    bodies_of_features,
    each_of,
    from_zero,
    path_of,
    spread_of,
    taken,
    times_of,
)
from .live_rows import Action, Followed, Row

__all__ = ["PhaseDisplay"]

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
    >>> from sklearn_motionsync import ASpace, DirectionCosines, OnlineSynchronizer, PhaseDisplay
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
        if not is_whole(n_frames) or n_frames < 2:
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
        X : performances, as ``estimator.follow`` takes them; or one, array (n_frames, n_features)
        times : list of array-like (n_frames_i,), default=None
            As ``estimator.follow`` takes them; of one performance an array.
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
            As from ``estimator.follow``; or if there is no such performance, feature or frame.
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
        phases = live.follow(given(chosen), times)
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
