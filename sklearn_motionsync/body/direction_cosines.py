"""DirectionCosines: from joint positions to postures, and back (Eq. 1)."""

import numpy as np
import pandas as pd
from sklearn.base import _fit_context
from sklearn.utils._param_validation import StrOptions
from sklearn.utils.validation import check_is_fitted

from ..inputs.numbers import as_numbers
from ..inputs.validation import check_transformed, restore
from ..utils.atomic import atomic_fit, snapshot
from .axes import along_parents, turned
from .base import ACROSS, PositionsTransformer
from .columns import AXES
from .formats import LANDMARKS, SIDES
from .hidden import hide_whole, in_proportion, typical_lengths
from .limbs import LIMB_NAMES, LIMBS, exponent_of, leg_length, lowest, places_of, unit
from .skeleton import Skeleton

__all__ = ["DirectionCosines"]

_HEIGHT = "pelvis_height"
_NUMBER = {2: "two", 3: "three"}


class DirectionCosines(PositionsTransformer):
    """Postures of 37 parameters from joint positions (Eq. 1).

    A posture is the height of the pelvis and, for each of twelve limbs, the cosines of the
    angles between the limb and three axes. It does not change when the body is moved,
    or when all its limbs are longer by the same factor; with the default frame of
    reference, nor when it faces another way.

    A skeleton that lacks landmarks has fewer parameters: the cosines of the limbs that are
    there, and the height if there is a pelvis and a whole leg. Key-points in a picture
    (``Skeleton(..., n_dims=2)``) have two cosines a limb.

    Parameters
    ----------
    skeleton : Skeleton
        Which columns are which joints: a ready one such as ``Skeleton.acclaim()``, that of a
        table, ``Skeleton.from_frame(df)``, or your own.
    reference : {"heading", "parent", "world"}, default="heading"
        The axes of the cosines. ``"heading"``: x to the left along the hips, y up, z forward; of
        a body without hips along the shoulders, and without those the axes of the recording.
        ``"parent"``: those of the parent limb, which turn with it (without twist), or of the
        nearest limb above it that is there; the hip's are those of ``"heading"``. ``"world"``:
        those of the recording, of which y is made the vertical one. A picture shows no heading:
        in the plane ``"heading"`` is ``"world"``, x across the picture and y up.
    hidden : {"refuse", "nan"}, default="refuse"
        What becomes of NaN, joints that were not seen. ``"refuse"``: it is an error. ``"nan"``: a
        joint is hidden in a frame if any of its coordinates is NaN, and so is a landmark that is
        the mean of it and others; limbs of which an end is hidden are NaN in that frame, and what
        is seen stays as it is.

    Attributes
    ----------
    limb_lengths_ : ndarray, shape (n_limbs,)
        Median length of each of ``skeleton.limbs`` over the postures of ``fit`` that show it, in
        the unit of the positions; what ``inverse_transform`` builds a body of.
    n_features_in_ : int
        The number of joints times that of their axes.
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

    In a picture, hips and shoulders that coincide in a whole performance point at the camera: both
    of their cosines are 0, as the two of three would be. A joint that was not found, and that the
    program put at (0, 0), is to be repaired, left out, or made NaN where ``hidden="nan"``: no
    position tells it from others.

    **Hidden joints.** Where the hips are hidden, axes of ``"heading"`` and ``"parent"`` face along
    the shoulders, turned by as much as they were against the hips when both were last seen; if
    they never were, along the shoulders. Where those are hidden, too, the body faces where it
    faced before; until anything tells, all limbs are NaN. With ``"parent"`` a limb is NaN if the
    limbs it hangs on are. The height needs the pelvis in its frame, an ankle in any frame, and
    the lengths of the legs: of limbs that a performance never shows they are those of ``fit``,
    in proportion to the limbs that it shows.

    **Live.** No row but the height looks at later frames, so the last row of the frames so far,
    ``transform(frames[: k + 1])[-1]``, is that of the whole take; its floor is the lowest ankle so
    far. The last seconds will do if they show the hips once, and a foot on the floor. A single
    frame, ``transform(frame[np.newaxis])[0]``, has its own lowest ankle as floor, so that
    a jump is not seen, its own leg, and no frame before it that tells the heading.

    Examples
    --------
    >>> from sklearn_motionsync import DirectionCosines
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(2, random_state=0)
    >>> cosines = DirectionCosines(bunch.skeleton).fit(bunch.data)
    >>> postures = cosines.transform(bunch.data)
    >>> postures[0].shape[1], list(cosines.get_feature_names_out()[:4])
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
        "hidden": [StrOptions({"refuse", "nan"})],
    }

    def __init__(self, skeleton, reference="heading", hidden="refuse"):
        self.skeleton = skeleton
        self.reference = reference
        self.hidden = hidden

    @atomic_fit
    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X, y=None):
        """Learn the limb lengths.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_dims * n_joints), 3-D array, or 2-D array
            Joint positions, joint by joint x, y, z; or x, y.
        y : ignored

        Returns
        -------
        self

        Raises
        ------
        ValueError
            As from ``transform``, or if a limb is hidden throughout.
        """
        performances = self._check(X, reset=True)
        limbs = self.skeleton.limbs
        bodies = [self._body(performances, i)[2:4] for i in range(len(performances))]
        # What is hidden throughout has no unit.
        unit_of_all = max((k for x, k in bodies if (x > 0).any()), default=0)
        lengths = [x if k == unit_of_all else np.ldexp(x, k - unit_of_all) for x, k in bodies]
        with np.errstate(over="ignore"):
            found = np.ldexp(typical_lengths(np.concatenate(lengths)), unit_of_all)
        found = found[places_of(limbs)]
        if np.isnan(found).any():
            never = [name for name, length in zip(limbs, found, strict=True) if np.isnan(length)]
            raise ValueError(
                f"The limbs {never} are hidden in every frame of every performance, so that their "
                "lengths cannot be learnt. Fit on performances that show them, or leave their "
                "landmarks out of the skeleton: Skeleton(..., landmarks={'left_wrist': None, ...})."
            )
        has_length = (found > 0) | self._may_lack_length
        if not has_length.all() or not np.isfinite(found).all():
            raise ValueError(
                f"The lengths of the limbs are beyond {found.dtype} numbers: give the positions in "
                "another unit, such as metres."
            )
        self.limb_lengths_ = found
        return self

    @snapshot
    def inverse_transform(self, X, limb_lengths=None):
        """Joint positions of postures: the paper's fifteen joints, for drawing.

        Of a body that lacks landmarks it is those that limbs hold together, ``skeleton.body()``.

        The lowest ankle of a performance stands on the floor y = 0, its pelvis above the
        origin; unless ``reference="world"`` it faces along z. Its hips lie evenly on both sides
        of the pelvis and its shoulders of the neck, so a body built that way comes back exactly.

        Postures do not tell how far the hips are below the pelvis. All hips of a performance
        are moved up or down by as much as puts its lowest ankle on the floor: then
        ``transform`` gives the same height of the pelvis, and the same cosines. They
        are moved by a quarter of a leg at most. A body that is farther from the floor, such as a
        single posture in the air, stays there, and its height comes back as near as that allows.
        A posture without a height has its pelvis at height 0; so has a part of the body that no
        limb joins to the pelvis its uppermost joint.

        With ``hidden="nan"`` a limb of which a cosine is NaN is hidden: joints that hang on it are
        NaN, and where the height is, all are.

        Parameters
        ----------
        X : list of arrays (n_frames_i, 37), 3-D array, or 2-D array
            Postures; the cosines of a limb only give its direction.
        limb_lengths : array-like of shape (n_limbs,), default=None
            Length of each limb, above 0; by default ``limb_lengths_``.

        Returns
        -------
        The kind that was given, with 45 features: the positions of ``Skeleton.paper()``, or those
        of ``skeleton.body()``

        Raises
        ------
        ValueError
            If the cosines of a limb are all 0, columns are not those of
            ``get_feature_names_out``, or ``limb_lengths`` are not numbers above 0, one a limb.
        """
        check_is_fitted(self)
        lengths = self._lengths(limb_lengths)
        names = self.get_feature_names_out()
        performances = check_transformed(self, X, names, finite=self._finite)
        arrays = [self._positions(performances, i, lengths) for i in range(len(performances))]
        return restore(self, performances, arrays, columns=self.skeleton.body().column_names)

    @snapshot
    def position_matrix(self, limb_lengths=None):
        """The linear map from postures to joint positions, for given limb lengths.

        The pelvis is at its height above the origin, and each joint at the end of its limb. That
        is what ``inverse_transform`` gives of cosines of length 1, but for its last step: the
        matrix leaves the hips beside the pelvis, where ``inverse_transform`` moves those of a
        performance, and the legs with them, by one height that puts its lowest ankle on the floor.

        Some of its rows are a camera: x and y are an orthographic picture from the front. A
        tracker that sees positions takes them as the projection of a posture, and as its offset
        that height of the legs, 0 elsewhere, where the hips of those it sees are below the pelvis.

        Parameters
        ----------
        limb_lengths : array-like of shape (n_limbs,), default=None
            Length of each limb, above 0; by default ``limb_lengths_``.

        Returns
        -------
        matrix : ndarray of float64, shape (n_dims * n_joints, n_features)
            ``postures @ matrix.T`` are positions of the joints of ``skeleton.body()``, y up, x to
            the left of who faces along z; with ``reference="world"`` along the recording's axes.
        names : list of str
            Of its rows, ``<joint>_x``, ``<joint>_y``, ``<joint>_z``, ...

        Raises
        ------
        ValueError
            If ``reference="parent"``, whose axes turn with the posture: that is not linear. Or if
            ``limb_lengths`` are not numbers above 0, one a limb.

        Examples
        --------
        >>> from sklearn_motionsync import DirectionCosines
        >>> from sklearn_motionsync.datasets import make_bending
        >>> bunch = make_bending(2, random_state=0)
        >>> cosines = DirectionCosines(bunch.skeleton).fit(bunch.data)
        >>> matrix, names = cosines.position_matrix()
        >>> matrix.shape, names[:3]
        ((45, 37), ['pelvis_x', 'pelvis_y', 'pelvis_z'])

        A picture from the front, in which the left arm is hidden:

        >>> hidden = ("left_elbow", "left_wrist")
        >>> seen = [name[-1] in "xy" and not name.startswith(hidden) for name in names]
        >>> picture = cosines.transform(bunch.data)[0] @ matrix[seen].T
        >>> picture.shape[1]
        26
        """
        check_is_fitted(self)
        if self.reference == "parent":
            raise ValueError(
                "Positions are no linear map of cosines along parent limbs, which turn with the "
                "posture. Use reference='heading' or 'world', or inverse_transform."
            )
        lengths = self._lengths(limb_lengths).astype(np.float64)
        return matrix_of(self._of_twelve(lengths), self.skeleton), self.skeleton.body().column_names

    def get_feature_names_out(self, input_features=None):
        """Names of the 37 parameters: ``pelvis_height``, ``hip_x``, ..., ``right_forearm_z``.

        Parameters
        ----------
        input_features : ignored

        Returns
        -------
        ndarray of str
        """
        axes = AXES[self.skeleton.n_dims]
        names = [f"{limb}_{axis}" for limb in self.skeleton.limbs for axis in axes]
        return np.asarray([_HEIGHT] * self.skeleton.has_height + names, dtype=object)

    def _features(self, body):
        limbs, cosines = self.skeleton.limbs, body.directions
        heading = body.heading if self.reference != "world" else None
        if heading is not None:
            cosines = turned(cosines, heading)
        if self.reference == "parent":
            cosines = along_parents(cosines, limbs)
        cosines = cosines[:, places_of(limbs)].reshape(len(cosines), -1)
        if not self.skeleton.has_height:
            return cosines
        ankles = [f"{side}_ankle" for side in SIDES if f"{side}_ankle" in self.skeleton.landmarks]
        floor, lengths = lowest([body.at(ankle) for ankle in ankles]), body.typical
        leg = leg_length(lengths, limbs)
        if np.isnan(leg):
            whole = in_proportion(lengths, self._of_twelve(self.limb_lengths_))
            leg = leg_length(whole, limbs)
        return np.column_stack([(body.at("pelvis")[:, 1] - floor) / leg, cosines])

    def _lengths(self, given):
        if given is None:
            return self.limb_lengths_
        return checked_lengths(given, self.skeleton.limbs)

    def _of_twelve(self, lengths):
        whole = np.zeros(len(LIMB_NAMES), dtype=lengths.dtype)
        whole[places_of(self.skeleton.limbs)] = lengths
        return whole

    @property
    def _finite(self):
        return "allow-nan" if self.hidden == "nan" else True

    @property
    def _may_lack_length(self):
        """Which limbs a picture may show end-on."""
        in_plane = self.skeleton.n_dims == 2
        return np.array([in_plane and name in ACROSS for name in self.skeleton.limbs])

    def _positions(self, performances, i, lengths):
        postures, limbs = performances[i], self.skeleton.limbs
        first, n_dims = int(self.skeleton.has_height), self.skeleton.n_dims
        given = postures[:, first:].reshape(len(postures), -1, n_dims)
        # All of them being there is told sooner than one of each limb.
        without = np.zeros(()) if given.all() else ~given.any(axis=2) & ~self._may_lack_length
        if without.any():
            frame, limb = np.argwhere(without)[0]
            raise ValueError(
                f"{performances.called(i)}, frame {frame}: the limb {limbs[limb]!r} has no "
                f"direction, its {_NUMBER[n_dims]} cosines are 0. Drop the frame, or give it a "
                "direction."
            )
        # A mean or an approximation of cosines is shorter than 1, a limb is not.
        cosines = np.zeros((len(given), len(LIMB_NAMES), n_dims), dtype=given.dtype)
        cosines[:, places_of(limbs)] = unit(given)
        if self.reference == "parent":
            cosines = along_parents(cosines, limbs, inverse=True)
        k = exponent_of(lengths.max(), postures.dtype)
        heights = postures[:, 0] if first else None
        with np.errstate(over="ignore", invalid="ignore"):
            whole = self._of_twelve(np.ldexp(lengths, -k)).astype(postures.dtype)
            body = built(heights, cosines, whole, self.skeleton)
            positions = np.ldexp(body, k) if k else body
            sound = np.isfinite(positions.sum()) or self._is_sound(positions)
        if not sound or lengths[lengths > 0].min(initial=1) < np.finfo(positions.dtype).tiny:
            raise ValueError(
                f"{performances.called(i)}: the positions are beyond {positions.dtype} numbers. "
                "Give limb_lengths in another unit, or smaller heights of the pelvis."
            )
        if self._finite is not True:
            hide_whole(positions.reshape(len(positions), -1, n_dims))
        return positions

    def _is_sound(self, positions):
        beyond = np.isinf(positions) if self._finite == "allow-nan" else ~np.isfinite(positions)
        return not beyond.any()


# -- bodies built of the heights, directions and lengths of their limbs, and the matrix of that

# How far the hips of a body may be moved from where its pelvis is, in leg lengths, so that it
# stands on the floor. Of 144 performances of optical motion capture, and of their approximations in
# an aSpace, none needs more than 0.21.
_MOVED = 0.25


def checked_lengths(limb_lengths, limbs):
    """One length above 0 for each limb."""
    names = list(limb_lengths.index) if isinstance(limb_lengths, pd.Series) else limbs
    if names not in (limbs, list(range(len(limbs)))):
        raise ValueError(f"limb_lengths is indexed by {names}; select {limbs}, in that order.")
    lengths = as_numbers(limb_lengths, "limb_lengths", dtype=np.float64)
    if lengths.shape != (len(limbs),):
        raise ValueError(
            f"limb_lengths needs one length for each of {limbs}, got shape {lengths.shape}."
        )
    wrong = ~((lengths > 0) & np.isfinite(lengths))
    if wrong.any():
        limb = int(wrong.argmax())
        raise ValueError(
            f"limb_lengths must be numbers above 0, got {lengths[limb]:g} for {limbs[limb]!r}."
        )
    return lengths


def built(heights, cosines, lengths, skeleton):
    """Positions of bodies with given heights, directions and lengths of limbs.

    Parameters
    ----------
    heights : ndarray, shape (n_frames,), or None
        Of the pelvis, in legs; None leaves it at height 0.
    cosines : ndarray, shape (n_frames, 12, n_dims)
        Of length 1; 0 for limbs that lack. What hangs on NaN is NaN.
    lengths : ndarray, shape (12,)
    skeleton : Skeleton
        Tells which limbs and landmarks there are.

    Returns
    -------
    ndarray, shape (n_frames, n_dims * n_landmarks)
        Of the landmarks of ``skeleton.body()``.
    """
    at = _chained(heights, cosines, lengths, skeleton.limbs)
    if heights is not None:
        legs = leg_length(lengths, skeleton.limbs)
        ankles = [f"{side}_ankle" for side in SIDES if f"{side}_leg" in skeleton.limbs]
        above = lowest([at[ankle] for ankle in ankles])
        # Where no ankle is seen, nothing tells the floor.
        down = 0 if np.isnan(above) else np.clip(above, -_MOVED * legs, _MOVED * legs)
        for side in SIDES:
            for joint in ("hip", "knee", "ankle"):
                at[f"{side}_{joint}"][:, 1] -= down
    return _joined(at, skeleton)


def matrix_of(lengths, skeleton):
    """The matrix (n_dims * n_landmarks, n_features) of the positions in heights and cosines.

    They are those that are ``built``, but for the move to the floor.
    """
    first, n_dims, limbs = int(skeleton.has_height), skeleton.n_dims, skeleton.limbs
    each = np.eye(first + n_dims * len(limbs))
    cosines = np.zeros((len(each), len(LIMBS), n_dims))
    cosines[:, places_of(limbs)] = each[:, first:].reshape(len(each), -1, n_dims)
    return _joined(_chained(each[:, 0] if first else None, cosines, lengths, limbs), skeleton).T


def _chained(heights, cosines, lengths, limbs):
    """Positions (n_frames, n_dims) by landmark, linear in heights and cosines."""
    limb = dict(zip(LIMBS, np.moveaxis(cosines * lengths[:, np.newaxis], 1, 0), strict=True))
    at = {"pelvis": np.zeros_like(limb["hip"])}
    if heights is not None:
        at["pelvis"][:, 1] = heights * leg_length(lengths, limbs)
    # What no limb joins to the pelvis starts where that is.
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
