"""What follows from a state: NetVarUDPDiagStruct of every list and node, counters, scopes, interval statistics.

Everything here is computed when asked for, from integers, and changes nothing in the state.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from dissectors import address
from dissectors.netvar import CHECKSUM_PRESENT
from nvscope.definition.buses import Buses
from nvscope.engine.keys import CHECKSUM_SHIFT, FLAGS_SHIFT, LENGTH_SHIFT, NOBODY_KEY, FrameKind
from nvscope.engine.reading import TIMEOUT_NS
from nvscope.list_key import ListKey, Transport
from nvscope.tracker.can.summary import CanSummary, summarize_can
from nvscope.tracker.capture import CaptureSummary
from nvscope.tracker.counters import SCOPE_NAMES, SCOPE_UNUSED, Scope, is_erratic
from nvscope.tracker.diagnosis import ERROR_ORDER, Diagnosis
from nvscope.tracker.errors import LastError
from nvscope.tracker.figures import BY_SCOPE
from nvscope.tracker.intervals import IntervalFigures, StreamIntervals
from nvscope.tracker.scopes import scopes_in_force
from nvscope.tracker.state import TrackerState
from nvscope.tracker.together import Together, counted_together, taken_together

UNUSED_FROM_TELEGRAMS = 8


@dataclass(frozen=True, slots=True)
class StreamSummary:
    """One stream: who sends which SubIndex, and what its counters and intervals say."""

    stream: int
    node: int
    subindex: int
    telegrams: int
    first_ns: int
    last_ns: int
    scope: Scope
    counter_scope: str
    figures: dict[str, int]
    intervals: IntervalFigures
    items: int
    length: int
    checksum: int | None
    whole_erratic: bool | None = field(default=None, compare=False)

    @property
    def erratic(self) -> bool:
        """Whether its counters are not believed, here or, of a window, in all that was seen up to its end."""
        if self.whole_erratic is not None:
            return self.whole_erratic
        return is_erratic(self.figures["lost"], self.telegrams, self.last_ns - self.first_ns, self.intervals.p50)

    @property
    def counters(self) -> dict[str, int | None]:
        """What is told of its ``figures``: the number of telegrams lost is unknown where the counters are erratic."""
        lost = self.figures["lost"]
        return self.figures | {"lost": None if self.erratic else lost, "lost_claimed": lost}


@dataclass(slots=True)
class ListSummary:
    """One list: who sends and reads it, its diagnosis, its counters, and its streams."""

    number: int
    key: ListKey
    senders: list[int] = field(default_factory=list)
    readers: list[int] = field(default_factory=list)
    diagnosis: Diagnosis = field(default_factory=Diagnosis)
    counters: dict[str, int | None] = field(default_factory=dict)
    nodes: list[tuple[int, Diagnosis]] = field(default_factory=list)
    streams: list[StreamSummary] = field(default_factory=list)
    sender_since: dict[int, tuple[int, int]] = field(default_factory=dict)
    """By sender: frame and time of its first data telegram."""


@dataclass(frozen=True, slots=True)
class Summary:
    """What follows from a state; lists by port and Index, nodes by address, streams by node and SubIndex.

    ``addresses`` and ``address_order`` are by number of node: those of the state, and behind them readers of which it
    knows nothing. Of a window, ``window_ns`` is how long it was, and ``extremes`` says whether anybody kept its own.
    """

    lists: list[ListSummary]
    addresses: list[str]
    address_order: list[tuple[bool, int]]
    scopes: dict[int, Scope]
    capture: CaptureSummary = field(default_factory=CaptureSummary)
    timeout_ns: int = TIMEOUT_NS
    can: CanSummary = field(default_factory=CanSummary)
    together: Together = field(default_factory=Together)
    window_ns: int | None = None
    extremes: bool = True

    @property
    def start_ns(self) -> int | None:
        """The earliest time of a frame."""
        return self.capture.start_ns

    @property
    def end_ns(self) -> int | None:
        """The latest time of a frame."""
        return self.capture.end_ns


@dataclass(slots=True)
class _Tally:
    """Telegrams counted, how many of them would be written, and the last one."""

    count: int = 0
    written: int = 0
    last: tuple[int, int | None] = (-1, None)

    def add(self, count: int, written: int, last: tuple[int, int | None]) -> None:
        if not count:
            return  # in a window, of what was seen before it
        self.count += count
        self.written += written
        self.last = max(self.last, last, key=lambda entry: entry[0])


def summarize(
    state: TrackerState,
    *,
    intervals_ns: Mapping[ListKey, int] = MappingProxyType({}),
    readers: Mapping[str, Collection[tuple[int | None, int]]] = MappingProxyType({}),
    buses: Buses | None = None,
    cob_ids: Collection[int] = (),
    erratic: Collection[int] | None = None,
) -> Summary:
    """Compute the summary of a state.

    ``intervals_ns`` are the nominal intervals of lists that have to be sent at one. ``readers`` are the lists that
    nodes read whatever they send, as (port, Index) by the text of their address; without port: Index on any port.
    ``buses`` and ``cob_ids`` are as for ``summarize_can``. ``erratic`` are the streams whose counters are not believed,
    where that is not to be judged from this state.
    """
    keys = state.keys
    nodes = list(zip(keys.nodes.high.tolist(), keys.nodes.low.tolist(), strict=True))
    known = {node: number for number, node in enumerate(nodes)}
    reading = {known.setdefault(address.halves(text), len(known)): lists for text, lists in readers.items()}
    nodes = list(known)
    order = [address.order(*node) for node in nodes]
    scopes = scopes_in_force(state)
    lists = [ListSummary(number, keys.list_key(number)) for number in range(len(keys.lists))]
    _diagnose(state, lists, order, reading)
    intervals = StreamIntervals(state.senders.timing)
    _add_streams(state, lists, scopes, order, intervals_ns, intervals, erratic)
    _count(state, lists)
    on_udp = [entry for entry in lists if entry.key.transport is Transport.UDP]
    on_udp.sort(key=lambda entry: entry.key)
    addresses = [address.text(*node) for node in nodes]
    can = summarize_can(state, intervals, intervals_ns=intervals_ns, buses=buses, cob_ids=cob_ids)
    timeout_ns = state.lists.acknowledgement.timeout_ns
    capture = state.capture.summary(state.buses.frames)
    together = taken_together(state, intervals, intervals_ns)
    return Summary(on_udp, addresses, order, scopes, capture, timeout_ns, can, together)


@dataclass(slots=True)
class _Traffic:
    """What went over one list, by node: sent, acknowledged, received by unicast, and broadcast."""

    received: _Tally = field(default_factory=_Tally)
    sent: dict[int, _Tally] = field(default_factory=lambda: defaultdict(_Tally))
    direct: dict[int, _Tally] = field(default_factory=lambda: defaultdict(_Tally))
    broadcast: dict[int, _Tally] = field(default_factory=lambda: defaultdict(_Tally))
    acknowledged: dict[int, int] = field(default_factory=lambda: defaultdict(int))
    readers: set[int] = field(default_factory=set)
    errors: dict[int, int] = field(default_factory=dict)
    """By node: its row in the table of errors."""

    def nodes(self) -> set[int]:
        """Return all nodes that may have counted something."""
        return {*self.sent, *self.direct, *self.acknowledged, *self.readers, *self.errors}


def _diagnose(
    state: TrackerState,
    lists: list[ListSummary],
    order: list[tuple[bool, int]],
    reading: Mapping[int, Collection[tuple[int | None, int]]],
) -> None:
    """Sum the flows up into the diagnosis of every list and of every node on it."""
    traffic = _sum_up(state, lists)
    for entry, seen in zip(lists, traffic, strict=True):
        names = {(entry.key.port, entry.key.identifier), (None, entry.key.identifier)}
        seen.readers.update(node for node, wanted in reading.items() if not names.isdisjoint(wanted))
    errors = state.lists.errors
    for member, (number, node) in enumerate(
        zip(errors.members.high.tolist(), errors.members.low.tolist(), strict=True)
    ):
        traffic[number].errors[node] = member
    for entry, seen in zip(lists, traffic, strict=True):
        broadcasts = _Broadcasts.of(seen)
        for node in sorted(seen.nodes(), key=order.__getitem__):
            own, heard = seen.sent.get(node, _Tally()), _heard(seen, broadcasts, node)
            diagnosis = Diagnosis(
                own.count, own.last[1], heard.count, heard.last[1], heard.written,
                nAcknowledges=seen.acknowledged.get(node, 0),
            )  # fmt: skip
            _add_errors(diagnosis, errors.of_member, seen.errors.get(node))
            if not diagnosis.blank:
                entry.nodes.append((node, diagnosis))
        entry.senders = sorted(seen.sent, key=order.__getitem__)
        entry.readers = sorted(seen.readers, key=order.__getitem__)
        total = _Tally()
        for own in seen.sent.values():
            total.add(own.count, 0, own.last)
        everything = seen.received
        entry.diagnosis = Diagnosis(
            total.count, total.last[1], everything.count, everything.last[1], everything.written,
            nAcknowledges=sum(seen.acknowledged.values()),
        )  # fmt: skip
        _add_errors(entry.diagnosis, errors.of_list, entry.number)


def _sum_up(state: TrackerState, lists: list[ListSummary]) -> list[_Traffic]:
    """Return the traffic of each list, and note in ``lists`` since when each sender sends it."""
    columns = state.lists.flows
    names = ("kind", "list", "source", "destination", "count", "mismatches", "last_frame", "last_ns")
    table = [columns.column(name).tolist() for name in (*names, "first_frame", "first_ns")]
    traffic = [_Traffic() for _ in lists]
    for kind, number, source, destination, count, mismatches, frame, time_ns, first_frame, first_ns in zip(
        *table, strict=True
    ):
        if kind in (FrameKind.HEADER_CUT, FrameKind.PDO):
            continue
        seen = traffic[number]
        last = (frame, time_ns)
        written = count - mismatches if kind == FrameKind.DATA else 0
        if kind in (FrameKind.DATA, FrameKind.MALFORMED_DATA):
            seen.sent[source].add(count, 0, last)
            since = lists[number].sender_since
            since[source] = min(since.get(source, (first_frame, first_ns)), (first_frame, first_ns))
        elif kind == FrameKind.ACKNOWLEDGEMENT:
            seen.acknowledged[source] += count
        if kind in (FrameKind.ACKNOWLEDGEMENT, FrameKind.BOOT_UP_REQUEST):
            seen.readers.add(source)
        seen.received.add(count, written, last)
        if destination < 0:
            seen.broadcast[source].add(count, written, last)
        elif destination != source:
            seen.direct[destination].add(count, written, last)
    return traffic


@dataclass(slots=True)
class _Broadcasts:
    """All broadcasts of a list, and the last one of the two nodes that sent last."""

    everything: _Tally = field(default_factory=_Tally)
    latest: list[tuple[int, _Tally]] = field(default_factory=list)

    @classmethod
    def of(cls, seen: _Traffic) -> _Broadcasts:
        told = cls(latest=sorted(seen.broadcast.items(), key=lambda entry: entry[1].last[0])[-2:])
        for tally in seen.broadcast.values():
            told.everything.add(tally.count, tally.written, tally.last)
        return told


def _heard(seen: _Traffic, broadcasts: _Broadcasts, node: int) -> _Tally:
    """Return what was delivered to a node: unicast, and to a reader the broadcasts of others."""
    tally = _Tally()
    if node in seen.direct:
        direct = seen.direct[node]
        tally.add(direct.count, direct.written, direct.last)
    if node in seen.readers:
        own, everything = seen.broadcast.get(node, _Tally()), broadcasts.everything
        last = max((sent.last for source, sent in broadcasts.latest if source != node), default=_Tally().last)
        tally.add(everything.count - own.count, everything.written - own.written, last)
    return tally


def _add_errors(diagnosis: Diagnosis, table: LastError, row: int | None) -> None:
    if row is None or row >= len(table) or not table.count[row]:
        return
    diagnosis.nErrorCount = int(table.count[row])
    diagnosis.sLastError = ERROR_ORDER[int(table.error[row])].name
    diagnosis.tLastError = int(table.time_ns[row])


def _add_streams(
    state: TrackerState,
    lists: list[ListSummary],
    scopes: dict[int, Scope],
    order: list[tuple[bool, int]],
    intervals_ns: Mapping[ListKey, int],
    intervals: StreamIntervals,
    erratic: Collection[int] | None,
) -> None:
    keys, memory, loss = state.keys, state.memory.columns, state.senders.loss.streams
    telegrams = memory.column("telegrams").tolist()
    for stream, (place, node) in enumerate(zip(keys.streams.high.tolist(), keys.streams.low.tolist(), strict=True)):
        if node == NOBODY_KEY:
            continue
        scope = scopes[node]
        entry = lists[int(keys.places.high[place])]
        whole = intervals.of(stream, intervals_ns.get(entry.key))
        counting = bool(loss.counting[stream])
        unused = not counting and telegrams[stream] >= UNUSED_FROM_TELEGRAMS
        signature = int(memory.signature[stream])
        flags = signature >> int(FLAGS_SHIFT) & 0xFF
        summary = StreamSummary(
            stream=stream,
            node=node,
            subindex=int(keys.places.low[place]),
            telegrams=telegrams[stream],
            first_ns=int(memory.first_ns[stream]),
            last_ns=int(memory.last_ns[stream]),
            scope=scope,
            counter_scope=SCOPE_UNUSED if unused else SCOPE_NAMES[scope],
            figures=_figures(state, stream, scope) if counting else dict.fromkeys(BY_SCOPE, 0),
            intervals=whole,
            items=signature & 0xFFFF,
            length=signature >> int(LENGTH_SHIFT) & 0xFFFF,
            checksum=signature >> int(CHECKSUM_SHIFT) if flags & CHECKSUM_PRESENT.mask else None,
            whole_erratic=None if erratic is None else stream in erratic,
        )
        entry.streams.append(summary)
    for entry in lists:
        entry.streams.sort(key=lambda stream: (order[stream.node], stream.subindex))


def _figures(state: TrackerState, stream: int, scope: Scope) -> dict[str, int]:
    loss = state.senders.loss.streams
    walk = min(scope, Scope.NODE_TELEGRAM)
    return {name: int(getattr(loss, name)[stream, scope if name == "duplicates" else walk]) for name in BY_SCOPE}


def _count(state: TrackerState, lists: list[ListSummary]) -> None:
    columns = state.lists.flows
    malformed: dict[int, int] = defaultdict(int)
    requests: dict[int, int] = defaultdict(int)
    mismatches: dict[int, int] = defaultdict(int)
    names = ("kind", "list", "count", "mismatches")
    for kind, number, count, mismatched in zip(*(columns.column(name).tolist() for name in names), strict=True):
        if kind in (FrameKind.MALFORMED_DATA, FrameKind.MALFORMED_OTHER):
            malformed[number] += count
        elif kind == FrameKind.BOOT_UP_REQUEST:
            requests[number] += count
        mismatches[number] += mismatched
    table = state.lists.columns
    for entry in lists:
        number = entry.number
        entry.counters = counted_together(entry.streams) | {
            "malformed": malformed[number],
            "truncated": int(table.truncated[number]),
            "missing_acknowledgements": int(table.missing_acknowledgements[number]),
            "negative_acknowledgements": int(table.negative_acknowledgements[number]),
            "checksum_mismatches": mismatches[number],
            "bootup_requests": requests[number],
            "bootup_unanswered": int(table.bootup_unanswered[number]),
            "send_rejected": int(table.send_rejected[number]),
        }
