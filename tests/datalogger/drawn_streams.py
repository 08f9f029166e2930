"""Streams of one sender, drawn at random: how it counts, when it sends, and what comes twice of that."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass

from tests.datalogger.drawn_plants import START_NS
from tests.datalogger.oracle_losses import Packet
from tests.datalogger.plant_faults import MS
from tests.records import replace

HABITS = ("moving", "with values", "still", "toggling", "of four bits", "of eight bits")
VALUES = {"constant": 0.0, "slow": 0.1, "often": 0.5, "always": 1.0}
"""With which chance a value is another one than in the cycle before."""


@dataclass
class Stream:
    """What a sender sends: its telegrams, how it does, and the interval that its list is defined to have."""

    sent: list[Packet]
    habit: str
    values: str
    interval_ns: int | None
    jitter: float
    defined_ns: int | None

    def __repr__(self) -> str:
        return (
            f"{len(self.sent)} {self.habit}, {self.values}, every {self.interval_ns} ± {self.jitter}, "
            f"defined {self.defined_ns}"
        )  # fmt: skip


def drawn_stream(rng: random.Random, *, habits: Sequence[str] = HABITS, regular: bool | None = None) -> Stream:
    habit, values = rng.choice(habits), rng.choice(sorted(VALUES))
    regular = rng.random() < 0.7 if regular is None else regular
    interval_ns = rng.choice([5, 20, 50, 200]) * MS if regular else None
    jitter = rng.choice([0.0, 0.0, 0.05, 0.15])
    defined_ns = rng.choice([interval_ns, interval_ns, None, 20 * MS, 50 * MS, 200 * MS])
    begin, value, at_ns = rng.choice([1, 1, 250, 65_530]), 0, START_NS
    counter, moved = begin, 0
    sent: list[Packet] = []
    # Of a few irregular ones, some may be alike by chance.
    for number in range(rng.choice([3, 8, 40, 150] if regular else [40, 150])):
        changes = number > 0 and rng.random() < VALUES[values]
        value += changes
        moved += changes if habit == "with values" else habit != "still"
        counter = begin + moved
        counter %= {"toggling": 2, "of four bits": 16, "of eight bits": 256}.get(habit, 65_536)
        off = round((interval_ns or 0) * rng.uniform(-jitter, jitter))
        sent.append(Packet(at_ns + off, "10.0.0.1", 1, 0, 1, counter, value.to_bytes(4, "little")))
        at_ns += interval_ns or round(rng.choice([3, 11, 40, 130, 700]) * rng.uniform(0.8, 1.2) * MS)
    return Stream(sent, habit, values, interval_ns, jitter, defined_ns)


def drawn_pauses(rng: random.Random) -> Stream:
    """Draw a sender that gives each value some cycles, and pauses after some; it may send about once in a second."""
    habit, values = rng.choice(["with values", "still"]), rng.choice([1, 2, 3, 5, 60, 10_000])
    interval_ns = rng.choice([20, 40, 100, 250, 333, 950, 995, 1002]) * MS
    pauses, pause_ns = rng.choice([7, 15, 19, 60]), rng.choice([0, 950, 1240, 2000]) * MS
    jitter, losses = rng.choice([0.0005, 0.01, 0.05]), rng.choice([0.0, 0.02, 0.2])
    at_ns, sent = START_NS, list[Packet]()
    for number in range(rng.choice([12, 60, 600])):
        value = number // values
        at_ns += interval_ns + (pause_ns if number and number % pauses == 0 else 0)
        if rng.random() < losses:
            continue
        counter = 5 + (value if habit == "with values" else 0)
        off = round(interval_ns * rng.uniform(-jitter, jitter))
        sent.append(Packet(at_ns + off, "10.0.0.1", 1, 0, 1, counter, value.to_bytes(4, "little")))
    told = f"each for {values}, {pause_ns} behind each {pauses}"
    return Stream(sent, habit, told, interval_ns, jitter, rng.choice([interval_ns, None]))


def seen_twice(
    rng: random.Random, sent: Sequence[Packet], late_ns: int, *, each: int = 1, off_ns: int = 0
) -> list[Packet]:
    """Return telegrams as somebody sees them who sees each so many-th one again, so late, as captured."""
    again = [replace(one, time_ns=one.time_ns + late_ns + rng.randint(0, off_ns)) for one in sent[::each]]
    return sorted([*sent, *again], key=lambda packet: packet.time_ns)
