"""The time from the first row of a table to the last: how much of it is covered by rows, and what lacks."""

from __future__ import annotations

from collections import Counter

from dissectors.batch import I64
from nvscope.datalogger.audit.restarts import ZeroRow
from nvscope.datalogger.audit.sums import total
from nvscope.datalogger.audit.time_strip import Mark, TimeStrip

_MOST_MARKED = 10_000
"""So many gaps of a table are drawn one by one."""


class Coverage:
    """Counts the time that is missing in one table.

    ``gaps`` are counted by what is drawn for them: TOLD, GAP and UNREAD. ``missing_ns`` is the sum of them over all
    tasks, with ``off_ns``, in which the logger was off, for each task.
    """

    def __init__(self) -> None:
        self.first_ns: int | None = None
        self.last_ns: int | None = None
        self.missing_ns = self.off_ns = 0
        self.gaps: Counter[Mark] = Counter()
        self.strip = TimeStrip()
        self._marked = 0

    def take(self, time_ns: I64) -> None:
        """Take the times of rows, in the order of the rows."""
        if len(time_ns):
            self.first_ns = int(time_ns[0]) if self.first_ns is None else self.first_ns
            self.last_ns = int(time_ns.max()) if self.last_ns is None else max(self.last_ns, int(time_ns.max()))
            self.strip.take(time_ns)

    def share(self, tasks: int) -> float | None:
        """Return the share of the time in which nothing is missing of so many tasks, None where there is no time."""
        if self.first_ns is None or self.last_ns is None or self.last_ns <= self.first_ns:
            return None
        return min(max(0.0, 1 - self.missing_ns / ((self.last_ns - self.first_ns) * tasks)), 1.0)

    def miss(self, mark: Mark, first_ns: I64, last_ns: I64, interval_ns: int = 0) -> None:
        """Count gaps of one kind, of each of which an interval is no loss."""
        self.gaps[mark] += len(first_ns)
        self.missing_ns += total(last_ns - first_ns - interval_ns)
        some = slice(0, max(_MOST_MARKED - self._marked, 0))
        self._marked += len(first_ns)
        for first, last in zip(first_ns[some].tolist(), last_ns[some].tolist(), strict=True):
            self.strip.mark(mark, first, last)

    def start(self, row: ZeroRow, tasks: int) -> None:
        """Take that a logger with so many tasks started anew with a row.

        The time in front of it is counted: from when on the logger was off, the row before tells at most.
        """
        if not row.timed:
            return
        if row.before_ns is not None and row.before_ns < row.time_ns:
            self.off_ns += row.time_ns - row.before_ns
            self.missing_ns += (row.time_ns - row.before_ns) * tasks
            self.strip.mark(Mark.OFF, row.before_ns + 1, row.time_ns - 1)
        self.strip.mark(Mark.STARTED, row.time_ns, row.time_ns)
