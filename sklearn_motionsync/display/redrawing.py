"""Pictures of one figure after the other: what stays is drawn once, what changes each time."""

import struct
import zlib
from numbers import Real
from typing import Any, NamedTuple

import numpy as np

__all__ = ["Redrawing", "as_png"]

# How a renderer is asked to draw. All but these is bookkeeping.
_CALLS = (
    "draw_path",
    "draw_markers",
    "draw_path_collection",
    "draw_quad_mesh",
    "draw_gouraud_triangles",
    "draw_image",
    "draw_text",
    "draw_tex",
)
# Arguments of savefig that the pictures are drawn with; others go the ordinary way.
_KNOWN = {"facecolor", "edgecolor", "transparent"}
_FORMATS = {"rgba", "raw", "png"}
# Whole figures that are drawn at most, and beyond that one of so many pictures; then the figure
# changes too much.
_MOST_WHOLE, _ONE_OF = 4, 4
# Of PNG: the filter that takes the line above off, and the effort of the compression.
_UP, _LEVEL = 2, 3


class Redrawing:
    """Replaces ``figure.savefig`` for a while by one that draws only what changed.

    The first picture is drawn as a whole, and what the renderer is told to draw is noted, artist by
    artist. Later pictures begin with a copy of all that stays. What changed since the last picture
    is known from ``Artist.stale``. These artists are drawn again in the order of the figure,
    together with what lies over them. The pixels are those of a whole drawing. Layouts must not
    change meanwhile.

    Axes whose limits or place change are drawn as a whole, as are axes with a method ``draw`` of
    their own, such as those in space. Where a figure gets other artists, all is drawn. Vector
    formats, transparent pictures, filters, and canvases other than Agg are left to the figure.

    Parameters
    ----------
    figure : Figure
    """

    def __init__(self, figure):
        self._figure = figure
        # Artists and axes that have changed at any time, by id.
        self._moving, self._whole = {}, {}
        self._noted = self._key = self._renderer = None
        self._n_whole = self._n_pictures = 0
        self._is_ordinary, self._before = False, None

    def __enter__(self):
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        canvas = self._figure.canvas
        one = isinstance(canvas, FigureCanvasAgg) and canvas.device_pixel_ratio == 1
        self._is_ordinary = not one
        self._ordinary = self._figure.savefig
        self._figure.savefig = self._savefig
        return self

    def __exit__(self, *error):
        del self._figure.savefig
        self._restore()
        # Screens do not show what was drawn here.
        self._figure.stale = True

    def _restore(self):
        """Give the figure its own resolution and colours."""
        if self._before is not None:
            self._figure.set(**self._before)
        self._before = self._key = self._noted = None

    def _savefig(self, file, *, format=None, dpi=None, **style):
        """Write a picture as ``Figure.savefig`` does."""
        picture = None
        if self._takes(file, format, dpi, style):
            picture = self._draw(dpi, style)
        if picture is None:
            self._restore()
            return self._ordinary(file, format=format, dpi=dpi, **style)
        file.write(as_png(picture) if format == "png" else picture.data)
        return None

    def _takes(self, file, format, dpi, style):
        from matplotlib import rcParams

        transparent = style.get("transparent", rcParams["savefig.transparent"])
        return not (
            self._is_ordinary
            or format not in _FORMATS
            or not isinstance(dpi, Real)
            or not hasattr(file, "write")
            or set(style) - _KNOWN
            or transparent
            or rcParams["savefig.bbox"] is not None
        )

    # -- one picture -----------------------------------------------------------------------

    def _draw(self, dpi, style):
        """The pixels of the figure, (height, width, 4); None if the figure must draw itself."""
        self._begin(dpi, style)
        self._n_pictures += 1
        noted = self._noted
        if noted is None or not self._follow(noted):
            self._n_whole += 1
            if self._n_whole > _MOST_WHOLE + self._n_pictures // _ONE_OF:
                self._is_ordinary = True
                return None
            noted = self._noted = Noted.draw(self._figure, self._renderer, self._whole)
            if noted is None:
                self._is_ordinary = True
                return None
        else:
            noted.draw_again(self._renderer)
        return np.asarray(self._renderer.buffer_rgba())

    def _begin(self, dpi, style):
        """Give the figure the resolution and the colours of the pictures, and a renderer."""
        from matplotlib import rcParams
        from matplotlib.backends.backend_agg import RendererAgg

        figure = self._figure
        colors = {}
        for name in ("facecolor", "edgecolor"):
            color = style.get(name, rcParams[f"savefig.{name}"])
            colors[name] = color if isinstance(color, str) else tuple(color)
        key = dpi, *figure.get_size_inches(), *colors.values()
        if key == self._key:
            return
        colors = {name: color for name, color in colors.items() if color != "auto"}
        if self._before is None:
            self._before = {
                "dpi": figure.dpi,
                "facecolor": figure.get_facecolor(),
                "edgecolor": figure.get_edgecolor(),
            }
        figure.set(**(self._before | {"dpi": dpi} | colors))
        self._key, self._noted = key, None
        self._renderer = RendererAgg(*figure.bbox.size, dpi)

    def _follow(self, noted):
        """Take over what has changed; False if the whole figure must be drawn."""
        if not noted.has_same_artists():
            return False
        other = noted.axes_that_changed()
        if other:
            self._whole |= {id(axis): axis for axis in other}
            return False
        changed = noted.changed()
        if any(unit.artist.get_zorder() != unit.zorder for unit in changed):
            return False
        self._moving |= {id(unit.artist): unit.artist for unit in changed}
        moving = [unit for unit in noted.units if id(unit.artist) in self._moving]
        boxes = {}
        for unit in moving if noted.reaches is None else changed:
            boxes[id(unit.artist)], bottom = unit.place(self._renderer)
            # Where a title is lower than before the axes may move it up.
            if bottom is not None and bottom < unit.bottom:
                if unit.bottom == np.inf:
                    self._whole[id(unit.artist.axes)] = unit.artist.axes
                return False
        noted.separate(boxes, self._renderer)
        return True


class Noted:
    """A figure as it was drawn, and how to draw it again.

    Attributes
    ----------
    reaches : dict or None
        Of each artist that moves, by id, the box that it stays within; None before `separate`.

    Parameters
    ----------
    units : list of DrawnArtist
        In the order in which they were drawn.
    axes : list of (Axes, tuple)
        The axes of which the artists are units, with their state.
    containers : list of (Artist, list)
        What holds the units, with its children.
    figure : Figure
    """

    def __init__(self, units, axes, containers, figure):
        self.units, self._axes, self._containers, self._figure = units, axes, containers, figure
        self.artists = [(artist, unit) for unit in units for artist in unit.artists]
        self.reaches = self._steps = self._below = self._ground = self._scratch = None
        self._inks = {}

    @classmethod
    def draw(cls, figure, renderer, whole):
        """Draw a figure and note how; None if that cannot be repeated.

        Parameters
        ----------
        figure : Figure
        renderer : RendererAgg
        whole : dict
            Axes by id that are one unit each.
        """
        artists, axes, containers = _split(figure, whole)
        log = Log(renderer)
        renderer.clear()
        with log.of(artists):
            figure.draw(renderer)
        if log.is_incomplete:
            return None
        titles = {id(title): title for axis in axes for title in _titles(axis)}
        units = []
        for artist, calls in log.drawn:
            bottom = _bottom_of(artist, renderer) if id(artist) in titles else None
            units.append(DrawnArtist(artist, calls, artist.get_zorder(), artist.findobj(), bottom))
        noted = cls(units, [(axis, _state_of(axis)) for axis in axes], containers, figure)
        for artist, _ in noted.artists:
            artist.stale = False
        return noted

    def has_same_artists(self):
        """Whether nothing was added, removed or put in another order."""
        for container, children in self._containers:
            now = container.get_children()
            if len(now) != len(children) or any(map(_differ, now, children)):
                return False
        return True

    def axes_that_changed(self):
        """Axes that have other limits or another place."""
        return [axis for axis, state in self._axes if _state_of(axis) != state]

    def changed(self):
        """The units that are stale."""
        stale = {}
        for artist, unit in self.artists:
            if artist.stale:
                artist.stale = False
                stale[id(unit)] = unit
        return list(stale.values())

    def separate(self, boxes, renderer):
        """Draw what stays beneath all that moves, and list what is drawn each time.

        Parameters
        ----------
        boxes : dict
            Of each artist that has changed, by id, the box that it is within; None if it is empty.
        """
        reaches = self.reaches or {}
        if self.reaches is not None and all(
            key in reaches and _is_within(box, reaches[key]) for key, box in boxes.items()
        ):
            return
        wider = {key: _union(box, reaches.get(key)) for key, box in boxes.items()}
        self.reaches, self._steps, covers, below = reaches | wider, [], [], []
        for unit in self.units:
            if id(unit.artist) in self.reaches:
                self._steps.append(unit.artist.draw)
                covers.append(self.reaches[id(unit.artist)])
                continue
            ink = self._ink(unit.calls, renderer) if covers and unit.calls else None
            if not any(_meet(ink, box) for box in covers):
                below += unit.calls
                continue
            for call in unit.calls:
                ink = self._ink([call], renderer)
                if any(_meet(ink, box) for box in covers):
                    self._steps.append(call.repeat)
                    covers.append(ink)
                else:
                    below.append(call)
        # Mostly a text has grown over nothing else.
        if below != self._below:
            self._below = below
            renderer.clear()
            for call in below:
                call.repeat(renderer)
            self._ground = renderer.copy_from_bbox(self._figure.bbox)

    def draw_again(self, renderer):
        """Draw the figure as it is now."""
        renderer.restore_region(self._ground)
        for step in self._steps:
            step(renderer)

    def _ink(self, calls, renderer):
        """The box that calls draw in; None if they draw nothing."""
        key = tuple(map(id, calls))
        if key not in self._inks:
            if self._scratch is None:
                self._scratch = type(renderer)(renderer.width, renderer.height, renderer.dpi)
            self._scratch.clear()
            for call in calls:
                call.repeat(self._scratch)
            drawn = np.asarray(self._scratch.buffer_rgba())[..., 3] > 0
            rows, columns = (np.flatnonzero(drawn.any(axis=axis)) for axis in (1, 0))
            box = None
            if len(rows):
                top, bottom = (len(drawn) - k for k in (rows[0], rows[-1] + 1))
                box = float(columns[0]), float(bottom), columns[-1] + 1.0, float(top)
            self._inks[key] = box
        return self._inks[key]


class DrawnArtist(NamedTuple):
    """An artist that is drawn as a whole.

    Attributes
    ----------
    artist : Artist
    calls : list of Call
        What the renderer was told.
    zorder : float
    artists : list of Artist
        The artist and all within it.
    bottom : float or None
        Of a title, its lower edge; infinite if it is empty or not right above the axes.
    """

    artist: Any
    calls: list
    zorder: float
    artists: list
    bottom: float | None

    def place(self, renderer):
        """The box that the artist stays within, None for an empty one, and a title's lower edge."""
        from matplotlib.text import Text

        artist, everything = self.artist, (0.0, 0.0, float(renderer.width), float(renderer.height))
        if type(artist) is Text:
            if not artist.get_visible() or not artist.get_text():
                return None, None
            box = artist.get_window_extent(renderer).extents
            bottom = None if self.bottom is None else box[1]
            if artist.get_bbox_patch() is not None or artist.get_path_effects():
                return everything, bottom
            # Letters lean out of their box by less than their size.
            return _padded(box, renderer.points_to_pixels(artist.get_size())), bottom
        box = artist.get_clip_box() if artist.get_clip_on() else None
        return everything if box is None else _padded(box.extents, 1), None


class Call:
    """One call of a renderer, which can be repeated."""

    def __init__(self, name, args, kwargs, renderer):
        from matplotlib.backend_bases import GraphicsContextBase
        from matplotlib.transforms import TransformNode

        def keep(value):
            # What the artist goes on to change.
            if isinstance(value, GraphicsContextBase):
                copy = renderer.new_gc()
                copy.copy_properties(value)
                return copy
            return value.frozen() if isinstance(value, TransformNode) else value

        self._name = name
        self._args = [keep(value) for value in args]
        self._kwargs = {key: keep(value) for key, value in kwargs.items()}

    def repeat(self, renderer):
        getattr(renderer, self._name)(*self._args, **self._kwargs)


class Log:
    """What a renderer is told to draw, artist by artist.

    Attributes
    ----------
    drawn : list of (Artist, list of Call)
    is_incomplete : bool
        Whether something was drawn with a filter, or by none of the artists.
    """

    def __init__(self, renderer):
        self._renderer, self._is_within, self._current = renderer, False, None
        self.drawn, self.is_incomplete = [], False

    def of(self, artists):
        """A context in which the drawing of artists is noted."""
        from contextlib import ExitStack

        stack = ExitStack()
        for name in _CALLS:
            _replace(stack, self._renderer, name, self._noting(name))
        _replace(stack, self._renderer, "start_filter", self._filtering())
        for artist in artists:
            _replace(stack, artist, "draw", self._drawing(artist))
        return stack

    def _noting(self, name):
        original = getattr(self._renderer, name)

        def note(*args, **kwargs):
            # Text may be drawn by other calls.
            outermost, self._is_within = not self._is_within, True
            try:
                if outermost and self._current is None:
                    self.is_incomplete = True
                elif outermost:
                    self._current.append(Call(name, args, kwargs, self._renderer))
                return original(*args, **kwargs)
            finally:
                self._is_within = not outermost

        return note

    def _filtering(self):
        original = self._renderer.start_filter

        def start():
            self.is_incomplete = True
            return original()

        return start

    def _drawing(self, artist):
        original = artist.draw

        def draw(*args, **kwargs):
            outer = self._current
            if outer is None:
                self._current = []
                self.drawn.append((artist, self._current))
            try:
                return original(*args, **kwargs)
            finally:
                self._current = outer

        return draw


def _replace(stack, thing, name, function):
    """Replace a method of an object until the stack is closed."""
    before = vars(thing).get(name)
    setattr(thing, name, function)
    if before is None:
        stack.callback(delattr, thing, name)
    else:
        stack.callback(setattr, thing, name, before)


def _split(figure, whole):
    """The artists that are drawn by themselves, the axes that hold them, and all containers."""
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

    artists, axes, containers, waiting = [], [], [], [figure]
    while waiting:
        container = waiting.pop()
        children = container.get_children()
        containers.append((container, children))
        for child in children:
            plain = isinstance(child, Axes) and type(child).draw is Axes.draw
            plain = plain and "draw" not in vars(child) and id(child) not in whole
            if plain:
                axes.append(child)
            if plain or isinstance(child, FigureBase):
                waiting.append(child)
            else:
                artists.append(child)
    return artists, axes, containers


def _titles(axis):
    """The titles on the left, in the middle and on the right."""
    from matplotlib.text import Text

    texts = set(map(id, axis.texts))
    return [a for a in axis.get_children() if isinstance(a, Text) and id(a) not in texts]


def _bottom_of(title, renderer):
    """The lower edge of a title; infinite if it is empty or not right above the axes."""
    if not title.get_text() or title.get_position()[1] != 1:
        return np.inf
    return title.get_window_extent(renderer).y0


def _state_of(axis):
    """What the place of all that is in axes depends on."""
    return (
        *axis.viewLim.extents,
        *axis.bbox.extents,
        axis.get_xscale(),
        axis.get_yscale(),
        axis.get_visible(),
        axis.get_zorder(),
        axis.axison,
        axis.get_frame_on(),
    )


def _differ(one, other):
    return one is not other


def as_png(picture):
    """A picture as the bytes of a PNG file.

    Lines as differences from the line above suit figures. Pillow tries other filters, too, takes
    three times as long, and its files are no smaller.

    Parameters
    ----------
    picture : ndarray of uint8, shape (height, width, 4)
    """
    height, width = picture.shape[:2]
    n_values = 3 if picture[..., 3].min() == 255 else 4
    values = picture[..., :n_values].reshape(height, -1)
    lines = np.full((height, 1 + values.shape[1]), _UP, dtype=np.uint8)
    lines[0, 1:] = values[0]
    np.subtract(values[1:], values[:-1], out=lines[1:, 1:])
    # Eight bits a value, with or without transparency.
    header = struct.pack(">IIBBBBB", width, height, 8, 2 if n_values == 3 else 6, 0, 0, 0)
    chunks = {b"IHDR": header, b"IDAT": zlib.compress(lines, _LEVEL), b"IEND": b""}
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        for name, data in chunks.items()
    )


# -- boxes (left, lower, right, upper) in pixels, None for an empty one ------------------------


def _padded(box, margin):
    return box[0] - margin, box[1] - margin, box[2] + margin, box[3] + margin


def _meet(a, b):
    if a is None or b is None:
        return False
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _is_within(a, b):
    if a is None or b is None:
        return a is None
    return a[0] >= b[0] and a[1] >= b[1] and a[2] <= b[2] and a[3] <= b[3]


def _union(a, b):
    if a is None or b is None:
        return a if b is None else b
    return min(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), max(a[3], b[3])
