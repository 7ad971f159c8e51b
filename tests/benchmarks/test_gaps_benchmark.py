"""Gaps of people: what the benchmark cuts, and how far key moments are missed."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from sklearn_motionsync.matching.gaps import Filler, interpolate_gaps


@pytest.fixture(scope="module")
def gaps(benchmark):
    return benchmark("gaps")


def test_runs_have_the_share_and_the_length(gaps):
    rng = np.random.default_rng(0)
    mask = gaps.runs(rng, 200_000, 0.1, 6)
    assert abs(mask.mean() - 0.1) < 0.01
    starts = np.flatnonzero(np.diff(mask.astype(int)) == 1)
    assert abs(mask.sum() / len(starts) - 6) < 0.3


@pytest.mark.filterwarnings("ignore:Matching leaves")
@pytest.mark.parametrize(
    "kind", ["limb", "frames", pytest.param("joints", marks=pytest.mark.nightly)]
)
def test_key_moments_of_people_are_missed_as_without_gaps(kind, gaps, real_data):
    events = [event for event in gaps.JUDGED if event.action == "grabHighR"]
    actions = gaps.read_actions(real_data, events)
    people = [gaps.People(action, patterns=2) for action in actions]
    found = gaps.compare(people, actions, None, 0, {"": gaps.as_they_are})
    (whole,) = found.values()
    (missed,) = gaps.compare(people, actions, kind, 0, {"": gaps.as_they_are}).values()
    assert np.mean(missed / whole) < 1.1


@pytest.mark.parametrize("length", [40, pytest.param(20, marks=pytest.mark.nightly)])
def test_positions_are_filled_at_least_as_well_as_in_any_simple_way(length, gaps, real_data):
    chosen = ("grabHighR", "jogLeftCircle4StepsRstart")
    actions = gaps.read_actions(real_data, [e for e in gaps.JUDGED if e.action in chosen])
    for hidden in (gaps.LIMBS["hdm05"][:2], gaps.LIMBS["hdm05"][2:], ()):
        found = [gaps.distances(action, hidden, length) for action in actions]
        means = {way: np.mean(np.concatenate([d[way] for d in found])) for way in found[0]}
        assert means.pop("fill_gaps") < 1.02 * min(means.values())


def test_velocities_of_people_are_filled_better_than_over_time_alone(gaps, real_data):
    judged = {"hopBothLegs1hops", "jogLeftCircle4StepsRstart"}
    events = [event for event in gaps.JUDGED if event.action in judged]
    errors = {"own": [], "in time": []}
    for i, action in enumerate(gaps.read_actions(real_data, events)):
        positions = gaps.hide(action, "joints", [0, i])
        cosines = gaps.to_cosines(action, positions)
        truth = gaps.to_cosines(action, action.data)
        filler = Filler.learn(cosines)
        filled = {
            "own": [filler(x)[0] for x in cosines],
            "in time": gaps.to_cosines(action, [interpolate_gaps(x, held=True) for x in positions]),
        }
        for name, some in filled.items():
            apart = [x - y for x, y in zip(some, truth, strict=True)]
            speeds = [gaussian_filter1d(x, 0.02 * len(x), axis=0, order=1) for x in apart]
            errors[name].append(sum(len(v) * np.square(v).sum() for v in speeds))
    logs = {name: np.mean(np.log(some)) for name, some in errors.items()}
    assert logs["own"] < np.log(0.8) + logs["in time"]
