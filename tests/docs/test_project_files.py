"""The project's papers: what they say of versions, files and pages is what the repository has."""

import importlib.util
import re
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CITATION = ROOT / "CITATION.cff"


def load(name):
    return yaml.safe_load((ROOT / name).read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def floors():
    spec = importlib.util.spec_from_file_location("floors", ROOT / ".ci" / "floors.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("requirement", "pin"),
    [
        ("numpy>=2.0", "numpy==2.0.*"),
        ("sphinx-design>=0.6.1", "sphinx-design==0.6.1.*"),
        ("dask[array]>=2024.8", "dask==2024.8.*"),
        ("ruff>=0.8,<2", "ruff==0.8.*"),
        ('spm1d>=0.4; python_version < "3.14"', 'spm1d==0.4.* ; python_version < "3.14"'),
    ],
)
def test_floor_is_the_oldest_allowed_version(floors, requirement, pin):
    assert floors.pin(requirement) == pin


@pytest.mark.parametrize("requirement", ["numpy", "numpy<3", "numpy==2.0"])
def test_requirement_without_a_floor_is_refused(floors, requirement):
    with pytest.raises(ValueError, match=re.escape(repr(requirement)) + ".*>="):
        floors.pin(requirement)


def test_every_test_requirement_has_a_floor(floors):
    names = {line.split("==")[0] for line in floors.constraints(ROOT / "pyproject.toml")}
    assert {"numpy", "scipy", "scikit-learn", "pandas", "matplotlib", "pytest"} <= names
    asked = PROJECT["dependencies"] + [
        each for extra in ("plot", "test") for each in PROJECT["optional-dependencies"][extra]
    ]
    others = {line.split("==")[0] for line in floors.COMPANIONS}
    assert names - others == {re.match(r"[\w.-]+", each)[0] for each in asked}


def test_python_classifiers_equal_the_tested_versions():
    named = re.findall(r"Python :: (3\.\d+)", "\n".join(PROJECT["classifiers"]))
    jobs = load(".github/workflows/tests.yml")["jobs"]
    assert jobs["tests"]["strategy"]["matrix"]["python"] == named
    assert PROJECT["requires-python"] == f">={named[0]}"
    setup = jobs["floors"]["steps"][1]
    assert setup["with"]["python-version"] == named[0]


def test_citation_file_is_valid():
    citation = load("CITATION.cff")
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert citation["license"] == PROJECT["license"]
    assert citation["authors"] == [{"name": PROJECT["authors"][0]["name"]}]
    assert citation["url"] == PROJECT["urls"]["Documentation"]
    for reference in citation["references"]:
        assert {"type", "title", "authors"} <= set(reference)


def test_project_urls_are_pages_of_the_manual():
    start = PROJECT["urls"]["Documentation"]
    for address in PROJECT["urls"].values():
        assert address.startswith(start)
        page = address.removeprefix(start).strip("/") or "index.html"
        assert (ROOT / "docs" / page.replace(".html", ".md")).is_file()


def test_publish_workflow_needs_no_secret():
    text = (ROOT / ".github" / "workflows" / "publish.yml").read_text(encoding="utf-8")
    publish = yaml.safe_load(text)["jobs"]["publish"]
    assert publish["permissions"] == {"id-token": "write"}
    assert not re.search(r"secrets\.|password|token:(?! write)", text)


def test_issue_templates_ask_for_version_and_code():
    folder = ROOT / ".github" / "ISSUE_TEMPLATE"
    for path in sorted(folder.glob("*.yml")):
        form = load(path)
        if path.stem == "config":
            continue
        assert {"name", "description", "body"} <= set(form), path.name
        ids = [field["id"] for field in form["body"] if field["type"] != "markdown"]
        assert len(ids) == len(set(ids)), path.name
    names = {path.stem for path in folder.glob("*.yml")}
    assert names == {"bug", "config", "data", "idea"}


def test_manifest_includes_every_folder():
    manifest = (ROOT / "MANIFEST.in").read_text(encoding="utf-8")
    for folder in ("tests", "docs", "examples", "benchmarks", ".ci", ".github"):
        assert f"graft {folder}\n" in manifest
    for name in re.findall(r"^include (.+)$", manifest, re.MULTILINE):
        for each in name.split():
            assert (ROOT / each).is_file(), each
