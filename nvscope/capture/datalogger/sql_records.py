"""Records of rows that SQLite handed over, as SQLite would store them: so these are read like all others."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, U8
from dissectors.datalogger.records import Form
from nvscope.capture.datalogger.sql_rows import SqlRows

_WIDTHS = {1: 1, 2: 2, 3: 3, 4: 4, 6: 5, 8: 6}
_REAL, _BLOB, _TEXT = 7, 12, 13


def as_records(rows: SqlRows, columns: int) -> tuple[U8, I64, I64]:
    """Return records of rows, one behind the other: the buffer, where each begins, and how long it is."""
    content = rows.data.tobytes()
    types: list[list[bytes]] = [[] for _ in range(len(rows))]
    bodies: list[list[bytes]] = [[] for _ in range(len(rows))]
    for column in range(columns):
        cells = rows.cells(column)
        told = (cells.form, cells.bits, cells.integers, cells.start, cells.stop)
        for place, (form, bits, whole, start, stop) in enumerate(zip(*(one.tolist() for one in told), strict=True)):
            kind, body = _value(form, bits, whole, content[start:stop])
            types[place].append(_varint(kind))
            bodies[place].append(body)
    records = [_record(b"".join(kinds), b"".join(body)) for kinds, body in zip(types, bodies, strict=True)]
    length = np.array([len(record) for record in records], np.int64)
    return np.frombuffer(b"".join(records), np.uint8), np.cumsum(length) - length, length


def _value(form: int, bits: int, whole: int, content: bytes) -> tuple[int, bytes]:
    """Return the type of a value and its bytes."""
    if form == Form.INTEGER:
        size = next(size for size in _WIDTHS if -(1 << 8 * size - 1) <= whole < 1 << 8 * size - 1)
        return _WIDTHS[size], whole.to_bytes(size, "big", signed=True)
    if form == Form.REAL:
        return _REAL, bits.to_bytes(8, "big")
    if form == Form.NULL:
        return 0, b""
    return 2 * len(content) + (_TEXT if form == Form.TEXT else _BLOB), content


def _record(types: bytes, body: bytes) -> bytes:
    head_bytes = next(size for size in range(1, 10) if len(_varint(len(types) + size)) == size)
    return _varint(len(types) + head_bytes) + types + body


def _varint(value: int) -> bytes:
    parts = [value & 0x7F]
    while value := value >> 7:
        parts.append(value & 0x7F | 0x80)
    return bytes(reversed(parts))
