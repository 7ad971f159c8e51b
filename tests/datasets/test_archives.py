"""load_trials: valid archives, and every fault with its message."""

import struct
import tracemalloc
import zipfile

import numpy as np
import pytest
from sklearn_motionsync import Skeleton
from sklearn_motionsync.datasets import load_trials

import fuzz_readers
from damaged_archives import archive, fields, make_archives, with_header
from motion_files import npy


def replaced(name, place, value, dtype=None):
    """A field with another value at a place."""
    values = np.array(fields()[name], dtype)
    values[place] = value
    return {name: values}


@pytest.mark.parametrize("number", range(4))
def test_archive_becomes_a_bunch(tmp_path, number):
    """Of any compression, order in memory and types of its arrays."""
    content, path = fields(), tmp_path / "a.npz"
    path.write_bytes(make_archives()[number])
    bunch = load_trials(str(path))
    assert [x.shape for x in bunch.data] == [(5, 60), (7, 60)]
    assert bunch.data[0].dtype == (np.float32 if number < 2 else np.float64)
    np.testing.assert_array_equal(bunch.data[1], content["positions"][5:].reshape(7, 60))
    bunch.data[1][0] = 0  # it can be written to
    assert bunch.target.tolist() == ["bow", "w\u00e4ve"]
    assert bunch.actor.tolist() == (["A", "B"] if number < 2 else ["1", "2"])
    assert bunch.skeleton == Skeleton.kinect()
    np.testing.assert_array_equal(bunch.frame_rate, [30, np.nan if number < 2 else 25])
    np.savez(path, **content | {"joints": [f"m{i}" for i in range(20)]})
    assert load_trials(path).skeleton is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"offsets": None}, r"lacks \['offsets'\]"),
        ({"positions": np.zeros((12, 60))}, r"must be floats of the shape \(F, joints, 3\)"),
        ({"positions": np.zeros((12, 20, 3), int)}, "must be floats"),
        ({"offsets": [0, 5, 11]}, "offsets must increase from 0 to the 12 frames"),
        ({"offsets": [0, 11, 12]}, "by at least 2 for each trial"),
        ({"offsets": [0.0, 5.0, 12.0]}, "whole numbers"),
        # Differences of unsigned numbers are never negative.
        *(({"offsets": np.array([0, 13, 12], t)}, "offsets must inc") for t in ("u1", "u8")),
        ({"offsets": np.array([0, 2**64 - 2, 12], "u8")}, "offsets must increase"),
        (
            {"label": ["bow"]},
            r"label must be text of the shape \(N\), where N is 2, .*, got <U3 \(1,\)",
        ),
        ({"label": np.array([{}, {}], dtype=object)}, "cannot be read as a NumPy .npz archive"),
        (replaced("positions", (7, 0, 1), np.nan), r"trial 1, frame 2, .*HipCenter_y'\) is N"),
        (replaced("positions", (7, 0, 1), 2e7), r"trial 1 has positions beyond 1e\+07"),
        *(
            (replaced("parents", 1, parent, float), "parents must be indices of joints, whole num")
            for parent in (0.5, np.nan, 20, -2, 2**40)
        ),
        (replaced("parents", 1, 2), "for a root, to which they lead in no cycle, got"),
        ({"joints": ["a"] * 2 + list("bcdefghijklmnopqrs")}, r"different names, got \['a', 'a'"),
        ({"joints": np.arange(20)}, "joints must be text .*, got int64"),
        *(({"fps": [30, f]}, "fps must be frames per second, above 0") for f in (0, -1, np.inf)),
        ({"fps": ["30", "60"]}, "fps must be numbers"),
        ({"actor": [1.0, np.nan]}, "actor must be text .*, got float64"),
        *(
            ({"label": label}, "label must be text, got other bytes")
            for label in (
                np.array([b"\xff", b"a"]),
                *(np.array([code, 65], "u4").view("U1") for code in (0x110000, 2**32 - 1)),
                np.array([0xD800, 65], "u4").view("U1"),
            )
        ),
    ],
)
def test_wrong_fields_are_refused(tmp_path, change, message):
    content = {k: v for k, v in (fields() | change).items() if v is not None}
    np.savez(tmp_path / "a.npz", **content)
    with pytest.raises(ValueError, match=rf"a\.npz.* {message}|a\.npz {message}") as caught:
        load_trials(tmp_path / "a.npz")
    assert str(caught.value).startswith(str(tmp_path))


def test_other_files_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="no archive at"):
        load_trials(tmp_path / "a.npz")
    for content in (b"", b"text", b"PK\x03\x04 and then nothing", npy(np.zeros(3))):
        (tmp_path / "a.npz").write_bytes(content)
        with pytest.raises(ValueError, match=r"cannot be read as a NumPy \.npz archive"):
            load_trials(tmp_path / "a.npz")


# -- damaged archives -------------------------------------------------------------------


SHAPE = "{{'descr': '<f4', 'fortran_order': False, 'shape': {}}}"
HEADERS = [
    SHAPE.format("(12, 20, 4)"),
    SHAPE.format("(10**9,)"),
    SHAPE.format("(" * 3000),
    SHAPE.replace("<f4", "O").format("(12, 20, 3)"),
    "",
]


@pytest.mark.parametrize("header", HEADERS, ids=range(len(HEADERS)))
def test_wrong_headers_are_refused(tmp_path, header):
    path = archive(tmp_path / "a.npz", positions=with_header(fields()["positions"], header))
    with pytest.raises(ValueError, match=r"a\.npz") as caught:
        load_trials(path)
    assert type(caught.value) is ValueError
    assert len(str(caught.value)) < 500 + len(str(path))


def test_archives_that_unpack_to_very_much_are_refused_before(tmp_path):
    path, shape = tmp_path / "a.npz", (40_000, 100, 3)
    zeros = with_header(np.zeros(0), SHAPE.replace("<f4", "<f8").format(shape))
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, values in fields().items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as member:
                member.write(npy(np.asarray(values)) if name != "positions" else zeros)
                for _ in range(96 * (name == "positions")):
                    member.write(bytes(10**6))
    assert path.stat().st_size < 10**6
    message = r"a\.npz: the arrays would take 92 MB, from a file of 0\.\d+ MB\. No recording grows"
    tracemalloc.start()
    with pytest.raises(ValueError, match=message):
        load_trials(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10**7
    # A directory that states less: no more than that is unpacked.
    content = path.read_bytes()
    size = struct.pack("<I", 96 * 10**6 + len(zeros))
    at = content.rindex(size)
    path.write_bytes(content[:at] + struct.pack("<I", 5000) + content[at + 4 :])
    with pytest.raises(ValueError, match=r"a\.npz cannot be read as a NumPy \.npz archive"):
        load_trials(path)


def test_damaged_archives_are_read_or_refused(tmp_path):
    originals = [{"a.npz": content} for content in make_archives()]
    outcomes = [
        fuzz_readers.run_case(fuzz_readers.damaged(originals, 0, number), tmp_path)
        for number in range(100)
    ]
    assert set(outcomes) == {"read", "ValueError"}
