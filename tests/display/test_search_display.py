"""SearchDisplay: its artists agree with the hits."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import to_trials
from sklearn_motionsync.display import SearchDisplay

WAVE = np.column_stack([np.sin(np.linspace(0, 6, 40)), np.sin(np.linspace(0, 9, 40))])
TAKE = np.concatenate([np.zeros((30, 2)), WAVE, np.zeros((50, 2)), 0.2 * WAVE, np.zeros((40, 2))])


def test_hits_have_their_times_and_scores_and_others_are_grey():
    display = SearchDisplay.from_estimator(WAVE, TAKE, segments=[(0, 30, 70)])
    assert repr(display) == "SearchDisplay(1 hit in 1 take)"
    boxes = [(b.get_x(), b.get_x() + b.get_width(), b.get_y() + b.get_height())
             for b in display.hits_[0]]  # fmt: skip
    # Of low scores nothing is seen.
    rows = display.origin[["start", "stop", "score"]].to_numpy()
    expected = np.maximum(rows, [-np.inf, -np.inf, 0.3])
    np.testing.assert_allclose(boxes, expected)
    good = display.origin["score"].to_numpy() >= display.origin["threshold"].to_numpy()
    assert boxes[int(good.argmax())][:2] == (30, 70)
    assert 0 < good.sum() < len(good)
    colors = [{bar.get_facecolor() for bar, one in zip(display.hits_[0], good, strict=True)
               if one == kind} for kind in (True, False)]  # fmt: skip
    assert len(colors[0] | colors[1]) == len(colors[0]) + len(colors[1]) == 2


def test_each_take_has_a_panel_also_without_hits():
    table = pd.concat([pd.DataFrame(TAKE), pd.DataFrame(0 * TAKE[:20])], keys=["ann", "bob"])
    takes = to_trials(table.rename_axis(["take", "frame"]))
    display = SearchDisplay.from_estimator(pd.DataFrame(WAVE), takes)
    assert [axis.get_title() for axis in display.axes_] == ["take ann", "take bob"]
    assert [axis.get_xlim()[1] for axis in display.axes_] == [len(TAKE), 20]
    assert len(display.hits_[1]) == 0


def test_unknown_takes_and_thresholds_are_refused():
    with pytest.raises(ValueError, match=r"segments names the take 3; the takes are \[0\]"):
        SearchDisplay.from_estimator(WAVE, TAKE, segments=[(3, 0, 9)])
    with pytest.raises(TypeError, match="threshold"):
        SearchDisplay.from_estimator(WAVE, TAKE, threshold=0.5)
