"""docs/method.md and docs/design.md: the equations of the paper, and files that exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ROOT, ROOT / "sklearn_motionsync"
PAGES = {name: (ROOT / "docs" / name).read_text("utf-8") for name in ("method.md", "design.md")}


def test_all_equations_of_the_paper_are_there_in_order():
    numbers = re.findall(r"\\tag\{(\d+)\}", PAGES["method.md"])
    assert numbers == [str(number) for number in range(1, 20)]


@pytest.mark.parametrize("page", PAGES)
def test_files_that_are_named_exist(page):
    spans = re.findall(r"`([^`\n]+)`", PAGES[page])
    words = [word for span in spans for word in span.split()]
    named = {word for word in words if re.fullmatch(r"[\w/]+(\.py|/)", word)}
    missing = {path for path in named if not any((at / path).exists() for at in FOLDERS)}
    assert len(named) > 15
    assert not missing


def test_both_pages_have_the_same_sections():
    """But for the table at the end of the method."""
    method, design = (re.findall(r"^## (.+)$", page, re.MULTILINE) for page in PAGES.values())
    assert method == [*design, "Equations and modules"]
