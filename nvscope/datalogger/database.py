"""Database: the SQLite files of a session, written as a controller writes them.

Rows are written in blocks of one transaction each, so that whatever ends the program leaves a file that can be read. A
full file is renamed to the next number and another one begun, or its oldest rows are deleted.
Source: the DataLogger's reference, "Attributes for file-based configuration", and ``datalogger.md`` sections 1 and 2.
"""

from __future__ import annotations

import os
import sqlite3
import zlib
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from dissectors.batch import Bool
from dissectors.datalogger.leaves import PAGE_BYTES, Block, Leaves, TextColumn, leaves_of
from dissectors.datalogger.tables import (
    TABLE,
    TABLE_OF_CHANGES,
    LoggedVariable,
    LogTable,
    statement,
)
from nvscope.capture.can.sqlite_file import left_beside
from nvscope.capture.datalogger.names import BEGUN, closed_files, to_close
from nvscope.datalogger.begun_files import begin_file, made_beside, take_away
from nvscope.datalogger.configuration import Session
from nvscope.datalogger.existing import NO_DATABASE, continued, table_in, tables_in, told_against
from nvscope.datalogger.logged import Logged
from nvscope.datalogger.oldest_rows import Deleted, OldestRows
from nvscope.datalogger.set_aside import without_leftovers
from nvscope.errors import CaptureError, UsageError

_PAGES_AT, _IMAGE = 28, "image"
_BUSY_S = 5.0
_HELD = frozenset({sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED})
IN_MEMORY = ":memory:"


class DatabaseLocked(Exception):
    """Another program reads or writes the file just now: nothing of the block was written."""


def table_of(session: Session, logged: Sequence[Logged]) -> LogTable:
    """Return the table of a session.

    How a controller numbers its tables is not known. Ours is the CRC-32 of the names of the variables.
    """
    step = 2 if session.only_changes else 1
    variables = tuple(
        LoggedVariable(one.uri, one.declared, 2 + step * place, 3 + step * place if session.only_changes else None)
        for place, one in enumerate(logged)
    )
    number = zlib.crc32("\0".join(one.uri for one in logged).encode())
    return LogTable(f"{TABLE_OF_CHANGES if session.only_changes else TABLE}{number}", session.raw, variables)


class Database:
    """The files of a session; ``path`` is the one that is written, ``rows`` how many were.

    ``deleted`` are rows that made room in it, ``removed`` full files that did (``removed_before``: so many of earlier
    runs), ``closed`` those of this run that stayed.
    ``table`` is the one that rows go to: that of the file with the same columns where it is gone on with, else its own;
    ``found`` are those that were there.
    ``durable``: each block is on the disk before the next one is taken, where it survives a power cut. ``begins`` tells
    whether the next row is the first of a file. ``had_rows`` tells whether the table had any in the file when that was
    opened to be gone on with, ``goes_on`` whether it had, or the series had closed files.
    """

    def __init__(self, session: Session, table: LogTable, path: str, *, durable: bool) -> None:
        self.path = path
        self.rows = 0
        self.closed: list[str] = []
        self.removed: list[str] = []
        self.removed_before = 0
        self.found: Sequence[LogTable] = ()
        self._oldest: OldestRows | None = None
        self._own, self._own_closed = 0, dict[str, int]()
        self.begins = True
        self.goes_on = self.had_rows = False
        self._made = False
        self._session = session
        self._durable = durable
        self._take(table)
        self._connection: Any = None

    def _take(self, table: LogTable) -> None:
        """Let rows be those of a table."""
        self.table = table
        self._template, self._root = _template(table)
        self._insert = f"INSERT INTO main.{table.sql_name} VALUES ({','.join('?' * table.columns)})"

    def open(self, *, append: bool) -> None:
        """Open the file, or make it; an existing one is gone on with where ``append``.

        Raises UsageError where that holds another table, and CaptureError where it cannot be written.
        """
        in_memory = self.path == IN_MEMORY
        exists = not in_memory and os.path.exists(self.path)
        if append and not in_memory:
            closed = [path for _, path in closed_files(self.path)]
            self.goes_on = bool(closed)
            if closed and not exists:
                self._take(table_in(closed[-1], self.table) or self.table)
        self._made |= not exists
        try:
            if not in_memory:
                take_away(self.path + BEGUN)
                if not os.path.lexists(self.path):
                    without_leftovers(self.path)
                    os.rename(made_beside(self.path, self.table, durable=self._durable), self.path)
            self._connect()
            if exists:
                self.found = self._check(append=append)
            elif not tables_in(self._connection):
                # In memory, or in a file to which a link leads.
                self._connection.execute(statement(self.table))
            if self._session.files == 1 or self.path == IN_MEMORY:
                self._oldest = OldestRows(self._connection, self.table, self.found)
        except sqlite3.Error as error:
            self.close()
            raise self._failure(error) from None
        except OSError as error:
            what = f"cannot be made: {error.strerror}"
            raise CaptureError(what, where=self.path, next_step="check its folder") from None

    def write(self, blocks: Sequence[Block], rows: int) -> None:
        """Write rows, given as columns in the order of the table, in one transaction.

        Raises DatabaseLocked, and CaptureError where they cannot be written; nothing of them is then.
        """
        if self._connection is None:
            raise CaptureError(
                "cannot be written: it is closed behind a fault", where=self.path, next_step="check its folder"
            )
        try:
            leaves = leaves_of(blocks, rows) if hasattr(self._connection, "deserialize") else None
            if leaves is None:
                self._connection.execute("BEGIN IMMEDIATE")
                self._connection.executemany(self._insert, tuples(blocks, rows))
            else:
                # SQLite copies the records of a database in memory as they are.
                self._connection.deserialize(self._image(leaves), name=_IMAGE)
                self._connection.execute("BEGIN IMMEDIATE")
                name = self.table.sql_name
                self._connection.execute(f"INSERT INTO main.{name} SELECT * FROM {_IMAGE}.{name}")
            self._connection.execute("COMMIT")
        except sqlite3.Error as error:
            self._undo()
            if getattr(error, "sqlite_errorcode", 0) & 0xFF in _HELD:
                raise DatabaseLocked from None
            raise self._failure(error) from None
        self.rows += rows
        self._own += rows
        self.begins = False

    def make_room(self) -> None:
        """Begin another file where this one is full, or delete its oldest rows; to be done behind each block.

        Raises CaptureError where that cannot be done; what was written stays.
        """
        most = self._session.max_bytes
        if most is None or self.size_bytes < most:
            return
        if self._oldest is None:
            self._roll_over()
            return
        try:
            self._oldest.make_room(most, self._session.delete_percent)
        except sqlite3.Error as error:
            if getattr(error, "sqlite_errorcode", 0) & 0xFF not in _HELD:
                raise self._failure(error) from None
            # Somebody reads or writes it just now: with the next block.

    def close(self) -> None:
        """Close the file; what was written stays."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def end(self) -> bool:
        """Close the file, and return whether it is there: one that was made and has got no row is taken away."""
        unused = self._made and not self.rows and self._is_empty()
        self.close()
        if unused and self.path != IN_MEMORY:
            with suppress(OSError):
                os.unlink(os.path.realpath(self.path))
        return not unused

    def _is_empty(self) -> bool:
        """Return whether the file holds the table alone, and that has no row."""
        if self._connection is None:
            return False
        asked = f"SELECT (SELECT count(*) FROM main.sqlite_master), EXISTS (SELECT 1 FROM main.{self.table.sql_name})"
        try:
            return bool(self._connection.execute(asked).fetchone() == (1, 0))
        except sqlite3.Error:
            return False

    @property
    def rows_left(self) -> int:
        """How many of the rows that were written are still there."""
        return self._own + sum(self._own_closed.values()) - self.deleted.own

    @property
    def deleted(self) -> Deleted:
        """The rows of the file that made room."""
        return Deleted() if self._oldest is None else self._oldest.deleted

    @property
    def size_bytes(self) -> int:
        """How large the file is."""
        if self.path == IN_MEMORY:
            pages = self._connection.execute("PRAGMA page_count").fetchone()[0]
            return int(pages * self._connection.execute("PRAGMA page_size").fetchone()[0])
        return os.path.getsize(self.path)

    def _connect(self) -> None:
        # By its whole path: some names mean something else to SQLite.
        path = self.path if self.path == IN_MEMORY else os.path.abspath(self.path)
        holds_nothing = path == IN_MEMORY or not os.path.exists(path) or not os.path.getsize(path)
        self._connection = sqlite3.connect(path, isolation_level=None, timeout=_BUSY_S, check_same_thread=False)
        execute = self._connection.execute
        if holds_nothing:
            # To say this of a database that is there would be to write to it.
            begin_file(self._connection)
        if not self._durable:
            # Nobody waits for a power cut, or looks at the file, while a capture is turned into it.
            execute("PRAGMA synchronous = OFF")
            execute("PRAGMA main.locking_mode = EXCLUSIVE")
        execute(f"ATTACH '{IN_MEMORY}' AS {_IMAGE}")

    def _check(self, *, append: bool) -> list[LogTable]:
        """Take an existing file to go on with, and make its table where it has only others of a DataLogger.

        So controllers do whose configuration has changed. Return the tables that were there. Raises UsageError where
        it cannot be gone on with.
        """
        if not append:
            self.close()
            raise UsageError(
                "the file exists", where=self.path,
                next_step="--append goes on with it, --force takes its place; or name another one",
            )  # fmt: skip
        execute = self._connection.execute
        found = tables_in(self._connection)
        reason = told_against(self._connection, self.table)
        # What a program was at that did not end is undone by now; SQLite takes what is missing of a page for zeros.
        if reason is None and os.path.getsize(self.path) % execute("PRAGMA main.page_size").fetchone()[0]:
            reason = (
                "the file is cut off in the middle of a page",
                "log to another file; `nvscope audit FILE.db` tells what is left",
            )
        if reason:
            self.close()
            raise UsageError(reason[0], where=self.path, next_step=reason[1])
        if known := continued(found, self.table):
            self._take(known)
            self.had_rows = bool(execute(f"SELECT EXISTS (SELECT 1 FROM main.{known.sql_name})").fetchone()[0])
            self.goes_on |= self.had_rows
        else:
            execute(statement(self.table))
        return [table for table in found.values() if table is not None]

    def _image(self, leaves: Leaves) -> bytes:
        """Return a database that holds some rows."""
        template, known = self._template, len(self._template) // PAGE_BYTES
        root, pages = leaves.tree(known + 1)
        count = (known + (len(leaves.pages) if pages else 0)).to_bytes(4, "big")
        front = template[_PAGES_AT + 4 : (self._root - 1) * PAGE_BYTES]
        return b"".join([template[:_PAGES_AT], count, front, *root, template[self._root * PAGE_BYTES :], *pages])

    def _undo(self) -> None:
        try:
            if self._connection.in_transaction:
                self._connection.execute("ROLLBACK")
        except sqlite3.Error:
            pass  # SQLite has undone it already

    def _roll_over(self) -> None:
        """Close the file under the next number, begin another, and remove the oldest beyond those that may stay.

        Whatever ends the program in between, no row is lost, and all that has the name of a file of the series is one.
        """
        self.close()
        if left_beside(os.path.realpath(self.path)):
            # Another program that has the file open keeps some of it there; under another name, that would be lost.
            self._connect()
            return
        closed, target = to_close(self.path)
        try:
            begun = made_beside(self.path, self.table, durable=self._durable)
            try:
                _rename(self.path, target, begun)
            except OSError as error:
                take_away(begun)
                self._connect()
                raise self._cannot_close(error) from None
            self.closed.append(target)
            self._own_closed[target], self._own = self._own, 0
            self.begins = self._made = True
            self._connect()
        except sqlite3.Error as error:
            # What waits for its block can be written, if to a file that is larger than it should be.
            with suppress(sqlite3.Error):
                self._connect()
            raise self._failure(error) from None
        try:
            self._remove_oldest([*(path for _, path in closed), target])
        except OSError as error:
            raise self._cannot_close(error) from None

    def _remove_oldest(self, closed: Sequence[str]) -> None:
        """Remove full files beyond those that may stay, the oldest first."""
        files = self._session.files
        if files is None:
            return
        for oldest in closed[: max(len(closed) - (files - 1), 0)]:
            os.unlink(oldest)
            self.removed.append(oldest)
            if self._own_closed.pop(oldest, None) is None:
                self.removed_before += 1
            else:
                self.closed.remove(oldest)

    def _cannot_close(self, error: OSError) -> CaptureError:
        what = f"a full file cannot be closed: {error.strerror}"
        return CaptureError(what, where=self.path, next_step="check its folder")

    def _failure(self, error: sqlite3.Error) -> CaptureError:
        code = getattr(error, "sqlite_errorcode", 0) & 0xFF
        told = f"{self.rows} rows were written before" if self.rows else "nothing was written"
        folder = os.path.dirname(self.path) or "."
        if code in _HELD:
            return CaptureError(
                f"another program holds the database; {told}", where=self.path,
                next_step="close it there, and start again: rows wait for it while they are logged, not at the start",
            )  # fmt: skip
        if code == sqlite3.SQLITE_FULL:
            return CaptureError(f"the disk is full; {told}", where=self.path, next_step="make room, or log elsewhere")
        if code == sqlite3.SQLITE_CANTOPEN and not Path(folder).is_dir():
            return CaptureError(
                "its folder does not exist, and none is made",
                where=self.path,
                next_step="make it, or name a file with -w",
            )
        if code == sqlite3.SQLITE_NOTADB:
            return CaptureError(NO_DATABASE[0], where=self.path, next_step=NO_DATABASE[1])
        return CaptureError(
            f"cannot be written: {error}; {told}", where=self.path, next_step="check the file and its folder"
        )


def _rename(path: str, target: str, begun: str) -> None:
    """Let a file that was begun take the place of another, which gets the name of a closed one; or do nothing."""
    without_leftovers(target)
    os.rename(path, target)
    try:
        os.rename(begun, path)
    except OSError:
        os.rename(target, path)
        raise


def _template(table: LogTable) -> tuple[bytes, int]:
    """Return a database in memory with an empty table, and the page of its root."""
    connection = sqlite3.connect(IN_MEMORY, isolation_level=None)
    try:
        connection.execute(f"PRAGMA page_size = {PAGE_BYTES}")
        connection.execute(statement(table))
        root = connection.execute("SELECT rootpage FROM sqlite_master").fetchone()[0]
        return (connection.serialize() if hasattr(connection, "serialize") else b""), int(root)
    finally:
        connection.close()


def tuples(blocks: Sequence[Block], rows: int) -> Iterator[tuple[Any, ...]]:
    """Yield rows value by value, as ``executemany`` takes them."""
    columns: list[Sequence[Any]] = []
    for block in blocks:
        if isinstance(block, TextColumn):
            data = block.data.tobytes()
            texts = [
                data[start:stop].decode() for start, stop in zip(block.start.tolist(), block.stop.tolist(), strict=True)
            ]
            columns.append(_with_nulls(texts, block.null))
            continue
        for column in range(block.columns):
            null = None if block.null is None else block.null[:, column]
            columns.append(_with_nulls(block.numbers[:, column].tolist(), null))
    return zip(*columns, strict=True) if columns else iter([()] * rows)


def _with_nulls(values: list[Any], null: Bool | None) -> list[Any]:
    if null is None:
        return values
    return [None if is_null else value for value, is_null in zip(values, null.tolist(), strict=True)]
