"""CycleDisplay: its artists agree with the estimator."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync.datasets import make_bending, make_gait
from sklearn_motionsync.display import CycleDisplay
from sklearn_motionsync.takes import CycleSegmenter, self_correlation

GAIT = make_gait(2, 4, takes=True, random_state=0)
HIP = 0


@pytest.fixture(scope="module")
def segmenter():
    return CycleSegmenter(start=HIP, incomplete=True).fit(GAIT.data)


def test_artists_agree_with_the_estimator(segmenter):
    take = GAIT.data[1]
    display = CycleDisplay.from_estimator(segmenter, GAIT.data[1:], unit="seconds", frame_rate=100)
    found = self_correlation(take)
    np.testing.assert_array_equal(display.correlation_.get_ydata(), found.correlation)
    np.testing.assert_allclose(display.peaks_.get_xdata(), found.peaks / 100)
    assert display.period_.get_xdata()[0] == pytest.approx(found.period / 100)
    asked = 1 - 0.6 * np.sqrt(min(1, found.breadth / 2.25))
    assert display.threshold_.get_ydata()[0] == pytest.approx(asked)
    np.testing.assert_allclose(display.curve_.get_xdata(), np.arange(len(take)) / 100)
    np.testing.assert_array_equal(display.curve_.get_ydata(), take[:, HIP])
    origin = segmenter.segment([take])[1]
    cuts = [segment[0, 0] for segment in display.cuts_.get_segments()]
    np.testing.assert_allclose(cuts[:-1], origin["start"][origin["complete"]] / 100)
    assert [a.get_xlabel() for a in display.axes_] == ["lag (s)", "time of the take (s)"]
    assert display.axes_[1].get_ylabel() == "x0"
    cycles = f"{len(cuts) - 1} whole cycles"
    assert repr(display).endswith(f"period {found.period:.1f} frames, {cycles})")
    # The first of the takes, in per cent of it.
    other = CycleDisplay.from_estimator(segmenter, GAIT.data, unit="percent", units="deg")
    assert other.axes_[1].get_ylabel() == "x0 (deg)"
    assert other.axes_[1].get_xlabel() == "% of the take"
    np.testing.assert_array_equal(other.curve_.get_ydata(), GAIT.data[0][:, HIP])
    assert other.curve_.get_xdata()[-1] == 100


def test_a_take_without_cycles_is_drawn_without_cuts():
    bunch = make_bending(1, random_state=0)
    display = CycleDisplay.from_estimator(CycleSegmenter(bunch.skeleton), bunch.data)
    assert (display.period_, len(display.cuts_.get_segments())) == (None, 0)
    assert display.axes_[0].get_title() == "not cyclic"
    assert display.axes_[1].get_ylabel() == "left ankle ahead (legs)"


def test_a_table_tells_its_frame_rate_and_other_units_are_refused(segmenter):
    x = GAIT.data[1]
    table = pd.DataFrame(x, index=pd.Index(np.arange(len(x)) / 100, name="time"))
    told = CycleDisplay.from_estimator(CycleSegmenter(), [table], unit="seconds")
    assert told.axes_[1].get_xlim() == pytest.approx((0, (len(x) - 1) / 100))
    for unit, message in (("hours", "unit must be"), ("seconds", "The frame rate of .* is not")):
        with pytest.raises(ValueError, match=message):
            CycleDisplay.from_estimator(segmenter, GAIT.data, unit=unit)
