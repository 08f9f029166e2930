"""Recordings: the stretches of time in which somebody captured, where captures lie days apart."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from nvscope.capture.source import SourceInfo

APART_NS = 86_400 * 10**9
"""So long without a capture, nobody listened: what came, or did not come, is unknown."""


class Recording(NamedTuple):
    """A stretch of time with captures, and the first and the last one of it, by path."""

    start_ns: int
    end_ns: int
    first: str
    last: str


def recordings(sources: Sequence[SourceInfo]) -> list[Recording]:
    """Return the recordings that sources are of, in order; those without a packet are of none."""
    timed = sorted((info.start_ns, info.end_ns, info.path) for info in sources if info.start_ns and info.end_ns)
    found: list[Recording] = []
    for start_ns, end_ns, path in timed:
        if found and start_ns - found[-1].end_ns < APART_NS:
            before = found[-1]
            last = path if end_ns >= before.end_ns else before.last
            found[-1] = before._replace(end_ns=max(before.end_ns, end_ns), last=last)
        else:
            found.append(Recording(start_ns, end_ns, path, path))
    return found
