"""CAN buses as data: what ``nvscope.report/2`` says of each channel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from dissectors.can.canopen import ERROR_REGISTER, NODE_STATES, emergency_text
from dissectors.can.error import CLASS_LABELS, CONTROLLER_BITS
from nvscope.list_key import ListKey, told_of
from nvscope.tracker.can.bus import BitRate, BusLoad, CanBusSummary, IdentifierBits
from nvscope.tracker.can.canopen import CanOpenNode, Emergency
from nvscope.tracker.can.errors import BusErrors
from nvscope.tracker.can.summary import CanSummary
from nvscope.tracker.figures import BIT_RATES, BUS_COUNTERS, BUS_ERRORS, BY_NAME, RATE, Of
from nvscope.tracker.measured import Measured
from nvscope.tracker.subjects import Measures
from nvscope.view.documents.can_lists import canopen_label
from nvscope.view.documents.drawn import Drawn, DrawnRow, Part, fields
from nvscope.view.documents.figures import FigureRow, rounded, time_text

MOST_SECONDS = 86_400
"""The load of so many seconds is told one by one."""

_COUNTED = FigureRow(BUS_COUNTERS, Of.BUS)
_RATE = FigureRow((RATE,), Of.BUS)
_BIT_RATES = FigureRow(BIT_RATES, Of.BUS, "bit_rate")
_LOADS = FigureRow((BY_NAME["load"], BY_NAME["load_peak"]), Of.BUS, "load")
_WORST_LOAD = FigureRow((BY_NAME["load_worst"],), Of.BUS, "load")
_ERROR_FRAMES = FigureRow((BY_NAME["error_frames"],), Of.BUS, "errors")
_BUS_OFFS = FigureRow((one for one in BUS_ERRORS if one.name.startswith("bus_off")), Of.BUS, "errors.bus_off")
_ERROR_COUNTERS = FigureRow((BY_NAME["tx_errors"], BY_NAME["rx_errors"]), Of.BUS, "errors")

_STATE_LABELS = {bit.name: bit.label for bit in CONTROLLER_BITS}
_Names = Mapping[tuple[str, bool, int], tuple[str | None, str | None]]


def can_buses(summary: CanSummary, names: Mapping[ListKey, str], measures: Measures) -> list[dict[str, Any]]:
    """Return what was seen of each channel; bits are those on the wire, with stuff bits, loads and shares percent.

    ``by_second`` has for each second with frames when it began, its load, and the most it could have with stuff bits.
    ``names`` are those of defined lists, "" of one that has none.
    """
    known: dict[tuple[str, bool, int], tuple[str | None, str | None]] = {}
    canopen = {bus.channel: bus.canopen for bus in summary.buses}
    for entry in summary.lists:
        name = told_of(names, entry.key)
        for stream in entry.streams:
            label = canopen_label(entry, stream.cob_id, canopen, defined=name is not None)
            known[str(entry.key.port), stream.extended, stream.cob_id] = name or None, label
    return [_bus(bus, known, measures.of_bus(bus)) for bus in summary.buses]


class _IdentifierRow(DrawnRow):
    """A COB-ID of a channel, with its share of the bus."""

    __slots__ = ("entry", "name_and_label")

    def __init__(self, channel: str, entry: IdentifierBits, known: _Names) -> None:
        super().__init__()
        self.entry = entry
        self.name_and_label = known.get((channel, entry.extended, entry.cob_id), (None, None))

    PARTS: ClassVar[Sequence[Part]] = (
        fields(
            cob_id=lambda row: row.entry.cob_id,
            extended=lambda row: row.entry.extended,
            name=lambda row: row.name_and_label[0],
            canopen=lambda row: row.name_and_label[1],
            frames=lambda row: row.entry.frames,
            bits=lambda row: row.entry.bits,
            fast_bits=lambda row: row.entry.fast_bits,
            share=lambda row: rounded(row.entry.share),
        ),
    )


def _bus(bus: CanBusSummary, known: _Names, measured: Measured) -> dict[str, Any]:
    return {
        "channel": bus.channel,
        **_COUNTED.read(measured),
        "bit_rate": _bit_rate(bus.bit_rate, measured),
        "load": _load(bus.load, measured),
        "identifiers": Drawn(bus.identifiers, lambda entry: _IdentifierRow(bus.channel, entry, known)),
        "errors": _errors(bus.errors, measured),
        "canopen_nodes": [_node(node) for node in bus.canopen_nodes],
        **_RATE.read(measured),
    }


def _bit_rate(rate: BitRate | None, measured: Measured) -> dict[str, Any] | None:
    if rate is None:
        return None
    return {**_BIT_RATES.read(measured), "source": "given" if rate.given else "found"}


def _load(load: BusLoad | None, measured: Measured) -> dict[str, Any] | None:
    if load is None:
        return None
    # Hours of a bus are many seconds: who shows a screen asks for none of them.
    seconds = range(min(len(load.second_ns), MOST_SECONDS))
    return {
        **_LOADS.read(measured),
        "peak_ns": time_text(load.peak_ns),
        **_WORST_LOAD.read(measured),
        "partial": load.partial,
        "by_second": Drawn(seconds, lambda place: _second(load, place)),
    }


def _second(load: BusLoad, place: int) -> list[Any]:
    columns = load.second, load.second_worst
    return [str(int(load.second_ns[place])), *(rounded(float(column[place])) for column in columns)]


def _errors(errors: BusErrors | None, measured: Measured) -> dict[str, Any] | None:
    if errors is None:
        return None
    return {
        **_ERROR_FRAMES.read(measured),
        "first_ns": time_text(errors.first_ns),
        "last_ns": time_text(errors.last_ns),
        "classes": _labelled(CLASS_LABELS, errors.classes),
        "states": _labelled(_STATE_LABELS, errors.states),
        "bus_off": {
            **_BUS_OFFS.read(measured),
            "since_ns": time_text(errors.off_since_ns),
        },
        **_ERROR_COUNTERS.read(measured),
    }


def _labelled(labels: Mapping[str, str], frames: Mapping[str, int]) -> list[dict[str, Any]]:
    return [{"name": name, "label": label, "frames": frames[name]} for name, label in labels.items() if name in frames]


def _node(node: CanOpenNode) -> dict[str, Any]:
    return {
        "node": node.node,
        "state": None if node.state is None else NODE_STATES[node.state],
        "since_ns": time_text(node.since_ns),
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
