"""The multicast groups that programs of this machine have joined."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator, Sequence

from msgspec import Struct


class Membership(Struct, frozen=True):
    """A group that was joined on an interface."""

    interface: str
    group: str


def memberships() -> Sequence[Membership]:
    """Return all memberships, of IPv4 and IPv6."""
    return [*_four(), *_six()]


def _four() -> Iterator[Membership]:
    interface = ""
    for words in _lines("/proc/net/igmp"):
        # A line for each interface, and below it one that begins with a group, for each group.
        if words[0].isdigit() and len(words) > 2:
            interface = words[1]
        elif len(words[0]) == 8 and interface:
            yield Membership(interface, socket.inet_ntoa(struct.pack("=I", int(words[0], 16))))


def _six() -> Iterator[Membership]:
    for words in _lines("/proc/net/igmp6"):
        yield Membership(words[1], socket.inet_ntop(socket.AF_INET6, bytes.fromhex(words[2])))


def _lines(path: str) -> Iterator[list[str]]:
    try:
        with open(path, encoding="ascii", errors="replace") as file:
            yield from (words for line in file if (words := line.split()))
    except (OSError, ValueError):
        return
