"""DirectionCosines: from joint positions to postures, and back (Eq. 1)."""

from typing import NamedTuple

import numpy as np
from sklearn.base import BaseEstimator, TransformerMixin, _fit_context
from sklearn.utils._param_validation import StrOptions
from sklearn.utils.validation import check_is_fitted

from ..fitting import at_once, of_one_state
from ..notebook import DocumentedMixin
from ..performances import check_performances, check_transformed, restore
from .skeleton import LANDMARKS, Skeleton

__all__ = ["DirectionCosines"]


class _Limb(NamedTuple):
    """A limb of the body model: its two joints, its parent limb, and where it points at rest.

    Rest directions are those of a person standing with the arms out, seen in a frame
    whose x axis points to the person's left, y up and z forward.
    """

    start: str
    end: str
    parent: str | None
    rest: tuple


_LEFT, _RIGHT, _UP, _DOWN = (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)

# Parents come before their children: frames are built in this order.
LIMBS = {
    "hip": _Limb("right_hip", "left_hip", None, _LEFT),
    "torso": _Limb("pelvis", "neck", "hip", _UP),
    "shoulder": _Limb("right_shoulder", "left_shoulder", "torso", _LEFT),
    "neck": _Limb("neck", "head", "torso", _UP),
    "left_thigh": _Limb("left_hip", "left_knee", "hip", _DOWN),
    "right_thigh": _Limb("right_hip", "right_knee", "hip", _DOWN),
    "left_leg": _Limb("left_knee", "left_ankle", "left_thigh", _DOWN),
    "right_leg": _Limb("right_knee", "right_ankle", "right_thigh", _DOWN),
    "left_arm": _Limb("left_shoulder", "left_elbow", "shoulder", _LEFT),
    "right_arm": _Limb("right_shoulder", "right_elbow", "shoulder", _RIGHT),
    "left_forearm": _Limb("left_elbow", "left_wrist", "left_arm", _LEFT),
    "right_forearm": _Limb("right_elbow", "right_wrist", "right_arm", _RIGHT),
}
_LIMB_NAMES = list(LIMBS)


class DirectionCosines(DocumentedMixin, TransformerMixin, BaseEstimator):
    """Postures of 37 parameters from joint positions (Eq. 1).

    A posture is the height of the pelvis and, for each of twelve limbs, the cosines of the
    angles between the limb and three axes. It does not change when the body is moved,
    or when all its limbs are longer by the same factor; with the default frame of
    reference, nor when it faces another way.

    Parameters
    ----------
    skeleton : Skeleton
        Which columns are which joints: ``Skeleton.paper()``, ``Skeleton.acclaim()``,
        ``Skeleton.kinect()`` or your own.
    reference : {"heading", "parent", "world"}, default="heading"
        The axes of the cosines. ``"heading"``: x to the left along the hips, y up, z forward.
        ``"parent"``: those of the parent limb, which turn with it (without twist);
        the hip's are those of ``"heading"``. ``"world"``: those of the recording.

    Attributes
    ----------
    limb_lengths_ : ndarray, shape (12,)
        Median length of each limb over the postures seen in ``fit``, in the unit of the
        positions; what ``inverse_transform`` builds a body of.
    n_features_in_ : int
        Three times the number of joints.
    feature_names_in_ : ndarray of str
        Names of the columns; only if the input had names.

    See Also
    --------
    ASpace : The reduced space of these postures.

    Notes
    -----
    The first parameter is the height of the pelvis above the lowest ankle of the whole
    performance, divided by the length of the stretched leg (the median over the performance):
    1 for standing, less for sitting, more in the air. The floor is a property of a
    performance; a 2-D input is taken as one performance.

    Examples
    --------
    >>> from sklearn_motionsync import DirectionCosines
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(2, random_state=0)
    >>> cosines = DirectionCosines(bunch.skeleton).fit(bunch.data)
    >>> postures = cosines.transform(bunch.data)
    >>> postures[0].shape[1], list(cosines.get_feature_names_out()[:4])
    (37, ['pelvis_height', 'hip_x', 'hip_y', 'hip_z'])
    """

    _parameter_constraints: dict = {
        "skeleton": [Skeleton],
        "reference": [StrOptions({"heading", "parent", "world"})],
    }

    def __init__(self, skeleton, reference="heading"):
        self.skeleton = skeleton
        self.reference = reference

    @at_once
    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X, y=None):
        """Learn the limb lengths.

        Parameters
        ----------
        X : list of arrays (n_frames_i, 3 * n_joints), 3-D array, or 2-D array
            Joint positions, joint by joint x, y, z.
        y : ignored

        Returns
        -------
        self
        """
        performances = self._check(X, reset=True)
        lengths = [np.linalg.norm(_limbs(self._landmarks(a)), axis=2) for a in performances]
        self.limb_lengths_ = np.median(np.concatenate(lengths), axis=0)
        return self

    fit_transform = at_once(TransformerMixin.fit_transform)

    @of_one_state
    def transform(self, X):
        """Postures of joint positions.

        Parameters
        ----------
        X : list of arrays (n_frames_i, 3 * n_joints), 3-D array, or 2-D array
            Joint positions.

        Returns
        -------
        The kind that was given, with 37 features

        Raises
        ------
        ValueError
            If the width is not that of the skeleton, or a limb has no length.
        """
        check_is_fitted(self)
        performances = self._check(X, reset=False)
        return restore(
            self, performances, [self._postures(i, a) for i, a in enumerate(performances)]
        )

    @of_one_state
    def inverse_transform(self, X, limb_lengths=None):
        """Joint positions of postures: the paper's fifteen joints, for drawing.

        The body stands on the floor y = 0 (the height of the ankles), its pelvis above the
        origin; unless ``reference="world"`` it faces along z. Its hips lie evenly on both sides
        of the pelvis and its shoulders of the neck, so a body built that way comes back exactly.

        Parameters
        ----------
        X : list of arrays (n_frames_i, 37), 3-D array, or 2-D array
            Postures; the three cosines of a limb only give its direction.
        limb_lengths : array-like of shape (12,), default=None
            Length of each limb; by default ``limb_lengths_``.

        Returns
        -------
        The kind that was given, with 45 features: the positions of ``Skeleton.paper()``
        """
        check_is_fitted(self)
        lengths = np.asarray(self.limb_lengths_ if limb_lengths is None else limb_lengths)
        if lengths.shape != (len(LIMBS),):
            raise ValueError(
                f"limb_lengths needs one length for each of {_LIMB_NAMES}, got shape "
                f"{lengths.shape}."
            )
        performances = check_transformed(self, X, 1 + 3 * len(LIMBS))
        arrays = [self._positions(a, lengths.astype(a.dtype)) for a in performances]
        return restore(self, performances, arrays, columns=Skeleton.paper().column_names)

    def get_feature_names_out(self, input_features=None):
        """Names of the 37 parameters: ``pelvis_height``, ``hip_x``, ..., ``right_forearm_z``.

        Parameters
        ----------
        input_features : ignored

        Returns
        -------
        ndarray of str
        """
        names = [f"{limb}_{axis}" for limb in LIMBS for axis in "xyz"]
        return np.asarray(["pelvis_height", *names], dtype=object)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        return tags

    def _check(self, X, *, reset):
        performances = check_performances(self, X, reset=reset, level="posture")
        width, expected = performances[0].shape[1], 3 * len(self.skeleton.joints)
        if width != expected:
            raise ValueError(
                f"Performance 0 has {width} features a frame, but the skeleton's "
                f"{len(self.skeleton.joints)} joints need {expected}: x, y, z of each."
            )
        return performances

    def _landmarks(self, positions):
        """(n_frames, 15, 3) positions of the landmarks, y up."""
        columns = [self.skeleton.index_of(name) for name in LANDMARKS]
        return y_up(positions.reshape(len(positions), -1, 3)[:, columns], self.skeleton)

    def _postures(self, i, positions):
        points = self._landmarks(positions)
        limbs = _limbs(points)
        lengths = np.linalg.norm(limbs, axis=2)
        if not lengths.all():
            frame, limb = np.argwhere(lengths == 0)[0]
            name = _LIMB_NAMES[limb]
            raise ValueError(
                f"Performance {i}, frame {frame}: the limb {name!r} has no length, its joints "
                f"{[self.skeleton.landmarks[j] for j in LIMBS[name][:2]]} coincide. Repair the "
                "frame, or choose other landmarks."
            )
        height = points[:, LANDMARKS.index("pelvis"), 1]
        ankles = [LANDMARKS.index(f"{side}_ankle") for side in ("left", "right")]
        floor = points[:, ankles, 1].min()
        u = (height - floor) / _leg_length(np.median(lengths, axis=0))
        cosines = limbs / lengths[:, :, np.newaxis]
        if self.reference != "world":
            cosines = _turn(cosines, heading(cosines[:, 0]))
        if self.reference == "parent":
            cosines = _along_parents(cosines)
        return np.column_stack([u, cosines.reshape(len(u), -1)])

    def _positions(self, postures, lengths):
        cosines = postures[:, 1:].reshape(len(postures), -1, 3)
        # A mean or an approximation of cosines is shorter than 1, a limb is not.
        norm = np.linalg.norm(cosines, axis=2, keepdims=True)
        cosines = cosines / np.where(norm > 0, norm, 1)
        if self.reference == "parent":
            cosines = _along_parents(cosines, inverse=True)
        limb = dict(zip(LIMBS, np.moveaxis(cosines * lengths[:, np.newaxis], 1, 0), strict=True))
        at = {"pelvis": np.zeros_like(limb["hip"])}
        at["pelvis"][:, 1] = postures[:, 0] * _leg_length(lengths)
        at["neck"] = at["pelvis"] + limb["torso"]
        at["head"] = at["neck"] + limb["neck"]
        for side, sign in (("left", 0.5), ("right", -0.5)):
            at[f"{side}_hip"] = at["pelvis"] + sign * limb["hip"]
            at[f"{side}_shoulder"] = at["neck"] + sign * limb["shoulder"]
            for part in ("thigh", "leg", "arm", "forearm"):
                start, end, _, _ = LIMBS[f"{side}_{part}"]
                at[end] = at[start] + limb[f"{side}_{part}"]
        return np.concatenate([at[name] for name in LANDMARKS], axis=1)


def y_up(points, skeleton):
    """Points (..., 3) of a skeleton in axes of which the second is vertical."""
    if skeleton.up == "y":
        return points
    return np.stack([points[..., 0], points[..., 2], -points[..., 1]], axis=-1)


def _limbs(points):
    """(n_frames, 12, 3) limb vectors of (n_frames, 15, 3) landmarks."""
    start, end = ([LANDMARKS.index(limb[k]) for limb in LIMBS.values()] for k in (0, 1))
    return points[:, end] - points[:, start]


def _leg_length(lengths):
    """Length of the stretched leg, the mean of both sides."""
    parts = [
        lengths[_LIMB_NAMES.index(f"{s}_{p}")] for s in ("left", "right") for p in ("thigh", "leg")
    ]
    return sum(parts) / 2


def heading(hip):
    """Frames (n_frames, 3, 3), rows x to the left along the hips, y up, z forward."""
    x = hip * np.array([1, 0, 1], dtype=hip.dtype)
    length = np.linalg.norm(x, axis=1, keepdims=True)
    # Hips one above the other show no heading: keep the recording's axes.
    shown = length[:, 0] > np.sqrt(np.finfo(hip.dtype).eps)
    x = np.where(shown[:, np.newaxis], x / np.where(length > 0, length, 1), _LEFT)
    y = np.broadcast_to(np.asarray(_UP, dtype=x.dtype), x.shape)
    return np.stack([x, y, np.cross(x, y)], axis=1).astype(hip.dtype)


def _turn(vectors, frames):
    """Coordinates of (n_frames, n, 3) vectors along the rows of (n_frames, 3, 3) frames."""
    return vectors @ frames.transpose(0, 2, 1)


def _swing(rest, direction):
    """Rows: the axes after the smallest rotation that takes ``rest`` to each direction."""
    rest = np.asarray(rest, dtype=direction.dtype)
    axis = np.cross(rest, direction)
    cosine = direction @ rest
    # At the opposite of rest every axis serves; the limit keeps the rotation finite.
    scale = 1 / np.maximum(1 + cosine, np.finfo(direction.dtype).eps)
    cross = np.zeros((len(axis), 3, 3), dtype=direction.dtype)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        cross[:, i, j], cross[:, j, i] = -axis[:, k], axis[:, k]
    rotation = np.eye(3, dtype=direction.dtype) + cross + scale[:, None, None] * (cross @ cross)
    return rotation.transpose(0, 2, 1)


def _along_parents(cosines, *, inverse=False):
    """From cosines along the body's axes to those along the parent limbs' axes, or back."""
    frames, out = {}, np.empty_like(cosines)
    for i, (name, limb) in enumerate(LIMBS.items()):
        given = cosines[:, i : i + 1]
        if limb.parent is None:
            local = whole = given
            parent = np.broadcast_to(np.eye(3, dtype=cosines.dtype), (len(cosines), 3, 3))
        else:
            parent = frames[limb.parent]
            local = given if inverse else _turn(given, parent)
            whole = given @ parent if inverse else given
        out[:, i : i + 1] = whole if inverse else local
        frames[name] = _swing(limb.rest, local[:, 0]) @ parent
    return out
