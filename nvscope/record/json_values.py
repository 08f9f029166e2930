"""Values of variables as JSON: what stands for a type in a JSON Schema, and whole columns of values as texts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from nvscope.definition.variables import Elementary, Enumeration, String
from nvscope.expression.typed_columns import FieldType
from nvscope.view.escape import json_text
from nvscope.view.rows.utf8 import Utf8Column
from nvscope.view.rows.values import SpanColumn, ValueColumn, fits_time, value_type

_WIDE_BYTES = 8
"""Whole numbers of so many bytes are texts: JavaScript would round them."""

_MEANING = {
    FieldType.DURATION: "nanoseconds",
    FieldType.TIME: "date and time of the controller, without a zone",
    FieldType.BYTES: "bytes, hexadecimal",
}


def value_schema(kind: Elementary) -> dict[str, Any]:
    """Return the JSON Schema of the values of a type; an enumeration has its names as constants."""
    of = value_type(kind)
    told: dict[str, Any] = {"type": _json_type(kind)}
    meaning = [kind.name, *([_MEANING[of]] if of in _MEANING else [])]
    told["description"] = ", ".join(meaning)
    if of is FieldType.REAL:
        told["description"] += "; null where it is no number"
    if isinstance(kind, Enumeration) and told["type"] == "integer":
        told["oneOf"] = [{"title": name, "const": value} for name, value in kind.values.items()]
    return told


def _json_type(kind: Elementary) -> str:
    of = value_type(kind)
    if of is FieldType.BOOL:
        return "boolean"
    if of is FieldType.REAL:
        return "number"
    if of in (FieldType.UNSIGNED, FieldType.SIGNED, FieldType.DURATION):
        return "string" if kind.size_bytes == _WIDE_BYTES else "integer"
    return "string"


def value_texts(kind: Elementary, column: ValueColumn) -> Sequence[Any]:
    """Return the values of a column as JSON, as ``%s`` writes it; what is no number, or no time, is null."""
    if isinstance(column, Utf8Column | SpanColumn):
        return _texts(kind, column)
    of = value_type(kind)
    return _FORMS.get(of, _whole)(kind, column)


def _whole(kind: Elementary, column: Any) -> Sequence[Any]:
    return [f'"{value}"' for value in column.tolist()] if kind.size_bytes == _WIDE_BYTES else column.tolist()


def _bools(kind: Elementary, column: Any) -> Sequence[Any]:
    return ["true" if value else "false" for value in column.tolist()]


def _reals(kind: Elementary, column: Any) -> Sequence[Any]:
    # As few digits as tell it from its neighbours: numpy knows those of a REAL, too.
    texts: list[str] = column.astype("U32").tolist()
    for row in np.flatnonzero(~np.isfinite(column)).tolist():
        texts[row] = "null"
    return texts


def _durations(kind: Elementary, column: Any) -> Sequence[Any]:
    return _whole(kind, column)


def _moments(kind: Elementary, column: Any) -> Sequence[Any]:
    fits = fits_time(column)
    moments = np.where(fits, column, column.dtype.type(0)).astype("datetime64[ns]")
    texts = [f'"{text}"' for text in np.datetime_as_string(moments).tolist()]
    for row in np.flatnonzero(~fits).tolist():
        texts[row] = "null"
    return texts


def _bytes(kind: Elementary, column: Any) -> Sequence[Any]:
    return [f'"{row.tobytes().hex()}"' for row in column]


def _texts(kind: Elementary, column: Utf8Column | SpanColumn) -> Sequence[Any]:
    data, offset = column.data.tobytes(), column.offset.tolist()
    cells = [data[begin:end] for begin, end in pairwise(offset)]
    if isinstance(kind, String):
        return [json_text(cell.decode("utf-8", "replace")) for cell in cells]
    return [f'"{cell.hex()}"' for cell in cells]


_FORMS: dict[FieldType, Callable[[Elementary, Any], Sequence[Any]]] = {
    FieldType.BOOL: _bools,
    FieldType.REAL: _reals,
    FieldType.DURATION: _durations,
    FieldType.TIME: _moments,
    FieldType.BYTES: _bytes,
}
