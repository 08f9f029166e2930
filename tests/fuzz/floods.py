"""Captures made to take long or much memory: huge lengths, many of everything, and telegrams that all concern another.

Each is small; what it costs must be in proportion to its size.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from ipaddress import IPv4Address

from tests.capture import build
from tests.oracle.builders import (
    ACKNOWLEDGEMENT,
    BOOT_UP_REQUEST,
    DATA,
    START,
    internet_packet,
    link_frame,
    telegram,
    udp,
)
from tests.oracle.frame import ETHERNET, PROTOCOL_UDP

_SOURCE_AT = 14 + 12
_FIRST_ADDRESS = int(IPv4Address("10.0.0.1"))
_MICROSECOND = 1000
_PERIOD_NS = 100_000_000


# --- sizes ----------------------------------------------------------------------------------------------------------


def huge_lengths() -> dict[str, bytes]:
    """Return small files whose length fields promise more than they hold."""
    files: dict[str, bytes] = {}
    for value in (0xFFFFFFFF, 0x7FFFFFFF, 0x80000000, 64 << 20, (16 << 20) + 1, 16 << 20, 262_145, 262_144):
        record = struct.pack("<IIII", 1_700_000_000, 0, value, value)
        files[f"pcap, {value} captured"] = build.pcap([], snap=0xFFFFFFFF) + record + bytes(100)
        files[f"pcapng, {value} captured"] = _pcapng(
            build.block("<", 6, struct.pack("<IIIII", 0, 0, 0, value, value) + bytes(100))
        )
        files[f"pcapng, simple of {value}"] = _pcapng(build.block("<", 3, struct.pack("<I", value) + bytes(100)))
        files[f"pcapng, interface {value}"] = _pcapng(build.enhanced("<", 1, b"x", number=value))
        length = struct.pack("<I", value & ~3)
        for kind in (0x0A0D0D0A, 1, 6, 0xBAD):
            block = struct.pack("<I", kind) + length + struct.pack("<I", 0x1A2B3C4D) + bytes(88) + length
            files[f"pcapng, block {kind:x} of {value & ~3} bytes"] = _pcapng(block)
    for code in (1, 2, 4, 9, 14, 2988):
        option = struct.pack("<HH", code, 0xFFFF) + bytes(8)
        files[f"pcapng, option {code} of 65535 bytes"] = (
            build.section("<", option)
            + build.interface("<", options=option)
            + build.enhanced("<", 1, b"x", options=option)
            + build.statistics("<", 0, option)
        )
    return files


def _pcapng(blocks: bytes) -> bytes:
    return build.section("<") + build.interface("<", snap=0xFFFFFFFF) + build.enhanced("<", 1, b"x") + blocks


def large_content(megabytes: int) -> bytes:
    """Return a pcap of large packets of zeros, which every compression makes very small."""
    packet = struct.pack("<IIII", 1_700_000_000, 0, 262_144, 262_144) + bytes(262_144)
    return build.pcap([]) + packet * (4 * megabytes)


# --- numbers of things ----------------------------------------------------------------------------------------------


def clocks(count: int) -> bytes:
    """As many interfaces as a section may have, each with another time offset, and packets of all of them."""
    interfaces = min(count, 65_000)
    return b"".join(
        [
            build.section("<"),
            *(
                build.interface("<", options=build.option("<", 14, struct.pack("<q", offset)))
                for offset in range(interfaces)
            ),
            *(build.enhanced("<", number, b"", number=number % interfaces) for number in range(count)),
        ]
    )


def sections(count: int) -> bytes:
    """A section for each packet, every other one in the other byte order."""
    return b"".join(
        build.section(order) + build.interface(order) + build.enhanced(order, number, b"x")
        for number, order in zip(range(count), "<>" * count, strict=False)
    )


def comments(count: int) -> bytes:
    packet = build.enhanced("<", 1, b"", options=build.option("<", 1, b"a") * 60)
    return build.section("<") + build.interface("<") + packet * (count // 10)


def empty_packets(count: int) -> bytes:
    return build.pcap([]) + bytes(16 * count)


# --- telegrams ------------------------------------------------------------------------------------------------------


class Plant:
    """Broadcast telegrams of any number of nodes, written to one pcap."""

    def __init__(self) -> None:
        self._templates: dict[bytes, bytes] = {}
        self._parts = [build.pcap([])]
        self._time_ns = START

    def send(self, node: int, payload: bytes, after_ns: int = _MICROSECOND) -> None:
        self._time_ns += after_ns
        frame = self._frame(payload)
        source = (_FIRST_ADDRESS + node).to_bytes(4, "big")
        frame = frame[:_SOURCE_AT] + source + frame[_SOURCE_AT + 4 :]
        seconds, fraction_ns = divmod(self._time_ns, 1_000_000_000)
        self._parts += (struct.pack("<IIII", seconds, fraction_ns, len(frame), len(frame)), frame)

    def _frame(self, payload: bytes) -> bytes:
        known = self._templates.get(payload)
        if known is None:
            everybody = IPv4Address("255.255.255.255")
            packet = internet_packet(IPv4Address(_FIRST_ADDRESS), everybody, PROTOCOL_UDP, udp(payload))
            known = self._templates[payload] = link_frame(packet, ETHERNET, broadcast=True)
        return known

    def capture(self) -> bytes:
        return b"".join(self._parts)


_WANTED = telegram(DATA, 1, 0, flags=1)
_PLAIN = telegram(DATA, 1, 0)
_ANSWER = telegram(ACKNOWLEDGEMENT, 1, 0, data=b"")
_REFUSAL = telegram(ACKNOWLEDGEMENT, 1, 0, flags=4, data=b"")
_REQUEST = telegram(BOOT_UP_REQUEST, 1, 0, counter=0, data=b"")


def _sent(telegrams: Iterable[tuple[int, bytes]]) -> bytes:
    plant = Plant()
    for node, payload in telegrams:
        plant.send(node, payload)
    return plant.capture()


def readers(count: int) -> bytes:
    """Every node acknowledges to everybody, so that each of them hears all others."""
    return _sent((node, _ANSWER) for node in range(count))


def senders(count: int) -> bytes:
    """Every node sends the same list."""
    return _sent((node, _PLAIN) for node in range(count))


def waits_and_answers(count: int) -> bytes:
    """Many senders wait, and every acknowledgement answers all of them."""
    return _sent((step if step % 2 else 0, _WANTED if step % 2 else _ANSWER) for step in range(count))


def refusals(count: int) -> bytes:
    """Many senders, then as many negative acknowledgements to everybody, of which each blames the last sender."""
    half = count // 2
    return _sent([(node, _PLAIN) for node in range(half)] + [(0, _REFUSAL)] * half)


def requests(count: int) -> bytes:
    """Many boot-up requests for what many nodes send."""
    half = count // 2
    return _sent([(0, _REQUEST)] * half + [(node, _PLAIN) for node in range(half)])


def requests_and_repeats(count: int) -> bytes:
    """Many boot-up requests, then a telegram that is repeated again and again, which answers none of them."""
    half = count // 2
    return _sent([(1, _PLAIN)] + [(0, _REQUEST)] * half + [(1, _PLAIN)] * half)


def shapes(count: int) -> bytes:
    """Every SubIndex changes its Items, so that each has a finding of its own."""
    half = count // 2
    return _sent((0, telegram(DATA, 1, step % half, items=1 + step // half)) for step in range(count))


def torn_cycles(count: int) -> bytes:
    """Many senders of two SubIndexes each, of which every one misses the second one once."""
    cycles = 4
    plant = Plant()
    for cycle in range(cycles):
        for node in range(count // (2 * cycles)):
            for subindex in range(1 if cycle == 2 else 2):
                pause_ns = _PERIOD_NS if node == 0 and subindex == 0 else _MICROSECOND
                plant.send(node, telegram(DATA, 1, subindex, items=2, counter=cycle + 1), pause_ns)
    return plant.capture()


def lists(count: int) -> bytes:
    """A list for each telegram."""
    return _sent((0, telegram(DATA, number % 65_536, 0)) for number in range(count))


Flood = Callable[[int], bytes]

CAPTURE_FLOODS: dict[str, tuple[Flood, int]] = {
    "clocks": (clocks, 200_000),
    "sections": (sections, 5_000),
    "comments": (comments, 100_000),
    "empty packets": (empty_packets, 200_000),
}
"""Who makes a flood of records, and of how many: enough that a cost in proportion to the square would not end."""

TELEGRAM_FLOODS: dict[str, Flood] = {
    "readers": readers,
    "senders": senders,
    "waits and answers": waits_and_answers,
    "refusals": refusals,
    "requests": requests,
    "requests and repeats": requests_and_repeats,
    "shapes": shapes,
    "torn cycles": torn_cycles,
    "lists": lists,
}
