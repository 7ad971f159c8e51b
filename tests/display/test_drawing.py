"""Colours for colour-blind people, curves outside a band, and a missing matplotlib."""

import itertools
import sys

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from sklearn_motionsync.display.base import COLORS, group_styles, parts_outside, pyplot

# Colours as seen without one kind of cones: Machado, Oliveira and Fernandes, "A
# physiologically-based model for simulation of color vision deficiency", 2009, severity 1.
SEEN_BY = {
    "normal vision": np.eye(3),
    "protanopes": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopes": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanopes": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
TOGETHER = [
    ("trial", "pattern"),
    ("trial", "mean"),
    ("mean", "envelope"),
    ("left", "right"),
    ("left", "middle"),
    ("right", "middle"),
    *(("departure", other) for other in ("trial", "mean", "envelope", "pattern")),
    *itertools.combinations(("departure", "quiet", "shadow"), 2),
]


def lab(color, seen_by):
    """CIE L*a*b* of a colour as it is seen."""
    rgb = np.array(to_rgb(color))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    linear = np.clip(np.asarray(SEEN_BY[seen_by]) @ linear, 0, 1)
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    x, y, z = np.cbrt(np.array(to_xyz) @ linear / [0.9505, 1, 1.089] + 1e-9)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("seen_by", SEEN_BY)
def test_colors_of_one_figure_and_of_four_groups_differ(seen_by):
    groups = itertools.combinations([color for color, _ in group_styles("abcd").values()], 2)
    pairs = [(COLORS[one], COLORS[other], 20) for one, other in TOGETHER]
    for one, other, least in [*pairs, *((*pair, 15) for pair in groups)]:
        apart = np.linalg.norm(lab(one, seen_by) - lab(other, seen_by))
        assert apart > least, (one, other)


def test_parts_outside_a_band_have_the_right_length():
    rng = np.random.default_rng(0)
    ys, center = rng.normal(size=(5, 12)).cumsum(axis=1), rng.normal(size=12)
    ys[1, 4], ys[2] = np.nan, center
    lower, upper = center - rng.uniform(size=12), center + 1
    xs, heights = parts_outside(ys, lower, upper)
    fine, clock = np.linspace(0, 11, 11 * 400 + 1)[:-1] + 1e-4, np.arange(12)
    at = {name: np.interp(fine, clock, y) for name, y in (("lower", lower), ("upper", upper))}
    for x, y in zip(xs, heights, strict=True):
        middle = x.mean()
        bounds = (np.interp(middle, clock, bound) for bound in (lower, upper))
        assert not next(bounds) <= y.mean() <= next(bounds)
        assert 0 < x[1] - x[0] <= 1
    outside = 0
    for y in ys:
        drawn = np.interp(fine, clock, y)
        drawn[np.isnan(y[np.floor(fine).astype(int)] + y[np.ceil(fine).astype(int)])] = np.nan
        outside += ((drawn < at["lower"]) | (drawn > at["upper"])).sum() / 400
    np.testing.assert_allclose(np.diff(xs).sum(), outside, atol=0.05)
    # A curve on the bounds is inside.
    assert len(parts_outside(ys[2:3], center, center)[0]) == 0


def test_missing_matplotlib_is_explained(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(ImportError, match="Drawing needs matplotlib: pip install matplotlib"):
        pyplot()
