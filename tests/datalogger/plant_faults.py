"""What may happen to telegrams: while they are sent, and while they are captured."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence

from tests.datalogger.oracle import SECOND_NS
from tests.datalogger.oracle_losses import Packet
from tests.records import replace

MS = 1_000_000


def in_order(packets: list[Packet]) -> list[Packet]:
    packets.sort(key=lambda packet: packet.time_ns)
    return packets


def somewhere(rng: random.Random, packets: Sequence[Packet]) -> int:
    return rng.randrange(len(packets))


def lose(rng: random.Random, packets: list[Packet]) -> None:
    at = somewhere(rng, packets)
    del packets[at : at + rng.choice([1, 1, 1, 2, 5])]


def overtake(rng: random.Random, packets: list[Packet]) -> None:
    """Telegrams come late: all of those that were missing, or some."""
    for at in sorted(rng.sample(range(len(packets)), min(len(packets), rng.choice([1, 1, 2, 3])))):
        packets[at] = replace(packets[at], time_ns=packets[at].time_ns + rng.choice([15, 60, 150, 400]) * MS)
    in_order(packets)


def lose_and_overtake(rng: random.Random, packets: list[Packet]) -> None:
    """Of telegrams of one stream in a row, some come late, in any order, and one perhaps never."""
    chosen = packets[somewhere(rng, packets)]
    row = [
        place
        for place, packet in enumerate(packets)
        if packet.stream == chosen.stream and packet.time_ns >= chosen.time_ns
    ]
    row = row[: rng.choice([1, 2, 3, 4])]
    late = {place: packets[place].time_ns + rng.choice([120, 250]) * MS for place in row}
    for place, time_ns in late.items():
        packets[place] = replace(packets[place], time_ns=time_ns)
    if rng.random() < 0.5:
        del packets[row[rng.randrange(len(row))]]
    in_order(packets)


def repeat(rng: random.Random, packets: list[Packet]) -> None:
    packet = packets[somewhere(rng, packets)]
    packets.append(replace(packet, time_ns=packet.time_ns + rng.choice([1_000, 3 * MS, 120 * MS])))
    in_order(packets)


def mirror(rng: random.Random, packets: list[Packet]) -> None:
    """From some time on, each packet is captured twice."""
    since_ns, late_ns = packets[somewhere(rng, packets)].time_ns, rng.choice([300, 2_000, 4 * MS, 12 * MS])
    again = [replace(one, time_ns=one.time_ns + late_ns, drops=0) for one in packets if one.time_ns >= since_ns]
    packets += again
    in_order(packets)


def swap(rng: random.Random, packets: list[Packet]) -> None:
    """From some time on, two SubIndexes of a list come in turns."""
    chosen = packets[somewhere(rng, packets)]
    waiting: dict[int, Packet] = {}
    for packet in [one for one in packets if one.stream[:3] == chosen.stream[:3] and one.time_ns >= chosen.time_ns]:
        other = waiting.pop(packet.subindex - 1, None)
        if other is not None:
            other.time_ns, packet.time_ns = packet.time_ns, other.time_ns
        else:
            waiting[packet.subindex] = packet
    in_order(packets)


def stand_still(rng: random.Random, packets: list[Packet]) -> None:
    """From some time on, a stream sends the same telegram again and again."""
    chosen = packets[somewhere(rng, packets)]
    for place, packet in enumerate(packets):
        if packet.stream == chosen.stream and packet.time_ns >= chosen.time_ns:
            packets[place] = replace(packet, counter=chosen.counter, data=chosen.data)


def restart(rng: random.Random, packets: list[Packet]) -> None:
    chosen = packets[somewhere(rng, packets)]
    first: dict[object, int] = {}
    for place, packet in enumerate(packets):
        if packet.node == chosen.node and packet.time_ns >= chosen.time_ns:
            begin = first.setdefault(packet.stream, packet.counter)
            packets[place] = replace(packet, counter=(packet.counter - begin + rng.choice([1, 1, 1, 0])) % 65_536)


def stop(rng: random.Random, packets: list[Packet]) -> None:
    """One list of a sender is silent for a while, and its counters too."""
    chosen = packets[somewhere(rng, packets)]
    silent_ns = rng.choice([3, 8, 15, 30]) * rng.choice([10, 20, 50]) * MS
    behind = [p for p in packets if p.index == chosen.index and p.time_ns >= chosen.time_ns]
    for packet in behind:
        packet.time_ns += silent_ns
    in_order(packets)


def misshape(rng: random.Random, packets: list[Packet]) -> None:
    packet = packets[somewhere(rng, packets)]
    if rng.random() < 0.5:
        packet.items += 1
    else:
        packet.data = packet.data + b"\1" if rng.random() < 0.5 else packet.data[:-1]


def malform(rng: random.Random, packets: list[Packet]) -> None:
    packet = packets[somewhere(rng, packets)]
    if rng.random() < 0.5:
        packet.well_formed = False
    else:
        packet.service, packet.data, packet.items = 5, b"", 0


def stranger(rng: random.Random, packets: list[Packet]) -> None:
    time_ns = packets[somewhere(rng, packets)].time_ns + rng.randrange(-20 * MS, 20 * MS)
    foreign = Packet(time_ns)
    if rng.random() < 0.4:
        foreign = Packet(time_ns, "10.0.0.1", 900, 0, 1, rng.randrange(9), b"\1\2")
    elif rng.random() < 0.3:
        chosen = packets[somewhere(rng, packets)]
        foreign = replace(chosen, time_ns=time_ns, subindex=chosen.subindex + 20, counter=rng.randrange(9))
    packets.append(foreign)
    in_order(packets)


def late_stamp(rng: random.Random, packets: list[Packet]) -> None:
    """A packet bears a time a little before that of the one before it."""
    packet = packets[somewhere(rng, packets)]
    packet.time_ns -= rng.choice([1_000, 30 * MS, 400 * MS])


def set_back(rng: random.Random, packets: list[Packet]) -> None:
    at, by_ns = somewhere(rng, packets), rng.choice([40 * MS, 500 * MS, 1_500 * MS, 7 * SECOND_NS, 900 * SECOND_NS])
    for packet in packets[at:]:
        packet.time_ns -= by_ns


def pause(rng: random.Random, packets: list[Packet]) -> None:
    at, by_ns = somewhere(rng, packets), rng.choice([2, 50]) * 3600 * SECOND_NS + rng.randrange(SECOND_NS)
    for packet in packets[at:]:
        packet.time_ns += by_ns


def drop(rng: random.Random, packets: list[Packet]) -> None:
    packets[somewhere(rng, packets)].drops = rng.choice([1, 40])


Fault = Callable[[random.Random, list[Packet]], None]
WHILE_SENT: Sequence[Fault] = (
    lose, lose, overtake, lose_and_overtake, lose_and_overtake, repeat, swap, restart, stand_still, stop, misshape,
    malform, stranger,
)  # fmt: skip
WHILE_CAPTURED: Sequence[Fault] = (mirror, late_stamp, set_back, pause, drop)
