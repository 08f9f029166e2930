"""The variables of many telegrams at once: one column an element.

What a value is, is said in ``nvscope.definition.value``; here whole columns of it are made, without a step a telegram.
"""

from __future__ import annotations

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, Bool
from nvscope.definition.packing import TelegramLayout
from nvscope.definition.variables import Elementary, ScalarKind, String, scalar_of
from nvscope.expression.typed_columns import FieldType, Numbers
from nvscope.tracker.variables.values import Block, blocks_of
from nvscope.view.rows.utf8 import Utf8Column, latin_column, utf16_column


class SpanColumn(Struct, frozen=True):
    """Bytes, of any number in each row: those of row i are ``data[offset[i] : offset[i + 1]]``; offsets int64."""

    offset: I64
    data: U8

    def __len__(self) -> int:
        return len(self.offset) - 1


ValueColumn = Numbers | Utf8Column | SpanColumn
"""Numbers, bools, nanoseconds (n,), texts, or bytes, where all have as many as uint8 of shape (n, bytes).

Nanoseconds are int64; those of times of 64 bits are uint64 as they were sent: ``fits_time`` tells which are no more
than an int64 holds.
"""

MOST_TIME_NS = np.iinfo(np.int64).max
"""The longest duration, 292 years, and the last moment, in the year 2262, that columns of times hold."""

_TYPES = {
    ScalarKind.BOOL: FieldType.BOOL,
    ScalarKind.UNSIGNED: FieldType.UNSIGNED,
    ScalarKind.SIGNED: FieldType.SIGNED,
    ScalarKind.REAL: FieldType.REAL,
    ScalarKind.DURATION: FieldType.DURATION,
    ScalarKind.TIME_OF_DAY: FieldType.DURATION,
    ScalarKind.DATE: FieldType.TIME,
    ScalarKind.DATE_AND_TIME: FieldType.TIME,
    ScalarKind.RAW: FieldType.BYTES,
}
_TABLE_BYTES = 256 << 10
"""Telegrams that are turned into columns in one go: few enough to stay in the cache while they are."""


def value_type(kind: Elementary) -> FieldType:
    """Return what the column of an element holds.

    Times of day are durations since midnight: a controller may send one beyond 24 h. Dates are TIME, that of the
    controller, which need not be UTC. An ENUM is its number, what nobody has described is BYTES.
    """
    if isinstance(kind, String):
        return FieldType.TEXT
    scalar = scalar_of(kind)
    return _TYPES[scalar.kind] if scalar else FieldType.BYTES


def fits_time(column: Numbers) -> Bool:
    """Tell which nanoseconds are no more than ``MOST_TIME_NS``."""
    fits: Bool = column <= column.dtype.type(MOST_TIME_NS)
    return fits


class ColumnDecoder:
    """Turns the data of telegrams of one layout into columns."""

    def __init__(self, layout: TelegramLayout) -> None:
        self.layout = layout
        self._blocks = blocks_of(layout)

    def columns(self, data: U8) -> list[ValueColumn]:
        """Return a column for each element of the layout; ``data`` are the bytes behind the headers, (n, bytes)."""
        return [column for block in self._blocks for column in _columns(block, data)]


def _columns(block: Block, data: U8) -> list[ValueColumn]:
    kind = block.type
    scalar = scalar_of(kind)
    column_type = value_type(kind)
    if column_type in (FieldType.TEXT, FieldType.BYTES):
        table = _table(block, data, f"V{kind.size_bytes}")
        cells = [row.view(np.uint8).reshape(len(data), kind.size_bytes) for row in table]
        if not isinstance(kind, String):
            return list(cells)
        return [utf16_column(cell) if kind.wide else latin_column(cell) for cell in cells]
    assert scalar is not None
    table = _table(block, data, scalar.dtype)
    if column_type is FieldType.BOOL:
        return list(table != 0)
    if scalar.unit_ns > 1:
        return list(table.astype(np.int64) * scalar.unit_ns)
    return list(table)


def _table(block: Block, data: U8, dtype: str) -> Numbers:
    """Return the elements of a block with a row an element and a column a telegram."""
    count, size_bytes = len(data), data.shape[1]
    table: Numbers = np.empty((block.count, count), dtype)
    strides = size_bytes, block.type.size_bytes
    step = max(1, _TABLE_BYTES // size_bytes)
    for begin in range(0, count, step):
        part = data[begin : begin + step]
        cells: Numbers = np.ndarray((len(part), block.count), dtype, part, block.offset_bytes, strides)
        table[:, begin : begin + step] = cells.T
    return table
