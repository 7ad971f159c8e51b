"""Long takes are computed a portion of frames at a time."""

import tracemalloc

import numpy as np
import pytest
from sklearn_motionsync import DirectionCosines, JointPositions
from sklearn_motionsync.body import base

TRANSFORMERS = {
    "heading": (DirectionCosines, {}),
    "parent": (DirectionCosines, {"reference": "parent"}),
    "world": (DirectionCosines, {"reference": "world"}),
    "hidden": (DirectionCosines, {"hidden": "nan"}),
    "joints": (JointPositions, {}),
}


def with_gaps(x, skeleton):
    """Hips hidden from the first frame on, shoulders, and both, over the borders of portions."""
    x = x.reshape(len(x), -1, 3).copy()
    for names, rows in (
        (["left_hip"], [*range(5), *range(12, 40), *range(50, 60)]),
        (["left_shoulder"], range(20, 36)),
        (["left_ankle", "right_ankle"], range(30, 33)),
    ):
        for name in names:
            x[rows, skeleton.index_of(name)] = np.nan
    return x.reshape(len(x), -1)


@pytest.mark.parametrize("kind", TRANSFORMERS)
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_portions_change_no_bit(bending, kind, dtype, monkeypatch):
    make, settings = TRANSFORMERS[kind]
    X = [x.astype(dtype) for x in bending.data[:4]]
    if kind == "hidden":
        X = [with_gaps(x, bending.skeleton) for x in X]
    whole = make(bending.skeleton, **settings).fit_transform(X)
    monkeypatch.setattr(base, "PORTION", 7)
    for got, expected in zip(
        make(bending.skeleton, **settings).fit_transform(X), whole, strict=True
    ):
        assert got.dtype == dtype
        np.testing.assert_array_equal(got, expected)


@pytest.mark.parametrize("wrong", ["length", "upside down"])
def test_errors_are_those_of_the_whole(bending, wrong, monkeypatch):
    x, messages = bending.data[0].copy(), []
    if wrong == "length":
        knee, ankle = (bending.skeleton.index_of(f"left_{part}") for part in ("knee", "ankle"))
        x[50, 3 * ankle : 3 * ankle + 3] = x[50, 3 * knee : 3 * knee + 3]
    else:
        x[:, 1::3] *= -1
    for portion in (base.PORTION, 7):
        monkeypatch.setattr(base, "PORTION", portion)
        with pytest.raises(ValueError, match="frame 50" if wrong == "length" else wrong) as caught:
            DirectionCosines(bending.skeleton).fit([x])
        messages.append(str(caught.value))
    assert messages[0] == messages[1]


def test_memory_of_a_long_take_is_lengths_and_result(bending):
    """40,000 frames, 14 MB of positions: landmarks, limbs and their like would take 45."""
    x = np.resize(bending.data[0], (40_000, 45))
    cosines = DirectionCosines(bending.skeleton)
    tracemalloc.start()
    cosines.fit(x)
    fitted = tracemalloc.get_traced_memory()[1]
    tracemalloc.reset_peak()
    result = cosines.transform(x)
    transformed = tracemalloc.get_traced_memory()[1] - result.nbytes
    tracemalloc.stop()
    assert fitted < 20e6
    assert transformed < 20e6
