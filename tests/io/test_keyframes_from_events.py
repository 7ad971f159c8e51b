"""Events in tables and in attrs become key-frames."""

import numpy as np
import pandas as pd
import polars as pl
import pytest
from sklearn_motionsync import DenseSynchronizer, to_frame, to_trials
from sklearn_motionsync.datasets import make_gait
from sklearn_motionsync.io import cut_at_events, keyframes_from_events

LENGTHS = [101, 121, 91]
# Of (subject, trial): toe-off and knee flexed, in frames.
TRUTH = {("ann", 1): (62.0, 73.5), ("ann", 2): (75.25, np.nan), ("bob", 1): (np.nan, 66.0)}
NAMES = ["toe-off", "knee flexed"]


def trials(levels=("subject", "trial", "frame"), start=0, **attrs):
    out = []
    for label, n in zip(TRUTH, LENGTHS, strict=True):
        out.append(pd.DataFrame({"knee": np.zeros(n)}, index=pd.RangeIndex(start, start + n)))
        out[-1].attrs = {"trial": label, "levels": levels, **attrs}
    return out


def table(time="frame", scale=1.0, start=0, ids=int, event="event"):
    rows = [
        {"subject": who, "trial": ids(trial), event: name, time: (frame + start) * scale}
        for (who, trial), frames in TRUTH.items()
        for name, frame in zip(NAMES, frames, strict=True)
    ]
    return pd.DataFrame(rows).sample(frac=1, random_state=0)


def check(found):
    np.testing.assert_allclose(found.to_numpy(), list(TRUTH.values()), rtol=0, atol=1e-9)
    assert found.columns.tolist() == NAMES
    assert found.index.to_list() == list(TRUTH)


@pytest.mark.parametrize("time", ["frame", "Frame", " FRAMES "])
@pytest.mark.parametrize("ids", [int, str, float, np.int8])
def test_rows_of_any_order_and_ids_of_any_type(time, ids):
    # Frames count where times are given as well.
    check(keyframes_from_events(trials(), table(time, ids=ids).assign(time=1e6)))
    renamed = table(time, ids=ids, event="Label").rename(columns={"subject": "Subject"})
    check(keyframes_from_events(trials(), renamed))
    check(keyframes_from_events(trials(), renamed.set_index(["Subject", "trial"])))
    check(keyframes_from_events(trials(), pl.DataFrame(renamed.to_dict("list"))))
    check(keyframes_from_events(to_frame(trials()), renamed))


@pytest.mark.parametrize("time", ["seconds", "time", "Time (s)", "t"])
def test_seconds(time):
    X, events = trials(), table(time, 1 / 200)
    check(keyframes_from_events(X, events, frame_rate=200))
    check(keyframes_from_events(X, events, frame_rate=[200] * 3))
    check(keyframes_from_events(trials(frame_rate=200.0), events))
    with pytest.raises(ValueError, match="frame rate of"):
        keyframes_from_events(X, events)
    # As events of one recording are, of which the trials are parts.
    late = trials(frame_rate=200.0, first_time=3.0)
    check(keyframes_from_events(late, table(time, 1 / 200, start=600)))


def test_times_and_frames_are_those_of_the_index():
    late = trials(start=40)
    check(keyframes_from_events(late, table(start=40)))
    for x in late:
        x.index = pd.Index(x.index / 50, name="time")
    check(keyframes_from_events(late, table("seconds", 1 / 50, start=40)))
    # Made by the package, of a table of times.
    long = to_frame(late).reset_index()
    X = to_trials(long, by=["subject", "trial"], time="time")
    check(keyframes_from_events(X, table("seconds", 1 / 50, start=40)))


@pytest.mark.parametrize("make", [list, np.stack, lambda X: np.stack(X)[:, :, 0]])
def test_arrays_are_numbered(make):
    X = make([np.zeros((100, 1))] * 3)
    events = pd.DataFrame({"trial": [2, 0], "event": "apex", "frame": [40, 30.5]})
    found = keyframes_from_events(X, events)
    np.testing.assert_array_equal(found["apex"], [30.5, np.nan, 40])
    assert found.index.to_list() == [0, 1, 2]
    contexts = events.assign(context=["Left", None])
    assert set(keyframes_from_events(X, contexts).columns) == {("apex", "Left"), "apex"}


def test_names_choose_and_order():
    events = pd.concat([table(), table(event="event").assign(event="other", frame=np.arange(6))])
    found = keyframes_from_events(trials(), events, ["Toe-Off", "knee flexed"])
    check(found.set_axis(NAMES, axis=1))
    (only,) = keyframes_from_events(trials(), table(), ["knee flexed"]).columns
    assert only == "knee flexed"
    message = r"\('ann', 1\): event 'toe-off' in row 62 is not after 'kn"
    with pytest.raises(ValueError, match=message):
        keyframes_from_events(trials(), table(), NAMES[::-1])


def test_events_that_never_meet_are_in_order_of_their_share_of_the_trial():
    X = [np.zeros((1001, 1)), np.zeros((101, 1)), np.zeros((101, 1))]
    events = pd.DataFrame({"trial": [1, 0, 2], "event": ["late", "early", "mid"], "frame": 60})
    events.loc[1, "frame"], events.loc[2, "frame"] = 100, 40
    for rows in (events, events[::-1]):
        found = keyframes_from_events(X, rows)
        assert found.columns.tolist() == ["early", "mid", "late"]


def test_the_ends_are_left_out():
    ends = pd.DataFrame({"subject": "ann", "trial": 1, "event": "strike", "frame": [0.0, 100.3]})
    check(keyframes_from_events(trials(), pd.concat([table(), ends])))
    with pytest.raises(ValueError, match="No trial has the event 'strike' inside, after its first"):
        keyframes_from_events(trials(), pd.concat([table(), ends]), ["strike"])


def changed(column, value):
    """The table with one row changed: the toe-off of the first trial."""
    events = table().sort_index().astype({column: object})
    events.loc[0, column] = value
    return events


MORE = pd.DataFrame([("ann", 2, NAMES[1], 90.0)], columns=table().columns)
BAD = {
    "twice": (
        pd.concat([table(), changed("frame", 64.0)[:1]]),
        r"^Trial 0 \('ann', 1\): event 'toe-off' comes twice, in rows 6.* and 6",
    ),
    "outside": (changed("frame", 101), "^Trial 0 .*'toe-off' at 101 is outside.* 100"),
    "before": (changed("frame", -1), "'toe-off' at -1 is outside of it, from 0 to 100"),
    "unknown": (changed("trial", 7), r"trial \('ann', 7\) of event 'toe-off' is not in X"),
    "none known": (table().assign(subject="eve"), r"trial \('eve', .* is not in X, whose trials"),
    "order": (
        pd.concat([changed("frame", 80.0), MORE]),
        r"'ann', [12]\): event .* is not after .*Key-frames have one order, and one each at",
    ),
    "at once": (changed("frame", 73.5), "not after .* in row 73.5. Key-frames have one order, and"),
    "no event": (table().drop(columns="event"), r"no column event; there are .*events.melt\(\['su"),
    "no time": (table().drop(columns="frame"), "no column frame or seconds"),
    "no level": (table().drop(columns="trial"), "no column 'trial', a level of the labels of X"),
    "text": (changed("frame", "soon"), "events: column 'frame'"),
    "nothing": (table().assign(frame=np.nan), "No trial has an event"),
    "never": (changed("frame", -np.inf), r"events: row 0, .* \('frame'\) is infinity"),
    "a list": ([{"event": "x"}], "must be a DataFrame of pandas or polars, got list"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_tables_are_refused(name):
    events, message = BAD[name]
    with pytest.raises(ValueError, match=message):
        keyframes_from_events(trials(), events)


def test_bad_names_and_no_table_are_refused():
    with pytest.raises(ValueError, match=r"No trial has the event 'apex' .*; there are \['"):
        keyframes_from_events(trials(), table(), ["apex"])
    with pytest.raises(ValueError, match="each of names must be the label of an event"):
        keyframes_from_events(trials(), table(), [3])
    with pytest.raises(ValueError, match="No trial has an event: give a table"):
        keyframes_from_events(trials())


# -- events of recordings -------------------------------------------------------------------


@pytest.fixture(scope="module")
def gait_cycles():
    gait = make_gait(4, 3, takes=True, random_state=0)
    takes = [pd.DataFrame(x, columns=gait.feature_names) for x in gait.data]
    for take, events, person in zip(takes, gait.events, gait.person, strict=True):
        take.attrs = {"events": events, "frame_rate": gait.frame_rate, "trial": person}
    return gait, takes, [x for take in takes for x in cut_at_events(take, "Foot Strike")]


def test_events_of_cut_cycles(gait_cycles):
    gait, takes, cycles = gait_cycles
    found = keyframes_from_events(cycles)
    assert found.columns.tolist() == [("Foot Off", "Right")]
    # The true toe-offs, by the key-frames of the takes.
    is_toe_off = [name.startswith("toe-off") for name in gait.keyframe_names]
    truth = gait.keyframes[:, is_toe_off].ravel() - [x.attrs["rows"][0] for x in cycles]
    np.testing.assert_allclose(found.to_numpy()[:, 0], truth, atol=1e-4)
    assert found.index.to_list() == [x.attrs["trial"] for x in cycles]
    named = keyframes_from_events(cycles, names=["foot off"])
    np.testing.assert_array_equal(named["foot off"], found["Foot Off", "Right"])
    with pytest.raises(ValueError, match=r"'Right'\) comes twice, in rows .* by cut_at_events"):
        keyframes_from_events(takes)
    with pytest.raises(ValueError, match="Trial 0: by its index row 0 is frame 5 of the rec"):
        keyframes_from_events([cycles[0].iloc[5:]])
    sync = DenseSynchronizer(60).fit(cycles, keyframes=found)
    own = truth * 59 / (np.array([len(x) for x in cycles]) - 1)
    times = sync.match(cycles, keyframes=found).times
    met = [np.interp(sync.keyframes_[0], np.arange(60), tau) for tau in times]
    np.testing.assert_allclose(met, own, atol=1e-3)
