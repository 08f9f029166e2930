"""The fields of rows of databases: ``db.database``, ``db.row``, ``db.consistent``, ``db.variable``."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from msgspec.structs import replace

from dissectors.batch import I64, Bool
from dissectors.datalogger.logged import RowTable
from dissectors.datalogger.rows import RowBatch, consistent
from nvscope.expression.typed_columns import FieldType, TextColumn
from nvscope.view.fields.field import TelegramField

NAME = "db"
MOST_VARIABLES = 64
"""Of a row, so many variables with a value can be asked for, the first ones."""


def _of_table(read: Callable[[RowTable], str]) -> Callable[[RowBatch], TextColumn]:
    return lambda part: TextColumn(part.logged.table, tuple(map(read, part.tables)) or ("",))


def _consistent(part: RowBatch) -> Bool:
    told = np.ones(len(part), np.bool_)
    for _, rows, records in part.by_table():
        told[rows] = consistent(records)
    return told


def _values(part: RowBatch) -> I64:
    count = np.zeros(len(part), np.int64)
    for table, rows, records in part.by_table():
        for variable in table.log.variables:
            if not records.is_empty(variable.column):
                count[rows] += records.filled(variable.column)
    return count


class _Names:
    """The variables of which the rows of a part have values: ``column`` tells those at one place of each row."""

    def __init__(self, part: RowBatch) -> None:
        self.part = part
        self.texts: list[str] = []
        self._codes = np.full((MOST_VARIABLES, len(part)), -1)
        codes: dict[str, int] = {}
        for table, rows, records in part.by_table():
            place = np.zeros(len(rows), np.int64)
            for variable in table.log.variables:
                if records.is_empty(variable.column):
                    continue
                code = codes.setdefault(variable.name, len(codes))
                own = np.flatnonzero(records.filled(variable.column) & (place < MOST_VARIABLES))
                self._codes[place[own], rows[own]] = code
                place[own] += 1
        self.texts = list(codes)

    def column(self, place: int) -> I64:
        """Return the code of the variable at a place of each row, -1 where there is none."""
        column: I64 = self._codes[place]
        return column


class _LastPart:
    """The names of the part that was asked for last: each place of it is asked for in turn."""

    def __init__(self) -> None:
        self._names: _Names | None = None

    def of(self, part: RowBatch) -> _Names:
        if self._names is None or self._names.part is not part:
            self._names = _Names(part)
        return self._names


_LAST = _LastPart()


def _variable(place: int) -> TelegramField:
    return TelegramField(
        "db.variable", FieldType.TEXT, "Variable", "that has a value in the row; a row may have several",
        lambda part: TextColumn(np.maximum(_LAST.of(part).column(place), 0), tuple(_LAST.of(part).texts) or ("",)),
        lambda part: _LAST.of(part).column(place) >= 0, of=NAME, any_case=True,
    )  # fmt: skip


def _variables() -> TelegramField:
    first, *further = (_variable(place) for place in range(MOST_VARIABLES))
    return replace(first, further=tuple(further))


DATABASE_FIELDS: Sequence[TelegramField] = (
    TelegramField(
        "db.database", FieldType.TEXT, "Database", "the file, or the series of files", _of_table(lambda one: one.title),
        of=NAME,
    ),
    TelegramField(
        "db.table", FieldType.TEXT, "Table", "of the database", _of_table(lambda one: one.log.name), of=NAME
    ),
    TelegramField("db.row", FieldType.SIGNED, "Row", "its id", lambda part: part.logged.rowid, of=NAME),
    TelegramField(
        "db.consistent", FieldType.BOOL, "Consistent", "ConsistentDataSeries: nothing was lost before the row",
        _consistent, of=NAME,
    ),
    TelegramField(
        "db.values", FieldType.UNSIGNED, "Values", "variables that have one in the row", _values, of=NAME
    ),
    _variables(),
)  # fmt: skip
