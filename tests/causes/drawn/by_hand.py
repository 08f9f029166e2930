"""Plants of tests that say themselves who sends what, and what befalls it."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

from nvscope.analysis.inquiry import Inquiry
from nvscope.causes.cause import Cause
from tests.causes.drawn.bus import Bus, write_log
from tests.causes.drawn.packets import Port, write_pcap
from tests.causes.drawn.plant import START_NS, List, Node, Plant
from tests.causes.drawn.traffic import Sent, play
from tests.causes.drawn.truth import MILLISECOND, SECOND
from tests.causes.told import causes_of

Picks = Callable[[Sent, float], bool]
"""Tells of a telegram, and of when it is sent in seconds, whether it is meant."""


def plant_of(seconds: int) -> Plant:
    return Plant(random.Random(1), seconds, [])


def node_of(plant: Plant, number: int, *, scope: str = "stream", chatter_s: float | None = None) -> Node:
    port = Port(bytes([2, 0, 0, 0, 0, number]), f"10.0.0.{number}")
    node = Node(port, scope, scope == "stream", None if chatter_s is None else int(chatter_s * SECOND))
    plant.nodes.append(node)
    return node


def list_of(node: Node, number: int, interval_ms: int, *, readers: tuple[Node, ...] = (), cyclic: bool = True) -> List:
    """Add a list that is sent to everybody, and acknowledged where it has readers."""
    one = List(
        node, number, interval_ms * MILLISECOND, cyclic, 0.01, [40], [10], "255.255.255.255", bool(readers), [*readers],
        latency_ns=MILLISECOND,
    )  # fmt: skip
    node.lists.append(one)
    for reader in readers:
        reader.reads.append(one)
    return one


def lost(plant: Plant, picks: Picks) -> None:
    """Let telegrams be sent and not come."""

    def lose(_: Plant, sents: list[Sent]) -> None:
        for sent in sents:
            sent.gone = sent.gone or picks(sent, (sent.ts_ns - START_NS) / SECOND)

    plant.losses.append(lose)


def told_of(plant: Plant, directory: Path) -> list[tuple[str, float, float | None]]:
    """Return what is told of a plant: kinds with since when and until when in seconds, None for still so."""
    path = directory / "plant.pcap"
    write_pcap(play(plant), path)
    return _told(causes_of(Inquiry([str(path)]))[1])


def told_of_bus(bus: Bus, directory: Path) -> list[tuple[str, float, float | None]]:
    """Return the same of a bus."""
    from tests.causes.drawn.draw import inquiry_of  # noqa: PLC0415

    return _told(causes_of(inquiry_of([bus], *write_log([bus], directory)))[1])


def _told(causes: list[Cause]) -> list[tuple[str, float, float | None]]:
    rows = []
    for cause in causes:
        until_s = None if cause.until_ns is None else round((cause.until_ns - START_NS) / SECOND, 1)
        rows.append((cause.kind.name, round(((cause.since_ns or 0) - START_NS) / SECOND, 1), until_s))
    return sorted(rows)
