"""The report as data: schema ``nvscope.report/1``, which every face shows and ``--json`` prints.

Absolute times are decimal strings of nanoseconds, since JavaScript cannot hold them as numbers; durations are integers;
what is absent is None. The same state gives the same document.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from nvscope.capture.source import SourceInfo
from nvscope.findings.finding import Finding
from nvscope.list_key import ListKey, Transport
from nvscope.tracker.can.summary import CanListSummary
from nvscope.tracker.stream_summary import StreamSummary
from nvscope.tracker.subjects import Measures
from nvscope.tracker.summary import ListSummary, Summary
from nvscope.version import __version__
from nvscope.view.documents.buses import can_buses
from nvscope.view.documents.can_lists import can_list
from nvscope.view.documents.figures import (
    COUNTED_OF_LIST,
    COUNTED_OF_STREAM,
    FIGURES_OF_NODE,
    PACE_OF_LIST,
    PACE_OF_STREAM,
    TELEGRAMS_OF_STREAM,
    time_text,
)

if TYPE_CHECKING:
    from nvscope.definition.model import Definition

SCHEMA = "nvscope.report/1"


def report_document(
    summary: Summary,
    findings: Sequence[Finding],
    sources: Sequence[SourceInfo],
    definition: Definition | None = None,
    values: Mapping[ListKey, list[dict[str, Any]]] | None = None,
    *,
    node_names: Mapping[str, str] = MappingProxyType({}),
    whole: Summary | None = None,
) -> dict[str, Any]:
    """Return the document of what was summarized and judged, and where it was read from.

    Lists that are defined have the name of their ``definition``. With ``values``, rows of variables by the key
    of their list, each list has its own. ``node_names`` are by the text of the address. ``whole`` is what the summary
    shows a part of: figures are those of all its streams.
    """
    names = {key: entry.name for key, entry in definition.by_key().items()} if definition else {}
    keys = {entry.number: str(entry.key) for entry in summary.lists}
    keys |= {entry.number: str(entry.key) for entry in summary.can.lists}

    def valued(entry: ListSummary | CanListSummary) -> dict[str, Any]:
        return {} if values is None else {"values": values.get(entry.key, [])}

    capture, measures = summary.capture, Measures(whole or summary)
    canopen = {bus.channel: bus.canopen for bus in summary.can.buses}
    document = {
        "schema": SCHEMA,
        "tool": {"name": "nvscope", "version": __version__},
        "capture": {
            "sources": [
                {"path": info.path, "format": info.format, "bytes": info.bytes, "frames": info.frames}
                for info in sources
            ],
            "frames": capture.frames,
            "telegrams": capture.telegrams,
            "other_frames": capture.frames - capture.telegrams,
            **({"can_frames": capture.can_frames} if capture.can_frames else {}),
            "drops": _sum(info.drops for info in sources),
            "start_ns": time_text(capture.start_ns),
            "end_ns": time_text(capture.end_ns),
        },
        "lists": [
            *(can_list(entry, names, measures, valued(entry), canopen) for entry in summary.can.lists),
            *(
                _list(entry, summary, measures, names.get(entry.key) or None, node_names, valued(entry))
                for entry in summary.lists
            ),
        ],
        "findings": [_finding(finding, keys, summary) for finding in findings],
    }
    return document | ({"buses": can_buses(summary.can, names, measures)} if summary.can.buses else {})


def _sum(counts: Iterable[int | None]) -> int | None:
    """Return the sum of counts, None where one of them is not known."""
    known = list(counts)
    return None if None in known else sum(count for count in known if count is not None)


def _list(
    entry: ListSummary,
    summary: Summary,
    measures: Measures,
    name: str | None,
    node_names: Mapping[str, str],
    values: Mapping[str, Any],
) -> dict[str, Any]:
    address, measured = summary.addresses, measures.of_list(entry)
    return {
        "key": str(entry.key),
        "transport": entry.key.transport.value,
        "port": entry.key.port,
        "id": entry.key.identifier,
        "name": name,
        "senders": [address[node] for node in entry.senders],
        "readers": [address[node] for node in entry.readers],
        **COUNTED_OF_LIST.read(measured),
        "nodes": [
            {
                "address": address[node],
                "name": node_names.get(address[node]),
                **FIGURES_OF_NODE.read(measures.of_node(entry, node, diagnosis)),
            }
            for node, diagnosis in entry.nodes
        ],
        "streams": [_stream(stream, summary, measures) for stream in entry.streams],
        **values,
        **PACE_OF_LIST.read(measured),
    }


def _stream(stream: StreamSummary, summary: Summary, measures: Measures) -> dict[str, Any]:
    measured = measures.of_stream(stream)
    return {
        "node": summary.addresses[stream.node],
        "subindex": stream.subindex,
        **TELEGRAMS_OF_STREAM.read(measured),
        "counter_scope": stream.counter_scope,
        **COUNTED_OF_STREAM.read(measured),
        "items": stream.items,
        "length": stream.length,
        "checksum": stream.checksum,
        **PACE_OF_STREAM.read(measured),
    }


def _finding(finding: Finding, keys: dict[int, str], summary: Summary) -> dict[str, Any]:
    kind = finding.kind
    return {
        "code": kind.code,
        "name": kind.name,
        "severity": kind.severity.word,
        "list": _key_of(finding, keys),
        "node": None if finding.node is None else summary.addresses[finding.node],
        "subindex": finding.subindex,
        **_on_can(finding, keys),
        "count": finding.count,
        "first_ns": time_text(finding.first_ns),
        "last_ns": time_text(finding.last_ns),
        "frames": list(finding.frames),
        "message": finding.message,
        "hint": finding.hint or kind.next_steps[0],
    }


def _key_of(finding: Finding, keys: Mapping[int, str]) -> str | None:
    if finding.list_number is not None:
        return keys[finding.list_number]
    return None if finding.key is None else str(finding.key)


def _on_can(finding: Finding, keys: Mapping[int, str]) -> dict[str, Any]:
    """Return the channel of a finding on CAN, and the lists of one that is about many."""
    transport, _, place = (_key_of(finding, keys) or "").partition("/")
    channel = finding.channel or (place.rpartition("/")[0] if transport == Transport.CAN else "")
    told: dict[str, Any] = {"channel": channel} if channel and channel != "*" else {}
    return told | ({"lists": [keys[number] for number in finding.lists]} if finding.lists else {})
