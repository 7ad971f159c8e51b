"""What the readers of text files share: its words, rows and tables of numbers, and its names."""

import array
import io
import math

import numpy as np
import pandas as pd

# Bytes of a table that are read at once: memory beside the file and its numbers stays constant.
_PORTION = 2**20
# What plain decimal numbers and the blanks between them are made of.
_PLAIN = b"0123456789+-.eE \t\n"
_ONE_A_LINE = bytes.maketrans(b" \t", b"\n\n")
# Before 3.1 the last digit is right on demand only; since then always, and nobody may ask for it.
_OLD = tuple(map(int, pd.__version__.split(".")[:2])) < (3, 1)
_EXACT = {"float_precision": "round_trip"} if _OLD else {}


class MotionText:
    """The words of a text file, one by one or line by line, and where they stand.

    Words are bytes: old files hold any encoding in their comments.
    """

    def __init__(self, path):
        data = path.read_bytes().removeprefix(b"\xef\xbb\xbf")
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        self.path = path
        self.size = len(data)
        self.line_number = 0
        self.is_whole = True  # the line read last has an end
        self._lines = io.BytesIO(data)
        self._words = []  # those left of this line, the last first

    @property
    def n_left(self):
        """Bytes after the line read last."""
        return self.size - self._lines.tell()

    def row(self):
        """The next line that has words, as it is; empty at the end."""
        while line := self._lines.readline():
            self.line_number += 1
            if line.strip():
                self.is_whole = line.endswith(b"\n")
                return line.removesuffix(b"\n")
        return b""

    def line(self):
        """The words of the next line that has any, or what is left of this one; [] at the end."""
        words, self._words = self._words[::-1], []
        return words or self.row().split()

    def lines(self):
        """All lines that are left."""
        if self._words:
            yield self.line()
        for line in self._lines:
            self.line_number += 1
            if words := line.split():
                yield words

    def word(self, expected):
        """The next word; a brace is always a word of its own."""
        if not self._words:
            line = b" ".join(self.line())
            self._words = line.replace(b"{", b" { ").replace(b"}", b" } ").split()[::-1]
        if not self._words:
            raise self.error(f"the file ends where {expected} should follow; it is not complete.")
        return self._words.pop()

    def numbers(self, words, n, what):
        """`n` finite numbers."""
        if len(words) != n:
            raise self.error(f"{what} needs {n} numbers, got {len(words)} ({show(words)}).")
        try:
            numbers = array.array("d", map(float, words))
        except ValueError:
            numbers = array.array("d", [math.nan])
        # Python reads 1_0 as a number, files do not mean it.
        if b"_" in b"".join(words) or not all(map(math.isfinite, numbers)):
            bad = next(word for word in words if not _is_number(word))
            raise self.error(f"{what} needs finite numbers, got {show([bad])}.")
        return numbers

    def table(self, n, what):
        """The lines that are left, `n` finite numbers each, as an array (n_lines, n)."""
        rows = [np.empty((0, n))]
        while self.n_left:
            start = self._lines.tell()
            portion = self._lines.read(_PORTION) + self._lines.readline()
            numbers = _plain_numbers(portion, n)
            if numbers is not None:
                rows.append(numbers)
                self.line_number += portion.count(b"\n") + (not portion.endswith(b"\n"))
                continue
            # Line by line, which finds out what is wrong with it, if anything is.
            self._lines.seek(start)
            while self._lines.tell() < start + len(portion) and (words := self.line()):
                rows.append(np.array([self.numbers(words, n, what)]))
        return np.concatenate(rows)

    def error(self, message):
        return ValueError(f"{self.path}, line {self.line_number}: {message}")


def _plain_numbers(text, n):
    """Lines of `n` plain finite numbers each, as an array; None if they are anything else."""
    if text.translate(None, _PLAIN):
        return None
    codes = np.frombuffer(text, np.uint8)
    within = np.pad(codes > 32, (1, 0))
    words = np.flatnonzero(within[1:] > within[:-1])
    ends = np.append(np.flatnonzero(codes == 10), len(codes))
    n_words = np.diff(np.searchsorted(words, ends), prepend=0)
    if not ((n_words == n) | (n_words == 0)).all():
        return None
    if not len(words):
        return np.empty((0, n))
    try:
        column = pd.read_csv(
            io.BytesIO(text.translate(_ONE_A_LINE)),
            header=None,
            dtype=np.float64,
            na_filter=False,
            engine="c",
            **_EXACT,
        )
    except ValueError:
        return None
    numbers = column.to_numpy()
    if numbers.size != len(words) or not np.isfinite(numbers).all():
        return None
    return numbers.reshape(-1, n)


def _is_number(word):
    try:
        return math.isfinite(float(word)) and b"_" not in word
    except ValueError:
        return False


def show(words):
    """Words as an error message quotes them, never more than a line."""
    text = decode(b" ".join(words[:8])[:61])
    return repr(text if len(text) <= 60 else text[:60] + "...")


def decode(name):
    """The text of a name: UTF-8, or ISO-8859-1 if it is not."""
    try:
        return name.decode("utf-8")
    except UnicodeDecodeError:
        return name.decode("latin-1")


def unique(names):
    """The names, with ``_2``, ``_3``, ... behind those that came before."""
    taken, last = set(names), {}
    result = []
    for name in names:
        new = name
        if name in last:
            # Counting on from the last number keeps this linear.
            while new in taken:
                last[name] += 1
                new = f"{name}_{last[name]}"
            taken.add(new)
        else:
            last[name] = 1
        result.append(new)
    return result


# -- what the readers of columns of text share: fields, numbers or nothing, times that go on

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
