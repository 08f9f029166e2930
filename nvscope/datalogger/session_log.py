"""SessionLog: one session on its way from telegrams to rows in its files.

::

    telegrams → instants, values at these → changes counted → ring buffer → only changes → blocks → database
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from msgspec import Struct, field
from msgspec.structs import replace

from dissectors.batch import I64, Bool
from nvscope.datalogger.changes import Changed, Counts
from nvscope.datalogger.columns import TableColumns
from nvscope.datalogger.configuration import Session
from nvscope.datalogger.database import Database, DatabaseLocked
from nvscope.datalogger.existing import other_table
from nvscope.datalogger.instants import Cycles, Interval
from nvscope.datalogger.logged import Content, Logged
from nvscope.datalogger.oldest_rows import Deleted
from nvscope.datalogger.ring import Ring
from nvscope.datalogger.rows import Rows
from nvscope.datalogger.samples import Samples
from nvscope.datalogger.texts import MOST_KEPT, Texts
from nvscope.datalogger.turns import Taken, Turns
from nvscope.engine.told import Told
from nvscope.list_key import ListKey
from nvscope.view.rows.defined import DefinedRows, Place

_CELLS_AT_ONCE = 1 << 17
"""So many values are looked at in one go: they stay near the processor."""

_TRIES_AT_END = 3
"""For each block; each waits as long as it does for any (``Database``)."""

_BLOCKS_KEPT = 4
"""While another program holds the file, so many blocks wait for it; then the oldest rows are lost."""


class Schedule(Struct, frozen=True):
    """When values are taken, and which columns are then; None: all.

    ``keys`` are the lists that it needs: what they lose is lost in front of its next row.
    """

    instants: Interval | Cycles
    keys: frozenset[ListKey]
    columns: Bool | None = None


class Counted(Struct):
    """What became of a session: rows that were written, how many of them are not consistent, and what was lost.

    ``overwritten`` are data sets that the ring buffer had no room for, ``not_taken`` those that no time was left for,
    ``late`` telegrams that came when the row of their cycle was made, ``not_written`` rows for which another program
    held the file too long. Of the rows, ``left`` are still there, in
    ``files``, the last written one at the end; none where there was no row. Others made room, by themselves
    (``deleted``, with those that were there before) or in whole files (``removed``, of which ``removed_before`` are of
    earlier runs).
    """

    samples: int = 0
    rows: int = 0
    inconsistent: int = 0
    overwritten: int = 0
    not_taken: int = 0
    late: int = 0
    not_written: int = 0
    first_ns: int | None = None
    last_ns: int | None = None
    files: list[str] = field(default_factory=list)
    left: int = 0
    deleted: Deleted = field(default_factory=Deleted)
    removed: int = 0
    removed_before: int = 0


class SessionLog:
    """Logs the variables of one session.

    ``keys`` are the lists of the places, by number; ``needed`` are those that each schedule needs, ``in_cycles`` those
    whose cycles are rows, and ``sampled`` tells which schedules take samples in an interval. Rows begin when a value is
    known.
    """

    def __init__(
        self, session: Session, logged: Sequence[Logged], schedules: Sequence[Schedule], places: Sequence[Place],
        keys: Sequence[ListKey], database: Database, *, document_style: bool = False,
    ) -> None:  # fmt: skip
        self.session = session
        self.logged = logged
        self.keys = frozenset(one.key for one in logged)
        self.needed = [one.keys for one in schedules]
        self.counted = Counted()
        self._list_of = [keys[place.number] for place in places]
        cycles = [one.instants.places for one in schedules if isinstance(one.instants, Cycles)]
        self.in_cycles = frozenset(self._list_of[place] for own in cycles for place in own)
        self._texts = Texts()
        self._samples = Samples(logged, places, keys, self._texts)
        at_once = max(_CELLS_AT_ONCE // max(len(logged), 1), 1)
        self._turns = Turns([one.instants for one in schedules], self._samples, at_once)
        every = np.ones(len(logged), np.bool_)
        self._taken = np.stack([every if one.columns is None else one.columns for one in schedules])
        self._takes_all = bool(self._taken.all())
        self.sampled = np.array([isinstance(one.instants, Interval) for one in schedules], np.bool_)
        self.has_cycles = not self.sampled.all()
        self._counts = Counts(len(logged), self._samples.dtype) if session.only_changes else None
        # With a task, no interval counts.
        self._ring = Ring(session.capacity, session.publish_ns if self.sampled.any() else None, self.sampled)
        self._changed = Changed(len(logged)) if session.only_changes else None
        self._columns = TableColumns(
            logged, self._texts, raw=session.raw, only_changes=session.only_changes, document_style=document_style
        )
        self._document_style = document_style
        self._begun = False
        self._database = database
        # A row in which all counters are 0 tells of a new beginning, as those of controllers do. Without counters, the
        # first row of each task has to tell that nobody recorded.
        self._interrupted = np.full(len(schedules), database.goes_on and not session.only_changes)
        self._counted_before = np.zeros(len(logged), np.int64)
        self._waiting: list[Rows] = []
        self._losses = [np.empty(0, np.int64)] * len(schedules)
        self._lost = np.zeros(len(schedules), np.bool_)
        self._since: list[int | None] = [None] * len(schedules)
        self._text_columns = [place for place, one in enumerate(logged) if one.content is Content.TEXT]

    def take(self, told: Told, rows: DefinedRows, losses: Sequence[I64], breaks: I64) -> None:
        """Take a batch; ``losses`` are frames for each schedule, behind which something is missing for it.

        ``breaks`` are those behind which it is for all of them, whatever their telegrams say.
        """
        late, behind_late = self._turns.begin(told, rows)
        self.counted.late += len(late)
        if len(late) or len(behind_late):
            losses = self._with_late(late, behind_late, losses)
        losses = [np.sort(np.append(own, breaks)) for own in losses]
        losses = [self._behind_first(number, own) for number, own in enumerate(losses)]
        self._losses = [np.concatenate(both) for both in zip(self._losses, losses, strict=True)]
        for taken in self._turns.take():
            self._sample(taken)
        self._samples.end()
        now_ns = told.until_ns
        if now_ns is not None:
            self._publish(self._ring.take(Rows.none(), now_ns))
        if len(self._texts) > MOST_KEPT:
            self._forget_texts()

    def _behind_first(self, number: int, losses: I64) -> I64:
        """Return the losses behind the first telegram that tells something to a schedule: before, nobody recorded."""
        if self._since[number] is None:
            self._since[number] = self._samples.first_frame(self._taken[number])
        since = self._since[number]
        return losses[:0] if since is None else losses[losses > since]

    def _with_late(self, late: DefinedRows, behind: DefinedRows, losses: Sequence[I64]) -> list[I64]:
        """Return losses where telegrams are missing that came when their row was made.

        What is missing in front of these as well, is missing in front of those behind.
        """
        return [
            np.append(own[~np.isin(own, self._of(late, keys))], self._of(behind, keys))
            for own, keys in zip(losses, self.needed, strict=True)
        ]

    def _of(self, rows: DefinedRows, keys: frozenset[ListKey]) -> I64:
        """Return the frames of telegrams of some lists."""
        return rows.frame[np.array([self._list_of[place] in keys for place in rows.place.tolist()], np.bool_)]

    @property
    def other_table(self) -> str:
        """Why rows are in a table of their own in a file that had others, '' where they are not."""
        return other_table(self._database.found, self._database.table)

    def lose(self) -> None:
        """Let the next row of each task that has had a telegram say that something was lost in front of it."""
        self._lost |= np.array([since is not None for since in self._since], np.bool_)

    def end(self) -> None:
        """Write all that is left, and close the files."""
        nothing = DefinedRows(np.empty(0, np.uint8), *(np.empty(0, np.int64) for _ in range(7)))
        self._samples.begin(nothing)
        for taken in self._turns.end():
            self._sample(taken)
        try:
            self._publish(self._ring.end())
            self._flush()
        finally:
            counted, database = self.counted, self._database
            counted.left, counted.deleted = database.rows_left, database.deleted
            counted.removed, counted.removed_before = len(database.removed), database.removed_before
            counted.files = [*database.closed, database.path] if database.end() else []

    def _flush(self) -> None:
        """Write all rows that wait for their block to be full, as far as nobody holds the file."""
        tries = 0
        while self._waiting and tries < _TRIES_AT_END:
            before = self.counted.rows
            self._write(1)
            tries = 0 if self.counted.rows > before else tries + 1
        self.counted.not_written += sum(len(one) for one in self._waiting)
        self._waiting = []

    def _sample(self, taken: Taken) -> None:
        """Make data sets of what was taken, as far as something is known."""
        consistent = self._consistent(taken.frame, taken.schedule)
        time_ns, cells, known = taken.time_ns, taken.cells, taken.known
        schedule = taken.schedule
        if not self._takes_all:
            own = self._taken[taken.schedule]
            known = own if known is None else known & own
        if known is not None and not (any_known := known.any(axis=1)).all():
            if not any_known.any():
                return
            time_ns, consistent, schedule = time_ns[any_known], consistent[any_known], schedule[any_known]
            cells, known = cells[any_known], known[any_known]
        self.counted.samples += len(cells)
        if self._counts is None:
            counts = np.empty((len(cells), 0), np.int64)
        else:
            cells, counts = self._counts.take(cells, known)
        before = self._ring.overwritten
        self._publish(self._ring.take(Rows(time_ns, consistent, cells, known, counts, schedule)))
        self.counted.overwritten += self._ring.overwritten - before

    def _consistent(self, frame: I64, schedule: I64) -> Bool:
        """Return in front of which data sets nothing of their task was lost, by the frames behind which they are.

        A loss that no data set is behind yet waits for one.
        """
        consistent = np.ones(len(frame), np.bool_)
        for number, losses in enumerate(self._losses):
            if not len(losses) and not self._lost[number]:
                continue
            own = np.flatnonzero(schedule == number)
            if self._lost[number] and len(own):
                consistent[own[0]] = self._lost[number] = False
            place = np.searchsorted(frame[own], losses)
            here = place < len(own)
            consistent[own[place[here]]] = False
            self._losses[number] = losses[~here]
        return consistent

    def _publish(self, rows: Rows | None) -> None:
        """Hand data sets from the ring buffer to the database."""
        if rows is None or not len(rows):
            return
        if not self._begun:
            rows.consistent[0] &= not self._document_style
            self._begun = True
        self._tell_interruption(rows)
        if self._changed is not None:
            rows = self._changed.take(rows)
        if not len(rows):
            return
        self._waiting.append(rows)
        if sum(len(one) for one in self._waiting) >= self.session.block_rows:
            self._write(self.session.block_rows)

    def _tell_interruption(self, rows: Rows) -> None:
        """Let the next row of each task that was interrupted say so."""
        for number in np.flatnonzero(self._interrupted).tolist():
            own = np.flatnonzero(rows.schedule == number)
            if len(own):
                rows.consistent[own[0]] = self._interrupted[number] = False

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
                self._database.make_room()
        except DatabaseLocked:
            kept = max(first, len(rows) - _BLOCKS_KEPT * self.session.block_rows)
            if kept > first:
                self.counted.not_written += kept - first
                rows.consistent[kept] = False
                self._interrupted[:] = not self.session.only_changes
                self._tell_interruption(rows.take(slice(kept, None)))
            first = kept
        finally:
            rest = rows.take(slice(first, len(rows)))
            self._waiting = [rest] if len(rest) else []

    def _write_block(self, block: Rows) -> None:
        counted = self.counted
        starts_anew = self.session.only_changes and self._database.goes_on and not counted.rows
        if self.session.only_changes:
            if not counted.rows:
                block = self._first_block(block)
            if self._database.begins:
                # A file can be read by itself: its first row has all that is known.
                own = block.owned.copy()
                own[0] = block.counts[0] >= 0
                block = replace(block, own=own)
            if self._counted_before.any():
                counts = np.where(block.counts >= 0, block.counts - self._counted_before, -1)
                block = replace(block, counts=counts)
        self._database.write(self._columns.of(block, starts_anew=starts_anew), len(block))
        # In the style of the document, the first row of all has 0, though nothing was lost before it.
        said = block.consistent[1:] if self._document_style and not counted.rows else block.consistent
        counted.rows += len(block)
        counted.inconsistent += int(np.count_nonzero(~said))
        if counted.first_ns is None:
            counted.first_ns = int(block.time_ns[0])
        counted.last_ns = int(block.time_ns[-1])

    def _first_block(self, block: Rows) -> Rows:
        """Return the first rows of all, whose counters begin at 0 with the first of them.

        Where a database is gone on with, what is not known yet is at 0 too: when it is known, that is a change. A row
        that could be taken for one that only goes on says that nobody recorded in front of it.
        """
        counts, database = block.counts[0], self._database
        self._counted_before = counts if database.goes_on else np.maximum(counts, 0)
        if not database.goes_on or (database.had_rows and (counts >= 0).all()):
            return block
        consistent = block.consistent.copy()
        consistent[0] = False
        return replace(block, consistent=consistent)

    def _forget_texts(self) -> None:
        """Forget the texts that nothing holds any more."""
        held = self._ring.held
        kept = [*self._waiting, *([] if held is None else [held])]
        columns = [rows.cells[:, place] for rows in kept for place in self._text_columns]
        columns += self._turns.cells(self._text_columns)
        if self._counts is not None:
            columns += [self._counts.cells[place : place + 1] for place in self._text_columns]
        self._texts.keep_only([*columns, *self._samples.text_cells()])
