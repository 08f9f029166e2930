"""Lists and buses of CAN as data: what ``nvscope.report/1`` says of them.

A frame names neither sender nor reader, and carries no counter: what cannot be known is None.
"""

from __future__ import annotations

from typing import Any

from dissectors.can_pdo import EXTENDED
from nvscope.tracker.can_summary import CanListSummary, CanStreamSummary, CanSummary
from nvscope.tracker.counters import LIST_COUNTERS, STREAM_FIGURES
from nvscope.view.diagnosis_row import diagnosis_row
from nvscope.view.intervals import interval_row


def can_list(entry: CanListSummary, name: str | None) -> dict[str, Any]:
    """Return a list on CAN, with its COB-IDs as streams; ``name`` is what people call it."""
    return {
        "key": entry.key,
        "transport": "can",
        "channel": entry.port,
        "id": entry.index & ~EXTENDED,
        "name": name,
        "senders": [],
        "readers": [],
        "diag": diagnosis_row(entry.diagnosis),
        "counters": dict.fromkeys(counter.name for counter in LIST_COUNTERS),
        "nodes": [],
        "streams": [_stream(stream) for stream in entry.streams],
    }


def can_buses(summary: CanSummary) -> list[dict[str, Any]]:
    """Return what was seen of each channel; bits are those on the wire, with stuff bits."""
    return [
        {
            "channel": bus.channel,
            "frames": bus.frames,
            "seconds": bus.seconds,
            "bits": bus.bits,
            "fast_bits": bus.fast_bits,
            "peak_bits": bus.peak_bits,
            "worst_bits": bus.worst_bits,
        }
        for bus in summary.buses
    ]


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
        "items": stream.items or None,
        "length": stream.length,
        "checksum": None,
    }
