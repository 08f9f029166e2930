"""CANopen: the identifiers that its predefined connection set has given away, and what is in its frames.

Sources: CiA 301, version 4.2 (sections 7.2, 7.3 and 7.5.2), and CiA 305 for LSS. Node N uses the N-th identifier of a
range of 127. Everything here looks at one frame at a time: what depends on the frames before it stays unsaid.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dissectors.batch import U8, U32, Bool

MAX_COB_ID = 0x7FF
"""The largest identifier of a CAN base frame."""
MAX_NODES = 127


class Service(NamedTuple):
    """A service and the COB-IDs from ``first`` to ``last`` that it uses."""

    name: str
    first: int
    last: int

    @property
    def by_node(self) -> bool:
        """Whether every node has its own identifier."""
        return self.last - self.first + 1 == MAX_NODES


PREDEFINED = (
    Service("NMT", 0x000, 0x000),
    Service("SYNC", 0x080, 0x080),
    Service("EMCY", 0x081, 0x0FF),
    Service("TIME", 0x100, 0x100),
    Service("TPDO1", 0x181, 0x1FF),
    Service("RPDO1", 0x201, 0x27F),
    Service("TPDO2", 0x281, 0x2FF),
    Service("RPDO2", 0x301, 0x37F),
    Service("TPDO3", 0x381, 0x3FF),
    Service("RPDO3", 0x401, 0x47F),
    Service("TPDO4", 0x481, 0x4FF),
    Service("RPDO4", 0x501, 0x57F),
    Service("SDO answer", 0x581, 0x5FF),
    Service("SDO request", 0x601, 0x67F),
    Service("heartbeat", 0x701, 0x77F),
    Service("LSS", 0x7E4, 0x7E5),
)
"""The predefined connection set, by COB-ID."""

NO_FUNCTION = 0
"""The code of an identifier that the predefined connection set has not."""
FUNCTION_NAMES = ("", *(service.name for service in PREDEFINED))
"""The name of every code of ``function_of``: a code is one more than the place in ``PREDEFINED``."""


def services_within(first: int, last: int) -> tuple[Service, ...]:
    """Return the services that use any of the COB-IDs from ``first`` to ``last``."""
    return tuple(service for service in PREDEFINED if service.first <= last and first <= service.last)


def _tables() -> tuple[U8, U8]:
    """The code and the node of every COB-ID, shape (2048,)."""
    function, node = np.zeros(MAX_COB_ID + 1, np.uint8), np.zeros(MAX_COB_ID + 1, np.uint8)
    for code, service in enumerate(PREDEFINED, 1):
        span = slice(service.first, service.last + 1)
        function[span] = code
        if service.by_node:
            node[span] = np.arange(1, MAX_NODES + 1)
    return function, node


_FUNCTION, _NODE = _tables()


def function_of(identifier: U32, other: Bool) -> U8:
    """Return which function of CANopen each frame has by its identifier, a code into ``FUNCTION_NAMES``, uint8.

    ``other`` (bool) marks frames whose identifier is no COB-ID of it: extended ones, and error frames.
    """
    return _look_up(_FUNCTION, identifier, other)


def node_of(identifier: U32, other: Bool) -> U8:
    """Return the node-ID in each identifier, uint8: 1 to 127, or 0 where its function is not one of a node."""
    return _look_up(_NODE, identifier, other)


def _look_up(table: U8, identifier: U32, other: Bool) -> U8:
    found = table[np.minimum(identifier, MAX_COB_ID)]
    found[other | (identifier > MAX_COB_ID)] = 0
    return found


def use_of(cob_id: int) -> tuple[str, int]:
    """Return the function of a COB-ID and its node, such as ("heartbeat", 5): "" for none, 0 where it is of no node."""
    if not 0 <= cob_id <= MAX_COB_ID:
        return "", 0
    return FUNCTION_NAMES[_FUNCTION[cob_id]], int(_NODE[cob_id])


def title_of(cob_id: int) -> str:
    """Return what a COB-ID is for, such as "heartbeat node 5", "SYNC", or "" outside of the predefined set."""
    name, node = use_of(cob_id)
    return f"{name} node {node}" if node else name


NMT_COMMANDS = {
    1: "start",
    2: "stop",
    128: "enter pre-operational",
    129: "reset node",
    130: "reset communication",
}
NODE_STATES = {0: "boot-up", 4: "stopped", 5: "operational", 127: "pre-operational"}

EMERGENCY_CODES = {
    0x0000: "no error",
    0x1000: "generic error",
    0x2000: "current",
    0x2100: "current, input side",
    0x2200: "current inside the device",
    0x2300: "current, output side",
    0x3000: "voltage",
    0x3100: "mains voltage",
    0x3200: "voltage inside the device",
    0x3300: "output voltage",
    0x4000: "temperature",
    0x4100: "ambient temperature",
    0x4200: "device temperature",
    0x5000: "device hardware",
    0x6000: "device software",
    0x6100: "internal software",
    0x6200: "user software",
    0x6300: "data set",
    0x7000: "additional modules",
    0x8000: "monitoring",
    0x8100: "communication",
    0x8110: "CAN overrun, objects lost",
    0x8120: "CAN error passive",
    0x8130: "life guard or heartbeat error",
    0x8140: "recovered from bus off",
    0x8150: "CAN-ID collision",
    0x8200: "protocol error",
    0x8210: "PDO not processed: length",
    0x8220: "PDO longer than mapped",
    0x8230: "DAM MPDO not processed: no destination object",
    0x8240: "unexpected SYNC data length",
    0x8250: "RPDO timeout",
    0x9000: "external error",
    0xF000: "additional functions",
    0xFF00: "device specific",
}
"""Emergency error codes, and the classes xx00 and x000 of those that only a device profile or a manual knows."""

_CLASS_MASKS = (0xFFFF, 0xFF00, 0xF000)
_NO_WIDE_CLASS = (0x0000, 0x1000, 0x9000, 0xF000)
"""Classes of 256 codes whose neighbours are not assigned."""

ERROR_REGISTER = (
    "generic",
    "current",
    "voltage",
    "temperature",
    "communication",
    "device profile",
    "reserved",
    "manufacturer",
)
"""The bits of the error register (object 1001), from the lowest."""

SDO_REQUESTS = {
    0: "write segment",
    1: "write",
    2: "read",
    3: "read segment",
    4: "abort",
    5: "block read",
    6: "block write",
}
SDO_ANSWERS = {
    0: "read segment",
    1: "segment written",
    2: "read",
    3: "written",
    4: "abort",
    5: "block write",
    6: "block read",
}
SDO_ABORT_CODES = {
    0x05030000: "toggle bit not alternated",
    0x05040000: "timeout",
    0x05040001: "unknown command specifier",
    0x05040002: "invalid block size",
    0x05040003: "invalid sequence number",
    0x05040004: "CRC error",
    0x05040005: "out of memory",
    0x06010000: "unsupported access",
    0x06010001: "object can only be written",
    0x06010002: "object can only be read",
    0x06020000: "object does not exist",
    0x06040041: "object cannot be mapped to a PDO",
    0x06040042: "mapped objects longer than the PDO",
    0x06040043: "incompatible parameter",
    0x06040047: "internal incompatibility of the device",
    0x06060000: "hardware error",
    0x06070010: "length does not match",
    0x06070012: "too long",
    0x06070013: "too short",
    0x06090011: "sub-index does not exist",
    0x06090030: "invalid value",
    0x06090031: "value too high",
    0x06090032: "value too low",
    0x06090036: "maximum less than minimum",
    0x060A0023: "SDO connection not available",
    0x08000000: "general error",
    0x08000020: "data cannot be stored",
    0x08000021: "data cannot be stored: local control",
    0x08000022: "data cannot be stored: present device state",
    0x08000023: "no object dictionary",
    0x08000024: "no data available",
}
LSS_COMMANDS = {
    0x04: "switch state of all",
    0x11: "configure node-ID",
    0x13: "configure bit timing",
    0x15: "activate bit timing",
    0x17: "store configuration",
    0x40: "select: vendor",
    0x41: "select: product",
    0x42: "select: revision",
    0x43: "select: serial number",
    0x44: "selected",
    0x46: "identify: vendor",
    0x47: "identify: product",
    0x48: "identify: lowest revision",
    0x49: "identify: highest revision",
    0x4A: "identify: lowest serial number",
    0x4B: "identify: highest serial number",
    0x4C: "identify devices without node-ID",
    0x4F: "identified",
    0x50: "identified, without node-ID",
    0x51: "fastscan",
    0x5A: "inquire vendor",
    0x5B: "inquire product",
    0x5C: "inquire revision",
    0x5D: "inquire serial number",
    0x5E: "inquire node-ID",
}

_SDO_ABORT, _SDO_WRITE, _SDO_READ, _SDO_WRITTEN = 4, 1, 2, 3
_LSS_ANSWER = 0x7E4


def emergency_text(code: int) -> str:
    """Return an emergency error code in words: its own, else those of its class, else "" ."""
    for mask in _CLASS_MASKS:
        known = EMERGENCY_CODES.get(code & mask)
        if known is not None and not (mask == 0xF000 and code & mask in _NO_WIDE_CLASS):
            return known
    return ""


def describe(identifier: int, data: bytes, remote: bool = False) -> str:
    """Return a frame of the predefined connection set in words, such as "heartbeat node 5: operational".

    Returns "" for an identifier outside of it. ``identifier`` is that of a base frame; ``data`` may have any length. A
    segment of an SDO block transfer cannot be told from a command, and is taken for one.
    """
    title = title_of(identifier)
    if not title:
        return ""
    name, _ = use_of(identifier)
    if remote:
        return f"{title}: asked for"
    reader = _READERS.get(name)
    details = reader(identifier, data) if reader else ""
    return f"{title}: {details}" if details else title


def _nmt(_: int, data: bytes) -> str:
    if len(data) < 2:
        return "too short"
    node = f"node {data[1]}" if data[1] else "all nodes"
    return f"{NMT_COMMANDS.get(data[0], f'command {data[0]}')}, {node}"


def _sync(_: int, data: bytes) -> str:
    return f"counter {data[0]}" if data else ""


def _emergency(_: int, data: bytes) -> str:
    if len(data) < 3:
        return "too short"
    code = int.from_bytes(data[:2], "little")
    register = [name for position, name in enumerate(ERROR_REGISTER) if data[2] >> position & 1]
    parts = [f"0x{code:04X} {emergency_text(code)}".rstrip(), f"register {', '.join(register) or 'clear'}"]
    if any(data[3:8]):
        parts.append(data[3:8].hex(" ").upper())
    return "; ".join(parts)


def _time(_: int, data: bytes) -> str:
    if len(data) < 6:
        return "too short"
    ms = int.from_bytes(data[:4], "little") & 0x0FFF_FFFF
    date = np.datetime64("1984-01-01", "ms") + np.timedelta64(int.from_bytes(data[4:6], "little"), "D")
    return str(date + np.timedelta64(ms, "ms")).replace("T", " ")


def _heartbeat(_: int, data: bytes) -> str:
    if not data:
        return "too short"
    state = data[0] & 0x7F  # node guarding toggles bit 7
    return NODE_STATES.get(state, f"state {state}")


def _sdo_request(_: int, data: bytes) -> str:
    return _sdo(data, SDO_REQUESTS, _SDO_WRITE)


def _sdo_answer(_: int, data: bytes) -> str:
    return _sdo(data, SDO_ANSWERS, _SDO_READ)


def _sdo(data: bytes, commands: dict[int, str], with_value: int) -> str:
    """Return an SDO in words; ``with_value`` is the command that brings the value, or tells its size."""
    if not data:
        return "too short"
    command = data[0] >> 5
    text = commands.get(command, f"command 0x{data[0]:02X}")
    if command == _SDO_ABORT:
        if len(data) < 8:
            return f"abort {_object(data)}, too short"
        code = int.from_bytes(data[4:8], "little")
        return f"abort {_object(data)}: {SDO_ABORT_CODES.get(code, 'unknown reason')} (0x{code:08X})"
    if command == with_value:
        expedited, sized = data[0] & 2, data[0] & 1
        if expedited:
            unused = data[0] >> 2 & 3 if sized else 0
            return f"{text} {_object(data)} = {data[4 : 8 - unused].hex(' ').upper()}"
        size = f", {int.from_bytes(data[4:8], 'little')} bytes" if sized else ""
        return f"{text} {_object(data)}{size}"
    if command == (_SDO_READ if commands is SDO_REQUESTS else _SDO_WRITTEN):
        return f"{text} {_object(data)}"
    return text


def _object(data: bytes) -> str:
    """Return the object that an SDO is about, as index:sub-index."""
    if len(data) < 4:
        return "an unknown object"
    return f"{int.from_bytes(data[1:3], 'little'):04X}:{data[3]:02X}"


def _lss(identifier: int, data: bytes) -> str:
    if not data:
        return "too short"
    text = LSS_COMMANDS.get(data[0], f"command 0x{data[0]:02X}")
    return f"answer, {text}" if identifier == _LSS_ANSWER else text


_READERS = {
    "NMT": _nmt,
    "SYNC": _sync,
    "EMCY": _emergency,
    "TIME": _time,
    "heartbeat": _heartbeat,
    "SDO request": _sdo_request,
    "SDO answer": _sdo_answer,
    "LSS": _lss,
}
