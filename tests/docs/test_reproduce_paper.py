"""examples/reproduce_paper.py: its report and its figures, on the bends of HDM05."""

import re
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

SCRIPT = Path(__file__).parents[2] / "examples" / "reproduce_paper.py"


@pytest.fixture(scope="module")
def report(real_data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("paper")
    data = real_data / "hdm05" / "hdm05_positions.npz"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [SCRIPT.name, "--data", str(data), "--output", str(folder)])
        printed = []
        patch.setattr("builtins.print", lambda *words: printed.append(" ".join(map(str, words))))
        runpy.run_path(str(SCRIPT), run_name="__main__")
    return "\n".join(printed), folder


def errors_of(text, name):
    """Errors of a method: pelvis and head lowest, pelvis falls and rises."""
    row = re.search(rf"^\| {name} \| (.*) \|$", text, flags=re.MULTILINE)
    return [float(number) for number in row[1].split(" | ")]


def test_four_figures_are_written(report):
    names = sorted(path.name for path in report[1].iterdir())
    assert names == [f"figure_{k}.png" for k in (1, 2, 3, 4)]


LOWEST, MOVING, ALL = slice(0, 2), slice(2, None), slice(None)


@pytest.mark.parametrize(
    ("name", "other", "moments", "least", "most"),
    [
        # The paper finds its results very similar to those of key-frames marked by hand.
        ("paper", "linear", LOWEST, 0.9, np.inf),
        ("paper", "key-frames", LOWEST, 1, np.inf),
        ("paper", "linear", MOVING, 0, 0.7),
        # Key-frames of largest curvature are other moments.
        ("curvature", "key-frames", ALL, 1.5, np.inf),
        # The defaults are as near as key-frames.
        ("defaults", "key-frames", ALL, 0, 1.25),
        ("defaults", "linear", ALL, 0, 0.65),
    ],
)
def test_errors_of_moments_are_this_share_of_those_of_another_method(
    report, name, other, moments, least, most
):
    found, expected = (np.array(errors_of(report[0], each)[moments]) for each in (name, other))
    assert (found > least * expected).all()
    assert (found < most * expected).all()


def test_curvature_is_largest_in_corners_and_finds_them_again():
    """A path along three edges of a box has two corners; one that is late has them later."""
    script = runpy.run_path(str(SCRIPT))
    paths = []
    for first, second in ((30, 60), (40, 65)):
        along = np.interp(np.arange(91), [0, first, second, 90], [0, 1, 2, 3])[:, np.newaxis]
        paths.append(np.clip(along - np.arange(3), 0, 1))
    corners = script["most_curved"](paths[0], 2)
    np.testing.assert_allclose(corners, [30, 60], atol=1)
    again = script["same_moments"](paths[0], corners, paths[1])
    np.testing.assert_allclose(again, [40, 65], atol=1)
