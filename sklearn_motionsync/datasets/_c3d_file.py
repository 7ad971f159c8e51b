"""The header and the parameters of a C3D file, in one of three machines' binary forms.

Read here with NumPy, since every number of the file must be held against the file's size
before it is believed.
"""

import math

import numpy as np

from ._text import decode

BLOCK = 512
_LITTLE, _DEC, _BIG = 84, 85, 86


class C3DFile:
    """The bytes of the file, and how its machine wrote numbers."""

    def __init__(self, path):
        self.path = path
        self.data = path.read_bytes()
        if len(self.data) < 2 * BLOCK or self.data[1] != 0x50:
            raise self.error(
                f"byte 1 must be hexadecimal 50 and the file {2 * BLOCK} bytes or more, got "
                f"{self.data[1:2].hex() or 'nothing'} and {len(self.data)} bytes; it is no C3D "
                "file, or not complete"
            )
        self.first_parameter = (self.data[0] - 1) * BLOCK
        if not 0 < self.first_parameter <= len(self.data) - 4:
            raise self.error(
                f"byte 0 says that parameters begin in block {self.data[0]}, but the file has "
                f"{len(self.data) // BLOCK} blocks"
            )
        self.machine = self.data[self.first_parameter + 3]
        if self.machine not in (_LITTLE, _DEC, _BIG):
            raise self.error(
                f"byte {self.first_parameter + 3} says processor {self.machine}; 84 (Intel), "
                "85 (DEC) and 86 (MIPS) are known"
            )
        self.order = ">" if self.machine == _BIG else "<"
        self.float_order = self.order
        other = "<" if self.order == ">" else ">"
        # Some writers turned the floats only, or the integers only.
        if not self._holds(self.data_start) and self._holds(self._find_data_start(other)):
            self.order = other

    @property
    def data_start(self):
        """Where the data begin, as the header says."""
        return self._find_data_start(self.order)

    def _find_data_start(self, order):
        return (int(np.frombuffer(self.data, order + "u2", 1, 16)[0]) - 1) * BLOCK

    def _holds(self, at):
        return self.first_parameter < at < len(self.data)

    def error(self, message):
        return ValueError(f"{self.path}: {message}. Export the recording again.")

    def integers(self, at, n=1, kind="u2"):
        return np.frombuffer(self.data, self.order + kind, n, at)

    def integer(self, at):
        return int(self.integers(at)[0])

    def float(self, at):
        return float(self.floats(np.frombuffer(self.data, np.uint8, 4, at))[0])

    def floats(self, raw):
        """Numbers of 4 bytes, given as an array of their bytes."""
        if self.machine != _DEC:
            with np.errstate(invalid="ignore"):
                return raw.view(self.float_order + "f4").astype(np.float64)
        # A DEC number has its two 16-bit words swapped and is four times too large for IEEE;
        # those with an exponent of 0 are 0.
        words = raw.view("<u2").astype(np.uint32)
        bits = words[..., 0::2] << 16 | words[..., 1::2]
        sign = np.where(bits >> 31, -1.0, 1.0)
        exponent = (bits >> 23 & 0xFF).astype(np.int64)
        mantissa = (bits & 0x7FFFFF | 0x800000).astype(np.float64)
        return np.where(exponent > 0, np.ldexp(sign * mantissa, exponent - 152), 0.0)


class Parameters:
    """The parameters of the file: (group, name) to type, dimensions and bytes."""

    def __init__(self, file):
        self._file = file
        self._found = {}
        groups, members = {}, []
        data, at = file.data, file.first_parameter
        n_blocks = data[at + 2]
        counted = min(len(data), at + n_blocks * BLOCK) if n_blocks else len(data)
        # Writers count wrongly, and one byte is too little for many; the data bound them.
        end = file.data_start if at < file.data_start < len(data) else counted
        at += 4
        # Every entry is longer than 4 bytes, so this comes to an end.
        while at + 4 < end and data[at] and data[at + 1]:
            n_chars, group = file.integers(at, 2, "i1").tolist()
            n_chars = abs(n_chars)
            link = at + 2 + n_chars
            step = file.integer(link) if link + 2 <= end else 0
            content = data[link + 2 : min(end, link + step) if step else end]
            if link + 2 > end or link + step > end or step == 1:
                if at >= counted:
                    break  # what follows them may be anything
                raise self._error(at, "leads out of the parameters")
            name = decode(data[at + 2 : link]).strip().upper()
            if group < 0:
                groups.setdefault(-group, name)
            else:
                members.append((group, name, at, content))
            if not step:
                break
            at = link + step
        for group, name, at, content in members:
            self._found.setdefault((groups.get(group), name), self._read(at, content))

    def _error(self, at, problem):
        return self._file.error(f"the parameter at byte {at} {problem}")

    def _read(self, at, content):
        # The format allows for seven dimensions.
        if len(content) < 2 or content[1] > 7 or len(content) < 2 + content[1]:
            raise self._error(at, "is not complete, or no parameter")
        size = np.frombuffer(content[:1], "i1")[0]
        dimensions = list(content[2 : 2 + content[1]])
        n_bytes = math.prod(dimensions) * abs(int(size))
        values = content[2 + len(dimensions) :][:n_bytes]
        if size not in (-1, 1, 2, 4) or len(values) < n_bytes:
            raise self._error(at, f"says {n_bytes} bytes of type {size}, which are not there")
        return int(size), dimensions, values

    def names(self, group):
        """Names of the parameters of a group, in the order of the file."""
        return [name for found, name in self._found if found == group]

    def numbers(self, group, name, kind="u"):
        """The numbers of a parameter, integers unsigned or of kind "i"; None without any."""
        size, _, values = self._found.get((group, name), (-1, [], b""))
        if size < 0 or not values:
            return None
        if size == 4:
            return self._file.floats(np.frombuffer(values, np.uint8))
        return np.frombuffer(values, f"{self._file.order}{kind}{size}").astype(np.float64)

    def number(self, group, name, default=None):
        numbers = self.numbers(group, name)
        return default if numbers is None else float(numbers[0])

    def texts(self, group, name):
        size, dimensions, values = self._found.get((group, name), (1, [], b""))
        width = dimensions[0] if dimensions else 1
        if size != -1 or not width:
            return []
        pieces = (values[i : i + width] for i in range(0, len(values), width))
        return [decode(piece).replace("\0", " ").strip() for piece in pieces]

    def all_texts(self, group, name):
        """Those of a parameter and of its continuations, NAME2, NAME3, ..."""
        return self._continued(self.texts, group, name)

    def all_numbers(self, group, name, kind="u"):
        def numbers(group, name):
            found = self.numbers(group, name, kind)
            return [] if found is None else found.tolist()

        return self._continued(numbers, group, name)

    def _continued(self, read, group, name):
        result, number = list(read(group, name)), 2
        while more := read(group, f"{name}{number}"):
            result += more
            number += 1
        return result

    def text(self, group, name):
        texts = self.texts(group, name)
        return texts[0] or None if texts else None
