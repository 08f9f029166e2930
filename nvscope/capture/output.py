"""A file that a sink writes to: what goes wrong with it is told once, in words."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Self

from dissectors.batch import U8
from nvscope.capture.source import Attachment
from nvscope.errors import CaptureError, UsageError

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

    def flush(self) -> None:
        """Hand what was written to the operating system."""
        self._tried(self._file.flush)

    def close(self) -> None:
        """Close the file; stdout stays open."""
        self._tried(self._file.flush if self._path == STDOUT else self._file.close)

    def _tried(self, action: Callable[[], None]) -> None:
        try:
            action()
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
    """What sinks to files have in common: the file, and that it is closed at the end of a ``with``.

    ``channels`` are the names of the packets' channels by number, which may grow while packets are written; None where
    there are none. ``format_name`` is that of the format in ``FORMATS``.
    """

    format_name = ""

    def __init__(self, path: str, channels: Sequence[str] | None = None) -> None:
        self._path = path
        self._channels = channels
        self._output = OutputFile(path)

    def attach(self, attachment: Attachment) -> None:
        """Refuse an attachment, since the format has no place for one."""
        raise UsageError(
            f"a {self.format_name} file cannot hold '{attachment.name}', nor any other attachment", where=self._path
        )

    def flush(self) -> None:
        self._output.flush()

    def close(self) -> None:
        self._output.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
