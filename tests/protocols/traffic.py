"""Traffic in which every protocol occurs, among telegrams, beside them, and broken."""

from __future__ import annotations

import random

from dissectors.batch import LinkType
from tests.oracle.builders import MILLISECOND, data_frame
from tests.oracle.frame import ETHERNET, Frame
from tests.oracle.traffic import generate, mutate
from tests.oracle.visu_traffic import conversations
from tests.protocols import beacon
from tests.protocols.probe import probe
from tests.protocols.rows import rows


def beacons(seed: int, count: int = 40) -> list[Frame]:
    """Return beacons of two senders with some gaps, short ones, and others' datagrams on the same port."""
    chance = random.Random(seed)
    frames, numbers = [], [chance.randrange(256), chance.randrange(256)]
    for place in range(count):
        sender = chance.randrange(2)
        numbers[sender] += chance.choice((1, 1, 1, 1, 4))
        content = beacon.payload(numbers[sender], chance.choice((1, 2, 9)), chance.randrange(3000))
        kind = chance.random()
        if kind < 0.1:
            content = content[: chance.randrange(6)]
        elif kind < 0.2:
            content = chance.randbytes(12)
        to = chance.choice(("10.0.0.255", "10.0.0.9"))
        frames.append(
            data_frame(
                1_700_000_000_000_000_000 + place * 7 * MILLISECOND, f"10.0.0.{sender + 1}", to, content,
                port=beacon.PORT,
            )
        )  # fmt: skip
    return frames


def probes(seed: int, start_ns: int, count: int = 20) -> list[Frame]:
    """Return segments with probes, with options and without, some of others."""
    chance = random.Random(seed)
    frames = []
    for place in range(count):
        kind = chance.random()
        more = b"" if kind < 0.2 else chance.randbytes(chance.randrange(30))
        data = probe(place, options=chance.choice((0, 0, 1, 10)), v6=kind > 0.7, tagged=kind < 0.3, more=more)
        if chance.random() < 0.1:
            data = data.replace(b"PB", b"no")
        frames.append(Frame(start_ns + place * 9 * MILLISECOND, ETHERNET, data, len(data)))
    return frames


def pages(seed: int, start_ns: int) -> list[Frame]:
    """Return some frames of web visualization, of the same time."""
    frames = [frame for frame in conversations(seed, link=ETHERNET, talks=2) if frame.link == ETHERNET][:120]
    first_ns = min((frame.ts_ns for frame in frames), default=0)
    return [frame._replace(ts_ns=frame.ts_ns - first_ns + start_ns) for frame in frames]


def can_frame(ts_ns: int, identifier: int, data: bytes) -> Frame:
    """Return a data frame of CAN."""
    content = identifier.to_bytes(4, "big") + bytes([len(data), 0, 0, 0]) + data
    return Frame(ts_ns, LinkType.CAN_SOCKETCAN, content, len(content))


def mixed(seed: int) -> list[Frame]:
    """Return telegrams, beacons, probes, CAN frames and rows of one time; of odd seeds some are broken."""
    chance = random.Random(seed)
    frames = generate(seed, frames=60, link=[ETHERNET, None][seed // 2 % 2])
    start_ns = min((frame.ts_ns for frame in frames), default=0)
    others = [*beacons(seed), *probes(seed, start_ns), *pages(seed, start_ns), *rows(seed, start_ns)]
    for place in range(10):
        others.append(can_frame(start_ns + place * 11 * MILLISECOND, 0x181 + place % 2, bytes([place] * (place % 9))))
    if seed % 2:
        frames, others = mutate(seed, frames), mutate(seed, others)
    return sorted(frames + others, key=lambda frame: (frame.ts_ns, chance.random()))
