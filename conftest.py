"""What all tests and documented examples share: figures are closed, files go to a folder."""

import gc
import os
import sys

import pytest

os.environ.setdefault("MPLBACKEND", "Agg")


def pytest_collection():
    """Nothing of what is collected is garbage."""
    gc.disable()


def pytest_collection_finish():
    """What is collected stays until the end, so that no search for garbage needs to look at it."""
    gc.enable()
    gc.freeze()


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(request):
    """Documented examples may write files."""
    # Asked for here, so that no folder is made for each of thousands of tests.
    if isinstance(request.node, pytest.DoctestItem):
        request.getfixturevalue("monkeypatch").chdir(request.getfixturevalue("tmp_path"))


@pytest.fixture(autouse=True)
def _close_figures():
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
