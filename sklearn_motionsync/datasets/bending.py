"""Synthetic trials of a skeleton that bends down and rises again."""

from __future__ import annotations

from numbers import Integral, Real

import numpy as np
from scipy.interpolate import PchipInterpolator
from sklearn.utils import Bunch, check_random_state
from sklearn.utils._param_validation import Interval

from ..body.skeleton import Skeleton
from ..inputs.types import RandomState
from ..matching.counting import whole
from ..utils.parameters import Rate, validated_function

# Ranges of the parameters that all makers of data have.
LIMITS = {
    "style": [Interval(Real, 0, 100, closed="both")],
    "warp": [Interval(Real, 0, 10, closed="both")],
    "noise": [Interval(Real, 0, 1000, closed="both")],
    "frame_rate": [Rate(0.001, 10_000)],
    "random_state": ["random_state"],
}
# The five moments, as shares of the action.
_KEYFRAMES = {
    "starts to bend": 0.12,
    "half way down": 0.30,
    "hand at the floor": 0.48,
    "half way up": 0.68,
    "upright again": 0.88,
}

# Limb lengths of an average body in metres; hips and shoulders: whole width.
_LENGTHS = {
    "hip": 0.24, "torso": 0.52, "shoulder": 0.36, "neck": 0.22,
    "thigh": 0.43, "leg": 0.42, "arm": 0.30, "forearm": 0.26,
}  # fmt: skip

# Degrees of every angle at the start, the five moments, and the end. In the sagittal plane
# positive angles are forward; the others are sideways, or about the vertical. The right
# hand carries an object down and returns without it.
_ANGLES = {
    "shin": (3, 3, 18, 28, 12, 3, 3),
    "thigh": (3, 2, -38, -66, -24, 3, 3),
    "torso": (2, 6, 46, 88, 64, 6, 2),
    "torso_aside": (0, -2, 2, 12, 4, -2, 0),
    "neck": (4, 30, 56, 58, 22, 0, 6),
    "twist": (0, -8, 6, 24, 4, -6, 0),
    "right_arm": (10, 26, 62, 34, 10, -8, 2),
    "right_forearm": (84, 82, 70, 26, 22, 6, 14),
    "left_arm": (2, -14, -18, 4, 52, 26, 2),
    "left_forearm": (16, 8, 6, 24, 84, 46, 16),
    "right_aside": (6, 16, 14, 2, 6, 16, 8),
    "left_aside": (8, 16, 34, 30, 16, 8, 8),
}


@validated_function(
    {
        "n_trials": [Interval(Integral, 1, 10**6, closed="both")],
        "n_frames": [Interval(Integral, 10, 10**6, closed="both")],
        "n_actors": [Interval(Integral, 1, 10**6, closed="both")],
        **LIMITS,
    }
)
def make_bending(
    n_trials: int = 40,
    *,
    n_frames: int = 100,
    n_actors: int = 4,
    style: float = 1.0,
    warp: float = 1.0,
    noise: float = 0.002,
    frame_rate: float = 50.0,
    random_state: RandomState = None,
) -> Bunch:
    """Trials of a bending action, with the true warps and key-frames.

    A skeleton of fifteen joints stands, bends down until its right hand is near the floor, and
    rises again. Every actor has a body and a style; every trial has a pace (a smooth random warp),
    a duration, a place and a heading, and the noise of a motion capture system.

    Parameters
    ----------
    n_trials : int, default=40
        Number of trials, up to a million.
    n_frames : int, default=100
        Mean number of frames, from 10 to a million; trials have 0.75 to 1.25 times as many.
    n_actors : int, default=4
        Number of actors, up to a million; the trials are theirs in turn.
    style : float, default=1.0
        Size of the differences in movement between actors and between trials, from 0 to 100.
    warp : float, default=1.0
        Size of the variation of pace within a trial, from 0 (an even pace) to 10. At 1 the
        rates of two trials differ at most by a factor of 2, at 10 by one of 1024.
    noise : float, default=0.002
        Standard deviation of the noise of each coordinate, in metres, up to 1000.
    frame_rate : float, default=50.0
        Frames per second, from 0.001; only returned.
    random_state : int, RandomState instance or None, default=None
        Seed of the generator; by default every call makes other trials.

    Returns
    -------
    Bunch
        data : list of ndarray (n_frames_i, 45)
            Joint positions in metres, y up.
        times : list of ndarray (n_frames_i,)
            The moment of the action that each frame shows, from 0 to 1: frames of two
            trials with equal times show the same moment.
        keyframes : ndarray (n_trials, 5)
            Frame (with fraction) of five moments in each trial.
        keyframe_names : list of str
            Names of these moments.
        skeleton : Skeleton
            The paper's skeleton of fifteen joints.
        target, actor, take : ndarray of str (n_trials,)
            The action, the actor, and the number of the trial.
        frame_rate : float
            Frames per second, as given.

    Raises
    ------
    ValueError
        If a parameter is out of its range.

    See Also
    --------
    make_gait : Gait cycles of two groups.

    Examples
    --------
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(3, random_state=0)
    >>> [x.shape[1] for x in bunch.data], bunch.keyframes.shape
    ([45, 45, 45], (3, 5))
    """
    rng = check_random_state(random_state)
    actors = [_draw_actor(rng, style) for _ in range(n_actors)]
    moments = np.array(list(_KEYFRAMES.values()))
    data, times, keyframes = [], [], []
    for i in range(n_trials):
        length = whole(n_frames * rng.uniform(0.75, 1.25))
        phase = _draw_warp(rng, length, warp)
        lengths, angles = actors[i % n_actors]
        positions = _animate(phase, lengths, _vary(rng, 0.3 * style, angles))
        positions = _place(rng, positions)
        positions += noise * rng.standard_normal(positions.shape)
        data.append(positions.reshape(length, -1))
        times.append(phase)
        keyframes.append(np.interp(moments, phase, np.arange(length)))
    numbers = np.arange(n_trials)
    return Bunch(
        data=data,
        times=times,
        keyframes=np.array(keyframes),
        keyframe_names=list(_KEYFRAMES),
        skeleton=Skeleton.paper(),
        target=np.full(n_trials, "bending"),
        actor=np.array([f"actor{k}" for k in numbers % n_actors]),
        take=np.array([f"{k:03d}" for k in numbers // n_actors + 1]),
        frame_rate=float(frame_rate),
    )


def _draw_warp(random_state, length, strength):
    """Share of the action over at each frame: the integral of a smooth positive rate."""
    t = np.linspace(0, 1, length)
    waves = np.arange(1, 4)[:, np.newaxis]
    weights = random_state.standard_normal(3) / waves[:, 0] ** 2
    shifts = random_state.uniform(0, 2 * np.pi, (3, 1))
    log_rate = np.tanh(3 * weights @ np.sin(np.pi * waves * t + shifts))
    rate = 2 ** (0.5 * strength * log_rate)
    phase = np.concatenate([[0], np.cumsum((rate[1:] + rate[:-1]) / 2)])
    return phase / phase[-1]


def _draw_actor(random_state, style):
    """The lengths of the limbs, and every angle over time."""
    size = np.exp(0.05 * random_state.standard_normal())
    lengths = {
        name: value * size * np.exp(0.03 * random_state.standard_normal())
        for name, value in _LENGTHS.items()
    }
    return lengths, _vary(random_state, style, _ANGLES)


def _vary(random_state, style, angles):
    """Every angle a little larger or smaller, throughout and at single moments."""
    varied = {}
    for name, values in angles.items():
        scale = np.exp(0.04 * style * random_state.standard_normal())
        # Differences are largest in the angles that change least: sideways and in twist.
        sideways = name == "twist" or name.endswith("aside")
        shift = (4 if sideways else 1.0) * style * random_state.standard_normal()
        changes = 0.3 * style * random_state.standard_normal(len(values))
        varied[name] = scale * np.asarray(values) + shift + changes
    return varied


def _animate(phase, lengths, angles):
    """Joint positions (n_frames, 15, 3) of a body facing z, feet on the floor."""
    moments = [0, *_KEYFRAMES.values(), 1]
    curves = PchipInterpolator(moments, np.column_stack([*angles.values()]))(phase)
    angle = dict(zip(angles, np.deg2rad(curves.T.copy()), strict=True))
    hip = np.array([lengths["hip"] / 2, 0, 0]) * np.ones((len(phase), 1))
    ankle = {"left": hip, "right": -hip}
    at = {}
    for side in ("left", "right"):
        at[f"{side}_ankle"] = ankle[side]
        at[f"{side}_knee"] = ankle[side] + lengths["leg"] * _up(angle["shin"])
        at[f"{side}_hip"] = at[f"{side}_knee"] + lengths["thigh"] * _up(angle["thigh"])
    at["pelvis"] = (at["left_hip"] + at["right_hip"]) / 2
    at["neck"] = at["pelvis"] + lengths["torso"] * _up(angle["torso"], angle["torso_aside"])
    at["head"] = at["neck"] + lengths["neck"] * _up(angle["neck"])
    # Reaching with the right hand turns the shoulders about the torso.
    turned = np.stack(
        [
            np.cos(angle["twist"]),
            np.sin(angle["twist"]) * np.sin(angle["torso"]),
            -np.sin(angle["twist"]) * np.cos(angle["torso"]),
        ],
        axis=1,
    )
    for side, sign in (("left", 1), ("right", -1)):
        shoulder = at["neck"] + sign * lengths["shoulder"] / 2 * turned
        aside = sign * angle[f"{side}_aside"]
        at[f"{side}_shoulder"] = shoulder
        at[f"{side}_elbow"] = shoulder - lengths["arm"] * _up(-angle[f"{side}_arm"], aside)
        at[f"{side}_wrist"] = at[f"{side}_elbow"] - lengths["forearm"] * _up(
            -angle[f"{side}_forearm"], 0.5 * aside
        )
    return np.stack([at[joint] for joint in Skeleton.paper().joints], axis=1)


def _up(forward, aside=0.0):
    """Unit vectors that lean forward (z) from the vertical, and the lower end aside (x)."""
    forward, aside = np.broadcast_arrays(forward, aside)
    return np.stack(
        [-np.sin(aside), np.cos(aside) * np.cos(forward), np.cos(aside) * np.sin(forward)], axis=1
    )


def _place(random_state, positions):
    """Turn about the vertical and move on the floor, at random."""
    angle = random_state.uniform(0, 2 * np.pi)
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
    shift = random_state.uniform(-2, 2, size=3) * [1, 0, 1]
    return positions @ turn.T + shift
