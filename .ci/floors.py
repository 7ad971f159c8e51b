"""The oldest versions that pyproject.toml allows, as constraints for pip.

    python .ci/floors.py > floors.txt
    pip install '.[test]' -c floors.txt

With the name of an extra, what that needs besides the package, as pyproject.toml has it:

    python .ci/floors.py docs > needed.txt

A floor such as ``numpy>=2.0`` becomes ``numpy==2.0.*``: its newest repairs, but nothing younger.
Only what the package and its tests need is pinned; the manual is built with what is newest.
"""

import re
import sys
import tomllib
from pathlib import Path

EXTRAS = ("plot", "test")
# What the oldest versions need in their turn, before it warned of the ways in which they use it.
COMPANIONS = ["pyparsing==3.1.*"]
_REQUIREMENT = re.compile(r"(?P<name>[\w.-]+)(\[[^]]*\])?\s*(?P<versions>[^;]*)(;\s*(?P<when>.*))?")
_FLOOR = re.compile(r">=\s*([\d.]*\d)")


def pin(requirement):
    """The constraint that keeps a requirement at its floor."""
    parts = _REQUIREMENT.fullmatch(requirement)
    floor = parts and _FLOOR.search(parts["versions"])
    if not floor:
        raise ValueError(f"The requirement {requirement!r} has no floor; say NAME>=VERSION.")
    when = f" ; {parts['when']}" if parts["when"] else ""
    return f"{parts['name']}=={floor[1]}.*{when}"


def needed(path, *extras):
    """What a pyproject.toml asks for, for the package and some extras."""
    project = tomllib.loads(Path(path).read_text(encoding="utf-8"))["project"]
    optional = project["optional-dependencies"]
    return project["dependencies"] + [each for extra in extras for each in optional[extra]]


def constraints(path):
    """What a pyproject.toml needs for the package, its figures and its tests, at the floors."""
    return sorted({*COMPANIONS, *(pin(requirement) for requirement in needed(path, *EXTRAS))})


if __name__ == "__main__":
    path = Path(__file__).parents[1] / "pyproject.toml"
    lines = needed(path, *sys.argv[1:]) if sys.argv[1:] else constraints(path)
    sys.stdout.write("\n".join(lines) + "\n")
