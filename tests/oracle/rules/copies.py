"""Copies: packets that a capture has once more, as of a mirror port.

A packet whose identification, addresses, ports and payload are those of one of the 256 before it, the last such one at
most 100 ms away, is a copy of that; where packets are not identified (by 0, in IPv6, behind options), it is at most
0.5 ms.
"""

from __future__ import annotations

from typing import Any

from tests.oracle.frame import Datagram

REACH, NEAR_NS, UNTOLD_NEAR_NS = 256, 100_000_000, 500_000
COMPARED_BYTES = 276


class Copies:
    """Packets of one kind, one after the other."""

    def __init__(self) -> None:
        self.last: dict[tuple[Any, ...], tuple[int, int]] = {}
        self.count = 0

    def again(self, packet: Datagram, time: int) -> bool:
        """Tell whether a packet was there already."""
        self.count += 1
        ends = packet.source, packet.source_port, packet.destination, packet.port
        key = (packet.identification, *ends, packet.payload[:COMPARED_BYTES])
        place, before = self.last.get(key, (-REACH, 0))
        self.last[key] = self.count, time
        within = NEAR_NS if packet.identification else UNTOLD_NEAR_NS
        return self.count - place <= REACH and abs(time - before) <= within
