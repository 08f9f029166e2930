"""Files that exist already: what they hold, and whether a session can go on with them."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path

from dissectors.datalogger.tables import LogTable, quoted, recognise
from nvscope.capture.datalogger.database import opened
from nvscope.errors import UnreadableInput

_SHOWN = 60
_WAL_AT = 19
"""Where the header of a database says how it is read: 2 is by a write-ahead log (SQLite file format, section 1.3.3)."""

_UNTOUCHED = "&immutable=1"

NO_DATABASE = "the file is no SQLite database", "log to another file"
"""What is told of other files, and what to do."""


def unlike_logger(path: str) -> str:
    """Return what a file is that is no whole database of a DataLogger alone, '' where it is one; it stays as it is."""
    try:
        with opened(path) as database:
            schema, file = database.schema, database.file
            if len(database.damages):
                return "damaged"
            if file.pages_missing or file.header.flaw:
                return file.header.flaw or next(iter(database.notes), "cut short")
            return database.beside or ("a database of too many tables" if schema.left_out else "")
    except UnreadableInput as error:
        return error.what


def others_in(path: str, own: LogTable) -> int:
    """Return how many tables of a DataLogger a file has beside one, as far as that can be read; it stays as it is."""
    try:
        with opened(path) as database:
            found = {one.log.name: one.log for one in database.tables}
            return len(found) - (continued(found, own) is not None)
    except UnreadableInput:
        return 0


def tables_in(connection: sqlite3.Connection) -> dict[str, LogTable | None]:
    """Return the tables of a database by their names, None of those that are no DataLogger's."""
    names = [name for (name,) in connection.execute("SELECT name FROM main.sqlite_master WHERE type = 'table'")]
    found = {}
    for name in names:
        columns = connection.execute(f"PRAGMA main.table_info({quoted(name)})")
        found[name] = recognise(name, [(column, kind) for _, column, kind, *_ in columns])
    return found


def continued(found: Mapping[str, LogTable | None], own: LogTable) -> LogTable | None:
    """Return the table of a file that rows go on with, None where it has none of the same columns.

    Controllers number tables in another way. Of several, it is that of the same name, else the last one.
    """
    same = [table for table in found.values() if table is not None and table.has_columns_of(own)]
    return next((table for table in same if table.name == own.name), same[-1] if same else None)


def other_table(found: Sequence[LogTable], own: LogTable) -> str:
    """Return why rows go into a table of their own where there are others; '' where there are none, or one is theirs.

    It is what tells the most alike of these from it.
    """
    if not found or continued({one.name: one for one in found}, own) is not None:
        return ""
    names = {one.name for one in own.variables}
    alike = max(found, key=lambda table: sum(one.name in names for one in table.variables))
    there = {one.name for one in alike.variables}
    what = f"stores {'changes only' if alike.only_changes else 'every value'}"
    if names != there:
        shown = ((f"has no '{min(names - there)[:_SHOWN]}'",) if names - there else ()) + (
            (f"has '{min(there - names)[:_SHOWN]}', too",) if there - names else ()
        )
        what = " and ".join(shown)
    return f"in a table of its own, {own.name}, beside {alike.name[:_SHOWN]}, which {what}"


def table_in(path: str, own: LogTable) -> LogTable | None:
    """Return the table of a file that has the columns of one, None where none has, or the file cannot be read."""
    try:
        with opened(path) as database:
            return continued({table.log.name: table.log for table in database.tables}, own)
    except UnreadableInput:
        return None


def told_against(connection: sqlite3.Connection, own: LogTable) -> tuple[str, str] | None:
    """Return why a database cannot be gone on with, and what to do; None where it can."""
    trigger = connection.execute("SELECT name FROM main.sqlite_master WHERE type = 'trigger'").fetchone()
    if trigger is not None:
        # It may do anything to rows as they come.
        return f"the file holds what is no DataLogger's: the trigger {str(trigger[0])[:_SHOWN]}", "log to another file"
    return _unlike(tables_in(connection), own)


def told_beforehand(path: str, own: LogTable) -> tuple[str, str] | None:
    """Return the same of a file that stays as it is; None also where only who writes to it finds out."""
    try:
        uri = f"{Path(path).absolute().as_uri()}?mode=ro{_UNTOUCHED if _is_closed_wal(path) else ''}"
        with closing(sqlite3.connect(uri, uri=True)) as connection:
            return told_against(connection, own)
    except sqlite3.Error as error:
        is_none = getattr(error, "sqlite_errorcode", 0) & 0xFF == sqlite3.SQLITE_NOTADB
        return NO_DATABASE if is_none else None


def _is_closed_wal(path: str) -> bool:
    """Return whether a database has a write-ahead log of which nothing is there: who opens it makes one beside it."""
    try:
        with open(path, "rb") as file:
            head = file.read(_WAL_AT + 1)
    except OSError:
        return False
    return head[_WAL_AT:] == b"\2" and not os.path.lexists(f"{path}-wal")


def _unlike(found: Mapping[str, LogTable | None], own: LogTable) -> tuple[str, str] | None:
    """Return why a file with some tables cannot be gone on with, and what to do."""
    foreign = next((name for name, table in found.items() if table is None), None)
    if foreign is not None:
        return f"the file holds what is no DataLogger's: the table {foreign[:_SHOWN]}", "log to another file"
    if continued(found, own) is not None:
        return None
    known = found.get(own.name) or next((table for table in found.values() if table and _is_of(table, own)), None)
    if known is None:
        return None
    if known.raw != own.raw:
        there, here = ("numbers", "texts") if known.raw else ("texts", "numbers")
        style = "Raw" if known.raw else "Iso8601"
        return (
            f"the table of these variables has its times as {there} there, and the session writes {here}",
            f'write tsfmt="{style}" in the configuration, or log to another file',
        )
    types = {one.name: one.declared for one in known.variables}
    other = next((one for one in own.variables if types.get(one.name) != one.declared), None)
    if other is not None and other.name in types:
        what = f"'{other.name[:_SHOWN]}' is {types[other.name]} in the table there, and {other.declared} in its list"
        return what, "log to another file: the type of the variable has changed"
    return "the file has a table of this name for other variables", "log to another file"


def _is_of(table: LogTable, own: LogTable) -> bool:
    """Tell whether a table is of the same variables, stored in the same way."""
    names, own_names = ({one.name for one in each.variables} for each in (table, own))
    return table.only_changes == own.only_changes and names == own_names
