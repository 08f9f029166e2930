"""CAN logs that python-can reads (.asc .blf .trc .csv .db .mf4), batched.

python-can is imported only when such a log is read. Channel numbers are named as python-can's own writers do, "can0".
Times are python-can's: .asc is in the local time zone, .trc, .blf and .mf4 are in UTC, and a log without a date begins
in 1970. A wrong line of a text is left out and told; behind a fault of another format nothing is read.
"""

from __future__ import annotations

import gc
import importlib.util
import io
import logging
import os
import shutil
import sqlite3
import struct
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING, TextIO, cast
from urllib.parse import quote

from dissectors.batch import PacketBatch
from nvscope.capture.byte_stream import ByteStream
from nvscope.capture.can.blf_containers import BlfContainers
from nvscope.capture.can.frame import MAX_CHANNEL_BYTES, MAX_CHANNELS, CanFrame, CanRows, FrameBatches
from nvscope.capture.can.message import MessageFault, described, frame_of
from nvscope.capture.content import Content
from nvscope.capture.formats import NoCapture, format_of
from nvscope.capture.reader import Reader, ReadingSizes
from nvscope.capture.source import Truncation
from nvscope.capture.text_lines import MAX_LINE_BYTES, TextLines
from nvscope.errors import UnreadableInput

if TYPE_CHECKING:
    import can

MAX_SPOOLED_BYTES = 2 << 30
"""Bytes that a log may have which has to be a file on disk, but is compressed or comes from a pipe."""

_MAX_TAIL_BYTES = 4 << 20
_CHUNK_FRAMES = 4096

# The kinds of logs, as reports call them.
_ASC, _BLF, _TRC, _CSV, _SQLITE, _MF4 = "asc", "blf", "trc", "csv", "sqlite", "mf4"

# What a text reader is to be given first where it begins anew in the middle of a file, in place of a header.
_RESUME_WITH = {_ASC: "internal events logged\n", _CSV: "header\n", _TRC: ""}


# What is wrong with a file is not always told in UTF-8.
_DATABASE_FAULTS = (sqlite3.Error, UnicodeError, OverflowError)


class _NoMessages(Exception):
    """An SQLite file that is no log of python-can."""


def _check_readable(kind: str, path: str, where: str) -> None:
    """Raise NoCapture or UnreadableInput where a log can be known to be unreadable without reading it."""
    if kind == _MF4 and importlib.util.find_spec("asammdf") is None:
        raise UnreadableInput(
            "an MDF 4 log, for which the package asammdf is missing",
            where=where,
            next_step='install it: pip install "python-can[mf4]"',
        )
    if kind == _SQLITE and path:
        try:
            _check_database(path, where)
        except _NoMessages:
            raise NoCapture(
                "an SQLite file without a table 'messages' as python-can writes it",
                where=where,
                next_step="a recording of a CODESYS DataLogger cannot be read yet",
            ) from None


def _check_database(path: str, where: str) -> None:
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
        raise UnreadableInput(f"an SQLite file that cannot be read: {described(error)}", where=where) from error
    if not found:
        raise _NoMessages


def _connect(path: str) -> sqlite3.Connection:
    # Read-only: opening a log must not change it.
    return sqlite3.connect(f"file:{quote(os.path.abspath(path))}?mode=ro", uri=True)


class CanLogReader(Reader):
    """Reads a log by python-can: in pieces, or from its file on disk where the format needs one and it is one."""

    def __init__(self, content: Content, sizes: ReadingSizes) -> None:
        super().__init__(content, sizes)
        found = format_of(content.head)
        assert found
        self._kind = found.name
        # SQLite and asammdf open files by themselves.
        self._path = content.disk_path if self._kind in (_SQLITE, _MF4) else ""
        self._pieces = iter(()) if self._path else content.pieces()
        _check_readable(self._kind, self._path, content.path)
        self._numbers: dict[object, int] = {}
        self._place = ""
        self._wrong = 0
        self._first_fault = ""
        self._fault_at = 0

    def batches(self) -> Iterator[PacketBatch]:
        """Yield the messages of the log as SocketCAN frames."""
        batches = FrameBatches(self.sizes.batch_packets)
        frames: list[CanFrame] = []
        channels: list[int] = []
        chunk = min(_CHUNK_FRAMES, self.sizes.batch_packets)
        with _warnings(self._kind) as warned:
            for message in self._messages():
                try:
                    channels.append(self._channel(message.channel))
                    frames.append(frame_of(message))
                except MessageFault as fault:
                    del channels[len(frames) :]
                    self._fault(str(fault))
                if len(frames) == chunk:
                    yield from self._add(batches, frames, channels)
                    frames, channels = [], []
            for line in warned:
                self._fault(f"python-can cannot read {line!r}")
        if frames:
            yield from self._add(batches, frames, channels)
        if batches.rows:
            yield batches.take()
        if self._path:
            self.position = self.content.size_bytes or 0
        if self._wrong:
            more = "" if self._wrong == 1 else f"; {self._wrong} faults in all"
            self.progress.left_out = self._first_fault + more
            self.progress.truncation = Truncation(self._fault_at, self.progress.left_out)

    def _add(self, batches: FrameBatches, frames: list[CanFrame], channels: list[int]) -> Iterator[PacketBatch]:
        self.progress.frames += len(frames)
        yield from batches.add(CanRows.of(frames, channels))

    def _fault(self, what: str, place: str | None = None) -> None:
        if not self._wrong:
            place = self._place if place is None else place
            self._first_fault = f"{place}: {what}" if place else what
            self._fault_at = self.position
        self._wrong += 1

    def _channel(self, channel: object) -> int:
        number = self._numbers.get(channel)
        if number is None:
            name = "" if channel is None else f"can{channel}" if isinstance(channel, int) else str(channel)
            name = name[:MAX_CHANNEL_BYTES]
            if len(self._numbers) >= MAX_CHANNELS:
                raise MessageFault(f"more than {MAX_CHANNELS} channels")
            if not self.channels and None in self._numbers:
                # What came before has no name, which need not be said as long as nothing has one.
                self.channels.append("")
            if name not in self.channels and (name or self.channels):
                self.channels.append(name)
            number = self._numbers[channel] = self.channels.index(name) if self.channels else 0
        return number

    def _messages(self) -> Iterator[can.Message]:
        if self._kind == _SQLITE:
            with _on_disk(self._path, self._pieces) as path:
                if not self._path:
                    try:
                        _check_database(path, self.content.path)
                    except _NoMessages:
                        raise self._unreadable("there is no table 'messages'") from None
                yield from self._of_database(path)
        elif self._kind == _MF4:
            with _on_disk(self._path, self._pieces) as path:
                yield from self._of_mdf(path)
        elif self._kind == _BLF:
            yield from self._of_blf()
        else:
            yield from self._of_text()

    def _of_text(self) -> Iterator[can.Message]:
        lines = TextLines(self._pieces)
        reader = _text_reader(self._kind, lines)
        begun = -1
        while True:
            try:
                for message in reader:
                    self._place = f"line {lines.number}"
                    self.position = lines.offset
                    yield message
                break
            except OSError:
                raise
            except Exception as error:
                self.position = lines.offset
                self._fault(f"{described(error)}; the line is left out", f"line {lines.number}")
                if lines.number == begun:
                    break
                begun = lines.number
                if _RESUME_WITH[self._kind]:
                    lines.push(_RESUME_WITH[self._kind])
        if lines.too_long:
            self._fault(f"more than {MAX_LINE_BYTES} characters", f"line {lines.first_too_long}")

    def _of_blf(self) -> Iterator[can.Message]:
        from can.io.blf import BLFReader  # noqa: PLC0415

        containers = BlfContainers(self._pieces)
        try:
            reader = BLFReader(io.BufferedReader(ByteStream(iter(containers)), 1 << 20))
        except OSError:
            raise
        except Exception as error:
            raise self._unreadable(containers.fault or described(error)) from error
        try:
            for message in reader:
                yield message
                if len(getattr(reader, "_tail", b"")) > _MAX_TAIL_BYTES:
                    break
        except OSError:
            raise
        except Exception as error:
            self.position = containers.offset
            self._fault(f"damaged: {described(error)}; nothing after it can be read", "")
        self.position = containers.offset
        tail = len(getattr(reader, "_tail", b""))
        if containers.fault:
            self._fault(containers.fault, "")
        elif tail >= 16:
            self._fault(f"damaged: the last object has only {tail} bytes left of it", "")

    def _of_database(self, path: str) -> Iterator[can.Message]:
        import can  # noqa: PLC0415

        query = "SELECT rowid, ts, arbitration_id, extended, remote, error, dlc, data FROM messages ORDER BY rowid"
        try:
            with closing(_connect(path)) as database:
                for row, ts, identifier, extended, remote, error, dlc, data in database.execute(query):
                    self._place = f"row {row}"
                    try:
                        message = can.Message(
                            timestamp=ts, arbitration_id=identifier, is_extended_id=bool(extended),
                            is_remote_frame=bool(remote), is_error_frame=bool(error), dlc=dlc,
                            data=data if isinstance(data, bytes) else None,
                        )  # fmt: skip
                    except (TypeError, ValueError) as fault:
                        self._fault(described(fault))
                        continue
                    yield message
        except _DATABASE_FAULTS as error:
            self._fault(
                f"damaged: {error}; nothing after it can be read", f"after {self._place}" if self._place else ""
            )

    def _of_mdf(self, path: str) -> Iterator[can.Message]:
        from can.io.mf4 import MF4Reader  # noqa: PLC0415

        fault = ""
        try:
            reader = MF4Reader(path)
        except Exception as error:
            fault = described(error)
        if fault:
            _forget_half_opened()
            raise self._unreadable(fault)
        try:
            yield from reader
        except Exception as error:
            self._fault(f"damaged: {described(error)}; nothing after it can be read", "")
        finally:
            reader.stop()

    def _unreadable(self, what: str) -> UnreadableInput:
        return UnreadableInput(
            f"a {self._kind} log that python-can cannot open: {what}",
            where=self.content.path,
            next_step="copy the file again",
        )


def _text_reader(kind: str, text: TextLines) -> Iterable[can.Message]:
    # Of a file, python-can's readers need the lines only.
    lines = cast("TextIO", text)
    if kind == _CSV:
        from can.io.csv import CSVReader  # noqa: PLC0415

        return CSVReader(lines)
    if kind == _TRC:
        from can.io.trc import TRCReader  # noqa: PLC0415

        return TRCReader(lines)
    from can.io.asc import ASCReader  # noqa: PLC0415

    class DatedAscReader(ASCReader):
        """Begins in 1970 where python-can does not understand the date; it would not read such a log at all."""

        @staticmethod
        def _datetime_to_timestamp(datetime_string: str) -> float:
            try:
                return float(ASCReader._datetime_to_timestamp(datetime_string))
            except (ValueError, OverflowError, OSError):
                return 0.0

    return DatedAscReader(lines, relative_timestamp=False)


def _forget_half_opened() -> None:
    """Let go of a log that asammdf did not open whole, where what that says of it on stderr is not heard."""
    hook = sys.unraisablehook
    sys.unraisablehook = lambda _: None
    try:
        gc.collect()
    finally:
        sys.unraisablehook = hook


@contextmanager
def _on_disk(path: str, pieces: Iterator[bytes]) -> Iterator[str]:
    """Yield the path of a file with the log in it."""
    if path:
        yield path
        return
    directory = tempfile.mkdtemp(prefix="nvscope-")
    try:
        spooled = os.path.join(directory, "log")
        size = 0
        with open(spooled, "wb") as file:
            for piece in pieces:
                size += len(piece)
                if size > MAX_SPOOLED_BYTES:
                    raise UnreadableInput(
                        f"a log of more than {MAX_SPOOLED_BYTES >> 30} GiB that is compressed or comes from a pipe",
                        next_step="decompress it to a file first",
                    )
                file.write(piece)
        yield spooled
    finally:
        shutil.rmtree(directory, ignore_errors=True)


@contextmanager
def _warnings(kind: str) -> Iterator[list[str]]:
    """Collect the lines that python-can leaves out with no more than a warning."""
    lines: list[str] = []

    class Collector(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            # A header without messages is parsed as one, too.
            line = str(record.args[0]) if record.args and isinstance(record.args, tuple) else ""
            if kind == _TRC and record.levelno >= logging.WARNING and line and not line.startswith(";"):
                lines.append(line[:80])

    handler = Collector()
    loggers = [logging.getLogger(name) for name in ("can", "asammdf")]
    for logger in loggers:
        logger.addHandler(handler)
    try:
        yield lines
    finally:
        for logger in loggers:
            logger.removeHandler(handler)
