"""SearchDisplay: its artists agree with the hits."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import to_trials
from sklearn_motionsync.display import SearchDisplay

WAVE = np.column_stack([np.sin(np.linspace(0, 6, 40)), np.sin(np.linspace(0, 9, 40))])
TAKE = np.concatenate([np.zeros((30, 2)), WAVE, np.zeros((50, 2)), 0.2 * WAVE, np.zeros((40, 2))])


def test_hits_have_their_times_and_others_are_grey():
    display = SearchDisplay.from_estimator(WAVE, TAKE, segments=[(0, 30, 70)])
    assert repr(display) == "SearchDisplay(1 hit in 1 take)"
    boxes = [path.get_extents() for path in display.hits_[0].get_paths()]
    spans = [[box.x0, box.x1] for box in boxes]
    assert spans == display.origin[["start", "stop"]].to_numpy().tolist()
    good = display.origin["score"].to_numpy() >= display.origin["threshold"].to_numpy()
    assert spans[int(good.argmax())] == [30, 70]
    colors = {tuple(color) for color in display.hits_[0].get_facecolor()[~good]}
    assert len(colors) == 1
    assert tuple(display.hits_[0].get_facecolor()[good.argmax()]) not in colors


def test_each_take_has_a_panel():
    table = pd.concat([pd.DataFrame(TAKE), pd.DataFrame(TAKE[:80])], keys=["ann", "bob"])
    takes = to_trials(table.rename_axis(["take", "frame"]))
    display = SearchDisplay.from_estimator(pd.DataFrame(WAVE), takes, xlabel="at 50 Hz")
    assert display.axes_[-1].get_xlabel() == "at 50 Hz"
    assert [axis.get_title() for axis in display.axes_] == ["take ann", "take bob"]
    assert [axis.get_xlim()[1] for axis in display.axes_] == [len(TAKE), 80]


def test_a_search_without_hits_is_drawn():
    display = SearchDisplay.from_estimator(WAVE, np.zeros((100, 2)))
    assert repr(display) == "SearchDisplay(0 hits in 1 take)"


def test_unknown_takes_and_thresholds_are_refused():
    with pytest.raises(ValueError, match=r"segments names the take 3; the takes are \[0\]"):
        SearchDisplay.from_estimator(WAVE, TAKE, segments=[(3, 0, 9)])
    with pytest.raises(TypeError, match="threshold"):
        SearchDisplay.from_estimator(WAVE, TAKE, threshold=0.5)
