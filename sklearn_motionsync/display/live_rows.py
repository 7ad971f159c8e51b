"""What `PhaseDisplay` knows of a running performance, and the panels it draws it in."""

from textwrap import fill
from typing import NamedTuple

import numpy as np

from ..online.stream import time_left
from .bodies import bones_by_side, limits, on_screen, place_of, with_landmarks
from .drawing import COLORS, front_line, stage, sticks

__all__ = ["Action", "Followed", "Row"]

# How far ahead "soon" is, as a share of the duration at the mean pace.
_SOON = 0.1
# Standard deviations to each side that leave out a tenth.
_BAND = 1.645
# Points of the predicted rest.
_FINE = 60
# Letters of a name beside a panel.
_LETTERS = 24


class Action(NamedTuple):
    """What is expected of everybody.

    Attributes
    ----------
    n_frames : int
        Of the clock.
    duration : float or None
        Of a performance at the mean pace, in the unit of the times.
    mean, spread : ndarray (P, n_shown), or None
    body : ndarray (P, n_joints, n_dims), or None
        The mean one.
    """

    n_frames: int
    duration: float | None = None
    mean: np.ndarray | None = None
    spread: np.ndarray | None = None
    body: np.ndarray | None = None

    def at(self, phase, of):
        """Something of the frames of the clock at phases between them."""
        clock = np.arange(self.n_frames)
        flat = of.reshape(self.n_frames, -1)
        found = np.stack([np.interp(phase, clock, column) for column in flat.T], axis=-1)
        return found.reshape(*np.shape(phase), *of.shape[1:])

    def soon(self, phase, rate):
        """The phase a tenth of the duration later at this rate."""
        last = self.n_frames - 1
        return min(phase + _SOON * last * rate, last)

    def left(self, phase, elapsed):
        """How long it will go on, as `OnlineSynchronizer.time_left` guesses."""
        return time_left(phase / (self.n_frames - 1), elapsed, self.duration)

    def latest(self, of):
        """When the last is seen of a performance, or was expected at any of its frames."""
        if self.duration is None:
            return of.times[-1]
        goes_on = of.phase < self.n_frames - 1
        expected = of.times + np.where(goes_on, self.left(of.phase, of.times), 0)
        return max(of.times[-1], expected.max())

    def rest(self, phase, elapsed):
        """When what is left will come, and at which phases: (n,) each; empty at the end."""
        last = self.n_frames - 1
        if self.duration is None or phase >= last:
            return np.empty((2, 0))
        left = self.left(phase, elapsed)
        return elapsed + np.linspace(0, left, _FINE), np.linspace(phase, last, _FINE)


class Followed(NamedTuple):
    """A performance, and where it was said to be.

    Attributes
    ----------
    phase, rate, confidence, times : ndarray, shape (n_frames,)
        Times begin with 0.
    name : str
    seen : ndarray (n_frames, n_shown), or None
    afterwards : ndarray (n_frames,), or None
        The phase as it is known when all is over.
    bodies : ndarray (n_frames, n_joints, n_dims), or None
    """

    phase: np.ndarray
    rate: np.ndarray
    confidence: np.ndarray
    times: np.ndarray
    name: str
    seen: np.ndarray | None = None
    afterwards: np.ndarray | None = None
    bodies: np.ndarray | None = None


class Row:
    """The panels of one performance: a body if there is one, a dial, the phase, curves.

    Parameters
    ----------
    axes : list of Axes
    followed : Followed
    action : Action
    skeleton : Skeleton or None
        Of bodies.
    features : list of str
        Names of the curves.
    end : float
        Of the axis of time.
    azimuth : float
    """

    def __init__(self, axes, followed, action, skeleton, features, end, azimuth):
        self.axes, self._of, self._action = list(axes), followed, action
        axes = list(axes)
        self.figure = None
        if followed.bodies is not None:
            self.figure = _Figure(axes.pop(0), followed, action, skeleton, azimuth)
        self.dial = Dial(axes.pop(0))
        self._phase_panel(axes[0], end)
        self.curves = [
            _Curve(axis, followed, action, k, name, end)
            for k, (axis, name) in enumerate(zip(axes[1:], features, strict=True))
        ]

    def _phase_panel(self, axis, end):
        grey, blue, orange = (COLORS[k] for k in ("shadow", "performance", "mean"))
        self.confidence = _area(axis, grey, 0.75, "confidence")
        self.afterwards = None
        of, share = self._of, 100 / (self._action.n_frames - 1)
        if of.afterwards is not None:
            style = {"color": COLORS["pattern"], "linewidth": 0.9, "linestyle": "--"}
            label = "afterwards"
            (self.afterwards,) = axis.plot(of.times, share * of.afterwards, label=label, **style)
        label = _label("guess", self._action.duration)
        (self.rest,) = axis.plot([], [], color=orange, linestyle=":", label=label)
        self.phase = front_line(axis, [], [], color=blue, label="phase, live")
        axis.set_xlim(0, end)
        axis.set_ylim(0, 105)
        axis.set_ylabel("%")

    def show(self, time):
        """Let it be so late; the artists that have changed."""
        of, action = self._of, self._action
        now = max(np.searchsorted(of.times, time, side="right") - 1, 0)
        phase, rate, confidence = (x[now] for x in (of.phase, of.rate, of.confidence))
        last, past = action.n_frames - 1, slice(now + 1)
        soon = action.soon(phase, rate)
        rest = action.rest(phase, of.times[now])
        artists = self.dial.show(phase / last, soon / last, rate, confidence)
        self.phase.set_data(of.times[past], 100 / last * of.phase[past])
        _fill(self.confidence, of.times[past], 0, 100 * of.confidence[past])
        self.rest.set_data(rest[0], 100 / last * rest[1])
        artists += [self.phase, self.confidence, self.rest]
        if self.figure is not None:
            artists += self.figure.show(now, soon)
        for curve in self.curves:
            artists += curve.show(now, *rest)
        return artists


class _Curve:
    """A feature: what has been seen of it, and what is expected."""

    def __init__(self, axis, followed, action, k, name, end):
        self._times, self._seen = followed.times, followed.seen[:, k]
        self._action, self._k = action, k
        blue, orange = COLORS["performance"], COLORS["mean"]
        self.band = _area(axis, COLORS["envelope"], 0.35, _label("90 % band", action.spread))
        style = {"color": blue, "linewidth": 1, "linestyle": "--", "alpha": 0.6}
        (self.to_come,) = axis.plot(self._times, self._seen, label="what came", **style)
        style = {"color": orange, "linewidth": 2, "label": _label("predicted", action.mean)}
        (self.expected,) = axis.plot([], [], **style)
        self.seen = front_line(axis, [], [], color=blue, label="seen")
        (self.now,) = axis.plot([], [], "o", color=blue, markersize=5, zorder=5)
        everything = [self._seen]
        if action.mean is not None:
            mean, wide = action.mean[:, k], 0
            if action.spread is not None:
                wide = _BAND * action.spread[:, k]
            everything += [mean - wide, mean + wide]
        values = np.concatenate(everything)
        values = values[np.isfinite(values)]
        low, high = values.min(initial=np.inf), values.max(initial=-np.inf)
        if low > high:
            low, high = 0.0, 0.0
        margin = 0.06 * (high - low) or 1.0
        axis.set_ylim(low - margin, high + margin)
        axis.set_xlim(0, end)
        axis.set_ylabel(fill(name, _LETTERS))

    def show(self, now, times, phases):
        past = slice(now + 1)
        self.seen.set_data(self._times[past], self._seen[past])
        self.now.set_data([self._times[now]], [self._seen[now]])
        mean, spread = (
            None if x is None else self._action.at(phases, x[:, self._k])
            for x in (self._action.mean, self._action.spread)
        )
        if mean is not None:
            self.expected.set_data(times, mean)
        if spread is not None:
            _fill(self.band, times, mean - _BAND * spread, mean + _BAND * spread)
        return [self.seen, self.now, self.expected, self.band]


class _Figure:
    """The body that is seen, before the mean one as it will be soon."""

    def __init__(self, axis, followed, action, skeleton, azimuth):
        self._action, self._bones = action, bones_by_side(skeleton)
        self._bodies, mean = (
            on_screen(with_landmarks(x, skeleton), azimuth) for x in (followed.bodies, action.body)
        )
        self._mean = mean
        self.soon = sticks(axis, COLORS["shadow"], 5, zorder=1)
        self.bones = {side: sticks(axis, COLORS[side], 2) for side in ("middle", "left", "right")}
        self.head, self._head = None, None
        if "head" in skeleton.landmarks:
            self._head = place_of(self._bodies, skeleton, "head")
            (self.head,) = axis.plot([], [], "o", color=COLORS["middle"], markersize=5)
        places = [x.reshape(-1, 2) for x in (self._bodies, mean)]
        stage(axis, "", *limits(np.concatenate(places)))

    def show(self, now, soon):
        body, shadow = self._bodies[now], self._action.at(soon, self._mean)
        everywhere = [bone for bones in self._bones.values() for bone in bones]
        self.soon.set_segments([shadow[list(bone)] for bone in everywhere])
        for side, lines in self.bones.items():
            lines.set_segments([body[list(bone)] for bone in self._bones[side]])
        artists = [self.soon, *self.bones.values()]
        if self.head is not None:
            self.head.set_data(self._head[[now]].T)
            artists.append(self.head)
        return artists


def _label(text, known):
    """A label in a legend, or none for what is not known."""
    return text if known is not None else "_nolegend_"


def _area(axis, color, alpha, label):
    """An empty area, to be filled."""
    from matplotlib.collections import PolyCollection

    area = PolyCollection([], facecolor=color, alpha=alpha, linewidth=0, zorder=1, label=label)
    return axis.add_collection(area, autolim=False)


def _fill(area, xs, lower, upper):
    """Let an area be between two curves."""
    if len(xs) == 0:
        area.set_verts([])
        return
    lower, upper = np.broadcast_to(lower, xs.shape), np.broadcast_to(upper, xs.shape)
    there, back = np.column_stack([xs, upper]), np.column_stack([xs, lower])[::-1]
    area.set_verts([np.concatenate([there, back])])


# -- a dial: how much of an action is over, how sure that is, and how much will be over soon

# Inner and outer radius of the ring, and of the arc around it; how far out the letters are, and
# where the hand begins.
_RING, _ARC, _DIAL_LETTERS, _HAND = (0.78, 1.0), (1.05, 1.13), 1.28, 0.62
# How strongly what nobody is sure of is still seen.
_FAINTEST = 0.12


class Dial:
    """A ring from 0 % at the top, clockwise to 100 %, in axes of its own.

    Parameters
    ----------
    axis : Axes

    Attributes
    ----------
    passed : Wedge
        What is over; the paler, the less sure.
    ahead : Wedge
        Where it will be soon.
    hand : Line2D
        The thicker, the surer.
    share, says : Text
        How much is over; rate and confidence.
    """

    def __init__(self, axis):
        from matplotlib.patches import Wedge

        self._axis = axis
        axis.set_aspect("equal")
        axis.set_xlim(-1.5, 1.5)
        axis.set_ylim(-1.75, 1.45)
        axis.axis("off")

        def ring(color, radii, zorder, end=90):
            style = {"width": radii[1] - radii[0], "facecolor": color, "linewidth": 0}
            return axis.add_patch(Wedge((0, 0), radii[1], end, 90, zorder=zorder, **style))

        ring(COLORS["shadow"], _RING, 1, end=-270)
        self.passed = ring(COLORS["performance"], _RING, 2)
        self.ahead = ring(COLORS["mean"], _ARC, 3)
        style = {"color": COLORS["pattern"], "solid_capstyle": "round", "zorder": 4}
        (self.hand,) = axis.plot([], [], **style)
        style = {"ha": "center", "va": "center", "color": "0.35", "fontsize": "x-small"}
        for quarter, text in enumerate(("0 %", "25", "50", "75")):
            x, y = _at(quarter / 4, _DIAL_LETTERS + 0.02 * (quarter % 2))
            axis.text(x, y, text, **style)
        self.share = axis.text(0, 0, "", ha="center", va="center", fontsize="large")
        self.says = axis.text(0, -1.62, "", ha="center", va="center", fontsize="small")

    def show(self, share, soon, rate, confidence):
        """Put the hand at a share of the action; the artists that have changed."""
        self.passed.set_theta1(90 - 360 * share)
        self.passed.set_alpha(_FAINTEST + (1 - _FAINTEST) * confidence)
        self.ahead.set_theta1(90 - 360 * soon)
        self.ahead.set_theta2(90 - 360 * share)
        # An arc of no length would be a whole ring's outline.
        self.ahead.set_visible(soon > share)
        self.hand.set_data(*np.transpose([_at(share, _HAND), _at(share, _RING[1])]))
        self.hand.set_linewidth(1 + 4 * confidence)
        self.share.set_text(f"{100 * share:.0f} %")
        self.says.set_text(f"rate {rate:.1f}, confidence {confidence:.2f}")
        return [self.passed, self.ahead, self.hand, self.share, self.says]


def _at(share, radius):
    """Where a share of the action is on a circle."""
    angle = 2 * np.pi * share
    return radius * np.sin(angle), radius * np.cos(angle)
