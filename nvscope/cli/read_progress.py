"""A line on stderr that says how much has been read, for what takes longer than a second and has no known end."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Self

from nvscope.cli.terminal import echo
from nvscope.units import data_size

_SILENT_S = 1.0
_EVERY_S = 0.2


class ReadProgress:
    """Call it with the bytes that were read now; it is silent where stderr is no terminal."""

    def __init__(self, *, quiet: bool = False) -> None:
        self._wanted = not quiet and sys.stderr.isatty()
        self._next_s = time.monotonic() + _SILENT_S
        self._bytes = 0
        self._shown = False

    def __enter__(self) -> Self:
        return self

    def __call__(self, more_bytes: int) -> None:
        self._bytes += more_bytes
        if not self._wanted or (now := time.monotonic()) < self._next_s:
            return
        self._next_s = now + _EVERY_S
        self._shown = True
        echo(f"\r\x1b[K{data_size(self._bytes)} read", err=True, nl=False)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._shown:
            echo("\r\x1b[K", err=True, nl=False)
