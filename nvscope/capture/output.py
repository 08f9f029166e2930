"""A file that a sink writes to: what goes wrong with it is told once, in words."""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from types import TracebackType
from typing import Self, overload

from dissectors.batch import U8, PacketBatch
from nvscope.capture.source import Attachment, Circumstances
from nvscope.errors import CaptureError, UsageError

STDOUT = "-"


class OutputFile:
    """A file being written, "-" is stdout. Raises CaptureError where it cannot be.

    Each piece is written whole or, to a regular file, not at all. ``bytes`` were written so far.
    """

    def __init__(self, path: str) -> None:
        self._path = path
        self.bytes = 0
        try:
            # Unbuffered: what is written comes in large pieces.
            self._file = sys.stdout.buffer if path == STDOUT else open(path, "wb", buffering=0)  # noqa: SIM115
        except OSError as error:
            raise self._error(error) from error

    def write(self, data: bytes | U8) -> None:
        whole = rest = memoryview(data)  # type: ignore[arg-type]
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except BrokenPipeError:
            raise
        except OSError as error:
            self._take_back()
            raise self._error(error) from error
        self.bytes += len(whole)

    def _take_back(self) -> None:
        with suppress(OSError):
            if self.is_regular:
                self._file.truncate(self.bytes)
                self._file.seek(self.bytes)

    @property
    def is_regular(self) -> bool:
        """Whether it is a file that can be cut, and no pipe or terminal."""
        return self._path != STDOUT and stat.S_ISREG(os.fstat(self._file.fileno()).st_mode)

    def flush(self, *, to_disk: bool = False) -> None:
        """Hand what was written to the operating system, and wait until it is on the disk where that is asked."""
        self._tried(self._file.flush)
        if to_disk and self.is_regular:
            self._tried(lambda: os.fsync(self._file.fileno()))

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


def check_frames(batch: PacketBatch) -> None:
    """Raise UsageError for packets that are rows of a database: no format of captures has a place for these."""
    if batch.logged is not None:
        raise rows_are_no_frames()


def rows_are_no_frames(path: str = "") -> UsageError:
    """Return the error that rows of a database cannot be written as frames."""
    return UsageError(
        "rows of a database are no frames, and no capture format can hold them", where=path,
        next_step="`nvscope export FILE.db -w values.csv` writes their values; without the database, the frames of "
        "others can be written",
    )  # fmt: skip


class ChannelNames(Sequence[str]):
    """The names of the channels of a source, as far as it knows them when it is asked."""

    def __init__(self, names: Callable[[], Sequence[str]]) -> None:
        self._names = names

    @overload
    def __getitem__(self, number: int) -> str: ...

    @overload
    def __getitem__(self, number: slice) -> Sequence[str]: ...

    def __getitem__(self, number: int | slice) -> str | Sequence[str]:
        return self._names()[number]

    def __len__(self) -> int:
        return len(self._names())


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
        self.packets = 0

    @property
    def bytes(self) -> int:
        """How large the file is by now."""
        return self._output.bytes

    def comment(self, number: int, text: str) -> None:
        """Put no comment anywhere: the format has no place for it."""

    def describe(self, circumstances: Circumstances) -> None:
        """Tell nothing of it: the format has no place for that."""

    def attach(self, attachment: Attachment) -> None:
        """Refuse an attachment, since the format has no place for one."""
        raise UsageError(
            f"a {self.format_name} file cannot hold '{attachment.name}', nor any other attachment", where=self._path
        )

    def flush(self, *, to_disk: bool = False) -> None:
        self._output.flush(to_disk=to_disk)

    def close(self) -> None:
        self._output.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
