"""Time a picture of saved animations, beside matplotlib's own: the table of docs/speed.md.

Both save the same animation in turns, in one process on one thread. The layout is fixed for both.
Without a writer pictures are only drawn. Differences between long and short animations leave out
what comes once. Where ffmpeg is not installed its rows are left out. Takes two minutes.

    OMP_NUM_THREADS=1 python benchmarks/animation.py [rounds]
"""

import io
import shutil
import sys
import tempfile
import time
import warnings
from contextlib import contextmanager, nullcontext
from pathlib import Path

import matplotlib as mpl

mpl.use("agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import AbstractMovieWriter, PillowWriter
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines, OnlineSynchronizer
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import PhaseDisplay, SkeletonDisplay, animation

# Pictures of a short and of a long animation.
SHORT, LONG = 10, 70
WRITERS = {"none": None, "ffmpeg": "x.mp4", "pillow": "x.gif", "notebook": None}


class Sink(AbstractMovieWriter):
    """Has pictures drawn, and forgets them."""

    def setup(self, fig, outfile, dpi=None):
        self.fig, self.dpi = fig, dpi

    def grab_frame(self, **style):
        self.fig.savefig(io.BytesIO(), format="rgba", dpi=self.dpi, **style)

    def finish(self):
        pass


def displays():
    bunch = make_bending(8, random_state=0)
    yield "one body", SkeletonDisplay.from_performances(bunch.data[:1], bunch.skeleton)
    yield "five bodies", SkeletonDisplay.from_performances(bunch.data[:5], bunch.skeleton)
    pipe = make_pipeline(DirectionCosines(bunch.skeleton), DenseSynchronizer(51)).fit(bunch.data)
    yield "six, twice", SkeletonDisplay.from_estimator(pipe, bunch.data)
    cosines = make_pipeline(DirectionCosines(bunch.skeleton), ASpace())
    X = cosines.fit_transform(bunch.data)
    live = OnlineSynchronizer().fit(X[:6])
    yield "two phases", PhaseDisplay.from_estimator(live, X[6:])
    given = {"body": cosines, "training": X[:6]}
    yield "phase and body", PhaseDisplay.from_estimator(live, X[6:7], **given)


@contextmanager
def by_matplotlib():
    """Whole drawings, and the writer of Pillow as it is."""
    ours = animation.Redrawing, animation.gif_writer
    animation.Redrawing = nullcontext
    animation.gif_writer = PillowWriter
    try:
        yield
    finally:
        animation.Redrawing, animation.gif_writer = ours


def seconds(display, writer, count, folder):
    """The time to save pictures."""
    made = display.animate(seconds=count / 10, fps=10)
    start = time.perf_counter()
    if writer == "notebook":
        made.to_jshtml()
    else:
        target = Sink() if writer == "none" else writer
        made.save(folder / (WRITERS[writer] or "x"), target)
    return time.perf_counter() - start


def a_picture(display, writer, folder):
    """Milliseconds a picture."""
    short, long = (seconds(display, writer, count, folder) for count in (SHORT, LONG))
    return 1000 * (long - short) / (LONG - SHORT)


def compare(rounds, writers, folder):
    """A row a display and writer: the medians of both and of their ratio, and what comes once."""
    rows = []
    for name, display in displays():
        for writer in writers:
            ours, whole = [], []
            for _ in range(rounds):
                ours.append(a_picture(display, writer, folder))
                with by_matplotlib():
                    whole.append(a_picture(display, writer, folder))
            ratio = np.median(np.array(whole) / ours)
            rows.append((name, writer, np.median(whole), np.median(ours), ratio))
        plt.close("all")
    return rows


def main(rounds=5):
    writers = [w for w in WRITERS if w != "ffmpeg" or shutil.which("ffmpeg")]
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        rows = compare(int(rounds), writers, Path(folder))
    print("| display | writer | whole drawings, ms | save, ms | ratio |\n|---|---|---|---|---|")
    for name, writer, whole, ours, ratio in rows:
        print(f"| {name} | {writer} | {whole:.1f} | {ours:.2f} | {ratio:.1f} |")


if __name__ == "__main__":
    main(*sys.argv[1:])
