"""``.db`` files, the SQLite databases that python-can writes: a message is a row of the table ``messages``."""

from __future__ import annotations

import sqlite3
from collections.abc import Generator, Iterator

from dissectors.batch import PacketBatch
from nvscope.capture.can.frame import CanFrame, CanRows, FrameBatches
from nvscope.capture.can.line_fields import LineFault
from nvscope.capture.can.on_disk import MAX_SPOOLED_BYTES, on_disk
from nvscope.capture.can.recorded_message import RecordedMessage
from nvscope.capture.can.sqlite_file import (
    MAX_VALUE_BYTES,
    Database,
    bytes_missing,
    opened,
    pages_left,
    state,
    unread_beside,
)
from nvscope.capture.content import Content
from nvscope.capture.formats import NoCapture
from nvscope.capture.reader import Reader, ReadingSizes
from nvscope.capture.source import Truncation
from nvscope.errors import UnreadableInput

_CHUNK_FRAMES = 4096
_COLUMNS = "rowid, ts, arbitration_id, extended, remote, error, dlc, data"
_QUERY = f"SELECT {_COLUMNS} FROM messages NOT INDEXED WHERE rowid >= ? ORDER BY rowid"
_FOLLOWING = "SELECT rowid FROM messages NOT INDEXED WHERE rowid >= ? ORDER BY rowid LIMIT 1"
_FIRST_ROW = -(1 << 63)

# What is wrong with a file is not always told in UTF-8.
_DATABASE_FAULTS = (sqlite3.Error, UnicodeError, OverflowError)


_NO_TABLE = "an SQLite file without a table 'messages' as python-can writes it, and without one of a DataLogger"


class _NoMessages(Exception):
    """An SQLite file that is no log of python-can."""


class SqliteReader(Reader):
    """Reads one database: from its file on disk where it is one, else from a copy."""

    def __init__(self, content: Content, sizes: ReadingSizes) -> None:
        super().__init__(content, sizes)
        self._path = content.disk_path
        self._pieces = iter(()) if self._path else content.pieces()
        if self._path:
            try:
                _check(self._path, content.path)
            except _NoMessages:
                raise NoCapture(
                    _NO_TABLE,
                    where=content.path,
                    next_step="tables of DataLoggers begin with the columns 'Timestamp' and 'ConsistentDataSeries'",
                ) from None
        self._next = _FIRST_ROW
        self._wrong = 0
        self._first_fault = ""

    def batches(self) -> Iterator[PacketBatch]:
        """Yield the messages in the order of their rows."""
        batches = FrameBatches(self.sizes.batch_packets)
        chunk = min(_CHUNK_FRAMES, self.sizes.batch_packets)
        frames: list[CanFrame] = []
        with on_disk(self._path, self._pieces) as path:
            if not self._path:
                self._check_copy(path)
            for frame in self._frames(path):
                frames.append(frame)
                if len(frames) == chunk:
                    yield from self._add(batches, frames)
                    frames = []
        if frames:
            yield from self._add(batches, frames)
        if batches.rows:
            yield batches.take()
        if self._path:
            self.position = self.content.size_bytes or 0
        if self._wrong:
            more = "" if self._wrong == 1 else f"; {self._wrong} faults in all"
            self.progress.left_out = self._first_fault + more
            self.progress.truncation = Truncation(self.position, self.progress.left_out)

    def _check_copy(self, path: str) -> None:
        try:
            _check(path, self.content.path)
        except _NoMessages:
            raise UnreadableInput(
                _NO_TABLE,
                where=self.content.path,
            ) from None

    def _add(self, batches: FrameBatches, frames: list[CanFrame]) -> Iterator[PacketBatch]:
        self.progress.frames += len(frames)
        yield from batches.add(CanRows.of(frames, [0] * len(frames)))

    def _frames(self, path: str) -> Iterator[CanFrame]:
        if self._path and (unread := unread_beside(path)):
            self._fault(unread)
        self._next = _FIRST_ROW
        cut = ""
        if missing := bytes_missing(path):
            cut = f"cut short: {missing[0]} of {missing[1]} bytes"
        before = state(path)
        try:
            with opened(path) as database:
                while True:
                    try:
                        yield from self._rows(database.execute(_QUERY, self._next))
                        break
                    except sqlite3.DataError:  # a value that is too long
                        if not (yield from self._rows_one_by_one(database)):
                            break
        except _DATABASE_FAULTS as error:
            after = f"after row {self._next - 1}" if self._next > _FIRST_ROW else ""
            if cut:
                self._fault(f"{cut}; nothing {after or 'of its rows'} can be read")
            else:
                self._fault(f"{after}{': ' * bool(after)}damaged: {error}; nothing after it can be read")
            cut = ""
        if cut:
            self._fault(cut)
        if state(path) != before:
            self._fault("changed while it was read: read it again when it is no longer recorded")

    def _rows_one_by_one(self, database: Database) -> Generator[CanFrame, None, bool]:
        """Yield the rows up to one with a value that is too long, and leave that out; False at the end of all.

        A cursor is a row ahead: what it fails at is the row after that which it was asked for.
        """
        while True:
            following = [row for (row,) in database.execute(_FOLLOWING, self._next)]
            if not following:
                return False
            before = self._next
            try:
                yield from self._rows(database.execute(f"{_QUERY} LIMIT 1", self._next))
                if self._next == before:
                    return False
            except sqlite3.DataError:
                self._fault(f"row {following[0]}: a value of more than {MAX_VALUE_BYTES} bytes")
                return self._is_next(following[0])

    def _rows(self, rows: Iterator[tuple[object, ...]]) -> Iterator[CanFrame]:
        for row, *told in rows:
            if not self._is_next(row):
                return
            try:
                frame = _message(told).frame()
            except (LineFault, TypeError, ValueError) as fault:
                self._fault(f"row {row}: {fault}")
                continue
            yield frame

    def _is_next(self, row: object) -> bool:
        """Note that a row was met; say so where it is one that was met before."""
        if not isinstance(row, int) or row < self._next:
            # Pages that lie several times in the tree of a table give rows without an end.
            self._fault(f"after row {self._next - 1}: damaged: row {row} follows; nothing after it can be read")
            return False
        self._next = row + 1
        return True

    def _fault(self, what: str) -> None:
        if not self._wrong:
            self._first_fault = what
        self._wrong += 1


def _message(told: list[object]) -> RecordedMessage:
    ts, identifier, extended, remote, error, dlc, data = told
    if not isinstance(ts, int | float):
        raise LineFault("no time")
    if not isinstance(identifier, int) or not isinstance(dlc, int) or identifier < 0:
        raise LineFault("no identifier or no length")
    if not isinstance(data, bytes | None):
        raise LineFault("data that are no bytes")
    return RecordedMessage(float(ts), identifier, bool(extended), bool(remote), bool(error), dlc, data or b"")


def _check(path: str, where: str) -> None:
    """Raise _NoMessages or UnreadableInput for an SQLite file that is no log, or does not even say what it is.

    Which tables it has stands in its first page.
    """
    missing, pages = bytes_missing(path), pages_left(path)
    cut = None
    if missing:
        what = f"an SQLite file that is cut short: {missing[0]} of {missing[1]} bytes"
        cut = UnreadableInput(what, where=where, next_step="copy the file again")
        if not pages or not pages[1] or missing[0] > MAX_SPOOLED_BYTES:
            raise cut
    try:
        with opened(path) as database:
            found = database.has_table("messages")
    except _DATABASE_FAULTS as error:
        raise cut or UnreadableInput(
            f"an SQLite file that cannot be read: {type(error).__name__}: {error}",
            where=where,
            next_step="copy it again from where it was written; `sqlite3 FILE .recover` may find what is left of it",
        ) from error
    if not found:
        raise _NoMessages
