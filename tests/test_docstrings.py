"""Docstrings of public objects: every parameter, with the default of the signature."""

import inspect
import re

from public import OBJECTS

# Given to every estimator by scikit-learn.
INHERITED = re.compile("_|set_|get_params$|get_metadata_routing$")


def callables():
    """Public functions, classes and methods of our own, by their dotted names."""
    for name, each in OBJECTS.items():
        if inspect.isclass(each) and issubclass(each, Warning):
            continue
        yield name, each
        if inspect.isclass(each):
            for method in dir(each):
                found = getattr(each, method)
                own = str(getattr(found, "__module__", "")).startswith("sklearn_motionsync")
                if inspect.isroutine(found) and own and not INHERITED.match(method):
                    yield f"{name}.{method}", found


CALLABLES = dict(callables())


def described(docstring, heading=r"(?:Other )?Parameters"):
    """The parameters of a docstring, and what stands behind the colon of each."""
    sections = re.finditer(
        rf"^{heading}\n-+\n(.*?)(?=\n\n\w[\w ]*\n-+\n|\Z)", docstring, re.S | re.M
    )
    found = re.findall(
        r"^(\**\w[\w, *]*) : ((?:.|\n(?= {8}))*)", "\n".join(each[1] for each in sections), re.M
    )
    return {
        name.strip("* "): " ".join(kind.split())
        for names, kind in found
        for name in names.split(",")
    }


def parameters(each):
    known = inspect.signature(each).parameters.values()
    return {p.name: p for p in known if p.name not in ("self", "cls")}


def for_each(objects):
    """Make of a check of one object a test of all, which names those that fail, and why."""

    def of_all(check):
        def test():
            failures = []
            for name, each in objects.items():
                try:
                    check(name, each)
                except AssertionError as error:
                    failures.append(f"{name}: {error}")
            assert not failures, "\n".join(failures)

        return test

    return of_all


@for_each(CALLABLES)
def test_every_parameter_is_documented(name, each):
    docstring = inspect.getdoc(each) or ""
    assert docstring, "it has no docstring"
    if inspect.isclass(each) and issubclass(each, tuple):
        return  # a result: its fields are attributes
    headings = ("Parameters", "Other Parameters")
    sections = [list(described(docstring, heading)) for heading in headings]
    assert sorted([*sections[0], *sections[1]]) == sorted(parameters(each))
    for section in sections:
        assert section == [key for key in parameters(each) if key in section]


@for_each(CALLABLES)
def test_defaults_are_those_of_the_signature(name, each):
    said = described(inspect.getdoc(each) or "")
    for key, parameter in parameters(each).items():
        default = re.search(r"default=(.+)$", said.get(key, ""))
        if parameter.default is parameter.empty or parameter.kind is parameter.VAR_KEYWORD:
            assert default is None, f"{key} has no default, the docstring says {default[1]}"
        elif said.get(key, "").strip() not in ("ignored", "Ignored"):
            assert default, f"the docstring of {key} says no default={parameter.default!r}"
            value = default[1].strip("`").rstrip(".")
            assert value.replace("'", '"') == repr(parameter.default).replace("'", '"'), key


def test_every_public_object_has_an_example():
    without = [name for name, each in OBJECTS.items() if ">>> " not in inspect.getdoc(each)]
    assert without == []
