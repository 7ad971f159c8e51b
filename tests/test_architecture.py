"""The architecture: subpackages and their imports, names, and what is public."""

import ast
import functools
import graphlib
import re
from pathlib import Path

import sklearn_motionsync

from public import ROOMS

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "sklearn_motionsync"

# Lowest first: a subpackage imports from itself and from the floors below.
FLOORS = [
    {"matching"},
    {"inputs"},
    {"utils"},
    {"body", "metrics", "transformers"},
    {"gait", "io", "synchronizers"},
    {"datasets", "model", "live"},
    {"comparison", "recognition", "takes"},
    {"display"},
    {"report"},
]

# Private names of scikit-learn that third parties rely on, and a public one of named tuples.
ALLOWED = {
    "_fit_context",
    "_get_output_config",
    "_param_validation",
    "_parameter_constraints",
    "_replace",
    "_set_output",
}


# All tests read the same files.
@functools.cache
def read(path):
    return ast.parse(path.read_text(encoding="utf-8"))


def name_of(path):
    """The name of a module below the package: ``matching.rows``."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__")


MODULES = {name_of(path): path for path in sorted(PACKAGE.rglob("*.py"))}


@functools.cache
def imports(name):
    """Modules of the package, and names of scikit-learn, that a module imports."""
    inside, outside = set(), set()
    base = name.split(".") if MODULES[name].name == "__init__.py" else name.split(".")[:-1]
    for node in ast.walk(read(MODULES[name])):
        if isinstance(node, ast.ImportFrom) and node.level:
            start = base[: len(base) + 1 - node.level]
            module = ".".join([*start, *filter(None, [node.module])])
            for alias in node.names:
                whole = f"{module}.{alias.name}".lstrip(".")
                inside.add(whole if whole in MODULES else module)
        elif isinstance(node, ast.ImportFrom):
            assert node.module.split(".")[0] != PACKAGE.name, f"{name}: imports are relative"
            if node.module.split(".")[0] == "sklearn":
                outside |= {alias.name for alias in node.names}
        elif isinstance(node, ast.Import):
            tops = {alias.name.split(".")[0] for alias in node.names}
            assert PACKAGE.name not in tops, f"{name}: imports are relative"
            outside |= tops & {"sklearn"}
    return inside - {""}, outside


def test_imports_run_downwards_only_and_in_no_circle():
    floor = {room: k for k, rooms in enumerate(FLOORS) for room in rooms}
    for name in filter(None, MODULES):
        own = name.split(".")[0]
        for other in imports(name)[0]:
            room = other.split(".")[0]
            assert room == own or floor[room] < floor[own], f"{name} imports {other}"
    list(graphlib.TopologicalSorter({name: imports(name)[0] for name in MODULES}).static_order())


def test_matching_imports_numpy_and_scipy_only():
    taken = {name: imports(name) for name in MODULES if name.split(".")[0] == "matching"}
    assert set().union(*(outside for _, outside in taken.values())) == {"get_config"}
    for inside, _ in taken.values():
        assert {module.split(".")[0] for module in inside} <= {"matching"}


def test_every_module_has_a_docstring_and_at_most_750_lines():
    for name, path in MODULES.items():
        first = (ast.get_docstring(read(path)) or "").split("\n")[0]
        assert re.fullmatch(r"[A-Za-z].{20,}[.:]", first), f"{name}: {first!r}"
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 750, name


def test_no_class_or_function_name_stands_in_two_modules():
    nodes = [node for path in MODULES.values() for node in read(path).body]
    names = [n.name for n in nodes if isinstance(n, (ast.ClassDef, ast.FunctionDef))]
    public = [name for name in names if not name.startswith("_")]
    assert sorted(name for name in set(public) if public.count(name) > 1) == []


def _is_own(node):
    """self, cls or super(): what is private to them is ours."""
    if isinstance(node, ast.Name):
        return node.id in ("self", "cls")
    return isinstance(node, ast.Call) and getattr(node.func, "id", "") == "super"


# Where a private name may be taken: behind a dot, in an import, also of several lines, or by text.
MAY_BE_PRIVATE = re.compile(
    r"\._[A-Za-z]|\b(from|import)\b.*[ .]_[A-Za-z]|^\s+_\w+( as \w+)?,?$|\bsetattr\b", re.MULTILINE
)


def private_accesses(path):
    """Names with an underscore that a file takes from other modules and objects."""
    text = re.sub(r"\b(self|cls|super\(\))\._", "", path.read_text(encoding="utf-8"))
    if not MAY_BE_PRIVATE.search(text):
        return
    for node in ast.walk(read(path)):
        taken = []
        if isinstance(node, ast.Attribute) and not _is_own(node.value):
            taken = [node.attr]
        elif isinstance(node, ast.ImportFrom):
            taken = [*(node.module or "").split("."), *(alias.name for alias in node.names)]
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "setattr":
            strings = [a.value for a in node.args if isinstance(a, ast.Constant)]
            taken = [part for s in strings if isinstance(s, str) for part in s.split(".")]
        for name in taken:
            if name.startswith("_") and name[:2] != "__" and name not in ALLOWED:
                yield f"{path.relative_to(ROOT)}:{node.lineno}: {name}"


def test_no_private_name_is_used_outside_its_module():
    found = []
    for folder in ("sklearn_motionsync", "tests", "benchmarks", "docs", "examples"):
        for path in (ROOT / folder).rglob("*.py"):
            if "_build" in path.parts:
                continue
            found += list(private_accesses(path))
    assert found == []


def test_reference_lists_the_public_names():
    text = (ROOT / "docs" / "reference.md").read_text(encoding="utf-8")
    listed = set()
    for block in re.findall(r"```\{eval-rst\}\n(.*?)```", text, re.DOTALL):
        listed |= set(re.findall(r"^   ([A-Za-z_.]+)$", block, re.MULTILINE))
    top = set(sklearn_motionsync.__all__)
    rooms = {name: set(module.__all__) - top for name, module in ROOMS.items()}
    assert listed == top | {f"{room}.{name}" for room, names in rooms.items() for name in names}
    assert len(top) <= 20


def test_public_names_exist_once_and_rooms_need_no_import_of_their_own():
    for module in (sklearn_motionsync, *ROOMS.values()):
        assert len(set(module.__all__)) == len(module.__all__)
        assert all(hasattr(module, name) for name in module.__all__)
    for name, room in ROOMS.items():
        assert getattr(sklearn_motionsync, name) is room
        assert name in dir(sklearn_motionsync)
    assert not hasattr(sklearn_motionsync, "nothing")
