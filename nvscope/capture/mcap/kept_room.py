"""Room on a disk that is kept back, so that a file can be ended where nothing else has room any more."""

from __future__ import annotations

import os
import tempfile
from contextlib import suppress
from typing import IO

_LEAST_BYTES = 64 << 10


class KeptRoom:
    """Room in the directory of a file, in a file without a name: whatever ends the process gives it back.

    Where the system cannot keep any, there is none.
    """

    def __init__(self, path: str) -> None:
        self.bytes = 0
        self._file: IO[bytes] | None = None
        if hasattr(os, "posix_fallocate"):
            with suppress(OSError):
                self._file = tempfile.TemporaryFile(dir=os.path.dirname(os.path.abspath(path)))  # noqa: SIM115

    def hold(self, size: int) -> None:
        """Keep at least so much. OSError where there is not so much room."""
        if self._file is None or size <= self.bytes:
            return
        wanted = max(2 * size, _LEAST_BYTES)
        os.posix_fallocate(self._file.fileno(), 0, wanted)
        self.bytes = wanted

    def give_back(self) -> None:
        """Keep nothing any more; also repeatedly."""
        if self._file is not None:
            self._file.close()
            self._file = None
