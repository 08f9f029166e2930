"""Values with a row a variable and telegram, all lists in one file.

What a value is decides in which column it stands; the others are null:

    ========  =====================================================================================
    integer   BOOL as 0 and 1, integers that an int64 holds, ENUM; times in nanoseconds (TIME and
              the time of day as durations, DATE and DT since 1970-01-01)
    unsigned  ULINT, LWORD, and times of 64 bits in nanoseconds
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
from nvscope.definition.model import Enumeration
from nvscope.definition.packing import TelegramLayout
from nvscope.export.arrays import LABEL, MOMENT, array_of, bits_of, labels, with_nulls
from nvscope.export.files import TableFile
from nvscope.export.names import value_names
from nvscope.expression.columns import Numbers
from nvscope.view.defined_telegrams import DefinedRows
from nvscope.view.utf8 import Utf8Column
from nvscope.view.value_columns import ColumnDecoder, ValueColumn

PIECE_VALUES = 1 << 18
PIECE_BYTES = 8 << 20

SCHEMA = pa.schema(
    [
        pa.field("frame.time", MOMENT),
        pa.field("frame.number", pa.int64()),
        pa.field("ip.src", LABEL),
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


class LongTable:
    """Writes the values of telegrams in the order of the capture, those of one telegram as they are declared."""

    def __init__(
        self,
        places: Sequence[tuple[int, TelegramLayout]],
        keys: Sequence[str],
        senders: Callable[[], Sequence[str]],
        file: TableFile,
    ) -> None:
        self._places = places
        self._keys = keys
        self._names = {number: layout.list.name for number, layout in places}
        self._senders = senders
        self._file = file
        self._decoders = [ColumnDecoder(layout) for _, layout in places]
        elements = [element for _, layout in places for element in layout.elements]
        self._variables = [element.name for element in elements]
        self._types = [element.type.name for element in elements]
        self._elements = np.array([len(layout.elements) for _, layout in places], np.int64)
        self._first = np.cumsum(self._elements) - self._elements
        self._list = np.array([number for number, _ in places], np.int64)
        self._subindex = np.array([layout.subindex for _, layout in places], np.uint16)
        self._bytes = np.array([layout.layout.size_bytes for _, layout in places], np.int64)
        self.telegrams = self.rows = 0

    def add(self, rows: DefinedRows) -> None:
        """Write the values of the telegrams of a batch."""
        # A telegram of many values weighs as if it were longer, so that both are bounded by one number.
        weight = np.maximum(self._elements * (PIECE_BYTES // PIECE_VALUES), self._bytes)
        for piece in stretches(weight[rows.place], PIECE_VALUES, PIECE_BYTES):
            self._write(rows.take(piece))

    def finish(self) -> None:
        """Write what stands at the end."""
        self._file.close()

    def _write(self, rows: DefinedRows) -> None:
        elements = self._elements[rows.place]
        after = np.cumsum(elements)
        start = after - elements
        cells = _Cells(int(after[-1]))
        for place, which in rows.by_place():
            size_bytes = int(self._bytes[place])
            columns = self._decoders[place].columns(rows.bytes_of(which, size_bytes))
            elements_here = self._places[place][1].elements
            for position, (element, column) in enumerate(zip(elements_here, columns, strict=True)):
                names = None
                if isinstance(element.type, Enumeration):
                    assert isinstance(column, np.ndarray)
                    names = value_names(element.type, column)
                cells.put(start[which] + position, column, names)
        places = np.repeat(rows.place, elements)
        told = self._first[places] + np.arange(cells.count) - np.repeat(start, elements)
        of_list = self._list[places]
        list_names = [self._names.get(number, "") for number in range(len(self._keys))]
        arrays = [
            array_of(np.repeat(rows.ts_ns, elements), MOMENT),
            array_of(np.repeat(rows.frame, elements), pa.int64()),
            labels(np.repeat(rows.sender, elements), self._senders()),
            labels(of_list, self._keys),
            labels(of_list, list_names),
            array_of(self._subindex[places], pa.uint16()),
            labels(told, self._variables),
            labels(told, self._types),
            *cells.arrays(),
        ]
        self._file.write(pa.table(arrays, schema=SCHEMA))
        self.telegrams += len(rows)
        self.rows += cells.count


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

    def put(self, at: I64, column: ValueColumn, names: tuple[I64, Sequence[str]] | None) -> None:
        """Take the values of a variable, whose rows are ``at``; ``names`` are those of an enumeration's values."""
        if isinstance(column, Utf8Column):
            self._texts.append((at, array_of(column, pa.string())))
            return
        if column.ndim == 2:
            self._bytes.append((at, array_of(column, pa.binary())))
            return
        name = "real" if column.dtype.kind == "f" else "unsigned" if column.dtype == np.uint64 else "integer"
        values, valid = self._numbers[name]
        with np.errstate(invalid="ignore"):  # of the many kinds of NaN, some cannot be widened as they are
            values[at] = column
        valid[at] = True
        if names is not None:
            code, texts = names
            named = code >= 0
            self._texts.append((at[named], labels(code[named], texts).cast(pa.string())))

    def arrays(self) -> list[Any]:
        """Return the columns."""
        kinds = (pa.int64(), pa.uint64(), pa.float64())
        numbers = [
            with_nulls(values, bits_of(valid), kind)
            for (values, valid), kind in zip(self._numbers.values(), kinds, strict=True)
        ]
        return [*numbers, self._spread(self._texts, pa.string()), self._spread(self._bytes, pa.binary())]

    def _spread(self, parts: list[tuple[I64, Any]], kind: Any) -> Any:
        """Put variables' texts, or bytes, to their rows."""
        if not parts:
            return pa.nulls(self.count, kind)
        source = np.full(self.count, -1)
        at = np.concatenate([where for where, _ in parts])
        source[at] = np.arange(len(at))
        places = pa.array(source, mask=source < 0)
        return pa.concat_arrays([array for _, array in parts]).take(places)
