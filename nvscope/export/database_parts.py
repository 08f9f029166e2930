"""Files that an export of databases consists of: one for each table, called after its database."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count

from dissectors.datalogger.logged import RowTable
from dissectors.datalogger.tables import LogTable
from nvscope.export.part_names import part_name


class DatabaseParts:
    """The names of parts: '' of a table alone, else that of the database, with the table where it has several.

    ``tables`` are those known beforehand. Files of a series with the same columns are one part.
    """

    def __init__(self, tables: Sequence[RowTable]) -> None:
        self.known = {(table.series, table.log): table for table in tables}
        self._names: dict[tuple[str, LogTable], str] = {}
        for key, table in self.known.items():
            several = sum(series == table.series for series, _ in self.known) > 1
            self._names[key] = self._free(_name(table, with_table=several)) if len(self.known) > 1 else ""

    def of(self, table: RowTable) -> str:
        """Return the part that a table's rows are of; one that nobody knew beforehand gets the whole name."""
        key = table.series, table.log
        if key not in self._names:
            self._names[key] = self._free(_name(table, with_table=True)) if self._names else ""
        return self._names[key]

    def _free(self, name: str) -> str:
        # Names that differ in case only are one to some file systems.
        taken = {one.lower() for one in self._names.values()}
        numbered = (f"{name}-{number}" if number > 1 else name for number in count(1))
        return next(one for one in numbered if one.lower() not in taken)


def _name(table: RowTable, *, with_table: bool) -> str:
    database = table.title.partition("/")[2]
    name = part_name(database.rpartition(".")[0] or database, "table")
    return f"{name}.{part_name(table.log.name, 'table')}" if with_table else name
