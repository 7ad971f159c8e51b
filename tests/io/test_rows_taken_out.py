"""Recordings of which rows were taken out: the same frames are cut, or they are refused."""

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import to_trials
from sklearn_motionsync.io import cut_at_events, fill_gaps

RATE = 120.0
SEEDS = range(4)


def recording(rng):
    """The column "number" holds the frame, "number" of an event its true one."""
    n_frames = int(rng.integers(40, 300))
    df = pd.DataFrame({"number": np.arange(float(n_frames)), "knee": rng.normal(size=n_frames)})
    df.index = pd.RangeIndex(n_frames, name=rng.choice(["frame", None]))
    at = np.sort(rng.uniform(-20, n_frames + 20, int(rng.integers(3, 12)))).round(2)
    df.attrs = {
        "events": [
            {"label": label, "context": None, "frame": float(x), "number": float(x)}
            for x, label in zip(at, rng.choice(["Strike", "Strike", "Off"], len(at)), strict=True)
        ],
        "frame_rate": RATE,
        "first_time": 2.0,
        "first_frame": 101,
    }
    df.attrs["events"][0]["label"] = "Strike"
    if rng.random() < 0.3:
        seconds = 2 + np.cumsum(rng.uniform(0.005, 0.01, n_frames))
        df.attrs |= {"times": seconds.tolist(), "frame_rate": None}
    return df


def check_attrs(part, whole, step=1):
    """Events, times and frame rate of a trial are those of its rows."""
    numbers = part["number"].to_numpy()
    for event in part.attrs["events"]:
        assert np.interp(event["frame"], np.arange(len(part)), numbers) == pytest.approx(
            event["number"], abs=1e-4
        )
    if "times" in whole.attrs:
        seconds = np.array(whole.attrs["times"])[numbers.astype(int)]
        assert part.attrs.get("times", seconds) == pytest.approx(seconds, abs=1e-9)
        assert part.attrs["first_time"] == pytest.approx(seconds[0], abs=1e-9)
    else:
        assert part.attrs["frame_rate"] == RATE / step
        assert part.attrs["first_time"] == pytest.approx(2 + numbers[0] / RATE)


@pytest.mark.parametrize("seed", SEEDS)
def test_every_kth_frame_is_cut_next_to_the_events(seed):
    rng = np.random.default_rng(seed)
    df = recording(rng)
    k, start = int(rng.integers(2, 11)), int(rng.integers(0, 9))
    some = df.iloc[start::k]
    places = [e["number"] for e in df.attrs["events"] if e["label"] == "Strike"]
    rows = [int(np.floor((x - start) / k + 0.5)) for x in places]
    # The last of several strikes next to one row, and the next strike.
    pairs = [(a, b) for a, b in pairwise(rows) if a < b]
    expected = [some["number"].iloc[a : b + 1] for a, b in pairs if a >= 0 and b < len(some)]
    found = cut_at_events(some, "Strike")
    for part, numbers in zip(found, expected, strict=True):
        assert part["number"].tolist() == numbers.tolist()
        assert part.attrs["rows"] == numbers.iloc[[0, -1]].tolist()
        assert min(abs(numbers.iloc[0] - x) for x in places) <= k / 2
        check_attrs(part, df, k)


@pytest.mark.parametrize("seed", SEEDS)
def test_rows_that_were_dropped_are_not_bridged(seed):
    rng = np.random.default_rng(seed)
    df = recording(rng)
    lost = rng.choice(len(df), int(rng.integers(1, 4)), replace=False)
    ends = np.r_[: int(rng.integers(0, 9)), len(df) - int(rng.integers(0, 9)) : len(df)]
    df.loc[np.r_[lost, ends], "knee"] = np.nan
    some = df.dropna()
    last = some["number"].max()
    whole = [
        part
        for part in cut_at_events(df, "Strike")
        if some["number"].min() <= part["number"].min() and part["number"].max() <= last
    ]
    if any(part["knee"].isna().any() for part in whole):
        with pytest.raises(ValueError, match=r"no row of frame .*Cut the recording before rows"):
            cut_at_events(some, "Strike")
        return
    found = cut_at_events(some, "Strike")
    assert [part["number"].tolist() for part in found] == [p["number"].tolist() for p in whole]
    for part in found:
        check_attrs(part, df)


@pytest.mark.parametrize("order", ["reversed", "shuffled"])
def test_rows_in_another_order_are_refused(order):
    rng = np.random.default_rng(0)
    df = recording(rng)
    assert cut_at_events(df.iloc[:0], "Strike") == []
    other = df.iloc[::-1] if order == "reversed" else df.iloc[rng.permutation(len(df))]
    with pytest.raises(ValueError, match=r"not in order of time: frame .*sort_index"):
        cut_at_events(other, "Strike")


def test_an_index_that_does_not_tell_frames_is_refused():
    """Which does not, tests/inputs/test_recorded.py tries."""
    df = pd.DataFrame({"number": np.arange(60.0)}, index=pd.date_range("2020", periods=60))
    df.attrs["events"] = [{"label": "Strike", "frame": x} for x in (9, 30)]
    with pytest.raises(ValueError, match=r"does not tell which frames .* df.reset_index"):
        cut_at_events(df, "Strike")
    (part,) = cut_at_events(df.reset_index(drop=True), "Strike")
    assert part.attrs["rows"] == [9, 30]
    (x,) = to_trials(df.assign(trial=0), by="trial")
    assert "events" not in x.attrs


@pytest.mark.parametrize("seed", range(4))
def test_gaps_are_filled_where_frames_are_in_time(seed):
    rng = np.random.default_rng(seed)
    t = np.arange(200.0)
    whole = pd.DataFrame({f"knee_{axis}": np.sin(t / 20 + i) for i, axis in enumerate("xyz")})
    gap = int(rng.integers(30, 150))
    df = whole.copy()
    df.iloc[gap : gap + 6] = np.nan
    lost = np.r_[gap - 4 : gap - 1, gap + 2 : gap + 4]
    error = (fill_gaps(df.drop(index=lost), 6) - whole.drop(index=lost)).abs().max(axis=None)
    assert error < 2e-3
    pd.testing.assert_frame_equal(fill_gaps(df.iloc[::-1], 6).iloc[::-1], fill_gaps(df, 6))
    pd.testing.assert_frame_equal(fill_gaps(df.iloc[7:], 6), fill_gaps(df, 6).iloc[7:])
    # Six frames are missing, of which two have no row.
    assert fill_gaps(df.drop(index=lost), 5).isna().any(axis=None)
    with pytest.raises(ValueError, match="not in order of time"):
        fill_gaps(df.iloc[rng.permutation(200)], 6)
