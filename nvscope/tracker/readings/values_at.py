"""ValuesAt: what variables were at a moment, which is up to a frame of the capture."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np

from dissectors.batch import Bool
from nvscope.engine.told import Told
from nvscope.tracker.readings.across_moment import AcrossMoment
from nvscope.tracker.readings.form import UNKNOWN_TEXT, Form, cut_text
from nvscope.tracker.readings.lasting import RowsRead
from nvscope.tracker.readings.readings import Readings, ReadValues
from nvscope.tracker.readings.value_history import Reading


class LastReading(NamedTuple):
    """The last value of a variable up to a moment, with the frame that has it."""

    reading: Reading
    frame: int
    time_ns: int


class ValuesAt:
    """The last values up to the frames that count, ``then``, by number of ``read.known``.

    Also those that came behind: a clock that steps
    back passes a moment again. ``unreadable`` are those that could not be read at some time. ``at`` returns those of a
    time, which is that of the moment: of what was lost around it, nobody knows what it was.
    """

    def __init__(self, read: ReadValues) -> None:
        self.read = read
        self.then: dict[int, LastReading] = {}
        self._now: dict[int, LastReading] = {}
        self.unreadable: set[int] = set()
        self._across = AcrossMoment(read) if isinstance(read, RowsRead) else None

    @property
    def readable(self) -> Collection[int]:
        """The numbers of the variables that had a value at any time."""
        return self._now.keys()

    def take(self, told: Told, part: Any, until: int) -> None:
        """Take a batch, of which so many packets count, and all before them."""
        is_open = until > 0
        came = []
        for readings in self.read.of(told, part):
            came.append(readings)
            counts = readings.row < until
            self._take(told, readings, counts)
            if counts.all():
                continue
            if is_open:
                self.count_all()
                is_open = False
            self._take(told, readings, ~counts)
        if is_open:
            self.count_all()
        if self._across is not None:
            self._across.take(told, came, until, len(self.read.known))

    def count_all(self) -> None:
        """Let all that came so far count."""
        self.then = dict(self._now)
        if self._across is not None:
            self._across.count_all()

    def at(self, number: int, time_ns: int) -> LastReading | None:
        """Return what a variable was at the moment, None where it had no value before."""
        last = self.then.get(number)
        if last is None or self._across is None or not self._across.is_lost(number, time_ns):
            return last
        return last._replace(reading=Reading(Form.UNKNOWN, 0, UNKNOWN_TEXT, last.reading.is_secret))

    def _take(self, told: Told, readings: Readings, which: Bool) -> None:
        nothing = readings.form == Form.NOTHING
        self.unreadable.update(np.unique(readings.variable[nothing & which]).tolist())
        rows = np.flatnonzero(which & ~nothing)
        last = np.full(len(self.read.known), -1)
        # Assigned in order, so that the last one is what stays.
        last[readings.variable[rows]] = rows
        for number in np.flatnonzero(last >= 0).tolist():
            place = int(last[number])
            packet = int(readings.row[place])
            reading = Reading(
                Form(int(readings.form[place])), int(readings.bits[place]), cut_text(readings.text(place)),
                bool(readings.secret[place]),
            )  # fmt: skip
            time_ns = int(told.packets.ts_ns[packet])
            self._now[number] = LastReading(reading, packet + told.first_frame, time_ns)
