"""Values of variables of WebVisu pages with a row a value: in the long form beside those of lists, or by themselves.

What a value is decides in which column it stands, as in ``nvscope.export.long``; one that is none of its type is a
text, as it came. Times are nanoseconds. What could not be read has no row. By themselves, values have the columns that
can hold something, and the place of the variable.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pyarrow as pa

from dissectors.batch import I64, Bool
from dissectors.webvisu import Place
from nvscope.definition.variables import Scalar
from nvscope.engine.runs import distinct
from nvscope.engine.told import Told
from nvscope.export.arrays import (
    MOMENT,
    array_of,
    bits_of,
    labels,
    spread_parts,
    with_nulls,
)
from nvscope.tracker.visu.messages import VisuBatch
from nvscope.tracker.visu.number_texts import Form
from nvscope.tracker.visu.readings import Readings, ReadValues
from nvscope.tracker.visu.variables import PageVariable
from nvscope.tracker.visu.writes import HIDDEN
from nvscope.view.documents.page_variables import type_told


class PageTables:
    """The values of wanted variables of pages, batch by batch; a reader of pages (``PageObserver``).

    ``rows`` counts those that were made; with ``secrets``, passwords are among them.
    """

    def __init__(self, wanted: Callable[[PageVariable], bool], *, secrets: bool = False) -> None:
        self.read = ReadValues(wanted)
        self.rows = 0
        self._secrets = secrets
        self._batch: tuple[Told, VisuBatch] | None = None

    def observe(self, told: Told, part: VisuBatch) -> None:
        """Take what a batch brings, which follows those before."""
        self._batch = told, part

    def forget(self) -> None:
        """Nothing that is told depends on what was before."""

    def tables(self, schema: Any) -> Iterator[Any]:
        """Yield the values of the batch observed last, once, by frame, in the columns of a schema."""
        batch, self._batch = self._batch, None
        if batch is None:
            return
        told, part = batch
        for readings in self.read.of(told, part):
            rows = np.flatnonzero(readings.form != Form.NOTHING)
            if len(rows):
                self.rows += len(rows)
                yield self._table(told, part, readings, rows, schema)

    def _table(self, told: Told, part: VisuBatch, readings: Readings, rows: I64, schema: Any) -> Any:
        known = self.read.variables.known
        variable = readings.variable[rows]
        used = distinct(variable)
        which = np.searchsorted(used, variable)
        own = [known[number] for number in used.tolist()]
        form = readings.form[rows]
        hidden = readings.secret[rows] & (not self._secrets)
        is_whole, is_real = (form == Form.WHOLE) & ~hidden, (form == Form.REAL) & ~hidden
        unit_ns = np.array([max(one.kind.unit_ns, 1) if isinstance(one.kind, Scalar) else 1 for one in own], np.int64)
        bits = readings.bits[rows]
        whole = np.where(is_whole, bits.view(np.int64), 0) * unit_ns[which]
        names, called = _names(part, part.messages.naming[readings.message[rows]], which, own)
        columns = {
            "frame.time": array_of(told.packets.ts_ns[readings.row[rows]], MOMENT),
            "frame.number": array_of(readings.row[rows] + told.first_frame, pa.int64()),
            "ip.src": labels(which, [one.sender for one in own]),
            "list": labels(which, [one.list for one in own]),
            "list_name": labels(np.zeros_like(which), [""]),
            "variable": labels(called, names),
            "place": labels(which, [one.place for one in own]),
            "type": labels(which, [type_told(one) for one in own]),
            "integer": with_nulls(whole, bits_of(is_whole), pa.int64()),
            "real": with_nulls(np.where(is_real, bits.view(np.float64), 0.0), bits_of(is_real), pa.float64()),
            "text": _texts(readings, rows, ~is_whole & ~is_real, hidden),
        }
        arrays = [columns[field.name] if field.name in columns else pa.nulls(len(rows), field.type) for field in schema]
        return pa.table(arrays, schema=schema)


def _names(part: VisuBatch, naming: I64, which: I64, own: list[PageVariable]) -> tuple[list[str], I64]:
    """Return what variables are called, and which of it each of some values is: as its variable was called then."""
    code = naming * len(own) + which
    used = distinct(code)
    names = []
    for version, place in (divmod(one, len(own)) for one in used.tolist()):
        where = own[place].where
        names.append(part.namings[version].get(where, where.text) if isinstance(where, Place) else where)
    return names, np.searchsorted(used, code)


def _texts(readings: Readings, rows: I64, is_text: Bool, hidden: Bool) -> Any:
    at = np.flatnonzero(is_text)
    texts = [
        HIDDEN if hides else readings.text(place)
        for place, hides in zip(rows[at].tolist(), hidden[at].tolist(), strict=True)
    ]
    return spread_parts([(at, pa.array(texts, pa.string()))] if texts else [], len(rows), pa.string())
