"""Animations that a notebook plays without further ado."""

import re

from .drawing import pyplot

__all__ = ["playable"]

# Resolution of moving pictures: every one of them is kept in the notebook.
_DPI = 64


def playable(figure, show, count, fps, *, closes):
    """An animation of a figure, which a notebook plays as the last value of a cell.

    Parameters
    ----------
    figure : Figure
    show : callable
        ``show(k)`` draws picture k, of ``count``, and returns its artists.
    count : int
    fps : float
        Pictures a second.
    closes : bool
        Whether the figure is closed once it plays; else the notebook shows it once more, standing
        still.

    Returns
    -------
    FuncAnimation
    """
    from matplotlib.animation import FuncAnimation

    # Known beforehand: nothing is imported any more while Python ends.
    still_there = pyplot().fignum_exists

    class Playable(FuncAnimation):
        """Its places stay, its pictures are small, and it fetches nothing."""

        def to_jshtml(self, *args, **kwargs):
            # To find the places of the panels costs more than to draw; and while they may be
            # sought, every picture is drawn twice.
            layout = figure.get_layout_engine()
            figure.draw_without_rendering()
            figure.get_layout_engine = _nothing
            # Pictures are saved; drawn on the canvas before, they would take twice as long.
            figure.canvas.draw_idle = _nothing
            try:
                with pyplot().rc_context({"savefig.dpi": _DPI}):
                    return with_own_buttons(super().to_jshtml(*args, **kwargs))
            finally:
                del figure.canvas.draw_idle, figure.get_layout_engine
                figure.set_layout_engine(layout)

        def __del__(self):
            # Who has closed the figure does not wait for it.
            if still_there(getattr(figure, "number", None)):
                super().__del__()

        def _repr_html_(self):
            html = self.to_jshtml()
            if closes:
                pyplot().close(figure)
            return html

    return Playable(figure, show, frames=count, interval=1000 / fps, blit=False)


def _nothing(*args, **kwargs):
    """Draw nothing."""


# -- buttons of a player of animations that are drawn without a network ------------------

# Outlines of the pictures on the buttons, on 14 by 12 units, by Matplotlib's names of them.
_OUTLINES = {
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
_FETCHED = re.compile(r"<link[^>]*font-awesome[^>]*>")
_ICON = re.compile(r'<i class="fa fa-([^"]*)"></i>')


def _draw(icon):
    outline = _OUTLINES.get(icon[1])
    if outline is None:
        return icon[0]
    # The size is said in style as well: style sheets of notebooks stretch pictures.
    return (
        '<svg viewBox="0 0 14 12" width="14" height="12" style="width: 14px; height: 12px" '
        f'aria-hidden="true"><path fill="currentColor" d="{outline}"/></svg>'
    )


def with_own_buttons(html):
    """Matplotlib's player, which fetches a font for its buttons, with pictures of its own instead.

    >>> with_own_buttons('<i class="fa fa-play"></i>')[:40]
    '<svg viewBox="0 0 14 12" width="14" heig'
    """
    return _ICON.sub(_draw, _FETCHED.sub("", html))
