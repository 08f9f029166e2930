"""Error frames of SocketCAN: what a controller's driver tells of its bus, in the shape of a frame.

Source: ``linux/can/error.h``. The classes are bits of the identifier; most have a detail in one of eight data bytes.

::

     0          1            2         3          4             5         6           7
    +----------+------------+---------+----------+-------------+---------+-----------+-----------+
    | Lost at  | Controller | Type of | Location | Transceiver | (driver)| TX errors | RX errors |
    +----------+------------+---------+----------+-------------+---------+-----------+-----------+
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dissectors.batch import I64, U8, U16, Bool
from dissectors.can.frame import CanBatch
from dissectors.layout import Bit, Field, Layout

CLASSES = (
    Bit(0, "tx-timeout", "transmit timeout"),
    Bit(1, "lost-arbitration", "lost arbitration"),
    Bit(2, "controller", "controller problem"),
    Bit(3, "protocol", "protocol violation"),
    Bit(4, "transceiver", "transceiver problem"),
    Bit(5, "no-acknowledgement", "no acknowledgement on transmission"),
    Bit(6, "bus-off", "bus off"),
    Bit(7, "bus-error", "bus error"),
    Bit(8, "restarted", "controller restarted"),
    Bit(9, "counters", "error counters"),
)
UNTOLD_CLASS = "unknown"
"""What stands for the class of an error frame that tells none: most logs record no more than that there was one."""

CLASS_LABELS = {bit.name: bit.label for bit in CLASSES} | {UNTOLD_CLASS: "class not recorded"}
"""What classes are called, by name."""

LOST_ARBITRATION, CONTROLLER, PROTOCOL, TRANSCEIVER = (CLASSES[position].mask for position in range(1, 5))
BUS_OFF, RESTARTED, COUNTERS = (CLASSES[position].mask for position in (6, 8, 9))

CONTROLLER_BITS = (
    Bit(0, "rx-overflow", "receive buffer overflow"),
    Bit(1, "tx-overflow", "transmit buffer overflow"),
    Bit(2, "rx-warning", "receive errors reached the warning level"),
    Bit(3, "tx-warning", "transmit errors reached the warning level"),
    Bit(4, "rx-passive", "error passive by receive errors"),
    Bit(5, "tx-passive", "error passive by transmit errors"),
    Bit(6, "active", "error active again"),
)
ACTIVE = CONTROLLER_BITS[6].mask
PROTOCOL_BITS = (
    Bit(0, "bit", "single bit error"),
    Bit(1, "form", "frame format error"),
    Bit(2, "stuff", "bit stuffing error"),
    Bit(3, "bit0", "a dominant bit could not be sent"),
    Bit(4, "bit1", "a recessive bit could not be sent"),
    Bit(5, "overload", "bus overload"),
    Bit(6, "active", "active error announced"),
    Bit(7, "tx", "while sending"),
)
LOCATIONS = {
    0x02: "identifier bits 28 to 21",
    0x03: "start of frame",
    0x04: "substitute RTR",
    0x05: "identifier extension bit",
    0x06: "identifier bits 20 to 18",
    0x07: "identifier bits 17 to 13",
    0x08: "CRC",
    0x09: "reserved bit 0",
    0x0A: "data",
    0x0B: "DLC",
    0x0C: "RTR",
    0x0D: "reserved bit 1",
    0x0E: "identifier bits 4 to 0",
    0x0F: "identifier bits 12 to 5",
    0x12: "intermission",
    0x18: "CRC delimiter",
    0x19: "acknowledge slot",
    0x1A: "end of frame",
    0x1B: "acknowledge delimiter",
}
_WIRE_STATES = {4: "no wire", 5: "short to the battery", 6: "short to VCC", 7: "short to ground"}
TRANSCEIVER_STATES = (
    {state: f"CAN high: {text}" for state, text in _WIRE_STATES.items()}
    | {state << 4: f"CAN low: {text}" for state, text in _WIRE_STATES.items()}
    | {0x80: "CAN low: short to CAN high"}
)

DETAIL = Layout(
    "can.error",
    (
        Field("lost_at", "u1", "Lost at", "bit at which arbitration was lost; 0 unspecified"),
        Field("controller", "u1", "Controller", "state of the controller", bits=CONTROLLER_BITS, base="hex"),
        Field("protocol", "u1", "Violation", "type of the protocol violation", bits=PROTOCOL_BITS, base="hex"),
        Field("location", "u1", "Location", "where in the frame; 0 unspecified", values=LOCATIONS, base="hex"),
        Field("transceiver", "u1", "Transceiver", "state of the wires", values=TRANSCEIVER_STATES, base="hex"),
        Field("driver", "u1", "Driver", "of the controller's driver; reserved today", base="hex"),
        Field("tx_errors", "u1", "Transmit errors", "transmit error counter"),
        Field("rx_errors", "u1", "Receive errors", "receive error counter"),
    ),
)

_KNOWN_CLASSES = sum(bit.mask for bit in CLASSES)


class ErrorDetails(NamedTuple):
    """The error frames of a batch: columns of shape (n,), one row an error frame.

    ``position`` is that in the batch of CAN frames, int64. ``classes`` are the bits of ``CLASSES``, uint16, 0 where the
    frame tells none known. The rest are the data bytes of ``DETAIL``, uint8; ``controller``, ``protocol``, ``location``
    and ``transceiver`` are 0 where the class that they belong to is not set. The counters are whatever is there: only
    drivers since Linux 6.0 tell by the class ``counters`` that they are meant. Data that was not captured is 0.
    """

    position: I64
    classes: U16
    controller: U8
    protocol: U8
    location: U8
    transceiver: U8
    tx_errors: U8
    rx_errors: U8

    @property
    def bus_off(self) -> Bool:
        """Which frames say that the controller left the bus."""
        told: Bool = (self.classes & np.uint16(BUS_OFF)) != 0
        return told

    @property
    def recovered(self) -> Bool:
        """Which frames say that the controller was restarted, or is error active again."""
        told: Bool = (self.classes & np.uint16(RESTARTED)) != 0
        told |= (self.controller & np.uint8(ACTIVE)) != 0
        return told


def classes_of(frames: CanBatch) -> U16:
    """Return the classes (bits of ``CLASSES``) of every frame, uint16 of shape (n,): 0 for what is no error frame."""
    classes = (frames.identifier & np.uint32(_KNOWN_CLASSES)).astype(np.uint16)
    classes[~frames.error] = 0
    return classes


def error_details(frames: CanBatch) -> ErrorDetails:
    """Read the error frames of a batch."""
    position = np.flatnonzero(frames.error)
    errors = frames.take(position)
    classes = (errors.identifier & np.uint32(_KNOWN_CLASSES)).astype(np.uint16)
    detail = DETAIL.gather(errors.data, errors.at)
    present = errors.captured

    def column(name: str, needed: int = _KNOWN_CLASSES) -> U8:
        known = (present > DETAIL.offset_of(name)) & ((classes & np.uint16(needed)) != 0)
        value: U8 = np.where(known, detail[name], np.uint8(0))
        return value

    return ErrorDetails(
        position, classes, column("controller", CONTROLLER), column("protocol", PROTOCOL),
        column("location", PROTOCOL), column("transceiver", TRANSCEIVER), column("tx_errors"), column("rx_errors"),
    )  # fmt: skip


def describe_error(identifier: int, data: bytes) -> str:
    """Return an error frame in words, such as "controller problem: error passive by transmit errors".

    ``identifier`` is that of ``CanBatch``, without flag bits. Bytes that are missing are taken for 0.
    """
    filled = np.frombuffer(data[: DETAIL.size_bytes].ljust(DETAIL.size_bytes, b"\0"), DETAIL.dtype)[0]
    told = {field.name: int(filled[field.name]) for field in DETAIL}
    parts = []
    for bit in CLASSES:
        if identifier & bit.mask:
            details = _details(bit.mask, told)
            parts.append(f"{bit.label}: {', '.join(details)}" if details else bit.label)
    if parts:
        return "; ".join(parts)
    return "an error of no known class" if identifier else f"error frame, {CLASS_LABELS[UNTOLD_CLASS]}"


def _details(class_mask: int, told: dict[str, int]) -> list[str]:
    """Return what the data bytes add to a class."""
    if class_mask == LOST_ARBITRATION:
        return [f"at bit {told['lost_at']}"] if told["lost_at"] else []
    if class_mask == CONTROLLER:
        return [bit.label for bit in CONTROLLER_BITS if told["controller"] & bit.mask]
    if class_mask == PROTOCOL:
        types = [bit.label for bit in PROTOCOL_BITS if told["protocol"] & bit.mask]
        location = told["location"]
        return types + ([f"at {LOCATIONS.get(location, f'0x{location:02X}')}"] if location else [])
    if class_mask == TRANSCEIVER:
        state = told["transceiver"]
        halves = (state & 0x0F, state & 0xF0)
        return [TRANSCEIVER_STATES.get(half, f"0x{half:02X}") for half in halves if half]
    if class_mask == COUNTERS:
        return [f"transmit {told['tx_errors']}", f"receive {told['rx_errors']}"]
    return []
