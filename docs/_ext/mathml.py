"""Formulas as MathML, which today's browsers draw by themselves: no script, no network.

Docutils converts the TeX. A ``\\tag{...}`` becomes the number of a displayed formula.
"""

import re
from html import escape

_TAG = re.compile(r"\\tag\{([^{}]*)\}")


def split_tag(tex):
    r"""The formula without its tag, and the tag.

    >>> split_tag(r"a = b \tag{3}")
    ('a = b', '3')
    """
    found = _TAG.search(tex)
    return _TAG.sub("", tex).strip(), found.group(1) if found else None


def to_mathml(tex, *, block, where=None):
    from docutils.utils.math import MathError
    from docutils.utils.math.latex2mathml import tex2mathml
    from sphinx.util import logging

    try:
        mathml = tex2mathml(tex, as_block=block)
    except MathError as error:
        logging.getLogger(__name__).warning("%s in the formula %r", error, tex, location=where)
        return f"<code>{escape(tex)}</code>"
    # Indentation between elements would become spaces where a formula stands in a sentence.
    return re.sub(r">\s+<", "><", mathml)


def visit_math(self, node):
    from docutils import nodes

    mathml = to_mathml(node.astext().strip(), block=False, where=node)
    self.body.append(f'<span class="math">{mathml}</span>')
    raise nodes.SkipNode


def visit_math_block(self, node):
    from docutils import nodes

    tex, number = split_tag(node.astext().strip())
    ids = "".join(f'<span id="{escape(name)}"></span>' for name in node["ids"])
    shown = f'<span class="equation-number">({escape(number)})</span>' if number else ""
    mathml = to_mathml(tex, block=True, where=node)
    self.body.append(f'<div class="math-block">{ids}{mathml}{shown}</div>\n')
    raise nodes.SkipNode


def setup(app):
    app.add_html_math_renderer("mathml", (visit_math, None), (visit_math_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
