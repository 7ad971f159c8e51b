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
from .base import ACROSS, PositionsTransformer
from .built import built
from .columns import AXES
from .formats import SIDES
from .limbs import LIMB_NAMES, exponent_of, unit
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

    Attributes
    ----------
    limb_lengths_ : ndarray, shape (n_limbs,)
        Median length of each of ``skeleton.limbs`` over the postures seen in ``fit``, in the unit
        of the positions; what ``inverse_transform`` builds a body of.
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
    program put at (0, 0), is to be repaired or left out: no position tells it from others.

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
        X : list of arrays (n_frames_i, n_dims * n_joints), 3-D array, or 2-D array
            Joint positions, joint by joint x, y, z; or x, y.
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
        limbs = self.skeleton.limbs
        bodies = [self._body(performances, i)[2:4] for i in range(len(performances))]
        unit_of_all = max(k for _, k in bodies)
        lengths = [x if k == unit_of_all else np.ldexp(x, k - unit_of_all) for x, k in bodies]
        with np.errstate(over="ignore"):
            found = np.ldexp(np.median(np.concatenate(lengths), axis=0), unit_of_all)
        found = found[_places_of(limbs)]
        has_length = (found > 0) | self._may_lack_length
        if not has_length.all() or not np.isfinite(found).all():
            raise ValueError(
                f"The lengths of the limbs are beyond {found.dtype} numbers: give the positions in "
                "another unit, such as metres."
            )
        self.limb_lengths_ = found
        return self

    @of_one_state
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
        lengths = self.limb_lengths_
        if limb_lengths is not None:
            lengths = _checked_lengths(limb_lengths, self.skeleton.limbs)
        performances = check_transformed(self, X, self.get_feature_names_out())
        arrays = [self._positions(performances, i, lengths) for i in range(len(performances))]
        return restore(self, performances, arrays, columns=self.skeleton.body().column_names)

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
        cosines = cosines[:, _places_of(limbs)].reshape(len(cosines), -1)
        if not self.skeleton.has_height:
            return cosines
        ankles = [f"{side}_ankle" for side in SIDES if f"{side}_ankle" in self.skeleton.landmarks]
        floor = min(body.at(ankle)[:, 1].min() for ankle in ankles)
        return np.column_stack([(body.at("pelvis")[:, 1] - floor) / body.leg, cosines])

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
        cosines[:, _places_of(limbs)] = unit(given)
        if self.reference == "parent":
            cosines = along_parents(cosines, limbs, inverse=True)
        k = exponent_of(lengths.max(), postures.dtype)
        whole = np.zeros(len(LIMB_NAMES), dtype=postures.dtype)
        heights = postures[:, 0] if first else None
        with np.errstate(over="ignore", invalid="ignore"):
            whole[_places_of(limbs)] = np.ldexp(lengths, -k)
            body = built(heights, cosines, whole, self.skeleton)
            positions = np.ldexp(body, k) if k else body
            sound = np.isfinite(positions.sum()) or np.isfinite(positions).all()
        if not sound or lengths[lengths > 0].min(initial=1) < np.finfo(positions.dtype).tiny:
            raise ValueError(
                f"{performances.called(i)}: the positions are beyond {positions.dtype} numbers. "
                "Give limb_lengths in another unit, or smaller heights of the pelvis."
            )
        return positions


def _places_of(limbs):
    """Where limbs are among all twelve: a slice, if they are all."""
    if len(limbs) == len(LIMB_NAMES):
        return slice(None)
    return [LIMB_NAMES.index(name) for name in limbs]


def _checked_lengths(limb_lengths, limbs):
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
