"""The pages of the gallery: all of them are in its index, and each shows what fails."""

import re
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("plot_*.py"))
INDEX = (ROOT / "examples" / "index.rst").read_text(encoding="utf-8")
# At 388 pixels, the width of a page on a phone, letters of 10 points are still 8 pixels high.
LARGEST_WIDTH = 6.5
# These take a second or two each.
QUICK = ["plot_find", "plot_helps_little", "plot_one_dimension", "plot_trellis"]


def test_the_index_names_each_page_once_and_lists_it():
    names = [path.stem for path in EXAMPLES]
    assert sorted(re.findall(r"\.\./examples/(\w+)\.py", INDEX)) == names
    assert sorted(re.findall(r"^    (plot_\w+)$", INDEX, re.MULTILINE)) == names


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_each_page_says_what_one_gets_and_shows_what_fails(path):
    code = path.read_text(encoding="utf-8")
    assert re.match(r'"""\n.+\n=+\n\nYou get ', code)
    assert len(re.findall(r"^# (What is refused|Where it fails)\n# -+$", code, re.MULTILINE)) == 1


@pytest.mark.parametrize("name", QUICK)
def test_figures_are_narrow_and_have_titles(name, monkeypatch):
    path = ROOT / "examples" / f"{name}.py"
    monkeypatch.setattr(sys, "argv", [str(path)])
    monkeypatch.setattr(plt, "show", lambda: None)
    exec(compile(path.read_text(encoding="utf-8"), path, "exec"), {"__name__": "__main__"})
    figures = [plt.figure(number) for number in plt.get_fignums()]
    assert figures
    for figure in figures:
        assert figure.get_size_inches()[0] <= LARGEST_WIDTH
        titles = [figure.get_suptitle(), *(axes.get_title() for axes in figure.axes)]
        assert any(title.strip() for title in titles)


def test_the_gallery_has_the_order_of_its_index(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "docs" / "_ext")
    from gallery_order import gallery_order

    ordered = sorted(map(str, EXAMPLES), key=gallery_order)
    assert [Path(path).stem for path in ordered] == re.findall(r"/(plot_\w+)\.py", INDEX)
