"""Lists and buses of CAN as data: what ``nvscope.report/1`` says of them.

A frame names neither sender nor reader, and carries no counter: what cannot be known is None.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dissectors.can.canopen import title_of
from dissectors.can.pdo import EXTENDED
from nvscope.list_key import ListKey, told_of
from nvscope.tracker.can.summary import CanListSummary, CanStreamSummary
from nvscope.tracker.counters import LIST_COUNTERS, STREAM_FIGURES
from nvscope.view.documents.diagnosis import diagnosis_row
from nvscope.view.documents.intervals import interval_row


def can_list(entry: CanListSummary, names: Mapping[ListKey, str]) -> dict[str, Any]:
    """Return a list on CAN, with its COB-IDs as streams; ``names`` are those of defined lists, "" of one without."""
    name = told_of(names, entry.key)
    return {
        "key": str(entry.key),
        "transport": entry.key.transport.value,
        "channel": entry.key.port,
        "id": entry.key.identifier & ~EXTENDED,
        "name": name or None,
        "canopen": canopen_label(entry, entry.key.identifier, defined=name is not None),
        "senders": [],
        "readers": [],
        "diag": diagnosis_row(entry.diagnosis),
        "counters": dict.fromkeys(counter.name for counter in LIST_COUNTERS),
        "nodes": [],
        "streams": [_stream(stream) for stream in entry.streams],
    }


def canopen_label(entry: CanListSummary, cob_id: int, *, defined: bool) -> str | None:
    """Return what CANopen's predefined set uses a COB-ID of a list for, such as ``heartbeat node 5``.

    None where it has none, or where the list is ``defined``.
    """
    return None if defined or entry.extended else title_of(cob_id) or None


def _stream(stream: CanStreamSummary) -> dict[str, Any]:
    return {
        "node": None,
        "subindex": stream.subindex,
        "cob_id": stream.cob_id,
        "extended": stream.extended,
        "telegrams": stream.telegrams,
        "remote": stream.remote,
        "counter_scope": None,
        **dict.fromkeys(STREAM_FIGURES),
        "interval_ns": interval_row(stream.intervals),
        "items": None,
        "length": stream.length,
        "checksum": None,
    }
