"""PartSynchronizer: recovered lags, coupling, composition, parts, and reports of lags."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import f_oneway, ttest_1samp
from sklearn import clone
from sklearn_motionsync import DenseSynchronizer, DirectionCosines, PartSynchronizer, Skeleton
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.synchronizers import Lags

PARTS = ["left arm", "right arm", "left leg", "right leg", "trunk"]
P = 100


def of_parts(parts=None, coupling=0.001, **settings):
    """A synchronizer of parts, with settings of that of the whole body."""
    return PartSynchronizer(parts, coupling, DenseSynchronizer(**settings))


def made_poses(count, seed):
    bunch = make_bending(count, n_frames=60, random_state=seed)
    return DirectionCosines(bunch.skeleton).fit_transform(bunch.data)


def clips_of(hdm05, action):
    """Recorded clips of an action as poses, and their actors."""
    chosen = np.flatnonzero(hdm05.target == action)
    poses = DirectionCosines(hdm05.skeleton).fit_transform([hdm05.data[i] for i in chosen])
    return [x.astype(float) for x in poses], hdm05.actor[chosen]


@pytest.fixture(scope="module")
def poses():
    return made_poses(7, 0)


@pytest.fixture(scope="module")
def fitted(poses):
    return of_parts(coupling=0, n_frames=60).fit(poses)


# -- recordings --------------------------------------------------------------------------


def test_lags_are_measured_without_coupling(fitted, poses):
    """An arm that is 5 % late is found as late, while its warp is drawn to the body."""
    sync = {0: fitted, 0.1: of_parts(coupling=0.1, n_frames=60).fit(poses)}
    late = [shifted(x, fitted.parts_["right arm"], 0.05) for x in poses]
    inner, found, warped = slice(6, -12), {}, {}
    for coupling, own in sync.items():
        values = [own.lags(X, unit="percent") for X in (poses, late)]
        arm = values[0].parts.index("right arm")
        found[coupling] = np.median((values[1].values - values[0].values)[:, arm, inner])
        times = [own.match_parts(X)["right arm"].times for X in (poses, late)]
        warped[coupling] = np.median((times[1] - times[0])[:, inner]) * 100 / 59
    assert abs(found[0] - 5) < 0.6
    assert abs(found[0.1] - 5) < 0.6
    assert warped[0.1] < 2.5 < warped[0]


def test_strong_coupling_follows_warps_steeper_than_a_path(utkinect):
    """In clips of a few frames warps by way of others are steep and leave the band."""
    chosen = np.flatnonzero(utkinect.target == "walk")[::3]
    X = DirectionCosines(utkinect.skeleton).fit_transform([utkinect.data[i] for i in chosen])
    trunk = {"trunk": Skeleton.paper().parts()["trunk"]}
    for coupling, most in ((10, 0.1), (1e6, 1e-6)):
        sync = of_parts(trunk, coupling, n_frames=60).fit(X)
        apart = sync.match_parts(X)["trunk"].times - sync.match(X).times
        assert np.abs(apart).max() < most


# -- warps of parts ----------------------------------------------------------------------


def test_match_is_that_of_the_dense_synchronizer(poses):
    sync = of_parts(n_frames=40, consensus=0).fit(poses)
    dense = DenseSynchronizer(40, consensus=0).fit(poses)
    match, expected = sync.match(poses), dense.match(poses)
    np.testing.assert_array_equal(match.times, expected.times)
    np.testing.assert_array_equal(match.distances, expected.distances)
    assert sync.match_parts(poses).keys() == dict.fromkeys(PARTS).keys()


def test_infinite_coupling_gives_one_warp_for_all_parts(poses):
    sync = of_parts(coupling=np.inf, n_frames=40)
    expected = DenseSynchronizer(40).fit_transform(poses)
    np.testing.assert_array_equal(sync.fit_transform(poses), expected)
    assert not sync.lags(poses).values.any()


def test_coupled_path_is_that_of_brute_force():
    """The path straight to the pattern, by the smallest sum over all paths, cell by cell."""
    rng, n, coupling = np.random.default_rng(0), 21, 2e-3
    X = list(np.cumsum(rng.normal(size=(2, n, 3)), axis=1))
    settings = {"cost": "pose", "consensus": 0, "max_rate": 2, "smoothness": 0, "n_frames": n}
    sync = of_parts({"a": [0, 1]}, coupling, pattern=0, **settings).fit(X)
    body = sync.match(X).offsets[1]
    part = np.array(X)[:, :, :2]
    energy = np.square(part - part.mean(axis=(0, 1))).sum(axis=2).mean()
    weight = coupling * energy * (100 / (n - 1)) ** 2
    row = {0: (np.square(part[0][0] - part[1][0]).sum(), [0])}
    for p in range(1, n):
        new = {}
        for q in range(n):
            ways = [row[q - s] for s in (1, 0, 2) if q - s in row and abs(q - p) <= n // 4]
            if ways:
                cost, path = min(ways, key=lambda way: way[0])
                local = np.square(part[0][p] - part[1][q]).sum() + weight * (q - p - body[p]) ** 2
                new[q] = cost + local, [*path, q]
        row = new
    assert np.any(body)
    found = sync.match_parts(X)["a"].times[1]
    # A path stands at whole frames; what is left of one is shared.
    assert np.abs(found - row[n - 1][1]).max() <= 0.5
    assert np.abs(found - row[n - 1][1]).mean() < 0.3


def test_transform_samples_every_part_at_its_own_times(fitted, poses):
    out, matches = fitted.transform(poses), fitted.match_parts(poses)
    np.testing.assert_allclose(out[:, :, 0], fitted.match(poses).warp(poses)[:, :, 0])
    for name, columns in fitted.parts_.items():
        own = np.stack(
            [
                [np.interp(t * (len(x) - 1) / 59, np.arange(len(x)), x[:, k]) for k in columns]
                for t, x in zip(matches[name].times, poses, strict=True)
            ]
        )
        np.testing.assert_allclose(out[:, :, columns], own.swapaxes(1, 2), atol=1e-12)


def test_uncoupled_parts_are_independent(fitted, poses):
    """Only the pattern, the exemplars and the metric are common."""
    shaken = [x.copy() for x in poses]
    for x in shaken:
        x[:, fitted.parts_["trunk"]] = x[::-1, fitted.parts_["trunk"]]
    before, after = fitted.match_parts(poses), fitted.match_parts(shaken)
    for name in PARTS[:-1]:
        np.testing.assert_array_equal(before[name].times, after[name].times)
    assert np.abs(before["trunk"].times - after["trunk"].times).max() > 1


def test_part_that_does_not_move_follows_the_body_and_is_no_reference(poses):
    X = [np.column_stack([x, np.full(len(x), 3.0)]) for x in poses]
    arms = {"left": [22, 23, 24], "right": [25, 26, 27]}
    sync = of_parts({**arms, "still": [37]}, 0, n_frames=40).fit(X)
    match, lags = sync.match_parts(X)["still"], sync.lags(X)
    np.testing.assert_array_equal(match.times, sync.match(X).times)
    assert np.isnan(match.distances).all()
    assert np.isfinite(sync.transform(X)).all()
    assert (lags.values[:, 2] == 0).all()
    without = of_parts({**arms}, 0, n_frames=40).fit(X)
    np.testing.assert_allclose(lags.values[:, :2], without.lags(X).values, atol=1e-9)


def test_unit_and_jobs_do_not_change_a_part(fitted, poses):
    scaled, parts = [1024 * x for x in poses], Skeleton.paper().parts()
    sync = clone(fitted).set_params(parts=parts, synchronizer__n_jobs=2).fit(scaled)
    together, alone = sync.match_parts(scaled), sync.match_parts(scaled[2:3])
    for name, match in fitted.match_parts(poses).items():
        np.testing.assert_array_equal(match.times, together[name].times)
        np.testing.assert_array_equal(match.times[2:3], alone[name].times)


# -- features of parts -------------------------------------------------------------------


def test_default_parts_are_recognised(fitted, poses):
    by_skeleton = Skeleton.paper().parts()
    names = DirectionCosines(Skeleton.paper()).fit(make_bending(1).data).get_feature_names_out()
    tables = [pd.DataFrame(x, columns=names) for x in poses]
    by_name = of_parts(n_frames=40).fit(tables).parts_
    assert [*by_skeleton] == [*by_name] == [*fitted.parts_] == PARTS
    for name in PARTS:
        assert by_skeleton[name] == by_name[name].tolist() == fitted.parts_[name].tolist()
    resampled = [np.float32(x[:-1] + x[1:]) / 2 for x in poses]
    assert [*of_parts(n_frames=40).fit(resampled).parts_] == PARTS
    limbs = {names[k].rsplit("_", 1)[0] for k in by_skeleton["left leg"]}
    assert limbs == {"left_thigh", "left_leg"}
    assert sorted(k for part in by_skeleton.values() for k in part) == list(range(1, 37))


def test_other_features_have_no_parts():
    X = list(np.cumsum(np.random.default_rng(0).normal(size=(4, 20, 37)), axis=1))
    sync = PartSynchronizer().fit(X)
    assert sync.parts_ == sync.match_parts(X) == {}
    np.testing.assert_array_equal(sync.transform(X), DenseSynchronizer().fit_transform(X))
    with pytest.raises(ValueError, match=r"There are no parts.*parts=\{name"):
        sync.lags(X)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"arm": [37]}, "Part 'arm': There is no feature 37; there are 37"),
        ({"arm": ["left"]}, "Part 'arm': There is no feature 'left'"),
        ({"arm": []}, "Part 'arm': features must name at least one"),
        ({"arm": None}, "Part 'arm': features must name at least one"),
        ({"arm": [1, 2], "leg": [2]}, "Feature 'x2' is in part 'arm' and again in 'leg'"),
        ({"rest": [1]}, "name of a part must be a string other than 'rest'; got 'rest'"),
        ({1: [1]}, "The name of a part must be a string"),
        ([1], "The 'parts' parameter of PartSynchronizer"),
    ],
)
def test_fit_refuses_invalid_parts(poses, parts, message):
    with pytest.raises(ValueError, match=message):
        PartSynchronizer(parts).fit(poses)


# -- reports of lags ---------------------------------------------------------------------


def offsets_from_mean(fitted, training, X):
    """Offsets of the parts less their means over a training set."""
    found, usual = fitted.match_parts(X), fitted.match_parts(training)
    return {name: m.offsets - usual[name].offsets.mean(axis=0) for name, m in found.items()}


def test_lags_in_every_unit(fitted):
    new = made_poses(4, 3)
    lags = fitted.lags(new)
    assert lags.parts == [*PARTS]
    percent = fitted.lags(new, unit="percent").values
    np.testing.assert_allclose(percent, lags.values * 100 / 59, atol=1e-9)
    seconds = fitted.lags(new, unit="seconds", frame_rate=30).values
    lasts = np.array([len(x) - 1 for x in new])[:, np.newaxis, np.newaxis]
    np.testing.assert_allclose(seconds, percent / 100 * lasts / 30, atol=1e-9)


def test_reference_is_a_least_absolute_fit(fitted, poses, hdm05):
    """Of equally good ones the farthest from the mean; features of no part vote, too."""
    bends, _ = clips_of(hdm05, "depositFloorR")
    for X, new in ((poses, made_poses(4, 3)), (bends[:9], bends[12:15])):
        left = np.setdiff1d(np.arange(37), np.concatenate([*fitted.parts_.values()]))
        sync = of_parts({**fitted.parts_, "left": left}, 0, n_frames=60).fit(X)
        own, taught = offsets_from_mean(sync, X, new), offsets_from_mean(sync, X, X)
        taught = np.stack([taught[name] for name in [*PARTS, "left"]])
        common = np.median(taught, axis=0)
        apart = min(np.abs(taught - common).mean() / np.abs(common).mean(), 1)
        assert (apart < 0.2) == (X is poses)
        values = of_parts(fitted.parts_, 0, n_frames=60).fit(X).lags(new).values
        for i, name in enumerate(PARTS):
            others = np.stack([own[other] for other in [*PARTS, "left"] if other != name])
            candidates = np.concatenate([others, np.zeros((1, *others.shape[1:]))])
            losses = np.abs(candidates[:, np.newaxis] - others).sum(axis=1)
            losses += (5 * apart - 1e-9) * np.abs(candidates)
            best = np.take_along_axis(candidates, losses.argmin(axis=0)[np.newaxis], axis=0)[0]
            assert (best != 0).any()
            np.testing.assert_allclose(values[:, i], own[name] - best, atol=1e-6)


def shifted(x, columns, share):
    """A trial, with features that come late by this share of it; the first frame is held."""
    frames, out = np.arange(len(x)), x.copy()
    for k in columns:
        out[:, k] = np.interp(frames - share * frames[-1], frames, x[:, k])
    return out


@pytest.mark.parametrize(
    ("action", "late"),
    [
        ("depositFloorR", ["left arm", "right leg"]),
        ("elbowToKnee1RepsLelbowStart", ["right leg"]),
    ],
)
def test_shifted_parts_of_new_people_leave_the_others(hdm05, action, late):
    """Nor does the part that moves most, which the whole body follows."""
    X, actor = clips_of(hdm05, action)
    is_new = np.isin(actor, ["bd", "bk"])
    sync = of_parts(coupling=0, n_frames=P).fit([X[i] for i in np.flatnonzero(~is_new)])
    new = [X[i] for i in np.flatnonzero(is_new)]
    columns = np.concatenate([sync.parts_[name] for name in late])
    values = sync.lags([*new, *(shifted(x, columns, 0.05) for x in new)], unit="percent").values
    change = values[len(new) :] - values[: len(new)]
    times = {name: match.times * 100 / (P - 1) for name, match in sync.match_parts(new).items()}
    for name, found in zip(PARTS, change.swapaxes(0, 1), strict=True):
        # What is met in the last twentieth has no room to be late.
        truth = np.minimum(5, 100 - times[name]) if name in late else 0
        error = np.abs(found - truth)[:, 10:90]
        assert np.median(error) < (0.6 if name in late else 0.5), name


def test_spread_within_and_between_subjects_agrees_with_scipy():
    rng, groups = np.random.default_rng(0), ["b", "a", "a", "c", "b", "c", "c", "a", "c"]
    own = {"a": 1.0, "b": -2.0, "c": 0.5}
    values = np.array([own[g] for g in groups])[:, np.newaxis] + rng.normal(size=(9, 6))
    codes = np.unique(groups, return_inverse=True)[1]
    lags = Lags(values.reshape(9, 2, 3), ["arm", "leg"], "frames", codes)
    table = lags.over_time()
    assert table.index[4] == ("leg", 1)
    for column, row in zip(values.T, table.itertuples(), strict=True):
        samples = [column[codes == g] for g in range(3)]
        means = [x.mean() for x in samples]
        ratio = f_oneway(*samples).statistic
        size = (9 - (3**2 + 2**2 + 4**2) / 9) / 2
        icc = max(0, (ratio - 1) / (ratio - 1 + size))
        interval = ttest_1samp(means, 0).confidence_interval()
        within = np.mean(np.repeat([x.var(ddof=1) for x in samples], [len(x) - 1 for x in samples]))
        assert row.mean == pytest.approx(np.mean(means))
        assert (row.low, row.high) == pytest.approx(tuple(interval))
        assert row.icc == pytest.approx(icc)
        assert row.sd_within**2 == pytest.approx(within)
        assert row.sd == pytest.approx(column.std(ddof=1))
    summary = lags.summary()
    assert summary.loc["leg", "mean"] == pytest.approx(table.loc["leg", "mean"].mean())


def test_spread_is_nan_for_too_few_trials(fitted, poses):
    summary = fitted.lags(poses, groups=list("abcdefg")).summary()
    assert summary[["sd_within", "sd_between", "icc"]].isna().all(axis=None)
    assert summary[["mean", "sd", "low", "high"]].notna().all(axis=None)
    one = fitted.lags(poses[:1]).summary()
    assert one["mean"].notna().all()
    assert one[["sd", "low", "high"]].isna().all(axis=None)
