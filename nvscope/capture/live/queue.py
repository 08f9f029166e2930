"""Packets on their way from a thread that receives them to the one that looks at them."""

from __future__ import annotations

import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Generic, TypeVar

from dissectors.batch import PacketBatch

MOST_PACKETS = 200_000
"""So many wait: half a minute of a CAN bus of 1 Mbit/s that is never idle. What comes then is dropped, and counted."""

MOST_BYTES = 256 << 20
"""So many bytes may wait, where packets are large."""

_BATCH_PACKETS, _BATCH_BYTES = 16_384, 16 << 20

_Packet = TypeVar("_Packet")


class PacketQueue(Generic[_Packet]):
    """A bounded queue with a descriptor that can be waited for. One thread puts, another one takes.

    ``batch_of`` makes a batch of packets, at least one. They wait ``gather_ns`` for others.
    """

    def __init__(self, batch_of: Callable[[Sequence[_Packet]], PacketBatch], gather_ns: int) -> None:
        self.dropped = 0
        self._batch_of = batch_of
        self._gather_ns = gather_ns
        self._packets: deque[tuple[int, _Packet, int]] = deque()
        # Each is counted by one of the threads alone.
        self._put_bytes = self._taken_bytes = 0
        self._end, self._ender = socket.socketpair()
        self._end.setblocking(False)
        self._ender.setblocking(False)
        self._told = False

    def fileno(self) -> int:
        return self._end.fileno()

    def put(self, packet: _Packet, size_bytes: int = 0) -> None:
        """Put a packet in, or count it where there is no room."""
        if len(self._packets) >= MOST_PACKETS or self._put_bytes - self._taken_bytes >= MOST_BYTES:
            self.dropped += 1
            return
        self._put_bytes += size_bytes
        self._packets.append((time.monotonic_ns(), packet, size_bytes))
        if not self._told:
            self._told = True
            self.wake()

    def wake(self) -> None:
        """Let whoever waits look."""
        with suppress(OSError):  # it is full of such words, or closed
            self._ender.send(b"\0")

    def gather(self, closing: threading.Event) -> None:
        """Wait until what is there has waited long enough, or nothing more is to come."""
        if self._packets and len(self._packets) < _BATCH_PACKETS:
            left_ns = self._packets[0][0] + self._gather_ns - time.monotonic_ns()
            if left_ns > 0:
                closing.wait(left_ns / 1e9)

    def take(self) -> PacketBatch | None:
        """Return packets that are there, None without any."""
        with suppress(OSError):  # until there is nothing more
            while self._end.recv(4096):
                pass
        # In this order: what is put in from here on is told of anew, or taken out below.
        self._told = False
        packets: list[_Packet] = []
        until_bytes = self._taken_bytes + _BATCH_BYTES
        while self._packets and len(packets) < _BATCH_PACKETS and self._taken_bytes < until_bytes:
            _, packet, size = self._packets.popleft()
            packets.append(packet)
            self._taken_bytes += size
        if not packets:
            return None
        if self._packets:
            self.wake()
        return self._batch_of(packets)

    def close(self) -> None:
        self._end.close()
        self._ender.close()
