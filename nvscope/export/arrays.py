"""Columns as Arrow has them: what is there in numpy is not copied.

They are made of buffers: ``pyarrow.array``, ``to_numpy`` and ``empty_table`` ask pandas first, where that is installed,
and its import takes longer than most exports do.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from dissectors.batch import I64, Bool
from nvscope.expression.typed_columns import FieldType, Numbers
from nvscope.view.rows.utf8 import Utf8Column
from nvscope.view.rows.values import SpanColumn, ValueColumn, fits_time

MOMENT = pa.timestamp("ns", tz="UTC")
"""When a telegram was captured."""

LABEL = pa.dictionary(pa.int32(), pa.string())
"""Texts of which few are different."""

_TYPES = {
    FieldType.BOOL: pa.bool_(),
    FieldType.DURATION: pa.duration("ns"),
    FieldType.TIME: pa.timestamp("ns"),  # that of the controller, whose zone nobody knows
    FieldType.TEXT: pa.string(),
    FieldType.BYTES: pa.binary(),
}


def arrow_type(kind: FieldType, dtype: str = "") -> Any:
    """Return the Arrow type of a column; ``dtype`` is that of numpy where the column holds numbers."""
    return _TYPES[kind] if kind in _TYPES else pa.from_numpy_dtype(np.dtype(dtype))


class Spread:
    """Where the rows of a column lie in one of ``count`` rows; the others are null."""

    def __init__(self, at: I64, count: int) -> None:
        self.at = at
        self.count = count
        self.valid: Bool = np.zeros(count, np.bool_)
        self.valid[at] = True
        self.bits = bits_of(self.valid)


def bits_of(flags: Bool) -> Any:
    """Return flags as Arrow lays them out, a bit each."""
    return pa.py_buffer(np.packbits(flags, bitorder="little"))


def array_of(column: ValueColumn, kind: Any, spread: Spread | None = None) -> Any:
    """Return a column as an Arrow array of a type; where it is ``spread``, with nulls in between.

    A time that the type cannot hold is null (``fits_time``).
    """
    if isinstance(column, Utf8Column | SpanColumn):
        return _spans(column.offset, column.data, kind, spread)
    if column.ndim == 2:
        offset = np.arange(len(column) + 1, dtype=np.int64) * column.shape[1]
        return _spans(offset, np.ascontiguousarray(column).reshape(-1), kind, spread)
    valid_bits = spread.bits if spread else None
    full = column
    if spread is not None:
        full = np.zeros(spread.count, column.dtype)
        full[spread.at] = column
    if column.dtype == np.uint64 and (pa.types.is_duration(kind) or pa.types.is_timestamp(kind)):
        fits = fits_time(full)
        valid_bits = valid_bits if fits.all() else bits_of(fits & spread.valid if spread else fits)
    return with_nulls(full, valid_bits, kind)


def with_nulls(column: Numbers, valid_bits: Any, kind: Any) -> Any:
    """Return numbers or bools as an Arrow array; ``valid_bits`` (``bits_of``) tell which are no nulls, None: all."""
    data = bits_of(column) if column.dtype == np.bool_ else pa.py_buffer(np.ascontiguousarray(column))
    return pa.Array.from_buffers(kind, len(column), [valid_bits, data])


def numbers_of(column: Numbers, missing: Bool | None = None) -> Any:
    """Return numbers or bools as an Arrow array of their own type, null where ``missing``."""
    valid_bits = None if missing is None else bits_of(~missing)
    return with_nulls(column, valid_bits, pa.from_numpy_dtype(column.dtype))


def numbers_in(column: Any) -> Any:
    """Return an Arrow column of integers or bools as numpy has them; where it is null, they are anything."""
    array = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    if isinstance(array, pa.ChunkedArray):
        array = array.chunk(0)
    begin, end, data = array.offset, array.offset + len(array), array.buffers()[1]
    if pa.types.is_boolean(array.type):
        bits = np.frombuffer(data, np.uint8) if data else np.empty(0, np.uint8)
        return np.unpackbits(bits, bitorder="little")[begin:end].astype(np.bool_)
    dtype = array.type.to_pandas_dtype()  # that of numpy, in spite of its name
    return np.frombuffer(data, dtype)[begin:end] if data else np.empty(0, dtype)


def empty_table(schema: Any) -> Any:
    """Return a table without rows."""
    return pa.table([pa.nulls(0, field.type) for field in schema], schema=schema)


def spans_of(parts: Sequence[bytes], kind: Any, missing: Bool | None = None) -> Any:
    """Return bytes, or texts in UTF-8, as an Arrow array of a type, null where ``missing``."""
    offset = np.cumsum([0, *map(len, parts)])
    valid_bits = None if missing is None else bits_of(~missing)
    buffers = [valid_bits, pa.py_buffer(offset.astype(np.int32)), pa.py_buffer(b"".join(parts))]
    return pa.Array.from_buffers(kind, len(parts), buffers)


def _spans(offset: I64, data: Numbers, kind: Any, spread: Spread | None) -> Any:
    if spread is not None:
        length = np.zeros(spread.count, np.int64)
        length[spread.at] = np.diff(offset)
        offset = np.append(0, np.cumsum(length))
    # Arrow's offsets are 32 bits wide; what is written at once is far smaller.
    buffers = [spread.bits if spread else None, pa.py_buffer(offset.astype(np.int32)), pa.py_buffer(data)]
    return pa.Array.from_buffers(kind, len(offset) - 1, buffers)


def spread_parts(parts: Sequence[tuple[I64, Any]], count: int, kind: Any) -> Any:
    """Return arrays of a type put to their rows, of ``count``; the others are null."""
    if not parts:
        return pa.nulls(count, kind)
    source = np.full(count, -1)
    at = np.concatenate([where for where, _ in parts])
    source[at] = np.arange(len(at))
    places = numbers_of(source, source < 0)
    return pa.concat_arrays([array for _, array in parts]).take(places)


def labels(code: Any, texts: Sequence[str], valid: Bool | None = None) -> Any:
    """Return texts by their place in a table; null where not ``valid``."""
    mask = None if valid is None else ~valid
    known = spans_of([text.encode() for text in texts], pa.string())
    return pa.DictionaryArray.from_arrays(numbers_of(code.astype(np.int32), mask), known)
