"""One list of words for pages and code, and pages without private terms."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FILES = [
    ROOT / "README.md",
    ROOT / "CHANGELOG.md",
    # The page of the changelog includes the file.
    *sorted(set((ROOT / "docs").glob("*.md")) - {ROOT / "docs" / "changelog.md"}),
    *sorted((ROOT / "docs" / "howto").glob("*.md")),
]
PAGES = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in FILES}

# Words that only this project knows, and what to write instead. Code does not count, nor do
# *italics*, in which a page may name the word that the code has for a thing.
INSTEAD = {
    r"performances?": "trial",
    r"postures?": "pose",
    r"templates?": "pattern",
    r"yardsticks?|rulers?": "measure",
    r"journeys?": "from your files to a figure",
    r"strangers?": "new people",
    r"in step": "aligned",
    r"say so|says so": "name what is said",
    r"house": "our",
    r"(?:no|some|every|any)body|whoever": "the person, people",
    r"stands? in for": "replace",
    r"what comes of": "result",
    r"the like": "the other things, by name",
    r"as \w+ as you like": "any",
}
# Front matter, titles of references, code but for the definitions of a glossary, formulas,
# comments; tables, headings, fences, options, targets.
NO_PROSE = [
    r"\A---\n.*?\n---\n",
    r"^## References$.*\Z",
    r"^ *(`{3,})(?!\{glossary).*?^ *\1 *$",
    r"\$\$.*?\$\$( *\{[^}]*\})?",
    r"<!--.*?-->",
    r"^ *(\||#|:::|```|:[a-z-]+:|%|\([\w-]+\)=)[^\n]*$",
]
IN_PROSE = [
    (r"!\[[^]]*\]\([^)]*\)", ""),
    (r"\[([^]]*)\]\([^)]*\)", r"\1"),
    (r"(\{[\w:]+\})?`([^`\n]|\n(?! *\n))+`", "Code"),
    (r"\$[^$\n]+\$", "x"),
    (r"\*\*([^*]+)\*\*", r"\1"),
    (r"(?<!\w)\*[^\s*]([^*\n]|\n(?! *\n))*\*", "Italics"),
]


def with_lines(match, instead):
    return "\n" * (match[0].count("\n") - instead.count("\n")) + instead


def prose_of(text):
    """A page without what is no prose. Every line keeps its number."""
    for outside in NO_PROSE:
        lines = re.compile(outside, re.DOTALL | re.MULTILINE)
        text = lines.sub(lambda m: with_lines(m, ""), text)
    for inside, instead in IN_PROSE:
        text = re.sub(inside, lambda m, s=instead: with_lines(m, m.expand(s)), text)
    return text


def private_words(text):
    """Line, word, and what to write instead."""
    prose = prose_of(text)
    return [
        (1 + prose.count("\n", 0, match.start()), match[0], instead)
        for word, instead in INSTEAD.items()
        for match in re.finditer(rf"\b({word})\b".replace(" ", r"\s+"), prose, re.IGNORECASE)
    ]


# -- the pages --------------------------------------------------------------------------


@pytest.mark.parametrize("name", PAGES)
def test_page_has_no_private_words(name):
    messages = [
        f'{name}:{line}: "{word}", write: {new}' for line, word, new in private_words(PAGES[name])
    ]
    assert messages == [], "\n".join(messages)


# -- the code ---------------------------------------------------------------------------

# What is called so elsewhere: a journal, names of Python, scikit-learn, CSS and browsers.
ELSEWHERE = (
    r"Gait & Posture|Posture\* 30|string import Template|Template\(|_doc_link_template"
    r"|others call it a template|grid-?[tT]emplate-?[cC]olumns"
    r"|performance\.now\(\)"
)


@pytest.mark.parametrize("suffix", ["py", "js", "css", "html"])
def test_code_has_the_words_of_the_pages(suffix):
    """It does not speak of arrays as people, either."""
    people = r"\b(who|whoever|nobody|somebody|everybody)\b"
    words = re.compile(f"performance|posture|template|{people}", re.IGNORECASE)
    messages = [
        f"{path.relative_to(ROOT)}:{i}: {line.strip()}"
        for path in sorted((ROOT / "sklearn_motionsync").rglob(f"*.{suffix}"))
        for i, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if words.search(re.sub(ELSEWHERE, "", line))
    ]
    assert messages == [], "\n".join(messages)


# -- the check finds what is wrong ----------------------------------------------------------

BAD = """(target-of-templates)=
# Performances on one clock

The median says
so. A *performance* is a `template`, see [the postures of strangers](templates.md).

```python
posture = 1
```

- Everybody is in
  step; {doc}`journeys` is a page, $template$ a formula.
"""


def test_private_words_are_found_on_their_lines():
    places = [(line, word) for line, word, _ in private_words(BAD)]
    assert sorted(places) == [
        (4, "says\nso"),
        (5, "postures"),
        (5, "strangers"),
        (11, "Everybody"),
        (11, "in\n  step"),
    ]
