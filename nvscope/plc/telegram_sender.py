"""Sends the telegrams of packets over UDP, when they are due."""

from __future__ import annotations

import ipaddress
import socket
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType, TracebackType
from typing import Self

import numpy as np
from msgspec import Struct, field

from dissectors import address
from dissectors.batch import PacketBatch
from dissectors.netvar import PortRules, dissect
from nvscope.errors import CaptureError
from nvscope.plc.pace import Pace
from nvscope.plc.permission import is_loopback, refuse_network
from nvscope.units import count_of

_MOST_SOCKETS = 256


class Route(Struct, frozen=True):
    """Where telegrams go: to the address that ``addresses`` have for theirs, else to ``address``, else to their own.

    So with the ports. UsageError, before anything is opened, where that may be another machine and ``allow_network`` is
    not set.
    """

    address: str = ""
    port: int = 0
    addresses: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    ports: Mapping[int, int] = field(default_factory=lambda: MappingProxyType({}))
    allow_network: bool = False

    def __post_init__(self) -> None:
        if self.allow_network:
            return
        for one in (self.address, *self.addresses.values()):
            if one and not is_loopback(one):
                raise refuse_network(one)
        if not self.address:
            raise refuse_network("where the telegrams went")

    def of(self, destination: str, port: int) -> tuple[str, int]:
        """Return where a telegram goes that went to an address and a port."""
        return self.addresses.get(destination, self.address or destination), self.ports.get(port, self.port or port)


class TelegramSender:
    """Sends each telegram of the batches that it is given, malformed ones too, at its time.

    What is sent on loopback comes from an address for each sender: 127.168.1.10 for 192.168.1.10, so that they are told
    apart. ``cut`` counts those that were not captured whole, which are not sent. ``is_stopped`` is asked at least ten
    times a second. CaptureError where something cannot be sent.
    """

    def __init__(
        self, route: Route, pace: Pace, ports: PortRules | None = None,
        is_stopped: Callable[[], bool] = lambda: False,
    ) -> None:  # fmt: skip
        self._route, self._pace, self._ports, self._is_stopped = route, pace, ports, is_stopped
        self._sockets: dict[tuple[str, str], socket.socket] = {}
        self._routes: dict[tuple[int, ...], tuple[socket.socket, tuple[str, int], str]] = {}
        self.cut = self._others = 0
        self._mapped: set[str] = set()
        self.targets: dict[str, int] = {}

    def send(self, packets: PacketBatch, channels: Sequence[str] = ()) -> None:
        """Send the telegrams of some packets; returns when the last one is sent, or somebody stops it."""
        telegrams = dissect(packets, self._ports).telegrams
        datagrams = telegrams.datagram
        whole = datagrams.captured_bytes >= datagrams.payload_bytes
        self.cut += int(np.count_nonzero(~whole))
        self._others += len(packets) - len(whole)
        datagrams = datagrams.take(whole)
        columns = (
            packets.ts_ns[datagrams.row], datagrams.payload, datagrams.payload_bytes, datagrams.source_hi,
            datagrams.source_lo, datagrams.destination_hi, datagrams.destination_lo, datagrams.destination_port,
        )  # fmt: skip
        data = telegrams.data.data
        for ts_ns, begin, size, *ends in zip(*(column.tolist() for column in columns), strict=True):
            due_ns = self._pace.due_ns(ts_ns)
            if not self._pace.wait_until(due_ns, self._is_stopped):
                return
            out, target, told = self._routes.get(tuple(ends)) or self._found(tuple(ends))
            try:
                out.sendto(data[begin : begin + size], target)
            except ConnectionRefusedError:
                pass  # of an earlier one: nobody listens there, which is theirs to know
            except OSError as error:
                raise CaptureError(
                    f"cannot be sent: {error.strerror or error}", where=told,
                    next_step="check the address, and that an interface leads there",
                ) from error  # fmt: skip
            self._pace.was_sent(time.monotonic_ns() - due_ns)
            self.targets[told] = self.targets.get(told, 0) + 1

    def _found(self, ends: tuple[int, ...]) -> tuple[socket.socket, tuple[str, int], str]:
        """Return the socket that a sender's telegrams go out by, and where they go, also in words."""
        source, destination = address.text(*ends[:2]), address.text(*ends[2:4])
        target = self._route.of(destination, ends[4])
        self._mapped |= {destination, str(ends[4])}
        if not self._route.allow_network and not is_loopback(target[0]):
            raise refuse_network(target[0])
        own = _local(source) if is_loopback(target[0]) and ":" not in target[0] else ""
        key = own, "6" if ":" in target[0] else "4"
        if key not in self._sockets:
            if len(self._sockets) >= _MOST_SOCKETS:
                key = next(iter(self._sockets))
            else:
                self._sockets[key] = _opened(own, is_six=key[1] == "6")
        self._routes[ends] = self._sockets[key], target, f"{target[0]}:{target[1]}"
        return self._routes[ends]

    def remarks(self) -> Iterator[str]:
        """Yield what a person should know of what was not sent, and of what was asked for in vain."""
        if self._others:
            yield f"{count_of(self._others, 'other frame')} left out: telegrams alone are sent to a network"
        for kind, names in (("--map", self._route.addresses), ("--port", map(str, self._route.ports))):
            for name in names:
                if name not in self._mapped:
                    yield f"{kind} {name}=…: no telegram went there"

    def close(self) -> None:
        """Close all sockets."""
        for one in self._sockets.values():
            one.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _local(source: str) -> str:
    """Return the address of this machine that stands for a sender; "" for none."""
    one = ipaddress.ip_address(source)
    if one.version != 4:
        return ""
    return str(ipaddress.IPv4Address(0x7F000000 | int(one) & 0x00FFFFFF))


def _opened(own: str, *, is_six: bool) -> socket.socket:
    out = socket.socket(socket.AF_INET6 if is_six else socket.AF_INET, socket.SOCK_DGRAM)
    try:
        out.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        if own:
            out.bind((own, 0))
    except OSError:
        # Where only 127.0.0.1 is this machine, all of them come from it.
        pass
    return out
