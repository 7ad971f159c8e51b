"""make_walk: feet that stand on the ground where and when it says."""

from itertools import pairwise

import numpy as np
import pytest
from sklearn_motionsync.datasets import make_walk


def foot(walk, i, name):
    k = walk.skeleton.joints.index(name)
    return walk.data[i][:, 3 * k : 3 * k + 3]


def test_shapes_and_truth():
    walk = make_walk(3, n_strides=4, frame_rate=60, random_state=0)
    assert [x.shape[1] for x in walk.data] == [57] * 3
    for x, events in zip(walk.data, walk.events, strict=True):
        assert all(0 < event["frame"] < len(x) for event in events)
        np.testing.assert_allclose(
            [event["time"] for event in events], [event["frame"] / 60 for event in events]
        )
        right = [e for e in events if (e["label"], e["context"]) == ("Foot Strike", "Right")]
        assert len(right) == 5  # four strides


@pytest.mark.parametrize("side", ["left", "right"])
def test_feet_stand_between_strike_and_foot_off(side):
    walk = make_walk(2, noise=0, random_state=0)
    for i, events in enumerate(walk.events):
        heel, toe = foot(walk, i, f"{side}_heel"), foot(walk, i, f"{side}_toe")
        lowest = np.minimum(heel[:, 1], toe[:, 1])
        assert lowest.min() > -0.01
        own = [e for e in events if e["context"] == side.capitalize()]
        for first, second in pairwise(own):
            if first["label"] != "Foot Strike":
                continue
            a, b = first["frame"], second["frame"]
            # Flat in the middle of the stance: neither end moves.
            flat = slice(round(a + 0.3 * (b - a)), round(a + 0.5 * (b - a)))
            for end in (heel, toe):
                assert np.ptp(end[flat], axis=0).max() < 0.005
            swing = lowest[round(b) + 8 : round(b) + 20]
            assert (swing > 0.005).all()


def test_treadmill_and_seeds():
    way = [np.ptp(foot(make_walk(1, treadmill=on, random_state=0), 0, "pelvis")[:, 2])
           for on in (False, True)]  # fmt: skip
    assert way[0] > 5
    assert way[1] < 0.1
    a, b = (make_walk(1, random_state=3).data[0] for _ in range(2))
    np.testing.assert_array_equal(a, b)
