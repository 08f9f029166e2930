"""What databases hold: rows, from when to when, of how many tables and variables, and before how many data was lost."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from msgspec import Struct, field

from dissectors.datalogger.logged import RowTable
from dissectors.datalogger.rows import RowBatch, consistent
from dissectors.datalogger.tables import LogTable
from nvscope.engine.told import Told
from nvscope.tracker.datalogger.titles import Titles


class DatabaseSummary(NamedTuple):
    """One database, or series of files; ``lost`` rows say that data was lost before them, the first of tables aside."""

    title: str
    rows: int
    tables: int
    variables: int
    lost: int
    first_lost_frame: int | None
    first_ns: int
    last_ns: int


class _Counted(Struct):
    tables: set[RowTable] = field(default_factory=set)
    begun: set[LogTable] = field(default_factory=set)
    names: set[str] = field(default_factory=set)
    rows: int = 0
    lost: int = 0
    first_lost_frame: int | None = None
    first_ns: int = 0
    last_ns: int = 0


class DatabaseCounts:
    """The databases so far, in the order in which their first rows came."""

    def __init__(self) -> None:
        self._titles = Titles()
        self._series: dict[str, _Counted] = {}

    def observe(self, told: Told, part: RowBatch) -> None:
        """Take what a batch brings, which follows those before."""
        for table, rows, records in part.by_table():
            known = self._series.setdefault(table.series, _Counted())
            if table not in known.tables:
                self._titles.of(table)
                known.tables.add(table)
                known.names.update(variable.name for variable in table.log.variables)
            begins = table.log not in known.begun
            known.begun.add(table.log)
            packet = part.row[rows]
            times = told.packets.ts_ns[packet]
            lost = ~consistent(records)
            if begins:
                lost[0] = False  # there is nothing before it
            if not known.rows:
                known.first_ns, known.last_ns = int(times[0]), int(times[0])
            known.rows += len(rows)
            known.first_ns, known.last_ns = min(known.first_ns, int(times.min())), max(known.last_ns, int(times.max()))
            known.lost += int(np.count_nonzero(lost))
            if known.first_lost_frame is None and lost.any():
                known.first_lost_frame = int(packet[np.argmax(lost)]) + told.first_frame

    def summary(self) -> tuple[DatabaseSummary, ...]:
        """Return a row a database, by name."""
        return tuple(
            sorted(
                DatabaseSummary(
                    self._titles.of(next(iter(one.tables))), one.rows, len({table.log.name for table in one.tables}),
                    len(one.names), one.lost, one.first_lost_frame, one.first_ns, one.last_ns,
                )
                for one in self._series.values()
            )
        )  # fmt: skip
