"""Displays that move, and their animations, which a notebook plays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..matching.counting import whole
from .base import Display, pyplot

if TYPE_CHECKING:
    from matplotlib.animation import Animation
else:
    # matplotlib is imported on drawing.
    Animation = Any

# Resolution of the pictures: the notebook stores all of them.
_DPI = 64


class MovingDisplay(Display):
    """The base of displays that move: `_show` moves what is drawn to a share of the time."""

    def animate(self, *, seconds: float = 5.0, fps: int = 15) -> Animation:
        """Animate the trials on the axes of the last plot.

        Parameters
        ----------
        seconds : float, default=5.0
            The time until the longest trial ends.
        fps : int, default=15
            Pictures a second; each takes 10 to 50 kB of a notebook.

        Returns
        -------
        Animation
            A notebook plays it as the last value of a cell, and closes the figure;
            ``to_jshtml()`` gives the HTML, ``save(path)`` a GIF or a video, for which Matplotlib
            draws the whole figure picture by picture. `write_player` is the fast way to moving
            bodies, and its file is smaller and needs no network.
        """
        if not (0 < seconds < np.inf and 0 < fps < np.inf):
            raise ValueError(f"seconds and fps must be above 0, got {seconds!r} and {fps!r}.")
        self.plot(self.axes_)
        count = max(2, whole(seconds * fps))
        return _animate(self.figure_.canvas.figure, self._show, count, fps)

    def _show(self, share):
        """Move to a share of the time from 0 to 1."""
        raise NotImplementedError


def _animate(figure, show, count, fps):
    """An animation of a figure that computes its layout once."""
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
                return super().to_jshtml(*args, **kwargs)

        def __del__(self):
            """Without the warning of Matplotlib that the animation was not shown."""

        def _repr_html_(self):
            html = self.to_jshtml()
            pyplot().close(figure)
            return html

    return NotebookAnimation(
        figure, lambda k: show(k / (count - 1)), frames=count, interval=1000 / fps, blit=False
    )
