"""One telegram: its header, whether it was cut, and what makes it malformed: sections 1 and 3."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from tests.oracle.frame import Address, Datagram
from tests.oracle.rules.keys import ListKey, Moment

IDENTITIES = (b"\x00-S3", b"0-S3")
ASCII_IDENTITY = IDENTITIES[1]
HEADER_BYTES = 20
TELEGRAM_BYTES = 12

DATA, ACKNOWLEDGEMENT, BOOT_UP_REQUEST = 0, 5, 6
PARAMETER_SERVICES = {1, 2, 3, 4, 20, 21, 22, 23, 24, 25, 26, 27, 28, 100}
SERVICES = PARAMETER_SERVICES | {DATA, ACKNOWLEDGEMENT, BOOT_UP_REQUEST}

ACKNOWLEDGE_WANTED, CHECKSUM_PRESENT, CHECKSUM_INVALID, RESERVED_FLAGS = 0x01, 0x02, 0x04, 0xF8


@dataclass(frozen=True)
class Telegram:
    """A UDP datagram that begins with an identity and shows at least its SubIndex."""

    frame: int
    time: int
    source: Address
    destination: Address
    broadcast: bool
    port: int
    length_bytes: int
    payload: bytes

    @property
    def moment(self) -> Moment:
        return Moment(self.time, self.frame)

    def number(self, offset: int, size: int) -> int:
        return int.from_bytes(self.payload[offset : offset + size], "little")

    @cached_property
    def service(self) -> int:
        return self.number(4, 4)

    @cached_property
    def index(self) -> int:
        return self.number(8, 2)

    @cached_property
    def subindex(self) -> int:
        return self.number(10, 2)

    @property
    def items(self) -> int:
        return self.number(12, 2)

    @cached_property
    def length(self) -> int:
        return self.number(14, 2)

    @cached_property
    def counter(self) -> int:
        return self.number(16, 2)

    @property
    def flags(self) -> int:
        return self.payload[18]

    @property
    def checksum(self) -> int:
        return self.payload[19]

    @cached_property
    def list_key(self) -> ListKey | None:
        """The list, or None for the Parameter Manager's telegrams."""
        return None if self.service in PARAMETER_SERVICES else ListKey("udp", self.port, self.index)

    @property
    def truncated(self) -> bool:
        return len(self.payload) < self.length_bytes

    @property
    def header_cut(self) -> bool:
        return self.truncated and len(self.payload) < HEADER_BYTES

    @cached_property
    def fault(self) -> str | None:
        """The code of what makes it malformed, or None; it has a meaning only where the header is not cut."""
        if self.length_bytes < HEADER_BYTES:
            return "NV101"
        if self.length != self.length_bytes:
            swapped = self.length >> 8 | (self.length & 0xFF) << 8
            return "NV105" if swapped == self.length_bytes else "NV102"
        return None if self.service in SERVICES else "NV103"


def telegram(frame: int, time: int, udp: Datagram) -> Telegram | None:
    if udp.payload[:4] not in IDENTITIES or len(udp.payload) < TELEGRAM_BYTES:
        return None
    return Telegram(frame, time, udp.source, udp.destination, udp.broadcast, udp.port, udp.length, udp.payload)
