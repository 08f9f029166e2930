"""Tables of values that come one by one between those of lists, by the numbers of their frames."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pyarrow as pa

from nvscope.export.arrays import LABEL, MOMENT, numbers_in, numbers_of
from nvscope.export.files import TableFile

_OF_PAGES = pa.schema(
    [
        pa.field("frame.time", MOMENT),
        pa.field("frame.number", pa.int64()),
        pa.field("ip.src", LABEL),
        pa.field("list", LABEL),
        pa.field("variable", LABEL),
        pa.field("place", LABEL),
        pa.field("type", LABEL),
        pa.field("integer", pa.int64()),
        pa.field("real", pa.float64()),
        pa.field("text", pa.string()),
    ]
)

_OF_DATABASES = pa.schema([field for field in _OF_PAGES if field.name not in ("ip.src", "place")])

READ_SCHEMAS: Mapping[str, Any] = {"visu": _OF_PAGES, "db": _OF_DATABASES}
"""The columns of values by themselves, by name of who tells them (``nvscope.analysis.read_values.SOURCES``)."""


class Interleaved:
    """A ``TableFile`` that puts tables of single values between those that are written to it, by their frames.

    No frame is in both. For each batch of the capture, ``begin`` takes those tables, and ``end`` writes what is
    left of them.
    """

    def __init__(self, file: TableFile) -> None:
        self._file = file
        self._tables: Iterator[Any] = iter(())
        self._held: Any | None = None

    def begin(self, tables: Iterator[Any]) -> None:
        """Take the tables of single values in a batch."""
        self._tables = tables

    def write(self, table: Any) -> None:
        """Write a table, and what stands in front of its last frame."""
        if not len(table):
            return
        last = table.column("frame.number")[len(table) - 1].as_py()
        between = []
        while (held := self._next()) is not None:
            frame = numbers_in(held.column("frame.number"))
            cut = int(np.searchsorted(frame, last))
            between.append(held.slice(0, cut))
            self._held = held.slice(cut) if cut < len(held) else None
            if cut < len(held):
                break
        if any(len(one) for one in between):
            whole = pa.concat_tables([table, *between]).unify_dictionaries().combine_chunks()
            order = np.argsort(numbers_in(whole.column("frame.number")), kind="stable")
            table = whole.take(numbers_of(order))
        self._file.write(table)

    def end(self) -> None:
        """Write what is left of the tables of a batch."""
        while (held := self._next()) is not None:
            self._held = None
            self._file.write(held)

    def close(self) -> None:
        """Write what stands at the end."""
        self._file.close()

    def _next(self) -> Any | None:
        if self._held is None:
            self._held = next(self._tables, None)
        return self._held
