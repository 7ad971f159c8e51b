"""write_report: what the file says, that it needs nothing else, and what is refused."""

import base64
import io
import os
import re
from html import escape
from operator import itemgetter
from unittest.mock import Mock

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
from sklearn_motionsync.io import write_motion
from sklearn_motionsync.report import page, player, report, write_player, write_report

from pages import Page

GAIT = make_gait(8, 2, timing=8, random_state=0)
TRIALS = [pd.DataFrame(x, columns=GAIT.feature_names) for x in GAIT.data]
for k, x in enumerate(TRIALS):
    x.attrs |= {"units": list(GAIT.units), "trial": f"walk {k}", "frame_rate": 100.0}
GIVEN = {"y": GAIT.group, "groups": GAIT.person, "random_state": 1}
SYNC = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(51)).fit(TRIALS)
MATCH = Match.from_estimator(SYNC, TRIALS)
OFFSETS, WARPED = MATCH.offsets_in("percent"), MATCH.warp(GAIT.data)
SIGNALS = ["hip_flexion (deg)", "knee_flexion (deg)", "ankle_dorsiflexion (deg)"]
SIGNALS += ["vertical_force (body weights)"]
# It is quick, and compares nothing again without some of its features.
LINEAR = LinearSynchronizer(20).fit(TRIALS)


# Those of `groups` are rendered, and of two that must be equal.
pytestmark = pytest.mark.usefixtures("without_pictures")


class Text(Page):
    """A report: its headings, its files, and its tables."""

    def __init__(self, path):
        super().__init__(path.read_text(encoding="utf-8"))
        self.images = [attributes for tag, attributes in self.tags if tag == "img"]

    @property
    def headings(self):
        return re.findall(r"<h2[^>]*>(.*?)</h2>", self.page)

    def table(self, name):
        return pd.read_csv(io.StringIO(self.data["files"][f"{name}.csv"]))

    def rows(self, caption):
        """The texts in the cells of a table of the page, its heads first."""
        _, _, after = self.page.partition(f"<figcaption>{escape(caption)}</figcaption>")
        rows = re.findall("<tr>(.*?)</tr>", after.partition("</table>")[0])
        return [re.findall("<t[hd][^>]*>(.*?)</t[hd]>", row) for row in rows]

    def check(self, caption, expected):
        """Of fractions three digits of the largest one are shown."""
        heads, *rows = self.rows(caption)
        assert heads == list(expected)
        for texts, (_, column) in zip(zip(*rows, strict=True), expected.items(), strict=True):
            if column.dtype.kind in "if":
                limit = 0.006 * column.abs().max() * (column.dtype.kind == "f")
                np.testing.assert_allclose(np.array(texts, float), column, atol=limit)
            else:
                assert list(texts) == column.astype(str).tolist()


def capture_figures(patch):
    """The list that will hold the figures of reports."""
    figures, draw = [], report.picture
    patch.setattr(report, "picture", lambda *given: figures.append(given[0]) or draw(*given))
    return figures


def write(folder, *args, **given):
    return Text(write_report(folder / "a.html", *args, **given))


def ys(lines):
    return np.array([path.vertices[:, 1] for path in lines.get_paths()])


def evenly(X, n):
    """Trials (n_sequences, n, n_features) after linear normalisation."""
    return np.array(
        [[np.interp(np.linspace(0, len(x) - 1, n), range(len(x)), column) for column in x.T]
         for x in X]
    ).transpose(0, 2, 1)  # fmt: skip


EVEN = evenly(GAIT.data, 51)


@pytest.fixture(scope="module")
def groups(tmp_path_factory):
    folder = tmp_path_factory.mktemp("groups")
    out = {"walk 99": "it was cut off", 7: "no force plate"}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page, "DPI", 40)
        figures = capture_figures(patch)
        text = write(folder, SYNC, TRIALS, **GIVEN, left_out=out, title="Gait")
    text.figures = figures
    return text


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
    assert table["seconds"].tolist() == [(len(x) - 1) / 100 for x in TRIALS]
    assert table["pattern"].tolist() == [k == pattern for k in range(16)]


def test_tables_hold_the_numbers_of_the_match(groups):
    timing = groups.table("timing")
    index = ["trial", "group", "person", "frame of the pattern", "time of the pattern (%)"]
    assert list(timing) == [*index, "offset (%)", "frame of the trial", "rate"]
    assert timing["trial"].tolist() == [f"walk {k}" for k in range(16) for _ in range(51)]
    assert timing["frame of the pattern"].tolist() == [*range(51)] * 16
    np.testing.assert_allclose(timing[index[-1]], 2 * timing["frame of the pattern"])
    np.testing.assert_allclose(timing["rate"], MATCH.rates.ravel(), rtol=1e-5)
    np.testing.assert_allclose(timing["offset (%)"], OFFSETS.ravel(), rtol=1e-5)
    frames = timing["frame of the trial"].to_numpy().reshape(16, 51)
    np.testing.assert_allclose(frames, MATCH.frames(TRIALS), rtol=1e-5)
    curves = groups.table("aligned_curves")
    assert list(curves) == [*index, *SIGNALS]
    np.testing.assert_allclose(curves[SIGNALS], WARPED.reshape(-1, 4), rtol=1e-4, atol=1e-9)
    assert curves["group"].tolist() == np.repeat(GAIT.group, 51).tolist()
    trials = groups.table("trials")
    columns = "mean absolute offset (%)", "largest offset (%)", "at (%)"
    known = ["trial", "group", "person", "frames", "seconds"]
    assert list(trials) == [*known, *columns, "pattern", "doubtful"]
    at = np.abs(OFFSETS).argmax(axis=1)
    numbers = np.abs(OFFSETS).mean(axis=1), OFFSETS[range(16), at], 2.0 * at
    np.testing.assert_allclose(trials[list(columns)].T, numbers, rtol=1e-5)
    groups.check("Offsets of trials", trials.drop(columns=["pattern", "doubtful"]))
    worst = np.abs(numbers[1]).argmax()
    word = "later" if numbers[1][worst] > 0 else "earlier"
    offset, place = (page.number(abs(values[worst])) for values in numbers[1:])
    words = f"is that of trial walk {worst}: {offset} % {word} than the pattern, at {place} %."
    assert f"The largest offset {words}" in groups.text
    rows = []
    for label in "AB":
        of_group = np.flatnonzero(GAIT.group == label)
        first = of_group[np.abs(numbers[1][of_group]).argmax()]
        mean, largest = numbers[0][of_group].mean(), numbers[1][first]
        rows.append([label, mean, largest, numbers[2][first], f"walk {first}"])
    expected = pd.DataFrame(rows, columns=["group", *columns, "of trial"])
    groups.check("Offsets of groups", expected)


def test_spreads_are_those_of_trials_before_and_after(groups):
    spreads = [np.sqrt(x.var(axis=0).mean(axis=0)) for x in (EVEN, WARPED)]
    left = 100 * spreads[1] / spreads[0]
    assert (
        f"Of the standard deviation between time-normalised trials, {left.min():.0f} to "
        f"{left.max():.0f} % is left after alignment."
    ) in groups.text
    table = {"signal": SIGNALS, "time-normalised": spreads[0], "aligned": spreads[1]}
    groups.check("Standard deviation between trials", pd.DataFrame(table | {"left (%)": left}))


def test_figures_show_the_curves_and_offsets(groups):
    before_and_after, _ = groups.figures
    *panels, timing = before_and_after.axes
    assert len(panels) == 8
    for k in range(4):
        for axis, values in zip(panels[2 * k : 2 * k + 2], (EVEN, WARPED), strict=True):
            (lines,) = axis.collections
            np.testing.assert_allclose(ys(lines), values[..., k])
            np.testing.assert_allclose(lines.get_paths()[0].vertices[:, 0], np.linspace(0, 100, 51))
        pattern = panels[2 * k + 1].lines[-1].get_ydata()
        np.testing.assert_array_equal(pattern, WARPED[SYNC[-1].pattern_index_, :, k])
    assert panels[-2].get_xlabel() == panels[-1].get_xlabel() == "% of the pattern"
    assert panels[1].get_title() == "aligned, thick: group means\nblack: the pattern"
    _, lines = timing.collections
    np.testing.assert_allclose(ys(lines), OFFSETS - OFFSETS.mean(axis=0), atol=1e-9)
    assert timing.get_ylabel() == "later than\nthe mean (%)"
    assert [text.get_text() for text in panels[0].get_legend().get_texts()] == ["A", "B"]


def test_the_test_is_that_of_compare_groups(groups):
    found = compare_groups(SYNC, TRIALS, **GIVEN)
    assert found.describe() in groups.text
    assert len(found.clusters)
    pd.testing.assert_frame_equal(
        groups.table("clusters"), found.clusters, rtol=1e-4, check_dtype=False
    )
    np.testing.assert_allclose(groups.table("p_values")["p"], found.to_frame()["p"], rtol=1e-4)
    columns = ["what", "feature", "start", "end", "direction"]
    columns += ["size", "lower", "upper", "unit", "p"]
    heads = ["differs in", "signal", "from (%)", "to (%)", "direction", "size", "95\u00a0% from"]
    heads += ["95\u00a0% to", "unit", "p"]
    groups.check("Where they differ", found.clusters[columns].set_axis(heads, axis=1))
    assert [[test, differs] for test, _, differs in groups.rows(
        "Probability of such differences by chance")[1:]] == [
        ["joint", "yes"], ["shape", "no"], ["timing", "yes"], ["linear", "yes"]]  # fmt: skip
    assert any(found.describe() in image["alt"] for image in groups.images)
    assert len(groups.images) == 2
    for image in groups.images:
        assert base64.b64decode(image["src"].removeprefix("data:image/png;base64,"))[1:4] == b"PNG"


def test_without_groups_there_is_no_test(tmp_path, monkeypatch):
    sync, figures = LinearSynchronizer(20).fit(GAIT.data), capture_figures(monkeypatch)
    others = [x for k, x in enumerate(GAIT.data) if k != sync.pattern_index_]
    page = write(tmp_path, sync, others, features=0)
    assert page.headings == ["The set", "Before and after", "Timing", "Doubtful trials"]
    assert "15 trials, on 20 frames. The pattern is none of these trials." in page.text
    assert "frames, mean" in page.text
    assert set(page.data["files"]) == {"aligned_curves.csv", "trials.csv", "timing.csv"}
    assert page.data["player"] is None
    assert "Aligned trials" in page.text
    assert "trials, 100 % is left after alignment." in page.text
    assert page.rows("Offsets of groups") == []
    assert "one of every" not in page.text
    (before_and_after,) = figures
    assert before_and_after.axes[1].get_title() == "aligned\nblack: their mean"
    mean = evenly(others, 20)[..., 0].mean(axis=0)
    np.testing.assert_allclose(before_and_after.axes[1].lines[-1].get_ydata(), mean)


def test_a_covariate_takes_the_place_of_groups(tmp_path, capsys):
    age = [int(p.removeprefix("person")) for p in GAIT.person]
    given = {"y": age, "covariate": True, "groups": GAIT.person}
    page = write(tmp_path, LINEAR, TRIALS, **given, features=0)
    assert "Covariate" in page.headings
    assert "Regression, 8 people" in page.text
    assert "No stretch of frames differs at p = 0.05." in page.text
    assert capsys.readouterr().out == ""
    assert page.table("trials")["covariate"].tolist() == age
    assert page.rows("Offsets of trials")[0][:4] == ["trial", "person", "frames", "seconds"]


def test_rows_seconds_and_synchronizers_that_do_not_tell(tmp_path):
    t = np.linspace(0, 1, 40)
    rows = np.array([np.sin(6 * t ** (1 + 0.1 * k)) for k in range(6)])
    sync = LinearSynchronizer(20).fit(rows)
    page = write(tmp_path, sync, rows, frame_rate=10, unit="seconds")
    assert "does not tell which trials" in page.text
    assert "No trial is later or earlier than the pattern." in page.text
    assert page.table("trials")["seconds"].tolist() == [3.9] * 6
    assert page.table("timing")["offset (s)"].abs().max() == 0
    one = write(tmp_path, LINEAR, TRIALS[:1], features=0)
    assert "1 trial, on 20 frames." in one.text
    assert "Of the standard deviation" not in one.text
    seconds = (len(TRIALS[0]) - 1) / 100
    assert one.rows("Trials and their lengths")[1] == ["1", f"{seconds:.2f}", ""]
    two = [rows[0, :, np.newaxis], rows[1, :30, np.newaxis]]
    sync = LinearSynchronizer(20).fit(two)
    two = write(tmp_path, sync, two, unit="frames")
    assert two.rows("Trials and their lengths")[1] == ["2", "35.0", f"{np.sqrt(50):.2f}"]
    columns = ["trial", "frame of the pattern", "offset (frames)", "frame of the trial", "rate"]
    assert list(two.table("timing")) == columns


def test_keyframes_and_features(tmp_path, monkeypatch):
    figures = capture_figures(monkeypatch)
    sync = DenseSynchronizer(51).fit(GAIT.data, keyframes=GAIT.keyframes)
    events = pd.DataFrame(GAIT.keyframes, columns=GAIT.keyframe_names)
    given = {"keyframes": events, "features": ["hip_flexion"], "signals": TRIALS}
    page = write(tmp_path, sync, GAIT.data, **given)
    match = Match.from_estimator(sync, GAIT.data, keyframes=GAIT.keyframes)
    expected = match.offsets_in("percent").ravel()
    np.testing.assert_allclose(page.table("timing")["offset (%)"], expected, rtol=1e-5)
    assert list(page.table("aligned_curves"))[-1] == "hip_flexion (deg)"
    # Key-frames have names and lines, behind the line at 0.
    share = GAIT.keyframes[0] / (len(GAIT.data[0]) - 1)
    at = np.interp(50 * share, match.times[0], 2 * np.arange(51))
    axis = figures[0].axes[-1]
    assert [text.get_text() for text in axis.texts] == GAIT.keyframe_names
    drawn = [line.get_xdata()[0] for line in axis.lines[1:]]
    np.testing.assert_allclose(drawn, at, atol=1)
    # One of seven signals is the same in all trials.
    wide = [np.column_stack([x, x[:, :2], np.ones(len(x))]) for x in GAIT.data]
    given = {"signals": wide, "keyframes": events}
    linear = LinearSynchronizer(20).fit(GAIT.data, keyframes=events)
    page = write(tmp_path, linear, GAIT.data, **given)
    assert "The figure shows 4 of 7 signals." in page.text
    assert page.rows("Standard deviation between trials")[-1] == ["x6", "0", "0", ""]
    # All seven are shown if they are named, and so are six.
    named = write(tmp_path, linear, GAIT.data, **given, features=range(7))
    given["signals"] = [x[:, :6] for x in wide]
    six = write(tmp_path, linear, GAIT.data, **given)
    assert "The figure shows" not in named.text + six.text
    assert [len(figure.axes) for figure in figures[1:]] == [9, 15, 13]


def test_doubtful_trials_come_with_reasons(tmp_path):
    bad = [*GAIT.data, np.concatenate([GAIT.data[0]] * 2)]
    sync = DenseSynchronizer(51).fit(GAIT.data)
    page = write(tmp_path, sync, bad, features=0)
    reasons = Match.from_estimator(sync, bad).reasons
    rows = [[str(k), escape(reason)] for k, reason in enumerate(reasons) if reason]
    assert page.rows("Look at 1 trial before using the warps") == [["trial", "reason"], *rows]
    assert "no warp explains" in rows[0][1]
    assert page.table("doubtful")["trial"].tolist() == [16]
    assert page.table("trials")["doubtful"].tolist() == [False] * 16 + [True]


# -- bodies -------------------------------------------------------------------------------

BENDING = make_bending(6, n_frames=40, random_state=0)


def test_bodies_are_those_that_reach_the_step_with_a_skeleton(tmp_path):
    """Other columns are left out before it, and key-frames go to a later step."""
    steps = DirectionCosines(BENDING.skeleton), ASpace(), LinearSynchronizer(30)
    plain = make_pipeline(*steps).fit(BENDING.data)
    expected = write(tmp_path, plain, BENDING.data, features=0).data["player"]["positions"]
    wide = [np.hstack([x[:, :2], x]) for x in BENDING.data]
    chosen = FrameWise(FunctionTransformer(itemgetter((slice(None), slice(2, None)))))
    keyframes = [[len(x) // 2 - k] for k, x in enumerate(wide)]
    pipe = make_pipeline(chosen, *steps).fit(wide, linearsynchronizer__keyframes=keyframes)
    page = write(tmp_path, pipe, wide, keyframes=keyframes, features=0)
    data, match = page.data["player"], Match.from_estimator(pipe, wide, keyframes=keyframes)
    assert "Stick figures" in page.headings
    assert data["positions"] == expected
    assert data["lengths"] == [len(x) for x in BENDING.data]
    warps = np.frombuffer(base64.b64decode(data["warps"]), "<u2").reshape(6, 30) / 65535
    np.testing.assert_allclose(warps, match.times / 29, atol=1e-4)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ([np.inf], "inf"), ([-np.inf], "-inf"), ([np.nan], ""), ([-0.0], "0"), ([2.5], "2.50"),
        ([0.1234], "0.123"), ([0.5, 2], "0.50"), ([-1.0, 1000.0], "-1"), ([1234.0], "1234"),
        ([100.0], "100"), ([1.2e-9], "0.000000"), ([1.234e-4], "0.000123"),
    ],
)  # fmt: skip
def test_numbers_of_the_page(value, text):
    assert page.number(*value) == text


def test_cells_and_links_of_the_page():
    table = pd.DataFrame(
        {"name": ["a<b", "c"], "count": [1200, 3], "one": [0.012345, 100], "ok": [True, False]}
    )
    table.insert(3, "each", table["one"])
    text = page.table_of(table, "One", ("each",))
    cells = re.findall('<td( class="n")?>(.*?)</td>', text)
    assert [bool(kind) for kind, _ in cells] == [False, True, True, True, False] * 2
    rows = [["a&lt;b", "1200", "0", "0.0123", "yes"], ["c", "3", "100", "100", "no"]]
    assert [text for _, text in cells] == [*rows[0], *rows[1]]
    two = page.Page()
    two.add("First", "text")
    assert "<nav" not in two.render("title", "version")
    two.add("Nothing", "", "")
    two.add("Second & last", "text")
    links = re.findall('<li><a href="#(.*?)">(.*?)</a>', two.render("title", "version"))
    assert links == [("section0", "First"), ("section1", "Second &amp; last")]


def test_tables_with_a_row_a_frame_have_a_limit_and_the_page_names_it(tmp_path, monkeypatch):
    sync = LinearSynchronizer(30).fit(GAIT.data)
    # Five numbers a frame, of 16 trials on 30 frames: every other frame.
    monkeypatch.setattr(report, "MOST_NUMBERS", 5 * 16 * 15)
    page = write(tmp_path, sync, GAIT.data, features=1)
    assert "one of every 2 frames" in page.text
    timing, curves = page.table("timing"), page.table("aligned_curves")
    for table in (timing, curves):
        assert table["frame of the pattern"].tolist() == [*range(0, 30, 2)] * 16
    match = sync.match(GAIT.data)
    frames = match.frames(GAIT.data)[:, ::2].ravel()
    np.testing.assert_allclose(timing["frame of the trial"], frames, rtol=1e-5)
    np.testing.assert_allclose(timing["rate"], match.rates[:, ::2].ravel())
    np.testing.assert_allclose(curves["x1"], evenly(GAIT.data, 30)[:, ::2, 1].ravel(), rtol=1e-5)


@pytest.mark.parametrize(
    ("pattern", "chosen", "shown"),
    [(4, [0, 1, 4], [0, 2]), (5, [0, 1, 2], [0, 1])],
)
def test_the_player_of_a_report_holds_the_pattern_and_the_first_trials(
    tmp_path, monkeypatch, pattern, chosen, shown
):
    steps = DirectionCosines(BENDING.skeleton), DenseSynchronizer(20, pattern=pattern)
    pipe = make_pipeline(*steps).fit(BENDING.data)
    X, given = BENDING.data[:5], {"features": 0, "frame_rate": 10}
    # Of 16 points each.
    most = sum(len(X[k]) for k in chosen) * 16 * 3
    monkeypatch.setattr(player, "MOST_COORDINATES", most)
    page = write(tmp_path, pipe, X, **given)
    data = page.data["player"]
    names = [f"{k} (pattern)" if k == pattern else str(k) for k in chosen]
    assert (data["names"], data["shown"], data["alone"]) == (names, shown, False)
    assert data["durations"] == [(len(X[k]) - 1) / 10 for k in chosen]
    assert "The player holds 3 trials of 5." in page.text
    monkeypatch.setattr(player, "MOST_COORDINATES", 1)
    two = write(tmp_path, pipe, X, **given).data["player"]
    assert two["names"] == [names[0], names[shown[1]]]
    one = write(tmp_path, pipe, [X[3]], **given)
    assert (one.data["player"]["names"], one.data["player"]["shown"]) == (["0"], [0])
    assert "The player holds" not in one.text


# -- the file -------------------------------------------------------------------------------


def test_what_users_give_is_text_and_no_markup(tmp_path):
    evil = "</script><script>alert(\"é\")</script> & 'quotes' <b>"
    tables = [x.rename(columns={"hip_flexion": evil}) for x in TRIALS]
    for k, x in enumerate(tables):
        x.attrs["trial"] = f"{k} {evil}"
    people = [f"{evil} {p}" for p in GAIT.person]
    group = [f"{g} $x$ {evil}" for g in GAIT.group]
    sync = LinearSynchronizer(20).fit(tables)
    given = {"y": group, "groups": people, "title": evil, "left_out": {evil: evil}}
    page = write(tmp_path, sync, tables, **given, features=evil)
    scripts = [attributes for tag, attributes in page.tags if tag == "script"]
    assert scripts == [{"type": "application/json", "id": "data"}, {}]
    assert "b" not in [tag for tag, _ in page.tags]
    assert page.text.startswith(evil)
    assert "\\u00e9" not in page.page
    assert page.table("left_out")["reason"].tolist() == [evil]
    assert page.table("trials")["trial"][3] == f"3 {evil}"
    assert evil in list(page.table("aligned_curves"))[-1]


def test_the_page_loads_nothing(groups):
    groups.check_that_nothing_is_loaded()


def test_the_same_input_gives_the_same_bytes(tmp_path, monkeypatch):
    monkeypatch.undo()
    monkeypatch.setattr(page, "DPI", 40)
    found = []
    step = FunctionTransformer(func=lambda x: x)  # its repr has an address
    for k in range(2):
        pipe = make_pipeline(step, LinearSynchronizer(20)).fit(TRIALS)
        with plt.style.context("dark_background" if k else "default"):
            path = write_report(tmp_path / f"{k}.html", pipe, TRIALS, features=0)
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


@pytest.mark.parametrize("ending", [".html", ".bvh", ".trc"])
def test_a_file_is_replaced_where_a_link_leads_and_keeps_its_readers(tmp_path, monkeypatch, ending):
    target, link = tmp_path / f"{'x' * 240}{ending}", tmp_path / f"link{ending}"
    target.write_text("old")
    target.chmod(0o600)
    link.symlink_to(target)
    bends = make_bending(2, n_frames=20, random_state=0)

    def write():
        if ending == ".html":
            write_player(link, bends.data, bends.skeleton)
        else:
            write_motion(link, bends.data[0], bends.skeleton, frame_rate=50)

    with monkeypatch.context() as full:
        full.setattr("pathlib.Path.write_bytes", Mock(side_effect=OSError("No space left")))
        with pytest.raises(OSError, match="No space left"):
            write()
    assert target.read_text() == "old"
    write()
    assert link.is_symlink()
    assert len(target.read_text(encoding="utf-8")) > 1000
    assert target.stat().st_mode & 0o777 == 0o600
    assert sorted(tmp_path.iterdir()) == sorted([target, link])


def test_no_spreadsheet_runs_what_users_give():
    """Names that begin as a formula stand behind an apostrophe in the files of the report."""
    hostile = ['=HYPERLINK("http://x")', "+1", "@a", "-b", "\t=1", "\n=1", "x;=1", '"=1', "\uff1d1"]
    escaped = [f"'{text}" for text in hostile]
    escaped[4:7] = ["'\t'=1", "'\n'=1", "x;'=1"]
    sheet = page.Page()
    sheet.offer(table=pd.DataFrame({text: [text] for text in hostile}))
    (file,) = Page(sheet.render("title", "version")).data["files"].values()
    table = pd.read_csv(io.StringIO(file))
    assert list(table) == table.iloc[0].tolist() == escaped
