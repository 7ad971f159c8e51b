"""What a notebook shows: links of the diagrams, and the outputs of the example."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from sklearn.pipeline import make_pipeline
from sklearn.utils import estimator_html_repr
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    JointPositions,
    LinearSynchronizer,
    PartSynchronizer,
    Skeleton,
)
from sklearn_motionsync.utils.doc_links import DOCUMENTATION

ESTIMATORS = [
    ActionModel(),
    ASpace(),
    DenseSynchronizer(),
    DirectionCosines(Skeleton.paper()),
    JointPositions(Skeleton.paper()),
    LinearSynchronizer(),
    PartSynchronizer(),
]


def test_html_diagram_of_a_pipeline_links_every_step():
    html = estimator_html_repr(make_pipeline(*ESTIMATORS[:0:-1], ESTIMATORS[0]))
    pages = set(re.findall(rf"{DOCUMENTATION}/reference/sklearn_motionsync\.(\w+)\.html", html))
    assert pages == {type(estimator).__name__ for estimator in ESTIMATORS}


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
    (table,) = (
        "".join(output["data"]["text/plain"])
        for cell in notebook[1]
        for output in cell["outputs"]
        if "aligned" in "".join(output.get("data", {}).get("text/plain", ""))
        and "%" in "".join(output["data"]["text/plain"])
    )
    left = [int(share) for share in re.findall(r"(\d+)%", table)]
    assert len(left) == 6
    assert max(left) < 50
