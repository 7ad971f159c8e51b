"""The call of read_motion, and files damaged at random."""

import numpy as np
import pytest
from sklearn_motionsync import DirectionCosines, Skeleton, to_frame
from sklearn_motionsync.io import read_motion

import fuzz_readers
from motion_files import AMC, ASF, body, c3d, everything, opensim, put, tracks


@pytest.mark.parametrize("name", ["a.bvh", "a.amc", "a.c3d", "a.trc", "a.mot", "a.sto"])
def test_no_file(tmp_path, name):
    with pytest.raises(FileNotFoundError, match=rf"no motion file at .*{name}"):
        read_motion(tmp_path / name)
    (tmp_path / name).mkdir()
    with pytest.raises(FileNotFoundError, match="no motion file"):
        read_motion(str(tmp_path / name))


def test_wrong_calls(tmp_path):
    path = put(tmp_path, body())
    with pytest.raises(ValueError, match=r"a skeleton without motion; give the \.amc file"):
        read_motion(put(tmp_path, ASF, "a.asf"))
    with pytest.raises(ValueError, match=r"end with \.bvh, .*, \.mot or \.sto, got '\.txt'"):
        read_motion(put(tmp_path, "", "a.txt"))
    with pytest.raises(ValueError, match=r"asf= goes with \.amc files only"):
        read_motion(path, asf=tmp_path / "a.asf")
    with pytest.raises(FileNotFoundError, match=r"no skeleton \(asf=\) at .*b\.asf"):
        read_motion(put(tmp_path, AMC, "a.amc"), asf=tmp_path / "b.asf")
    for rate in (0, -1, np.nan, np.inf, "60", True):
        with pytest.raises(ValueError, match="frame_rate must be frames a second, above 0"):
            read_motion(path, frame_rate=rate)
    for gap in (-1, 1.5, "5", True, None):
        with pytest.raises(ValueError, match="max_gap must be a whole number of frames, 0 or mor"):
            read_motion(path, max_gap=gap)


def test_recordings_are_called_like_their_files(tmp_path):
    """So that tables of several say which is which; of folders with the same names nothing is."""
    recordings = [read_motion(put(tmp_path, body(), f"walk {k}.bvh")) for k in "ba"]
    table = to_frame(recordings)
    assert table.index.names == ["recording", "frame"]
    assert list(table.index.unique("recording")) == ["walk b", "walk a"]
    assert list(to_frame(recordings[:1] * 2).index.unique(0)) == [0, 1]


def test_damaged_files(tmp_path):
    """A short run of tests/datasets/fuzz_readers.py on files made here."""
    originals = [
        {"a.bvh": body().encode()},
        {"a.amc": AMC.encode(), "a.asf": ASF.encode("latin-1")},
        *({"a.c3d": c3d(tracks(gap=(3, 9)), machine)} for machine in (84, 85, 86)),
        *({"a.c3d": c3d(**everything(machine))} for machine in (84, 85, 86)),
        *opensim(),
    ]
    outcomes = [
        fuzz_readers.run_case(fuzz_readers.damaged(originals, 0, number), tmp_path)
        for number in range(800)
    ]
    assert set(outcomes) == {"read", "ValueError"}


@pytest.mark.parametrize(
    "name", ["bvh/007_01.bvh", "asf_amc/02_02.amc", "asf_amc/HDM_bk_depositFloorR_011_120.amc"]
)
def test_as_plain_parsers_read_it(real_data, benchmark, name):
    path = real_data / "original_files" / name
    expected = benchmark("readers").PLAIN[path.suffix](path)
    scale = 1e-12 * np.abs(expected).max()
    df = read_motion(path)
    np.testing.assert_allclose(df.to_numpy().reshape(expected.shape), expected, atol=scale, rtol=0)


@pytest.mark.parametrize(
    "name", ["bvh/007_01.bvh", "asf_amc/02_01.amc", "asf_amc/HDM_bd_depositFloorR_001_120.amc"]
)
def test_from_a_file_to_postures(real_data, name):
    """What is read goes into the pipeline as it is."""
    df = read_motion(real_data / "original_files" / name)
    df = df.iloc[1:] if name.startswith("bvh") else df  # its first frame was put there later
    cosines = DirectionCosines(Skeleton.from_frame(df))
    (postures,) = cosines.fit_transform([df])
    limbs = postures[:, 1:].reshape(len(df), 12, 3)
    np.testing.assert_allclose(np.linalg.norm(limbs, axis=2), 1)
    if "deposit" not in name:
        # A walk: the pelvis at about the height of the stretched legs, legs and torso upright.
        assert 0.9 < postures[:, 0].min() <= postures[:, 0].max() < 1.3
        names = list(cosines.get_feature_names_out())
        assert (postures[:, names.index("torso_y")] > 0.9).all()
        assert (postures[:, names.index("left_thigh_y")] < -0.7).all()
    else:
        assert postures[:, 0].min() < 0.8 * postures[0, 0]
