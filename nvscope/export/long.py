"""Values with a row a variable and telegram, all lists in one file.

What a value is decides in which column it stands; the others are null:

    ========  =====================================================================================
    integer   BOOL as 0 and 1, integers that an int64 holds, ENUM; times in nanoseconds (TIME, LTIME
              and times of day as durations, dates since 1970-01-01)
    unsigned  ULINT, LWORD, and the nanoseconds of a time that an int64 does not hold
    real      REAL, LREAL
    text      STRING, WSTRING; of an ENUM the name of its number
    bytes     what nobody has described
    ========  =====================================================================================
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from dissectors.batch import I64
from nvscope.capture.spans import stretches
from nvscope.definition.variables import Element, Enumeration
from nvscope.export.arrays import LABEL, MOMENT, array_of, bits_of, labels, spread_parts, with_nulls
from nvscope.export.files import TableFile
from nvscope.export.names import value_names
from nvscope.expression.typed_columns import FieldType, Numbers
from nvscope.list_key import ANY_CHANNEL, ListKey, Transport
from nvscope.view.rows.defined import DefinedRows, Place
from nvscope.view.rows.utf8 import Utf8Column
from nvscope.view.rows.values import ColumnDecoder, SpanColumn, ValueColumn, fits_time, value_type

PIECE_VALUES = 1 << 18
PIECE_BYTES = 8 << 20

_COLUMNS = pa.schema(
    [
        pa.field("frame.time", MOMENT),
        pa.field("frame.number", pa.int64()),
        pa.field("ip.src", LABEL),
        pa.field("can.channel", LABEL),
        pa.field("can.id", pa.uint16()),
        pa.field("list", LABEL),
        pa.field("list_name", LABEL),
        pa.field("nv.subindex", pa.uint16()),
        pa.field("variable", LABEL),
        pa.field("type", LABEL),
        pa.field("integer", pa.int64()),
        pa.field("unsigned", pa.uint64()),
        pa.field("real", pa.float64()),
        pa.field("text", pa.string()),
        pa.field("bytes", pa.binary()),
    ]
)
_ONLY_ON = {Transport.UDP: ("ip.src", "nv.subindex"), Transport.CAN: ("can.channel", "can.id")}


def long_schema(keys: Sequence[ListKey]) -> Any:
    """Return the columns for some lists: where all are on UDP or all on CAN, without what only the others have."""
    transports = {key.transport for key in keys}
    unknown = {name for transport, names in _ONLY_ON.items() if transport not in transports for name in names}
    return pa.schema([column for column in _COLUMNS if column.name not in unknown])


class LongTable:
    """Writes the values of telegrams in the order of the capture, those of one telegram as they are declared.

    ``file`` is of ``long_schema``.
    """

    def __init__(
        self,
        places: Sequence[Place],
        keys: Sequence[ListKey],
        senders: Callable[[], Sequence[str]],
        file: TableFile,
    ) -> None:
        self._places = places
        self._keys = keys
        self._list_names = [place.layout.list.name for place in places]
        self._senders = senders
        self._file = file
        self._decoders = [ColumnDecoder(place.layout) for place in places]
        elements = [element for place in places for element in place.elements]
        self._variables = [element.name for element in elements]
        self._types = [element.type.name for element in elements]
        self._elements = np.array([len(place.elements) for place in places], np.int64)
        self._first = np.cumsum(self._elements) - self._elements
        self._list = np.array([place.number for place in places], np.int64)
        self._on_can = np.array([place.layout.list.on_can for place in places], np.bool_)
        self._cob_id = np.array([place.layout.list.list_id or 0 for place in places], np.int64)
        self._schema = long_schema(keys)
        self.telegrams = self.rows = 0

    def add(self, rows: DefinedRows) -> None:
        """Write the values of the telegrams of a batch."""
        # A telegram of many values weighs as if it were longer, so that both are bounded by one number.
        weight = np.maximum(self._elements[rows.place] * (PIECE_BYTES // PIECE_VALUES), rows.size_bytes)
        for piece in stretches(weight, PIECE_VALUES, PIECE_BYTES):
            self._write(rows.take(piece))

    def finish(self) -> None:
        """Write what stands at the end."""
        self._file.close()

    def _write(self, rows: DefinedRows) -> None:
        elements = self._elements[rows.place]
        after = np.cumsum(elements)
        start = after - elements
        cells = _Cells(int(after[-1]))
        for number, which in rows.by_place():
            place = self._places[number]
            size_bytes = place.layout.layout.size_bytes
            columns = self._decoders[number].columns(rows.bytes_of(which, size_bytes))
            if place.rest is not None:
                columns.append(rows.bytes_behind(which, size_bytes))
            for position, (element, column) in enumerate(zip(place.elements, columns, strict=True)):
                cells.put(start[which] + position, element, column)
        places = np.repeat(rows.place, elements)
        told = self._first[places] + np.arange(cells.count) - np.repeat(start, elements)
        sender, subindex = np.repeat(rows.sender, elements), np.repeat(rows.subindex, elements)
        on_can = self._on_can[places]
        arrays = [
            array_of(np.repeat(rows.ts_ns, elements), MOMENT),
            array_of(np.repeat(rows.frame, elements), pa.int64()),
            labels(sender, self._senders(), ~on_can),
            labels(sender, self._senders(), on_can),
            with_nulls((self._cob_id[places] + subindex).astype(np.uint16), bits_of(on_can), pa.uint16()),
            self._lists(self._list[places], sender),
            labels(places, self._list_names),
            with_nulls(subindex.astype(np.uint16), bits_of(~on_can), pa.uint16()),
            labels(told, self._variables),
            labels(told, self._types),
            *cells.arrays(),
        ]
        kept = [array for array, column in zip(arrays, _COLUMNS, strict=True) if column in self._schema]
        self._file.write(pa.table(kept, schema=self._schema))
        self.telegrams += len(rows)
        self.rows += cells.count

    def _lists(self, number: I64, sender: I64) -> Any:
        """Return the keys of lists; one that is defined for any CAN channel has that of the frame."""
        if all(key.port != ANY_CHANNEL for key in self._keys):
            return labels(number, [str(key) for key in self._keys])
        senders = self._senders()
        texts = [
            str(ListKey.can(sent, key.identifier) if key.port == ANY_CHANNEL else key)
            for key in self._keys
            for sent in senders
        ]
        return labels(number * len(senders) + sender, texts)


class _Cells:
    """The columns of values while they are put together from those of the variables."""

    def __init__(self, count: int) -> None:
        self.count = count
        self._numbers: dict[str, tuple[Numbers, Any]] = {
            name: (np.zeros(count, dtype), np.zeros(count, np.bool_))
            for name, dtype in (("integer", np.int64), ("unsigned", np.uint64), ("real", np.float64))
        }
        self._texts: list[tuple[I64, Any]] = []
        self._bytes: list[tuple[I64, Any]] = []

    def put(self, at: I64, element: Element, column: ValueColumn) -> None:
        """Take the values of an element, whose rows are ``at``."""
        if isinstance(column, Utf8Column):
            self._texts.append((at, array_of(column, pa.string())))
            return
        if isinstance(column, SpanColumn) or column.ndim == 2:
            self._bytes.append((at, array_of(column, pa.binary())))
            return
        if column.dtype == np.uint64 and value_type(element.type) is not FieldType.UNSIGNED:
            fits = fits_time(column)
            self._put_numbers("integer", at[fits], column[fits])
            self._put_numbers("unsigned", at[~fits], column[~fits])
            return
        self._put_numbers(
            "real" if column.dtype.kind == "f" else "unsigned" if column.dtype == np.uint64 else "integer", at, column
        )
        if isinstance(element.type, Enumeration):
            code, texts = value_names(element.type, column)
            named = code >= 0
            self._texts.append((at[named], labels(code[named], texts).cast(pa.string())))

    def _put_numbers(self, name: str, at: I64, column: Numbers) -> None:
        values, valid = self._numbers[name]
        with np.errstate(invalid="ignore"):  # of the many kinds of NaN, some cannot be widened as they are
            values[at] = column
        valid[at] = True

    def arrays(self) -> list[Any]:
        """Return the columns."""
        kinds = (pa.int64(), pa.uint64(), pa.float64())
        numbers = [
            with_nulls(values, bits_of(valid), kind)
            for (values, valid), kind in zip(self._numbers.values(), kinds, strict=True)
        ]
        return [
            *numbers,
            spread_parts(self._texts, self.count, pa.string()),
            spread_parts(self._bytes, self.count, pa.binary()),
        ]
