"""Reports and players in a browser: what is drawn, files, widths, and that nothing fails."""

import json
import re
import shutil
import subprocess
from urllib.parse import unquote

import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import make_bending, make_gait
from sklearn_motionsync.report import write_player, write_report

NAMES = "chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"
BROWSER = next(filter(None, map(shutil.which, NAMES)), None)
pytestmark = pytest.mark.skipif(BROWSER is None, reason=f"there is no browser: {', '.join(NAMES)}")
WIDTHS = 1280, 420

# Before the page: what it complains of, or tries to fetch.
WATCH = """<script>
var problems = [];
addEventListener("error", (e) => problems.push(e.message));
addEventListener("unhandledrejection", (e) => problems.push(String(e.reason)));
addEventListener("securitypolicyviolation", (e) => problems.push(e.blockedURI));
console.error = console.warn = (...words) => problems.push(words.join(" "));
</script>"""

# In frames of several widths, as windows of a browser without a screen are not as narrow.
HARNESS = """<!DOCTYPE html>
<body>
<script id="script">
const page = PAGE, widths = WIDTHS, found = [];
const wait = (ms) => new Promise((done) => setTimeout(done, ms));

async function visit(width) {
  const frame = document.createElement("iframe");
  frame.style = `width: ${width}px; height: 900px; border: 0`;
  const loaded = new Promise((done) => (frame.onload = done));
  frame.srcdoc = page;
  document.body.append(frame);
  await loaded;
  const own = frame.contentWindow, there = frame.contentDocument;
  const find = (id) => there.getElementById(id), out = { files: {} };
  const root = there.documentElement;
  out.inner = own.innerWidth;
  out.scroll = root.scrollWidth;
  out.images = [...there.images].map((image) => image.naturalWidth);

  // Files: what links save. To read a blob takes real time, of which the clock here knows nothing.
  let text = null;
  own.Blob = function (parts) {
    text = parts.join("");
  };
  own.URL.createObjectURL = () => "blob:";
  own.URL.revokeObjectURL = () => {};
  own.HTMLAnchorElement.prototype.click = function () {
    out.files[this.download] = text;
  };
  there.querySelectorAll("button[data-file]").forEach((button) => button.click());

  // Without a screen a browser draws when it likes.
  own.requestAnimationFrame = (f) => own.setTimeout(() => f(own.performance.now()), 16);
  if (find("stage")) {
    const canvases = () => [...find("stage").querySelectorAll("canvas")];
    const picture = () => canvases().map((one) => one.toDataURL()).join();
    const change = (id, value, kind) => {
      find(id).value = value;
      find(id).dispatchEvent(new own.Event(kind));
      return [picture(), find("moment").textContent];
    };
    const first = canvases()[0];
    const pixels = first.getContext("2d").getImageData(0, 0, first.width, first.height).data;
    out.colors = new Set(new Uint32Array(pixels.buffer)).size;
    out.count = canvases().length;
    out.columns = own.getComputedStyle(find("stage")).gridTemplateColumns.split(" ").length;
    out.rows = new Set(canvases().map((one) => one.getBoundingClientRect().top)).size;
    out.start = [picture(), find("moment").textContent];
    out.frames = Number(find("time").max) + 1;
    out.moved = change("time", (out.frames - 1) / 2, "input");
    out.turned = change("turn", 45, "input");
    out.seen = change("from", 90, "change");
    const boxes = [...find("choice").querySelectorAll("input")];
    boxes.find((box) => !box.checked)?.click();
    out.other = [picture(), find("moment").textContent, canvases().length];
    out.shown = find("shown").textContent;
    const recorded = there.querySelector("input[value=recorded]");
    if (!find("paces").hidden) recorded.click();
    out.recorded = [picture(), find("moment").textContent];
    const place = (mark) => Number(mark.style.getPropertyValue("--at"));
    out.marks = [...find("marks").children].map(place);
    out.jumped = [...find("jumps").querySelectorAll("button")].map((jump) => {
      jump.click();
      return find("time").value / find("time").max;
    });
    const key = (name) =>
      find("stage").dispatchEvent(new own.KeyboardEvent("keydown", { key: name }));
    key("ArrowRight");
    out.key = [picture(), find("moment").textContent];
    out.at = Number(find("time").value);
    find("play").click();
    out.playing = find("play").textContent;
    for (let k = 0; k < 100 && picture() === out.key[0]; k++) await wait(50);
    key(" ");
    out.paused = find("play").textContent;
    out.played = [picture(), find("moment").textContent];
    // Without repetition it stops at the end.
    find("loop").click();
    key("End");
    out.end = Number(find("time").value);
    key("ArrowLeft");
    key(" ");
    for (let k = 0; k < 100 && find("play").textContent === "Pause"; k++) await wait(50);
    out.stopped = [find("play").textContent, Number(find("time").value)];
    key("Home");
    out.home = Number(find("time").value);
    const controls = "#stage, .controls input, .controls select, canvas";
    out.turns = !find("view").hidden;
    out.labels = [...there.querySelectorAll(controls)].map(
      (one) => one.ariaLabel || one.closest("label")?.textContent.trim() || "",
    );
  }
  await wait(100);
  out.problems = own.problems;
  frame.remove();
  return out;
}

(async () => {
  for (const width of widths) found.push(await visit(width));
})()
  .catch((error) => found.push({ problems: [String(error)] }))
  .then(() => (document.body.textContent = `|||${encodeURIComponent(JSON.stringify(found))}|||`));
</script>
"""


def visit(path, folder):
    """What a browser found on the page, for each width."""
    page = path.read_text(encoding="utf-8").replace("<head>", f"<head>{WATCH}", 1)
    code = json.dumps(page).replace("<", "\\u003c")
    harness = folder / "harness.html"
    text = HARNESS.replace("WIDTHS", str(list(WIDTHS))).replace("PAGE", code, 1)
    harness.write_text(text, encoding="utf-8")
    done = subprocess.run(
        [
            BROWSER,
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            f"--user-data-dir={folder / 'profile'}",
            "--window-size=1400,1000",
            "--virtual-time-budget=20000",
            "--dump-dom",
            harness.as_uri(),
        ],
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=180,
        check=False,
    )
    found = re.search(r"\|\|\|([^$|]+)\|\|\|", done.stdout)
    assert found, done.stderr[-2000:]
    return json.loads(unquote(found[1]))


@pytest.fixture(scope="module")
def bending(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bending")
    bunch = make_bending(6, n_frames=40, random_state=0)
    pipe = make_pipeline(DirectionCosines(bunch.skeleton), ASpace(), DenseSynchronizer(31))
    path = write_report(folder / "report.html", pipe.fit(bunch.data), bunch.data, frame_rate=20)
    return visit(path, folder)


@pytest.fixture(scope="module")
def gait(tmp_path_factory):
    folder = tmp_path_factory.mktemp("gait")
    bunch = make_gait(8, 2, timing=8, random_state=0)
    trials = [pd.DataFrame(x, columns=bunch.feature_names) for x in bunch.data]
    for k, x in enumerate(trials):
        x.attrs["trial"] = f"Jürgen </script> {'long ' * 20}{k}"
    path = write_report(
        folder / "report.html",
        DenseSynchronizer(51).fit(trials),
        trials,
        y=[f"{'averylongnameofagroup' * 3}{g}" for g in bunch.group],
        groups=bunch.person,
    )
    return visit(path, folder)


@pytest.mark.parametrize("name", ["bending", "gait"])
@pytest.mark.parametrize("k", range(len(WIDTHS)))
def test_the_page_fits_its_width_and_has_no_problem(request, name, k):
    found = request.getfixturevalue(name)[k]
    assert found["problems"] == []
    assert abs(found["inner"] - WIDTHS[k]) < 20
    assert found["scroll"] <= found["inner"]
    assert len(found["images"]) >= 1
    assert min(found["images"]) > 800


def test_buttons_save_tables(gait, bending):
    for found in gait:
        assert set(found["files"]) == {
            f"{name}.csv" for name in ("trials", "timing", "aligned_curves", "clusters", "p_values")
        }
        lines = found["files"]["trials.csv"].splitlines()
        assert lines[0].startswith("\ufefftrial,group,person,frames,mean absolute offset (%)")
        assert "Jürgen </script>" in lines[1]
        assert len(lines) == 17
        assert len(found["files"]["timing.csv"].splitlines()) == 1 + 16 * 51
    assert "trials.csv" in bending[0]["files"]


@pytest.fixture(scope="module")
def players(tmp_path_factory):
    folder = tmp_path_factory.mktemp("players")
    path = folder / "player.html"
    found = {}
    bunch = make_bending(5, n_frames=40, random_state=0)
    pipe = make_pipeline(DirectionCosines(bunch.skeleton), DenseSynchronizer(31)).fit(bunch.data)
    # In seconds, as there is a frame rate.
    keyframes = pd.DataFrame({"down": [0.5, 0.6, 0.45, None, 0.55], "up": [1.5] * 5})
    given = {"match": pipe, "keyframes": keyframes, "frame_rate": 20}
    found["aligned"] = visit(write_player(path, bunch.data, bunch.skeleton, **given), folder)
    names = [f"joint{k}_{axis}" for k in range(15) for axis in "xy"]
    flat = [x.reshape(len(x), -1, 3)[..., :2].reshape(len(x), -1) for x in bunch.data[:2]]
    flat = [pd.DataFrame(x, columns=names) for x in flat]
    found["plane"] = visit(write_player(path, flat, None), folder)
    return found


def check_steps(found, steps):
    assert found["problems"] == []
    assert found["scroll"] <= found["inner"]
    assert found["colors"] > 2
    pictures = [found[step][0] for step in steps]
    assert len(set(pictures)) == len(steps)
    assert (found["playing"], found["paused"]) == ("Pause", "Play")
    assert found["stopped"] == ["Play", found["end"]]
    assert found["end"] > 0 == found["home"]
    assert all(found["labels"])


def test_the_player_draws_and_its_controls_work(bending):
    for found in bending:
        check_steps(
            found, ["start", "moved", "turned", "seen", "other", "recorded", "key", "played"]
        )
        assert found["start"][1].startswith("At 0 % of the pattern, trial ")
        assert found["moved"][1].startswith("At 50 % of the pattern, trial ")
        assert (found["count"], found["other"][2], found["shown"]) == (2, 3, "Trials: 3 of 6")
        assert found["recorded"][1].startswith("After ")
        assert " s, trial 0 is at " in found["recorded"][1]


def test_a_player_by_itself(players):
    for found in players["aligned"]:
        check_steps(found, ["start", "moved", "turned", "seen", "recorded", "key", "played"])
        assert (found["count"], found["frames"]) == (5, 31)
        assert found["moved"][1] == "At 50 % of the pattern."
        # Each at its own pace; one does not have the first key-frame.
        assert len(found["marks"]) == 4 + 5
        assert found["jumped"] == pytest.approx(sorted(found["jumped"]))
        assert all(min(abs(jump - at) for at in found["marks"]) < 0.03 for jump in found["jumped"])
    wide, phone = players["aligned"]
    assert (wide["columns"], wide["rows"]) in [(5, 1), (3, 2)]
    assert phone["columns"] <= 3
    assert phone["rows"] > 1


def test_points_in_a_plane_without_a_match(players):
    for found in players["plane"]:
        check_steps(found, ["start", "moved", "key", "played"])
        # There is no other side, and no other pace.
        assert not found["turns"]
        assert found["start"][1].startswith("At frame 0, trial 0 is at 0 %, and trial 1")
        assert found["marks"] == found["jumped"] == []
