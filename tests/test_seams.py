"""Laws of all public functions that take an estimator and trials.

A function has a row in `CALLS`, which gives what it finds, and each law changes what it is given in
a way that must not change what it finds. A public function without a row fails.
"""

import gc
import inspect
import io
import json
import pickle
import re
import weakref
from collections import Counter
from typing import NamedTuple
from unittest.mock import Mock

import numpy as np
import pandas as pd
import pytest
from joblib import parallel_config
from sklearn.base import BaseEstimator, clone
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import (
    ActionDetector,
    ActionModel,
    DenseSynchronizer,
    DirectionCosines,
    FrameWise,
    LinearSynchronizer,
    Match,
    PartSynchronizer,
    TimingChannel,
    display,
    to_frame,
    to_trials,
)
from sklearn_motionsync.comparison import (
    compare_effects,
    compare_groups,
    compare_to_norm,
    plan_study,
)
from sklearn_motionsync.datasets import make_bending, make_gait
from sklearn_motionsync.live import OnlineSynchronizer
from sklearn_motionsync.metrics import FeatureHoldoutScorer, SpreadScorer
from sklearn_motionsync.model import find_departures
from sklearn_motionsync.report import write_player, write_report
from sklearn_motionsync.synchronizers import blend_trials, dense

from public import functions

BENDS = make_bending(12, n_frames=60, n_actors=6, random_state=0)
# A forearm of trial 3 is turned.
BENDS.data[3][20:40, 3 * BENDS.skeleton.index_of("right_wrist")] += 0.2
K = BENDS.keyframes[:, :2].astype(float)
GAIT = make_gait(8, timing=5, n_frames=60, random_state=0)
EVENTS = GAIT.keyframes[:, 3:4]


class Study(NamedTuple):
    """What functions are given."""

    sync: object
    model: object
    detector: object
    X: list
    y: list
    groups: list
    params: dict
    path: object
    trial: int = 3
    norm: object = "early"

    def fitted(self, estimator):
        """A clone of an estimator that takes key-frames, fitted on the cosines of these trials."""
        return clone(estimator).fit(cosines(self), **self.params)


def part(study):
    """A pipeline for lags."""
    steps = DirectionCosines(BENDS.skeleton), PartSynchronizer(synchronizer=DenseSynchronizer(31))
    return make_pipeline(*steps).fit(study.X)


def cosines(study):
    """What reaches the synchronizer, with the labels of the trials."""
    out = DirectionCosines(BENDS.skeleton).fit_transform(study.X)
    names = [x.attrs.get("label") for x in study.X if isinstance(x, pd.DataFrame)]
    return to_trials(to_frame(out, trials=study.X)) if names else out


def data_of(path):
    """The data of a page."""
    text = path.read_text(encoding="utf-8")
    return json.loads(re.search(r'id="data">(.*?)</script>', text, re.DOTALL)[1])


def timing_of(s):
    """The offsets that a report offers."""
    path = write_report(s.path / "report.html", s.sync, s.X, unit="frames", **s.params)
    table = pd.read_csv(io.StringIO(data_of(path)["files"]["timing.csv"]))
    return table["offset (frames)"].to_numpy().reshape(len(s.X), -1)


def marks_of(s):
    """The key-frames of a player, as shares of each trial."""
    path = write_player(s.path / "player.html", s.X, BENDS.skeleton, **s.params)
    return np.array([mark["own"] for mark in data_of(path)["player"]["keyframes"]]).T


def blended(s):
    """A mean performance, seen from its first joint."""
    weights = np.full(len(s.X), 1 / len(s.X))
    path = blend_trials(s.sync, s.X, weights, skeleton=BENDS.skeleton, **s.params)
    positions = np.asarray(path).reshape(len(path), -1, 3)
    return positions - positions[:1, :1]


# What each function finds. Of those in BY_TRIAL the rows, or the first axis, are trials.
CALLS = {
    "ActionDetector.fit": lambda s: (
        clone(s.detector)
        .fit(s.X, groups=s.groups, **{f"densesynchronizer__{k}": v for k, v in s.params.items()})
        .offset_
    ),
    "ActionDetector.decision_function": lambda s: s.detector.decision_function(s.X, **s.params),
    "ActionDetector.predict": lambda s: s.detector.predict(s.X, **s.params),
    "ActionDetector.report": lambda s: s.detector.report(s.X, **s.params).drop(columns="reason"),
    "ActionDetector.score_samples": lambda s: s.detector.score_samples(s.X, **s.params),
    "ActionModelDisplay.from_estimator": lambda s: (
        display.ActionModelDisplay.from_estimator(s.model, s.X, **s.params).trials
    ),
    "DenseSynchronizer.calibrate": lambda s: (
        clone(s.sync[1])
        .fit(cosines(s), **s.params)
        .calibrate(cosines(s), **s.params)
        .interval_factor_
    ),
    "DenseSynchronizer.disparity_space": lambda s: (
        s.sync[1].disparity_space(cosines(s), s.trial, **s.params).costs
    ),
    "DenseSynchronizer.fit": lambda s: s.fitted(DenseSynchronizer(31)).pattern_,
    "FeatureHoldoutScorer": lambda s: FeatureHoldoutScorer()(s.sync, s.X, **s.params),
    "GroupDisplay.from_estimator": lambda s: (
        display.GroupDisplay.from_estimator(s.sync, s.X, s.y, groups=s.groups, **s.params).events
    ),
    "LagDisplay.from_estimator": lambda s: (
        display.LagDisplay.from_estimator(part(s), s.X).lags.values
    ),
    "LinearSynchronizer.fit": lambda s: s.fitted(LinearSynchronizer(31)).keyframes_,
    "Match.from_estimator": lambda s: Match.from_estimator(s.sync, s.X, **s.params).times,
    "OnlineSynchronizer.fit": lambda s: (
        OnlineSynchronizer(DenseSynchronizer(31))
        .fit(cosines(s), keyframes=s.params["keyframes"])
        .mean_
    ),
    "PartSynchronizer.fit": lambda s: s.fitted(PARTS).keyframes_,
    "PartSynchronizer.lags": lambda s: part(s)[1].lags(cosines(s)).values,
    "PartSynchronizer.match_parts": lambda s: (
        s.fitted(PARTS).match_parts(cosines(s), **s.params)["foot"].times
    ),
    "SkeletonDisplay.from_departures": lambda s: display.SkeletonDisplay.from_departures(
        s.model, s.X, trial=s.trial, **s.params
    ).titles[1:],
    "SkeletonDisplay.from_estimator": lambda s: np.array(
        display.SkeletonDisplay.from_estimator(s.sync, s.X, trials=[s.trial], **s.params).scenes[-1]
    ),
    "SpreadScorer": lambda s: SpreadScorer()(s.sync, s.X, **s.params),
    "SynchronizationDisplay.from_estimator": lambda s: (
        display.SynchronizationDisplay.from_estimator(s.sync, s.X, **s.params).match.times
    ),
    "TimingChannel.fit": lambda s: s.fitted(TIMING).synchronizer_.pattern_,
    "TrellisDisplay.from_estimator": lambda s: (
        display.TrellisDisplay.from_estimator(s.sync, s.X, trial=s.trial, **s.params).warp
    ),
    "blend_trials": blended,
    "compare_effects": lambda s: compare_effects(
        # Numbers are covariates.
        *(s.sync, s.X, {"side": [str(label) for label in s.y]}, "side"),
        groups=s.groups,
        n_permutations=99,
        **s.params,
    )["side"].to_frame(),
    "compare_groups": lambda s: compare_groups(
        s.sync, s.X, s.y, groups=s.groups, n_permutations=99, **s.params
    ).to_frame(),
    "compare_to_norm": lambda s: (
        compare_to_norm(s.sync, s.X, s.y, norm=s.norm, groups=s.groups, unit="frames", **s.params)
        .verdicts[["p", "p_shape", "p_timing"]]
        .sort_values("p")
        .to_numpy()
    ),
    "find_departures": lambda s: (
        find_departures(s.model, s.X, **s.params)[["kind", "limb", "first", "last", "size"]]
        .sort_values(["limb", "first"])
        .reset_index(drop=True)
    ),
    "plan_study": lambda s: plan_study(
        s.sync, s.X, s.y, groups=s.groups, n_studies=10, power=0.01, **s.params
    ),
    "write_player": marks_of,
    "write_report": timing_of,
}
PARTS = PartSynchronizer({"foot": [0, 1]}, synchronizer=DenseSynchronizer(31))
TIMING = TimingChannel(DenseSynchronizer(31))
for kind in (DenseSynchronizer(31), LinearSynchronizer(31), PARTS, TIMING):
    name = type(kind).__name__
    CALLS |= {
        f"{name}.fit_transform": lambda s, k=kind: clone(k).fit_transform(cosines(s), **s.params),
        f"{name}.match": lambda s, k=kind: s.fitted(k).match(cosines(s), **s.params).times,
        f"{name}.transform": lambda s, k=kind: s.fitted(k).transform(cosines(s), **s.params),
    }


# Lags are of the whole body, on which key-frames have no influence.
WITHOUT_KEYFRAMES = {"LagDisplay.from_estimator", "PartSynchronizer.lags"}
# The first axis, or the rows, of what they find are trials.
BY_TRIAL = {
    *(name for name in CALLS if name.endswith((".match", "transform", "match_parts", "lags"))),
    *(name for name in CALLS if name.startswith("ActionDetector")),
    "ActionModelDisplay.from_estimator",
    "LagDisplay.from_estimator",
    "Match.from_estimator",
    "SynchronizationDisplay.from_estimator",
    "write_player",
    "write_report",
} - {"ActionDetector.fit"}
# Those whose estimator may be a Match, by the annotation of their signature.
OF_MATCH = {
    "GroupDisplay.from_estimator",
    "SynchronizationDisplay.from_estimator",
    "blend_trials",
    "compare_effects",
    "compare_groups",
    "compare_to_norm",
    "plan_study",
    "write_report",
}
# They take recordings that are no trials, or what was found before.
OTHERS = {
    "CycleDisplay.from_estimator",
    "PhaseDisplay.from_estimator",
    "SearchDisplay.from_estimator",
    "TrackingDisplay.from_estimator",
    "keyframe_error",
}


def test_every_function_has_its_row():
    names, of_match = set(), set()
    for name, function in functions():
        if inspect.isclass(function) or not hasattr(function, "__annotations__"):
            continue
        parameters = inspect.signature(function).parameters
        takes_trials = "X" in parameters and bool({"estimator", "params"} & set(parameters))
        if takes_trials or "keyframes" in parameters:
            # Scorers are called; scikit-learn knows the same as their method score.
            names.add(name.replace("Scorer.score", "Scorer"))
        if "estimator" in parameters and "Match" in str(parameters["estimator"].annotation):
            of_match.add(name)
    assert names == (set(CALLS) - {n for n in CALLS if n.endswith(".lags")}) | OTHERS
    assert of_match == OF_MATCH


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    X, groups = BENDS.data, BENDS.actor.tolist()
    y = ["early" if person in ("actor0", "actor2", "actor4") else "late" for person in groups]
    steps = DirectionCosines(BENDS.skeleton), DenseSynchronizer(31)
    sync = make_pipeline(*steps).fit(X, densesynchronizer__keyframes=K)
    model = make_pipeline(*steps, ActionModel())
    names = {"densesynchronizer__keyframes": K}
    detector = ActionDetector(model).fit(X, groups=groups, **names)
    model.fit(X, actionmodel__groups=groups, **names)
    params, path = {"keyframes": K}, tmp_path_factory.mktemp("laws")
    return Study(sync, model, detector, X, y, groups, params, path)


@pytest.fixture(scope="module", autouse=True)
def nothing_is_drawn():
    """Laws are of what is found; figures are drawn in the tests of displays."""
    with pytest.MonkeyPatch.context() as patch:
        for kind in (getattr(display, name) for name in display.__all__):
            patch.setattr(kind, "plot", lambda self, *args, **kwargs: self)
        patch.setattr("sklearn_motionsync.report.report.SignalsDisplay", Mock())
        patch.setattr("sklearn_motionsync.report.report.picture", lambda *args: "")
        yield


@pytest.fixture(scope="module")
def found(study):
    """What a function finds in the study, once for all laws."""
    known = {}

    def of(name):
        if name not in known:
            known[name] = CALLS[name](study)
        return known[name]

    return of


def seconds(study, rate):
    """Key-frames in seconds, in a table."""
    table = pd.DataFrame(K / rate[:, np.newaxis])
    return study._replace(params={"keyframes": table, "frame_rate": rate})


def labelled(study):
    """Trials with labels, and a table of the key-frames of more trials in another order."""
    names = [f"trial{i}" for i in range(len(K))]
    tables = to_trials(to_frame(study.X, trials=names))
    table = pd.DataFrame(np.vstack([K, K[:2]]), index=[*names, "x", "y"]).iloc[::-1]
    return study._replace(X=list(tables), params={"keyframes": table})


ORDER = np.array([7, 2, 5, 11, 0, 3, 9, 1, 10, 4, 8, 6])


def rearranged(study):
    X, y, groups = ([values[i] for i in ORDER] for values in (study.X, study.y, study.groups))
    trial = ORDER.tolist().index(study.trial)
    return study._replace(X=X, y=y, groups=groups, params={"keyframes": K[ORDER]}, trial=trial)


def renamed(study):
    y = [{"early": 2, "late": 1}[label] for label in study.y]
    return study._replace(y=y, groups=[9 - int(person[-1]) for person in study.groups], norm=2)


LAWS = {
    "seconds": lambda s: seconds(s, np.array([12.0, 25.0, 100.0] * 4)),
    "labels": labelled,
    "order": rearranged,
    "names": renamed,
    "units": lambda s: s._replace(X=[1000 * (x + np.tile([3.0, 0.0, -2.0], 15)) for x in s.X]),
    "match": lambda s: s._replace(sync=Match.from_estimator(s.sync, s.X, **s.params), params={}),
    "again": lambda s: s,
}


def holds_for(law):
    """The functions for which a law is tried.

    A live synchronizer has one frame rate. What scikit-learn's pipelines and the refits of a scorer
    hand on has no labels.
    """
    if law == "seconds":
        return set(CALLS) - WITHOUT_KEYFRAMES - {"OnlineSynchronizer.fit"}
    if law == "labels":
        return set(CALLS) - WITHOUT_KEYFRAMES - {"ActionDetector.fit", "FeatureHoldoutScorer"}
    if law == "match":
        return OF_MATCH
    if law == "names":
        return {name for name in CALLS if "groups" in inspect.getsource(CALLS[name])}
    return set(CALLS)


@pytest.mark.parametrize(
    ("law", "name"), [(law, name) for law in LAWS for name in sorted(holds_for(law))]
)
def test_law(law, name, study, found, monkeypatch):
    changed, matches, matched = LAWS[law](study), Counter(), dense.warp_in_portions

    def counted(warper, arrays, *args, **kwargs):
        matches.update((x.shape, np.nansum(x)) for x in arrays)
        return matched(warper, arrays, *args, **kwargs)

    monkeypatch.setattr(dense, "warp_in_portions", counted)
    with parallel_config("threading", n_jobs=2 if law == "again" else 1):
        other = CALLS[name](changed)
    assert max(matches.values(), default=0) <= 1
    expected, tolerance = found(name), 0 if law == "again" else 1e-6
    if law == "order" and name in BY_TRIAL:
        expected = expected.iloc[ORDER] if isinstance(expected, pd.DataFrame) else expected[ORDER]
    if law == "units" and name in ("blend_trials", "SkeletonDisplay.from_estimator"):
        expected = 1000 * expected
    if isinstance(expected, pd.DataFrame):
        expected = expected.reset_index(drop=True)
        other = other.reset_index(drop=True)
        pd.testing.assert_frame_equal(other, expected, rtol=tolerance, atol=tolerance)
    elif isinstance(expected, list):
        assert other == expected
    else:
        np.testing.assert_allclose(other, expected, rtol=tolerance, atol=tolerance)


@pytest.fixture(scope="module")
def sync():
    return DenseSynchronizer(n_frames=51).fit(GAIT.data, keyframes=EVENTS)


@pytest.mark.parametrize("wrap", [lambda sync: sync, make_pipeline])
def test_a_match_is_of_its_trials(wrap, sync):
    estimator = wrap(sync)
    match = Match.from_estimator(estimator, GAIT.data, keyframes=EVENTS, frame_rate=1.0)
    for X in (GAIT.data[::-1], GAIT.data[1:], [x + 1 for x in GAIT.data]):
        with pytest.raises(ValueError, match=r"Match of 24 trials, and X are other ones"):
            compare_groups(match, X, GAIT.group)
    with pytest.raises(TypeError, match="'keyframes' beside a Match"):
        compare_groups(match, GAIT.data, GAIT.group, keyframes=EVENTS)
    with pytest.raises(ValueError, match="without the synchronizer and the trials"):
        compare_groups(pickle.loads(pickle.dumps(match)), GAIT.data, GAIT.group)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(match)).seconds(), match.seconds())


def test_a_match_stays_that_of_its_fit():
    pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(51)).fit(GAIT.data)
    match, given = Match.from_estimator(pipe, GAIT.data), {"norm": "A", "groups": GAIT.person}
    before = compare_to_norm(match, GAIT.data, GAIT.group, **given).departures
    pipe.set_params(densesynchronizer__n_frames=31).fit([10 * x for x in GAIT.data])
    after = compare_to_norm(match, GAIT.data, GAIT.group, **given).departures
    pd.testing.assert_frame_equal(after, before)


def test_frame_rates_of_a_match_are_those_it_was_told(sync):
    tables = [pd.DataFrame(x) for x in GAIT.data]
    for x in tables:
        x.attrs["frame_rate"] = 60.0
    match = Match.from_estimator(sync, tables, keyframes=EVENTS / 30, frame_rate=30.0)
    shown = display.GroupDisplay.from_estimator(match, tables, GAIT.group, unit="seconds")
    lasting = (np.median([len(x) for x in tables]) - 1) / 30
    np.testing.assert_allclose([np.median(match.seconds()[:, -1]), shown.axis.clock[-1]], lasting)


def test_what_is_hidden_in_a_match_is_hidden_in_what_it_warps(sync):
    confidence = [np.ones(x.shape) for x in GAIT.data]
    confidence[2][20:24, 1] = 0.1
    match = sync.match(GAIT.data, keyframes=EVENTS, confidence=confidence)
    expected = sync.transform(GAIT.data, keyframes=EVENTS, confidence=confidence)
    assert np.isnan(expected).any()
    np.testing.assert_array_equal(sync.transform_matched(GAIT.data, match), expected)


class EvenSynchronizer(BaseEstimator):
    """A synchronizer that is not derived from `Synchronizer`: it has what functions ask for."""

    def fit(self, X, y=None):
        self.linear_ = LinearSynchronizer(31).fit(X)
        self.n_frames_ = 31
        return self

    def check_trials(self, X):
        return self.linear_.check_trials(X)

    def normalize(self, X):
        return self.linear_.normalize(X)

    def match(self, X):
        return Match(self.linear_.match(X).times)

    def transform(self, X):
        return self.linear_.transform(X)


def test_a_synchronizer_of_another_base_serves_detectors():
    scores = []
    for synchronizer in (EvenSynchronizer(), LinearSynchronizer(31)):
        detector = ActionDetector(make_pipeline(synchronizer, ActionModel()))
        scores.append(detector.fit(GAIT.data, groups=GAIT.person).score_samples(GAIT.data[:4]))
    np.testing.assert_array_equal(*scores)


def test_what_is_learnt_of_a_model_goes_with_it():
    X = LinearSynchronizer(30).fit_transform(GAIT.data)
    model = ActionModel().fit(X)
    find_departures(model, X[:1])
    assert len(pickle.dumps(model)) == len(pickle.dumps(pickle.loads(pickle.dumps(model))))
    known = weakref.ref(model)
    del model
    gc.collect()
    assert known() is None


def test_a_live_synchronizer_takes_keyframes_in_its_seconds():
    frames = OnlineSynchronizer(DenseSynchronizer(51)).fit(GAIT.data, keyframes=EVENTS)
    live = OnlineSynchronizer(DenseSynchronizer(51), frame_rate=12.0)
    live.fit(GAIT.data, keyframes=EVENTS / 12)
    np.testing.assert_allclose(live.mean_, frames.mean_, rtol=1e-12)


def test_lags_take_no_keyframes():
    """They are of the whole body, on which lags do not depend."""
    sync = PartSynchronizer({"leg": [0, 1]}, synchronizer=DenseSynchronizer(51)).fit(
        GAIT.data, keyframes=EVENTS
    )
    with pytest.raises(TypeError, match=r"LagDisplay\.from_estimator got 'keyframes'"):
        display.LagDisplay.from_estimator(sync, GAIT.data, keyframes=EVENTS)


@pytest.mark.parametrize("method", ["fit", "match", "transform"])
def test_a_table_in_another_order_is_refused(method, sync):
    table = pd.DataFrame(EVENTS)
    np.testing.assert_array_equal(
        sync.transform(GAIT.data, keyframes=table), sync.transform(GAIT.data, keyframes=EVENTS)
    )
    with pytest.raises(ValueError, match=r"rows of keyframes are labelled .* in another order"):
        getattr(sync, method)(GAIT.data, keyframes=table.sort_values(0, ascending=False))


def test_a_keyframe_that_only_late_trials_know():
    """Where it is in the pattern is learnt from those that know it, as many as of any other."""
    trials, keyframes = GAIT.data * 2, np.full((2 * len(GAIT.data), 2), np.nan)
    keyframes[1:, 0] = np.tile(GAIT.keyframes[:, 0], 2)[1:]
    keyframes[-6:, 1] = GAIT.keyframes[-6:, 3]
    sync = DenseSynchronizer(51, pattern=0).fit(trials, keyframes=keyframes)
    alone = DenseSynchronizer(51, pattern=0).fit(trials, keyframes=keyframes[:, 1:])
    assert len(trials) > 40
    np.testing.assert_allclose(sync.keyframes_[1], alone.keyframes_[0], atol=1.5)
