"""Animations that a notebook plays without further ado."""

from .drawing import pyplot
from .player import with_own_buttons

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
