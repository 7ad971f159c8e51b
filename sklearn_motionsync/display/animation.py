"""Displays that move, and their animations, which a notebook plays without a network."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from ..matching.counting import whole
from .base import AxesLike, Display, pyplot

if TYPE_CHECKING:
    from matplotlib.animation import Animation
else:
    # matplotlib is imported on drawing.
    Animation = Any

# Resolution of the pictures: the notebook stores all of them.
_DPI = 64
# The largest number of pictures: about half an hour at 15 a second.
_MAX_PICTURES = 25_000


class MovingDisplay(Display):
    """The base of displays that move: `_show` moves what is drawn to a share of the time."""

    def animate(
        self,
        ax: AxesLike | None = None,
        *,
        seconds: float = 5.0,
        fps: int = 15,
    ) -> Animation:
        """Animate the trials.

        Parameters
        ----------
        ax : Axes or array-like of Axes, default=None
            As for `plot`; by default the axes of the last plot. Then the figure is closed after the
            notebook has shown the animation.
        seconds : float, default=5.0
            The time until the longest trial ends.
        fps : int, default=15
            Pictures a second; each takes 10 to 50 kB of a notebook.

        Returns
        -------
        Animation
            A notebook plays it as the last value of a cell; ``to_jshtml()`` gives the HTML,
            ``save(path)`` a GIF or a video, for which Matplotlib draws the whole figure picture by
            picture. `write_player` is the fast way to moving bodies, and its file is smaller.
        """
        if not (0 < seconds < np.inf and 0 < fps < np.inf):
            raise ValueError(f"seconds and fps must be above 0, got {seconds!r} and {fps!r}.")
        if seconds * fps > _MAX_PICTURES:
            raise ValueError(
                f"seconds={seconds!r} at fps={fps!r} are {seconds * fps:.3g} pictures, more than "
                f"{_MAX_PICTURES}; choose fewer."
            )
        self.plot(getattr(self, "axes_", None) if ax is None else ax)
        count = max(2, whole(seconds * fps))
        return _animate(self.figure_.canvas.figure, self._show, count, fps, closes=ax is None)

    def _show(self, share):
        """Move to a share of the time from 0 to 1."""
        raise NotImplementedError


def _animate(figure, show, count, fps, *, closes):
    """An animation of a figure that computes its layout once and needs no network."""
    from matplotlib.animation import FuncAnimation

    class NotebookAnimation(FuncAnimation):
        def save(self, *args, **kwargs):
            # The layout takes longer than the drawing, and each picture would repeat it. And
            # drawing a picture on the canvas before it is saved would double the time.
            layout = figure.get_layout_engine()
            figure.draw_without_rendering()
            figure.get_layout_engine = figure.canvas.draw_idle = lambda: None
            try:
                super().save(*args, **kwargs)
            finally:
                del figure.canvas.draw_idle, figure.get_layout_engine
                figure.set_layout_engine(layout)

        def to_jshtml(self, *args, **kwargs):
            with pyplot().rc_context({"savefig.dpi": _DPI}):
                return embed_buttons(super().to_jshtml(*args, **kwargs))

        def __del__(self):
            """Without the warning of Matplotlib that the animation was not shown."""

        def _repr_html_(self):
            html = self.to_jshtml()
            if closes:
                pyplot().close(figure)
            return html

    return NotebookAnimation(
        figure, lambda k: show(k / (count - 1)), frames=count, interval=1000 / fps, blit=False
    )


# -- the buttons of the player -----------------------------------------------------------

# SVG paths of the icons in a box of 14 by 12, by Matplotlib's names.
_ICON_PATHS = {
    "minus": "M1 5h12v2H1z",
    "fast-backward": "M0 0h2v12H0zM8 0v12L2 6zM14 0v12L8 6z",
    "step-backward": "M1 0h3v12H1zM13 0v12L5 6z",
    "play fa-flip-horizontal": "M12 0v12L2 6z",
    "pause": "M2 0h4v12H2zM8 0h4v12H8z",
    "play": "M2 0l10 6-10 6z",
    "step-forward": "M1 0l8 6-8 6zM10 0h3v12h-3z",
    "fast-forward": "M0 0l6 6-6 6zM6 0l6 6-6 6zM12 0h2v12h-2z",
    "plus": "M1 5h5V0h2v5h5v2H8v5H6V7H1z",
}
_FONT_LINK = re.compile(r"<link[^>]*font-awesome[^>]*>")


def embed_buttons(html):
    """Matplotlib's player with its icon font, which it downloads, replaced by SVG icons.

    >>> embed_buttons('<i class="fa fa-play"></i>')[:40]
    '<svg viewBox="0 0 14 12" width="14" heig'
    """
    html = _FONT_LINK.sub("", html)
    for name, path in _ICON_PATHS.items():
        # The style repeats the size: style sheets of notebooks stretch pictures.
        picture = (
            '<svg viewBox="0 0 14 12" width="14" height="12" style="width: 14px; height: 12px" '
            f'aria-hidden="true"><path fill="currentColor" d="{path}"/></svg>'
        )
        html = html.replace(f'<i class="fa fa-{name}"></i>', picture)
    return html
