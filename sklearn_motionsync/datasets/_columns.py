"""What the readers of columns of text share: fields, numbers or nothing, times that go on."""

import array
import math

from ._text import show

# What programs write where they have no number, without its sign.
_NOTHING = {b"", b"nan", b"na", b"n/a", b"null", b"none", b"-", b"inf", b"infinity"}
_NOTHING |= {b"1.#ind", b"1.#inf", b"1.#qnan", b"1.#snan", b"nan(ind)", b"nan(snan)"}
# Seconds; no recording is as late.
_LONG = 1e12


def fields_of(row):
    """What stands between tabs; between blanks in a row without tabs."""
    if b"\t" not in row:
        return row.split()
    return [field.strip() for field in row.split(b"\t")]


def read_numbers(text, fields, what):
    """A number for each field, NaN where there is none."""
    try:
        numbers = array.array("d", map(float, fields))
        # Python reads 1_0 as a number, files do not mean it.
        if not any(map(math.isinf, numbers)) and b"_" not in b"".join(fields):
            return numbers
    except ValueError:
        pass
    return array.array("d", (_read_number(text, field, what) for field in fields))


def _read_number(text, field, what):
    if field.strip().lower().lstrip(b"+-") in _NOTHING or field.strip() == b"-":
        return math.nan
    try:
        number = float(field)
    except ValueError:
        number = math.inf
    if math.isinf(number) or b"_" in field:
        raise text.error(
            f"{what} needs numbers, or nothing where none is known, got {show([field])}."
        )
    return number


def check_time(text, time, before):
    """Refuse a time that is none, or that lies before the one of the row above."""
    if not -_LONG < time < _LONG or time < before:
        raise text.error(
            "the time of a row must be a number of seconds, and not lie before that of the row "
            f"above, got {time:g} after {before:g}."
        )
    return time


def check_n_rows(text, name, line_number, n_stated, n_rows):
    """Refuse a file that states another number of rows, or has none."""
    if not n_rows:
        raise text.error("the file ends where frames should follow; it is not complete.")
    if n_stated is not None and n_stated != n_rows:
        raise text.error(
            f"{name} in line {line_number} says {n_stated}, but {n_rows} frames follow; the file "
            "is not complete, or that line is wrong: then correct it."
        )


def count_decimals(field):
    """Digits behind the point of a number as it is written."""
    return len(field.strip().partition(b".")[2]) if b"e" not in field.lower() else 17
