"""Values that come one by one, with a row a value: in the long form beside those of lists, or by themselves.

What a value is decides in which column it stands, as in ``nvscope.export.long``; one that is none of its type is a
text, as it came. Times are nanoseconds. What could not be read has no row; one without any value says that nobody
knows it any more. By themselves, values have the columns that can hold something, and the place of the variable.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from dissectors.batch import I64, Bool
from nvscope.definition.variables import Scalar
from nvscope.engine.runs import distinct
from nvscope.engine.told import Told
from nvscope.export.arrays import MOMENT, array_of, bits_of, labels, spread_parts, with_nulls
from nvscope.tracker.readings.form import HIDDEN, Form
from nvscope.tracker.readings.readings import Readings, ReadValues, ReadVariable
from nvscope.view.documents.read_variables import UNKNOWN

if TYPE_CHECKING:
    from nvscope.export.values import OpenPart

Columns = Mapping[str, Callable[[Any], str]]
"""What stands in columns of variables of one protocol, beside what those of all have."""


FURTHER: Mapping[str, Columns] = {
    "visu": {"ip.src": lambda one: one.sender, "place": lambda one: one.place},
    "db": {},
}
"""By name of who tells them (``nvscope.analysis.read_values.SOURCES``)."""


class ReadTables:
    """The values that are read, batch by batch; a reader (``nvscope.tracker.readings.observed.Observed``).

    ``further`` are columns of their own, ``schema`` those of a file of theirs. ``rows`` counts those that were made;
    with ``secrets``, passwords are among them.
    """

    unit = "value"
    misplaced = 0

    def __init__(self, read: ReadValues, further: Columns, schema: Any, *, secrets: bool = False) -> None:
        self._read = read
        self.rows = 0
        self._schema = schema
        self._further = further
        self._secrets = secrets
        self._batch: tuple[Told, Any] | None = None

    def observe(self, told: Told, part: Any) -> None:
        """Take what a batch brings, which follows those before."""
        self._batch = told, part

    def forget(self) -> None:
        """Nothing that is told depends on what was before."""

    @property
    def read(self) -> ReadValues:
        """What finds the values."""
        return self._read

    @property
    def of_part(self) -> Mapping[str, int]:
        """How many rows there are: they are one part."""
        return {"": self.rows}

    def write(self, open_part: OpenPart) -> None:
        """Write the values of the batch observed last, once."""
        for table in self.tables(self._schema):
            open_part("", self._schema).write(table)

    def finish(self, open_part: OpenPart) -> None:
        """Nothing is held."""

    def tables(self, schema: Any) -> Iterator[Any]:
        """Yield the values of the batch observed last, once, by frame, in the columns of a schema."""
        batch, self._batch = self._batch, None
        if batch is None:
            return
        told, part = batch
        for readings in self._read.of(told, part):
            rows = np.flatnonzero(readings.form != Form.NOTHING)
            # In the order of the capture, which is that of each variable alone so far.
            rows = rows[np.argsort(readings.row[rows], kind="stable")]
            if len(rows):
                self.rows += len(rows)
                yield self._table(told, readings, rows, schema)

    def _table(self, told: Told, readings: Readings, rows: I64, schema: Any) -> Any:
        known = self._read.known
        variable = readings.variable[rows]
        used = distinct(variable)
        which = np.searchsorted(used, variable)
        own = [known[number] for number in used.tolist()]
        form = readings.form[rows]
        hidden = readings.secret[rows] & (not self._secrets)
        is_whole, is_real = (form == Form.WHOLE) & ~hidden, (form == Form.REAL) & ~hidden
        unit_ns = np.array([_unit_ns(one) for one in own], np.int64)
        bits = readings.bits[rows]
        whole = np.where(is_whole, bits.view(np.int64), 0) * unit_ns[which]
        names, called = _names(readings, readings.naming[rows], which, used)
        columns = {
            "frame.time": array_of(told.packets.ts_ns[readings.row[rows]], MOMENT),
            "frame.number": array_of(readings.row[rows] + told.first_frame, pa.int64()),
            "list": labels(which, [one.list for one in own]),
            "list_name": labels(np.zeros_like(which), [""]),
            "variable": labels(called, names),
            "type": labels(which, [one.type or UNKNOWN for one in own]),
            **{column: labels(which, [told_of(one) for one in own]) for column, told_of in self._further.items()},
            "integer": with_nulls(whole, bits_of(is_whole), pa.int64()),
            "real": with_nulls(np.where(is_real, bits.view(np.float64), 0.0), bits_of(is_real), pa.float64()),
            "text": _texts(readings, rows, ~is_whole & ~is_real & (form != Form.UNKNOWN), hidden),
        }
        arrays = [columns[field.name] if field.name in columns else pa.nulls(len(rows), field.type) for field in schema]
        return pa.table(arrays, schema=schema)


def _unit_ns(variable: ReadVariable) -> int:
    kind = variable.kind_of(Form.WHOLE, 0)
    return max(kind.unit_ns, 1) if isinstance(kind, Scalar) else 1


def _names(readings: Readings, naming: I64, which: I64, used: I64) -> tuple[list[str], I64]:
    """Return what variables are called, and which of it each of some values is: as its variable was called then."""
    code = naming * len(used) + which
    codes = distinct(code)
    numbers = used.tolist()
    names = [
        readings.called(numbers[place], version)
        for version, place in (divmod(one, len(used)) for one in codes.tolist())
    ]
    return names, np.searchsorted(codes, code)


def _texts(readings: Readings, rows: I64, is_text: Bool, hidden: Bool) -> Any:
    at = np.flatnonzero(is_text)
    texts = [
        HIDDEN if hides else readings.text(place)
        for place, hides in zip(rows[at].tolist(), hidden[at].tolist(), strict=True)
    ]
    return spread_parts([(at, pa.array(texts, pa.string()))] if texts else [], len(rows), pa.string())
