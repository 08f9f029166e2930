"""The report as data: schema ``nvscope.report/2``, which every face shows and ``--json`` prints.

Absolute times are decimal strings of nanoseconds, since JavaScript cannot hold them as numbers; durations are integers;
what is absent is None. The same state gives the same document.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from nvscope.capture.recordings import Recording, recordings
from nvscope.capture.source import SourceInfo
from nvscope.findings.finding import Finding
from nvscope.list_key import ListKey, Transport
from nvscope.tracker.can.summary import CanListSummary
from nvscope.tracker.diagnosis import Diagnosis
from nvscope.tracker.measured import Measured
from nvscope.tracker.stream_summary import StreamSummary
from nvscope.tracker.subjects import Measures
from nvscope.tracker.summary import ListSummary, Summary
from nvscope.version import head
from nvscope.view.documents.buses import can_buses
from nvscope.view.documents.can_lists import CanListRow, ValuedCanListRow
from nvscope.view.documents.causes import cause_rows
from nvscope.view.documents.drawn import Drawn, DrawnRow, Part, fields, lists, plain
from nvscope.view.documents.figures import (
    COUNTED_OF_LIST,
    COUNTED_OF_STREAM,
    FIGURES_OF_NODE,
    PACE_OF_LIST,
    PACE_OF_STREAM,
    TELEGRAMS_OF_STREAM,
    time_text,
)
from nvscope.view.documents.measured_row import MeasuredRow, of_measured, with_values
from nvscope.view.documents.verdicts import Verdicts, key_of, verdicts

if TYPE_CHECKING:
    from nvscope.causes.cause import Cause
    from nvscope.definition.model import Definition

SCHEMA = "nvscope.report/2"


def report_document(
    summary: Summary,
    findings: Sequence[Finding],
    sources: Sequence[SourceInfo],
    definition: Definition | None = None,
    values: Mapping[ListKey, list[dict[str, Any]]] | None = None,
    *,
    node_names: Mapping[str, str] = MappingProxyType({}),
    whole: Summary | None = None,
    all_findings: Sequence[Finding] | None = None,
    causes: Sequence[Cause] = (),
    left_out: int = 0,
    drawn: bool = False,
    secrets: bool = False,
) -> dict[str, Any]:
    """Return the document of what was summarized and judged, and where it was read from.

    Lists that are defined have the name of their ``definition``. With ``values``, rows of variables by the key
    of their list, each list has its own. ``node_names`` are by the text of the address. ``whole`` is what the summary
    shows a part of: figures are those of all its streams; ``all_findings`` are those that ``findings`` were chosen
    from: they decide on the status of lists. ``causes`` are those to be shown; for ``left_out`` events there was no
    room, so that they are told without these. ``drawn``: lists and findings are made when they are asked for
    (``nvscope.view.documents.drawn``), so that never all of them are there. ``secrets``: passwords that pages wrote are
    not hidden.
    """
    names = {key: entry.name for key, entry in definition.by_key().items()} if definition else {}
    keys, shown = _keys(whole or summary), _keys(summary)
    judged = verdicts(findings, findings if all_findings is None else all_findings, keys, frozenset(shown.values()))
    capture, measures = summary.capture, Measures(whole or summary)
    canopen = {bus.channel: bus.canopen for bus in summary.can.buses}
    context = _ListContext(summary, measures, names, node_names, judged, keys)
    list_row, can_row = (_ListRow, CanListRow) if values is None else (_ValuedListRow, ValuedCanListRow)

    def row_of(entry: ListSummary | CanListSummary) -> Mapping[str, Any]:
        if isinstance(entry, ListSummary):
            return list_row(context, entry, values)
        return can_row(entry, keys[entry.number], names, measures, values, canopen, judged)

    document = {
        **head(SCHEMA),
        "capture": {
            "sources": [
                {"path": info.path, "format": info.format, "bytes": info.bytes, "frames": info.frames}
                for info in sorted(sources, key=_begin)
            ],
            "frames": capture.frames,
            "telegrams": capture.telegrams,
            "other_frames": capture.frames - capture.telegrams,
            **({"can_frames": capture.can_frames} if capture.can_frames else {}),
            **_recordings(recordings(sources, capture.start_ns, capture.at_ns)),
            **_drops(sources),
            "start_ns": time_text(capture.start_ns),
            "end_ns": time_text(capture.end_ns),
            "until_ns": time_text(None if capture.until_ns is None else capture.at_ns),
        },
        "totals": judged.totals,
        "causes": cause_rows(whole or summary, causes),
        **({"evidence_left_out": left_out} if left_out else {}),
        "lists": Drawn((*summary.can.lists, *summary.lists), row_of),
        "findings": Drawn(findings, lambda finding: _finding_row(finding, keys, summary)),
    }
    whole_summary = whole or summary
    if whole_summary.parameters:
        from nvscope.view.documents.parameters import sdo_rows  # noqa: PLC0415

        document["sdo"] = sdo_rows(whole_summary.parameters, node_names)
    if whole_summary.parameter_writes:
        from nvscope.view.documents.parameter_writes import sdo_write_rows  # noqa: PLC0415

        known = definition.parameters if definition else None
        document["sdo_writes"] = sdo_write_rows(whole_summary.parameter_writes, known, node_names)
    if pages := whole_summary.others.get("visu"):
        from nvscope.view.documents.visu import visu_rows  # noqa: PLC0415

        document["visu"] = visu_rows(pages, node_names)
    if spoken := whole_summary.others.get("visu_others"):
        from nvscope.view.documents.visu import visu_other_rows  # noqa: PLC0415

        document["visu_others"] = visu_other_rows(spoken, node_names)
    if written := whole_summary.others.get("visu_writes"):
        from nvscope.view.documents.visu_writes import visu_write_rows  # noqa: PLC0415

        document["visu_writes"] = visu_write_rows(written, node_names, secrets=secrets)
    if unchanging := whole_summary.others.get("visu_unchanging"):
        from nvscope.view.documents.visu import unchanging_rows  # noqa: PLC0415

        document["visu_unchanging"] = unchanging_rows(unchanging, node_names)
    if databases := whole_summary.others.get("db"):
        from nvscope.view.documents.databases import database_rows  # noqa: PLC0415

        document["databases"] = database_rows(databases)
    document |= {"buses": can_buses(summary.can, names, measures)} if summary.can.buses else {}
    return document if drawn else dict(plain(document))


def _keys(summary: Summary) -> dict[int, str]:
    """Return the keys of lists by number."""
    lists = {entry.number: str(entry.key) for entry in summary.lists}
    return lists | {entry.number: str(entry.key) for entry in summary.can.lists}


def _begin(info: SourceInfo) -> tuple[bool, int, str]:
    """Return by what sources are sorted, so that it does not matter in which order a person names them."""
    return info.start_ns is None, info.start_ns or 0, info.path


def _recordings(found: Sequence[Recording]) -> dict[str, Any]:
    """Return recordings, where there are several."""
    if len(found) < 2:
        return {}
    return {
        "recordings": [
            {"start_ns": time_text(one.start_ns), "end_ns": time_text(one.end_ns), "first": one.first, "last": one.last}
            for one in found
        ]
    }


def _drops(sources: Sequence[SourceInfo]) -> dict[str, Any]:
    """Return how many packets were lost while capturing, and where as far as that is told; None if one cannot know."""
    parts: Counter[str] = Counter()
    drops = 0
    for info in sources:
        if info.drops is None:
            return {"drops": None, "drops_by": None}
        drops += info.drops
        parts.update(info.drops_by)
    return {"drops": drops, "drops_by": {name: parts[name] for name in sorted(parts) if parts[name]}}


class _ListContext(NamedTuple):
    """What the rows of lists are made with."""

    summary: Summary
    measures: Measures
    names: Mapping[ListKey, str]
    node_names: Mapping[str, str]
    judged: Verdicts
    keys: Mapping[int, str]


class _StreamRow(MeasuredRow):
    """A stream on UDP."""

    __slots__ = ("context", "stream")

    def __init__(self, context: _ListContext, stream: StreamSummary) -> None:
        super().__init__()
        self.context, self.stream = context, stream

    def measure(self) -> Measured:
        return self.context.measures.of_stream(self.stream)

    PARTS: ClassVar[Sequence[Part]] = (
        fields(
            node=lambda row: row.context.summary.addresses[row.stream.node],
            subindex=lambda row: row.stream.subindex,
        ),
        of_measured(TELEGRAMS_OF_STREAM),
        fields(counter_scope=lambda row: row.stream.counter_scope),
        of_measured(COUNTED_OF_STREAM),
        fields(
            items=lambda row: row.stream.items,
            length=lambda row: row.stream.length,
            checksum=lambda row: row.stream.checksum,
        ),
        of_measured(PACE_OF_STREAM),
    )


class _NodeRow(MeasuredRow):
    """A node on a list."""

    __slots__ = ("address", "context", "diagnosis", "entry", "node")

    def __init__(self, context: _ListContext, entry: ListSummary, node: int, diagnosis: Diagnosis) -> None:
        super().__init__()
        self.context, self.entry, self.node, self.diagnosis = context, entry, node, diagnosis
        self.address = context.summary.addresses[node]

    def measure(self) -> Measured:
        # No report has counters of a node.
        return self.context.measures.of_node(self.entry, self.node, self.diagnosis, counters=False)

    PARTS: ClassVar[Sequence[Part]] = (
        fields(
            address=lambda row: row.address,
            name=lambda row: row.context.node_names.get(row.address),
        ),
        of_measured(FIGURES_OF_NODE),
    )


class _ListRow(MeasuredRow):
    """A list on UDP."""

    __slots__ = ("context", "entry", "values_of")

    def __init__(
        self, context: _ListContext, entry: ListSummary, values: Mapping[ListKey, list[dict[str, Any]]] | None
    ) -> None:  # fmt: skip
        super().__init__()
        self.context, self.entry, self.values_of = context, entry, values

    def measure(self) -> Measured:
        return self.context.measures.of_list(self.entry)

    def nodes(self) -> Drawn[_NodeRow]:
        context, entry = self.context, self.entry
        return Drawn(entry.nodes, lambda told: _NodeRow(context, entry, *told))

    def streams(self) -> Drawn[_StreamRow]:
        context = self.context
        return Drawn(self.entry.streams, lambda stream: _StreamRow(context, stream))

    def addresses(self, nodes: Sequence[int]) -> list[str]:
        return [self.context.summary.addresses[node] for node in nodes]

    PARTS: ClassVar[Sequence[Part]] = (
        fields(
            key=lambda row: row.context.keys[row.entry.number],
            transport=lambda row: row.entry.key.transport.value,
            port=lambda row: row.entry.key.port,
            id=lambda row: row.entry.key.identifier,
            name=lambda row: row.context.names.get(row.entry.key) or None,
            status=lambda row: row.context.judged.status(row.context.keys[row.entry.number]),
            senders=lambda row: row.addresses(row.entry.senders),
            readers=lambda row: row.addresses(row.entry.readers),
        ),
        of_measured(COUNTED_OF_LIST),
        lists(nodes=lambda row: row.nodes(), streams=lambda row: row.streams()),
        of_measured(PACE_OF_LIST),
    )


class _ValuedListRow(_ListRow):
    """The same with its variables."""

    __slots__ = ()
    PARTS: ClassVar = with_values(_ListRow.PARTS)


class _FindingRow(DrawnRow):
    """A finding."""

    __slots__ = ("finding", "list_keys", "summary")

    def __init__(self, finding: Finding, keys: Mapping[int, str], summary: Summary) -> None:
        super().__init__()
        self.finding, self.list_keys, self.summary = finding, keys, summary

    PARTS: ClassVar[Sequence[Part]] = (
        fields(
            code=lambda row: row.finding.kind.code,
            name=lambda row: row.finding.kind.name,
            severity=lambda row: row.finding.kind.severity.word,
            list=lambda row: key_of(row.finding, row.list_keys),
            node=lambda row: None if row.finding.node is None else row.summary.addresses[row.finding.node],
            subindex=lambda row: row.finding.subindex,
        ),
        fields(
            count=lambda row: row.finding.count,
            extent=lambda row: row.finding.extent,
            first_ns=lambda row: time_text(row.finding.first_ns),
            last_ns=lambda row: time_text(row.finding.last_ns),
            frames=lambda row: list(row.finding.frames),
            frames_cut=lambda row: row.finding.frames_cut,
            message=lambda row: row.finding.message,
            hint=lambda row: row.finding.hint or row.finding.kind.next_steps[0],
        ),
    )


def _finding_row(finding: Finding, keys: Mapping[int, str], summary: Summary) -> DrawnRow:
    """Return the row of a finding; one on CAN has its channel, one that is about many lists these."""
    if finding.lists:
        return _FoldedFindingRow(finding, keys, summary)
    if finding.variable:
        return _VariableFindingRow(finding, keys, summary)
    return (_CanFindingRow if _channel_of(finding, keys) else _FindingRow)(finding, keys, summary)


class _CanFindingRow(_FindingRow):
    """The same with its channel, behind its SubIndex."""

    __slots__ = ()
    PARTS: ClassVar[Sequence[Part]] = (
        _FindingRow.PARTS[0],
        fields(channel=lambda row: _channel_of(row.finding, row.list_keys)),
        _FindingRow.PARTS[1],
    )


class _VariableFindingRow(_FindingRow):
    """The same with the variable of another conversation that it is about, behind its SubIndex."""

    __slots__ = ()
    PARTS: ClassVar[Sequence[Part]] = (
        _FindingRow.PARTS[0],
        fields(variable=lambda row: row.finding.variable),
        _FindingRow.PARTS[1],
    )


_OF_PARTS = ("list", "subindex", "count", "extent", "first_ns", "last_ns", "frames", "frames_cut", "message", "hint")
"""What each of many identifiers has of its own."""


class _FoldedFindingRow(_CanFindingRow):
    """The same with the lists that it is about, and what is said of each of their identifiers."""

    __slots__ = ()

    def part(self, finding: Finding) -> dict[str, Any]:
        row = _FindingRow(finding, self.list_keys, self.summary)
        return {key: row[key] for key in _OF_PARTS}

    PARTS: ClassVar[Sequence[Part]] = (
        *_CanFindingRow.PARTS[:2],
        fields(lists=lambda row: [row.list_keys[number] for number in row.finding.lists]),
        lists(parts=lambda row: [row.part(finding) for finding in row.finding.parts]),
        _FindingRow.PARTS[1],
    )


def _channel_of(finding: Finding, keys: Mapping[int, str]) -> str:
    """Return the channel that a finding is about, "" of one on any channel or on none."""
    transport, _, place = (key_of(finding, keys) or "").partition("/")
    channel = finding.channel or (place.rpartition("/")[0] if transport == Transport.CAN else "")
    return "" if channel == "*" else channel
