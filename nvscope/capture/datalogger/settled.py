"""Databases as they are once their writers' unfinished work is done or undone; the files themselves stay as they are.

What a writer has not put into a database yet lies in ``-wal`` beside it, and what one that was killed would have to
take back in ``-journal``. SQLite looks after both by writing, so it does that in a copy.
"""

from __future__ import annotations

import os
import shutil
import sqlite3
import struct
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass

from nvscope.capture.can.sqlite_file import left_beside, unread_beside

try:
    import fcntl
except ImportError:  # on Windows, where nobody can be asked who holds a file
    fcntl = None  # type: ignore[assignment]

# Bytes of the file that SQLite locks: whoever writes has one of these two.
_PENDING_BYTE, _RESERVED_BYTE = 0x40000000, 0x40000001
_LOCK = struct.Struct("@hhqqi")


@dataclass(frozen=True, slots=True)
class Settled:
    """Where a database is to be read, and what of that people should know (may be empty)."""

    path: str
    notes: tuple[str, ...] = ()


@contextmanager
def settled(path: str) -> Iterator[Settled]:
    """Give the place of a database without unfinished work: itself, or a copy for as long as it is needed."""
    notes = [writer] if (writer := writer_of(path)) else []
    beside = left_beside(path)
    if not beside:
        yield Settled(path, tuple(notes))
        return
    names = " and ".join(os.path.basename(path) + suffix for suffix in beside)
    if unread := unread_beside(path):
        yield Settled(path, (*notes, unread))
        return
    directory = tempfile.mkdtemp(prefix="nvscope-")
    try:
        copy = os.path.join(directory, "log")
        for suffix in ("", *beside):
            shutil.copyfile(path + suffix, copy + suffix)
        try:
            _settle(copy)
        except sqlite3.Error as error:
            yield Settled(path, (*notes, f"{names} cannot be taken in: {error}"))
            return
        done = "was left beside it, and was taken in" if len(beside) == 1 else "were left beside it, and were taken in"
        yield Settled(copy, (*notes, f"{names} {done}: the file alone lacks what its writer did last"))
    finally:
        shutil.rmtree(directory, ignore_errors=True)


def writer_of(path: str) -> str:
    """Say who holds a database for writing, '' where nobody does or nobody can say."""
    if fcntl is None:
        return ""
    try:
        with open(path, "rb") as file:
            told = fcntl.fcntl(
                file, fcntl.F_GETLK, _LOCK.pack(fcntl.F_WRLCK, os.SEEK_SET, _PENDING_BYTE, 2, 0)
            )  # fmt: skip
        kind, *_, process = _LOCK.unpack(told)
    except (OSError, struct.error):
        return ""
    if kind == fcntl.F_UNLCK:
        return ""
    return f"locked: process {process} is writing to it now, and what it has not finished is not there yet"


def _settle(path: str) -> None:
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("PRAGMA trusted_schema = OFF")
        connection.execute("SELECT COUNT(*) FROM sqlite_master").fetchone()
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
