"""A plant played against a clock: what its nodes send, and what of it reaches others and the capture."""

from __future__ import annotations

import random
import struct
from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple

from tests.causes.drawn.packets import Frame, arp, datagram, group_mac, segment, unreachable
from tests.causes.drawn.plant import START_NS, List, Node, Plant
from tests.causes.drawn.truth import MILLISECOND, SECOND
from tests.oracle.builders import IDENTITY

STATION_MAC = b"\x00\x50\x56\x01\x02\x03"


class UnclearError(Exception):
    """What was drawn would be told otherwise, or nobody could tell it: another plant has to be drawn."""


class Sent:
    """A data telegram: when, what, and whether it got through its node's link (``gone``) and into the capture."""

    __slots__ = ("counter", "gone", "list", "port", "subindex", "ts_ns", "unseen")

    def __init__(self, ts_ns: int, list_: List, subindex: int, counter: int) -> None:
        self.ts_ns = ts_ns
        self.list = list_
        self.subindex = subindex
        self.counter = counter
        self.gone = False
        self.unseen = False
        self.port = list_.node.port


class Seen(NamedTuple):
    """A frame at the mirror port, with who sent it and the data telegram that it is."""

    ts_ns: int
    data: bytes
    node: Node | None
    sent: Sent | None


def play(plant: Plant) -> list[Frame]:
    """Return what was captured of a plant."""
    chance = plant.chance
    others: list[Seen] = []
    answers = defaultdict(list)
    for node in plant.nodes:
        delays_ns = {id(one): int(chance.uniform(2, 40) * MILLISECOND) for one in node.reads}
        for ts_ns, one, subindex in _requests(plant, node):
            # A request to everybody, or to the sender.
            others.append(
                Seen(ts_ns, _telegram_frame(node, one, _head(6, one.id, subindex, 0, 20, 0, 0, 0)), node, None)
            )
            # What comes in a moment anyway answers, too.
            soon = one.cyclic and one.interval_ns <= SECOND // 20
            answers_it = one.node.controller and one.node.is_up(ts_ns) and (one.stops_ns or 1 << 62) > ts_ns
            # All that is asked of a list is answered in one cycle of its sender.
            if answers_it and not soon and subindex == len(one.sizes) - 1:
                answers[one.node.ip].append((ts_ns + delays_ns[id(one)], one, list(range(len(one.sizes)))))
        others += _chatter(plant, node)
    sents: list[Sent] = []
    for node in plant.nodes:
        sents += _numbered(chance, node, sorted([*_cycles(plant, node), *answers[node.ip]], key=lambda row: row[0]))
    sents = [sent for sent in sents if START_NS <= sent.ts_ns < plant.end_ns]
    sents.sort(key=lambda sent: sent.ts_ns)
    for take in plant.losses:
        take(plant, sents)
    seen = [*others, *_answers(plant, sents)]
    _check_singles(plant)
    seen += [Seen(sent.ts_ns, data_frame(sent), sent.list.node, sent) for sent in sents if not sent.gone]
    seen += [Seen(ts_ns, data, None, None) for ts_ns, data in plant.extra]
    seen = [one for one in seen if one.ts_ns < plant.end_ns]
    seen.sort(key=lambda one: one.ts_ns)
    for change in [*plant.captured, *(step for _, step in sorted(plant.clocks, key=lambda one: -one[0]))]:
        seen = change(plant, seen)
    return [Frame(one.ts_ns, one.data) for one in seen if one.ts_ns >= START_NS and not (one.sent and one.sent.unseen)]


def _requests(plant: Plant, node: Node) -> Iterator[tuple[int, List, int]]:
    """Yield the boot-up requests of a node: when it came up, for each telegram of each list that it reads."""
    ups = [node.born_ns] if node.born_ns else []
    ups += [
        away.until_ns for away in node.away if away.mode == "off" and away.announces and away.until_ns < plant.end_ns
    ]
    for up_ns in ups:
        ts_ns = up_ns + int(plant.chance.uniform(5, 100) * MILLISECOND)
        for one in node.reads if node.controller and node.requests else []:
            answered = one.node.controller or (one.cyclic and one.interval_ns <= SECOND // 2)
            if not answered or not one.node.is_up(ts_ns) or not one.node.is_up(ts_ns + SECOND):
                continue
            if one.stops_ns and one.stops_ns < ts_ns + SECOND:
                continue
            for subindex in range(len(one.sizes)):
                ts_ns += int(plant.chance.uniform(0.1, 3) * MILLISECOND)
                yield ts_ns, one, subindex


def _chatter(plant: Plant, node: Node) -> list[Seen]:
    """Return the other frames of a node: ARP, and what it says to an engineering station."""
    chance, rows = plant.chance, []
    announced = [node.born_ns] if node.born_ns and chance.random() < 0.8 else []
    announced += [away.until_ns for away in node.away if away.mode == "off" and away.announces]
    rows += [
        Seen(ts_ns, arp(node.port, "", gratuitous=True), node, None) for ts_ns in announced if ts_ns < plant.end_ns
    ]
    if node.chatter_ns is None:
        return rows
    ts_ns = START_NS + int(chance.random() * node.chatter_ns)
    kind = chance.choice(["arp", "tcp", "both"])
    while ts_ns < plant.end_ns:
        if node.is_up(ts_ns, "anything"):
            other = plant.nodes[chance.randrange(len(plant.nodes))]
            asks = kind == "arp" or (kind == "both" and chance.random() < 0.5)
            data = arp(node.port, other.ip) if asks else segment(node.port, STATION_MAC, _station(node), ts_ns)
            rows.append(Seen(ts_ns, data, node, None))
        ts_ns += int(node.chatter_ns * chance.uniform(0.8, 1.25))
    return rows


def _station(node: Node) -> str:
    return "fd00::ffff" if ":" in node.ip else "10.0.0.250"


def _cycles(plant: Plant, node: Node) -> list[tuple[int, List, list[int]]]:
    """Return when which SubIndexes of its lists are sent, as if the node never stopped."""
    chance: random.Random = plant.chance
    rows = []
    for one in node.lists:
        everything = list(range(len(one.sizes)))
        base_ns = max(START_NS - 2 * one.interval_ns, node.born_ns, one.begins_ns)
        base_ns += int(chance.random() * one.interval_ns)
        late = sorted(one.late)
        bursts = sorted(one.bursts)
        while base_ns < plant.end_ns:
            ts_ns = base_ns
            if one.cyclic:
                spread = one.jitter * one.interval_ns
                ts_ns += int(max(-2.5 * spread, min(2.5 * spread, chance.gauss(0, spread))))
                while late and late[0][0] <= ts_ns:
                    delay_ns = late.pop(0)[1]
                    base_ns += delay_ns
                    ts_ns += delay_ns
            subs = everything
            if one.stops_ns is not None and ts_ns >= one.stops_ns:
                if one.stopped_subindex is None:
                    break
                subs = [sub for sub in everything if sub != one.stopped_subindex]
            rows.append((ts_ns, one, subs))
            if bursts and bursts[0] <= ts_ns:
                bursts.pop(0)
                rows.append((ts_ns + max(one.interval_ns // 20, MILLISECOND // 2), one, subs))
            if one.cyclic:
                base_ns += one.interval_ns
            elif chance.random() < 0.1:
                base_ns += 20 * MILLISECOND
            else:
                base_ns += 20 * MILLISECOND + int(chance.expovariate(1 / (3 * one.interval_ns)))
    return rows


def _numbered(chance: random.Random, node: Node, cycles: list[tuple[int, List, list[int]]]) -> list[Sent]:
    """Return the telegrams of a node with their counters, one after the other, as far as it is not away."""
    sents = []
    count = node_start = 1 if node.born_ns else chance.choice([chance.randrange(1, 60_000), chance.randrange(1, 2000)])
    counters: dict[object, int] = {}
    free_ns = 0
    apart_ns = min(250_000, min((one.interval_ns for one in node.lists), default=0) // 40)
    sent_ns: dict[tuple[List, int], int] = {}
    aways = sorted((away for away in node.away), key=lambda away: away.since_ns)
    back = 0
    restarts = (
        sorted((ts_ns, one) for one in node.lists for ts_ns in one.restarts)
        if any(one.restarts for one in node.lists)
        else []
    )
    for wanted_ns, one, subs in cycles:
        ts_ns = max(wanted_ns, free_ns)
        if one.acknowledged:
            # An answer to a request waits for the acknowledgement of the telegram before.
            ts_ns = max(ts_ns, *(sent_ns.get((one, sub), 0) + 2 * one.latency_ns for sub in subs))
            sent_ns.update(((one, sub), ts_ns) for sub in subs)
        while restarts and restarts[0][0] <= ts_ns:
            _, again = restarts.pop(0)
            for sub in range(len(again.sizes)):
                counters[(again, sub) if node.scope == "stream" else again] = 1
        away = next((away for away in aways if away.since_ns <= ts_ns < away.until_ns), None)
        if away is not None and away.mode != "cable":
            continue
        while back < len(aways) and aways[back].until_ns <= ts_ns:
            if aways[back].mode == "off":
                counters.clear()
                node_start = count = 1
            back += 1
        first = True
        for sub in subs:
            key: object = (one, sub) if node.scope == "stream" else one if node.scope == "list" else None
            if node.scope in ("stream", "list"):
                # Streams of one list count together, but streams that began at other times do not.
                value = counters.setdefault(
                    key, one.next.get(sub, node_start + (one.id * 37) % 1000 * (node_start > 1))
                )
                if node.scope == "stream" or sub == subs[-1]:
                    counters[key] = value + 1
            elif node.scope == "constant":
                value = 1
            else:
                value = count
                if node.scope != "send" or sub == subs[-1]:
                    count += 1
            if node.scope == "wrap256":
                value %= 256
            elif node.scope == "wrap65534":
                value %= 65535
            sent = Sent(ts_ns, one, sub, value)
            sent.gone = away is not None
            sents.append(sent)
            ts_ns += int(chance.uniform(0.3, 1) * apart_ns)
            first = False
        free_ns = ts_ns if not first else free_ns
    return sents


def _head(service: int, id_: int, sub: int, items: int, length: int, counter: int, flags: int, checksum: int) -> bytes:
    fields = (service, id_, sub, items, length, counter & 0xFFFF, flags, checksum)
    return IDENTITY + struct.pack("<IHHHHHBB", *fields)


def payload(sent: Sent) -> bytes:
    """Return the bytes of a data telegram: values that differ from one to the next."""
    one, sub = sent.list, sent.subindex
    sizes, items, checksums = one.sizes, one.items, one.checksums
    for since_ns, until_ns, *shape in one.shapes:
        if since_ns <= sent.ts_ns < until_ns:
            sizes, items, checksums = shape
    if sub >= len(sizes):
        sizes, items = one.sizes, one.items
    size = sizes[sub]
    data = (struct.pack("<Q", sent.ts_ns // 1000) + bytes(size))[:size] if size >= 8 else _small(sent, size)
    flags, checksum = int(one.acknowledged), 0
    if checksums:
        flags, checksum = flags | 2, checksums[sub % len(checksums)]
    counter = sent.counter & 0xFFFF
    if one.swapped:
        counter = (counter & 0xFF) << 8 | counter >> 8
    if one.wide:
        flags, checksum = (sent.counter >> 16) & 0xFF, (sent.counter >> 24) & 0xFF
    head = _head(0, one.id, sub, items[sub], one.header + size, counter, flags, checksum)
    return head[: one.header] + data


def _small(sent: Sent, size: int) -> bytes:
    return (sent.ts_ns // 1000 * 2654435761 & 0xFFFFFFFFFFFFFFFF).to_bytes(8, "big")[:size]


def data_frame(sent: Sent) -> bytes:
    return _telegram_frame(sent.list.node, sent.list, payload(sent), sent)


def _telegram_frame(node: Node, one: List, content: bytes, sent: Sent | None = None) -> bytes:
    to = one.to if sent is not None or group_mac(one.to) else one.node.ip
    mac = group_mac(to) or _mac_of(one, to)
    source_port = 1202 if node.controller else 49_152 + (sent.ts_ns // 1000 if sent else 0) % 16_000
    return datagram(sent.port if sent else node.port, mac, to, content, source_port=source_port, to_port=one.port)


def _mac_of(one: List, ip: str) -> bytes:
    return next((node.port.mac for node in [one.node, *one.readers] if node.ip == ip), b"\x02\0\0\0\0\x01")


def _answers(plant: Plant, sents: list[Sent]) -> list[Seen]:
    """Return acknowledgements, and what says that nobody waits."""
    chance, rows = plant.chance, []
    for sent in sents:
        one = sent.list
        if sent.gone or not one.readers:
            continue
        mode = next((how for since, until, how in one.silent_readers if since <= sent.ts_ns < until), None)
        if mode is None and one.unanswered and one.unanswered_from_ns <= sent.ts_ns < one.unanswered_until_ns:
            mode = "nothing" if _skips(plant, one, sent) else None
        for reader in one.readers:
            at_ns = sent.ts_ns + int(one.latency_ns * chance.uniform(0.7, 1.5))
            if not reader.is_up(at_ns) or mode == "nothing":
                continue
            if mode == "icmp":
                data = unreachable(reader.port, one.node.port.mac, one.node.ip, data_frame(sent), reader.port.vlan)
                rows.append(Seen(at_ns, data, reader, None))
            elif one.acknowledged or mode == "reject":
                flags = 4 if mode == "reject" else 0
                content = _head(5, one.id, sent.subindex, 0, 20, sent.counter, flags, 0)
                data = datagram(reader.port, one.node.port.mac, one.node.ip, content, to_port=one.port)
                rows.append(Seen(at_ns, data, reader, None))
    return rows


def _skips(plant: Plant, one: List, sent: Sent) -> bool:
    """Tell whether one of few telegrams stays unanswered, never three in a row."""
    row = one.unanswered_in_row.get(sent.subindex, 0)
    skips = row < 1 and plant.chance.random() < one.unanswered
    one.unanswered_in_row[sent.subindex] = row + 1 if skips else 0
    if skips:
        one.unanswered_ns.append(sent.ts_ns)
    return skips


def _check_singles(plant: Plant) -> None:
    """Let what goes unanswered now and then begin with the first one, and be seen to go on at the end."""
    for one in plant.lists:
        if one.single_fault is not None:
            times = one.unanswered_ns
            usual_ns = max((times[-1] - times[0]) // (len(times) - 1), one.interval_ns) if len(times) > 2 else 0
            if plant.end_ns - times[-1] > usual_ns if times else True:
                raise UnclearError
            one.single_fault.since_ns = times[0]
