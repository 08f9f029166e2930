"""SoSpans: the times at which something was so, to be asked of what began before it is known what came of it."""

from __future__ import annotations

from array import array
from collections.abc import Iterator

import numpy as np

from dissectors.batch import I64, Bool

MOST_SPANS = 100_000
_OPEN = np.iinfo(np.int64).max


class SoSpans:
    """Since when and up to when something was so, by time and by frame; ``MOST_SPANS`` of them at most.

    ``left_out``: it was so later, too, and that is not kept.
    """

    def __init__(self) -> None:
        self._begins = array("q"), array("q")
        self._ends = array("q"), array("q")
        self.left_out = False

    def note(self, begins: tuple[I64, I64], ends: tuple[I64, I64]) -> None:
        """Take the times and frames with which it began to be so, and with which it ended; each rising."""
        room = MOST_SPANS - len(self._begins[0])
        self.left_out |= len(begins[0]) > room
        _add(self._begins, begins, room)
        _add(self._ends, ends, len(self._begins[0]) - len(self._ends[0]))

    def at(self, time_ns: I64) -> Bool:
        """Tell of some times whether it was so then. Shape (n,)."""
        return self._within(0, time_ns)

    def at_frames(self, frame: I64) -> Bool:
        """Tell of some frames whether it was so when they came. Shape (n,)."""
        return self._within(1, frame)

    def touch(self, since_ns: int | None, until_ns: int | None, behind_frame: int = 0) -> bool:
        """Tell whether it was so at any moment of a time, None for no end of it; ``behind_frame`` only, too."""
        begin_ns, end_ns, (_, end) = self._column(0), self._end(0), (0, self._end(1))
        found = end > behind_frame
        if since_ns is not None:
            found &= end_ns > since_ns
        if until_ns is not None:
            found &= begin_ns <= until_ns
        return bool(found.any())

    def longest_ns(self, since_ns: int, until_ns: int) -> int:
        """Return for how long it was so without a break, at most, from one time to another."""
        return max((end_ns - max(begin_ns, since_ns) for begin_ns, end_ns in self.over(since_ns, until_ns)), default=0)

    def over(self, since_ns: int, until_ns: int) -> list[tuple[int, int]]:
        """Return since when and until when it was so, of what touches a time; open ends are at its end."""
        begin_ns, end_ns = self._column(0), self._end(0)
        own = slice(int(np.searchsorted(end_ns, since_ns, "right")), int(np.searchsorted(begin_ns, until_ns)))
        return list(zip(begin_ns[own].tolist(), np.minimum(end_ns[own], until_ns).tolist(), strict=True))

    def _within(self, column: int, value: I64) -> Bool:
        begin, end = self._column(column), self._end(column)
        if not len(begin):
            return np.zeros(len(value), np.bool_)
        place = np.searchsorted(begin, value, "right") - 1
        found: Bool = (place >= 0) & (value < end[place])
        return found

    def _column(self, column: int) -> I64:
        return np.array(self._begins[column], np.int64)

    def _end(self, column: int) -> I64:
        ends = np.array(self._ends[column], np.int64)
        return np.append(ends, np.full(len(self._begins[column]) - len(ends), _OPEN))


def whole_windows(spans: SoSpans, begin_ns: int, length_ns: int, first: int, stop: int) -> Iterator[tuple[int, int]]:
    """Yield which windows are whole within spans, from one to before another, of those from ``first`` to ``stop``.

    They lie end to end, from ``begin_ns`` on; all before ``stop`` have ended.
    """
    for since_ns, until_ns in spans.over(begin_ns + first * length_ns, begin_ns + stop * length_ns):
        start, end = max(-((begin_ns - since_ns) // length_ns), first), (until_ns - begin_ns) // length_ns
        if start < end:
            yield start, end


def _add(columns: tuple[array[int], array[int]], values: tuple[I64, I64], room: int) -> None:
    for column, value in zip(columns, values, strict=True):
        column.frombytes(np.ascontiguousarray(value[:room], np.int64).tobytes())
