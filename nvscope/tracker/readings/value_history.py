"""ValueHistory: each change of some variables, in the order of the capture, and how fast they change."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import I64, Bool
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.told import Told
from nvscope.tracker.readings.changes import ChangeMemory, Steps, UnknownMemory
from nvscope.tracker.readings.form import MOST_CHARACTERS, Form, cut_text
from nvscope.tracker.readings.readings import Readings, ReadValues, ReadVariable

_NEVER = np.iinfo(np.int64).max


class Reading(Struct, frozen=True):
    """A value: its form, the bits of its number, its text as it came, and whether it is, or may be, a password."""

    form: Form
    bits: int
    text: str
    is_secret: bool


class ReadEntry(Struct, frozen=True):
    """One variable in one message or row: its value there, and the one before, None where nobody knows that.

    ``name`` is what it was called then; ``changed`` says that it is another value than the last one that was known.
    """

    frame: int
    time_ns: int
    variable: ReadVariable
    name: str
    changed: bool
    before: Reading | None
    now: Reading


class TrackColumns(KeyedColumns):
    """One row a variable; of its changes, the shortest and the longest time between two, -1 where there is none."""

    readings: I64
    first_ns: I64
    last_ns: I64
    changes: I64
    changed_ns: I64
    shortest_ns: I64
    longest_ns: I64
    untimed: I64
    stretch: I64
    COLUMNS: ClassVar = {
        **{
            name: (np.int64(0), 1)
            for name in ("readings", "first_ns", "last_ns", "changes", "changed_ns", "untimed", "stretch")
        },
        "shortest_ns": (np.int64(_NEVER), 1),
        "longest_ns": (np.int64(-1), 1),
    }


class _Shown(Struct, frozen=True):
    """Readings to be told, by their rows; of each whether it is the first that is known, and whether it differs."""

    told: Told
    readings: Readings
    rows: I64
    fresh: Bool
    differs: Bool


class ValueHistory:
    """The changes of wanted variables, and where they are unknown, as batches come; however these are cut, the same.

    With ``every``, each value is told, changed or not. A time between changes is left out where a clock steps back,
    and where some may have been missed between them. ``tracks`` are by number of ``read.known``.
    """

    def __init__(self, read: ReadValues, *, every: bool = False) -> None:
        self.read = read
        self.tracks = TrackColumns()
        self._every = every
        self._memory = ChangeMemory()
        self._unknown = UnknownMemory()
        self._last: dict[int, Reading] = {}
        self._shown: list[_Shown] = []

    def observe(self, told: Told, part: Any) -> None:
        """Take what a batch brings, which follows those before."""
        self._shown = [self._take(told, readings) for readings in self.read.of(told, part)]

    def forget(self) -> None:
        """Begin anew: nobody listened for a while."""
        if not self.read.tells_gaps:
            self._memory.forget()
        # Not at once: what the batch brought has not been told.
        self.tracks.untimed[: len(self.tracks)] = self.tracks.changes[: len(self.tracks)]

    def entries(self) -> Iterator[ReadEntry]:
        """Yield what the batch observed last tells, once."""
        shown, self._shown = self._shown, []
        for one in shown:
            yield from self._entries(one)

    def _take(self, told: Told, readings: Readings) -> _Shown:
        steps = self._memory.steps(readings)
        time_ns = told.packets.ts_ns[readings.row[steps.order]]
        stretch = None if readings.stretch is None else readings.stretch[steps.order]
        self._count(readings.variable[steps.order], time_ns, steps, stretch)
        fresh, differs = np.zeros(len(readings), np.bool_), np.zeros(len(readings), np.bool_)
        fresh[steps.order], differs[steps.order] = steps.fresh, steps.differs
        turns = self._unknown.turns(readings)
        rows = np.flatnonzero(readings.form != Form.NOTHING if self._every else fresh | differs | turns)
        # In the order of the capture, which is that of each variable alone so far.
        rows = rows[np.argsort(readings.row[rows], kind="stable")]
        return _Shown(told, readings, rows, fresh[rows], differs[rows])

    def _count(self, variable: I64, time_ns: I64, steps: Steps, stretch: I64 | None) -> None:
        tracks = self.tracks
        tracks.resize(len(self.read.known))
        begins = np.flatnonzero(steps.begins)
        first = begins[tracks.readings[variable[begins]] == 0]
        tracks.first_ns[variable[first]] = time_ns[first]
        tracks.readings[: len(tracks)] += np.bincount(variable, minlength=len(tracks))
        tracks.last_ns[variable] = time_ns
        row = np.flatnonzero(steps.differs)
        if not len(row):
            return
        own, when = variable[row], time_ns[row]
        starts = np.append(True, own[1:] != own[:-1])
        before = np.append(0, when[:-1])
        before[starts] = tracks.changed_ns[own[starts]]
        between = when - before
        timed = (between >= 0) & (~starts | (tracks.changes > tracks.untimed)[own])
        if stretch is not None:
            now = stretch[row]
            last = np.append(0, now[:-1])
            last[starts] = tracks.stretch[own[starts]]
            timed &= last == now
            tracks.stretch[own] = now
        np.minimum.at(tracks.shortest_ns, own[timed], between[timed])
        np.maximum.at(tracks.longest_ns, own[timed], between[timed])
        tracks.changes[: len(tracks)] += np.bincount(own, minlength=len(tracks))
        tracks.changed_ns[own] = when

    def _entries(self, shown: _Shown) -> Iterator[ReadEntry]:
        readings, rows = shown.readings, shown.rows
        known, last = self.read.known, self._last
        columns = (
            rows, readings.variable[rows], readings.form[rows], readings.bits[rows], readings.secret[rows],
            readings.naming[rows], readings.row[rows] + shown.told.first_frame,
            shown.told.packets.ts_ns[readings.row[rows]], shown.fresh, shown.differs,
        )  # fmt: skip
        for place, number, form, bits, is_secret, naming, frame, time_ns, fresh, differs in zip(
            *(column.tolist() for column in columns), strict=True
        ):
            now = Reading(Form(form), bits, readings.text(place), is_secret)
            before = None if fresh else last.get(number)
            last[number] = replace(now, text=cut_text(now.text)) if len(now.text) > MOST_CHARACTERS else now
            yield ReadEntry(frame, time_ns, known[number], readings.called(number, naming), differs, before, now)

    def shortest_ns(self, number: int) -> int | None:
        """Return the shortest time between two changes of a variable, None where there is none."""
        found = int(self.tracks.shortest_ns[number])
        return None if found == _NEVER else found
