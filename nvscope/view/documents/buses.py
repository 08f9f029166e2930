"""CAN buses as data: what ``nvscope.report/1`` says of each channel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from dissectors.can.canopen import ERROR_REGISTER, NODE_STATES, emergency_text
from dissectors.can.error import CLASSES, CONTROLLER_BITS
from dissectors.layout import Bit
from nvscope.list_key import ListKey, told_of
from nvscope.tracker.can.bus import BitRate, BusLoad, CanBusSummary
from nvscope.tracker.can.canopen import CanOpenNode, Emergency
from nvscope.tracker.can.errors import BusErrors
from nvscope.tracker.can.summary import CanSummary
from nvscope.tracker.figures import BUS_COUNTERS, Of
from nvscope.tracker.measured import Measured
from nvscope.view.documents.can_lists import canopen_label
from nvscope.view.documents.figures import figure_row

MOST_SECONDS = 86_400
"""The load of so many seconds is told one by one."""

_Names = Mapping[tuple[str, bool, int], tuple[str | None, str | None]]


def can_buses(summary: CanSummary, names: Mapping[ListKey, str]) -> list[dict[str, Any]]:
    """Return what was seen of each channel; bits are those on the wire, with stuff bits, loads and shares percent.

    ``by_second`` has for each second with frames when it began, its load, and the most it could have with stuff bits.
    ``names`` are those of defined lists, "" of one that has none.
    """
    known: dict[tuple[str, bool, int], tuple[str | None, str | None]] = {}
    for entry in summary.lists:
        name = told_of(names, entry.key)
        for stream in entry.streams:
            label = canopen_label(entry, stream.cob_id, defined=name is not None)
            known[str(entry.key.port), stream.extended, stream.cob_id] = name or None, label
    return [_bus(bus, known) for bus in summary.buses]


def _bus(bus: CanBusSummary, known: _Names) -> dict[str, Any]:
    identifiers = []
    for entry in bus.identifiers:
        name, label = known.get((bus.channel, entry.extended, entry.cob_id), (None, None))
        identifiers.append(
            {
                "cob_id": entry.cob_id,
                "extended": entry.extended,
                "name": name,
                "canopen": label,
                "frames": entry.frames,
                "bits": entry.bits,
                "fast_bits": entry.fast_bits,
                "share": _rounded(entry.share),
            }
        )
    return {
        "channel": bus.channel,
        **figure_row(BUS_COUNTERS, Of.BUS, Measured(telegrams=bus.frames, bus=bus)),
        "bit_rate": _bit_rate(bus.bit_rate),
        "load": _load(bus.load),
        "identifiers": identifiers,
        "errors": _errors(bus.errors),
        "canopen_nodes": [_node(node) for node in bus.canopen_nodes],
    }


def _bit_rate(rate: BitRate | None) -> dict[str, Any] | None:
    if rate is None:
        return None
    return {"nominal": rate.nominal, "data": rate.data, "source": "given" if rate.given else "found"}


def _load(load: BusLoad | None) -> dict[str, Any] | None:
    if load is None:
        return None
    columns = load.second_ns, load.second, load.second_worst
    seconds = zip(*(column[:MOST_SECONDS].tolist() for column in columns), strict=True)
    return {
        "mean": _rounded(load.mean),
        "peak": _rounded(load.peak),
        "peak_ns": str(load.peak_ns),
        "worst": _rounded(load.worst),
        "partial": load.partial,
        "by_second": [[str(began_ns), _rounded(part), _rounded(worst)] for began_ns, part, worst in seconds],
    }


def _errors(errors: BusErrors | None) -> dict[str, Any] | None:
    if errors is None:
        return None
    return {
        "frames": errors.count,
        "first_ns": str(errors.first_ns),
        "last_ns": str(errors.last_ns),
        "classes": _labelled(CLASSES, errors.classes),
        "states": _labelled(CONTROLLER_BITS, errors.states),
        "bus_off": {
            "count": errors.bus_offs,
            "restarted": errors.restarts,
            "returned": errors.returns,
            "total_ns": errors.off_ns,
            "longest_ns": errors.longest_off_ns,
            "since_ns": None if errors.off_since_ns is None else str(errors.off_since_ns),
        },
        "tx_errors": errors.tx_errors,
        "rx_errors": errors.rx_errors,
    }


def _labelled(bits: Sequence[Bit], frames: Mapping[str, int]) -> list[dict[str, Any]]:
    return [{"name": bit.name, "label": bit.label, "frames": frames[bit.name]} for bit in bits if bit.name in frames]


def _node(node: CanOpenNode) -> dict[str, Any]:
    return {
        "node": node.node,
        "state": None if node.state is None else NODE_STATES[node.state],
        "since_ns": None if node.since_ns is None else str(node.since_ns),
        "told_by": None if node.state is None else "command" if node.commanded else "heartbeat",
        "last_ns": str(node.last_ns),
        "heartbeats": node.heartbeats,
        "changes": node.changes,
        "boot_ups": node.boot_ups,
        "emergencies": node.emergencies,
        "last_emergency": _emergency(node.emergency),
    }


def _emergency(emergency: Emergency | None) -> dict[str, Any] | None:
    if emergency is None:
        return None
    return {
        "code": emergency.code,
        "text": emergency_text(emergency.code),
        "register": [name for bit, name in enumerate(ERROR_REGISTER) if emergency.register >> bit & 1],
        "time_ns": str(emergency.time_ns),
    }


def _rounded(percent: float) -> float:
    return round(percent, 3)
