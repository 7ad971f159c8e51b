"""Measures against oracles, closed forms, wrong arguments, and every kind of right ones."""

import inspect
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from measure_cases import CASES, FIVE, make_curves
from sklearn_motionsync import metrics
from sklearn_motionsync.metrics import (
    group_timing_error,
    keyframe_error,
    least_squares,
)

REFERENCE = Path(__file__).resolve().parents[2] / "docs" / "reference.md"


@pytest.mark.parametrize("name", metrics.__all__)
def test_public_name_has_documentation_example_and_tests(name):
    """The list that fails names what a new measure lacks."""
    found, missing = getattr(metrics, name), []
    if not re.search(rf"^ +(metrics\.)?{name}$", REFERENCE.read_text(encoding="utf-8"), re.M):
        missing.append("an entry in docs/reference.md")
    if ">>> " not in inspect.getdoc(found):
        missing.append("an example in its docstring")
    if inspect.isfunction(found) and name not in CASES:
        missing.append("an oracle and refused arguments in CASES of tests/metrics/measure_cases.py")
    elif inspect.isfunction(found) and not CASES[name].refused:
        missing.append("refused arguments in CASES of tests/metrics/measure_cases.py")
    elif inspect.isclass(found) and name.endswith("Scorer"):
        tests = (Path(__file__).parent / "test_scorers.py").read_text(encoding="utf-8")
        if not re.search(rf"^SCORERS = .*\b{name}\b", tests, re.M):
            missing.append("a place in SCORERS of tests/metrics/test_scorers.py")
    assert not missing, f"metrics.{name} lacks {', '.join(missing)}."


@pytest.mark.parametrize("name", CASES)
def test_measure_equals_oracle(name):
    arguments, oracle, _ = CASES[name]
    np.testing.assert_allclose(getattr(metrics, name)(*arguments), oracle(*arguments))


@pytest.mark.parametrize(
    ("name", "arguments", "keywords", "message"),
    [(name, *refused) for name, case in CASES.items() for refused in case.refused],
)
def test_measure_refuses_wrong_arguments(name, arguments, keywords, message):
    with pytest.raises(ValueError, match=message):
        getattr(metrics, name)(*arguments, **keywords)


# -- warps --------------------------------------------------------------------------------


def test_group_timing_error_is_zero_for_true_warps_to_any_clock(bending):
    own = [np.arange(len(phi)) * 99 / (len(phi) - 1) for phi in bending.times]
    for power in (1.0, 1.7):
        clock = np.linspace(0, 1, 100) ** power
        true = np.stack(
            [np.interp(clock, phi, f) for phi, f in zip(bending.times, own, strict=True)]
        )
        assert group_timing_error(true, bending.times) < 1e-10
    assert group_timing_error(np.tile(np.arange(100.0), (40, 1)), bending.times) > 2
    assert group_timing_error(FIVE, [[0, 0.2, 1]]) == 0


def test_closed_forms_of_warps():
    assert keyframe_error(FIVE, [[0, 8]], [0, 4], [9]) == 0
    # Warps may decrease, and go beyond the bounds by rounding.
    assert keyframe_error([[0, 2, 1, 3, 4]], [[2]], [1], [9]) == pytest.approx(1)
    assert keyframe_error([[-1e-15, 1, 2, 3, 4 + 1e-15]], [[5]], [2], [9]) == pytest.approx(0.5)


KINDS = {
    "lists": lambda x: np.asarray(x).tolist(),
    "tables": lambda x: pd.DataFrame(x) if np.ndim(x) == 2 else list(map(pd.DataFrame, x)),
    "objects": lambda x: np.asarray(x).astype(object),
    "masked": np.ma.array,
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", CASES)
def test_arguments_of_any_kind_give_the_same(name, kind):
    """Also moments and key-frames."""
    arguments, measure = CASES[name].arguments, getattr(metrics, name)
    expected = measure(*arguments)
    np.testing.assert_allclose(
        measure(KINDS[kind](arguments[0]), *arguments[1:]), expected, rtol=1e-12
    )
    if name == "keyframe_error":
        assert measure(arguments[0], KINDS[kind](arguments[1]), *arguments[2:]) == expected
    if name == "group_timing_error":
        assert measure(arguments[0], iter(arguments[1])) == expected


# -- spread -------------------------------------------------------------------------------


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_spread_in_any_unit(unit):
    x = make_curves()
    y = x + (x.mean(axis=0) - x) / 2
    assert least_squares(unit * x, unit * y) == pytest.approx(least_squares(x, y), rel=1e-12)
    assert least_squares(x.astype("f4"), y.astype("f4")) == pytest.approx(0.25, rel=1e-5)
    integers = np.rint(x * 9).astype(int)
    assert least_squares(integers, integers) == pytest.approx(1)


CONSTANT = np.full((3, 20, 2), 0.1)
# Trials that differ by rounding at most, such as sums of three tenths.
WITHOUT_SPREAD = {
    "constant": (CONSTANT, CONSTANT),
    "zero": (0 * CONSTANT, 0 * CONSTANT),
    "rounded": (CONSTANT, CONSTANT + [[[0]], [[1e-17]], [[2e-17]]]),
    "float32": (CONSTANT.astype("f4"), CONSTANT.astype("f4") * np.float32(1 + 1e-7)),
    "two frames": (CONSTANT[:, :2], CONSTANT[:, :2]),
}


@pytest.mark.parametrize("name", WITHOUT_SPREAD)
def test_spread_is_1_where_trials_differ_by_rounding(name):
    assert least_squares(*WITHOUT_SPREAD[name]) == 1


def test_spread_is_refused_if_there_was_none_before():
    with pytest.raises(ValueError, match="before and are not after"):
        least_squares(CONSTANT, make_curves(3, n_features=2))


def test_least_squares_leaves_out_the_mean_of_the_others():
    """0.1, 0.2, 0.3: the second differs from the mean of the others by rounding."""
    x = np.array([0.1, 0.2, 0.3])[:, np.newaxis, np.newaxis] * np.ones((3, 5, 2))
    assert least_squares(x, x[[0, 0, 2]]) == pytest.approx((4 / 9 + 16 / 9) / 2)
