"""Columns of fields as text, a whole column at once: as people and spreadsheets read them, and as JSON."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from math import isfinite

import numpy as np

from dissectors import address
from dissectors.batch import Bool
from nvscope.expression.typed_columns import AddressColumn, BytesColumn, FieldType, Numbers, TextColumn
from nvscope.view.escape import json_text, visible
from nvscope.view.fields.field import TelegramField
from nvscope.view.lines import moments
from nvscope.view.rows.frames import FrameRows

_BITS = ("0", "1")
_JSON_BITS = ("false", "true")
_NULL = "null"


def texts(
    field: TelegramField, rows: FrameRows, shown: Callable[[str], str] = visible, *, raw: bool = False
) -> list[str]:
    """Return a field as Wireshark writes it; empty where it does not exist.

    Numbers decimal or with 0x, times in seconds, bytes as hexadecimal digits, bits as 0 and 1; of real numbers that are
    no numbers, NaN, inf and -inf; of a field that a frame has several times all of them, with commas in between.
    ``shown`` makes what a text may hold safe for where it is written. ``raw``: numbers are those of JSON, decimal
    (programs take one with 0x for a text), times but dates in nanoseconds, and the first one only unless they are
    ``listed``.
    """
    cells = _own_texts(field, rows, shown, raw=raw)
    for one in _further(field, rows) if listed(field) or not raw else ():
        further = _own_texts(one, rows, shown, raw=raw)
        cells = [f"{cell},{more}" if more else cell for cell, more in zip(cells, further, strict=True)]
    return cells


def listed(field: TelegramField) -> bool:
    """Tell whether JSON has a field as an array of all that a frame has; of numbers it is the first one, a number."""
    return bool(field.further) and field.type is FieldType.TEXT


def _further(field: TelegramField, rows: FrameRows) -> Iterator[TelegramField]:
    """Yield the fields of what some frame has once more."""
    for one in field.further:
        exists = one.exists(rows)
        if exists is not None and not exists.any():
            return
        yield one


def _own_texts(field: TelegramField, rows: FrameRows, shown: Callable[[str], str], *, raw: bool) -> list[str]:
    column = field.column(rows)
    if isinstance(column, AddressColumn):
        cells = addresses(column)
    elif isinstance(column, BytesColumn):
        cells = hexadecimal(column, field.separator)
    elif isinstance(column, TextColumn):
        safe = [shown(text) for text in column.texts]
        cells = [safe[code] for code in column.code.tolist()]
    else:
        cells = _number_texts(field, column, raw=raw)
    return _where_known(cells, field.exists(rows), "")


def json_texts(field: TelegramField, rows: FrameRows) -> list[str]:
    """Return a field as JSON values; null where it does not exist.

    Numbers and bits are what they are in JSON, null where they are not finite. Absolute times are strings of
    nanoseconds, since JavaScript cannot hold them as numbers, or of the date; durations are numbers of nanoseconds.
    Bytes are strings of hexadecimal digits. Of a field that a frame may have several times, it is the first one, or an
    array of all if they are ``listed``.
    """
    cells = _own_json_texts(field, rows)
    if not listed(field):
        return cells
    several = [cells, *(_own_json_texts(one, rows) for one in _further(field, rows))]
    told = (",".join(cell for cell in row if cell != _NULL) for row in zip(*several, strict=True))
    return [f"[{one}]" if one else _NULL for one in told]


def _own_json_texts(field: TelegramField, rows: FrameRows) -> list[str]:
    column = field.column(rows)
    if isinstance(column, AddressColumn):
        cells = _quoted(addresses(column))
    elif isinstance(column, BytesColumn):
        cells = _quoted(hexadecimal(column, field.separator))
    elif isinstance(column, TextColumn):
        quoted = [json_text(text) for text in column.texts]
        cells = [quoted[code] for code in column.code.tolist()]
    elif field.type is FieldType.BOOL:
        cells = [_JSON_BITS[bit] for bit in column.tolist()]
    elif field.type is FieldType.TIME:
        cells = _quoted(moments.iso(column, zoned=field.zoned) if field.calendar else map(str, column.tolist()))
    elif field.type is FieldType.REAL:
        cells = [text if isfinite(float(text)) else _NULL for text in map(str, column)]
    else:
        cells = list(map(str, column.tolist()))
    return _where_known(cells, field.exists(rows), _NULL)


def addresses(column: AddressColumn) -> list[str]:
    """Return addresses as people write them."""
    pairs = list(zip(column.high.tolist(), column.low.tolist(), strict=True))
    told = {pair: address.text(*pair) for pair in set(pairs)}
    return [told[pair] for pair in pairs]


def hexadecimal(column: BytesColumn, separator: str = "") -> list[str]:
    """Return bytes as pairs of lower-case hexadecimal digits, with what separates them in between."""
    data = column.data.data
    spans = zip(column.start.tolist(), column.stop.tolist(), strict=True)
    if separator:
        return [data[start:stop].hex(separator) for start, stop in spans]
    return [data[start:stop].hex() for start, stop in spans]


def _number_texts(field: TelegramField, column: Numbers, *, raw: bool) -> list[str]:
    if field.type is FieldType.BOOL:
        return [_BITS[bit] for bit in column.tolist()]
    if field.in_nanoseconds and not raw:
        return moments.seconds(column)
    if field.type is FieldType.TIME and field.calendar:
        return moments.iso(column, zoned=field.zoned)
    if field.type is FieldType.REAL:
        # As short as tells them from their neighbours of the same width.
        cells = list(map(str, column))
        for row in np.flatnonzero(np.isnan(column)).tolist():
            cells[row] = "NaN"
        return cells
    if raw or not field.hex_digits:
        return list(map(str, column.tolist()))
    pattern = f"0x%0{field.hex_digits}x"
    return [pattern % number for number in column.tolist()]


def _quoted(cells: Iterable[str]) -> list[str]:
    """Quote texts in which nothing needs an escape."""
    return [f'"{cell}"' for cell in cells]


def _where_known(cells: list[str], known: Bool | None, otherwise: str) -> list[str]:
    if known is not None:
        for row in np.flatnonzero(~known).tolist():
            cells[row] = otherwise
    return cells
