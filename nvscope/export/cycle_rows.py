"""Tables with a row a telegram to tables with a row a cycle, for lists of which each variable is a telegram.

Telegrams of one sender are of one cycle where they follow each other with rising SubIndexes and not later than a gap.
A row has the last value of every variable, also of one that an earlier cycle of the same recording sent: of what was
sent while nobody listened, nothing is known. It is written when the next cycle of
its sender begins, so that any cut into tables gives the same rows in the same order.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
from msgspec import Struct

from dissectors.batch import I64, Bool
from nvscope.export.arrays import MOMENT, array_of, empty_table, numbers_in, numbers_of

USUAL_GAP_NS = 10_000_000
"""The gap that ends a cycle where no definition says an interval; else it is half of that."""

TELEGRAMS = pa.field("nv.telegrams", pa.uint16())
"""How many telegrams of a cycle came; it stands where a row of a telegram has its SubIndex."""

_HEAD = 4
_TIME, _FRAME, _SENDER, _SUBINDEX = range(_HEAD)


class _Rows(Struct, frozen=True):
    """Telegrams, grouped by sender and in order within; those of open cycles stand in front as one row each.

    ``begin_ns`` and ``begin_frame`` are those of the cycle for such a row, ``last_ns`` and ``subindex`` those of its
    last telegram, ``telegrams`` how many it stands for.
    """

    table: Any
    sender: I64
    begin_ns: I64
    begin_frame: I64
    last_ns: I64
    subindex: I64
    telegrams: I64
    frame: I64

    def take(self, rows: I64) -> _Rows:
        columns = (
            self.sender, self.begin_ns, self.begin_frame, self.last_ns, self.subindex, self.telegrams, self.frame
        )  # fmt: skip
        return _Rows(self.table.take(numbers_of(rows)), *(column[rows] for column in columns))

    def behind(self, open_rows: _Rows) -> _Rows:
        """Return these rows behind those of open cycles."""
        columns = [
            np.concatenate([getattr(open_rows, name), getattr(self, name)])
            for name in ("sender", "begin_ns", "begin_frame", "last_ns", "subindex", "telegrams", "frame")
        ]
        return _Rows(pa.concat_tables([open_rows.table, self.table]), *columns)


class CycleRows:
    """Takes tables of one list in the order of the capture; ``schema`` is that of these tables.

    ``sent`` says for a column which telegrams have it, by what stands in the place of their SubIndex: a null in such a
    row is what was sent. The columns ``without`` which rows of cycles are, are left out. ``recordings_from`` returns
    the frames with which recordings behind the first one begin, rising, as far as tables were taken.
    """

    def __init__(
        self, schema: Any, interval_ns: int | None, sent: Mapping[str, Collection[int]], without: Sequence[str] = (),
        recordings_from: Callable[[], Sequence[int]] = tuple,
    ) -> None:  # fmt: skip
        self._sent = sent
        self._recordings_from = recordings_from
        self._gap_ns = interval_ns // 2 if interval_ns else USUAL_GAP_NS
        self._kept = [name for name in schema.names if name not in without]
        self.schema = pa.schema([schema.field(name) for name in self._kept]).set(_SUBINDEX, TELEGRAMS)
        self._open: _Rows | None = None

    def take(self, table: Any) -> Any:
        """Return the rows of the cycles that ended with a table's telegrams."""
        return self._ended(_rows_of(table.select(self._kept).combine_chunks()), last=False)

    def finish(self) -> Any:
        """Return the rows of the cycles that are open."""
        left, self._open = self._open, None
        return empty_table(self.schema) if left is None else self._ended(left, last=True)

    def _ended(self, rows: _Rows, *, last: bool) -> Any:
        if self._open is not None:
            rows = rows.behind(self._open)
        rows = rows.take(np.argsort(rows.sender, kind="stable"))
        first = np.append(True, rows.sender[1:] != rows.sender[:-1])
        step_ns = np.diff(rows.last_ns, prepend=rows.last_ns[:1])
        rising = np.diff(rows.subindex, prepend=rows.subindex[:1]) > 0
        recording = np.searchsorted(np.array(self._recordings_from(), np.int64), rows.frame, "right")
        anew = first | (np.diff(recording, prepend=recording[:1]) != 0)
        begins = anew | ~(rising & (step_ns >= 0) & (step_ns <= self._gap_ns))
        begin, end = np.flatnonzero(begins), np.append(np.flatnonzero(begins)[1:], len(begins)) - 1
        table = self._last_values(rows, anew)
        cycles = _Rows(
            table.take(numbers_of(end)), rows.sender[end], rows.begin_ns[begin], rows.begin_frame[begin],
            rows.last_ns[end], rows.subindex[end], np.add.reduceat(rows.telegrams, begin), rows.frame[end],
        )  # fmt: skip
        is_open = np.append(first[begin][1:], True)
        if last:
            return self._table(cycles.take(np.argsort(cycles.begin_frame, kind="stable")))
        self._open = cycles.take(np.flatnonzero(is_open))
        ended = np.flatnonzero(~is_open)
        # A cycle ends where the next one of its sender begins.
        return self._table(cycles.take(ended[np.argsort(cycles.begin_frame[ended + 1], kind="stable")]))

    def _last_values(self, rows: _Rows, first: Bool) -> Any:
        """Return a table in which what a telegram did not send is the last value above it of its group.

        A group begins with a ``first`` row: nothing is known of what was sent before it, or it has that itself.
        """
        table, place = rows.table, np.arange(len(first))
        group = np.maximum.accumulate(np.where(first, place, 0))
        columns = []
        for number, (name, column) in enumerate(zip(table.column_names, table.columns, strict=True)):
            if number < _HEAD or not column.null_count:
                columns.append(column)
                continue
            told = numbers_in(column.is_valid())
            if name in self._sent:
                told = told | np.isin(rows.subindex, list(self._sent[name]))
            last = np.maximum.accumulate(np.where(told, place, -1))
            columns.append(column.take(numbers_of(last, last < group)))
        return pa.table(columns, schema=table.schema)

    def _table(self, cycles: _Rows) -> Any:
        columns = [
            array_of(cycles.begin_ns, MOMENT),
            array_of(cycles.begin_frame, pa.int64()),
            cycles.table.column(_SENDER),
            array_of(np.minimum(cycles.telegrams, 0xFFFF).astype(np.uint16), pa.uint16()),
            *cycles.table.columns[_HEAD:],
        ]
        return pa.table(columns, schema=self.schema)


def _rows_of(table: Any) -> _Rows:
    time_ns = numbers_in(table.column(_TIME).cast(pa.int64()))
    frame = numbers_in(table.column(_FRAME))
    sender = table.column(_SENDER).combine_chunks()
    if isinstance(sender, pa.ChunkedArray):
        sender = sender.chunk(0)
    # Numbers of senders are the same in all tables.
    number = numbers_in(sender.indices).astype(np.int64)
    subindex = numbers_in(table.column(_SUBINDEX)).astype(np.int64)
    return _Rows(table, number, time_ns, frame, time_ns, subindex, np.ones(len(frame), np.int64), frame)
