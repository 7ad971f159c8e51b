"""DirectionCosines: from joint positions to postures, and back (Eq. 1)."""

import numpy as np
import pandas as pd
from sklearn.base import _fit_context
from sklearn.utils._param_validation import StrOptions
from sklearn.utils.validation import check_is_fitted

from ..fitting import at_once, of_one_state
from ..gate import as_numbers
from ..performances import check_transformed, restore
from .axes import along_parents, turned
from .base import PositionsTransformer
from .limbs import LIMB_NAMES, LIMBS, exponent_of, leg_length, unit
from .skeleton import LANDMARKS, Skeleton

__all__ = ["DirectionCosines"]

# How far the hips of a body may be moved from where its pelvis is, in leg lengths, so that it
# stands on the floor. Of 144 performances of optical motion capture, and of their approximations in
# an aSpace, none needs more than 0.21.
_MOVED = 0.25


class DirectionCosines(PositionsTransformer):
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
    JointPositions : Where the joints are: the other view of a body.

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

        Raises
        ------
        ValueError
            As from ``transform``.
        """
        performances = self._check(X, reset=True)
        bodies = [self._body(performances, i)[2:] for i in range(len(performances))]
        unit_of_all = max(k for _, k in bodies)
        lengths = [x if k == unit_of_all else np.ldexp(x, k - unit_of_all) for x, k in bodies]
        with np.errstate(over="ignore"):
            found = np.ldexp(np.median(np.concatenate(lengths), axis=0), unit_of_all)
        if not (found > 0).all() or not np.isfinite(found).all():
            raise ValueError(
                f"The lengths of the limbs are beyond {found.dtype} numbers: give the positions in "
                "another unit, such as metres."
            )
        self.limb_lengths_ = found
        return self

    @of_one_state
    def inverse_transform(self, X, limb_lengths=None):
        """Joint positions of postures: the paper's fifteen joints, for drawing.

        The lowest ankle of a performance stands on the floor y = 0, its pelvis above the
        origin; unless ``reference="world"`` it faces along z. Its hips lie evenly on both sides
        of the pelvis and its shoulders of the neck, so a body built that way comes back exactly.

        Postures do not tell how far the hips are below the pelvis. All hips of a performance
        are moved up or down by as much as puts its lowest ankle on the floor: then
        ``transform`` gives the same height of the pelvis, and the same cosines. They
        are moved by a quarter of a leg at most. A body that is farther from the floor, such as a
        single posture in the air, stays there, and its height comes back as near as that allows.

        Parameters
        ----------
        X : list of arrays (n_frames_i, 37), 3-D array, or 2-D array
            Postures; the three cosines of a limb only give its direction.
        limb_lengths : array-like of shape (12,), default=None
            Length of each limb, above 0; by default ``limb_lengths_``.

        Returns
        -------
        The kind that was given, with 45 features: the positions of ``Skeleton.paper()``

        Raises
        ------
        ValueError
            If the three cosines of a limb are all 0, columns are not those of
            ``get_feature_names_out``, or ``limb_lengths`` are not 12 numbers above 0.
        """
        check_is_fitted(self)
        lengths = self.limb_lengths_ if limb_lengths is None else _checked_lengths(limb_lengths)
        performances = check_transformed(self, X, self.get_feature_names_out())
        arrays = [self._positions(performances, i, lengths) for i in range(len(performances))]
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

    def _features(self, body):
        floor = min(body.at(f"{side}_ankle")[:, 1].min() for side in ("left", "right"))
        u = (body.at("pelvis")[:, 1] - floor) / body.leg
        cosines = body.directions
        if self.reference != "world":
            cosines = turned(cosines, body.heading)
        if self.reference == "parent":
            cosines = along_parents(cosines)
        return np.column_stack([u, cosines.reshape(len(u), -1)])

    def _positions(self, performances, i, lengths):
        postures = performances[i]
        cosines = postures[:, 1:].reshape(len(postures), -1, 3)
        # All of them being there is told sooner than one of each limb.
        without = np.zeros(()) if cosines.all() else ~cosines.any(axis=2)
        if without.any():
            frame, limb = np.argwhere(without)[0]
            raise ValueError(
                f"{performances.called(i)}, frame {frame}: the limb {LIMB_NAMES[limb]!r} has no "
                "direction, its three cosines are 0. Drop the frame, or give it a direction."
            )
        # A mean or an approximation of cosines is shorter than 1, a limb is not.
        cosines = unit(cosines)
        if self.reference == "parent":
            cosines = along_parents(cosines, inverse=True)
        k = exponent_of(lengths.max(), postures.dtype)
        with np.errstate(over="ignore", invalid="ignore"):
            body = _built(postures[:, 0], cosines, np.ldexp(lengths, -k).astype(postures.dtype))
            positions = np.ldexp(body, k) if k else body
            sound = np.isfinite(positions.sum()) or np.isfinite(positions).all()
        if not sound or lengths.min() < np.finfo(positions.dtype).tiny:
            raise ValueError(
                f"{performances.called(i)}: the positions are beyond {positions.dtype} numbers. "
                "Give limb_lengths in another unit, or smaller heights of the pelvis."
            )
        return positions


def _checked_lengths(limb_lengths):
    """One length above 0 for each limb."""
    names = list(limb_lengths.index) if isinstance(limb_lengths, pd.Series) else LIMB_NAMES
    if names not in (LIMB_NAMES, list(range(len(LIMB_NAMES)))):
        raise ValueError(f"limb_lengths is indexed by {names}; select {LIMB_NAMES}, in that order.")
    lengths = as_numbers(limb_lengths, "limb_lengths", dtype=np.float64)
    if lengths.shape != (len(LIMBS),):
        raise ValueError(
            f"limb_lengths needs one length for each of {LIMB_NAMES}, got shape {lengths.shape}."
        )
    wrong = ~((lengths > 0) & np.isfinite(lengths))
    if wrong.any():
        limb = int(wrong.argmax())
        raise ValueError(
            f"limb_lengths must be numbers above 0, got {lengths[limb]:g} for {LIMB_NAMES[limb]!r}."
        )
    return lengths


def _built(heights, cosines, lengths):
    """(n_frames, 45) positions of bodies with given heights, directions and lengths of limbs."""
    limb = dict(zip(LIMBS, np.moveaxis(cosines * lengths[:, np.newaxis], 1, 0), strict=True))
    legs = leg_length(lengths)
    at = {"pelvis": np.zeros_like(limb["hip"])}
    at["pelvis"][:, 1] = heights * legs
    at["neck"] = at["pelvis"] + limb["torso"]
    at["head"] = at["neck"] + limb["neck"]
    for side, sign in (("left", 0.5), ("right", -0.5)):
        at[f"{side}_hip"] = at["pelvis"] + sign * limb["hip"]
        at[f"{side}_shoulder"] = at["neck"] + sign * limb["shoulder"]
        for part in ("thigh", "leg", "arm", "forearm"):
            start, end, _, _ = LIMBS[f"{side}_{part}"]
            at[end] = at[start] + limb[f"{side}_{part}"]
    above = min(at[f"{side}_ankle"][:, 1].min() for side in ("left", "right"))
    for side in ("left", "right"):
        for joint in ("hip", "knee", "ankle"):
            at[f"{side}_{joint}"][:, 1] -= np.clip(above, -_MOVED * legs, _MOVED * legs)
    return np.concatenate([at[name] for name in LANDMARKS], axis=1)
