"""The variables of many telegrams at once: one column an element.

What a value is, is said in ``nvscope.definition.value``; here whole columns of it are made, without a step a telegram.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import U8
from nvscope.definition.model import Elementary, Kind, String, scalar_of
from nvscope.definition.packing import TelegramLayout
from nvscope.expression.columns import FieldType, Numbers
from nvscope.tracker.values import Block, blocks_of
from nvscope.view.utf8 import Utf8Column, latin_column, utf16_column

ValueColumn = Numbers | Utf8Column
"""Numbers, bools, int64 nanoseconds (n,), texts, or bytes as uint8 of shape (n, bytes)."""

_TYPES = {
    Kind.BOOL: FieldType.BOOL,
    Kind.UNSIGNED: FieldType.UNSIGNED,
    Kind.SIGNED: FieldType.SIGNED,
    Kind.REAL: FieldType.REAL,
    Kind.DURATION: FieldType.DURATION,
    Kind.TIME_OF_DAY: FieldType.DURATION,
    Kind.DATE: FieldType.TIME,
    Kind.DATE_AND_TIME: FieldType.TIME,
    Kind.RAW: FieldType.BYTES,
}
_TABLE_BYTES = 256 << 10
"""Telegrams that are turned into columns in one go: few enough to stay in the cache while they are."""


def value_type(kind: Elementary) -> FieldType:
    """Return what the column of an element holds.

    TIME and the time of day are DURATION, the latter since midnight: a controller may send one beyond 24 h. DATE and DT
    are TIME, that of the controller, which need not be UTC. Times of 64 bits stay numbers of nanoseconds (UNSIGNED),
    since no signed one holds all of them. An ENUM is its number, what nobody has described is BYTES.
    """
    if isinstance(kind, String):
        return FieldType.TEXT
    scalar = scalar_of(kind)
    if scalar is None:
        return FieldType.BYTES
    return FieldType.UNSIGNED if scalar.unit_ns and scalar.size_bytes == 8 else _TYPES[scalar.kind]


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
    if column_type in (FieldType.DURATION, FieldType.TIME):
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
