"""What constants are worth: the table of constants, how they are switched, and what is printed."""

import ast
import inspect
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from sklearn_motionsync import DenseSynchronizer

PACKAGE = Path(__file__).resolve().parents[2] / "sklearn_motionsync"


@pytest.fixture(scope="module")
def constants(benchmark):
    return benchmark("constants")


@pytest.fixture(scope="module")
def table(constants):
    """The constants that stand in a module."""
    return [one for one in constants.CONSTANTS if one.module != constants.PARAMETERS]


def reads(node, name, runs=False):
    """Yield, for each place that reads a name, whether it does so whenever a function runs."""
    if isinstance(node, ast.Name) and node.id == name and isinstance(node.ctx, ast.Load):
        yield runs
    if isinstance(node, ast.FunctionDef):
        once = any(re.search(r"\b(lru_)?cache\b", ast.unparse(d)) for d in node.decorator_list)
        yield from reads(node.args, name, runs)
        for statement in node.body:
            yield from reads(statement, name, not once)
        return
    for child in ast.iter_child_nodes(node):
        yield from reads(child, name, runs)


def importers():
    """{(module, name): modules that import the name from there}, by last parts of module names."""
    importing = {}
    for path in PACKAGE.rglob("*.py"):
        importer = ".".join(path.relative_to(PACKAGE).with_suffix("").parts)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                for alias in node.names:
                    key = node.module.split(".")[-1], alias.name
                    importing.setdefault(key, set()).add(importer)
    return importing


def test_every_constant_is_listed_once_and_is_switched_and_comes_back(constants):
    assert len({str(one) for one in constants.CONSTANTS}) == len(constants.CONSTANTS)
    for one in constants.CONSTANTS:
        before = one.value
        assert before is not None
        for label, value in one.tried().items():
            assert value != before, (str(one), label)
            assert type(value) is type(before) or np.isscalar(value), (str(one), label)
            with one.switched(value):
                assert one.value == value
            assert one.value == before


def test_constants_are_read_whenever_a_function_runs_and_importers_are_named(table):
    importing = importers()
    for one in table:
        key = one.module.split(".")[-1], one.name
        assert importing.get(key, set()) == set(one.also), str(one)
        for module in one.modules:
            read_late = list(reads(ast.parse(inspect.getsource(module)), one.name))
            assert read_late, f"{module.__name__} does not read {one.name}"
            assert all(read_late), f"{module.__name__} reads {one.name} only once"


def test_a_switched_constant_changes_warps_and_leaves_nothing_behind(constants):
    cells = {(0.05, 16): [constants.known_warps(0, 0.5, 2.0, 0.05, n_features=16)]}
    one = constants.Constant(constants.PARAMETERS, "consensus", "", off=0)
    of_columns = {"warps": partial(constants.missed_warps, cells)}
    before = constants.judged(of_columns)
    with one.switched(one.off):
        assert DenseSynchronizer().consensus == 0
        assert constants.judged(of_columns) > 1.5 * before
    assert DenseSynchronizer().consensus == 8
    assert constants.judged(of_columns) == before


def test_moments_of_unseen_actions_and_landmarks_are_read(constants, real_data):
    unseen = constants.read_unseen(real_data / "events44" / "events44.npz")
    assert len(unseen) == 23
    assert sum(len(trials) for _, trials, _ in unseen) == 624
    assert sum(len(moments) for *_, moments in unseen) == 46
    for _, trials, moments in unseen:
        assert len({x.shape[1] for x in trials}) == 1
        for at in moments.values():
            assert len(at) == len(trials)
            assert np.nanmin(at) >= 0
            assert np.nanmax(at) <= 99
    for _, curves, landmarks in constants.read_landmarks(real_data / "nlreg1d"):
        for at in landmarks.values():
            assert np.isfinite(at).mean() > 0.9
            assert len(at) == len(curves)
