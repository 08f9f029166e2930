"""A file that a sink writes to: what goes wrong with it is told once, in words."""

from __future__ import annotations

import sys
from types import TracebackType
from typing import Self

from dissectors.batch import U8
from nvscope.errors import CaptureError

STDOUT = "-"


class OutputFile:
    """A file being written, "-" is stdout. Raises CaptureError where it cannot be."""

    def __init__(self, path: str) -> None:
        self._path = path
        try:
            # Unbuffered: what is written comes in large pieces.
            self._file = sys.stdout.buffer if path == STDOUT else open(path, "wb", buffering=0)  # noqa: SIM115
        except OSError as error:
            raise self._error(error) from error

    def write(self, data: bytes | U8) -> None:
        rest = memoryview(data)  # type: ignore[arg-type]
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except BrokenPipeError:
            raise
        except OSError as error:
            raise self._error(error) from error

    def close(self) -> None:
        try:
            if self._path == STDOUT:
                self._file.flush()
            else:
                self._file.close()
        except BrokenPipeError:
            raise
        except OSError as error:
            raise self._error(error) from error

    def _error(self, error: OSError) -> CaptureError:
        return CaptureError(
            f"cannot be written: {error.strerror or error}",
            where=self._path,
            next_step="check the directory, its permissions and the space left",
        )


class FileSink:
    """What sinks to files have in common: the file, and that it is closed at the end of a ``with``."""

    def __init__(self, path: str) -> None:
        self._output = OutputFile(path)

    def close(self) -> None:
        self._output.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
