"""read_motion: what every reader of the registry owes, wrong calls, and files damaged at random."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync.io import fill_gaps, read_motion
from sklearn_motionsync.io.motion import ENDINGS, FORMATS

import fuzz_readers
from motion_files import EXAMPLES, c3d, put, storage, texts, tracks, trc

ROOT = Path(__file__).resolve().parents[2]
MANUAL = (ROOT / "docs" / "howto" / "motion_files.md").read_text(encoding="utf-8")
# What attrs["format"] may be.
KEYS = [
    each.name or ending.removeprefix(".")
    for each in FORMATS
    for ending in (each.endings if each.name is None else [""])
]


def read_example(folder, key, **params):
    files = EXAMPLES[key]()
    path, *_ = [put(folder, content, name) for name, content in files.items()]
    path = path.parent if path.suffix == ".json" else path
    return read_motion(path, max_gap=9 if key in ("c3d", "trc") else 0, **params)


# -- every reader -----------------------------------------------------------------------


def test_every_format_of_the_registry_has_its_example_and_documentation():
    assert set(KEYS) == set(EXAMPLES), "EXAMPLES of tests/io/motion_files.py has others"
    row = MANUAL.partition("| `format` |")[2].partition("\n")[0]
    lacking = [key for key in KEYS if f'"{key}"' not in row]
    lacking += [ending for ending in ENDINGS if f"`{ending}`" not in MANUAL]
    assert lacking == [], "docs/howto/motion_files.md does not list them"


@pytest.mark.parametrize("key", KEYS)
def test_every_reader_returns_a_table_with_its_attrs(tmp_path, key):
    df = read_example(tmp_path, key)
    assert set(df.dtypes) == {np.dtype(float)}
    assert df.columns.is_unique
    assert df.notna().all(axis=None)
    pd.testing.assert_index_equal(df.index, pd.RangeIndex(len(df), name="frame"))
    attrs = df.attrs
    assert json.loads(json.dumps(attrs, allow_nan=False)) == attrs
    assert attrs["format"] == key
    assert (attrs["trial"], attrs["levels"]) == ("a", ["recording", "frame"])
    assert {"frame_rate", "units", "up", "kind"} < set(attrs)
    assert ("first_time" in attrs) == (attrs["frame_rate"] is not None)
    assert ("joints" in attrs) == ("parents" in attrs) == ("channels" not in attrs)
    if "joints" in attrs:
        assert len(attrs["joints"]) == len(attrs["parents"])
        axes = "xyz"[: df.shape[1] // len(attrs["joints"])]
        assert list(df) == [f"{joint}_{axis}" for joint in attrs["joints"] for axis in axes]
    else:
        assert list(df) == attrs["channels"]
    given = read_example(tmp_path, key, frame_rate=20)
    changed = {key for key in given.attrs if given.attrs[key] != attrs.get(key)}
    # Times follow from frames where a file has no times; `test_clock` tells which.
    assert {"frame_rate", "report"} <= changed <= {"frame_rate", "report", "first_time", "events"}
    assert given.attrs["frame_rate"] == 20
    assert " at 20 Hz" in given.attrs["report"]
    pd.testing.assert_frame_equal(given, df)


@pytest.mark.parametrize("key", KEYS)
def test_every_reader_takes_its_ending_in_capitals_and_line_ends_of_windows(tmp_path, key):
    expected, (first, *_) = read_example(tmp_path, key), EXAMPLES[key]()
    for name, content in EXAMPLES[key]().items():
        (tmp_path / name).unlink()
        other = content if key in ("c3d", "array") else content.replace(b"\n", b"\r\n")
        put(tmp_path, other, name.upper())
    path = tmp_path / first.upper()
    path = path.parent if path.suffix == ".JSON" else path
    df = read_motion(path, max_gap=9 * ("joints" in expected.attrs))
    pd.testing.assert_frame_equal(df, expected)
    assert df.attrs == expected.attrs | {"trial": "A"}


@pytest.mark.parametrize("key", KEYS)
def test_damaged_files_are_read_or_refused(tmp_path, key):
    originals = [EXAMPLES[key]()]
    outcomes = {
        fuzz_readers.run_case(fuzz_readers.damaged(originals, 0, number), tmp_path)
        for number in range(100)
    }
    assert outcomes == {"read", "ValueError"}


@pytest.mark.parametrize(
    ("name", "make", "place"),
    [
        ("a.c3d", c3d, "M1_z"),
        ("a.trc", lambda x: trc(x, [*"ABC"]), "B_z"),
        ("a.sto", lambda x: storage(x.reshape(len(x), -1), [*"abcdefghi"]), "f"),
    ],
)
def test_numbers_of_no_recording_are_missing_with_a_warning(tmp_path, name, make, place):
    positions = tracks()
    positions[7, 1, 2] = 3e15
    message = rf"a\.\w+: frame 7 of '{place}' is 3e\+15, the first of 1 number that become missing"
    with pytest.warns(UserWarning, match="are missing"), pytest.warns(UserWarning, match=message):
        found = read_motion(put(tmp_path, make(positions), name)).to_numpy()
    hidden = positions.reshape(len(positions), -1) == 3e15
    hidden[7, 3:6] |= name != "a.sto"
    np.testing.assert_array_equal(np.isnan(found), hidden)
    with pytest.raises(ValueError, match=r"a\.\w+: frame 0 of .* No recording has numbers beyond"):
        read_motion(put(tmp_path, make(1e12 * positions), name))


@pytest.mark.parametrize("ending", [".bvh", ".amc"])
def test_joints_of_no_recording_are_refused(tmp_path, ending):
    """Of a skeleton all joints are seen."""
    for name, content in EXAMPLES[ending[1:]]().items():
        content = content.replace(b"root 1 2 3", b"root 1 2 -2e9")
        put(tmp_path, content.replace(b"OFFSET 0.5", b"OFFSET -2e7"), name)
    with pytest.raises(ValueError, match=r"a\.\w+: frame 0 of '\w+' is .*e\+\d\d\. No recording"):
        read_motion(tmp_path / f"a{ending}")


# -- wrong calls ------------------------------------------------------------------------


def test_unknown_endings_and_missing_files_are_errors(tmp_path):
    for name, ending in (("a.unknown", ".unknown"), ("a", ""), ("a.asf", ".asf")):
        path = put(tmp_path, "", name)
        with pytest.raises(ValueError, match=r"no reader is for.*; the known endings") as caught:
            read_motion(path)
        message = str(caught.value)
        assert message.startswith(f"{path} ends with {ending!r}")
        assert all(known in message for known in ENDINGS)
    for ending in set(ENDINGS):
        (tmp_path / f"c{ending}").mkdir()
        for name in "bc":
            with pytest.raises(FileNotFoundError, match=rf"no motion file at .*{name}\{ending}"):
                read_motion(str(tmp_path / f"{name}{ending}"))


WHOLE = "max_gap must be a whole number of frames, 0 or more, got"


@pytest.mark.parametrize(
    ("key", "params", "message"),
    [
        ("bvh", {"asf": "a.asf"}, r"asf= goes with \.amc files only, got asf='a\.asf' with .*a\.b"),
        ("bvh", {"group": "angles"}, r"group= goes with \.c3d, .*\.csv files only, got group='an"),
        *(("bvh", {"max_gap": gap}, WHOLE) for gap in (-1, 1.5, "5", True, None)),
        ("mot", {"max_gap": 3}, r"recording .a. has no positions but coordinates: max_gap"),
        ("c3d", {"ends": "cut"}, "ends must be 'keep' or 'trim', got 'cut'"),
        ("c3d", {"group": "analog", "ends": "trim"}, "'a' has no positions but analog: max_gap"),
        ("c3d", {"columns": "common"}, "columns must be None, or 'common' with a folder or a li"),
        ("amc", {"asf": "b.asf"}, r"b\.asf"),
    ],
)
def test_wrong_parameters_are_refused(tmp_path, key, params, message):
    path, *_ = [put(tmp_path, content, name) for name, content in EXAMPLES[key]().items()]
    with pytest.raises(FileNotFoundError if key == "amc" else ValueError, match=message):
        read_motion(path, **params)


# -- recordings -------------------------------------------------------------------------


# -- several files ------------------------------------------------------------------------


def folder_of(tmp_path):
    """Three recordings: of three markers, of two in another order, and of another two."""
    names = (["LKNE", "RKNE", "SACR"], ["SACR", "LKNE"], ["LKNE", "SACR", "T10"])
    paths = []
    for i, labels in enumerate(names):
        x = np.random.default_rng(i).integers(-900, 900, (40 + i, len(labels), 3)) / 2
        content = c3d(x, changes={"LABELS": texts(*labels)}, analog=np.ones((40 + i, 2, 1)))
        paths.append(put(tmp_path, content, f"walk{i}.c3d"))
    return paths


def test_several_files_are_read_as_a_list(tmp_path):
    paths = folder_of(tmp_path)
    for given in (paths, map(str, paths)):
        for x, path in zip(read_motion(given), paths, strict=True):
            pd.testing.assert_frame_equal(x, read_motion(path))
            assert x.attrs == read_motion(path).attrs
    with pytest.raises(ValueError, match="There are no files to read"):
        read_motion([])
    with pytest.raises(ValueError, match=r"walk0\.c3d: there are no angles"):
        read_motion(paths, group="angles")
    # A file without the group is left out while another one has it.
    angles = put(tmp_path, c3d(tracks(), changes={"ANGLES": texts("M1")}), "angles.c3d")
    with pytest.warns(UserWarning, match=r"walk0\.c3d: there are no angles .*left out"):
        (only,) = read_motion([paths[0], angles], group="angles")
    pd.testing.assert_frame_equal(only, read_motion(angles, group="angles"))
    with pytest.raises(ValueError, match="columns must be None, or 'common'"):
        read_motion(paths, columns="all")


def test_common_columns_of_several_files(tmp_path):
    paths = folder_of(tmp_path)
    message = (
        r"^3 files have 6 columns in common\. Left out are 3 of 'walk0' \['RKNE_x', 'RKNE_y', "
        r"'RKNE_z'\]; 3 of 'walk2' \['T10_x', .*\.$"
    )
    with pytest.warns(UserWarning, match=message) as caught:
        common = read_motion(paths, columns="common")
    assert len(caught) == 1
    assert caught[0].filename == __file__
    names = [f"{joint}_{axis}" for joint in ("LKNE", "SACR") for axis in "xyz"]
    for x, path in zip(common, paths, strict=True):
        pd.testing.assert_frame_equal(x, read_motion(path)[names])
        assert x.attrs == read_motion(path).attrs
    (one, two) = read_motion([paths[1], paths[1]], columns="common")
    pd.testing.assert_frame_equal(one, two)
    for labels, units in (("abc", "NVm"), ("cab", "mNV")):
        analog = {"ANALOG": {"LABELS": texts(*labels), "UNITS": texts(*units)}}
        content = c3d(np.ones((9, 1, 3)), analog=np.ones((9, 2, 3)), others=analog)
        put(tmp_path, content, f"force_{labels}.c3d")
    for x in read_motion(sorted(tmp_path.glob("force*")), group="analog", columns="common"):
        assert list(x) == x.attrs["channels"] == ["a", "b", "c"]
        assert x.attrs["units"] == ["N", "V", "m"]


def test_ends_of_a_file_are_trimmed_as_those_of_a_table(tmp_path):
    x = np.random.default_rng(0).integers(-900, 900, (40, 3, 3)) / 2
    x[:4, 1] = x[20:23, 0] = np.nan
    path = put(tmp_path, c3d(x), "a.c3d")
    with pytest.warns(UserWarning, match="2 gaps"):
        df = read_motion(path)
    alone, (listed,) = (read_motion(given, max_gap=3, ends="trim") for given in (path, [path]))
    for trimmed in (alone, listed):
        pd.testing.assert_frame_equal(trimmed, fill_gaps(df, 3, ends="trim"))
        assert trimmed.attrs["rows"] == [4, 39]
    with pytest.warns(UserWarning, match=r"1 gap, the longest of 3 frames\. Inter"):
        assert len(read_motion(path, ends="trim")) == 36


@pytest.mark.parametrize(("n", "more"), [(1, ""), (3, ""), (4, "; and some of 1 more"), (5, "2 m")])
def test_three_files_that_lose_columns_are_named(tmp_path, n, more):
    labels = {f"w{i}.c3d": ["A", f"B{i}"] for i in range(n)} | {"x.c3d": ["A"]}
    paths = [
        put(tmp_path, c3d(np.ones((2, len(x), 3)), changes={"LABELS": texts(*x)}), name)
        for name, x in labels.items()
    ]
    with pytest.warns(UserWarning, match="have 3 columns in common") as caught:
        read_motion(paths, columns="common")
    message = str(caught[0].message)
    assert [f"3 of 'w{i}'" in message for i in range(n)] == [i < 3 for i in range(n)]
    assert more in message
    assert ("more" in message) == bool(more)


def test_messages_about_several_files_are_short(tmp_path):
    paths = []
    for i in range(12):
        labels = [f"{chr(97 + i)} marker of a long name, as some have them, {k}" for k in range(99)]
        content = c3d(np.ones((2, 99, 3)), changes={"LABELS": texts(*labels)})
        paths.append(put(tmp_path, content, f"{i}_{'long' * 40}.c3d"))
    with pytest.raises(ValueError, match="No column is common to the 12 files") as caught:
        read_motion(paths, columns="common")
    assert len(str(caught.value)) < 600
