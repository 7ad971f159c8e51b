"""The table that notebooks show of a Match."""

from html.parser import HTMLParser

import numpy as np
import pytest
from IPython.core.formatters import HTMLFormatter
from sklearn_motionsync import Match


class Page(HTMLParser):
    """Texts, tags and curves of a page; tags must be closed in order."""

    def __init__(self, text):
        super().__init__()
        self.texts, self.tags, self.curves, self._open = [], [], [], []
        self.feed(text)
        self.close()
        assert not self._open

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self._open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append(tag)
        if tag == "polyline":
            points = dict(attrs)["points"].split()
            self.curves.append(np.array([point.split(",") for point in points], dtype=float))

    def handle_endtag(self, tag):
        assert self._open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


def test_offsets_are_told_and_drawn():
    page = Page(HTMLFormatter()(Match([[0, 2, 3, 3.5, 4], [0, 0.5, 1.5, 3, 4]])))
    text = " ".join(page.texts)
    assert "25.0 % late, at 25 %" in text
    assert "12.5 % early, at 25 %" in text
    first, second = page.curves
    np.testing.assert_allclose(first[:, 0], np.linspace(0, 120, 5))
    np.testing.assert_allclose(first[:, 1], [12, 1, 1, 6.5, 12])
    # Early is below the line, on the same scale.
    np.testing.assert_allclose(second[:, 1], [12, 17.5, 17.5, 12, 12], atol=0.06)
    assert not {"script", "link", "img"} & set(page.tags)


@pytest.mark.parametrize(("count", "shown"), [(0, 0), (1, 1), (10, 10), (25, 10)])
def test_first_trials_are_shown(count, shown):
    page = Page(HTMLFormatter()(Match(np.tile([0.0, 1.0, 2.0], (count, 1)))))
    assert len(page.curves) == shown
    more = [text for text in page.texts if text.startswith("and ")]
    assert more == (["and 15 trials more"] if count == 25 else [])
