"""Pages as a reader takes them: block after block pasted into an interpreter."""

import code
import contextlib
import doctest
import io
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TEXTS = {
    str(path.relative_to(ROOT / "docs")): path.read_text(encoding="utf-8")
    for folder in ("", "howto")
    for path in sorted((ROOT / "docs" / folder).glob("*.md"))
} | {"README.md": (ROOT / "README.md").read_text(encoding="utf-8")}
PAGES = {name: page for name, page in TEXTS.items() if "```{plot}" in page}
# A block, and what is said to come out of it.
BLOCK = re.compile(
    r"^```(?:\{plot\}\n(?::[^\n]*\n)+\n|python\n)(.*?)^```\n"
    r"(?:\n```text\n(.*?)^```\n)?",
    re.MULTILINE | re.DOTALL,
)
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def paste(lines, console):
    """What an interpreter prints for the lines of a block; an error of a block fails the test."""
    printed, complaints = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(complaints):
        for line in [*lines.split("\n"), ""]:
            console.push(line)
    assert complaints.getvalue() == ""
    return printed.getvalue()


@pytest.mark.parametrize("name", PAGES)
def test_blocks_of_a_page_run_in_order_and_print_what_it_says(name, tmp_path, monkeypatch):
    page, blocks = PAGES[name], BLOCK.findall(PAGES[name])
    assert len(blocks) == page.count("```{plot}") + page.count("```python")
    assert sum(bool(expected) for _, expected in blocks) == page.count("```text")
    assert ">>>" not in page
    monkeypatch.chdir(tmp_path)
    console = code.InteractiveConsole({"__name__": "__main__"})
    for lines, expected in blocks:
        assert ("print(" in lines) == bool(expected), lines
        printed = paste(lines, console)
        if expected:
            assert doctest.OutputChecker().check_output(expected, printed, FLAGS), printed
        else:  # what is left is the figure, by its short name
            assert re.fullmatch(r"(\w+Display\(.*\)\n)?", printed), printed


# -- every other page ---------------------------------------------------------------------

# Blocks of Python that no test pastes, and why.
NOT_RUN = {
    "howto/other_tools.md": 2,  # these packages are no requirements
    "scaling.md": 2,  # Ray is no requirement, and progress bars need scikit-learn 1.9
}
# Files for these are made by tests/docs/test_journeys.py.
RUN_ON_FILES = ("howto/journeys.md", "howto/motion_files.md")
CODE = re.compile(r"^ *```+(pycon|python|sh)\n(.*?)^ *```+$", re.MULTILINE | re.DOTALL)
FENCE = re.compile(r"^ *```+(?!\{(?!plot|code))(\S+)", re.MULTILINE)


@pytest.mark.parametrize("name", TEXTS)
def test_every_block_is_run_by_a_test(name):
    """Doctest runs ``pycon``; this file ``{plot}``, and ``python`` on the same pages.

    CI runs the commands that install; a script has tests of its own.
    """
    page = TEXTS[name]
    blocks = CODE.findall(page)
    assert set(FENCE.findall(page)) <= {"pycon", "python", "sh", "text", "{plot}"}
    assert [code for kind, code in blocks if kind == "pycon" and code[:4] != ">>> "] == []
    if name not in (*PAGES, *RUN_ON_FILES):
        assert [kind for kind, _ in blocks].count("python") == NOT_RUN.get(name, 0)
    commands = "".join(code for kind, code in blocks if kind == "sh")
    for script in re.findall(r"python3? (\S+\.py)", commands):
        rooms = [ROOT / room for room in ("examples", "benchmarks", "docs")]
        assert any((room / Path(script).name).is_file() for room in rooms), script


def test_tutorial_installs_the_declared_extras():
    """No index has the package: it is installed from a checkout."""
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    pages += sorted((ROOT / "examples").glob("*.*"))
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"pip install [^\n`]*sklearn[-_]motionsync", text), page.name
