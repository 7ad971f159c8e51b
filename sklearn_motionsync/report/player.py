"""write_player: stick figures of several trials side by side in one HTML file, and its data."""

from __future__ import annotations

import base64
import pathlib

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.pipeline import make_pipeline

from ..body.base import PositionsTransformer
from ..body.skeleton import Skeleton
from ..display.arguments import as_trials, names_of_trials
from ..display.base import COLORS
from ..display.bodies import (
    bones_by_side,
    landmark_track,
    place_on_floor,
    project,
    read_positions,
)
from ..inputs.collections import Trials
from ..inputs.keyframes import Keyframes
from ..inputs.trial_facts import TrialFacts
from ..inputs.types import NamesLike, NumbersLike, Path, Table, TrialsLike, ValuesLike
from ..inputs.wording import counted
from ..synchronizers.match import Match
from ..utils.files import check_path
from ..utils.pipelines import transform_through, union_transformers
from .page import Page, paragraph, read_part

# Coordinates of two bytes each that a report holds of more than two trials: 4 MB of text.
MOST_COORDINATES = 1_500_000
# The largest number, and what stands for a joint that was not seen.
_LARGEST, _MISSING = 32767, -32768
# Trials that are side by side, at most.
MOST_SHOWN = 24
# Okabe and Ito's lighter colours, for a dark page.
_ON_DARK = {"left": "#56B4E9", "middle": "#B8B8B8", "right": "#E69F00"}
# Seconds of the median trial if no frame rate is known.
_UNKNOWN = 4.0


def write_player(
    path: Path,
    X: TrialsLike,
    skeleton: Skeleton | None,
    *,
    match: Match | BaseEstimator | None = None,
    names: NamesLike | None = None,
    keyframes: NumbersLike | Table | None = None,
    frame_rate: float | ValuesLike | None = None,
    title: str | None = None,
) -> pathlib.Path:
    """Write a player of trials side by side: one HTML file that opens without a network.

    It plays, pauses, repeats and slows down, and moves frame by frame. Bodies are seen from any
    side. With ``match`` they move on one clock, or each at its own pace; without it only the
    latter. All have one scale, and the grid wraps on a phone.

    Parameters
    ----------
    path : str or path
        Of the file, such as ``"squats.html"``. Its folder must exist. A file that is there already
        is replaced once the new one is complete.
    X : list of arrays (n_frames_i, n_dims * n_joints)
        Joint positions of 1 to 24 trials, of two frames or more. NaN where a joint was not seen.
    skeleton : Skeleton or None
        None shows the joints as points without bones, y up.
    match : Match, synchronizer or Pipeline with one, default=None
        The warps of X to one clock; of a fitted estimator those that it finds in X.
    names : list of str, default=None
        The names under the trials; by default their labels in X, or numbers.
    keyframes : array-like or DataFrame, shape (n_sequences, n_keyframes), default=None
        Frames of each trial, or seconds where a frame rate is given; NaN where one is not known.
        They are marked below the slider, and a button for each leads there. Columns of a table are
        their names. On one clock a mark is at the median of the trials.
    frame_rate : float, or array-like of shape (n_sequences,), default=None
        Frames a second of X; by default what tables tell, as in `Match.offsets_in`. If it is not
        known, the median trial takes four seconds.
    title : str, default=None
        Of the page; by default "Side by side".

    Returns
    -------
    Path
        Of the file.

    Raises
    ------
    FileNotFoundError
        If there is no such folder.
    ValueError
        If there are more than 24 trials, one has a single frame, or names, keyframes or
        match do not have one entry for each; or if the path is that of a folder.

    See Also
    --------
    write_report : A report about aligned trials, with the same player.
    sklearn_motionsync.display.SkeletonDisplay : Stick figures in a notebook, as pictures or video.

    Notes
    -----
    Positions have a precision of a 30 000th of the largest, and a million numbers take 2.7 MB of
    the file. The names are in the file.

    Examples
    --------
    >>> from sklearn_motionsync.report import write_player
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bends = make_bending(5, random_state=0)
    >>> path = write_player("bends.html", bends.data, bends.skeleton, frame_rate=50)
    >>> path.read_text(encoding="utf-8")[:15]
    '<!DOCTYPE html>'
    """
    path = check_path(path, "player.html")
    trials = as_trials(X, skeleton)
    n = len(trials)
    if n > MOST_SHOWN:
        raise ValueError(
            f"X has {n} trials, and a player shows {MOST_SHOWN} side by side at most: choose "
            f"some of them, such as X[:{MOST_SHOWN}]."
        )
    names = names_of_trials(names, trials)
    bodies = [_points(x, skeleton, i) for i, x in enumerate(trials)]
    for i, (points, _, _) in enumerate(bodies):
        if len(points) < 2:
            raise ValueError(f"Trial {i} has 1 frame; a player needs 2 or more: leave it out.")
        if points.shape[1:] != bodies[0][0].shape[1:]:
            raise ValueError(
                f"Trial {i} has {points.shape[1:]} points and axes, and trial 0 "
                f"{bodies[0][0].shape[1:]}; all must have the same."
            )
    if match is not None and not isinstance(match, Match):
        match = Match.from_estimator(match, X)
    if match is not None and len(match.times) != n:
        raise ValueError(
            f"match must be of the {counted(n, 'trial')} of X, got one of "
            f"{len(match.times)}: give Match.from_estimator(estimator, X)."
        )
    times = None if match is None else match.times
    facts_of, marks = TrialFacts.of if match is None else match.facts_of, []
    facts = facts_of(trials, frame_rate)
    seconds = facts.durations() if facts.are_timed else None
    if keyframes is not None:
        rows = Keyframes(keyframes, n, frame_rate, anywhere=True)
        shares = rows.shares(Trials([points for points, _, _ in bodies], "list", facts.labels))
        marks = _marks(shares, getattr(keyframes, "columns", ()), times)
    data = data_of_bodies(bodies, names, seconds, times, marks)
    data["alone"] = True
    page = Page()
    add_player(page, data)
    return page.write(path, "Side by side" if title is None else title)


def _marks(shares, names, times):
    """Key-frames by name, as shares of each trial and of the clock; None if not known."""
    out = []
    for k, of_trials in enumerate(shares.T):
        clock = None
        if times is not None and np.isfinite(of_trials).any():
            last = times.shape[1] - 1
            places = [
                np.interp(x * last, tau, np.arange(last + 1))
                for x, tau in zip(of_trials, times, strict=True)
            ]
            clock = float(np.nanmedian(places)) / last
        of_trials = [None if np.isnan(x) else float(x) for x in of_trials]
        name = str(names[k]) if len(names) else f"key-frame {k}"
        out.append({"name": name, "own": of_trials, "clock": clock})
    return out


def add_player_of(page, trials, X, params, skeleton):
    """Add the player of a report, where there are bodies."""
    *steps, synchronizer = trials.aligned.reached.steps
    for k, step in enumerate(steps if skeleton is None else ()):
        taking = [t for t in union_transformers(step) if isinstance(t, PositionsTransformer)]
        if taking:
            skeleton, earlier = taking[0].skeleton, make_pipeline(*steps[:k]) if k else None
            # Later ones take the other params.
            also = [*(later.transform for later in steps[k:]), synchronizer.match]
            X = transform_through(earlier, X, params, "write_report", also=also)
            break
    if skeleton is None:
        return
    n, pattern = len(trials.names), trials.pattern
    X = as_trials(X, skeleton)
    first = 0 if pattern is None else pattern
    width = int(np.prod(_points(X[first], skeleton, first)[0].shape[1:]))
    order = sorted(range(n), key=lambda i: i != first)
    fits = np.cumsum([len(X[i]) for i in order]) * width <= MOST_COORDINATES
    chosen = sorted(order[: max(np.count_nonzero(fits), 2)])
    right, note = chosen.index(first), ""
    data = data_of_bodies(
        [_points(X[i], skeleton, i) for i in chosen],
        [trials.names[i] + " (pattern)" * (i == pattern) for i in chosen],
        None if trials.seconds is None else trials.seconds[chosen],
        trials.aligned.match.times[chosen],
    )
    # One beside the pattern.
    data["shown"] = sorted({1 if right == 0 and len(chosen) > 1 else 0, right})
    if len(chosen) < n:
        note = f"The player holds {counted(len(chosen), 'trial')} of {n}."
    add_player(page, data, note)


def data_of_bodies(bodies, names, seconds=None, times=None, keyframes=()):
    """What the script of the player reads.

    Parameters
    ----------
    bodies : list of (points, bones, dots)
        As `_points` gives them.
    names : list of str
    seconds : ndarray, shape (n_sequences,), default=None
        Durations, if they are known.
    times : ndarray, shape (n_sequences, P), default=None
        The warps to a common clock.
    keyframes : list of dict, default=()
        The ``name``, the shares ``own`` of each trial and the share ``clock`` of the clock.
    """
    bones, dots = bodies[0][1:]
    lengths = np.array([len(points) for points, _, _ in bodies])
    every = np.concatenate([points for points, _, _ in bodies])
    scale = np.nanmax(np.abs(every)) / _LARGEST or 1.0
    durations = lengths - 1.0 if seconds is None else seconds
    middle = float(np.median(durations))
    return {
        "names": names,
        "shown": list(range(len(names))),
        "most": MOST_SHOWN,
        "alone": False,
        "seconds": seconds is not None,
        "durations": durations.tolist(),
        "lengths": lengths.tolist(),
        "median": middle,
        "pace": 1.0 if seconds is not None else _UNKNOWN / middle,
        "points": every.shape[1],
        "dims": every.shape[2],
        "positions": _packed(np.where(np.isnan(every), _MISSING, every / scale), "<i2"),
        "scale": float(scale),
        "frames": 0 if times is None else times.shape[1],
        "warps": None if times is None else _packed(times / (times.shape[1] - 1) * 65535, "<u2"),
        "keyframes": list(keyframes),
        "bones": bones,
        "dots": dots,
        "colors": {"light": {side: COLORS[side] for side in _ON_DARK}, "dark": _ON_DARK},
    }


def add_player(page, data, note=""):
    """Add the player to a page, as the last section."""
    page.player = data
    colors = "Left limbs are blue, right ones orange." if data["bones"] else ""
    page.add("Stick figures", read_part("player.html"), paragraph(f"{colors} {note}".strip()))


def _points(x, skeleton, i):
    """The points of a trial that are drawn, (n_frames, n_points, n_dims), its bones and its dots.

    Bones are pairs of a side and indices of two points.
    """
    body = place_on_floor(read_positions(x, skeleton, i), skeleton)
    views = [project(body, skeleton, azimuth) for azimuth in (0, -90)[: body.shape[2] - 1]]
    # Seen from the front, and from the side.
    points = np.concatenate([views[0], *(view[..., :1] for view in views[1:])], axis=2)
    by_side = bones_by_side(skeleton)
    # As in `SkeletonDisplay`, the joints are dots if no bones join them; otherwise the head is one.
    joined = skeleton is not None and skeleton.bones
    dots = [] if joined else list(range(body.shape[1]))
    used = sorted({k for of_side in by_side.values() for bone in of_side for k in bone} | {*dots})
    number = {point: k for k, point in enumerate(used)}
    bones = [
        [side, [[number[a], number[b]] for a, b in of_side]]
        for side, of_side in by_side.items()
        if of_side
    ]
    points, dots = points[:, used], [number[k] for k in dots]
    if joined and "head" in skeleton.landmarks:
        dots = [len(used)]
        head = landmark_track(body, skeleton, "head")[:, np.newaxis]
        points = np.concatenate([points, head], axis=1)
    return points, bones, dots


def _packed(values, dtype):
    """Whole numbers as text."""
    return base64.b64encode(np.round(values).astype(dtype).tobytes()).decode("ascii")
