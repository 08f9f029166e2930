"""The header fields of telegrams as tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from dissectors import address
from dissectors.batch import Bool
from nvscope.export.arrays import LABEL, MOMENT, arrow_type, labels, numbers_of, spans_of
from nvscope.export.files import TableFile
from nvscope.expression.typed_columns import AddressColumn, BytesColumn, FieldType, TextColumn
from nvscope.view.fields.field import TelegramField, times_beyond
from nvscope.view.rows.frames import FrameRows

GROUP_ROWS = 1 << 17
GROUP_BYTES = 32 << 20


class TelegramTable:
    """Writes fields of telegrams, a column each; pieces are collected until they are a row group.

    ``beyond_time`` counts the times that no column of times holds: they are null.
    """

    def __init__(self, fields: Sequence[TelegramField]) -> None:
        self._fields = list({field.name: field for field in fields}.values())
        self.schema = pa.schema([pa.field(field.name, _type(field)) for field in self._fields])
        self._pieces: list[Any] = []
        self._rows = self._bytes = self.beyond_time = 0
        self._file: TableFile | None = None

    def open(self, file: TableFile) -> None:
        """Say where to write, to a file of ``schema``."""
        self._file = file

    def add(self, rows: FrameRows) -> None:
        """Take some telegrams."""
        arrays = [_array(field, rows) for field in self._fields]
        table = pa.table(arrays, schema=self.schema)
        self._pieces.append(table)
        self._rows += len(table)
        self.beyond_time += times_beyond(self._fields, rows)
        self._bytes += table.nbytes
        if self._rows >= GROUP_ROWS or self._bytes >= GROUP_BYTES:
            self._flush()

    def finish(self) -> None:
        """Write what is held, and what stands at the end."""
        if self._pieces:
            self._flush()
        assert self._file
        self._file.close()

    def _flush(self) -> None:
        assert self._file
        self._file.write(pa.concat_tables(self._pieces).unify_dictionaries())
        self._pieces.clear()
        self._rows = self._bytes = 0


def _type(field: TelegramField) -> Any:
    if field.type is FieldType.TIME and field.zoned:
        return MOMENT
    if field.type in (FieldType.ADDRESS, FieldType.TEXT):
        return LABEL
    # Every number of a header fits; one width for all, whatever column a field is read as.
    return arrow_type(field.type, {FieldType.REAL: "f8", FieldType.SIGNED: "i8"}.get(field.type, "u8"))


def _array(field: TelegramField, rows: FrameRows) -> Any:
    column, known = field.column(rows), field.exists(rows)
    if isinstance(column, AddressColumn):
        pairs, place = np.unique(np.stack([column.high, column.low]), axis=1, return_inverse=True)
        return labels(place.reshape(-1), [address.text(*pair) for pair in pairs.T.tolist()], known)
    if isinstance(column, TextColumn):
        return labels(column.code, column.texts, known)
    if isinstance(column, BytesColumn):
        return _bytes(column, known)
    kind = _type(field)
    mask = None if known is None else ~known
    if kind == pa.bool_():
        return numbers_of(column, mask)
    dtype = np.dtype("u8") if field.type is FieldType.UNSIGNED else column.dtype.newbyteorder("=")
    numbers = numbers_of(column.astype(dtype), mask)
    return numbers if numbers.type == kind else numbers.cast(kind)


def _bytes(column: BytesColumn, known: Bool | None) -> Any:
    data = column.data.data
    spans = zip(column.start.tolist(), column.stop.tolist(), strict=True)
    parts = [data[start:stop].tobytes() for start, stop in spans]
    return spans_of(parts, pa.binary(), None if known is None else ~known)
