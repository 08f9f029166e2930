"""Losses: behind which frames values were lost, of the lists of a session.

What a gap in a Counter means depends on what the sender counts: a whole capture tells, and is therefore read again once
something may be missing. Live, what is known by then has to do.

A telegram that comes late, behind newer ones of its stream, tells what was, and not what is: it is in no row, and lost
for them. So the gap in front of the newer ones stays one. Where one Counter runs through all that a sender sends, a
telegram may fill a gap in that and be behind nothing of its own stream: that one is no later than it should be, unless
cycles of its list are logged, and a later one has begun (``passed_cycles``).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterable, Mapping
from operator import itemgetter
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from msgspec import Struct, field

from dissectors.batch import I64
from nvscope.capture.source import LostSpan, SourceInfo
from nvscope.datalogger.passed_cycles import PassedCycles
from nvscope.datalogger.wanted import WantedStreams
from nvscope.engine.rows import DataRows
from nvscope.engine.told import Told
from nvscope.list_key import ListKey, told_of
from nvscope.tracker.counters import Scope
from nvscope.tracker.loss import Loss
from nvscope.tracker.node_steps import NodeSteps
from nvscope.tracker.steps import WINDOW, Step, Steps

if TYPE_CHECKING:
    from nvscope.tracker.summary import Summary

STOPPED_INTERVALS = 10
"""A list that is silent for more than so many intervals has stopped (NV504)."""

_Stream = tuple[ListKey, int, str]
"""List, SubIndex and sender."""


class Judged(Struct, frozen=True):
    """What is known of senders: what the Counter of each stream counts, None where it is not believed.

    ``counting`` are the streams whose senders count on one by one: by those something can be late.
    ``intervals_ns`` are those of lists that are sent cyclically. ``lacking`` are the lists that gaps in the Counters of
    nodes are of, by frame, where that is known; then ``cycles_lacking`` are those whose cycles alone lack something.
    ``lost`` is when packets were lost while capturing. ``copies`` are the frames of telegrams that came again, rising.
    """

    scopes: Mapping[_Stream, Scope | None] = field(default_factory=dict)
    counting: Collection[_Stream] = frozenset()
    intervals_ns: Mapping[ListKey, int] = field(default_factory=dict)
    lacking: Mapping[int, Collection[ListKey]] = field(default_factory=dict)
    cycles_lacking: Mapping[int, Collection[ListKey]] = field(default_factory=dict)
    lost: tuple[LostSpan, ...] = ()
    copies: I64 = field(default_factory=lambda: np.empty(0, np.int64))

    @staticmethod
    def of(
        summary: Summary, defined_ns: Mapping[ListKey, int], infos: Iterable[SourceInfo] = (),
        losses: Losses | None = None,
    ) -> Judged:  # fmt: skip
        """Return what a summary says; ``defined_ns`` are the intervals of definitions, 0 where a list has none.

        ``losses`` are those of all that it is of.
        """
        scopes: dict[_Stream, Scope | None] = {}
        known: dict[object, tuple[int, int]] = {}
        intervals: dict[ListKey, int] = {}
        for entry in summary.lists:
            for one in entry.streams:
                believed = None if one.erratic or one.scope is None else Scope(one.scope)
                stream = entry.key, one.subindex, summary.addresses[one.node]
                scopes[stream] = believed
                skipped, came = known.get(_counted(stream, believed), (0, 0))
                skipped += (one.figures["lost"] or 0) + (one.figures["overtaken"] or 0)
                known[_counted(stream, believed)] = skipped, came + one.telegrams
        timed = [(entry.key, [one.intervals for one in entry.streams]) for entry in summary.lists]
        timed += [(entry.key, [one.intervals for one in entry.streams]) for entry in summary.can.lists]
        for key, own in timed:
            defined = told_of(defined_ns, key)
            if defined != 0 and own and all(one.nominal for one in own):
                # Who sends more slowly than is defined has not stopped each time.
                measured = max(max(one.nominal or 0, one.p50 or 0) for one in own)
                intervals[key] = max(measured, defined or 0)
        lost = tuple(span for info in infos for span in info.lost)
        counting = {
            stream
            for stream, scope in scopes.items()
            if scope is not None and _counts_on(*known[_counted(stream, scope)])
        }
        lacking, cycles_lacking = ({}, {}) if losses is None else (losses.lacking, losses.cycles_lacking)
        return Judged(scopes, counting, intervals, lacking, cycles_lacking, lost)


def _counts_on(skipped: int, came: int) -> bool:
    """Tell whether telegrams count on one by one: who skips more than one for two that come may count otherwise."""
    return 2 * skipped <= came


def _counted(stream: _Stream, scope: Scope | None) -> object:
    """Return what has one Counter: a stream, or a sender."""
    return stream if scope is None or scope == Scope.STREAM else stream[2]


class _Gap(Struct):
    """A gap in front of a frame and its ``counter``; of ``count`` telegrams, some may still be ``missing``.

    ``late`` are the lists of those that came too late to be in a row, ``passed`` of those that did for a row of their
    cycle.
    """

    frame: int
    counter: int
    count: int
    missing: int
    late: set[ListKey] = field(default_factory=set)
    passed: set[ListKey] = field(default_factory=set)

    def holds(self, counter: int) -> bool:
        """Tell whether it was this telegram, by its Counter, that was missing in it, among others."""
        return 1 <= (self.counter - counter) % (1 << 16) <= self.count


class Losses:
    """Finds the gaps in the Counters of some lists, batch by batch, and what comes late.

    ``gaps`` are those of the batch observed last, as (walk, frame behind which something is missing, stream, the lists
    that it may be of). Where one Counter runs through all that a sender sends, nobody knows which list it was: it may
    be any that had come from there. ``lacking`` are the lists that such gaps are of, by frame, once all that was
    missing has come: none where late telegrams have filled it; ``cycles_lacking`` are those whose cycles alone lack
    something. ``overtaken`` are the telegrams of the batch that are behind newer ones of their stream, as (frame,
    stream, whether they were missing in the Counter of their node, too); ``passed`` are others that came when a later
    cycle of their list had begun, by the Counter of their node, as (frame, stream). ``parts`` are the SubIndexes of
    lists that are sent whole.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, keys: Collection[ListKey], parts: Mapping[ListKey, Collection[int]]) -> None:
        self._keys = frozenset(keys)
        self._loss = Loss()
        self._cycles = PassedCycles(parts)
        self._streams_of = WantedStreams(keys)
        self._wanted = np.zeros(0, np.bool_)
        self._open: dict[int, deque[_Gap]] = {}
        """The last gaps in the Counter of each node."""
        self._streams: dict[int, _Stream] = {}
        self._begun: set[int] = set()
        """The wanted streams that came."""
        self._lists: dict[int, dict[ListKey, int]] = {}
        """The wanted lists of each node, with the first frame of each."""
        self.gaps: list[tuple[int, int, _Stream, tuple[ListKey, ...]]] = []
        self.overtaken: list[tuple[int, _Stream, bool]] = []
        self.passed: list[tuple[int, _Stream]] = []
        self.lacking: dict[int, frozenset[ListKey]] = {}
        self.cycles_lacking: dict[int, frozenset[ListKey]] = {}

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        self.gaps, self.overtaken, self.passed = [], [], []
        rows = told.laid.data
        if len(rows):
            own, nodes = self._loss.observe(told, rows)
            self._wanted = self._streams_of.of(told)
            self._begin(told, rows)
            self._note_streams(told, rows, own)
            late = own.at(Step.OVERTAKEN)
            self._cycles.take(rows, own, told.first_frame)
            self._note_nodes(told, rows, nodes, late[self._wanted[rows.stream[late]]])
            self._cycles.end()
        for unheard in told.unheard:
            self._loss.resume(unheard)

    def behind(self, judged: Judged, in_cycles: Collection[ListKey] = ()) -> Mapping[ListKey, I64]:
        """Return the frames of the batch, by list, behind which telegrams are missing for good, as far as is known.

        Of lists whose telegrams are logged ``in_cycles``, those are missing that come behind their cycle.
        """
        found: dict[ListKey, list[int]] = {}
        for walk, frame, stream, lists in self.gaps:
            scope = judged.scopes.get(stream)
            if scope is None or min(scope, Scope.NODE_TELEGRAM) != walk:
                continue
            if walk != Scope.STREAM:
                known = self.lacking.get(frame, judged.lacking.get(frame, lists))
                cycles = self.cycles_lacking.get(frame, judged.cycles_lacking.get(frame, ()))
                own = in_cycles if scope == Scope.NODE_TELEGRAM else ()
                lacking = tuple(key for key in lists if key in known or (key in cycles and key in own))
            else:
                lacking = lists
            for key in lacking:
                found.setdefault(key, []).append(frame)
        return {key: np.array(frames, np.int64) for key, frames in found.items()}

    def late(self, judged: Judged, in_cycles: Collection[ListKey] = ()) -> I64:
        """Return the frames of the batch, rising, that are late by a Counter that is believed: they are in no row.

        Of lists whose telegrams are logged ``in_cycles``, those are that come behind their cycle.
        """
        found = [
            frame
            for frame, stream, is_of_node in self.overtaken
            if stream in judged.counting and (is_of_node or judged.scopes[stream] == Scope.STREAM)
        ]
        found += [
            frame
            for frame, stream in self.passed
            if stream in judged.counting
            and judged.scopes[stream] == Scope.NODE_TELEGRAM
            and self._wanted_key(stream[0]) in in_cycles
        ]
        return np.array(sorted(found), np.int64)

    def _begin(self, told: Told, rows: DataRows) -> None:
        """Note since when senders have sent the lists that are wanted."""
        runs = np.flatnonzero(self._wanted[rows.run_stream])
        first = rows.packet[rows.start[runs]] + told.first_frame
        for number, frame in zip(rows.run_stream[runs].tolist(), first.tolist(), strict=True):
            if number in self._begun:
                continue
            self._begun.add(number)
            node = int(told.keys.node_of(np.array([number]))[0])
            lists, stream = self._lists.setdefault(node, {}), told.keys.stream_key(number)
            key = self._wanted_key(stream.list)
            self._cycles.begin(node, key, stream.subindex, number)
            lists[key] = min(lists.get(key, frame), frame)

    def _wanted_key(self, key: ListKey) -> ListKey:
        return key if key in self._keys else key.on_any_channel

    def _stream(self, told: Told, number: int) -> _Stream:
        if number not in self._streams:
            key = told.keys.stream_key(number)
            self._streams[number] = key.list, key.subindex, key.sender
        return self._streams[number]

    def _note_streams(self, told: Told, rows: DataRows, steps: Steps) -> None:
        gaps = steps.at(Step.GAP)
        gaps = gaps[self._wanted[rows.stream[gaps]]]
        frame = rows.packet[gaps] + told.first_frame
        for number, own in zip(rows.stream[gaps].tolist(), frame.tolist(), strict=True):
            stream = self._stream(told, number)
            self.gaps.append((Scope.STREAM, own, stream, (self._wanted_key(stream[0]),)))

    def _note_nodes(self, told: Told, rows: DataRows, steps: NodeSteps, overtaken: I64) -> None:
        """Note gaps in the Counters of nodes, and what comes late; ``overtaken`` are the rows that are in streams."""
        gaps, late = steps.at(Step.GAP), steps.at(Step.OVERTAKEN)
        # A node's Counter runs through all that it sends: a late telegram of any list may fill a gap of these.
        nodes = told.keys.node_of(np.arange(len(self._wanted)))
        senders = np.zeros(int(nodes.max(initial=-1)) + 1, np.bool_)
        senders[nodes[self._wanted]] = True
        counts = senders[nodes]
        gaps, late = gaps[counts[rows.stream[gaps]]], late[counts[rows.stream[late]]]
        if not len(gaps) and not len(late) and not len(overtaken):
            return
        missing = dict(zip(gaps.tolist(), (steps.distance_at(gaps).astype(np.int64) - 1).tolist(), strict=True))
        is_late, is_overtaken = set(late.tolist()), set(overtaken.tolist())
        place = np.array(sorted({*missing, *is_late, *is_overtaken}), np.int64)
        for row in place[np.argsort(rows.packet[place], kind="stable")].tolist():
            number, own, counter = int(rows.stream[row]), int(rows.packet[row]) + told.first_frame, rows.counter[row]
            stream = self._stream(told, number)
            node = int(told.keys.node_of(np.array([number]))[0])
            # Each gap misses one telegram at least, and none is waited for that is further behind than the window.
            waiting = self._open.setdefault(node, deque(maxlen=WINDOW))
            gap = next((one for one in reversed(waiting) if one.holds(int(counter))), None)
            if row in is_overtaken:
                self.overtaken.append((own, stream, gap is not None))
            if row in is_late and gap is not None:
                gap.missing -= 1
                key = self._wanted_key(stream[0])
                if row in is_overtaken:
                    gap.late.add(key)
                elif self._cycles.has_passed(row, gap.frame):
                    gap.passed.add(key)
                    self.passed.append((own, stream))
                if not gap.missing:
                    self.lacking[gap.frame], self.cycles_lacking[gap.frame] = map(frozenset, (gap.late, gap.passed))
            if count := missing.get(row):
                lists = tuple(key for key, since in self._lists.get(node, {}).items() if since <= own)
                if lists:
                    self.gaps.append((Scope.NODE_TELEGRAM, own, stream, lists))
                waiting.append(_Gap(own, int(counter), count, count))


class Drops:
    """When packets were lost while capturing, each of which is told once.

    A packet that says so is known by its time, wherever the clock was set. Statistics tell of a span behind it: what is
    missing in that may have shown in Counters already.
    """

    def __init__(self, lost: Iterable[LostSpan]) -> None:
        spans = list(lost)
        self._at_packets = {span.until_ns: span for span in spans if span.at_packet and span.until_ns is not None}
        told = [(span.since_ns if span.until_ns is None else span.until_ns, span) for span in spans]
        waiting = [(when, span) for when, span in told if when is not None and when not in self._at_packets]
        self._waiting = sorted(waiting, key=itemgetter(0))

    def behind(self, time_ns: I64, first_frame: int) -> list[tuple[int, LostSpan]]:
        """Return the frames behind which packets were lost, given the times of frames that follow."""
        found = []
        if self._at_packets:
            when = np.array(sorted(self._at_packets), np.int64)
            place = np.minimum(np.searchsorted(when, time_ns), len(when) - 1)
            for row in np.flatnonzero(when[place] == time_ns).tolist():
                own = self._at_packets.pop(int(time_ns[row]), None)
                if own is not None:
                    found.append((row + first_frame, own))
        while self._waiting and len(time_ns):
            when_ns, span = self._waiting[0]
            after = np.flatnonzero(time_ns >= when_ns if span.until_ns is None else time_ns > when_ns)
            if not len(after):
                break
            del self._waiting[0]
            found.append((int(after[0]) + first_frame, span))
        return found
