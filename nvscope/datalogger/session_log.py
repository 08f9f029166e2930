"""SessionLog: one session on its way from telegrams to rows in its files.

::

    telegrams → instants, values at these → changes counted → ring buffer → only changes → blocks → database
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.datalogger.changes import Changed, Counts
from nvscope.datalogger.columns import TableColumns
from nvscope.datalogger.configuration import Session
from nvscope.datalogger.database import Database, DatabaseLocked
from nvscope.datalogger.instants import Cycles, Instants, Interval
from nvscope.datalogger.logged import Content, Logged
from nvscope.datalogger.ring import Ring
from nvscope.datalogger.rows import Rows
from nvscope.datalogger.samples import Samples
from nvscope.datalogger.texts import MOST_KEPT, Texts
from nvscope.engine.told import Told
from nvscope.list_key import ListKey
from nvscope.view.rows.defined import DefinedRows, Place

_CELLS_AT_ONCE = 1 << 17
"""So many values are looked at in one go: they stay near the processor."""

_BLOCKS_KEPT = 4
"""While another program holds the file, so many blocks wait for it; then the oldest rows are lost."""


@dataclass(frozen=True, slots=True)
class Schedule:
    """When values are taken, and which columns are then; None: all."""

    instants: Interval | Cycles
    columns: Bool | None = None


@dataclass(slots=True)
class Counted:
    """What became of a session: rows that were written, how many of them are not consistent, and what was lost.

    ``overwritten`` are data sets that the ring buffer had no room for, ``not_written`` rows for which another program
    held the file too long.
    """

    samples: int = 0
    rows: int = 0
    inconsistent: int = 0
    overwritten: int = 0
    not_written: int = 0
    first_ns: int | None = None
    last_ns: int | None = None
    files: list[str] = field(default_factory=list)


class SessionLog:
    """Logs the variables of one session.

    ``keys`` are the lists of the places, by number. Rows begin when a value is known. ``goes_on``: the file has rows
    already.
    """

    def __init__(
        self, session: Session, logged: Sequence[Logged], schedules: Sequence[Schedule], places: Sequence[Place],
        keys: Sequence[ListKey], database: Database, *, document_style: bool = False, goes_on: bool = False,
    ) -> None:  # fmt: skip
        self.session = session
        self.logged = logged
        self.keys = frozenset(one.key for one in logged)
        self.counted = Counted()
        self._schedules = schedules
        self._texts = Texts()
        self._samples = Samples(logged, places, keys, self._texts)
        self._counts = Counts(len(logged), self._samples.dtype) if session.only_changes else None
        self._ring = Ring(session.capacity, None if _at_once(schedules) else session.publish_ns)
        self._changed = Changed(len(logged)) if session.only_changes else None
        self._columns = TableColumns(
            logged, self._texts, raw=session.raw, only_changes=session.only_changes, document_style=document_style
        )
        # What was before the first row, nobody recorded; of a new series there is nothing before it.
        self._first_consistent = not (document_style or goes_on)
        self._database = database
        self._at_once = max(_CELLS_AT_ONCE // max(len(logged), 1), 1)
        self._waiting: list[Rows] = []
        self._losses = np.empty(0, np.int64)
        self._lost = False
        self._text_columns = [place for place, one in enumerate(logged) if one.content is Content.TEXT]

    def take(self, told: Told, rows: DefinedRows, losses: I64) -> None:
        """Take a batch; behind the frames ``losses``, which rise, something is missing that this session logs."""
        self._losses = np.concatenate([self._losses, losses])
        self._samples.begin(rows)
        for instants, own in self._instants(told, rows):
            for part in range(0, len(instants.frame), self._at_once):
                rest = slice(part, part + self._at_once)
                self._sample(instants.take(rest), own[rest] if own is not None and own.ndim == 2 else own)
        self._samples.end()
        now_ns = told.until_ns
        if now_ns is not None:
            self._publish(self._ring.take(Rows.none(), now_ns))
        if len(self._texts) > MOST_KEPT:
            self._forget_texts()

    def lose(self) -> None:
        """Let the next row say that something was lost in front of it."""
        self._lost = True

    def end(self) -> None:
        """Write all that is left, and close the files."""
        nothing = DefinedRows(np.empty(0, np.uint8), *(np.empty(0, np.int64) for _ in range(7)))
        self._samples.begin(nothing)
        for schedule in self._schedules:
            for instants in schedule.instants.end():
                self._sample(instants, schedule.columns)
        self._publish(self._ring.end())
        self.flush()
        self.counted.files = [*self._database.closed, self._database.path]
        self._database.close()

    def flush(self) -> None:
        """Write all rows that wait for their block to be full."""
        self._write(1)

    def _instants(self, told: Told, rows: DefinedRows) -> Iterator[tuple[Instants, Bool | None]]:
        """Yield the instants of a batch with the columns that are taken at each of them."""
        if len(self._schedules) == 1:
            only = self._schedules[0]
            for instants in only.instants.take(told, rows):
                yield instants, only.columns
            return
        found = [
            (instants, number)
            for number, schedule in enumerate(self._schedules)
            for instants in schedule.instants.take(told, rows)
        ]
        if not found:
            return
        time_ns = np.concatenate([one.time_ns for one, _ in found])
        frame = np.concatenate([one.frame for one, _ in found])
        number = np.repeat([number for _, number in found], [len(one.frame) for one, _ in found])
        order = np.lexsort((number, time_ns, frame))
        number = number[order]
        masks = np.stack(
            [np.ones(len(self.logged), np.bool_) if one.columns is None else one.columns for one in self._schedules]
        )
        yield Instants(time_ns[order], frame[order], any(one.begins for one, _ in found)), masks[number]

    def _sample(self, instants: Instants, own: Bool | None) -> None:
        cells, known = self._samples.at(instants.frame)
        if own is not None:
            known = np.broadcast_to(own, cells.shape) if known is None else known & own
        consistent = self._consistent(instants)
        if known is not None and not (any_known := known.any(axis=1)).all():
            if not any_known.any():
                return
            instants = Instants(instants.time_ns[any_known], instants.frame[any_known])
            # What was lost before anything is known, is lost in front of nothing.
            cells, known, consistent = cells[any_known], known[any_known], consistent[any_known]
        if not self.counted.samples:
            consistent[0] = self._first_consistent
        self.counted.samples += len(cells)
        if self._counts is None:
            counts = np.empty((len(cells), 0), np.int64)
        else:
            cells, counts = self._counts.take(cells, known)
        before = self._ring.overwritten
        self._publish(self._ring.take(Rows(instants.time_ns, consistent, cells, known, counts)))
        self.counted.overwritten += self._ring.overwritten - before

    def _consistent(self, instants: Instants) -> Bool:
        """Return which of some data sets follow the one before without a loss."""
        consistent = np.ones(len(instants.frame), np.bool_)
        if self._lost or instants.begins:
            consistent[0] = self._lost = False
        if len(self._losses):
            place = np.searchsorted(instants.frame, self._losses)
            here = place < len(consistent)
            consistent[place[here]] = False
            self._losses = self._losses[~here]
        return consistent

    def _publish(self, rows: Rows | None) -> None:
        """Hand data sets from the ring buffer to the database."""
        if rows is None or not len(rows):
            return
        if self._changed is not None:
            rows = self._changed.take(rows)
        if not len(rows):
            return
        self._waiting.append(rows)
        if sum(len(one) for one in self._waiting) >= self.session.block_rows:
            self._write(self.session.block_rows)

    def _write(self, least: int) -> None:
        """Write whole blocks, as long as so many rows are left."""
        if not self._waiting:
            return
        rows, first = Rows.joined(self._waiting), 0
        try:
            while len(rows) - first >= least:
                stop = min(first + self.session.block_rows, len(rows))
                self._write_block(rows.take(slice(first, stop)))
                first = stop
        except DatabaseLocked:
            kept = max(first, len(rows) - _BLOCKS_KEPT * self.session.block_rows)
            if kept > first:
                self.counted.not_written += kept - first
                rows.consistent[kept] = False
            first = kept
        finally:
            rest = rows.take(slice(first, len(rows)))
            self._waiting = [rest] if len(rest) else []

    def _write_block(self, block: Rows) -> None:
        if self._database.begins and self.session.only_changes:
            # A file can be read by itself: its first row has all that is known.
            own = block.owned.copy()
            own[0] = block.counts[0] >= 0
            block = Rows(block.time_ns, block.consistent, block.cells, own, block.counts)
        self._database.write(self._columns.of(block), len(block))
        counted = self.counted
        counted.rows += len(block)
        counted.inconsistent += int(np.count_nonzero(~block.consistent))
        if counted.first_ns is None:
            counted.first_ns = int(block.time_ns[0])
        counted.last_ns = int(block.time_ns[-1])

    def _forget_texts(self) -> None:
        """Forget the texts that nothing holds any more."""
        held = self._ring.held
        kept = [*self._waiting, *([] if held is None else [held])]
        columns = [rows.cells[:, place] for rows in kept for place in self._text_columns]
        if self._counts is not None:
            columns += [self._counts.cells[place : place + 1] for place in self._text_columns]
        self._texts.keep_only([*columns, *self._samples.text_cells()])


def _at_once(schedules: Sequence[Schedule]) -> bool:
    """Tell whether data sets are passed on as they come: with a task, no interval counts."""
    return all(isinstance(one.instants, Cycles) for one in schedules)
