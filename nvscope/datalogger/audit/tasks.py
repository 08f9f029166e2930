"""Tasks: which variables are sampled together, and which rows are theirs.

In a row of one task, the columns of the others are NULL. Which variables belong together stands nowhere; those that
are stored in one row do. A value that is no number is NULL, too, so rows of one task need not have the same columns.
Behind a loss that is told, a logger may go on with other tasks; so groups are those of a part of the table.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from dissectors.datalogger.row_shapes import RowShapes
from dissectors.datalogger.tables import LogTable
from nvscope.datalogger.audit.chunk import Chunk
from nvscope.datalogger.audit.grouping import Grouping
from nvscope.datalogger.audit.part_groups import PartGroups
from nvscope.tracker.datalogger.variable_groups import VariableGroups


class TaskRows(Struct, frozen=True):
    """Rows of a chunk that are of one task, None for all.

    Of rows without any value nobody knows whose they are: each may be a sample of every task. ``blank`` tells which
    rows of the chunk are such ones, None where there is one task only. ``behind`` are the tasks of its variables up to
    here, where these have been others.
    """

    task: int
    rows: I64 | None
    blank: Bool | None = None
    behind: tuple[int, ...] = ()


class Tasks:
    """Tells which rows are of which task; a task is named by the number of one of its variables.

    As long as nothing is ``known`` of them, they are found while rows are read, for the table as a whole.
    """

    def __init__(self, table: LogTable, known: Grouping | None = None) -> None:
        # A counter is there, too, where a value is no number.
        self._columns = [one.column if one.counter is None else one.counter for one in table.variables]
        self._groups = VariableGroups(len(self._columns))
        self._shapes = RowShapes(len(self._columns))
        # In rows of changes, nobody looks for what is missing between them.
        self._parts = None if table.only_changes or known is not None else PartGroups(len(self._columns))
        self._known = known
        self._part, self._place = 0, 0
        self._led: int | None = None
        """The task that rows in front of all with a value were taken to be of."""
        self._there: dict[int, set[int]] = {}
        self._behind: dict[int, tuple[int, ...]] = {}
        """Of tasks of the part that goes on, and had no row there yet, those of their variables in front of it."""
        self.merged: list[tuple[int, int]] = []
        """Tasks that turned out to be one, since ``rows`` was called last: the one that is no more, and the other."""

    @property
    def grouping(self) -> Grouping:
        """The tasks, when all rows were taken."""
        if self._known is not None:
            return self._known
        whole, first = self._groups.of, min(self._groups.there, default=0)
        return Grouping(whole, (first,)) if self._parts is None else self._parts.grouping(whole, first)

    @property
    def has_erred(self) -> bool:
        """Whether rows without any value were taken for those of another task than the first one."""
        return self._led is not None and int(self._groups.of[self._led]) != min(self._groups.there, default=0)

    def rows(self, chunk: Chunk, begins: I64) -> Iterator[TaskRows]:
        """Yield each task that rows of a chunk are of; with rows ``begins`` begin parts of the table."""
        self.merged = []
        numbers = np.array([at for at, column in enumerate(self._columns) if not chunk.rows.is_empty(column)], np.int64)
        if self._known is None:
            before = self._groups.seen.copy()
            self._learn(chunk, numbers, begins)
            there = set(self._groups.of[before].tolist())
            if not there and self._led is None:
                self._led = min(self._groups.there, default=0)
            if not there and self._led is not None:
                there = {int(self._groups.of[self._led])}
            yield from _divided(self._filled(chunk, numbers), self._groups.of[numbers], there, len(chunk))
            return
        edges = [0, *begins.tolist(), len(chunk)]
        places = [self._known.place_of(self._part + number) for number in range(len(edges) - 1)]
        self._part += len(begins)
        filled = self._filled(chunk, numbers)
        start = 0
        for number, place in enumerate(places):
            if number + 1 < len(places) and (places[number + 1] == place or edges[number + 1] == start):
                continue
            stop = edges[number + 1]
            if stop > start:
                yield from self._of_place(place, filled, numbers, slice(start, stop), len(chunk))
            start = stop

    def _of_place(self, place: int, filled: list[Bool], numbers: I64, rows: slice, of_rows: int) -> Iterator[TaskRows]:
        """Yield the tasks of a stretch of rows in which the same variables are of one task."""
        assert self._known is not None
        tasks, before = self._known.all[place], self._known.all[self._place]
        there = self._there.setdefault(place, {self._known.first[place]})
        if place != self._place:
            # Rows of a task may come much later than the part begins.
            self._behind = {
                task: tuple(np.unique(before[tasks == task]).tolist()) for task in np.unique(tasks).tolist()
            }
        self._place = place
        some = filled if rows.stop - rows.start == of_rows else [one[rows] for one in filled]
        for one in _divided(some, tasks[numbers], there, rows.stop - rows.start):
            there.add(one.task)
            behind = self._behind.pop(one.task, ())
            own, blank = one.rows, one.blank
            if some is not filled:
                own = np.arange(rows.start, rows.stop) if own is None else own + rows.start
                if blank is not None:
                    blank = np.concatenate(
                        [np.zeros(rows.start, np.bool_), blank, np.zeros(of_rows - rows.stop, np.bool_)]
                    )
            yield TaskRows(one.task, own, blank, () if one.task in behind else behind)

    def _filled(self, chunk: Chunk, numbers: I64) -> list[Bool]:
        return [chunk.rows.filled(self._columns[number]) for number in numbers.tolist()]

    def _learn(self, chunk: Chunk, numbers: I64, begins: I64) -> None:
        """Take the rows of a chunk for what they tell of tasks."""
        filled = self._filled(chunk, numbers)
        if len(numbers) < 2 or any(one.all() for one in filled):
            # Mostly, all rows have one variable in common.
            self._join(numbers)
            if self._parts is not None:
                self._parts.take(numbers, filled, None, begins, len(chunk))
            return
        for row in {0, len(chunk) - 1}:
            self._join(numbers[[bool(one[row]) for one in filled]])
        known = self._groups.are_one(numbers)
        if known and self._parts is None:
            return
        shape = self._shapes.of(len(chunk), zip(numbers.tolist(), filled, strict=True))
        if self._parts is not None:
            self._parts.take(numbers, filled, shape, begins, len(chunk))
        if not known:
            self._note_merged(self._groups.join_rows(numbers, filled, np.unique(shape, return_index=True)[1]))

    def _join(self, variables: I64) -> None:
        self._note_merged(self._groups.join(variables))

    def _note_merged(self, gone: list[int]) -> None:
        self.merged += [(one, int(self._groups.of[one])) for one in gone]


def _divided(filled: list[Bool], task: I64, there: set[int], rows: int) -> Iterator[TaskRows]:
    """Yield each task that rows are of, given variables that are in them, where they are, and of which task.

    ``there`` are tasks of which there were rows in front of these. Rows without any value are of none that comes only
    later, but the first one.
    """
    if len(task) and (task == task[0]).all() and there <= {int(task[0])}:
        yield TaskRows(int(task[0]), None)
        return
    own: dict[int, Bool] = {}
    for one, number in zip(filled, task.tolist(), strict=True):
        own[number] = own[number] | one if number in own else one
    own = {number: one for number, one in own.items() if one.any()}
    others = sorted(there.difference(own))
    blank = np.ones(rows, np.bool_)
    for one in own.values():
        blank &= ~one
    has_blank = bool(blank.any())
    if len(own) + len(others) < 2 or (len(own) == 1 and not has_blank):
        yield TaskRows(next(iter([*own, *others]), 0), None)
        return
    if not has_blank:
        for number, one in own.items():
            yield TaskRows(number, np.flatnonzero(one))
        return
    since = {number: 0 if number in there else int(one.argmax()) for number, one in own.items()}
    # As long as there is one task only, such rows are its own.
    second = sorted([*since.values(), *(0 for _ in others)])[1]
    number = np.arange(rows)
    in_doubt = blank & (number >= second)
    for task_number, one in own.items():
        yield TaskRows(task_number, np.flatnonzero(one | (blank & (number >= since[task_number]))), in_doubt)
    for task_number in others:
        yield TaskRows(task_number, np.flatnonzero(blank), in_doubt)
