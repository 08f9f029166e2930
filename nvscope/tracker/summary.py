"""What follows from a state: NetVarUDPDiagStruct of every list and node, counters, scopes, interval statistics.

Everything here is computed when asked for, from integers, and changes nothing in the state.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from msgspec import Struct, field

from dissectors import address
from dissectors.batch import I64, Bool
from dissectors.netvar import CHECKSUM_PRESENT
from nvscope.definition.buses import Buses
from nvscope.engine.keys import CHECKSUM_SHIFT, FLAGS_SHIFT, LENGTH_SHIFT, NOBODY_KEY, FrameKind
from nvscope.engine.limit import Missing
from nvscope.engine.reading import TIMEOUT_NS
from nvscope.list_key import ListKey, Transport
from nvscope.tracker.can.summary import CanSummary, summarize_can
from nvscope.tracker.capture import CaptureSummary
from nvscope.tracker.counters import SCOPE_NAMES, SCOPE_UNUSED, Scope, is_erratic
from nvscope.tracker.diagnosis import Diagnosis
from nvscope.tracker.figures import BY_SCOPE
from nvscope.tracker.intervals import StreamIntervals
from nvscope.tracker.list_diagnosis import diagnose
from nvscope.tracker.lists import ListColumns
from nvscope.tracker.loss import StreamSequences
from nvscope.tracker.scopes import scopes_in_force
from nvscope.tracker.state import TrackerState
from nvscope.tracker.stream_summary import StreamSummary
from nvscope.tracker.together import NOTHING_KNOWN_TOGETHER, Together, counted_together, taken_together

if TYPE_CHECKING:  # most plants have no such telegrams
    from nvscope.tracker.parameter.summary import PairSummary
    from nvscope.tracker.parameter.writes import Write

UNUSED_FROM_TELEGRAMS = 8
"""So many of a stream, all with one Counter, and it does not count; each recording's first one behind the first says
nothing, for nobody has seen what it follows."""


class ListSummary(NamedTuple):
    """One list: who sends and reads it, its diagnosis and that of its nodes, its counters, and its streams."""

    number: int
    key: ListKey
    senders: Sequence[int]
    readers: Sequence[int]
    diagnosis: Diagnosis
    counters: Mapping[str, int | None]
    nodes: Sequence[tuple[int, Diagnosis]]
    streams: Sequence[StreamSummary]


class Summary(Struct, frozen=True):
    """What follows from a state; lists by port and Index, nodes by address, streams by node and SubIndex.

    ``addresses`` and ``address_order`` are by number of node: those of the state, and behind them readers of which it
    knows nothing. ``parameters`` are all that was asked of the Parameter Manager, also of a window, and
    ``parameter_writes`` what was written, in the order of the frames; ``others`` what follows from the state of
    protocols with ports of their own, by name (``ProtocolAccumulator.summary``). Of a window, ``window_ns`` is how long
    it was, and ``extremes`` says whether anybody kept its own.
    """

    lists: Sequence[ListSummary]
    addresses: Sequence[str]
    address_order: Sequence[tuple[bool, int]]
    scopes: Mapping[int, Scope]
    capture: CaptureSummary = field(default_factory=CaptureSummary)
    timeout_ns: int = TIMEOUT_NS
    can: CanSummary = field(default_factory=CanSummary)
    together: Together = field(default_factory=Together)
    parameters: Sequence[PairSummary] = ()
    parameter_writes: Sequence[Write] = ()
    others: Mapping[str, Sequence[Any]] = field(default_factory=dict)
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
    others: dict[str, Sequence[Any]] = {}
    for name, other in state.others.items():
        told = other.summary()
        others |= {key: rows for key, rows in ((name, told.rows), *told.further.items()) if rows}
        for node in told.nodes:
            known.setdefault(node, len(known))
    nodes = list(known)
    order = [address.order(*node) for node in nodes]
    scopes = scopes_in_force(state)
    keys_of_lists = keys.list_keys()
    intervals = StreamIntervals(state.senders.timing)
    diagnosed = diagnose(state, keys_of_lists, order, reading)
    streams = _streams(state, keys_of_lists, scopes, order, intervals_ns, intervals, erratic)
    lists = [
        ListSummary(number, key, told.senders, told.readers, told.diagnosis, counters, told.nodes, own)
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
        tuple(lists), addresses, tuple(order), MappingProxyType(scopes), capture, timeout_ns, can, together,
        _parameters(state), _parameter_writes(state),
        MappingProxyType(others),
    )  # fmt: skip


def _parameters(state: TrackerState) -> Sequence[PairSummary]:
    if state.parameters.known is None:
        return ()
    from nvscope.tracker.parameter.summary import summarize_parameters  # noqa: PLC0415

    return summarize_parameters(state.parameters.known)


def _parameter_writes(state: TrackerState) -> Sequence[Write]:
    return () if state.parameters.known is None else tuple(state.parameters.known.writes.kept)


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
    keys, memory, loss = state.keys, state.memory.columns, state.senders.loss.streams
    holes = state.capture.holes
    known = np.flatnonzero(keys.streams.low != np.uint64(NOBODY_KEY))
    of_list, node, subindex = keys.described(known)
    rank = np.empty(len(order), np.int64)
    rank[sorted(range(len(order)), key=order.__getitem__)] = np.arange(len(order))
    by_place = np.lexsort((subindex, rank[node], of_list))
    known, of_list, node, subindex = known[by_place], of_list[by_place], node[by_place], subindex[by_place]
    counting, telegrams = loss.counting[known], memory.telegrams[known]
    unused = ~counting & (telegrams - np.maximum(loss.begun[known] - 1, 0) >= UNUSED_FROM_TELEGRAMS)
    signature = memory.signature[known]
    signed = (signature >> FLAGS_SHIFT & np.uint64(CHECKSUM_PRESENT.mask)) != 0
    figures = _figures(loss, known, np.array([scopes.get(one, Scope.STREAM) for one in node.tolist()], np.int64))
    columns = (
        known, of_list, node, subindex, telegrams, memory.first_ns[known], memory.last_ns[known], counting, unused,
        signature & np.uint64(0xFFFF), signature >> LENGTH_SHIFT & np.uint64(0xFFFF), signed,
        signature >> CHECKSUM_SHIFT, state.senders.loss.byte_swapped(keys)[known],
    )  # fmt: skip
    found = []
    nominal = [intervals_ns.get(key) for key in lists] if intervals_ns else [None] * len(lists)
    for (
        stream, number, own_node, part, own_telegrams, first_ns, last_ns, counts, is_unused, items, length, has, check,
        swapped,
    ), row in zip(zip(*(column.tolist() for column in columns), strict=True), figures, strict=True):  # fmt: skip
        scope, timed = scopes.get(own_node), intervals.of(stream, nominal[number])
        counted: Mapping[str, int | None] = _NOTHING_COUNTED
        if counts:
            counted = _NOTHING_KNOWN if scope is None else MappingProxyType(dict(zip(BY_SCOPE, row, strict=True)))
        if erratic is None:
            lost, duration_ns = counted["lost"], last_ns - first_ns - holes.within_ns(first_ns, last_ns)
            believed = lost is None or not is_erratic(lost, own_telegrams, duration_ns, timed.p50, swapped=swapped)
        else:
            believed = stream not in erratic
        found.append(
            StreamSummary(
                stream, own_node, part, own_telegrams, first_ns, last_ns, scope,
                SCOPE_UNUSED if is_unused else None if scope is None else SCOPE_NAMES[scope], counted, timed, items,
                length,
                check if has else None, swapped, not believed,
            )
        )  # fmt: skip
    bounds = np.searchsorted(of_list, np.arange(len(lists) + 1)).tolist()
    return [tuple(found[start:stop]) for start, stop in pairwise(bounds)]


_NOTHING_COUNTED: Mapping[str, int] = MappingProxyType(dict.fromkeys(BY_SCOPE, 0))
_NOTHING_KNOWN: Mapping[str, None] = MappingProxyType(dict.fromkeys(BY_SCOPE))


def _figures(loss: StreamSequences, stream: I64, scope: I64) -> Iterator[tuple[int, ...]]:
    """Yield the counters of streams that depend on what a sender counts, in the order of ``BY_SCOPE``."""
    walk = np.minimum(scope, Scope.NODE_TELEGRAM)
    columns = (getattr(loss, name)[stream, walk] for name in BY_SCOPE)
    return zip(*(column.tolist() for column in columns), strict=True)


def _counters(state: TrackerState, streams: Sequence[Sequence[StreamSummary]]) -> Iterator[Mapping[str, int | None]]:
    """Yield the counters of each list, given its streams."""
    columns, table = state.lists.flows, state.lists.columns
    kind, number, count, mismatches = (columns.column(name) for name in ("kind", "list", "count", "mismatches"))

    def summed(amount: I64, own: Bool) -> list[int]:
        total = np.zeros(len(streams), np.int64)
        np.add.at(total, number[own], amount[own])
        told: list[int] = total.tolist()
        return told

    malformed = (kind == FrameKind.MALFORMED_DATA) | (kind == FrameKind.MALFORMED_OTHER)
    of_list: dict[str, list[int] | list[int | None]] = {
        "malformed": summed(count, malformed),
        **_padded(table, len(streams), "truncated", "missing_acknowledgements", "negative_acknowledgements"),
        "checksum_mismatches": summed(mismatches, np.ones(len(kind), np.bool_)),
        "bootup_requests": summed(count, kind == FrameKind.BOOT_UP_REQUEST),
        **_padded(table, len(streams), "bootup_unanswered", "send_rejected"),
    }
    left_out = state.keys.left_out.of_lists(state.keys.lists)
    for name, part in _UNKNOWN_WITHOUT.items():
        of_list[name] = _known_where(of_list[name], left_out & part == 0)
    if not state.lists.acknowledgement.hears_answers:
        unknown: list[int | None] = [None] * len(streams)
        of_list |= dict.fromkeys(_UNKNOWN_UNHEARD, unknown)
    in_part = (left_out & Missing.DATA != 0).tolist()
    # Of hundreds of thousands of lists, most have counted the same, and those on CAN nothing.
    zeros = [0] * len(of_list)
    nothing = MappingProxyType({**counted_together([]), **dict.fromkeys(of_list, 0)})
    alike: dict[tuple[int | None, ...], Mapping[str, int | None]] = {}
    for own, misses_streams, *others in zip(streams, in_part, *of_list.values(), strict=True):
        if not own and not misses_streams and others == zeros:
            yield nothing
            continue
        of_streams = NOTHING_KNOWN_TOGETHER if misses_streams else counted_together(own)
        counters = {**of_streams, **dict(zip(of_list, others, strict=True))}
        yield alike.setdefault(tuple(counters.values()), MappingProxyType(counters))


_UNKNOWN_WITHOUT = {
    "missing_acknowledgements": Missing.ACKNOWLEDGEMENTS,
    "checksum_mismatches": Missing.DATA,
    "bootup_unanswered": Missing.DATA,
}
"""What nobody knows of a list of which the limit has left out something, beside the counters of its streams."""

_UNKNOWN_UNHEARD = ("missing_acknowledgements", "negative_acknowledgements", "send_rejected")
"""What nobody knows of a list where what nodes answer to each other is not to be seen."""


def _known_where(amounts: Sequence[int | None], known: Bool) -> list[int | None]:
    """Return amounts, None of those that are not known."""
    told = list(amounts)
    for place in np.flatnonzero(~known).tolist():
        told[place] = None
    return told


def _padded(table: ListColumns, lists: int, *names: str) -> dict[str, list[int]]:
    return {name: getattr(table, name)[:lists].tolist() for name in names}
