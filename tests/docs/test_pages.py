"""README, method, design record and the page on other packages: numbers, names and links hold."""

import ast
import builtins
import doctest
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ROOT, ROOT / "sklearn_motionsync"
README = (ROOT / "README.md").read_text("utf-8")
PAGES = {name: (ROOT / "docs" / name).read_text("utf-8") for name in ("method.md", "design.md")}
PAGE = (ROOT / "docs" / "howto" / "other_tools.md").read_text("utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```\n", PAGE, re.MULTILINE | re.DOTALL)


# -- README ------------------------------------------------------------------------------------


def test_readme_is_short():
    assert len(README.encode()) <= 6_400


def test_links_of_the_readme_are_files_of_a_checkout():
    links = re.findall(r"\]\(([^)]+)\)", README)
    assert len(links) > 15
    assert [link for link in links if not (ROOT / link).is_file()] == []


def test_two_commands_make_an_environment():
    assert len(re.findall(r"^python3 -m venv", README, flags=re.MULTILINE)) == 2


def test_errors_and_spreads_are_those_of_the_page_of_accuracy():
    page = (ROOT / "docs" / "accuracy.md").read_text(encoding="utf-8")
    table = README.partition("## How it compares")[2]
    assert [x for x in re.findall(r"\d\.\d\d(?= %)", table) if f"| {x} / " not in page] == []
    exact = [float(x) for x in re.findall(r"(?<=\| )\d\.\d\d(?= \|)", page)]
    spreads = {f"{x:.1f}" for x in exact}
    for row in re.findall(r"(\d\.\d, \d\.\d, \d\.\d) %", table):
        assert set(row.split(", ")) <= spreads


# -- method and design record ------------------------------------------------------------------


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


# -- other packages ----------------------------------------------------------------------------


def names_of(code):
    """The names that code reads, and those that it makes."""
    nodes = list(ast.walk(ast.parse(code)))
    names = [node for node in nodes if isinstance(node, ast.Name)]
    made = {node.id for node in names if isinstance(node.ctx, ast.Store)}
    made |= {node.arg for node in nodes if isinstance(node, ast.arg)}
    made |= {node.name for node in nodes if isinstance(node, ast.FunctionDef)}
    for node in nodes:
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            made |= {(each.asname or each.name).partition(".")[0] for each in node.names}
    return {node.id for node in names if isinstance(node.ctx, ast.Load)}, made


@pytest.mark.parametrize("block", BLOCKS)
def test_a_block_that_needs_a_package_says_so_and_uses_what_the_page_made(block):
    first, _, code = block.partition("\n")
    package = re.fullmatch(r"# pip install (\w+)", first)[1]
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    installed = " ".join(extras["optional-dependencies"]["test"] + extras["dependencies"])
    assert package not in installed
    assert re.search(rf"^from {package}[. ]", code, re.MULTILINE)
    before = PAGE[: PAGE.index(block)]
    examples = "".join(each.source for each in doctest.DocTestParser().get_examples(before))
    used, made = names_of(code)
    assert used <= made | names_of(examples)[1] | set(dir(builtins))


def test_every_package_of_the_table_has_a_section():
    table = set(re.findall(r"^\| (\w+)(?:, \w+)? \| [^|]+ \| [^|]*\|$", PAGE, re.MULTILINE))
    titles = " ".join(re.findall(r"^## (.*)$", PAGE, re.MULTILINE))
    assert {"pandas", "polars", "sktime", "aeon", "skrub", "xarray", "movement"} <= table
    assert not [name for name in table - {"package"} if name not in titles]
