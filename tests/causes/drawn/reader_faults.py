"""Faults of readers: silent, without a program, rejecting, never there; and requests that nobody answers."""

from __future__ import annotations

from tests.causes.drawn.list_faults import _fault
from tests.causes.drawn.packets import datagram, group_mac
from tests.causes.drawn.places import claim, end_or_not, moment
from tests.causes.drawn.plant import START_NS, List, Plant
from tests.causes.drawn.traffic import _head
from tests.causes.drawn.truth import MILLISECOND, SECOND, Fault
from tests.records import replace


def _answered(plant: Plant) -> List | None:
    lists = [one for one in plant.lists if one.acknowledged and len(one.readers) == 1 and one.cyclic]
    lists = [one for one in lists if not one.readers[0].born_ns and not one.node.born_ns]
    return plant.chance.choice(lists) if lists else None


def _of_reader(one: List, kind: str, since_ns: int, ongoing: bool, note: str = "") -> Fault:
    return Fault(kind, since_ns, ongoing, one.interval_ns, (one.readers[0].ip,), (one.key,), note=note)


def reader_silent(plant: Plant) -> Fault | None:
    return _reader_is(plant, "reader-silent", "nothing")


def reader_rejects(plant: Plant) -> Fault | None:
    return _reader_is(plant, "reader-rejects", "reject")


def reader_without_program(plant: Plant) -> Fault | None:
    one = _answered(plant)
    if one is None or group_mac(one.to):
        return None
    return _reader_is(plant, "reader-without-program", "icmp", one)


def _reader_is(plant: Plant, kind: str, how: str, one: List | None = None) -> Fault | None:
    one = one or _answered(plant)
    if one is None:
        return None
    since = moment(plant, one.interval_ns, 12 * one.interval_ns + 4 * SECOND)
    if since is None:
        return None
    until, ongoing = end_or_not(plant, since, 8 * one.interval_ns + 2 * SECOND)
    if not claim(plant, since, min(until, plant.end_ns), one, one.readers[0]):
        return None
    one.silent_readers.append((since, until, how))
    return _of_reader(one, kind, since, ongoing)


def single_answers_lost(plant: Plant) -> Fault | None:
    one = _answered(plant)
    if one is None or plant.seconds * SECOND / one.interval_ns < 100:
        return None
    since = moment(plant, one.interval_ns, 80 * one.interval_ns)
    if since is None or not claim(plant, since, plant.end_ns, one, one.readers[0]):
        return None
    one.unanswered, one.unanswered_from_ns = plant.chance.uniform(0.05, 0.2), since
    fault = _of_reader(one, "reader-silent", since, True, "single")
    one.single_fault = fault
    return fault


def acknowledgement_impossible(plant: Plant) -> Fault | None:
    lists = [one for one in plant.lists if not one.readers and one.node.controller and one.cyclic and not one.checksums]
    lists = [one for one in lists if not one.node.born_ns and one.interval_ns < plant.seconds * SECOND / 8]
    if not lists:
        return None
    one = plant.chance.choice(lists)
    others = [node for node in plant.nodes if node is not one.node]
    if not claim(plant, START_NS, plant.end_ns, one):
        return None
    one.acknowledged = True
    where = plant.chance.choice(["all", "node", "nobody"])
    if where == "node" and others:
        one.to = plant.chance.choice(others).ip
    elif where == "nobody":
        one.to = "fd00::ee" if ":" in one.node.ip else "10.0.0.238"
    # Told at the sender as well as at the node that it addresses.
    fault = _fault("acknowledgement-impossible", one, START_NS, True, where)
    return replace(fault, nodes=())


def boot_up_unanswered(plant: Plant) -> Fault | None:
    nodes = [node for node in plant.nodes if node.controller and not node.born_ns]
    if not nodes:
        return None
    chance, node = plant.chance, plant.chance.choice(nodes)
    since = moment(plant, 0, 8 * SECOND)
    if since is None or not claim(plant, since, since + 2 * SECOND, node):
        return None
    number = 300 + len(plant.extra)
    to = plant.lists[0].to if group_mac(plant.lists[0].to) else ("ff02::1" if ":" in node.ip else "255.255.255.255")
    for sub in range(chance.randint(1, 3)):
        frame = datagram(node.port, group_mac(to) or b"", to, _head(6, number, sub, 0, 20, 0, 0, 0))
        plant.extra.append((since + sub * MILLISECOND, frame))
    return Fault("boot-up-unanswered", since, False, 0, lists=(f"udp/1202/{number}",))
