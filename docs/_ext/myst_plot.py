"""Matplotlib's ``plot`` directive in Markdown pages.

Where the gallery is not run (``-D plot_gallery=0``), the code of a page is not run either: it is
shown without its figure.

The directive hands its result to the parser as reStructuredText lines, which the parser of Markdown
cannot take; here they are parsed apart.
"""

from types import SimpleNamespace


class _Machine:
    """What the directive needs of a parser: the document, and a place for its lines."""

    def __init__(self, document):
        self.document = document
        self.input_lines = SimpleNamespace(items=[])
        self.lines = []

    def insert_input(self, lines, source):
        self.lines.extend(lines)


def _directive():
    from docutils import nodes
    from matplotlib.sphinxext import plot_directive
    from myst_parser.mocking import MockRSTParser
    from sphinx.util.docutils import new_document

    class Plot(plot_directive.PlotDirective):
        def run(self):
            if self.state.document.settings.env.config.plot_gallery == "0":
                code = "\n".join(self.content)
                return [nodes.literal_block(code, code, language="python")]
            if not hasattr(self.state, "_renderer"):
                return super().run()
            outer = self.state.document
            machine = _Machine(outer)
            errors = plot_directive.run(
                self.arguments, self.content, self.options, machine, self.state, self.lineno
            )
            inner = new_document(outer["source"], outer.settings)
            inner.reporter = outer.reporter
            MockRSTParser().parse("\n".join(machine.lines), inner)
            return [*errors, *inner.children]

    return Plot


def setup(app):
    app.setup_extension("matplotlib.sphinxext.plot_directive")
    app.add_directive("plot", _directive(), override=True)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
