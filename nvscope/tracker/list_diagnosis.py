"""The diagnosis of every list, and of every node on it, summed up from the flows: NetVarUDPDiagStruct."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from nvscope.engine.keys import FrameKind
from nvscope.list_key import ListKey
from nvscope.tracker.diagnosis import ERROR_ORDER, Diagnosis
from nvscope.tracker.errors import LastError

if TYPE_CHECKING:
    from nvscope.tracker.state import TrackerState


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
    since: dict[int, tuple[int, int]] = field(default_factory=dict)
    """By sender: frame and time of its first data telegram."""

    def nodes(self) -> set[int]:
        """Return all nodes that may have counted something."""
        return {*self.sent, *self.direct, *self.acknowledged, *self.readers, *self.errors}


class Diagnosed(NamedTuple):
    """What the flows of a list come to; as ``ListSummary`` has it."""

    senders: Sequence[int]
    readers: Sequence[int]
    diagnosis: Diagnosis
    nodes: Sequence[tuple[int, Diagnosis]]
    sender_since: Mapping[int, tuple[int, int]]


def diagnose(
    state: TrackerState,
    lists: Sequence[ListKey],
    order: Sequence[tuple[bool, int]],
    reading: Mapping[int, Collection[tuple[int | None, int]]],
) -> Iterator[Diagnosed]:
    """Sum the flows up, and yield the diagnosis of each list and of the nodes on it, in the order of ``lists``.

    ``order`` is that of nodes, by number. ``reading`` are the lists that nodes read whatever they send, as (port,
    Index), without port: Index on any port.
    """
    traffic = _sum_up(state, len(lists))
    for key, seen in zip(lists, traffic, strict=True):
        names = {(key.port, key.identifier), (None, key.identifier)}
        seen.readers.update(node for node, wanted in reading.items() if not names.isdisjoint(wanted))
    errors = state.lists.errors
    for member, (number, node) in enumerate(
        zip(errors.members.high.tolist(), errors.members.low.tolist(), strict=True)
    ):
        traffic[number].errors[node] = member
    for number, seen in enumerate(traffic):
        broadcasts, nodes = _Broadcasts.of(seen), []
        for node in sorted(seen.nodes(), key=order.__getitem__):
            own, heard = seen.sent.get(node, _Tally()), _heard(seen, broadcasts, node)
            acknowledges = seen.acknowledged.get(node, 0)
            diagnosis = _diagnosis(own, heard, acknowledges, errors.of_member, seen.errors.get(node))
            if not diagnosis.blank:
                nodes.append((node, diagnosis))
        total = _Tally()
        for own in seen.sent.values():
            total.add(own.count, 0, own.last)
        whole = _diagnosis(total, seen.received, sum(seen.acknowledged.values()), errors.of_list, number)
        senders, readers = (tuple(sorted(who, key=order.__getitem__)) for who in (seen.sent, seen.readers))
        yield Diagnosed(senders, readers, whole, tuple(nodes), MappingProxyType(seen.since))


def _sum_up(state: TrackerState, lists: int) -> list[_Traffic]:
    """Return the traffic of each list."""
    columns = state.lists.flows
    names = ("kind", "list", "source", "destination", "count", "mismatches", "last_frame", "last_ns")
    table = [columns.column(name).tolist() for name in (*names, "first_frame", "first_ns")]
    traffic = [_Traffic() for _ in range(lists)]
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
            seen.since[source] = min(seen.since.get(source, (first_frame, first_ns)), (first_frame, first_ns))
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


def _diagnosis(sent: _Tally, received: _Tally, acknowledges: int, errors: LastError, row: int | None) -> Diagnosis:
    """Return a diagnosis; the errors are those of a row of their table, if it is there."""
    known = Diagnosis(
        sent.count, sent.last[1], received.count, received.last[1], received.written, nAcknowledges=acknowledges
    )  # fmt: skip
    if row is None or row >= len(errors) or not errors.count[row]:
        return known
    last = ERROR_ORDER[int(errors.error[row])].name
    return replace(
        known, nErrorCount=int(errors.count[row]), sLastError=last, tLastError=int(errors.time_ns[row])
    )  # fmt: skip
