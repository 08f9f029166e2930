"""Interfaces elsewhere than on Linux: Scapy's listening socket on layer 2, over libpcap (macOS) or Npcap (Windows).

Nothing of Scapy dissects: bytes, lengths and times are taken as libpcap has them. A thread takes them, since libpcap's
buffer is small and Windows has no descriptor to wait for.
"""

from __future__ import annotations

import ctypes
import logging
import select
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from dissectors.batch import LinkType, PacketBatch
from nvscope.capture.live.bpf import Instruction, compiled, default_program
from nvscope.capture.live.queued_inlet import CLOSE_S, QueuedInlet
from nvscope.capture.source import DropsPart
from nvscope.errors import CaptureError

GATHER_NS = 100_000_000
"""So long packets are gathered to a batch; libpcap may have them as long before."""

_LOOK_S = 0.12
_REST_S = 0.3
_LOOK_PACKETS = 256
_WITHOUT = "udp://0.0.0.0:1202 needs neither, and sees broadcasts and what is sent to this machine"
_WINDOWS = sys.platform == "win32"
_LINKS = {0: LinkType.NULL, 1: LinkType.ETHERNET, 12: LinkType.RAW, 14: LinkType.RAW, 101: LinkType.RAW,
          108: LinkType.LOOP, 227: LinkType.CAN_SOCKETCAN, 228: LinkType.IPV4, 229: LinkType.IPV6}  # fmt: skip
"""Link types by what libpcap calls them on an interface; "raw IP" has a number of its own on some systems."""


class _Packet(NamedTuple):
    ts_ns: int
    data: bytes
    original: int


class Layer2(QueuedInlet[_Packet]):
    """The packets of an interface by libpcap; an ``Inlet``.

    ``bpf`` is a filter of tcpdump's language, '' for everything, None for the default one with these ``ports`` of UDP,
    and of ``tcp``. Raises CaptureError where libpcap is missing or does not open the interface, UsageError for a filter
    that says nothing.
    """

    format = "interface"
    hears_answers = True

    def __init__(
        self, name: str, bpf: str | None, ports: Sequence[int] = (), *, tcp: Sequence[int] = (),
        promiscuous: bool = True,
    ) -> None:  # fmt: skip
        self.path = name
        self.lag_ns = 2 * GATHER_NS + 50_000_000
        self._library, self._socket = _opened(name, promiscuous)
        self._pcap = self._socket.pcap_fd.pcap
        datalink = self._socket.pcap_fd.datalink()
        link = _LINKS.get(datalink)
        try:
            if link is None:
                raise CaptureError(
                    f"an interface of a kind that cannot be read (link type {datalink})", where=name,
                    next_step="capture with tcpdump or dumpcap, and read the file",
                )  # fmt: skip
            given = compiled(bpf, link) if bpf and bpf.strip() else None
            self._filter(default_program(link, ports, tcp) if bpf is None else given)
        except BaseException:
            self._socket.close()
            raise
        self.channels: Sequence[str] = [name] if link == LinkType.CAN_SOCKETCAN else ()
        self._link = link
        super().__init__(self._batch_of, GATHER_NS)
        self._lost: Mapping[str, int] | None = None
        self._failure = ""
        if not _WINDOWS:
            self._socket.pcap_fd.setnonblock(True)
        self._thread = threading.Thread(target=self._live, name=name, daemon=True)
        self._thread.start()

    def _filter(self, program: Sequence[Instruction] | None) -> None:
        if program is None:
            return
        from scapy.libs.structures import bpf_insn  # noqa: PLC0415

        lines = (bpf_insn * len(program))(*(bpf_insn(*one) for one in program))
        wanted = self._library.bpf_program(len(program), lines)
        if self._library.pcap_setfilter(self._pcap, ctypes.byref(wanted)) < 0:
            raise CaptureError(f"its filter was refused: {self._error()}", where=self.path)

    def _error(self) -> str:
        told = self._library.pcap_geterr(self._pcap)
        return (told or b"").decode(errors="replace") if isinstance(told, bytes) else str(told)

    # In the thread that takes packets.

    def _live(self) -> None:
        try:
            self._receive()
        except Exception as error:
            self._failure = f"capturing failed: {error}"
        self._look()
        self._rested.set()
        self._queue.wake()

    def _receive(self) -> None:
        header, data = ctypes.POINTER(self._library.pcap_pkthdr)(), ctypes.POINTER(ctypes.c_ubyte)()
        take, place, told = self._library.pcap_next_ex, ctypes.byref(header), ctypes.byref(data)
        descriptor = -1 if _WINDOWS else self._socket.fileno()
        until_s = 0.0
        while True:
            for _ in range(_LOOK_PACKETS):
                answer = take(self._pcap, place, told)
                if answer != 1:
                    break
                one = header.contents
                ts_ns = (one.ts.tv_sec * 1_000_000 + one.ts.tv_usec) * 1000
                self._queue.put(_Packet(ts_ns, ctypes.string_at(data, one.caplen), one.len), one.caplen)
            if answer < 0:
                self._failure = _words(self._error())
                return
            self._look()
            if until_s and time.monotonic() > until_s:
                return
            # libpcap hands out what came up to so long ago.
            is_empty = answer == 0 and (descriptor < 0 or not select.select([descriptor], [], [], _LOOK_S)[0])
            if until_s and is_empty:
                return
            # What came before it was to be closed is looked for once more; what goes on coming has to end.
            if self._closing.is_set():
                until_s = until_s or time.monotonic() + _REST_S

    def _look(self) -> None:
        """Note what libpcap says that it lost."""
        told = self._library.pcap_stat()
        if self._library.pcap_stats(self._pcap, ctypes.byref(told)) == 0:
            self._lost = {DropsPart.KERNEL.value: told.ps_drop, DropsPart.INTERFACE.value: told.ps_ifdrop}

    # In the thread of who looks at the packets.

    def _batch_of(self, packets: Sequence[_Packet]) -> PacketBatch:
        times = np.array([one.ts_ns for one in packets], np.int64)
        batch = PacketBatch.of([one.data for one in packets], self._link, times)
        batch.original[:] = [one.original for one in packets]
        return batch

    def drops(self) -> Mapping[str, int] | None:
        if self._lost is None and not self._queue.dropped:
            return None
        return {**(self._lost or {}), DropsPart.QUEUE.value: self._queue.dropped}

    def failure(self) -> str:
        return self._failure

    def close(self) -> None:
        self._closing.set()
        self._thread.join(CLOSE_S)
        if not self._thread.is_alive():
            with suppress(OSError):
                self._socket.close()
        self._queue.close()


def _opened(name: str, promiscuous: bool) -> tuple[Any, Any]:
    """Return Scapy's functions of libpcap, and its socket on an interface."""
    # It wonders about link types of which it has no layers loaded.
    logging.getLogger("scapy.runtime").setLevel(logging.ERROR)
    try:
        from scapy.config import conf  # noqa: PLC0415  takes a while

        conf.use_pcap = True
        from scapy.arch.libpcap import L2pcapListenSocket  # noqa: PLC0415
        from scapy.libs import winpcapy  # noqa: PLC0415
    except (ImportError, OSError, AttributeError) as error:
        raise CaptureError(
            "Npcap is not installed" if _WINDOWS else "libpcap is not installed", where=name,
            next_step=f"{'get it from https://npcap.com' if _WINDOWS else 'install it'}; {_WITHOUT}",
        ) from error  # fmt: skip
    try:
        return winpcapy, L2pcapListenSocket(iface=name, promisc=promiscuous)
    except ValueError as error:  # Scapy knows no such interface
        raise CaptureError("no interface has this name", where=name, next_step="`nvscope -D` lists them") from error
    except OSError as error:
        raise _refused(name, str(error)) from error


def _refused(name: str, told: str) -> CaptureError:
    words = " ".join(told.split())[:300]
    lower = words.lower()
    if "permi" in lower or "access" in lower:
        return CaptureError(
            "no permission to capture", where=name,
            next_step="run it as administrator, or install Npcap without restricting it to administrators" if _WINDOWS
            else f"run it with sudo, or install ChmodBPF, which Wireshark brings; {_WITHOUT}",
        )  # fmt: skip
    if "no such device" in lower or "not exist" in lower:
        return CaptureError("no interface has this name", where=name, next_step="`nvscope -D` lists them")
    return CaptureError(_words(words), where=name, next_step="`nvscope doctor` tells more about this machine")


def _words(told: str) -> str:
    """Return an error of libpcap in the words that are used for it everywhere."""
    lower = told.lower()
    if "is down" in lower or "not up" in lower or "went down" in lower:
        return "the interface is down"
    if "disappeared" in lower or "no such device" in lower or "gone" in lower or "no longer attached" in lower:
        return "the interface is gone"
    return told or "libpcap fails, and does not say why"
