"""A file that appears under its name when it is complete, and not before."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import BinaryIO

from nvscope.errors import CaptureError

_BUFFER_BYTES = 64 << 10


class WholeFile:
    """A file being written beside the one that it replaces when it is complete.

    What is no regular file (a pipe, a terminal) is written to as it is. Nothing is there before ``open``: who keeps it
    first can discard it whenever that ends.
    """

    file: BinaryIO

    def __init__(self, path: str) -> None:
        self.path = path
        # Where the name is a link, what it leads to is replaced.
        self._target = Path(path).resolve() if Path(path).is_symlink() else Path(path)
        self._unfinished: Path | None = None

    def open(self) -> None:
        """Open ``file``; CaptureError where it cannot be written. What goes wrong later is an OSError."""
        try:
            if self._target.is_dir():
                raise IsADirectoryError(None, "is a directory")
            if self._target.exists() and not self._target.is_file():
                self.file = self._target.open("wb", _BUFFER_BYTES)
            else:
                self._open_beside()
        except (OSError, ValueError) as error:
            raise CaptureError(
                f"cannot be written: {getattr(error, 'strerror', None) or error}", where=self.path,
                next_step="check the directory, its permissions and the space left",
            ) from error  # fmt: skip

    def _open_beside(self) -> None:
        name = self._target.with_name(f".{self._target.name[:200]}.{os.urandom(8).hex()}.unfinished")
        # Noted before it is there, so that no interrupt finds a file that nobody knows of; the name is nobody else's.
        self._unfinished = name
        self.file = name.open("xb", _BUFFER_BYTES)

    def finish(self) -> None:
        """Write what is left, and close the file; it still has its other name."""
        self.file.close()

    def publish(self) -> None:
        """Give the finished file its name."""
        if self._unfinished:
            os.replace(self._unfinished, self._target)
            self._unfinished = None

    def discard(self) -> None:
        """Remove the file where it has not got its name; whatever goes wrong with that has gone wrong before."""
        with contextlib.suppress(OSError):
            if hasattr(self, "file"):
                self.file.close()
        if self._unfinished:
            self._unfinished.unlink(missing_ok=True)
            self._unfinished = None
