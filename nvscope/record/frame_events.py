"""Events that frames show: those at which an expression becomes true, and those that waited in vain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from dissectors.batch import PacketBatch
from dissectors.can.pdo import EXTENDED
from dissectors.carried import Carrier
from nvscope.engine.reading import Reading
from nvscope.engine.recogniser import Before, Recogniser
from nvscope.engine.told import Told
from nvscope.errors import UsageError
from nvscope.expression.words import Words
from nvscope.record.edges import Edges
from nvscope.tracker.frame_counts import FrameCounts, Parts
from nvscope.units import cob_id
from nvscope.view.fields.field import TelegramField
from nvscope.view.fields.frame_counts import FrameCountFields, is_late
from nvscope.view.moment_filter import MomentFilter
from nvscope.view.rows.frames import FrameRows


class FrameEvent(NamedTuple):
    """When something happened, the row of the batch before which it did, and what its list is called, "" for none."""

    time_ns: int
    row: int
    name: str = ""


class FrameEvents:
    """Finds the events of an expression over telegrams, their variables, and what they add to figures.

    ``frame`` returns a frame of the capture by its number, None where it is not kept any more. UsageError, with the
    place, where the expression cannot be understood.
    """

    def __init__(
        self, expression: str, fields: Words[TelegramField], reading: Reading,
        frame: Callable[[int], PacketBatch | None] = lambda _: None,
    ) -> None:  # fmt: skip
        self._counts = FrameCounts()
        self._parts: Parts = {}
        self._reading = reading
        self.frame = frame
        known = FrameCountFields(fields, lambda: self._parts)
        self.chosen = MomentFilter(expression, known)
        named = [field.name for field in self.chosen.named if field.name in known.own]
        late = [name for name in named if is_late(name)]
        if late and self.chosen.alone is None:
            raise UsageError(
                f"{', '.join(late)}: told when a wait is over, and not in the order of telegrams",
                next_step="leave functions of time, or this, out",
            )
        self._edges = Edges(self.chosen)
        self._is_counting, self._waits = bool(named), bool(late)

    def of(self, told: Told) -> Sequence[FrameEvent]:
        """Return the events of a batch, in their order."""
        if self._is_counting:
            self._counts.observe(told)
            self._parts = self._counts.own
        packets = told.packets
        rows = self._edges.rows(told)
        found = [FrameEvent(int(packets.ts_ns[row]), row, _list_of(told, row)) for row in rows.tolist()]
        if self._waits and len(self._counts.waited.frame):
            found = sorted([*found, *self._in_vain(told)], key=lambda event: (event.row, event.time_ns))
        return found

    def _in_vain(self, told: Told) -> list[FrameEvent]:
        """Return the events of frames that waited in vain, each when its time was over."""
        latest_ns = np.maximum.accumulate(told.packets.ts_ns) if len(told) else told.packets.ts_ns
        self._parts = self._counts.late
        waited, found = self._counts.waited, []
        for number, time_ns in zip(waited.frame.tolist(), waited.time_ns.tolist(), strict=True):
            true, name = self._ask(told, number)
            if true:
                found.append(FrameEvent(time_ns, int(np.searchsorted(latest_ns, time_ns, "right")), name))
        return found

    def _ask(self, told: Told, number: int) -> tuple[bool, str]:
        """Ask of a frame that came before, by its number: whether it is true, and what its list is called."""
        row = number - told.first_frame
        alone = told.packets[row : row + 1] if 0 <= row < len(told) else self.frame(number)
        if alone is None or self.chosen.alone is None:
            return False, ""
        recogniser = Recogniser(self._reading, told.pdos.names, by_stream=False)
        recogniser.go_on_behind(Before(number - 1, told.start_ns, int(alone.ts_ns[0])))
        for again in recogniser.tell(alone):
            if len(again.wanted) and self.chosen.alone(FrameRows.of(again, again.wanted)).any():
                return True, _list_of(again, int(again.wanted[0]))
        return False, ""


def _list_of(told: Told, row: int) -> str:
    """Return what people call the list that a packet belongs to: 7, on CAN 0x181; "" for none."""
    carried = told.varieties.carried.take(told.variety[row : row + 1])
    if not carried.of_list[0]:
        return ""  # such as requests for parameters, whose Index is no list
    number = int(carried.identifier[0])
    if carried.carrier[0] == Carrier.UDP:
        return str(number)
    return cob_id(number & ~EXTENDED, extended=bool(number & EXTENDED))
