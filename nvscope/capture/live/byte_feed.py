"""Byte feeds: where the bytes of a capture come from while it is written: a pipe, or a file that grows.

None of them ever waits: who reads asks for what is there, and waits for ``fileno`` in between.
"""

from __future__ import annotations

import os
import select
import socket
import stat
import sys
import threading
import time
from collections import deque
from contextlib import suppress
from typing import Protocol

from nvscope.capture.pieces import OF_A_STREAM
from nvscope.errors import UnreadableInput

_PIECE_BYTES = 256 << 10
_PIPE_BYTES = 1 << 20
_LEAVING_NS = 500_000_000
_MOST_AHEAD = 32


class ByteFeed(Protocol):
    """Bytes that come one after the other.

    ``position`` is how many were read, ``old_bytes`` how many of them were there before anybody looked: when these came
    is unknown. ``is_there``: there is, or was, something to read from. ``ended``: nothing comes any more, and all was
    read. ``failure`` is why it ended, '' where it just did.
    """

    position: int
    old_bytes: int
    is_there: bool
    ended: bool
    failure: str

    def fileno(self) -> int:
        """Return the descriptor that has something to be read when bytes came, -1 where only looking tells."""
        ...

    def read(self) -> bytes:
        """Return some of the bytes that are there, b"" where there are none now."""
        ...

    def waiting_bytes(self) -> int:
        """Return how many bytes may be there that were not read yet."""
        ...

    def close(self) -> None:
        """Close what was opened; also repeatedly."""
        ...


class PipeFeed:
    """A pipe, a socket or a terminal that is open as ``descriptor``; ``owned`` descriptors are closed."""

    old_bytes = 0
    is_there = True

    def __init__(self, descriptor: int, *, owned: bool = False) -> None:
        self.position = 0
        self.ended = False
        self.failure = ""
        self._descriptor, self._owned = descriptor, owned
        _widen(descriptor)

    def fileno(self) -> int:
        return self._descriptor

    def read(self) -> bytes:
        if self.ended:
            return b""
        poll = select.poll()
        poll.register(self._descriptor, select.POLLIN)
        if not poll.poll(0):
            return b""
        try:
            piece = os.read(self._descriptor, _PIECE_BYTES)
        except (BlockingIOError, InterruptedError):
            return b""
        except OSError as error:
            self.ended, self.failure = True, f"reading failed: {error.strerror or error}"
            return b""
        self.ended = not piece
        self.position += len(piece)
        return piece

    def waiting_bytes(self) -> int:
        return _PIPE_BYTES

    def close(self) -> None:
        if self._owned and self._descriptor >= 0:
            os.close(self._descriptor)
        self._descriptor = -1


def _widen(descriptor: int) -> None:
    """Let a pipe hold more than the usual 64 KiB: who writes into it has to wait less often."""
    if sys.platform.startswith("linux"):
        from fcntl import F_SETPIPE_SZ, fcntl  # noqa: PLC0415  # not there on Windows

        with suppress(OSError):  # no pipe, or too many of this person's are wide already
            fcntl(descriptor, F_SETPIPE_SZ, _PIPE_BYTES)


class ThreadFeed:
    """What a thread reads from ``descriptor``, which may block it: where a system waits for sockets only."""

    old_bytes = 0
    is_there = True

    def __init__(self, descriptor: int) -> None:
        self.position = 0
        self.ended = False
        self.failure = ""
        self._pieces: deque[bytes] = deque()
        self._room = threading.Semaphore(_MOST_AHEAD)
        self._closed = False
        self._comes, self._tells = socket.socketpair()
        self._comes.setblocking(False)
        # Nobody can end a read that waits: the thread goes with the process.
        threading.Thread(target=self._run, args=(descriptor,), name="nvscope stream", daemon=True).start()

    def _run(self, descriptor: int) -> None:
        piece = b"\0"
        while piece and not self._closed:
            try:
                piece = os.read(descriptor, _PIECE_BYTES)
            except OSError as error:
                piece = b""
                self.failure = f"reading failed: {error.strerror or error}"
            self._pieces.append(piece)
            with suppress(OSError):
                self._tells.send(b"\0")
            self._room.acquire()

    def fileno(self) -> int:
        return self._comes.fileno()

    def read(self) -> bytes:
        if not self._pieces:
            return b""
        with suppress(OSError):
            self._comes.recv(1)
        piece = self._pieces.popleft()
        self._room.release()
        self.ended = not piece
        self.position += len(piece)
        return piece

    def waiting_bytes(self) -> int:
        return sum(len(piece) for piece in list(self._pieces))

    def close(self) -> None:
        self._closed = True
        self._room.release()
        self._comes.close()
        self._tells.close()


class FileFeed:
    """A file that grows, and that may not be there yet.

    It ends where the file is cut, or another one, or none, has its name: with what was in it until then.
    """

    def __init__(self, path: str) -> None:
        self.position = 0
        self.old_bytes = 0
        self.is_there = False
        self.ended = False
        self.failure = ""
        self._path = path
        self._descriptor = -1
        self._leaves_ns: int | None = None
        self._why = ""
        if self._open():
            self.old_bytes = os.fstat(self._descriptor).st_size

    def _open(self) -> bool:
        try:
            self._descriptor = os.open(self._path, OF_A_STREAM)
        except FileNotFoundError:
            return False
        except OSError as error:
            raise UnreadableInput(
                error.strerror or str(error), where=self._path, next_step="check the path and the permissions"
            ) from error
        self.is_there = True
        return True

    def fileno(self) -> int:
        return -1

    def read(self) -> bytes:
        if self.ended or (not self.is_there and not self._open()):
            return b""
        try:
            if (size := os.fstat(self._descriptor).st_size) < self.position:
                self._end(f"the file was cut to {size} bytes, of which {self.position} had been read")
                return b""
            piece = os.read(self._descriptor, _PIECE_BYTES)
        except OSError as error:
            self._end(f"reading failed: {error.strerror or error}")
            return b""
        self.position += len(piece)
        if not piece:
            self._look_for_it()
        return piece

    def _look_for_it(self) -> None:
        """End where the name stands for the file no longer, a while later: its writer may not have closed it yet."""
        now_ns = time.monotonic_ns()
        if self._leaves_ns is not None:
            if now_ns >= self._leaves_ns:
                self._end(self._why)
            return
        try:
            other = os.stat(self._path)
        except FileNotFoundError:
            self._why = "the file was deleted or renamed"
        except OSError as error:
            self._why = f"the file cannot be looked at: {error.strerror or error}"
        else:
            own = os.fstat(self._descriptor)
            if (own.st_dev, own.st_ino) == (other.st_dev, other.st_ino):
                return
            self._why = "another file has taken the place of this one"
        self._leaves_ns = now_ns + _LEAVING_NS

    def _end(self, failure: str) -> None:
        self.ended, self.failure = True, failure

    def waiting_bytes(self) -> int:
        return max(os.fstat(self._descriptor).st_size - self.position, 0) if self.is_there else 0

    def close(self) -> None:
        if self._descriptor >= 0:
            os.close(self._descriptor)
        self._descriptor = -1


def feed_of(path: str, descriptor: int | None = None) -> ByteFeed:
    """Return what feeds from a file or named pipe, or from what is open as ``descriptor``."""
    if descriptor is not None:
        return ThreadFeed(descriptor) if sys.platform == "win32" else PipeFeed(descriptor)
    try:
        status = os.stat(path)
    except OSError:
        return FileFeed(path)  # it waits for it, or says what is wrong
    if stat.S_ISDIR(status.st_mode):
        raise UnreadableInput("a directory, expected a file", where=path, next_step="name the file that grows")
    return FileFeed(path) if stat.S_ISREG(status.st_mode) else PipeFeed(os.open(path, OF_A_STREAM), owned=True)
