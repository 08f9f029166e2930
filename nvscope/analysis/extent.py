"""The part of captures in time that a person asks for."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from nvscope.capture.source import FileSource, Source
from nvscope.errors import UsageError

if TYPE_CHECKING:
    from nvscope.view.asked_time import AskedRange


def part_of(source: Source, asked: AskedRange, latest: Callable[[], int | None]) -> Source:
    """Return what of a source lies in a range; of files, everything where they hold no packet.

    ``latest`` is called where the range counts from the end. UsageError where it counts from a beginning that is not
    known before it comes.
    """
    if not isinstance(source, FileSource):
        if not asked.is_absolute:
            what = "a time that counts from the beginning, the end or the day of captures needs files"
            raise UsageError(what, next_step="write it with its date, such as 2026-01-31 08:00:01.5Z")
        return source.between(*asked.span_ns(0, None))
    return source.between(*span_of(source, asked, latest))


def span_of(source: FileSource, asked: AskedRange, latest: Callable[[], int | None]) -> tuple[int | None, int | None]:
    """Return from when to when files are asked for, in ns since 1970; None for no bound, or without any packet.

    ``latest`` is called where the range counts from the end.
    """
    start_ns = source.first_ts_ns()
    if start_ns is None:
        return None, None
    return asked.span_ns(start_ns, latest() if asked.told_from_end else None)
