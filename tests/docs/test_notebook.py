"""What a notebook shows: links of the diagrams, and the outputs of the example."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import sklearn_motionsync
from sklearn.pipeline import Pipeline
from sklearn.utils import estimator_html_repr
from sklearn_motionsync.utils.doc_links import DOCUMENTATION

from estimators import EVERY


def test_html_diagram_links_every_estimator():
    """Those of a room whose names are not at the top have their page under the room."""
    ours = [each for each in EVERY if type(each).__module__.startswith("sklearn_motionsync.")]
    html = estimator_html_repr(Pipeline([(f"step{k}", each) for k, each in enumerate(ours)]))
    pages = set(re.findall(rf"{DOCUMENTATION}/reference/([\w.]+)\.html", html))
    names = [(type(each).__module__.split("."), type(each).__name__) for each in ours]
    expected = {
        f"{package}.{name}" if name in sklearn_motionsync.__all__ else f"{package}.{room}.{name}"
        for (package, room, _), name in names
    }
    assert pages == expected


# -- the notebook of the examples -----------------------------------------------------------

NOTEBOOK = Path(__file__).resolve().parents[2] / "examples" / "dataframe.ipynb"
EXECUTE = """
import sys, nbclient, nbformat
notebook = nbformat.read(sys.argv[1], as_version=4)
nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
nbformat.write(notebook, sys.argv[2])
"""


@pytest.fixture(scope="module")
def notebook(tmp_path_factory):
    """The cells of the notebook, as they are kept and after running all of them."""
    executed = tmp_path_factory.mktemp("notebook") / "executed.ipynb"
    # In a process of its own: the client's warnings are not ours. A failing cell fails it.
    environment = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}
    done = subprocess.run(
        [sys.executable, "-c", EXECUTE, NOTEBOOK, executed],
        capture_output=True,
        text=True,
        timeout=600,
        env=environment,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return [
        [cell for cell in json.loads(path.read_text())["cells"] if cell["cell_type"] == "code"]
        for path in (NOTEBOOK, executed)
    ]


def test_notebook_outputs_equal_the_stored_ones(notebook):
    for kept, now in zip(*notebook, strict=True):
        assert kept["source"] == now["source"]
        kinds = [
            [sorted(output.get("data", {})) for output in cell["outputs"]] for cell in (kept, now)
        ]
        assert kinds[0] == kinds[1], f"run the notebook again: {kept['source']}"
        errors = [o for o in now["outputs"] if o["output_type"] in ("error", "stream")]
        assert errors == []


def test_notebook_synchronises_trials(notebook):
    shown = ["".join(o["data"].get("text/plain", "")) for c in notebook[1] for o in c["outputs"]]
    (table,) = [text for text in shown if "aligned" in text and "%" in text]
    left = [int(share) for share in re.findall(r"(\d+)%", table)]
    assert len(left) == 6
    assert max(left) < 50
