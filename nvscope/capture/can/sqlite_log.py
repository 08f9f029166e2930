"""``.db`` files, the SQLite databases that python-can writes: a message is a row of the table ``messages``."""

from __future__ import annotations

import os
import sqlite3
import struct
from collections.abc import Iterator
from contextlib import closing
from urllib.parse import quote

from dissectors.batch import PacketBatch
from nvscope.capture.can.frame import CanFrame, CanRows, FrameBatches
from nvscope.capture.can.line_fields import LineFault
from nvscope.capture.can.on_disk import on_disk
from nvscope.capture.can.recorded_message import RecordedMessage
from nvscope.capture.content import Content
from nvscope.capture.formats import NoCapture
from nvscope.capture.reader import Reader, ReadingSizes
from nvscope.capture.source import Truncation
from nvscope.errors import UnreadableInput

_CHUNK_FRAMES = 4096
_QUERY = "SELECT rowid, ts, arbitration_id, extended, remote, error, dlc, data FROM messages ORDER BY rowid"

# What is wrong with a file is not always told in UTF-8.
_DATABASE_FAULTS = (sqlite3.Error, UnicodeError, OverflowError)


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
                    "an SQLite file without a table 'messages' as python-can writes it",
                    where=content.path,
                    next_step="a recording of a CODESYS DataLogger cannot be read yet",
                ) from None
        self._place = ""
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
                "an SQLite file without a table 'messages' as python-can writes it", where=self.content.path
            ) from None

    def _add(self, batches: FrameBatches, frames: list[CanFrame]) -> Iterator[PacketBatch]:
        self.progress.frames += len(frames)
        yield from batches.add(CanRows.of(frames, [0] * len(frames)))

    def _frames(self, path: str) -> Iterator[CanFrame]:
        place = ""
        try:
            with closing(_connect(path)) as database:
                for row, *told in database.execute(_QUERY):
                    place = f"row {row}"
                    try:
                        frame = _message(told).frame()
                    except (LineFault, TypeError, ValueError) as fault:
                        self._fault(f"{place}: {fault}")
                        continue
                    yield frame
        except _DATABASE_FAULTS as error:
            self._fault(f"{f'after {place}: ' if place else ''}damaged: {error}; nothing after it can be read")

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
    content = data if isinstance(data, bytes) else b""
    return RecordedMessage(float(ts), identifier, bool(extended), bool(remote), bool(error), dlc, content)


def _check(path: str, where: str) -> None:
    """Raise _NoMessages or UnreadableInput for an SQLite file that is no log, or no whole one.

    SQLite reads zeros for what is missing of the last page, and would show them as messages.
    """
    with open(path, "rb") as file:
        head = file.read(32)
    page_bytes, pages = struct.unpack(">16xH10xL", head.ljust(32, b"\0"))
    expected = (page_bytes if page_bytes > 1 else 1 << 16) * pages
    if os.path.getsize(path) < expected:
        raise UnreadableInput(
            f"an SQLite file that is cut short: {os.path.getsize(path)} of {expected} bytes",
            where=where,
            next_step="copy the file again",
        )
    try:
        with closing(_connect(path)) as database:
            found = database.execute("SELECT 1 FROM sqlite_master WHERE name = 'messages'").fetchone()
    except _DATABASE_FAULTS as error:
        raise UnreadableInput(
            f"an SQLite file that cannot be read: {type(error).__name__}: {error}", where=where
        ) from error
    if not found:
        raise _NoMessages


def _connect(path: str) -> sqlite3.Connection:
    # Read-only: opening a log must not change it.
    return sqlite3.connect(f"file:{quote(os.path.abspath(path))}?mode=ro", uri=True)
