"""The diagnosis of every list, and of every node on it, summed up from the flows: NetVarUDPDiagStruct."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.engine.keys import NOBODY, FrameKind
from nvscope.engine.runs import distinct
from nvscope.list_key import ListKey
from nvscope.tracker.diagnosis import ERROR_ORDER, Diagnosis
from nvscope.tracker.errors import LastError

if TYPE_CHECKING:
    from nvscope.tracker.state import TrackerState

_NEVER = -1
Value = TypeVar("Value")
_COLUMNS = "kind", "list", "source", "destination", "count", "mismatches", "last_frame", "last_ns"


class Diagnosed(NamedTuple):
    """What the flows of a list come to; as ``ListSummary`` has it."""

    senders: Sequence[int]
    readers: Sequence[int]
    diagnosis: Diagnosis
    nodes: Sequence[tuple[int, Diagnosis]]


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
    flows, errors = _Flows.of(state), state.lists.errors
    members = _Members(lists, order)
    is_data = (flows.kind == FrameKind.DATA) | (flows.kind == FrameKind.MALFORMED_DATA)
    acknowledges = flows.kind == FrameKind.ACKNOWLEDGEMENT
    source = members.words(flows.of_list, flows.source)
    direct = (flows.destination >= 0) & (flows.destination != flows.source)
    target = members.words(flows.of_list[direct], flows.destination[direct])
    sending = distinct(source[is_data])
    asks = acknowledges | (flows.kind == FrameKind.BOOT_UP_REQUEST)
    readers = distinct(np.append(source[asks], members.reading(reading)))
    blamed = members.words(*(word.astype(np.int64) for word in errors.members.words))
    every = distinct(np.concatenate([sending, target, readers, blamed]))

    sent = _Tally.of(np.searchsorted(every, source[is_data]), flows.where(is_data), len(every))
    heard = _Tally.of(np.searchsorted(every, target), flows.where(direct), len(every))
    is_reader = np.zeros(len(every), np.bool_)
    is_reader[np.searchsorted(every, readers)] = True
    _hear_broadcasts(heard, every, is_reader, flows.where(flows.destination == NOBODY), members)
    acknowledged = np.zeros(len(every), np.int64)
    np.add.at(acknowledged, np.searchsorted(every, source[acknowledges]), flows.telegrams[acknowledges])
    row = np.full(len(every), _NEVER)
    row[np.searchsorted(every, blamed)] = np.arange(len(blamed))
    whole_lists = state.keys.left_out.of_lists(state.keys.lists) == 0
    found = _diagnoses(sent, heard, acknowledged, errors.of_member, row, whole_lists[members.lists(every)])
    told = np.flatnonzero(~np.array([diagnosis.blank for diagnosis in found], np.bool_))
    nodes = list(zip(members.nodes(every[told]), map(found.__getitem__, told.tolist()), strict=True))

    everything = _Tally.of(flows.of_list, flows, len(lists))
    everything_sent = _Tally.of(flows.of_list[is_data], flows.where(is_data), len(lists))
    of_list = np.zeros(len(lists), np.int64)
    np.add.at(of_list, flows.of_list[acknowledges], flows.telegrams[acknowledges])
    whole = _diagnoses(everything_sent, everything, of_list, errors.of_list, np.arange(len(lists)), whole_lists)
    for senders, own_readers, diagnosis, own_nodes in zip(
        members.by_list(sending, members.nodes(sending)),
        members.by_list(readers, members.nodes(readers)),
        whole,
        members.by_list(every[told], nodes),
        strict=True,
    ):
        yield Diagnosed(senders, own_readers, diagnosis, own_nodes)


class _Members:
    """Nodes on lists as one word each: words sort by number of the list, then as addresses do."""

    def __init__(self, lists: Sequence[ListKey], order: Sequence[tuple[bool, int]]) -> None:
        self._lists = lists
        self._by_rank = np.array(sorted(range(len(order)), key=order.__getitem__), np.int64)
        self._rank = np.empty(len(order), np.int64)
        self._rank[self._by_rank] = np.arange(len(order))

    def words(self, lists: I64, node: I64) -> I64:
        """Return the words of nodes on lists."""
        return lists * len(self._rank) + self._rank[node]

    def lists(self, words: I64) -> I64:
        """Return the lists of words."""
        return words // max(len(self._rank), 1)

    def nodes(self, words: I64) -> list[int]:
        """Return the nodes of words."""
        found: list[int] = self._by_rank[words % max(len(self._rank), 1)].tolist()
        return found

    def by_list(self, words: I64, values: Sequence[Value]) -> Iterator[tuple[Value, ...]]:
        """Yield for each list what belongs to its words, which rise."""
        bounds = np.searchsorted(self.lists(words), np.arange(len(self._lists) + 1)).tolist()
        for start, stop in pairwise(bounds):
            yield tuple(values[start:stop])

    def reading(self, reading: Mapping[int, Collection[tuple[int | None, int]]]) -> I64:
        """Return the words of the nodes that read lists whatever they send."""
        if not reading:
            return np.empty(0, np.int64)
        pairs = [
            (number, node)
            for number, key in enumerate(self._lists)
            for node, wanted in reading.items()
            if (key.port, key.identifier) in wanted or (None, key.identifier) in wanted
        ]
        lists, node = np.array(pairs, np.int64).reshape(-1, 2).T
        return self.words(lists, node)


class _Flows(NamedTuple):
    """The flows that count for the diagnosis of a list, a row each."""

    kind: I64
    of_list: I64
    source: I64
    destination: I64
    telegrams: I64
    mismatches: I64
    last_frame: I64
    last_ns: I64

    @staticmethod
    def of(state: TrackerState) -> _Flows:
        table = state.lists.flows
        flows = _Flows(*(table.column(name) for name in _COLUMNS))
        return flows.where((flows.kind != FrameKind.HEADER_CUT) & (flows.kind != FrameKind.PDO))

    def where(self, chosen: Bool) -> _Flows:
        return _Flows(*(column[chosen] for column in self))


class _Tally(NamedTuple):
    """Telegrams counted, how many of them would be written, and the last one; a row a group.

    ``frame`` is ``_NEVER`` where there is none.
    """

    telegrams: I64
    written: I64
    frame: I64
    time_ns: I64

    @staticmethod
    def of(group: I64, flows: _Flows, groups: int) -> _Tally:
        """Sum flows up by group; of those of which a window has nothing, nothing is told."""
        zeros = (np.zeros(groups, np.int64) for _ in range(3))
        tally = _Tally(next(zeros), next(zeros), np.full(groups, _NEVER), next(zeros))
        np.add.at(tally.telegrams, group, flows.telegrams)
        np.add.at(tally.written, group, np.where(flows.kind == FrameKind.DATA, flows.telegrams - flows.mismatches, 0))
        frame = np.where(flows.telegrams > 0, flows.last_frame, _NEVER)
        np.maximum.at(tally.frame, group, frame)
        last = np.flatnonzero((frame == tally.frame[group]) & (frame > _NEVER))
        tally.time_ns[group[last]] = flows.last_ns[last]
        return tally

    def last_ns(self) -> list[int | None]:
        """Return the times of the last ones, None where there is none."""
        times: list[int | None] = self.time_ns.tolist()
        for row in np.flatnonzero(self.frame == _NEVER).tolist():
            times[row] = None
        return times


def _hear_broadcasts(heard: _Tally, every: I64, is_reader: Bool, sent: _Flows, members: _Members) -> None:
    """Add to what readers heard the broadcasts of others, the last of which is one of the last two nodes'."""
    source = members.words(sent.of_list, sent.source)
    senders = distinct(source)
    if not len(senders):
        return
    own = _Tally.of(np.searchsorted(senders, source), sent, len(senders))
    lists = int(members.lists(senders[-1:])[0]) + 1
    whole = _Tally.of(sent.of_list, sent, lists)
    latest = np.lexsort((own.frame, members.lists(senders)))
    stop = np.searchsorted(members.lists(senders), np.arange(lists), "right")
    start = np.searchsorted(members.lists(senders), np.arange(lists))

    reader = np.flatnonzero(is_reader)
    reader = reader[members.lists(every[reader]) < lists]
    on_list = members.lists(every[reader])
    reader, on_list = reader[stop[on_list] > start[on_list]], on_list[stop[on_list] > start[on_list]]
    place = np.minimum(np.searchsorted(senders, every[reader]), len(senders) - 1)
    sends = senders[place] == every[reader]
    count = whole.telegrams[on_list] - np.where(sends, own.telegrams[place], 0)
    written = whole.written[on_list] - np.where(sends, own.written[place], 0)
    last = latest[stop[on_list] - 1]
    other = sends & (last == place)
    last = np.where(other, latest[np.maximum(stop[on_list] - 2, start[on_list])], last)
    heard.telegrams[reader] += count
    heard.written[reader] += written
    alone = other & (stop[on_list] - start[on_list] == 1)
    frame = np.where((count != 0) & ~alone, own.frame[last], _NEVER)
    later = frame > heard.frame[reader]
    heard.frame[reader[later]], heard.time_ns[reader[later]] = frame[later], own.time_ns[last[later]]


def _diagnoses(
    sent: _Tally, received: _Tally, acknowledges: I64, errors: LastError, row: I64, whole: Bool
) -> list[Diagnosis]:  # fmt: skip
    """Return the diagnosis of each group; its errors are those of a row of their table, if it is there.

    They are unknown where not the ``whole`` list was looked at: what is left out may have been an answer, or an error.
    """
    known = np.flatnonzero((row >= 0) & (row < len(errors)) & whole)
    known = known[errors.count[row[known]] > 0]
    found = [
        Diagnosis(count, last_ns, heard, heard_ns, written, nAcknowledges=own)
        for count, last_ns, heard, heard_ns, written, own in zip(
            sent.telegrams.tolist(), sent.last_ns(), received.telegrams.tolist(), received.last_ns(),
            received.written.tolist(), acknowledges.tolist(), strict=True,
        )
    ]  # fmt: skip
    for place, own in zip(known.tolist(), row[known].tolist(), strict=True):
        told = found[place]
        found[place] = Diagnosis(
            told.nSendCount, told.tLastSend, told.nReceiveCount, told.tLastReceive, told.nWriteCount,
            ERROR_ORDER[int(errors.error[own])].name, int(errors.time_ns[own]), int(errors.count[own]),
            told.nAcknowledges,
        )  # fmt: skip
    for place in np.flatnonzero(~whole).tolist():
        found[place] = found[place]._replace(sLastError=None, tLastError=None, nErrorCount=None)
    return found
