"""TrackerState: everything that is known of the traffic so far, as a value made of integers.

``observe`` takes what is told in batches; however they are cut, the state is the same. What is derived from it (means,
percentiles, the scope of a sender's Counter, findings) is computed when somebody asks (``nvscope.tracker.summary``),
which changes nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar

from nvscope.engine.events import Listeners
from nvscope.engine.keys import Keys
from nvscope.engine.rows import StreamMemory
from nvscope.engine.told import Told
from nvscope.tracker.can.state import BusState
from nvscope.tracker.capture import CaptureState
from nvscope.tracker.lists import ListState
from nvscope.tracker.parameter.state import ParameterState
from nvscope.tracker.senders import SenderState

if TYPE_CHECKING:
    from nvscope.tracker.accumulator import ProtocolAccumulator
    from nvscope.tracker.variables.values import Values


class TrackerState:
    """What is on the wire: one ``nvscope.tracker.accumulator.Accumulator`` for each way to split it.

    ``memory`` is what is known of the streams, ``values`` are those of the variables, where their definition is known;
    ``recent`` asks for the intervals of the last minute (``SenderState``). ``others`` count the protocols beside
    network variables, the Parameter Manager and CAN, by name. ``listeners`` are told of the events of all of them
    (``nvscope.tracker.event_kinds``, and those that protocols have of their own). Frame numbers count from 1 across all
    that was observed.

    A filter chooses telegrams: flows count these, and only these give values; everything else looks at all telegrams,
    so that no filter makes up a loss.
    """

    by_stream: ClassVar[bool] = True

    def __init__(
        self, *, values: Values | None = None, recent: bool = False,
        others: Mapping[str, ProtocolAccumulator] = MappingProxyType({}), listeners: Listeners = (),
    ) -> None:  # fmt: skip
        self.memory = StreamMemory()
        self.capture = CaptureState()
        self.lists = ListState(values)
        self.senders = SenderState(recent=recent)
        self.buses = BusState()
        self.parameters = ParameterState()
        self.others = others
        self._listeners = listeners

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        told = told.heard_by(self._listeners)
        self.memory = told.laid.memory
        self.capture.observe(told)
        self.lists.observe(told)
        self.senders.observe(told)
        self.buses.observe(told)
        self.parameters.observe(told)
        for other in self.others.values():
            other.observe(told)

    @property
    def keys(self) -> Keys:
        """What the numbers of lists, nodes, places, streams and flows stand for."""
        return self.lists.keys

    @property
    def values(self) -> Values | None:
        return self.lists.values
