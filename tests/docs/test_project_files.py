"""The project's papers: what they say of versions, files and pages is what the repository has."""

import importlib.util
import re
import subprocess
import tomllib
from pathlib import Path

import pytest
import sklearn_motionsync
import yaml

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CITATION = ROOT / "CITATION.cff"


def load(name):
    return yaml.safe_load((ROOT / name).read_text(encoding="utf-8"))


def script(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def floors():
    return script(ROOT / ".ci" / "floors.py")


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
    extras = PROJECT["optional-dependencies"]
    asked = PROJECT["dependencies"] + extras["plot"] + extras["test"]
    others = {line.split("==")[0] for line in floors.COMPANIONS}
    assert names - others == {re.match(r"[\w.-]+", each)[0] for each in asked}


def test_python_classifiers_equal_the_tested_versions():
    named = re.findall(r"Python :: (3\.\d+)", "\n".join(PROJECT["classifiers"]))
    jobs = load(".github/workflows/tests.yml")["jobs"]
    assert jobs["tests"]["strategy"]["matrix"]["python"] == named
    assert PROJECT["requires-python"] == f">={named[0]}"
    assert jobs["floors"]["steps"][1]["with"]["python-version"] == named[0]


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
    text = (ROOT / ".github/workflows/publish.yml").read_text(encoding="utf-8")
    publish = yaml.safe_load(text)["jobs"]["publish"]
    assert publish["permissions"] == {"contents": "write", "id-token": "write"}
    assert not re.search(r"secrets\.|password|token:(?! write)", text)


def test_issue_templates_are_forms_with_fields_of_their_own():
    forms = {path.stem: load(path) for path in (ROOT / ".github/ISSUE_TEMPLATE").glob("*.yml")}
    assert set(forms) == {"bug", "config", "data", "idea"}
    del forms["config"]
    for name, form in forms.items():
        assert {"name", "description", "body"} <= set(form), name
        ids = [field["id"] for field in form["body"] if field["type"] != "markdown"]
        assert len(ids) == len(set(ids)), name


def test_manifest_includes_every_folder():
    manifest = (ROOT / "MANIFEST.in").read_text(encoding="utf-8")
    folders = {"tests", "docs", "examples", "benchmarks", "paper", "conda", ".ci", ".github"}
    assert folders <= set(re.findall(r"^graft (.+)$", manifest, re.MULTILINE))
    for name in re.findall(r"^include (.+)$", manifest, re.MULTILINE):
        for each in name.split():
            assert (ROOT / each).is_file(), each


def test_version_is_the_same_everywhere():
    version = sklearn_motionsync.__version__
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    headings = re.findall(r"^## \[([^]]+)\](?: - (\S+))?$", changelog, re.MULTILINE)
    assert headings[0] == ("Unreleased", "")
    citation = load("CITATION.cff")
    assert headings[1] == (version, str(citation["date-released"]))
    assert citation["version"] == version
    assert load("conda/recipe.yaml")["context"]["version"] == version


@pytest.mark.parametrize(
    ("version", "status"), [(sklearn_motionsync.__version__, 0), ("Unreleased", 1), ("9.9.9", 1)]
)
def test_release_notes_are_the_section_of_the_changelog(version, status):
    done = subprocess.run(
        ["bash", ".ci/notes", version], cwd=ROOT, capture_output=True, text=True, encoding="utf-8"
    )
    assert done.returncode == status
    assert ("### Added" in done.stdout) == (status == 0)
    assert "## [" not in done.stdout


def test_conda_recipe_requires_what_the_project_requires():
    recipe = load("conda/recipe.yaml")
    run = {line.replace(" ", "") for line in recipe["requirements"]["run"]}
    assert run == {f"python{PROJECT['requires-python']}", *PROJECT["dependencies"]}
    build = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]
    host = {line.replace(" ", "") for line in recipe["requirements"]["host"]}
    assert set(build["requires"]) <= host
    assert recipe["about"]["license"] == PROJECT["license"]


def test_description_on_the_package_index_links_to_pages_of_the_manual():
    setup = script(ROOT / "setup.py")
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    files = re.findall(r"\]\(([^)]+)\)", readme)
    known = [file for file in files if setup.address(file)]
    # The manual has no page of these.
    others = {".github/SUPPORT.md", "CITATION.cff", "CONTRIBUTING.md"}
    assert set(files) - set(known) == others
    addresses = re.findall(r"\]\(([^)]+)\)", setup.description(readme))
    assert addresses == [setup.address(file) for file in known]
    start = PROJECT["urls"]["Documentation"]
    assert setup.address("docs/howto/live.md") == f"{start}/howto/live.html"
    assert setup.address("examples/plot_blend.py") == f"{start}/auto_examples/plot_blend.html"
    assert setup.address("docs/_static/a.png") == f"{start}/_static/a.png"
    text = "Read [this](docs/tutorial.md), and [`that`](LICENSE)."
    assert setup.description(text) == f"Read [this]({start}/tutorial.html), and `that`."


def test_journal_paper_cites_its_bibliography_and_has_the_sections():
    paper = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
    bibliography = (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8")
    _, metadata, text = paper.split("---\n", maxsplit=2)
    metadata = yaml.safe_load(metadata)
    assert {"title", "tags", "authors", "affiliations", "date", "bibliography"} <= set(metadata)
    entries = re.findall(r"^@\w+\{(\w+),$", bibliography, re.MULTILINE)
    assert len(entries) == len(set(entries)) > 15
    assert set(re.findall(r"@(\w+)", text)) == set(entries)
    sections = re.findall(r"^# (.+)$", text, re.MULTILINE)
    needed = ["Summary", "Statement of need", "State of the field", "Software design"]
    assert sections[:4] == needed
    assert 750 <= len(text.split()) <= 1750
