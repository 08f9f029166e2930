"""Facts: what findings are judged from, looked up once for all judges."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from nvscope.capture.formats import CAN_LOGS
from nvscope.capture.source import SourceInfo
from nvscope.definition.limits import Limits
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.pdos import Pdos
from nvscope.findings.finding import Events, events_of
from nvscope.findings.kind import FindingKind
from nvscope.findings.torn_cycles import CycleSizes
from nvscope.findings.unusual_intervals import UnusualIntervals
from nvscope.list_key import ListKey, told_of
from nvscope.tracker.can.summary import CanListSummary, CanStreamSummary
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.state import TrackerState, event_parts
from nvscope.tracker.summary import ListSummary, StreamSummary, Summary

AnyList = ListSummary | CanListSummary

Logged = tuple[int | None, int | None, int | None, Events]
"""List, node, SubIndex and events; None for what these do not concern."""


@dataclass(frozen=True)
class Facts:
    """What findings are judged from: the state, what follows from it, the sources, the limits, and the time.

    ``definition`` is what should be on the wire, None where nobody says.
    """

    state: TrackerState
    summary: Summary
    sources: Sequence[SourceInfo]
    at_ns: int
    limits: Limits = field(default_factory=Limits)
    definition: Definition | None = None

    @cached_property
    def frames_of_stream(self) -> dict[int, tuple[int, int]]:
        """The first and the last frame of each stream."""
        columns = self.state.flows
        frames: dict[int, tuple[int, int]] = {}
        for stream, first, last in zip(
            *(columns.column(name).tolist() for name in ("stream", "first_frame", "last_frame")), strict=True
        ):
            known = frames.get(stream, (first, last))
            frames[stream] = min(first, known[0]), max(last, known[1])
        return frames

    @cached_property
    def defined(self) -> dict[ListKey, ListDefinition]:
        """The defined lists."""
        return self.definition.by_key() if self.definition else {}

    @cached_property
    def pdos(self) -> Pdos:
        """The frames of the lists that are defined on CAN."""
        return Pdos(self.definition or Definition())

    @cached_property
    def streams_of_place(self) -> dict[tuple[int, int], list[StreamSummary]]:
        """The streams of each list and SubIndex."""
        places = defaultdict(list)
        for entry, stream in self.streams():
            places[entry.number, stream.subindex].append(stream)
        return places

    @cached_property
    def intervals(self) -> UnusualIntervals:
        """The intervals of all streams."""
        return UnusualIntervals(self.state)

    @cached_property
    def cycles(self) -> CycleSizes:
        """The cycles of the lists on UDP."""
        return CycleSizes(self.state.cycles)

    @cached_property
    def can_cycles(self) -> CycleSizes:
        """The cycles of the lists on CAN."""
        return CycleSizes(self.state.can.cycles)

    @cached_property
    def captured(self) -> set[str]:
        """The transports that were listened to: of what nobody captured, nothing is missed."""
        frames, on_can = self.state.frames, self.state.can.frames
        captured = set()
        if on_can or any(info.format in CAN_LOGS for info in self.sources):
            captured.add("can")
        empty = any(info.format not in CAN_LOGS and not info.frames for info in self.sources)
        if frames > on_can or empty or not captured:
            captured.add("udp")
        return captured

    @cached_property
    def shape_changes(self) -> set[tuple[int | None, int | None]]:
        """The lists and nodes of which telegrams changed their shape."""
        return {(number, node) for number, node, _, _ in self._log.get(EventKind.SHAPE_CHANGED, ())}

    @cached_property
    def causes(self) -> dict[int, dict[Any, tuple[str, Any]]]:
        """What was found out of why telegrams of a list do not fit, by list, for ``nvscope.findings.misfits``."""
        return {}

    def address(self, node: int) -> str:
        """Return the text of a node's address."""
        return self.summary.addresses[node]

    def streams(self) -> list[tuple[ListSummary, StreamSummary]]:
        """Return all streams on UDP with their lists."""
        return [(entry, stream) for entry in self.summary.lists for stream in entry.streams]

    def pdo_streams(self) -> list[tuple[CanListSummary, CanStreamSummary]]:
        """Return all streams on CAN with their lists."""
        return [(entry, stream) for entry in self.summary.can.lists for stream in entry.streams]

    def definition_of(self, entry: AnyList) -> ListDefinition | None:
        """Return the definition of a list that was seen, None where there is none."""
        return told_of(self.defined, (entry.port, entry.index))

    def reference_checksum(self, list_number: int, subindex: int) -> int:
        """Return the checksum with which all others of a list and SubIndex are compared."""
        places = self.state.keys.places
        place = places.find(np.array([list_number], np.uint64), np.array([subindex], np.uint64))[0]
        return int(self.state.consistency.places.reference[place])

    def logged(self, kind: FindingKind) -> list[Logged]:
        """Return what the tracker logged of the event that is this kind of finding, by place."""
        if kind.from_event is None:
            raise ValueError(f"{kind.code} is no event of the log")
        return self._log.get(kind.from_event, [])

    @cached_property
    def _log(self) -> dict[int, list[Logged]]:
        keys, rows = self.state.events.keys, self.state.events.rows
        found = defaultdict(list)
        for row, key in enumerate(zip(keys.high.tolist(), keys.low.tolist(), strict=True)):
            kind, *parts = event_parts(*key)
            place = [None if part < 0 else part for part in parts]
            found[kind].append((place[0], place[1], place[2], events_of(rows, row)))
        return found
