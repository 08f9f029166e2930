"""Readings of databases: the values that their rows hold.

NULL is no value: where only changes are stored, it was what it had been; else nobody knows it. ConsistentDataSeries 0
says that data was lost before a row, and all counters at 0 that the logger began anew: changes may be missing there,
and how long a value lasted is not known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from hashlib import blake2b
from typing import ClassVar

import numpy as np

from dissectors.batch import I64, U8, U64, Bool
from dissectors.datalogger.logged import RowTable
from dissectors.datalogger.records import Cells, Records
from dissectors.datalogger.records import Form as Stored
from dissectors.datalogger.rows import RowBatch, consistent
from nvscope.engine.told import Told
from nvscope.tracker.datalogger.variables import DatabaseVariable, DatabaseVariables
from nvscope.tracker.readings.form import Form
from nvscope.tracker.readings.readings import LEFT_OUT, MOST_AT_ONCE, Readings

_FORMS = np.zeros(len(Stored), np.int64)
_FORMS[Stored.INTEGER], _FORMS[Stored.REAL] = Form.WHOLE, Form.REAL
_FORMS[Stored.TEXT], _FORMS[Stored.BLOB] = Form.TEXT, Form.RAW


class ReadRows:
    """The readings of rows (``nvscope.tracker.readings.readings.ReadValues``); None wants all variables."""

    title: ClassVar[str] = "databases"
    tells_gaps: ClassVar[bool] = True

    def __init__(self, wanted: Callable[[DatabaseVariable], bool] | None = None) -> None:
        self.variables = DatabaseVariables()
        self.hidden = 0
        self.meant: set[int] = set()
        self._wanted = wanted
        self._meant_of: dict[RowTable, I64] = {}
        self._stretch: dict[str, int] = {}
        self.missed = 0

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
        for table, rows, records in part.by_table():
            numbers = self._numbers(table, told.max_streams)
            stretch = self._stretches(table, records)
            chosen = None if told.chosen is None else told.chosen[part.row[rows]]
            most = max(MOST_AT_ONCE // max(len(numbers), 1), 1)
            for begin in range(0, len(rows), most):
                own = np.arange(begin, min(begin + most, len(rows)))
                if chosen is not None:
                    own = own[chosen[own]]
                if len(own):
                    yield self._read(part.row[rows], own, numbers, stretch, table, records)

    def _stretches(self, table: RowTable, records: Records) -> I64:
        """Return numbers of rows that are the same where nothing was lost between these."""
        lost = ~consistent(records)
        if table.series not in self._stretch:
            lost[0] = False  # there is nothing before it
        self.missed += int(np.count_nonzero(lost))
        lost |= _restarts(table, records)
        number = self._stretch.get(table.series, 0) + np.cumsum(lost)
        self._stretch[table.series] = int(number[-1])
        return number

    def _numbers(self, table: RowTable, most: int) -> I64:
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

    def _read(
        self, row: I64, own: I64, numbers: I64, stretch: I64, table: RowTable, records: Records
    ) -> Readings:  # fmt: skip
        found: list[tuple[int, I64, Cells]] = []
        for number, logged in zip(numbers.tolist(), table.log.variables, strict=True):
            if number < 0 or records.is_empty(logged.column):
                continue
            cells = records.cells(logged.column, own)
            filled = np.flatnonzero(cells.form)
            if len(filled):
                if len(filled) < len(own):
                    cells = records.cells(logged.column, own[filled])
                found.append((number, own[filled], cells))
        count = [len(rows) for _, rows, _ in found]
        place = np.concatenate([rows for _, rows, _ in found]) if found else np.empty(0, np.int64)
        variable = np.repeat([number for number, *_ in found], count).astype(np.int64)
        stored = np.concatenate([cells.form for *_, cells in found]) if found else np.empty(0, np.uint8)
        bits = np.concatenate([cells.bits for *_, cells in found]) if found else np.empty(0, np.uint64)
        start = np.concatenate([cells.start for *_, cells in found]) if found else place
        stop = np.concatenate([cells.stop for *_, cells in found]) if found else place
        form = _FORMS[stored]
        real = stored == Stored.REAL
        if real.any():
            bits[real] = (bits[real].view(np.float64) + 0.0).view(np.uint64)  # of one zero only
        texts = np.flatnonzero(stored >= Stored.TEXT)
        if len(texts):
            bits[texts] = _digests(records.data, start[texts], stop[texts])

        def text(at: int) -> str:
            content = records.data[start[at] : stop[at]].tobytes() if stored[at] >= Stored.TEXT else b""
            return content.hex(" ") if stored[at] == Stored.BLOB else content.decode(table.encoding, "replace")

        nothing = np.zeros(len(place), np.int64)
        return Readings(
            variable, row[place], form, bits, nothing.astype(np.bool_), nothing, text, self._called, stretch[place]
        )  # fmt: skip

    def _called(self, number: int, naming: int) -> str:
        return self.known[number].name


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


def _digests(data: U8, start: I64, stop: I64) -> U64:
    content = data.data
    told = [
        int.from_bytes(blake2b(content[begin:end], digest_size=8).digest(), "little")
        for begin, end in zip(start.tolist(), stop.tolist(), strict=True)
    ]
    return np.array(told, np.uint64)
