"""Numbers and their nouns in messages and reprs."""

import re
from pathlib import Path

import pytest
import sklearn_motionsync
from sklearn_motionsync import Match, to_frame
from sklearn_motionsync.inputs.wording import counted

PACKAGE = Path(sklearn_motionsync.__file__).parent
# A number that may be 1 and a plural behind it, in an f-string.
PLURALS = re.compile(
    r'f".*\{(len\([^{}]*\)|n_(?!frames)\w+|[\w.]+\.shape\[[01]\])\} '
    r"(trials|takes|features|gaps|warps|rows|columns|channels|samples|labels|poses)\b"
)
# Numbers that are never 1.
KEPT = [
    'f"None of the {len(takes)} takes is"',
    'f"{n_parts} parts" if n_parts > 1',
    'f"{len(shares)} features the others',
    "must be between 2 and the {n_features} features",
]


def test_one_is_singular():
    assert [counted(n, "frame") for n in (0, 1, 2, 1.0, 40.5)] == [
        "0 frames",
        "1 frame",
        "2 frames",
        "1 frame",
        "40.5 frames",
    ]
    assert repr(Match([[0, 1, 2]])) == "Match(1 trial on 3 frames)"
    with pytest.raises(ValueError, match="must be 1 different label, one a"):
        to_frame([[[0.0], [1.0]]], trials=["a", "b"])


def test_messages_count_by_one_function():
    found = [
        f"{path.relative_to(PACKAGE)}:{i}: {line.strip()}"
        for path in sorted(PACKAGE.rglob("*.py"))
        for i, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if PLURALS.search(line) and not any(kept in line for kept in KEPT)
    ]
    assert found == []
