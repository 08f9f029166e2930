"""Lists on CAN as data: what ``nvscope.report/1`` says of them.

A frame names neither sender nor reader, and carries no counter: what cannot be known is None.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from dissectors.canopen import title_of
from nvscope.tracker.can_summary import CanListSummary, CanStreamSummary, CanSummary
from nvscope.tracker.counters import DIAGNOSIS, LIST_COUNTERS, STREAM_FIGURES
from nvscope.view.intervals import interval_row


def canopen_label(cob_id: int, extended: bool, names: Mapping[int, str | None]) -> str | None:
    """Return what CANopen's predefined set uses a COB-ID for, such as ``heartbeat node 5``.

    None where it has none, or where a list is defined there: ``names`` has its COB-ID.
    """
    return None if extended or cob_id in names else title_of(cob_id) or None


def can_lists(summary: CanSummary, names: Mapping[int, str | None]) -> Iterator[dict[str, Any]]:
    """Yield the lists on CAN, with their COB-IDs as streams.

    ``names`` are those of lists, by COB-ID, None of one that has no name.
    """
    for entry in summary.lists:
        yield {
            "key": entry.key,
            "transport": "can",
            "channel": entry.channel,
            "id": entry.cob_id,
            "name": None if entry.streams[0].extended else names.get(entry.cob_id),
            "canopen": canopen_label(entry.cob_id, entry.streams[0].extended, names),
            "senders": [],
            "readers": [],
            "diag": _diagnosis(entry),
            "counters": dict.fromkeys(counter.name for counter in LIST_COUNTERS),
            "nodes": [],
            "streams": [_stream(stream) for stream in entry.streams],
        }


def _diagnosis(entry: CanListSummary) -> dict[str, Any]:
    """Return what a diagnosis structure would hold: on CAN, it counts nothing but frames."""
    frames = sum(stream.frames for stream in entry.streams)
    last = str(max(stream.last_ns for stream in entry.streams))
    told: dict[str, Any] = dict.fromkeys(component.name for component in DIAGNOSIS)
    return told | {
        "nSendCount": frames, "tLastSend": last, "nReceiveCount": frames, "tLastReceive": last, "nWriteCount": frames,
        "sLastError": "NOERROR", "nErrorCount": 0, "nAcknowledges": 0,
    }  # fmt: skip


def _stream(stream: CanStreamSummary) -> dict[str, Any]:
    return {
        "node": None,
        "subindex": stream.subindex,
        "cob_id": stream.cob_id,
        "extended": stream.extended,
        "telegrams": stream.frames,
        "remote": stream.remote,
        "counter_scope": None,
        **dict.fromkeys(STREAM_FIGURES),
        "interval_ns": interval_row(stream.intervals),
        "items": None,
        "length": stream.length,
        "checksum": None,
    }
