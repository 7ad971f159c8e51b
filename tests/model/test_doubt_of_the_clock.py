"""What a model makes of intervals of the clock: departures by timing, and the band of the mean."""

import numpy as np
import pytest
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
    Match,
)
from sklearn_motionsync.model import find_departures
from sklearn_motionsync.model.departures import Departure, explained_by_timing
from sklearn_motionsync.synchronizers.intervals import Intervals

P = 60


def match_within(half_width, n=1):
    """A match at an even pace whose intervals of 90 % have one half-width, in frames."""
    times = np.tile(np.arange(float(P)), (n, 1))
    match = Match(times)
    widths = np.full(times.shape, float(half_width))
    match.intervals = Intervals(times, lambda: (widths, np.ones(n), [None] * n))
    return match


def departure(first, last):
    """Of the only feature of the first trial."""
    places = first, last, first, first, last, np.nan, np.nan
    return Departure(0, "value", None, None, None, 0, *places, 1.0, "", 10.0, True)


@pytest.mark.parametrize(
    ("half_width", "explained"), [(0, False), (1.5, False), (3, True), (10, True)]
)
def test_a_late_step_is_timing_if_the_interval_reaches_it(half_width, explained):
    """Two frames late, within bounds of a tenth."""
    mean = np.where(np.arange(P) < 30, 0.0, 1.0)[:, np.newaxis]
    late = np.where(np.arange(P) < 33, 0.0, 1.0)[np.newaxis, :, np.newaxis]
    rows, match = [departure(30, 32)], match_within(half_width)
    found = explained_by_timing(rows, late, mean - 0.1, mean + 0.1, match)
    assert found.tolist() == [explained]


def test_a_value_that_never_comes_is_not_timing():
    mean = np.sin(np.linspace(0, 6, P))[:, np.newaxis]
    high = mean[np.newaxis] + 2.5
    rows, match = [departure(0, P - 1)], match_within(P)
    assert not explained_by_timing(rows, high, mean - 0.1, mean + 0.1, match).any()


def test_a_lifted_forearm_is_no_timing_and_departures_of_people_often_are(bends):
    """Actors held out: their departures, and those of a forearm that points up for most of it."""
    skeleton = DirectionCosines(bends.skeleton).fit(bends.data)
    poses = skeleton.transform(bends.data)
    known, new = np.flatnonzero(bends.actor != "tr")[::2], np.flatnonzero(bends.actor == "tr")
    pipe = make_pipeline(ASpace(), DenseSynchronizer(40), ActionModel())
    pipe.fit([poses[i] for i in known], actionmodel__groups=bends.actor[known])
    names = list(skeleton.get_feature_names_out())
    arm = [i for i, name in enumerate(names) if name.startswith("left_forearm")]
    lifted = [poses[i].copy() for i in new]
    for x in lifted:
        x[len(x) // 3 :, arm] = 0, 1, 0
    of_arm = find_departures(pipe, lifted)
    of_arm = of_arm[of_arm["feature"].isin([f"x{i}" for i in arm])]
    of_arm = of_arm.groupby("trial").head(1)
    assert of_arm["trial"].nunique() == len(new)
    assert of_arm["timing"].mean() < 0.2
    untouched = find_departures(pipe, [poses[i] for i in new], limit=2)
    assert untouched["timing"].mean() > 0.3


def test_where_nothing_tells_departures_are_not_timing(bending):
    points = ASpace(3).fit_transform(bending.data[:12])
    pipe = make_pipeline(LinearSynchronizer(P), ActionModel()).fit(points)
    wrong = [2 * x for x in points[:3]]
    assert not find_departures(pipe, wrong)["timing"].any()
    model = ActionModel().fit(LinearSynchronizer(P).fit_transform(points))
    assert not find_departures(model, [2 * model.mean_])["timing"].any()


def test_the_band_of_the_mean_with_the_doubt_of_the_clock(bending_aspace):
    sync = DenseSynchronizer(P).fit(bending_aspace[:12])
    match = sync.match(bending_aspace[:12])
    model = ActionModel().fit(match.warp(bending_aspace[:12]))
    plain, wide = model.mean_envelope(), model.mean_envelope(match=match)
    lower, upper = match.interval(0.6827)
    error = (upper - lower).mean(axis=0)[:, np.newaxis] / 2 * np.gradient(model.mean_, axis=0)
    for own, other, side in zip(plain, wide, (-1, 1), strict=True):
        half_width = np.hypot(own - model.mean_, error)
        np.testing.assert_allclose(other, model.mean_ + side * half_width)
    other = Match(np.tile(np.arange(30.0), (2, 1)))
    with pytest.raises(ValueError, match="The match has 30 frames, the model 60: give the match"):
        model.mean_envelope(match=other)
    with pytest.raises(ValueError, match=r"only DenseSynchronizer\.match does"):
        model.mean_envelope(match=Match(match.times))
