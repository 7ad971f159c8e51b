"""Two groups of people: whether they differ in shape or in timing, by the test of the benchmark."""

import sys

import numpy as np
import pytest
from scipy.stats import binom
from sklearn_motionsync.datasets import make_gait
from threadpoolctl import threadpool_limits

SHOWN = ("hip_flexion", "knee_flexion")


@pytest.fixture(scope="module")
def groups(benchmark):
    return benchmark("groups")


def hotelling(fields, in_second):
    """T2 at every frame, step by step."""
    found = []
    for p in range(fields.shape[1]):
        a, b = fields[~in_second, p], fields[in_second, p]
        within = (len(a) - 1) * np.cov(a.T) + (len(b) - 1) * np.cov(b.T)
        within = np.atleast_2d(within) / (len(a) + len(b) - 2)
        d = b.mean(axis=0) - a.mean(axis=0)
        found.append(len(a) * len(b) / (len(a) + len(b)) * d @ np.linalg.solve(within, d))
    return np.array(found)


# -- the test ---------------------------------------------------------------------------


@pytest.mark.parametrize("n_channels", [1, 3])
def test_p_value_equals_that_of_the_largest_t2(groups, n_channels):
    rng = np.random.default_rng(0)
    in_second = np.arange(9) % 2 == 1
    fields = rng.standard_normal((9, 6, n_channels)).cumsum(axis=1)
    fields[in_second] += 1
    again = np.random.default_rng(5)
    deals = [in_second] + [again.permutation(in_second) for _ in range(200)]
    largest = np.array([hotelling(fields, deal).max() for deal in deals])
    expected = np.mean(largest >= largest[0] * (1 - 1e-9))
    assert groups.p_value(fields, in_second, 200, 5) == expected
    assert 0.005 < expected < 0.5
    # Units do not matter, nor what channels have in common.
    mixed = fields @ rng.standard_normal((n_channels, n_channels)) * 1e3 + 7
    assert groups.p_value(mixed, in_second, 200, 5) == expected


def test_constant_frames_are_not_tested(groups):
    rng = np.random.default_rng(0)
    in_second = np.arange(12) % 2 == 1
    fields = rng.standard_normal((12, 5, 2))
    expected = groups.p_value(fields, in_second, 100)
    # A pinned end, and a channel that is constant there only.
    ends = np.zeros((12, 1, 2))
    assert groups.p_value(np.hstack([ends, fields, ends + 3]), in_second, 100) == expected
    fields[:, 2, 0] = 0
    alone = np.delete(fields, 2, axis=1)
    both = [
        groups.p_value(alone, in_second, 100),
        groups.p_value(fields[:, [2], 1], in_second, 100),
    ]
    assert groups.p_value(fields, in_second, 100) >= min(both)


def test_false_positive_rate_is_the_nominal_level(groups):
    rng = np.random.default_rng(0)
    in_second = np.arange(10) % 2 == 1
    p = [
        groups.p_value(rng.standard_normal((10, 20, 2)).cumsum(axis=1), in_second, 99, seed)
        for seed in range(300)
    ]
    lowest, highest = binom.interval(0.999, 300, 0.05)
    assert lowest <= np.sum(np.array(p) <= 0.05) <= highest


def test_cycles_of_one_person_count_as_one_sample(groups):
    bunch = make_gait(4, 3, random_state=0)
    lengths = np.array([float(len(x)) for x in bunch.data])
    np.testing.assert_allclose(
        groups.of_people(lengths, bunch.person), lengths.reshape(4, 3).mean(axis=1)
    )
    clock = groups.synchronised(bunch)
    assert clock.curves.shape == (4, 101, 4)
    assert clock.offsets.shape == (4, 101)
    assert (clock.offsets[:, [0, -1]] == 0).all()


# -- on people --------------------------------------------------------------------------


def shares_found(groups, seeds, **params):
    """How often every test finds a difference in the hip and in the knee, a cycle a person."""
    with threadpool_limits(1):
        all_p = [groups.p_values(s, params, SHOWN, 20, 1) for s in seeds]
    return {t: [np.mean([p[t, c] <= 0.05 for p in all_p]) for c in SHOWN] for t in groups.TESTS}


def test_timing_difference_is_significant_in_offsets_only_after_matching(groups):
    found = shares_found(groups, range(3000, 3006), timing=3)
    hip = {test: share[0] for test, share in found.items()}
    assert hip[groups.JOINT] >= 0.75
    assert hip[groups.OFFSET] >= 0.75
    assert hip[groups.LINEAR] <= 0.5
    assert hip[groups.CURVE] <= 0.25


def test_shape_difference_is_significant_in_curves_and_not_in_offsets(groups):
    found = shares_found(groups, range(3000, 3006), amplitude=12)
    hip, knee = ({test: share[i] for test, share in found.items()} for i in range(2))
    assert knee[groups.JOINT] >= 0.75
    assert knee[groups.CURVE] >= 0.75
    assert knee[groups.OFFSET] <= 0.25
    assert hip[groups.JOINT] <= 0.25


def test_equal_groups_are_not_significant(groups):
    found = shares_found(groups, range(3000, 3006))
    assert max(max(share) for share in found.values()) <= 0.25


def test_tables_of_one_seed_have_the_stated_rows(groups, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["groups.py", "1"])
    monkeypatch.setattr(groups, "PEOPLE", 4)
    monkeypatch.setattr(groups, "DIFFERENCES", {"nothing": {}, "timing": {"timing": 3}})
    groups.main()
    tables = capsys.readouterr().out.strip().split("\n\n")
    assert len(tables) == len(groups.CHANNELS)
    for table in tables:
        head, _, *body = table.splitlines()
        assert [row.split(" | ")[0].strip("| ") for row in body] == ["nothing", "timing"]
        assert {row.count("|") for row in body} == {head.count("|")}
