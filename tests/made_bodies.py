"""Bodies made by hand, rotated and moved."""

import numpy as np
import pandas as pd
from sklearn_motionsync import Skeleton


def turned(positions, degrees):
    a = np.deg2rad(degrees)
    turn = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    return (positions.reshape(-1, 3) @ turn.T).reshape(positions.shape)


def moved(positions, shift):
    return (positions.reshape(-1, 3) + shift).reshape(positions.shape)


def standing(**moves):
    """One pose in metres, facing z: standing straight, arms down, joints moved as given."""
    at = {
        "pelvis": (0, 1, 0),
        "neck": (0, 1.5, 0),
        "head": (0, 1.7, 0),
        "left_shoulder": (0.2, 1.5, 0),
        "left_elbow": (0.2, 1.2, 0),
        "left_wrist": (0.2, 0.9, 0),
        "right_shoulder": (-0.2, 1.5, 0),
        "right_elbow": (-0.2, 1.2, 0),
        "right_wrist": (-0.2, 0.9, 0),
        "left_hip": (0.1, 1, 0),
        "left_knee": (0.1, 0.5, 0),
        "left_ankle": (0.1, 0, 0),
        "right_hip": (-0.1, 1, 0),
        "right_knee": (-0.1, 0.5, 0),
        "right_ankle": (-0.1, 0, 0),
    } | moves
    return np.array([at[j] for j in Skeleton.paper().joints], float).reshape(1, -1)


def turned_over(positions, axes=(1, -1, -1)):
    return (positions.reshape(-1, 3) * axes).reshape(positions.shape)


def columns_of(x, skeleton=None):
    """A table of positions."""
    return pd.DataFrame(x, columns=(skeleton or Skeleton.paper()).column_names)


def with_still_root(x, skeleton, place=(0.0, 0.0, 0.0)):
    """A table of positions as retargeted takes have them: the body's root hangs on another joint,
    which stays at its place.
    """
    root = pd.DataFrame([place] * len(x), columns=["World_x", "World_y", "World_z"])
    df = pd.concat([root, columns_of(x, skeleton)], axis=1)
    df.attrs = {"joints": ["World", *skeleton.joints], "up": skeleton.up}
    df.attrs["parents"] = [-1, *(p + 1 for p in skeleton.parents)]
    return df
