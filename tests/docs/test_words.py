"""Pages in plain words: no private terms, short sentences, easy to read."""

import re
from pathlib import Path

import pytest
import textstat

ROOT = Path(__file__).resolve().parents[2]
FILES = [
    ROOT / "README.md",
    ROOT / "CHANGELOG.md",
    # The page of the changelog includes the file.
    *sorted(set((ROOT / "docs").glob("*.md")) - {ROOT / "docs" / "changelog.md"}),
    *sorted((ROOT / "docs" / "howto").glob("*.md")),
]
PAGES = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in FILES}

# How many words a sentence has, in the mean of a page and at most; Flesch's reading ease, at least.
MEAN, LONGEST, EASE = 16, 25, 50

# Words that only this project knows, and what to write instead. Code does not count, nor do
# *italics*, in which a page may name the word that the code has for a thing.
INSTEAD = {
    r"performances?": "trial",
    r"postures?": "pose",
    r"patterns?": "template",
    r"clocks?": "time axis, frames of the template",
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
WORD = re.compile(r"\w([\w'.,-]*\w)?")
# Between two sentences; and at the end of a line, before a line that begins another.
BETWEEN = re.compile(r"(?:(?<=[.?!])|(?<=[.?!][\"')]))\s+(?=[\"'(]?[A-Z0-9])")


def with_lines(found, instead):
    return "\n" * (found[0].count("\n") - instead.count("\n")) + instead


def prose_of(text):
    """A page without what is no prose. Every line keeps its number."""
    for outside in NO_PROSE:
        lines = re.compile(outside, re.DOTALL | re.MULTILINE)
        text = lines.sub(lambda m: with_lines(m, ""), text)
    for inside, instead in IN_PROSE:
        text = re.sub(inside, lambda m, s=instead: with_lines(m, m.expand(s)), text)
    return text


def sentences_of(text):
    """Line and text of every sentence; an item of a list and a term of a glossary are sentences."""
    lines = prose_of(text).split("\n")
    begins, found = True, []
    for number, (line, following) in enumerate(zip(lines, [*lines[1:], ""], strict=True), 1):
        item = re.match(r" *([-*]|\d+\.) ", line)
        begins |= bool(item)
        for part in BETWEEN.split(line[item.end() :] if item else line):
            if begins:
                found.append([number, ""])
            found[-1][1] += " " + part.strip()
            begins = True
        term = following.startswith("  ") and not item and not line.startswith(" ")
        ended = BETWEEN.match(f"{line}\n{following}", len(line))
        begins = bool(term or ended or not line.strip())
    return [(number, sentence.strip()) for number, sentence in found if WORD.search(sentence)]


def n_words(sentence):
    return len(WORD.findall(sentence))


def private_words(text):
    """Line, word, and what to write instead."""
    prose = prose_of(text)
    return [
        (1 + prose.count("\n", 0, found.start()), found[0], instead)
        for word, instead in INSTEAD.items()
        for found in re.finditer(rf"\b({word})\b".replace(" ", r"\s+"), prose, re.IGNORECASE)
    ]


def long_sentences(text, longest=LONGEST):
    """Line, number of words and sentence of those that are too long."""
    counted = [(line, n_words(sentence), sentence) for line, sentence in sentences_of(text)]
    return [one for one in counted if one[1] > longest]


def mean_of(text):
    counts = [n_words(sentence) for _, sentence in sentences_of(text)]
    return sum(counts) / len(counts)


def ease_of(text):
    flat = " ".join(sentence.rstrip(":;, ") + "." for _, sentence in sentences_of(text))
    return textstat.flesch_reading_ease(flat.replace("..", "."))


# -- the pages --------------------------------------------------------------------------


@pytest.mark.parametrize("name", PAGES)
def test_page_has_no_private_words(name):
    found = [
        f'{name}:{line}: "{word}", write: {new}' for line, word, new in private_words(PAGES[name])
    ]
    assert found == [], "\n".join(found)


@pytest.mark.parametrize("name", PAGES)
def test_sentences_of_a_page_are_short(name):
    long = long_sentences(PAGES[name], LONGEST)
    found = [f"{name}:{line}: {count} words: {sentence}" for line, count, sentence in long]
    assert found == [], "\n".join(found)
    assert mean_of(PAGES[name]) <= MEAN


@pytest.mark.parametrize("name", PAGES)
def test_page_is_easy_to_read(name):
    assert ease_of(PAGES[name]) >= EASE


# -- the checks find what is wrong ---------------------------------------------------------

BAD = """(target-of-patterns)=
# Performances on one clock

The median says
so. A *performance* is a `pattern`, see [the postures of strangers](patterns.md).

```python
posture = 1
```

| patterns | clocks |
|---|---|

(house)=
- Everybody is in
  step; {doc}`journeys` is a page, $pattern$ a formula.
"""


def test_private_words_are_found_on_their_lines():
    found = [(line, word) for line, word, _ in private_words(BAD)]
    assert sorted(found) == [
        (4, "says\nso"),
        (5, "postures"),
        (5, "strangers"),
        (15, "Everybody"),
        (15, "in\n  step"),
    ]


def test_sentences_end_at_stops_items_and_terms():
    text = """# No sentence at all

One two. Three four
five six! `code` seven.

- Eight nine
- ten (Eleven.) Twelve

```{glossary}
term
  Its definition goes
  on.
```
"""
    assert sentences_of(text) == [
        (3, "One two."),
        (3, "Three four five six!"),
        (4, "Code seven."),
        (6, "Eight nine"),
        (7, "ten (Eleven.)"),
        (7, "Twelve"),
        (10, "term"),
        (11, "Its definition goes on."),
    ]


def test_long_sentences_are_found_on_their_lines():
    long = " ".join(["word"] * 26) + "."
    assert long_sentences(f"Short.\n\n{long}\nMore. W{long[6:]}") == [(3, 26, long)]
    assert mean_of(f"{long} One two.") == 14
    assert mean_of("Of seventeen words the mean is " + "too " * 9 + "long indeed.") > MEAN


def test_hard_text_is_found():
    hard = (
        "Multidimensional synchronisation necessitates considerable computational sophistication."
    )
    assert ease_of(hard) < EASE < ease_of("The cat sat on the mat. It is a cat of ours.")
