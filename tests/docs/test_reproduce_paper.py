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


def test_the_paper_and_key_frames_are_similar_for_few_moments_only(report):
    """The paper finds its results very similar to those of key-frames marked by hand."""
    of = {name: errors_of(report[0], name) for name in ("linear", "key-frames", "paper")}
    lowest = slice(0, 2)
    assert all(a > 0.9 * b for a, b in zip(of["paper"][lowest], of["linear"][lowest], strict=True))
    assert all(a > b for a, b in zip(of["paper"][lowest], of["key-frames"][lowest], strict=True))
    assert all(a < 0.7 * b for a, b in zip(of["paper"][2:], of["linear"][2:], strict=True))


def test_key_frames_of_largest_curvature_are_other_moments(report):
    curvature, keyframes = (errors_of(report[0], name) for name in ("curvature", "key-frames"))
    assert all(a > 1.5 * b for a, b in zip(curvature, keyframes, strict=True))


def test_curvature_is_largest_in_corners_and_finds_them_again():
    """A path along three edges of a box has two corners; one that is late has them later."""
    script = runpy.run_path(str(SCRIPT))
    paths = []
    for first, second in ((30, 60), (40, 65)):
        along = np.interp(np.arange(91), [0, first, second, 90], [0, 1, 2, 3])[:, np.newaxis]
        paths.append(np.clip(along - np.arange(3), 0, 1))
    corners = script["most_curved"](paths[0], 2)
    np.testing.assert_allclose(corners, [30, 60], atol=1)
    np.testing.assert_allclose(
        script["same_moments"](paths[0], corners, paths[1]), [40, 65], atol=1
    )


def test_the_defaults_are_as_near_as_key_frames(report):
    defaults, keyframes = (errors_of(report[0], name) for name in ("defaults", "key-frames"))
    linear = errors_of(report[0], "linear")
    assert all(a < 1.25 * b for a, b in zip(defaults, keyframes, strict=True))
    assert all(a < 0.65 * b for a, b in zip(defaults, linear, strict=True))
