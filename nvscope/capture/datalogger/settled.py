"""Databases as they are once their writers' unfinished work is done or undone; the files themselves stay as they are.

What a writer has not put into a database yet lies in ``-wal`` beside it, and what one that was killed would have to
take back in ``-journal``. SQLite looks after both by writing, so it does that in a copy.
"""

from __future__ import annotations

import filecmp
import os
import shutil
import sqlite3
import struct
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager

from msgspec import Struct

from nvscope.capture.can.sqlite_file import left_beside, unread_beside

try:
    import fcntl
except ImportError:  # on Windows, where nobody can be asked who holds a file
    fcntl = None  # type: ignore[assignment]

# Bytes of the file that SQLite locks: whoever writes has one of these two.
_PENDING_BYTE, _RESERVED_BYTE = 0x40000000, 0x40000001
_LOCK = struct.Struct("@hhqqi")

_WAL_HEAD_BYTES, _WAL_FRAME_HEAD_BYTES = 32, 24
_WAL_CHECKSUMS = {0x377F0682: "<", 0x377F0683: ">"}
"""The order of bytes that checksums are made by, by what a -wal begins with."""


class Settled(Struct, frozen=True):
    """Where a database is to be read, and what of that people should know (may be empty).

    ``doubt`` says why something may be missing that its writer had finished, '' where nothing speaks for that.
    """

    path: str
    notes: tuple[str, ...] = ()
    doubt: str = ""


@contextmanager
def settled(path: str) -> Iterator[Settled]:
    """Give the place of a database without unfinished work: itself, or a copy for as long as it is needed."""
    notes = [writer] if (writer := writer_of(path)) else []
    beside = left_beside(path)
    if not beside:
        yield Settled(path, tuple(notes))
        return
    name = os.path.basename(path)
    if unread := unread_beside(path):
        yield Settled(path, (*notes, unread))
        return
    directory = tempfile.mkdtemp(prefix="nvscope-")
    try:
        copy = os.path.join(directory, "log")
        for suffix in ("", *beside):
            shutil.copyfile(path + suffix, copy + suffix)
        try:
            frames = _settle(copy)
        except sqlite3.Error as error:
            names = " and ".join(name + suffix for suffix in beside)
            unread = f"{names} cannot be taken in: {error}"
            yield Settled(path, (*notes, unread), f"{unread}. What its writer did last may be missing.")
            return
        if "-journal" in beside:
            notes.append(f"{name}-journal {_undone(path, copy)}")
        if "-wal" not in beside:
            yield Settled(copy, tuple(notes))
        elif frames:
            done = "was left beside it, and was taken in: the file alone lacks what its writer did last"
            yield Settled(copy, (*notes, f"{name}-wal {done}"))
        elif what := _wrong_with_wal(path + "-wal"):
            doubt = f"{name}-wal lies beside it and is damaged ({what}): nothing of it can be taken in, and what its "
            yield Settled(copy, tuple(notes), f"{doubt}writer did last may be missing.")
        else:
            yield Settled(copy, (*notes, f"{name}-wal lies beside it, and no finished change is in it to be taken in"))
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


def _settle(path: str) -> int:
    """Have SQLite do what is unfinished; return how many frames of ``-wal`` were taken in."""
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("PRAGMA trusted_schema = OFF")
        connection.execute("SELECT COUNT(*) FROM sqlite_master").fetchone()
        # Only the first way tells of frames; the other leaves nothing beside the copy.
        _, _, frames = connection.execute("PRAGMA wal_checkpoint(FULL)").fetchone()
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
    return max(int(frames), 0)


def _undone(path: str, copy: str) -> str:
    """Say what a journal did to the copy of a database."""
    if filecmp.cmp(path, copy, shallow=False):
        return "lies beside it, and there was nothing to undo"
    return "was left beside it, and what its writer had not finished was undone: the file alone has a part of that"


def _wrong_with_wal(path: str) -> str:
    """Say what is wrong with a ``-wal`` of which nothing is whole, '' where it may just be unfinished."""
    with open(path, "rb") as file:
        head = file.read(_WAL_HEAD_BYTES)
        size = file.seek(0, os.SEEK_END)
    magic, _, page_bytes = struct.unpack_from(">LLL", head)
    if magic not in _WAL_CHECKSUMS or _wal_checksum(head[:-8], _WAL_CHECKSUMS[magic]) != struct.unpack(
        ">LL", head[-8:]
    ):
        return "it does not begin as one"
    if page_bytes and (size - _WAL_HEAD_BYTES) % (_WAL_FRAME_HEAD_BYTES + page_bytes):
        return "it ends in the middle of a page"
    return ""


def _wal_checksum(data: bytes, order: str) -> tuple[int, int]:
    """Return the checksum of https://www.sqlite.org/fileformat2.html, section 4.2."""
    first = second = 0
    for one, other in struct.iter_unpack(f"{order}LL", data):
        first = (first + one + second) & 0xFFFFFFFF
        second = (second + other + first) & 0xFFFFFFFF
    return first, second
