"""Network: how telegrams get into a capture: wrapped, twice, in pieces, badly, or cut."""

from __future__ import annotations

import random
from collections.abc import Sequence

from tests.oracle.builders import LINKS, internet_packet, link_frame, udp, unreachable
from tests.oracle.frame import (
    AUTHENTICATION,
    DESTINATION_OPTIONS,
    ETHERNET,
    HOP_BY_HOP,
    IPV4,
    IPV6,
    PROTOCOL_UDP,
    ROUTING,
    SLL,
    SLL2,
    VLAN_TAGS,
    Address,
    Frame,
)
from tests.oracle.plant.faults import Faults


class Network:
    """What was sent so far; any of its ``nodes`` may say, as a router, that a packet went nowhere."""

    def __init__(self, rng: random.Random, link: int | None, faults: Faults) -> None:
        self.rng = rng
        self.link = link
        self.happens = faults.happens
        self.snap_bytes = rng.choice((60, 62, 64, 80, 96)) if rng.random() < 0.05 and not faults.clean else None
        self.padded = rng.random() < 0.5
        self.mirrored = rng.random() < 0.08 and not faults.clean
        self.nodes: Sequence[Address] = ()
        self.sent: list[tuple[int, int, Frame]] = []

    def __len__(self) -> int:
        return len(self.sent)

    def first(self, frames: int) -> list[Frame]:
        """Return so many frames, in the order of their times."""
        self.sent.sort(key=lambda row: row[:2])
        return [frame for _, _, frame in self.sent[:frames]]

    def draw_link(self, version: int | None = None) -> int:
        """Draw a link type, one that can carry the version of IP if that matters."""
        if self.link is not None:
            return self.link
        return self.rng.choice([link for link in LINKS if link != {4: IPV6, 6: IPV4}.get(version or 0)])

    def transmit(self, time: int, source: Address, destination: Address, port: int, payload: bytes) -> None:
        """Send a telegram: once, twice, in pieces or badly."""
        rng = self.rng
        source_port = rng.choice((1202, 1202, 50000 + rng.randrange(1000)))
        udp_length = total_length = None
        if self.happens("odd_lengths"):
            choice = rng.randrange(6)
            if choice == 0:
                udp_length = rng.choice((0, 7, 8, 20, 27, 28, 8 + len(payload) + 1, 65535))
            elif choice == 1:
                total_length = 0
            elif choice == 2:
                total_length = rng.randrange(20, 60 + len(payload))
            elif choice == 3:
                total_length = 65535
            elif choice == 4:
                payload += rng.randbytes(3)
                udp_length = 8 + len(payload) - 3
            else:
                total_length = rng.randrange(20)
        segment = udp(payload, source_port=source_port, port=port, udp_length=udp_length)
        options = b""
        extensions: tuple[int, ...] = ()
        fragment: tuple[int, bool] | None = None
        if self.happens("header_options"):
            options = b"\x01" * (4 * rng.randint(1, 10))
            extensions = tuple(
                rng.choice((HOP_BY_HOP, ROUTING, DESTINATION_OPTIONS, AUTHENTICATION)) for _ in range(rng.randint(1, 3))
            )
            fragment = (0, False) if rng.random() < 0.3 else None
        if self.happens("fragment"):
            fragment = rng.choice(((0, True), (1, False), (185, True), (0, False)))
        packet = internet_packet(
            source,
            destination,
            PROTOCOL_UDP,
            segment,
            options=options,
            extensions=extensions,
            fragment=fragment,
            total_length=total_length,
        )
        group = destination.is_multicast or (destination.version == 4 and destination.packed[3] == 255)
        if self.happens("link_says_otherwise"):
            group = not group
        data = self.wrap(packet, group)
        self.put(time, *data)
        if self.mirrored or self.happens("mirror"):
            # A mirror shows it at once, a router later: after what was sent in the meantime.
            self.put(time + rng.choice((0, 0, 1000, 20_000, 300_000, 5_000_000)), *data)
        if self.happens("unreachable"):
            quote = (
                packet if rng.random() < 0.5 else packet[: rng.randint(20 if source.version == 4 else 40, len(packet))]
            )
            router = rng.choice([node for node in self.nodes if node.version == source.version])
            self.put(time + rng.choice((1, 2000, 300_000)), *self.wrap(unreachable(router, quote), False))

    def wrap(self, packet: bytes, group: bool) -> tuple[bytes, int]:
        rng = self.rng
        link = self.draw_link(None if self.happens("link_says_otherwise") else packet[0] >> 4)
        tags = [rng.choice(VLAN_TAGS) for _ in range(rng.randint(1, 2))] if self.happens("vlan") else []
        if link not in (ETHERNET, SLL, SLL2):
            tags = []
        packet_type = rng.choice((1, 2)) if group else rng.choice((0, 3, 4))
        data = link_frame(
            packet,
            link,
            broadcast=group,
            tags=tags,
            packet_type=packet_type,
            little_endian=rng.random() < 0.5,
            family=None if packet[0] >> 4 == 4 else rng.choice((24, 28, 30)),
        )
        if link == ETHERNET and self.padded and len(data) < 60:
            data += rng.choice((bytes(60 - len(data)), b"\xaa" * (60 - len(data))))
        return data, link

    def put(self, time: int, data: bytes, link: int | None = None) -> None:
        """Capture a frame, perhaps not all of it."""
        rng = self.rng
        original = len(data)
        if self.snap_bytes is not None:
            data = data[: self.snap_bytes]
        if self.happens("cut"):
            data = data[: rng.randint(0, len(data))] if rng.random() < 0.3 else data[: len(data) - rng.randint(0, 30)]
        frame = Frame(time, self.draw_link() if link is None else link, data, original)
        self.sent.append((time, len(self.sent), frame))
