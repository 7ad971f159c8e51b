"""Events of walks and their parameters, computed slowly by hand."""

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from scipy.signal import find_peaks
from sklearn_motionsync import Skeleton
from sklearn_motionsync.datasets import make_walk
from sklearn_motionsync.gait import gait_events, gait_parameters
from sklearn_motionsync.gait.events import events_of
from sklearn_motionsync.gait.recordings import Walk, joints_of_feet

MADE = make_walk(2, n_strides=5, noise=0.0009, random_state=3)
ON_BELT = make_walk(1, n_strides=5, treadmill=True, random_state=3)
JOINTS = list(MADE.skeleton.joints)

# -- events --------------------------------------------------------------------------------------


def vertex(y, k):
    """Where a parabola through three samples is largest."""
    a, b, _ = np.polyfit([-1, 0, 1], y[k - 1 : k + 2], 2)
    return k - b / (2 * a)


def highest(y, by):
    """The local maximum of y where `by` is largest; None without one."""
    peaks = [k for k in range(1, len(y) - 1) if y[k - 1] <= y[k] > y[k + 1]]
    return vertex(y, max(peaks, key=lambda k: by[k])) if peaks else None


def turning_points(walk, side, points, sign):
    """Samples where a foot is farthest ahead or behind, and whether at an end."""
    curve = sign * walk.filtered(walk.ahead(points), 0.03)
    known = np.flatnonzero(~np.isnan(curve))
    if not len(known):
        return []
    span = np.percentile(curve[known], 97) - np.percentile(curve[known], 3)
    (other,) = [heel for s, heel in walk.heels.items() if s != side] or [walk.pelvis]
    way = (points - other)[:, [0, 2]] if points.shape[1] == 3 else (points - other)[:, :1]
    rows, reach = [], int(0.6 * walk.rate + 1e-9)
    for run in np.split(known, np.flatnonzero(np.diff(known) > 1) + 1):
        y = curve[run]
        outside = y.min() - span
        peaks, _ = find_peaks(
            [outside, *y, outside], prominence=max(0.4 * span, 0.15),
            distance=int(0.35 * walk.rate + 1e-9),
        )  # fmt: skip
        for k in peaks - 1:
            at_start, at_stop = k <= int(0.03 * walk.rate + 1e-9), k >= len(y) - 3
            around = way[max(run[0] + k - reach, 0) : run[0] + k + reach]
            moved = np.linalg.norm(around.max(axis=0) - around.min(axis=0))
            if (at_start or not at_stop) and not moved < 0.15:
                rows.append((run[0] + (k if at_start else vertex(y, k)), at_start))
    return rows


def delayed(walk, side, curve, moments, usual, spread, first, last, doubt=0.0):
    """Peaks of a curve after moments, None where there is none; and whether their mean has one."""
    rate = walk.rate
    variance = walk.noise[side] ** 2 * walk.per_frame / rate
    inner = [round(k) for k, is_end in moments if not is_end]
    lags, n = range(int(np.round(first * rate)), int(np.round(last * rate)) + 1), max(len(inner), 1)
    rows = [[curve[k + d] if 0 <= k + d < len(curve) else np.nan for d in lags] for k in inner]
    mean = np.nanmean(rows, axis=0) if rows else np.full(len(lags), np.nan)
    height = np.sqrt(variance / n * 0.2116 / 0.0175**5)
    seconds = np.array(lags) / rate
    at = highest(mean, mean - height / 2 * ((seconds - usual) / spread) ** 2)

    def weight(width, count, more):
        noise = variance / count * 0.5289 / 0.0175**7 / 14000**2
        return width**2 / (width**2 + noise + more**2)

    delay = usual * rate
    if at is not None:
        delay += weight(spread, n, doubt) * (at + lags[0] - delay)
    half = np.inf if at is None else mean[round(at)] / 2

    def peak_between(a, b):
        a, b = max(0, round(a) - 1), min(len(curve), round(b) + 2)
        piece = curve[a:b]
        found = highest(piece, piece) if len(piece) > 2 else None
        return None if found is None else a + found

    found = []
    for k, is_end in moments:
        if is_end:
            peak = peak_between(k, k + last * rate) if weight(0.01, 1, 0.0) > 0.5 else None
            found.append(peak if peak is not None and curve[round(peak)] > half else None)
            continue
        middle = k + delay
        peak = peak_between(middle - 0.04 * rate, middle + 0.04 * rate)
        found.append(middle if peak is None else middle + weight(0.01, 1, doubt) * (peak - middle))
    return found, at is not None


def events_by_hand(walk):
    strikes, behind, events = {}, {}, []
    for side, heel in walk.heels.items():
        doubt, ahead = 0.0 if walk.has_heel[side] else 0.02, turning_points(walk, side, heel, 1)
        strike = 0.04, 0.015, -0.02, 0.15, doubt
        at, is_known = delayed(walk, side, walk.filtered(heel[:, 1], 0.0175, 2), ahead, *strike)
        if not is_known:
            at, _ = delayed(walk, side, -walk.filtered(heel[:, 1], 0.0175), ahead, *strike)
        strikes[side] = [k for k in at if k is not None]
        foot = walk.toes.get(side, heel)
        behind[side] = [(k, end) for k, end in turning_points(walk, side, foot, -1) if not end]
    late = []
    for side, moments in behind.items():
        others = [k for other, at in strikes.items() if other != side for k in at]
        if side in walk.toes and others:
            late += [k - min(others, key=lambda other: abs(other - k)) for k, _ in moments]
    late = [k / walk.rate for k in late if abs(k) / walk.rate < 0.35]
    for side, moments in behind.items():
        heel, off = walk.heels[side], [k for k, _ in moments]
        if side not in walk.toes:
            rise = walk.filtered(heel[:, 1], 0.0175, 1)
            off, _ = delayed(walk, side, rise, moments, 0.0, 0.05, -0.15, 0.1)
            off = [k + 0.02 * walk.rate for k in off]
        elif late and np.median(late) < 0.04:
            rise = walk.filtered(walk.toes[side][:, 1], 0.0175, 2)
            off, _ = delayed(walk, side, rise, moments, -0.09, 0.015, -0.16, 0.06)
        rows = [("Foot Strike", side, k) for k in strikes[side]]
        rows += [("Foot Off", side, k) for k in off]
        for row in rows:
            k = round(row[2])
            if 0 <= k < len(heel) and np.isfinite(heel[k]).all():
                events.append(row)
    return sorted(events, key=lambda event: event[2])


def changed(kind):
    """A made walk that was changed, with its skeleton, feet and frame rate."""
    made = ON_BELT if kind == "belt" else MADE
    points = made.data[kind == "noisy"].reshape(-1, len(JOINTS), 3).copy()
    skeleton, feet, rate = MADE.skeleton, {}, 100
    if kind.startswith("cut"):
        points = points[int(kind[3:]) :]
    elif kind == "nearly clear":
        points = points[73:]
        points += np.random.default_rng(0).normal(0, 0.001, points.shape)
    elif kind == "short":
        points = points[120:260]
    elif kind == "noisy":
        points += np.random.default_rng(0).normal(0, 0.02, points.shape)
    elif kind == "slow":
        points, rate = points[::4], 25
    elif kind.startswith("quick"):
        points, rate = points[: int(kind[5:])], 250
    elif kind == "shuffling":
        # Ever longer steps.
        share = np.linspace(0.1, 0.4, len(points))[:, np.newaxis]
        points[..., 2] = points[:, :1, 2] + share * (points[..., 2] - points[:, :1, 2])
    elif kind == "rocking":
        # The pelvis swings above feet that stand, and then above feet that move a little.
        ends, foot = (
            [JOINTS.index(f"{side}_{end}") for side in sides for end in ("heel", "toe")]
            for sides in (("left", "right"), ("left",))
        )
        points[250:] = points[250]
        wave = np.sin(np.arange(len(points) - 250) / 9)[:, np.newaxis]
        points[250:, :, 2] += 0.3 * wave
        points[250:, ends, 2] = points[250, ends, 2]
        points[250:, foot, 2] -= np.linspace(0, 0.2, len(wave))[:, np.newaxis] * wave
    elif kind == "without heels":
        feet = {"left_heel": None, "right_heel": None}
    elif kind == "without toes":
        feet = {"left_toe": None, "right_toe": None}
    elif kind.startswith(("toes", "dips")):
        # Toes are ahead of their time, as those of runners; and dip so long after they are behind.
        early, toes = 9, [JOINTS.index(f"{side}_toe") for side in ("left", "right")]
        if kind.startswith("toes"):
            early = int(kind[4:])
        ways = points[:, toes] - points[:, :1]
        points[:-early, toes] = points[:-early, :1] + ways[early:]
        walk = Walk(points.reshape(len(points), -1), skeleton, joints_of_feet(skeleton), rate, "")
        for (side, foot), toe in zip(walk.toes.items(), toes, strict=True):
            if kind.startswith("dips"):
                behind = [k / 3 + float(kind[4:]) for k, _ in turning_points(walk, side, foot, -1)]
                off = np.subtract.outer(np.arange(len(points)), behind)
                points[:, toe, 1] = -0.05 * np.exp(-((off / 3) ** 2) / 2).sum(axis=1)
                points[:200, toe] = np.nan
    elif kind.startswith(("heels", "ankles")):
        # Heights of heels are late.
        feet = {"left_toe": None, "right_toe": None} if kind.startswith("ankles") else {}
        frames = np.arange(len(points))
        for side in ("left", "right"):
            heights = points[:, JOINTS.index(f"{side}_heel"), 1]
            heights[:] = np.interp(frames - float(kind.split()[1]), frames, heights)
    elif kind == "one foot":
        foot = [JOINTS.index(f"left_{part}") for part in ("ankle", "heel", "toe")]
        points[:, foot] = np.nan
    elif kind == "gaps":
        points[150:230, JOINTS.index("left_heel")] = np.nan
        points[330:400, JOINTS.index("right_toe")] = np.nan
    elif kind.startswith("short steps"):
        # Some hardly reach the least share of the usual swing.
        pelvis, share = points[:, :1], float(kind.split()[2])
        points[200:450, :, 2] = (pelvis + share * (points - pelvis))[200:450, :, 2]
    elif kind == "side view":
        points = points[..., [2, 1]]
        skeleton = Skeleton(JOINTS, skeleton.parents, dict(skeleton.landmarks), n_dims=2)
    elif kind == "flat":
        feet = {"left_toe": None, "right_toe": None}
        points[..., 1] = np.round(points[..., 1], 1)
    elif kind in ("slow belt", "sliding"):
        pace = {"slow belt": 0.3, "sliding": 0.2}[kind]
        points += np.multiply.outer(np.arange(len(points)) / rate, [0, 0, pace])[:, np.newaxis]
    return points.reshape(len(points), -1), skeleton, feet, rate


KINDS = [
    "whole", "cut12", "cut30", "cut73", "cut88", "cut97", "short", "noisy", "slow", "quick435",
    "quick400", "without heels", "without toes", "one foot", "gaps", "shuffling", "rocking",
    "short steps 0.371", "short steps 0.392", "side view", "flat", "toes 5", "toes 9", "toes 56",
    "dips -15.9", "dips -15.67", "dips 5.67", "dips 6", "heels -7.5", "heels -6", "heels -5.5",
    "heels 10.5", "nearly clear", "ankles 7.5", "ankles 8", "ankles 15.5",
]  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_events_equal_those_by_hand(kind):
    x, skeleton, feet, rate = changed(kind)
    walk = Walk(x, skeleton, joints_of_feet(skeleton, feet), rate, "Walk")
    found, expected = events_of(walk), events_by_hand(walk)
    assert len(found) > 5
    assert [event[:2] for event in found] == [event[:2] for event in expected]
    np.testing.assert_allclose([k for *_, k in found], [k for *_, k in expected], atol=1e-6)


# -- parameters ----------------------------------------------------------------------------------


def parameters_by_hand(walk, events, leg):
    """Rows of left, right, mean, standard deviation, number and asymmetry of each parameter."""

    def at(label, side):
        return [k for name, of, k in events if (name, of) == (label, side)]

    def ground(points, k):
        row = points[min(max(round(k), 0), len(points) - 1)]
        return row[[0, 2] if len(row) == 3 else [0]]

    speeds = []
    for side, heel in walk.heels.items():
        for first in at("Foot Strike", side):
            last = next((k for k in at("Foot Off", side) if k > first), None)
            if last is not None:
                a, b = round(first + 0.25 * (last - first)), round(first + 0.55 * (last - first))
                if a < b < len(heel):
                    speeds.append((ground(heel, b) - ground(heel, a)) / (b - a) * walk.rate)
    speeds = [v for v in speeds if np.isfinite(v).all()]
    belt = np.median(speeds, axis=0) if speeds else np.zeros(walk.forward.shape[1])
    if np.hypot.reduce(belt) <= 0.25:
        belt = 0 * belt
    out = {}
    for side, other in (("left", "right"), ("right", "left")):
        strikes, rows = at("Foot Strike", side), []
        every = [*np.diff(strikes), *np.diff(at("Foot Strike", other))]
        for first, last in pairwise(strikes):
            if last - first > 1.5 * np.median(every):
                continue

            def only(label, of, first=first, last=last):
                inside = [k for k in at(label, of) if first < k < last]
                return inside[0] if len(inside) == 1 else np.nan

            off, other_off = only("Foot Off", side), only("Foot Off", other)
            opposite = only("Foot Strike", other)
            stride, heel = last - first, walk.heels[side]
            way = ground(heel, last) - ground(heel, first) - belt * stride / walk.rate
            length, row = np.hypot.reduce(way), {}
            row["stride time"], row["stride length"] = stride / walk.rate, length * leg
            row["speed"] = row["stride length"] / row["stride time"]
            row["stance time"] = (off - first) / walk.rate
            row["swing time"] = (last - off) / walk.rate
            row["stance"] = 100 * (off - first) / stride
            row["step time"] = (last - opposite) / walk.rate
            row["cadence"] = 60 / row["step time"]
            if opposite == opposite:
                step = ground(heel, last) - ground(walk.heels[other], opposite)
                step = step - belt * (last - opposite) / walk.rate
                unit = way / length if length else way
                row["step length"] = leg * step @ unit
                if len(step) == 2:
                    row["step width"] = leg * abs(step[0] * unit[1] - step[1] * unit[0])
            if np.isfinite([off, opposite, other_off]).all():
                moments = np.sort([first, off, opposite, other_off, last])
                middles = (moments[1:] + moments[:-1]) / 2
                this, that = middles < off, (middles < other_off) & (middles > opposite)
                if other_off < opposite:
                    that = (middles < other_off) | (middles > opposite)
                shares = 100 * np.diff(moments) / stride
                row["double support"] = shares[this & that].sum()
                row["single support"] = shares[this & ~that].sum()
                row["flight"] = shares[~this & ~that].sum()
            rows.append(row)
        out[side] = rows
    table = {}
    for name in PARAMETERS:
        left, right = (
            np.array([row[name] for row in out[side] if np.isfinite(row.get(name, np.nan))])
            for side in ("left", "right")
        )
        both = np.r_[left, right]
        *means, mean = (x.mean() if len(x) else np.nan for x in (left, right, both))
        spread = both.std(ddof=1) if len(both) > 1 else np.nan
        middle = np.mean(means)
        asymmetry = 100 * (means[0] - means[1]) / middle if middle else np.nan
        table[name] = [*means, mean, spread, len(both), asymmetry]
    return table


PARAMETERS = {
    "cadence": "steps/min", "speed": "m/s", "stride time": "s", "step time": "s",
    "stance time": "s", "swing time": "s", "stance": "%", "single support": "%",
    "double support": "%", "flight": "%", "stride length": "m", "step length": "m",
    "step width": "m",
}  # fmt: skip


@pytest.mark.parametrize("kind", [
    "whole", "belt", "slow belt", "sliding", "toes 9", "toes 18", "short", "one foot", "gaps",
    "side view",
])  # fmt: skip
def test_parameters_equal_those_by_hand(kind):
    """Of centimetres; events are missing, there twice, and half a frame beyond the ends."""
    x, skeleton, feet, rate = changed(kind)
    walk = Walk(x, skeleton, joints_of_feet(skeleton, feet), rate, "Walk")
    events = events_of(walk)
    twice = [k + 3 for *of, k in events if of == ["Foot Off", "right"]][1:2]
    events = [*events[:6], *events[7:11], *events[12:], *[("Foot Off", "right", k) for k in twice]]
    ends = -0.4 * walk.per_frame, walk.n_samples - 1 + 0.4 * walk.per_frame
    events += [("Foot Strike", side, k) for side, k in zip(("left", "right"), ends, strict=True)]
    events.append(("Foot Off", "left", ends[0] + 0.3))
    events.sort(key=lambda event: event[2])
    names = ["label", "context", "frame"]
    table = pd.DataFrame([(a, b, k / walk.per_frame) for a, b, k in events], columns=names)
    data = pd.DataFrame(100 * x, columns=skeleton.column_names)
    data.attrs |= {"frame_rate": rate, "units": "cm"}
    found = gait_parameters(data, skeleton, events=table, feet=feet).loc[0]
    assert found["unit"].to_dict() == PARAMETERS
    expected = parameters_by_hand(walk, events, walk.leg)
    values = found.drop(columns="unit").astype(float)
    np.testing.assert_allclose(values, [expected[name] for name in values.index], atol=1e-7)
    assert (values["n"] > 0).sum() >= 4


def test_feet_that_stand_have_no_length():
    events = gait_events(MADE.data[:1], MADE.skeleton, frame_rate=100)
    still = np.repeat(MADE.data[0][:1], len(MADE.data[0]), axis=0)
    table = gait_parameters([still], MADE.skeleton, events=events, frame_rate=100).loc[0]
    rows = table.loc[["speed", "stride length", "step length"], ["left", "right", "mean"]]
    assert (rows == 0).all(axis=None)
