"""Pages as a reader takes them: block after block pasted into an interpreter."""

import doctest
import os
import re
import subprocess
import sys
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
    assert len(blocks) == page.count("```{plot}") + page.count("```python")
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
    """Doctest runs ``pycon``; this file ``{plot}``, and ``python`` on the same pages."""
    page = TEXTS[name]
    blocks = CODE.findall(page)
    assert set(FENCE.findall(page)) <= {"pycon", "python", "sh", "text", "{plot}"}
    assert [code for kind, code in blocks if kind == "pycon" and code[:4] != ">>> "] == []
    if name not in (*PAGES, *RUN_ON_FILES):
        assert [kind for kind, _ in blocks].count("python") == NOT_RUN.get(name, 0)


@pytest.mark.parametrize("name", TEXTS)
def test_scripts_of_commands_exist(name):
    """CI runs the commands that install; a script has tests of its own."""
    commands = "".join(code for kind, code in CODE.findall(TEXTS[name]) if kind == "sh")
    scripts = re.findall(r"python3? (\S+\.py)", commands)
    found = {
        path.name: path
        for room in ("examples", "benchmarks", "docs")
        for path in (ROOT / room).glob("*.py")
    }
    assert [script for script in scripts if Path(script).name not in found] == []


def test_tutorial_installs_the_declared_extras():
    """No index has the package: it is installed from a checkout."""
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    pages += sorted((ROOT / "examples").glob("*.*"))
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"pip install [^\n`]*sklearn[-_]motionsync", text), page.name
