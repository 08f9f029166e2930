"""The nodes of a plant, and the lists that they send."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass
from ipaddress import ip_address

from tests.oracle.builders import MILLISECOND
from tests.oracle.frame import IPV4, IPV6, Address


@dataclass
class PlantList:
    """One list of one sender."""

    sender: Address
    port: int
    list_id: int
    items: list[int]
    interval: int
    acknowledge: bool
    checksums: list[int] | None
    destination: Address
    readers: list[Address]
    on_change: bool
    constant_data: bool
    stops_after: int | None

    @property
    def key(self) -> tuple[int, int]:
        return self.port, self.list_id


def draw_nodes(rng: random.Random, link: int | None) -> list[Address]:
    v6 = {IPV4: 0.0, IPV6: 1.0}.get(link if link is not None else -1, rng.choice((0.0, 0.0, 0.3, 1.0)))
    nodes: list[Address] = []
    for number in range(1, rng.randint(2, 6) + 1):
        if rng.random() < v6:
            nodes.append(ip_address(rng.choice(("fe80::", "2001:db8::", "::")) + f"{number:x}"))
        else:
            nodes.append(ip_address(rng.choice(("10.0.0.", "192.168.1.", "9.255.0.")) + str(number * 50 % 254 + 1)))
    return list(dict.fromkeys(nodes))


def draw_lists(rng: random.Random, nodes: Sequence[Address], *, clean: bool) -> list[PlantList]:
    """Draw a list and its senders, mostly one."""
    sender = rng.choice(nodes)
    same_family = [node for node in nodes if node.version == sender.version]
    readers = rng.sample([node for node in same_family if node != sender] or [sender], k=1)
    readers += [node for node in same_family if node != sender and rng.random() < 0.3 and node not in readers]
    if sender.version == 6:
        destination = rng.choice(("ff02::1", "ff05::c", str(readers[0])))
    else:
        subnet = str(sender).rsplit(".", 1)[0] + ".255"
        destination = rng.choice(("255.255.255.255", subnet, "225.10.10.11", str(readers[0])))
    packed = rng.random() < 0.6
    subindexes = rng.choice((1, 1, 2, 3)) if packed else rng.randint(1, 6)
    items = [rng.randint(1, 30) if packed else 1 for _ in range(subindexes)]
    checksums = [rng.randrange(256) for _ in range(subindexes)] if rng.random() < 0.3 else None
    interval = rng.choice((10, 20, 50, 100, 100, 250, 500, 1000)) * MILLISECOND
    senders = [sender]
    senders += [node for node in same_family if node != sender and rng.random() < 0.07]
    stops_after = rng.randint(3, 30) if rng.random() < 0.15 and not clean else None
    return [
        PlantList(
            sender=node,
            port=rng.choice((1202, 1202, 1300, 65535)) if node == sender else 1202,
            list_id=rng.choice((0, 1, 1, 2, 7, 65535)) if node == sender else 1,
            items=items,
            interval=interval,
            acknowledge=rng.random() < 0.4 and not (clean and node in readers),
            checksums=checksums,
            destination=ip_address(destination),
            readers=readers,
            on_change=rng.random() < 0.2 and not clean,
            constant_data=rng.random() < 0.2,
            stops_after=stops_after,
        )
        for node in senders
    ]
