"""SeveralSenders: which nodes send a list together, within one stretch of time in which somebody listened to it.

A controller that has another address behind a time in which nobody listened to the list is one sender, not two.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import ClassVar, NamedTuple

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.keys import KeyTable
from nvscope.engine.dealing import Share
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.keys import FrameKind, Keys
from nvscope.engine.rows import StreamMemory
from nvscope.engine.runs import distinct, runs_of
from nvscope.engine.told import Told
from nvscope.engine.watch import Unheard
from nvscope.tracker.event_kinds import FRAMES_KEPT
from nvscope.tracker.events import EventLog
from nvscope.tracker.flows import Flows

_DATA = (FrameKind.DATA, FrameKind.MALFORMED_DATA)


class SendersTogether(NamedTuple):
    """The nodes that send a list together, by number, and the first telegrams of all but the first in each stretch.

    Of these telegrams there are ``further``, and ``frames`` are the first ten of them.
    """

    nodes: Collection[int]
    further: int
    first_ns: int
    last_ns: int
    frames: tuple[int, ...]


class _ListColumns(KeyedColumns):
    """One row a list: the frame (from 1) from which on somebody listens to it; 0 from the beginning."""

    since_frame: I64
    COLUMNS: ClassVar = {"since_frame": (np.int64(0), 1)}


class _FlowColumns(KeyedColumns):
    """One row a flow: where it is older than that, the first telegram of it from there on."""

    first_ns: I64
    first_frame: I64
    COLUMNS: ClassVar = {"first_ns": (np.int64(0), 1), "first_frame": (np.int64(0), 1)}


class SeveralSenders:
    """The nodes that sent a list together in stretches that have ended, and where those began that go on.

    As long as nobody stops listening, the flows know it all, and nothing is kept.
    """

    def __init__(self) -> None:
        self._lists = _ListColumns()
        self._flows = _FlowColumns()
        self._pairs = KeyTable()
        self._further = EventLog(words=1)

    def observe(self, told: Told, flows: Flows) -> None:
        """Take a batch in which there are packets; ``flows`` have not taken it yet."""
        if not len(self._lists):
            return
        varieties, known = told.keys.varieties, len(flows.counts)
        flow = varieties.column("flow")
        came = np.flatnonzero((told.count > 0) & np.isin(varieties.column("kind"), _DATA) & (flow >= 0))
        came = came[flow[came] < known]
        came = came[flows.counts.last_frame[flow[came]] < self._since(varieties.list[came])]
        if not len(came):
            return
        is_first = np.zeros(len(varieties), np.bool_)
        is_first[came] = True
        packet = np.flatnonzero(is_first[told.variety])[::-1]
        of_packet = flow[told.variety[packet]]
        self._flows.resize(known)
        # Assigned backwards, so that the first packet of each flow is what stays.
        self._flows.first_ns[of_packet] = told.packets.ts_ns[packet]
        self._flows.first_frame[of_packet] = packet + told.first_frame

    def resume(self, unheard: Unheard, flows: Flows, memory: StreamMemory, next_frame: int) -> None:
        """Let who sends a list of which nothing is heard any more be asked anew from the frame ``next_frame`` on."""
        keys = flows.keys
        ended = np.arange(len(keys.lists)) if unheard.everything else _unheard_lists(unheard, keys, memory)
        if not len(ended):
            return
        own = self._senders(flows).of_lists(ended)
        self._pairs.numbers(own.list.astype(np.uint64), own.node.astype(np.uint64))
        own = own.where(own.is_further)
        order = np.argsort(own.frame)
        self._further.record(own.time_ns[order], own.frame[order], own.list[order].astype(np.uint64))
        self._further.settle()
        self._lists.resize(len(keys.lists))
        self._lists.since_frame[ended] = next_frame

    def together(self, flows: Flows) -> dict[int, SendersTogether]:
        """Return the lists that several nodes send together, by number, rising; ``flows`` are those observed."""
        found: dict[int, SendersTogether] = {}
        nodes: dict[int, set[int]] = {}
        for number, node in zip(*(word.tolist() for word in self._pairs.words), strict=True):
            nodes.setdefault(number, set()).add(node)
        rows = self._further.rows
        for row, number in enumerate(self._further.keys.words[0].tolist()):
            frames = tuple(frame for frame in rows.frames[row].tolist() if frame)
            count, first_ns, last_ns = (int(column[row]) for column in (rows.count, rows.first_ns, rows.last_ns))
            found[number] = SendersTogether(nodes[number], count, first_ns, last_ns, frames)
        own = self._senders(flows)
        start, stop = runs_of(own.list)
        for number, first, end in zip(own.list[start].tolist(), start.tolist(), stop.tolist(), strict=True):
            before = found.get(number)
            times_ns, frames = own.time_ns[first + 1 : end].tolist(), own.frame[first + 1 : end].tolist()
            found[number] = SendersTogether(
                {*own.node[first:end].tolist(), *(before.nodes if before else ())},
                (before.further if before else 0) + len(frames),
                before.first_ns if before else times_ns[0], times_ns[-1],
                (*(before.frames if before else ()), *frames)[:FRAMES_KEPT],
            )  # fmt: skip
        return dict(sorted(found.items()))

    def take(self, part: SeveralSenders, share: Share) -> None:
        """Take over what a part has found of its share of the lists."""
        self._lists.take(part._lists, share.lists)
        self._flows.take(part._flows, share.flows)
        self._pairs.numbers(*part._pairs.words)
        self._further.take(part._further)

    def _since(self, lists: I64) -> I64:
        """Return from which frames on somebody listens to lists."""
        known = self._lists.column("since_frame")
        return np.append(known, 0)[np.minimum(lists, len(known))]

    def _senders(self, flows: Flows) -> _Senders:
        """Return who sends lists that several nodes send, in the stretches that go on."""
        kind, last_frame = flows.column("kind"), flows.column("last_frame")
        counted = len(last_frame)
        row = np.flatnonzero(np.isin(kind[:counted], _DATA) & (last_frame > 0))
        lists = flows.column("list")[row]
        since = self._since(lists)
        heard = last_frame[row] >= since
        row, lists, since = row[heard], lists[heard], since[heard]
        frame, time_ns = flows.column("first_frame")[row], flows.column("first_ns")[row]
        again = np.flatnonzero(frame < since)
        frame[again], time_ns[again] = self._flows.first_frame[row[again]], self._flows.first_ns[row[again]]
        node = flows.column("source")[row]
        order = np.lexsort((frame, node, lists))
        lists, node, frame, time_ns = lists[order], node[order], frame[order], time_ns[order]
        first = np.append(True, (lists[1:] != lists[:-1]) | (node[1:] != node[:-1]))[: len(lists)]
        found = _Senders(lists, node, frame, time_ns).where(first)
        found = found.where(np.lexsort((found.frame, found.list)))
        start, stop = runs_of(found.list)
        return found.where(np.repeat(stop - start > 1, stop - start))


class _Senders(NamedTuple):
    """Nodes that send lists, by list and first telegram, and these telegrams. Shapes (n,)."""

    list: I64
    node: I64
    frame: I64
    time_ns: I64

    def where(self, chosen: Bool | I64) -> _Senders:
        return _Senders(*(column[chosen] for column in self))

    def of_lists(self, lists: I64) -> _Senders:
        return self.where(np.isin(self.list, lists))

    @property
    def is_further(self) -> Bool:
        """Which are not the first of their list."""
        return np.append(False, self.list[1:] == self.list[:-1])[: len(self.list)]


def _unheard_lists(unheard: Unheard, keys: Keys, memory: StreamMemory) -> I64:
    """Return the lists of which something is unheard, and no stream is heard any more."""
    heard = np.flatnonzero(memory.columns.column("heard"))
    lists, kept = (keys.list_of_place(keys.place_of(stream)) for stream in (unheard.streams, heard))
    ended = distinct(lists)
    return ended[~np.isin(ended, kept)]
