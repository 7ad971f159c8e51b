"""A page in one file: sections, tables with their files, figures, and what scripts read."""

import base64
import datetime
import json
import pathlib
import uuid
from html import escape
from importlib.resources import files
from io import BytesIO
from string import Template

import numpy as np

from ..display.base import pyplot
from ..matching.counting import whole

__all__ = [
    "Page",
    "check_path",
    "list_of",
    "number",
    "paragraph",
    "picture",
    "read_part",
    "table_of",
]

# Pixels an inch of the figures.
DPI = 180


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

        text = self.render(str(title), __version__)
        # The file that a link leads to is replaced, and keeps its permissions.
        target = path.resolve()
        beside = target.with_name(f".{uuid.uuid4().hex}")
        try:
            beside.touch()
            if target.exists():
                beside.chmod(target.stat().st_mode & 0o777)
            beside.write_text(text, encoding="utf-8", newline="\n")
            beside.replace(target)
        finally:
            beside.unlink(missing_ok=True)
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


def check_path(path, what):
    """A path at which a file can be written.

    Parameters
    ----------
    path : str or path
    what : str
        What is written, for messages.
    """
    path = pathlib.Path(path)
    if path.exists() and not path.is_file():
        raise ValueError(
            f"path must be that of a file, such as '{what}.html'; {str(path)!r} is a folder or a "
            "device."
        )
    if not path.parent.is_dir():
        raise FileNotFoundError(
            f"There is no folder {str(path.parent)!r} for the {what} {path.name!r}: make it by "
            "Path.mkdir(parents=True), or give the path of another file."
        )
    return path


def _without_formula(value):
    """Text that a spreadsheet would run as a formula, behind an apostrophe; or the value."""
    is_formula = isinstance(value, str) and value.startswith(("=", "+", "-", "@", "\t", "\r"))
    return f"'{value}" if is_formula else value


def read_part(name):
    """A file of this folder."""
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


def paragraph(text, kind=""):
    """A paragraph; nothing without text."""
    attribute = f' class="{kind}"' if kind else ""
    # No line begins with a unit.
    text = escape(text).replace(" %", "\u00a0%")
    return f"<p{attribute}>{text}</p>" if text else ""


def list_of(texts):
    """A numbered list of lines of code."""
    items = "".join(f"<li><code>{escape(text)}</code></li>\n" for text in texts)
    return f"<ol>\n{items}</ol>"


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
        columns.append(
            [f"<td{kind}>{escape(text)}</td>" for text in _texts(column, name in by_row)]
        )
    rows = ["<tr>" + "".join(cells) + "</tr>" for cells in zip(*columns, strict=True)]
    return (
        f"<figure>\n<figcaption>{escape(caption)}</figcaption>\n"
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(caption)}">\n<table>\n'
        f"<thead><tr>{''.join(heads)}</tr></thead>\n<tbody>\n" + "\n".join(rows) + "\n"
        "</tbody>\n</table>\n</div>\n</figure>"
    )


def _texts(column, by_row):
    if column.dtype.kind == "b":
        return ["yes" if value else "no" for value in column]
    if column.dtype.kind != "f":
        return [str(value) for value in column]
    largest = None if by_row else column.abs().max()
    return [number(value, largest) for value in column]


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
