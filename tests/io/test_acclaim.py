"""Acclaim: positions by hand, and errors of wrong files."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation
from sklearn_motionsync.io import read_motion

from motion_files import AMC, ASF, joint, put

INCH = 0.0254 / 0.5


def acclaim(folder, asf=ASF, amc=AMC, **params):
    put(folder, asf, "a.asf")
    return read_motion(put(folder, amc, "a_01.amc"), **params)


def test_positions_by_hand(tmp_path):
    df = acclaim(tmp_path)
    assert (df.attrs["units"], df.attrs["up"], df.attrs["kind"]) == ("m", "y", "joints")
    assert (df.attrs["joints"], df.attrs["parents"]) == (["root", "thigh", "shin"], [-1, 0, 1])
    expected = np.array([[1, 2, 3], [1, -2, 3], [1, -5, 3]]) * INCH
    np.testing.assert_allclose(df.iloc[0].to_numpy().reshape(3, 3), expected)
    # The thigh's x axis is the root's y, about which -y does not turn; shin and thigh are one line.
    np.testing.assert_allclose(df.iloc[1].to_numpy().reshape(3, 3), expected, atol=1e-12)
    bent = AMC.replace("thigh 90 0", "thigh 0 90")
    bent = acclaim(tmp_path, amc=bent.replace(":DEGREES", ":DEGREES\n:SAMPLES-PER-SECOND 60"))
    expected = np.array([[1, 2, 3], [1, 2, -1], [1, 2, -4]]) * INCH
    np.testing.assert_allclose(bent.iloc[1].to_numpy().reshape(3, 3), expected, atol=1e-12)
    assert bent.attrs["frame_rate"] == 60


def test_degrees_of_freedom_act_in_their_order_about_fixed_axes(tmp_path):
    asf = ASF.replace("axis 0 0 90 XYZ\n    dof rx rz", "axis 0 0 0 XYZ\n    dof {} tx")
    amc = "1\nroot 0 0 0 0 0 0\nthigh 90 90 2\n"
    first_x = acclaim(tmp_path, asf.format("rx rz"), amc)
    np.testing.assert_allclose(joint(first_x, "thigh")[0] / INCH, [2, 0, -4], atol=1e-12)
    first_z = acclaim(tmp_path, asf.format("rz rx"), amc)
    np.testing.assert_allclose(joint(first_z, "thigh")[0] / INCH, [6, 0, 0], atol=1e-12)
    asf = ASF.replace("TX TY TZ RX RY RZ", "RZ RX RY TZ TY TX")
    df = acclaim(tmp_path, asf, "1\nroot 90 90 0 3 2 1\nthigh 0 0\n")
    np.testing.assert_allclose(joint(df, "root")[0] / INCH, [1, 2, 3])
    np.testing.assert_allclose(joint(df, "thigh")[0] / INCH, [5, 2, 3], atol=1e-12)


def test_root_starts_at_its_position_and_orientation(tmp_path):
    asf = ASF.replace("position 0 0 0", "position 1 1 1")
    asf = asf.replace("orientation 0 0 0", "orientation 0 0 90")
    df = acclaim(tmp_path, asf)
    np.testing.assert_allclose(joint(df, "root")[0] / INCH, [2, 3, 4])
    np.testing.assert_allclose(joint(df, "thigh")[0] / INCH, [6, 3, 4])


def test_lines_that_are_left_out_have_defaults(tmp_path):
    """A place, an orientation and axes of 0, in the order XYZ, in units of 1."""
    asf = ASF.replace("length 0.5", "length 1").replace("0 0 90 XYZ", "0 0 0 XYZ")
    expected = acclaim(tmp_path, asf)
    for line in ("  length 1", "  angle deg", "  axis XYZ", "  position 0 0 0",
                 "  orientation 0 0 0", "    axis 0 0 0 XYZ"):  # fmt: skip
        assert f"{line}\n" in asf
        pd.testing.assert_frame_equal(acclaim(tmp_path, asf.replace(f"{line}\n", "")), expected)


def test_angles_may_be_radians(tmp_path):
    """The motion says its own unit, or has that of the skeleton."""
    expected = acclaim(tmp_path)
    in_radians = ASF.replace("angle deg", "angle Radians").replace("0 0 90", f"0 0 {np.pi / 2}")
    motion = AMC.replace("90", f"{np.pi / 2}")
    df = acclaim(tmp_path, in_radians, motion.replace(":DEGREES\n", ""))
    pd.testing.assert_frame_equal(df, expected)
    for asf in (ASF, in_radians, ASF.replace("angle deg", "angle degrees")):
        pd.testing.assert_frame_equal(acclaim(tmp_path, asf, AMC), expected)
        df = acclaim(tmp_path, asf, motion.replace(":DEGREES", ":radians"))
        np.testing.assert_allclose(df, expected, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_axes_in_any_order_that_turn_alike_give_the_same_positions(tmp_path, seed):
    """Angles about fixed axes in one order or another, those of SciPy."""
    rng = np.random.default_rng(seed)
    orders = ["xyz", "xzy", "yxz", "yzx", "zxy", "zyx"]
    turns = Rotation.random(3, random_state=seed)
    asf = ASF.replace("orientation 0 0 0", "orientation {0}").replace("axis XYZ\n", "axis {1}\n")
    asf = asf.replace("axis 0 0 90 XYZ", "axis {2} {3}")
    asf = asf.replace("axis 0 0 0 XYZ", "axis {4} {5}\n    dof rz ry")
    amc = AMC.replace("thigh 0 0", "thigh 20 -30\nshin 5 70")
    amc = amc.replace("thigh 90 0", "thigh -80 10\nshin -40 33")
    frames = []
    for given in (["xyz"] * 3, *(rng.choice(orders, 3) for _ in range(6))):
        words = []
        for turn, order in zip(turns, given, strict=True):
            angles = turn.as_euler(order, degrees=True)
            words += [" ".join(f"{angle:.12f}" for angle in angles), order.upper()]
        frames.append(acclaim(tmp_path, asf.format(*words), amc))
    for df in frames[1:]:
        np.testing.assert_allclose(df, frames[0], atol=1e-10)


def test_small_file_with_a_huge_result_is_refused(tmp_path):
    bones = "".join(f"begin\nname b{i}\ndirection 0 1 0\nlength 1\nend\n" for i in range(1000))
    head = ASF[: ASF.index(":bonedata")].replace("TX TY TZ RX RY RZ", "TX")
    names = " ".join(f"b{i}" for i in range(1000))
    asf = f"{head}:bonedata\n{bones}:hierarchy\nbegin\nroot {names}\nend\n"
    amc = "".join(f"{i}\nroot 0\n" for i in range(1, 4000))
    with pytest.raises(ValueError, match=r"3999 frames of 1001 joints would take 92 MB, from a"):
        acclaim(tmp_path, asf, amc)


@pytest.mark.parametrize("between", ["_", "-", " "])
def test_skeleton_is_found_by_its_name(tmp_path, between):
    put(tmp_path, ASF.replace("length 0.5", "length 1"), "HDM.asf")
    put(tmp_path, ASF, f"HDM{between}bd.ASF")
    amc = put(tmp_path, AMC.replace("\n", "\r\n"), f"HDM{between}bd_sneak_120.AMC")
    assert read_motion(amc).iloc[0, 0] == pytest.approx(INCH)
    assert read_motion(amc, asf=tmp_path / "HDM.asf").iloc[0, 0] == pytest.approx(INCH / 2)
    other = put(tmp_path, AMC, "other.amc")
    with pytest.raises(ValueError, match=r"none of the \.asf files .* \(HDM.*, HDM.*give asf="):
        read_motion(other)
    (tmp_path / "HDM.asf").unlink()
    assert read_motion(other).shape == (2, 9)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("length 0.5", "length 0", "line 5: :units length must be above 0"),
        ("angle deg", "angle gon", "line 6: :units angle must be deg or rad, got 'gon'"),
        ("TX TY", "TX TX", "'order' needs different ones of tx ty"),
        ("dof rx rz", "dof l", "'dof' needs different ones of tx ty tz rx ry rz, got 'l'"),
        ("90 XYZ", "90 XYX", "order of the axes like XYZ, got 'XYX'"),
        ("length 4", "length x", "line 19: length needs finite numbers below 1e.12, got 'x'"),
        ("length 4", "", "line 24: bone 'thigh' needs a name of its own, a direction and a length"),
        ("    dof rx", "begin", "expected end, got 'begin rz'"),
        ("root thigh\n", "root leg\n", ":hierarchy names 'leg', which is not in :bonedata"),
        ("thigh shin\n", "shin thigh\n", ":hierarchy gives 'thigh' two parents"),
        ("thigh shin\n", "\n", "does not connect 1 bone to the root, 'shin' is one"),
        (ASF[ASF.index(":bonedata") :], "", "ends without a complete :root, :bonedata"),
    ],
)
def test_wrong_skeletons_are_refused(tmp_path, old, new, message):
    assert old in ASF
    asf = ASF.replace(old, new, 1)
    with pytest.raises(ValueError, match=rf"a\.asf, line \d+: |a\.asf: {message}") as caught:
        acclaim(tmp_path, asf)
    caught.match(message)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (AMC, "", "line 0: the file ends without a frame"),
        ("1\nroot", "root", "line 4: expected the number of a frame, or a bone that moves"),
        ("thigh 0 0", "shin 0", "line 6: expected .* a bone that moves in a.asf"),
        ("thigh 0 0", "thigh 0 0\nthigh 0 0", "line 7: expected .* once a frame"),
        ("thigh 0 0", "thigh 0", "line 6: bone 'thigh' needs 2 numbers, got 1"),
        ("thigh 0 0", "thigh 0 nan", "line 6: bone 'thigh' needs finite numbers .* got 'nan'"),
        ("thigh 0 0\n", "", "frame 1 has no values of 'thigh', .* or asf= is not its skeleton"),
        ("thigh 90 0\n", "", "frame 2 has no values of 'thigh', .* the file is not complete"),
        ("\n2\n", "\n3\n", "line 7: frame '3' follows frame 1; frames must be numbered"),
        (":DEGREES", ":SAMPLES-PER-SECOND 0", ":SAMPLES-PER-SECOND must be above 0"),
    ],
)
def test_wrong_motions_are_refused(tmp_path, old, new, message):
    assert old in AMC
    with pytest.raises(ValueError, match=r"a_01\.amc, line \d+: ") as caught:
        acclaim(tmp_path, amc=AMC.replace(old, new, 1))
    caught.match(message)
