"""One task of a table as an audit reads it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.datalogger.audit import topics
from nvscope.datalogger.audit.chunk import Chunk
from nvscope.datalogger.audit.finding import Topic
from nvscope.datalogger.audit.intervals import LEAST_ALIKE, Gaps, Intervals, SetBack, are_late
from nvscope.datalogger.audit.rhythms import OF_TABLE, Parts, Rhythms
from nvscope.datalogger.audit.tasks import TaskRows
from nvscope.datalogger.audit.unknown_rows import lacking_rows


@dataclass(slots=True)
class Task:
    """What is known of the rows of one task: its intervals, how many rows, and the last of them.

    ``losses`` are those that the rows of all tasks had told up to that one: data that is lost is lost to each of them.
    """

    intervals: Intervals
    rhythms: Rhythms | None = None
    parts: Parts = field(default_factory=Parts)
    rows: int = 0
    timed_rows: int = 0
    time_ns: int = 0
    stretch: int = -1
    local: bool = False
    file: int = -1
    losses: int = 0
    cycle_ns: int | None = None
    set_back: list[SetBack] = field(default_factory=list)

    def count(self, chunk: Chunk, own: TaskRows) -> None:
        """Take how many rows of a chunk are its own; of rows without a value, those that it lacks."""
        rows, blank = own.rows, own.blank
        if rows is None:
            self.rows += len(chunk)
        elif blank is None or not (chunk.times.valid.all() and chunk.is_one_stretch):
            self.rows += len(rows)
        else:
            known, others = rows[~blank[rows]], rows[blank[rows]]
            lacking, self.cycle_ns = lacking_rows(chunk.time_ns, known, others, self.cycle_ns)
            self.rows += len(known) + lacking

    def take(self, gaps: Gaps, forward: Bool, begins: Bool) -> None:
        """Take its next rows as what may be gaps in front of them, which are some where time goes ``forward``.

        ``begins`` tells with which rows parts begin: behind a loss that is told, or where rows cannot be read.
        """
        if self.rhythms is not None:
            self.rhythms.take(gaps, self.parts.count + np.cumsum(begins) - 1, forward & ~begins)
        self.parts.begin(gaps.number[begins])
        self.intervals.take(gaps if forward.all() else gaps.take(forward))

    def go_on_with(self, other: Task) -> None:
        """Have the last row of another task be its own."""
        self.time_ns, self.stretch, self.local, self.file = other.time_ns, other.stretch, other.local, other.file
        self.losses = other.losses

    def judged(self, untold: Gaps, interval_ns: int, *, is_asked: bool) -> Iterator[tuple[Topic, Gaps, I64]]:
        """Yield what rows are missing of those that nobody tells of, each with an amount, and what to say of it.

        The rhythm of a part excuses nothing where the configuration ``is_asked``: that holds for all rows.
        """
        if self.rhythms is None:
            self.parts.doubt(untold, though_it_is_one=is_asked)
            yield topics.GAP, untold, untold.length_ns
            return
        part = self.parts.of(untold)
        if is_asked:
            own_ns = self.rhythms.own_ns(part, least=LEAST_ALIKE)
            slower = are_late(own_ns, np.full_like(own_ns, interval_ns))
            yield topics.GAP, untold.take(~slower), untold.length_ns[~slower]
            yield topics.SLOWER, untold.take(slower), own_ns[slower]
            return
        own_ns = self.rhythms.own_ns(part)
        late = (own_ns > 0) & are_late(untold.length_ns, own_ns)
        gaps = untold.take(late | (own_ns == OF_TABLE))
        yield topics.GAP, gaps, gaps.length_ns
