"""One task of a table as an audit reads it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dissectors.batch import Bool
from nvscope.datalogger.audit.chunk import Chunk
from nvscope.datalogger.audit.gaps import Gaps, SetBack, are_steady, limit_ns
from nvscope.datalogger.audit.intervals import Intervals
from nvscope.datalogger.audit.kept_gaps import KeptGaps, Late, Yardstick
from nvscope.datalogger.audit.lacking_rows import LackingRows
from nvscope.datalogger.audit.open_part import OpenPart, floors_ns, most_kept
from nvscope.datalogger.audit.rhythms import Rhythms
from nvscope.datalogger.audit.tasks import TaskRows


@dataclass(slots=True)
class Task:
    """What is known of the rows of one task: its intervals, how many rows, and the last of them.

    ``asked_ns`` is what the configuration says of them. ``intervals`` are those of all parts that are over. ``losses``
    are those that the rows of all tasks had told up to the last one: data that is lost is lost to each of them.
    ``has_passed``: what turned out to be late was not kept.
    """

    asked_ns: int | None
    intervals: Intervals = field(default_factory=Intervals)
    kept: KeptGaps = field(default_factory=KeptGaps)
    own_rows: int = 0
    lacking: LackingRows = field(default_factory=LackingRows)
    timed_rows: int = 0
    time_ns: int = 0
    stretch: int = -1
    local: bool = False
    file: int = -1
    losses: int = 0
    is_blank: bool = False
    has_passed: bool = False
    set_back: list[SetBack] = field(default_factory=list)
    _open: OpenPart = field(init=False)

    def __post_init__(self) -> None:
        self._open = OpenPart(self.asked_ns)

    @property
    def rows(self) -> int:
        """How many rows it has, with those of no value that it lacks."""
        return self.own_rows + self.lacking.count

    def count(self, chunk: Chunk, own: TaskRows) -> None:
        """Take how many rows of a chunk are its own; of rows without a value, those that it lacks."""
        rows = np.arange(len(chunk)) if own.rows is None else own.rows
        blank = rows[:0] if own.blank is None else rows[own.blank[rows]]
        known = rows if own.blank is None else rows[~own.blank[rows]]
        self.own_rows += len(known)
        timed = chunk.times.valid
        if not timed.all():
            self.own_rows += int(np.count_nonzero(~timed[blank]))
            known, blank = known[timed[known]], blank[timed[blank]]
        self.lacking.take(chunk.time_ns, known, blank)

    def take(self, gaps: Gaps, forward: Bool, begins: Bool, in_doubt: Bool | None, tasks: int) -> None:
        """Take its next rows as what may be gaps in front of them, which are some where time goes ``forward``.

        ``begins`` tells with which rows parts begin: behind a loss that is told, or where rows cannot be read. Rows in
        front of which an interval is ``in_doubt`` may be of others; there are so many ``tasks``.
        """
        edges = np.flatnonzero(begins)
        if not len(edges):
            self._open.take(*_some(gaps, in_doubt, forward), tasks)
            return
        part = np.cumsum(begins) - 1
        last = len(edges) - 1
        own = forward & ~begins
        self._open.take(*_some(gaps, in_doubt, own & (part < 0)), tasks)
        first = self._close()
        # Parts that end here, too, are looked at all at once: there may be as many as rows.
        within = own & (part >= 0) & (part < last)
        (whole, in_doubt_of), place = _some(gaps, in_doubt, within), part[within]
        self.intervals.take(whole.length_ns, in_doubt_of)
        rhythms = Rhythms.of_parts(whole.length_ns, place, last, in_doubt_of)
        self.kept.regularity.take(rhythms)
        late = whole.length_ns > floors_ns(rhythms.median_ns, self.asked_ns)[place]
        self.kept.take(whole.take(late), place[late], rhythms)
        told = np.flatnonzero(forward[edges])
        self.kept.take_told(gaps.take(edges[told]), told, Rhythms.joined([first, rhythms]))
        self.intervals.take_told(gaps.length_ns[edges[told]])
        self._open = OpenPart(self.asked_ns)
        self._open.take(*_some(gaps, in_doubt, own & (part == last)), tasks)

    def end(self) -> None:
        """Take that there are no more rows."""
        self.kept.take_told(Gaps.joined([]), np.zeros(0, np.int64), self._close())
        self._open = OpenPart(self.asked_ns)

    def yardstick(self, *, alone: bool) -> Yardstick:
        """Return what its rows are judged by so far; ``alone``: the table has no other task.

        The configuration does not say how long the cycle of each task is: of several, rows that come more often, or
        less often, than it asks for are judged by how they come. Rows that come irregularly are judged where it is
        theirs alone.
        """
        intervals = Intervals.joined(self.intervals, self._open.intervals) if self._open.is_begun else self.intervals
        median_ns = intervals.median_ns
        if median_ns is None or (alone and self.asked_ns is not None):
            return Yardstick(None if median_ns is None else self.asked_ns, self.asked_ns)
        if not intervals.is_regular:
            return Yardstick(None, self.asked_ns)
        asked_ns = self.asked_ns or 0
        return Yardstick(median_ns if limit_ns(median_ns) < asked_ns else max(asked_ns, median_ns), self.asked_ns)

    def late(self, by: Yardstick) -> tuple[Late, Late]:
        """Return the rows that come late of those that were taken, untold and told; they are forgotten then."""
        return self.kept.late(by, self.set_back)

    def passes(self, by: Yardstick) -> bool:
        """Return whether gaps may have passed, when all is decided."""
        is_known = by.interval_ns is not None or self.kept.regularity.tells
        return not by.is_asked and (self.has_passed or (self.kept.passed > 0 and is_known))

    def late_so_far(self, tasks: int, *, alone: bool) -> tuple[Late, Late] | None:
        """Return those up to here where so much may be late that it has to be decided now."""
        is_full = self._open.is_full(tasks)
        if not is_full and not self.kept.is_full and self.kept.count <= most_kept(tasks):
            return None
        by = self.yardstick(alone=alone)
        gaps = self._open.gaps() if is_full else None
        rhythm = Rhythms.of(self._open.intervals)
        if gaps is not None:
            if not by.is_asked:
                # Rows that come so from here on may be most of all in the end, and nothing is missing then.
                steady = are_steady(gaps)
                self.has_passed |= bool(steady.any())
                gaps = gaps.take(~steady)
            self.kept.take(gaps, np.zeros(len(gaps), np.int64), rhythm)
            if not by.knows(rhythm):
                self._open.give_up()
        return self.kept.late(by, self.set_back, rhythm)

    def in_doubt(self, blank: Bool | None, rows: int) -> Bool | None:
        """Return in front of which of its next rows an interval begins or ends with one that has no value.

        None: in front of none.
        """
        was_blank, self.is_blank = self.is_blank, blank is not None and bool(blank[-1])
        if blank is None:
            blank = np.zeros(rows, np.bool_) if was_blank else None
        return None if blank is None else blank | np.append(was_blank, blank[:-1])

    def go_on_with(self, other: Task) -> None:
        """Have the last row of another task be its own."""
        self.time_ns, self.stretch, self.local, self.file = other.time_ns, other.stretch, other.local, other.file
        self.losses, self.is_blank = other.losses, other.is_blank

    def _close(self) -> Rhythms:
        """Take that the part that is read ends here, and return its rhythm."""
        gaps = self._open.gaps()
        rhythm = Rhythms.of(self._open.intervals)
        self.has_passed |= bool(rhythm.is_regular[0]) and self._open.has_passed(int(rhythm.median_ns[0]))
        self.intervals.join(self._open.intervals)
        self.kept.regularity.take(rhythm)
        self.kept.take(gaps, np.zeros(len(gaps), np.int64), rhythm)
        return rhythm


def _some(gaps: Gaps, in_doubt: Bool | None, rows: Bool) -> tuple[Gaps, Bool | None]:
    if rows.all():
        return gaps, in_doubt
    return gaps.take(rows), None if in_doubt is None else in_doubt[rows]
