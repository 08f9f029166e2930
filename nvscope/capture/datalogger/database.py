"""An open database of a DataLogger: its tables, and their rows as columns."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from msgspec import Struct

from nvscope.capture.can import sqlite_file
from nvscope.capture.compressed import compression_of
from nvscope.capture.datalogger.damage import Damages
from nvscope.capture.datalogger.page_file import NoByte, NotADatabase, PageFile
from nvscope.capture.datalogger.schema import Schema, StoredTable, read_schema
from nvscope.capture.datalogger.settled import settled
from nvscope.capture.datalogger.sql_rows import SqlRows, sql_rows
from nvscope.capture.datalogger.table_rows import Rows, table_rows
from nvscope.capture.datalogger.tree import Tree
from nvscope.errors import UnreadableInput

AnyRows = Rows | SqlRows
"""Rows as they were read: by pages, or by SQLite."""

NOTHING_YET = "nothing is in it: its logger had only begun it when it had closed the file before, or it was emptied"
"""What is said of the newest file of a series in which there is no table yet."""

_NO_DATABASE = "name a database, which begins with 'SQLite format 3'; if this should be one, copy it again"
_MOST_NAMED, _LONGEST_NAME = 3, 60
_HEAD_BYTES = 64
_COPY_AGAIN = "copy it again from the controller"


class NothingYet(UnreadableInput):
    """A file without a byte, or a database without tables: as one is that a logger has only begun."""


class LogDatabase(Struct, frozen=True):
    """A database with tables of DataLoggers.

    ``notes`` are sentences on its state that people should know. ``damages`` tells what of the definitions of tables
    could not be read, ``doubt`` is why something may be missing that nobody sees (may be ''). Nothing of
    it holds once it is closed.
    """

    path: str
    file: PageFile
    schema: Schema
    damages: Damages
    notes: tuple[str, ...]
    doubt: str = ""

    @property
    def tables(self) -> tuple[StoredTable, ...]:
        """Its tables of DataLoggers, in the order of the file."""
        return self.schema.tables

    @property
    def beside(self) -> str:
        """A sentence on tables in it that are none of a DataLogger, '' where there are none."""
        others = self.schema.others
        if not others:
            return ""
        names = ", ".join(name[:_LONGEST_NAME] for name in others[:_MOST_NAMED])
        more = f" and {len(others) - _MOST_NAMED} more" if len(others) > _MOST_NAMED else ""
        what = "1 table in it is" if len(others) == 1 else f"{len(others)} tables in it are"
        return f"{what} none of a DataLogger: {names}{more}"

    @property
    def encoding(self) -> str:
        """How texts are encoded in the file; rows that SQLite hands over have them in UTF-8."""
        return self.file.header.encoding

    def rows(self, table: StoredTable, damages: Damages) -> Iterator[AnyRows]:
        """Yield the rows of a table in the order of their ids, some thousand at a time, in bounded memory.

        What cannot be read is left out and told to ``damages``; nothing is raised.
        """
        if table.by_pages:
            tree = Tree(self.file, table.root, damages)
            yield from table_rows(self.file, tree, table.log.columns, table.real)
            return
        with sqlite_file.opened(self.path, with_texts=True) as database:
            yield from sql_rows(database, table.log.name, table.columns, damages)

    def encoding_of(self, rows: AnyRows) -> str:
        """Return how the texts of rows are encoded."""
        return self.encoding if isinstance(rows, Rows) else "utf-8"


@contextmanager
def opened(path: str) -> Iterator[LogDatabase]:
    """Open a database for reading, whatever state it is in; ``UnreadableInput`` where nothing of it can be read.

    It and what lies beside it stay as they are.
    """
    if os.path.exists(path) and not os.path.isfile(path):
        raise UnreadableInput("a folder, pipe or device, and no file", where=path, next_step="name the database itself")
    with ExitStack() as stack:
        try:
            database = _opened(path, stack)
        except NoByte as error:
            raise NothingYet(str(error), where=path, next_step=_COPY_AGAIN) from None
        except NotADatabase as error:
            if error.is_other and (how := _compression_of(path)):
                raise UnreadableInput(
                    f"compressed ({how}), and a database is read as it lies on the disk, with what lies beside it",
                    where=path, next_step="unpack it, and name the file that comes out of it",
                ) from None  # fmt: skip
            raise UnreadableInput(
                str(error), where=path, next_step=_NO_DATABASE if error.is_other else _COPY_AGAIN
            ) from None
        except OSError as error:
            raise UnreadableInput(error.strerror or str(error), where=path) from None
        yield database


def _compression_of(path: str) -> str:
    """Return how a file is compressed, '' where it is not."""
    with open(path, "rb") as file:
        return compression_of(file.read(_HEAD_BYTES))


def _opened(path: str, stack: ExitStack) -> LogDatabase:
    place = stack.enter_context(settled(path))
    file = stack.enter_context(PageFile(place.path))
    damages = Damages()
    schema = read_schema(file, damages)
    if not schema.tables:
        raise _no_table(path, schema, damages)
    notes = [*place.notes]
    if file.pages_missing:
        missing, counted = file.pages_missing, file.pages + file.pages_missing
        notes.append(
            f"cut short: {missing} of its {counted} pages {'is' if missing == 1 else 'are'} missing at its end"
        )
    if schema.left_out:
        were = "table was" if schema.left_out == 1 else "tables were"
        notes.append(f"{schema.left_out} more {were} not looked at")
    return LogDatabase(place.path, file, schema, damages, tuple(notes), place.doubt)


def changed_since(path: str, before: list[tuple[int, int] | None]) -> bool:
    """Return whether a database was written since ``sqlite_file.state`` looked at it."""
    return sqlite_file.state(path) != before


def _no_table(path: str, schema: Schema, damages: Damages) -> UnreadableInput:
    if len(damages):
        return UnreadableInput(
            f"damaged: no table can be found, {next(iter(damages))}",
            where=path,
            next_step="copy it again from the controller; `sqlite3 FILE .recover` may find rows without their table",
        )
    if not schema.others:
        return NothingYet(
            "a database without tables",
            where=path,
            next_step="a DataLogger makes its table with the first block that it writes: wait for that, or copy again",
        )
    return UnreadableInput(
        "a database without a table of a DataLogger",
        where=path,
        next_step="such tables begin with the columns 'Timestamp' and 'ConsistentDataSeries'",
    )
