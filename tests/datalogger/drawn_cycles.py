"""Cycles of one list, drawn at random, with what happens to their telegrams on the way; and the rows that are true.

It is known here which cycle each telegram is of, so that nothing has to be concluded from Counters and times.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from tests.datalogger.drawn_plants import START_NS, Plant
from tests.datalogger.oracle import DefinedList, Session
from tests.datalogger.oracle_losses import Packet
from tests.datalogger.plant_faults import MS

NODE = "10.0.0.1"
EDGE = 6
"""So many cycles in the beginning and in the end come as they are sent."""


@dataclass(frozen=True)
class Telegram:
    """A telegram of a cycle: which part of it, when it comes, and whether it is sent once more.

    ``number`` counts all telegrams that the sender sends.
    """

    cycle: int
    part: int
    time_ns: int
    counter: int
    is_copy: bool = False
    number: int = 0


@dataclass(frozen=True)
class Cycles:
    """Telegrams as they come, of a list of so many ``parts``.

    ``interval_ns`` is that of its definition, 0 where that has none. ``counts`` is what the Counter does: "cycles",
    "telegrams", or these of "all lists". ``others`` are telegrams of another list of the sender, which all come in
    time.
    """

    parts: int
    interval_ns: int
    telegrams: list[Telegram]
    happened: list[str]
    counts: str = "cycles"
    others: Sequence[Telegram] = ()

    def __repr__(self) -> str:
        came = " ".join(f"{'~' if one.is_copy else ''}{one.cycle}.{one.part}" for one in self.telegrams)
        told = f"{self.parts} parts every {self.interval_ns // MS or '?'} ms, {self.counts} counted"
        return f"{told}: {', '.join(self.happened)}: {came}"

    def plant(self) -> Plant:
        """Return a session with a row for each cycle; values are the numbers of these."""
        fields = tuple((f"nPart{part}", "DINT") for part in range(self.parts))
        axis = DefinedList("axis", 7, fields, self.interval_ns or None, packed=False)
        packets = [
            Packet(one.time_ns, NODE, 7, one.part, 1, one.counter, one.cycle.to_bytes(4, "little"))
            for one in self.telegrams
        ]
        packets += [Packet(one.time_ns, NODE, 8, 0, 1, one.counter, bytes(4)) for one in self.others]
        packets.sort(key=lambda one: one.time_ns)
        lists = [axis, DefinedList("press", 8, (("nPress", "DINT"),))]
        return Plant(lists, packets, Session({f"Plc/{name}": (7, name) for name, _ in fields}, task=7), "axis")

    def rows(self) -> list[tuple[int, int, tuple[int, ...]]]:
        """Return the true rows: time, ConsistentDataSeries, and of which cycle each value is.

        A telegram is in the row of its cycle, unless one of a newer cycle came before it: then it is lost. Where parts
        of cycles are lost, the next row with that part says so; where the Counter runs over telegrams, the row of the
        first one that was sent behind what is lost.
        """
        begun: dict[int, int] = {}
        in_time: dict[int, set[int]] = {}
        known: set[tuple[int, int]] = set()
        for one in self.telegrams:
            if (one.cycle, one.part) not in known and one.cycle >= max(begun, default=0):
                begun.setdefault(one.cycle, one.time_ns)
                in_time.setdefault(one.cycle, set()).add(one.part)
            known.add((one.cycle, one.part))
        last: dict[int, int] = {}
        rows = []
        behind_loss = self._behind_loss(in_time)
        for cycle, own in in_time.items():
            is_behind_loss = any(cycle != last.get(part, cycle - 1) + 1 for part in own)
            is_behind_loss = is_behind_loss if self.counts == "cycles" else cycle in behind_loss
            last |= dict.fromkeys(own, cycle)
            rows.append((begun[cycle], int(not is_behind_loss), tuple(last[part] for part in range(self.parts))))
        return rows

    def _behind_loss(self, in_time: Mapping[int, set[int]]) -> set[int]:
        """Return the cycles that one Counter over telegrams tells losses in front of."""
        came = sorted([*self.telegrams, *self.others], key=lambda one: one.time_ns)
        there = {one.number for one in self.others}
        last_of = {}
        for place, one in enumerate(came):
            if one.number not in there and one.part in in_time.get(one.cycle, ()):
                there.add(one.number)
                last_of[one.cycle] = place
        found = set()
        for missing in set(range(max(there))) - there:
            behind = next(place for place, one in enumerate(came) if one.number > missing)
            # Another list may show it when the row of its cycle is made.
            found.add(min(cycle for cycle, last in last_of.items() if last >= behind))
        return found


def drawn_cycles(seed: int, counts: str = "cycles") -> Cycles:
    """Draw cycles of which some are lost, late or sent once more, as a whole or in part."""
    rng = random.Random(seed)
    parts, interval_ns = rng.randint(1 if counts == "cycles" else 2, 4), rng.choice([20, 50]) * MS
    count, first = rng.randint(30, 60), rng.choice([1, 300, 65_510])
    jitter, apart_ns = rng.choice([0, 0.02, 0.1, 0.3]), rng.choice([MS // 10, MS])
    each = rng.choice([1, 3]) if counts == "all lists" else count + 1
    sent, others = [], []
    for cycle in range(count):
        begin_ns = START_NS + cycle * interval_ns + round(rng.uniform(0, jitter) * interval_ns)
        for part in range(parts + (cycle % each == each - 1)):
            number = len(sent) + len(others)
            counter = (first + (cycle if counts == "cycles" else number)) % 65_536
            one = Telegram(cycle, part, begin_ns + part * apart_ns, counter, number=number)
            (sent if part < parts else others).append(one)
    lost: set[tuple[int, int]] = set()
    late_ns: dict[tuple[int, int], int] = {}
    places: dict[tuple[int, int], int] = {}
    copied_ns: dict[tuple[int, int], int] = {}
    happened, at = [], EDGE
    while at < count - EDGE:
        what, cycle, part = rng.choice(list(_WHAT)), at + rng.randint(0, 1), rng.randrange(parts)
        at += rng.randint(3, 9)
        # Who goes on with 0 behind 65534 loses nothing, and who sends 0 or 1 may begin anew.
        if {65_534, 65_535, 0, 1} & {one.counter for one in sent if one.cycle == cycle}:
            continue
        own = [(cycle, one) for one in ([part] if what in ("lost", "late", "overtaken", "copied") else range(parts))]
        within_ns = rng.choice([0, apart_ns // 2, 3 * apart_ns // 2, -apart_ns // 2])
        if what.startswith("lost"):
            lost |= set(own)
        elif what.startswith("late"):
            intervals = rng.choice([1, 1, 2, 3]) + rng.choice([-0.3, 0.001, 0.3, 0.6] if what == "late" else [0, 0.3])
            late_ns |= dict.fromkeys(own, round(interval_ns * intervals) + within_ns)
        elif what == "overtaken":
            places |= dict.fromkeys(own, rng.randint(1, 5))
        else:
            copied_ns |= dict.fromkeys(own, rng.choice([1000, 2 * interval_ns + 7000, 3 * interval_ns - 9000]))
        happened.append(f"{what} {own[0][0]}.{own[0][1]}")
    came = [replace(one, time_ns=one.time_ns + late_ns.get((one.cycle, one.part), 0)) for one in sent]
    came = [one for one in came if (one.cycle, one.part) not in lost]
    came += [
        replace(one, time_ns=one.time_ns + copied_ns[one.cycle, one.part], is_copy=True)
        for one in came
        if (one.cycle, one.part) in copied_ns
    ]
    return Cycles(parts, interval_ns, _moved(came, places), happened, counts, others)


_WHAT = ("lost", "lost cycle", "late", "late cycle", "overtaken", "copied", "copied cycle")


def _moved(came: Sequence[Telegram], places: dict[tuple[int, int], int]) -> list[Telegram]:
    """Return telegrams in their order, of which some are so many places behind their own."""
    found = sorted(came, key=lambda one: one.time_ns)
    for one in [one for one in found if (one.cycle, one.part) in places and not one.is_copy]:
        at = min(found.index(one) + places[one.cycle, one.part], len(found) - 1)
        found.remove(one)
        found.append(replace(one, time_ns=found[at - 1].time_ns + 500))
        found.sort(key=lambda one: one.time_ns)
    return found
