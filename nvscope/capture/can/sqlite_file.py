"""SQLite databases of strangers, opened so that nothing in them is run, and nothing beside them is made or changed.

A database is more than its file: what its writer has not put into it yet lies in ``-wal`` beside it, and what a writer
that was killed would have to take back in ``-journal``. SQLite looks after both by writing. So it does that in a copy;
a database that has neither is read where it is, as one that nobody changes (``immutable``), without locks that its
writer would have to wait for. Of one that is cut short, a copy of its whole pages is read: SQLite refuses the file.
"""

from __future__ import annotations

import os
import shutil
import sqlite3
import struct
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from urllib.parse import quote

from nvscope.capture.can.on_disk import MAX_SPOOLED_BYTES

MAX_VALUE_BYTES = 1 << 16
"""Bytes of one value, and of one definition, that are looked at."""

MAX_TEXT_BYTES = 1 << 20
"""The same where texts are asked for: of the DataLogger's, a definition and a query may name two thousand columns."""

_MAX_OPENING_STEPS = 20_000  # of some thousand definitions of tables, which SQLite keeps all in memory
_MAX_STEPS = 1_000_000  # between two rows, which are some ten steps apart
_STEPS = 1000

_BESIDE = {"-wal": 32, "-journal": 28}
"""Suffixes of what lies beside a database, and the bytes of its header."""

_JOURNAL_MAGIC = bytes.fromhex("d9d505f920a163d7")

_PAGES_OFFSET = 28

_MADE_UP = {1, 2}  # what PRAGMA table_xinfo calls columns of virtual tables, and those that are computed when read
_ALLOWED = frozenset({sqlite3.SQLITE_SELECT, sqlite3.SQLITE_READ})
_LIMITS = (
    (sqlite3.SQLITE_LIMIT_LENGTH, MAX_VALUE_BYTES),
    (sqlite3.SQLITE_LIMIT_SQL_LENGTH, MAX_VALUE_BYTES),
    (sqlite3.SQLITE_LIMIT_ATTACHED, 0),
    (sqlite3.SQLITE_LIMIT_TRIGGER_DEPTH, 1),
)


class Text(bytes):
    """A text as it is stored, in UTF-8 perhaps; blobs are ``bytes``."""


class Database:
    """An open database; ``execute`` yields the rows of a query of tables, of which texts are '', or ``Text``.

    What a stranger can make SQLite do is limited: values of ``MAX_VALUE_BYTES``, steps between two rows, and no
    functions, views, virtual tables and triggers. ``sqlite3.Error`` where a limit bites.
    """

    def __init__(self, connection: sqlite3.Connection, with_texts: bool = False) -> None:
        self._connection = connection
        self._steps_left = _MAX_OPENING_STEPS
        # Not all texts are UTF-8, and most often none is wanted.
        connection.text_factory = Text if with_texts else lambda _: ""
        for limit, most in _LIMITS:
            connection.setlimit(limit, MAX_TEXT_BYTES if with_texts and most == MAX_VALUE_BYTES else most)
        connection.execute("PRAGMA trusted_schema = OFF")
        connection.execute("PRAGMA cell_size_check = ON")
        connection.set_progress_handler(self._step, _STEPS)
        connection.set_authorizer(_judge)

    def has_table(self, name: str) -> bool:
        """Return whether there is a table, stored as rows, no column of which its definition makes up."""
        query = "SELECT 1 FROM sqlite_master WHERE name = ? AND type = 'table' AND rootpage > 0"
        if self._connection.execute(query, (name,)).fetchone() is None:
            return False
        *_, hidden = zip(*self._connection.execute(f"PRAGMA table_xinfo('{name}')"), strict=True)
        return _MADE_UP.isdisjoint(hidden)

    def execute(self, query: str, *values: object) -> Iterator[tuple[object, ...]]:
        """Yield the rows of a query."""
        self._steps_left = _MAX_STEPS
        for row in self._connection.execute(query, values):
            yield row
            self._steps_left = _MAX_STEPS

    def _step(self) -> int:
        self._steps_left -= _STEPS
        return self._steps_left < 0


@contextmanager
def opened(path: str, with_texts: bool = False) -> Iterator[Database]:
    """Open the database in a file, or of one that is cut short what is left. It and what lies beside it stay."""
    unfinished = left_beside(path)
    pages = pages_left(path)
    if pages is None and (not unfinished or _not_copied(path, unfinished)):
        with _connected(path, "mode=ro&immutable=1", with_texts) as database:
            yield database
        return
    directory = tempfile.mkdtemp(prefix="nvscope-")
    try:
        copy = os.path.join(directory, "log")
        shutil.copyfile(path, copy)
        if pages is not None:
            _end_at(copy, *pages)
        for suffix in unfinished:
            shutil.copyfile(path + suffix, copy + suffix)
        with _connected(copy, "mode=rw", with_texts) as database:
            yield database
    finally:
        shutil.rmtree(directory, ignore_errors=True)


def _end_at(path: str, page_bytes: int, pages: int) -> None:
    """Make a database end behind so many pages, and say so itself: those that it refers to and has not are a fault."""
    with open(path, "r+b") as file:
        file.truncate(page_bytes * pages)
        file.seek(_PAGES_OFFSET)
        file.write(struct.pack(">L", pages))


def left_beside(path: str) -> list[str]:
    """Return the suffixes of files beside a database in which something may be that is not in it yet, or no more."""
    found = []
    for suffix, header_bytes in _BESIDE.items():
        try:
            with open(path + suffix, "rb") as file:
                begins = file.read(len(_JOURNAL_MAGIC))
                size = file.seek(0, os.SEEK_END)
        except OSError:
            continue
        if size > header_bytes and (suffix == "-wal" or begins == _JOURNAL_MAGIC):
            found.append(suffix)
    return found


def unread_beside(path: str) -> str:
    """Return what beside a database is not read with it, '' where all is."""
    unfinished = left_beside(path)
    if unfinished and (what := _not_copied(path, unfinished)):
        return f"{os.path.basename(path)}{unfinished[0]} is not read: {what}"
    return ""


def _not_copied(path: str, unfinished: list[str]) -> str:
    """Return why a database and what lies beside it cannot be copied, '' where they can."""
    try:
        size = sum(os.path.getsize(path + suffix) for suffix in ["", *unfinished])
        if size > MAX_SPOOLED_BYTES:
            return f"with the database it has more than {MAX_SPOOLED_BYTES >> 30} GiB"
        if "-journal" in unfinished:
            with open(path + "-journal", "rb") as file:
                file.seek(-len(_JOURNAL_MAGIC), os.SEEK_END)
                # It ends with the name of a file that SQLite would delete.
                if file.read() == _JOURNAL_MAGIC:
                    return "it belongs to a change of several databases"
    except OSError as error:
        return error.strerror or str(error)
    return ""


def bytes_missing(path: str) -> tuple[int, int] | None:
    """Return how many bytes a database has and should have, None where none are missing.

    SQLite reads zeros for what is missing of the last page, and would show them as rows.
    """
    page_bytes, pages = _pages(path)
    size = os.path.getsize(path)
    return (size, page_bytes * pages) if size < page_bytes * pages and not left_beside(path) else None


def pages_left(path: str) -> tuple[int, int] | None:
    """Return the size of a page and how many whole ones are left of a database, None where none are missing."""
    missing = bytes_missing(path)
    page_bytes, _ = _pages(path)
    return missing and (page_bytes, missing[0] // page_bytes)


def _pages(path: str) -> tuple[int, int]:
    """Return the size of a page and the number of pages, as the header says them."""
    with open(path, "rb") as file:
        head = file.read(_PAGES_OFFSET + 4)
    page_bytes, pages = struct.unpack(">16xH10xL", head.ljust(_PAGES_OFFSET + 4, b"\0"))
    return (page_bytes if page_bytes > 1 else 1 << 16), pages


def state(path: str) -> list[tuple[int, int] | None]:
    """Return what changes when a database is written: sizes and times of its file and those beside it."""
    told: list[tuple[int, int] | None] = []
    for suffix in ("", *_BESIDE):
        try:
            status = os.stat(path + suffix)
        except OSError:
            told.append(None)
        else:
            told.append((status.st_size, status.st_mtime_ns))
    return told


@contextmanager
def _connected(path: str, how: str, with_texts: bool) -> Iterator[Database]:
    uri = f"file:{quote(os.path.abspath(path))}?{how}"
    with closing(sqlite3.connect(uri, uri=True, isolation_level=None)) as connection:
        yield Database(connection, with_texts)


def _judge(action: int, name: str | None, _: str | None, __: str | None, inner: str | None) -> int:
    """Allow reading tables, not from within a view or trigger, and their definitions."""
    allowed = action in _ALLOWED or (action == sqlite3.SQLITE_PRAGMA and name == "table_xinfo")
    return sqlite3.SQLITE_OK if allowed and inner is None else sqlite3.SQLITE_DENY
