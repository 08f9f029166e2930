"""What is in an open capture file, decompressed, as its reader wants it: a window, pieces, a file on disk."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterator
from itertools import chain
from typing import Protocol

from msgspec import Struct

from nvscope.capture.byte_window import (
    CHUNK_BYTES,
    SMALL_FILE_BYTES,
    ByteWindow,
    MappedWindow,
    StreamWindow,
    WholeWindow,
)
from nvscope.capture.compressed import COMPRESSIONS, Decompressed, compression_of
from nvscope.capture.datalogger.names import is_newest
from nvscope.capture.formats import READABLE, TEXT_HEAD_BYTES, NoCapture, either, is_enough
from nvscope.capture.pieces import FilePieces, PipePieces, is_whole_file, read_at
from nvscope.capture.time_span import TimeSpan
from nvscope.errors import UnreadableInput

STDIN = "-"

EXPECTED = f"{READABLE}, plain or compressed with {either(COMPRESSIONS)}"
"""What a person may give as a capture file."""


class ContentSizes(Struct, frozen=True):
    """How much is in memory at a time: ``small_file_bytes`` and ``chunk_bytes`` are those of the windows."""

    small_file_bytes: int = SMALL_FILE_BYTES
    chunk_bytes: int = CHUNK_BYTES


class Input(Protocol):
    """Bytes as they are on disk or on their way, in pieces, of which those before ``position`` were read."""

    @property
    def position(self) -> int: ...

    def __iter__(self) -> Iterator[bytes]: ...


class Content:
    """The content of a file that is open as ``descriptor``; ``path`` is what messages call it, "-" is stdin.

    ``head`` are its first bytes, none of a database that a logger has only begun; ``compression`` is how they were
    compressed, '' if not at all. A ``regular`` file can be opened again. A reader takes either ``window()`` or
    ``pieces()``, or reads the file at ``disk_path`` by itself.
    ``span`` is what is wanted of it: packets outside may be left out. Raises NoCapture where there is nothing in it.
    Where it ``pauses``, a reader must not wait for what comes next, but say that nothing has come.
    """

    pauses = False

    def __init__(
        self,
        path: str,
        descriptor: int,
        sizes: ContentSizes,
        span: TimeSpan,
        stopped: Callable[[], bool] = lambda: False,
    ) -> None:
        self.path = path
        self.span = span
        self._descriptor = descriptor
        self._sizes = sizes
        self._window: ByteWindow | None = None
        self._decompressed: Decompressed | None = None
        status = os.fstat(descriptor)
        if stat.S_ISDIR(status.st_mode):
            raise UnreadableInput("a directory, expected a file", where=path)
        self.regular = is_whole_file(descriptor) if path == STDIN else stat.S_ISREG(status.st_mode)
        self.size_bytes = status.st_size if self.regular else None
        self._input: Input = FilePieces(descriptor, stopped) if self.regular else PipePieces(descriptor, stopped)
        self._pieces = iter(self._input)
        self._by_pieces = not self.regular
        self._begin(read_at(descriptor, TEXT_HEAD_BYTES, 0) if self.regular else self._peek())

    def _begin(self, head: bytes) -> None:
        """Find out by its first bytes whether it is compressed, and what it begins with if it is."""
        self.head = head
        self.compression = compression_of(self.head)
        if not self.head and not (self.regular and self.path != STDIN and is_newest(self.path)):
            raise NoCapture(
                f"empty (0 bytes), expected {EXPECTED}", where=self.path,
                next_step="was anything written to it? --follow waits for what is still to come",
            )  # fmt: skip
        if self.compression:
            self._decompressed = Decompressed(self._pieces, self.compression)
            self._pieces = iter(self._decompressed)
            self._by_pieces = True
            self.head = self._peek()
            if not self.head:
                what = self.failure or f"{self.compression} data with nothing in them"
                raise NoCapture(f"{what}, expected {EXPECTED}", where=f"{self.path}, offset 0")

    def _peek(self) -> bytes:
        """Return as much from the begin of the pieces as tells what they are, if there is as much, and put it back."""
        taken: list[bytes] = []
        for piece in self._pieces:
            taken.append(piece)
            if is_enough(b"".join(taken)[:TEXT_HEAD_BYTES]):
                break
        self._pieces = chain(taken, self._pieces)
        return b"".join(taken)[:TEXT_HEAD_BYTES]

    @property
    def failure(self) -> str:
        """What ended the bytes before their end, '' while nothing has."""
        return self._decompressed.failure if self._decompressed else ""

    @property
    def disk_path(self) -> str:
        """The path of a file on disk that is this content, '' where it is compressed, or comes from a pipe."""
        is_there = self.regular and self.path != STDIN and not self.compression
        # What is read may be a copy of what came from a pipe of this name.
        return self.path if is_there and os.path.isfile(self.path) else ""

    @property
    def begin(self) -> str:
        """Where the content begins, as messages tell it."""
        return f"{self.path}, offset 0" + (f" of the {self.compression} data" if self.compression else "")

    def pieces(self) -> Iterator[bytes]:
        """Return the bytes in pieces, once; empty ones where the other side pauses."""
        self._by_pieces = True
        return self._pieces

    def window(self) -> ByteWindow:
        """Return a window over the bytes: a map of a regular file where it can be mapped, a buffer of all others."""
        if self._window is None:
            self._window = None if self._by_pieces else self._map()
            self._window = self._window or StreamWindow(
                self.pieces(), chunk_bytes=self._sizes.chunk_bytes, pauses=self.pauses
            )
        return self._window

    def _map(self) -> ByteWindow | None:
        assert self.size_bytes is not None
        small = self._sizes.small_file_bytes
        if 0 < self.size_bytes <= small:  # what says 0 may be made while it is read, such as files of /proc
            window = WholeWindow(self._descriptor, self.size_bytes)
            self._let_go()
            return window
        try:
            return MappedWindow(self._descriptor, self.size_bytes, small_file_bytes=small, path=self.path)
        except (OSError, ValueError):
            # Empty, or of a kind that cannot be mapped: read like a stream.
            return None

    def position_bytes(self, reader_position: int) -> int:
        """Return how many bytes of the file were read, where its reader is at a position of the content."""
        return self._input.position if self._by_pieces else reader_position

    def close(self) -> None:
        """Close the file; also repeatedly."""
        if self._window is not None:
            self._window.close()
            self._window = None
        self._let_go()

    def _let_go(self) -> None:
        """Close the descriptor, if it is not one of the program's own."""
        if self._descriptor > 2:
            os.close(self._descriptor)
        self._descriptor = -1
