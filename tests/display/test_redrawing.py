"""Saved pictures: the same pixels as whole drawings by matplotlib, at a fraction of its calls."""

import io
import struct
import zlib

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.animation import AbstractMovieWriter, FuncAnimation, PillowWriter
from matplotlib.offsetbox import AnchoredText
from PIL import Image
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ASpace, DirectionCosines, OnlineSynchronizer
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import PhaseDisplay, SkeletonDisplay
from sklearn_motionsync.display.animation import animate
from sklearn_motionsync.display.redrawing import as_png

BUNCH = make_bending(4, n_frames=40, random_state=0)


class Keeper(AbstractMovieWriter):
    """Keeps the pictures that it is given."""

    def setup(self, fig, outfile, dpi=None):
        self.fig, self.dpi, self.pictures = fig, dpi, []

    def grab_frame(self, **style):
        file = io.BytesIO()
        self.fig.savefig(file, format="rgba", dpi=self.dpi, **style)
        width, height = map(int, np.array(self.fig.get_size_inches()) * self.dpi + 1e-8)
        self.pictures.append(np.frombuffer(file.getvalue(), np.uint8).reshape(height, width, 4))

    def finish(self):
        pass


class Drawn:
    """A display on a figure of the test."""

    def __init__(self, figure):
        self.figure_ = figure

    def plot(self, ax, azimuth):
        return self


def animation_of(figure, show, n=6):
    return animate(Drawn(figure), show, None, seconds=n / 10, fps=10, azimuth=0)


def check(animation, figure, **given):
    """Our pictures are those that matplotlib saves; how often ours drew the whole figure."""
    fast, whole, drawn = Keeper(), Keeper(), []
    connection = figure.canvas.mpl_connect("draw_event", drawn.append)
    animation.save("x", fast, **given)
    figure.canvas.mpl_disconnect(connection)
    figure.set_layout_engine("none")
    FuncAnimation.save(animation, "x", whole, **given)
    assert len(fast.pictures) == len(whole.pictures) > 1
    for k, (a, b) in enumerate(zip(fast.pictures, whole.pictures, strict=True)):
        np.testing.assert_array_equal(a, b, err_msg=f"picture {k}")
    assert any((a != fast.pictures[0]).any() for a in fast.pictures)
    # The first time for the layout.
    return len(drawn) - 1


# -- displays -------------------------------------------------------------------------------


def test_bodies_side_by_side():
    display = SkeletonDisplay.from_performances(BUNCH.data, BUNCH.skeleton)
    layout = display.figure_.get_layout_engine()
    animation = display.animate(seconds=1, fps=10)
    animation.save("x", Keeper())
    assert display.figure_.get_layout_engine() is layout
    assert check(animation, display.figure_, dpi=70) == 1
    assert "savefig" not in vars(display.figure_)


def test_bodies_over_each_other_with_shadows_and_another_colour():
    x = [x.reshape(len(x), -1, 3) for x in BUNCH.data]
    display = SkeletonDisplay([x[:3], x[1:]], BUNCH.skeleton, ["a", "b"], behind=[x[:1], x[1:2]])
    animation = display.plot().animate(seconds=0.5, fps=10)
    given = {"savefig_kwargs": {"facecolor": "lightblue", "edgecolor": "red"}, "dpi": 50.5}
    assert check(animation, display.figure_, **given) == 1
    assert display.figure_.get_facecolor() == (1, 1, 1, 1)
    assert display.figure_.dpi == mpl.rcParams["figure.dpi"]


@pytest.mark.parametrize("cyclic", [False, True])
def test_running_performances(cyclic):
    cosines = make_pipeline(DirectionCosines(BUNCH.skeleton), ASpace())
    X = cosines.fit_transform(BUNCH.data)
    if cyclic:
        X = [np.concatenate([x, x[::-1]]) for x in X]
    live = OnlineSynchronizer(cyclic=cyclic).fit(X[:3])
    given = {} if cyclic else {"body": cosines, "training": X[:3]}
    display = PhaseDisplay.from_estimator(live, X[3:], features=[0, 1], **given)
    # Cycles move the time axes, whose limits change.
    assert check(display.animate(seconds=1, fps=8), display.figure_) <= (3 if cyclic else 1)


# -- what may stand in a figure ----------------------------------------------------------------


def test_what_lies_between_and_above():
    figure, (left, right) = plt.subplots(1, 2, figsize=(4, 2))
    x = np.linspace(0, 1, 20)
    left.plot(x, x, linewidth=9, alpha=0.5, zorder=1)
    (line,) = left.plot(x, x**2, linewidth=7, alpha=0.7, zorder=2)
    left.plot(x, 1 - x, linewidth=5, alpha=0.5, zorder=3)
    (dots,) = left.plot(x, x, "o", zorder=4)
    left.imshow(np.eye(3), extent=(0.3, 0.7, 0.3, 0.7), alpha=0.3, zorder=5, aspect="auto")
    left.text(0.5, 0.5, "in front", zorder=6, ha="center", alpha=0.8)
    left.add_artist(AnchoredText("box", "lower right"))
    area = right.fill_between(x, x, 0.2, alpha=0.4, clip_on=False)
    right.text(-0.4, 0.5, "over both", bbox={"facecolor": "white", "alpha": 0.5})
    right.legend([line, area], ["line", "area"])

    def show(k, last):
        line.set_ydata(x ** (1 + k))
        dots.set_alpha(0.5 if k > 2 else 1)
        area.set_alpha(0.2 + 0.1 * k)

    assert check(animation_of(figure, show), figure) == 1


def test_texts_that_change():
    figure, axes = plt.subplots(2, 2, figsize=(4, 3), layout="constrained")
    over, at = figure.suptitle("all"), figure.text(0.5, 0.5, "here")
    (line,) = axes[0, 0].plot([0, 1], label="one")
    legend = axes[0, 0].legend()

    def show(k, last):
        over.set_text(f"at {k}")
        at.set(x=k / 6, rotation=20 * k)
        axes[0, 1].set_title("gy\n" * (k % 3) + "x")
        legend.get_texts()[0].set_text("one" * k)
        axes[1, 0].set_xlabel(f"time {k}")
        axes[1, 1].set_title(f"{k}", loc="left")
        line.set_linewidth(k + 1)

    # The title becomes empty, or lower than the first one.
    assert check(animation_of(figure, show, 8), figure) <= 4


def test_titles_that_are_moved_up():
    figure, axes = plt.subplots(1, 3, figsize=(5, 2))
    axes[0].xaxis.tick_top()
    deep = r"$\frac{\frac{\frac{a}{b}}{c}}{\frac{c}{\frac{c}{d}}}$"
    axes[1].set_title("fixed", y=0.8)

    def show(k, last):
        axes[0].title.set_text(deep if k % 2 else f"{k}")
        axes[1].title.set_text(f"{k}")
        # The first of these reaches into the axes, but for moving it up.
        axes[2].title.set_text(deep if k in (4, 5, 9) else f"{k}")

    assert check(animation_of(figure, show, 12), figure) < 12


def test_axes_that_change_and_axes_in_space():
    figure = plt.figure(figsize=(6, 2))
    above, below = figure.subfigures(1, 2)
    plane, space = above.add_subplot(), below.add_subplot(projection="3d")
    twin, inset = plane.twinx(), plane.inset_axes([0.1, 0.6, 0.3, 0.3])
    (line,) = plane.plot([0, 1])
    twin.plot([1, 0], color="red")
    (third,) = inset.plot([0, 1])
    dots = space.scatter([0, 1, 2], [0, 1, 2], [0, 1, 0])
    (path,) = space.plot([0, 1], [0, 1], [0, 1])

    def show(k, last):
        line.set_ydata([0, k])
        twin.set_ylim(0, 5 if k > 4 else 1)
        third.set_ydata([0, k / 9])
        path.set_data_3d([0, k], [0, 1], [0, 1])
        dots.set_sizes([10 * k + 1])
        space.view_init(azim=40 if k > 6 else -60)

    assert check(animation_of(figure, show, 10), figure) == 2


def test_pictures_in_which_nothing_moves():
    figure, axis = plt.subplots(figsize=(2, 2))
    (line,) = axis.plot([0, 1])
    assert check(animation_of(figure, lambda k, last: line.set_alpha(1 - (k > 2) / 2)), figure) == 1


@pytest.mark.parametrize("what", ["new", "order", "hidden", "filter", "ticks"])
def test_what_changes_by_other_means(what):
    figure, axis = plt.subplots(figsize=(2, 2))
    lines = [axis.plot([0, k], [1, 0], linewidth=8)[0] for k in (1, 2)]
    if what == "filter":
        lines[0].set_agg_filter(lambda pixels, dpi: (pixels / 2, 0, 0))

    def show(k, last):
        lines[0].set_ydata([1, k / last])
        if what == "new":
            axis.collections[0].remove() if axis.collections else None
            axis.scatter([0.5], [k / last], color="black")
        elif what == "order":
            lines[0].set_zorder(1 + k % 3)
        elif what == "hidden":
            lines[1].set_visible(k % 2 == 1)
        elif what == "ticks":
            axis.set_xticks(np.arange(k) / 5)

    check(animation_of(figure, show, 12), figure)


def test_canvases_and_styles_that_are_left_to_matplotlib(tmp_path):
    figure, axis = plt.subplots(figsize=(2, 2))
    (line,) = axis.plot([0, 1])
    animation = animation_of(figure, lambda k, last: line.set_ydata([k / 9, 1]), 3)
    given = {"savefig_kwargs": {"transparent": True}}
    animation.save(tmp_path / "x.gif", "pillow", **given)
    FuncAnimation.save(animation, tmp_path / "y.gif", PillowWriter(10), **given)
    pixels = []
    for name in ("x", "y"):
        with Image.open(tmp_path / f"{name}.gif") as image:
            pixels.append(np.asarray(image.convert("RGBA"))[..., 3])
    np.testing.assert_array_equal(*pixels)
    seen = []
    other = FuncAnimation(figure, lambda k: axis.set_xlim(0, 1 + k), frames=3)
    animation.save(
        tmp_path / "x.gif",
        writer="pillow",
        extra_anim=[other],
        progress_callback=lambda k, n: seen.append((k, n)),
    )
    assert seen == [(k, 6) for k in range(6)]
    assert axis.get_xlim() == (0, 3)
    with pytest.raises(TypeError, match="dpi"):
        animation.save(tmp_path / "x.gif", "pillow", savefig_kwargs={"dpi": 3})
    with pytest.raises(RuntimeError, match="fps"):
        animation.save("x", Keeper(), fps=3)


# -- files -------------------------------------------------------------------------------------


@pytest.mark.parametrize("writer", ["pillow", "no such writer"])
def test_gifs_have_one_palette_and_the_colours_of_pillow(tmp_path, writer, caplog):
    display = SkeletonDisplay.from_performances(BUNCH.data, BUNCH.skeleton)
    animation = display.animate(seconds=1, fps=10)
    keeper = Keeper()
    animation.save("x", keeper, dpi=80)
    path = tmp_path / "x.gif"
    animation.save(path, writer, dpi=80, fps=5, metadata={"title": "x"})
    assert ("Pillow is used instead" in caplog.text) == (writer != "pillow")
    FuncAnimation.save(animation, tmp_path / "y.gif", PillowWriter(5), dpi=80)
    errors = {}
    for name in ("x", "y"):
        with Image.open(tmp_path / f"{name}.gif") as image:
            assert (image.n_frames, image.info["duration"]) == (10, 200)
            pixels = []
            for k in range(10):
                image.seek(k)
                pixels.append(np.asarray(image.convert("RGB")).astype(int))
        off = np.abs(np.array(pixels) - np.array(keeper.pictures)[..., :3])
        errors[name] = off.mean(), off.max()
        if name == "x":
            # The ground is as it was.
            is_white = (np.array(keeper.pictures)[..., :3] == 255).all(axis=-1)
            assert off[is_white].max() == 0
    assert errors["x"][0] < 1.2 * errors["y"][0]
    assert errors["x"][1] <= errors["y"][1]
    assert path.stat().st_size < 1.5 * (tmp_path / "y.gif").stat().st_size


def test_few_colours_are_exact(tmp_path):
    figure, axis = plt.subplots(figsize=(2, 2), layout="none")
    axis.set_position([0, 0, 1, 1])
    axis.axis("off")
    patch = axis.axvspan(0, 1, antialiased=False, color=(0.3, 0.7, 0.2))
    axis.set_xlim(0, 9)
    animation = animation_of(figure, lambda k, last: patch.set_x(k), 9)
    keeper = Keeper()
    animation.save("x", keeper)
    animation.save(tmp_path / "x.gif", "pillow")
    with Image.open(tmp_path / "x.gif") as image:
        for k, picture in enumerate(keeper.pictures):
            image.seek(k)
            np.testing.assert_array_equal(np.asarray(image.convert("RGB")), picture[..., :3])


@pytest.mark.parametrize("alpha", [255, 254])
def test_png_files(alpha):
    pixels = np.random.default_rng(0).integers(0, 256, (7, 5, 4)).astype(np.uint8)
    pixels[..., 3] = alpha
    data = as_png(pixels)
    with Image.open(io.BytesIO(data)) as image:
        assert image.mode == ("RGB" if alpha == 255 else "RGBA")
        np.testing.assert_array_equal(np.asarray(image.convert("RGBA")), pixels)
    length, name = struct.unpack(">I4s", data[8:16])
    assert (length, name) == (13, b"IHDR")
    assert struct.unpack(">I", data[29:33])[0] == zlib.crc32(data[12:29])
