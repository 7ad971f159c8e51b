"""DirectionCosines: poses of joint positions (Eq. 1), and back."""

from __future__ import annotations

from typing import Literal

import numpy as np
from sklearn.utils._param_validation import StrOptions
from sklearn.utils.validation import check_is_fitted

from ..inputs.types import Transformed, TrialsLike
from ..inputs.validation import check_transformed, restore
from .axes import convert_to_parent_axes, project_on_axes
from .base import PositionsTransformer, mask_hidden
from .formats import LANDMARKS, SIDES
from .limbs import (
    LATERAL_LIMBS,
    LIMB_NAMES,
    LIMBS,
    body_size,
    cosine_names,
    limb_indices,
    lowest_height,
    unit_vectors,
)
from .skeleton import Skeleton

# Largest shift of the hips from the pelvis, in leg lengths, that puts a body on the floor. Of 144
# trials of optical motion capture, and of their approximations in an aSpace, none needs more
# than 0.21.
_LARGEST_SHIFT = 0.25


class DirectionCosines(PositionsTransformer):
    """Poses of 37 parameters from joint positions (Eq. 1).

    A pose is the height of the pelvis and, for each of twelve limbs, the cosines of the
    angles between the limb and three axes. It is invariant to the place and the size of the body,
    and with the default axes to its heading.

    A skeleton that lacks landmarks has fewer parameters: the cosines of its limbs, and the height
    if there are a pelvis and a complete leg. Key-points in a picture
    (``Skeleton(..., n_dims=2)``) have two cosines a limb.

    Parameters
    ----------
    skeleton : Skeleton
        Which columns are which joints: a known one such as ``Skeleton.acclaim()``, that of a
        table, ``Skeleton.from_frame(df)``, or your own.
    reference : {"heading", "parent", "world"}, default="heading"
        The axes of the cosines. ``"heading"``: x to the left along the hips, y up, z forward; of
        a body without hips along the shoulders, and without those the axes of the recording.
        ``"parent"``: those of the parent limb, which turn with it (without twist), or of the
        nearest limb above it that is there; the hip's are those of ``"heading"``. ``"world"``:
        those of the recording, turned so that y is vertical. A picture shows no heading:
        in the plane ``"heading"`` is ``"world"``, x across the picture and y up.
    hidden : {"raise", "nan"}, default="raise"
        How NaN, the positions of hidden joints, are treated. ``"raise"``: they are an error.
        ``"nan"``: a joint is hidden in a frame if any of its coordinates is NaN, and so is a
        landmark that is the mean of it and others; limbs with a hidden end are NaN in that frame,
        and all other values are unchanged.

    Attributes
    ----------
    limb_lengths_ : ndarray, shape (n_limbs,)
        Median length of each of ``skeleton.limbs`` over the frames of ``fit`` that show it, in
        the unit of the positions. ``inverse_transform`` uses them.
    n_features_in_ : int
        The number of joints times that of their axes.
    feature_names_in_ : ndarray of str
        Names of the columns; only if the input had names.

    See Also
    --------
    ASpace : The reduced space of these poses.
    JointPositions : The positions of the joints relative to the pelvis.

    Notes
    -----
    The first parameter is the height of the pelvis above the lowest ankle of the whole
    trial, divided by the length of the stretched leg (the median over the trial):
    1 for standing, less for sitting, more in the air. The floor is a property of a
    trial; a 2-D input is one trial.

    In a picture, hips and shoulders that coincide in a whole trial point at the camera: both
    of their cosines are 0. A joint that the program did not find and put at (0, 0) cannot be told
    from others: repair it, leave it out, or make it NaN and use ``hidden="nan"``.

    **Hidden joints.** Where the hips are hidden, the shoulders give the axes of ``"heading"`` and
    ``"parent"``, corrected by the angle between hips and shoulders when both were last seen;
    before that, by none. Where both are hidden, the last heading stays; before the first heading
    all limbs are NaN. With ``"parent"`` a limb is NaN if one of the limbs above it is. The height
    needs the pelvis in its frame, an ankle in any frame, and the lengths of the legs: of limbs that
    a trial never shows they are those of ``fit``, scaled to the limbs that it shows.

    **Live.** No row but the height depends on later frames, so the last row of the frames so far,
    ``transform(frames[: k + 1])[-1]``, is that of the whole take; its floor is the lowest ankle so
    far. The last seconds suffice if they show the hips once, and a foot on the floor. A single
    frame, ``transform(frame[np.newaxis])[0]``, has its own lowest ankle as floor, so that
    a jump is not seen, its own leg length, and no earlier heading.

    Examples
    --------
    >>> from sklearn_motionsync import DirectionCosines
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(2, random_state=0)
    >>> cosines = DirectionCosines(bunch.skeleton).fit(bunch.data)
    >>> poses = cosines.transform(bunch.data)
    >>> poses[0].shape[1], list(cosines.get_feature_names_out()[:4])
    (37, ['pelvis_height', 'hip_x', 'hip_y', 'hip_z'])

    Legs seen by a camera:

    >>> import pandas as pd
    >>> from sklearn_motionsync import Skeleton
    >>> df = pd.DataFrame(bunch.data[0], columns=bunch.skeleton.column_names)
    >>> legs = df[[c for c in df if c[:-2].endswith(("hip", "knee", "ankle")) and c[-1] in "xy"]]
    >>> cosines = DirectionCosines(Skeleton.from_frame(legs)).fit(legs)
    >>> cosines.get_feature_names_out()[:5].tolist()
    ['pelvis_height', 'hip_x', 'hip_y', 'left_thigh_x', 'left_thigh_y']
    >>> cosines.inverse_transform(cosines.transform(legs)).shape[1], cosines.skeleton.body()
    (14, Skeleton(<7 joints, 7 of 15 landmarks>, up='y', n_dims=2))
    """

    _parameter_constraints: dict = {
        "skeleton": [Skeleton],
        "reference": [StrOptions({"heading", "parent", "world"})],
        "hidden": [StrOptions({"raise", "nan"})],
    }

    def __init__(
        self,
        skeleton: Skeleton,
        reference: Literal["heading", "parent", "world"] = "heading",
        hidden: Literal["raise", "nan"] = "raise",
    ) -> None:
        self.skeleton = skeleton
        self.reference = reference
        self.hidden = hidden

    def inverse_transform(self, X: TrialsLike) -> Transformed:
        """Joint positions of poses: the paper's fifteen joints.

        Of a skeleton that lacks landmarks they are those that its limbs join,
        ``skeleton.body()``.

        The lowest ankle of a trial is on the floor y = 0, its pelvis above the
        origin; unless ``reference="world"`` it faces along z. The pelvis is the middle of the hips
        and the neck that of the shoulders. A body of these proportions is reconstructed exactly.

        Poses do not contain the height of the hips relative to the pelvis. All hips of a
        trial are shifted up or down by one distance that puts its lowest ankle on the floor:
        then ``transform`` gives the same height of the pelvis, and the same cosines. The largest
        shift is a quarter of a leg. A body farther from the floor, such as a single pose in the
        air, stays there, and its height is approximated. A pose without a height has its pelvis
        at height 0; so has the uppermost joint of a part that no limb joins to the pelvis.

        With ``hidden="nan"`` a limb of which a cosine is NaN is hidden: joints below it are
        NaN, and where the height is NaN, all are.

        Parameters
        ----------
        X : list of arrays (n_frames_i, 37), 3-D array, or 2-D array
            Poses. Cosines of a limb are scaled to length 1.

        Returns
        -------
        list of arrays (n_frames_i, 45), 3-D array, or 2-D array
            The positions of ``Skeleton.paper()``, or of ``skeleton.body()``, in the kind that was
            given.

        Raises
        ------
        ValueError
            If the cosines of a limb are all 0, or columns are not those of
            ``get_feature_names_out``.
        """
        check_is_fitted(self, "limb_lengths_")
        names = self.get_feature_names_out()
        trials = check_transformed(self, X, names, finite=self._finite)
        arrays = [self._positions(trials, i) for i in range(len(trials))]
        return restore(self, trials, arrays, columns=self.skeleton.body().column_names)

    @property
    def _names(self):
        return cosine_names(self.skeleton.limbs, self.skeleton.n_dims, self.skeleton.has_height)

    def _features(self, body):
        limbs, cosines = self.skeleton.limbs, body.directions
        axes = body.axes if self.reference != "world" else None
        if axes is not None:
            cosines = project_on_axes(cosines, axes)
        if self.reference == "parent":
            cosines = convert_to_parent_axes(cosines, limbs)
        cosines = cosines[:, limb_indices(limbs)].reshape(len(cosines), -1)
        if not self.skeleton.has_height:
            return cosines
        heights = (body.position_of("pelvis")[:, 1] - body.floor) / self._size_of(body)
        return np.column_stack([heights, cosines])

    def _positions(self, trials, i):
        poses, limbs = trials[i], self.skeleton.limbs
        first, n_dims = int(self.skeleton.has_height), self.skeleton.n_dims
        by_limb = poses[:, first:].reshape(len(poses), -1, n_dims)
        if not by_limb.all():
            # A picture may show hips and shoulders end-on.
            end_on = np.array([n_dims == 2 and name in LATERAL_LIMBS for name in limbs])
            zero = ~by_limb.any(axis=2) & ~end_on
            if zero.any():
                frame, limb = np.argwhere(zero)[0]
                raise ValueError(
                    f"{trials.called(i)}, frame {frame}: the limb {limbs[limb]!r} has no "
                    f"direction, its cosines are 0. Drop the frame, or give it a "
                    "direction."
                )
        # Means and approximations of cosines are shorter than 1.
        cosines = np.zeros((len(by_limb), len(LIMB_NAMES), n_dims), dtype=by_limb.dtype)
        cosines[:, limb_indices(limbs)] = unit_vectors(by_limb)
        if self.reference == "parent":
            cosines = convert_to_parent_axes(cosines, limbs, inverse=True)
        heights = poses[:, 0] if first else None
        lengths = self._all_lengths(self.limb_lengths_).astype(poses.dtype)
        positions = _forward_kinematics(heights, cosines, lengths, self.skeleton)
        if self._finite is not True:
            mask_hidden(positions.reshape(len(positions), -1, n_dims))
        return positions


# -- forward kinematics -------------------------------------------------------------------


def _forward_kinematics(heights, cosines, lengths, skeleton):
    """Positions of bodies with given heights, directions and lengths of limbs.

    Parameters
    ----------
    heights : ndarray, shape (n_frames,), or None
        Of the pelvis, in leg lengths; None for height 0.
    cosines : ndarray, shape (n_frames, 12, n_dims)
        Unit vectors; 0 for limbs that the skeleton lacks. Joints below NaN are NaN.
    lengths : ndarray, shape (12,)
    skeleton : Skeleton

    Returns
    -------
    ndarray, shape (n_frames, n_dims * n_landmarks)
        Of the landmarks of ``skeleton.body()``.
    """
    at = _landmarks_of(heights, cosines, lengths, skeleton.limbs)
    if heights is not None:
        limit = _LARGEST_SHIFT * body_size(lengths, skeleton.limbs)
        ankles = [f"{side}_ankle" for side in SIDES if f"{side}_leg" in skeleton.limbs]
        above = lowest_height([at[ankle][:, 1] for ankle in ankles])
        # The floor is unknown if every ankle is hidden.
        shift = 0 if np.isnan(above) else np.clip(above, -limit, limit)
        for side in SIDES:
            for joint in ("hip", "knee", "ankle"):
                at[f"{side}_{joint}"][:, 1] -= shift
    return _joined(at, skeleton)


def _landmarks_of(heights, cosines, lengths, limbs):
    """Positions (n_frames, n_dims) by landmark, linear in heights and cosines."""
    limb = dict(zip(LIMBS, np.moveaxis(cosines * lengths[:, np.newaxis], 1, 0), strict=True))
    at = {"pelvis": np.zeros_like(limb["hip"])}
    if heights is not None:
        at["pelvis"][:, 1] = heights * body_size(lengths, limbs)
    # A part that no limb joins to the pelvis begins there.
    at["neck"] = at["pelvis"] + limb["torso"]
    at["head"] = at["neck"] + limb["neck"]
    for side, sign in zip(SIDES, (0.5, -0.5), strict=True):
        at[f"{side}_hip"] = at["pelvis"] + sign * limb["hip"]
        at[f"{side}_shoulder"] = at["neck"] + sign * limb["shoulder"]
        for part in ("thigh", "leg", "arm", "forearm"):
            start, end, _, _ = LIMBS[f"{side}_{part}"]
            at[end] = at[start] + limb[f"{side}_{part}"]
    return at


def _joined(at, skeleton):
    joints = skeleton.body().joints
    return np.concatenate([at[name] for name in LANDMARKS if name in joints], axis=1)
