"""Gaps of people: what the benchmark cuts, and how far key moments are missed."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from sklearn_motionsync.matching.gaps import Filler


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
    # A limb of a third of the clips changes the mean of all errors by less than chance.
    names = ["as they are"] if kind == "limb" else ["as they are", "mean"]
    ways = {name: gaps.WAYS[name] for name in names}
    found = gaps.compare(people, actions, kind, 0, ways)
    missed, *by_mean = (np.mean(found[name] / whole) for name in names)
    assert missed < 1.1
    assert all(missed < 0.95 * other for other in by_mean)


def test_velocities_of_people_are_filled_better_than_over_time_alone(gaps, real_data):
    judged = {"hopBothLegs1hops", "jogLeftCircle4StepsRstart"}
    events = [event for event in gaps.JUDGED if event.action in judged]
    errors = {"own": [], "fill_gaps": []}
    for i, action in enumerate(gaps.read_actions(real_data, events)):
        positions = gaps.hide(action, "joints", [0, i])
        cosines = gaps.to_cosines(action, positions)
        truth = gaps.to_cosines(action, action.data)
        filler = Filler.learn(cosines)
        filled = {
            "own": [filler(x)[0] for x in cosines],
            "fill_gaps": gaps.by_fill_gaps(cosines, action, positions),
        }
        for name, some in filled.items():
            apart = [x - y for x, y in zip(some, truth, strict=True)]
            speeds = [gaussian_filter1d(x, 0.02 * len(x), axis=0, order=1) for x in apart]
            errors[name].append(sum(len(v) * np.square(v).sum() for v in speeds))
    logs = {name: np.mean(np.log(some)) for name, some in errors.items()}
    assert logs["own"] < np.log(0.8) + logs["fill_gaps"]
