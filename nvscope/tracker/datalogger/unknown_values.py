"""Unknown values: in which rows NULL says that nobody knows what a variable is, and not that nothing is new.

Where only changes are stored, it is that where the counter beside it has gone on, or the logger begins anew: the value
is none that a database can hold, as a number that is none. Where every value is stored, it is that in the rows of its
own task; in those of the others, its column is NULL because it is not sampled there. Which variables are of one task
stands nowhere: those are that are stored in one row, but where a part of the table tells that it has other tasks
(``nvscope.tracker.datalogger.tasks_apart``). Each row is judged by itself and those before it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from dissectors.batch import I64, Bool
from dissectors.datalogger.records import Form, Records
from dissectors.datalogger.row_shapes import RowShapes
from dissectors.datalogger.tables import LogTable
from nvscope.tracker.datalogger.tasks_apart import TasksApart
from nvscope.tracker.datalogger.variable_groups import VariableGroups

_REALS = ("FLOAT", "DOUBLE")

Unknown = Mapping[int, I64]
"""The rows, rising, in which variables are unknown, by their places in the table; none of one that is known in all."""

_Matrix = npt.NDArray[np.bool_]


class CountedUnknown:
    """Finds them in a table of changes, stretch by stretch of its rows."""

    def __init__(self, table: LogTable) -> None:
        self._variables = table.variables
        self._counts: list[int | None] = [None] * len(table.variables)

    def of(self, records: Records, restarts: Bool) -> Unknown:
        """Return where variables are unknown in rows that follow those before; ``restarts``: the logger begins anew."""
        found: dict[int, I64] = {}
        for place, variable in enumerate(self._variables):
            assert variable.counter is not None
            if records.is_empty(variable.counter):
                continue
            counted = records.filled(variable.counter)
            half = counted > records.filled(variable.column)
            if half.any():
                rows = self._rows(place, records, counted, half, restarts)
                if len(rows):
                    found[place] = rows
            else:
                last = len(counted) - 1 - int(counted[::-1].argmax())
                self._take(place, records, np.array([last]))
        return found

    def step(self, records: Records, row: int) -> int:
        """Return by how much a counter has gone on up to a row, at most; to be asked before ``of`` takes it."""
        step = 0
        for variable, before in zip(self._variables, self._counts, strict=True):
            assert variable.counter is not None
            cells = records.cells(variable.counter, np.arange(row + 1))
            if cells.form[-1] != Form.INTEGER:
                continue
            counts = cells.integers[cells.form == Form.INTEGER]
            known = int(counts[-2]) if len(counts) > 1 else before
            if known is not None:
                step = max(step, int(counts[-1]) - known)
        return step

    def jumps(self, records: Records) -> Bool:
        """Return in which rows a counter goes on by more than a change, or back; asked before ``of`` takes them."""
        found = np.zeros(len(records), np.bool_)
        for variable, before in zip(self._variables, self._counts, strict=True):
            assert variable.counter is not None
            if records.is_empty(variable.counter):
                continue
            rows = np.flatnonzero(records.filled(variable.counter))
            cells = records.cells(variable.counter, rows)
            whole = cells.form == Form.INTEGER
            rows, counts = rows[whole], cells.integers[whole]
            step = np.diff(counts, prepend=counts[:1] if before is None else before)
            # Beside NULL, and in a row that is as the one before, as the reference shows them, it stands still.
            found[rows[(step < 0) | (step > 1)]] = True
        return found

    def _rows(self, place: int, records: Records, counted: Bool, half: Bool, restarts: Bool) -> I64:
        rows, counts = self._take(place, records, np.flatnonzero(counted))
        if not len(rows):
            return rows
        goes_on = np.append(True, counts[1:] != counts[:-1])
        before = self._before
        goes_on[0] = before is not None and int(counts[0]) != before
        return rows[half[rows] & (goes_on | restarts[rows])]

    def _take(self, place: int, records: Records, rows: I64) -> tuple[I64, I64]:
        """Return those of some rows in which a counter is a number, and what it is; keep the last in mind."""
        column = self._variables[place].counter
        assert column is not None
        cells = records.cells(column, rows)
        whole = cells.form == Form.INTEGER
        rows, counts = rows[whole], cells.integers[whole]
        self._before = self._counts[place]
        if len(counts):
            self._counts[place] = int(counts[-1])
        return rows, counts


class SampledUnknown:
    """Finds them in a table that stores every value, stretch by stretch of its rows."""

    def __init__(self, table: LogTable) -> None:
        self._columns = [one.column for one in table.variables]
        self._is_real: Bool = np.array([one.declared.upper() in _REALS for one in table.variables], np.bool_)
        self._groups = VariableGroups(len(self._columns))
        self._shapes = RowShapes(len(self._columns))
        self._apart = TasksApart(self._is_real)

    def of(self, records: Records, begins: Bool) -> Unknown:
        """Return where variables are unknown in rows that follow those before; with rows ``begins`` begin parts."""
        found = self._by_table(records)
        if not self._apart.is_open and not begins.any():
            return found
        return self._apart.without(found, self._filled(records), begins, self._groups.of)

    def _filled(self, records: Records) -> _Matrix:
        return np.array([records.filled(column) for column in self._columns], np.bool_)

    def _by_table(self, records: Records) -> Unknown:
        own = [place for place, column in enumerate(self._columns) if not records.is_empty(column)]
        if self._groups.seen[own].all() and len(self._groups.there) <= 1:
            return self._of_one(records)
        filled = self._filled(records)
        found: dict[int, list[I64]] = {}
        for first, stop in self._parts(filled):
            for place, rows in self._of_part(filled[:, first:stop]):
                found.setdefault(place, []).append(rows + first)
        return {place: np.concatenate(rows) for place, rows in found.items()}

    def _of_one(self, records: Records) -> Unknown:
        """Return them of variables that all are of one task, as mostly."""
        found: dict[int, I64] = {}
        for place in np.flatnonzero(self._groups.seen).tolist():
            if not records.is_full(self._columns[place]):
                found[place] = np.flatnonzero(~records.filled(self._columns[place]))
        return found

    def _parts(self, filled: _Matrix) -> Iterator[tuple[int, int]]:
        """Yield stretches of rows in which no more becomes known of tasks, once what is known in each is."""
        shape = self._shapes.of(filled.shape[1], enumerate(filled))
        first_rows = np.sort(np.unique(shape, return_index=True)[1])
        begin = 0
        for row in first_rows.tolist():
            own = np.flatnonzero(filled[:, row])
            if self._groups.are_one(own):
                continue
            if row > begin:
                yield begin, row
            begin = row
            self._groups.join(own)
        yield begin, filled.shape[1]

    def _of_part(self, filled: _Matrix) -> Iterator[tuple[int, I64]]:
        of_row = np.where(filled.any(axis=0), self._groups.of[filled.argmax(axis=0)], -1)
        unsaid = of_row < 0
        groups = self._of_rows_without_any() if unsaid.any() else ()
        for place in np.flatnonzero(self._groups.seen & ~filled.all(axis=1)).tolist():
            group = int(self._groups.of[place])
            rows = np.flatnonzero(~filled[place] & ((of_row == group) | (unsaid & (group in groups))))
            if len(rows):
                yield place, rows

    def _of_rows_without_any(self) -> Sequence[int]:
        """Return the tasks that a row without any value may be of: those that can have nothing else but numbers that
        are none, if there are such ones."""
        of, seen = self._groups.of, self._groups.seen
        groups = self._groups.there
        return [group for group in groups if self._is_real[seen & (of == group)].all()] or groups
