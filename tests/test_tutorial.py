"""The tutorial as a reader takes it: block after block pasted into an interpreter."""

import doctest
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
# A block, and what is said to come out of it.
BLOCK = re.compile(
    r"^```\{plot\}\n(?::[^\n]*\n)+\n(.*?)^```\n"
    r"(?:\n```text\n(.*?)^```\n)?",
    re.MULTILINE | re.DOTALL,
)
BLOCKS = [match.groups() for match in BLOCK.finditer(PAGE)]
MARK = "the end of block"
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


@pytest.fixture(scope="module")
def session():
    """What a fresh interpreter prints for each block, and its complaints."""
    pasted = "".join(f"{code}\nprint({MARK!r})\n" for code, _ in BLOCKS)
    done = subprocess.run(
        [sys.executable, "-i", "-q", "-W", "error"],
        input=pasted,
        capture_output=True,
        text=True,
        timeout=300,
        env=os.environ | {"MPLBACKEND": "Agg", "PYTHONPATH": str(ROOT)},
        check=False,
    )
    return done.stdout.split(MARK + "\n"), done.stderr


def test_all_of_the_page_is_found():
    assert len(BLOCKS) == PAGE.count("```{plot}") > 10
    assert sum(printed is not None for _, printed in BLOCKS) == PAGE.count("```text")
    assert all(("print(" in code) == (printed is not None) for code, printed in BLOCKS)
    assert ">>>" not in PAGE


def test_the_blocks_can_be_pasted(session):
    outputs, complaints = session
    assert re.sub(r">>> |\.\.\. |\n", "", complaints) == ""
    assert len(outputs) == len(BLOCKS) + 1


@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_a_block_prints_what_the_page_says(session, number):
    printed, expected = session[0][number], BLOCKS[number][1]
    if expected is None:  # what is left is the figure, by its short name
        assert re.fullmatch(r"(\w+Display\(.*\)\n)?", printed), printed
    else:
        assert doctest.OutputChecker().check_output(expected, printed, FLAGS), printed


def test_what_is_installed_is_what_can_be_had():
    """No index has the package: it is installed from a checkout."""
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    pages += sorted((ROOT / "examples").iterdir())
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"pip install [^\n`]*sklearn[-_]motionsync", text), page.name
