"""What tables say of their trials, frame rate, unit and vertical axis, is held together."""

import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn_motionsync import ASpace, LinearSynchronizer, to_frame, to_trials
from sklearn_motionsync.live import MotionTracker, OnlineSynchronizer
from sklearn_motionsync.synchronizers import blend_trials

from estimators import BODY, EVERY, NAMES, OF_TAKES, by_name, data_for, outputs

RATE = {"frame_rate": 30}
# Of two trials: what their tables say, and words of the warning or the error.
RATES = [
    ({"frame_rate": 120}, r"has 120 frames a second, and .* 30 frames a second.*frame_rate=30"),
    ({"frame_rate": 31}, "has 31 frames a second"),
]
DIFFERENT = [
    ({"units": "mm"}, {"units": "m"}, r"has the unit 'm', and .* the unit 'mm'.*'units'\] = 'mm'"),
    ({"units": "degrees"}, {"units": "rad"}, "the unit 'rad', and .* the unit 'deg'"),
    ({"units": ["N", "Nm"]}, {"units": ["N", "Nmm"]}, "'N Nmm'"),
    ({"up": "y"}, {"up": "z"}, r"the vertical axis 'z', and .* the vertical axis 'y'"),
]
ALIKE = [
    ({}, {"frame_rate": 120, "units": "mm", "up": "z"}),
    ({"frame_rate": 30}, {"frame_rate": 29.97}),
    ({"units": "mm"}, {"units": "Millimetres "}),
    ({"units": ["N", "N"]}, {"units": "N"}),
    ({"units": None, "up": None, "frame_rate": None}, {"units": "mm", "up": "y"}),
    ({"units": 3, "up": 1, "frame_rate": "fast"}, {"units": "m", "up": "y", "frame_rate": 3}),
]


def tables(estimator, *facts):
    """What an estimator is fitted on as tables; the last ones say what is given, one each."""
    data = data_for(estimator)
    frames = [pd.DataFrame(x, columns=NAMES if x.shape[1] == len(NAMES) else None) for x in data]
    given = [facts[0]] * (len(frames) - len(facts)) + list(facts)
    for df, attrs in zip(frames, given, strict=True):
        df.attrs = dict(attrs)
    return frames


@pytest.mark.parametrize(
    ("estimator", "other", "message"),
    [
        # The cycles of a take have the clock of the take.
        *((estimator, *RATES[0]) for estimator in EVERY if estimator not in OF_TAKES),
        (LinearSynchronizer(), *RATES[1]),
    ],
    ids=by_name,
)
def test_rates_that_differ_are_warned_of(estimator, other, message):
    last = len(data_for(estimator)) - 1
    with pytest.warns(UserWarning, match=f"Trial {last} {message}"):
        clone(estimator).fit(tables(estimator, RATE, other))
    fitted = clone(estimator).fit(tables(estimator, RATE))
    with pytest.warns(UserWarning, match=f"Trial {last} has .*and the training set has 30"):
        outputs(fitted, tables(estimator, RATE, other))


@pytest.mark.parametrize(
    ("estimator", "one", "other", "message"),
    [
        *((estimator, *DIFFERENT[3]) for estimator in EVERY),
        *((LinearSynchronizer(), *different) for different in DIFFERENT[:3]),
        (BODY[0], *DIFFERENT[0]),
    ],
    ids=by_name,
)
def test_units_and_axes_that_differ_are_refused(estimator, one, other, message):
    if estimator in BODY and "units" in one:
        # Directions, and positions in units of the body.
        clone(estimator).fit(tables(estimator, one, other))
        return
    with pytest.raises(ValueError, match=message):
        clone(estimator).fit(tables(estimator, one, other))
    fitted = clone(estimator).fit(tables(estimator, one))
    with pytest.raises(ValueError, match="the training set has"):
        outputs(fitted, tables(estimator, one, other))


@pytest.mark.parametrize(("one", "other"), ALIKE)
@pytest.mark.parametrize("estimator", [LinearSynchronizer(), ASpace(2)], ids=by_name)
def test_what_is_alike_or_not_known_passes(estimator, one, other):
    fitted = clone(estimator).fit(tables(estimator, one, other))
    for given in ([other, one], [one]):
        outputs(fitted, tables(estimator, *given))


def test_the_index_tells_the_rate_of_the_rows():
    X = tables(ASpace(), RATE)
    seconds = [df.set_axis(pd.Index(np.arange(len(df)) / 30, name="time")) for df in X]
    for df in seconds:
        df.attrs = {}
    fitted = LinearSynchronizer().fit([*X[:3], *seconds[3:]])
    with pytest.warns(UserWarning, match=r"Trial 1 has 15 frames a second"):
        fitted.transform([X[0], X[1].iloc[::2]])
    table = to_frame([seconds[0], seconds[1].iloc[::3]], trials=["a", "b"])
    with pytest.warns(UserWarning, match=r"Trial 1 \('b'\) has 10 frames a second"):
        fitted.transform(table)


def test_a_table_of_all_keeps_what_they_share():
    X = tables(ASpace(), RATE | {"units": "mm", "up": "y"}, {"frame_rate": 30, "up": "y"})
    assert to_frame(X).attrs == {"frame_rate": 30, "up": "y"}
    other = {"frame_rate": 60}
    with pytest.warns(UserWarning, match=r"Trial 4 has 60 .* 30 frames a second\. 1 more"):
        assert to_frame(tables(ASpace(), RATE, other, other)).attrs == {}
    with pytest.raises(ValueError, match="Trial 5 has the unit 'm'"):
        to_frame(tables(ASpace(), {"units": "mm"}, {"units": "m"}))
    again = to_trials(to_frame(X), frame_rate=15)
    assert [df.attrs["frame_rate"] for df in again] == [15] * 6


def test_a_known_rate_is_changed_without_times():
    x = pd.DataFrame({"a": np.arange(121) / 120})
    x.attrs = {"frame_rate": 120, "events": [{"frame": 60.0}], "trial": "ann"}
    for first, step, n_frames, event in ((0, 1, 31, 15), (0, 2, 31, 15), (12, 1, 28, 12)):
        (slow,) = to_trials(x.iloc[first::step], frame_rate=30)
        np.testing.assert_allclose(slow["a"], (first / 120) + np.arange(n_frames) / 30)
        facts = {"frame_rate": 30, "trial": "ann", "events": [{"frame": event}]}
        assert facts.items() <= slow.attrs.items()
    assert len(to_trials(slow, frame_rate=60)[0]) == 55
    dates = x.set_axis(pd.date_range("2020", periods=121, freq="10ms"), axis=0)
    dates.attrs = {}
    assert len(to_trials(dates, frame_rate=50)[0]) == 61
    dates.index = range(121)
    with pytest.raises(ValueError, match=r"frame_rate=50 needs time=, .* 121 rows"):
        to_trials(dates, frame_rate=50)


def test_the_rate_of_a_parameter_counts_and_times_replace_it():
    X = tables(ASpace(), RATE)
    for estimator in (OnlineSynchronizer(frame_rate=60), MotionTracker(frame_rate=60)):
        with pytest.warns(UserWarning, match="30 frames a second, and frame_rate is 60"):
            estimator.fit(X)
    fast = [df.iloc[::2] for df in X[:2]]
    online = OnlineSynchronizer(LinearSynchronizer()).fit(X)
    tracker = MotionTracker(LinearSynchronizer(), n_particles=10).fit(X)
    for track in (online.track, tracker.track, tracker.smooth):
        track(fast, times=[np.arange(0, 30, 2.0)] * 2)
        with pytest.warns(UserWarning, match="Trial 0 has 15 frames a second"):
            track(fast)
    fast[1].attrs = {"units": "mm"}
    X[0].attrs["units"] = "m"
    tracker.fit(X)
    with pytest.raises(ValueError, match="Trial 1 has the unit 'mm'"):
        tracker.track(fast, times=[np.arange(0, 30, 2.0)] * 2)


def test_a_refit_forgets_what_was_known():
    X = tables(ASpace(), RATE)
    fitted = LinearSynchronizer().fit(X).fit([x.to_numpy() for x in X])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # names without names
        fitted.transform([x.set_axis(x.columns, axis=1) for x in tables(ASpace(), RATES[0][0])])


def test_bodies_hold_the_axis_of_their_skeleton_against_that_of_tables():
    X = tables(BODY[0], {"up": "y"}, {"up": "y"})
    clone(BODY[0]).fit(X)
    for x in X:
        x.attrs["up"] = "z"
    with pytest.warns(UserWarning, match="Trial 0 has the vertical axis 'z' in its attrs"):
        clone(BODY[0]).fit(X)


def test_blends_have_the_facts_that_trials_share():
    X = tables(ASpace(), RATE | {"units": "mm", "events": [{"frame": 3}], "trial": "a"})
    fitted = LinearSynchronizer().fit(X)
    assert blend_trials(fitted, X, {0: 0.5, 1: 0.5}).attrs == {**RATE, "units": "mm"}
    X[1].attrs["frame_rate"] = 60
    with pytest.warns(UserWarning, match="Trial 1 has 60 frames a second"):
        mixed = blend_trials(fitted, X, {0: 0.5, 1: 0.5})
    assert mixed.attrs == {"frame_rate": None, "units": "mm"}
    X[1].attrs = {"units": "m"}
    with pytest.raises(ValueError, match="Trial 1 has the unit 'm', and trial 0"):
        blend_trials(fitted.match(X[:1] * 6), X, {0: 0.5, 1: 0.5})


UNITS = {"force": "N", "moment": "Nm", "emg": "V"}


def channels(names, units=None, **facts):
    steps = np.random.default_rng(0).normal(size=(40, 3))
    x = pd.DataFrame(np.cumsum(steps, axis=0), columns=UNITS)[list(names)]
    x.attrs = {"units": [UNITS[name] for name in names] if units is None else units} | facts
    return x


def test_units_of_columns_are_compared_by_name():
    first, other = ["force", "moment", "emg"], ["emg", "force", "moment"]
    kept = channels(other, ["N", "Nm", "V"], channels=first)
    LinearSynchronizer().fit([channels(first), channels(other), kept, channels(first)])
    for wrong in (["Nm", "N", "V"], ["N", "N", "V"], ["N", "Nmm", "V"]):
        with pytest.raises(ValueError, match=r"Trial 1 has the unit .* and trial 0 has"):
            LinearSynchronizer().fit([channels(first), channels(first, wrong)])
    assert len(to_frame([channels(first, ["N"] * 3), channels(first, "N")])) == 80
