"""The bytes of an open file in pieces, as they come."""

from __future__ import annotations

import os
import select
import stat
import sys
from collections.abc import Callable, Iterator

READ_ONLY = os.O_RDONLY | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
"""How a file is opened whose bytes are wanted."""

OF_A_STREAM = READ_ONLY | getattr(os, "O_NONBLOCK", 0)
"""How a pipe is: it is open at once, whether or not anybody writes into it."""

_PIECE_BYTES = 256 << 10
_IDLE_SECONDS = 0.1
_CAN_WAIT = sys.platform != "win32"  # there, select knows sockets only


def read_at(descriptor: int, size_bytes: int, position: int) -> bytes:
    """Read from a place in a regular file; where the next plain read begins stays as it is."""
    if hasattr(os, "pread"):
        return os.pread(descriptor, size_bytes, position)
    before = os.lseek(descriptor, 0, os.SEEK_CUR)
    os.lseek(descriptor, position, os.SEEK_SET)
    try:
        return os.read(descriptor, size_bytes)
    finally:
        os.lseek(descriptor, before, os.SEEK_SET)


def is_whole_file(descriptor: int) -> bool:
    """Return whether a regular file is open of which nothing has been read."""
    return stat.S_ISREG(os.fstat(descriptor).st_mode) and not os.lseek(descriptor, 0, os.SEEK_CUR)


class Stopped(BaseException):
    """Reading ends because somebody said so: no error, and nothing that a library on the way may take for one."""


class FilePieces:
    """Pieces of a regular file, ``position`` bytes so far. Raises Stopped when ``stopped`` says so."""

    def __init__(self, descriptor: int, stopped: Callable[[], bool] = lambda: False) -> None:
        self._descriptor = descriptor
        self._stopped = stopped
        self.position = 0

    def __iter__(self) -> Iterator[bytes]:
        while piece := read_at(self._descriptor, _PIECE_BYTES, self.position):
            if self._stopped():
                raise Stopped
            self.position += len(piece)
            yield piece


class PipePieces:
    """Pieces of a pipe, terminal or socket; empty ones where the other side pauses. Raises Stopped as FilePieces do."""

    def __init__(self, descriptor: int, stopped: Callable[[], bool] = lambda: False) -> None:
        self._descriptor = descriptor
        self._stopped = stopped
        self.position = 0

    def __iter__(self) -> Iterator[bytes]:
        while True:
            while _CAN_WAIT and not select.select([self._descriptor], [], [], _IDLE_SECONDS)[0]:
                if self._stopped():
                    raise Stopped
                yield b""
            if self._stopped():
                raise Stopped
            piece = os.read(self._descriptor, _PIECE_BYTES)
            if not piece:
                return
            self.position += len(piece)
            yield piece
