"""BVH: positions against plain matrices and by hand, and errors of wrong files."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import Skeleton
from sklearn_motionsync.datasets import load_trials
from sklearn_motionsync.io import read_motion

from motion_files import body, joint, put
from plain_readers import plain_bvh


def test_position_channels_replace_offset_and_the_first_rotation_is_the_outermost(tmp_path):
    text = (
        "HIERARCHY ROOT a { OFFSET 9 9 9 CHANNELS 2 Zposition Xposition JOINT b { OFFSET 1 0 0 "
        "CHANNELS 3 Zrotation Yposition Xrotation End Site { OFFSET 0 2 0 } } }\n"
        "MOTION\nFrames: 1\nFrame Time: 1\n4 5 90 7 90\n"
    )
    df = read_motion(put(tmp_path, text))
    np.testing.assert_allclose(joint(df, "a"), [[5, 9, 4]])
    np.testing.assert_allclose(joint(df, "b"), [[6, 16, 4]])
    # About its own X first y turns to z, which stays when all turns about Z.
    np.testing.assert_allclose(joint(df, "b_end"), [[6, 16, 6]], atol=1e-12)


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\n", "\r"),
        lambda text: text.replace("\n", "\n\n"),
        lambda text: text.replace("\n  ", " ").replace("OFFSET", "offset"),
        lambda text: text.replace("rotation", "ROTATION").replace("\n  {", "{"),
        lambda text: text.replace("Frames: 3", "frames:3"),
    ],
)
def test_variants_of_programs_are_the_same(tmp_path, change):
    expected = read_motion(put(tmp_path, body()))
    pd.testing.assert_frame_equal(read_motion(put(tmp_path, change(body()), "b.BVH")), expected)


def test_repeated_names_are_numbered(tmp_path):
    text = body().replace("JOINT spine", "JOINT left arm").replace("JOINT leg", "JOINT left arm")
    text = text.replace("JOINT foot", "JOINT left arm_2").replace("JOINT neck", "JOINT f\xfc\xdf")
    df = read_motion(put(tmp_path, text))
    names = ["hips", "left arm", "f\xfc\xdf", "f\xfc\xdf_end", "left arm_3", "left arm_2"]
    assert df.attrs["joints"] == names
    assert df.columns.is_unique


@pytest.mark.parametrize("name", ["root", "Joint", "end", "Motion", "OFFSET"])
def test_joints_may_be_called_as_key_words(tmp_path, name):
    text = body().replace("ROOT hips", f"ROOT {name}").replace("JOINT leg", f"JOINT {name}")
    df = read_motion(put(tmp_path, text))
    assert df.attrs["joints"] == [name, "spine", "neck", "neck_end", f"{name}_2", "foot"]
    np.testing.assert_array_equal(df, read_motion(put(tmp_path, body())))


@pytest.mark.parametrize(("deep", "n"), [(True, 2000), (False, 9000)])
def test_many_joints_deep_and_wide(tmp_path, deep, n):
    head = "HIERARCHY\nROOT a { OFFSET 0 0 0 CHANNELS 1 Xposition\n"
    one = "JOINT a { OFFSET 0 1 0 "
    inner = one * n + "} " * n if deep else (one + "} ") * n
    text = head + inner + "}\nMOTION\nFrames: 2\nFrame Time: 1\n0\n1\n"
    df = read_motion(put(tmp_path, text))
    assert df.iloc[1, -3:].tolist() == [1, n if deep else 1, 0]


def test_chain_bends_to_half_a_circle_in_more_frames_than_one_block(tmp_path):
    n, n_frames = 600, 1760
    joint = "JOINT a { OFFSET 0 1 0 CHANNELS 1 Zrotation "
    turns = np.linspace(0, 180 / n, n_frames).round(6)
    text = f"HIERARCHY\nROOT a {{ OFFSET 0 0 0 {joint * n + '} ' * n}}}\nMOTION\n"
    text += f"Frames: {n_frames}\nFrame Time: 1\n"
    text += "".join(f"{turn} " * n + "\n" for turn in turns)
    df = read_motion(put(tmp_path, text))
    angles = np.radians(turns)[:, None] * np.arange(n)
    expected = np.column_stack([-np.sin(angles).sum(axis=1), np.cos(angles).sum(axis=1)])
    np.testing.assert_allclose(df.iloc[:, -3:-1], expected, atol=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_random_trees_agree_with_plain_matrices(tmp_path, seed):
    """Channels in any number and order, several roots."""
    rng = np.random.default_rng(seed)
    names = [axis + kind for axis in "XYZ" for kind in ("position", "rotation")]
    n_channels = 0

    def one(word, depth):
        nonlocal n_channels
        channels = rng.permutation(names)[: rng.integers(7)]
        n_channels += len(channels)
        offset = " ".join(map(str, rng.uniform(-9, 9, 3).round(2)))
        inner = [one("JOINT", depth + 1) for _ in range(rng.integers(4) if depth < 5 else 0)]
        inner = inner or ["End Site {\nOFFSET 1 2 3\n}"] * rng.integers(2)
        head = f"{word} j{rng.integers(10**9)} {{\nOFFSET {offset}"
        return "\n".join([head, f"CHANNELS {len(channels)} {' '.join(channels)}", *inner, "}"])

    roots = [one("ROOT", 0) for _ in range(3)]
    numbers = rng.uniform(-400, 400, (4, n_channels)).round(3)
    rows = [" ".join(map(str, row)) for row in numbers]
    text = "\n".join(["HIERARCHY", *roots, "MOTION", "Frames: 4", "Frame Time: 1", *rows])
    path = put(tmp_path, text)
    assert n_channels > 20
    expected = plain_bvh(path)
    np.testing.assert_allclose(read_motion(path), expected.reshape(4, -1), atol=1e-9)


def moves(rows):
    """A file of one joint that moves, with rows of text."""
    return small("3 Xposition Yposition Zposition", f"Frames: {len(rows)}\nFrame Time: 1\n") + (
        "\n".join(rows)
    )


def test_numbers_are_exact_between_all_blanks(tmp_path):
    rng = np.random.default_rng(0)
    formats = ["%r", "%.6f", "%.17g", "%.25g", "%e", "%+.3E", "%d"]
    values = rng.uniform(-1, 1, 3000) * 10.0 ** rng.integers(-40, 7, 3000)
    words = [formats[i % 7] % float(value) for i, value in enumerate(values)]
    words[:6] = ["+5", ".5", "5.", "-.5e-3", "1e-400", "-0"]
    df = read_motion(put(tmp_path, moves([" ".join(words[i : i + 3]) for i in range(0, 3000, 3)])))
    assert df.to_numpy().ravel().tolist() == list(map(float, words))
    for blank in (" \t", "\v"):
        rows = [f"{blank}1{blank}2 3{blank}", blank, "", f"4 5{blank}6{blank} "]
        text = moves(rows).replace("Frames: 4", "Frames: 2")
        assert read_motion(put(tmp_path, text)).to_numpy().tolist() == [[1, 2, 3], [4, 5, 6]]
    for word in ("1e+", "+-1", "1.2.3", "1_0", "0x1", "inf", "\xb2"):
        with pytest.raises(ValueError, match=r"line 11: a frame .* needs finite numbers"):
            read_motion(put(tmp_path, moves(["1 2 3", f"1 {word} 3", "1 2 3"])))


def small(channels="3 Xrotation Yrotation Zrotation", motion="Frames: 1\nFrame Time: 1\n1 2 3\n"):
    return f"HIERARCHY\nROOT a\n{{\nOFFSET 0 0 0\nCHANNELS {channels}\n}}\nMOTION\n{motion}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"line 0: the file ends where ROOT, .* should follow; it is not complete"),
        ("\x00\xff", "line 1: expected ROOT, .* got "),
        (small()[:30], "line 4: the file ends where a number of OFFSET"),
        (small().replace("OFFSET 0 0 0\n", ""), "line 5: joint 'a' ends without an OFFSET"),
        (small().replace("0 0 0", "0 x 0"), "line 4: OFFSET needs finite numbers .*got 'x'"),
        (small().replace("ROOT a", "ROOT"), "line 3: expected the joint's name"),
        (small().replace("ROOT a\n{", "ROOT a"), "line 3: expected a joint's name and {, got 'OFF"),
        (small().replace("ROOT", "JOINT"), "'JOINT' stands where it cannot"),
        (small().replace("}\n", ""), "MOTION begins with 1 open joint of"),
        ("MOTION\n", "at least one ROOT"),
        (small("x Xrotation"), "CHANNELS needs a number from 0 to 6 .* got 'x'"),
        (small("2 Xrotation Xrotation"), "as many different names"),
        (small("1 Wrotation"), "got '1 WROTATION'"),
        (small("0"), "no joint has CHANNELS"),
        (small().replace("}", "End Site { OFFSET 0 0 0 CHANNELS 1 Xrotation } }"), "End Site none"),
        (small(motion=""), "line 7: expected 'Frames: <number>', got ''"),
        (small(motion="Frames: 1\nTime: 1\n1 2 3\n"), "expected 'Frame Time: <number>', got 'Ti"),
        (small(motion="Frames: -1\n"), "Frames: needs a whole number, 0 or more, got '-1'"),
        (small(motion="Frames: 1\nFrame Time: 0\n1 2 3"), "Frame Time: must be above 0"),
        (small(motion="Frames: 99999\nFrame Time: 1\n1 2 3"), "9, but 1 frame follows, and"),
        (small(motion="Frames: 1\nFrame Time: 1\n1 2\n"), "a frame .* needs 3 numbers, got 2"),
        (small(motion="Frames: 4\nFrame Time: 1\n\n"), "the file ends where frames should follow"),
    ],
)
def test_wrong_files_are_refused(tmp_path, text, message):
    with pytest.raises(ValueError, match=rf"a\.bvh, {message}|a\.bvh, line \d+: .*{message}"):
        read_motion(put(tmp_path, text))


@pytest.mark.parametrize("stated", [0, 1, 3, 9999999999])
def test_stated_frames_that_contradict_those_that_are_there_are_a_warning(tmp_path, stated):
    expected = read_motion(put(tmp_path, body()))
    text = body().replace("Frames: 3", f"Frames: {stated}")
    n = text.rindex("\n", 0, -1) + 1  # without the last row
    with pytest.warns(UserWarning, match=rf"Frames: says {stated}, but 2 frames follow"):
        pd.testing.assert_frame_equal(read_motion(put(tmp_path, text[:n])), expected[:2])


def test_small_file_with_a_huge_result_is_refused(tmp_path):
    joints = "JOINT a { OFFSET 0 0 0 }\n" * 2000
    text = f"HIERARCHY\nROOT a {{ OFFSET 0 0 0 CHANNELS 1 Xposition\n{joints}}}\nMOTION\n"
    text += "Frames: 4000\nFrame Time: 1\n" + "0\n" * 4000
    with pytest.raises(ValueError, match=r"4000 frames of 2001 joints would take 183 MB, from a"):
        read_motion(put(tmp_path, text))


def test_real_file_agrees_with_the_archive(real_data):
    df = read_motion(real_data / "original_files" / "bvh" / "007_01.bvh")
    assert df.attrs["frame_rate"] == pytest.approx(60, rel=1e-4)
    archive = load_trials(real_data / "cmu07_walk" / "cmu07_walk_positions.npz")
    columns = [f"{j}_{axis}" for j in archive.joints for axis in "xyz"]
    np.testing.assert_allclose(df[columns], archive.data[0], atol=1e-4)
    assert Skeleton.from_frame(df[columns]) == archive.skeleton
    assert Skeleton.from_frame(df).landmarks["left_knee"] == "CC_Base_L_Calf"
