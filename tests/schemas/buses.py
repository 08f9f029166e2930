"""The schemas of what is told of buses: frames and bits, load, errors, and CANopen nodes."""

from __future__ import annotations

from dissectors.can.canopen import ERROR_REGISTER, NODE_STATES
from dissectors.can.error import CLASS_LABELS, CONTROLLER_BITS
from nvscope.tracker.figures import BIT_RATES, BUS_COUNTERS, BUS_ERRORS, LOADS, RATE, Of
from nvscope.view.documents.buses import MOST_SECONDS
from tests.schemas.figures import figures
from tests.schemas.shapes import Schema, maybe, number, record, several, shared, text, time, truth, whole, word


def bus() -> Schema:
    """Return the schema of a row of ``buses``."""
    return record(
        {
            "channel": text(),
            **figures(BUS_COUNTERS, Of.BUS),
            "bit_rate": maybe(
                record({**figures(BIT_RATES, Of.BUS, "bit_rate"), "source": word(("given", "found"))})
            ),
            "load": maybe(_load()),
            "identifiers": several(_identifier(), "those with frames, the largest share first"),
            "errors": maybe(_errors()),
            "canopen_nodes": several(shared("canopen_node")),
            **figures((RATE,), Of.BUS),
        }
    )  # fmt: skip


def _load() -> Schema:
    second = [time("when it began"), number("load; unit: percent", 0), number("with most stuff bits; percent", 0)]
    row = {"type": "array", "prefixItems": second, "minItems": len(second), "items": False}
    mean, peak, worst = (figures((one,), Of.BUS, "load") for one in LOADS)
    return record(
        {
            **mean,
            **peak,
            "peak_ns": time("when the busiest second began"),
            **worst,
            "partial": truth("bits at a data bit rate that is unknown are not counted"),
            "by_second": several(row, "seconds with frames") | {"maxItems": MOST_SECONDS},
        }
    )


def _identifier() -> Schema:
    return record(
        {
            "cob_id": whole("", 0, 0x1FFF_FFFF),
            "extended": truth("whether it has 29 bits"),
            "name": maybe(text("that of a defined list")),
            "canopen": maybe(text("what CANopen plans it for")),
            "frames": whole(),
            "bits": whole(),
            "fast_bits": whole(),
            "share": number("unit: percent", 0),
        }
    )


def _errors() -> Schema:
    by_key = figures(BUS_ERRORS, Of.BUS, "errors")
    states = [bit.name for bit in CONTROLLER_BITS]
    off = record(
        {**by_key["bus_off"]["properties"], "since_ns": maybe(time("null while no controller is off the bus"))}
    )
    return record(
        {
            "frames": by_key["frames"],
            "first_ns": time(),
            "last_ns": time(),
            "classes": several(record({"name": word(CLASS_LABELS), "label": text(), "frames": whole("", 1)})),
            "states": several(record({"name": word(states), "label": text(), "frames": whole("", 1)})),
            "bus_off": off,
            "tx_errors": by_key["tx_errors"],
            "rx_errors": by_key["rx_errors"],
        }
    )


def canopen_node() -> Schema:
    """Return the schema of a node of CANopen."""
    emergency = record(
        {
            "code": whole("", 0, 0xFFFF),
            "text": text(),
            "register": several(word(ERROR_REGISTER)),
            "time_ns": time(),
        }
    )
    return record(
        {
            "node": whole("", 1, 127),
            "state": maybe(word(NODE_STATES.values())),
            "since_ns": maybe(time()),
            "told_by": maybe(word(("command", "heartbeat"))),
            "last_ns": time(),
            "heartbeats": whole(),
            "changes": whole(),
            "boot_ups": whole(),
            "emergencies": whole(),
            "last_emergency": maybe(emergency),
        }
    )
