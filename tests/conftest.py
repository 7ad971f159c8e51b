"""Settings and data all tests share."""

import importlib
import os
from pathlib import Path

# Must be set before scipy is imported, for scikit-learn's array API checks.
os.environ.setdefault("SCIPY_ARRAY_API", "1")

import numpy as np
import pytest
from sklearn.utils import Bunch
from sklearn_motionsync import ASpace, DirectionCosines
from sklearn_motionsync.datasets import load_trials, make_bending

BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"
REAL_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def real_data():
    """The folder of real motion capture, which is not part of the repository."""
    if not REAL_DATA.is_dir():
        pytest.skip("the real motion capture is not beside the repository (../shared/data)")
    return REAL_DATA


@pytest.fixture(scope="module")
def benchmark():
    """Imports modules of the benchmarks, which import each other as they lie there."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(BENCHMARKS)
        yield importlib.import_module


@pytest.fixture
def without_pictures(monkeypatch):
    """Figures of a report are made and not rendered, which takes most of its time."""
    save = "matplotlib.figure.Figure.savefig"
    monkeypatch.setattr(save, lambda figure, file, **settings: file.write(b"\x89PNG"))


@pytest.fixture(scope="module")
def known_warps(benchmark):
    """Copies of a random movement with gains and known warps, of rates from 0.5 to 2."""

    def make(seed, noise, n_features=16, n=8):
        return benchmark("accuracy").known_warps(seed, 0.5, 2.0, noise, n=n, n_features=n_features)

    return make


@pytest.fixture(scope="session")
def hdm05(real_data):
    """Joint positions of clips of optical motion capture."""
    return load_trials(real_data / "hdm05" / "hdm05_positions.npz")


@pytest.fixture(scope="session")
def utkinect(real_data):
    """Joint positions of clips of a Kinect."""
    return load_trials(real_data / "utkinect" / "utkinect_positions.npz")


@pytest.fixture(scope="session")
def bends(hdm05):
    """The 24 real bends of four actors: joint positions."""
    bunch, chosen = Bunch(**hdm05), np.flatnonzero(hdm05.target == "depositFloorR")
    bunch.data = [bunch.data[i] for i in chosen]
    for name in ("target", "actor", "take", "frame_rate"):
        bunch[name] = bunch[name][chosen]
    return bunch


@pytest.fixture(scope="session")
def bending():
    return make_bending(random_state=0)


@pytest.fixture(scope="session")
def bending_aspace(bending):
    """The bending trials as points of their aSpace."""
    poses = DirectionCosines(bending.skeleton).fit_transform(bending.data)
    return ASpace().fit_transform(poses)
