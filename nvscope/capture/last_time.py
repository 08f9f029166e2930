"""The latest time of a source: nothing else of its packets is looked at."""

from __future__ import annotations

from collections.abc import Callable

from nvscope.capture.source import Source


def latest_ns(source: Source, progress: Callable[[], None] = lambda: None) -> int | None:
    """Read a source to its end, and return its latest time; None where it holds no packet.

    ``progress`` is called after each batch.
    """
    latest = None
    for batch in source:
        if len(batch):
            own = int(batch.ts_ns.max())
            latest = own if latest is None else max(latest, own)
        progress()
    return latest
