"""Plants on Ethernet without a fault: nodes, their lists, who reads them, how they count; drawn at random."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import Any

from tests.causes.drawn.packets import Port
from tests.causes.drawn.truth import MILLISECOND, SECOND, Fault

START_NS = 1_700_000_000 * SECOND
MOST_TELEGRAMS = 24_000
STATION = "station"


@dataclass
class Away:
    """A time in which a node, or some of its lists, do not send.

    ``mode``: "off" (no program, nothing; begins anew), "cable" (the program goes on, nothing comes through), "frozen"
    (the program stands still and goes on where it was). ``chatter`` says whether its other frames go on.
    """

    since_ns: int
    until_ns: int
    mode: str
    chatter: bool = False
    announces: bool = True


@dataclass(eq=False)
class Node:
    port: Port
    scope: str
    """How it counts: stream, list, telegram, send, constant, wrap256, wrap65534."""
    controller: bool
    chatter_ns: int | None
    lists: list[List] = field(default_factory=list)
    reads: list[List] = field(default_factory=list)
    born_ns: int = 0
    away: list[Away] = field(default_factory=list)
    requests: bool = True

    @property
    def ip(self) -> str:
        return self.port.ip

    @property
    def cyclic(self) -> list[List]:
        return [one for one in self.lists if one.cyclic]

    @property
    def longest_ns(self) -> int:
        return max((one.interval_ns for one in self.cyclic), default=0)

    def is_up(self, ts_ns: int, of: str = "program") -> bool:
        """Tell whether its program, or anything of it, answers."""
        if ts_ns < self.born_ns:
            return False
        for away in self.away:
            if away.since_ns < ts_ns < away.until_ns and not (of == "anything" and away.chatter):
                return False
        return True


@dataclass(eq=False)
class List:
    node: Node
    id: int
    interval_ns: int
    cyclic: bool
    jitter: float
    sizes: list[int]
    items: list[int]
    to: str
    acknowledged: bool = False
    readers: list[Node] = field(default_factory=list)
    checksums: list[int] | None = None
    port: int = 1202
    latency_ns: int = 2 * MILLISECOND
    stops_ns: int | None = None
    stopped_subindex: int | None = None
    begins_ns: int = 0
    restarts: list[int] = field(default_factory=list)
    late: list[tuple[int, int]] = field(default_factory=list)
    """Times from which the next cycle is late, by how much."""
    bursts: list[int] = field(default_factory=list)
    shapes: list[tuple[int, int, list[int], list[int], list[int] | None]] = field(default_factory=list)
    """Since, until; sizes, items and checksums from then on."""
    swapped: bool = False
    header: int = 20
    wide: bool = False
    next: dict[int, int] = field(default_factory=dict)
    silent_readers: list[tuple[int, int, str]] = field(default_factory=list)
    """Since, until, how: "nothing", "icmp", "reject"."""
    single_fault: Fault | None = None
    unanswered: float = 0.0
    unanswered_in_row: dict[int, int] = field(default_factory=dict)
    unanswered_ns: list[int] = field(default_factory=list)
    unanswered_from_ns: int = 0
    unanswered_until_ns: int = 1 << 62

    @property
    def key(self) -> str:
        return f"udp/{self.port}/{self.id}"


@dataclass(eq=False)
class Plant:
    chance: random.Random
    seconds: int
    nodes: list[Node]
    faults: list[Fault] = field(default_factory=list)
    claims: list[tuple[str, object, int, int]] = field(default_factory=list)
    losses: list[Any] = field(default_factory=list)
    """What takes telegrams away, in order: see ``traffic``."""
    captured: list[Any] = field(default_factory=list)
    """What happens in the capture: mirrored twice, clock."""
    clocks: list[tuple[int, Any]] = field(default_factory=list)
    drops: int | None = None
    extra: list[tuple[int, bytes]] = field(default_factory=list)
    definitions: list[str] = field(default_factory=list)

    @property
    def end_ns(self) -> int:
        return START_NS + self.seconds * SECOND

    @property
    def lists(self) -> list[List]:
        return [one for node in self.nodes for one in node.lists]

    @property
    def senders(self) -> list[Node]:
        return [node for node in self.nodes if node.lists]


def drawn_plant(chance: random.Random) -> Plant:
    """Return a plant without a fault."""
    seconds = chance.choice([20, 25, 30, 40, 45, 60, 60, 90, 120])
    six = chance.random() < 0.08
    vlan = chance.choice([0, 0, 0, 0, 0, 7, 120])
    plant = Plant(chance, seconds, [])
    vendor = [bytes(chance.randbytes(3)) for _ in range(3)]
    for number in range(chance.randint(1, 8)):
        ip = f"fd00::{number + 1:x}" if six else f"10.0.{chance.choice([0, 0, 0, 1]) if number else 0}.{number + 11}"
        mac = bytes([chance.choice(vendor)[0] & 0xFC]) + chance.choice(vendor)[1:] + bytes([0, 1, number + 1])
        controller = chance.random() < 0.75
        scope = (
            "stream"
            if controller
            else chance.choice(["stream", "list", "telegram", "send", "constant", "wrap256", "wrap65534"])
        )
        chatter = chance.choice([None, None, *(int(chance.uniform(0.3, 6) * SECOND) for _ in range(3))])
        node = Node(Port(mac, ip, vlan, chance.choice([64, 128])), scope, controller, chatter)
        if chance.random() < 0.08:
            node.born_ns = START_NS + int(chance.uniform(0.1, 0.4) * seconds * SECOND)
        plant.nodes.append(node)
    if any(node.born_ns for node in plant.nodes) and chance.random() < 0.5:
        plant.nodes[0].born_ns = 0
    numbers = chance.sample(range(1, 255), 60)
    port = chance.choice([1202] * 9 + [1203])
    broadcast = (
        "ff02::1" if six else chance.choice(["255.255.255.255", "255.255.255.255", "10.0.255.255", "225.10.10.11"])
    )
    rate = 0.0
    for node in plant.nodes:
        if len(plant.nodes) > 1 and chance.random() < 0.1 and plant.lists:
            continue
        for _ in range(chance.choice([1, 1, 2, 2, 3, 4, 5, 6])):
            interval = chance.choice([5, 10, 20, 50, 50, 100, 100, 100, 200, 250, 500, 500, 1000, 2000]) * MILLISECOND
            subs = chance.choice([1, 1, 1, 1, 2, 3, 4])
            while rate + subs * SECOND / interval > MOST_TELEGRAMS / seconds and interval < 2 * SECOND:
                interval *= 2
            rate += subs * SECOND / interval
            cyclic = chance.random() < 0.88
            sizes = [chance.randint(240, 256) for _ in range(subs - 1)] + [chance.randint(2, 200)]
            one = List(
                node, numbers.pop(), interval, cyclic, chance.choice([0.0005, 0.01, 0.03, 0.08]), sizes,
                [max(1, size // chance.choice([1, 2, 4])) for size in sizes], broadcast, port=port,
                latency_ns=min(int(chance.uniform(0.5, 8) * MILLISECOND), interval // 5),
            )  # fmt: skip
            if chance.random() < 0.25:
                one.checksums = [chance.randrange(1, 256) for _ in sizes]
            others = [other for other in plant.nodes if other is not node and other.controller]
            if others and chance.random() < 0.4:
                one.readers = chance.sample(others, min(len(others), chance.choice([1, 1, 1, 2, 3])))
                # Who comes late cannot have answered before.
                there = not any(reader.born_ns for reader in one.readers)
                one.acknowledged = there and node.controller and chance.random() < 0.6
                if len(one.readers) == 1 and chance.random() < 0.5:
                    one.to = one.readers[0].ip
                for reader in one.readers:
                    reader.reads.append(one)
            node.lists.append(one)
    return plant
