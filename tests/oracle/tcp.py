"""The TCP segments inside frames, one at a time.

Readings, where the rules leave a choice:

- a segment of whose 20 bytes of header some were not captured is none, and neither is one whose header is longer than
  what the IP header says there is
- where the IP header says no length (0, as network cards do for what they cut themselves), the frame's original
  length says it
- checksums are not looked at
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from tests.oracle.frame import Address, Frame, internet_header, link_header, number

PROTOCOL_TCP = 6
FIN, SYN, RST, PSH, ACK = 1, 2, 4, 8, 16


class Segment(NamedTuple):
    """A TCP segment: ``payload`` is what was captured of its ``length`` bytes of data."""

    source: Address
    source_port: int
    destination: Address
    destination_port: int
    seq: int
    ack: int
    flags: int
    payload: bytes
    length: int


@lru_cache(maxsize=1)  # of one frame, several rules ask one after the other
def peel_tcp(frame: Frame) -> Segment | None:
    """Return the TCP segment of a frame; of a fragment, and of everything else, None."""
    link = link_header(frame)
    if link is None:
        return None
    data = frame.data
    outer = internet_header(data, link.start, len(data), link.version)
    if outer is None or outer.protocol != PROTOCOL_TCP or outer.end - outer.start < 20:
        return None
    at = outer.start
    header_bytes = (data[at + 12] >> 4) * 4
    begin, end = at + header_bytes, packet_end(frame, link.start, outer.version)
    if header_bytes < 20 or begin > end:
        return None
    return Segment(
        outer.source, number(data, at, 2), outer.destination, number(data, at + 2, 2), number(data, at + 4, 4),
        number(data, at + 8, 4), data[at + 13], data[begin : min(end, len(data))], end - begin,
    )  # fmt: skip


def packet_end(frame: Frame, start: int, version: int) -> int:
    """Return where the IP packet ends by its header, captured or not."""
    fixed, field = (0, 2) if version == 4 else (40, 4)
    length = number(frame.data, start + field, 2)
    return start + fixed + length if length else frame.original
