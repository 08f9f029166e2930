"""Where captures begin and end in time, and the part of them that a person asks for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from nvscope.capture.content import STDIN
from nvscope.capture.open import open_source
from nvscope.capture.source import FileSource, Source
from nvscope.errors import UsageError

if TYPE_CHECKING:
    from nvscope.view.asked_time import AskedRange

Watch = Callable[[Source], AbstractContextManager[Callable[[], None]]]
"""Given a source that is about to be read, returns what is called after each batch, as a context."""


def latest_ns(paths: Sequence[str], watch: Watch, told: str) -> int | None:
    """Return the latest time of captures, None where they hold no packet; nothing else of them is looked at.

    UsageError for stdin, which cannot be read twice; ``told`` is how a person finds in it what needs to know the end.
    """
    if STDIN in paths:
        raise UsageError(f"{told}: stdin has no end that is known before it is there", next_step="name a file instead")
    latest = None
    source = open_source(paths)
    with watch(source) as progress:
        for batch in source:
            if len(batch):
                own = int(batch.ts_ns.max())
                latest = own if latest is None else max(latest, own)
            progress()
    return latest


def part_of(source: FileSource, asked: AskedRange, latest: Callable[[], int | None]) -> FileSource:
    """Return what of a source lies in a range, everything where it holds no packet.

    ``latest`` is called where the range counts from the end.
    """
    start_ns = source.first_ts_ns()
    if start_ns is None:
        return source
    return source.between(*asked.span_ns(start_ns, latest() if asked.told_from_end else None))
