"""Wire: frames written down by hand, to see what the rules make of them; all numbers were worked out by hand too."""

from __future__ import annotations

import struct
from ipaddress import ip_address
from typing import Any

from tests.oracle.builders import (
    data_frame,
    internet_packet,
    link_frame,
    other_frame,
    telegram,
    udp,
    unreachable,
    whole,
)
from tests.oracle.frame import Frame
from tests.oracle.reference import reference_report

SECOND = 1_000_000_000
A, B, C = "10.0.0.1", "10.0.0.2", "10.0.0.3"
ALL = "255.255.255.255"
ACK, BOOT_UP = 5, 6


class Wire:
    """Frames written down in order; times in nanoseconds."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []

    def send(self, ts_ns: int, source: str, destination: str, payload: bytes, port: int = 1202) -> Wire:
        self.frames.append(data_frame(ts_ns, source, destination, payload, port=port))
        return self

    def data(
        self, ts_ns: int, counter: int, *, source: str = A, to: str = ALL, port: int = 1202, **fields: Any
    ) -> Wire:
        """Send a data telegram whose values differ from those of all others."""
        fields.setdefault("data", struct.pack("<I", len(self.frames)))
        return self.send(ts_ns, source, to, telegram(counter=counter, **fields), port)

    def ack(self, ts_ns: int, source: str, to: str, **fields: Any) -> Wire:
        return self.send(ts_ns, source, to, telegram(ACK, data=b"", **fields))

    def boot_up(self, ts_ns: int, source: str, to: str = ALL, **fields: Any) -> Wire:
        return self.send(ts_ns, source, to, telegram(BOOT_UP, data=b"", counter=0, **fields))

    def nothing(self, ts_ns: int) -> Wire:
        self.frames.append(other_frame(ts_ns))
        return self

    def again(self, ts_ns: int, number: int = -1) -> Wire:
        """Repeat an earlier frame byte for byte."""
        self.frames.append(self.frames[number]._replace(ts_ns=ts_ns))
        return self

    @property
    def report(self) -> dict[str, Any]:
        return reference_report(self.frames)

    @property
    def only_list(self) -> dict[str, Any]:
        """The report of the only list."""
        (entry,) = self.report["lists"]
        return dict(entry)

    @property
    def stream(self) -> dict[str, Any]:
        (stream,) = self.only_list["streams"]
        return dict(stream)

    def figures(self) -> tuple[int | None, int, int, int]:
        """Lost, duplicates, overtaken, restarts of the only stream."""
        stream = self.stream
        return stream["lost"], stream["duplicates"], stream["overtaken"], stream["restarts"]

    def counters(self, *names: str) -> tuple[int, ...]:
        return tuple(self.only_list["counters"][name] for name in names)

    def findings(self, code: str) -> list[dict[str, Any]]:
        return [finding for finding in self.report["findings"] if finding["code"] == code]

    def codes(self) -> dict[str, int]:
        return {finding["code"]: finding["count"] for finding in self.report["findings"]}

    def node(self, address: str) -> dict[str, Any] | None:
        """The components of a node on the only list."""
        diags = {node["address"]: node["diag"] for node in self.only_list["nodes"]}
        return diags.get(address)


def counted(*counters: int) -> Wire:
    """Return one stream with these counters, 100 ms apart."""
    wire = Wire()
    for number, counter in enumerate(counters):
        wire.data(number * 100_000_000, counter)
    return wire


def icmp(ts_ns: int, payload: bytes, quote_bytes: int = 1000, source: str = A, router: str = C) -> Frame:
    head, to = (28, B) if ip_address(source).version == 4 else (48, "ff02::1")
    packet = internet_packet(ip_address(source), ip_address(to), 17, udp(payload))
    return whole(ts_ns, 1, link_frame(unreachable(ip_address(router), packet[: head + quote_bytes])))
