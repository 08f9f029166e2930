"""What the Counters of a sender say of the cycles of a list: which have begun, and what comes too late for its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from tests.datalogger.oracle_losses import Packet


@dataclass
class CycleSender:
    """What the Counters of a sender say of cycles, if its last whole one had the same in all telegrams.

    Unless it ``sends_all`` telegrams each time, they tell what is next, and neither what is late nor what goes on.
    ``counts_telegrams``: these differed as the SubIndexes do; ``rises``: the greatest SubIndex had a greater one.
    """

    sends_all: bool
    going: list[int] = field(default_factory=list)
    counts_cycles: bool = False
    counts_telegrams: bool = False
    rises: bool = False
    begun: int = 0
    said: set[int] = field(default_factory=set)
    torn: dict[int, set[int]] = field(default_factory=dict)
    begins: list[int] = field(default_factory=list)
    told: set[int] = field(default_factory=set)
    newest: dict[int, int] = field(default_factory=dict)
    owing: set[int] = field(default_factory=set)

    def is_late(self, packet: Packet) -> bool:
        there = self.torn.get(packet.counter)
        behind = (self.begun - packet.counter) % 65_536
        if not self.sends_all or not self.counts_cycles or not 1 <= behind <= 64:
            return False
        distances, far = self.behind_newest()
        by_one = self.by_one()
        if there is None:
            if not by_one or behind > far or behind in distances:
                return False
            self.tear(packet.counter, set())
        elif packet.subindex in there or not (self.said <= {packet.counter} or by_one):
            return False
        self.torn[packet.counter].add(packet.subindex)
        self.said = self.said or {packet.counter}
        return True

    def miss(self, packet: Packet) -> bool:
        """Let the next telegram of the SubIndex say that this one is missing.

        If that has come, this one has to say it, unless another one of its cycle did; return whether it does.
        """
        behind = (self.newest.get(packet.subindex, packet.counter) - packet.counter) % 65_536
        is_told = packet.counter in self.told
        self.told.add(packet.counter)
        if not 1 <= behind <= 64:
            self.owing.add(packet.subindex)
            return False
        return not is_told

    def is_behind_late(self, packet: Packet) -> bool:
        """Take a telegram that is not late; tell whether one is missing in front of it that was."""
        self.newest[packet.subindex] = packet.counter
        is_owing = packet.subindex in self.owing
        self.owing.discard(packet.subindex)
        return is_owing

    def behind_newest(self) -> tuple[set[int], int]:
        """Return how far behind the newest the cycles began that are known, and how far back anything is."""
        distances, far = {0}, 0
        for later, earlier in pairwise(reversed(self.begins)):
            far += (later - earlier) % 65_536
            if far > 64:
                return distances, 64
            distances.add(far)
        return distances, far

    def is_next(self, own: Sequence[Packet], packet: Packet) -> bool:
        first, last = own[0], max(own, key=lambda one: one.subindex)
        if self.rises and packet.subindex < last.subindex and 1 <= (packet.counter - last.counter) % 65_536 <= 64:
            return True
        if not 1 <= (packet.counter - first.counter) % 65_536 <= 64 or not self.tells(packet.counter):
            return False
        self.said.add(packet.counter)
        return True

    def goes_on(self, own: Sequence[Packet], packet: Packet) -> bool:
        """Tell whether a telegram is of the same cycle, however late: the one before had another Counter."""
        if not self.sends_all:
            return False
        if self.counts_telegrams and {first_counter(one) for one in own} == {first_counter(packet)}:
            return True
        is_same = {one.counter for one in own} == {packet.counter}
        return self.counts_cycles and is_same and self.has_moved() and (self.tells(packet.counter) or self.by_one())

    def is_again(self, own: Sequence[Packet], packet: Packet) -> bool:
        """Tell whether a telegram has been there, and is sent once more in the middle of a later cycle."""
        behind = (self.begun - packet.counter) % 65_536
        is_one = len({one.counter for one in own}) == 1
        if not self.sends_all or not self.counts_cycles or not 1 <= behind <= 64 or not is_one:
            return False
        there = self.torn.get(packet.counter)
        was_there = behind in self.behind_newest()[0] if there is None else packet.subindex in there
        return was_there and self.has_moved() and self.by_one()

    def has_moved(self) -> bool:
        """Tell whether the last cycle has another Counter than the one before, and counts on from that."""
        return len(self.begins) > 1 and 1 <= (self.begins[-1] - self.begins[-2]) % 65_536 <= 64

    def by_one(self) -> bool:
        """Tell whether most of the Counters that there may be were there."""
        distances, far = self.behind_newest()
        return 3 * len(distances) >= 2 * (far + 1)

    def tells(self, counter: int) -> bool:
        """Since the last whole cycle, one Counter may say that something is out of order, else four what is next."""
        return self.counts_cycles and len(self.said | {counter}) <= (1 if self.sends_all else 4)

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
        self.told.discard(counter)
        self.torn[counter] = subindexes
        self.torn = dict(list(self.torn.items())[-64:])

    def complete(self, own: Sequence[Packet]) -> None:
        self.going = []
        is_one = len({one.counter for one in own}) == 1
        was_sure, self.counts_cycles = self.counts_cycles, is_one
        least, greatest = (pick(own, key=lambda one: one.subindex) for pick in (min, max))
        self.rises = 1 <= (greatest.counter - least.counter) % 65_536 <= 64
        self.counts_telegrams = len({first_counter(one) for one in own}) == 1
        if self.counts_cycles:
            self.said.clear()
            if not was_sure:
                self.torn, self.begins = {}, [own[0].counter]
                self.newest = {one.subindex: one.counter for one in own}


def first_counter(packet: Packet) -> int:
    """Return the Counter of the first SubIndex of a cycle of which each telegram is counted."""
    return (packet.counter - packet.subindex) % 65_536
