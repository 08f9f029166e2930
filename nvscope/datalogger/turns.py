"""Turns: what is taken by several schedules in the order of the frames behind which it was taken."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.datalogger.instants import Cycles, Instants, Interval
from nvscope.datalogger.samples import Samples
from nvscope.engine.told import Told
from nvscope.view.rows.defined import DefinedRows


@dataclass(frozen=True, slots=True)
class Taken:
    """Values at instants: when (n,), behind which frames (n,), by which schedule (n,), and what was known (n, v)."""

    time_ns: I64
    frame: I64
    schedule: I64
    cells: I64
    known: Bool

    def take(self, rows: I64 | slice) -> Taken:
        """Return some of them."""
        return Taken(*(getattr(self, one.name)[rows] for one in fields(Taken)))

    @staticmethod
    def joined(parts: Sequence[Taken]) -> Taken:
        """Return them one part behind the other; there is one part at least."""
        return Taken(*(np.concatenate([getattr(part, one.name) for part in parts]) for one in fields(Taken)))


class Turns:
    """Takes the values of a session by its schedules.

    That a cycle is over is known when something follows it. What was taken behind its last telegram waits till then:
    the same packets give the same order, however they are cut into batches.
    """

    def __init__(self, schedules: Sequence[Interval | Cycles], samples: Samples) -> None:
        self._schedules = schedules
        self._samples = samples
        self._held: Taken | None = None
        self._open: dict[int, tuple[I64, Bool]] = {}

    def take(self, told: Told, rows: DefinedRows) -> Iterator[Taken]:
        """Yield what is due with a batch, whose telegrams the samples have begun."""
        if len(self._schedules) == 1 and isinstance(self._schedules[0], Interval):
            for instants in self._schedules[0].take(told, rows):
                yield self._valued(instants, 0)
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

    def cells(self, columns: Sequence[int]) -> list[I64]:
        """Return the values of some columns that are held, to be changed in place."""
        held = [] if self._held is None else [self._held.cells[:, column] for column in columns]
        return held + [cells[column : column + 1] for cells, _ in self._open.values() for column in columns]

    def _valued(self, instants: Instants, number: int) -> Taken:
        cells, known = self._samples.at(instants.frame)
        # What holds behind a telegram of an earlier batch was looked up when that was there.
        for frame, (own, own_known) in self._open.items():
            start, stop = np.searchsorted(instants.frame, [frame, frame + 1])
            cells[start:stop], known[start:stop] = own, own_known
        return Taken(instants.time_ns, instants.frame, np.full(len(instants.frame), number), cells, known)

    def _due(self, taken: Iterable[Taken]) -> Iterator[Taken]:
        """Yield what no cycle that may go on was begun in front of."""
        parts = list(taken)
        waits = sorted({frame for one in self._schedules if isinstance(one, Cycles) for frame in one.open_frames})
        fresh = np.array([frame for frame in waits if frame not in self._open], np.int64)
        cells, known = self._samples.at(fresh)
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
