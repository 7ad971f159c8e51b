"""benchmarks/hdm05.py: the archive it makes of downloaded files, against the one of the tests."""

import re
import shutil
import sys

import numpy as np
import pytest
from sklearn_motionsync.datasets import load_trials


@pytest.fixture(scope="module")
def hdm05(benchmark):
    return benchmark("hdm05")


def make(hdm05, monkeypatch, *args):
    monkeypatch.setattr(sys, "argv", ["hdm05.py", *map(str, args)])
    hdm05.main()


def test_archive_agrees_with_that_of_the_tests(hdm05, real_data, tmp_path, monkeypatch, capsys):
    output = tmp_path / "new" / "hdm05_positions.npz"
    make(hdm05, monkeypatch, real_data / "original_files", output)
    assert "3 clips, " in capsys.readouterr().out
    with np.load(real_data / "hdm05" / "hdm05_positions.npz") as file:
        archive = dict(file)
    with np.load(output) as file:
        made = dict(file)
    assert set(made) == set(archive)
    clips = [archive["source"].tolist().index(name) for name in made["source"]]
    assert sorted(clips) == clips
    for i, clip in enumerate(clips):
        positions, expected = (
            part["positions"][slice(*part["offsets"][k : k + 2])]
            for part, k in ((made, i), (archive, clip))
        )
        np.testing.assert_allclose(positions, expected, rtol=0, atol=2e-6)  # metres
    for name in ("label", "actor", "take", "fps"):
        assert made[name].tolist() == archive[name][clips].tolist()
    for name in ("joints", "parents"):
        assert made[name].tolist() == archive[name].tolist()
    for name, array in made.items():
        assert array.dtype.kind == archive[name].dtype.kind
    assert made["positions"].dtype == np.float32
    assert len(load_trials(output).data) == 3


def test_find_clips_finds_all_clips_of_the_archive_in_its_order(hdm05, real_data, tmp_path):
    with np.load(real_data / "hdm05" / "hdm05_positions.npz") as file:
        sources = file["source"].tolist()
    for number, name in enumerate(sources):
        folder = tmp_path / str(number % 7)
        folder.mkdir(exist_ok=True)
        (folder / name).touch()
        (folder / name.replace("_tr_", "_mm_")).touch()
    shutil.copytree(tmp_path / "0", tmp_path / "again")
    (tmp_path / "HDM_bd_depositFloorR_001_120.c3d").touch()
    assert [path.name for path, _ in hdm05.find_clips(tmp_path)] == sources


def test_missing_clips_and_skeletons_are_errors(hdm05, tmp_path, monkeypatch):
    with pytest.raises(
        SystemExit, match=re.escape(f"below {tmp_path}; download them as docs/bench")
    ):
        make(hdm05, monkeypatch, tmp_path, tmp_path / "a.npz")
    (tmp_path / "HDM_bd_grabHighR_001_120.amc").touch()
    with pytest.raises(SystemExit, match=r"\['HDM_bd\.asf'\] are not in"):
        make(hdm05, monkeypatch, tmp_path, tmp_path / "a.npz")
