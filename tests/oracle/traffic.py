"""Random traffic with every fault.

``generate`` plays a plant of a few nodes against a clock: senders with different ways of counting, readers that
acknowledge or do not, requests, strangers. How likely each fault is, is itself drawn from the seed, so that some
seeds are clean and some are wild. ``mutate`` then breaks bytes without knowing what they mean.
"""

from __future__ import annotations

import random
from collections.abc import Sequence

from tests.oracle.builders import MILLISECOND, SECOND
from tests.oracle.frame import ETHERNET, Frame
from tests.oracle.plant.plant import Plant


def disturb_clock(rng: random.Random, rates: dict[str, float], frames: list[Frame]) -> list[Frame]:
    """Let the clock of the capture step, and stand still."""
    offset = 0
    disturbed: list[Frame] = []
    for frame in frames:
        if rng.random() < rates["clock_back"] / 4:
            offset -= rng.choice(
                (1, 1000, MILLISECOND, MILLISECOND + 1, 30 * MILLISECOND, 900 * MILLISECOND, 3 * SECOND)
            )
        if rng.random() < rates["clock_forward"] / 4:
            offset += rng.choice((1, 200 * MILLISECOND, SECOND, 40 * SECOND))
        time = frame.ts_ns + offset
        if disturbed and rng.random() < rates["equal_time"]:
            time = disturbed[-1].ts_ns
        disturbed.append(frame._replace(ts_ns=time))
    return disturbed


def generate(seed: int, frames: int = 400, link: int | None = ETHERNET) -> list[Frame]:
    """Return up to ``frames`` frames of one link type, or of all mixed where ``link`` is None."""
    rng = random.Random(seed)
    plant = Plant(rng, link)
    return disturb_clock(rng, plant.faults.rates, plant.run(frames))


def mutate(seed: int, frames: Sequence[Frame]) -> list[Frame]:
    """Return the frames with bits flipped, bytes replaced, ends cut and tails swapped, about one in five."""
    rng = random.Random(seed)
    mutated: list[Frame] = []
    for frame in frames:
        data = bytearray(frame.data)
        original = frame.original
        if data and rng.random() < 0.2:
            kind = rng.randrange(5)
            if kind == 0:
                for _ in range(rng.randint(1, 4)):
                    data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
            elif kind == 1:
                data[rng.randrange(len(data))] = rng.choice((0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256)))
            elif kind == 2:
                del data[rng.randrange(len(data)) :]
            elif kind == 3:
                other = rng.choice(frames).data
                data[rng.randrange(len(data)) :] = other[rng.randrange(len(other) + 1) :]
                original = max(original, len(data))
            else:
                at = rng.randrange(len(data))
                data[at : at + 2] = rng.choice((b"\0\0", b"\xff\xff", b"\0\x08", b"\x14\0", b"\0\x14"))
                original = max(original, len(data))
        mutated.append(frame._replace(data=bytes(data), original=original))
    return mutated
