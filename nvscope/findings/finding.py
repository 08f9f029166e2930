"""Finding: one thing that is wrong, or worth knowing, with its figures; and the facts that findings are judged from."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from nvscope.capture.source import SourceInfo
from nvscope.definition.limits import Limits
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.pdos import Pdos
from nvscope.list_key import ListKey, told_of
from nvscope.tracker.can.summary import CanListSummary, CanStreamSummary
from nvscope.tracker.events import EventRows
from nvscope.tracker.state import SHAPE_CODE, TrackerState, finding_parts
from nvscope.tracker.summary import ListSummary, StreamSummary, Summary

AnyList = ListSummary | CanListSummary
AnyStream = StreamSummary | CanStreamSummary


@dataclass(frozen=True, slots=True)
class Finding:
    """A finding of the catalogue in one place; what it does not concern is None.

    ``list_number`` is a number of the state, ``node`` one of the summary. ``frames`` are the first ten of its events
    (of those whose frames are known), times those of its first and last.
    """

    code: str
    message: str
    count: int
    first_ns: int | None
    last_ns: int | None
    frames: tuple[int, ...] = ()
    list_number: int | None = None
    node: int | None = None
    subindex: int | None = None
    hint: str = ""
    """What to check next, where the catalogue's first step does not fit the case."""


@dataclass(frozen=True, slots=True)
class Events:
    """Events of one kind and place, as logged by the tracker."""

    count: int
    first_ns: int
    last_ns: int
    frames: tuple[int, ...]


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
    def _events_by_code(self) -> dict[int, list[int]]:
        log, rows = self.state.events, defaultdict(list)
        for row, high in enumerate(log.keys.high.tolist()):
            rows[finding_parts(high, 0)[0]].append(row)
        return rows

    @cached_property
    def shape_changes(self) -> set[tuple[int | None, int | None]]:
        """The lists and nodes of which telegrams changed their shape (NV402)."""
        return {(number, node) for number, node, _, _ in self.logged(SHAPE_CODE)}

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

    def logged(self, code: int) -> list[tuple[int | None, int | None, int | None, Events]]:
        """Return the events of ``TrackerState.events`` with a code: list, node, SubIndex and events."""
        log = self.state.events
        found = []
        for row in self._events_by_code.get(code, ()):
            parts = finding_parts(int(log.keys.high[row]), int(log.keys.low[row]))[1:]
            place = [None if part < 0 else part for part in parts]
            found.append((place[0], place[1], place[2], events_of(log.rows, row)))
        return found


def events_of(rows: EventRows, row: int) -> Events:
    """Return one row of an event log."""
    frames = tuple(frame for frame in rows.frames[row].tolist() if frame)
    return Events(int(rows.count[row]), int(rows.first_ns[row]), int(rows.last_ns[row]), frames)
