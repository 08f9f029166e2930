"""Values with a row a telegram and a column a variable, a file a list.

A list of several definitions has the variables of all of them as columns, one where they have the same of one type.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from dissectors.batch import I64
from nvscope.capture.spans import stretches
from nvscope.definition.variables import Element, Enumeration, scalar_of
from nvscope.export.arrays import LABEL, MOMENT, Spread, array_of, arrow_type, labels, spread_parts
from nvscope.export.cycle_rows import CycleRows
from nvscope.export.files import TableFile
from nvscope.export.held import HeldTelegrams, OpenPart, Slabs
from nvscope.export.names import Names, value_names
from nvscope.expression.typed_columns import FieldType
from nvscope.view.rows.defined import DefinedRows, Place
from nvscope.view.rows.values import ValueColumn, fits_time, value_type

PIECE_BYTES = 16 << 20
"""Data that is taken from a batch at once."""

GROUP_ROWS = 1 << 17
GROUP_BYTES = 16 << 20
HELD_BYTES = 64 << 20
"""Rows or bytes of a list that are enough for a row group, and bytes of all lists at which the largest is written."""

HEAD = (
    pa.field("frame.time", MOMENT),
    pa.field("frame.number", pa.int64()),
    pa.field("ip.src", LABEL),
    pa.field("nv.subindex", pa.uint16()),
)
CAN_HEAD = (*HEAD[:2], pa.field("can.channel", LABEL), pa.field("can.id", pa.uint16()))
"""What stands in front of the variables, on UDP and on CAN; named as the fields of telegrams are."""


class _Column:
    """A variable, as one or several telegrams of a list have it."""

    def __init__(self, element: Element, names: Names, *, typed: bool) -> None:
        self.name, self.text_name = names.free(element, typed=typed)
        self.type = _number_type(element)
        self.iec_type = element.type.name

    def fields(self) -> Iterator[Any]:
        """Yield what stands of it in the schema: itself, and where it has names of its numbers these."""
        yield pa.field(self.name, self.type, metadata={"iec_type": self.iec_type})
        if self.text_name:
            yield pa.field(self.text_name, LABEL)


class WideTable:
    """The telegrams of one list, held until there are enough of them for a row group.

    Rows are in the order of the capture. The variables that a row's own telegram does not have are null. ``senders``
    are the addresses that the numbers of senders stand for; several tables share ``slabs``. ``beyond_time`` counts the
    times that are null because no column of times holds them.
    """

    def __init__(
        self, places: Sequence[Place], senders: Callable[[], Sequence[str]], slabs: Slabs | None = None
    ) -> None:
        pool = slabs or Slabs()
        self._parts: list[HeldTelegrams | OpenPart] = [
            HeldTelegrams(place, pool, len(places)) if place.rest is None else OpenPart(place) for place in places
        ]
        self._senders = senders
        on_can = any(place.layout.list.on_can for place in places)
        # The frames of a list have COB-IDs that follow each other.
        self._first_number = (places[0].layout.list.list_id or 0) if on_can else 0
        head = CAN_HEAD if on_can else HEAD
        self._columns, self._column_of = _columns(places, head)
        self.schema = pa.schema([*head, *(field for column in self._columns for field in column.fields())])
        self.rows = self.held_bytes = self.beyond_time = 0

    @property
    def of_several(self) -> list[str]:
        """The columns of bytes that nobody has described, and that several telegrams have."""
        shared = Counter(
            numbers[-1]
            for part, numbers in zip(self._parts, self._column_of, strict=True)
            if part.place.rest is not None
        )
        return [self._columns[number].name for number, telegrams in shared.items() if telegrams > 1]

    @property
    def sent(self) -> Mapping[str, frozenset[int]]:
        """By column, what stands in the place of the SubIndex of the telegrams that have it, as far as that is sure."""
        found: dict[str, set[int]] = {}
        for part, numbers in zip(self._parts, self._column_of, strict=True):
            if part.place.rest is None:
                for entry in (entry for number in numbers for entry in self._columns[number].fields()):
                    found.setdefault(entry.name, set()).add(part.place.layout.subindex + self._first_number)
        return {name: frozenset(numbers) for name, numbers in found.items()}

    @property
    def variables(self) -> int:
        """How many variables have a column."""
        return len(self._columns)

    def add(self, position: int, rows: DefinedRows, which: I64) -> None:
        """Take some telegrams, all of one place."""
        self.held_bytes += self._parts[position].add(rows, which)
        self.rows += len(which)

    def take(self) -> Any:
        """Return what is held as an Arrow table, and hold nothing."""
        held = [(position, part.take()) for position, part in enumerate(self._parts) if part.rows]
        frame = np.concatenate([taken.frame for _, taken in held])
        whole = len(held) == 1
        order = slice(None) if whole else np.argsort(frame, kind="stable")
        row_of = np.empty(len(frame), np.int64)
        row_of[order] = np.arange(len(frame))
        parts: dict[int, list[tuple[Element, ValueColumn, Spread | None]]] = {}
        start = 0
        for position, taken in held:
            stop = start + len(taken.frame)
            spread = None if whole else Spread(row_of[start:stop], len(frame))
            start = stop
            elements = self._parts[position].place.elements
            for number, element, column in zip(self._column_of[position], elements, taken.columns, strict=True):
                parts.setdefault(number, []).append((element, column, spread))
                self.beyond_time += _beyond_time(element, column)
        ts_ns, sender, subindex = (
            np.concatenate([getattr(taken, name) for _, taken in held])[order]
            for name in ("ts_ns", "sender", "subindex")
        )
        arrays = [
            array_of(ts_ns, MOMENT),
            array_of(frame[order], pa.int64()),
            labels(sender, self._senders()),
            array_of((subindex + self._first_number).astype(np.uint16), pa.uint16()),
        ]
        for number, variable in enumerate(self._columns):
            arrays += _arrays(variable, parts.get(number, []), len(frame))
        self.rows = self.held_bytes = 0
        return pa.table(arrays, schema=self.schema)


def _columns(places: Sequence[Place], head: Sequence[Any]) -> tuple[list[_Column], list[list[int]]]:
    """Return the columns of all variables, and which of them those of each place are.

    Telegrams of several definitions share the column of a variable that is of one type in all of them; the same holds
    for the bytes that nobody has described.
    """
    names = Names({entry.name for entry in head})
    columns: list[_Column] = []
    known: dict[tuple[object, ...], int] = {}
    column_of = []
    seen: dict[tuple[object, ...], int] = {}
    told: list[Element] = []
    earlier: set[str] = set()
    definition = None
    for place in places:
        if place.layout.list is not definition:
            definition, seen = place.layout.list, {}
            earlier = {element.name for element in told}
        numbers = []
        for element in place.elements:
            key: tuple[object, ...] = (element.name, _number_type(element), isinstance(element.type, Enumeration))
            if element is not place.rest:
                # Should a definition have a name twice, these are two variables.
                seen[key] = seen.get(key, 0) + 1
                key = (*key, seen[key])
            if key not in known:
                known[key] = len(columns)
                columns.append(_Column(element, names, typed=element.name in earlier))
            numbers.append(known[key])
            told.append(element)
        column_of.append(numbers)
    return columns, column_of


class WideTables:
    """The tables of all lists; each goes to its file when it, or all together, hold enough.

    With ``cycles``, one a table, a file has a row a cycle.
    """

    def __init__(
        self,
        tables: Sequence[WideTable],
        open_file: Callable[[int], TableFile],
        places: Sequence[Place],
        cycles: Sequence[CycleRows] = (),
    ) -> None:
        self._tables = tables
        self._cycles = cycles
        self._open = open_file
        # The places of a list follow each other.
        self._number = [place.number for place in places]
        self._first = np.searchsorted(self._number, self._number).tolist()
        self._files: dict[int, TableFile] = {}
        self._held_bytes = 0
        self.rows = [0] * len(tables)

    def add(self, rows: DefinedRows) -> None:
        """Take the telegrams of a batch."""
        for piece in stretches(rows.size_bytes, len(rows), PIECE_BYTES):
            self._add(rows if piece.stop - piece.start == len(rows) else rows.take(piece))

    def _add(self, rows: DefinedRows) -> None:
        # Nothing is written before the telegrams of all SubIndexes are there: a list's rows would lose their order.
        for place, which in rows.by_place():
            number = self._number[place]
            table = self._tables[number]
            before = table.held_bytes
            table.add(place - self._first[place], rows, which)
            self._held_bytes += table.held_bytes - before
        for number, table in enumerate(self._tables):
            if table.rows >= GROUP_ROWS or table.held_bytes >= GROUP_BYTES:
                self._write(number)
        while self._held_bytes > HELD_BYTES:
            self._write(max(range(len(self._tables)), key=lambda one: self._tables[one].held_bytes))

    def finish(self) -> None:
        """Write what is held; a list without a telegram gets a file without rows."""
        for number, table in enumerate(self._tables):
            if table.rows:
                self._write(number)
            if self._cycles:
                self._put(number, self._cycles[number].finish())
            self._file(number).close()

    def _write(self, number: int) -> None:
        table = self._tables[number]
        self._held_bytes -= table.held_bytes
        taken = table.take()
        self._put(number, self._cycles[number].take(taken) if self._cycles else taken)

    def _put(self, number: int, table: Any) -> None:
        self.rows[number] += len(table)
        self._file(number).write(table)

    def _file(self, number: int) -> TableFile:
        if number not in self._files:
            self._files[number] = self._open(number)
        return self._files[number]


def _number_type(element: Element) -> Any:
    scalar = scalar_of(element.type)
    return arrow_type(value_type(element.type), scalar.dtype if scalar else "")


def _beyond_time(element: Element, column: ValueColumn) -> int:
    is_time = value_type(element.type) in (FieldType.DURATION, FieldType.TIME)
    if not is_time or not isinstance(column, np.ndarray) or column.dtype != np.uint64:
        return 0
    return int(np.count_nonzero(~fits_time(column)))


def _arrays(
    variable: _Column, parts: Sequence[tuple[Element, ValueColumn, Spread | None]], count: int
) -> Iterator[Any]:
    """Yield the arrays of a variable, put together from those of the telegrams that have it."""
    if len(parts) == 1:
        ((element, column, spread),) = parts
        yield array_of(column, variable.type, spread)
        if variable.text_name:
            assert isinstance(element.type, Enumeration)
            assert isinstance(column, np.ndarray)
            code, texts = value_names(element.type, column)
            if spread is not None:
                full = np.full(spread.count, -1)
                full[spread.at] = code
                code = full
            yield labels(code, texts, code >= 0)
        return
    rows = [spread.at for _, _, spread in parts if spread]
    yield spread_parts(
        [(at, array_of(column, variable.type)) for at, (_, column, _) in zip(rows, parts, strict=True)],
        count,
        variable.type,
    )
    if variable.text_name:
        named = [(at, _names(element, column)) for at, (element, column, _) in zip(rows, parts, strict=True)]
        yield spread_parts(named, count, pa.string()).dictionary_encode()


def _names(element: Element, column: ValueColumn) -> Any:
    assert isinstance(element.type, Enumeration)
    assert isinstance(column, np.ndarray)
    code, texts = value_names(element.type, column)
    return labels(code, texts, code >= 0).cast(pa.string())
