"""What becomes of the values of a database, by the rules, over rows as SQLite hands them over: the oracle."""

from __future__ import annotations

import itertools
import sqlite3
from collections.abc import Collection, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from dissectors.datalogger.tables import COUNT_SUFFIX

Value = Any


@dataclass
class Reading:
    """One value: in which row of all, from 1, when, and in which stretch without a loss; None is an unknown one."""

    frame: int
    time_ns: int
    stretch: tuple[int, int]
    value: Value

    @property
    def alike(self) -> tuple[str, Value]:
        """What tells it from others: 1 and 1.0 are two values, as they are stored."""
        return type(self.value).__name__, self.value


@dataclass
class Variable:
    """The values of one variable, in their order; ``rows`` are those that say what it is: frame, time and stretch."""

    name: str
    every: list[Reading] = field(default_factory=list)
    rows: list[tuple[int, int, int]] = field(default_factory=list)

    @property
    def readings(self) -> list[Reading]:
        """Those of which the value is known."""
        return [one for one in self.every if one.value is not None]

    def take(self, frame: int, time_ns: int, stretch: int, value: Value) -> None:
        """Take what a row says of it; it is unknown behind a value only, and what comes then is another stretch."""
        if value is None and not self.every:
            return
        gone = sum(one.value is None for one in self.every) + (value is None)
        self.every.append(Reading(frame, time_ns, (stretch, gone), value))

    def is_lost(self, frame: int, time_ns: int) -> bool:
        """Tell whether something may be missing between the rows up to a frame and the next one, at a time."""
        stood = [one for one in self.rows if one[0] <= frame]
        behind = next((one for one in self.rows if one[0] > frame), None)
        return bool(stood and behind and behind[2] > stood[-1][2] and stood[-1][1] < time_ns)

    @property
    def changes(self) -> list[tuple[Reading, Reading]]:
        """Which value came behind which other one."""
        pairs = zip(self.readings, self.readings[1:], strict=False)
        return [(before, now) for before, now in pairs if before.alike != now.alike]

    @property
    def between_ns(self) -> list[int]:
        """The times between changes that have none before them that may have been missed."""
        times = [now for _, now in self.changes]
        return [
            now.time_ns - before.time_ns
            for before, now in itertools.pairwise(times)
            if before.stretch == now.stretch and now.time_ns >= before.time_ns
        ]


def time_ns(text: object) -> int | None:
    """Return the time that a text tells, None where it tells none."""
    try:
        told = datetime.strptime(str(text), "%Y-%m-%dT%H:%M:%S.%f").replace(tzinfo=UTC)
    except ValueError:
        return None
    return int(told.timestamp()) * 10**9 + told.microsecond * 1000


def stored_rows(paths: Sequence[Path], table: str = "log_1") -> Iterator[tuple[list[str], int, tuple[Value, ...]]]:
    """Yield the rows of a table of several files, file after file, with the names of the columns and the id."""
    for path in paths:
        with closing(sqlite3.connect(path)) as database:
            names = [name for _, name, *_ in database.execute(f"PRAGMA table_info({table})")]
            for number, *row in database.execute(f"SELECT rowid, * FROM {table} ORDER BY rowid"):
                yield names, number, tuple(row)


def put_together(groups: list[set[str]], names: set[str]) -> set[str]:
    """Let those be one group that names are in, and return it."""
    own = names.union(*(one for one in groups if one & names))
    groups[:] = [*(one for one in groups if not one & names), own]
    return own


class Tasks:
    """Which variables are sampled together, as far as rows have told: those that stand in one row.

    A logger that goes on with other tasks says that data was lost. Behind that, a variable that is no real number, and
    was in a row, is in each row of its task; so rows without it are of another one, and all that stands with these.
    """

    def __init__(self, reals: Collection[str]) -> None:
        self._reals = set(reals)
        self._together: list[set[str]] = []
        self._part: list[set[str]] | None = None
        self._rows: dict[str, list[int]] = {}
        """The rows of the part in which each was."""
        self._number = 0

    def unknown(self, values: dict[str, Value], *, begins: bool) -> set[str]:
        """Take the values of a row; return which of those that are NULL were to be sampled in it."""
        if begins:
            self._part, self._rows = [], {}
        there = {name for name, value in values.items() if value is not None}
        if not there:
            only_reals = [one for one in self._together if one <= self._reals]
            return set().union(*(only_reals or self._together))
        self._number += 1
        for name in there:
            self._rows.setdefault(name, []).append(self._number)
        found = put_together(self._together, there) - there
        if self._part is None:
            return found
        own = put_together(self._part, there)
        return {name for name in found if name in own or not self._is_apart(name, own)}

    def _is_apart(self, name: str, own: set[str]) -> bool:
        """Return whether a variable is of another task than some, none of which was in a row with it."""
        assert self._part is not None
        others = next((one for one in self._part if name in one), set())
        if others - self._reals:
            return True
        whole = [self._rows[one][0] for one in own - self._reals]
        return bool(others and whole) and self._rows[name][-1] > min(whole)


def read(paths: Sequence[Path], reals: Collection[str] = ()) -> list[Variable]:
    """Return the variables of databases of one series, in the order of their columns; ``reals`` hold real numbers."""
    found: dict[str, Variable] = {}
    tasks, counts = Tasks(reals), dict[str, int]()
    frame = stretch = 0
    before: int | None = None
    was_lost = False
    for names, number, row in stored_rows(paths):
        when = time_ns(row[0])
        if when is None:
            continue
        # A row that is not the next one: what was between cannot be read, such as those without a time.
        is_unread = before is not None and number > before + 1
        stretch += is_unread
        before = number
        frame += 1
        values = dict(zip(names[2:], row[2:], strict=True))
        counted = [name for name in values if not name.endswith(COUNT_SUFFIX)]
        counters = [values[name + COUNT_SUFFIX] for name in counted if name + COUNT_SUFFIX in values]
        begins_anew = bool(counters) and len(counters) == len(counted) and all(one == 0 for one in counters)
        if row[1] == 0 or begins_anew:
            stretch += 1
        begins = (row[1] == 0 and not was_lost) or is_unread
        was_lost = row[1] == 0
        unknown = set() if counters else tasks.unknown(values, begins=begins)
        for name in counted if counters else ():
            count = values[name + COUNT_SUFFIX]
            if isinstance(count, int):
                went_on = name in counts and counts[name] != count
                if values[name] is None and (went_on or begins_anew):
                    unknown.add(name)
                counts[name] = count
        for name in counted:
            variable = found.setdefault(name, Variable(name))
            if counters or values[name] is not None or name in unknown:
                variable.rows.append((frame, when, stretch))
            if values[name] is not None or name in unknown:
                variable.take(frame, when, stretch, values[name])
    return list(found.values())
