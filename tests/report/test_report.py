"""write_report: what the file says, that it needs nothing else, and what is refused."""

import base64
import io
import json
import os
import re
import sys
from html.parser import HTMLParser
from operator import itemgetter

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler
from sklearn_motionsync import (
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    FrameWise,
    LinearSynchronizer,
    Match,
)
from sklearn_motionsync.comparison import compare_groups
from sklearn_motionsync.datasets import make_bending, make_gait
from sklearn_motionsync.report import page, player, report, write_player, write_report

GAIT = make_gait(8, 2, timing=8, random_state=0)
TRIALS = [pd.DataFrame(x, columns=GAIT.feature_names) for x in GAIT.data]
for k, x in enumerate(TRIALS):
    x.attrs |= {"units": list(GAIT.units), "trial": f"walk {k}", "frame_rate": 100.0}
GIVEN = {"y": GAIT.group, "groups": GAIT.person}
SYNC = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(51)).fit(TRIALS)
# It is quick, and compares nothing again without some of its features.
LINEAR = LinearSynchronizer(20).fit(TRIALS)


@pytest.fixture(autouse=True)
def small_pictures(monkeypatch):
    monkeypatch.setattr(page, "DPI", 40)


class Text(HTMLParser):
    """What a page shows: its text, its tags, its tables, and the text in place of images."""

    def __init__(self, path):
        super().__init__()
        self.page = path.read_text(encoding="utf-8")
        self.shown, self.tags, self.images, self._within = [], [], [], []
        self.feed(self.page)
        self.close()
        self.text = " ".join(" ".join(self.shown).split())
        json_text = re.search(r'id="data">(.*?)</script>', self.page, re.DOTALL)[1]
        self.data = json.loads(json_text)

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag == "img":
            self.images.append(dict(attributes))
        if tag in ("script", "style"):
            self._within.append(tag)

    def handle_endtag(self, tag):
        if tag in ("script", "style"):
            self._within.pop()

    def handle_data(self, data):
        if not self._within:
            self.shown.append(data)

    @property
    def headings(self):
        return re.findall(r"<h2[^>]*>(.*?)</h2>", self.page)

    def table(self, name):
        return pd.read_csv(io.StringIO(self.data["files"][f"{name}.csv"]))


@pytest.fixture(scope="module")
def groups(tmp_path_factory):
    path = tmp_path_factory.mktemp("groups") / "report.html"
    out = {"walk 99": "it was cut off", 7: "no force plate"}
    return Text(write_report(path, SYNC, TRIALS, **GIVEN, left_out=out, title="Gait"))


def test_the_set_and_what_was_left_out(groups):
    assert groups.headings == ["The set", "Before and after", "Timing", "Groups", "Doubtful trials"]
    pattern = SYNC[-1].pattern_index_
    assert "16 trials of 8 people in 2 groups, on 51 frames." in groups.text
    assert f"The pattern is trial walk {pattern}." in groups.text
    assert "Left out before: 2 trials trial reason walk 99 it was cut off 7 no force" in groups.text
    assert "DenseSynchronizer(n_frames=51)" in groups.text
    seconds = [(len(x) - 1) / 100 for x, g in zip(TRIALS, GAIT.group, strict=True) if g == "B"]
    assert f"B 4 8 {np.mean(seconds):.2f} {np.std(seconds, ddof=1):.4f}" in groups.text
    table = groups.table("trials")
    assert table["trial"].tolist() == [f"walk {k}" for k in range(16)]
    assert table["seconds"].tolist() == [(len(x) - 1) / 100 for x in TRIALS]
    assert table["pattern"].tolist() == [k == pattern for k in range(16)]


def test_tables_hold_the_numbers_of_the_match(groups):
    match = Match.from_estimator(SYNC, TRIALS)
    offsets = match.offsets_in("percent")
    timing = groups.table("timing")
    assert len(timing) == 16 * 51
    np.testing.assert_allclose(timing["offset (%)"], offsets.ravel(), rtol=1e-5)
    frames = timing["frame of the trial"].to_numpy().reshape(16, 51)
    np.testing.assert_allclose(frames, match.frames(TRIALS), rtol=1e-5)
    curves = groups.table("aligned_curves")
    assert list(curves)[-4:] == [
        "hip_flexion (deg)",
        "knee_flexion (deg)",
        "ankle_dorsiflexion (deg)",
        "vertical_force (body weights)",
    ]
    expected = match.warp(GAIT.data).reshape(-1, 4)
    np.testing.assert_allclose(curves.iloc[:, -4:], expected, rtol=1e-4, atol=1e-9)
    assert curves["group"].tolist() == np.repeat(GAIT.group, 51).tolist()
    trials = groups.table("trials")
    worst = np.abs(offsets).max(axis=1).argmax()
    np.testing.assert_allclose(
        trials["mean absolute offset (%)"], np.abs(offsets).mean(axis=1), rtol=1e-5
    )
    assert f"The largest offset is that of trial walk {worst}:" in groups.text


def test_the_test_is_that_of_compare_groups(groups):
    found = compare_groups(SYNC, TRIALS, **GIVEN)
    assert found.describe() in groups.text
    assert len(found.clusters)
    pd.testing.assert_frame_equal(
        groups.table("clusters"), found.clusters, rtol=1e-4, check_dtype=False
    )
    np.testing.assert_allclose(groups.table("p_values")["p"], found.to_frame()["p"], rtol=1e-4)
    assert "B later than A" in groups.text
    assert any(found.describe() in image["alt"] for image in groups.images)
    assert len(groups.images) == 3
    for image in groups.images:
        assert base64.b64decode(image["src"].removeprefix("data:image/png;base64,"))[1:4] == b"PNG"


def test_without_groups_there_is_no_test(tmp_path):
    sync = LinearSynchronizer(20).fit(GAIT.data)
    page = Text(write_report(tmp_path / "a.html", sync, GAIT.data, features=0))
    assert page.headings == ["The set", "Before and after", "Timing", "Doubtful trials"]
    assert "16 trials, on 20 frames." in page.text
    assert "frames, mean" in page.text
    assert set(page.data["files"]) == {"aligned_curves.csv", "trials.csv", "timing.csv"}
    assert page.data["player"] is None
    assert 'id="stage"' not in page.page
    assert "Aligned trials" in page.text


def test_a_covariate_takes_the_place_of_groups(tmp_path):
    age = [int(p.removeprefix("person")) for p in GAIT.person]
    page = Text(
        write_report(
            tmp_path / "a.html",
            LINEAR,
            TRIALS,
            y=age,
            covariate=True,
            groups=GAIT.person,
            features=0,
        )
    )
    assert "Covariate" in page.headings
    assert "Regression, 8 people" in page.text
    assert page.table("trials")["covariate"].tolist() == age


def test_rows_seconds_and_synchronizers_that_do_not_tell(tmp_path):
    t = np.linspace(0, 1, 40)
    rows = np.array([np.sin(6 * t ** (1 + 0.1 * k)) for k in range(6)])
    sync = LinearSynchronizer(20).fit(rows)
    page = Text(write_report(tmp_path / "a.html", sync, rows, frame_rate=10, unit="seconds"))
    assert "does not tell which trials" in page.text
    assert "No trial is later or earlier than the pattern." in page.text
    assert page.table("trials")["seconds"].tolist() == [3.9] * 6
    assert page.table("timing")["offset (s)"].abs().max() == 0
    one = Text(write_report(tmp_path / "b.html", sync, rows[:1]))
    assert "1 trial, on 20 frames." in one.text


def test_keyframes_and_features(tmp_path):
    sync = DenseSynchronizer(51).fit(GAIT.data, keyframes=GAIT.keyframes)
    events = pd.DataFrame(GAIT.keyframes, columns=GAIT.keyframe_names)
    given = {"keyframes": events, "features": ["hip_flexion"], "signals": TRIALS}
    page = Text(write_report(tmp_path / "a.html", sync, GAIT.data, **given))
    match = Match.from_estimator(sync, GAIT.data, keyframes=GAIT.keyframes)
    expected = match.offsets_in("percent").ravel()
    np.testing.assert_allclose(page.table("timing")["offset (%)"], expected, rtol=1e-5)
    assert list(page.table("aligned_curves"))[-1] == "hip_flexion (deg)"
    wide = [np.repeat(x, 2, axis=1) for x in GAIT.data]
    page = Text(write_report(tmp_path / "a.html", sync, GAIT.data, signals=wide, keyframes=events))
    assert "The figure shows 4 of 8 signals." in page.text


def test_doubtful_trials_come_with_reasons(tmp_path):
    bad = [*GAIT.data, np.concatenate([GAIT.data[0]] * 2)]
    sync = DenseSynchronizer(51).fit(GAIT.data)
    page = Text(write_report(tmp_path / "a.html", sync, bad, features=0))
    table = page.table("doubtful")
    assert table["trial"].tolist() == [16]
    assert "no warp explains" in page.text
    assert page.table("trials")["doubtful"].tolist() == [False] * 16 + [True]


# -- bodies -------------------------------------------------------------------------------

BENDING = make_bending(6, n_frames=40, random_state=0)


def test_bodies_have_a_player(tmp_path):
    steps = DirectionCosines(BENDING.skeleton), ASpace(), DenseSynchronizer(30)
    pipe = make_pipeline(*steps).fit(BENDING.data)
    page = Text(write_report(tmp_path / "a.html", pipe, BENDING.data, features=0))
    data, match = page.data["player"], Match.from_estimator(pipe, BENDING.data)
    assert "Stick figures" in page.headings
    assert data["counts"] == [len(x) for x in BENDING.data]
    assert data["names"][pipe[-1].pattern_index_].endswith("(pattern)")
    assert len(data["shown"]) == 2
    assert pipe[-1].pattern_index_ in data["shown"]
    warps = np.frombuffer(base64.b64decode(data["warps"]), "<u2").reshape(6, 30) / 65535
    np.testing.assert_allclose(warps, match.times / 29, atol=1e-4)


def test_bodies_are_those_that_reach_the_step_with_a_skeleton(tmp_path):
    wide = [np.hstack([x[:, :2], x]) for x in BENDING.data]
    chosen = FrameWise(FunctionTransformer(itemgetter((slice(None), slice(2, None)))))
    steps = DirectionCosines(BENDING.skeleton), LinearSynchronizer(30)
    keyframes = [[len(x) // 2] for x in wide]
    pipe = make_pipeline(chosen, *steps).fit(wide, linearsynchronizer__keyframes=keyframes)
    page = Text(write_report(tmp_path / "a.html", pipe, wide, keyframes=keyframes, features=0))
    plain = make_pipeline(*steps).fit(BENDING.data)
    expected = Text(write_report(tmp_path / "b.html", plain, BENDING.data, features=0))
    assert page.data["player"]["positions"] == expected.data["player"]["positions"]


@pytest.mark.parametrize(
    ("value", "text"),
    [(np.inf, "inf"), (-np.inf, "-inf"), (np.nan, ""), (-0.0, "0"), (2.5, "2.50")],
)
def test_numbers_of_the_page(value, text):
    assert page.number(value) == text


def test_sizes_are_limited_and_the_page_names_it(tmp_path, monkeypatch):
    pipe = make_pipeline(DirectionCosines(BENDING.skeleton), LinearSynchronizer(30))
    pipe.fit(BENDING.data)
    monkeypatch.setattr(report, "MOST_NUMBERS", 6 * 30 * 2)
    page = Text(write_report(tmp_path / "a.html", pipe, BENDING.data, features=0))
    step = tables_step(page)
    assert f"one of every {step} frames" in page.text
    monkeypatch.setattr(player, "MOST_COORDINATES", 1)
    page = Text(write_report(tmp_path / "a.html", pipe, BENDING.data, features=0))
    assert len(page.data["player"]["names"]) == 2
    assert "The player holds 2 trials of 6." in page.text


def tables_step(page):
    return int(np.diff(page.table("timing")["frame of the pattern"].unique())[0])


# -- the file -------------------------------------------------------------------------------


def test_what_users_give_is_text_and_no_markup(tmp_path):
    evil = "</script><script>alert(\"x\")</script> & 'quotes' <b>"
    tables = [x.rename(columns={"hip_flexion": evil}) for x in TRIALS]
    for k, x in enumerate(tables):
        x.attrs["trial"] = f"{k} {evil}"
    people = [f"{evil} {p}" for p in GAIT.person]
    group = [f"{g} $x$ {evil}" for g in GAIT.group]
    sync = LinearSynchronizer(20).fit(tables)
    page = Text(
        write_report(
            tmp_path / "a.html",
            sync,
            tables,
            y=group,
            groups=people,
            title=evil,
            left_out={evil: evil},
            features=evil,
        )
    )
    scripts = [attributes for tag, attributes in page.tags if tag == "script"]
    assert scripts == [{"type": "application/json", "id": "data"}, {}]
    assert "b" not in [tag for tag, _ in page.tags]
    assert page.text.startswith(evil)
    assert page.table("left_out")["reason"].tolist() == [evil]
    assert page.table("trials")["trial"][3] == f"3 {evil}"
    assert evil in list(page.table("aligned_curves"))[-1]


def test_the_page_loads_nothing(groups):
    assert "://" not in groups.page
    for tag, attributes in groups.tags:
        assert tag not in ("link", "iframe", "object", "embed")
        source = attributes.get("src", "data:")
        assert source.startswith("data:")
    assert "@import" not in groups.page
    assert "url(" not in groups.page
    policy = [a["content"] for tag, a in groups.tags if a.get("http-equiv")]
    assert "default-src 'none'" in policy[0]


def test_the_same_input_gives_the_same_bytes(tmp_path, groups):
    found = []
    step = FunctionTransformer(func=lambda x: x)  # its repr has an address
    for k in range(2):
        pipe = make_pipeline(step, LinearSynchronizer(20)).fit(TRIALS)
        with plt.style.context("dark_background" if k else "default"):
            path = write_report(tmp_path / f"{k}.html", pipe, TRIALS, **GIVEN, features=0)
        found.append(re.sub(rb"<time>.*?</time>", b"", path.read_bytes()))
    assert found[0] == found[1]
    assert b" at 0x" not in found[0]


def test_figures_of_the_user_stay_and_own_ones_are_closed(tmp_path):
    figure = plt.figure()
    write_report(str(tmp_path / "a.html"), LINEAR, TRIALS, **GIVEN, features=0)
    assert plt.get_fignums() == [figure.number]
    with pytest.raises(ValueError, match="no feature 'elbow'"):
        write_report(tmp_path / "a.html", LINEAR, TRIALS, features="elbow")
    assert plt.get_fignums() == [figure.number]


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({"left_out": ["walk 3"]}, ValueError, r"left_out must be a mapping .* got \['walk 3'\]"),
        ({"y": ["A"]}, ValueError, "y must have one label"),
        ({"y": None, "covariate": True}, ValueError, "y is needed"),
        ({"paired": True}, ValueError, "y is needed"),
        ({"unit": "minutes"}, ValueError, "unit must be one of"),
        ({"skeleton": "acclaim"}, ValueError, "skeleton must be a Skeleton"),
        ({"speed": 3}, TypeError, "write_report got 'speed'"),
    ],
)
def test_refused_arguments_leave_the_file_as_it_was(tmp_path, given, error, message):
    path = tmp_path / "report.html"
    path.write_text("before")
    with pytest.raises(error, match=message):
        write_report(path, LINEAR, TRIALS, **{"features": 0} | given)
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_refused_paths(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"There is no folder '.*none' for the report"):
        write_report(tmp_path / "none" / "a.html", SYNC, TRIALS)
    for path in (tmp_path, os.devnull):
        with pytest.raises(ValueError, match=r"path must be that of a file.* is a folder or"):
            write_report(path, SYNC, TRIALS)


def test_a_file_is_replaced_where_a_link_leads_and_keeps_its_readers(tmp_path):
    target, link = tmp_path / f"{'x' * 240}.html", tmp_path / "link.html"
    target.write_text("old")
    target.chmod(0o600)
    link.symlink_to(target)
    bends = make_bending(2, n_frames=20, random_state=0)
    write_player(link, bends.data, bends.skeleton)
    assert link.is_symlink()
    assert target.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert target.stat().st_mode & 0o777 == 0o600
    assert sorted(tmp_path.iterdir()) == sorted([target, link])


def test_no_spreadsheet_runs_what_users_give(tmp_path):
    """Names that begin as a formula stand behind an apostrophe in the files of the report."""
    people = ['=HYPERLINK("http://x")', "+1", "@a", "-b"] * (len(TRIALS) // 4 + 1)
    path = write_report(
        tmp_path / "a.html", LINEAR, TRIALS, groups=people[: len(TRIALS)], features=0
    )
    table = pd.read_csv(io.StringIO(Text(path).data["files"]["trials.csv"]))
    assert table["person"].tolist()[:4] == ['\'=HYPERLINK("http://x")', "'+1", "'@a", "'-b"]


def test_a_missing_matplotlib_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(ImportError, match="pip install matplotlib"):
        write_report(tmp_path / "a.html", SYNC, TRIALS)
