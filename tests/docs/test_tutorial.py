"""Pages as a reader takes them: block after block pasted into an interpreter."""

import doctest
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NAMES = (
    "tutorial.md",
    "method.md",
    "howto/timing.md",
    "howto/neuroscience.md",
    "howto/speech.md",
    "howto/sport.md",
)
PAGES = {name: (ROOT / "docs" / name).read_text(encoding="utf-8") for name in NAMES}
# A block, and what is said to come out of it.
BLOCK = re.compile(
    r"^```\{plot\}\n(?::[^\n]*\n)+\n(.*?)^```\n"
    r"(?:\n```text\n(.*?)^```\n)?",
    re.MULTILINE | re.DOTALL,
)
BLOCKS = {name: [match.groups() for match in BLOCK.finditer(page)] for name, page in PAGES.items()}
NUMBERED = [(name, number) for name, blocks in BLOCKS.items() for number in range(len(blocks))]
MARK = "the end of block"
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


@pytest.fixture(scope="module")
def sessions(tmp_path_factory):
    """What a fresh interpreter prints for each block of a page, and its complaints."""
    folder = tmp_path_factory.mktemp("pages")
    return {name: paste(blocks, folder) for name, blocks in BLOCKS.items()}


def paste(blocks, folder):
    pasted = "".join(f"{code}\nprint({MARK!r})\n" for code, _ in blocks)
    done = subprocess.run(
        [sys.executable, "-i", "-q", "-W", "error"],
        input=pasted,
        capture_output=True,
        text=True,
        timeout=300,
        cwd=folder,
        env=os.environ | {"MPLBACKEND": "Agg", "PYTHONPATH": str(ROOT)},
        check=False,
    )
    return done.stdout.split(MARK + "\n"), done.stderr


@pytest.mark.parametrize("name", PAGES)
def test_every_block_of_the_tutorial_is_parsed(name):
    page, blocks = PAGES[name], BLOCKS[name]
    assert len(blocks) == page.count("```{plot}") >= 2
    assert sum(printed is not None for _, printed in blocks) == page.count("```text")
    assert all(("print(" in code) == (printed is not None) for code, printed in blocks)
    assert ">>>" not in page


@pytest.mark.parametrize("name", PAGES)
def test_tutorial_blocks_run_in_order(sessions, name):
    outputs, complaints = sessions[name]
    assert re.sub(r">>> |\.\.\. |\n", "", complaints) == ""
    assert len(outputs) == len(BLOCKS[name]) + 1


@pytest.mark.parametrize(("name", "number"), NUMBERED)
def test_tutorial_block_prints_the_documented_output(sessions, name, number):
    printed, expected = sessions[name][0][number], BLOCKS[name][number][1]
    if expected is None:  # what is left is the figure, by its short name
        assert re.fullmatch(r"(\w+Display\(.*\)\n)?", printed), printed
    else:
        assert doctest.OutputChecker().check_output(expected, printed, FLAGS), printed


def test_tutorial_installs_the_declared_extras():
    """No index has the package: it is installed from a checkout."""
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    pages += sorted((ROOT / "examples").glob("*.*"))
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"pip install [^\n`]*sklearn[-_]motionsync", text), page.name
