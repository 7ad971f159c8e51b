"""Buttons of a player of animations that are drawn without a network."""

import re

__all__ = ["with_own_buttons"]

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
