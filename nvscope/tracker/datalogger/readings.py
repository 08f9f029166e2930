"""Readings of databases: the values that their rows hold.

NULL is no value: it was what it had been, or nobody knows it (``nvscope.tracker.datalogger.unknown_values``): then that
is a reading, behind a value, and no stretch goes on across it. ConsistentDataSeries 0 says that data was lost before a
row, all counters at 0 that the logger began anew, and a row id that is not the next one that rows are missing, as where
a page is damaged; a file of a series may be missing, too: changes may be missing there, and how long a value lasted is
not known.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from hashlib import blake2b
from typing import ClassVar

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import I64, U8, U64, Bool
from dissectors.datalogger.logged import RowTable
from dissectors.datalogger.records import Cells, Records
from dissectors.datalogger.records import Form as Stored
from dissectors.datalogger.rows import RowBatch, consistent
from dissectors.datalogger.tables import LogTable
from nvscope.engine.told import Told
from nvscope.tracker.datalogger.late_rows import LATE_PERCENT
from nvscope.tracker.datalogger.unknown_values import CountedUnknown, SampledUnknown, Unknown
from nvscope.tracker.datalogger.unread_rows import UnreadRows
from nvscope.tracker.datalogger.variables import DatabaseVariable, DatabaseVariables
from nvscope.tracker.readings.form import UNKNOWN_TEXT, Form
from nvscope.tracker.readings.readings import LEFT_OUT, MOST_AT_ONCE, Holes, Readings

_APART = 1 << 40
"""Between the numbers of stretches of a variable that was unknown in between: no file has so many rows."""

_FORMS = np.full(len(Stored), int(Form.UNKNOWN))
_FORMS[Stored.INTEGER], _FORMS[Stored.REAL] = Form.WHOLE, Form.REAL
_FORMS[Stored.TEXT], _FORMS[Stored.BLOB] = Form.TEXT, Form.RAW


class ReadRows:
    """The readings of rows (``nvscope.tracker.readings.readings.ReadValues``); None wants all variables."""

    title: ClassVar[str] = "databases"
    holder: ClassVar[str] = "database"
    late_percent: ClassVar[int] = LATE_PERCENT
    tells_gaps: ClassVar[bool] = True

    def __init__(self, wanted: Callable[[DatabaseVariable], bool] | None = None) -> None:
        self.variables = DatabaseVariables()
        self.hidden = 0
        self.meant: set[int] = set()
        self._wanted = wanted
        self._meant_of: dict[RowTable, I64] = {}
        self._stretch: dict[str, int] = {}
        self.holes: list[Holes] = []
        self.told_ns: list[tuple[I64, int]] = []
        self._unread = UnreadRows()
        self._begun: set[tuple[str, LogTable]] = set()
        self.missed = 0
        self._came: list[tuple[I64, I64, I64]] = []
        self._unknown: dict[RowTable, CountedUnknown | SampledUnknown] = {}
        self._was_lost: dict[RowTable, bool] = {}
        self._apart: dict[int, int] = {}
        """How often variables were unknown that had a value before, by number."""
        self._apart_at: dict[int, list[I64]] = {}
        """The packets of that in the batch read last."""

    @property
    def known(self) -> Sequence[DatabaseVariable]:
        """The variables seen so far, by number."""
        return self.variables.known

    @property
    def left_out(self) -> bool:
        """Whether there was no room for some variables."""
        return self.variables.left_out

    def of(self, told: Told, part: RowBatch) -> Iterator[Readings]:
        """Yield the readings of a batch, in stretches of so many that memory stays bounded."""
        self.holes, self.told_ns = [], []
        in_turn = sorted(part.by_table(), key=lambda one: int(one[1][0]))
        tables = [self._table_rows(told, part, *one) for one in in_turn]
        self._apart_at.clear()
        self._came = [(one.numbers, part.row[one.rows], one.stretch) for one in tables if one.table.log.only_changes]
        chosen = None if told.chosen is None else told.chosen[part.row]
        variables = max((len(one.numbers) for one in tables), default=1)
        most = max(MOST_AT_ONCE // max(variables, 1), 1)
        for begin in range(0, len(part), most):
            found = [self._set_apart(part, one) for table in tables for one in table.cells(begin, begin + most, chosen)]
            found = [one for one in found if len(one.rows)]
            if found:
                yield self._readings(part.row, found, in_turn=len(tables) > 1)

    def lists_of(self, part: RowBatch, chosen: Bool) -> Collection[str]:
        """Return the titles of the databases whose rows a mask over the packets of a batch chooses."""
        own = np.unique(part.logged.table[chosen[part.row]]).tolist()
        return {self.variables.title_of(part.tables[number]) for number in own}

    def rows_of(self, number: int) -> tuple[I64, I64]:
        """Return the packets of the rows, in the batch read last, of tables in which only changes of a variable are.

        In those it is what it was before, where there is no value of it, as long as nothing was lost: the numbers of
        their stretches are the second.
        """
        own = [(rows, stretch) for numbers, rows, stretch in self._came if (numbers == number).any()]
        rows, stretch = (np.concatenate([np.empty(0, np.int64), *(one[at] for one in own)]) for at in range(2))
        if apart := self._apart.get(number):
            at = np.sort(np.concatenate([np.empty(0, np.int64), *self._apart_at.get(number, [])]))
            stretch = stretch + (apart - len(at) + np.searchsorted(at, rows, "right")) * _APART
        return rows, stretch

    def unbroken(self, stretch: I64) -> I64:
        """Return stretches that end only where rows may be missing, not where a variable alone is unknown."""
        return stretch % _APART

    def _table_rows(self, told: Told, part: RowBatch, table: RowTable, rows: I64, records: Records) -> _TableRows:
        restarts = _restarts(table, records)
        find = self._unknown.get(table)
        if find is None:
            find = CountedUnknown(table.log) if table.log.only_changes else SampledUnknown(table.log)
            self._unknown[table] = find
        counted = find if isinstance(find, CountedUnknown) else None
        lost, packet, numbers = ~consistent(records), part.row[rows], self.numbers_of(table, told.max_streams)
        time_ns = told.packets.ts_ns[packet]
        unread, holes = self._unread.of(
            table, records, part.logged.take(rows), time_ns, lost | restarts, counted
        )  # fmt: skip
        wanted = numbers[numbers >= 0]
        self.told_ns.append((wanted, int(time_ns[-1])))
        if len(holes.row):
            self.holes.append(holes._replace(variables=wanted, row=packet[holes.row]))
        unread[holes.row] = True
        follows_another = table.series in self._stretch and (table.series, table.log) not in self._begun
        others = restarts | unread
        others[0] |= follows_another
        if counted is not None:
            others |= counted.jumps(records)
        begins = restarts if counted is not None else self._begins(table, lost, unread)
        unknown = find.of(records, begins)
        if follows_another and counted is not None:
            # Nobody stored what changed between a table and the next one.
            unknown = _unknown_at_first(table.log, records, unknown)
        stretch = self._stretches(table, lost, others)
        return _TableRows(table, rows, records, numbers, stretch, unknown)

    def _begins(self, table: RowTable, lost: Bool, unread: Bool) -> Bool:
        """Return with which rows a part of a table begins: behind a loss that is told, or that cannot be read."""
        # Where several tasks begin, each says so in a row of its own.
        found: Bool = lost & ~np.append(self._was_lost.get(table, False), lost[:-1])
        found[unread] = True
        self._was_lost[table] = bool(lost[-1])
        return found

    def _set_apart(self, part: RowBatch, column: _Column) -> _Column:
        """Let a variable be unknown behind a value only, and each such row begin a stretch of its own."""
        unknown = column.cells.form == Stored.NULL
        apart = self._apart.get(column.number)
        if not unknown.any():
            self._apart.setdefault(column.number, 0)
            return replace(column, stretch=column.stretch + apart * _APART) if apart else column
        if apart is None:
            # Nobody has known it yet.
            first = int(unknown.argmin()) if not unknown.all() else len(unknown)
            column, unknown, apart = column.behind(first), unknown[first:], 0
            if not len(unknown):
                return column
        self._apart_at.setdefault(column.number, []).append(part.row[column.rows[unknown]])
        self._apart[column.number] = apart + int(np.count_nonzero(unknown))
        return replace(column, stretch=column.stretch + (apart + np.cumsum(unknown)) * _APART)

    def _stretches(self, table: RowTable, lost: Bool, others: Bool) -> I64:
        """Return numbers of rows that are the same where nothing was lost between these: told, or for others."""
        begins = (table.series, table.log) not in self._begun
        # The first row of a table may say so as well: there is nothing before it.
        self.missed += int(np.count_nonzero(lost)) - int(begins and lost[0])
        if table.series not in self._stretch:
            lost[0] = False
        self._begun.add((table.series, table.log))
        lost |= others
        number = self._stretch.get(table.series, 0) + np.cumsum(lost)
        self._stretch[table.series] = int(number[-1])
        return number

    def numbers_of(self, table: RowTable, most: int) -> I64:
        """Return the numbers of the variables of a table, ``LEFT_OUT`` of those that are not wanted."""
        found = self._meant_of.get(table)
        if found is None:
            found = self.variables.of(table, most)
            wanted, known = self._wanted, self.known
            if wanted is not None:
                own = [one if one >= 0 and wanted(known[one]) else LEFT_OUT for one in found.tolist()]
                found = np.array(own, np.int64)
            self._meant_of[table] = found
            self.meant.update(found[found >= 0].tolist())
        return found

    def _readings(self, packet: I64, found: Sequence[_Column], *, in_turn: bool) -> Readings:
        """Return the values of some columns; ``in_turn``: those of a variable may be in several of them."""
        behind = np.cumsum([len(one.rows) for one in found])
        row = packet[np.concatenate([one.rows for one in found])]
        stretch = np.concatenate([one.stretch for one in found])
        variable = np.repeat([one.number for one in found], [len(one.rows) for one in found]).astype(np.int64)
        stored = np.concatenate([one.cells.form for one in found])
        bits = np.concatenate([one.cells.bits for one in found])
        for one, end in zip(found, behind.tolist(), strict=True):
            texts = np.flatnonzero(one.cells.form >= Stored.TEXT)
            if len(texts):
                bits[end - len(one.rows) + texts] = _digests(one, texts)
        real = stored == Stored.REAL
        if real.any():
            bits[real] = (bits[real].view(np.float64) + 0.0).view(np.uint64)  # of one zero only
        order = np.argsort(row, kind="stable") if in_turn else None
        if order is not None:
            row, stretch, variable, stored, bits = (one[order] for one in (row, stretch, variable, stored, bits))

        def text(at: int) -> str:
            place = at if order is None else int(order[at])
            column = int(np.searchsorted(behind, place, "right"))
            return found[column].text(place - (int(behind[column - 1]) if column else 0))

        nothing = np.zeros(len(row), np.int64)
        return Readings(
            variable, row, _FORMS[stored], bits, nothing.astype(np.bool_), nothing, text, self._called, stretch
        )  # fmt: skip

    def _called(self, number: int, naming: int) -> str:
        return self.known[number].name


class _Column(Struct, frozen=True):
    """The values of one variable in some rows of a table, by their positions in the batch; NULL where it is unknown."""

    number: int
    rows: I64
    cells: Cells
    stretch: I64
    data: U8
    encoding: str

    def behind(self, first: int) -> _Column:
        """Return it without the values in front of one."""
        cells = self.cells
        kept = Cells(cells.form[first:], cells.bits[first:], cells.start[first:], lambda: cells.stop[first:])
        return replace(self, rows=self.rows[first:], cells=kept, stretch=self.stretch[first:])

    def text(self, at: int) -> str:
        """Return a value as text, '' of a number."""
        form = self.cells.form[at]
        if form < Stored.TEXT:
            return UNKNOWN_TEXT if form == Stored.NULL else ""
        content = self.data[self.cells.start[at] : self.cells.stop[at]].tobytes()
        return content.hex(" ") if form == Stored.BLOB else content.decode(self.encoding, "replace")


class _TableRows(Struct, frozen=True):
    """The rows of one table in a batch, by their positions in it, rising, and the numbers of its variables."""

    table: RowTable
    rows: I64
    records: Records
    numbers: I64
    stretch: I64
    unknown: Unknown

    def cells(self, begin: int, end: int, chosen: Bool | None) -> Iterator[_Column]:
        """Yield values and where there is none, from one position to before another, in the rows that are chosen."""
        own = np.arange(*np.searchsorted(self.rows, (begin, end)).tolist())
        if chosen is not None:
            own = own[chosen[self.rows[own]]]
        for place, (number, logged) in enumerate(zip(self.numbers.tolist(), self.table.log.variables, strict=True)):
            unknown = self.unknown.get(place)
            if number < 0 or not len(own) or (unknown is None and self.records.is_empty(logged.column)):
                continue
            # Numbers that are none are among them where somebody wrote the file byte by byte.
            kept = self.records.filled(logged.column)[own]
            if unknown is not None:
                kept |= np.isin(own, unknown, assume_unique=True)
            there = own if kept.all() else own[kept]
            if len(there):
                yield _Column(
                    number, self.rows[there], self.records.cells(logged.column, there), self.stretch[there],
                    self.records.data, self.table.encoding,
                )  # fmt: skip


def _unknown_at_first(table: LogTable, records: Records, unknown: Unknown) -> Unknown:
    """Return where variables are unknown, those with it that have no value in the first row."""
    found = dict(unknown)
    for place, logged in enumerate(table.variables):
        if records.cells(logged.column, np.zeros(1, np.int64)).form[0] == Stored.NULL:
            found[place] = np.union1d(found.get(place, np.empty(0, np.int64)), 0)
    return found


def _restarts(table: RowTable, records: Records) -> Bool:
    """Tell which rows begin anew: they hold all values, and none of these has changed yet."""
    found = np.zeros(len(records), np.bool_)
    if not table.log.only_changes:
        return found
    rows = np.arange(len(records))
    for logged in table.log.variables:
        assert logged.counter is not None
        cells = records.cells(logged.counter, rows)
        rows = rows[(cells.form == Stored.INTEGER) & (cells.bits == 0)]
        if not len(rows):
            return found
    found[rows] = True
    return found


def _digests(column: _Column, rows: I64) -> U64:
    content, cells = column.data.data, column.cells
    told = [
        int.from_bytes(blake2b(content[begin:end], digest_size=8).digest(), "little")
        for begin, end in zip(cells.start[rows].tolist(), cells.stop[rows].tolist(), strict=True)
    ]
    return np.array(told, np.uint64)
