"""Begun files: databases that hold their table and no row, made under another name than the one that they get.

What ends the program while one is made, or finds no room for it, leaves all files of a series as they were: under the
name of a database there is none that is not one yet.
"""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing, suppress
from itertools import count

from dissectors.datalogger.tables import LogTable, quoted, statement
from nvscope.capture.datalogger.names import BEGUN
from nvscope.datalogger.existing import tables_in


def made_beside(path: str, table: LogTable, *, durable: bool) -> str:
    """Make the file that gets the name of a database, and return its path; that of one that was left is used again.

    Raises sqlite3.Error where it cannot be made; then it is not there.
    """
    names = (f"{path}{BEGUN}{f'-{number}' if number else ''}" for number in count())
    begun = next(name for name in names if not os.path.lexists(name) or take_away(name))
    try:
        with closing(sqlite3.connect(os.path.abspath(begun), isolation_level=None)) as connection:
            # Nobody has to undo what has not got its name yet; what lay beside it would not move with it.
            connection.execute("PRAGMA journal_mode = OFF")
            if not durable:
                connection.execute("PRAGMA synchronous = OFF")
            begin_file(connection)
            connection.execute(statement(table))
    except sqlite3.Error:
        with suppress(OSError):
            os.unlink(begun)
        raise
    return begun


def begin_file(connection: sqlite3.Connection) -> None:
    """Have a file as controllers have it; this has to be said before the first table is made."""
    connection.execute("PRAGMA page_size = 4096")
    connection.execute("PRAGMA auto_vacuum = FULL")


def take_away(begun: str) -> bool:
    """Remove a file that a program which was ended had begun; return whether it is gone. One with a row stays."""
    if os.path.islink(begun) or not os.path.isfile(begun) or not _is_empty(begun):
        return False
    try:
        os.unlink(begun)
    except OSError:
        return False
    return True


def _is_empty(path: str) -> bool:
    """Return whether a file has no byte, or is as ``made_beside`` leaves one: a table of a DataLogger without a row."""
    try:
        if not os.path.getsize(path):
            return True
        with closing(sqlite3.connect(os.path.abspath(path), isolation_level=None, timeout=0)) as connection:
            connection.execute("PRAGMA query_only = ON")
            marks = [connection.execute(f"PRAGMA {name}").fetchone()[0] for name in ("user_version", "application_id")]
            (objects,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
            tables = tables_in(connection)
            if any(marks) or objects > 1 or len(tables) != objects or None in tables.values():
                return False
            return not any(connection.execute(f"SELECT 1 FROM {quoted(name)} LIMIT 1").fetchone() for name in tables)
    except (OSError, sqlite3.Error):
        return False
