"""The word for where a limb points instead of where it is expected to."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from sklearn_motionsync.body.axes import direction_of


@pytest.mark.parametrize(
    ("limb", "expected", "now", "word"),
    [
        ("left_thigh", (0, -1, 0), (0, -0.9, 0.4), "flexed"),
        ("right_thigh", (0, -1, 0), (0, -0.9, -0.4), "extended"),
        ("left_thigh", (0, -1, 0), (0.4, -0.9, 0.1), "abducted"),
        ("right_thigh", (0, -1, 0), (-0.4, -0.9, 0.1), "abducted"),
        ("right_thigh", (0, -1, 0), (0.4, -0.9, 0.1), "adducted"),
        # Of one who sits.
        ("left_thigh", (0, -0.2, 0.98), (0, 0.3, 0.95), "flexed"),
        ("left_leg", (0, -1, 0), (0, -0.8, -0.6), "flexed"),
        ("left_leg", (0, -0.8, -0.6), (0, -1, 0), "extended"),
        ("right_forearm", (-1, 0, 0), (-0.5, 0.2, 0.8), "flexed"),
        ("right_forearm", (-0.5, 0, 0.87), (-0.9, 0, 0.43), "extended"),
        ("left_forearm", (0.5, 0, 0.87), (0.5, 0.87, 0), "turned"),
        ("left_arm", (0.2, -0.98, 0), (0.9, 0.1, 0), "raised"),
        ("left_arm", (1, 0, 0), (0.2, -0.98, 0), "lowered"),
        ("right_arm", (0, -1, 0), (0, -0.8, 0.6), "forward"),
        ("right_arm", (0, -1, 0), (-0.6, -0.8, 0), "outward"),
        ("torso", (0, 1, 0), (0, 0.9, 0.4), "forward"),
        ("neck", (0, 1, 0), (0.4, 0.9, 0), "to the left"),
        ("hip", (1, 0, 0), (0.9, 0, 0.4), "turned to the right"),
        ("shoulder", (1, 0, 0), (0.9, 0.4, 0), "left side raised"),
        ("torso", (0, 1), (0.4, 0.9), None),
        ("left_leg", (0, -1), (0.6, -0.8), "flexed"),
    ],
)
def test_words_of_directions(limb, expected, now, word):
    expected, now = np.array(expected, dtype=float), np.array(now, dtype=float)
    assert direction_of(limb, now - expected, expected) == word


def test_a_knee_is_flexed_however_its_axis_is_turned():
    rest = np.array([0.0, -1.0, 0.0])
    rng = np.random.default_rng(0)
    for _ in range(50):
        about_thigh = Rotation.from_rotvec(rng.uniform(-np.pi, np.pi) * rest)
        slightly, far = np.sort(rng.uniform(0, 2.5, 2)) + [0, 0.1]
        before, after = (
            about_thigh.apply(Rotation.from_rotvec([angle, 0, 0]).apply(rest))
            for angle in (slightly, far)
        )
        assert direction_of("right_leg", after - before, before) == "flexed"
        assert direction_of("right_leg", before - after, after) == "extended"
