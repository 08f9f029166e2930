"""A progress bar on stderr, for what takes longer than a second."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from nvscope.capture.source import FileSource, Source

if TYPE_CHECKING:
    from rich.progress import Progress

    from nvscope.cli.live import LiveRun

_SILENT_S = 1.0


class ProgressBar:
    """Shows how far files have been read, on a terminal only; call it after each batch. Other sources have no end."""

    def __init__(self, source: Source, *, quiet: bool = False) -> None:
        self._source = source if isinstance(source, FileSource) else None
        self._wanted = not quiet and self._source is not None and sys.stderr.isatty()
        self._start = time.monotonic()
        self._bar: Progress | None = None
        self._task: Any = None

    def __enter__(self) -> Self:
        return self

    def __call__(self) -> None:
        if not self._wanted or time.monotonic() - self._start < _SILENT_S:
            return
        if self._bar is None:
            self._open()
        assert self._bar is not None
        assert self._source is not None
        self._bar.update(self._task, completed=self._source.position_bytes, total=self._source.size_bytes)

    def _open(self) -> None:
        assert self._source is not None
        from rich.console import Console
        from rich.progress import BarColumn, DownloadColumn, Progress, TimeRemainingColumn, TransferSpeedColumn

        columns = (BarColumn(), DownloadColumn(), TransferSpeedColumn(), TimeRemainingColumn())
        self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
        self._task = self._bar.add_task("", total=self._source.size_bytes)
        self._bar.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()


def watching(*, quiet: bool) -> Callable[[Source], ProgressBar | LiveRun]:
    """Return what makes the progress bar of files, and what ends a live source in order."""

    def watch(source: Source) -> ProgressBar | LiveRun:
        if isinstance(source, FileSource):
            return ProgressBar(source, quiet=quiet)
        from nvscope.cli.live import LiveRun

        return LiveRun(source, quiet=quiet)

    return watch
