"""The example stream_files.py: results of every method, also after a kill."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import joblib
import numpy as np
import pytest
import sklearn_motionsync
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ActionModel, ASpace, DenseSynchronizer, Match

import stream_files

SCRIPT = Path(stream_files.__file__)
PACKAGE = Path(sklearn_motionsync.__file__).parents[1]


def walks(n, seed):
    random = np.random.default_rng(seed)
    lengths = random.integers(30, 50, n)
    return [np.cumsum(random.standard_normal((length, 3)), axis=0) for length in lengths]


PORTIONS = {
    "a.npz": walks(6, 1),
    "b.npy": np.stack([x[:30] for x in walks(5, 2)]),
    "c.npz": walks(1, 3),
    "d.npy": np.stack([x[:30] for x in walks(4, 4)]).astype(np.float32),
}


@pytest.fixture(scope="module")
def fitted():
    steps = ASpace(2), DenseSynchronizer(n_frames=40), ActionModel()
    return make_pipeline(*steps).fit(walks(12, 0))


@pytest.fixture
def files(fitted, tmp_path):
    """The model, the portions, and a folder for results that does not exist yet."""
    (tmp_path / "walks").mkdir()
    joblib.dump(fitted, tmp_path / "model.joblib")
    joblib.dump(fitted[:-1], tmp_path / "synchronizer.joblib")
    for name, portion in PORTIONS.items():
        if name.endswith(".npz"):
            np.savez(tmp_path / "walks" / name, *portion)
        else:
            np.save(tmp_path / "walks" / name, portion)
    return tmp_path / "synchronizer.joblib", tmp_path / "walks", tmp_path / "out"


def assert_synchronized(folder, fitted):
    assert sorted(path.name for path in folder.glob("*.np*")) == [f"{x}.npy" for x in "abcd"]
    for name, portion in PORTIONS.items():
        expected, got = fitted[:-1].transform(portion), np.load(folder / f"{name[0]}.npy")
        assert (got.dtype, got.tobytes()) == (expected.dtype, expected.tobytes())


def test_stream_equals_transform_with_one_or_two_jobs(files, fitted, capsys):
    model, walks, out = files
    assert [wrong for _, wrong in stream_files.stream(*files)] == [None] * 4
    assert_synchronized(out, fitted)
    two = [*map(str, (model, walks, out.with_name("two"))), "--n-jobs", "2"]
    assert stream_files.main(two) == 0
    assert capsys.readouterr().out.split("\n")[:2] == ["a.npz: done", "b.npy: done"]
    assert_synchronized(out.with_name("two"), fitted)


def test_stream_equals_match_and_score_samples(files, fitted):
    whole = files[0].with_name("model.joblib")
    assert len(list(stream_files.stream(*files, method="match"))) == 4
    scored = files[2].with_name("scored")
    assert len(list(stream_files.stream(whole, files[1], scored, "score_samples"))) == 4
    for name, portion in PORTIONS.items():
        match = Match.from_estimator(fitted, portion)
        with np.load(files[2] / f"{name[0]}.npz") as found:
            assert found["times"].tobytes() == match.times.tobytes()
            assert found["distances"].tobytes() == match.distances.tobytes()
        scores = np.load(scored / f"{name[0]}.npy")
        assert scores.tobytes() == fitted.score_samples(portion).tobytes()


# Killed when the third result is written, but not renamed yet.
KILLED = """
import os, signal, sys
import stream_files

n_written, keep = 0, os.fsync

def write(file):
    global n_written
    n_written += 1
    if n_written == 3:
        os.kill(os.getpid(), getattr(signal, "SIGKILL", signal.SIGTERM))
    keep(file)

os.fsync = write
list(stream_files.stream(*sys.argv[1:]))
"""


def test_stream_continues_after_a_kill(files, fitted):
    _, _, out = files
    paths = [str(PACKAGE), str(SCRIPT.parent), os.environ.get("PYTHONPATH", "")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, "-c", KILLED, *map(str, files)]
    killed = subprocess.run(command, env=environment, capture_output=True, check=False)
    assert killed.returncode != 0
    done = {path.name: path.stat().st_mtime_ns for path in out.glob("*.npy")}
    assert sorted(done) == ["a.npy", "b.npy"]
    assert len(list(out.glob("*.part"))) == 1
    assert [source.name for source, _ in stream_files.stream(*files)] == ["c.npz", "d.npy"]
    assert {name: (out / name).stat().st_mtime_ns for name in done} == done
    assert_synchronized(out, fitted)
    assert list(stream_files.stream(*files)) == []


def test_refused_and_unreadable_portions_do_not_stop_others(files, capsys):
    wrong = PORTIONS["b.npy"].copy()
    wrong[1, 4, 2] = np.inf
    np.save(files[1] / "b.npy", wrong)
    whole = (files[1] / "a.npz").read_bytes()
    broken = {"e.npz": whole[:-30], "f.npy": b"", "g.npz": whole[:90] + b"12345678" + whole[98:]}
    for name, content in broken.items():
        (files[1] / name).write_bytes(content)
    assert stream_files.main([str(path) for path in files]) == 1
    printed = capsys.readouterr().out
    assert re.search(r"^b\.npy: Trial 1.*infinity", printed, re.MULTILINE)
    for name in broken:
        pattern = rf"^{re.escape(name)}: .*It cannot be read, is it whole\? "
        assert re.search(pattern, printed, re.MULTILINE)
    assert sorted(path.name for path in files[2].glob("*.np*")) == ["a.npy", "c.npy", "d.npy"]


def test_wrong_arguments_leave_no_folder(files):
    model, walks, out = files
    whole = model.with_name("model.joblib")
    for arguments, message in (
        ((whole, walks, out), r"ends in ActionModel and has no transform: .* --method"),
        ((whole, walks.with_name("none"), out), r"no portions in .*: files \.npy or \.npz"),
        ((model, walks, walks / ".." / walks.name), r"Results among .* give another folder"),
    ):
        with pytest.raises(ValueError, match=message):
            next(stream_files.stream(*arguments))
    assert not out.exists()
    joblib.dump(DenseSynchronizer(), model)
    assert "not fitted yet" in next(stream_files.stream(*files))[1]
    # Results of two models or methods are not mixed.
    assert [wrong for _, wrong in stream_files.stream(whole, walks, out, "match")] == [None] * 4
    note = json.loads((out / "made_by.json").read_text(encoding="utf-8"))
    assert note["sklearn_motionsync"] == sklearn_motionsync.__version__
    with pytest.raises(ValueError, match="results of another model and another method"):
        next(stream_files.stream(*files))
    with pytest.raises(ValueError, match=r"results of another method \(made_by.json\)"):
        next(stream_files.stream(whole, walks, out, "score_samples"))
    message = stream_files.main([*map(str, files), "--method", "match"])
    assert "holds results of another model (made_by.json): give another folder" in message
    np.save(walks / "a.npy", PORTIONS["b.npy"])
    with pytest.raises(ValueError, match=r"a\.npy and a\.npz would have one result"):
        next(stream_files.stream(*files))
