"""Tables of a scenario that are about CAN: buses, the lists sent over them, other frames, and what goes wrong on a bus.

Faults that choose telegrams (``[[loss]]``, ``[[late]]``, ``[[wrong_dlc]]``) and ``[[pause]]``, ``[[burst]]`` and
``[[stop]]`` name a list on CAN as they name one on UDP.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from dissectors.can.canopen import MAX_NODES
from dissectors.can.error import CLASSES, CONTROLLER_BITS
from dissectors.can.frame import EXTENDED_MASK, MAX_DATA_BYTES, MAX_FD_DATA_BYTES, STANDARD_MASK
from nvscope.toml_table import FLAG, LENGTH, TEXT, Place, ValueKind, array, choice, integer, key, number

MAX_PDOS = 128
DEFAULT_BIT_RATE, DEFAULT_DATA_BIT_RATE = 500_000, 2_000_000
_HIGHEST_BIT_RATE = 8_000_000
_RATE = re.compile(r"(\d{1,7}(?:\.\d{1,3})?)([kM]?)", re.ASCII)
_FACTORS = {"": 1, "k": 1_000, "M": 1_000_000}


def _bit_rate(value: Any, place: Place) -> int:
    match = _RATE.fullmatch(value.strip()) if isinstance(value, str) else _RATE.fullmatch(str(value))
    rate = float(match[1]) * _FACTORS[match[2]] if match and not isinstance(value, bool) else 0
    if not 1_000 <= rate <= _HIGHEST_BIT_RATE or rate != int(rate):
        raise place.error(f"'{str(value)[:40]}' is no bit rate", 'Write one from "1k" to "8M", such as "250k".')
    return int(rate)


def _hexadecimal(value: Any, place: Place) -> str:
    text = TEXT.read(value, place)
    try:
        data = bytes.fromhex(text)
    except ValueError:
        raise place.error(f"'{text[:60]}' is no bytes in hexadecimal", 'Write them as "81 10 00".') from None
    if len(data) > MAX_FD_DATA_BYTES:
        raise place.error(f"{len(data)} bytes, more than {MAX_FD_DATA_BYTES}")
    return data.hex()


BIT_RATE = ValueKind("bit rate", _bit_rate)
BYTES = ValueKind("bytes in hexadecimal", _hexadecimal)
CHANNEL = "the bus"
ETHERNET = "eth0"
"""The name of what is no bus, where frames have names of channels."""

TRAFFIC_DATA = {
    "heartbeat": "05",
    "emergency": "30 81 11 00 00 00 00 00",
    "nmt": "01 00",
    "sync": "",
    "time": "00 00 00 00 00 00",
    "sdo": "40 18 10 01 00 00 00 00",
    "frame": "00 00 00 00 00 00 00 00",
    "remote": "",
    "fd": "00 " * 12,
}
"""The kinds of other frames, and their data where none is given."""

_COB_IDS = {"heartbeat": 0x700, "emergency": 0x080, "nmt": 0x000, "sync": 0x080, "time": 0x100, "sdo": 0x600}
OF_NODES = {"heartbeat", "emergency", "sdo"}
_SDO_ANSWER_COB_ID = 0x580
SDO_ANSWER = "43 18 10 01 78 56 34 12"
SDO_ANSWER_AFTER_NS = 2_000_000


@dataclass(frozen=True, kw_only=True)
class Bus:
    """A CAN bus. One that only other tables name has what is the default here."""

    channel: str = key(TEXT, "its name, such as can0")
    bit_rate: int = key(BIT_RATE, "bits a second", default=DEFAULT_BIT_RATE)
    data_bit_rate: int = key(
        BIT_RATE, "bits a second behind the bit rate switch of a CAN FD frame", default=DEFAULT_DATA_BIT_RATE
    )


@dataclass(frozen=True, kw_only=True)
class CanList:
    """A network variables list on CAN. Each of its PDOs has an identifier of its own; telegram 1 is its first one."""

    name: str = key(TEXT, "how the rest of the scenario calls it")
    cob_id: int = key(integer(0, EXTENDED_MASK), "identifier of the first PDO; the others follow")
    channel: str = key(TEXT, CHANNEL, default="can0")
    extended: bool = key(FLAG, "identifiers of 29 bits; no definition tells of such", default=False)
    data_bytes: tuple[int, ...] = key(array(integer(0, MAX_DATA_BYTES), single=True), "bytes of each PDO", name="bytes")
    packed: bool = key(FLAG, "several variables in one PDO; otherwise one PDO per variable", default=True)
    defined: bool = key(
        FLAG, "a definition tells of it; otherwise each of its identifiers is a list by itself", default=True
    )
    sender: str = key(TEXT, "the node that sends it, for restarts and stops; the frames do not tell", default="")
    interval_ns: int = key(LENGTH, "time from one sending of the list to the next", name="interval")
    mode: str = key(
        choice("cyclic", "on_change"),
        "on_change sends at random moments: intervals lie between a tenth and nearly twice the interval",
        default="cyclic",
    )
    jitter_ns: int = key(LENGTH, "each sending is late by 0 to this much", default=0, name="jitter")
    phase_ns: int = key(LENGTH, "when the first sending is due", default=0, name="phase")
    from_ns: int = key(LENGTH, "when the sender starts", default=0, name="from")
    until_ns: int | None = key(LENGTH, "when the sender stops", default=None, name="until")
    values: str = key(
        choice("ramp", "constant", "noise"),
        "data: the first bytes count the sendings; nothing ever changes; random bytes behind a counting one",
        default="ramp",
    )

    @property
    def has_definition(self) -> bool:
        """Whether a definition tells which identifiers make the list."""
        return self.defined and not self.extended


@dataclass(frozen=True, kw_only=True)
class CanTraffic:
    """Frames on CAN that belong to no list, such as those of CANopen."""

    kind: str = key(
        choice(*TRAFFIC_DATA),
        "frames of CANopen (sdo: a request, and the answer 2 ms later); a frame, a request for one (remote), or one of "
        "CAN FD with the given cob_id",
    )
    channel: str = key(TEXT, CHANNEL, default="can0")
    node: int = key(integer(1, MAX_NODES), "node-ID of heartbeat, emergency and sdo", default=1)
    cob_id: int | None = key(integer(0, EXTENDED_MASK), "identifier of frame, remote and fd", default=None)
    extended: bool = key(FLAG, "an identifier of 29 bits", default=False)
    data: str = key(BYTES, "the data; otherwise what is usual for the kind", default="")
    length: int = key(integer(0, MAX_DATA_BYTES), "data bytes that a remote frame asks for", default=MAX_DATA_BYTES)
    at: tuple[int, ...] = key(array(LENGTH, single=True), "when, instead of interval", default=())
    interval_ns: int = key(LENGTH, "how often", default=0, name="interval")
    jitter_ns: int = key(LENGTH, "and up to this much later", default=0, name="jitter")
    from_ns: int = key(LENGTH, "since when", default=0, name="from")
    until_ns: int | None = key(LENGTH, "until when", default=None, name="until")

    @property
    def identifiers(self) -> tuple[int, ...]:
        """The identifier of the frames; of an SDO those of request and answer."""
        if self.cob_id is not None:
            return (self.cob_id,)
        first = _COB_IDS[self.kind] + (self.node if self.kind in OF_NODES else 0)
        return (first, _SDO_ANSWER_COB_ID + self.node) if self.kind == "sdo" else (first,)


@dataclass(frozen=True, kw_only=True)
class ErrorFrames:
    """Error frames, by which the driver of the capturing computer tells what happened on the bus."""

    kind: tuple[str, ...] = key(
        array(choice(*(bit.name for bit in CLASSES)), single=True), "the classes of each of them"
    )
    channel: str = key(TEXT, CHANNEL, default="can0")
    state: str = key(
        choice(*(bit.name for bit in CONTROLLER_BITS)), "what the class controller tells", default="rx-warning"
    )
    tx_errors: int = key(integer(0, 255), "transmit error counter", default=0)
    rx_errors: int = key(integer(0, 255), "receive error counter", default=0)
    at: tuple[int, ...] = key(array(LENGTH, single=True), "when, instead of interval", default=())
    interval_ns: int = key(LENGTH, "how often", default=0, name="interval")
    jitter_ns: int = key(LENGTH, "and up to this much later", default=0, name="jitter")
    from_ns: int = key(LENGTH, "since when", default=0, name="from")
    until_ns: int | None = key(LENGTH, "until when", default=None, name="until")


@dataclass(frozen=True, kw_only=True)
class BusOverload:
    """A device that fills a bus with frames of one identifier, so that others wait."""

    channel: str = key(TEXT, CHANNEL, default="can0")
    cob_id: int = key(integer(0, STANDARD_MASK), "identifier of its frames; a low one goes first", default=1)
    share: float = key(number(0.01, 1), "of the bits of the bus", default=0.9)
    from_ns: int = key(LENGTH, "since when", default=0, name="from")
    until_ns: int | None = key(LENGTH, "until when", default=None, name="until")


@dataclass(frozen=True, kw_only=True)
class BusOff:
    """The capturing controller leaves the bus, and tells so; until it is restarted, and tells that, it sees nothing."""

    channel: str = key(TEXT, CHANNEL, default="can0")
    at_ns: int = key(LENGTH, "when", name="at")
    outage_ns: int = key(LENGTH, "how long until the restart", default=100_000_000, name="outage")
