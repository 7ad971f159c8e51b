"""JointNoise: noise of joint positions, as it shows in direction cosines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from sklearn.utils.validation import check_is_fitted

from ..inputs.numbers import LARGEST
from ..inputs.wording import counted
from .direction_cosines import DirectionCosines
from .formats import LANDMARKS
from .limbs import landmark_positions

# Draws of every pose, and their seed.
_DRAWS, _SEED = 20, 0


@dataclass(frozen=True)
class JointNoise:
    """Noise of joint positions, for a tracker of direction cosines.

    The same error of a joint turns a short limb farther than a long one, moves both limbs that meet
    there, and by way of the hips the heading of the whole body. ``MotionTracker(noise=JointNoise(
    0.02, cosines))`` accounts for that: joints are off by 2 cm, in metres.

    Parameters
    ----------
    sd : float
        Standard deviation of every coordinate of a joint, in the unit of the positions that
        ``cosines`` was fitted on.
    cosines : DirectionCosines
        The fitted transformer that makes the poses.

    Raises
    ------
    ValueError
        If ``sd`` is not a number above 0.
    TypeError
        If ``cosines`` are no `DirectionCosines`.
    sklearn.exceptions.NotFittedError
        If ``cosines`` are not fitted.

    See Also
    --------
    MotionTracker : Takes it as its ``noise``.

    Notes
    -----
    The covariance is that of 20 draws of each pose, with limbs of the lengths of ``cosines``. A
    landmark that is the mean of several markers has the noise of that mean.

    Examples
    --------
    >>> from sklearn_motionsync import DirectionCosines
    >>> from sklearn_motionsync.body import JointNoise
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bending = make_bending(4, random_state=0)
    >>> cosines = DirectionCosines(bending.skeleton).fit(bending.data)
    >>> noise = JointNoise(0.02, cosines)  # 2 cm
    >>> covariance = noise.covariance(cosines.transform(bending.data)[0])
    >>> names = list(cosines.get_feature_names_out())
    >>> hips, thigh = names.index("hip_y"), names.index("left_thigh_x")
    >>> bool(covariance[hips, hips] > 1.5 * covariance[thigh, thigh])  # hips are shorter
    True
    """

    sd: float
    cosines: DirectionCosines

    def __post_init__(self):
        if not isinstance(self.cosines, DirectionCosines):
            raise TypeError(
                "JointNoise needs the fitted DirectionCosines that make the poses, got "
                f"{type(self.cosines).__name__}."
            )
        check_is_fitted(self.cosines)
        if not 0 < self.sd <= LARGEST:
            raise ValueError(
                f"sd must be a number above 0, in the unit of the joints; got {self.sd!r}."
            )

    def covariance(self, poses: np.ndarray) -> np.ndarray:
        """Second moments of the errors of poses whose joints are off.

        Parameters
        ----------
        poses : ndarray, shape (n_frames, n_features)
            Direction cosines, over which it is averaged.

        Returns
        -------
        ndarray, shape (n_features, n_features)
            About 0: noise of joints also makes mean cosines shorter.

        Raises
        ------
        ValueError
            If the poses have another width than ``cosines`` make.
        """
        width = len(self.cosines.get_feature_names_out())
        if poses.ndim != 2 or poses.shape[1] != width:
            raise ValueError(
                f"The DirectionCosines of this JointNoise make {counted(width, 'feature')} a "
                f"frame, and the trials have the shape {poses.shape}. Give those that "
                "made the trials."
            )
        skeleton, (positions,) = self.cosines.skeleton, self.cosines.inverse_transform([poses])
        body, rng = skeleton.body(), np.random.default_rng(_SEED)
        order = [LANDMARKS.index(name) for name in body.joints]
        again = DirectionCosines(body, self.cosines.reference).fit([positions])
        (exact,) = again.transform([positions])
        moments = np.zeros((width, width))
        for _ in range(_DRAWS):
            size = len(positions), skeleton.n_dims * len(skeleton.joints)
            moved = landmark_positions(self.sd * rng.standard_normal(size), skeleton)[:, order]
            (noisy,) = again.transform([positions + moved.reshape(positions.shape)])
            moments += (noisy - exact).T @ (noisy - exact)
        return moments / (_DRAWS * len(positions))
