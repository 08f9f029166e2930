"""Turns: what is taken by several schedules in the order of the frames behind which it was taken."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.datalogger.instants import Cycles, Instants, Interval
from nvscope.datalogger.samples import Samples
from nvscope.engine.told import Told
from nvscope.expression.typed_columns import Numbers
from nvscope.view.rows.defined import DefinedRows


@dataclass(frozen=True, slots=True)
class Taken:
    """Values at instants: when (n,), behind which frames (n,), by which schedule (n,), and what was known (n, v).

    ``known`` is None where all was.
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
        """Return them one part behind the other; there is one part at least."""
        time_ns, frame, schedule, cells = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("time_ns", "frame", "schedule", "cells")
        )
        whole = all(part.known is None for part in parts)
        return Taken(time_ns, frame, schedule, cells, None if whole else np.concatenate([_known(one) for one in parts]))


def _known(taken: Taken) -> Bool:
    return np.ones(taken.cells.shape, np.bool_) if taken.known is None else taken.known


class Turns:
    """Takes the values of a session by its schedules.

    That a cycle is over is known when something follows it. What was taken behind its last telegram waits till then:
    the same packets give the same order, however they are cut into batches. Where nothing has to wait, no more than
    ``at_once`` are looked at in one go.
    """

    def __init__(self, schedules: Sequence[Interval | Cycles], samples: Samples, at_once: int) -> None:
        self._schedules = schedules
        self._at_once = at_once
        self._none_waits = len(schedules) == 1 and not (isinstance(schedules[0], Cycles) and schedules[0].waits)
        self._samples = samples
        self._held: Taken | None = None
        self._open: dict[int, tuple[Numbers, Bool]] = {}

    def take(self, told: Told, rows: DefinedRows) -> Iterator[Taken]:
        """Yield what is due with a batch, whose telegrams the samples have begun."""
        if self._none_waits:
            for instants in self._schedules[0].take(told, rows):
                for part in range(0, len(instants.frame), self._at_once):
                    yield self._valued(instants.take(slice(part, part + self._at_once)), 0)
            return
        yield from self._due(
            self._valued(instants, number)
            for number, one in enumerate(self._schedules)
            for instants in one.take(told, rows)
        )

    def end(self) -> Iterator[Taken]:
        """Yield all that is left."""
        yield from self._due(
            self._valued(instants, number) for number, one in enumerate(self._schedules) for instants in one.end()
        )

    def cells(self, columns: Sequence[int]) -> list[Numbers]:
        """Return the values of some columns that are held, to be changed in place."""
        held = [] if self._held is None else [self._held.cells[:, column] for column in columns]
        return held + [cells[column : column + 1] for cells, _ in self._open.values() for column in columns]

    def _valued(self, instants: Instants, number: int) -> Taken:
        cells, known = self._samples.at(instants.frame)
        if self._open and known is None:
            known = np.ones(cells.shape, np.bool_)
        # What holds behind a telegram of an earlier batch was looked up when that was there.
        for frame, (own, own_known) in self._open.items():
            start, stop = np.searchsorted(instants.frame, [frame, frame + 1])
            cells[start:stop] = own
            if known is not None:
                known[start:stop] = own_known
        return Taken(instants.time_ns, instants.frame, np.full(len(instants.frame), number), cells, known)

    def _due(self, taken: Iterable[Taken]) -> Iterator[Taken]:
        """Yield what no cycle that may go on was begun in front of."""
        parts = list(taken)
        waits = sorted({frame for one in self._schedules if isinstance(one, Cycles) for frame in one.open_frames})
        fresh = np.array([frame for frame in waits if frame not in self._open], np.int64)
        cells, known = self._samples.at(fresh)
        if known is None:
            known = np.ones(cells.shape, np.bool_)
        values = {frame: (cells[row], known[row]) for row, frame in enumerate(fresh.tolist())}
        self._open = {frame: self._open.get(frame) or values[frame] for frame in waits}
        if self._held is not None:
            parts.insert(0, self._held)
            self._held = None
        if not parts:
            return
        joined = Taken.joined(parts)
        joined = joined.take(np.lexsort((joined.schedule, joined.time_ns, joined.frame)))
        due = int(np.searchsorted(joined.frame, waits[0])) if waits else len(joined.frame)
        if due < len(joined.frame):
            self._held = joined.take(slice(due, None))
        if due:
            yield joined.take(slice(0, due))
