"""Tables of DataLogger databases: how their columns are called and typed, and which tables are such ones.

A table is recognised by its columns, never by its name. Source: the DataLogger's reference, "Database layout", and
``datalogger.md`` section 2; where a database of a controller differs from the reference, it is as there.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from msgspec import Struct

TIMESTAMP, CONSISTENT = "Timestamp", "ConsistentDataSeries"
COUNT_SUFFIX = "_change_count"
TABLE, TABLE_OF_CHANGES = "log_", "log_changes_"
"""How names of tables begin; a number follows."""

MOST_VARIABLES = 996
"""So many variables a session may have, by the reference."""

SQL_TYPES: Mapping[str, str] = MappingProxyType(
    {
        # Seen in databases of controllers.
        "BOOL": "TINYINT",
        "WORD": "SMALLINT",
        # Assumed.
        **dict.fromkeys(("BYTE", "SINT", "USINT", "CHAR"), "TINYINT"),
        **dict.fromkeys(("INT", "UINT", "WCHAR"), "SMALLINT"),
        **dict.fromkeys(("DWORD", "DINT", "UDINT", "TIME", "TOD", "DATE", "DT"), "INT"),
        **dict.fromkeys(("LWORD", "LINT", "ULINT", "LTIME", "LTOD", "LDATE", "LDT"), "BIGINT"),
        "REAL": "FLOAT",
        "LREAL": "DOUBLE",
        **dict.fromkeys(("STRING", "WSTRING"), "TEXT"),
    }
)
"""What the column of a variable is declared as, by the name of its IEC type."""


class LoggedVariable(Struct, frozen=True):
    """A variable of a table: its name, what its column is declared as, and the numbers of its columns, from 0.

    ``counter`` is None where the table stores every value.
    """

    name: str
    declared: str
    column: int
    counter: int | None = None


class LogTable(Struct, frozen=True):
    """A table as DataLoggers write them; ``raw``: its timestamps are declared as numbers."""

    name: str
    raw: bool
    variables: tuple[LoggedVariable, ...]

    @property
    def only_changes(self) -> bool:
        """Whether unchanged values are NULL (storeChangesOnly)."""
        return any(one.counter is not None for one in self.variables)

    @property
    def columns(self) -> int:
        """How many columns it has."""
        return 2 + len(self.variables) * (1 + self.only_changes)

    @property
    def sql_name(self) -> str:
        """Its name as SQL takes it, without quotes where it is like those that controllers give."""
        return self.name if re.fullmatch(r"log_\w+", self.name, re.ASCII) else quoted(self.name)

    def has_columns_of(self, other: LogTable) -> bool:
        """Tell whether it has the same columns as another table, of the same types, in whatever order of variables."""
        own, others = ({one.name: one.declared.upper() for one in table.variables} for table in (self, other))
        return (self.raw, self.only_changes, own) == (other.raw, other.only_changes, others)


def recognise(name: str, columns: Sequence[tuple[str, str]]) -> LogTable | None:
    """Return a table by the names and declared types of its columns; None where it is no DataLogger's.

    Either all variables have a counter behind them, or none has: a variable may be called like a counter.
    """
    if [column for column, _ in columns[:2]] != [TIMESTAMP, CONSISTENT]:
        return None
    raw = columns[0][1].upper() != "TEXT"
    rest = columns[2:]
    counted = (
        len(rest) % 2 == 0
        and bool(rest)
        and all(
            counter == f"{value}{COUNT_SUFFIX}" for (value, _), (counter, _) in zip(rest[::2], rest[1::2], strict=True)
        )
    )
    if counted:
        variables = [
            LoggedVariable(value, declared, 2 + 2 * place, 3 + 2 * place)
            for place, (value, declared) in enumerate(rest[::2])
        ]
    else:
        variables = [LoggedVariable(value, declared, 2 + place) for place, (value, declared) in enumerate(rest)]
    return LogTable(name, raw, tuple(variables))


def statement(table: LogTable) -> str:
    """Return the statement that makes a table, with the spaces that controllers write."""
    parts = [f'"{TIMESTAMP}" {"INT" if table.raw else "TEXT"}, "{CONSISTENT}" INT']
    for variable in table.variables:
        column = f"{quoted(variable.name)} {variable.declared} DEFAULT NULL"
        if variable.counter is not None:
            column += f", {quoted(variable.name + COUNT_SUFFIX)} DEFAULT NULL"
        parts.append(column)
    return f"CREATE TABLE {table.sql_name}( {','.join(parts)})"


def quoted(name: str) -> str:
    """Return a name as SQL takes it, whatever is in it."""
    return f'"{name.replace(chr(34), chr(34) * 2)}"'
