"""Listening for a while, on all interfaces at once: as much as may be captured, and plain sockets beside. It sends
nothing: no group is joined, and no port is taken that somebody has."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field

from msgspec.structs import replace

from nvscope.capture.live.device import device_of
from nvscope.capture.live.inlet import Inlet
from nvscope.capture.live.ring import KernelRing
from nvscope.capture.live.udp_socket import UdpSocket
from nvscope.capture.live.wait import Wait
from nvscope.capture.source import SourceInfo
from nvscope.doctor.expected import Expected
from nvscope.doctor.facts.machine import Machine
from nvscope.doctor.facts.traffic import ListenedTo, Traffic
from nvscope.errors import CaptureError

_RING_BYTES = 8 << 20
_MOST_INTERFACES = 24
_MOST_SOCKETS = 4
_TICK_NS = 100_000_000


def _nothing() -> None:
    pass


@dataclass
class Listening:
    """Something open to listen with; ``stop`` ends it early, from signal handlers, too."""

    expected: Expected
    machine: Machine
    wait: Wait = field(default_factory=Wait)
    places: list[ListenedTo] = field(default_factory=list)
    left_out: int = 0
    _inlets: list[Inlet | None] = field(default_factory=list)
    _begun_ns: int = field(default_factory=time.monotonic_ns)

    @classmethod
    def open(cls, expected: Expected, machine: Machine, interfaces: Sequence[str] = ()) -> Listening:
        """Open all that can be opened; ``interfaces`` are those that were named, none for all.

        What cannot be opened says why. Raises CaptureError where no interface has a name that was given.
        """
        made = cls(expected, machine)
        wanted = [made._named(name) for name in interfaces] or [
            entry.name for entry in machine.interfaces or () if entry.is_up and (entry.is_ethernet or entry.is_loopback)
        ]  # fmt: skip
        made.left_out = len(wanted[_MOST_INTERFACES:])
        if machine.may_capture:
            for name in wanted[:_MOST_INTERFACES]:
                made._add_ring(name)
        else:
            for name in interfaces:
                why = "capturing is not known on this system" if machine.may_capture is None else "no permission"
                made._add_failure(ListenedTo(name, True, failure=why))
        for port in expected.ports[:_MOST_SOCKETS]:
            made._add_socket(port)
        return made

    def _named(self, name: str) -> str:
        if self.machine.interfaces is not None and self.machine.interface(name) is None:
            known = ", ".join(entry.name for entry in self.machine.interfaces) or "none"
            raise CaptureError("no interface has this name", where=name, next_step=f"the interfaces are: {known}")
        return name

    def _add_ring(self, name: str) -> None:
        device = device_of(name)
        if device is None or not device.is_known or device.is_can:
            return
        try:
            self._add(ListenedTo(name, True), KernelRing(device, None, buffer_bytes=_RING_BYTES))
        except CaptureError as error:
            self._add_failure(ListenedTo(name, True, failure=error.what))

    def _add_socket(self, port: int) -> None:
        word = f"udp://0.0.0.0:{port}"
        if any(entry.port == port for entry in self.machine.bound or ()):
            # It would get what is addressed to this machine in place of the one who waits for it.
            self._add_failure(ListenedTo(word, False, failure="somebody has the port"))
            return
        try:
            self._add(ListenedTo(word, False), UdpSocket(word))
        except CaptureError as error:
            self._add_failure(ListenedTo(word, False, failure=error.what))

    def _add(self, place: ListenedTo, inlet: Inlet) -> None:
        self.places.append(place)
        self._inlets.append(inlet)
        self.wait.add(inlet.fileno())

    def _add_failure(self, place: ListenedTo) -> None:
        self.places.append(place)
        self._inlets.append(None)

    @property
    def infos(self) -> Sequence[SourceInfo]:
        """What is known of the places, for who shows that it goes on."""
        return [
            SourceInfo(place.name, "live", frames=place.frames, is_live=True)
            for place, inlet in zip(self.places, self._inlets, strict=True) if inlet is not None
        ]  # fmt: skip

    @property
    def lasted_ns(self) -> int:
        """How long it has been listened."""
        return time.monotonic_ns() - self._begun_ns

    def stop(self) -> None:
        self.wait.wake()

    def hear(self, duration_ns: int, tick: Callable[[], None] = _nothing) -> Traffic:
        """Listen for so long at most, and return what came; ``tick`` is called again and again meanwhile."""
        traffic = Traffic(self.expected.ports)
        self._begun_ns = time.monotonic_ns()
        with ExitStack() as opened:
            opened.callback(self.wait.close)
            for inlet in self._inlets:
                if inlet is not None:
                    opened.callback(inlet.close)
            deaf = not any(self._inlets)
            while not deaf and not self.wait.woken and (left_ns := duration_ns - self.lasted_ns) > 0:
                if not self._take(traffic):
                    self.wait.wait(min(left_ns, _TICK_NS))
                tick()
            self._drain(traffic)
        return traffic

    def _take(self, traffic: Traffic) -> bool:
        """Take what is there; return whether there was something."""
        found = False
        for number, inlet in enumerate(self._inlets):
            if inlet is None:
                continue
            batch = inlet.take()
            if batch is not None:
                found = True
                traffic.observe(batch, number)
                self.places[number] = replace(self.places[number], frames=self.places[number].frames + len(batch))
            elif failure := inlet.failure():
                self.places[number] = replace(self.places[number], failure=failure)
                self.wait.remove(inlet.fileno())
        return found

    def _drain(self, traffic: Traffic) -> None:
        for number, inlet in enumerate(self._inlets):
            if inlet is None:
                continue
            for batch in inlet.drain():
                traffic.observe(batch, number)
                self.places[number] = replace(self.places[number], frames=self.places[number].frames + len(batch))
            dropped = sum((inlet.drops() or {}).values())
            self.places[number] = replace(self.places[number], dropped=dropped)
