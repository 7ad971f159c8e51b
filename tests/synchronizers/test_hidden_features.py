"""Trials with gaps: what is matched, kept as NaN, and refused."""

import numpy as np
import pandas as pd
import pytest
from sklearn import clone, config_context
from sklearn.model_selection import cross_validate
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    DenseSynchronizer,
    LinearSynchronizer,
    PartSynchronizer,
    TimingChannel,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.metrics import SpreadScorer

P = 40
DENSE = DenseSynchronizer(P)
SYNCHRONIZERS = {
    "dense": DENSE,
    "paper": DenseSynchronizer.paper(n_frames=P),
    "refined": DenseSynchronizer(P, refine=True),
    "parts": PartSynchronizer({"one": [0, 1, 2], "two": [5, 6]}, synchronizer=DENSE),
    "timing": TimingChannel(DENSE),
    "linear": LinearSynchronizer(P),
    "sample": DenseSynchronizer(P, max_fit=5),
}
WHOLE = [x[:, 6:18] for x in make_bending(8, random_state=0).data]


def with_gaps(trials, seed=0):
    """A limb hidden for a third, some frames gone, and a feature that flickers."""
    rng = np.random.default_rng(seed)
    out = [x.copy() for x in trials]
    for i, x in enumerate(out):
        n = len(x)
        if i % 3 == 0:
            x[n // 3 : 2 * n // 3, 3:6] = np.nan
        elif i % 3 == 1:
            x[n // 2 : n // 2 + n // 10] = np.nan
        x[rng.random(n) < 0.1, 7] = np.nan
    return out


GAPPY = with_gaps(WHOLE)


def mean_error(times, expected):
    return np.abs(times - expected).mean()


@pytest.mark.parametrize("name", ["dense", "paper", "refined", "parts"])
def test_warps_are_those_without_gaps_nearly(name):
    sync = clone(SYNCHRONIZERS[name])
    expected = sync.fit(WHOLE).match(WHOLE)
    # Learnt from whole trials, and from those with gaps.
    after = sync.match(GAPPY)
    # To the same pattern.
    inner = sync.synchronizer_ if name in ("parts", "timing") else sync
    given = "synchronizer__pattern" if inner is not sync else "pattern"
    both = clone(sync).set_params(**{given: inner.pattern_index_}).fit(GAPPY).match(GAPPY)
    moved = np.abs(expected.offsets).mean()
    assert mean_error(after.times, expected.times) < 0.1 * moved
    assert mean_error(both.times, expected.times) < 0.5 * moved


@pytest.mark.parametrize("name", ["dense", "parts", "linear"])
def test_trials_without_gaps_keep_every_bit(name):
    sync = clone(SYNCHRONIZERS[name]).fit(WHOLE)
    whole = [5, 6]
    some = [GAPPY[0], WHOLE[5], GAPPY[1], WHOLE[6]]
    expected, found = sync.match([WHOLE[i] for i in whole]), sync.match(some)
    np.testing.assert_array_equal(found.times[[1, 3]], expected.times)
    np.testing.assert_array_equal(found.distances[[1, 3]], expected.distances)
    np.testing.assert_array_equal(
        sync.transform(some)[[1, 3]], sync.transform([WHOLE[i] for i in whole])
    )


@pytest.mark.parametrize("name", ["dense", "parts", "timing", "linear"])
def test_what_was_hidden_stays_nan(name):
    sync = clone(SYNCHRONIZERS[name]).fit(GAPPY)
    out = sync.transform(GAPPY)[:, :, : GAPPY[0].shape[1]]
    # Everything else is there, at the same moments.
    if name != "parts":
        expected = sync.match(GAPPY).warp(GAPPY)
        np.testing.assert_array_equal(out, expected)
    hidden = np.isnan(out)
    assert hidden[0, :, 3:6].any()
    assert not hidden[:, :, [0, 1, 2, 6, 8]][[0, 2, 3]].any()
    assert hidden[1].all(axis=1).any()
    assert np.isfinite(sync.match(GAPPY).times).all()
    assert np.isfinite(sync.match(GAPPY).distances).all()
    if name != "timing":
        for attribute in ("pattern_", "examples_", "global_distances_"):
            assert np.isfinite(getattr(sync, attribute)).all()


def test_rows_and_memory_maps(tmp_path):
    rows = np.stack([np.resize(x[:, 3], 50) for x in GAPPY])
    assert np.isnan(rows).any()
    np.save(tmp_path / "X.npy", rows)
    maps = np.load(tmp_path / "X.npy", mmap_mode="r")
    out = clone(DENSE).fit(maps).transform(maps)
    alone = clone(DENSE).fit(list(rows[:, :, None])).transform(list(rows[:, :, None]))
    np.testing.assert_array_equal(out, alone[:, :, 0])


# -- what is refused ------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["dense", "parts", "timing", "linear"])
def test_a_trial_that_shows_nothing_is_refused_by_its_index(name):
    empty = [*GAPPY[:3], np.full((30, 12), np.nan)]
    sync = clone(SYNCHRONIZERS[name])
    with pytest.raises(ValueError, match=r"Trial 3 is NaN in every frame and feature.*Leave"):
        sync.fit(empty)
    with pytest.raises(ValueError, match=r"Trial 3 is NaN in every frame and feature.*Leave"):
        sync.fit(WHOLE).match(empty)


def test_a_feature_that_is_never_seen_is_refused_by_its_name():
    X = [x.copy() for x in WHOLE]
    for x in X:
        x[:, [2, 5]] = np.nan
    with pytest.raises(ValueError, match=r"Feature 2 is NaN.*never seen: 2 of 12 features"):
        clone(DENSE).fit(X)
    names = [f"f{i}" for i in range(12)]
    with pytest.raises(ValueError, match=r"Feature 2 \('f2'\) is NaN"):
        clone(DENSE).fit([pd.DataFrame(x, columns=names) for x in X])
    # After a fit that has seen it, it is filled.
    assert np.isfinite(clone(DENSE).fit(WHOLE).match(X).times).all()


# -- fill="model" ---------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["dense", "parts", "linear"])
def test_filling_by_the_model_is_better_than_the_mean(name):
    sync = clone(SYNCHRONIZERS[name]).fit(WHOLE)
    out, filled = sync.transform(GAPPY), sync.transform(GAPPY, fill="model")
    hidden = np.isnan(out)
    np.testing.assert_array_equal(filled[~hidden], out[~hidden])
    assert np.isfinite(filled).all()
    # The same moments of the whole trials.
    truth = sync.match(GAPPY).warp(WHOLE) if name != "parts" else sync.transform(WHOLE)
    mean = np.broadcast_to(sync.transform(WHOLE).mean(axis=0), out.shape)
    errors = [np.abs(guess - truth)[hidden].mean() for guess in (filled, mean)]
    assert errors[0] < 0.5 * errors[1]


def test_a_gap_at_which_all_deviate_alike_is_filled_exactly():
    # Each trial is the mean plus a constant of its own in every feature.
    t = np.linspace(0, 1, P)[:, np.newaxis]
    mean = np.concatenate([np.sin(6 * t), np.cos(5 * t)], axis=1)
    X = [mean + shift for shift in (-0.2, -0.1, 0.0, 0.1, 0.2)]
    gappy = [x.copy() for x in X]
    gappy[3][10:20] = np.nan
    sync = LinearSynchronizer(P).fit(X)
    assert np.isnan(sync.transform(gappy)[3, 10:20]).all()
    np.testing.assert_allclose(sync.transform(gappy, fill="model")[3], X[3], atol=1e-12)


def test_filling_keeps_pandas_and_single_precision_and_rows():
    single = [x.astype(np.float32) for x in GAPPY]
    sync = clone(DENSE).fit(single)
    assert sync.transform(single, fill="model").dtype == np.float32
    table = clone(DENSE).set_output(transform="pandas").fit(GAPPY).transform(GAPPY, fill="model")
    expected = clone(DENSE).fit(GAPPY).transform(GAPPY, fill="model")
    np.testing.assert_array_equal(table.to_numpy().reshape(expected.shape), expected)


@pytest.mark.parametrize("fill", ["mean", 0, True])
def test_an_unknown_fill_is_refused(fill):
    with pytest.raises(ValueError, match=r"fill=.* is unknown: use None .* or 'model'"):
        clone(DENSE).fit(WHOLE).transform(GAPPY, fill=fill)


# -- confidence= ----------------------------------------------------------------------------


def confidences(trials):
    """1 where something was seen, else 0."""
    return [np.isfinite(x).astype(float) for x in trials]


@pytest.mark.parametrize("name", ["dense", "linear", "parts", "sample", "timing"])
def test_no_confidence_is_as_nan(name):
    sync, given = clone(SYNCHRONIZERS[name]), {"confidence": confidences(GAPPY)}
    expected = clone(sync).fit(GAPPY)
    wrong = [np.where(np.isnan(x), 100.0, x) for x in GAPPY]
    fitted = clone(sync).fit(wrong, **given)
    patterns = [getattr(each, "synchronizer_", each).pattern_ for each in (fitted, expected)]
    np.testing.assert_array_equal(*patterns)
    found = fitted.match(wrong, **given)
    np.testing.assert_array_equal(found.times, expected.match(GAPPY).times)
    np.testing.assert_array_equal(found.distances, expected.match(GAPPY).distances)
    np.testing.assert_array_equal(fitted.transform(wrong, **given), expected.transform(GAPPY))
    np.testing.assert_array_equal(sync.fit_transform(wrong, **given), expected.transform(GAPPY))


def test_what_is_less_sure_counts_less():
    rng = np.random.default_rng(0)
    noisy, sure = [], []
    for x in WHOLE:
        confidence = np.ones(len(x))
        confidence[len(x) // 3 : len(x) // 2] = 0.5
        noise = rng.standard_normal(x.shape).cumsum(axis=0) * 0.3
        noisy.append(x + noise * (confidence < 1)[:, np.newaxis])
        sure.append(confidence)
    expected = DenseSynchronizer(P, pattern=0).fit(WHOLE).match(WHOLE).times
    sync = DenseSynchronizer(P, pattern=0)
    plain = mean_error(sync.fit(noisy).match(noisy).times, expected)
    weighed = sync.fit(noisy, confidence=sure).match(noisy, confidence=sure).times
    assert mean_error(weighed, expected) < plain
    # Of a frame or of each of its features.
    by_feature = [np.repeat(w[:, None], 12, axis=1) for w in sure]
    again = sync.fit(noisy, confidence=by_feature).match(noisy, confidence=by_feature).times
    np.testing.assert_array_equal(again, weighed)


def test_confidence_goes_through_pipelines_and_searches():
    sure = confidences(GAPPY)
    wrong = [np.where(np.isnan(x), 9.0, x) for x in GAPPY]
    with config_context(enable_metadata_routing=True):
        dense = clone(DENSE).set_fit_request(confidence=True)
        dense.set_transform_request(confidence=True)
        pipe = make_pipeline(dense)
        expected = clone(DENSE).fit_transform(wrong, confidence=sure)
        np.testing.assert_array_equal(pipe.fit_transform(wrong, confidence=sure), expected)
        scorer = SpreadScorer().set_score_request(confidence=True)
        given = {"confidence": sure}
        found = cross_validate(dense, wrong, cv=2, scoring=scorer, params=given)
    plain = cross_validate(DENSE, GAPPY, cv=2, scoring=SpreadScorer())
    assert np.isfinite(found["test_score"]).all()
    assert np.abs(found["test_score"] - plain["test_score"]).max() < 0.2


WRONG = {
    "one for all": (np.ones(3), "list of 8 arrays"),
    "a number": (0.5, "list of 8 arrays"),
    "too many": ([np.ones(len(x)) for x in [*WHOLE, WHOLE[0]]], "a list of 8 arrays"),
    "length": ([np.ones(3)] * 8, r"Trial 0: confidence has shape \(3,\), expected"),
    "range": ([2.0 * np.ones(len(x)) for x in WHOLE], "Trial 0: .*from 0.*to 1, got 2 to 2"),
    "NaN": ([np.full(len(x), np.nan) for x in WHOLE], "Trial 0: confidence must be from 0"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_confidence_is_refused(case):
    given, message = WRONG[case]
    with pytest.raises(ValueError, match=message):
        clone(DENSE).fit(WHOLE, confidence=given)


def test_the_trellis_that_is_drawn_is_that_of_the_match():
    sync = DenseSynchronizer.paper(n_frames=P).fit(GAPPY)
    space = sync.disparity_space(GAPPY, 1)
    np.testing.assert_array_equal(space.path, sync.match(GAPPY[1:2]).offsets[0])
    costs = space.costs[np.isfinite(space.costs)]
    assert (costs >= 0).all()
