"""The examples of the gallery run."""

import runpy
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.mark.parametrize("script", sorted(EXAMPLES.glob("plot_*.py")), ids=lambda path: path.stem)
def test_a_page_of_the_gallery_runs_and_draws(script, tmp_path, monkeypatch):
    if "spm1d" in script.read_text(encoding="utf-8"):
        pytest.importorskip("spm1d", reason="this page compares with spm1d")
    # Some write their figures to the folder in which they run.
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(script)])
    plt.close("all")
    runpy.run_path(str(script), run_name="__main__")
    assert plt.get_fignums()
    plt.close("all")
