"""Small repairs to what Sphinx and its extensions make of doctests and tables."""

import re

_NUMBERS = re.compile(r"[-+]?\d[\d.,e+%/() -]*( to [\d.]+\))?(m?s|MB)?")


def strip_blocks(app, doctree):
    """A doctest in Markdown ends with an empty line, so that its fence is no expected output."""
    from docutils import nodes

    for block in doctree.findall(nodes.literal_block):
        text = block.astext()
        if block.rawsource == text and text != text.rstrip("\n"):
            block.rawsource = text.rstrip("\n")
            block[:] = [nodes.Text(block.rawsource)]


def mark_numbers(app, doctree):
    """Cells of numbers, such as "3.34 / 16%" or "18 ms": the style sheet keeps them on one line."""
    from docutils import nodes

    for entry in doctree.findall(nodes.entry):
        if _NUMBERS.fullmatch(entry.astext().strip()):
            entry["classes"].append("number")


def setup(app):
    from numpydoc.xref import DEFAULT_LINKS
    from sphinx.ext import autosummary

    # Types are linked to pages of this site only.
    DEFAULT_LINKS.clear()
    autosummary.WELL_KNOWN_ABBREVIATIONS += ("Eq.", "Eqs.", "Fig.", "Figs.")
    app.connect("doctree-read", strip_blocks)
    app.connect("doctree-read", mark_numbers)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
