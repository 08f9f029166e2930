"""PartedState: the same state as ``TrackerState``, counted in parts that know nothing of each other."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import ClassVar, TypeVar

from nvscope.engine.dealing import Share, SplitBy, deal
from nvscope.engine.events import Listeners
from nvscope.engine.rows import StreamMemory
from nvscope.engine.told import Told
from nvscope.tracker.accumulator import Accumulator, ProtocolAccumulator
from nvscope.tracker.can.state import BusState
from nvscope.tracker.capture import CaptureState
from nvscope.tracker.lists import ListState
from nvscope.tracker.parameter.state import ParameterState
from nvscope.tracker.senders import SenderState
from nvscope.tracker.state import TrackerState
from nvscope.tracker.variables.values import Values

AnyPart = TypeVar("AnyPart", bound=Accumulator)


class PartedState:
    """What is on the wire, counted in ``parts`` parts by each key that it may be split by.

    ``values`` and ``others`` make those of a part, where they are wanted; ``recent`` and ``listeners`` are as for
    ``TrackerState``: what parts tell comes part by part. ``join`` gives the state that folding all at once gives; it
    uses the parts up.
    """

    by_stream: ClassVar[bool] = True

    def __init__(
        self, parts: int, values: Callable[[], Values] | None = None, *,
        recent: bool = False, others: Callable[[], Mapping[str, ProtocolAccumulator]] = dict,
        listeners: Listeners = (),
    ) -> None:  # fmt: skip
        self._count = parts
        self._values, self._recent = values, recent
        self._memory = StreamMemory()
        self._capture = CaptureState()
        self._lists = [ListState(values() if values else None) for _ in range(parts)]
        self._senders = [SenderState(recent=recent) for _ in range(parts)]
        self._buses = [BusState() for _ in range(parts)]
        self._parameters = [ParameterState() for _ in range(parts)]
        self._make_others = others
        made = [others() for _ in range(parts)]
        self._others = {name: [one[name] for one in made] for name in made[0]}
        self._shares: dict[SplitBy, list[Share]] = {}
        self._listeners = listeners

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far, and deal it out."""
        told = told.heard_by(self._listeners)
        self._memory = told.laid.memory
        self._capture.observe(told)
        self._deal(told, self._lists)
        self._deal(told, self._senders)
        self._deal(told, self._buses)
        self._deal(told, self._parameters)
        for parts in self._others.values():
            self._deal(told, parts)

    def _deal(self, told: Told, parts: Sequence[AnyPart]) -> None:
        by = parts[0].SPLIT_BY
        self._shares[by] = []
        for part, (share, own) in zip(parts, deal(told, by, self._count), strict=True):
            self._shares[by].append(share)
            part.observe(own)

    def join(self) -> TrackerState:
        """Return the parts as one state."""
        values, others = self._values() if self._values else None, self._make_others()
        state = TrackerState(values=values, recent=self._recent, others=others)
        state.memory, state.capture = self._memory, self._capture
        for part, share in self._dealt(self._lists):
            state.lists.take(part, share)
        for senders, share in self._dealt(self._senders):
            state.senders.take(senders, share)
        for buses, share in self._dealt(self._buses):
            state.buses.take(buses, share)
        for parameters, share in self._dealt(self._parameters):
            state.parameters.take(parameters, share)
        for name, parts in self._others.items():
            for other, share in self._dealt(parts):
                others[name].take(other, share)
        return state

    def _dealt(self, parts: Sequence[AnyPart]) -> Iterator[tuple[AnyPart, Share]]:
        """Return parts with their shares; before the first batch, nothing is theirs."""
        return zip(parts, self._shares.get(parts[0].SPLIT_BY, ()), strict=False)
