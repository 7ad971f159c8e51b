"""Counts, cuts and choices stay the same where only the last bits of the input differ.

Sums of products differ in these bits from processor to processor.
"""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import ASpace, Match, to_trials
from sklearn_motionsync.io import cut_at_events
from sklearn_motionsync.live.members import weighted_median
from sklearn_motionsync.synchronizers import blend_trials
from sklearn_motionsync.takes import CycleSegmenter

# Each test is of two seeds.
pytestmark = pytest.mark.parametrize("seed", range(2))


def shaken(values, seed):
    """Values whose last bits are others."""
    values = np.asarray(values, dtype=np.float64)
    return values * (1 + 1e-13 * np.random.default_rng(seed).uniform(-1, 1, values.shape))


def curve(n_frames):
    t = np.linspace(0, 1, n_frames)
    return np.column_stack([np.sin(3 * t), t**2])


@pytest.mark.parametrize(
    ("lengths", "expected"), [((101, 108), 105), ((78, 117), 98), ((80, 90), 85)]
)
def test_blend_of_half_a_frame_has_one_length(lengths, expected, seed):
    # The mean of the first two pairs is 104.5 and 97.5 frames.
    clock = shaken(np.arange(61.0), seed)
    clock[[0, -1]] = 0, 60
    match = Match(np.tile(clock, (2, 1)))
    assert len(blend_trials(match, list(map(curve, lengths)), [0.5, 0.5])) == expected


@pytest.mark.parametrize(("rate", "expected"), [(None, 13), (2.0, 25), (0.5, 7)])
def test_resampled_recordings_have_one_length(rate, expected, seed):
    # Frames come once a unit of time; the last one is late by half of it.
    times = np.append(np.arange(12.0), 12.5 if rate is None else 12.0)
    times = shaken(times, seed) if rate is None else times
    df = pd.DataFrame({"t": times, "x": np.sin(times)})
    (found,) = to_trials(df, time="t", frame_rate=rate)
    assert len(found) == expected + (rate is None)


def test_events_between_two_frames_cut_at_one_of_them(seed):
    df = pd.DataFrame({"knee": np.arange(80.0)})
    frames = shaken([10.5, 31.5, 60.5], seed)
    df.attrs["events"] = [{"label": "strike", "context": "left", "frame": k} for k in frames]
    found = cut_at_events(df, "strike")
    assert [x["knee"].iloc[[0, -1]].tolist() for x in found] == [[11, 32], [32, 61]]


def cycles(n_cycles, period):
    """Whole cycles, in which each feature has an opposite one that moves as much."""
    t = 2 * np.pi * np.arange(int(n_cycles * period) + 1) / period
    x = np.column_stack([np.sin(t) + 0.5 * np.cos(2 * t), np.cos(t) - 0.3 * np.sin(2 * t)])
    return np.concatenate([x, -x], axis=1)


@pytest.mark.parametrize("period", [40, 42.5])
def test_cycles_are_counted_and_cut_alike(period, seed):
    x = cycles(4, period)
    tables = []
    for take in (x, shaken(x, seed)):
        _, table = CycleSegmenter(incomplete=True).fit([take]).segment([take])
        tables.append(table[["start", "stop", "complete"]])
    pd.testing.assert_frame_equal(*tables)
    assert tables[0]["complete"].sum() >= 3


def test_first_component_reaches_its_share_of_the_variance(seed):
    turned, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(2, 2)))
    x = np.array([[3, 1], [3, -1], [-3, 1], [-3, -1]]) @ turned
    assert ASpace(0.9).fit([shaken(x, seed)]).n_components_ == 1


def test_median_of_equal_weights_is_the_lower_one_of_two(seed):
    assert weighted_median(np.arange(10.0), shaken(np.full(10, 0.1), seed)) == 4
