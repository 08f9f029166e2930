"""Unread rows: in front of which rows of a database others are missing that its logger had stored.

Loggers number rows one by one, and each file anew; they delete the oldest alone. So ids tell of rows that lack within a
file and at its beginning, and the numbers of files of one that lacks between two others. Whether there was another one
behind the closed file with the highest number, or rows at its end, they do not tell: a time between two files that is
longer than any usual one speaks for that, or counters of changes that have gone on, where the logger says nothing. One
that has gone on by 1 may have done so in the first row of the new file; there the time has its say, too. That is a
doubt: nobody can say that the logger has missed anything there, nor that it has not; so it is where rows are there that
cannot be read. Where each file has a row alone, nothing is usual but the times between files.
"""

from __future__ import annotations

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from dissectors.datalogger.logged import Logged, RowTable
from dissectors.datalogger.records import Records
from dissectors.datalogger.tables import LogTable
from nvscope.tracker.datalogger.late_rows import LATE_PERCENT
from nvscope.tracker.datalogger.unknown_values import CountedUnknown
from nvscope.tracker.readings.readings import Holes

_USUAL = 16
"""So many times between rows tell what is usual; without any, nobody knows whether one is longer."""


class _Last(Struct):
    """The last rows of a table: the times of two, the id of the last one, and whether that has unread ones before it.

    ``between_ns`` are the last times between rows that follow each other, as far as that is known.
    """

    times_ns: I64
    between_ns: I64
    rowid: int
    part: int
    is_behind: bool


class UnreadRows:
    """Finds them, batch by batch."""

    def __init__(self) -> None:
        self._last: dict[tuple[str, LogTable], _Last] = {}

    def of(
        self, table: RowTable, records: Records, rows: Logged, time_ns: I64, told: Bool,
        counted: CountedUnknown | None,
    ) -> tuple[Bool, Holes]:  # fmt: skip
        """Return in front of which rows others are missing for sure, and where some may be, by the places of rows.

        The rows follow those before; ``told``: the logger says that something was lost, or begins anew. ``counted``
        knows the counters up to the row before, None where none are.
        """
        rowid = rows.rowid
        last = self._last.get((table.series, table.log))
        if last is None:
            last = _Last(time_ns[:0], time_ns[:0], int(rowid[0]) - 1, table.part, False)
        step = np.diff(rowid, prepend=last.rowid)
        begins_file = step <= 0
        unread = (step > 1) | (begins_file & (rowid > 1))
        unread[0] |= table.part != last.part
        times_ns = np.append(last.times_ns, time_ns)
        first = len(last.times_ns)
        unread[0] &= first > 0
        # Of rows that somebody deleted within a file, the database has nothing: that is missed.
        doubted = unread & (begins_file | rows.unread)
        doubted[0] |= unread[0] & (table.part != last.part)
        follows = ~unread & ~begins_file
        follows[0] &= first > 0
        step_ns = np.diff(times_ns[-1 - len(time_ns) :], prepend=time_ns[: int(not first)])
        for row in np.flatnonzero(begins_file & ~unread & ~told).tolist():
            usual = np.append(last.between_ns, step_ns[:row][follows[:row]])[-_USUAL:]
            is_late = not len(usual) or int(step_ns[row]) * 100 > LATE_PERCENT * int(usual.max())
            goes_on = 1 if counted is None else counted.step(records, row)
            doubted[row] = goes_on > 1 or (goes_on == 1 and is_late)
            # Where nothing was usual before, this is.
            follows[row] = not doubted[row] or (counted is None and not len(usual))
        between_ns = np.append(last.between_ns, step_ns[follows])
        places = np.flatnonzero(doubted)
        before = first + places - 1
        behind = np.append(last.is_behind, doubted[:-1])[places]
        # What was on its way when the last row was stored would have been in the next one.
        since = np.where(behind, before, np.maximum(before - 1, 0))
        self._last[table.series, table.log] = _Last(
            times_ns[-2:], between_ns[-_USUAL:], int(rowid[-1]), table.part, bool(doubted[-1])
        )
        return unread, Holes(np.empty(0, np.int64), places, times_ns[before], times_ns[since])
