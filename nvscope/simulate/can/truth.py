"""Truth about CAN: what was put on the buses of a scenario, in the words of a report that knows the definitions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from dissectors.can.error import CLASSES
from dissectors.can.frame import EXTENDED
from nvscope.simulate.can.frame_table import CanFrameTable, frames_bits
from nvscope.simulate.can.list_facts import CanListFacts, CanStreamFacts
from nvscope.simulate.scenario import Scenario

_NO_FIGURES = ("lost", "duplicates", "overtaken", "restarts")


def can_list_truth(table: CanFrameTable, entry: CanListFacts) -> dict[str, Any]:
    """Return what is true of a list on CAN."""
    last, plan = str(table.frames.ts_ns[entry.rows[-1]]), entry.plan
    return {
        "key": str(entry.key),
        "transport": entry.key.transport.value,
        "channel": entry.key.port,
        "id": entry.key.identifier & ~EXTENDED.mask,
        "name": None if plan is None else plan.name,
        "senders": [],
        "readers": [],
        "diag": {
            "nSendCount": len(entry.rows),
            "tLastSend": last,
            "nReceiveCount": len(entry.rows),
            "tLastReceive": last,
            "nWriteCount": len(entry.rows),
            "nErrorCount": 0,
            "nAcknowledges": 0,
        },
        "counters": {},
        "nodes": [],
        "streams": [_stream(table, stream) for stream in entry.streams],
        "designed": _designed(table, entry),
    }


def can_buses(scenario: Scenario, table: CanFrameTable) -> Iterator[dict[str, Any]]:
    """Yield what is true of the buses on which anything is seen."""
    frames = table.frames
    rates = {bus.channel: bus.bit_rate for bus in scenario.bus}
    for number, channel in enumerate(scenario.channels):
        own = frames.take(frames.channel == number)
        if not len(own):
            continue
        nominal, fast = frames_bits(own)
        errors = own.identifier[own.error]
        classes = {bit.name: int(np.count_nonzero(errors & np.uint32(bit.mask))) for bit in CLASSES}
        yield {
            "channel": channel,
            "frames": len(own),
            "bits": int(nominal.sum()),
            "fast_bits": int(fast.sum()),
            "designed": {
                "bit_rate": rates.get(channel),
                "error_frames": len(errors),
                "errors": {name: count for name, count in classes.items() if count},
                "bus_off": sum(off.channel == channel for off in scenario.bus_off),
            },
        }


def _stream(table: CanFrameTable, stream: CanStreamFacts) -> dict[str, Any]:
    rows, intervals = stream.rows, stream.intervals
    return {
        "node": None,
        "subindex": stream.subindex,
        "cob_id": stream.identity.identifier,
        "extended": stream.identity.extended,
        "telegrams": len(rows),
        "remote": stream.remote,
        "counter_scope": None,
        **dict.fromkeys(_NO_FIGURES),
        "interval_ns": {
            "count": len(intervals),
            "min": int(intervals.min()) if len(intervals) else None,
            "max": int(intervals.max()) if len(intervals) else None,
        },
        "length": int(table.frames.length[rows[-1]]),
        "checksum": None,
    }


def _designed(table: CanFrameTable, entry: CanListFacts) -> dict[str, int] | None:
    """Return how many PDOs of a list were sent, and how many of them are never seen."""
    if not entry.entries:
        return None
    number = entry.entries[0]
    seen = int((table.frames.entry == number).sum())
    return {"telegrams_sent": table.sent_of[number], "telegrams_lost": table.sent_of[number] - seen}
