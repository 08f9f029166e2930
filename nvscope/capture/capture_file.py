"""One capture file as a source of packets, told by its content."""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from dissectors.batch import PacketBatch
from nvscope.capture import pcap, pcapng
from nvscope.capture.can.candump import CandumpReader
from nvscope.capture.compressed import Decompressed, compression_of
from nvscope.capture.formats import (
    BY_PYTHON_CAN,
    HEAD_BYTES,
    TEXT_HEAD_BYTES,
    Format,
    format_of,
    is_candump_screen,
    is_enough,
)
from nvscope.capture.pieces import FilePieces, PipePieces, read_at
from nvscope.capture.reader import Reader, ReadingSizes
from nvscope.capture.source import SourceInfo, Truncation
from nvscope.capture.window import CHUNK_BYTES, SMALL_FILE_BYTES, MappedWindow, StreamWindow, Window
from nvscope.errors import UnreadableInput

STDIN = "-"

_READ_ONLY = os.O_RDONLY | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)

_PEEK_SIZES = ReadingSizes(batch_packets=1, stride_bytes=4096)
_PEEK_BYTES = 64 << 10
_EXPECTED = "a pcap or pcapng file or a CAN log, plain or compressed with gzip, zstd or lz4"


_MAPPED = (Format.PCAP, Format.PCAPNG, Format.CANDUMP)


class NoCapture(UnreadableInput):
    """A file that is empty, or whose first bytes are of no known capture format."""


@dataclass(slots=True)
class _Opened:
    """A file that is being read."""

    descriptor: int
    regular: bool
    window: Window
    reader: Reader
    pieces: FilePieces | PipePieces | None = None
    decompressed: Decompressed | None = None

    @property
    def position(self) -> int:
        return self.pieces.position if self.pieces else self.reader.position

    def close(self) -> None:
        self.window.close()
        if self.descriptor > 2:
            os.close(self.descriptor)


class CaptureFile:
    """The packets of one file; "-" is stdin.

    The file is told by its first bytes at once, and read when iterated; a regular file can be iterated again.
    Raises UnreadableInput where it cannot be opened or is no capture file. ``small_file_bytes`` and ``chunk_bytes`` are
    those of MappedWindow and StreamWindow.
    """

    def __init__(
        self,
        path: str,
        *,
        sizes: ReadingSizes | None = None,
        small_file_bytes: int = SMALL_FILE_BYTES,
        chunk_bytes: int = CHUNK_BYTES,
    ) -> None:
        self.path = path
        self.info = SourceInfo(path, "")
        self.size_bytes: int | None = None
        self._sizes = sizes or ReadingSizes()
        self._small_file_bytes = small_file_bytes
        self._chunk_bytes = chunk_bytes
        self._position = 0
        self._channels: list[str] = []
        opened = self._open()
        self._opened: _Opened | None = None
        self._batches: Iterator[PacketBatch] | None = None
        if opened.regular:
            # What can be opened again is not kept open: there may be more files than descriptors.
            opened.close()
        else:
            self._batches = self._read(1, opened)

    @property
    def infos(self) -> list[SourceInfo]:
        return [self.info]

    @property
    def channels(self) -> Sequence[str]:
        """The names of the channels of the packets read so far, by number; empty where the file tells none."""
        return self._channels

    @property
    def position_bytes(self) -> int:
        """How much of ``size_bytes`` has been read; of a compressed file the compressed bytes."""
        return self._opened.position if self._opened else self._position

    def __iter__(self) -> Iterator[PacketBatch]:
        return self.read(1)

    def first_ts_ns(self) -> int | None:
        """Return the time of the first packet, or None where there is none."""
        if self._batches is None:
            few = CaptureFile(self.path, sizes=_PEEK_SIZES, small_file_bytes=0, chunk_bytes=_PEEK_BYTES)
            first = next(iter(few), None)
        else:
            first = self._peek(self._batches)
        return None if first is None else int(first.ts_ns[0])

    def first_batches(self) -> list[PacketBatch]:
        """Return what the file begins with, if anything; it is read again later."""
        first = next(iter(CaptureFile(self.path)), None) if self._batches is None else self._peek(self._batches)
        return [] if first is None else [first]

    def _peek(self, batches: Iterator[PacketBatch]) -> PacketBatch | None:
        """Return the first batch of what can be read only once, and put it back."""
        first = next(batches, None)
        self._batches = chain([] if first is None else [first], batches)
        return first

    def read(self, share: int) -> Iterator[PacketBatch]:
        """Return the packets, read with a ``share``-th of the memory that it would take otherwise."""
        return self._read(share) if self._batches is None else self._batches

    def _read(self, share: int, opened: _Opened | None = None) -> Iterator[PacketBatch]:
        self._opened = opened = opened or self._open(share)
        reader, window = opened.reader, opened.window
        self._channels = reader.channels
        try:
            while not reader.finished:
                view = window.view(reader.position)
                reader.input_failed = bool(opened.decompressed and opened.decompressed.failure)
                for batch in reader.read(view):
                    yield batch
                    window.release(reader.position)
        except OSError as error:
            raise self._unreadable(error) from error
        finally:
            self._end(opened)

    def _end(self, opened: _Opened) -> None:
        self._position, self._opened = opened.position, None
        if not opened.regular:
            self.info.bytes = opened.position
        failure = opened.decompressed.failure if opened.decompressed else ""
        if failure:
            cut = self.info.truncation
            message = f"{failure}; frames are read up to the last whole record"
            if opened.reader.left_out:
                message += f"; before that, {opened.reader.left_out}"
            self.info.truncation = Truncation(cut.offset if cut else opened.reader.position, message)
        opened.close()

    def _open(self, share: int = 1) -> _Opened:
        info = self.info
        info.frames, info.drops, info.truncation = 0, 0, None
        info.comments.clear()
        try:
            descriptor = sys.stdin.fileno() if self.path == STDIN else os.open(self.path, _READ_ONLY)
            try:
                return self._tell(descriptor, share)
            except BaseException:
                if descriptor > 2:
                    os.close(descriptor)
                raise
        except OSError as error:
            raise self._unreadable(error) from error

    def _unreadable(self, error: OSError) -> UnreadableInput:
        return UnreadableInput(
            error.strerror or str(error), where=self.path, next_step="check the path and the permissions"
        )

    def _tell(self, descriptor: int, share: int) -> _Opened:
        """Find out what the file is, and get ready to read it."""
        status = os.fstat(descriptor)
        if stat.S_ISDIR(status.st_mode):
            raise UnreadableInput("a directory, expected a file", where=self.path)
        regular = stat.S_ISREG(status.st_mode) and (self.path != STDIN or not os.lseek(descriptor, 0, os.SEEK_CUR))
        if regular:
            self.size_bytes = self.info.bytes = status.st_size
            head = read_at(descriptor, TEXT_HEAD_BYTES, 0)
            if format_of(head) in _MAPPED:
                mapped = self._map(descriptor, status.st_size)
                if mapped:
                    return _Opened(descriptor, regular, mapped, self._reader(head, share))
        pieces = FilePieces(descriptor) if regular else PipePieces(descriptor)
        head, content = _peek(iter(pieces))
        compression = compression_of(head)
        if not head:
            raise NoCapture(f"empty (0 bytes), expected {_EXPECTED}", where=self.path)
        decompressed = None
        if compression:
            decompressed = Decompressed(content, compression)
            head, content = _peek(iter(decompressed))
            if not head:
                what = decompressed.failure or f"{compression} data with nothing in them"
                raise NoCapture(f"{what}, expected {_EXPECTED}", where=f"{self.path}, offset 0")
        kind = format_of(head)
        window: Window
        reader: Reader
        if kind in BY_PYTHON_CAN:
            path = self.path if regular and self.path != STDIN and not compression else ""
            reader, window = self._log_reader(kind, share, content, path), StreamWindow(iter(()))
        else:
            reader = self._reader(head, share, compression)
            chunk_bytes = max(self._chunk_bytes // share, min(256 << 10, self._chunk_bytes))
            window = StreamWindow(content, chunk_bytes=chunk_bytes)
        return _Opened(descriptor, regular, window, reader, pieces, decompressed)

    def _map(self, descriptor: int, size: int) -> MappedWindow | None:
        try:
            return MappedWindow(descriptor, size, small_file_bytes=self._small_file_bytes)
        except (OSError, ValueError):
            # Empty, or of a kind that cannot be mapped: read like a stream.
            return None

    def _shared(self, share: int) -> ReadingSizes:
        sizes = self._sizes
        if share > 1:
            sizes = replace(sizes, batch_packets=max(sizes.batch_packets // share, min(1024, sizes.batch_packets)))
        return sizes

    def _reader(self, head: bytes, share: int, compression: str = "") -> Reader:
        sizes = self._shared(share)
        kind = format_of(head)
        if kind is Format.PCAP:
            return pcap.PcapReader(head[:HEAD_BYTES], self.info, sizes)
        if kind is Format.PCAPNG:
            return pcapng.PcapngReader(head[:HEAD_BYTES], self.info, sizes)
        if kind is Format.CANDUMP:
            return CandumpReader(self.info, sizes)
        inside = f" of the {compression} data" if compression else ""
        where = f"{self.path}, offset 0{inside}"
        if is_candump_screen(head):
            raise NoCapture(
                "what candump shows on a screen, expected its log",
                where=where,
                next_step="record with candump -L, or candump -l for a file",
            )
        raise NoCapture(f"the bytes {head[:4].hex(' ')}, expected {_EXPECTED}", where=where)

    def _log_reader(self, kind: Format, share: int, content: Iterator[bytes], path: str) -> Reader:
        from nvscope.capture.can.log import CanLogReader, NoMessages, check_readable  # noqa: PLC0415

        try:
            check_readable(kind, path, self.path)
        except NoMessages:
            raise NoCapture(
                "an SQLite file without a table 'messages' as python-can writes it",
                where=self.path,
                next_step="a recording of a CODESYS DataLogger cannot be read yet",
            ) from None
        return CanLogReader(self.info, kind, self._shared(share), content, path)


def _peek(pieces: Iterator[bytes]) -> tuple[bytes, Iterator[bytes]]:
    """Return as much from the begin of the pieces as tells what they are, if there is as much, and all pieces."""
    taken: list[bytes] = []
    for piece in pieces:
        taken.append(piece)
        if is_enough(b"".join(taken)[:TEXT_HEAD_BYTES]):
            break
    return b"".join(taken)[:TEXT_HEAD_BYTES], chain(taken, pieces)
