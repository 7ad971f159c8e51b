"""The README: its size, its commands and its links."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def test_readme_is_short():
    assert len(TEXT.encode()) <= 6_400


def test_links_of_the_readme_are_files_of_a_checkout():
    links = re.findall(r"\]\(([^)]+)\)", TEXT)
    assert len(links) > 15
    assert [link for link in links if not (ROOT / link).is_file()] == []


def test_two_commands_make_an_environment():
    assert len(re.findall(r"^python3 -m venv", TEXT, flags=re.MULTILINE)) == 2


def test_errors_and_spreads_are_those_of_the_page_of_accuracy():
    page = (ROOT / "docs" / "accuracy.md").read_text(encoding="utf-8")
    table = TEXT.partition("## How it compares")[2]
    assert [x for x in re.findall(r"\d\.\d\d(?= %)", table) if f"| {x} / " not in page] == []
    exact = [float(x) for x in re.findall(r"(?<=\| )\d\.\d\d(?= \|)", page)]
    spreads = {f"{x:.1f}" for x in exact}
    for row in re.findall(r"(\d\.\d, \d\.\d, \d\.\d) %", table):
        assert set(row.split(", ")) <= spreads
