"""Many trials: memory by portions, what is read by index, and fits to a sample."""

import tracemalloc

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.model_selection import cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    LinearSynchronizer,
    PartSynchronizer,
    to_frame,
)
from sklearn_motionsync.inputs import validation as reading
from sklearn_motionsync.matching import median
from sklearn_motionsync.synchronizers import learning, training

from shift_synchronizer import ShiftSynchronizer

PAPER = {"cost": "pose", "max_rate": 2, "consensus": 0, "max_offset": 0.1}


def walks(n, n_frames=30, n_features=3, dtype=np.float64):
    steps = np.random.default_rng(0).standard_normal((n, n_frames, n_features))
    return np.cumsum(steps, axis=1).astype(dtype)


class Files:
    """Gives trials by index, and records the indices."""

    def __init__(self, trials):
        self.trials, self.read = trials, []

    def __len__(self):
        return len(self.trials)

    def __getitem__(self, i):
        self.read.append(i)
        return self.trials[i]


X = walks(16, 20)
KINDS = {
    "double": X,
    "single": X.astype(np.float32),
    "lengths": [x[: 14 + i % 7] for i, x in enumerate(X)],
    "tables": [pd.DataFrame(x, columns=["a", "b", "c"]) for x in X],
}
SYNCHRONIZERS = {
    "dense": DenseSynchronizer(15),
    "linear": LinearSynchronizer(15),
    "parts": PartSynchronizer({"arm": [0]}, synchronizer=DenseSynchronizer(15)),
    "outside": ShiftSynchronizer(15),
}


@pytest.fixture
def small_parts(monkeypatch):
    """Five trials at a time."""
    monkeypatch.setattr(reading, "MANY", 5)


def peak_of(call):
    tracemalloc.start()
    try:
        call()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


# -- memory ---------------------------------------------------------------------------------


def test_paths_of_long_trials_take_little_memory():
    """24 of 250 to 540 frames, 0.5 MB, whose rows of the trellis would take 180."""
    X = [np.cumsum(walks(1, n)[0], axis=0) for n in np.linspace(250, 540, 24).astype(int)]
    sync = DenseSynchronizer(cost="pose").fit(X)
    assert peak_of(lambda: sync.transform(X)) < 30e6


@pytest.mark.filterwarnings("ignore::sklearn_motionsync.SynchronizationWarning")
@pytest.mark.parametrize("settings", [{}, {"pattern": 3}, PAPER])
def test_portions_change_nothing(monkeypatch, settings):
    X = walks(16, 20, dtype=np.float32)
    monkeypatch.setattr(median, "MOST_REFERENCES", 12)
    expected = DenseSynchronizer(**settings).fit(X)
    monkeypatch.setattr(learning, "PORTION_CELLS", 5_000)
    sync = DenseSynchronizer(**settings).fit(X)
    assert sync.pattern_index_ == expected.pattern_index_
    assert sync.mu_ == expected.mu_
    # Single precision: products of one base and of several may round differently.
    distances = sync.global_distances_
    np.testing.assert_allclose(distances, expected.global_distances_, rtol=1e-9)
    np.testing.assert_array_equal(sync.exemplars_, expected.exemplars_)
    np.testing.assert_array_equal(sync.match(X[:9]).times, expected.match(X[:9]).times)


def test_memory_of_fit_and_transform_is_bounded():
    X = walks(2500, 20, 32, dtype=np.float32)
    sync = DenseSynchronizer(pattern=0, metric=None, refine=False, max_offset=0.05, consensus=1)
    assert peak_of(lambda: sync.fit(X)) < 2.6 * X.nbytes
    assert peak_of(lambda: sync.transform(X)) < 1.9 * X.nbytes
    linear = LinearSynchronizer().fit(X[:10])
    assert peak_of(lambda: linear.transform(X)) < 1.7 * X.nbytes


# -- what is read by index ------------------------------------------------------------------


@pytest.mark.usefixtures("small_parts")
@pytest.mark.parametrize(
    ("name", "kind"),
    [("dense", "lengths"), ("linear", "tables"), ("parts", "single"), ("outside", "double")],
)
def test_trials_are_read_once(name, kind):
    trials, files = KINDS[kind], Files(KINDS[kind])
    expected = clone(SYNCHRONIZERS[name]).fit(trials)
    sync = clone(SYNCHRONIZERS[name]).fit(files)
    assert sync.pattern_.tobytes() == expected.pattern_.tobytes()
    warped = sync.transform(files)
    assert files.read == 2 * list(range(len(X)))
    assert warped.dtype == expected.pattern_.dtype
    np.testing.assert_array_equal(warped, expected.transform(trials))
    times = sync.match(Files(trials)).times
    np.testing.assert_array_equal(times, expected.match(trials).times)


@pytest.mark.usefixtures("small_parts")
def test_memory_maps_equal_arrays(tmp_path):
    np.save(tmp_path / "all.npy", KINDS["single"])
    maps = np.load(tmp_path / "all.npy", mmap_mode="r")
    sync = DenseSynchronizer().fit(maps)
    expected = sync.transform(KINDS["single"])
    for given in (maps, list(maps), tuple(maps)):
        np.testing.assert_array_equal(sync.transform(given), expected)
    # They tell their precision unread: all of them count, as they do in memory.
    mixed = [maps[0], *np.load(tmp_path / "all.npy", mmap_mode="r")[1:]]
    np.save(tmp_path / "one.npy", X[15])
    mixed[15] = np.load(tmp_path / "one.npy", mmap_mode="r")
    assert sync.transform(mixed).dtype == np.float64


@pytest.mark.usefixtures("small_parts")
def test_tables_by_index_equal_a_list():
    sync = DenseSynchronizer().fit(KINDS["tables"]).set_output(transform="pandas")
    named = [x.copy() for x in KINDS["tables"]]
    for x, label in zip(named, "abcdefghijklmnop", strict=True):
        x.attrs["trial"] = label
    for given in (KINDS["tables"], named):
        pd.testing.assert_frame_equal(sync.transform(Files(given)), sync.transform(given))


BAD = {
    "infinity": (np.where(np.arange(20)[:, None] == 5, np.inf, X[11]), "frame 5, feature 0 is inf"),
    "width": (X[11][:, :2], "has 2 features a frame"),
    "unit": (1e40 * X[11], "e\\+40.*give the data in another unit"),
    "text": ([["a"] * 3] * 9, "is not a numeric array"),
    "ragged": ([[1.0, 2.0, 3.0], [1.0, 2.0]], "is not a numeric array"),
}


@pytest.mark.usefixtures("small_parts")
@pytest.mark.parametrize(
    ("name", "bad"),
    [*(("dense", bad) for bad in BAD), ("parts", "infinity"), ("outside", "infinity")],
)
def test_transform_names_the_index_of_bad_trials(name, bad):
    sync = clone(SYNCHRONIZERS[name]).fit(X)
    spoilt = list(X)
    spoilt[11], message = BAD[bad]
    with pytest.raises(ValueError, match=f"Trial 11.*{message}"):
        sync.transform(Files(spoilt))


def test_transform_refuses_mixed_precision():
    sync = LinearSynchronizer().fit(X)
    single = KINDS["single"]
    with pytest.raises(ValueError, match="Trial 9 is float64, and those before are float32"):
        sync.transform(Files([*single[:9], *X[9:]]))
    assert sync.transform(Files([*X[:9], *single[9:]])).dtype == np.float64


def test_files_are_a_collection_for_all_estimators():
    files = Files(X)
    pipe = make_pipeline(ASpace(2), DenseSynchronizer(15, metric=None), ActionModel())
    expected = cross_val_score(pipe, list(X), cv=3)
    np.testing.assert_array_equal(cross_val_score(pipe, files, cv=3), expected)
    assert to_frame(files).equals(to_frame(X))
    with pytest.raises(ValueError, match="Found 0 trials"):
        DenseSynchronizer().fit(Files([]))


# -- fits to a sample -----------------------------------------------------------------------


@pytest.mark.parametrize("settings", [{}, PAPER, {"pattern": X[3]}])
def test_fit_to_a_sample_equals_a_fit_to_these_trials(settings):
    files = Files(X)
    sync = DenseSynchronizer(max_fit=9, **settings).fit(files)
    sample = sync.sample_
    assert len(sample) == 9
    # The first is read for its kind.
    assert sorted({0, *files.read}) == sorted({0, *sample.tolist()})
    assert len(files.read) == len(set(files.read))
    expected = DenseSynchronizer(**settings).fit(X[sample])
    np.testing.assert_array_equal(sync.transform(X), expected.transform(X))
    np.testing.assert_array_equal(sync.exemplars_, sample[expected.exemplars_])
    np.testing.assert_array_equal(sync.global_distances_[sample], expected.global_distances_)
    assert np.isnan(np.delete(sync.global_distances_, sample)).all()
    assert len(sync.global_distances_) == 16
    if "pattern" not in settings:
        assert sync.pattern_index_ == sample[expected.pattern_index_]
        assert sync.pattern_.tobytes() == X[sync.pattern_index_].tobytes()
        np.testing.assert_array_equal(expected.sample_, np.arange(9))
    if expected.metric_:
        learnt = sample[expected.metric_.trials]
        np.testing.assert_array_equal(sync.metric_.trials, learnt)


def test_sample_does_not_depend_on_the_kind_of_input():
    expected = DenseSynchronizer(max_fit=9).fit(X)
    for given in (list(X), tuple(X), to_frame(X)):
        sync = DenseSynchronizer(max_fit=9).fit(given)
        assert sync.pattern_.tobytes() == expected.pattern_.tobytes()
        np.testing.assert_array_equal(sync.sample_, expected.sample_)
    rows = X[:, :, 0]
    expected = DenseSynchronizer(max_fit=9).fit(rows)
    for given in (pd.DataFrame(rows), rows.tolist()):
        sync = DenseSynchronizer(max_fit=9).fit(given)
        assert sync.pattern_.tobytes() == expected.pattern_.tobytes()
        np.testing.assert_array_equal(sync.sample_, expected.sample_)
    whole = DenseSynchronizer(max_fit=16).fit(X)
    assert whole.pattern_.tobytes() == DenseSynchronizer().fit(X).pattern_.tobytes()
    other = DenseSynchronizer(max_fit=9, random_state=1).fit(X)
    assert set(other.sample_) != set(expected.sample_)


@pytest.mark.parametrize("pattern", [0, 7, 15])
def test_given_pattern_is_in_the_sample(pattern):
    sync = DenseSynchronizer(max_fit=5, pattern=pattern).fit(X)
    assert (sync.pattern_index_, len(sync.sample_)) == (pattern, 5)
    assert sync.pattern_.tobytes() == X[pattern].tobytes()
    with pytest.raises(ValueError, match="pattern=16 is out of range: there are 16 trials"):
        DenseSynchronizer(max_fit=5, pattern=16).fit(X)


def test_parts_are_learnt_from_the_sample():
    sync = PartSynchronizer({"arm": [0, 1]}, synchronizer=DenseSynchronizer(max_fit=9)).fit(X)
    expected = PartSynchronizer({"arm": [0, 1]}).fit(X[sync.synchronizer_.sample_])
    np.testing.assert_array_equal(sync.transform(X), expected.transform(X))


def test_only_the_sample_is_checked():
    sample = DenseSynchronizer(max_fit=9).fit(X).sample_
    spoilt = X.copy()
    spoilt[np.delete(np.arange(16), sample)] = np.nan
    DenseSynchronizer(max_fit=9).fit(spoilt)
    spoilt[sample[7], 3, 1] = np.inf
    with pytest.raises(ValueError, match=f"Trial {sample[7]}, frame 3, feature 1"):
        DenseSynchronizer(max_fit=9).fit(spoilt)


def test_memory_limit_names_max_fit(monkeypatch):
    monkeypatch.setattr(training, "MOST_BYTES", 6 * X.size)
    with pytest.raises(ValueError, match="Or learn from some: max_fit=1000"):
        DenseSynchronizer().fit(X)
    with pytest.raises(ValueError, match=r"or trials\.$"):
        LinearSynchronizer().fit(X)
    DenseSynchronizer(max_fit=9).fit(X)
