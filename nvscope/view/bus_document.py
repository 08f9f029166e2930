"""CAN buses as data: what ``nvscope.report/1`` says of each channel."""

from __future__ import annotations

from typing import Any

from nvscope.tracker.can_bus import BitRate, BusLoad, CanBusSummary
from nvscope.tracker.can_summary import CanSummary


def can_buses(summary: CanSummary) -> list[dict[str, Any]]:
    """Return what was seen of each channel; bits are those on the wire, with stuff bits, loads and shares percent."""
    return [_bus(bus) for bus in summary.buses]


def _bus(bus: CanBusSummary) -> dict[str, Any]:
    return {
        "channel": bus.channel,
        "frames": bus.frames,
        "seconds": bus.seconds,
        "bits": bus.bits,
        "fast_bits": bus.fast_bits,
        "peak_bits": bus.peak_bits,
        "worst_bits": bus.worst_bits,
        "bit_rate": _bit_rate(bus.bit_rate),
        "load": _load(bus.load),
        "identifiers": [
            {
                "cob_id": entry.cob_id,
                "extended": entry.extended,
                "frames": entry.frames,
                "bits": entry.bits,
                "fast_bits": entry.fast_bits,
                "share": _rounded(entry.share),
            }
            for entry in bus.identifiers
        ],
    }


def _bit_rate(rate: BitRate | None) -> dict[str, Any] | None:
    if rate is None:
        return None
    return {"nominal": rate.nominal, "data": rate.data, "source": "given" if rate.given else "found"}


def _load(load: BusLoad | None) -> dict[str, Any] | None:
    if load is None:
        return None
    return {
        "mean": _rounded(load.mean),
        "peak": _rounded(load.peak),
        "peak_ns": str(load.peak_ns),
        "worst": _rounded(load.worst),
        "partial": load.partial,
    }


def _rounded(percent: float) -> float:
    return round(percent, 3)
