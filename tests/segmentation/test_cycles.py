"""CycleSegmenter: cycles of takes whose phases are known, what is refused, and the contract."""

import pickle

import numpy as np
import pandas as pd
import pytest
from sklearn import clone
from sklearn.exceptions import NotFittedError
from sklearn.model_selection import GroupKFold, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils import estimator_checks
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    CycleSegmenter,
    DenseSynchronizer,
    FrameWise,
    Skeleton,
    to_frame,
    to_sequences,
)
from sklearn_motionsync.datasets import make_bending, make_gait

HIP = 0


@pytest.fixture(scope="module")
def gait():
    return make_gait(6, 4, takes=True, warp=2, random_state=0)


@pytest.fixture(scope="module")
def fitted(gait):
    return CycleSegmenter(start=HIP).fit(gait.data[:3])


def off_phase(phases, times):
    """How far apart phases of the same true moments are, in cycles: from their mean at each."""
    moments = (np.concatenate(times) * 20).astype(int) % 20
    d = (np.concatenate(phases) - np.concatenate(times)) * 2j * np.pi
    means = [np.exp(d[moments == k]).mean() for k in range(20)]
    return np.angle(np.exp(d) * np.conj(means)[moments]) / (2 * np.pi)


def two_paces(n_cycles=8, n_frames=800):
    """A take that slows down, its phases, and so a cycle every so many frames."""
    t = np.linspace(0, 1, n_frames)
    phases = n_cycles * (t + 0.05 * np.sin(np.pi * t))
    angle = 2 * np.pi * phases[:, np.newaxis]
    return np.sin(angle + np.arange(3)) + 0.5 * np.cos(2 * angle), phases


# -- what it finds --------------------------------------------------------------------------


def test_people_not_seen_are_cut_at_the_same_phase(gait):
    """Their own template of hip, knee, ankle and force; truth is the phase that made the take."""
    takes = FrameWise(StandardScaler()).fit_transform(gait.data)
    new, times = takes[3:], gait.times[3:]
    fitted = CycleSegmenter(start=HIP).fit(takes[:3])
    followed = np.abs(off_phase(fitted.phases(new), times)).mean()
    steady = CycleSegmenter(start=HIP, refine=False).fit(takes[:3])
    constant = np.abs(off_phase(steady.phases(new), times)).mean()
    assert followed < 0.006
    assert followed < 0.5 * constant
    cycles, origin = fitted.segment(new)
    assert set(origin["take"]) == {0, 1, 2}
    assert origin["complete"].all()
    assert (origin["score"] > 0.95).all()
    starts = [times[i][k] % 1 for i, k in zip(origin["take"], origin["start"], strict=True)]
    assert np.ptp((np.array(starts) + 0.5) % 1) < 0.05
    for cycle, (_, row) in zip(cycles, origin.iterrows(), strict=True):
        np.testing.assert_array_equal(cycle, new[row["take"]][row["start"] : row["stop"]])
    # First and last frame are the same phase: neighbours share it.
    inner = origin["take"].to_numpy()[1:] == origin["take"].to_numpy()[:-1]
    np.testing.assert_array_equal(
        origin["start"].to_numpy()[1:][inner], origin["stop"].to_numpy()[:-1][inner] - 1
    )


def test_cycles_of_changing_length():
    take, phases = two_paces()
    segmenter = CycleSegmenter(start=0).fit(take)
    (found,) = segmenter.phases(take)
    d = found - phases
    assert np.ptp(d) < 0.05  # at constant period 0.4
    _, origin = segmenter.segment(take)
    assert len(origin) == 7
    lengths = (origin["stop"] - origin["start"] - 1).to_numpy()
    np.testing.assert_allclose(np.diff(phases[origin["start"]]), 1, atol=0.03)
    assert lengths[-1] > 1.25 * lengths[0]


def test_long_takes_are_matched_in_parts():
    """No seam is seen: where 16 cycles end, the phase goes on as elsewhere."""
    take, phases = two_paces(45, 2000)
    segmenter = CycleSegmenter(start=0).fit(take)
    (found,) = segmenter.phases(take)
    assert np.ptp(found - phases) < 0.05  # at constant period 2.2
    assert (np.diff(found) >= 0).all()
    assert len(segmenter.segment(take)[0]) in (44, 45)


def test_it_begins_where_it_is_told(gait):
    for start, name in ((1, "x1"), ("x2", "x2")):
        segmenter = CycleSegmenter(start=start).fit(gait.data)
        assert segmenter.start_ == name
        k = int(name[1])
        cycles, _ = segmenter.segment(gait.data)
        ends = np.mean([c[0, k] for c in cycles])
        assert ends > np.quantile(np.concatenate(cycles)[:, k], 0.9)
    assert CycleSegmenter().fit(gait.data).start_ in {"x0", "x1", "x2", "x3"}
    with pytest.raises(ValueError, match="no feature 'knee'; there are 4: x0, x1, x2, x3"):
        CycleSegmenter(start="knee").fit(gait.data)
    with pytest.raises(ValueError, match="start='ahead' needs a skeleton in space"):
        CycleSegmenter(start="ahead").fit(gait.data)


def test_incomplete_cycles_are_told():
    take, _ = two_paces()
    segmenter = CycleSegmenter(start=0).fit(take)
    whole = segmenter.segment(take)[1]
    origin = segmenter.set_params(incomplete=True).segment(take)[1]
    pd.testing.assert_frame_equal(origin[origin["complete"]].reset_index(drop=True), whole)
    assert origin["complete"].tolist() == [False, *[True] * 7, False]
    assert origin["start"].iloc[0] == 0
    assert origin["stop"].iloc[-1] == len(take)


def test_the_foot_that_is_farther_ahead():
    """Legs that swing on the way, the left one farther, of a body that goes round a bend."""
    skeleton, t = Skeleton.paper(), np.linspace(0, 1, 400)
    place = {"pelvis": (0, 1), "neck": (0, 1.5), "head": (0, 1.7)}
    joints = np.zeros((len(t), 15, 3))
    for k, joint in enumerate(skeleton.joints):
        side = 1 if joint.startswith("left") else -1 if joint.startswith("right") else 0
        part = joint.split("_")[-1]
        height = {"hip": 1, "knee": 0.5, "ankle": 0.05, "shoulder": 1.5, "elbow": 1.2, "wrist": 1}
        swing = {"knee": 0.15, "ankle": 0.4}.get(part, 0) * (1.2 if side > 0 else 1)
        joints[:, k, 0] = 0.2 * side
        joints[:, k, 1] = height.get(part, place.get(joint, (0, 1))[1])
        joints[:, k, 2] = side * swing * np.cos(2 * np.pi * (5 * t - 0.3))
    turn = 3 * t[:, np.newaxis]
    x, z = joints[..., 0] + 2, joints[..., 2].copy()
    joints[..., 0] = x * np.cos(turn) + z * np.sin(turn)
    joints[..., 2] = z * np.cos(turn) - x * np.sin(turn)
    take = joints.reshape(len(t), -1)
    for start, name, phase in ((None, "left", 0.3), ("right", "right", 0.8)):
        segmenter = CycleSegmenter(skeleton, start=start).fit(take)
        assert segmenter.start_ == name
        cycles, origin = segmenter.segment(take)
        assert cycles[0].shape[1] == 45
        true = (np.arange(6) + phase) / 5 * 399
        np.testing.assert_allclose(origin["start"], true[: len(origin)], atol=3)


# -- what is refused ------------------------------------------------------------------------


def test_what_does_not_repeat_is_refused(gait):
    bunch = make_bending(2, random_state=0)
    with pytest.raises(ValueError, match=r"Take 0 is not cyclic, or .* has no peak. Leave it out"):
        CycleSegmenter(bunch.skeleton).fit(bunch.data)
    noise = np.random.default_rng(0).normal(size=(200, 4))
    with pytest.raises(ValueError, match=r"strength 0\.\d\d, below threshold=0.4 \(0\.\d\d at"):
        CycleSegmenter().fit(noise)
    short = gait.data[1][: round(1.52 * CycleSegmenter().periods(gait.data)[1])]
    with pytest.raises(
        ValueError, match=r"Take 1 holds 1\.\d\d cycles of about \d+ frames, and 1.6"
    ):
        CycleSegmenter().fit([gait.data[0], short])
    named = to_sequences(to_frame([gait.data[0], short], performances=["ann", "bob"]))
    with pytest.raises(ValueError, match=r"Take 1 \('bob'\) holds"):
        CycleSegmenter().fit(named)
    report = CycleSegmenter().report(named)
    assert report["cyclic"].to_dict() == {"ann": True, "bob": False}
    np.testing.assert_array_equal(CycleSegmenter().is_cyclic(named), [True, False])
    assert np.isnan(CycleSegmenter().periods(named)).tolist() == [False, True]


def test_of_less_than_two_cycles_more_is_asked():
    """Of 1.7 cycles 0.7 meet another: the threshold is divided by the root of that."""
    t = 2 * np.pi * np.arange(300)[:, np.newaxis] / 100
    waves = np.sin(t + np.arange(3))
    for threshold, cyclic in ((0.9, [True, False]), (0.7, [True, True])):
        report = CycleSegmenter(threshold=threshold).report([waves, waves[:170]])
        assert (report["strength"] > 0.95).all()
        assert report["cyclic"].tolist() == cyclic
    with pytest.raises(ValueError, match=r"below threshold=0.9 \(1.\d\d at 1.7\d cycles\)"):
        CycleSegmenter(threshold=0.9).fit(waves[:170])


def test_or_skipped(gait):
    still, skip = np.zeros((200, 4)), CycleSegmenter(start=HIP, not_cyclic="skip")
    mixed = [still, *gait.data[:2], gait.data[0][:60]]
    cycles, origin = skip.fit_segment(mixed)
    expected, alone = CycleSegmenter(start=HIP).fit_segment(gait.data[:2])
    assert origin["take"].tolist() == (alone["take"] + 1).tolist()
    assert all(map(np.array_equal, cycles, expected))
    assert np.isnan(skip.periods_).tolist() == [True, False, False, True]
    assert np.isnan(skip.phases([still])[0]).all()
    nothing, origin = skip.segment([still])
    assert nothing == []
    assert list(origin) == ["take", "start", "stop", "complete", "score"]
    with pytest.raises(ValueError, match="None of the 2 takes is cyclic"):
        skip.fit([still, still])
    with pytest.raises(NotFittedError):
        skip.segment(mixed)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda x: np.where(np.eye(len(x), 4) > 0, np.nan, x), "Performance 1, frame 0, .* NaN"),
        (lambda x: x * np.inf, "Performance 1, frame 0"),
        (lambda x: x[:1], "Performance 1 has shape"),
        (lambda x: x[:, :3], "Performance 1 has 3 features a frame, performance 0 has 4"),
        (lambda x: x[:, 0], "Performance 1 has shape"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_bad_takes_are_named(change, message, gait, fitted):
    bad = [gait.data[0], change(gait.data[1])]
    for ask in (CycleSegmenter().fit, CycleSegmenter().report, fitted.segment, fitted.phases):
        with pytest.raises(ValueError, match=message):
            ask(bad)


def test_other_refusals(gait, fitted):
    with pytest.raises(ValueError, match="0 performances"):
        CycleSegmenter().fit([])
    for X in (gait.data[0][:, 0], 3.0):
        with pytest.raises(ValueError, match=r"one take \(n_frames, n_features\), or a list"):
            fitted.segment(X)
    with pytest.raises(ValueError, match="3 features a frame, but CycleSegmenter is expecting 4"):
        fitted.segment([x[:, :3] for x in gait.data])
    with pytest.raises(NotFittedError):
        CycleSegmenter().segment(gait.data)
    for params in ({"threshold": 2}, {"not_cyclic": "drop"}, {"skeleton": "paper"}, {"start": 1.5}):
        for ask in ("fit", "report"):
            with pytest.raises(ValueError, match=f"The '{next(iter(params))}' parameter"):
                getattr(CycleSegmenter(**params), ask)(gait.data)


# -- the contract -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    [
        "check_complex_data",
        "check_do_not_raise_errors_in_init_or_set_params",
        "check_estimator_cloneable",
        "check_estimator_repr",
        "check_estimator_sparse_array",
        "check_estimators_unfitted",
        "check_fit1d",
        "check_get_params_invariance",
        "check_no_attributes_set_in_init",
        "check_param_validation",
        "check_parameters_default_constructible",
        "check_set_params",
        "check_valid_tag_types",
    ],
)
def test_scikit_learn_checks_whose_data_may_be_refused(name):
    """The others fit noise, in which nothing repeats."""
    getattr(estimator_checks, name)("CycleSegmenter", CycleSegmenter())


def same(answer, expected):
    (cycles, origin), (others, other) = answer, expected
    assert all(np.array_equal(a, b) for a, b in zip(cycles, others, strict=True))
    pd.testing.assert_frame_equal(origin, other)


def objects(X):
    out = np.empty(len(X), dtype=object)
    out[:] = X
    return out


@pytest.mark.parametrize(
    "kind",
    [
        tuple,
        objects,
        np.stack,
        lambda X: [x.tolist() for x in X],
        lambda X: [np.asfortranarray(x) for x in X],
        lambda X: [pd.DataFrame(x, columns=list("hkaf")) for x in X],
        lambda X: to_frame(X, columns=list("hkaf")),
    ],
)
def test_every_kind_of_takes(kind, gait):
    X = [x[:380] for x in gait.data[:2]]
    before = [x.copy() for x in X]
    segmenter = CycleSegmenter(start=HIP).fit(kind(X))
    same(segmenter.segment(kind(X)), CycleSegmenter(start=HIP).fit_segment(X))
    assert all(map(np.array_equal, X, before))


def test_a_single_take(gait):
    take = gait.data[0]
    expected = CycleSegmenter(start=HIP).fit_segment([take])
    same(CycleSegmenter(start=HIP).fit_segment(take), expected)
    table = pd.DataFrame(take, columns=list("hkaf"))
    cycles, origin = CycleSegmenter(start="h").fit_segment(table)
    same((cycles, origin), expected)
    assert cycles[1].attrs["performance"] == (0, 1)
    assert list(to_frame(cycles).index.names) == ["take", "part", "frame"]


def test_answers_depend_on_the_take_alone_and_write_nothing(gait, fitted):
    before = pickle.dumps(vars(fitted))
    cycles, origin = fitted.segment(gait.data)
    for i in (5, 0):
        own = fitted.segment([gait.data[i]])[1]
        mine = (origin["take"] == i).to_numpy()
        assert own["start"].tolist() == origin["start"][mine].tolist()
        assert own["score"].tolist() == origin["score"][mine].tolist()
    same(pickle.loads(before) and fitted.segment(gait.data), (cycles, origin))
    same(pickle.loads(pickle.dumps(fitted)).segment(gait.data), (cycles, origin))
    same(clone(fitted).fit(gait.data[:3]).segment(gait.data), (cycles, origin))
    assert pickle.dumps(vars(fitted)) == before


def test_single_precision_and_units(gait, fitted):
    expected = fitted.segment(gait.data[3:])
    single = [x.astype(np.float32) for x in gait.data]
    cycles, origin = clone(fitted).fit(single[:3]).segment(single[3:])
    assert all(c.dtype == np.float32 for c in cycles)
    assert (origin["start"] - expected[1]["start"]).abs().max() <= 1
    large = [1e150 * x for x in gait.data]
    _, origin = clone(fitted).fit(large[:3]).segment(large[3:])
    assert (origin["start"] - expected[1]["start"]).abs().max() <= 1


def test_a_failed_fit_leaves_it_unfitted(gait):
    segmenter = CycleSegmenter(start=HIP).fit(gait.data)
    with pytest.raises(ValueError, match="not cyclic"):
        segmenter.fit([np.zeros((50, 4))])
    assert not hasattr(segmenter, "template_")


def test_cycles_go_on(gait):
    """Into a pipeline, folds by take, and a table that knows who walked."""
    takes = to_frame(gait.data, performances=gait.person, columns=gait.feature_names)
    cycles, origin = CycleSegmenter(start="hip_flexion").fit_segment(takes)
    assert set(origin["take"]) == set(gait.person)
    df = to_frame(cycles)
    assert df.index.names == ["performance", "part", "frame"]
    assert df.loc["person3"].index.unique(0).tolist() == list(
        range(len(df.loc["person3"].index.unique(0)))
    )
    pipe = make_pipeline(ASpace(3), DenseSynchronizer(30), ActionModel())
    folds = GroupKFold(3)
    scores = cross_val_score(pipe, cycles, groups=origin["take"].to_numpy(), cv=folds)
    assert np.isfinite(scores).all()
    synchronised = pipe[:2].fit_transform(cycles)
    assert synchronised.shape == (len(cycles), 30, 3)
