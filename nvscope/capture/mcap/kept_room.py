"""Room on a disk that is kept back, so that a file can be ended where nothing else has room any more."""

from __future__ import annotations

import os
import tempfile
from contextlib import suppress
from typing import IO


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
        # More than that, so that it is not asked for with each chunk; less where there is no more.
        for wanted in (2 * size, size + size // 8, size):
            try:
                os.posix_fallocate(self._file.fileno(), 0, wanted)
            except OSError:
                if wanted == size:
                    raise
            else:
                self.bytes = wanted
                return

    def give_back(self) -> None:
        """Keep nothing any more; also repeatedly."""
        if self._file is not None:
            self._file.close()
            self._file = None
