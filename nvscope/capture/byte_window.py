"""A capture file as a window that moves over its bytes: mapped where it is a file, buffered where it is a stream.

A small file is in memory as a whole: what it was read from can be closed at once, and files by the hundred can be read
side by side.
"""

from __future__ import annotations

import io
import mmap
import time
from collections.abc import Iterator
from typing import Protocol

import numpy as np
from msgspec import Struct

from dissectors.batch import PAD_BYTES, U8
from nvscope.capture import bus_error

SMALL_FILE_BYTES = 8 << 20
CHUNK_BYTES = 8 << 20
_TAIL_BYTES = 4096
_RELEASE_BYTES = 8 << 20


class View(Struct, frozen=True):
    """A stretch of a file in memory.

    ``data[start:end]`` are bytes that were not read yet; ``data[0]`` is at ``origin`` in the file. Records that begin
    at ``stop`` or later are to be left to the next view. ``ends_file`` says that nothing follows ``end``.
    ``PAD_BYTES`` can be read after ``end``, or, where ``stop`` is less, at least ``PAD_BYTES`` + 64 after ``stop``.
    """

    data: U8
    start: int
    stop: int
    end: int
    origin: int
    ends_file: bool


class ByteWindow(Protocol):
    """The bytes of a file, in order."""

    def view(self, position: int) -> View:
        """Return the view that begins at ``position`` of the file; asked again for the same position it holds more."""
        ...

    def release(self, position: int) -> None:
        """Let go of memory for what lies before ``position``. Batches stay readable."""
        ...

    def close(self) -> None: ...


class MappedWindow:
    """A regular file, mapped. The last bytes come as a padded copy, and a small file as a whole.

    A file that another program shortens while it is mapped ends the process (``bus_error``); one that grows is read to
    the size it had. ``path`` is what it is called then. ``data`` are the bytes of the map.
    """

    def __init__(self, descriptor: int, size: int, *, small_file_bytes: int = SMALL_FILE_BYTES, path: str = "") -> None:
        bus_error.mapped(id(self), path)
        self._map = mmap.mmap(descriptor, size, access=mmap.ACCESS_READ)
        if hasattr(mmap, "MADV_SEQUENTIAL"):
            self._map.madvise(mmap.MADV_SEQUENTIAL)
        self.size = size
        self._small = small_file_bytes
        self._released = 0
        self.data = np.frombuffer(self._map, np.uint8)

    def view(self, position: int) -> View:
        rest = self.size - position
        if rest > max(self._small, 2 * _TAIL_BYTES):
            return View(self.data, position, self.size - _TAIL_BYTES, self.size, 0, True)
        data = np.zeros(rest + PAD_BYTES, np.uint8)
        data[:rest] = self.data[position:]
        return View(data, 0, rest, rest, position, True)

    def release(self, position: int) -> None:
        # Pages of the file are in the page cache anyway: without them in the process its memory does not grow.
        # What lies close before the position is still to be looked at.
        if position - self._released >= 2 * _RELEASE_BYTES:
            until = (position - _RELEASE_BYTES) // mmap.PAGESIZE * mmap.PAGESIZE
            if hasattr(mmap, "MADV_DONTNEED"):
                self._map.madvise(mmap.MADV_DONTNEED, self._released, until - self._released)
            self._released = until

    def close(self) -> None:
        """Drop the map; it goes when the last batch over it does."""
        bus_error.unmapped(id(self))
        del self.data


class WholeWindow:
    """A small regular file, read as a whole into a padded copy: of ``descriptor`` nothing is needed any more.

    Raises OSError where it cannot be read; what it has lost meanwhile of its ``size`` is not there.
    """

    def __init__(self, descriptor: int, size: int) -> None:
        self._data = np.zeros(size + PAD_BYTES, np.uint8)
        file = io.FileIO(descriptor, closefd=False)
        before = file.seek(0, io.SEEK_CUR)
        file.seek(0)
        rest = self._data.data[:size]
        while rest and (count := file.readinto(rest)):
            rest = rest[count:]
        file.seek(before)
        self._size = size - len(rest)

    def view(self, position: int) -> View:
        return View(self._data, min(position, self._size), self._size, self._size, 0, True)

    def release(self, position: int) -> None:
        pass

    def close(self) -> None:
        pass


class StreamWindow:
    """Bytes that come in pieces: a pipe, or what a decompressor yields.

    An empty piece says that there is nothing for the moment; then, or after ``patience_ns``, what has come is a view.
    With ``pauses``, it is one also where nothing has come.
    """

    def __init__(
        self, pieces: Iterator[bytes], *, chunk_bytes: int = CHUNK_BYTES, patience_ns: int = 250_000_000,
        pauses: bool = False,
    ) -> None:  # fmt: skip
        self._pieces = pieces
        self._chunk_bytes = chunk_bytes
        self._patience_ns = patience_ns
        self._pauses = pauses
        self._data = np.zeros(PAD_BYTES, np.uint8)
        self._origin = 0
        self._end = 0

    def view(self, position: int) -> View:
        pieces: list[bytes] = []
        fresh = 0
        begun_ns = time.monotonic_ns()
        ends_file = True
        for piece in self._pieces:
            if piece:
                pieces.append(piece)
                fresh += len(piece)
            enough = fresh >= self._chunk_bytes or not piece or time.monotonic_ns() - begun_ns > self._patience_ns
            if (fresh or self._pauses) and enough:
                ends_file = False
                break
        # The position is beyond what has come only once: when a file header was read in another way.
        origin = min(position, self._origin + self._end)
        carry = self._data[origin - self._origin : self._end]
        end = len(carry) + fresh
        data = np.empty(end + PAD_BYTES, np.uint8)
        data[: len(carry)] = carry
        at = len(carry)
        for piece in pieces:
            data[at : at + len(piece)] = np.frombuffer(piece, np.uint8)
            at += len(piece)
        data[end:] = 0
        self._data, self._origin, self._end = data, origin, end
        return View(data, min(position - origin, end), end, end, origin, ends_file)

    def release(self, position: int) -> None:
        pass

    def close(self) -> None:
        self._pieces = iter(())
