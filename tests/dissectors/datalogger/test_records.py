"""Records of SQLite by columns: what of any bytes is a record, and no other bytes, is read; nothing raises.

That values are those of SQLite is a law of ``tests/capture/datalogger/test_rows.py``.
"""

from __future__ import annotations

import struct

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dissectors.datalogger.records import Form, Records
from dissectors.datalogger.varints import varints

_SIZES = (0, 1, 2, 3, 4, 6, 8, 8, 0, 0)

Value = tuple[int, object]


def varint(number: int) -> bytes:
    """Return a number from 0 on in as few bytes as it takes."""
    if number >> 56:
        return bytes([number >> 57 & 0x7F | 0x80]) + _lower(number >> 8, 7) + bytes([number & 0xFF])
    count = max(1, -(-number.bit_length() // 7))
    return _lower(number, count)[:-1] + bytes([number & 0x7F])


def _lower(number: int, count: int) -> bytes:
    return bytes(number >> 7 * place & 0x7F | 0x80 for place in range(count - 1, -1, -1))


@given(st.lists(st.integers(0, (1 << 64) - 1) | st.integers(0, 300), min_size=1, max_size=20), st.data())
def test_integers_of_any_length_are_read_and_those_that_do_not_end_are_none(
    numbers: list[int], data: st.DataObject
) -> None:
    numbers = [number if not number >> 56 else number | 1 << 63 for number in numbers]
    parts = [varint(number) for number in numbers]
    stop = np.cumsum([len(part) for part in parts])
    start = stop - np.array([len(part) for part in parts])
    less = np.array([data.draw(st.integers(0, len(part))) for part in parts])
    value, used = varints(np.frombuffer(b"".join(parts), np.uint8), start, stop - less)
    for number, part, missing, found, length in zip(parts and numbers, parts, less, value, used, strict=True):
        if missing:
            assert length == 0
        else:
            assert length == len(part)
            assert int(found) % (1 << 64) == number


def record(values: list[tuple[int, bytes]]) -> bytes:
    """Return a record of types and bodies."""
    types = b"".join(varint(kind) for kind, _ in values)
    size = len(types) + 1
    size += size > 127
    return varint(size) + types + b"".join(body for _, body in values)


def size_of(kind: int) -> int:
    return _SIZES[kind] if kind < len(_SIZES) else 0 if kind < 12 else (kind - 12) // 2


def value_of(kind: int, body: bytes) -> tuple[Form, object]:
    """Return what a value is, by the document of the format."""
    if kind in (0, 10, 11) or (kind == 7 and np.isnan(struct.unpack(">d", body)[0])):
        return Form.NULL, None
    if kind in (8, 9):
        return Form.INTEGER, kind - 8
    if kind == 7:
        return Form.REAL, struct.unpack(">d", body)[0]
    if kind < 7:
        return Form.INTEGER, int.from_bytes(body, "big", signed=True)
    return (Form.TEXT if kind % 2 else Form.BLOB), body


_kinds = st.sampled_from([0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 13, 20, 65, 127, 128, 129, 400]) | st.sampled_from(
    [10, 11]
)
_values = _kinds.flatmap(
    lambda kind: st.binary(min_size=size_of(kind), max_size=size_of(kind)).map(lambda body: (kind, body))
)


@given(st.lists(st.lists(_values, max_size=5), max_size=12), st.integers(0, 4), st.data())
def test_values_are_what_the_format_says(
    rows: list[list[tuple[int, bytes]]], columns: int, data: st.DataObject
) -> None:
    between = data.draw(st.binary(max_size=3))
    parts = [record(row) for row in rows]
    offset, at = [], 0
    for part in parts:
        offset.append(at + len(between))
        at += len(between) + len(part)
    raw = np.frombuffer(b"".join(between + part for part in parts), np.uint8)
    found = Records(raw, np.array(offset, np.int64), np.array([len(part) for part in parts], np.int64), columns)
    good = [len(row) <= columns and all(kind not in (10, 11) for kind, _ in row) for row in rows]
    assert found.faulty.tolist() == [not one for one in good]
    for column in range(columns):
        cells = found.cells(column)
        filled = found.filled(column)
        assert found.is_empty(column) == (not filled.any())
        for row, values in enumerate(rows):
            stored = good[row] and column < len(values)
            form, value = value_of(*values[column]) if stored else (Form.NULL, None)
            assert cells.form[row] == form
            if form == Form.INTEGER:
                assert cells.integers[row] == value
            elif form == Form.REAL:
                assert cells.bits[row : row + 1].view(np.float64)[0] == value
            elif form != Form.NULL:
                assert found.data[cells.start[row] : cells.stop[row]].tobytes() == value
        some = np.flatnonzero(filled)
        part = found.cells(column, some)
        assert part.form.tolist() == cells.form[some].tolist()
        assert part.bits.tolist() == cells.bits[some].tolist()


@given(st.binary(max_size=80), st.data(), st.integers(0, 6))
def test_any_bytes_are_read_without_an_error_and_from_within(raw: bytes, data: st.DataObject, columns: int) -> None:
    ends = data.draw(st.lists(st.tuples(st.integers(0, len(raw)), st.integers(0, len(raw))), max_size=10))
    offset = np.array([min(one) for one in ends], np.int64)
    length = np.array([max(one) - min(one) for one in ends], np.int64)
    found = Records(np.frombuffer(raw, np.uint8), offset, length, columns, real=range(columns))
    for column in range(columns):
        cells = found.cells(column)
        long = (cells.form == Form.TEXT) | (cells.form == Form.BLOB)
        assert (cells.start[long] >= offset[long]).all()
        assert (cells.stop[long] <= (offset + length)[long]).all()
        assert not (cells.form == Form.INTEGER).any()
