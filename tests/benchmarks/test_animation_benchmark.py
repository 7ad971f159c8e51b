"""Saved animations: the benchmark compares two ways that draw the same pictures."""

import numpy as np
import pytest
from matplotlib import pyplot as plt


@pytest.fixture(scope="module")
def bench(benchmark):
    return benchmark("animation")


def test_ours_draws_the_figure_less_often(bench, tmp_path, monkeypatch):
    drawn = dict(bench.displays())
    assert len(drawn) == 5
    display, counts = drawn["one body"], []
    display.figure_.canvas.mpl_connect("draw_event", counts.append)
    bench.seconds(display, "none", 10, tmp_path)
    ours = len(counts)
    with bench.by_matplotlib():
        bench.seconds(display, "none", 10, tmp_path)
    # The layout, and the whole drawings.
    assert (ours, len(counts) - ours) == (1 + 1, 1 + 10)
    monkeypatch.setattr(bench, "displays", lambda: [("one body", display)])
    monkeypatch.setattr(bench, "SHORT", 2)
    monkeypatch.setattr(bench, "LONG", 6)
    ((name, writer, whole, fast, ratio),) = bench.compare(1, ["pillow"], tmp_path)
    assert (name, writer) == ("one body", "pillow")
    assert ratio == pytest.approx(whole / fast)
    assert np.isfinite(ratio)
    plt.close("all")
