"""A page in one file: sections, tables with their files, figures, and what scripts read."""

import base64
import datetime
import json
import re
from html import escape
from importlib.resources import files
from io import BytesIO
from string import Template

import numpy as np

from ..display.base import pyplot
from ..matching.counting import whole
from ..utils.files import write_whole

# Pixels an inch of the figures.
DPI = 180
# Where a spreadsheet would begin to read a formula.
_FORMULA = re.compile(r'(?:^|(?<=[;\t\r\n]))(?="*[=+\-@\t\r\n\uff1d\uff0b\uff0d\uff20])')


class Page:
    """Sections in order, the tables that they offer as files, and the data of the player.

    Attributes
    ----------
    player : dict or None
        For the script.
    """

    def __init__(self):
        self._sections, self._files, self.player = [], {}, None

    def add(self, title, *parts):
        """Add a section of parts in HTML, unless all of them are empty."""
        if any(parts):
            self._sections.append((title, "\n".join(filter(None, parts))))

    def offer(self, **tables):
        """Buttons that save tables as CSV, by the names of the files."""
        buttons = []
        for name, table in tables.items():
            file = f"{name}.csv"
            table = table.rename(columns=_without_formula).map(_without_formula)
            self._files[file] = table.to_csv(index=False, float_format="%.6g", lineterminator="\n")
            buttons.append(f'<button type="button" data-file="{file}">Save {file}</button>')
        return f"<p>{''.join(buttons)}</p>"

    def write(self, path, title):
        """Write the page as a whole or not at all."""
        # The version is known once the package is imported.
        from .. import __version__

        write_whole(path, self.render(str(title), __version__))
        return path

    def render(self, title, version):
        """The page as text."""
        data = json.dumps({"files": self._files, "player": self.player}, ensure_ascii=False)
        names = [f"section{k}" for k in range(len(self._sections))]
        sections = [
            f'<section aria-labelledby="{name}">\n<h2 id="{name}">{escape(heading)}</h2>\n{body}\n'
            "</section>"
            for name, (heading, body) in zip(names, self._sections, strict=True)
        ]
        links = [
            f'<li><a href="#{name}">{escape(heading)}</a></li>'
            for name, (heading, _) in zip(names, self._sections, strict=True)
        ]
        nav = '<nav aria-label="Sections">\n<ul>\n' + "\n".join(links) + "\n</ul>\n</nav>"
        return Template(read_part("page.html")).substitute(
            title=escape(title),
            style=read_part("page.css"),
            links=nav if len(links) > 1 else "",
            sections="\n".join(sections),
            date=datetime.date.today().isoformat(),
            version=escape(version),
            # Within a script element nothing but "<" could end it.
            data=data.replace("<", "\\u003c"),
            script=read_part("page.js") + (read_part("player.js") if self.player else ""),
        )


def _without_formula(value):
    """Text with an apostrophe before all that a spreadsheet would run as a formula; or the value.

    Spreadsheets of other languages take a semicolon for the end of a cell, and wide signs as well.
    """
    return _FORMULA.sub("'", value) if isinstance(value, str) else value


def read_part(name):
    """A file of this folder."""
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


def paragraph(text, kind=""):
    """A paragraph; nothing without text."""
    attribute = f' class="{kind}"' if kind else ""
    # No line begins with a unit.
    text = escape(text).replace(" %", "\u00a0%")
    return f"<p{attribute}>{text}</p>" if text else ""


def table_of(table, caption, by_row=()):
    """A DataFrame as a table of HTML, in a box that scrolls by itself; nothing without rows.

    Numbers of the columns ``by_row`` have three digits each, those of others where they are
    largest.
    """
    if len(table) == 0:
        return ""
    heads, columns = [], []
    for k, name in enumerate(table.columns):
        column = table.iloc[:, k]
        kind = ' class="n"' if column.dtype.kind in "if" else ""
        heads.append(f'<th scope="col"{kind}>{escape(str(name))}</th>')
        if column.dtype.kind == "b":
            texts = ["yes" if value else "no" for value in column]
        elif column.dtype.kind == "f":
            largest = None if name in by_row else column.abs().max()
            texts = [number(value, largest) for value in column]
        else:
            texts = [str(value) for value in column]
        columns.append([f"<td{kind}>{escape(text)}</td>" for text in texts])
    rows = ["<tr>" + "".join(cells) + "</tr>" for cells in zip(*columns, strict=True)]
    return (
        f"<figure>\n<figcaption>{escape(caption)}</figcaption>\n"
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(caption)}">\n<table>\n'
        f"<thead><tr>{''.join(heads)}</tr></thead>\n<tbody>\n" + "\n".join(rows) + "\n"
        "</tbody>\n</table>\n</div>\n</figure>"
    )


def number(value, largest=None):
    """A number as text; of this one, or of the largest of several, three digits are shown."""
    if not np.isfinite(value):
        return "" if np.isnan(value) else str(value)
    size = abs(value if largest is None else largest)
    digits = min(max(2 - whole(np.log10(size), "down"), 0), 6) if size > 0 else 0
    # The sum makes 0 of -0.
    return f"{round(value, digits) + 0:.{digits}f}"


def picture(figure, text):
    """A figure as an image within the page, with a text in its place."""
    file = BytesIO()
    figure.savefig(file, format="png", dpi=DPI, metadata={"Software": None})
    pyplot().close(figure)
    code = base64.b64encode(file.getvalue()).decode("ascii")
    return f'<img src="data:image/png;base64,{code}" alt="{escape(text)}">'
