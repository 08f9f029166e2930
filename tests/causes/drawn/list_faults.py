"""Faults of one list: it restarts, stops, is late, has a second sender, another definition, or a foreign counter."""

from __future__ import annotations

from tests.causes.drawn.packets import Port
from tests.causes.drawn.places import claim, end_or_not, moment
from tests.causes.drawn.plant import START_NS, List, Node, Plant
from tests.causes.drawn.traffic import Sent
from tests.causes.drawn.truth import MILLISECOND, SECOND, Fault


def cyclic_list(plant: Plant) -> List | None:
    # Not what a second sender sends for a while.
    lists = [one for one in plant.lists if one.cyclic and not one.begins_ns]
    return plant.chance.choice(lists) if lists else None


def _fault(kind: str, one: List, since_ns: int, ongoing: bool, note: str = "") -> Fault:
    return Fault(kind, since_ns, ongoing, one.interval_ns, (one.node.ip,), (one.key,), note=note)


def list_restarted(plant: Plant) -> Fault | None:
    one = cyclic_list(plant)
    if one is None or one.node.scope not in ("stream", "list"):
        return None
    others = [other for other in one.node.cyclic if other is not one]
    if 2 * len(one.sizes) >= len(one.sizes) + sum(len(other.sizes) for other in others):
        return None
    since = moment(plant, one.node.longest_ns, 3 * one.node.longest_ns + 3 * SECOND, one.node.born_ns)
    if since is None or not claim(plant, since - 10 * SECOND, since + 10 * SECOND, one.node):
        return None
    one.restarts.append(since)
    return _fault("list-restarted", one, since, False)


def list_stopped(plant: Plant) -> Fault | None:
    one = cyclic_list(plant)
    if one is None or len(one.node.cyclic) < 2:
        return None
    others = [other for other in one.node.cyclic if other is not one and other.stops_ns is None]
    if not others:
        return None
    nearest = min(other.interval_ns for other in others)
    least = max(12 * one.interval_ns, 5 * nearest, 2 * SECOND)
    since = moment(plant, one.interval_ns, least, one.node.born_ns)
    if since is None or not claim(plant, since, plant.end_ns, one):
        return None
    one.stops_ns = since
    if len(one.sizes) > 1 and plant.chance.random() < 0.25:
        one.stopped_subindex = plant.chance.randrange(len(one.sizes))
    return _fault("list-stopped", one, since, True, f"sub {one.stopped_subindex}")


def second_sender(plant: Plant) -> Fault | None:
    chance, one = plant.chance, cyclic_list(plant)
    if one is None or one.acknowledged:
        return None
    others = [node for node in plant.nodes if node is not one.node and not node.born_ns]
    if not others or chance.random() < 0.4:
        number = len(plant.nodes) + 60
        ip = f"fd00::{number:x}" if ":" in one.node.ip else f"10.0.0.{number}"
        port = Port(bytes([2, 7, 7]) + chance.randbytes(3), ip, one.node.port.vlan, 128)
        other = Node(port, chance.choice(["stream", "telegram", "send", "constant"]), False, None)
    else:
        other = chance.choice(others)
    interval = int(one.interval_ns * chance.choice([1, 1, 1, 0.5, 2]))
    since = moment(
        plant, max(interval, one.interval_ns), 15 * max(interval, one.interval_ns) + SECOND, one.node.born_ns
    )
    if since is None:
        return None
    until, ongoing = end_or_not(plant, since, 15 * interval + SECOND)
    if not claim(plant, since, min(until, plant.end_ns), one, other):
        return None
    copy = List(
        other, one.id, interval, True, one.jitter, one.sizes, one.items, one.to, checksums=one.checksums, port=one.port,
        begins_ns=since, stops_ns=None if ongoing else until,
    )  # fmt: skip
    how = chance.choice(["same", "same", "size", "checksum"])
    if how == "size":
        copy.sizes = [*one.sizes[:-1], one.sizes[-1] + chance.choice([2, 4, 8])]
        copy.items = [*one.items[:-1], one.items[-1] + chance.choice([0, 1, 2])]
    elif how == "checksum" and one.checksums:
        copy.checksums = [value ^ 0x5A for value in one.checksums]
    if other not in plant.nodes:
        plant.nodes.append(other)
    other.lists.append(copy)
    # It begins somewhere in its first interval.
    return Fault(
        "second-sender",
        since + interval // 2,
        ongoing,
        max(interval, one.interval_ns),
        (other.ip,),
        (one.key,),
        note=how,
    )


def byte_swapped(plant: Plant) -> Fault | None:
    lists = [one for one in plant.lists if one.cyclic and not one.node.born_ns and len(one.node.lists) == 1]
    lists = [
        one
        for one in lists
        if one.node.scope in ("stream", "list", "send") and plant.seconds * SECOND / one.interval_ns > 40
    ]
    if not lists:
        return None
    one = plant.chance.choice(lists)
    if one.acknowledged or not claim(plant, START_NS, plant.end_ns, one.node):
        return None
    one.swapped, one.node.controller = True, False
    one.node.reads.clear()
    return _fault("counter-foreign", one, START_NS, True, "swapped")


def wide_counter(plant: Plant) -> Fault | None:
    """A counter of 32 bits is written over Counter, Flags and Checksum: its carry asks for acknowledgements."""
    one = cyclic_list(plant)
    if one is None or one.acknowledged or one.checksums or len(one.node.lists) > 1 or one.node.scope != "list":
        return None
    since = moment(plant, one.interval_ns, 8 * one.interval_ns + 2 * SECOND, one.node.born_ns)
    if since is None or not claim(plant, START_NS, plant.end_ns, one.node):
        return None
    cycles = (since - max(START_NS, one.node.born_ns)) // one.interval_ns
    one.wide, one.next = True, dict.fromkeys(range(len(one.sizes)), int(65536 - cycles))
    return _fault("counter-foreign", one, since, True, "wide")


def sender_late(plant: Plant) -> Fault | None:
    chance, one = plant.chance, cyclic_list(plant)
    if one is None:
        return None
    whole = chance.random() < 0.4
    lists = one.node.cyclic if whole else [one]
    longest = max(each.interval_ns for each in lists)
    if plant.seconds * SECOND / longest < 25:
        return None
    events = chance.choice([1, 1, 2, 4, 8])
    delay = int(longest * chance.uniform(2.5, 7))
    if delay > 8 * SECOND:
        return None
    apart = delay + 4 * longest + int(chance.uniform(0.2, 3) * SECOND)
    # One in twenty late, and there is no interval that is usual.
    apart = max(apart, 30 * longest) if events > 1 else apart
    since = moment(plant, longest, events * apart + 3 * apart + 6 * longest, one.node.born_ns)
    late = f"late {one.node.ip}"
    if since is None or not claim(plant, since, since + events * apart, late, *(one.node.lists if whole else [one])):
        return None
    # Of many that come again and again to the end, it is still so.
    ongoing = events > 1 and chance.random() < 0.3
    last = since + events * apart
    times = [since + number * apart for number in range(events)]
    if ongoing:
        plant.claims.append((late, since, plant.end_ns))
        times = list(range(since, plant.end_ns - apart // 2, apart))
        last = plant.end_ns
        if not claim(plant, last, last, *(one.node.lists if whole else [one])):
            return None
    for each in lists:
        each.late += [(ts_ns, delay) for ts_ns in times]
    return (
        _fault("sender-late", one, since, ongoing, f"whole {whole} {len(times)}x{delay / 1e9:.2f}")
        if not whole
        else Fault(
            "sender-late",
            since,
            ongoing,
            longest,
            (one.node.ip,),
            tuple(each.key for each in lists),
            note=f"whole {len(times)}x",
        )
    )


def sender_bursts(plant: Plant) -> Fault | None:
    """Telegrams sent twice within a moment: a note."""
    one = cyclic_list(plant)
    if one is None or one.interval_ns < 40 * MILLISECOND or one.interval_ns > SECOND:
        return None
    # Who waits for an acknowledgement in between does not send within a tenth of the interval (NV503).
    if one.acknowledged and 2 * one.latency_ns >= one.interval_ns // 12:
        return None
    # Of few intervals these would be one in twenty: then none is usual.
    if plant.seconds * SECOND / one.interval_ns < 150:
        return None
    since = moment(plant, one.interval_ns, 12 * SECOND, one.node.born_ns)
    if since is None or not claim(plant, since, since + 6 * SECOND, one):
        return None
    one.bursts += [since, since + 2 * SECOND, since + 4 * SECOND]
    return _fault("sender-bursts", one, since, False)


def download(plant: Plant) -> Fault | None:
    """The definition of the sender changes while it runs: sizes, numbers of variables, or the checksum alone."""
    chance, one = plant.chance, cyclic_list(plant)
    if one is None:
        return None
    since = moment(plant, one.interval_ns, 20 * one.interval_ns + SECOND, one.node.born_ns)
    if since is None or not claim(plant, since, plant.end_ns, one):
        return None
    sizes, items, checksums = list(one.sizes), list(one.items), one.checksums and list(one.checksums)
    if checksums and chance.random() < 0.5:
        checksums = [value ^ 0x33 for value in checksums]
        note = "checksum"
    else:
        sub = chance.randrange(len(sizes))
        sizes[sub] += chance.choice([1, 2, 4, -1])
        items[sub] += chance.choice([0, 1])
        checksums = checksums and [value ^ 0x33 for value in checksums]
        note = "shape"
    one.shapes.append((since, 1 << 62, sizes, items, checksums))
    return _fault("definition-differs", one, since, True, note)


def two_paths(plant: Plant) -> Fault | None:
    """Some telegrams of a list take the slower of two ways, and come after those sent later."""
    chance, one = plant.chance, cyclic_list(plant)
    if (
        one is None
        or one.interval_ns > 500 * MILLISECOND
        or one.acknowledged
        or one.node.scope not in ("stream", "list")
    ):
        return None
    since = moment(plant, one.interval_ns, 30 * one.interval_ns + 2 * SECOND, one.node.born_ns)
    if since is None or not claim(plant, since, plant.end_ns, one, f"paths {one.node.ip}"):
        return None
    other = one.node.port._replace(mac=b"\x02\x99" + one.node.port.mac[2:], ttl=one.node.port.ttl - 1)
    share = chance.uniform(0.05, 0.15)
    fault = _fault("two-paths", one, since, True)
    last: list[int] = []

    def detour(plant: Plant, sents: list[Sent]) -> None:
        mine = [sent for sent in sents if sent.list is one and sent.ts_ns >= since]
        cycles = sorted({sent.counter for sent in mine})
        slow = {
            counter for number, counter in enumerate(cycles) if number % 3 == 0 and plant.chance.random() < 3 * share
        }
        slow |= {cycles[-4] if len(cycles) > 4 else -1}
        for sent in mine:
            if sent.counter in slow and sent.ts_ns < plant.end_ns - 3 * one.interval_ns:
                sent.ts_ns += int(one.interval_ns * 1.4)
                sent.port = other
                last.append(sent.ts_ns)
        sents.sort(key=lambda sent: sent.ts_ns)
        if last:
            fault.since_ns = min(last)

    plant.losses.append(detour)
    return fault
