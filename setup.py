"""The project's description on a package index: the README, whose links lead into the manual.

Everything else about the package is in pyproject.toml.
"""

import re
import tomllib
from pathlib import Path

from setuptools import setup

ROOT = Path(__file__).parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
# Files of a checkout, and where the manual has them.
PAGES = (
    (r"docs/(_static/.+)", r"\1"),
    (r"docs/(.+)\.md", r"\1.html"),
    (r"examples/(.+)\.py", r"auto_examples/\1.html"),
    (r"CHANGELOG\.md", "changelog.html"),
)


def address(file):
    """Where the manual has a file of the repository; None where it has no such page."""
    for pattern, page in PAGES:
        if re.fullmatch(pattern, file):
            return f"{PROJECT['urls']['Documentation']}/{re.sub(pattern, page, file)}"
    return None


def description(text):
    """The README with addresses in place of files; files that the manual lacks are not linked."""

    def linked(match):
        where = address(match["file"])
        return f"{match['text']}({where})" if where else match["text"].strip("[]")

    return re.sub(r"(?P<text>!?\[[^\]]*\])\((?P<file>[^)]+)\)", linked, text)


if __name__ == "__main__":
    setup(
        long_description=description((ROOT / "README.md").read_text(encoding="utf-8")),
        long_description_content_type="text/markdown",
    )
