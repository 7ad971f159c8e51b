"""The page of a report in a browser: its player, its files, its widths, and that nothing fails."""

import json
import re
import shutil
import subprocess
from urllib.parse import unquote

import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines, write_report
from sklearn_motionsync.datasets import make_bending, make_gait

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

  if (find("stage")) {
    const picture = () => find("stage").toDataURL();
    const change = (id, value, kind) => {
      find(id).value = value;
      find(id).dispatchEvent(new own.Event(kind));
      return [picture(), find("moment").textContent];
    };
    const pen = find("stage").getContext("2d");
    const pixels = pen.getImageData(0, 0, find("stage").width, find("stage").height).data;
    out.colors = new Set(new Uint32Array(pixels.buffer)).size;
    out.start = [picture(), find("moment").textContent];
    out.moved = change("time", 500, "input");
    out.turned = change("turn", 90, "input");
    out.other = change("left", 4, "change");
    const recorded = there.querySelector("input[value=recorded]");
    recorded.click();
    out.recorded = [picture(), find("moment").textContent];
    const key = (name) =>
      find("stage").dispatchEvent(new own.KeyboardEvent("keydown", { key: name }));
    key("ArrowRight");
    out.key = [picture(), find("moment").textContent];
    find("play").click();
    out.playing = find("play").textContent;
    for (let k = 0; k < 100 && picture() === out.key[0]; k++) await wait(50);
    key(" ");
    out.paused = find("play").textContent;
    out.played = [picture(), find("moment").textContent];
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
    pipe = make_pipeline(DirectionCosines(bunch.skeleton), ASpace(), DenseSynchronizer(30))
    path = write_report(folder / "report.html", pipe.fit(bunch.data), bunch.data, frame_rate=20)
    return visit(path, folder)


@pytest.fixture(scope="module")
def gait(tmp_path_factory):
    folder = tmp_path_factory.mktemp("gait")
    bunch = make_gait(8, 2, timing=8, random_state=0)
    trials = [pd.DataFrame(x, columns=bunch.feature_names) for x in bunch.data]
    for k, x in enumerate(trials):
        x.attrs["performance"] = f"Jürgen </script> {'long ' * 20}{k}"
    path = write_report(
        folder / "report.html",
        DenseSynchronizer(51).fit(trials),
        trials,
        groups=[f"{'averylongnameofagroup' * 3}{g}" for g in bunch.group],
        people=bunch.person,
    )
    return visit(path, folder)


@pytest.mark.parametrize("name", ["bending", "gait"])
@pytest.mark.parametrize("k", range(len(WIDTHS)))
def test_the_page_fits_its_width_and_has_no_problem(request, name, k):
    found = request.getfixturevalue(name)[k]
    assert found["problems"] == []
    assert abs(found["inner"] - WIDTHS[k]) < 20
    assert found["scroll"] <= found["inner"]
    assert len(found["images"]) >= 2
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


def test_the_player_draws_and_its_controls_work(bending):
    for found in bending:
        assert found["colors"] > 4
        steps = ["start", "moved", "turned", "other", "recorded", "key", "played"]
        pictures = [found[step][0] for step in steps]
        assert len(set(pictures)) == len(steps)
        assert found["start"][1].startswith("At 0 % of the template, trial ")
        assert found["moved"][1].startswith("At 50 % of the template, trial ")
        assert found["recorded"][1].startswith("After ")
        assert " s, trial 4 is at " in found["recorded"][1]
        assert (found["playing"], found["paused"]) == ("Pause", "Play")
