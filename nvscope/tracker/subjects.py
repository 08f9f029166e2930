"""Subjects: every stream, list, node on a list, and bus of a summary, with what was measured of it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from nvscope.tracker.can.bus import CanBusSummary
from nvscope.tracker.can.summary import CanListSummary, CanStreamSummary
from nvscope.tracker.diagnosis import Diagnosis
from nvscope.tracker.figures import Of
from nvscope.tracker.intervals import NO_INTERVALS
from nvscope.tracker.latency import LatencyFigures
from nvscope.tracker.measured import Measured
from nvscope.tracker.summary import ListSummary, StreamSummary, Summary
from nvscope.tracker.together import counted_together

AnyList = ListSummary | CanListSummary
AnyStream = StreamSummary | CanStreamSummary

NO_LATENCY = LatencyFigures()


@dataclass(frozen=True, slots=True)
class Subject:
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
    """Tells what was measured of the lists, nodes, streams and buses of a summary."""

    def __init__(self, summary: Summary) -> None:
        self._together = summary.together
        self._extremes = summary.extremes
        capture = summary.capture
        self._span_ns = summary.window_ns
        if self._span_ns is None and capture.start_ns is not None and capture.at_ns is not None:
            self._span_ns = capture.at_ns - capture.start_ns
        self._streams: dict[tuple[int, int], list[StreamSummary]] = defaultdict(list)
        for entry in summary.lists:
            for stream in entry.streams:
                self._streams[entry.number, stream.node].append(stream)

    def of_list(self, entry: AnyList) -> Measured:
        """Return what was measured of a list."""
        measured = Measured(
            telegrams=sum(stream.telegrams for stream in entry.streams),
            span_ns=self._span_ns,
            extremes=self._extremes,
            diagnosis=entry.diagnosis,
            intervals=self._together.intervals.get(entry.number, NO_INTERVALS),
            jitter_percent=_worst(entry.streams),
        )
        if isinstance(entry, CanListSummary):
            return measured
        return replace(measured, counters=entry.counters, latency=self._together.latency.get(entry.number, NO_LATENCY))

    def of_node(self, entry: ListSummary, node: int, diagnosis: Diagnosis) -> Measured:
        """Return what was measured of a node on a list."""
        member = entry.number, node
        own = self._streams.get(member, [])
        return Measured(
            telegrams=sum(stream.telegrams for stream in own),
            span_ns=self._span_ns,
            extremes=self._extremes,
            diagnosis=diagnosis,
            counters=counted_together(own),
            intervals=self._together.intervals_of_node.get(member, NO_INTERVALS),
            jitter_percent=_worst(own),
            latency=self._together.latency_of_node.get(member, NO_LATENCY),
        )

    def of_nobody(self) -> Measured:
        """Return what is measured of a node on a list where it has counted nothing."""
        return Measured(
            telegrams=0, span_ns=self._span_ns, diagnosis=Diagnosis(), counters=counted_together([]), latency=NO_LATENCY
        )

    def of_stream(self, stream: AnyStream) -> Measured:
        """Return what was measured of a stream."""
        measured = Measured(
            telegrams=stream.telegrams,
            span_ns=self._span_ns,
            extremes=self._extremes,
            intervals=stream.intervals,
            jitter_percent=_worst([stream]),
        )
        if isinstance(stream, CanStreamSummary):
            return measured
        latency = self._together.latency_of_stream.get(stream.stream, NO_LATENCY)
        return replace(measured, counters=stream.counters, latency=latency)

    def of_bus(self, bus: CanBusSummary) -> Measured:
        """Return what was measured of a bus."""
        return Measured(telegrams=bus.frames, span_ns=self._span_ns, extremes=self._extremes, bus=bus)


def _worst(streams: Iterable[AnyStream]) -> float | None:
    known = (one.intervals.jitter for one in streams)
    return max((jitter.percent for jitter in known if jitter is not None), default=None)
