"""Databases of DataLoggers with a row a row of their tables, and a column a variable.

Values are as they are stored: NULL is null, where only changes are stored, too. A value that is none of what its column
is declared as (a text among numbers) has no place among these: it is null, and counted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from dissectors.batch import I64, Bool
from dissectors.datalogger.logged import RowTable
from dissectors.datalogger.records import Form as Stored
from dissectors.datalogger.records import Records
from dissectors.datalogger.rows import RowBatch, consistent, says_whether
from nvscope.engine.limit import MAX_STREAMS
from nvscope.engine.told import Told
from nvscope.export.arrays import MOMENT, array_of, bits_of, spans_of, spread_parts, with_nulls
from nvscope.export.database_parts import DatabaseParts
from nvscope.export.names import Names
from nvscope.tracker.datalogger.readings import ReadRows
from nvscope.tracker.datalogger.variables import usual_form_of
from nvscope.tracker.readings.form import Form

if TYPE_CHECKING:
    from nvscope.export.values import OpenPart
    from nvscope.tracker.readings.readings import ReadValues, Wanted

HEAD = (
    pa.field("frame.time", MOMENT),
    pa.field("frame.number", pa.int64()),
    pa.field("db.row", pa.int64()),
    pa.field("db.consistent", pa.bool_()),
)
"""What stands in front of the variables; named as the fields of rows are."""

_TYPES = {Form.WHOLE: pa.int64(), Form.REAL: pa.float64(), Form.TEXT: pa.string()}
_MOST_CELLS = 1 << 21
"""So many values are made at once."""

_GROUP_BYTES = 16 << 20


class DatabaseRows:
    """The rows of databases, batch by batch; a reader (``nvscope.tracker.readings.observed.Observed``).

    ``wanted`` chooses among variables, None wants all; a table of which none is wanted is left out. ``tables`` are
    those known beforehand: each has a file, whether rows come or not. Of all tables, ``most`` variables are told apart.
    ``of_part`` counts those that were made of each part, ``misplaced`` the values that are none of what their column is
    declared as.
    """

    unit = "row"

    def __init__(
        self, wanted: Wanted | None = None, tables: Sequence[RowTable] = (), most: int = MAX_STREAMS
    ) -> None:  # fmt: skip
        self._read = ReadRows(wanted)
        self.misplaced = 0
        self._most = most
        self.of_part: dict[str, int] = {}
        self._batch: tuple[Told, RowBatch] | None = None
        self._held: dict[str, list[Any]] = {}
        self._columns: dict[RowTable, _Columns] = {}
        self._parts = DatabaseParts([table for table in tables if self._columns_of(table).wanted])

    @property
    def read(self) -> ReadValues:
        """What knows the variables."""
        return self._read

    def observe(self, told: Told, part: RowBatch) -> None:
        """Take what a batch brings, which follows those before."""
        self._batch = told, part

    def forget(self) -> None:
        """Nothing that is told depends on what was before."""

    def begin(self, open_part: OpenPart) -> None:
        """Open the files of all tables that are known: that one cannot be written is to be said at once."""
        for table in self._parts.known.values():
            open_part(self._parts.of(table), self._columns_of(table).schema)

    def write(self, open_part: OpenPart) -> None:
        """Write the rows of the batch observed last, once; few of a part are held until there are more."""
        batch, self._batch = self._batch, None
        if batch is None:
            return
        told, part = batch
        for table, rows, records in part.by_table():
            columns = self._columns_of(table)
            if not columns.wanted:
                continue
            own, told_whole, said = np.arange(len(rows)), consistent(records), says_whether(records)
            if told.chosen is not None:
                own = own[told.chosen[part.row[rows]]]
            most = max(_MOST_CELLS // len(columns.wanted), 1)
            for start in range(0, len(own), most):
                some = own[start : start + most]
                made = self._table(told, part, rows[some], records, some, columns, told_whole[some], said[some])
                self._hold(self._parts.of(table), made, open_part)

    def tables(self, schema: Any) -> Iterator[Any]:
        """Yield nothing: rows of tables do not stand between values."""
        return iter(())

    def finish(self, open_part: OpenPart) -> None:
        """Write what is held."""
        for name in [*self._held]:
            self._flush(name, open_part)

    def _hold(self, name: str, table: Any, open_part: OpenPart) -> None:
        self.of_part[name] = self.of_part.get(name, 0) + len(table)
        held = self._held.setdefault(name, [])
        held.append(table)
        if sum(one.nbytes for one in held) >= _GROUP_BYTES:
            self._flush(name, open_part)

    def _flush(self, name: str, open_part: OpenPart) -> None:
        whole = pa.concat_tables(self._held.pop(name)).combine_chunks()
        open_part(name, whole.schema).write(whole)

    def _table(
        self, told: Told, part: RowBatch, places: I64, records: Records, some: I64, columns: _Columns,
        told_whole: Bool, said: Bool,
    ) -> Any:  # fmt: skip
        """Return rows at some places of the batch, which are ``some`` of their table's ``records``.

        ``told_whole``: nothing was lost before them, as they say; ``said``: they say whether anything was.
        """
        packet = part.row[places]
        arrays = [
            array_of(told.packets.ts_ns[packet], MOMENT),
            array_of(packet + told.first_frame, pa.int64()),
            array_of(part.logged.rowid[places], pa.int64()),
            with_nulls(told_whole, None if said.all() else bits_of(said), pa.bool_()),
            *(self._array(records, column, form, some, columns.encoding) for column, form in columns.wanted),
        ]
        return pa.table(arrays, schema=columns.schema)

    def _array(self, records: Records, column: int, form: Form, rows: I64, encoding: str) -> Any:
        if records.is_empty(column):
            return pa.nulls(len(rows), _TYPES[form])
        cells = records.cells(column, rows)
        if form is Form.TEXT:
            fits = cells.form == Stored.TEXT
            at = np.flatnonzero(fits)
            texts = [
                records.data[start:stop].tobytes().decode(encoding, "replace").encode()
                for start, stop in zip(cells.start[at].tolist(), cells.stop[at].tolist(), strict=True)
            ]
            made = spread_parts([(at, spans_of(texts, pa.string()))] if texts else [], len(rows), pa.string())
        elif form is Form.REAL:
            fits = cells.form == Stored.REAL
            made = with_nulls(np.where(fits, cells.bits.view(np.float64), 0.0), bits_of(fits), pa.float64())
        else:
            fits = cells.form == Stored.INTEGER
            made = with_nulls(np.where(fits, cells.integers, 0), bits_of(fits), pa.int64())
        self.misplaced += int(np.count_nonzero((cells.form != Stored.NULL) & ~fits))
        return made

    def _columns_of(self, table: RowTable) -> _Columns:
        found = self._columns.get(table)
        if found is None:
            found = self._columns[table] = _Columns(table, (self._read.numbers_of(table, self._most) >= 0).tolist())
        return found


class _Columns:
    """The columns of a table: the schema, and of each variable that is wanted its column in records and its form."""

    def __init__(self, table: RowTable, wanted: Sequence[bool]) -> None:
        own = [variable for variable, is_wanted in zip(table.log.variables, wanted, strict=True) if is_wanted]
        names = Names({entry.name for entry in HEAD})
        self.encoding = table.encoding
        self.wanted = [(variable.column, usual_form_of(variable.declared)) for variable in own]
        fields = [
            pa.field(names.of(variable.name), _TYPES[form], metadata={"sql_type": variable.declared})
            for variable, (_, form) in zip(own, self.wanted, strict=True)
        ]
        self.schema = pa.schema([*HEAD, *fields])
