"""Variables whose values come one by one, of pages and of databases, as what is traced.

Connections are followed from the oldest frame of a ring on, as its packets are. Where a database stores each value, and
where pages ask, a value is missed that comes late; where only changes are stored, values last from row to row.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import Struct

from dissectors.batch import Bool
from nvscope.analysis.read_values import SOURCES
from nvscope.analysis.recent_frames import recogniser_of, told_of
from nvscope.analysis.tracing import Numbers, Points
from nvscope.analysis.watching import Scene
from nvscope.definition.variables import Elementary
from nvscope.engine.told import Told
from nvscope.tracker.readings.cadence import Cadence
from nvscope.tracker.readings.form import Form
from nvscope.tracker.readings.lasting import Lasted, LastingValue, RowsRead
from nvscope.tracker.readings.value_history import Reading
from nvscope.view.documents.read_variables import reading_text

if TYPE_CHECKING:
    from nvscope.tracker.readings.readings import ReadVariable


class TracedReadings(Struct, frozen=True):
    """A variable of a page or of a database; ``source`` is the name of who tells it, as in ``SOURCES``.

    What came up to ``hidden_frame`` is left out: it is, or may be, a password.
    """

    source: str
    variable: ReadVariable
    has_numbers: bool
    hidden_frame: int

    @property
    def holds(self) -> bool:
        """Whether only changes of it are stored."""
        return self.variable.lasts

    def finder(self) -> ReadingFinder:
        """Return what finds its values."""
        return ReadingFinder(self)

    def type_of(self, value: Numbers) -> Elementary:
        """Return the type that its values have."""
        kind = self.variable.kind_of(_form(value), 0)
        assert kind is not None
        return kind

    def text(self, value: Any) -> str:
        """Return one of its values as ``vars`` has it."""
        reading = Reading(_form(value), int(value.view(np.uint64)), "", False)
        return reading_text(self.variable, reading, hidden=False)


def _form(value: Any) -> Form:
    return Form.REAL if value.dtype.kind == "f" else Form.WHOLE


class ReadingFinder:
    """Finds the values of a variable in what was read (``nvscope.analysis.tracing.Finder``)."""

    def __init__(self, traced: TracedReadings) -> None:
        self._traced = traced
        self._source = next(one for one in SOURCES if one.name == traced.source)
        self._channels: Sequence[str] = ()

    def begin(self, scene: Scene) -> None:
        self._channels = scene.channels
        identity = self._traced.variable.identity
        self._read = self._source.read(lambda variable: variable.identity == identity)
        self._recogniser = recogniser_of(scene.inquiry.reading(), scene.snapshot.infos, lambda: self._channels)
        self._cadence = Cadence(self._read.late_percent)
        self._lasting = LastingValue()
        self._stretch = 0

    def skip(self) -> None:
        self._cadence = Cadence(self._read.late_percent)
        self._lasting.forget()

    def find(self, scene: Scene, first_frame: int, nominal_ns: int | None) -> Iterator[tuple[Sequence[Points], int]]:
        self._channels = scene.channels
        for chunk in scene.recent.pieces(first_frame):
            told = told_of(self._recogniser, chunk, scene.recent)
            yield [points for one in told for points in self._points(one)], chunk.stop_frame

    def _points(self, told: Told) -> Iterator[Points]:
        part = told.parts.get(self._source.name)
        if part is None:
            return
        found: list[Lasted] = []
        for readings in self._read.of(told, part):
            # What is hidden is as what could not be read.
            form = np.where(readings.secret, int(Form.NOTHING), readings.form)
            if told.first_frame <= self._traced.hidden_frame:
                form = np.where(readings.row + told.first_frame <= self._traced.hidden_frame, int(Form.NOTHING), form)
            values = Lasted.of(readings, np.arange(len(readings)))._replace(form=form)
            if self._traced.holds:
                self._lasting.take(values)
            else:
                found.append(values)
        if self._traced.holds:
            assert isinstance(self._read, RowsRead)
            numbers = sorted(self._read.meant)
            found = [self._lasting.fill(*self._read.rows_of(number)) for number in numbers]
        for values in found:
            if len(values.row):
                yield self._of(told, values)

    def _of(self, told: Told, values: Lasted) -> Points:
        time_ns = told.packets.ts_ns[values.row]
        apart: Bool = np.diff(values.stretch, prepend=self._stretch) != 0
        self._stretch = int(values.stretch[-1])
        if not self._traced.holds:
            apart |= self._cadence.late(time_ns)
        whole, real = values.form == Form.WHOLE, values.form == Form.REAL
        bits = np.where(whole | real, values.bits, np.uint64(0))
        value: Numbers = bits.view(np.int64)
        if not whole.all() and (real.any() or self._traced.variable.usual_form == Form.REAL):
            value = np.where(real, bits.view(np.float64), value.astype(np.float64))
        return Points(time_ns, values.row + told.first_frame, value, whole | real, apart)
