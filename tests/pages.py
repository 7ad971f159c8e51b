"""Pages of HTML as tests read them."""

import json
import re
from html.parser import HTMLParser

# Elements without an end.
VOID = {"meta", "input", "link", "img", "br", "hr"}


class Page(HTMLParser):
    """Tags with their attributes, and what is shown; elements must end within those around them."""

    def __init__(self, text):
        super().__init__()
        self.page, self.tags, self.shown, self._open = text, [], [], []
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        assert self._open.pop() == tag

    def handle_data(self, data):
        if not {"script", "style"} & set(self._open):
            self.shown.append(data)

    @property
    def text(self):
        return " ".join(" ".join(self.shown).split())

    @property
    def data(self):
        """What a report or a player holds for its script."""
        return json.loads(re.search(r'id="data">(.*?)</script>', self.page, re.DOTALL)[1])

    def check_that_nothing_is_loaded(self):
        """No address, no element that fetches, and a policy that forbids it."""
        assert not re.search(r"://|@import|url\(", self.page)
        for tag, attributes in self.tags:
            assert tag not in ("link", "iframe", "object", "embed")
            assert attributes.get("src", "data:").startswith("data:")
            assert attributes.get("href", "#").startswith("#")
        policy = [a["content"] for _, a in self.tags if a.get("http-equiv")]
        assert "default-src 'none'" in policy[0]
