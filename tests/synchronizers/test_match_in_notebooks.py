"""The table that notebooks show of a Match."""

import numpy as np
import pytest
from IPython.core.formatters import HTMLFormatter
from sklearn_motionsync import Match

from pages import Page


def curves_of(page):
    points = [attributes["points"].split() for tag, attributes in page.tags if tag == "polyline"]
    return [np.array([point.split(",") for point in curve], dtype=float) for curve in points]


def test_offsets_are_told_and_drawn():
    page = Page(HTMLFormatter()(Match([[0, 2, 3, 3.5, 4], [0, 0.5, 1.5, 3, 4]])))
    assert "25.0 % late, at 25 %" in page.text
    assert "12.5 % early, at 25 %" in page.text
    first, second = curves_of(page)
    np.testing.assert_allclose(first[:, 0], np.linspace(0, 120, 5))
    np.testing.assert_allclose(first[:, 1], [12, 1, 1, 6.5, 12])
    # Early is below the line, on the same scale.
    np.testing.assert_allclose(second[:, 1], [12, 17.5, 17.5, 12, 12], atol=0.06)
    assert not {"script", "link", "img"} & {tag for tag, _ in page.tags}


@pytest.mark.parametrize(("count", "shown"), [(0, 0), (1, 1), (10, 10), (25, 10)])
def test_first_trials_are_shown(count, shown):
    page = Page(HTMLFormatter()(Match(np.tile([0.0, 1.0, 2.0], (count, 1)))))
    assert len(curves_of(page)) == shown
    more = [text for text in page.shown if text.startswith("and ")]
    assert more == (["and 15 trials more"] if count == 25 else [])
