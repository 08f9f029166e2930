"""Streams: what can be read only once, as it comes; and copies of them, to be read again like files."""

from __future__ import annotations

import os
import stat
import sys
import tempfile
from collections.abc import Callable, Iterable
from typing import IO

from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.content import STDIN
from nvscope.capture.formats import TEXT_HEAD_BYTES, NoCapture, is_enough
from nvscope.capture.pieces import OF_A_STREAM, PipePieces, Stopped, is_whole_file
from nvscope.capture.source import SourceInfo
from nvscope.errors import CaptureError, UnreadableInput

MOST_KEPT_BYTES = 16 << 30
"""So many bytes of streams are kept; what has more is to be named as a file."""


def is_stream(word: str) -> bool:
    """Return whether a word names what can be read only once, as it comes: stdin, or a named pipe."""
    if word == STDIN:
        return True
    try:
        mode = os.stat(word).st_mode
    except (OSError, ValueError):
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


class KeptStreams:
    """Copies of streams, in files without names, as long as it is entered.

    ``copies`` are the descriptors of these by the names of the streams. ``waiting`` is called again and again while
    the other side has not ended. Raises UnreadableInput where a stream cannot be opened, or is too large, CaptureError
    where a copy cannot be written.
    """

    infos: tuple[SourceInfo, ...] = ()

    def __init__(
        self, words: Iterable[str], waiting: Callable[[str], None] = lambda _: None, *, most: int = MOST_KEPT_BYTES
    ) -> None:
        self._words = [word for word in dict.fromkeys(words) if is_stream(word)]
        self._waiting = waiting
        self._left = most
        self._most = most
        self._files: list[IO[bytes]] = []
        self._stopped = False
        self.copies: dict[str, int] = {}

    def __enter__(self) -> KeptStreams:
        return self

    def __exit__(self, *_: object) -> None:
        self.copies.clear()
        while self._files:
            self._files.pop().close()

    def stop(self) -> None:
        """Let it be enough: what came until now is what is kept."""
        self._stopped = True

    def keep(self) -> None:
        """Read all streams to their ends, one after the other."""
        for word in self._words:
            try:
                if word == STDIN and sys.stdin is None:
                    raise UnreadableInput("stdin is closed", where=word, next_step="name a file instead")
                self._keep(word, sys.stdin.fileno() if word == STDIN else os.open(word, OF_A_STREAM))
            except OSError as error:
                raise UnreadableInput(error.strerror or str(error), where=word) from error

    def _keep(self, word: str, descriptor: int) -> None:
        try:
            if word == STDIN and is_whole_file(descriptor):
                self.copies[word] = descriptor
                return
            copy = self._made()
            self._files.append(copy)
            head: bytes | None = b""
            try:
                for piece in PipePieces(descriptor, lambda: self._stopped):
                    self._write(copy, piece, word)
                    self._waiting(word)
                    head = None if head is None else (head + piece)[:TEXT_HEAD_BYTES]
                    if head and is_enough(head):
                        head = None
                        self._recognise(copy, word)
            except Stopped:
                pass
            self._write(copy, b"", word)
            os.lseek(copy.fileno(), 0, os.SEEK_SET)
            self.copies[word] = copy.fileno()
        finally:
            if descriptor > 2:
                os.close(descriptor)

    def _write(self, copy: IO[bytes], piece: bytes, word: str) -> None:
        """Write a piece of a stream; an empty one says that nothing follows for a while."""
        self._left -= len(piece)
        if self._left < 0:
            raise UnreadableInput(
                f"more than {self._most >> 30} GiB that come from a pipe", where=word,
                next_step="write it to a file first, and name that",
            )  # fmt: skip
        try:
            copy.write(piece)
            if not piece:
                copy.flush()
        except OSError as error:
            raise _not_kept(error) from error

    def _recognise(self, copy: IO[bytes], word: str) -> None:
        """Raise NoCapture where a stream begins as no capture does: it may have no end."""
        self._write(copy, b"", word)
        os.lseek(copy.fileno(), 0, os.SEEK_SET)
        try:
            CaptureFile(word, copy=copy.fileno())
        except NoCapture:
            raise
        except UnreadableInput:
            pass  # it may be readable when there is more of it
        os.lseek(copy.fileno(), 0, os.SEEK_END)

    @staticmethod
    def _made() -> IO[bytes]:
        try:
            return tempfile.TemporaryFile(prefix="nvscope-")
        except OSError as error:
            raise _not_kept(error) from error


def _not_kept(error: OSError) -> CaptureError:
    return CaptureError(
        f"what comes from a pipe cannot be kept: {error.strerror or error}",
        next_step="TMPDIR names another directory for it; or write it to a file first, and name that",
    )  # fmt: skip
