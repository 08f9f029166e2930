"""Records of SQLite: the rows of a table as columns, many rows at a time.

::

    record   length of the header | a type a column … | values …        lengths and types are variable-length integers

To have SQLite hand over a row value by value takes several microseconds; here a value costs a few nanoseconds.
Source: https://www.sqlite.org/fileformat2.html, section 2.1.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from dissectors.batch import I32, I64, U8, U64, Bool
from dissectors.datalogger.varints import varints


class Form(IntEnum):
    """What a value is stored as."""

    NULL = 0
    INTEGER = 1
    REAL = 2
    TEXT = 3
    BLOB = 4


# Types of values: 0 is NULL, 7 a float, 8 and 9 are the integers 0 and 1, 10 and 11 are not used; from 12 on, even ones
# are blobs, odd ones texts.
_NULL, _REAL, _ZERO, _ONE, _UNUSED, _BLOB, _TEXT = 0, 7, 8, 9, (10, 11), 12, 13
_INTEGER_BYTES = (0, 1, 2, 3, 4, 6, 8)
_LAST_ALIKE = 4
"""Types up to it have as many bytes."""
_ONE_BYTE = 0x80
"""Types below it take one byte."""

_WORD_BYTES = 8

_Places = npt.NDArray[Any]
"""Whole numbers, as narrow as they can be."""


def _tables() -> tuple[U8, U8, I64]:
    """Return, for types of one byte: form, bytes, and by how many bits a word is too long for the value."""
    form, size, shift = np.zeros(256, np.uint8), np.zeros(256, np.uint8), np.zeros(256, np.int64)
    for kind, count in enumerate(_INTEGER_BYTES[1:], 1):
        form[kind], size[kind], shift[kind] = Form.INTEGER, count, 64 - 8 * count
    form[_REAL], size[_REAL] = Form.REAL, _WORD_BYTES
    form[[_ZERO, _ONE]] = Form.INTEGER
    for kind in range(_BLOB, _ONE_BYTE):
        form[kind], size[kind] = Form.TEXT if kind % 2 else Form.BLOB, (kind - _BLOB) // 2
    return form, size, shift


_FORM, _SIZE, _SHIFT = _tables()
_LONGEST_SHORT = (_ONE_BYTE - 1 - _BLOB) // 2
"""Bytes of the longest text or blob whose type takes one byte."""


def sizes_of(types: U8) -> U8:
    """Return how many bytes numbers of these types have, and NULL; to look them up takes several times as long."""
    sizes: U8 = types * (types < _ZERO).view(np.uint8)
    if int(sizes.max(initial=0)) > _LAST_ALIKE:
        sizes += (sizes > _LAST_ALIKE).view(np.uint8) + (types == _LAST_ALIKE + 2).view(np.uint8)
    return sizes


class Cells(Struct, frozen=True, dict=True):
    """The values of one column, a row each.

    ``form`` is a ``Form`` as uint8. ``bits`` are those of an int64 or a float64, 0 of all else. A text or blob is
    ``data[start : stop]`` of the records it comes from; of all else, what lies there says nothing. ``find_stop`` finds
    ``stop``: hardly anybody asks where numbers end.
    """

    form: U8
    bits: U64
    start: I64
    find_stop: Callable[[], I64]

    def __len__(self) -> int:
        return len(self.form)

    @cached_property
    def stop(self) -> I64:
        """Where each value ends."""
        return self.find_stop()

    @property
    def integers(self) -> I64:
        """The bits as int64."""
        return self.bits.view(np.int64)


class Records:
    """Rows of a table, as columns over one buffer.

    ``faulty`` rows cannot be read: all their values are NULL. A row with fewer values than there are columns has NULL
    in the others.
    """

    def __init__(self, data: U8, offset: I64, length: I64, columns: int, real: Sequence[int] = ()) -> None:
        """Read the headers of records that lie at ``offset`` and have ``length`` bytes, all within ``data``.

        ``real`` are the numbers of columns that hold real numbers: SQLite stores them as integers where that is
        shorter.
        """
        # A word is read from wherever a value begins, and a window of a byte a column from wherever a header does.
        margin = max(columns, 1) + _WORD_BYTES
        furthest = int((offset + length).max(initial=0))
        if furthest + margin > len(data):
            data = np.concatenate([data, np.zeros(margin, np.uint8)])
        self.data, self.columns = data, columns
        self._real = frozenset(real)
        self._words = np.ndarray((len(data) - _WORD_BYTES + 1,), ">i8", data, 0, (1,))
        self._read(offset, length)

    def __len__(self) -> int:
        return len(self._body)

    def filled(self, column: int) -> Bool:
        """Return where something is stored in a column: all that is not NULL, and floats that are no numbers."""
        filled: Bool = self._types[column] != _NULL
        return filled

    def is_empty(self, column: int) -> bool:
        """Return whether a column is NULL in all rows."""
        return not self._most[column]

    def is_full(self, column: int) -> bool:
        """Return whether something is stored in a column in all rows, as ``filled`` tells it."""
        return bool(self._least[column] > _NULL)

    def cells(self, column: int, rows: I64 | None = None) -> Cells:
        """Return the values of a column, from 0, of all rows or of some."""
        types, body, behind = self._types[column], self._body, self._starts[column]
        sizes = None if self._sizes is None else self._sizes[column]
        least, most = int(self._least[column]), int(self._most[column])
        if rows is not None:
            types, body, behind = types.take(rows), body.take(rows), behind.take(rows)
            sizes = None if sizes is None else sizes.take(rows)
            if least < most and len(types):
                least, most = int(types.min()), int(types.max())
        start: I64 = body + behind
        # Big-endian, so that the value is in the upper bytes; the shift keeps its sign.
        words = self._words[start].astype(np.int64)
        bits = words >> (_SHIFT[most] if least == most else _SHIFT.take(types))
        if least == most or (least > _NULL and most < _REAL):
            form = np.full(len(words), _FORM[most], np.uint8)
        else:
            form = _FORM.take(types)
        if least == _NULL or most >= _ZERO:
            short = (types == _NULL) | (types >= _ZERO)
            if short.any():
                bits[short] = types[short] == _ONE
        if most >= _REAL:
            floats = types == _REAL
            if floats.any():
                # What is no number is NULL; SQLite never writes it.
                floats &= np.isnan(bits.view(np.float64))
                form[floats], bits[floats] = Form.NULL, 0
        if column in self._real:
            whole = form == Form.INTEGER
            if whole.any():
                bits[whole] = bits[whole].astype(np.float64).view(np.int64)
                form[whole] = Form.REAL

        def stop() -> I64:
            found: I64 = start + (_SIZE.take(types) if sizes is None else sizes)
            return found

        return Cells(form, bits.view(np.uint64), start, stop)

    def _read(self, offset: I64, length: I64) -> None:
        stop = offset + length
        header_bytes, head = varints(self.data, offset, stop)
        faulty = (head == 0) | (header_bytes < head) | (header_bytes > length)
        self._sizes: I32 | None = None
        types = self._one_byte_types(offset + head, faulty)
        odd = faulty | (header_bytes - head != self.columns)
        if types.max(initial=0) >= _ONE_BYTE:
            odd |= (types >= _ONE_BYTE).any(axis=0)
        body = offset + header_bytes
        if odd.any():
            rows = np.flatnonzero(odd)
            body[faulty] = offset[faulty]
            types[:, rows] = _NULL
            self._sizes = _SIZE[types].astype(np.int32)
            rows = np.flatnonzero(odd & ~faulty)
            faulty[rows[self._read_odd(types, rows, (offset + head)[rows], body[rows], length[rows])]] = True
        self._types, self._body = types, body
        self._find_values(stop, faulty)
        if faulty.any():
            types[:, faulty] = _NULL
            self._most, self._least = types.max(axis=1, initial=0), types.min(axis=1, initial=_ONE_BYTE)
            self._body[faulty] = 0
            for start in self._starts:
                start[faulty] = 0
        self.faulty: Bool = faulty

    def _one_byte_types(self, start: I64, faulty: Bool) -> U8:
        """Return a byte a column behind ``start``, shape (columns, n)."""
        count, columns = len(start), self.columns
        if not columns or not count:
            return np.zeros((columns, count), np.uint8)
        if faulty.any():
            start = np.where(faulty, 0, start)
        windows = np.ndarray((len(self.data) - columns + 1,), f"V{columns}", self.data, 0, (1,))
        # A copy of so many bytes a row, and then a column at a time.
        return np.ascontiguousarray(windows[start].view(np.uint8).reshape(count, columns).T)

    def _read_odd(self, types: U8, rows: I64, at: I64, stop: I64, length: I64) -> Bool:
        """Read headers in which a type has several bytes, or some are missing; return which are faulty."""
        assert self._sizes is not None
        at, faulty = at.copy(), np.zeros(len(rows), np.bool_)
        for column in range(self.columns):
            here = np.flatnonzero((at < stop) & ~faulty)
            if not len(here):
                break
            kind, used = varints(self.data, at[here], stop[here])
            long = kind >= _BLOB
            size = np.where(long, (kind - _BLOB) >> 1, 0)
            faulty[here] = (used == 0) | (kind < 0) | (size > length[here])
            kind = np.where(kind < _ONE_BYTE, kind, _BLOB + (kind & 1))
            good = ~faulty[here]
            types[column, rows[here[good]]] = kind[good]
            self._sizes[column, rows[here[good]]] = np.where(long, size, _SIZE[kind & 0x7F])[good]
            at[here] += used
        faulty |= at != stop
        return faulty

    def _find_values(self, stop: I64, faulty: Bool) -> None:
        """Find where the values of each column begin behind the header; what does not end with its record is faulty."""
        self._most = self._types.max(axis=1, initial=0)
        self._least = self._types.min(axis=1, initial=_ONE_BYTE)
        starts: list[_Places] = []
        # As narrow as it can be: there are as many of these as values.
        longest = sum(_WORD_BYTES if most < _BLOB else _LONGEST_SHORT for most in self._most.tolist())
        is_narrow = self._sizes is None and longest < 1 << 16
        at: _Places = np.zeros(len(self._body), np.uint16 if is_narrow else np.int64)
        for column, (least, most) in enumerate(zip(self._least.tolist(), self._most.tolist(), strict=True)):
            starts.append(at)
            if self._sizes is not None:
                at = at + self._sizes[column] if most else at
            elif least == most:
                at = at + at.dtype.type(_SIZE[most]) if _SIZE[most] else at
            elif most < _UNUSED[0]:
                at = at + sizes_of(self._types[column])
            else:
                at = at + _SIZE.take(self._types[column])
        self._starts = starts
        faulty |= at != stop - self._body
        if (self._most >= _UNUSED[0]).any():
            for column, most in enumerate(self._most.tolist()):
                if most >= _UNUSED[0]:
                    kind = self._types[column]
                    faulty |= (kind == _UNUSED[0]) | (kind == _UNUSED[1])
