"""Random conversations by the Parameter Manager, with every fault, among the other traffic of a plant."""

from __future__ import annotations

import random
from ipaddress import ip_address

from tests.oracle.builders import (
    ETHERNET,
    MILLISECOND,
    PROTOCOL_UDP,
    data_frame,
    internet_packet,
    link_frame,
    telegram,
    udp,
    unreachable,
    whole,
)
from tests.oracle.frame import Frame
from tests.oracle.rules.parameter import BUSY, ERRORS, READ, READ_REPLY, WRITE, WRITE_REPLY
from tests.oracle.traffic import disturb_clock, generate, mutate

NODES = ("10.0.0.1", "10.0.0.2", "192.168.1.10", "fe80::1", "10.0.0.255")
_OTHERS = "10.0.0.1", "10.0.0.2"


def conversations(seed: int, requests: int = 60) -> list[Frame]:
    """Return requests and replies of some nodes, in the order of their times."""
    rng, values, ports = random.Random(seed), random.Random(~seed), random.Random(seed + (1 << 32))
    wild = rng.random()
    found: list[Frame] = []
    at, counter, copies = 0, 0, random.Random(seed + (2 << 32))
    # Programs that say which packet is which, that never do, and that give all the same number.
    numbers = {node: copies.choice((0, 1, 1, 1, None)) for node in NODES}
    number = 0

    def packet(at: int, source: str, destination: str, payload: bytes, port: int, source_port: int) -> None:
        nonlocal number
        own = numbers.get(source)
        number += 1 if own else 0
        frame = data_frame(
            at, source, destination, payload, port=port, source_port=source_port,
            identification=9 if own is None else own and number % 65_535 + 1,
        )  # fmt: skip
        found.extend(twice(frame))

    def twice(frame: Frame) -> list[Frame]:
        frames = [frame]
        while copies.random() < wild / 6:
            after = copies.choice((0, 20_000, 500_000, 500_001, *(MILLISECOND * one for one in (30, 99, 100, 101))))
            frames.append(frames[-1]._replace(ts_ns=frames[-1].ts_ns + after))
        return frames

    for _ in range(requests):
        at += rng.choice((0, 1, 5, 100, 300, 700)) * MILLISECOND
        counter = (counter + 1) % 65536 if rng.random() > wild / 2 else rng.randrange(3)
        requester, partner = rng.sample(NODES[:3] if rng.random() > 0.1 else NODES, 2)
        if ":" in requester + partner:
            requester, partner = "fe80::1", "fe80::2"
        index, subindex = rng.choice((0x2000, 0x2001, 7)), rng.randrange(2)
        port = rng.choice((1202, 1202, 1202, 1203))
        service = rng.choice((READ, WRITE))
        times = 1 if rng.random() > wild / 2 else rng.randint(2, 4)
        for again in range(times):
            if not again or values.random() < 0.4:
                items, data = values.choice((1, 1, 2)), _value(values) if service == WRITE else b""
            payload = telegram(
                service, index, subindex, counter=counter, items=items, data=data,
                length=None if rng.random() > wild / 10 else 3,
            )  # fmt: skip
            source_port = rng.choice((port, port, 50_000 + counter % 1000))
            source_port = ports.choice((source_port, source_port, source_port, 1202, 1203))
            packet(at + again * 100 * MILLISECOND, requester, partner, payload, port, source_port)
        if rng.random() < wild / 8:
            by = rng.choice((partner, "fe80::9" if ":" in partner else "10.0.0.9"))
            quoted = internet_packet(
                *map(ip_address, (requester, partner)), PROTOCOL_UDP, udp(payload, source_port=source_port, port=port),
                identification=copies.choice((0, 9, number + 1)),
            )  # fmt: skip
            told = unreachable(ip_address(by), quoted[: rng.choice((36, 38, 60, 200))], rng.choice((0, 1, 3, 4)))
            found += twice(whole(at + MILLISECOND, ETHERNET, link_frame(told)))
        for _ in range(rng.choice((1, 1, 1, 0, 2)) if rng.random() < wild else 1):
            kind = READ_REPLY if service == READ else WRITE_REPLY
            if rng.random() < wild / 3:
                kind = rng.choice((*ERRORS, BUSY, READ_REPLY, WRITE_REPLY))
            took = rng.choice((0, 1, 3, 249, 250, 251, 499, 500, 501, 600)) if rng.random() < wild else 3
            reply = telegram(kind, index, subindex, counter=counter, items=values.choice((1, 1, 2)),
                             data=_value(values) if kind == READ_REPLY else b"")  # fmt: skip
            to_port = rng.choice((port, port, source_port))
            from_port = ports.choice((port, port, port, 40_000 + counter % 7, 1202, 1203))
            packet(at + took * MILLISECOND, partner, requester, reply, to_port, from_port)
    return sorted(found, key=lambda frame: frame.ts_ns)


def _value(rng: random.Random) -> bytes:
    """Return a value as short as most are, or one about as long as what is kept of them."""
    return rng.randbytes(rng.choice((2, 2, 2, 4, 4, 0, 1, 255, 256, 257, 400)))


def _cut(seed: int, frames: list[Frame]) -> list[Frame]:
    """Return the frames as far as some of them were captured."""
    rng = random.Random(seed)
    return [
        frame._replace(data=frame.data[: rng.choice((60, 64, 66, 68, 300, 317, 318, 319))]) if rng.random() < 0.3
        else frame for frame in frames
    ]  # fmt: skip


def parameter_traffic(seed: int) -> list[Frame]:
    """Return the same; with many seeds with data of lists between, a clock that steps, and bytes that are broken."""
    rng = random.Random(seed)
    frames = conversations(seed, rng.choice((5, 40, 120)))
    if seed % 2:
        others = generate(seed, frames=80)
        begin = others[0].ts_ns if others else 0
        frames = sorted(
            [frame._replace(ts_ns=frame.ts_ns + begin) for frame in frames] + others, key=lambda one: one.ts_ns
        )
    if seed % 3 == 0:
        frames = disturb_clock(rng, {"clock_back": 0.1, "clock_forward": 0.1, "equal_time": 0.1}, frames)
    if seed % 7 == 0:
        frames = _cut(seed, frames)
    return mutate(seed, frames) if seed % 5 == 0 else frames
