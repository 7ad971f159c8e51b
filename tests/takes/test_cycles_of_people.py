"""CycleSegmenter on recorded walking and jogging, on long takes, and on other actions."""

import numpy as np
import pytest
from sklearn.model_selection import GroupKFold
from sklearn_motionsync.takes import CycleSegmenter
from sklearn_motionsync.takes.cycles import correlate_takes
from sklearn_motionsync.takes.decoder import follow


@pytest.fixture(scope="module")
def cycles(benchmark):
    return benchmark("cycles")


@pytest.fixture(scope="module")
def read(cycles, real_data):
    return lambda archive, label: cycles.read(real_data, archive, label)


def test_periods_agree_with_foot_strikes(cycles, read):
    """On 95 % of the takes within 5 %."""
    good = []
    for archive, label in cycles.CYCLIC.items():
        bunch = read(archive, label)
        periods = CycleSegmenter(bunch.skeleton).report(bunch.data)["period"]
        for x, rate, period in zip(bunch.data, bunch.frame_rate, periods, strict=True):
            true = cycles.period_of_strikes(x, bunch.skeleton, rate)
            good.append(abs(period / true - 1) < 0.05)
    assert len(good) == 26
    assert np.mean(good) > 0.95


def test_single_actions_are_not_cyclic(cycles, read):
    """Bends, grabs, hops and others; two sneaking steps hold one cycle."""
    for archive, labels in cycles.SINGLE.items():
        for label in labels:
            bunch = read(archive, label)
            takes = bunch.data[::6]
            assert not CycleSegmenter(bunch.skeleton).report(takes)["cyclic"].any(), label
    bunch = read("hdm05", "sneak2StepsLStart")
    with pytest.raises(ValueError, match=r"Trial 0: (not cyclic|holds)"):
        CycleSegmenter(bunch.skeleton).fit(bunch.data)


@pytest.mark.parametrize("n_cycles", [1.5, 1.7])
def test_walks_of_too_few_cycles_are_rejected(n_cycles, read):
    """Walks that are cut short, at 30 and at 60 frames per second."""
    bunch = read("cmu07_walk", "walk")
    segmenter, walks = CycleSegmenter(bunch.skeleton), bunch.data[::2]
    periods = segmenter.report(walks)["period"]
    short = [x[-round(n_cycles * p) :] for x, p in zip(walks, periods, strict=True)]
    slow = [x[::2] for x in short]
    for X in (short, slow):
        assert (segmenter.report(X)["cyclic"] == (n_cycles > 1.6)).mean() > 0.95
        if n_cycles < 1.6:
            with pytest.raises(ValueError, match=r"Trial 0: holds 1\.[45]\d cycles"):
                segmenter.fit(X)


def phases_of_others(bunch):
    """Phases of every take, by a segmenter that knows the takes of other people only."""
    out = [np.full(len(x), np.nan) for x in bunch.data]
    for train, test in GroupKFold(2).split(bunch.data, groups=bunch.actor):
        # Which foot is farther ahead depends on who is left out.
        segmenter = CycleSegmenter(bunch.skeleton, start="right")
        segmenter.fit([bunch.data[i] for i in train])
        takes = [bunch.data[i] for i in test]
        period = np.nanmedian(segmenter.periods_)
        for i, x, repeats in zip(test, *correlate_takes(segmenter, takes, takes), strict=True):
            for stretch in follow(x, repeats.stretches, segmenter.pattern_, period):
                inside = np.arange(*stretch.ends)
                out[i][inside] = np.interp(inside, stretch.times, stretch.phases)
    return out


def mean_deviation(phases, strikes):
    """Mean deviation of the phases of the strikes of a foot in a take, in hundredths of a cycle."""
    deviations = []
    for phases_of_take, of_take in zip(phases, strikes, strict=True):
        for foot in of_take:
            at = np.interp(foot, np.arange(len(phases_of_take)), phases_of_take)
            at = at[np.isfinite(at)]
            if len(at) > 1:
                mean = np.angle(np.exp(2j * np.pi * at).mean()) / (2 * np.pi)
                deviations.append((at - mean + 0.5) % 1 - 0.5)
    return 100 * np.abs(np.concatenate(deviations)).mean()


def test_matched_phases_of_foot_strikes_vary_less_than_at_constant_periods(cycles, read):
    """On jogging; the pattern is that of two other actors."""
    bunch = read("hdm05", cycles.CYCLIC["hdm05"])
    strikes = [
        cycles.foot_strikes(x, bunch.skeleton, rate)
        for x, rate in zip(bunch.data, bunch.frame_rate, strict=True)
    ]
    periods = CycleSegmenter(bunch.skeleton).report(bunch.data)["period"]
    constant = [np.arange(len(x)) / p for x, p in zip(bunch.data, periods, strict=True)]
    followed = phases_of_others(bunch)
    within = [mean_deviation(phases, strikes) for phases in (followed, constant)]
    assert within[0] < 2
    assert within[0] < 0.6 * within[1]


# -- stretches of long takes ---------------------------------------------------------------


@pytest.fixture(scope="module")
def walks(cycles, real_data):
    """Every sixth one: walks and jogs."""
    return list(cycles.walks(real_data))[::6]


def test_walks_between_standing_are_found_and_cut_inside(cycles, walks):
    """All of them, with nine tenths of the cuts in the walk."""
    cyclic, right, _, inside, cuts, good, found = cycles.standing(walks, 2, "noise", 30)
    assert cyclic == right == len(walks) == 5
    assert good >= 0.9 * cuts
    assert inside >= 12
    assert found <= len(walks) + 1


def test_jogs_among_single_actions_are_found(cycles, real_data):
    takes, _, found, others = cycles.among_actions(real_data, 4, jogs=True)
    assert found >= 0.9 * takes
    assert others == 0


def test_single_actions_one_after_the_other_are_not_cyclic(cycles, real_data):
    assert cycles.among_actions(real_data, 3)[1] == 0
    file = np.load(real_data / "uiprmd" / "uiprmd_odd_positions.npz")
    points = file["positions"] - file["positions"].mean(axis=1, keepdims=True)
    takes = np.split(points.reshape(len(points), -1), file["offsets"][1:-1])[::40]
    assert not CycleSegmenter().report(takes)["cyclic"].any()


def test_gestures_are_found(cycles, real_data):
    """In clips, and in recordings of ten actions, where no other stretch is found."""
    *rows, (_, others) = cycles.gestures(real_data)
    counts = {label: tuple(numbers) for label, *numbers in rows}
    n_clips, cyclic, n_labels, found = counts["waveHands"]
    assert (n_clips, n_labels) == (20, 20)
    assert cyclic >= 0.9 * n_clips
    assert cyclic + found >= 0.8 * (n_clips + n_labels)
    assert others == 0
