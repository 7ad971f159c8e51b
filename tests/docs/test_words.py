"""Pages without the private terms of this project."""

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
    r"trials?": "trial",
    r"poses?": "pose",
    r"patterns?": "pattern",
    r"clocks?": "time axis, frames of the pattern",
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


def prose_of(text):
    """A page without what is no prose."""
    for outside in NO_PROSE:
        text = re.sub(outside, "", text, flags=re.DOTALL | re.MULTILINE)
    for inside, instead in IN_PROSE:
        text = re.sub(inside, instead, text)
    return text


def private_words(text):
    """Each word with what stands before it, and what to write instead."""
    prose = prose_of(text)
    return [
        (prose[max(0, match.start() - 40) : match.end()], instead)
        for word, instead in INSTEAD.items()
        for match in re.finditer(rf"\b({word})\b".replace(" ", r"\s+"), prose, re.IGNORECASE)
    ]


@pytest.mark.parametrize("name", PAGES)
def test_page_has_no_private_words(name):
    messages = [f'"{words}", write: {new}' for words, new in private_words(PAGES[name])]
    assert messages == [], "\n".join(messages)


def test_private_words_are_found_in_prose_only():
    page = "# Clocks\n\nIt says\nso. A *clock* is a `pattern`, see [poses](strangers.md).\n"
    assert [new for _, new in private_words(page)] == ["pose", "name what is said"]
