"""Values and telegrams as data frames in memory."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from nvscope.export.arrays import empty_table
from nvscope.export.long import LongTable, long_schema
from nvscope.export.wide import WideTable, WideTables
from nvscope.view.rows.defined import DefinedRows, DefinedTelegrams

if TYPE_CHECKING:
    import polars as pl


class Collected:
    """Tables of one schema, kept; a ``TableFile`` that is no file."""

    def __init__(self, schema: Any) -> None:
        self._schema = schema
        self._tables: list[Any] = []

    def write(self, table: Any) -> None:
        """Keep a table."""
        self._tables.append(table)

    def close(self) -> None:
        """Nothing has to be done."""

    def frame(self) -> pl.DataFrame:
        """Return all that was written as one data frame."""
        import polars as pl  # noqa: PLC0415

        whole = pa.concat_tables(self._tables) if self._tables else empty_table(self._schema)
        frame = pl.from_arrow(whole)
        assert isinstance(frame, pl.DataFrame)
        return frame


def wide_frame(telegrams: DefinedTelegrams, rows: Iterable[DefinedRows]) -> tuple[pl.DataFrame, int]:
    """Return the telegrams of one list, a column a variable, and how many times in them no column of times holds."""
    table = WideTable(telegrams.places, lambda: telegrams.senders)
    collected = Collected(table.schema)
    wide = WideTables([table], lambda _: collected, telegrams.places)
    for batch in rows:
        wide.add(batch)
    wide.finish()
    return collected.frame(), table.beyond_time


def long_frame(telegrams: DefinedTelegrams, rows: Iterable[DefinedRows]) -> pl.DataFrame:
    """Return the values of all telegrams below each other."""
    collected = Collected(long_schema(telegrams.keys))
    long = LongTable(telegrams.places, telegrams.keys, lambda: telegrams.senders, collected)
    for batch in rows:
        long.add(batch)
    long.finish()
    return collected.frame()
