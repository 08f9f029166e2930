"""Opens live sources by what people call them: eth0, udp://0.0.0.0:1202, can:socketcan:can0."""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

from nvscope.capture.content import STDIN
from nvscope.capture.live.can.word import PREFIX as CAN
from nvscope.capture.live.can.word import CanWord
from nvscope.capture.live.device import device_of, names
from nvscope.capture.live.inlet import Inlet
from nvscope.capture.live.live_source import Autostop, LiveSource
from nvscope.capture.live.wait import Wait
from nvscope.capture.source import Source
from nvscope.capture.timeline import Timeline
from nvscope.errors import CaptureError, UnreadableInput, UsageError

_UDP = "udp://"
_MAX_BUFFER_BYTES = 2 << 30


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveSettings:
    """How live sources are opened.

    ``bpf`` is a filter of tcpdump's language for interfaces, '' for everything, None for the default one, which lets
    through what uses one of the ``ports`` of UDP, what says something of network variables on any other, and what uses
    one of the ``tcp`` ports.
    """

    autostop: Autostop = field(default_factory=Autostop)
    bpf: str | None = None
    ports: Collection[int] = ()
    tcp: Collection[int] = ()
    promiscuous: bool = True
    buffer_bytes: int | None = None
    renamed: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}), hash=False)


def is_live(word: str) -> bool:
    """Return whether a word names a live source; a file of that name goes before an interface."""
    return word.startswith((_UDP, CAN)) or (not os.path.lexists(word) and device_of(word) is not None)


def open_live(words: Sequence[str], settings: LiveSettings) -> Source:
    """Return live sources as one timeline, open: what comes from now on is kept until it is read.

    Raises UsageError for a word that cannot be understood, CaptureError for what cannot be opened.
    """
    if len(set(words)) < len(words):
        raise UsageError("a live source is given more than once", next_step="name each once")
    called = _channel_names(words)
    wait = Wait()
    inlets: list[Inlet] = []
    try:
        for word in words:
            inlets.append(_inlet(word, called.get(word, ""), settings))
    except BaseException:
        for inlet in inlets:
            inlet.close()
        wait.close()
        raise
    sources = [LiveSource(inlet, wait, settings.autostop) for inlet in inlets]
    if len(sources) == 1 and not settings.renamed:
        return sources[0]
    return Timeline(sources, renamed=settings.renamed)


def open_stream(word: str, settings: LiveSettings) -> Source:
    """Return a capture that is being written, open: stdin, a named pipe, or a file that grows and may come later.

    Raises UnreadableInput for what cannot be opened; what it is shows when it is read.
    """
    from nvscope.capture.live.byte_feed import FileFeed, feed_of  # noqa: PLC0415
    from nvscope.capture.live.stream_inlet import StreamInlet  # noqa: PLC0415
    from nvscope.capture.live.stream_source import StreamSource  # noqa: PLC0415

    if word == STDIN and sys.stdin is None:
        raise UnreadableInput("stdin is closed", where=word, next_step="name a file instead")
    feed = feed_of(word, sys.stdin.fileno() if word == STDIN else None)
    source = StreamSource(StreamInlet(word, feed, grows=isinstance(feed, FileFeed)), Wait(), settings.autostop)
    return Timeline([source], renamed=settings.renamed) if settings.renamed else source


def _channel_names(words: Sequence[str]) -> dict[str, str]:
    """Return what the buses are called: by their channels, and where two of these have one name, by interface too."""
    buses = {word: CanWord.of(word) for word in words if word.startswith(CAN)}
    seen = Counter([*words, *(bus.name for bus in buses.values())])
    return {
        word: bus.name if seen[bus.name] == 1 else f"{bus.interface}:{bus.channel}" for word, bus in buses.items()
    }  # fmt: skip


def _inlet(word: str, name: str, settings: LiveSettings) -> Inlet:
    if word.startswith(_UDP):
        from nvscope.capture.live.udp_socket import UdpSocket  # noqa: PLC0415

        return UdpSocket(word)
    if word.startswith(CAN):
        from nvscope.capture.live.can.bus import CanBus  # noqa: PLC0415

        return CanBus(word, name)
    device = device_of(word)
    if device is None:
        near = ", ".join(names()) or "none"
        raise CaptureError("no interface has this name", where=word, next_step=f"the interfaces are: {near}")
    if not device.is_known:
        raise CaptureError(
            f"an interface of a kind that cannot be read (ARPHRD {device.kind})", where=word,
            next_step="capture with tcpdump -w FILE, and read the file",
        )  # fmt: skip
    if not sys.platform.startswith("linux"):
        from nvscope.capture.live.layer2 import Layer2  # noqa: PLC0415

        if settings.buffer_bytes is not None:
            raise UsageError("-B: only on Linux a buffer can be chosen", next_step="leave it out")
        ports, tcp = sorted(settings.ports), sorted(settings.tcp)
        return Layer2(word, settings.bpf, ports, tcp=tcp, promiscuous=settings.promiscuous)
    from nvscope.capture.live.bpf import compiled, default_program  # noqa: PLC0415
    from nvscope.capture.live.ring import KernelRing  # noqa: PLC0415

    if settings.bpf is None:
        program = default_program(device.link, settings.ports, settings.tcp)
    else:
        program = compiled(settings.bpf, device.link) if settings.bpf.strip() else None
    size = settings.buffer_bytes
    if size is not None and size > _MAX_BUFFER_BYTES:
        raise UsageError("-B: more than 2048 MiB", next_step="take less; 64 MiB hold half a second of 1 Gbit/s")
    return KernelRing(device, program, promiscuous=settings.promiscuous, buffer_bytes=size)
