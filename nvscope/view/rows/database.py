"""The values in rows of databases, one by one, as a person reads them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from msgspec import Struct

from dissectors.batch import I64
from dissectors.datalogger.records import Cells, Form, Records
from dissectors.datalogger.rows import RowBatch
from dissectors.datalogger.tables import LoggedVariable
from nvscope.tracker.readings.form import cut_text

MOST_TOLD = 1024
"""So many values of a row are told one by one: the first ones."""


class RowValue(NamedTuple):
    """A value of a row; it lies from ``start`` to ``stop`` of the record, in no byte where these are the same.

    ``counter`` is how often it has changed, as the row says it; '' where it does not.
    """

    variable: LoggedVariable
    text: str
    start: int
    stop: int
    counter: str


class ToldRows(Struct, frozen=True):
    """The rows of a part: of each where it is from, whether it says that data was lost before it, and its values."""

    part: RowBatch
    place: I64
    consistent: list[str]
    values: list[list[RowValue]]
    left_out: list[int]

    @staticmethod
    def of(part: RowBatch, most: int = MOST_TOLD) -> ToldRows:
        """Read the rows of a part, of each the first so many values."""
        told = ToldRows(
            part, part.logged.table, [""] * len(part), [[] for _ in range(len(part))], [0] * len(part)
        )  # fmt: skip
        for table, rows, records in part.by_table():
            told._read(table.log.variables, table.encoding, rows, records, most)
        return told

    def _read(
        self, variables: tuple[LoggedVariable, ...], encoding: str, rows: I64, records: Records, most: int
    ) -> None:  # fmt: skip
        offset = self.part.packets.offset[self.part.row[rows]].tolist()
        own = rows.tolist()
        for place, text in enumerate(_texts(records, records.cells(1), encoding)):
            self.consistent[own[place]] = text
        for variable in variables:
            if records.is_empty(variable.column):
                continue
            cells = records.cells(variable.column)
            filled = np.flatnonzero(cells.form)
            counters: Iterator[str] = iter(())
            some = records.cells(variable.column, filled)
            if variable.counter is not None:
                counters = iter(_texts(records, records.cells(variable.counter, filled), encoding))
            told = zip(
                filled.tolist(), _texts(records, some, encoding), some.start.tolist(), some.stop.tolist(), strict=True
            )
            for place, text, start, stop in told:
                counter = next(counters, "")
                row = own[place]
                if len(self.values[row]) < most:
                    at = offset[place]
                    self.values[row].append(RowValue(variable, text, start - at, stop - at, counter))
                else:
                    self.left_out[row] += 1


def _texts(records: Records, cells: Cells, encoding: str) -> Iterator[str]:
    """Yield values as texts, '' for none."""
    forms, whole, real = cells.form.tolist(), cells.integers.tolist(), cells.bits.view(np.float64).tolist()
    content = records.data.data
    for place, form in enumerate(forms):
        if form == Form.INTEGER:
            yield str(whole[place])
        elif form == Form.REAL:
            number = real[place]
            yield repr(number).removesuffix(".0")
        elif form == Form.NULL:
            yield ""
        else:
            # A character has four bytes at most.
            raw = bytes(content[int(cells.start[place]) : int(min(cells.stop[place], cells.start[place] + 8192))])
            yield cut_text(f"'{raw.decode(encoding, 'replace')}'" if form == Form.TEXT else raw.hex(" "))
