"""NormDisplay: the subject, the norm and the departures are those of the comparison."""

import numpy as np
import pytest
from artists import edges, segments, texts
from sklearn_motionsync import DenseSynchronizer
from sklearn_motionsync.comparison import compare_to_norm
from sklearn_motionsync.datasets import make_gait
from sklearn_motionsync.display import NormDisplay

GAIT = make_gait(24, 2, timing=7, amplitude=-25, random_state=1)


@pytest.fixture(scope="module")
def found():
    norm = [x for x, group in zip(GAIT.data, GAIT.group, strict=True) if group == "A"]
    sync = DenseSynchronizer(51).fit(norm)
    return compare_to_norm(sync, GAIT.data, GAIT.group, norm="A", groups=GAIT.person, level=0.2)


def test_lines_and_bands_are_those_of_the_comparison(found):
    subject = found.departures.loc[found.departures["what"] == "shape", "subject"].iloc[0]
    i = found.verdicts.index.get_loc(subject)
    display = NormDisplay.from_comparison(found, subject, units={"x1": "degrees"})
    assert len(display.axes_) == 5
    for k in range(5):
        # The offset is counted from that of the norm, which is flat.
        mean = found.mean[:, k] * (k < 4)
        curve = found.curves[i, :, k] - found.mean[:, k] * (k == 4)
        np.testing.assert_array_equal(display.subject_[k].get_ydata(), curve)
        np.testing.assert_array_equal(display.mean_[k].get_ydata(), mean)
        reach = found.limits[i, k] * found.std[:, k]
        np.testing.assert_allclose(edges(display.bands_[k]), [mean - reach, mean + reach])
        # Violet where a row of the table is, and nowhere else.
        rows = found.departures[found.departures["subject"] == subject]
        rows = rows[rows["feature"] == found.features[k]]
        drawn = [xy[:, 0] for xy in segments(display.departures_[k])]
        assert bool(drawn) == bool(len(rows))
        if drawn:
            drawn = np.concatenate(drawn)
            assert abs(drawn.min() - rows["start"].min()) < 2
            assert abs(drawn.max() - rows["end"].max()) < 2
    assert display.axes_[1].get_ylabel() == "x1 (degrees)"
    assert "at least 80 % of new people stay inside in all panels" in texts(display.axes_[0])
    title = display.axes_[0].get_legend().get_title().get_text().replace("\n", " ")
    assert title == found.describe(subject)


@pytest.mark.filterwarnings("ignore::sklearn_motionsync.SynchronizationWarning")
def test_signals_with_departures_are_shown_first():
    rng = np.random.default_rng(0)
    X = rng.standard_normal((20, 30, 6)) + np.sin(np.linspace(0, 3, 30))[:, np.newaxis]
    X[19, 10:14, 5] += 30
    sync = DenseSynchronizer(30).fit(X[:19])
    found = compare_to_norm(sync, X, ["n"] * 18 + ["p"] * 2, norm="n")
    for subject, last, departs in ((19, "x5", True), (18, "x3", False)):
        display = NormDisplay.from_comparison(found, subject, xlabel="% gait cycle")
        assert display.labels == ["x0", "x1", "x2", last]
        assert ("departs" in texts(display.axes_[0])) == departs
        assert display.axes_[-1].get_xlabel() == "% gait cycle"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"subject": "person0"}, "There is no subject 'person0'; there are"),
        ({"comparison": {}}, "Give what compare_to_norm returns, got dict"),
        ({"features": "elbow"}, "There is no feature 'elbow'"),
        ({"units": {"elbow": "deg"}}, "units: there is no signal 'elbow'"),
    ],
)
def test_refused_arguments(found, change, message):
    with pytest.raises(ValueError, match=message):
        NormDisplay.from_comparison(**({"comparison": found, "subject": "person1"} | change))
