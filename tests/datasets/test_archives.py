"""Archives of performances, good and bad."""

import struct
import tracemalloc
import zipfile

import numpy as np
import pytest
from sklearn_motionsync import Skeleton
from sklearn_motionsync.datasets import load_performances

import fuzz_readers
from damaged_archives import archive, fields, npy


def bad(value):
    positions = fields()["positions"]
    positions[7, 0, 1] = value
    return positions


def parents(parent):
    """The Kinect's, but for the second joint's."""
    values = np.array(Skeleton.kinect().parents, float)
    values[1] = parent
    return values if parent % 1 or not np.isfinite(parent) else values.astype(int)


def test_an_archive(tmp_path):
    content = fields()
    np.savez(tmp_path / "a.npz", **content)
    bunch = load_performances(str(tmp_path / "a.npz"))
    assert [x.shape for x in bunch.data] == [(5, 60), (7, 60)]
    assert bunch.data[0].dtype == np.float32
    np.testing.assert_array_equal(bunch.data[1], content["positions"][5:].reshape(7, 60))
    assert bunch.target.tolist() == ["bow", "wave"]
    assert bunch.actor.tolist() == ["A", "B"]
    assert bunch.skeleton == Skeleton.kinect()
    assert bunch.frame_rate[0] == 30
    assert np.isnan(bunch.frame_rate[1])


def test_archives_that_say_the_same_otherwise(tmp_path):
    """Compressed, by columns, of another machine's byte order, numbers and bytes for text."""
    content = fields()
    other = content | {
        "positions": np.asfortranarray(content["positions"].astype(">f4")),
        "offsets": np.array(content["offsets"], ">u2"),
        "actor": [1, 2],
        "label": np.array(["bow", "w\u00e4ve".encode()], "S"),
        "parents": np.array(content["parents"], float),
        "fps": [30, 25],
    }
    np.savez_compressed(tmp_path / "a.npz", **other)
    bunch = load_performances(tmp_path / "a.npz")
    assert bunch.data[1].dtype == np.float32
    np.testing.assert_array_equal(bunch.data[1], content["positions"][5:].reshape(7, 60))
    bunch.data[1][0] = 0  # it can be written to
    assert bunch.actor.tolist() == ["1", "2"]
    assert bunch.target.tolist() == ["bow", "w\u00e4ve"]
    assert bunch.skeleton == Skeleton.kinect()


def test_an_archive_of_something_else_than_a_body(tmp_path):
    np.savez(tmp_path / "a.npz", **fields() | {"joints": [f"m{i}" for i in range(20)]})
    assert load_performances(tmp_path / "a.npz").skeleton is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"offsets": None}, r"lacks \['offsets'\]"),
        ({"positions": np.zeros((12, 60))}, r"shape \(frames, joints, 3\)"),
        ({"positions": np.zeros((12, 20, 3), int)}, "must be floats"),
        ({"offsets": [0, 5, 11]}, "offsets must increase from 0 to the 12 frames"),
        ({"offsets": [0, 12, 5]}, "offsets must increase"),
        ({"offsets": [0, 0, 12]}, "offsets must increase"),
        ({"offsets": [0.0, 5.0, 12.0]}, "whole numbers"),
        ({"label": ["bow"]}, r"label must have shape \(2,\), got \(1,\)"),
        ({"joints": ["a"]}, r"joints must have shape \(20,\)"),
        ({"label": np.array([{}, {}], dtype=object)}, "cannot be read.*label holds Python objects"),
        # Differences of unsigned numbers do not become negative.
        *(({"offsets": np.array([0, 12, 5, 12], t)}, "offsets must inc") for t in ("u1", "u8")),
        ({"offsets": np.array([0, 2**64 - 1, 12], "u8")}, "offsets must increase"),
        ({"offsets": [0, -3, 12]}, "offsets must increase"),
        ({"offsets": [0, 11, 12]}, "performance 1 has one frame; a performance needs at least 2"),
        ({"positions": np.zeros((12, 0, 3))}, r"must be floats of shape .*\(12, 0, 3\)"),
        ({"positions": bad(np.nan)}, "performance 1, frame 2, joint 'HipCenter' is NaN or inf"),
        ({"positions": bad(-np.inf)}, "performance 1, frame 2, joint .* Interpolate the gap"),
        *(
            ({"parents": parents(p)}, message)
            for p, message in (
                (0.5, r"parents must be indices of joints, whole numbers from 0 to 19, or -1"),
                (np.nan, "parents must be indices"),
                (np.inf, "parents must be indices"),
                (20, "parents must be indices"),
                (-2, "parents must be indices"),
                (2**40, "parents must be indices"),
                (1, "parents must lead to a root .*, but from joint 'Spine' they run in a circle"),
                (2, "they run in a circle"),
            )
        ),
        ({"parents": ["0"] * 20}, "parents must be indices"),
        ({"joints": ["a"] * 2 + list("bcdefghijklmnopqrs")}, "different names, got 'a' more than"),
        ({"joints": np.arange(20)}, "joints must be text, got int64"),
        *(({"fps": [30, f]}, r"fps must be frames a second, above 0, or NaN") for f in (0, -1)),
        ({"fps": [30, np.inf]}, "fps must be"),
        ({"fps": ["30", "60"]}, "fps must be"),
        *(
            ({name: values}, f"{name} must be text, got ")
            for name in ("label", "actor", "take")
            for values in ([1.0, np.nan], [True, False], np.array([1, 2], "M8[s]"), [1j, 2])
        ),
        ({"label": np.array([b"\xff", b"a"])}, "label must be text, got bytes that are none"),
        ({"label": np.array([0x110000, 65], "u4").view("U1")}, "label must be text, got bytes"),
        ({"label": np.array([0xD800, 65], "u4").view("U1")}, "label must be text, got bytes"),
    ],
)
def test_bad_archives(tmp_path, change, message):
    content = {k: v for k, v in (fields() | change).items() if v is not None}
    np.savez(tmp_path / "a.npz", **content)
    with pytest.raises(ValueError, match=rf"a\.npz.* {message}|a\.npz {message}") as caught:
        load_performances(tmp_path / "a.npz")
    assert str(caught.value).startswith(str(tmp_path))


@pytest.mark.parametrize("content", [b"", b"text", b"PK\x03\x04 and then nothing"])
def test_files_that_are_no_archives(tmp_path, content):
    (tmp_path / "a.npz").write_bytes(content)
    with pytest.raises(ValueError, match=r"cannot be read as a NumPy \.npz archive"):
        load_performances(tmp_path / "a.npz")


def test_a_single_array_is_no_archive(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros(3))
    with pytest.raises(ValueError, match="cannot be read"):
        load_performances(tmp_path / "a.npy")


def test_no_file(tmp_path):
    with pytest.raises(FileNotFoundError, match="no archive at"):
        load_performances(tmp_path / "a.npz")


def test_real_archives(real_data):
    bunch = load_performances(real_data / "hdm05" / "hdm05_positions.npz")
    assert len(bunch.data) == len(bunch.target) == 132
    assert bunch.skeleton == Skeleton.acclaim()
    assert load_performances(real_data / "utkinect" / "utkinect_positions.npz").skeleton is not None
    assert load_performances(real_data / "cmu07_walk" / "cmu07_walk_positions.npz").skeleton


# -- garbled archives -------------------------------------------------------------------


def headers():
    shape = "{{'descr': '<f4', 'fortran_order': False, 'shape': {}}}"
    yield from (shape.format(s) for s in ("(12, 20, 4)", "(-12, 20, -3)", "(10**9,)", "12", "None"))
    yield from (shape.format(s) for s in ("(12, 20, 3", "(12, 20, '3')", "(" * 3000))
    yield from ("", "\0" * 50, "{", "[1, 2]", "x" * 20000, "'\\N{'", "{'descr': '<f4'}")
    yield from (shape.replace("<f4", d).format("(12, 20, 3)") for d in ("O", "U0", "V4", "f3", "?"))
    yield "{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (12, 20, 3)}"
    yield "{'descr': ('<f4', (2,)), 'fortran_order': False, 'shape': (12, 20, 3)}"


@pytest.mark.parametrize("header", list(headers()), ids=lambda header: header[-40:])
def test_headers_that_make_no_sense(tmp_path, header):
    path = archive(tmp_path / "a.npz", positions=npy(fields()["positions"], header))
    with pytest.raises(ValueError, match=r"a\.npz") as caught:
        load_performances(path)
    assert type(caught.value) is ValueError
    assert str(caught.value).startswith(str(path))
    assert len(str(caught.value)) < 500 + len(str(path))


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_archives_that_numpy_did_not_write(tmp_path, method):
    with pytest.raises(ValueError, match=r"cannot be read .* is encrypted, or packed as"):
        load_performances(archive(tmp_path / "a.npz", method))


def test_an_array_that_comes_twice(tmp_path):
    path = archive(tmp_path / "a.npz")
    with (
        pytest.warns(UserWarning, match="Duplicate name"),
        zipfile.ZipFile(path, "a") as file,
    ):
        file.writestr("label.npy", npy(np.array(["x", "y"])))
    with pytest.raises(ValueError, match=r"cannot be read .* it holds label twice"):
        load_performances(path)


@pytest.mark.parametrize("compression", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_garbled_bytes(tmp_path, compression):
    """Whatever byte is wrong: ours or nothing."""
    path = archive(tmp_path / "a.npz", compression)
    content, rng = path.read_bytes(), np.random.default_rng(0)
    errors = []
    for at in [*range(0, 400, 3), *range(len(content) - 700, len(content), 3)]:
        path.write_bytes(content[:at] + rng.bytes(1) + content[at + 1 :])
        try:
            load_performances(path)
        except Exception as error:
            errors.append(error)
    assert len(errors) > 100
    assert {type(error) for error in errors} == {ValueError}
    assert all(str(error).startswith(str(path)) for error in errors)


def zeros(shape):
    return npy(np.zeros(0), f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}}}")


def test_archives_that_unpack_to_very_much(tmp_path):
    """Neither what they say nor what they hold is unpacked."""
    path = tmp_path / "a.npz"
    shape = (100_000, 100, 3)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, values in fields().items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as member:
                member.write(npy(np.asarray(values)) if name != "positions" else zeros(shape))
                for _ in range(240 * (name == "positions")):
                    member.write(bytes(10**6))
    assert path.stat().st_size < 10**6
    message = r"a\.npz: the arrays would take 229 MB, from a file of 0\.\d+ MB\. No recording grows"
    tracemalloc.start()
    with pytest.raises(ValueError, match=message):
        load_performances(path)
    # The directory may lie; then no more is unpacked than it says.
    content = path.read_bytes()
    size = struct.pack("<I", 240 * 10**6 + len(zeros(shape)))
    at = content.rindex(size)
    path.write_bytes(content[:at] + struct.pack("<I", 5000) + content[at + 4 :])
    with pytest.raises(ValueError, match=r"positions says float64 .* bytes, but there are \d+ of"):
        load_performances(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10**7


def test_damaged_archives(tmp_path):
    """A short run of tests/datasets/fuzz_readers.py."""
    originals = fuzz_readers.load_originals("archives")
    outcomes = [
        fuzz_readers.run_case(fuzz_readers.damaged(originals, 0, number), tmp_path)
        for number in range(300)
    ]
    assert set(outcomes) == {"read", "ValueError"}
