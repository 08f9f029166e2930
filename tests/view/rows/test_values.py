"""Columns of values: each is what ``value_of`` says of the same bytes, whatever the bytes are."""

from __future__ import annotations

import struct
from math import isnan

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from nvscope.definition.packing import pack
from nvscope.definition.scalars import SCALARS
from nvscope.definition.value import Value, value_of
from nvscope.definition.variables import Elementary, Enumeration, String
from nvscope.expression.typed_columns import FieldType
from nvscope.view.rows.utf8 import Utf8Column, latin_column, utf16_column
from nvscope.view.rows.values import ColumnDecoder, ValueColumn, value_type
from tests.definition.lists import SCALARS as DRAWN
from tests.definition.lists import list_of

KINDS = st.one_of(
    DRAWN,
    st.sampled_from([scalar for scalar in SCALARS.values() if scalar.size_bytes]),
    st.builds(String, st.integers(0, 300), st.booleans()),
)
# Halves of characters, NULs and letters outside ASCII are rare among random bytes.
PIECES = [b"\0", b"\0\0", b"A", b"\x80", b"\xff", "é".encode("utf-16-le"), b"\x3d\xd8", b"\x00\xde", b"\xff\xff"]
BYTES = st.one_of(st.binary(max_size=40), st.lists(st.sampled_from(PIECES), max_size=20).map(b"".join))


def plain(column: ValueColumn, kind: Elementary) -> list[Value]:
    """Return a column as ``value_of`` gives its values; times in the unit of their type."""
    if isinstance(column, Utf8Column):
        return list(column.texts())
    if column.ndim == 2:
        return [row.tobytes() for row in column]
    unit_ns = getattr(kind, "unit_ns", 0)
    if unit_ns and value_type(kind) in (FieldType.DURATION, FieldType.TIME):
        assert column.dtype == (np.uint64 if unit_ns == 1 else np.int64)
        assert not (column % unit_ns).any()
        column = column // unit_ns
    return list(column.tolist())


def same(left: Value, right: Value) -> bool:
    """Tell whether two values are the same, NaN with NaN, and of one type."""
    if isinstance(left, float) and isinstance(right, float):
        return struct.pack("<d", left) == struct.pack("<d", right) or (isnan(left) and isnan(right))
    return type(left) is type(right) and left == right


@settings(deadline=None)
@given(st.lists(KINDS, min_size=1, max_size=8), st.lists(BYTES, min_size=1, max_size=20), st.integers(0, 3))
def test_a_column_holds_what_each_of_its_bytes_mean(kinds: list[Elementary], pieces: list[bytes], turn: int) -> None:
    (layout, *_) = pack(list_of(kinds))
    size_bytes = layout.layout.size_bytes
    rows = [(piece * (size_bytes // max(1, len(piece)) + 2))[turn : turn + size_bytes] for piece in pieces]
    rows = [row.ljust(size_bytes, b"\x01") for row in rows]
    data = np.frombuffer(b"".join(rows), np.uint8).reshape(len(rows), size_bytes)
    columns = ColumnDecoder(layout).columns(data)
    assert len(columns) == len(layout.elements)
    for (offset, element), column in zip(layout.spans(), columns, strict=True):
        expected = [value_of(element.type, row[offset : offset + element.type.size_bytes]) for row in rows]
        found = plain(column, element.type)
        assert len(found) == len(expected)
        assert all(map(same, found, expected)), (element, found, expected)


def test_no_telegrams_give_columns_without_rows() -> None:
    kinds = [SCALARS["BOOL"], String(5), String(5, wide=True), SCALARS["CHAR"], SCALARS["LREAL"]]
    (layout,) = pack(list_of(kinds))
    for column in ColumnDecoder(layout).columns(np.empty((0, layout.layout.size_bytes), np.uint8)):
        assert len(column) == 0


def test_half_a_character_is_replaced_and_a_whole_one_is_not() -> None:
    whole, high, low = "a😀b".encode("utf-16-le"), b"\x3d\xd8", b"\x00\xde"
    rows = [whole, high + b"a\0" + low + b"b\0", high + high + low + b"\0\0", b"\0\0" + whole[:6]]
    texts = utf16_column(np.frombuffer(b"".join(rows), np.uint8).reshape(4, 8)).texts()
    assert texts == ["a😀b", "\ufffda\ufffdb", "\ufffd😀", ""]
    assert texts == [row.decode("utf-16-le", errors="replace").partition("\0")[0] for row in rows]


def test_letters_outside_ascii() -> None:
    cells = np.frombuffer("Größe\0xx°C\0\0\0\0\0\0".encode("latin-1"), np.uint8).reshape(2, 8)
    column = latin_column(cells)
    assert column.texts() == ["Größe", "°C"]
    assert column.offset.tolist() == [0, 7, 10]


def test_many_texts_are_as_one_at_a_time() -> None:
    rng = np.random.default_rng(3)
    cells = rng.integers(0, 256, (9_000, 256), np.uint8)
    rows = [row.tobytes() for row in cells]
    assert latin_column(cells).texts() == [row.decode("latin-1").partition("\0")[0] for row in rows]
    wide = [row.decode("utf-16-le", errors="replace").partition("\0")[0] for row in rows]
    assert utf16_column(cells).texts() == wide


def test_times_of_64_bits_stay_exact_numbers() -> None:
    (layout,) = pack(list_of([SCALARS["LTIME"], SCALARS["LDT"]]))
    (time, moment) = ColumnDecoder(layout).columns(np.full((1, 16), 0xFF, np.uint8))
    assert isinstance(time, np.ndarray)
    assert isinstance(moment, np.ndarray)
    assert time.tolist() == moment.tolist() == [(1 << 64) - 1]


def test_an_enumeration_is_its_number() -> None:
    kind = Enumeration("eAny", SCALARS["INT"], {"eOff": 0})
    assert value_type(kind) is FieldType.SIGNED
