"""Turns: what is taken by several schedules in the order of the frames behind which it was taken."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from nvscope.datalogger.instants import Cycles, Instants, Interval
from nvscope.datalogger.samples import Samples
from nvscope.engine.told import Told
from nvscope.expression.typed_columns import Numbers
from nvscope.view.rows.defined import DefinedRows

_LATEST = (1 << 63) - 1


class Taken(Struct, frozen=True):
    """Values at instants: when (n,), behind which frames (n,), by which schedule (n,), and what is known (n, v).

    ``known`` is None where all is.
    """

    time_ns: I64
    frame: I64
    schedule: I64
    cells: Numbers
    known: Bool | None

    def take(self, rows: I64 | slice) -> Taken:
        """Return some of them."""
        known = None if self.known is None else self.known[rows]
        return Taken(self.time_ns[rows], self.frame[rows], self.schedule[rows], self.cells[rows], known)

    @staticmethod
    def joined(parts: Sequence[Taken]) -> Taken:
        """Return them one part behind the other, in the order of their frames; there is one part at least."""
        masks = [np.ones(part.cells.shape, np.bool_) if part.known is None else part.known for part in parts]
        time_ns, frame, schedule, cells = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("time_ns", "frame", "schedule", "cells")
        )
        found = Taken(time_ns, frame, schedule, cells, np.concatenate(masks))
        return found.take(np.lexsort((found.schedule, found.time_ns, found.frame)))


class Turns:
    """Takes the values of a session by its schedules, ``at_once`` at a time.

    That a cycle is over is known when something follows it. What was taken behind its last telegram waits till then:
    the same packets give the same order, however they are cut into batches.
    """

    def __init__(self, schedules: Sequence[Interval | Cycles], samples: Samples, at_once: int) -> None:
        self._schedules = schedules
        self._samples = samples
        self._at_once = at_once
        self._places = [one.places if isinstance(one, Cycles) else frozenset[int]() for one in schedules]
        self._held: Taken | None = None
        self._open: dict[int, Taken] = {}
        self._due_now: Callable[[], Iterator[Taken]]

    def begin(self, told: Told, rows: DefinedRows) -> tuple[DefinedRows, DefinedRows]:
        """Take a batch, and return those of its telegrams that came too late for a cycle: no value is theirs.

        The second ones are those behind which something late is missing.
        """
        only = self._schedules[0]
        if len(self._schedules) == 1 and isinstance(only, Interval):
            self._samples.begin(rows)
            self._due_now = lambda: self._sampled(only.take(told, rows))
            return rows.take(slice(0, 0)), rows.take(slice(0, 0))
        found = [(number, list(one.take(told, rows))) for number, one in enumerate(self._schedules)]
        cycles = [one for one in self._schedules if isinstance(one, Cycles)]
        self._due_now = lambda: self._due(found, told.first_frame)
        if not any(len(one.late) or len(one.lost) for one in cycles):
            self._samples.begin(rows)
            return rows.take(slice(0, 0)), rows.take(slice(0, 0))
        is_late = np.isin(rows.frame, np.concatenate([one.late for one in cycles]))
        is_behind = np.isin(rows.frame, np.concatenate([one.lost for one in cycles]))
        self._samples.begin(rows.take(np.flatnonzero(~is_late)))
        return rows.take(np.flatnonzero(is_late)), rows.take(np.flatnonzero(is_behind))

    def take(self) -> Iterator[Taken]:
        """Yield what is due with the batch that was begun."""
        return self._due_now()

    def _sampled(self, instants: Iterator[Instants]) -> Iterator[Taken]:
        for some in instants:
            yield from self._looked_up(some, np.zeros(len(some.frame), np.int64))

    def end(self) -> Iterator[Taken]:
        """Yield all that is left."""
        yield from self._due([(number, list(one.end())) for number, one in enumerate(self._schedules)], _LATEST)

    def cells(self, columns: Sequence[int]) -> list[Numbers]:
        """Return the values of some columns that are held, to be changed in place."""
        held = [*self._open.values(), *([] if self._held is None else [self._held])]
        return [one.cells[:, column] for one in held for column in columns]

    def _due(self, found: Sequence[tuple[int, Sequence[Instants]]], first_frame: int) -> Iterator[Taken]:
        """Yield what no cycle that may go on stands in front of; ``first_frame`` is that of the batch."""
        none = np.empty(0, np.int64)
        time_ns, frame, sender = (
            np.concatenate([none, *(getattr(one, name) for _, own in found for one in own)])
            for name in ("time_ns", "frame", "sender")
        )
        schedule = np.repeat([number for number, _ in found], [sum(len(one.frame) for one in own) for _, own in found])
        order = np.lexsort((schedule, time_ns, frame))
        instants, schedule = Instants(time_ns, frame, sender).take(order), schedule[order]
        # What holds behind a telegram of an earlier batch was looked up when that was there.
        before = int(np.searchsorted(instants.frame, first_frame))
        early = [self._of_earlier(one) for one in self._looked_up(instants.take(slice(before)), schedule[:before])]
        cycles = [(number, one) for number, one in enumerate(self._schedules) if isinstance(one, Cycles)]
        waiting_for = {frame: (number, sender) for number, one in cycles for frame, sender in one.open_frames.items()}
        waits = sorted(waiting_for)
        until = waits[0] if waits else _LATEST
        held = [] if self._held is None else [self._held]
        waiting = []
        if early or held:
            joined = Taken.joined([*held, *early])
            due = int(np.searchsorted(joined.frame, until))
            for part in range(0, due, self._at_once):
                yield joined.take(slice(part, min(part + self._at_once, due)))
            waiting.append(joined.take(slice(due, None)))
        due = max(int(np.searchsorted(instants.frame, until)), before)
        yield from self._looked_up(instants.take(slice(before, due)), schedule[before:due])
        waiting += self._looked_up(instants.take(slice(due, None)), schedule[due:])
        waiting = [one for one in waiting if len(one.frame)]
        self._held = Taken.joined(waiting) if waiting else None
        fresh = np.array([frame for frame in waits if frame not in self._open], np.int64)
        number, sender = np.array([waiting_for[one] for one in fresh.tolist()], np.int64).reshape(-1, 2).T
        looked_up = {
            int(one.frame[row]): one.take(slice(row, row + 1))
            for one in self._looked_up(Instants(fresh, fresh, sender), number)
            for row in range(len(one.frame))
        }
        self._open = {frame: self._open.get(frame) or looked_up[frame] for frame in waits}

    def _looked_up(self, instants: Instants, schedule: I64) -> Iterator[Taken]:
        """Yield the values at instants, as far as this batch tells them."""
        for part in range(0, len(instants.frame), self._at_once):
            rows = slice(part, part + self._at_once)
            own = instants.take(rows)
            cells, known = self._samples.at(own.frame, self._senders(own, schedule[rows]))
            yield Taken(instants.time_ns[rows], instants.frame[rows], schedule[rows], cells, known)

    def _senders(self, instants: Instants, schedule: I64) -> Mapping[int, I64]:
        """Return by place whose telegrams say what it is at instants, where that is not all the same."""
        return {
            place: np.where(schedule == number, instants.sender, -1)
            for number, places in enumerate(self._places)
            for place in places
        }

    def _of_earlier(self, taken: Taken) -> Taken:
        """Put the values behind telegrams of earlier batches in their place."""
        cells = taken.cells.copy()
        known = np.ones(cells.shape, np.bool_) if taken.known is None else taken.known.copy()
        for frame, own in self._open.items():
            start, stop = np.searchsorted(taken.frame, [frame, frame + 1])
            cells[start:stop] = own.cells
            known[start:stop] = True if own.known is None else own.known
        return Taken(taken.time_ns, taken.frame, taken.schedule, cells, known)
