"""One table of a series audited: rows in, chunk by chunk and file by file; findings and figures out."""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.datalogger.row_times import Stamp
from dissectors.datalogger.tables import LogTable
from nvscope.datalogger.audit import topics
from nvscope.datalogger.audit.change_judge import ChangeJudge
from nvscope.datalogger.audit.chunk import Chunk
from nvscope.datalogger.audit.coverage import Coverage
from nvscope.datalogger.audit.finding import Finding, Notes, Topic
from nvscope.datalogger.audit.gaps import Gaps, SetBack
from nvscope.datalogger.audit.grouping import Grouping
from nvscope.datalogger.audit.kept_gaps import Late
from nvscope.datalogger.audit.row_ids import RowIds
from nvscope.datalogger.audit.stamps import Stamps
from nvscope.datalogger.audit.task import Task
from nvscope.datalogger.audit.tasks import TaskRows, Tasks
from nvscope.datalogger.audit.time_strip import Mark
from nvscope.datalogger.audit.values import Figures, Values
from nvscope.findings.datalogger import SERIES_BROKEN
from nvscope.units import duration

_HOUR_NS = 3_600_000_000_000
_MOST_SET_BACK = 10_000
"""So many settings of the clock of a task are looked at one by one."""

_UNTIMED = 1 << 32
"""Added to the number of a stretch for each row in front that has no time."""


class TableAudit:
    """Audits the rows of one table, of one file of a series after the other.

    ``asked_ns`` is the interval by the configuration, which says nothing of variables that are taken ``in_cycles`` of
    lists; ``known`` are the tasks that an audit of the same rows found out.
    """

    def __init__(
        self, table: LogTable, encoding: str, asked_ns: int | None, known: Grouping | None = None,
        in_cycles: Callable[[str], bool] | None = None,
    ) -> None:  # fmt: skip
        self.table = table
        self.names = tuple(one.name for one in table.variables)
        self.rows = self.restarts = 0
        self.losses = 0
        """How many rows say that data was lost before them, the first of all aside."""
        self.may_lack = False
        """Whether so much came late that what of it is a gap was decided before that could be known."""
        self.coverage = Coverage()
        self._tasks = Tasks(table, known)
        self._ids = RowIds()
        self._values = Values(len(table.variables), encoding)
        self._judge = ChangeJudge(table, self._values) if table.only_changes else None
        self._asked_ns, self._known = asked_ns, known
        self._in_cycles = {place for place, name in enumerate(self.names) if in_cycles is not None and in_cycles(name)}
        self._of_task: dict[int, Task] = {}
        self._have_joined = False
        self._stretch, self._last_lost = 0, False
        self._notes: list[Notes] = []
        self._files: list[str] = []
        self._stamps = Stamps()
        self.overlaps: dict[int, int] = {}
        """By how much a file, by its number here, begins before the one before it ends."""
        self._begun = False
        self._before_ns: int | None = None
        self._untimed_before = self._losses = 0
        self._uncovered: list[tuple[I64, I64]] = []
        """Rows of a chunk that say that data was lost, and the times of the rows before them."""

    def begin_file(self, path: str, encoding: str) -> None:
        """Say which file the next rows are of."""
        if self._judge is not None and self._notes:
            self._judge.begin_file(self._notes[-1])
        self._files.append(path)
        self._notes.append(Notes())
        self._values.use(encoding)

    def end_file(self, *, damaged: bool) -> None:
        """Say that all rows of a file were read that can be; those of a damaged one may lack for that."""
        if damaged:
            self._notes[-1].drop(topics.DELETED)

    def take(self, chunk: Chunk) -> None:
        """Judge some rows."""
        notes = self._notes[-1]
        timed = chunk.times.valid
        self.rows += len(chunk)
        self.coverage.take(chunk.time_ns if timed.all() else chunk.time_ns[timed])
        self._stamps.take(chunk, timed, notes)
        self._look_at_intervals(chunk, timed, notes)
        self._ids.take(chunk, notes)
        lost = np.flatnonzero(chunk.lost)
        if not self._begun and len(lost) and not lost[0]:
            lost = lost[1:]  # there is nothing before it: documents have 0 there, controllers 1
        if len(lost):
            self.losses += len(lost)
            notes.of(topics.LOST).add(chunk.rowid[lost], chunk.time_ns[lost], timed[lost])
        if len(chunk.unsaid):
            rows = chunk.unsaid
            notes.of(topics.UNSAID).add(chunk.rowid[rows], chunk.time_ns[rows], timed[rows])
        if chunk.begins_file and self.overlaps_now and self._judge is not None:
            # What a file repeats of the one before is no change.
            self._judge.forget()
        if self._judge is not None:
            self._judge.take(chunk, notes)
            self._note_uncovered(chunk)
            self._take_restarts(self._judge)
        else:
            self._look_at_values(chunk)
        self._begun = True
        if timed.any():
            self._before_ns = int(chunk.time_ns[timed][-1])

    def decide(self) -> None:
        """Say that all rows were taken: whether they have to be looked at again is known then."""
        if self._judge is None:
            for number, task in self._of_task.items():
                task.end()
                by = task.yardstick(alone=self._beside(number) == 1)
                self._note_late(*task.late(by))
                self.may_lack |= task.passes(by)

    def end(self) -> list[Finding]:
        """Return what was found, by file, when that is decided."""
        if self._judge is not None and self._notes:
            self._judge.end(self._notes[-1])
            self._take_restarts(self._judge)
        groupings = self._tasks.grouping.all if self._judge is None else ()
        for number, figures in enumerate(self._values.figures):
            figures.rows = self.rows
            if self._judge is None:
                own = {int(tasks[number]) for tasks in groupings} & set(self._of_task)
                figures.rows = sum(self._of_task[task].rows for task in own) if own else self.rows
                figures.unknown = figures.rows - figures.stored
        found: list[Finding] = []
        for path, notes in zip(self._files, self._notes, strict=True):
            if any(map(notes.has, (topics.GAP, topics.SLOWER, topics.MISSED))):
                notes.drop(topics.DELETED)  # that rows are missing is said, and for how long
            notes.drop(topics.OF_FORM[self._stamps.usual])
            found += notes.findings(path, self.table.name, self.names)
        found += [
            Finding(
                SERIES_BROKEN, SERIES_BROKEN.severity,
                f"It begins {duration(by_ns)} before {os.path.basename(self._files[number - 1])} ends.",
                self._files[number], self.table.name,
            )
            for number, by_ns in self.overlaps.items()
        ]  # fmt: skip
        return found

    def lacks_in_front_of(self, path: str) -> bool:
        """Return whether rows or changes are missing in front of the first row of the file that was read last."""
        own = self._notes[-1] if self._files[-1:] == [path] else Notes()
        return own.begins_with(topics.GAP) or own.begins_with(topics.MISSED)

    @property
    def figures(self) -> list[Figures]:
        """The figures of each variable, in the order of the table."""
        return self._values.figures

    @property
    def forms(self) -> set[str]:
        """The forms of its timestamps: ``iso``, ``raw``."""
        return self._stamps.forms

    @property
    def untimed(self) -> int:
        """How many rows have no time that can be told."""
        return self._stamps.untimed

    @property
    def task_count(self) -> int:
        """How many tasks there are rows of at a time, as far as can be told."""
        return max(map(self._beside, self._of_task), default=1) if self.rows else 0

    @property
    def interval_ns(self) -> int | None:
        """The interval that rows are judged by: of several tasks, the shortest. None of a table of changes."""
        if self._judge is not None:
            return None
        by = (task.yardstick(alone=self._beside(number) == 1) for number, task in self._of_task.items())
        return min((one.interval_ns for one in by if one.interval_ns is not None), default=None)

    @property
    def part_intervals_ns(self) -> tuple[int, int] | None:
        """The shortest and the longest interval that parts are judged by where the table has none."""
        if self._judge is not None or self.interval_ns is not None:
            return None
        of_parts = [task.kept.regularity for task in self._of_task.values() if task.kept.regularity.tells]
        least, most = (
            [one.least_ns for one in of_parts if one.least_ns],
            [one.most_ns for one in of_parts if one.most_ns],
        )
        return (min(least), max(most)) if least and most else None

    @property
    def usual_ns(self) -> int | None:
        """The interval at which the rows of a single task come, None where that is not known or not regular, or not
        what the configuration says."""
        if self._judge is not None or len(self._of_task) != 1:
            return None
        ((group, task),) = self._of_task.items()
        if group in self._in_cycles:
            return None
        return task.intervals.median_ns if task.intervals.is_regular else None

    @property
    def needs_another_look(self) -> Grouping | None:
        """The tasks to audit the same rows by again, where they became known too late; None where all is well."""
        if self._judge is not None or self._known is not None:
            return None
        grouping = self._tasks.grouping
        return grouping if self._have_joined or grouping.apart or self._tasks.has_erred else None

    @property
    def overlaps_now(self) -> bool:
        """Whether the file whose rows came last begins before the one in front of it ends."""
        return len(self._files) - 1 in self.overlaps

    @property
    def covered(self) -> float | None:
        """The share of the time from the first row to the last in which nothing is missing, None where that is none."""
        return self.coverage.share

    def _look_at_intervals(self, chunk: Chunk, timed: Bool, notes: Notes) -> None:
        # Where several tasks begin, each says so in a row of its own.
        begins = chunk.lost & ~np.append(self._last_lost, chunk.lost[:-1])
        begins |= np.diff(chunk.stretch, prepend=self._stretch) != 0
        self._stretch, self._last_lost = int(chunk.stretch[-1]), bool(chunk.lost[-1])
        of_tasks = list(self._tasks.rows(chunk, np.flatnonzero(begins)))
        for gone, other in self._tasks.merged:
            self._join(gone, other)
        # A row without a time leaves open how long it was to the next one.
        stretch = chunk.stretch + self._untimed_before * _UNTIMED
        if not timed.all():
            stretch += np.cumsum(~timed) * _UNTIMED
            self._untimed_before = self.untimed
        losses = self._losses + np.cumsum(chunk.lost) if chunk.lost.any() else None
        self._losses = self._losses if losses is None else int(losses[-1])
        for one in of_tasks:
            task, rows = self._task_of(one), one.rows
            task.count(chunk, one)
            own = np.flatnonzero(timed) if rows is None else rows[timed[rows]]
            if len(own):
                if self._judge is None and task.stretch < 0 and chunk.lost[own[0]]:
                    self._note_late_task(chunk, int(own[0]), timed)
                self._look_at_task(task, chunk, one, own, stretch, None if losses is None else losses[own], notes)
            late = task.late_so_far(len(self._of_task), alone=self._beside(one.task) == 1)
            if late is not None:
                self._note_late(*late)

    def _task_of(self, one: TaskRows) -> Task:
        """Return the task of some rows; what is known of the last row is that of the tasks that it goes on with."""
        if one.task not in self._of_task:
            self._of_task[one.task] = self._new_task(one.task)
        task = self._of_task[one.task]
        behind = [self._of_task[number] for number in one.behind if number in self._of_task]
        if behind:
            task.go_on_with(max(behind, key=lambda other: (other.file, other.time_ns)))
        return task

    def _note_late_task(self, chunk: Chunk, row: int, timed: Bool) -> None:
        """Count the time in front of the first row of a task that says that data was lost, behind rows of others."""
        before = np.flatnonzero(timed[:row])
        before_ns = int(chunk.time_ns[before[-1]]) if len(before) else self._before_ns
        if before_ns is not None and before_ns < chunk.time_ns[row]:
            self.coverage.miss(Mark.TOLD, np.array([before_ns]), chunk.time_ns[[row]])

    def _look_at_task(
        self, task: Task, chunk: Chunk, of_task: TaskRows, rows: I64, stretch: I64, losses: I64 | None, notes: Notes
    ) -> None:  # fmt: skip
        time_ns, of_stretch = chunk.time_ns[rows], stretch[rows]
        before_ns = np.concatenate([[task.time_ns], time_ns[:-1]])
        follows = of_stretch == np.concatenate([[task.stretch], of_stretch[:-1]])
        length_ns = time_ns - before_ns
        local = chunk.times.stamp[rows] == Stamp.RAW_LOCAL
        if local.any():
            # The clocks of local time are set by an hour twice a year.
            was_local = np.concatenate([[task.local], local[:-1]])
            hour = np.abs(np.abs(length_ns) - _HOUR_NS) < _HOUR_NS // 60
            follows &= ~(local & was_local & hour & (length_ns < 0))
        current, first = len(self._files) - 1, task.timed_rows
        task.timed_rows += len(rows)
        back = follows & (length_ns < 0)
        if task.file != current and task.file >= 0 and back[0]:
            # Files that overlap are told as such.
            back[0] = False
            self.overlaps[current] = max(self.overlaps.get(current, 0), int(-length_ns[0]))
        if back.any():
            places = np.flatnonzero(back)
            notes.of(topics.RUN_BACK).add(
                chunk.rowid[rows[places]], time_ns[places], np.ones(len(places), np.bool_), -length_ns[places]
            )
            for place in places[: _MOST_SET_BACK - len(task.set_back)].tolist():
                task.set_back.append(SetBack(first + place, int(before_ns[place]), int(time_ns[place])))
                self.coverage.strip.mark(Mark.CLOCK_SET, int(time_ns[place]), int(time_ns[place]))
        if self._judge is None:
            forward = follows & (length_ns > 0)
            number = first + np.arange(len(rows))
            if losses is None:
                told = np.zeros(len(rows), np.bool_)
                told[0] = self._losses > task.losses
            else:
                told = np.diff(losses, prepend=task.losses) > 0
            gaps = Gaps(length_ns, before_ns, chunk.rowid[rows], number, np.full(len(rows), current), told)
            in_doubt = task.in_doubt(None if of_task.blank is None else of_task.blank[rows], len(rows))
            task.take(gaps, forward, told | ~follows, in_doubt, len(self._of_task))
        else:
            places = np.flatnonzero(chunk.lost[rows] & follows & (length_ns > 0))
            if len(places):
                self._uncovered.append((rows[places], before_ns[places]))
        if not follows.all():
            before = np.concatenate([[task.stretch], of_stretch[:-1]])
            unread = (before >= 0) & (before % _UNTIMED != of_stretch % _UNTIMED) & (length_ns > 0)
            self.coverage.miss(Mark.UNREAD, before_ns[unread], time_ns[unread])
        task.time_ns, task.stretch = int(time_ns[-1]), int(of_stretch[-1])
        task.local, task.file = bool(local[-1]), current
        task.losses = self._losses if losses is None else int(losses[-1])

    def _take_restarts(self, judge: ChangeJudge) -> None:
        for start in judge.restarts:
            self.restarts += 1
            self.coverage.start(start.rows[0])
        judge.restarts.clear()

    def _note_uncovered(self, chunk: Chunk) -> None:
        """Count what is not covered in a table of changes: only what the logger says is known there.

        Time in front of a new start is counted as that in which the logger was off.
        """
        assert self._judge is not None
        started = [row.rowid for start in self._judge.restarts for row in start.rows]
        for own, own_before_ns in self._uncovered:
            other = ~np.isin(chunk.rowid[own], started)
            self.coverage.miss(Mark.TOLD, own_before_ns[other], chunk.time_ns[own[other]])
        self._uncovered.clear()

    def _new_task(self, number: int) -> Task:
        groupings = self._known.all if self._known is not None else ()
        variables = {number, *(at for tasks in groupings for at in np.flatnonzero(tasks == number).tolist())}
        return Task(None if variables & self._in_cycles else self._asked_ns)

    def _beside(self, number: int) -> int:
        """Return how many tasks there are rows of while there are of one, with that one."""
        groupings = self._known.all if self._known is not None else ()
        beside = [self._of_task.keys() & set(tasks.tolist()) for tasks in groupings if number in tasks]
        return max(map(len, beside), default=len(self._of_task))

    def _note_late(self, untold: Late, told: Late) -> None:
        """Note what turned out to be late."""
        slower = untold.slower_ns > 0
        self._note_gaps(topics.GAP, untold.gaps.take(~slower), untold.gaps.length_ns[~slower])
        self._note_gaps(topics.SLOWER, untold.gaps.take(slower), untold.slower_ns[slower])
        for mark, late in ((Mark.TOLD, told), (Mark.GAP, untold)):
            gaps = late.gaps
            self.coverage.miss(mark, gaps.before_ns, gaps.before_ns + gaps.length_ns, late.interval_ns)

    def _note_gaps(self, topic: Topic, gaps: Gaps, amount: I64) -> None:
        for file in dict.fromkeys(gaps.file.tolist()):
            rows = gaps.file == file
            own = gaps.take(rows)
            self._notes[file].of(topic).add(
                own.rowid, own.before_ns + own.length_ns, np.ones(len(own), np.bool_), amount[rows]
            )

    def _join(self, gone: int, other: int) -> None:
        task = self._of_task.pop(gone, None)
        if task is None:
            return
        # Their intervals were others: these are found when the rows are read again, by what is known then.
        self._have_joined = True
        kept = self._of_task.setdefault(other, self._new_task(other))
        kept.own_rows += task.rows
        kept.timed_rows += task.timed_rows
        kept.set_back += task.set_back
        if (task.file, task.time_ns) > (kept.file, kept.time_ns):
            kept.go_on_with(task)

    def _look_at_values(self, chunk: Chunk) -> None:
        """Take the values of a table that stores all of them."""
        for number, variable in enumerate(self.table.variables):
            if chunk.rows.is_empty(variable.column):
                continue
            filled = chunk.rows.filled(variable.column)
            rows = None if filled.all() else np.flatnonzero(filled)
            self._values.take(number, chunk, rows, chunk.rows.cells(variable.column, rows))
