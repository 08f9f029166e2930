"""What the Counters of a sender say of the cycles of a list: which have begun, and what comes too late for its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from tests.datalogger.oracle_losses import Packet


@dataclass
class CycleSender:
    """What the Counters of a sender say of cycles, if its last whole one had the same in all telegrams."""

    sends_all: bool
    going: list[int] = field(default_factory=list)
    counts_cycles: bool = False
    begun: int = 0
    said: set[int] = field(default_factory=set)
    torn: dict[int, set[int]] = field(default_factory=dict)
    begins: list[int] = field(default_factory=list)

    def is_late(self, packet: Packet) -> bool:
        there = self.torn.get(packet.counter)
        behind = (self.begun - packet.counter) % 65_536
        if not self.counts_cycles or not 1 <= behind <= 64:
            return False
        distances, far = self.behind_newest()
        by_one = 3 * len(distances) >= 2 * (far + 1)
        if there is None:
            if not self.going or not by_one or behind > far or behind in distances:
                return False
            self.tear(packet.counter, set())
        elif packet.subindex in there or not (self.said <= {packet.counter} or by_one):
            return False
        self.torn[packet.counter].add(packet.subindex)
        self.said = self.said or {packet.counter}
        return True

    def behind_newest(self) -> tuple[set[int], int]:
        """Return how far behind the newest the cycles began that are known, and how far back anything is."""
        distances, far = {0}, 0
        for later, earlier in pairwise(reversed(self.begins)):
            far += (later - earlier) % 65_536
            if far > 64:
                return distances, 64
            distances.add(far)
        return distances, far

    def is_next(self, first: Packet, packet: Packet) -> bool:
        if not 1 <= (packet.counter - first.counter) % 65_536 <= 64 or not self.tells(packet.counter):
            return False
        self.said.add(packet.counter)
        return True

    def tells(self, counter: int) -> bool:
        """Since the last whole cycle, one Counter alone may say that something is out of order."""
        return self.counts_cycles and self.said <= {counter}

    def begin(self, packet: Packet) -> None:
        if self.begins and (packet.counter - self.begins[-1]) % 65_536 > 64:
            self.begins = []
        self.begins.append(packet.counter)
        self.begun = packet.counter
        self.torn.pop(packet.counter, None)

    def leave(self, own: Sequence[Packet]) -> None:
        self.going = []
        if self.counts_cycles:
            self.tear(own[0].counter, {one.subindex for one in own})

    def tear(self, counter: int, subindexes: set[int]) -> None:
        self.torn[counter] = subindexes
        self.torn = dict(list(self.torn.items())[-64:])

    def complete(self, own: Sequence[Packet]) -> None:
        self.going = []
        is_one = len({one.counter for one in own}) == 1
        was_sure, self.counts_cycles = self.counts_cycles, is_one and self.sends_all
        if self.counts_cycles:
            self.said.clear()
            if not was_sure:
                self.torn, self.begins = {}, [own[0].counter]
