"""Traffic of a CAN bus as it would be: frames wait until the bus is free, and are stamped when they have ended."""

from __future__ import annotations

import random
from functools import cache

from tests.dissectors.can.test_bits import classic_bits
from tests.tracker.can.test_state import START_NS, Frame


@cache
def frames_with_bits(seed: int, same_length: bool) -> tuple[tuple[int, bytes, int], ...]:
    """Return frames to choose from, with the bits that they take, counted one by one."""
    choice = random.Random(seed)
    pool = []
    for _ in range(120):
        word = choice.choice([choice.randrange(0x800), 0x8000_0000 | choice.randrange(1 << 29)])
        data = choice.randbytes(8 if same_length else choice.randrange(9))
        pool.append((word, data, classic_bits(word, data, len(data))))
    return tuple(pool)


def bus_traffic(
    rate: int,
    load: float,
    count: int,
    *,
    seed: int = 0,
    channel: int = 0,
    jitter_ns: int = 0,
    quantum_ns: int = 1,
    same_length: bool = False,
    stamped_at_start: bool = False,
) -> list[Frame]:
    """Return what a logger sees of a bus on which frames are wanted at random times, as often as gives the load."""
    choice = random.Random(seed)
    pool = frames_with_bits(seed % 3, same_length)
    mean_s = sum(bits for _, _, bits in pool) / len(pool) / rate / load
    wanted_s = free_s = 0.0
    frames = []
    for _ in range(count):
        wanted_s += choice.expovariate(1 / mean_s)
        word, data, bits = choice.choice(pool)
        begin_s = max(wanted_s, free_s)
        free_s = begin_s + bits / rate
        stamp_ns = round((begin_s if stamped_at_start else free_s) * 1e9) + round(choice.gauss(0, 1) * jitter_ns)
        frames.append((START_NS + stamp_ns // quantum_ns * quantum_ns, channel, word, data))
    return frames
