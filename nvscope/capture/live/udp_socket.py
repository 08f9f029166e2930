"""A plain UDP socket as a source: no privileges, and nothing that is not for this machine.

It gets payloads; the IP and UDP headers that packets have are put together again from what the kernel tells of them.
"""

from __future__ import annotations

import errno
import ipaddress
import re
import socket
import struct
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress

import numpy as np
from msgspec import Struct

from dissectors.batch import LinkType, PacketBatch
from dissectors.netvar import PORT
from nvscope.capture.live.internet_headers import packet_of
from nvscope.capture.source import DropsPart
from nvscope.errors import CaptureError, UsageError

PREFIX = "udp://"
GATHER_NS = 100_000_000
"""So long datagrams are gathered to a batch: less would cost more time than it saves."""

_MOST_DATAGRAMS = 16_384
_PAUSE_MS = 5
_BUFFER_BYTES = 32 << 20
_DATAGRAM_BYTES = 65_535
_ANCILLARY_BYTES = 256
_LINUX = sys.platform.startswith("linux")
_SO_RCVBUFFORCE, _SO_TIMESTAMPNS, _SO_RXQ_OVFL, _SO_MEMINFO = 33, 35, 40, 55
_IP_PKTINFO, _IP_RECVTTL, _IP_TTL = 8, 12, 2
_IPV6_RECVPKTINFO, _IPV6_PKTINFO, _IPV6_RECVHOPLIMIT, _IPV6_HOPLIMIT = 49, 50, 51, 52
_MEMINFO_DROPS, _MEMINFO_COUNT = 8, 9
_TIME = struct.Struct("@ll")
_WORD = re.compile(r"(?:(?P<six>\[[^\]]*\])|(?P<four>[^:,\[\]]*))(?::(?P<port>[0-9]{1,5}))?(?P<groups>(?:,[^,]+)*)")


class UdpAddress(Struct, frozen=True):
    """Where a socket listens: an address of this machine, or all of them, a port, and the multicast groups it joins."""

    address: str
    port: int
    groups: tuple[str, ...] = ()

    @classmethod
    def of(cls, word: str) -> UdpAddress:
        """Return what ``udp://ADDRESS:PORT[,GROUP...]`` says; UsageError where it cannot be understood."""
        found = _WORD.fullmatch(word.removeprefix(PREFIX))
        port = int(found["port"] or PORT) if found else 0
        if not found or not 0 < port <= 0xFFFF:
            raise _not_understood(word)
        address = (found["six"] or found["four"] or "0.0.0.0").strip("[]")
        groups = tuple(found["groups"].split(",")[1:])
        try:
            version = ipaddress.ip_address(address).version
            for group in groups:
                one = ipaddress.ip_address(group)
                if not one.is_multicast or one.version != version:
                    raise ValueError(group)
        except ValueError:
            raise _not_understood(word) from None
        return cls(address, port, groups)

    @property
    def is_six(self) -> bool:
        return ":" in self.address


def _not_understood(word: str) -> UsageError:
    return UsageError(
        f"{word[:80]}: expected udp://ADDRESS:PORT, with multicast groups behind commas",
        next_step="for example udp://0.0.0.0:1202, or udp://0.0.0.0:1202,239.0.0.1",
    )


class UdpSocket:
    """What comes to a UDP port of this machine; an ``Inlet``. Raises CaptureError where it cannot be opened."""

    format = "udp"
    hears_answers = False

    def __init__(self, word: str) -> None:
        self.path = word
        self.channels: Sequence[str] = ()
        self.lag_ns = GATHER_NS + 50_000_000
        self.gather_ns = 0
        self._where = where = UdpAddress.of(word)
        self._link = LinkType.IPV6 if where.is_six else LinkType.IPV4
        self._socket = socket.socket(socket.AF_INET6 if where.is_six else socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._open(where)
        except OSError as error:
            self._socket.close()
            raise _failure(word, where, error) from error

    def _open(self, where: UdpAddress) -> None:
        own = self._socket
        own.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        own.setblocking(False)
        if hasattr(socket, "SO_REUSEPORT") and not _LINUX:
            # On Linux it would take turns with others of the same person: each would miss what another one got.
            own.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        with suppress(OSError):
            own.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
        if _LINUX:
            with suppress(OSError):  # for who may
                own.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, _BUFFER_BYTES)
            for option in (_SO_TIMESTAMPNS, _SO_RXQ_OVFL):
                own.setsockopt(socket.SOL_SOCKET, option, 1)
            level = socket.IPPROTO_IPV6 if where.is_six else socket.IPPROTO_IP
            options = (_IPV6_RECVPKTINFO, _IPV6_RECVHOPLIMIT) if where.is_six else (_IP_PKTINFO, _IP_RECVTTL)
            for option in options:
                own.setsockopt(level, option, 1)
        own.bind((where.address, where.port))
        for group in where.groups:
            packed = ipaddress.ip_address(group).packed
            if where.is_six:
                own.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_JOIN_GROUP, packed + struct.pack("@I", 0))
            else:
                local = ipaddress.ip_address(where.address).packed
                own.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, packed + local)

    def fileno(self) -> int:
        return self._socket.fileno()

    def take(self) -> PacketBatch | None:
        packets: list[bytes] = []
        times: list[int] = []
        self._receive(packets, times)
        if not packets:
            return None
        until_ns = time.monotonic_ns() + GATHER_NS
        while len(packets) < _MOST_DATAGRAMS and time.monotonic_ns() < until_ns:
            time.sleep(_PAUSE_MS / 1000)
            self._receive(packets, times)
        return PacketBatch.of(packets, self._link, np.array(times, np.int64))

    def is_filling(self) -> bool:
        return False

    def drain(self) -> Iterator[PacketBatch]:
        packets: list[bytes] = []
        times: list[int] = []
        # What comes while it is emptied is behind the end: no more than it can hold at once.
        self._receive(packets, times)
        if packets:
            yield PacketBatch.of(packets, self._link, np.array(times, np.int64))

    def _receive(self, packets: list[bytes], times: list[int]) -> None:
        """Take the datagrams that are there."""
        receive = getattr(self._socket, "recvmsg", None)
        while len(packets) < _MOST_DATAGRAMS:
            try:
                if receive is None:  # on Windows
                    payload, source = self._socket.recvfrom(_DATAGRAM_BYTES)
                    told: list[tuple[int, int, bytes]] = []
                else:
                    payload, told, _, source = receive(_DATAGRAM_BYTES, _ANCILLARY_BYTES)
            except (BlockingIOError, InterruptedError):
                return
            except OSError:
                # What was sent from here came back: not of interest, and gone with this.
                continue
            time_ns, target, hops = self._told(told)
            times.append(time_ns or time.time_ns())
            packets.append(packet_of(source[0], target, source[1], self._where.port, hops, payload))

    def _told(self, told: list[tuple[int, int, bytes]]) -> tuple[int, str, int]:
        """Return what the kernel says of a datagram: its time or 0, the address it was sent to, and its hops or 0."""
        time_ns, target, hops = 0, self._where.address, 0
        for level, kind, value in told:
            if level == socket.SOL_SOCKET:
                if kind == _SO_TIMESTAMPNS:
                    seconds, ns = _TIME.unpack_from(value)
                    time_ns = seconds * 1_000_000_000 + ns
            elif level == socket.IPPROTO_IP:
                if kind == _IP_PKTINFO:
                    target = socket.inet_ntoa(value[8:12])
                elif kind == _IP_TTL:
                    hops = int.from_bytes(value[:4], sys.byteorder)
            elif kind == _IPV6_PKTINFO:
                target = socket.inet_ntop(socket.AF_INET6, value[:16])
            elif kind == _IPV6_HOPLIMIT:
                hops = int.from_bytes(value[:4], sys.byteorder)
        return time_ns, target, hops

    def drops(self) -> Mapping[str, int] | None:
        if not _LINUX:
            return None
        try:
            told = self._socket.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, 4 * _MEMINFO_COUNT)
        except OSError:
            return None
        numbers = struct.unpack(f"@{len(told) // 4}I", told)
        return {DropsPart.KERNEL.value: numbers[_MEMINFO_DROPS]} if len(numbers) > _MEMINFO_DROPS else None

    def failure(self) -> str:
        return ""

    def has_carrier(self) -> bool:
        return True

    def close(self) -> None:
        self._socket.close()


def _failure(word: str, where: UdpAddress, error: OSError) -> CaptureError:
    next_step = "`nvscope doctor` tells what listens there"
    if error.errno == errno.EADDRINUSE:
        what = f"port {where.port} is in use by a program that does not share it"
        next_step = "end that program, or capture on the interface, which shares with all: -i NAME"
    elif error.errno == errno.EADDRNOTAVAIL:
        what, next_step = "this machine does not have this address", "0.0.0.0 stands for all addresses of this machine"
    elif error.errno == errno.EACCES:
        what, next_step = f"no permission for port {where.port}", "ports below 1024 need privileges"
    else:
        what = error.strerror or str(error)
    return CaptureError(what, where=word, next_step=next_step)
