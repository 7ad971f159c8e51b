"""Recordings of walking: labels, frame rates, and the feet beside the pelvis."""

import math

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from ..body.axes import to_y_up
from ..body.columns import check_columns, plain_positions
from ..body.formats import SIDES
from ..body.landmarks import as_tuple, guess_feet
from ..body.skeleton import Skeleton
from ..inputs.collections import as_collection, check_members
from ..inputs.numbers import nanmean
from ..inputs.recorded import frames_of_rows, rows_at, times_of_rows
from ..inputs.tables import as_pandas, index_of
from ..inputs.trial_facts import TrialFacts
from ..inputs.wording import counted, within
from ..matching.counting import runs_of, whole
from ..matching.filters import smooth
from ..matching.gaps import interpolate_gaps

# Frames beyond an end that are rounding.
_MARGIN = 0.5
# Least and largest frames a second.
_RATES = 1.0, 10_000.0
# Metres of the units of positions.
_METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}
# Labels of events, and contexts, as C3D files have them.
FOOT_STRIKE, FOOT_OFF = "Foot Strike", "Foot Off"
CONTEXTS = {"left": "Left", "right": "Right"}


class Recordings:
    """Recordings of bodies that walk.

    Parameters
    ----------
    X, skeleton, feet, frame_rate
        As of `gait_events`.

    Attributes
    ----------
    skeleton : Skeleton
    levels : list of str
        Names of the levels of the labels of recordings.
    """

    def __init__(self, X, skeleton=None, feet=None, frame_rate=None):
        X = X if skeleton is None else plain_positions(X, skeleton)
        sequences = as_collection(X)
        self._recordings = [as_pandas(X)] if sequences is None else sequences
        if skeleton is None:
            first = next(iter(self._recordings), None)
            if not isinstance(first, pd.DataFrame):
                raise ValueError(
                    "Arrays do not name their joints: give a skeleton, such as "
                    "Skeleton.from_frame(df) or Skeleton(joints, parents)."
                )
            skeleton = Skeleton.from_frame(first)
            self._recordings = plain_positions(self._recordings, skeleton)
        self._checked = check_members(self._recordings, finite="allow-nan")
        self.skeleton, self._feet = skeleton, joints_of_feet(skeleton, feet)
        names, width = self._checked.names or (), self._checked[0].shape[1]
        check_columns(names, skeleton, self.called(0), width)
        facts = TrialFacts.of(self._recordings, frame_rate)
        self._labels, self.levels = facts.labels, list(facts.levels[:-1])
        self._rates = facts.known_rates().tolist()
        slowest, fastest = _RATES
        for i, rate in enumerate(self._rates):
            if not slowest <= rate <= fastest:
                raise ValueError(
                    f"{self.called(i)} has a frame rate of {rate:g}; recordings of people have "
                    f"{slowest:g} to {fastest:g} frames a second. Give frame_rate= in frames a "
                    "second, not the time between frames."
                )
        # Arrays say nothing of their unit.
        self._units = [known.get("units") for known in self._checked.facts] or [None] * len(self)

    def __len__(self):
        return len(self._checked)

    def called(self, i):
        """The name of a recording in messages."""
        return self._checked.called(i)

    def walk(self, i):
        """The `Walk` of a recording."""
        return Walk(self._checked[i], self.skeleton, self._feet, self._rates[i], self.called(i))

    def length_of_leg(self, i, walk):
        """The length of a leg, and its unit: metres, if it is known that positions are lengths."""
        unit = self._units[i]
        return (walk.leg * _METRES[unit], "m") if unit in _METRES else (walk.leg, "")

    def frames_at(self, i, rows):
        """The frames of rows of a recording, with fractions, as its index counts."""
        frames = frames_of_rows(self._recordings[i])
        return np.interp(rows, np.arange(len(frames)), frames)

    def row_of_frame(self, i, frame):
        """The inverse of `frames_at`; beyond the ends, frames are single steps."""
        known = frames_of_rows(self._recordings[i])
        row = np.interp(frame, known, np.arange(len(known)))
        return row + frame - np.clip(frame, known[0], known[-1])

    def times_at(self, i, rows):
        """Seconds at rows of a recording."""
        return times_of_rows(self._recordings[i], rows, self._rates[i])

    def row_of_time(self, i, time):
        """The inverse of `times_at`."""
        return rows_at(self._recordings[i], time, self._rates[i])

    def split_events(self, events):
        """The events of a table, by recording: label, side and row; None of each without a table.

        Parameters
        ----------
        events : DataFrame or None
            As `gait_events` returns it.
        """
        if events is None:
            return [None] * len(self)
        table = as_pandas(events)
        columns = list(getattr(table, "columns", ()))
        time = next((name for name in ("frame", "time") if name in columns), None)
        missing = [name for name in ("label", "context") if name not in columns]
        missing += ["frame"] * (time is None)
        missing += [k for k in self.levels if k not in columns] if len(self) > 1 else []
        if missing:
            raise ValueError(
                f"events: there is no column {missing[0]!r}; there are {columns}. Give a table as "
                "gait_events returns it."
            )
        places = {label: i for i, label in enumerate(self._labels)}
        keys = [self._labels[0]] * len(table)
        if set(self.levels) <= set(columns):
            keys = list(table[self.levels].itertuples(index=False, name=None))
            keys = [key[0] if len(self.levels) == 1 else key for key in keys]
        by_recording = [[] for _ in self._labels]
        sides = {context.casefold(): side for side, context in CONTEXTS.items()}
        rows = zip(keys, table["label"], table["context"], table[time], strict=True)
        for key, label, context, value in rows:
            if key not in places:
                raise ValueError(
                    f"events: recording {key!r} is not in X, whose labels are {self._labels[:6]}."
                )
            i, side = places[key], sides.get(str(context).strip().casefold())
            if side is None or label not in (FOOT_STRIKE, FOOT_OFF) or pd.isna(value):
                continue
            at = self.row_of_frame(i, value) if time == "frame" else self.row_of_time(i, value)
            if not -_MARGIN <= at <= len(self._recordings[i]) - 1 + _MARGIN:
                raise ValueError(
                    f"events: {label} {context} at {time} {value:.6g} is outside of "
                    f"{within(self.called(i))}. Leave its row out, or give the events of these "
                    "recordings."
                )
            by_recording[i].append((label, side, float(at)))
        if len(table) and not any(by_recording):
            raise ValueError(
                f"events: none of {counted(len(table), 'row')} has a label {FOOT_STRIKE!r} or "
                f"{FOOT_OFF!r}, a context 'Left' or 'Right', and a {time} that is known."
            )
        return [sorted(events_of_one, key=lambda event: event[2]) for events_of_one in by_recording]

    def stack(self, tables):
        """Tables of recordings below each other, with the labels of recordings in columns."""
        keys = index_of(self._labels, self.levels).repeat([len(table) for table in tables])
        labels = keys.to_frame(index=False)
        return pd.concat([labels, pd.concat(tables, ignore_index=True)], axis=1)


# -- the feet of a recording, heels and toes beside the pelvis ----------------------------------

_ENDS_OF_FEET = [f"{side}_{part}" for side in SIDES for part in ("heel", "toe")]
# Positions are interpolated to at least so many samples a second.
_LEAST_RATE = 240
# Gaps up to this length, in seconds, are filled in. Pieces between gaps that are shorter than the
# second number, or have fewer frames than the third, are left out.
_LONGEST_GAP, _SHORTEST_PIECE, _FEWEST = 0.2, 0.25, 4
# Standard deviations, in seconds, of the Gaussians for the direction of walking, and for the speed
# of feet that swing.
_HEADING, _SWING = 0.2, 0.03
# Variance of third differences of white noise of variance 1; the share of them that is taken, those
# of feet on the ground; and how large normal deviates are at most in such a share.
_THIRD_DIFFERENCE, _SHARE, _DEVIATE = 20, 0.25, 0.3186


def joints_of_feet(skeleton, feet=None):
    """Indices of the joints at heels and toes: those that are given, or guessed from the names.

    ``feet`` has the names of some or all of `_ENDS_OF_FEET`, and None leaves one out. The result, a
    dict of tuples, lacks those that are not known.
    """
    named = {} if feet is None else dict(feet)
    for name, joints in named.items():
        if name not in _ENDS_OF_FEET:
            raise ValueError(f"feet: {name!r} is none of {', '.join(_ENDS_OF_FEET)}.")
        for joint in () if joints is None else as_tuple(joints):
            if joint not in skeleton.joints:
                raise ValueError(
                    f"feet: {name!r} is at {joint!r}, which is no joint of the skeleton; it has "
                    f"{list(skeleton.joints)[:40]}."
                )
    known = guess_feet(skeleton.joints, skeleton.landmarks) | named
    return {
        name: tuple(skeleton.joints.index(joint) for joint in as_tuple(joints))
        for name, joints in known.items()
        if joints is not None
    }


class Walk:
    """A recording of a body that walks, at an even rate of at least 240 samples a second.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_dims * n_joints)
        NaN where a joint is not seen.
    skeleton : Skeleton
    feet : dict of str to tuple of int
        From `joints_of_feet`.
    frame_rate : float
    called : str
        The name of the recording, with a capital letter.

    Attributes
    ----------
    rate : float
        Samples a second.
    n_samples : int
    per_frame : int
        Samples a frame.
    heels, toes : dict of str to ndarray (n_samples, n_dims)
        By side, y up, in leg lengths; NaN in long gaps. The ankle stands for a missing heel. Feet
        without toes have none.
    has_heel : dict of str to bool
    noise : dict of str to float
        Standard deviation of the noise of the height of the heel in a frame.
    pelvis : ndarray, shape (n_samples, n_dims)
        A hip if there is no other.
    forward : ndarray, shape (n_samples, n_dims - 1)
        Horizontal unit vectors along which the body walks. Of a body that walks backwards they
        point back, and heels and toes are exchanged: its toes strike first.
    leg : float
        Median height of the pelvis above the lower foot, the unit of the positions above.
    """

    def __init__(self, positions, skeleton, feet, frame_rate, called):
        self._points = to_y_up(
            positions.astype(np.float64).reshape(len(positions), -1, skeleton.n_dims), skeleton
        )
        self._fewest = max(_FEWEST, whole(_SHORTEST_PIECE * frame_rate, "up"))
        if len(positions) < self._fewest:
            raise ValueError(
                f"{called} has {counted(len(positions), 'frame')} at {frame_rate:g} a second; "
                f"{_SHORTEST_PIECE:g} s and {_FEWEST} frames are the least. Leave it out."
            )
        self.per_frame = max(1, whole(_LEAST_RATE / frame_rate, "up"))
        self.rate, self._frame_rate = frame_rate * self.per_frame, frame_rate
        self.n_samples = (len(positions) - 1) * self.per_frame + 1
        self.heels, self.toes, self.has_heel, self.noise = {}, {}, {}, {}
        for side in SIDES:
            choices = [feet.get(f"{side}_heel"), self._landmark(skeleton, f"{side}_ankle")]
            at = next((c for c in choices if c is not None and self._is_seen(c)), None)
            if at is None:
                continue
            self.has_heel[side] = at == choices[0]
            self.noise[side] = _noise(self._mean(at)[:, 1])
            self.heels[side] = self._resample(at)
            if f"{side}_toe" in feet and self._is_seen(feet[f"{side}_toe"]):
                self.toes[side] = self._resample(feet[f"{side}_toe"])
        if not self.heels:
            raise ValueError(
                f"{called}: no heel and no ankle is seen. Name them: "
                "feet={'left_heel': 'LHEE', ...}."
            )
        places = [k for k in ("pelvis", "left_hip", "right_hip") if k in skeleton.landmarks]
        if not places:
            raise ValueError(
                f"{called}: the skeleton has no pelvis and no hip. Name one: "
                "Skeleton(..., landmarks={'pelvis': ..., ...})."
            )
        self.pelvis = self._resample(skeleton.indices_of(places[0]))
        lowest = np.min([heel[:, 1] for heel in self.heels.values()], axis=0)
        heights = self.pelvis[:, 1] - lowest
        heights = heights[~np.isnan(heights)]
        self.leg = float(np.median(heights)) if len(heights) else 0.0
        if not self.leg > 0:
            raise ValueError(
                f"{called}: the pelvis is never seen above the feet. Look at the vertical axis of "
                f"the skeleton, {skeleton.up!r}, and at the landmarks."
            )
        for of_all in (self.heels, self.toes, self.noise):
            for side in of_all:
                of_all[side] = of_all[side] / self.leg
        self.pelvis = self.pelvis / self.leg
        self.forward = self._directions(skeleton)
        self.forward *= self._sense_of_swings()
        along = [
            np.einsum("ij,ij->i", horizontal(toe - self.heels[side]), self.forward)
            for side, toe in self.toes.items()
        ]
        if along and np.nanmean(np.concatenate(along)) < 0:
            for side in self.toes:
                self.heels[side], self.toes[side] = self.toes[side], self.heels[side]

    def ahead(self, points):
        """How far points (n_samples, n_dims) are ahead of the pelvis."""
        return np.einsum("ij,ij->i", horizontal(points - self.pelvis), self.forward)

    def filtered(self, values, width, order=0):
        """Values (n_samples,) or (n_samples, n) under a Gaussian, or their derivative by time.

        ``width`` is its standard deviation in seconds. NaN stays NaN.
        """
        flat = values.reshape(len(values), -1)
        out = np.full_like(flat, np.nan)
        for piece in pieces(flat):
            if piece.stop - piece.start > 2:
                part = np.ascontiguousarray(flat[piece])[np.newaxis]
                out[piece] = smooth(part, width * self.rate, order)[0] * self.rate**order
        return out.reshape(values.shape)

    def _landmark(self, skeleton, name):
        return skeleton.indices_of(name) if name in skeleton.landmarks else None

    def _is_seen(self, joints):
        return not np.isnan(self._mean(joints)).any(axis=1).all()

    def _mean(self, joints):
        """The mean of some joints: (n_frames, n_dims), NaN where none of them is seen.

        A joint that is hidden while another is seen keeps its way from that one, on a straight line
        across the gap. One that is never seen is left out.
        """
        points = self._points[:, list(joints)]
        hidden = np.isnan(points).any(axis=2)
        points, hidden = points[:, ~hidden.all(axis=0)], hidden[:, ~hidden.all(axis=0)]
        if not hidden.any() or points.shape[1] < 2:
            return nanmean(points, axis=1)
        filled = points.copy()
        for j in np.flatnonzero(hidden.any(axis=0)):
            ways = (points[:, j, np.newaxis] - points).reshape(len(points), -1)
            ways = interpolate_gaps(ways, held=True, way="line").reshape(points.shape)
            rows = hidden[:, j]
            filled[rows, j] = nanmean((points + ways)[rows].swapaxes(0, 1), axis=0)
        return filled.mean(axis=1)

    def _resample(self, joints):
        """Positions of the mean of some joints at the samples."""
        longest = whole(_LONGEST_GAP * self._frame_rate, "down")
        x = interpolate_gaps(self._mean(joints), longest)
        frames = np.arange(len(x))
        out = np.full((self.n_samples, x.shape[1]), np.nan)
        for piece in pieces(x):
            if piece.stop - piece.start < self._fewest:
                continue
            samples = np.arange(piece.start * self.per_frame, (piece.stop - 1) * self.per_frame + 1)
            spline = CubicSpline(frames[piece], x[piece])
            out[samples] = spline(samples / self.per_frame)
        return out

    def _directions(self, skeleton):
        """Horizontal unit vectors along the way, in either sense.

        Across hips or shoulders, else along the feet, else along the line on which they come apart.
        """
        if skeleton.n_dims == 2:
            return np.ones((self.n_samples, 1))
        for part in ("hip", "shoulder"):
            pair = [self._landmark(skeleton, f"{side}_{part}") for side in SIDES]
            if None not in pair and all(map(self._is_seen, pair)):
                left, right = map(self._resample, pair)
                across = horizontal(left - right)
                return self._unit(np.stack([-across[:, 1], across[:, 0]], axis=1))
        if self.toes:
            along = [self.toes[side] - self.heels[side] for side in self.toes]
            return self._unit(nanmean([horizontal(x) for x in along], axis=0))
        apart = np.concatenate([horizontal(heel - self.pelvis) for heel in self.heels.values()])
        apart = apart[~np.isnan(apart).any(axis=1)]
        axes = np.linalg.eigh(np.cov(apart, rowvar=False))[1]
        return np.tile(axes[:, -1], (self.n_samples, 1))

    def _sense_of_swings(self):
        """1 if feet swing along `forward`, in which they are higher than on the ground; else -1."""
        total = 0.0
        for heel in self.heels.values():
            velocity = self.filtered(self.ahead(heel), _SWING, 1)
            height = heel[:, 1] - self.pelvis[:, 1]
            known = ~np.isnan(velocity) & ~np.isnan(height)
            total += float(((height - height[known].mean()) * velocity)[known].sum())
        return 1.0 if total >= 0 else -1.0

    def _unit(self, directions):
        filled = interpolate_gaps(directions, held=True, way="line")
        filled = smooth(filled[np.newaxis], _HEADING * self.rate)[0]
        size = np.linalg.norm(filled, axis=1, keepdims=True)
        return filled / np.where(size > 0, size, 1)


def pieces(x):
    """Slices of rows (n, n_columns) without NaN."""
    return [slice(first, end) for first, end in runs_of(~np.isnan(x).any(axis=1)).tolist()]


def horizontal(points):
    """The components (n, n_dims - 1) of points, y up, that are not vertical."""
    return points[:, [0, 2]] if points.shape[1] == 3 else points[:, [0]]


def _noise(heights):
    """Standard deviation of white noise, from the smallest third differences."""
    third = np.abs(np.diff(heights, 3))
    third = third[~np.isnan(third)]
    if not len(third):
        return 0.0
    return float(np.quantile(third, _SHARE)) / _DEVIATE / math.sqrt(_THIRD_DIFFERENCE)
