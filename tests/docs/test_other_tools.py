"""The page on other packages: its examples run as doctests; what needs another package says so."""

import ast
import builtins
import doctest
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "howto" / "other_tools.md").read_text("utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```\n", PAGE, re.MULTILINE | re.DOTALL)


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
