"""Values with a row a telegram and a column a variable, a file a list."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from dissectors.batch import I64, U8
from nvscope.capture.spans import stretches
from nvscope.definition.model import Element, Enumeration, scalar_of
from nvscope.definition.packing import TelegramLayout
from nvscope.export.arrays import LABEL, MOMENT, Spread, array_of, arrow_type, labels
from nvscope.export.files import TableFile
from nvscope.export.names import Names, value_names
from nvscope.view.defined_telegrams import DefinedRows
from nvscope.view.value_columns import ColumnDecoder, ValueColumn, value_type

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
"""What stands in front of the variables; named as the fields of telegrams are."""

_HEAD_BYTES = 3 * 8
_SLAB_BYTES = 256 << 10
_LEAST_SLAB_BYTES = 4 << 10


class Slabs:
    """Memory in pieces of few sizes, which any list takes and gives back: what is held of many leaves no holes."""

    def __init__(self) -> None:
        self._free: dict[int, list[U8]] = {}

    def take(self, size_bytes: int) -> U8:
        free = self._free.get(size_bytes)
        return free.pop() if free else np.empty(size_bytes, np.uint8)

    def give_back(self, slabs: list[U8]) -> None:
        if slabs:
            self._free.setdefault(len(slabs[0]), []).extend(slabs)
        slabs.clear()


class _Part:
    """Telegrams of one SubIndex that were not written yet, in slabs of at least so many bytes."""

    def __init__(self, layout: TelegramLayout, slabs: Slabs, slab_bytes: int) -> None:
        self.layout = layout
        self.decoder = ColumnDecoder(layout)
        self.rows = 0
        self._size_bytes = layout.layout.size_bytes
        self._slab_bytes = max(slab_bytes, _HEAD_BYTES + self._size_bytes)
        self._rows_a_slab = self._slab_bytes // (_HEAD_BYTES + self._size_bytes)
        self._pool = slabs
        self._slabs: list[U8] = []

    def add(self, rows: DefinedRows, which: I64) -> None:
        while len(which):
            at = self.rows % self._rows_a_slab
            if not at:
                self._slabs.append(self._pool.take(self._slab_bytes))
            piece, which = np.split(which, [self._rows_a_slab - at])
            numbers, data = self._views(self._slabs[-1], slice(at, at + len(piece)))
            for target, source in zip(numbers, (rows.frame, rows.ts_ns, rows.sender), strict=True):
                target[:] = source[piece]
            data[:] = rows.bytes_of(piece, self._size_bytes)
            self.rows += len(piece)

    def take(self) -> tuple[I64, U8]:
        """Return frame numbers, times in ns and senders, (3, rows), and data, (rows, bytes), and hold nothing."""
        last = self.rows - (len(self._slabs) - 1) * self._rows_a_slab
        used = [self._rows_a_slab] * (len(self._slabs) - 1) + [last]
        views = [self._views(slab, slice(count)) for slab, count in zip(self._slabs, used, strict=True)]
        taken = np.hstack([numbers for numbers, _ in views]), np.concatenate([data for _, data in views])
        self._pool.give_back(self._slabs)
        self.rows = 0
        return taken

    def _views(self, slab: U8, rows: slice) -> tuple[I64, U8]:
        head, stop = _HEAD_BYTES * self._rows_a_slab, (_HEAD_BYTES + self._size_bytes) * self._rows_a_slab
        numbers = slab[:head].view(np.int64).reshape(3, self._rows_a_slab)
        return numbers[:, rows], slab[head:stop].reshape(self._rows_a_slab, self._size_bytes)[rows]


class WideTable:
    """The telegrams of one list, held until there are enough of them for a row group.

    Rows are in the order of the capture. The variables of other SubIndexes than a row's own are null. ``senders`` are
    the addresses that the numbers of senders stand for; several tables share ``slabs``.
    """

    def __init__(
        self, layouts: Sequence[TelegramLayout], senders: Callable[[], Sequence[str]], slabs: Slabs | None = None
    ) -> None:
        pool = slabs or Slabs()
        # Of a list that is not packed, each variable has slabs of its own.
        slab_bytes = max(_SLAB_BYTES // len(layouts) & -_LEAST_SLAB_BYTES, _LEAST_SLAB_BYTES)
        self._parts = [_Part(layout, pool, slab_bytes) for layout in layouts]
        self._senders = senders
        taken = {entry.name for entry in HEAD}
        names = Names(taken)
        self._names = [[names.free(element) for element in layout.elements] for layout in layouts]
        self.schema = pa.schema([*HEAD, *self._fields()])
        self.rows = self.held_bytes = 0

    def add(self, subindex: int, rows: DefinedRows, which: I64) -> None:
        """Take some telegrams of one SubIndex."""
        part = self._parts[subindex]
        part.add(rows, which)
        self.rows += len(which)
        self.held_bytes += len(which) * (_HEAD_BYTES + part.layout.layout.size_bytes)

    def take(self) -> Any:
        """Return what is held as an Arrow table, and hold nothing."""
        parts = [part for part in self._parts if part.rows]
        counts = [part.rows for part in parts]
        taken = {part.layout.subindex: part.take() for part in parts}
        frame, ts_ns, sender = np.hstack([numbers for numbers, _ in taken.values()])
        subindex = np.repeat(np.array([part.layout.subindex for part in parts], np.uint16), counts)
        spreads: dict[int, Spread | None] = {part.layout.subindex: None for part in parts}
        if len(self._parts) > 1:
            order = np.argsort(frame, kind="stable")
            frame, ts_ns, sender, subindex = frame[order], ts_ns[order], sender[order], subindex[order]
            place = np.empty(len(order), np.int64)
            place[order] = np.arange(len(order))
            ends = np.cumsum(counts)
            for part, end, count in zip(parts, ends.tolist(), counts, strict=True):
                spreads[part.layout.subindex] = Spread(place[end - count : end], len(order))
        arrays = [
            array_of(ts_ns, MOMENT),
            array_of(frame, pa.int64()),
            labels(sender, self._senders()),
            array_of(subindex, pa.uint16()),
        ]
        for part in self._parts:
            if part.layout.subindex in taken:
                columns = part.decoder.columns(taken[part.layout.subindex][1])
                arrays += _arrays(part.layout, columns, spreads[part.layout.subindex])
            else:
                # Of these, not one telegram is among what is held.
                fields = self.schema.names[len(arrays) :][: self._width(part.layout)]
                arrays += [pa.nulls(len(frame), self.schema.field(name).type) for name in fields]
        self.rows = self.held_bytes = 0
        return pa.table(arrays, schema=self.schema)

    def _fields(self) -> Iterator[Any]:
        for part, names in zip(self._parts, self._names, strict=True):
            for element, (name, text_name) in zip(part.layout.elements, names, strict=True):
                yield pa.field(name, _number_type(element), metadata={"iec_type": element.type.name})
                if text_name:
                    yield pa.field(text_name, LABEL)

    def _width(self, layout: TelegramLayout) -> int:
        return sum(1 + isinstance(element.type, Enumeration) for element in layout.elements)


class WideTables:
    """The tables of all lists; each goes to its file when it, or all together, hold enough."""

    def __init__(
        self,
        tables: Sequence[WideTable],
        open_file: Callable[[int], TableFile],
        places: Sequence[tuple[int, TelegramLayout]],
    ) -> None:
        self._tables = tables
        self._open = open_file
        self._places = places
        self._bytes = np.array([layout.layout.size_bytes for _, layout in places], np.int64)
        self._files: dict[int, TableFile] = {}
        self._held_bytes = 0
        self.rows = [0] * len(tables)

    def add(self, rows: DefinedRows) -> None:
        """Take the telegrams of a batch."""
        for piece in stretches(self._bytes[rows.place], len(rows), PIECE_BYTES):
            self._add(rows if piece.stop - piece.start == len(rows) else rows.take(piece))

    def _add(self, rows: DefinedRows) -> None:
        # Nothing is written before the telegrams of all SubIndexes are there: a list's rows would lose their order.
        for place, which in rows.by_place():
            number, layout = self._places[place]
            table = self._tables[number]
            before = table.held_bytes
            table.add(layout.subindex, rows, which)
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
            self._file(number).close()

    def _write(self, number: int) -> None:
        table = self._tables[number]
        self._held_bytes -= table.held_bytes
        self.rows[number] += table.rows
        self._file(number).write(table.take())

    def _file(self, number: int) -> TableFile:
        if number not in self._files:
            self._files[number] = self._open(number)
        return self._files[number]


def _number_type(element: Element) -> Any:
    scalar = scalar_of(element.type)
    return arrow_type(value_type(element.type), scalar.dtype if scalar else "")


def _arrays(layout: TelegramLayout, columns: Iterable[ValueColumn], spread: Spread | None) -> Iterator[Any]:
    for element, column in zip(layout.elements, columns, strict=True):
        yield array_of(column, _number_type(element), spread)
        if isinstance(element.type, Enumeration):
            assert isinstance(column, np.ndarray)
            code, texts = value_names(element.type, column)
            if spread is not None:
                full = np.full(spread.count, -1)
                full[spread.at] = code
                code = full
            yield labels(code, texts, code >= 0)
