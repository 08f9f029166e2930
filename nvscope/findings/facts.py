"""Facts: what findings are judged from, looked up once for all judges."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import Struct, field

from dissectors.carried import Carrier
from nvscope.capture.formats import CAN_LOGS, DATABASES, are_databases
from nvscope.capture.source import SourceInfo
from nvscope.definition.limits import Limits
from nvscope.engine.keys import NOBODY_KEY
from nvscope.engine.limit import Missing
from nvscope.findings.finding import Events, all_events
from nvscope.findings.kind import FindingKind
from nvscope.findings.torn_cycles import CycleSizes
from nvscope.findings.unusual_intervals import UnusualIntervals
from nvscope.list_key import ListKey, Transport, told_of
from nvscope.tracker.can.summary import CanListSummary, CanStreamSummary
from nvscope.tracker.counters import Scope
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.events import EventLog
from nvscope.tracker.list_log import event_key, event_parts
from nvscope.tracker.silences import Silence
from nvscope.tracker.state import TrackerState
from nvscope.tracker.stream_summary import StreamSummary
from nvscope.tracker.summary import ListSummary, Summary
from nvscope.tracker.timing import NEVER

if TYPE_CHECKING:  # without definitions, nothing of them is imported
    from nvscope.definition.model import Definition, ListDefinition
    from nvscope.definition.pdos import Pdos
    from nvscope.definition.project_nodes import Node
    from nvscope.definition.project_security import Security
    from nvscope.tracker.evidence.shared_devices import SharedAddress
    from nvscope.tracker.evidence.witness import Witness

AnyList = ListSummary | CanListSummary

Place = tuple[int | None, int | None, int | None]
"""List, node and SubIndex; None for what is not concerned."""

Logged = tuple[int | None, int | None, int | None, Events]
"""A place, and the events there."""


class Facts(Struct, frozen=True, dict=True):
    """What findings are judged from: the state, what follows from it, the sources, the limits, and the time.

    ``definition`` is what should be on the wire, None where nobody says. ``overdue``: waits whose deadline has passed
    at that time count as if a frame had shown it. ``nodes`` are those that the project names, by address, ``security``
    is what it says of that. ``witness`` is who else observed, None where nobody did, and has settled.
    """

    state: TrackerState
    summary: Summary
    sources: Sequence[SourceInfo]
    at_ns: int
    limits: Limits = field(default_factory=Limits)
    definition: Definition | None = None
    overdue: bool = False
    nodes: Mapping[str, Node] = field(default_factory=dict)
    security: Security | None = None
    witness: Witness | None = None

    @cached_property
    def node_numbers(self) -> dict[str, int]:
        """The numbers of the nodes, by address."""
        return {text: number for number, text in enumerate(self.summary.addresses)}

    @cached_property
    def shared_addresses(self) -> Sequence[SharedAddress]:
        """The addresses that several devices have; none where nobody has looked for them."""
        if self.witness is None or not self.witness.presence.columns.shared.any():
            return ()
        from nvscope.tracker.evidence.shared_devices import addresses_by_hardware, shared_addresses

        presence = self.witness.presence
        return shared_addresses(
            presence, self.witness.shared_addresses, self.node_numbers, addresses_by_hardware(presence)
        )

    @cached_property
    def frames_of_stream(self) -> dict[int, tuple[int, int]]:
        """The first and the last frame of each stream."""
        columns = self.state.lists.flows
        frames: dict[int, tuple[int, int]] = {}
        for stream, first, last in zip(
            *(columns.column(name).tolist() for name in ("stream", "first_frame", "last_frame")), strict=True
        ):
            known = frames.get(stream, (first, last))
            frames[stream] = min(first, known[0]), max(last, known[1])
        return frames

    def misses_data(self, list_number: int) -> bool:
        """Tell whether the limit of streams has left out data of a list, or may have."""
        return bool(self._parts_left_out[list_number] & Missing.DATA)

    def misses_acknowledgements(self, list_number: int) -> bool:
        """The same of acknowledgements."""
        return bool(self._parts_left_out[list_number] & Missing.ACKNOWLEDGEMENTS)

    @property
    def identifiers_left_out(self) -> bool:
        """Whether there were more identifiers on CAN than are told apart."""
        return bool(len(self.state.buses.load.identifiers.left_out.rows))

    @property
    def telegrams_left_out(self) -> int:
        """How many telegrams the limit of streams has left out."""
        log = self.state.capture.left_out
        return int(log.rows.column("count")[log.keys.high == np.uint64(Carrier.UDP)].sum())

    @cached_property
    def _parts_left_out(self) -> list[int]:
        keys = self.state.keys
        parts: list[int] = keys.left_out.of_lists(keys.lists).tolist()
        return parts

    @cached_property
    def left_out(self) -> set[Transport]:
        """The transports of which the limit of streams has left out something: of these, nothing is called missing."""
        carriers = set(self.state.capture.left_out.keys.high.tolist())
        return {one for one in Transport if Carrier[one.name] in carriers}

    def silences_of(self, stream: StreamSummary | CanStreamSummary) -> list[Silence]:
        """Return how long a stream was silent when nobody listened any more, or is now, where somebody does."""
        number = stream.stream
        silences = self._silences.get(number, [])
        if self.state.senders.timing.columns.last_ns[number] == NEVER:
            return silences
        frame, capture = self.frames_of_stream[number][1], self.state.capture
        now_ns = self.at_ns
        if len(capture.steps_back.rows) and stream.last_ns <= capture.clock_ns:
            now_ns = min(now_ns, capture.clock_ns)  # not what the clock said before it was set back
        return [*silences, Silence(stream.last_ns, max(now_ns, stream.last_ns), frame)]

    @cached_property
    def _silences(self) -> dict[int, list[Silence]]:
        return self.state.senders.timing.silences.by_stream()

    @cached_property
    def defined(self) -> dict[ListKey, ListDefinition]:
        """The defined lists."""
        return self.definition.by_key() if self.definition else {}

    @cached_property
    def pdos(self) -> Pdos:
        """The frames of the lists that are defined on CAN."""
        from nvscope.definition.model import Definition
        from nvscope.definition.pdos import Pdos

        return Pdos(self.definition or Definition())

    @cached_property
    def streams_of_place(self) -> dict[tuple[int, int], list[StreamSummary]]:
        """The streams of each list and SubIndex."""
        places = defaultdict(list)
        for entry, stream in self.streams():
            places[entry.number, stream.subindex].append(stream)
        return places

    @cached_property
    def lost_of_node(self) -> list[int]:
        """How many telegrams or sends each node has lost, of those that it counts beyond one stream."""
        lost = self.state.senders.loss.streams.column("lost")[:, Scope.NODE_TELEGRAM].tolist()
        by_node = [0] * len(self.summary.addresses)
        for stream, node in enumerate(self.state.keys.streams.low.tolist()):
            if node != NOBODY_KEY:
                by_node[node] += lost[stream]
        return by_node

    @cached_property
    def telegrams_of(self) -> dict[Place, int]:
        """How many telegrams each stream has, by list, node and SubIndex."""
        return {
            (entry.number, stream.node, stream.subindex): stream.telegrams for entry, stream in self.streams()
        }  # fmt: skip

    @cached_property
    def intervals(self) -> UnusualIntervals:
        """The intervals of all streams."""
        return UnusualIntervals(self.state)

    @cached_property
    def cycles(self) -> CycleSizes:
        """The cycles of the lists on UDP."""
        return CycleSizes(self.state.senders.cycles)

    @cached_property
    def can_cycles(self) -> CycleSizes:
        """The cycles of the lists on CAN."""
        return CycleSizes(self.state.senders.can_cycles)

    @cached_property
    def captured(self) -> set[Transport]:
        """The transports that were listened to: of what nobody captured, nothing is missed."""
        frames, on_can = self.state.capture.frames, self.state.buses.frames
        # Who logs values listens to none.
        listening = [info for info in self.sources if info.format not in DATABASES]
        frames -= sum(info.frames for info in self.sources if info.format in DATABASES)
        captured: set[Transport] = set()
        if on_can or any(info.format in CAN_LOGS for info in self.sources):
            captured.add(Transport.CAN)
        empty = any(info.format not in CAN_LOGS and not info.frames for info in listening)
        if frames > on_can or empty or not (captured or are_databases(self.sources)):
            captured.add(Transport.UDP)
        return captured

    @cached_property
    def shape_changes(self) -> set[tuple[int | None, int | None]]:
        """The lists and nodes of which telegrams changed their shape."""
        return {(number, node) for number, node, _ in self._log.get(EventKind.SHAPE_CHANGED, {})}

    @cached_property
    def causes(self) -> dict[int, dict[Any, tuple[str, Any]]]:
        """What was found out of why telegrams of a list do not fit, by list, for ``nvscope.findings.misfits``."""
        return {}

    def address(self, node: int) -> str:
        """Return the text of a node's address."""
        return self.summary.addresses[node]

    def streams(self) -> list[tuple[ListSummary, StreamSummary]]:
        """Return all streams on UDP with their lists."""
        return self._streams

    @cached_property
    def _streams(self) -> list[tuple[ListSummary, StreamSummary]]:
        return [(entry, stream) for entry in self.summary.lists for stream in entry.streams]

    def pdo_streams(self) -> list[tuple[CanListSummary, CanStreamSummary]]:
        """Return all streams on CAN with their lists."""
        return [(entry, stream) for entry in self.summary.can.lists for stream in entry.streams]

    def definition_of(self, entry: AnyList) -> ListDefinition | None:
        """Return the definition of a list that was seen, None where there is none."""
        return told_of(self.defined, entry.key) if self.defined else None

    def reference_checksum(self, list_number: int, subindex: int) -> int:
        """Return the checksum that another one of a list and SubIndex differed from first."""
        places = self.state.keys.places
        place = places.find(np.array([list_number], np.uint64), np.array([subindex], np.uint64))[0]
        return int(self.state.lists.consistency.places.differed_from[place])

    def logged(self, kind: FindingKind) -> list[Logged]:
        """Return the events that are this kind of finding, by place: what the tracker logged, and what is overdue."""
        if kind.from_event is None:
            raise ValueError(f"{kind.code} is no event of the log")
        found = dict(self._log.get(kind.from_event, {}))
        for place, events in self._overdue.get(kind.from_event, {}).items():
            known = found.get(place)
            found[place] = events if known is None else known.followed_by(events)
        return [(*place, events) for place, events in found.items()]

    @cached_property
    def _log(self) -> dict[EventKind, dict[Place, Events]]:
        """What the tracker logged, by event and place."""
        return _by_place(self.state.lists.events)

    @cached_property
    def _overdue(self) -> dict[EventKind, dict[Place, Events]]:
        """What is overdue and was shown by no frame, by event and place."""
        if not self.overdue:
            return {}
        lists, log = self.state.lists, EventLog()
        over = lists.acknowledgement.overdue(self.at_ns)
        waits, requests, nobody = over.waits, over.requests, np.full(len(over.requests), -1)
        asked = self.state.keys.places.low[requests.place].astype(np.int64)
        for event, place, deadline_ns, frame in (
            (EventKind.NO_ACKNOWLEDGEMENT, self.state.keys.described(waits.stream), waits.end_ns, waits.frame),
            (EventKind.BOOT_UP_UNANSWERED, (requests.list, nobody, asked), requests.deadline_ns, requests.frame),
        ):
            order = np.argsort(deadline_ns, kind="stable")
            words = event_key(event, *(column[order] for column in place))
            log.record(deadline_ns[order], frame[order], *words)
        log.settle()
        return _by_place(log)


def _by_place(log: EventLog) -> dict[EventKind, dict[Place, Events]]:
    """Return the events of a log that is keyed by ``nvscope.tracker.list_log.event_key``."""
    found: dict[EventKind, dict[Place, Events]] = defaultdict(dict)
    kinds = {kind.value: kind for kind in EventKind}
    keys = zip(log.keys.high.tolist(), log.keys.low.tolist(), strict=True)
    for key, events in zip(keys, all_events(log.rows), strict=True):
        event, number, node, subindex = event_parts(*key)
        found[kinds[event]][_known(number), _known(node), _known(subindex)] = events
    return found


def _known(number: int) -> int | None:
    """Return a part of a key as findings have it; in keys, -1 stands for none."""
    return None if number < 0 else number
