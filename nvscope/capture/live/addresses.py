"""The addresses of this machine's interfaces, as the kernel tells them (rtnetlink, ``RTM_GETADDR``); on Linux.

::

    message  length u32 | type u16 | flags u16 | sequence u32 | port u32
    address  family u8 | prefix u8 | flags u8 | scope u8 | interface u32 | attributes (length u16 | type u16 | value)...
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator

from msgspec import Struct

_MESSAGE = struct.Struct("=IHHII")
_ADDRESS = struct.Struct("=BBBBI")
_ATTRIBUTE = struct.Struct("=HH")
_NEW_ADDRESS, _GET_ADDRESS, _ERROR, _DONE = 20, 22, 2, 3
_REQUEST_ALL = 0x301
_ADDRESS_OF, _LOCAL, _BROADCAST = 1, 2, 4
_BUFFER_BYTES = 1 << 16


class Address(Struct, frozen=True):
    """An IPv4 or IPv6 address of an interface with the ``prefix`` of its network, None where nobody tells.

    ``broadcast`` is the address that reaches all of the network, '' where there is none.
    """

    text: str
    prefix: int | None = None
    broadcast: str = ""

    def __str__(self) -> str:
        return self.text if self.prefix is None else f"{self.text}/{self.prefix}"


def addresses_of(name: str) -> list[Address]:
    """Return the addresses of an interface, those of IPv4 first; none where it has none, or nobody can be asked."""
    return [address for _, address in sorted(_told(name), key=lambda one: one[0])]


def _told(name: str) -> Iterator[tuple[int, Address]]:
    try:
        wanted = socket.if_nametoindex(name)
        answer = _ask()
    except (OSError, ValueError):
        return
    at = 0
    while at + _MESSAGE.size + _ADDRESS.size <= len(answer):
        length, kind, *_ = _MESSAGE.unpack_from(answer, at)
        if kind == _NEW_ADDRESS:
            family, prefix, _, _, index = _ADDRESS.unpack_from(answer, at + _MESSAGE.size)
            if index == wanted and family in (socket.AF_INET, socket.AF_INET6):
                values = dict(_attributes(answer[at + _MESSAGE.size + _ADDRESS.size : at + length]))
                # Of a point-to-point interface, the other one is that of the partner.
                own = values.get(_LOCAL) or values.get(_ADDRESS_OF)
                if own:
                    broadcast = values.get(_BROADCAST)
                    text = socket.inet_ntop(family, broadcast) if broadcast else ""
                    yield family, Address(socket.inet_ntop(family, own), prefix, text)
        at += max(-(-length // 4) * 4, _MESSAGE.size)


def _attributes(data: bytes) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at + _ATTRIBUTE.size <= len(data):
        length, kind = _ATTRIBUTE.unpack_from(data, at)
        yield kind, data[at + _ATTRIBUTE.size : at + length]
        at += max(-(-length // 4) * 4, _ATTRIBUTE.size)


def _ask() -> bytes:
    """Return all that the kernel answers to the question for all addresses."""
    answer = b""
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, 0) as link:
        link.settimeout(1)
        size = _MESSAGE.size + _ADDRESS.size
        link.sendto(_MESSAGE.pack(size, _GET_ADDRESS, _REQUEST_ALL, 1, 0) + _ADDRESS.pack(0, 0, 0, 0, 0), (0, 0))
        while True:
            part = link.recv(_BUFFER_BYTES)
            answer += part
            at = 0
            while at + _MESSAGE.size <= len(part):
                length, kind, *_ = _MESSAGE.unpack_from(part, at)
                if kind in (_DONE, _ERROR):
                    return answer
                at += max(-(-length // 4) * 4, _MESSAGE.size)
