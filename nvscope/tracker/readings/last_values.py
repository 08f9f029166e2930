"""LastValues: what variables are now, how often they changed, and between which bounds they lay."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from dissectors.batch import I64, U64
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.told import Told
from nvscope.tracker.readings.changes import ChangeMemory, Steps
from nvscope.tracker.readings.form import UNKNOWN_TEXT, Form, cut_text
from nvscope.tracker.readings.readings import Readings, ReadValues

_LEAST, _MOST = np.iinfo(np.int64).min, np.iinfo(np.int64).max


class ValueColumns(KeyedColumns):
    """One row a variable.

    ``readings`` is how often it had a value, ``unreadable`` how often the controller could not read it; ``changes``
    counts those that are another value than the last one that was known, ``changed_ns`` is when it was last (its first
    time before that). ``form`` is the last ``Form``; where that is UNKNOWN, the last time and frame are of that.
    ``secret_frame`` is the last frame with a value that was, or may have been, a password, 0 without any. Bounds are
    those of numbers: of whole ones, or of REALs; the least is above the most where there was none.
    """

    readings: I64
    unreadable: I64
    changes: I64
    changed_ns: I64
    last_ns: I64
    last_frame: I64
    secret_frame: I64
    form: I64
    bits: U64
    least: I64
    most: I64
    least_real: np.ndarray[tuple[int], np.dtype[np.float64]]
    most_real: np.ndarray[tuple[int], np.dtype[np.float64]]
    COLUMNS: ClassVar = {
        **{
            name: (np.int64(0), 1)
            for name in (
                "readings", "unreadable", "changes", "changed_ns", "last_ns", "last_frame", "secret_frame", "form",
            )
        },
        "bits": (np.uint64(0), 1),
        "least": (np.int64(_MOST), 1), "most": (np.int64(_LEAST), 1),
        "least_real": (np.float64(np.inf), 1), "most_real": (np.float64(-np.inf), 1),
    }  # fmt: skip


class LastValues:
    """The values that ``read`` finds, by number of ``read.known``.

    ``texts`` are the last ones, as they came. Longer texts than what is worth keeping are cut, and end with "…".
    ``batches`` counts what was observed.
    """

    def __init__(self, read: ReadValues) -> None:
        self.read = read
        self.columns = ValueColumns()
        self.texts: dict[int, str] = {}
        self.batches = 0
        self._memory = ChangeMemory()

    def observe(self, told: Told, part: Any) -> None:
        """Take what a batch brings, which follows those before."""
        self.batches += 1
        for readings in self.read.of(told, part):
            self._take(told, readings)
        self.columns.resize(len(self.read.known))

    def forget(self) -> None:
        """Let what comes next change nothing: nobody listened for a while."""
        if not self.read.tells_gaps:
            self._memory.forget()

    def _take(self, told: Told, readings: Readings) -> None:
        columns = self.columns
        columns.resize(len(self.read.known))
        nothing = readings.variable[readings.form == Form.NOTHING]
        columns.unreadable[: len(columns)] += np.bincount(nothing, minlength=len(columns))
        steps = self._memory.steps(readings)
        if len(steps.order):
            self._take_values(told, readings, steps)
        unknown = np.flatnonzero(readings.form == Form.UNKNOWN)
        if len(unknown):
            self._take_unknown(told, readings, unknown)

    def _take_values(self, told: Told, readings: Readings, steps: Steps) -> None:
        columns, order = self.columns, steps.order
        variable, time_ns = readings.variable[order], told.packets.ts_ns[readings.row[order]]
        first = steps.begins & (columns.readings[variable] == 0)
        columns.changed_ns[variable[first]] = time_ns[first]
        columns.readings[: len(columns)] += np.bincount(variable, minlength=len(columns))
        changed = np.flatnonzero(steps.differs)
        columns.changes[: len(columns)] += np.bincount(variable[changed], minlength=len(columns))
        # Assigned in order, so that the last one is what stays.
        columns.changed_ns[variable[changed]] = time_ns[changed]
        self._bound(readings, steps)
        if readings.secret.any():
            hidden = order[readings.secret[order]]
            columns.secret_frame[readings.variable[hidden]] = readings.row[hidden] + told.first_frame
        ends = np.flatnonzero(np.append(steps.begins[1:], True))
        last, own = order[ends], variable[ends]
        columns.last_ns[own] = time_ns[ends]
        columns.last_frame[own] = readings.row[last] + told.first_frame
        columns.form[own], columns.bits[own] = readings.form[last], readings.bits[last]
        for number, place in zip(own.tolist(), last.tolist(), strict=True):
            self.texts[number] = cut_text(readings.text(place))

    def _take_unknown(self, told: Told, readings: Readings, unknown: I64) -> None:
        """Let variables be unknown behind which no value came."""
        columns = self.columns
        last = np.full(len(columns), -1)
        rows = np.flatnonzero(readings.form != Form.NOTHING)
        # Assigned in order, so that the last one is what stays.
        last[readings.variable[rows]] = rows
        ends = unknown[last[readings.variable[unknown]] == unknown]
        own = readings.variable[ends]
        columns.last_ns[own] = told.packets.ts_ns[readings.row[ends]]
        columns.last_frame[own] = readings.row[ends] + told.first_frame
        columns.form[own], columns.bits[own] = Form.UNKNOWN, 0
        self.texts.update(dict.fromkeys(own.tolist(), UNKNOWN_TEXT))

    def _bound(self, readings: Readings, steps: Steps) -> None:
        """Widen the bounds of numbers: by values that are not as those before."""
        columns = self.columns
        order = steps.order[steps.differs | steps.fresh]
        for form, least, most, dtype in (
            (Form.WHOLE, columns.least, columns.most, np.int64),
            (Form.REAL, columns.least_real, columns.most_real, np.float64),
        ):  # fmt: skip
            own = order[readings.form[order] == form]
            if len(own):
                variable, number = readings.variable[own], readings.bits[own].view(dtype)
                start = np.flatnonzero(np.append(True, variable[1:] != variable[:-1]))
                which = variable[start]
                least[which] = np.minimum(least[which], np.minimum.reduceat(number, start))
                most[which] = np.maximum(most[which], np.maximum.reduceat(number, start))
