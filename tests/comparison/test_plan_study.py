"""How many people a study needs, against studies of the same people that are carried out."""

import numpy as np
import pandas as pd
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.stats import norm
from sklearn_motionsync import LinearSynchronizer
from sklearn_motionsync.comparison import plan_study
from sklearn_motionsync.comparison.permutations import families
from sklearn_motionsync.comparison.planning import Pilot, least_people, power_of
from sklearn_motionsync.comparison.study import Study
from sklearn_motionsync.utils.parallel import Progress


def pilot_of(paired, height=1.4, n=60):
    """A bump in the second label, in smooth noise, and offsets without a difference."""
    rng, y = np.random.default_rng(0), [0, 1] * n
    groups = np.repeat(range(n), 2).tolist() if paired else None
    study = Study.of(y, groups, covariate=False, paired=paired, n=2 * n)
    noise = gaussian_filter1d(rng.standard_normal((2, 2 * n, 45, 1)), 4, axis=2)[:, :, 10:35]
    curves, offsets = noise / noise.std()
    curves += height * np.outer(y, np.exp(-0.5 * np.square((np.arange(25) - 12) / 4)))[..., None]
    return Pilot(study, [study.units(curves), study.units(offsets)], 1.0)


@pytest.mark.parametrize(("paired", "n"), [(False, 9), (True, 12)])
def test_the_power_is_that_of_studies_with_permutations_of_their_own(paired, n):
    pilot, rng, found = pilot_of(paired), np.random.RandomState(0), 0
    planned = power_of(pilot, n, "shape", 0.05, 300, rng)
    for _ in range(60):
        design, values = pilot.draw(n, rng)
        (shape,) = families(design, values[:1], 99, rng, progress=Progress(None, 0))
        found += shape.p_value <= 0.05
    error = np.sqrt(planned * (1 - planned) * (1 / 60 + 1 / 300))
    assert 0.2 < planned < 0.95
    assert found / 60 == pytest.approx(planned, abs=3 * error)


def test_people_of_a_pilot_have_its_means_and_covariances():
    pilot = pilot_of(paired=False)
    design, (curves, offsets) = pilot.draw(4000, np.random.RandomState(0))
    assert design.counts.tolist() == [4000, 4000]
    for values, fitted, deviations in zip(
        (curves, offsets), pilot.fitted, pilot.deviations, strict=True
    ):
        for k, rows in enumerate((slice(4000), slice(4000, None))):
            drawn, known = values[rows, :, 0], deviations[k][:, :, 0]
            np.testing.assert_allclose(drawn.mean(axis=0), fitted[k, :, 0], atol=0.08)
            np.testing.assert_allclose(np.cov(drawn.T), known.T @ known, atol=0.12)
    # Those of the noise of the pilot, whose variance is 1.
    assert np.cov(offsets[:4000, :, 0].T).diagonal().mean() == pytest.approx(1, abs=0.1)
    values = np.random.default_rng(2).standard_normal((6, 2000, 1))
    study = Study.of([*"aaabbb"], None, covariate=False, paired=False, n=6)
    (drawn,) = Pilot(study, [values], 1.0).draw(50, np.random.RandomState(0))[1]
    spread = np.mean([drawn[k : k + 50].var(axis=0, ddof=1).mean() for k in (0, 50)])
    assert spread == pytest.approx(1, abs=0.15)


def test_smaller_differences_need_more_people():
    rng, t = np.random.default_rng(1), np.linspace(0, 1, 30)
    y = ["old", "new"] * 8
    X = [np.sin(3 * t + rng.normal(0, 0.2) + 0.3 * (k % 2))[:, np.newaxis] for k in range(16)]
    match = LinearSynchronizer(30).fit(X).match(X)
    plans = [plan_study(match, X, y, change=c, n_studies=50) for c in (1, 0.6)]
    assert plans[0].attrs["people"] < plans[1].attrs["people"]
    assert (plans[0]["power"] >= plans[1]["power"].loc[plans[0].index]).all()
    assert plan_study(match, X, y, change=0.01, n_studies=10).attrs["people"] is None
    for wrong in ({"power": 1}, {"change": 0}, {"n_studies": 5}, {"what": "when"}, {"level": 2}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            plan_study(match, X, y, **wrong)


def test_studies_that_cannot_find_anything_have_no_power():
    pilot, rng = pilot_of(paired=True, height=9), np.random.RandomState(0)
    # The least p of five pairs is .0625.
    assert power_of(pilot, 5, "shape", 0.05, 20, rng) == 0
    assert power_of(pilot, 7, "shape", 0.05, 20, rng) > 0.5
    assert power_of(pilot, 7, "shape", 1e-4, 20, rng) == 0


def test_the_least_number_lies_on_a_line_of_deviates():
    sizes = np.array([4, 9, 16, 25, 36])
    powers = pd.Series(norm.cdf(np.sqrt(sizes) - 3.5), index=sizes)
    # The root of 18.83 is 3.5 and the deviate of .8.
    assert least_people(powers, 0.8, 10**9) == 19
    assert least_people(powers, 0.05, 10**9) == 4
    assert least_people(powers, 0.999, 10**9) is None
