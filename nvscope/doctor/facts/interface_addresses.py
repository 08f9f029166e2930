"""The IPv4 addresses of this machine's interfaces, asked of the kernel by netlink: all of them, with their netmasks."""

from __future__ import annotations

import os
import socket
import struct
from collections.abc import Iterator
from ipaddress import IPv4Interface

_GET_ADDRESS, _NEW_ADDRESS, _DONE, _ERROR = 22, 20, 3, 2
_REQUEST, _DUMP = 0x1, 0x300
_LOCAL, _ADDRESS = 2, 1
_MESSAGE = struct.Struct("=IHHII")
_ABOUT = struct.Struct("=BBBBI")
_ATTRIBUTE = struct.Struct("=HH")
_ANSWER_BYTES = 65_536
_LONGEST_S = 1.0


def addresses() -> dict[int, list[IPv4Interface]]:
    """Return addresses with their netmasks by the index of their interface; nothing where the kernel does not tell."""
    found: dict[int, list[IPv4Interface]] = {}
    try:
        with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW | socket.SOCK_CLOEXEC, 0) as kernel:
            kernel.settimeout(_LONGEST_S)
            size = _MESSAGE.size + _ABOUT.size
            question = _MESSAGE.pack(size, _GET_ADDRESS, _REQUEST | _DUMP, 1, 0)
            kernel.sendto(question + _ABOUT.pack(socket.AF_INET, 0, 0, 0, 0), (0, 0))
            for index, address in _answers(kernel):
                found.setdefault(index, []).append(address)
    except (OSError, struct.error):
        return {}
    return found


def _answers(kernel: socket.socket) -> Iterator[tuple[int, IPv4Interface]]:
    while True:
        data = kernel.recv(_ANSWER_BYTES)
        at = 0
        while at + _MESSAGE.size <= len(data):
            length, kind, *_ = _MESSAGE.unpack_from(data, at)
            if kind == _ERROR:
                raise OSError(os.strerror(0))
            if kind == _DONE or length < _MESSAGE.size:
                return
            if kind == _NEW_ADDRESS:
                _, bits, _, _, index = _ABOUT.unpack_from(data, at + _MESSAGE.size)
                told = _attributes(data, at + _MESSAGE.size + _ABOUT.size, at + length)
                # Of a line from one to one, the first is its own and the second the other end's.
                own = told.get(_LOCAL) or told.get(_ADDRESS)
                if own is not None and len(own) == 4:
                    yield index, IPv4Interface((own, bits))
            at += -(-length // 4) * 4


def _attributes(data: bytes, at: int, end: int) -> dict[int, bytes]:
    found = {}
    while at + _ATTRIBUTE.size <= end:
        length, kind = _ATTRIBUTE.unpack_from(data, at)
        if length < _ATTRIBUTE.size:
            break
        found[kind] = data[at + _ATTRIBUTE.size : at + length]
        at += -(-length // 4) * 4
    return found
