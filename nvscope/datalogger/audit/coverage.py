"""The time from the first row of a table to the last: how much of it is covered by rows, and what lacks."""

from __future__ import annotations

from collections import Counter

import numpy as np

from dissectors.batch import I64
from nvscope.datalogger.audit.restarts import ZeroRow
from nvscope.datalogger.audit.spans import Spans
from nvscope.datalogger.audit.time_strip import Mark, TimeStrip

_MOST_MARKED = 10_000
"""So many gaps of a table are drawn one by one."""


class Coverage:
    """Counts the time that is missing in one table.

    ``gaps`` are counted by what is drawn for them: TOLD, GAP and UNREAD. Time in which rows of several tasks are
    missing is missing once.
    """

    def __init__(self) -> None:
        self.first_ns: int | None = None
        self.last_ns: int | None = None
        self._missing, self._off = Spans(), Spans()
        self.gaps: Counter[Mark] = Counter()
        self.strip = TimeStrip()
        self._marked = 0

    def take(self, time_ns: I64) -> None:
        """Take the times of rows, in the order of the rows."""
        if len(time_ns):
            self.first_ns = int(time_ns[0]) if self.first_ns is None else self.first_ns
            self.last_ns = int(time_ns.max()) if self.last_ns is None else max(self.last_ns, int(time_ns.max()))
            self.strip.take(time_ns)

    @property
    def missing_ns(self) -> int:
        """The time in which rows are missing, or the logger was off; not more than there is."""
        return min(self._missing.length_with(self._off), self._span_ns)

    @property
    def off_ns(self) -> int:
        """The time in which the logger was off."""
        return min(self._off.length_ns(), self._span_ns)

    @property
    def share(self) -> float | None:
        """The share of the time in which nothing is missing, None where there is no time."""
        return 1 - self.missing_ns / self._span_ns if self._span_ns else None

    @property
    def _span_ns(self) -> int:
        if self.first_ns is None or self.last_ns is None:
            return 0
        return max(self.last_ns - self.first_ns, 0)

    def miss(self, mark: Mark, first_ns: I64, last_ns: I64, interval_ns: I64 | int = 0) -> None:
        """Count gaps of one kind, of each of which an interval is no loss."""
        self.gaps[mark] += len(first_ns)
        self._missing.add(first_ns + interval_ns, last_ns)
        some = slice(0, max(_MOST_MARKED - self._marked, 0))
        self._marked += len(first_ns)
        for first, last in zip(first_ns[some].tolist(), last_ns[some].tolist(), strict=True):
            self.strip.mark(mark, first, last)

    def start(self, row: ZeroRow) -> None:
        """Take that a logger started anew with a row.

        The time in front of it is counted: from when on the logger was off, the row before tells at most.
        """
        if not row.timed:
            return
        if row.before_ns is not None and row.before_ns < row.time_ns:
            self._off.add(np.array([row.before_ns]), np.array([row.time_ns]))
            self.strip.mark(Mark.OFF, row.before_ns + 1, row.time_ns - 1)
        self.strip.mark(Mark.STARTED, row.time_ns, row.time_ns)
