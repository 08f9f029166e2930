"""Plants drawn at random, with faults at known places: what judges of causes are measured by."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

DURATION_S = 40


class Fault(NamedTuple):
    """What was put in: the kinds of causes that may be told for it, at which node and list, since when."""

    kinds: tuple[str, ...]
    node: str
    list: str
    since_s: float


@dataclass
class _List:
    name: str
    index: int
    node: str
    interval_ms: int
    parts: int
    acknowledged: bool


@dataclass
class Plant:
    """A scenario's text, and what is wrong in it."""

    chance: random.Random
    text: list[str] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    addresses: dict[str, str] = field(default_factory=dict)
    lists: list[_List] = field(default_factory=list)
    seen_otherwise: set[str] = field(default_factory=set)
    silent_since_s: dict[str, int] = field(default_factory=dict)

    def add(self, table: str, **keys: object) -> None:
        rows = (f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {value}" for key, value in keys.items())
        self.text.append("\n".join([f"[[{table}]]", *(row.replace("True", "true") for row in rows)]))

    def own(self, node: str) -> list[_List]:
        return [one for one in self.lists if one.node == node]


def drawn_plant(seed: int, most_faults: int = 5) -> Plant:
    """Draw a plant of three to six nodes, and up to so many faults, at most one a node."""
    plant = Plant(random.Random(seed))
    chance = plant.chance
    senders = [f"node{number}" for number in range(1, chance.randint(3, 6) + 1)]
    plant.text = [f'title = "drawn"\nduration = "{DURATION_S}s"\nseed = {seed}']
    for name, address in [(one, f"10.0.0.{number}") for number, one in enumerate(senders, 1)] + [
        ("hmi", "10.0.0.50"), ("spare", "10.0.0.99"),
    ]:  # fmt: skip
        plant.addresses[name] = address
        plant.add("node", name=name, address=address)
    for node in senders:
        for _ in range(chance.randint(1, 3)):
            _add_list(plant, node)
    plant.seen_otherwise = {one for one in (*senders, "hmi") if chance.random() < 0.8}
    free = list(senders)
    chance.shuffle(free)
    makers = list(_MAKERS)
    chance.shuffle(makers)
    for make, node in zip(makers[: chance.randint(0, most_faults)], free, strict=False):
        make(plant, node)
    for node in sorted(plant.seen_otherwise):
        until = {"until": f"{plant.silent_since_s[node]}s"} if node in plant.silent_since_s else {}
        to = senders[0] if node == "hmi" else "hmi"
        plant.add("traffic", kind="arp", node=node, to=to, interval=f"{chance.choice([500, 1000, 2000])}ms", **until)
    return plant


def _add_list(plant: Plant, node: str) -> None:
    chance, number = plant.chance, len(plant.lists) + 1
    interval_ms, parts = chance.choice([20, 50, 100, 200, 500]), chance.choice([1, 1, 2, 3])
    own = _List(f"list{number}", number, node, interval_ms, parts, chance.random() < 0.4)
    plant.lists.append(own)
    sizes = [chance.choice([256, 128, 40]) for _ in range(parts - 1)] + [chance.choice([40, 88])]
    wanted = {"acknowledge": True, "checksum": [49], "destination": "hmi"} if own.acknowledged else {}
    plant.add(
        "list", name=own.name, index=number, sender=node, bytes=sizes, interval=f"{interval_ms}ms",
        jitter=f"{interval_ms // 50}ms", phase=f"{chance.randint(0, interval_ms)}ms", **wanted,
    )  # fmt: skip
    if own.acknowledged:
        plant.add("reader", node="hmi", list=own.name)


def _moment_s(plant: Plant) -> int:
    return plant.chance.randint(10, 25)


def _silence(plant: Plant, node: str) -> None:
    at_s = plant.silent_since_s[node] = _moment_s(plant)
    plant.add("stop", node=node, at=f"{at_s}s")
    plant.faults.append(Fault(("node-silent",), node, "", at_s))


def _stop_of_program(plant: Plant, node: str) -> None:
    if node in plant.seen_otherwise:
        at_s = _moment_s(plant)
        plant.add("stop", node=node, at=f"{at_s}s")
        plant.faults.append(Fault(("program-stopped",), node, "", at_s))


def _stop_of_list(plant: Plant, node: str) -> None:
    if len(plant.own(node)) > 1:
        own, at_s = plant.chance.choice(plant.own(node)), _moment_s(plant)
        plant.add("stop", node=node, list=own.name, at=f"{at_s}s")
        plant.faults.append(Fault(("list-stopped",), node, own.name, at_s))


def _restart(plant: Plant, node: str) -> None:
    at_s, outage_s = _moment_s(plant), plant.chance.choice([0, 2, 5])
    plant.add("restart", node=node, at=f"{at_s}s", outage=f"{outage_s}s")
    plant.faults.append(Fault(("node-restart",), node, "", at_s))


def _second_sender(plant: Plant, node: str) -> None:
    free = [one for one in plant.own(node) if not one.acknowledged]
    if free:
        own, at_s = plant.chance.choice(free), _moment_s(plant)
        plant.add("second_sender", list=own.name, node="spare", **{"from": f"{at_s}s"})
        plant.faults.append(Fault(("second-sender",), "spare", own.name, at_s))


def _loss(plant: Plant, node: str) -> None:
    free = [one for one in plant.own(node) if one.parts == 1]
    if free and len(plant.own(node)) > 1:
        own, at_s = plant.chance.choice(free), _moment_s(plant)
        first, run = at_s * 1000 // own.interval_ms, plant.chance.choice([1, 3, 7])
        plant.add("loss", list=own.name, telegrams=[first], run=run)
        plant.faults.append(Fault(("loss-of-list",), node, own.name, at_s))


def _silence_of_reader(plant: Plant, node: str) -> None:
    free = [one for one in plant.own(node) if one.acknowledged]
    if free:
        own, at_s = plant.chance.choice(free), _moment_s(plant)
        first, run = at_s * 1000 // own.interval_ms, plant.chance.choice([1, 4, 9])
        plant.add("missing_acknowledgement", list=own.name, subindex=0, telegrams=[first], run=run)
        plant.faults.append(Fault(("reader-silent",), "hmi", own.name, at_s))


_MAKERS: tuple[Callable[[Plant, str], None], ...] = (
    _silence, _stop_of_program, _stop_of_list, _restart, _second_sender, _loss, _silence_of_reader,
)  # fmt: skip
