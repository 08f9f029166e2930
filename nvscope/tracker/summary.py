"""What follows from a state: NetVarUDPDiagStruct of every list and node, counters, scopes, interval statistics.

Everything here is computed when asked for, from integers, and changes nothing in the state.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
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
from nvscope.tracker.counters import SCOPE_NAMES, SCOPE_UNUSED, Scope
from nvscope.tracker.diagnosis import Diagnosis
from nvscope.tracker.figures import BY_SCOPE
from nvscope.tracker.intervals import StreamIntervals
from nvscope.tracker.list_diagnosis import diagnose
from nvscope.tracker.scopes import scopes_in_force
from nvscope.tracker.state import TrackerState
from nvscope.tracker.stream_summary import StreamSummary
from nvscope.tracker.together import Together, counted_together, taken_together

UNUSED_FROM_TELEGRAMS = 8


@dataclass(frozen=True, slots=True)
class ListSummary:
    """One list: who sends and reads it, its diagnosis and that of its nodes, its counters, and its streams.

    ``sender_since`` has by sender the frame and the time of its first data telegram.
    """

    number: int
    key: ListKey
    senders: Sequence[int]
    readers: Sequence[int]
    diagnosis: Diagnosis
    counters: Mapping[str, int | None]
    nodes: Sequence[tuple[int, Diagnosis]]
    streams: Sequence[StreamSummary]
    sender_since: Mapping[int, tuple[int, int]]


@dataclass(frozen=True, slots=True)
class Summary:
    """What follows from a state; lists by port and Index, nodes by address, streams by node and SubIndex.

    ``addresses`` and ``address_order`` are by number of node: those of the state, and behind them readers of which it
    knows nothing. Of a window, ``window_ns`` is how long it was, and ``extremes`` says whether anybody kept its own.
    """

    lists: Sequence[ListSummary]
    addresses: Sequence[str]
    address_order: Sequence[tuple[bool, int]]
    scopes: Mapping[int, Scope]
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

    ``intervals_ns`` are the nominal intervals of lists that are defined, 0 where they have none. ``readers`` are the
    lists that nodes read whatever they send, as (port, Index) by the text of their address; without port: Index on any
    port. ``buses`` and ``cob_ids`` are as for ``summarize_can``. ``erratic`` are the streams whose counters are not
    believed, where that is not to be judged from this state.
    """
    keys = state.keys
    nodes = list(zip(keys.nodes.high.tolist(), keys.nodes.low.tolist(), strict=True))
    known = {node: number for number, node in enumerate(nodes)}
    reading = {known.setdefault(address.halves(text), len(known)): lists for text, lists in readers.items()}
    nodes = list(known)
    order = [address.order(*node) for node in nodes]
    scopes = scopes_in_force(state)
    keys_of_lists = [keys.list_key(number) for number in range(len(keys.lists))]
    intervals = StreamIntervals(state.senders.timing)
    diagnosed = diagnose(state, keys_of_lists, order, reading)
    streams = _streams(state, keys_of_lists, scopes, order, intervals_ns, intervals, erratic)
    lists = [
        ListSummary(
            number, key, told.senders, told.readers, told.diagnosis, MappingProxyType(counters), told.nodes, own,
            told.sender_since,
        )
        for number, (key, told, own, counters) in enumerate(
            zip(keys_of_lists, diagnosed, streams, _counters(state, streams), strict=True)
        )
        if key.transport is Transport.UDP
    ]  # fmt: skip
    lists.sort(key=lambda entry: entry.key)
    addresses = tuple(address.text(*node) for node in nodes)
    can = summarize_can(state, intervals, intervals_ns=intervals_ns, buses=buses, cob_ids=cob_ids)
    timeout_ns = state.lists.acknowledgement.timeout_ns
    capture = state.capture.summary(state.buses.frames)
    together = taken_together(state, intervals, intervals_ns)
    return Summary(
        tuple(lists), addresses, tuple(order), MappingProxyType(scopes), capture, timeout_ns, can, together
    )  # fmt: skip


def _streams(
    state: TrackerState,
    lists: Sequence[ListKey],
    scopes: Mapping[int, Scope],
    order: Sequence[tuple[bool, int]],
    intervals_ns: Mapping[ListKey, int],
    intervals: StreamIntervals,
    erratic: Collection[int] | None,
) -> list[tuple[StreamSummary, ...]]:
    """Return the streams of each list, by node and SubIndex."""
    found: list[list[StreamSummary]] = [[] for _ in lists]
    keys, memory, loss = state.keys, state.memory.columns, state.senders.loss.streams
    telegrams = memory.column("telegrams").tolist()
    for stream, (place, node) in enumerate(zip(keys.streams.high.tolist(), keys.streams.low.tolist(), strict=True)):
        if node == NOBODY_KEY:
            continue
        scope = scopes[node]
        number = int(keys.places.high[place])
        whole = intervals.of(stream, intervals_ns.get(lists[number]))
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
            figures=MappingProxyType(_figures(state, stream, scope) if counting else dict.fromkeys(BY_SCOPE, 0)),
            intervals=whole,
            items=signature & 0xFFFF,
            length=signature >> int(LENGTH_SHIFT) & 0xFFFF,
            checksum=signature >> int(CHECKSUM_SHIFT) if flags & CHECKSUM_PRESENT.mask else None,
            whole_erratic=None if erratic is None else stream in erratic,
        )
        found[number].append(summary)
    return [tuple(sorted(own, key=lambda stream: (order[stream.node], stream.subindex))) for own in found]


def _figures(state: TrackerState, stream: int, scope: Scope) -> dict[str, int]:
    loss = state.senders.loss.streams
    walk = min(scope, Scope.NODE_TELEGRAM)
    return {name: int(getattr(loss, name)[stream, walk]) for name in BY_SCOPE}


def _counters(state: TrackerState, streams: Sequence[Sequence[StreamSummary]]) -> Iterator[dict[str, int | None]]:
    """Yield the counters of each list, given its streams."""
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
    for number, own in enumerate(streams):
        yield counted_together(own) | {
            "malformed": malformed[number],
            "truncated": int(table.truncated[number]),
            "missing_acknowledgements": int(table.missing_acknowledgements[number]),
            "negative_acknowledgements": int(table.negative_acknowledgements[number]),
            "checksum_mismatches": mismatches[number],
            "bootup_requests": requests[number],
            "bootup_unanswered": int(table.bootup_unanswered[number]),
            "send_rejected": int(table.send_rejected[number]),
        }
