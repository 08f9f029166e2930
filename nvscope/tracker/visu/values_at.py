"""ValuesAt: what WebVisu variables were at a moment, which is up to a frame of the capture."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import NamedTuple

import numpy as np

from nvscope.engine.told import Told
from nvscope.tracker.visu.last_values import cut_text
from nvscope.tracker.visu.messages import VisuBatch
from nvscope.tracker.visu.number_texts import Form
from nvscope.tracker.visu.readings import Readings, ReadValues
from nvscope.tracker.visu.value_history import Reading
from nvscope.tracker.visu.variables import PageVariable


class LastReading(NamedTuple):
    """The last value of a variable up to a moment, with the frame of the reply."""

    reading: Reading
    frame: int
    time_ns: int


class ValuesAt:
    """The last values up to the frames that count, ``then``, by number of ``read.variables``.

    Also those that came behind: a clock that steps back passes a moment again.
    """

    def __init__(self, wanted: Callable[[PageVariable], bool]) -> None:
        self.read = ReadValues(wanted)
        self.then: dict[int, LastReading] = {}
        self._now: dict[int, LastReading] = {}

    @property
    def readable(self) -> Collection[int]:
        """The numbers of the variables that had a value at any time."""
        return self._now.keys()

    def take(self, told: Told, part: VisuBatch, until: int) -> None:
        """Take a batch, of which so many packets count, and all before them."""
        is_open = until > 0
        for readings in self.read.of(told, part):
            cut = int(np.searchsorted(readings.row, until))
            self._take(told, readings, 0, cut)
            if is_open and cut < len(readings):
                self.count_all()
                is_open = False
            self._take(told, readings, cut, len(readings))
        if is_open:
            self.count_all()

    def count_all(self) -> None:
        """Let all that came so far count."""
        self.then = dict(self._now)

    def _take(self, told: Told, readings: Readings, begin: int, end: int) -> None:
        rows = begin + np.flatnonzero(readings.form[begin:end] != Form.NOTHING)
        last = np.full(len(self.read.variables), -1)
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
