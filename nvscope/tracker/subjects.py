"""Subjects: every stream, list, node on a list, and bus of a summary, with what was measured of it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType

from msgspec import Struct

from nvscope.tracker.can.bus import CanBusSummary
from nvscope.tracker.can.summary import CanListSummary, CanStreamSummary
from nvscope.tracker.diagnosis import Diagnosis
from nvscope.tracker.figures import Of
from nvscope.tracker.intervals import NO_INTERVALS
from nvscope.tracker.latency import LatencyFigures
from nvscope.tracker.measured import Measured
from nvscope.tracker.stream_summary import StreamSummary
from nvscope.tracker.summary import ListSummary, Summary
from nvscope.tracker.together import counted_together

AnyList = ListSummary | CanListSummary
AnyStream = StreamSummary | CanStreamSummary

NO_LATENCY = LatencyFigures()
NO_COUNTERS: Mapping[str, int | None] = MappingProxyType({})


class Subject(Struct, frozen=True):
    """One of them: its numbers, as far as it has them, or the name of its ``channel``, and what was ``measured``.

    ``list`` and ``node`` are the numbers of the summary.
    """

    of: Of
    measured: Measured
    list: int | None = None
    node: int | None = None
    subindex: int | None = None
    channel: str | None = None


def subjects(summary: Summary) -> Iterator[Subject]:
    """Yield all subjects: lists of CAN first, each with its nodes and streams behind it, then the buses."""
    measures = Measures(summary)
    for on_can in summary.can.lists:
        yield Subject(Of.LIST, measures.of_list(on_can), on_can.number)
        for frames in on_can.streams:
            yield Subject(Of.STREAM, measures.of_stream(frames), on_can.number, None, frames.subindex)
    for entry in summary.lists:
        yield Subject(Of.LIST, measures.of_list(entry), entry.number)
        for node, diagnosis in entry.nodes:
            yield Subject(Of.NODE, measures.of_node(entry, node, diagnosis), entry.number, node)
        for stream in entry.streams:
            yield Subject(Of.STREAM, measures.of_stream(stream), entry.number, stream.node, stream.subindex)
    for bus in summary.can.buses:
        yield Subject(Of.BUS, measures.of_bus(bus), channel=bus.channel)


class Measures:
    """Tells what was measured of the lists, nodes, streams and buses of a summary.

    A list and a node may be given without some of their streams: what is told of them is that of all.
    """

    def __init__(self, summary: Summary) -> None:
        self._together = summary.together
        self._extremes = summary.extremes
        self._span_ns = summary.capture.watched_ns if summary.window_ns is None else summary.window_ns
        self._of_list: dict[int, Sequence[AnyStream]] = {}
        self._of_node: dict[tuple[int, int], list[StreamSummary]] = defaultdict(list)
        for on_can in summary.can.lists:
            self._of_list[on_can.number] = on_can.streams
        for entry in summary.lists:
            self._of_list[entry.number] = entry.streams
            for stream in entry.streams:
                self._of_node[entry.number, stream.node].append(stream)
        self._jitter_percent = {
            stream.stream: jitter.percent
            for own in self._of_list.values()
            for stream in own
            if (jitter := stream.intervals.jitter) is not None
        }

    def of_list(self, entry: AnyList) -> Measured:
        """Return what was measured of a list."""
        own = self._of_list[entry.number]
        counters, latency = NO_COUNTERS, None
        if isinstance(entry, ListSummary):
            counters, latency = entry.counters, self._together.latency.get(entry.number, NO_LATENCY)
        return Measured(
            telegrams=sum(stream.telegrams for stream in own),
            span_ns=self._span_ns,
            extremes=self._extremes,
            diagnosis=entry.diagnosis,
            counters=counters,
            intervals=self._together.intervals.get(entry.number, NO_INTERVALS),
            jitter_percent=self._worst_jitter(own),
            latency=latency,
        )

    def of_node(self, entry: ListSummary, node: int, diagnosis: Diagnosis, *, counters: bool = True) -> Measured:
        """Return what was measured of a node on a list; without ``counters``, nothing of its counters."""
        member = entry.number, node
        own = self._of_node.get(member, [])
        return Measured(
            telegrams=sum(stream.telegrams for stream in own),
            span_ns=self._span_ns,
            extremes=self._extremes,
            diagnosis=diagnosis,
            counters=counted_together(own) if counters else NO_COUNTERS,
            intervals=self._together.intervals_of_node.get(member, NO_INTERVALS),
            jitter_percent=self._worst_jitter(own),
            latency=self._together.latency_of_node.get(member, NO_LATENCY),
        )

    def of_nobody(self) -> Measured:
        """Return what is measured of a node on a list where it has counted nothing."""
        return Measured(
            telegrams=0, span_ns=self._span_ns, diagnosis=Diagnosis(), counters=counted_together([]), latency=NO_LATENCY
        )

    def of_stream(self, stream: AnyStream) -> Measured:
        """Return what was measured of a stream."""
        counters, latency = NO_COUNTERS, None
        if isinstance(stream, StreamSummary):
            counters, latency = stream.counters, self._together.latency_of_stream.get(stream.stream, NO_LATENCY)
        return Measured(
            telegrams=stream.telegrams,
            remote=stream.remote if isinstance(stream, CanStreamSummary) else None,
            span_ns=self._span_ns,
            extremes=self._extremes,
            counters=counters,
            intervals=stream.intervals,
            jitter_percent=self._jitter_percent.get(stream.stream),
            latency=latency,
        )

    def of_bus(self, bus: CanBusSummary) -> Measured:
        """Return what was measured of a bus."""
        return Measured(telegrams=bus.frames, span_ns=self._span_ns, extremes=self._extremes, bus=bus)

    def _worst_jitter(self, streams: Iterable[AnyStream]) -> float | None:
        known = self._jitter_percent
        return max((known[one.stream] for one in streams if one.stream in known), default=None)
