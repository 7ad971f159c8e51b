"""The mirror image of a body: left and right joints exchanged."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pandas as pd

from ..inputs.collections import as_collection
from ..inputs.numbers import as_numbers, column_names
from ..inputs.tables import as_pandas
from ..inputs.types import Transformed, TrialsLike
from .axes import UP_AXES
from .columns import check_columns, columns_of_skeleton, plain_positions
from .formats import AXES, LANDMARKS
from .landmarks import as_tuple, other_side
from .limbs import LATERAL_LIMBS, LIMBS
from .skeleton import Skeleton


def mirror(X: TrialsLike, skeleton: Skeleton) -> Transformed:
    """Exchange left and right: the mirror images of trials.

    It joins trials with the left and with the right hand to one set, or shows how
    symmetrically a person moves.

    Parameters
    ----------
    X : list of arrays (n_frames_i, n_dims * n_joints), 3-D array, 2-D array or DataFrame
        Joint positions, one or several trials; gaps may be NaN. Arrays may have an axis of joints,
        (n_frames_i, n_joints, n_dims), and tables the spellings of `Skeleton.from_frame`.
    skeleton : Skeleton
        The joints. Left and right joints are exchanged: those at a left and a right landmark, then
        those whose names differ by "left" and "right", or "L" and "R". All others are mirrored
        under their own names.

    Returns
    -------
    list of arrays, 3-D array, 2-D array or DataFrame
        The kind that was given, with the same shape, names and order. The first horizontal axis is
        negated: x, or y where x is vertical, so that a body that faces z still does. The mirror
        image of the mirror image is what was given.

    Raises
    ------
    ValueError
        If the width or the order of the columns is not that of the skeleton, or a joint is on one
        side by its name or its landmark and has no counterpart.

    See Also
    --------
    DirectionCosines : The mirror image has the cosines of the other side's limbs with x negated;
        of hip line and shoulder line with y and z negated.

    Examples
    --------
    >>> from sklearn_motionsync.body import mirror
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(3, random_state=0)
    >>> mirrored = mirror(bunch.data, bunch.skeleton)
    >>> left, right = (3 * bunch.skeleton.index_of(f"{side}_wrist") for side in ("left", "right"))
    >>> bool((mirrored[0][:, left] == -bunch.data[0][:, right]).all())
    True
    """
    if not isinstance(skeleton, Skeleton):
        raise ValueError(
            "mirror needs the Skeleton of the positions, such as Skeleton.from_frame(df); got "
            f"{type(skeleton).__name__}."
        )
    counterparts = _counterparts(skeleton)
    # One array of several trials is mirrored as a whole.
    whole = isinstance(X, pd.DataFrame) or getattr(X, "ndim", 1) > 2
    one = whole or as_collection(X) is None
    sequences: Any = [X] if one else X
    parts = list(sequences)
    if not parts:
        raise ValueError("Found 0 trials (n_samples=0); there is nothing to mirror.")
    arrays = []
    for i, x in enumerate(parts):
        positions = plain_positions(as_pandas(x), skeleton)
        array = as_numbers(positions, f"Trial {i}")
        width = array.shape[-1] if array.ndim > 1 else 1
        check_columns(column_names(positions) or (), skeleton, f"Trial {i}", width)
        arrays.append(array.reshape(*array.shape[:-1], -1, skeleton.n_dims))
    mirrored, lateral = [], UP_AXES[skeleton.n_dims][skeleton.up][0][0]
    for x, array in zip(parts, arrays, strict=True):
        image = array[..., counterparts, :]
        image[..., lateral] = -image[..., lateral]
        image = image.reshape(*array.shape[:-2], -1)
        mirrored.append(_as_kind_of(x, image, skeleton, counterparts))
    return mirrored[0] if one else mirrored


def _as_kind_of(x, array, skeleton, counterparts):
    """An array in the container that was given."""
    table = as_pandas(x)
    if not isinstance(table, pd.DataFrame):
        return array.reshape(np.shape(x))
    fitting = columns_of_skeleton(table, skeleton)
    df = pd.DataFrame(array, index=table.index)
    if fitting is not None:
        # Columns beside the positions stay, but for the confidence, which goes with its joint.
        df, values = table.copy(), dict(zip(fitting.places.ravel(), array.T, strict=True))
        of_other = [fitting.confidence[k] for k in counterparts]
        pairs = zip(fitting.confidence, of_other, strict=True)
        values |= {to: table.iloc[:, k].to_numpy() for to, k in pairs if min(to, k) >= 0}
        for place, column in values.items():
            df.isetitem(place, column)
    df.columns = table.columns
    df.attrs = dict(table.attrs)
    # Polars need not be installed.
    return df if x is table else type(x)({name: df[name].to_numpy() for name in x.columns})


# -- the counterpart of each joint --------------------------------------------------------


def _counterparts(skeleton):
    """For each joint the index of its counterpart on the other side, or its own without one.

    A joint that is on one side by its landmark or its name, and has no counterpart, is refused.
    """
    joints, landmarks = skeleton.joints, skeleton.landmarks
    pairs = [
        (as_tuple(at), as_tuple(landmarks.get(other_side(name), ())))
        for name, at in landmarks.items()
        if other_side(name)
    ]
    sided = {joint for one, _ in pairs for joint in one}
    other_of = {}
    for one, other in pairs:
        if len(one) == len(other) == 1:
            other_of.setdefault(one[0], other[0])
    lower = {joint.lower(): joint for joint in reversed(joints)}
    for joint in joints:
        if joint not in other_of and (other := _find_by_name(joint, lower)) is not None:
            other_of[joint] = other
    # Joints of means that are not paired by names are paired in their order.
    for one, other in pairs:
        left, right = ([j for j in of_side if j not in other_of] for of_side in (one, other))
        if len(left) == len(right):
            for a, b in zip(left, right, strict=True):
                other_of[a], other_of[b] = b, a
    middle = {j for name in LANDMARKS[:3] for j in as_tuple(landmarks.get(name, ()))}
    for joint in joints:
        other = other_of.get(joint, joint)
        lacks = other == joint and (joint in sided or re.search("left|right", joint.lower()))
        if (lacks and joint not in middle) or other_of.get(other, other) != joint:
            raise ValueError(
                f"The joint {joint!r} is on one side, and has no counterpart on the other; the "
                f"joints are {list(joints)}. Leave its columns out, or name both in the landmarks."
            )
    return [joints.index(other_of.get(joint, joint)) for joint in joints]


def _find_by_name(joint, lower):
    """The joint with the name of the other side, or None."""
    name = joint.lower()
    swapped = {"left": "right", "right": "left", "l": "r", "r": "l"}
    # "left" anywhere; "l" at the beginning of a word, or at the end.
    others = [re.sub("left|right", lambda match: swapped[match.group()], name)]
    others += [
        name[: match.start()] + swapped[match.group()] + name[match.end() :]
        for match in re.finditer("(?<![a-z0-9])[lr]|[lr]$", name)
    ]
    return next((lower[other] for other in others if other != name and other in lower), None)


# -- the mirror image of cosines ------------------------------------------------------------


def exchange_of_sides(names, limbs=None):
    """The columns and signs that make the mirror image of poses from direction cosines.

    The image is ``signs * poses[..., columns]``; None if a limb lacks its counterpart, or there is
    no left and right. Features whose names are no cosine ``<limb>_<axis>`` stay. If limbs are
    given, only their left and right are exchanged; by default the whole body is mirrored: hip line
    and shoulder line, and the middle, too.
    """
    names = [str(name) for name in names]
    columns, signs, has_sides = np.arange(len(names)), np.ones(len(names)), False
    for k, name in enumerate(names):
        limb, _, axis = name.rpartition("_")
        if limb not in LIMBS or axis not in AXES[3] or (limbs is not None and limb not in limbs):
            continue
        other = other_side(limb) or limb
        if f"{other}_{axis}" not in names:
            return None
        has_sides |= other != limb
        columns[k] = names.index(f"{other}_{axis}")
        # Hip line and shoulder line go from right to left: their mirror images the other way.
        signs[k] = -1 if (axis == AXES[3][0]) != (limb in LATERAL_LIMBS) else 1
    return (columns, signs) if has_sides else None
