"""The kernel's packet ring (AF_PACKET with TPACKET_V3): packets of an interface, mapped, block by block.

The kernel fills a block, and gives it to the program when it is full or ``RETIRE_NS`` old. Blocks that are the
program's are looked at where they lie, and given back when the next batch is asked for.
"""

from __future__ import annotations

import ctypes
import errno
import mmap
import socket
import struct
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress

import numpy as np

from dissectors.batch import PAD_BYTES, PacketBatch
from nvscope.capture.live.block import COUNT_AT, STATUS_AT, TO_READ, VLAN_BYTES, BlockReader
from nvscope.capture.live.bpf import NOTHING, Instruction, packed
from nvscope.capture.live.device import Device, speed_of, state_of
from nvscope.capture.source import DropsPart
from nvscope.errors import CaptureError

RETIRE_NS = 50_000_000
GATHER_NS = 380_000_000
"""So long blocks are gathered to a batch: what a batch costs beside its packets is as much as 10 000 of them do.

With ``RETIRE_NS``, a packet waits for 0.43 s at most: a screen shows it within half a second.
"""

BLOCK_BYTES = 1 << 19
"""Blocks with few packets are closed by ``RETIRE_NS``: all of the usual buffer last for 6 s while nobody reads."""

BUFFER_BYTES = 64 << 20
"""Half a second of what 1 Gbit/s carries. To open it takes longer the larger it is: the kernel clears all of it."""

_FAST_BUFFER_BYTES, _FAST_MBIT_S = 128 << 20, 1000
_FRAME_BYTES = 2048
_SETTLE_S = 0.02
_ALL_PROTOCOLS = 0x0003
_SOL_PACKET = 263
_ADD_MEMBERSHIP, _RX_RING, _STATISTICS, _VERSION, _RESERVE = 1, 5, 6, 10, 12
_PROMISCUOUS = 1
_V3 = 2
_SO_ATTACH_FILTER, _SO_DETACH_FILTER = 26, 27
_STATISTICS_FORMAT = struct.Struct("=III")


class KernelRing:
    """The packets of a network device; an ``Inlet``.

    ``program`` is asked of each packet, None lets in all. ``buffer_bytes`` are the kernel's to fill, by default as
    many as suit the device. ``promiscuous``: frames for other stations, too, which only the device's hardware would
    leave out. Raises CaptureError where permission is missing, or the device is down or gone.
    """

    format = "interface"
    hears_answers = True

    def __init__(
        self, device: Device, program: Sequence[Instruction] | None = None, *, promiscuous: bool = True,
        buffer_bytes: int | None = None,
    ) -> None:  # fmt: skip
        self.path = device.name
        self.channels: Sequence[str] = [device.name] if device.is_can else ()
        self.lag_ns = RETIRE_NS + 50_000_000
        self.gather_ns = GATHER_NS
        self._blocks = max((buffer_bytes or usual_buffer_bytes(device.name)) // BLOCK_BYTES, 4)
        self._dropped = 0
        self._next = 0
        self._taken: list[int] = []
        self._failure = 0
        try:
            self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
        except PermissionError as error:
            raise no_permission(device.name) from error
        try:
            self._open(device, program, promiscuous)
        except PermissionError as error:
            self._socket.close()
            raise no_permission(device.name) from error
        except OSError as error:
            self._socket.close()
            raise CaptureError(
                _WORDS.get(error.errno or 0, error.strerror or str(error)), where=device.name,
                next_step="`nvscope doctor` tells more about the interfaces of this machine",
            ) from error  # fmt: skip
        if failure := self.failure():
            self._socket.close()
            raise CaptureError(failure, where=device.name, next_step=f"set it up: ip link set {device.name} up")

    def _open(self, device: Device, program: Sequence[Instruction] | None, promiscuous: bool) -> None:
        tap = self._socket
        tap.setsockopt(_SOL_PACKET, _VERSION, _V3)
        tap.setsockopt(_SOL_PACKET, _RESERVE, VLAN_BYTES)
        # Until the filter is there, nothing comes in: what was not asked for would be in the ring already.
        _attach(tap, NOTHING)
        frames = BLOCK_BYTES // _FRAME_BYTES * self._blocks
        retire_ms = RETIRE_NS // 1_000_000
        request = struct.pack("=7I", BLOCK_BYTES, self._blocks, _FRAME_BYTES, frames, retire_ms, 0, 0)
        tap.setsockopt(_SOL_PACKET, _RX_RING, request)
        self._map = mmap.mmap(tap.fileno(), BLOCK_BYTES * self._blocks)
        self._data = np.frombuffer(self._map, np.uint8)
        words = self._data.view(np.uint32)
        self._status, self._count = (words[at // 4 :: BLOCK_BYTES // 4] for at in (STATUS_AT, COUNT_AT))
        self._reader = BlockReader(
            self._data, BLOCK_BYTES, device.link, skip_outgoing=device.is_loopback or device.is_can,
            has_tags=device.is_ethernet,
        )  # fmt: skip
        tap.bind((device.name, _ALL_PROTOCOLS))
        if promiscuous and not device.is_loopback:
            membership = struct.pack("=iHH8s", device.index, _PROMISCUOUS, 0, b"")
            with suppress(OSError):  # some devices know no such mode
                tap.setsockopt(_SOL_PACKET, _ADD_MEMBERSHIP, membership)
        if program is None:
            tap.setsockopt(socket.SOL_SOCKET, _SO_DETACH_FILTER, 0)
        else:
            _attach(tap, program)

    def fileno(self) -> int:
        return self._socket.fileno()

    def take(self) -> PacketBatch | None:
        self._give_back()
        return self._read(self._ready())

    def is_filling(self) -> bool:
        self._give_back()  # the last batch is over: the kernel fills its blocks while more is waited for
        # The kernel fills one after the other: where this one is full, those in front of it are.
        return bool(self._status[(self._next + self._blocks // 4) % self._blocks] & TO_READ)

    def drain(self) -> Iterator[PacketBatch]:
        with suppress(OSError):
            _attach(self._socket, NOTHING)
        time.sleep(_SETTLE_S)
        while (batch := self.take()) is not None:
            yield batch
        self._give_back()
        # The block that the kernel was filling; nobody fills it any more.
        batch = self._read([self._next])
        if batch is not None:
            yield batch

    def _ready(self) -> list[int]:
        """Return the blocks that are the program's by now, at most half of all: the kernel goes on filling others."""
        status, block = self._status, self._next
        ready: list[int] = []
        while len(ready) < self._blocks // 2 and status[block] & TO_READ:
            ready.append(block)
            block = (block + 1) % self._blocks
            if ready[-1] > block:
                break  # what lies at the end of the ring, and may have to be copied, is a batch of its own
        self._next = block
        self._taken = ready
        return ready

    def _read(self, blocks: list[int]) -> PacketBatch | None:
        batch = self._reader.read(blocks)
        if not len(batch):
            return None
        if int(batch.offset[-1]) + int(batch.captured[-1]) + 2 * PAD_BYTES > len(self._data):
            first = int(batch.offset[0])
            data = np.zeros(len(self._data) - first + 2 * PAD_BYTES, np.uint8)
            data[: len(self._data) - first] = self._data[first:]
            batch = PacketBatch(
                data, batch.offset - first, batch.captured, batch.original, batch.ts_ns, batch.link,
                direction=batch.direction,
            )  # fmt: skip
        return batch

    def _give_back(self) -> None:
        for block in self._taken:
            # A block that the kernel has not begun anew when it ends, because it had no room, holds nothing.
            self._count[block] = 0
            self._status[block] = 0
        self._taken = []

    def drops(self) -> Mapping[str, int]:
        with suppress(OSError):
            told = self._socket.getsockopt(_SOL_PACKET, _STATISTICS, _STATISTICS_FORMAT.size)
            # The kernel begins anew with each answer.
            self._dropped += _STATISTICS_FORMAT.unpack(told)[1]
        return {DropsPart.KERNEL.value: self._dropped}

    def failure(self) -> str:
        if not self._failure:
            try:
                self._failure = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
            except OSError as error:
                self._failure = error.errno or errno.EBADF
        if self._failure == errno.ENETDOWN and state_of(self.path) is None:
            self._failure = errno.ENODEV  # it is set down before it goes
        if not self._failure:
            return ""
        return _WORDS.get(self._failure, errno.errorcode.get(self._failure, str(self._failure)))

    def has_carrier(self) -> bool:
        state = state_of(self.path)
        return state is None or not state.is_up or state.has_carrier

    def close(self) -> None:
        # The map goes when the last batch over it does; without its socket nothing comes in.
        self._socket.close()


_WORDS = {
    errno.ENETDOWN: "the interface is down",
    errno.ENODEV: "the interface is gone",
    errno.ENXIO: "the interface is gone",
    errno.ENOMEM: "the kernel has no memory for a buffer of this size; -B takes a smaller one",
}


def usual_buffer_bytes(name: str) -> int:
    """Return how large the buffer of a device is where nobody says so."""
    return _FAST_BUFFER_BYTES if (speed_of(name) or 0) > _FAST_MBIT_S else BUFFER_BYTES


def no_permission(name: str) -> CaptureError:
    """Return the error that capturing is not allowed, with what to do about it."""
    return CaptureError(
        "no permission to capture",
        where=name,
        next_step="run it with sudo, or allow it once: sudo setcap cap_net_raw+ep $(readlink -f $(which python3)); "
        "udp://0.0.0.0:1202 needs no permission, and sees broadcasts and what is sent to this machine",
    )


def _attach(tap: socket.socket, program: Sequence[Instruction]) -> None:
    code = ctypes.create_string_buffer(packed(program))
    tap.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, struct.pack("@HP", len(program), ctypes.addressof(code)))
