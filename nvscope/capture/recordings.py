"""Recordings: the stretches of time in which somebody captured; between two of them lies a hole.

What was open when a recording ended (waits, cycles, intervals, sequences of counters) stays unknown, and the next one
begins as a capture does. Files that follow each other closer than ``APART_NS`` are of one recording: a capture that is
rotated has holes of microseconds, or as long as the plant was silent, and a telegram lost between two files is lost.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from typing import NamedTuple

from nvscope.capture.source import SourceInfo

APART_NS = 60 * 10**9
"""So long without any capture, nobody listened: what came, or did not come, is unknown.

A file that is rotated goes on with the next frame; on a network with switches and PCs there is one within the minute.
Where there is none, an interval is left out that was one: that is no false alarm.
"""


class Recording(NamedTuple):
    """A stretch of time with captures, and the first and the last one of it, by path."""

    start_ns: int
    end_ns: int
    first: str
    last: str


SEAMLESS_NS = 1_000_000_000
"""So soon behind the end of one capture, another one goes on with it, whoever is heard: somebody rotates them."""


def is_seamless(end_ns: int, path: str, start_ns: int, following: str) -> bool:
    """Tell whether a capture that begins surely goes on with one that ended: at once, or by its name.

    Files of a series have names that differ in their digits alone: numbers and times, as dumpcap, tcpdump and candump
    write them.
    """
    return start_ns - end_ns <= SEAMLESS_NS or _series(path) == _series(following)


def _series(path: str) -> tuple[str, str]:
    folder, name = os.path.split(path)
    # A database that is rolled over gets a number behind its name: x.db, x.db.0.
    return folder, re.sub("[0-9]+", "", name).rstrip(".")


def is_apart(end_ns: int, start_ns: int) -> bool:
    """Tell whether a capture that begins goes on with none that ended before."""
    return start_ns - end_ns >= APART_NS


def recordings(
    sources: Sequence[SourceInfo], start_ns: int | None = None, end_ns: int | None = None
) -> list[Recording]:
    """Return the recordings that sources are of, in order; those without a packet are of none.

    With a start or an end, those that begin behind the end or end before the start are left out.
    """
    timed = sorted(
        # Where a clock stepped back, a capture can end before it began.
        (info.start_ns, max(info.start_ns, info.end_ns), info.path)
        for info in sources
        if info.start_ns is not None and info.end_ns is not None
    )
    found: list[Recording] = []
    for begin_ns, stop_ns, path in timed:
        if found and not is_apart(found[-1].end_ns, begin_ns):
            before = found[-1]
            last = path if stop_ns >= before.end_ns else before.last
            found[-1] = before._replace(end_ns=max(before.end_ns, stop_ns), last=last)
        else:
            found.append(Recording(begin_ns, stop_ns, path, path))
    return [
        one
        for one in found
        if (start_ns is None or one.end_ns >= start_ns) and (end_ns is None or one.start_ns <= end_ns)
    ]
