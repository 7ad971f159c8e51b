"""Tables to trials with labels, in order of an even time, and back."""

import datetime as dt
import io
import pickle

import numpy as np
import pandas as pd
import polars as pl
import pytest
from IPython.core.formatters import HTMLFormatter
from sklearn.base import clone
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionDetector,
    ActionModel,
    ASpace,
    DenseSynchronizer,
    LinearSynchronizer,
    to_frame,
    to_trials,
)
from sklearn_motionsync.model import find_departures
from sklearn_motionsync.takes import CycleSegmenter

KEYS = ["subject", "trial"]


def walk(time, trial=0):
    return {"knee": np.sin(4 * time + 0.1 * trial), "hip": np.cos(3 * time)}


def trial_of(subject, k, time):
    return pd.DataFrame({"subject": subject, "trial": k, "time": time, **walk(time, k)})


@pytest.fixture
def table():
    """Three subjects, two trials each, all rows mixed."""
    rng = np.random.default_rng(0)
    parts = [
        trial_of(subject, k, np.arange(rng.integers(30, 40)) / 50)
        for subject in ("cem", "ann", "bob")
        for k in (2, 1)
    ]
    return pd.concat(parts, ignore_index=True).sample(frac=1, random_state=0, ignore_index=True)


@pytest.fixture
def walks(table):
    return to_trials(table, by=KEYS, time="time")


def labels_of(table):
    return list(table.index.droplevel(-1).unique())


# -- keys, labels, levels --------------------------------------------------------------------


@pytest.mark.parametrize("levels", [[], ["subject"], ["trial", "time"], [*KEYS, "time"]])
def test_the_time_puts_frames_in_order_and_keys_name_trials(table, levels):
    df = table.set_index(levels) if levels else table
    found = to_trials(df, by=KEYS, time="time")
    keys = list(table[KEYS].drop_duplicates().itertuples(index=False, name=None))
    assert [x.attrs["trial"] for x in found] == keys
    for x, (subject, k) in zip(found, keys, strict=True):
        rows = table[(table["subject"] == subject) & (table["trial"] == k)].sort_values("time")
        pd.testing.assert_frame_equal(x, rows.set_index("time")[["knee", "hip"]])
        assert x.attrs["levels"] == ("subject", "trial", "time")
        assert not x.attrs["resampled"]


def test_labels_given_to_a_frame_name_their_levels(walks):
    some = walks[:2]
    assert to_frame(some, trials=["a", "b"]).index.names == ["trial", "time"]
    tuples = [("x", 1), ("x", 2)]
    assert to_frame(some, trials=tuples).index.nlevels == 2
    index = pd.MultiIndex.from_tuples(tuples, names=["subject", "take"])
    assert to_frame(some, trials=index).index.names == ["subject", "take", "time"]
    assert to_frame(some, trials=pd.Index([4, 5], name="take")).index.names[0] == "take"
    bare = to_frame([x.to_numpy() for x in some], trials=some)
    assert bare.index.names == [*KEYS, "frame"]


@pytest.mark.parametrize("names", [["subject", "day", "trial", "t"], [None] * 4])
def test_pandas_outputs_have_the_levels_of_the_table(names):
    """Any number of them, named or not, of the table and of the list of its trials."""
    index = pd.MultiIndex.from_product([["a", "b"], [1], ["x", "y"], range(5)], names=names)
    df = pd.DataFrame({"knee": np.sin(np.arange(20.0)), "hip": np.arange(20.0) ** 2}, index=index)
    expected = [("a", 1, "x"), ("a", 1, "y"), ("b", 1, "x"), ("b", 1, "y")]
    levels = ["level_0", "level_1", "level_2", "frame"] if names[0] is None else names
    for X in (df, to_trials(df)):
        poses = ASpace(2).set_output(transform="pandas").fit_transform(X)
        assert (labels_of(poses), poses.index.names) == (expected, levels)
        for sync in (LinearSynchronizer(4), make_pipeline(ASpace(2), DenseSynchronizer(4))):
            out = sync.set_output(transform="pandas").fit_transform(X)
            assert (labels_of(out), out.index.names) == (expected, [*levels[:3], "frame"])
            assert out.loc["a"].loc[1].loc["y"].index.tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize(
    "attrs", [{"trial": "a"}, {"trial": ["a"]}, {"trial": "a", "levels": 3}, {}]
)
def test_attrs_that_come_twice_or_of_other_kinds_are_no_labels(attrs):
    x = pd.DataFrame({"knee": [0.0, 1.0]})
    y = x.copy()
    x.attrs, y.attrs = attrs, {"trial": "a"}
    assert to_frame([x, y]).index.unique(0).tolist() == [0, 1]


def test_messages_name_the_label(walks):
    bad = [x.copy() for x in walks]
    label = bad[3].attrs["trial"]
    bad[3].iloc[4, 1] = np.inf
    for X in (bad, to_frame(bad)):
        with pytest.raises(ValueError, match="is infinity") as caught:
            ASpace().fit(X)
        where = f"Trial 3 {label!r}, frame 4 (0.08), feature 1 ('hip')"
        assert str(caught.value).startswith(where)


@pytest.mark.parametrize("as_table", [False, True])
def test_departures_carry_the_label(walks, as_table):
    """Also behind steps that give arrays."""
    moved = [x.copy() for x in walks]
    moved[1].iloc[10:15] += 5
    X, given = (to_frame(x) if as_table else x for x in (walks, moved))
    model = make_pipeline(ASpace(2), LinearSynchronizer(30), ActionModel()).fit(X)
    found = find_departures(model, given)
    assert set(found.loc[found["rare"], "trial"]) == {moved[1].attrs["trial"]}
    report = ActionDetector(clone(model)).fit(X).report(given)
    assert report.index.names == KEYS
    assert report.index.tolist() == [x.attrs["trial"] for x in walks]


# -- times ----------------------------------------------------------------------------------


def test_uneven_times_are_resampled_on_straight_lines():
    rng = np.random.default_rng(0)
    time = np.arange(60) / 50 + rng.uniform(-0.009, 0.009, 60)
    (x,) = to_trials(trial_of("a", 1, time), by=KEYS, time="time")
    assert x.attrs["resampled"]
    assert (x.index[0], x.index[-1]) == (time[0], time[-1])
    steps = np.diff(x.index)
    np.testing.assert_allclose(steps, steps[0], rtol=1e-9)
    np.testing.assert_allclose(steps[0], np.median(np.diff(time)), rtol=0.02)
    for name, curve in walk(time, 1).items():
        np.testing.assert_allclose(x[name], np.interp(x.index, time, curve), rtol=1e-12)
        np.testing.assert_allclose(x[name], walk(x.index.to_numpy(), 1)[name], atol=2e-3)


@pytest.mark.parametrize(
    ("time", "rate"),
    [
        (np.round(np.arange(400) / 60, 3), 60),
        (1000 * np.round(np.arange(400) / 120, 3), 0.12),
        (np.round(np.arange(400) / 30, 2), 30),
        (np.round(np.arange(30) / 48, 2), 48),
        (np.round(4 + np.arange(200) / 51.2, 2), 51.2),
        (np.round(17.3 + np.arange(300) / 90, 2), 90),
        (np.round(np.arange(480) / 240, 3), 240),
        ((np.arange(6000) / 60).astype("f4"), 60),
    ],
    ids=lambda value: f"{np.size(value)} {value}"[:9],
)
def test_rounded_times_are_even(time, rate):
    """Of a recording whose times have few digits every number is kept."""
    df = pd.DataFrame({"t": time, "x": np.sin(time.astype(float))})
    for frame_rate in (None, rate):
        (x,) = to_trials(df, time="t", frame_rate=frame_rate)
        np.testing.assert_array_equal(x["x"], df["x"])
        assert not x.attrs["resampled"]


@pytest.mark.parametrize("lost", [[30], [20, 40], [15, 30, 45]])
@pytest.mark.parametrize(("rate", "digits"), [(60, 2), (100, 2), (240, 3)])
def test_lost_frames_are_no_rounding(rate, digits, lost):
    time = np.delete(np.round(np.arange(60) / rate, digits), lost)
    (x,) = to_trials(pd.DataFrame({"t": time, "x": time}), time="t", max_gap_time=3 / rate)
    assert x.attrs["resampled"]


@pytest.mark.parametrize("rate", [25, 100, 30])
def test_a_frame_rate_is_given(rate):
    time = np.arange(51) / 50
    (x,) = to_trials(pd.DataFrame({"t": time, "x": time**2}), time="t", frame_rate=rate)
    np.testing.assert_allclose(x.index, np.arange(rate + 1) / rate, atol=1e-12)
    np.testing.assert_allclose(x["x"], np.interp(x.index, time, time**2))


def test_gaps_are_bridged_up_to_a_size_that_the_message_tells():
    time = np.delete(np.arange(20.0), [4, 10, 11])
    df = pd.DataFrame({"t": time, "x": time, "k": "a"})
    for max_gap_time in (None, 2):
        with pytest.raises(ValueError, match=r"'a' has a gap from 9 to 12.*max_gap_time=3,"):
            to_trials(df, by="k", time="t", max_gap_time=max_gap_time)
    (x,) = to_trials(df, by="k", time="t", max_gap_time=3)
    assert x["x"].tolist() == x.index.tolist() == list(range(20))
    rng = np.random.default_rng(1)
    for _ in range(20):
        time = np.cumsum(rng.exponential(size=30)) * 10.0 ** rng.integers(-6, 6)
        df = pd.DataFrame({"t": time, "x": time})
        with pytest.raises(ValueError, match="max_gap_time") as caught:
            to_trials(df, time="t")
        gap = float(str(caught.value).split("max_gap_time=")[1].split(",")[0])
        assert to_trials(df, time="t", max_gap_time=gap)


def test_dates_and_durations_become_seconds():
    seconds = np.arange(10) / 4
    start = pd.Timestamp("2020-03-29 01:59:59", tz="Europe/Vienna")  # clocks go forward then
    stamps = start + pd.to_timedelta(seconds, unit="s")
    for time in (
        stamps,
        stamps.tz_convert(None),
        stamps.tz_convert(None).to_pydatetime(),
        pd.to_timedelta(seconds, unit="s"),
        pd.to_timedelta(seconds, unit="s").to_pytimedelta(),
    ):
        df = pd.DataFrame({"t": time, "x": seconds}).iloc[::-1]
        (x,) = to_trials(df, time="t")
        assert x.index.tolist() == x["x"].tolist() == seconds.tolist()


def test_gaps_in_features_stay_gaps():
    time = np.r_[0:5, 5.3, 6:10]
    df = pd.DataFrame({"t": time, "x": time, "y": 2 * time}).astype({"y": np.float32})
    df.loc[2, "x"] = np.nan
    (x,) = to_trials(df, time="t")
    assert x["x"].isna().any()
    assert not x["y"].isna().any()
    assert (x["x"].dtype, x["y"].dtype) == (np.float64, np.float32)
    with pytest.raises(ValueError, match=r"'x'.* is NaN"):
        CycleSegmenter().fit([x])


def test_a_time_among_the_levels_goes_with_the_others(table, walks):
    indexed = table.set_index([*KEYS, "time"])
    for df in (indexed, indexed.reset_index("time").set_index("hip", append=True)):
        for x, y in zip(to_trials(df, time="time"), walks, strict=True):
            pd.testing.assert_frame_equal(x[["knee"]], y[["knee"]])
    one = table[table["subject"] == "ann"].set_index("trial").drop(columns="subject")
    assert [x.attrs["trial"] for x in to_trials(one, time="time")] == [1, 2]


def test_levels_of_a_wide_file_are_keys():
    """pandas keeps every column that it reads apart, and warns when one more is inserted."""
    text = pd.DataFrame(np.random.default_rng(0).random((9, 120))).to_csv()
    read = {name: pd.read_csv(io.StringIO(text), index_col=0) for name in "ab"}
    found = to_trials(pd.concat(read, names=["trial", "t"]), time="t")
    assert [(x.attrs["trial"], x.shape) for x in found] == [("a", (9, 120)), ("b", (9, 120))]


# -- clock and events of a recording ------------------------------------------------------------

CLOCK = {"frame_rate": None, "first_time": 2.0, "units": "deg"}


def recording(seconds, **facts):
    df = pd.DataFrame({"knee": seconds})
    df.attrs = CLOCK | facts
    return df


def events_at(*frames):
    return [{"label": "Foot Strike", "frame": frame} for frame in frames]


def test_a_recording_of_one_trial_keeps_its_name():
    df = pd.DataFrame({"t": np.arange(9)[::-1] / 10, "x": range(9)})
    for attrs, label, levels in (
        ({}, 0, ("trial", "t")),
        ({"trial": "walk1", "levels": ["recording", "frame"]}, "walk1", ("recording", "t")),
    ):
        df.attrs = attrs
        trials = to_trials(df, time="t")
        assert trials[0]["x"].tolist() == list(range(8, -1, -1))
        assert (trials[0].attrs["trial"], trials[0].attrs["levels"]) == (label, levels)
        assert trials.labels.to_dict("list") == {levels[0]: [label]}


def test_uneven_times_that_were_made_even_are_a_frame_rate():
    seconds = 2 + np.delete(np.arange(101) / 100, [3, 50])
    df = recording(seconds, times=seconds.tolist(), events=events_at(2.0, 48.5, None))
    for time in (seconds, seconds - 2, 1000 * seconds, pd.to_timedelta(seconds, unit="s")):
        (x,) = to_trials(df.assign(time=time), time="time", max_gap_time=1e5)
        assert x.attrs["frame_rate"] == 100
        assert x.attrs["first_time"] == 2
        assert "times" not in x.attrs
        # The event stays at its time: one missing frame came before, the other is bridged.
        assert [e["frame"] for e in x.attrs["events"]] == pytest.approx([2, 50, None], abs=0.1)
    assert df.attrs["times"] == seconds.tolist()
    assert df.attrs["events"] == events_at(2.0, 48.5, None)


@pytest.mark.parametrize("time", [None, "frame"])
def test_parts_of_a_recording_have_their_own_times(time):
    seconds = 2 + np.cumsum([0, 1, 3, 1, 1, 2, 1, 1, 1, 4]) / 10
    df = recording(seconds, times=seconds.tolist(), events=events_at(1.5, 6.0), first_frame=7)
    df = df.assign(cycle=[0] * 4 + [1] * 6, frame=range(10))
    first, second = to_trials(df, by="cycle", time=time)
    assert first.attrs["times"] == seconds[:4].tolist()
    assert second.attrs["times"] == seconds[4:].tolist()
    assert [x.attrs["first_time"] for x in (first, second)] == [2, seconds[4]]
    assert [x.attrs["events"] for x in (first, second)] == [events_at(1.5), events_at(2.0)]
    assert first.attrs["first_frame"] == 7
    assert second.attrs["first_frame"] == 11


def test_events_stay_at_their_times_between_and_beyond_uneven_frames():
    """On a straight line between frames, and at the mean step beyond them."""
    seconds = 2 + np.cumsum(np.random.default_rng(0).uniform(0.009, 0.016, 40))
    frames = np.array([-7.0, 0.0, 16.9, 39.0, 55.0])
    df = recording(seconds, times=seconds.tolist(), events=events_at(*frames))
    (x,) = to_trials(df.assign(t=seconds), time="t")
    assert x.attrs["resampled"]
    times = np.interp(frames, np.arange(40), seconds)
    times += (frames - frames.clip(0, 39)) * (seconds[-1] - seconds[0]) / 39
    expected = (times - seconds[0]) / (x.index[1] - x.index[0])
    assert [event["frame"] for event in x.attrs["events"]] == pytest.approx(expected, abs=1e-4)


def test_a_trial_of_one_row_has_a_clock():
    df = pd.DataFrame({"k": ["a", "a", "b"], "t": [0.0, 0.5, 3.0], "knee": [1.0, 2, 3]})
    found = to_trials(df, by="k", time="t")
    assert [x.attrs["clock"] for x in found] == [(0.0, 0.5), (3.0, 1.0)]


def test_levels_without_a_name_have_a_number():
    index = pd.MultiIndex.from_product([["a", "b"], range(4)])
    df = pd.DataFrame({"t": [0.0, 1, 2, 3] * 2, "knee": np.arange(8.0)}, index=index)
    for given in ({"by": "trial"}, {"by": ["trial"], "time": "t"}, {"time": "t"}):
        found = to_trials(df, **given)
        assert found[0].attrs["levels"][0] == "trial"
        assert found.labels.to_dict("list") == {"trial": ["a", "b"]}


# -- errors -----------------------------------------------------------------------------------

BY = {"by": KEYS, "time": "time"}


def put(column, value, row=3):
    def change(df):
        df = df.astype({column: object})
        df.loc[row, column] = value
        return df

    return change


CALL = "to_trials(df, by=..., time=...)"
REFUSED = [
    # change of the table, arguments, words
    (put("subject", None), BY, ["'subject'", "1 of", "row 3", "Drop these rows"]),
    (put("time", np.nan), BY, ["time of trial", "row 3", "df.dropna(subset=['time'])"]),
    (put("time", np.inf), BY, ["infinite", "row 3"]),
    (lambda df: pd.concat([df, df[:1]]), BY, ["twice", "drop_duplicates", "spikes, become rates"]),
    (lambda df: df, {"by": "subject", "time": "time"}, ["twice", "the first is 0", "by="]),
    (lambda df: df.drop(columns=KEYS), {"time": "time"}, ["twice", "by="]),
    (
        lambda df: df.drop(index=df.index[df["time"] == 0.1]),
        BY,
        ["a gap from 0.08 to 0.12", "such as spikes, become rates first"],
    ),
    (lambda df: df.assign(group="young"), BY, ["column 'group'", CALL, "that name the trial"]),
    (lambda df: df.assign(day=pd.Timestamp(0)), BY, ["column 'day'", "dates"]),
    (lambda df: df.astype({"time": str}), BY, ["text", "pd.to_datetime"]),
    (lambda df: df.assign(knee="0,5"), BY, ["'knee'", "'0,5'", "decimal=','"]),
    (lambda df: df.assign(time=dt.time(0, 1)), BY, ["time of trial", "durations (time)"]),
    (lambda df: df[:0], BY, ["no rows"]),
    (lambda df: df, {"by": ["subject", "take"]}, ["['take']", "'trial'", CALL]),
    (lambda df: df, {"by": []}, ["no column", CALL]),
    (lambda df: df.drop(columns="time"), {"by": KEYS, "time": "frame"}, ["['frame']", "levels []"]),
    (lambda df: df, {"by": "trial", "time": "trial"}, ["different"]),
    (lambda df: df.rename(columns={"hip": "subject"}), BY, ["by=['subject', 'trial']", "once"]),
    (lambda df: df, {"by": [*KEYS, "time"]}, ["of one row each", CALL]),
    (lambda df: df, {**BY, "max_gap_time": 0}, ["max_gap_time must be a number above 0", "got 0"]),
    (lambda df: df, {**BY, "frame_rate": "fast"}, ["frame_rate", "'fast'"]),
    (lambda df: df, {**BY, "frame_rate": 1e9}, ["frame_rate=1e+09", "frames from 0 to", "units"]),
    (lambda df: df, {**BY, "frame_rate": 0.1}, ["frame_rate=0.1", "units"]),
    (lambda df: df, {"by": KEYS, "max_gap_time": 2}, ["max_gap_time=2", "time="]),
    (lambda df: df, {}, ["index of 1 level(s)", CALL]),
    (lambda df: df.set_index([*KEYS, "time"]), {}, ["do not increase", CALL]),
    (lambda df: pd.concat([df, df]).set_index([*KEYS, "time"]).sort_index(), {}, ["come twice"]),
    (lambda df: df.to_numpy(), {}, ["got ndarray", "Several tables make one: pd.concat(tables"]),
    (lambda df: put("subject", None)(df).set_index([*KEYS, "time"]), {}, ["'subject' is missing"]),
    (lambda df: pl.DataFrame(df.to_dict("list")).lazy(), BY, ["LazyFrame", "df.collect()"]),
]


@pytest.mark.parametrize("time", ["time", "frame"])
def test_index_with_the_frame_first_is_refused(time):
    wide = pd.DataFrame({time: np.arange(30), "knee_1": np.ones(30), "knee_2": np.zeros(30)})
    long = pd.wide_to_long(wide, ["knee"], i=time, j="trial", sep="_")
    for take in (to_trials, ASpace().fit, DenseSynchronizer().fit):
        with pytest.raises(ValueError, match=rf"the frame in its last level, and '{time}' is"):
            take(long)
    assert [len(x) for x in to_trials(long, by=["trial"], time=time)] == [30, 30]


@pytest.mark.parametrize(("change", "given", "words"), REFUSED, ids=range(len(REFUSED)))
def test_to_trials_refuses(table, change, given, words):
    with pytest.raises((TypeError, ValueError)) as caught:
        to_trials(change(table), **given)
    assert [word for word in words if word not in str(caught.value)] == [], str(caught.value)
    assert len(str(caught.value)) < 1000


# -- polars ---------------------------------------------------------------------------------


def test_polars_tables_give_the_same(table, walks):
    found = to_trials(pl.DataFrame(table.to_dict("list")), **BY)
    for x, y in zip(found, walks, strict=True):
        pd.testing.assert_frame_equal(x, y)
        assert x.attrs == y.attrs


def test_lists_of_polars_frames_are_trials(walks):
    X = [pl.DataFrame(x.to_dict("list")) for x in walks]
    sync = DenseSynchronizer(20).fit(X)
    np.testing.assert_array_equal(sync.transform(X), DenseSynchronizer(20).fit_transform(walks))
    assert list(to_frame(X).columns) == sync.feature_names_in_.tolist() == ["knee", "hip"]
    with pytest.raises(ValueError, match=r"df\.collect\(\)"):
        sync.fit([x.lazy() for x in X])
    # Of one table the rows are no trials.
    with pytest.raises(ValueError, match=r"to_trials\(df, by=..., time=...\)"):
        sync.fit(X[0])


def test_polars_dates_and_missing_values():
    seconds = np.arange(5)
    df = pl.DataFrame(
        {"subject": ["a"] * 5, "t": (seconds * 1000).astype("M8[ms]"), "x": [1, 2, None, 4, 5]},
        schema_overrides={"subject": pl.Categorical},
    )
    (x,) = to_trials(df, by="subject", time="t")
    assert x.index.tolist() == seconds.tolist()
    assert x["x"].isna().tolist() == [False, False, True, False, False]


# -- other tables ---------------------------------------------------------------------------


def test_a_level_named_frame_may_tell_trials_apart():
    """Rows are then numbered under another name, and the way there and back keeps both."""
    df = pd.DataFrame({"frame": [1, 1, 2, 2, 2], "knee": np.arange(5.0)})
    found = to_trials(df, by="frame")
    out = to_frame(found)
    assert out.index.names == ["frame", "row"]
    assert out.index.tolist() == [(1, 0), (1, 1), (2, 0), (2, 1), (2, 2)]
    assert to_frame(to_trials(out)).equals(out)


def test_an_index_of_uneven_times_is_warned_of():
    times = np.delete(np.arange(20) / 50, [7, 8, 9])
    x = pd.DataFrame({"knee": np.sin(9 * times)}, index=pd.Index(times, name="time"))
    df = pd.concat({"ann": x.iloc[:7], "bob": x}, names=["subject"])
    words = (
        r"'bob'.*, level 'time' .*: from 0.12 to 0.2 it is 0.08, mostly 0.02.*time='time'\) makes"
    )
    with pytest.warns(UserWarning, match=words):
        to_trials(df)
    # No warning of even times, or of times that were made even.
    assert len(to_trials(df.loc[["ann"]])) == 1
    assert len(to_trials(to_frame(to_trials(df, time="time", max_gap_time=0.1)))) == 2


# -- text as files of tables have it ----------------------------------------------------------


def exported(i, header="time,knee,hip\ns,deg,deg\n", **how):
    """A file as programs export it, with a row of units below the names."""
    lines = [f"{k / 50},{np.sin(k / 9 + i):.4f},{np.cos(k / 7 + i):.4f}\n" for k in range(40)]
    return pd.read_csv(io.StringIO(header + "".join(lines)), **how)


UNITS = r"got str, '(s|deg)'\. Give numbers: .* skiprows=\[1\] leaves out a row of units"
BY_TRIAL = {"by": "trial", "time": "time"}
OF_UNITS = {
    "arrays of tables": lambda files: DenseSynchronizer().fit([df.to_numpy() for df in files]),
    "list of tables": lambda files: ASpace().fit(files),
    "one file": lambda files: to_trials(files[0], time="time"),
    "several in one": lambda files: to_trials(
        pd.concat([df.assign(trial=i) for i, df in enumerate(files)], ignore_index=True), **BY_TRIAL
    ),
    "polars": lambda files: to_trials(pl.DataFrame(files[0].to_dict("list")), time="time"),
}


@pytest.mark.parametrize("way", OF_UNITS)
def test_a_row_of_units_is_told_of(way):
    with pytest.raises(ValueError, match=UNITS) as caught:
        OF_UNITS[way]([exported(i) for i in range(3)])
    assert "read_motion" not in str(caught.value)
    assert len(to_trials(exported(0, skiprows=[1]), time="time")[0]) == 40


@pytest.mark.parametrize(
    "column",
    [
        ["-", "-", *["0.5"] * 38],
        ["0.5", "deg", *["0.5"] * 38],
        ["deg", *["0,5"] * 39],
        ["n", "0.5", "0.7", "m", *["0.5"] * 36],
        [f"step {k}" for k in range(40)],
    ],
    ids=lambda column: "_".join(column[:4]),
)
def test_other_text_is_told_of(column):
    df = exported(0, skiprows=[1]).assign(knee=column)
    with pytest.raises(ValueError, match="column 'knee'") as caught:
        to_trials(df, time="time")
    assert "pd.to_numeric" in str(caught.value)
    assert "read_motion" not in str(caught.value)


@pytest.mark.parametrize("values", ["walk one", ["left", "right"] * 20, [None, "fast"] * 20])
def test_a_label_that_is_no_feature_is_told_of(values):
    files = [exported(i, skiprows=[1]).assign(note=values) for i in range(3)]
    said = r"column 'note',.*to_trials\(df, by=..., time=...\) takes columns that name the trial"
    for refused in (DenseSynchronizer().fit, ASpace().fit):
        with pytest.raises(ValueError, match=said):
            refused(files)
    with pytest.raises(ValueError, match=said):
        to_trials(pd.concat(files), time="time")


# -- labels beside the trials ---------------------------------------------------------------


def test_labels_stay_with_slices_and_choices():
    rows = [("b", "ann", 1), ("b", "ann", 2), ("a", "bob", 1), ("a", "cy", 3)]
    table = pd.DataFrame(rows, columns=["group", "subject", "trial"]).loc[np.repeat(range(4), 3)]
    table["time"], table["knee"] = np.tile([0.0, 0.1, 0.2], 4), np.arange(12.0)
    keys = ["group", "subject", "trial"]
    trials = to_trials(table, by=keys, time="time")
    assert isinstance(trials, list)
    assert list(trials.labels.itertuples(index=False, name=None)) == rows
    for some, expected in (
        (trials[1:3], [1, 2]),
        (trials[trials.labels["group"] == "a"], [2, 3]),
        (trials[[3, 0]], [3, 0]),
        (pickle.loads(pickle.dumps(trials)), [0, 1, 2, 3]),
    ):
        assert [tuple(row) for row in some.labels.to_numpy()] == [rows[i] for i in expected]
        for x, i in zip(some, expected, strict=True):
            pd.testing.assert_frame_equal(x, trials[i])
    assert trials[-1] is trials[3]
    shown = HTMLFormatter()(trials)
    assert "n_frames" in shown
    assert "<td>bob</td>" in shown
