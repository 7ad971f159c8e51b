"""JointNoise against recordings that are moved, and of means of markers."""

import numpy as np
import pytest
from sklearn import clone
from sklearn.exceptions import NotFittedError
from sklearn_motionsync import DirectionCosines, JointPositions, LinearSynchronizer, Skeleton
from sklearn_motionsync.body import JointNoise
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.live import MotionTracker

BENDING = make_bending(4, frame_rate=30, random_state=0)


def fitted(reference="heading", skeleton=BENDING.skeleton):
    return DirectionCosines(skeleton, reference).fit(BENDING.data)


@pytest.mark.parametrize("reference", ["heading", "parent", "world"])
@pytest.mark.parametrize("sd", [0.01, 0.05])
def test_covariance_is_that_of_moved_recordings(reference, sd):
    """Of a body of these proportions, moved by other draws."""
    cosines = fitted(reference)
    (body,) = cosines.inverse_transform(cosines.transform(BENDING.data[:1]))
    (exact,) = cosines.transform([body])
    rng = np.random.default_rng(9)
    moved = cosines.transform([body + sd * rng.standard_normal(body.shape) for _ in range(30)])
    off = np.concatenate(moved) - np.tile(exact, (30, 1))
    expected = off.T @ off / len(off)
    found = JointNoise(sd, cosines).covariance(exact)
    np.testing.assert_allclose(found, found.T, atol=1e-15)
    scales = [np.sqrt(np.diag(x)) for x in (found, expected)]
    moves = scales[1] > 1e-9  # all but the hips, forward
    np.testing.assert_allclose(*(x[moves] for x in scales), rtol=0.2)
    pairs = zip((found, expected), scales, strict=True)
    correlations = [x[np.ix_(moves, moves)] / np.outer(s[moves], s[moves]) for x, s in pairs]
    np.testing.assert_allclose(*correlations, atol=0.2)


def test_mean_of_markers_has_less_noise():
    """Each landmark the mean of four markers: half the noise, a quarter of the covariance."""
    names = [f"{joint}{k}" for joint in BENDING.skeleton.joints for k in range(4)]
    landmarks = {joint: tuple(f"{joint}{k}" for k in range(4)) for joint in BENDING.skeleton.joints}
    markers = Skeleton(names, [-1] * len(names), landmarks=landmarks)
    data = [np.repeat(x.reshape(len(x), -1, 3), 4, axis=1) for x in BENDING.data]
    many = DirectionCosines(markers).fit([x.reshape(len(x), -1) for x in data])
    (pose,) = fitted().transform(BENDING.data[:1])
    one, four = (JointNoise(0.005, c).covariance(pose) for c in (fitted(), many))
    # After the height and the hips, whose errors are of second order along the heading.
    np.testing.assert_allclose(np.diag(four)[4:] / np.diag(one)[4:], 0.25, atol=0.04)


def test_stays_fitted_in_clones():
    noise = JointNoise(0.02, fitted())
    tracker = clone(MotionTracker(LinearSynchronizer(), 10, noise=noise))
    tracker.fit(noise.cosines.transform(BENDING.data))
    assert tracker.get_params()["noise"].sd == 0.02


def test_refusals():
    with pytest.raises(TypeError, match=r"needs the fitted DirectionCosines .* got JointPositions"):
        JointNoise(0.02, JointPositions(BENDING.skeleton))
    with pytest.raises(NotFittedError):
        JointNoise(0.02, DirectionCosines(BENDING.skeleton))
    for sd in (0, -1, np.inf, np.nan):
        with pytest.raises(ValueError, match=r"sd must be a number above 0, .* got"):
            JointNoise(sd, fitted())
    tracker = MotionTracker(LinearSynchronizer(), 10, noise=JointNoise(0.02, fitted()))
    with pytest.raises(ValueError, match=r"make 37 features a frame, .* shape \(\d+, 36\)"):
        tracker.fit([x[:, 1:] for x in fitted().transform(BENDING.data)])
