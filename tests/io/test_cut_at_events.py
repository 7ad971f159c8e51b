"""cut_at_events: bounds, attrs and labels of trials, and errors."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import to_frame
from sklearn_motionsync.io import cut_at_events

STRIKE, OFF, LEFT = "Foot Strike", "Foot Off", ("Foot Strike", "Left")


def recording(*events, n_frames=200, **attrs):
    """The values are the numbers of the rows; events are (label, context, frame)."""
    df = pd.DataFrame({"row": np.arange(float(n_frames))})
    keys = "label", "context", "frame"
    df.attrs = {"events": [dict(zip(keys, event, strict=True)) for event in events]} | attrs
    return df


WALK = (
    (STRIKE, "Left", -20.0),
    (OFF, "Right", -5.0),
    (STRIKE, "Right", 5.5),
    (STRIKE, "Left", 20.4),
    (OFF, "Right", 31.25),
    (STRIKE, "Right", 55.0),
    (OFF, "Left", 66.0),
    (STRIKE, "Left", 90.5),
    (STRIKE, "Right", 131.0),
    (STRIKE, "Left", 160.6),
    (STRIKE, "Right", 200.0),
    ("General", None, 250.0),
)


def rows(parts):
    assert all(x.attrs["rows"] == [x["row"].iloc[0], x["row"].iloc[-1]] for x in parts)
    return [x.attrs["rows"] for x in parts]


@pytest.mark.parametrize(
    ("start", "stop", "expected"),
    [
        (LEFT, None, [[20, 91], [91, 161]]),
        (("foot strike ", "LEFT"), None, [[20, 91], [91, 161]]),
        (list(LEFT), LEFT, [[20, 91], [91, 161]]),
        ((STRIKE, "Right"), None, [[6, 55], [55, 131]]),
        (STRIKE, None, [[6, 20], [20, 55], [55, 91], [91, 131], [131, 161]]),
        # A strike without a later foot off begins no stance.
        (LEFT, (OFF, "Left"), [[20, 66]]),
        (LEFT, (STRIKE, "Right"), [[20, 55], [91, 131]]),
        (OFF, STRIKE, [[31, 55], [66, 91]]),
        ((OFF, "Left"), None, []),
        (LEFT, "General", []),
    ],
)
def test_trials_last_from_start_to_stop(start, stop, expected):
    assert rows(cut_at_events(recording(*WALK), start, stop)) == expected
    assert rows(cut_at_events(recording(*WALK[::-1]), start, stop)) == expected


@pytest.mark.parametrize(
    ("frames", "expected"),
    # The first and the last of the recording, and marked twice in a frame.
    [([0.0, 199.0], [0, 199]), ([9.0, 9.3, 30.0, 29.8], [9, 30])],
)
def test_events_are_cut_at_once_each(frames, expected):
    assert rows(cut_at_events(recording(*(("a", None, x) for x in frames)), "a")) == [expected]


def test_attrs_belong_to_the_trial():
    df = recording(*WALK, frame_rate=50.0, kind="markers", first_frame=101)
    before = df.copy()
    first, second = cut_at_events(df, LEFT)
    pd.testing.assert_frame_equal(df, before)
    assert df.attrs == before.attrs
    assert first.index.equals(pd.RangeIndex(72))
    assert first.index.name == "frame"
    events = [(e["label"], e["context"], e["frame"]) for e in first.attrs["events"]]
    assert events == [(OFF, "Right", 11.25), (STRIKE, "Right", 35.0), (OFF, "Left", 46.0)]
    assert [x.attrs["first_frame"] for x in (first, second)] == [121, 192]
    assert (first.attrs["frame_rate"], first.attrs["kind"]) == (50.0, "markers")
    first.attrs["events"][0]["frame"] = 99
    assert df.attrs == before.attrs
    # Events on the border are no key-frames.
    (short,) = cut_at_events(recording(("a", None, 3), ("b", None, 3), ("a", None, 9)), "a")
    assert short.attrs["events"] == []


def test_labels_follow_those_of_the_recording():
    known = recording(*WALK, trial=("ann", 3), levels=("subject", "trial", "frame"))
    for df, first, levels in (
        (recording(*WALK), 0, "trial"),
        (recording(*WALK, trial="walk"), ("walk", 0), "recording part"),
        (known, ("ann", 3, 0), "subject trial part"),
        (recording(*WALK, trial=("ann", 3)), ("ann", 3, 0), "recording_0 recording_1 part"),
    ):
        parts = cut_at_events(df, LEFT)
        assert [x.attrs["trial"] for x in parts] == [first, (*first[:-1], 1) if first else 1]
        assert [x.attrs["levels"] for x in parts] == [(*levels.split(), "frame")] * 2
        assert len(to_frame(parts)) == 72 + 71
    (again,) = cut_at_events(cut_at_events(known, LEFT)[0], OFF)
    assert again.attrs["trial"] == ("ann", 3, 0, 0)
    assert again.attrs["levels"] == ("subject", "trial", "part", "part_4", "frame")


@pytest.mark.parametrize(
    ("df", "start", "stop", "message"),
    [
        (recording(*WALK, events=None), "a", None, r"has no events; attrs\['events'\] must"),
        (recording(*WALK, trial="w"), "a", None, r"^The recording 'w' has no event 'a' for"),
        (recording(*WALK), "Heel", None, r"no event 'Heel' for start; there are \('Foot Str"),
        (recording(*WALK), LEFT, (OFF, "Both"), r"no event \('Foot Off', 'Both'\) for stop; .*'G"),
        (recording(*WALK), 3, None, "start must be the label of an event, or a pair .*, got 3"),
        (recording(*WALK), (STRIKE, 3), None, r"start must be the label .*, got \('Foot S"),
        (recording(*WALK), (), None, r"start must be the label .*, got \(\)"),
        (recording(*WALK), LEFT, (1, 2), r"stop must be the label .*, got \(1, 2\)"),
        (recording(("a", None, None)), "a", None, "have no frames, as its file has no frame rate"),
        (recording(("a", None, "7")), "a", None, "must be a list of dicts .*, got {'label': 'a'"),
        (recording((*LEFT, 7), (*LEFT, np.inf)), "a", None, "must be a list of dicts .*, got"),
        (pd.Series([1.0]), "a", None, "must be a DataFrame, as read_motion returns it, got Series"),
    ],
)
def test_wrong_events_are_refused(df, start, stop, message):
    with pytest.raises(ValueError, match=message):
        cut_at_events(df, start, stop)


def test_messages_name_the_recording_and_are_short_whatever_is_marked():
    message = r"^The recording 'standing' has no events, so no trial is cut out of it\.$"
    with pytest.warns(UserWarning, match=message):
        assert cut_at_events(recording(trial="standing"), LEFT) == []
    many = [("a long label of an event " * 9 + str(k), "General", 3.0) for k in range(200)]
    for df in (recording(*many, trial="p" * 300), recording(("a", None, "x" * 9999))):
        with pytest.raises(ValueError, match="The recording") as caught:
            cut_at_events(df, LEFT)
        assert len(str(caught.value)) < 600
