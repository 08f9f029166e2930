"""Symptoms: the events behind findings, as columns, each of which is explained by one cause.

A finding sums up a whole capture, so that one can have several causes: what its events come of is judged event by
event (causes.md, section 1).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.causes.filled import lost_in_the_end
from nvscope.engine.events import NOWHERE
from nvscope.engine.runs import distinct, rows_by
from nvscope.findings.can import INCOMPLETE_CYCLE
from nvscope.findings.can_bus import BUS_LOAD, ERROR_FRAMES
from nvscope.findings.capture import CLOCK_STEP
from nvscope.findings.catalogue import CATALOGUE
from nvscope.findings.facts import AnyList, Facts
from nvscope.findings.finding import Finding
from nvscope.findings.kind import FindingKind
from nvscope.findings.loss import DUPLICATE_TELEGRAM, OVERTAKEN_TELEGRAM, SENDER_RESTART, TELEGRAM_GAP
from nvscope.findings.parameter import SDO_ERROR_REPLY, SDO_SLOW, SDO_TIMEOUT, SDO_UNEXPECTED_REPLY
from nvscope.findings.timing import BURST, JITTER, LATE, STOPPED, TORN_CYCLE
from nvscope.findings.unusual_intervals import AnyStream
from nvscope.tracker.counters import Scope
from nvscope.tracker.event_kinds import FRAMES_KEPT, EventKind
from nvscope.tracker.evidence.event_columns import EventTable
from nvscope.tracker.evidence.evidence import PARAMETERS, Evidence
from nvscope.tracker.kept_rows import LOSS_OF_NODE, LOSS_OF_STREAM
from nvscope.tracker.parameter.events import ParameterEvent, parameter_name, variable_name

_STEPS = {
    EventKind.GAP: TELEGRAM_GAP,
    EventKind.DUPLICATE: DUPLICATE_TELEGRAM,
    EventKind.OVERTAKEN: OVERTAKEN_TELEGRAM,
    EventKind.RESTART: SENDER_RESTART,
}
_OF_EVENT = {EventKind.STEP_BACK: CLOCK_STEP, EventKind.ERROR_FRAME: ERROR_FRAMES, EventKind.BUS_OFF: ERROR_FRAMES} | {
    kind.from_event: kind for kind in CATALOGUE.values() if kind.from_event is not None
}
OF_SILENCE = (STOPPED, TELEGRAM_GAP, LATE, JITTER, TORN_CYCLE)
"""What a list breaks that does not come for a while."""

SECOND_NS = 1_000_000_000
_OF_CYCLES = (TORN_CYCLE, INCOMPLETE_CYCLE)


def code_number(kind: FindingKind) -> int:
    """Return the code of a kind of finding as a number."""
    return int(kind.code[2:])


_CODES = 1000
_OF_PARAMETERS: Mapping[IntEnum, FindingKind] = {
    ParameterEvent.TIMEOUT: SDO_TIMEOUT,
    ParameterEvent.ERROR_REPLY: SDO_ERROR_REPLY,
    ParameterEvent.UNEXPECTED_REPLY: SDO_UNEXPECTED_REPLY,
    ParameterEvent.SLOW: SDO_SLOW,
}


AS_A_WHOLE = -2
"""The ``detail`` of a row that is all of a finding, since nobody has kept its events."""


class Symptoms(NamedTuple):
    """The events behind findings, by time; columns int64 of shape (n,).

    ``finding`` is the place of the finding among all (of one that stands for several, of that one); ``code`` is its
    number. The others are as in ``EventTable``; where nobody knows, times are 0.
    """

    finding: I64
    code: I64
    list: I64
    node: I64
    subindex: I64
    channel: I64
    since_ns: I64
    time_ns: I64
    frame: I64
    amount: I64
    peer: I64
    detail: I64

    def of_kinds(self, *kinds: FindingKind) -> Bool:
        """Tell which are behind findings of some kinds."""
        table: Bool = np.zeros(_CODES, np.bool_)
        table[[code_number(kind) for kind in kinds]] = True
        return table[self.code]

    def shown(self, rows: I64) -> tuple[tuple[int, ...], int, int | None]:
        """Return the first frames of some of them, how many there are, and when the last was, None of none."""
        frames = distinct(self.frame[rows])
        frames = frames[frames > 0]
        return tuple(frames[:FRAMES_KEPT].tolist()), len(frames), int(self.time_ns[rows].max()) if len(rows) else None


def symptoms_of(
    facts: Facts, findings: Sequence[Finding], evidence: Evidence, intervals: IntervalsByStream,
    channels: Sequence[str],
) -> Symptoms:  # fmt: skip
    """Return the events behind findings; of a finding whose events nobody has kept, one that is all of it.

    ``channels`` are the names of the CAN channels by number.
    """
    places = _Places(findings, channels)
    parts = [
        *_of_tables(places, evidence), *_of_steps(facts, places, evidence), *_of_intervals(facts, places, intervals),
        *_of_silences(facts, places), *_of_overloads(facts, places), *_of_parameters(facts, findings, evidence),
    ]  # fmt: skip
    known = {finding for part in parts for finding in distinct(part.finding).tolist()}
    parts.append(_of_findings(places, known))
    whole = Symptoms(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    order = np.lexsort((whole.code, whole.frame, whole.time_ns))
    return Symptoms(*(column[order] for column in whole))


class IntervalsByStream:
    """The unusual intervals that were kept, by list, node and SubIndex; those of a stream by time."""

    def __init__(self, evidence: Evidence) -> None:
        table = evidence.columns["intervals"].table()
        rows = dict(rows_by((table.list, table.node, table.subindex)))
        # In the order of streams, so that those of one are a slice.
        self._table = _where(table, np.concatenate([*rows.values(), _NO_ROWS]))
        self._none = _where(table, slice(0))
        stop = np.cumsum([len(own) for own in rows.values()]).tolist()
        self._rows = dict(zip(rows, map(slice, [0, *stop], stop), strict=True))

    def of(self, place: tuple[int, int, int]) -> EventTable:
        """Return those of one stream."""
        rows = self._rows.get(place)
        return self._none if rows is None else _where(self._table, rows)

    def longer_than(self, least_ns: Callable[[tuple[int, ...]], int]) -> EventTable:
        """Return those of all streams that last at least as long as is asked of their stream."""
        length = [rows.stop - rows.start for rows in self._rows.values()]
        least = np.repeat(np.array([least_ns(place) for place in self._rows], np.int64), length)
        return _where(self._table, self._table.amount >= least)


_NO_ROWS = np.empty(0, np.int64)


class _Places:
    """Findings by code and place: those that stand for several, by each of them."""

    def __init__(self, findings: Sequence[Finding], channels: Sequence[str]) -> None:
        self.channels = {name: number for number, name in enumerate(channels)}
        self.each: list[tuple[int, Finding]] = [
            (number, one) for number, finding in enumerate(findings) for one in finding.parts or (finding,)
        ]
        self._number: dict[tuple[str, int, int, int, int], int] = {}
        self.of_kind: dict[FindingKind, list[tuple[int, Finding]]] = defaultdict(list)
        for number, one in self.each:
            self._number.setdefault((one.code, *self.place(one)), number)
            self.of_kind[one.kind].append((number, one))

    def place(self, finding: Finding) -> tuple[int, int, int, int]:
        """Return list, node, SubIndex and channel of a finding, ``NOWHERE`` for none."""
        channel = NOWHERE if finding.channel is None else self.channels.get(finding.channel, NOWHERE)
        parts = (finding.list_number, finding.node, finding.subindex)
        whole = tuple(NOWHERE if part is None else part for part in parts)
        return whole[0], whole[1], whole[2], channel

    def find(self, kind: FindingKind, number: int, node: int, subindex: int, channel: int) -> int:
        """Return the finding of a kind at a place, or at the narrowest one around it; ``NOWHERE`` if there is none."""
        for place in (
            (number, node, subindex, NOWHERE), (number, NOWHERE, subindex, NOWHERE), (number, node, NOWHERE, NOWHERE),
            (number, NOWHERE, NOWHERE, NOWHERE), (NOWHERE, NOWHERE, NOWHERE, channel),
            (NOWHERE, NOWHERE, NOWHERE, NOWHERE),
        ):  # fmt: skip
            found = self._number.get((kind.code, *place))
            if found is not None:
                return found
        return NOWHERE

    def behind(self, kind: FindingKind, table: EventTable) -> Symptoms | None:
        """Return those of some events that are behind findings of a kind; None where no finding is of it."""
        if kind not in self.of_kind or not len(table.frame):
            return None
        columns = table.list, table.node, table.subindex, table.channel
        finding = np.empty(len(table.frame), np.int64)
        for place, row in rows_by(columns):
            finding[row] = self.find(kind, place[0], place[1], place[2], place[3])
        chosen = np.flatnonzero(finding >= 0)
        return Symptoms(
            finding[chosen], np.full(len(chosen), code_number(kind)),
            *(getattr(table, name)[chosen] for name in Symptoms._fields[2:]),
        )  # fmt: skip


def _where(table: EventTable, chosen: Bool | I64 | slice) -> EventTable:
    return EventTable(*(column[chosen] for column in table))


def _of_tables(places: _Places, evidence: Evidence) -> Iterator[Symptoms]:
    """Yield the events that are findings as they are."""
    for theme in evidence.columns.values():
        table = theme.table()
        kinds = theme.kinds
        for number in distinct(table.kind).tolist():
            own = _where(table, table.kind == number)
            event = kinds[number]
            if not isinstance(event, EventKind):
                continue  # what protocols tell of their own is one with its finding
            of_event = _OF_CYCLES if event is EventKind.TORN_CYCLE else (_OF_EVENT.get(event),)
            for kind in of_event:
                found = None if kind is None else places.behind(kind, own)
                if found is not None:
                    yield found


def _of_steps(facts: Facts, places: _Places, evidence: Evidence) -> Iterator[Symptoms]:
    """Yield the steps of counters, in the scope that each node's Counter has; gaps that were filled lost 0."""
    table = evidence.columns["steps"].table()
    scopes = np.full(len(facts.summary.addresses) + 1, Scope.STREAM.value)
    for node, scope in facts.summary.scopes.items():
        scopes[node] = min(scope, Scope.NODE_TELEGRAM)  # both node scopes take the same steps
    table = _where(table, table.scope == scopes[table.node])
    table = table._replace(amount=lost_in_the_end(table))
    for event, kind in _STEPS.items():
        found = places.behind(kind, _where(table, table.kind == event))
        if found is not None:
            yield found


def _of_parameters(facts: Facts, findings: Sequence[Finding], evidence: Evidence) -> Iterator[Symptoms]:
    """Yield what went wrong with requests of the Parameter Manager; who is no node is told by its address alone."""
    columns = evidence.columns[PARAMETERS]
    table, kinds = columns.table(), columns.kinds
    known = facts.state.parameters.known
    if not len(table.frame) or known is None:
        return
    places = {(one.code, one.node, one.variable): number for number, one in enumerate(findings) if one.variable}
    for (number, node, detail, pair), row in rows_by((table.kind, table.node, table.detail, table.pair)):
        kind = _OF_PARAMETERS.get(kinds[number])
        if kind is None:
            continue
        variable = variable_name(*known.writes.ends(pair)[1:], parameter_name(detail))
        finding = places.get((kind.code, node if node >= 0 else None, variable))
        if finding is not None:
            own = _where(table, row)
            yield Symptoms(
                np.full(len(row), finding), np.full(len(row), code_number(kind)),
                *(getattr(own, name) for name in Symptoms._fields[2:]),
            )  # fmt: skip


def _of_intervals(facts: Facts, places: _Places, intervals: IntervalsByStream) -> Iterator[Symptoms]:
    """Yield the intervals that are late, or bursts, or what makes the jitter."""
    streams = _streams_by_place(facts)
    for kind in (LATE, JITTER, BURST):
        for number, finding in places.of_kind.get(kind, ()):
            place = places.place(finding)[:3]
            if place not in streams:
                continue
            table = intervals.of(place)
            own = _where(table, _chosen(facts, kind, *streams[place], table))
            yield Symptoms(
                np.full(len(own.frame), number), np.full(len(own.frame), code_number(kind)),
                *(getattr(own, name) for name in Symptoms._fields[2:]),
            )  # fmt: skip


def _chosen(facts: Facts, kind: FindingKind, entry: AnyList, stream: AnyStream, table: EventTable) -> Bool:
    """Tell which intervals of a stream are what a finding of a kind is about."""
    nominal_ns, limits = stream.intervals.nominal or 0, facts.limits
    if kind is BURST:
        defined = facts.definition_of(entry)
        min_gap_ns = (defined.min_gap_ns or 0) if defined else 0
        shortest_ns = max(-(-nominal_ns * limits.burst_percent // 100), min_gap_ns)
        short: Bool = (table.amount >= 0) & (table.amount < shortest_ns)
        return short
    if kind is JITTER:
        long: Bool = table.amount > (stream.intervals.p50 or 0) + nominal_ns // 2
        return long
    scope = facts.summary.scopes.get(stream.node, Scope.STREAM) if stream.node is not None else Scope.STREAM
    bit = LOSS_OF_STREAM if scope == Scope.STREAM else LOSS_OF_NODE
    late: Bool = (table.amount > nominal_ns * limits.late_percent // 100) & (table.detail & bit == 0)
    return late


def _streams_by_place(facts: Facts) -> dict[tuple[int, int, int], tuple[AnyList, AnyStream]]:
    """Return all streams with their lists, by list, node and SubIndex."""
    every: list[tuple[AnyList, AnyStream]] = [*facts.streams(), *facts.pdo_streams()]
    return {
        (entry.number, NOWHERE if stream.node is None else stream.node, stream.subindex): (entry, stream)
        for entry, stream in every
    }


def _of_silences(facts: Facts, places: _Places) -> Iterator[Symptoms]:
    """Yield the silences at the ends of captures; the time is their beginning."""
    streams = _streams_by_place(facts)
    rows: list[tuple[int, ...]] = []
    for number, finding in places.of_kind.get(STOPPED, ()):
        place = places.place(finding)
        _, stream = streams[place[:3]]
        nominal_ns = stream.intervals.nominal or 0
        for silence in facts.silences_of(stream):
            if 100 * silence.length_ns > facts.limits.stopped_percent * nominal_ns:
                rows.append(
                    (number, code_number(STOPPED), *place, silence.since_ns, silence.since_ns, silence.frame,
                     silence.length_ns, NOWHERE, silence.until_ns)
                )  # fmt: skip
    if rows:
        yield _table(rows)


def _of_overloads(facts: Facts, places: _Places) -> Iterator[Symptoms]:
    """Yield the seconds in which a bus was busier than it should be."""
    rows: list[tuple[int, ...]] = []
    loads = {bus.channel: bus.load for bus in facts.summary.can.buses}
    for number, finding in places.of_kind.get(BUS_LOAD, ()):
        load = loads.get(finding.channel or "")
        if load is None:
            continue
        place = places.place(finding)
        for second_ns in load.second_ns[load.second > facts.limits.bus_load_percent].tolist():
            end_ns = second_ns + SECOND_NS
            rows.append((number, code_number(BUS_LOAD), *place, second_ns, end_ns, 0, 1, NOWHERE, 0))
    if rows:
        yield _table(rows)


def _of_findings(places: _Places, known: set[int]) -> Symptoms:
    """Return a row for each finding of which no event is known."""
    rows = [
        (
            number, code_number(one.kind), *places.place(one), one.first_ns or 0,
            one.first_ns or 0, one.frames[0] if one.frames else 0, one.count, NOWHERE, AS_A_WHOLE,
        )
        for number, one in places.each
        if number not in known
    ]  # fmt: skip
    return _table(rows)


def _table(rows: Sequence[tuple[int, ...]]) -> Symptoms:
    whole = np.array(rows, np.int64).reshape(len(rows), len(Symptoms._fields))
    return Symptoms(*whole.T)
